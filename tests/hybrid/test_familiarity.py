"""Outside of what it was learned from a correction fades to none, and what it may be comes back as variance."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.linear_model import Ridge

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel
from tripwatt.hybrid import SegmentTable, power_corrector, segment_trips
from tripwatt.hybrid.familiarity import FADING, Familiarity, Range
from tripwatt.hybrid.outside import outside_corrector
from tripwatt.hybrid.power import PowerCorrector
from tripwatt.hybrid.stored import new_converter, parts_tree, structured, tree_parts
from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
from tripwatt.trips import Departure, Plan
from tripwatt.vehicles import load_vehicle

AMBIENT = "ambient_temperature_degc"
CAR = load_vehicle(VEHICLE)
TRIPS = synthetic_fleet(14).trips
TABLE = segment_trips(TRIPS, CAR)
SEEN = Range.from_values(TABLE.features[AMBIENT])
NAMES = ("linear", "gp", "boosting", "gamm")


@cache
def fitted(name: str) -> PowerCorrector:
    return power_corrector(name).fit(TABLE)


def at(degc: float, trip: int = 0) -> SegmentTable:
    """The segments of a trip in other air; everything else is as it was."""
    own = TABLE.take([trip])
    return replace(own, features=own.features.assign(**{AMBIENT: degc}))


def energies(name: str, table: SegmentTable) -> tuple[float, float]:
    """Correction of a trip and the standard deviation of what is not known of it [Wh]."""
    corrector = fitted(name)
    mean, factor = corrector.predict_with_uncertainty(table)
    whole = np.hstack([factor, corrector.outside_factor(table)])
    return float(table.hours @ mean), float(np.linalg.norm(table.hours @ whole))


@pytest.mark.parametrize("name", NAMES)
def test_far_outside_nothing_of_a_correction_is_left(name) -> None:
    inside = abs(energies(name, at(SEEN.high))[0])
    assert inside > 1.0
    for far in (SEEN.low - 8.0 * SEEN.sd, SEEN.high + 8.0 * SEEN.sd):
        assert abs(energies(name, at(far))[0]) < 1e-6 * inside


@pytest.mark.parametrize("name", ["linear", "gp"])
def test_its_uncertainty_grows_from_what_was_learned_to_the_prior(name) -> None:
    sds = [energies(name, at(SEEN.high + k * SEEN.sd))[1] for k in (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)]
    assert (np.diff(sds) > -1e-9).all()
    far = at(SEEN.high + 8.0 * SEEN.sd)
    model = fitted(name).model
    prior = np.linalg.norm(far.hours @ model.prior_factor(model.features(far.features)))
    assert sds[-1] == pytest.approx(prior, rel=0.01)
    assert sds[-1] > sds[0]


@pytest.mark.parametrize("name", NAMES)
@given(share=st.floats(0.0, 1.0), trip=st.integers(0, len(TRIPS) - 1))
def test_inside_the_range_it_counts_in_full(name, share, trip) -> None:
    table = at(SEEN.low + share * (SEEN.high - SEEN.low), trip)
    assert fitted(name).familiarity.share(table.features).tolist() == [1.0] * len(table.hours)


@given(a=st.floats(-60.0, 60.0), b=st.floats(-60.0, 60.0))
def test_it_fades_without_a_step_and_never_comes_back(a, b) -> None:
    """The slope of exp(-d²/2) is at most exp(-1/2); further out less counts."""
    seen = Familiarity({AMBIENT: Range(-5.0, 20.0, 6.0)})
    one, other = seen.share(pd.DataFrame({AMBIENT: [a, b]}))
    assert abs(one - other) <= np.exp(-0.5) * abs(a - b) / 6.0 + 1e-12
    if b >= a >= 20.0 or b <= a <= -5.0:
        assert other <= one


def test_each_covariate_takes_its_part_and_an_unknown_one_none() -> None:
    seen = Familiarity({AMBIENT: Range(0.0, 20.0, 5.0), "speed_m_s": Range(0.0, 30.0, 10.0)})
    rows = pd.DataFrame({AMBIENT: [25.0, 25.0, np.nan, 10.0], "speed_m_s": [40.0, 10.0, 40.0, np.nan]})
    share = seen.share(rows)
    assert share.tolist() == pytest.approx([np.exp(-1.0), np.exp(-0.5), np.exp(-0.5), 1.0])
    assert share[0] == pytest.approx(share[1] * share[2])
    longer = TABLE.features.assign(time_s=90_000.0)
    for corrector in map(fitted, NAMES):
        assert set(corrector.familiarity.ranges) <= set(FADING)
        np.testing.assert_array_equal(corrector.familiarity.share(longer), 1.0)


class MeanPower:
    """A corrector from outside on a table of segments, without an uncertainty of its own."""

    def fit(self, table):
        self.mean_w = float(np.average(table.residual_w, weights=table.hours))

    def predict(self, table):
        return np.full(len(table.hours), self.mean_w)


@pytest.mark.parametrize("corrector", ["boosting", "forest", "gamm", Ridge(), MeanPower()])
def test_a_corrector_without_a_prior_is_as_uncertain_far_outside_as_the_simulation_was(corrector) -> None:
    made = fitted(corrector) if isinstance(corrector, str) else outside_corrector(corrector, 0).fit(TABLE)
    mean_w = TABLE.totals_wh(TABLE.residual_w) / TABLE.totals_wh(np.ones(len(TABLE.hours)))
    for distance, share in ((0.0, 0.0), (1.0, np.sqrt(1.0 - np.exp(-1.0))), (8.0, 1.0)):
        table = at(SEEN.high + distance * SEEN.sd)
        sd_wh = np.linalg.norm(table.hours @ made.outside_factor(table))
        lost_wh = np.sqrt(np.mean(mean_w**2)) * table.hours.sum()
        assert sd_wh == pytest.approx(share * lost_wh, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("corrector", ["linear", "boosting"])
def test_a_forecast_far_outside_is_that_of_the_physics_and_wider(corrector) -> None:
    warm = sorted(TRIPS, key=lambda trip: trip.departure.ambient_temperature_degc)[-9:]
    model = ForecastModel(CAR, corrector=corrector).fit(warm)
    seen = model.ranges_[AMBIENT]
    assert seen.low - 8.0 * seen.sd > -60.0
    plan = Plan.from_trip(warm[0])
    usual = model.forecast(plan, Departure(ambient_temperature_degc=seen.low))
    far = model.forecast(plan, Departure(ambient_temperature_degc=seen.low - 8.0 * seen.sd))
    own = far.drive.table
    simulated = float(own.hours @ own.simulated_w)
    assert far.energy_wh == pytest.approx(simulated, rel=1e-6)
    assert far.sd_wh > usual.sd_wh
    assert any(flag.code == "outside_training" for flag in far.flags)


@pytest.mark.parametrize("name", ["linear", "gp", "boosting"])
def test_a_stored_correction_fades_as_the_fitted_one(name) -> None:
    converter = new_converter()
    values = parts_tree(tree_parts(converter.unstructure(fitted(name), PowerCorrector)))
    again = structured(values, PowerCorrector, converter, "a corrector")
    for degc in (SEEN.low, SEEN.high + SEEN.sd, SEEN.high + 3.0 * SEEN.sd):
        np.testing.assert_array_equal(again.predict(at(degc)), fitted(name).predict(at(degc)))
        np.testing.assert_array_equal(again.outside_factor(at(degc)), fitted(name).outside_factor(at(degc)))


@pytest.mark.parametrize("values", [[0.0, 1.0, 0.0], [0.0, float("nan"), 1.0], [float("-inf"), 1.0, 1.0]])
def test_a_stored_range_that_is_none_is_refused(values) -> None:
    with pytest.raises(InvalidInput, match="no range"):
        Familiarity({AMBIENT: Range(*values)})
