"""The inner folds of a fit: what a training trip would have been forecast as, had the model never seen it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.hybrid.test_identification import as_logged

from tripwatt.forecasting.fitting import fit_car
from tripwatt.forecasting.inner import INNER_FOLDS, inner_fits, inner_folds
from tripwatt.hybrid import power_corrector, segment_trips
from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
from tripwatt.vehicles import load_vehicle

BOOK = load_vehicle(VEHICLE)
TRUTH = load_vehicle(VEHICLE, overrides={"auxiliaries.base_load_w": 420.0, "body.curb_mass_kg": 1400.0})
LOGS = [as_logged(trip, TRUTH) for trip in synthetic_fleet(12).trips]


def other_log(trip):
    """The same drive and departure with another torque, heater and energy."""
    samples = trip.samples.assign(
        motor_torque_nm=1.3 * trip.samples["motor_torque_nm"] + 3.0,
        heating_power_w=trip.samples["heating_power_w"] + 700.0,
        current_a=1.6 * trip.samples["current_a"] + 5.0,
    )
    # what is known at departure stays as it was
    samples.loc[0, ["heating_power_w", "current_a"]] = trip.samples.loc[0, ["heating_power_w", "current_a"]]
    return replace(trip, samples=samples)


def test_what_a_trip_measured_does_not_reach_its_own_held_out_forecast() -> None:
    k = 5
    before, _ = fit_car(LOGS, BOOK)
    after, _ = fit_car([*LOGS[:k], other_log(LOGS[k]), *LOGS[k + 1 :]], BOOK)
    assert after.vehicle.road_load != before.vehicle.road_load
    changed = abs(after.held_out_[k].observed_wh / before.held_out_[k].observed_wh - 1.0)
    assert changed > 0.2
    assert after.held_out_[k].predicted_wh == pytest.approx(before.held_out_[k].predicted_wh, rel=1e-9)
    others = [
        abs(a.predicted_wh / b.predicted_wh - 1.0)
        for i, (a, b) in enumerate(zip(after.held_out_, before.held_out_, strict=True))
        if i != k
    ]
    assert max(others) > 1e-6, "the others learn from it"


def test_every_trip_is_held_out_once_and_those_that_log_climate_control_are_spread() -> None:
    table = segment_trips(LOGS, BOOK)
    climate = np.array(table.observed_climate_w)
    climate[table.groups >= 7] = np.nan
    table = replace(table, observed_climate_w=climate)
    folds = inner_folds(table, seed=3)
    assert np.bincount(folds).tolist() == [2, 2] + [1] * 8
    assert np.bincount(folds[:7], minlength=INNER_FOLDS).max() == 1
    fits = list(inner_fits("linear", 0, power_corrector("linear").fit(table), table))
    held = np.concatenate([fit.members for fit in fits])
    assert sorted(held.tolist()) == list(range(len(LOGS)))


def test_a_fold_asks_for_the_car_without_its_trips_and_for_settings_without_its_third() -> None:
    table = segment_trips(LOGS, BOOK)
    asked: list[list[int]] = []
    fitted_on: list[int] = []

    class Spy:
        def fit(self, own):
            fitted_on.append(len(own))
            return self

        def clone_tuned(self):
            return self

    def again(several):
        asked.extend(members.tolist() for members in several)
        return [table] * len(several)

    for fold, fit in enumerate(inner_fits("linear", 0, Spy(), table, again)):
        assert sorted([*asked[fold], *fit.members.tolist()]) == list(range(len(LOGS)))
    assert len(asked) == INNER_FOLDS
    assert fitted_on == [len(members) for members in asked]
    asked.clear()
    tuned = list(inner_fits("ensemble", 0, SimpleNamespace(), table, again))
    assert len(tuned) == INNER_FOLDS
    assert len(asked) == INNER_FOLDS + 3
    searches = [members for members in asked if len(members) <= len(LOGS) - 3]
    assert len(searches) == 3
    for fit in tuned:
        assert any(not set(fit.members.tolist()) & set(members) for members in searches)
