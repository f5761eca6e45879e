"""Models whose levels are eliminated one by one are those of the dense matrices."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamm_samples import clustered
from tripwatt_gamm import GAMM
from tripwatt_gamm.gram import Factor, Gram
from tripwatt_gamm.penalties import PenaltyBlock, PenaltyStack


def sample(seed, d, q, levels):
    """Crossproduct of d columns and of q effects of some levels."""
    rng = np.random.default_rng(seed)
    code, X, z = rng.integers(0, levels, 60), rng.normal(size=(60, d)), rng.normal(size=(60, q))
    Z = np.hstack([z[:, [a]] * (code[:, None] == np.arange(levels)) for a in range(q)])
    blocks = [[np.bincount(code, z[:, a] * z[:, b], levels) for b in range(q)] for a in range(q)]
    return np.hstack([X, Z]), Gram(X.T @ X, X.T @ Z, np.array(blocks).reshape(q, q, levels))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), d=st.integers(0, 4), q=st.integers(1, 3))
def test_elimination_is_the_dense_algebra(seed, d, q):
    levels = 5
    X, gram = sample(seed, d, q, levels)
    full = X.T @ X
    np.testing.assert_allclose(gram.dense(), full, atol=1e-12)
    np.testing.assert_allclose(gram.diagonal, np.diag(full))
    v = np.random.default_rng(seed).normal(size=len(full))
    np.testing.assert_allclose(gram @ v, full @ v, atol=1e-10)
    dead = v > 0
    np.testing.assert_allclose(gram.without(dead).dense(), full * ~dead * ~dead[:, None], atol=1e-12)
    # one penalty of the corner, and one for each effect or all correlated effects
    terms = [PenaltyBlock.from_matrices(0, [np.eye(d)])] if d else []
    L = np.tril(np.random.default_rng(seed).normal(size=(q, q)), -1) + np.eye(q)
    terms.append(PenaltyBlock.from_matrices(d, [np.outer(row, row) for row in L], levels, np.ones(q)))
    stack, rho = PenaltyStack(len(full), terms), np.random.default_rng(seed).uniform(-1, 1, q + bool(d))
    penalties = [np.zeros_like(full) for _ in rho]
    for j, S in enumerate(penalties):
        if j < len(rho) - q:
            S[:d, :d] = np.eye(d)
        else:
            row = L[j - (len(rho) - q)]
            S[d:, d:] = np.kron(np.outer(row, row), np.eye(levels))
    weighted = [np.exp(r) * S for r, S in zip(rho, penalties, strict=True)]
    A = full + sum(weighted)
    total = stack.add_to(gram, rho)
    np.testing.assert_allclose(total.dense(), A, atol=1e-10)
    factor, K = Factor.from_gram(total), np.linalg.inv(A)
    np.testing.assert_allclose(factor.dense(), K, atol=1e-9)
    np.testing.assert_allclose(factor.diagonal, np.diag(K), atol=1e-9)
    np.testing.assert_allclose(factor.solve(X.T), K @ X.T, atol=1e-8)
    assert factor.log_determinant == pytest.approx(np.linalg.slogdet(A)[1])
    single, pairs = stack.traces(rho, factor)
    np.testing.assert_allclose(single, [np.trace(K @ S) for S in weighted], atol=1e-8)
    np.testing.assert_allclose(
        pairs, [[np.trace(K @ S @ K @ T) for S in weighted] for T in weighted], atol=1e-8
    )
    assert Factor.from_gram(gram * -1.0) is None


@pytest.mark.parametrize(
    ("formula", "family"),
    [
        ('y ~ s(x) + z + s(g, bs="re")', "gaussian"),
        ('y ~ 0 + s(g, bs="re")', "gaussian"),
        ('y ~ s(g, bs="re") + s(x) + s(g, z, bs="re")', "gaussian"),
        ("y ~ s(x) + (1 + z | g)", "gaussian"),
        ('y ~ x + s(w, bs="re") + s(w, g, bs="re")', "gaussian"),
        ('y ~ s(x) + s(x, z, k=15) + s(g, z, bs="re")', "scat"),
        ('count ~ x + s(g, bs="re") + s(g, z, bs="re")', "poisson"),
    ],
)
def test_fits_are_those_of_the_dense_way(formula, family, monkeypatch):
    groups = 24 if family == "scat" else 12
    frame = clustered(4, n=20 * groups, groups=groups)
    frame["count"] = np.random.default_rng(0).poisson(np.exp(frame["y"] / 3))
    weights = np.linspace(0.5, 1.5, len(frame))
    free = GAMM(formula, family, tolerance=1e-6).fit(frame, weights=weights)
    held = GAMM(formula, family, tolerance=1e-6).leave_groups_out(frame, groups="g")
    given_values = free.smoothing_parameters_
    dense = GAMM(formula, family, tolerance=1e-6, smoothing_parameters=list(given_values.values())).fit(
        frame, weights=weights
    )
    monkeypatch.setattr("tripwatt_gamm.design.MANY_LEVELS", groups)
    found = GAMM(formula, family, tolerance=1e-6).fit(frame, weights=weights)
    assert found.reml_ == pytest.approx(free.reml_, rel=1e-8)
    np.testing.assert_allclose(found.fitted_values_, free.fitted_values_, atol=1e-5)
    in_order = [given_values[name] for name in found.smoothing_parameters_]
    sparse = GAMM(formula, family, tolerance=1e-6, smoothing_parameters=in_order).fit(frame, weights=weights)
    old, new = (np.argsort(model.coef_names_) for model in (dense, sparse))
    for name in ("coef_", "edf_", "edf1_"):
        np.testing.assert_allclose(getattr(sparse, name)[new], getattr(dense, name)[old], atol=1e-8)
    covariance = sparse.Vp_[np.ix_(new, new)]
    np.testing.assert_allclose(covariance, dense.Vp_[np.ix_(old, old)], atol=1e-8)
    assert sparse.reml_ == pytest.approx(dense.reml_, abs=1e-8)
    left_out = GAMM(formula, family, tolerance=1e-6).leave_groups_out(frame, groups="g")
    np.testing.assert_allclose(left_out, held, atol=1e-5)


def test_autocorrelated_rows_connect_levels_which_then_stay_dense(monkeypatch):
    frame, formula = clustered(2), 'y ~ x + s(g, bs="re")'
    dense = GAMM(formula, ar1_rho=0.4).fit(frame)
    monkeypatch.setattr("tripwatt_gamm.design.MANY_LEVELS", 2)
    assert GAMM(formula, ar1_rho=0.4).fit(frame).coef_ == pytest.approx(dense.coef_, abs=1e-12)
