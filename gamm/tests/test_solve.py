"""Models with autocorrelated errors: likelihood, search of the correlation, both methods."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.optimize import minimize

from tripwatt_gamm import GAMM

LENGTHS = [1, 30, 70, 99, 200, 200]


@pytest.fixture(scope="module")
def heavy() -> pd.DataFrame:
    """A line with errors e_t = 0.7 e_(t-1) + sqrt(1 - 0.7^2) 0.5 T_5 in groups of unequal length."""
    rng = np.random.default_rng(5)
    parts = []
    for n in LENGTHS:
        e = 0.5 * rng.standard_t(5, n)
        for t in range(1, n):
            e[t] = 0.7 * e[t - 1] + np.sqrt(1 - 0.7**2) * e[t]
        parts.append(e)
    x = rng.uniform(0, 1, sum(LENGTHS))
    groups = np.repeat([f"g{i}" for i in range(len(LENGTHS))], LENGTHS)
    return pd.DataFrame({"x": x, "g": groups, "y": 1 + 2 * x + np.concatenate(parts)})


def innovations_loglik(frame: pd.DataFrame, line: np.ndarray, rho: float, nu: float, sigma: float) -> float:
    """Product over the innovations, group by group."""
    total = 0.0
    for _, rows in frame.assign(e=frame["y"] - line).groupby("g"):
        e, scale = rows["e"].to_numpy(), np.sqrt(1 - rho**2) * sigma
        total += stats.t.logpdf(e[0], nu, scale=sigma)
        total += stats.t.logpdf(e[1:], nu, loc=rho * e[:-1], scale=scale).sum()
    return total


def test_students_t_innovations_have_the_likelihood_of_a_brute_force_product(heavy: pd.DataFrame) -> None:
    model = GAMM("y ~ x", "scat", "REML", ar1_rho="estimate").fit(heavy, groups="g")
    assert model.converged_
    own = innovations_loglik(heavy, model.fitted_values_, model.ar1_rho_, model.nu_, model.sigma_)
    assert model.loglik_ == pytest.approx(own, abs=1e-7)
    x = heavy["x"].to_numpy()

    def negative(p: np.ndarray) -> float:
        return -innovations_loglik(heavy, p[0] + p[1] * x, np.tanh(p[2]), 3 + np.exp(p[3]), np.exp(p[4]))

    best = minimize(negative, [1.0, 2.0, 0.8, 0.5, -0.7], method="BFGS")
    assert -best.fun == pytest.approx(
        model.loglik_, abs=0.02
    )  # REML and ML differ by two coefficients in 600 rows
    assert model.coef_ == pytest.approx(best.x[:2], abs=2e-3)
    assert model.ar1_rho_ == pytest.approx(np.tanh(best.x[2]), abs=5e-3)
    assert model.sigma_ == pytest.approx(np.exp(best.x[4]), rel=0.01)
    assert model.ar1_rho_ == pytest.approx(0.7, abs=0.05)
    assert 3 < model.nu_ < 9


def test_the_order_of_groups_does_not_matter_and_other_rho_has_a_higher_score(heavy: pd.DataFrame) -> None:
    model = GAMM("y ~ x", "scat", "REML", ar1_rho=0.7).fit(heavy, groups="g")
    place = heavy.groupby("g").cumcount().to_numpy()
    interleaved = heavy.iloc[np.argsort(place, kind="stable")]
    assert GAMM("y ~ x", "scat", "REML", ar1_rho=0.7).fit(interleaved, groups="g").reml_ == pytest.approx(
        model.reml_, abs=1e-6
    )
    best = GAMM("y ~ x", "scat", "REML", ar1_rho="estimate").fit(heavy, groups="g")
    for rho in (best.ar1_rho_ - 0.03, best.ar1_rho_ + 0.03):
        assert GAMM("y ~ x", "scat", "REML", ar1_rho=rho).fit(heavy, groups="g").reml_ > best.reml_ + 0.1
    assert GAMM("y ~ x", "scat", "REML").fit(heavy).reml_ > best.reml_ + 50


def test_the_fast_method_with_a_given_rho_meets_the_exact_one(heavy: pd.DataFrame) -> None:
    formula = "y ~ s(x, k=6)"
    fast = GAMM(formula, "scat", ar1_rho=0.7).fit(heavy, groups="g")
    exact = GAMM(formula, "scat", "REML", ar1_rho=0.7).fit(heavy, groups="g")
    assert fast.ar1_rho_ == exact.ar1_rho_ == 0.7
    assert np.abs(fast.fitted_values_ - exact.fitted_values_).max() < 0.02
    assert fast.nu_ == pytest.approx(exact.nu_, rel=0.02)
    held = GAMM(formula, "scat", ar1_rho=0.7).leave_groups_out(heavy, groups="g")
    own = heavy["g"] == "g2"
    without = GAMM(formula, "scat", ar1_rho=0.7).fit(heavy[~own], groups="g")
    np.testing.assert_allclose(held[own], without.predict(heavy[own]), atol=0.02)
