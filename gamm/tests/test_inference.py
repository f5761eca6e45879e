"""Tests of terms against R's mgcv at its own parameters."""

import numpy as np
import pytest

from gamm_samples import mgcv_fit
from tripwatt_gamm import inference
from tripwatt_gamm.inference import coefficient_table, smooth_test, term_table


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
    check(*mgcv_fit(name))


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


def test_a_singular_system_is_solved_without_what_is_rounding():
    """Two equal columns, and an eigenvalue that rounding made negative."""
    a = np.array([[1.0, 1.0 + 1e-13], [1.0 + 1e-13, 1.0]])
    b = np.array([[2.0], [2.0 + 1e-6]])
    np.testing.assert_allclose(inference._solve(a, b), [[1.0], [1.0]], rtol=1e-6)
