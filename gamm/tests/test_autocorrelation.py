"""Autocorrelation: of residuals, where it is bounded and right by hand, and of the errors of a model."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.optimize import minimize

from tripwatt_gamm import GAMM, autocorrelation
from tripwatt_gamm.tables import IndexedColumns, TableRows, Whitening, previous_rows

RESIDUALS = st.lists(
    st.tuples(
        st.integers(0, 3), st.floats(-1e9, 1e9, allow_nan=False).map(lambda v: 0.0 if abs(v) < 1e-9 else v)
    ),
    min_size=2,
    max_size=60,
)


@given(RESIDUALS)
def test_it_lies_between_minus_one_and_one(rows: list[tuple[int, float]]) -> None:
    groups = [group for group, _ in rows]
    if max(groups.count(group) for group in groups) < 2:
        return
    found = autocorrelation([value for _, value in rows], groups)
    assert np.all(np.abs(found.correlation) <= 1.0)


def test_it_is_what_the_formula_gives_by_hand() -> None:
    # mean 0; lag 1: pairs (1, 2), (2, -3) of a and (2, -2) of b; lag 2: the pair (1, -3) of a alone
    found = autocorrelation([1.0, 2.0, -3.0, 2.0, -2.0], ["a", "a", "a", "b", "b"], max_lag=2)
    assert found.pairs.tolist() == [3, 1]
    first = (1 * 2 + 2 * -3 + 2 * -2) / np.sqrt((1 + 4 + 4) * (4 + 9 + 4))
    np.testing.assert_allclose(found.correlation, [first, -1.0])


def test_one_long_group_does_not_exceed_one() -> None:
    """Short quiet groups and one long, loud, alternating one: a mean product over the whole variance is -1.8 here."""
    loud = 5.0 * np.tile([1.0, -1.0], 20)
    quiet = np.tile([0.1, -0.1], 20)
    residuals = np.concatenate([loud, quiet])
    groups = np.repeat(["long", *[f"short {i}" for i in range(20)]], [40, *[2] * 20])
    found = autocorrelation(residuals, groups, max_lag=3)
    lag_3 = residuals[3:40] @ residuals[:37] / 37 / (residuals @ residuals / len(residuals))
    assert lag_3 < -1.8
    assert found.correlation[2] == pytest.approx(-1.0)


@pytest.mark.parametrize("phi", [-0.6, 0.0, 0.5, 0.9])
def test_it_recovers_an_autoregressive_process_in_groups_of_unequal_length(phi: float) -> None:
    rng = np.random.default_rng(4)
    lengths = rng.integers(20, 400, 150)
    parts = []
    for n in lengths:
        series = np.empty(n)
        series[0] = rng.normal() / np.sqrt(1.0 - phi**2)
        for t in range(1, n):
            series[t] = phi * series[t - 1] + rng.normal()
        parts.append(series)
    found = autocorrelation(np.concatenate(parts), np.repeat(np.arange(150), lengths), max_lag=4)
    np.testing.assert_allclose(found.correlation, phi ** np.arange(1, 5), atol=0.03)


# -- models with autocorrelated errors --------------------------------------------------------------------------------

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


def test_the_likelihood_of_normal_errors_is_that_of_their_joint_density() -> None:
    rng = np.random.default_rng(1)
    frame = pd.DataFrame({"x": rng.normal(size=60), "g": np.repeat(["a", "b"], [20, 40])})
    frame["y"] = frame["x"] + np.convolve(rng.normal(size=60), [1.0, 0.6], "same")
    model = GAMM("y ~ x", ar1_rho=0.4).fit(frame, groups="g")
    lag = np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    R = 0.4**lag * np.equal.outer(frame["g"].to_numpy(), frame["g"].to_numpy())
    r = model.residuals_
    variance = r @ np.linalg.solve(R, r) / 60
    density = stats.multivariate_normal(np.zeros(60), variance * R)
    assert model.loglik_ == pytest.approx(density.logpdf(r), abs=1e-8)
    assert model.aic_ == pytest.approx(2 * (model.edf_.sum() + 1) - 2 * model.loglik_)


def test_whitened_rows_are_the_whitened_matrix() -> None:
    rng = np.random.default_rng(2)
    groups = rng.integers(0, 3, 40)
    index = rng.integers(0, 7, 40)
    parts = [
        IndexedColumns(np.array([0, 2]), rng.normal(size=(7, 2)), index, rng.normal(size=40)),
        IndexedColumns(np.array([1]), rng.normal(size=(40, 1)), np.arange(40)),
    ]
    rows = TableRows(parts, 40, 3)
    white = Whitening(previous_rows(groups), 0.6)
    X = rows.dense(np.arange(40))
    expected = X.copy()
    for group in range(3):
        own = np.flatnonzero(groups == group)
        expected[own[1:]] = (X[own[1:]] - 0.6 * X[own[:-1]]) / 0.8
    found, weights = white.rows(rows), rng.uniform(1, 2, 40)
    np.testing.assert_allclose(found.dense(np.arange(40)), expected)
    np.testing.assert_allclose(white.values(X[:, 1]), expected[:, 1])
    np.testing.assert_allclose(found.gram(weights), expected.T @ (weights[:, None] * expected))
    np.testing.assert_allclose(found.transpose(weights), expected.T @ weights)
    np.testing.assert_allclose(found.predictor(np.ones(3)), expected.sum(axis=1))
    assert white.log_jacobian == pytest.approx(-37 * np.log(0.8))
