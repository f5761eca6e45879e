"""The width that was needed: what scaling all intervals by one factor does to their coverage."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import beta, binom

from tripwatt.uncertainty import Coverage
from tripwatt.uncertainty.coverage import clopper_pearson, power

NUMBERS = st.floats(-1e4, 1e4, allow_nan=False)
TRIPS = st.lists(st.tuples(NUMBERS, NUMBERS, st.floats(1.0, 1e3)), min_size=1, max_size=40)
LEVEL = st.sampled_from((0.5, 0.8, 0.9, 0.95))


def of(trips, level, factor=1.0) -> Coverage:
    observed, centre, half = np.array(trips).T
    return Coverage.from_bounds(observed, centre - factor * half, centre + factor * half, level)


@given(trips=TRIPS, level=LEVEL)
def test_the_needed_factor_is_the_least_that_holds_the_level(trips, level) -> None:
    needed = of(trips, level).needed
    assert of(trips, level, needed * (1.0 + 1e-9) + 1e-9).share >= level - 1e-12
    if needed > 1e-3:
        assert of(trips, level, needed * (1.0 - 1e-6)).share < level


@given(trips=TRIPS, level=LEVEL, factor=st.floats(0.1, 10.0))
def test_the_needed_width_does_not_depend_on_how_wide_the_intervals_were(trips, level, factor) -> None:
    assert of(trips, level, factor).needed_width == pytest.approx(
        of(trips, level).needed_width, rel=1e-6, abs=1e-6
    )


def test_the_ends_belong_to_an_interval_and_nothing_is_known_of_no_trip() -> None:
    assert Coverage.from_bounds([0.0, 2.0], [0.0, 0.0], [1.0, 2.0], 0.9).inside == 2
    nothing = Coverage.from_bounds([], [], [], 0.9)
    assert (nothing.trips, nothing.inside) == (0, 0)
    assert math.isnan(nothing.share)
    assert math.isnan(nothing.needed_width)
    assert nothing.ci95 == clopper_pearson(0, 0) == (0.0, 1.0)
    assert math.isinf(Coverage.from_bounds([1.0], [0.0], [0.0], 0.9).needed)


def test_the_interval_of_a_proportion_is_that_of_the_beta_distribution():
    for hits, n in ((3, 4), (52, 57), (1, 60)):
        low, high = clopper_pearson(hits, n)
        assert low == pytest.approx(beta.ppf(0.025, hits, n - hits + 1), rel=1e-9)
        assert high == pytest.approx(beta.ppf(0.975, hits + 1, n - hits), rel=1e-9)
    assert clopper_pearson(0, 5)[0] == 0.0
    assert clopper_pearson(5, 5)[1] == 1.0


@pytest.mark.parametrize("n", [1, 5, 17, 60])
@pytest.mark.parametrize("truth", [0.5, 0.75, 0.9, 0.99])
def test_the_power_is_the_probability_of_the_counts_that_exclude_the_level(n: int, truth: float) -> None:
    bounds = [Coverage(0.9, n, k, 1.0, 1.0).ci95 for k in range(n + 1)]
    excluded = [k for k, (low, high) in enumerate(bounds) if not low <= 0.9 <= high]
    assert power(n, 0.9, truth) == pytest.approx(sum(binom.pmf(k, n, truth) for k in excluded))
