"""Metrics against values worked out by hand, and the bootstrap against the normal theory."""

import numpy as np
import pytest
from scipy import stats

from tripwatt.study.evaluation.metrics import (
    absolute_percentage_error,
    bootstrap_interval,
    leaves_out_zero,
    paired_difference,
    summarise_errors,
)

EXACT = {"rel": 1e-9, "abs": 1e-12}


OBSERVED = np.array([1000.0, 2000.0, 500.0, 4000.0, -200.0])


PREDICTED = np.array([1100.0, 1500.0, 600.0, 4040.0, -150.0])


APE = np.array([0.1, 0.25, 0.2, 0.01, 0.25])


def test_errors_of_a_model():
    summary = summarise_errors(OBSERVED, PREDICTED, seed=0)
    np.testing.assert_allclose(absolute_percentage_error(OBSERVED, PREDICTED), APE, rtol=1e-12)
    assert summary["mape"] == pytest.approx(0.81 / 5, **EXACT)
    assert summary["median_ape"] == pytest.approx(0.2, **EXACT)
    assert summary["max_ape"] == pytest.approx(0.25, **EXACT)
    # positive where the model says too much: 0.1 - 0.25 + 0.2 + 0.01, and a descent that gave back 200 Wh
    assert summary["bias"] == pytest.approx((0.1 - 0.25 + 0.2 + 0.01 - 0.25) / 5, **EXACT)
    assert summary["rmse_wh"] == pytest.approx(np.sqrt((1e4 + 25e4 + 1e4 + 1600 + 2500) / 5), **EXACT)
    assert summary["mape_ci95"] == bootstrap_interval(APE, 0)


def test_the_bootstrap_draws_trips():
    # two trips: the mean of two draws is 0, 1/2 or 1 with chances 1/4, 1/2, 1/4
    assert bootstrap_interval(np.array([0.0, 1.0]), seed=1) == (0.0, 1.0)
    # ten trips of which one errs: no draw of it has a chance of 0.9^10 = 0.35, four or more of 0.013
    assert bootstrap_interval(np.array([1.0] + [0.0] * 9), seed=1) == (0.0, 0.3)
    assert bootstrap_interval(np.array([0.0, 1.0, 5.0]), seed=1, draws=200) != bootstrap_interval(
        np.array([0.0, 1.0, 9.0]), seed=1, draws=200
    )


def test_paired_difference_is_first_less_second():
    found = paired_difference(np.array([0.1, 0.3, 0.5]), np.array([0.2, 0.2, 0.9]), seed=0)
    assert found.diff == pytest.approx((-0.1 + 0.1 - 0.4) / 3, **EXACT)
    assert found.ci95 == pytest.approx((-0.4, 0.1), abs=1e-9)
    assert not found.significant
    assert paired_difference(np.full(4, 0.1), np.full(4, 0.3), seed=0).significant
    assert paired_difference(np.full(4, 0.3), np.full(4, 0.1), seed=0).significant
    assert not paired_difference(np.full(4, 0.3), np.full(4, 0.3), seed=0).significant


def test_the_interval_of_a_mean_has_ten_thousand_draws_and_95_percent():
    values = np.array([0.1, 0.4, 0.25, 0.05, 0.3, 0.17, 0.02]) / 3.0
    expected = stats.bootstrap(
        (values,),
        np.mean,
        n_resamples=10_000,
        confidence_level=0.95,
        method="percentile",
        rng=np.random.default_rng(5),
    ).confidence_interval
    assert bootstrap_interval(values, 5) == (round(expected.low, 12), round(expected.high, 12))
    assert bootstrap_interval(np.array([1.0 / 3.0]), 5) == (0.333333333333, 0.333333333333)


def test_an_interval_that_ends_at_zero_is_not_significant():
    cases = [(-0.2, -0.1), (-0.2, 0.0), (-0.1, 0.1), (0.0, 0.2), (0.1, 0.2)]
    assert [leaves_out_zero(ci, lambda _: (0.1, 0.2)) for ci in cases] == [True, False, False, False, True]


def test_an_interval_near_zero_has_to_leave_it_out_for_every_seed():
    asked = []

    def again(seed: int, crossing: int = 0) -> tuple[float, float]:
        asked.append(seed)
        return (-0.001, 0.1) if seed == crossing else (0.001, 0.1)

    assert leaves_out_zero((0.01, 0.1), again)  # further from 0 than a tenth of its width
    assert asked == []
    assert leaves_out_zero((0.009, 0.1), again)
    assert asked == list(range(1, 40))
    assert not leaves_out_zero((0.009, 0.1), lambda seed: again(seed, 39))
    assert not leaves_out_zero((-0.1, -0.009), lambda seed: again(seed, 1))
    difference = paired_difference(np.array([0.1, 0.2, 0.35]), np.array([0.1, 0.1, 0.1]), 3)
    assert difference.significant is (difference.ci95[0] > 0.0)


def test_trips_of_one_day_are_drawn_together() -> None:
    """Ten days of four equal trips are no more than ten trips."""
    by_day = np.random.default_rng(0).normal(0.1, 0.05, 10)
    trips, days = np.repeat(by_day, 4), [f"day {k}" for k in np.repeat(np.arange(10), 4)]
    of_days, of_trips = bootstrap_interval(trips, 0, days), bootstrap_interval(trips, 0)
    assert np.subtract(*of_days) == pytest.approx(np.subtract(*bootstrap_interval(by_day, 0)), rel=1e-9)
    assert of_days[0] < of_trips[0] < of_trips[1] < of_days[1]
    each = bootstrap_interval(trips, 0, [f"{k:02d}" for k in range(40)])
    assert each == pytest.approx(of_trips, rel=1e-9)


def test_a_difference_of_days_is_not_one_of_trips() -> None:
    a = np.repeat([0.12, 0.12, 0.02], [10, 10, 10])
    b, days = np.full(30, 0.08), ["mon"] * 10 + ["tue"] * 10 + ["wed"] * 10
    by_trip, by_day = paired_difference(a, b, 0), paired_difference(a, b, 0, days)
    assert by_day.diff == by_trip.diff
    assert by_day.ci95[0] < by_trip.ci95[0] < by_trip.ci95[1] < by_day.ci95[1]
