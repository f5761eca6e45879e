"""The tail of weighted chi-squares against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tripwatt_gamm.chisq import weighted_chi2_sf

POSITIVE = st.floats(0.01, 100)


@given(st.floats(1e-4, 700), st.integers(1, 60), POSITIVE)
def test_equal_weights_are_a_chi_square(q, df, weight):
    exact = stats.chi2.sf(q / weight, df)
    assert weighted_chi2_sf(q, np.full(df, weight)) == pytest.approx(exact, rel=1e-8, abs=1e-300)
    assert weighted_chi2_sf(q, [weight], [df]) == pytest.approx(exact, rel=1e-8, abs=1e-300)


@given(st.floats(1e-3, 300), st.integers(1, 30), st.floats(1, 1e5))
def test_ratio_of_two_is_an_f(f, a, b):
    assert weighted_chi2_sf(0.0, [1.0, -f * a / b], [a, b]) == pytest.approx(
        stats.f.sf(f, a, b), rel=1e-8, abs=1e-300
    )


@given(
    st.lists(POSITIVE, min_size=1, max_size=12),
    st.lists(st.floats(0.01, 50), max_size=8),
    st.floats(-200, 200),
)
def test_tail_of_the_mirror_image_is_the_other_tail(up, down, q):
    weights = np.array([*up, *(-np.array(down))])
    assert weighted_chi2_sf(q, weights) + weighted_chi2_sf(-q, -weights) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("q", [0.1, 1.0, 10.0, 100.0, 500.0])
def test_sum_of_exponentials_far_into_the_tail(q):
    weights = np.array([3.0, 1.5, 0.7, 0.01])
    share = [np.prod([a / (a - b) for b in weights if b != a]) for a in weights]
    exact = float(np.exp(-q / (2 * weights)) @ share)
    assert weighted_chi2_sf(q, weights, [2] * 4) == pytest.approx(exact, rel=1e-9, abs=0)


def test_a_probability_below_the_smallest_number_is_zero():
    assert weighted_chi2_sf(9.7e19, np.ones(9)) == 0.0
