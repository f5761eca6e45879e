"""The scale of the error of a total."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import t as student
from tests.forecasting import test_forecast as by_hand

from tripwatt.uncertainty.process import Segments
from tripwatt.uncertainty.scale import TimeCourse, TotalScale

EXACT = {"rel": 1e-9, "abs": 1e-9}


def test_the_scale_of_a_total() -> None:
    """100 Wh a trip, 60 W over 2 h, 5 % of 3 kWh moved, the corrector's 80 Wh twice, and 70 Wh outside.

    These are a standard deviation; the scale of a t distribution with four degrees of freedom is smaller by the root of 2.
    """
    two = Segments(
        np.array([0.0, 1.0]), np.full(2, 3600.0), np.array([1000.0, 2000.0]), np.zeros(2), 80.0, 70.0
    )
    expected = np.sqrt(100.0**2 + 120.0**2 + 150.0**2 + 160.0**2 + 70.0**2 / 2.0)
    values = np.array([100.0, 60.0, 0.05, 2.0])
    assert TotalScale(values).sd_wh(two) == pytest.approx(expected, **EXACT)
    # hours and energy together are 192 Wh; 6 % of 3 kWh are less, 10 % are more
    assert TotalScale(values, least_share=0.06).sd_wh(two) == pytest.approx(expected, **EXACT)
    more = np.sqrt(100.0**2 + 300.0**2 + 160.0**2 + 70.0**2 / 2.0)
    assert TotalScale(values, least_share=0.1).sd_wh(two) == pytest.approx(more, **EXACT)
    wider = TotalScale(values).with_share(0.06, 2.0)  # 12 % of the energy moved are 390 Wh with the 5 %
    assert wider.values.tolist() == pytest.approx([100.0, 60.0, 0.13, 2.0])
    # 7200 s are 20 correlation times: 2 sd² T² (20 - 1 + exp(-20)) over sd²
    course = TimeCourse(0.0, ((300.0, 360.0),))
    assert course.hours(2.0) == pytest.approx(
        np.sqrt(2.0 * 360.0**2 * (19.0 + np.exp(-20.0))) / 3600.0, **EXACT
    )
    assert TimeCourse(0.0, ()).hours(3.0) == 3.0


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


def test_shares_of_the_net_energy_stay_and_even_out() -> None:
    scale = TotalScale(np.array([0.0, 0.0, 0.0, 0.0]), net_shares=(0.03, 0.4))
    assert scale.net_sd_wh(10_000.0, 12_000.0, 1e9) == pytest.approx(300.0, rel=1e-3)
    assert scale.net_sd_wh(10_000.0, 12_000.0, 4000.0) == pytest.approx(10_000.0 * np.hypot(0.03, 0.2))
    assert scale.net_sd_wh(-100.0, 10_000.0, 1e9) == pytest.approx(0.3 * 300.0, rel=1e-3)
    trip = Segments(
        np.zeros(1), np.full(1, 3600.0), np.zeros(1), np.zeros(1), net_wh=500.0, distance_m=4000.0
    )
    assert scale.sd_wh(trip) == pytest.approx(500.0 * np.hypot(0.03, 0.2))
