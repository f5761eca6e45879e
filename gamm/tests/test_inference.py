"""Tests of terms against R's mgcv at its own parameters, and the tail of weighted chi-squares against closed forms."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from oracle import HERE, small, synthetic
from tripwatt_gamm.chisq import weighted_chi2_sf
from tripwatt_gamm.dependence import column_concurvity, concurvity
from tripwatt_gamm.inference import coefficient_table, smooth_test, term_table

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


def check(fit, smooths, parametric):
    terms, coefficients = term_table(fit), coefficient_table(fit)
    assert list(terms.index) == list(smooths.index)
    np.testing.assert_allclose(terms["edf"], smooths["edf"], atol=0.01)
    np.testing.assert_allclose(terms["ref_df"], smooths["ref_df"], rtol=5e-4)
    np.testing.assert_allclose(terms["statistic"], smooths["statistic"], rtol=5e-4)
    np.testing.assert_allclose(terms["p_value"], smooths["p_value"], atol=1e-3)
    for column in ("estimate", "std_error", "statistic", "p_value"):
        np.testing.assert_allclose(coefficients[column], parametric[column], rtol=5e-4, atol=1e-12)


@pytest.mark.parametrize("name", ["random_gaussian", "random_scat", "no_null_space", "concurvity"])
def test_tables_are_those_of_mgcv(name):
    check(*small(name))


@pytest.mark.parametrize("kind", ["A", "B"])
@pytest.mark.parametrize("family", ["gaussian", "scat"])
def test_tables_are_those_of_mgcv_on_the_synthetic_set(kind, family):
    check(*synthetic(kind, family))


def test_concurvity_is_that_of_mgcv():
    fit, smooths, _ = small("concurvity")
    table = concurvity(fit)
    assert list(table.index) == ["parametric", *smooths.index]
    # mgcv's first row sees the intercept only; ours is the whole parametric part
    np.testing.assert_allclose(table[1:], pd.read_csv(HERE / "concurvity" / "concurvity.csv")[1:], atol=1e-6)


def test_concurvity_of_a_repeated_column_is_one_and_of_an_orthogonal_one_zero():
    rng = np.random.default_rng(0)
    basis, _ = np.linalg.qr(rng.normal(size=(50, 5)))
    factor = np.column_stack([basis, basis[:, 3] * 2.0])
    assert column_concurvity(factor, np.ones(6), np.array([5])) == pytest.approx((1.0, 1.0, 1.0))
    assert column_concurvity(factor, np.ones(6), np.array([0, 1])) == pytest.approx(
        (0.0, 0.0, 0.0), abs=1e-12
    )


def test_p_values_of_a_pure_noise_term_are_uniform():
    rng = np.random.default_rng(1)
    basis, _ = np.linalg.qr(rng.normal(size=(60, 8)))
    gram, penalty = basis.T @ basis, np.diag([0.0, *np.geomspace(0.02, 20, 7)])
    posterior = np.linalg.inv(gram + penalty)
    hat = posterior @ gram
    ref_df = float(np.trace(2 * hat - hat @ hat))
    p = [
        smooth_test(posterior @ basis.T @ rng.normal(size=60), posterior, basis, ref_df).p_value
        for _ in range(150)
    ]
    assert np.mean(np.array(p) < 0.05) <= 0.07
    assert 0.35 <= np.mean(np.array(p) < 0.5) <= 0.6


def test_term_without_data_explains_nothing():
    test = smooth_test(np.zeros(3), np.zeros((3, 3)), np.zeros((5, 3)), 0.0)
    assert (test.statistic, test.p_value) == (0.0, 1.0)


def test_level_without_data_is_shown_as_zero():
    fit, _, _ = small("concurvity")
    fit.Vp_[1] = fit.Vp_[:, 1] = 0.0
    fit.coef_ = np.where(np.arange(fit.coef_.size) == 1, 0.0, fit.coef_)
    row = coefficient_table(fit).iloc[1]
    assert (row["estimate"], row["std_error"]) == (0.0, 0.0)
    assert np.isnan(row["p_value"])
