"""Parts of the uncertainty model against values that are found another way."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm
from scipy.stats import t as student
from tests.forecasting import test_forecast as by_hand

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel
from tripwatt.forecasting.measured import _from_power
from tripwatt.forecasting.ranges import Range, unknown_state_sd_wh
from tripwatt.synthetic import synthetic_fleet
from tripwatt.uncertainty.charge import CAPACITY_SD, NORMAL_SCALE, ChargeScale
from tripwatt.uncertainty.charge import FULL as FULL_DISPLAY
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.process import HeldOutResidual, Segments
from tripwatt.uncertainty.route import RouteUncertainty
from tripwatt.uncertainty.scale import TimeCourse, TotalScale
from tripwatt.uncertainty.shrinkage import FRACTIONS, SURE, UpdateShrinkage, _best_share, _rests, is_off
from tripwatt.vehicles import load_vehicle


def test_the_scale_is_the_mode_of_t_distributed_errors():
    rng = np.random.default_rng(2)
    trips = [
        Segments(np.arange(n) * 60.0, np.full(n, 60.0), rng.uniform(2e3, 9e3, n), np.zeros(n), 20.0 + n)
        for n in rng.integers(5, 60, 40)
    ]
    errors = rng.standard_t(4, 40) * np.array([40.0 + 3.0 * len(trip) for trip in trips])
    sizes = np.array(
        [[1.0, t.hours.sum(), t.moved_w @ t.hours, t.corrector_sd_wh] for t in trips]
    ) * np.array([100.0, 200.0, 0.03, 1.0])

    def cost(logs: np.ndarray) -> float:
        sd = np.sqrt((sizes**2 * np.exp(2.0 * logs)).sum(axis=1))
        return float(-student.logpdf(errors, 4, scale=sd).sum() + 0.5 * np.sum((logs / 2.0) ** 2))

    best = minimize(cost, np.zeros(4), method="L-BFGS-B", bounds=[(-6.0, 6.0)] * 4)
    found = TotalScale.from_errors(trips, errors)
    np.testing.assert_allclose(
        found.values, np.array([100.0, 200.0, 0.03, 1.0]) * np.exp(best.x), rtol=0.02, atol=1e-6
    )


def test_scores_by_rank():
    scores = ConformalScores.from_errors([3.0, -1.0, 2.0])
    # the k-th of three covers k / 4 of new trips
    assert [scores.factor(level) for level in (0.0, 0.125, 0.25, 0.5, 0.75)] == [0.0, 0.5, 1.0, 2.0, 3.0]
    top = student.ppf(0.875, 4)
    for level in (0.8, 0.9, 0.99):
        assert scores.factor(level) == pytest.approx(3.0 * student.ppf(0.5 + level / 2, 4) / top, rel=1e-9)
    for size, chance in ((0.0, 0.5), (1.5, 0.6875), (3.0, 0.875), (-2.0, 0.25)):
        assert scores.probability(size) == pytest.approx(chance, rel=1e-12)
    assert scores.probability(6.0) == pytest.approx(student.cdf(2.0 * top, 4), rel=1e-9)
    assert scores.probability(-6.0) == pytest.approx(1.0 - student.cdf(2.0 * top, 4), rel=1e-9)


def test_scores_of_zero_are_sure():
    sure = ConformalScores.from_errors([0.0, 0.0])
    assert (sure.probability(1e-9), sure.probability(-1e-9)) == (1.0, 0.0)


def test_the_share_of_an_update_is_the_lower_end_of_a_slope():
    x = np.array([100.0, -50.0, 25.0, 80.0])
    assert _best_share(0.11 * x, x, np.ones(4)) == pytest.approx(0.11)
    assert _best_share(0.09 * x, x, np.ones(4)) == 0.0  # too small to change a forecast
    assert _best_share(1.7 * x, x, np.ones(4)) == 1.0
    assert _best_share(-0.5 * x, x, np.ones(4)) == 0.0
    assert _best_share(x, np.zeros(4), np.ones(4)) == 0.0
    truth, scale = np.array([90.0, -20.0, 40.0, 75.0]), np.array([10.0, 20.0, 10.0, 40.0])
    t, z = truth / scale, x / scale
    slope = (z @ t) / (z @ z)
    error = np.sqrt(np.mean((t - slope * z) ** 2) / (z @ z))
    assert student.ppf(0.95, 1e6) == pytest.approx(SURE, abs=2e-4)
    assert _best_share(truth, x, scale) == pytest.approx(slope - SURE * error, rel=1e-9)


def test_shares_are_interpolated_from_none_at_departure():
    rising = np.array([0.2, 0.4, 0.6, 0.8, 0.9, 1.0])
    ones = np.ones(6)
    shrinkage = UpdateShrinkage(rising, rising / 2, rising / 4, 2 * ones, 3 * ones)
    for fraction, share in ((0.0, 0.0), (0.05, 0.1), (0.1, 0.2), (0.175, 0.3), (0.9, 1.0), (1.0, 1.0)):
        assert shrinkage.at("climate", fraction) == pytest.approx(share)
        assert shrinkage.at("drive", fraction) == pytest.approx(share / 2)
        assert shrinkage.at("joint", fraction) == pytest.approx(share / 4)
    assert shrinkage.sd_factor(True, 0.05) == pytest.approx(1.5)
    assert shrinkage.sd_factor(False, 0.05) == pytest.approx(2.0)


@pytest.mark.parametrize(("stretch", "counts"), [(1.0, True), (1.5, True), (1.51, False), (3.0, False)])
def test_a_segment_that_took_long_is_no_evidence_of_its_power(stretch, counts):
    drive = by_hand.drive()
    ends = drive.edges_s.copy()
    ends[1:] += (stretch - 1.0) * 60.0  # the first segment took longer than planned, the others as planned
    readings = _from_power(
        np.array([60.0, 400.0, 300.0]), by_hand.HOURS.copy(), drive, by_hand.ONE_PROCESS, ends
    )
    assert (0 in readings.seen) is counts
    assert len(readings.power_w) == 2 + counts
    assert readings.power_w[-1] == pytest.approx(300.0 * 20)


def test_the_error_of_the_capacity_is_that_of_ageing():
    """A battery loses 2 to 3 % of its energy a year, and as much for each 10 K below 20 °C."""
    assert 0.02 <= CAPACITY_SD <= 0.05


def test_seven_trips_are_too_few_and_eight_are_enough():
    trips = synthetic_fleet(n_trips=8, seed=1).trips
    car = load_vehicle("bmw_i3_60ah")
    with pytest.raises(InvalidInput, match="too few trips"):
        ForecastModel(car, corrector="linear").fit(trips[:7])
    assert len(ForecastModel(car, corrector="linear").fit(trips).held_out_) == 8


def test_distance_outside_a_range_is_in_standard_deviations():
    seen = Range(10.0, 20.0, 4.0)
    assert [seen.beyond(v) for v in (4.0, 10.0, 15.0, 20.0, 22.0, float("nan"))] == [1.5, 0, 0, 0, 0.5, 0]


def test_differences_of_links_become_variances():
    differences = np.array([[0.01, 0.03, 0.02], [-0.03, 0.01, 0.04], [0.02, np.nan, 0.01]] * 3)
    found = RouteUncertainty.from_differences(differences)
    assert found.trips == 6
    first, second, third = (1e-4 + 9e-4) / 2, (9e-4 + 1e-4) / 2, (4e-4 + 16e-4) / 2
    np.testing.assert_allclose(found.variance, [first, max(first, second), third], rtol=1e-12)
    assert found.share(4000.0) ** 2 == pytest.approx(third)
    assert found.share(2500.0) ** 2 == pytest.approx((second + third) / 2)
    assert found.share(125.0) ** 2 == pytest.approx(first / 2)
    assert RouteUncertainty.from_differences(differences[:6]) is None  # four whole rows


@pytest.mark.parametrize(
    ("unknown", "expected_wh"),
    [
        ((), 0.0),
        (("ambient_temperature_degc",), 8.0 * 70.0 * 0.5 / 0.95),
        (("cabin_setpoint_degc",), 1.5 * 70.0 * 0.5 / 0.95),
        # no more than the heat of 12 kJ/K of air and 90 kJ/K of seats
        (("cabin_temperature_degc",), 6.0 * (102_000.0 / 3600.0) / 0.95),
        (("battery_temperature_degc",), 6.0 * 10.0 * 0.5),
    ],
)
def test_an_unknown_temperature_costs_heat(unknown, expected_wh):
    car = load_vehicle("bmw_i3_60ah")
    assert unknown_state_sd_wh(car, unknown, 0.5) == pytest.approx(expected_wh, rel=1e-9)


def test_unknown_temperatures_are_independent_and_a_heat_pump_saves():
    car, leaf = load_vehicle("bmw_i3_60ah"), load_vehicle("nissan_leaf_24")
    both = ("ambient_temperature_degc", "cabin_setpoint_degc")
    parts = [unknown_state_sd_wh(car, (name,), 0.5) for name in both]
    assert unknown_state_sd_wh(car, both, 0.5) == pytest.approx(np.hypot(*parts))
    climate = leaf.climate
    heat_w_k = climate.shell_w_k + climate.fresh_air_low_w_k
    expected = 8.0 * heat_w_k * 0.5 / climate.heat_pump_cop_at_0_degc
    assert unknown_state_sd_wh(leaf, both[:1], 0.5) == pytest.approx(expected)


def test_charge_is_learned_from_readings():
    energy = np.array([500.0, 1000.0, 2000.0, 3000.0, 800.0, 1500.0, 2500.0, 400.0])
    start = np.array([0.9, 0.8, 0.7, 0.9, 0.6, 0.5, 0.8, 0.4])
    shown = np.column_stack([start, start - energy / 16_000.0])
    exact = ChargeScale.from_readings(np.hstack([0.1 + 0.8 * shown, shown]), energy)
    assert (exact.zero_soc, exact.full_soc) == pytest.approx((0.1, 0.9), rel=1e-9)
    assert exact.wh_per_display == pytest.approx(16_000.0, rel=1e-9)
    assert exact.trips == 8
    # at least a step of the display, as a scale of t-distributed errors with the same central 90 %
    t_scale = NORMAL_SCALE
    assert t_scale == pytest.approx(norm.ppf(0.95) / student.ppf(0.95, 4), abs=1e-4)
    assert exact.displayed_sd == pytest.approx(0.005 / np.sqrt(6.0) * t_scale, rel=1e-9)
    off = np.array([1, -1, 1, -1, -1, 1, -1, 1]) * 0.02
    noisy = ChargeScale.from_readings(
        np.hstack([0.1 + 0.8 * shown, np.column_stack([start, shown[:, 1] + off])]), energy
    )
    per_wh = float(energy @ (start - shown[:, 1] - off)) / float(energy @ energy)
    assert noisy.wh_per_display == pytest.approx(1.0 / per_wh, rel=1e-9)
    error = (start - shown[:, 1] - off) - energy * per_wh
    left = np.sum(error**2 - (0.03 * energy * per_wh) ** 2) / 7
    assert noisy.displayed_sd == pytest.approx(np.sqrt(left) * t_scale, rel=1e-9)
    assert ChargeScale.from_readings(np.hstack([shown, shown])[:7], energy[:7]) is None
    assert ChargeScale.from_readings(np.hstack([shown, shown]), -energy) is None
    alike = np.column_stack([np.full(8, 0.8), 0.8 - energy / 16_000.0])  # no line goes through one charge
    assert ChargeScale.from_readings(np.hstack([alike, alike]), energy) is None


def test_a_full_display_hides_charge():
    energy = np.array([500.0, 1000.0, 2000.0, 3000.0, 800.0, 1500.0, 2500.0, 400.0, 700.0, 1800.0])
    full = np.arange(10) < 5
    start = np.where(full, 1.0, 0.7)
    end = start + 0.02 * full - energy / 16_000.0
    soc = 0.1 + 0.8 * np.column_stack([start + 0.02 * full, end])
    found = ChargeScale.from_readings(np.hstack([soc, np.column_stack([start, end])]), energy)
    assert found.hidden == pytest.approx(0.02, rel=1e-9)
    assert found.wh_per_display == pytest.approx(16_000.0, rel=1e-9)
    few = ChargeScale.from_readings(np.hstack([soc, np.column_stack([start, end])])[:9], energy[:9])
    assert few.hidden == 0.0  # four trips of the other kind are too few
    assert found.left(1.0, 4000.0) == pytest.approx(0.77)
    assert found.left(FULL_DISPLAY, 4000.0) == pytest.approx(FULL_DISPLAY + 0.02 - 0.25)
    assert found.left(0.985, 4000.0) == pytest.approx(0.735)
    assert found.left(0.99, 4000.0) == pytest.approx(0.75)  # half of the way from 98.5 to 99.5 %
    # what is computed from the battery management's charge hides nothing
    assert found.left(1.0, 4000.0, from_display=False) == pytest.approx(0.75)


def test_climate_control_that_was_off_stays_off():
    rng = np.random.default_rng(8)
    held_out = []
    for i in range(40):
        segments = by_hand_segments(rng, 40)
        expected = rng.uniform(500.0, 1500.0) * np.ones(40)
        drawn = 0.1 * expected * (np.arange(40) >= 30) if i < 12 else expected + rng.normal(0.0, 100.0, 40)
        climate = drawn - expected
        held_out.append(HeldOutResidual(segments, climate + rng.normal(0, 100, 40), climate, expected))
    split = dataclasses.replace(by_hand.ONE_PROCESS, split=True)
    own = np.array([split.sd_wh(trip.segments) for trip in held_out])
    found = UpdateShrinkage.from_trips(split, held_out, own)
    # after half of the trip, ten segments of nothing and ten of a tenth are to come: 95 % is not drawn
    assert found.off[FRACTIONS.index(0.5)] == pytest.approx(0.95, abs=0.03)
    none_off = UpdateShrinkage.from_trips(split, held_out[10:], own[10:])
    assert (none_off.off == 0.0).all()  # two trips are too few


@pytest.mark.parametrize(
    ("climate_w", "seconds", "off"),
    [([50.0, 0.0], 60.0, True), ([50.1, 0.0], 60.0, False), ([0.0, 0.0], 59.0, False)],
)
def test_when_climate_control_counts_as_off(climate_w, seconds, off):
    assert is_off(np.array(climate_w), np.full(2, seconds)) is off


def test_the_mean_width_never_grows_on_the_way():
    rng = np.random.default_rng(6)
    held_out = []
    for _ in range(40):
        segments = by_hand_segments(rng, 30)
        size = np.where(np.arange(30) < 15, 1.0, 4.0)  # the second half errs more than the process believes
        held_out.append(HeldOutResidual(segments, rng.normal(0.0, 800.0, 30) * size))
    own = np.array([by_hand.ONE_PROCESS.sd_wh(trip.segments) for trip in held_out])
    found = UpdateShrinkage.from_trips(by_hand.ONE_PROCESS, held_out, own)
    before = own.mean()
    rests = np.array([_rests(by_hand.ONE_PROCESS, trip) for trip in held_out])
    for k, factor in enumerate(found.joint_sd_factor):
        rest = factor * rests[:, k, 5].mean()
        assert rest <= before * (1.0 + 1e-9)
        before = rest


def by_hand_segments(rng: np.random.Generator, n: int) -> Segments:
    return Segments(
        15.0 + 30.0 * np.arange(n), np.full(n, 30.0), rng.uniform(0, 9000, n), rng.uniform(0, 3000, n)
    )


def test_errors_of_power_add_up_as_the_process_says():
    course = TimeCourse.from_process(by_hand.ONE_PROCESS)
    assert course == TimeCourse(float(np.hypot(500.0, 300.0)), ())  # two constants, no drift
    assert course.hours(7.0) == pytest.approx(7.0, rel=1e-12)
    mixed = TimeCourse(100.0, ((300.0, 600.0), (50.0, 60.0)))
    for hours in (0.05, 1.0, 12.0):
        time = (np.arange(2000) + 0.5) * hours * 3600.0 / 2000
        lag = np.abs(time[:, None] - time)
        covariance = 100.0**2 + 300.0**2 * np.exp(-lag / 600.0) + 50.0**2 * np.exp(-lag / 60.0)
        expected = hours * np.sqrt(covariance.mean() / (100.0**2 + 300.0**2 + 50.0**2))
        assert mixed.hours(hours) == pytest.approx(expected, rel=1e-3)
        assert mixed.hours(hours) <= hours


def test_the_scale_counts_hours_as_its_course_does():
    n = 240
    segments = Segments(30.0 + 60.0 * np.arange(n), np.full(n, 60.0), np.zeros(n), np.zeros(n))
    course = TimeCourse(100.0, ((300.0, 600.0),))
    assert TotalScale(np.array([0.0, 50.0, 0.0, 1.0])).sd_wh(segments) == pytest.approx(200.0)
    shorter = TotalScale(np.array([0.0, 50.0, 0.0, 1.0]), course).sd_wh(segments)
    assert shorter == pytest.approx(50.0 * course.hours(4.0))
    assert shorter < 100.0
