"""The factors of a car: their powers by hand, what trips show of them, and a correction by them."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from math import exp

import numpy as np
import pandas as pd
import pytest
from tests.hybrid.tables import EXACT, NO, table
from tests.support.refusals import refusal

from tripwatt.errors import InvalidInput
from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.factors import (
    CLIMATE,
    FACTORS,
    NAMES,
    SDS,
    SEASONS,
    UNITS,
    FactorCorrector,
    TripEvidence,
    factor_power,
    usual_variance_wh2,
)
from tripwatt.hybrid.groups import Sums
from tripwatt.hybrid.segments import LINE_CAUSES, EnergyErrors
from tripwatt.population.prior import Population
from tripwatt.uncertainty.process import process_segments
from tripwatt.vehicles import Vehicle, load_vehicle

I3 = load_vehicle("bmw_i3_60ah")
BY_CAUSE = {
    "air_w": 4000.0,
    "rolling_w": 3000.0,
    "climb_w": 1000.0,
    "acceleration_w": -800.0,
    "friction_brakes_w": 0.0,
    "drivetrain_w": 1500.0,
    "base_load_w": 300.0,
    "climate_w": 1000.0,
}
"""Power of a segment by cause [W]; 10 kW together."""


def segments(rows: list[int], hours: list[float], **columns: object) -> SegmentTable:
    """Segments that are alike but for some columns."""
    made = table(rows, hours, simulated=np.full(sum(rows), 10_000.0))
    known = {
        **BY_CAUSE,
        "moved_w": 8000.0,
        "speed_m_s": 15.0,
        "speed_change_m_s2": 0.4,
        "time_s": 600.0,
        "ambient_temperature_degc": 10.0,
        "day": NO,
    }
    features = pd.DataFrame({name: np.broadcast_to(v, sum(rows)) for name, v in (known | columns).items()})
    return replace(made, features=features.astype(float))


def test_the_causes_of_the_rows_are_all_that_are_simulated() -> None:
    assert set(BY_CAUSE) == {f"{cause}_w" for cause in LINE_CAUSES}
    assert sum(BY_CAUSE.values()) == 10_000.0


def test_every_factor_has_a_name_a_unit_and_a_source() -> None:
    assert len({*NAMES}) == len(FACTORS) == len(SDS)
    assert {*UNITS.values()} == {"1", "kW"}
    assert NAMES[0] == "everything"
    assert {*CLIMATE} < {*NAMES}
    assert all(factor.source and factor.sd > 0.0 for factor in FACTORS)


def test_powers_of_two_segments_are_those_by_hand() -> None:
    """One at -10 °C ten minutes after departure, and one at 19 °C at departure."""
    own = segments([2], [0.1, 0.1], ambient_temperature_degc=[-10.0, 19.0], time_s=[600.0, 0.0])
    found = dict(zip(NAMES, factor_power(own, 1500.0).T, strict=True))
    sd = dict(zip(NAMES, SDS, strict=True))
    by_hand = {
        "everything": [9000.0, 9000.0],
        "climb": [1000.0, 1000.0],
        "rolling": [3000.0, 3000.0],
        "air": [4000.0, 4000.0],
        "drivetrain": [1500.0, 1500.0],
        "base_load": [300.0, 300.0],
        "heating": [1000.0 / (1.0 + exp(-29.0 / 1.5)), 500.0],
        "mild_heating": [0.0, 500.0],
        "cooling": [1000.0 / (1.0 + exp(29.0 / 1.5)), 500.0],
        "cold": [8000.0 * 2.5, 0.0],
        "transients": [1500.0 * 0.4 * 15.0] * 2,
        "frost": [1000.0, 0.0],
        "warm_up": [50.0 * 30.0 * exp(-1.0), 50.0],
    }
    for name, power in by_hand.items():
        assert found[name] == pytest.approx(sd[name] * np.array(power), **EXACT), name
    # the seasons share the power without the climb, in squares
    seasons = np.array([found[name] / sd[name] for name in SEASONS])
    assert np.linalg.norm(seasons, axis=0) == pytest.approx([9000.0, 9000.0])
    # what a unit of a factor is: a share of the simulated power, or a kilowatt
    assert found["everything"] / sd["everything"] == pytest.approx(own.simulated_w - 1000.0)
    assert found["frost"][0] / sd["frost"] == pytest.approx(1000.0), "1 kW at 10 K below freezing"
    assert found["heating"] + found["cooling"] == pytest.approx(sd["heating"] * 1000.0)


def test_unknown_outside_air_counts_as_fifteen_degrees() -> None:
    unknown = segments([2], [0.1, 0.1], ambient_temperature_degc=[NO, NO], time_s=[0.0, 300.0])
    mild = segments([2], [0.1, 0.1], ambient_temperature_degc=[15.0, 15.0], time_s=[0.0, 300.0])
    found = factor_power(unknown, 1500.0)
    assert np.isfinite(found).all()
    assert found.tolist() == factor_power(mild, 1500.0).tolist()


def test_no_outside_air_makes_a_factor_infinite() -> None:
    far = segments([2], [0.1, 0.1], ambient_temperature_degc=[-60.0, 60.0])
    found = factor_power(far, 1500.0)
    assert np.isfinite(found).all()
    assert found[1, NAMES.index("heating")] == pytest.approx(0.0, abs=1e-6)
    assert found[0, NAMES.index("cooling")] == pytest.approx(0.0, abs=1e-6)


def with_energies(own: SegmentTable, residual_wh: list[float]) -> SegmentTable:
    """Trips that took more than simulated, evenly."""
    hours = own.totals_wh(np.ones(len(own.hours)))
    return replace(own, observed_w=own.simulated_w + (np.array(residual_wh) / hours)[own.groups])


def test_evidence_of_trips_is_their_energy_by_factor() -> None:
    own = with_energies(segments([2, 1], [0.1, 0.2, 0.5], day=[3.0, 3.0, NO]), [120.0, -40.0])
    own = replace(
        own,
        errors=EnergyErrors(np.array([0.0, 30.0]), np.zeros(2), np.ones(2, dtype=bool)),
        charge=np.array([[0.9, 0.8, NO, NO], [NO] * 4]),
    )
    found = TripEvidence.from_table(own, I3)
    rows = factor_power(own, I3.body.test_mass_kg)
    assert found.factors_wh[0] == pytest.approx(0.1 * rows[0] + 0.2 * rows[1], **EXACT)
    assert found.factors_wh[1] == pytest.approx(0.5 * rows[2], **EXACT)
    assert found.residual_wh == pytest.approx([120.0, -40.0])
    assert found.observed_wh == pytest.approx([3120.0, 4960.0])
    assert found.measured_wh2 == pytest.approx([0.0, 900.0], abs=1e-6)
    # 40 Wh, 4.2 % of the 3 and 5 kWh without a tenth for the climb, and 33 % of them over a kilometre
    km = own.totals_wh(3.6 * own.features["speed_m_s"].to_numpy())
    share = np.array([0.042**2 + 0.33**2 / one for one in km])
    assert found.usual_wh2 == pytest.approx(40.0**2 + np.array([2700.0, 4500.0]) ** 2 * share, rel=1e-12)
    assert found.day[0] == 3.0
    assert np.isnan(found.day[1])
    assert found.charge[0, :2].tolist() == [0.9, 0.8]
    unmeasured = TripEvidence.from_table(replace(own, observed_w=None, charge=None, errors=None), I3)
    assert np.isnan(unmeasured.residual_wh).all()
    assert np.isnan(unmeasured.charge).all()
    assert unmeasured.charge.shape == (2, 4)
    assert unmeasured.measured_wh2 == pytest.approx([0.0, 0.0], abs=1e-6)


def test_what_the_car_could_not_follow_is_a_variance_of_the_trip() -> None:
    """A kilowatt over a fifth of an hour that no cause explains."""
    own = with_energies(segments([2], [0.1, 0.1]), [0.0])
    short = replace(own, simulated_w=own.simulated_w + 1000.0, observed_w=own.observed_power_w + 1000.0)
    found = [TripEvidence.from_table(one, I3) for one in (own, short)]
    assert found[0].measured_wh2 == pytest.approx([0.0], abs=1e-6)
    assert found[1].measured_wh2 == pytest.approx([200.0**2])
    corrector = known_car(I3, {})
    factors = [corrector.predict_with_uncertainty(one)[1] for one in (own, short)]
    energy_sd = [np.sqrt(((one.T @ own.hours) ** 2).sum()) for one in factors]
    assert energy_sd[1] ** 2 - energy_sd[0] ** 2 == pytest.approx(200.0**2, rel=0.5)
    assert energy_sd[1] > 200.0


def trips(residual_wh: list[float]) -> TripEvidence:
    """Trips of a car in all weathers."""
    rng = np.random.default_rng(0)
    n = len(residual_wh)
    own = segments(
        [1] * n,
        rng.uniform(0.2, 0.6, n).tolist(),
        ambient_temperature_degc=rng.uniform(-10.0, 30.0, n),
        climate_w=rng.uniform(0.0, 2000.0, n),
        rolling_w=rng.uniform(2000.0, 4000.0, n),
    )
    causes = own.features[list(BY_CAUSE)].sum(axis=1).to_numpy()
    return TripEvidence.from_table(with_energies(replace(own, simulated_w=causes), residual_wh), I3)


def test_trips_are_taken_and_put_side_by_side() -> None:
    own = trips([10.0, 20.0, 30.0])
    some = own.take([2, 0])
    assert some.trip_ids == ("t2", "t0")
    assert len(some) == 2
    assert some.residual_wh == pytest.approx([30.0, 10.0])
    both = some + own.take([1])
    assert both.trip_ids == ("t2", "t0", "t1")
    for field in fields(TripEvidence)[1:]:
        assert np.array_equal(
            getattr(both, field.name), getattr(own, field.name)[[2, 0, 1]], equal_nan=True
        ), field.name
    none = TripEvidence.empty()
    assert len(none) == 0
    assert (none + own).trip_ids == (own + none).trip_ids == own.trip_ids
    assert (none + own).factors_wh.tolist() == own.factors_wh.tolist()
    assert len(own.take([])) == 0
    assert len(none.sums("m", "v").groups) == 0


def noisy(n: int, scale: float, seed: int = 1) -> TripEvidence:
    """Trips of a car that takes 10 % more, with errors of some usual sizes."""
    blank = trips([0.0] * n)
    error = scale * np.sqrt(blank.usual_wh2) * np.random.default_rng(seed).normal(size=n)
    return replace(blank, residual_wh=0.1 * blank.observed_wh + error)


def means(sums: Sums) -> np.ndarray:
    """Factors of the one group of some sums, each with its usual spread."""
    assert sums.groups == (("m", "v"),)
    return np.linalg.solve(sums.xx[0] + np.eye(len(NAMES)), sums.xy[0])


def test_a_trip_that_stands_out_counts_less_in_the_sums() -> None:
    own = noisy(30, 0.5)
    doubled = own.residual_wh.copy()
    doubled[7] += own.observed_wh[7]
    wrong = replace(own, residual_wh=doubled)
    plain = [
        Sums.from_trips([("m", "v")] * 30, one.factors_wh, one.residual_wh, one.usual_wh2)
        for one in (own, wrong)
    ]
    robust = [one.sums("m", "v") for one in (own, wrong)]
    assert robust[0].count.tolist() == [30.0]
    moved = [np.linalg.norm(means(b) - means(a)) for a, b in (plain, robust)]
    assert moved[1] < 0.34 * moved[0]
    # its weight: what it adds to the information, over what it adds to that of usual variances
    without = [one.take(np.delete(np.arange(30), 7)).sums("m", "v") for one in (own, wrong)]
    added = [np.trace(b.xx[0] - a.xx[0]) for a, b in zip(without, robust, strict=True)]
    assert added[1] < 0.2 * added[0]


def test_errors_of_a_car_that_are_larger_than_usual_make_its_trips_count_less() -> None:
    calm, wild = (noisy(60, scale).sums("m", "v") for scale in (0.5, 3.0))
    information = np.trace(calm.xx[0]) / np.trace(wild.xx[0])
    assert 0.4 * 36.0 < information < 2.5 * 36.0, "six times the error, a thirty-sixth of the information"


def test_inaccurate_energies_count_less_in_the_sums() -> None:
    """A measurement with fifteen times the variance of the usual error leaves much less of the information."""
    exact = noisy(60, 1.0)
    variance = 15.0 * exact.usual_wh2
    error = np.sqrt(variance) * np.random.default_rng(2).normal(size=60)
    vague = replace(exact, residual_wh=exact.residual_wh + error, measured_wh2=variance)
    known, unsure = (np.trace(one.sums("m", "v").xx[0]) for one in (exact, vague))
    assert known / unsure > 16.0 / 2.5


def known_car(vehicle: Vehicle, changes: dict[str, float]) -> FactorCorrector:
    """The correction of a car without trips, with some changes in the units of the factors."""
    corrector = Population(Sums.empty(len(NAMES))).experts(vehicle).corrector(vehicle)
    mean = np.zeros_like(corrector.mean)
    for name, change in changes.items():
        mean[NAMES.index(name)] = change / SDS[NAMES.index(name)]
    return replace(corrector, mean=mean)


def test_changes_are_in_the_unit_of_each_factor() -> None:
    corrector = known_car(I3, {"everything": 0.05, "base_load": -0.2, "frost": 0.4, "cold": 0.01})
    assert list(corrector.changes) == list(NAMES)
    expected = {"everything": 0.05, "base_load": -0.2, "frost": 0.4, "cold": 0.01}
    variances = (corrector.factor @ corrector.factor.T).diagonal()
    for i, name in enumerate(NAMES):
        change, sd = corrector.changes[name]
        assert change == pytest.approx(expected.get(name, 0.0), **EXACT)
        assert sd == pytest.approx(SDS[i] * np.sqrt(variances[i]), rel=1e-9)
    own = segments([1], [0.5], ambient_temperature_degc=-10.0)
    # 5 % of the 9 kW without the climb, a fifth of 300 W, 0.4 kW at 10 K below freezing, 1 % of 8 kW for each of 2.5 steps of 10 K
    assert corrector.predict(own) == pytest.approx([450.0 - 60.0 + 400.0 + 200.0], **EXACT)


def test_a_correction_is_linear_and_knows_how_sure_it_is() -> None:
    corrector = known_car(I3, {"rolling": 0.1, "heating": -0.3})
    own = segments([2], [0.1, 0.1], ambient_temperature_degc=[-10.0, 25.0])
    power, factor = corrector.predict_with_uncertainty(own)
    assert power.tolist() == corrector.predict(own).tolist()
    assert corrector.mass_kg == I3.body.test_mass_kg
    rows = factor_power(own, I3.body.test_mass_kg)
    assert power == pytest.approx(rows @ corrector.mean[: len(NAMES)], **EXACT)
    covariance = (corrector.factor @ corrector.factor.T)[: len(NAMES), : len(NAMES)]
    assert (np.diag(factor @ factor.T) >= np.diag(rows @ covariance @ rows.T) * (1.0 - 1e-9)).all()


def test_the_climate_s_part_is_heating_and_cooling_and_zero_without_climate_control() -> None:
    corrector = known_car(I3, {"everything": 0.1, "heating": -0.3, "cooling": 0.2, "frost": 0.4})
    own = segments([2], [0.1, 0.1], ambient_temperature_degc=[-10.0, 40.0])
    assert corrector.predict_climate(own) == pytest.approx([-300.0, 200.0], rel=1e-4)
    bare = replace(own, features=own.features.assign(climate_w=0.0))
    assert corrector.predict_climate(bare).tolist() == [0.0, 0.0]
    assert (corrector.predict(bare) != 0.0).all()


def test_a_drift_is_that_of_its_day_and_is_forgotten_long_after() -> None:
    """A car that took 6 % more on the last day: the day after nearly so, ten years later as unknown as ever."""
    known = replace(known_car(I3, {}), day=20_000.0)
    known = replace(known, mean=np.append(known.mean[:-1], 0.06 / SDS[0]), factor=np.zeros_like(known.factor))
    days = (20_000.0, 20_060.0, 23_650.0, NO)
    power, sd = [], []
    for day in days:
        mean, factor = known.predict_with_uncertainty(segments([1], [0.5], day=day))
        power.append(float(mean[0]))
        sd.append(float(np.sqrt((factor**2).sum())))
    kept = [1.0, exp(-1.0), 0.0, exp(-1.0 / 60.0)]
    assert power == pytest.approx([540.0 * share for share in kept], rel=1e-9, abs=1e-9)
    full = 9000.0 * SDS[0] * known.drift_sd
    assert sd == pytest.approx([full * (1.0 - share**2) ** 0.5 for share in kept], rel=1e-6, abs=1e-6)
    assert known.changes["everything"][0] == 0.0, "the drift is no property of the car"


def test_a_correction_by_factors_is_not_fitted() -> None:
    corrector, own = known_car(I3, {}), with_energies(segments([1], [0.5]), [10.0])
    for fitting in (lambda: corrector.fit(own), corrector.clone_tuned):
        with pytest.raises(InvalidInput, match="corrector cannot be fitted") as caught:
            fitting()
        assert caught.value.faults[0].fix == "adapt the base again"
    older = refusal(FactorCorrector, 1500.0, np.zeros(4), np.zeros((4, 4)), None, 0.0)
    allowed = f"got 3 factors; allowed: {len(NAMES)} factors; adapt the base again"
    assert older == f"model of an older version: model.json, corrector: {allowed}"


def test_the_usual_error_stays_at_a_share_of_a_long_trip_and_never_vanishes() -> None:
    def usual(net: float, moved: float, km: float) -> float:
        return float(usual_variance_wh2(np.array([net]), np.array([moved]), np.array([km]))[0] ** 0.5)

    assert usual(300_000.0, 400_000.0, 2000.0) == pytest.approx(0.042 * 300_000.0, rel=0.02)
    halves = math.hypot(usual(15_000.0, 20_000.0, 100.0), usual(15_000.0, 20_000.0, 100.0))
    assert halves < usual(30_000.0, 40_000.0, 200.0) < 2.0 * usual(15_000.0, 20_000.0, 100.0)
    # all of a descent is recovered: three tenths of what is moved count
    assert usual(0.0, 10_000.0, 10.0) == usual(3000.0, 10_000.0, 10.0) == usual(-3000.0, 10_000.0, 10.0)
    assert np.isfinite(usual(0.0, 0.0, 0.0))


def test_wind_and_traffic_do_not_change_the_energy_of_a_climb() -> None:
    level = segments([1], [0.5])
    climb_w = level.columns["climb_w"] + 4000.0
    steep = replace(
        level, simulated_w=level.simulated_w + 4000.0, features=level.features.assign(climb_w=climb_w)
    )
    usual = [TripEvidence.from_table(table, I3).usual_wh2[0] for table in (level, steep)]
    assert usual[0] == pytest.approx(usual[1], rel=1e-12)
    assert process_segments(level, np.zeros(1)).net_wh == pytest.approx(
        process_segments(steep, np.zeros(1)).net_wh
    )
