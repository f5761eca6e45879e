"""Variances of random effects against lme4, mgcv and a dense likelihood of our own."""

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize

from gamm_samples import study
from tripwatt_gamm import GAMM, Gaussian, ScaledT

# Printed by lme4 1.1-31 (fixtures/mixed/reference.R): fixed effects, their standard errors, standard deviations of the
# random effects and the errors, correlation, REML criterion
LME4 = [
    (
        "sleepstudy",
        'reaction ~ days + s(subject, bs="re") + s(subject, days, bs="re")',
        ([251.405105, 10.467286], [6.8853808, 1.5595691]),
        [25.0513283, 5.9881867, 25.5652792],
        None,
        1743.669294,
    ),
    (
        "sleepstudy",
        "reaction ~ days + (1 + days | subject)",
        ([251.405105, 10.467286], [6.8245967, 1.5457896]),
        [24.740657995, 5.922137659, 25.591795722],
        0.065551238,
        1743.628272,
    ),
    (
        "oxboys",
        'height_cm ~ age + s(boy, bs="re") + s(boy, age, bs="re")',
        ([149.3717444, 6.5254339], [1.58560433, 0.33634112]),
        [8.08203110, 1.68093002, 0.65987854],
        None,
        736.6404524,
    ),
    (
        "machines",
        'score ~ machine + s(worker, bs="re")',
        ([52.3555556, 7.9666667, 13.9166667], [2.2293124, 1.0538825, 1.0538825]),
        [5.1465522, 3.1616474],
        None,
        286.878202,
    ),
    (
        "machines",
        'score ~ machine + s(worker, bs="re") + s(worker, machine, bs="re")',
        ([52.3555556, 7.9666667, 13.9166667], [2.4858303, 2.1769755, 2.1769755]),
        [4.78105074, 3.72953844, 0.96157663],
        None,
        215.687568,
    ),
]


@pytest.mark.parametrize(("data", "formula", "fixed", "sds", "correlation", "criterion"), LME4)
def test_it_has_the_estimates_of_lme4(data, formula, fixed, sds, correlation, criterion):
    model = GAMM(formula).fit(study(data))
    found, components = model.summary(), model.variance_components()
    assert found.parametric["estimate"].tolist() == pytest.approx(fixed[0], rel=2e-5)
    assert found.parametric["std_error"].tolist() == pytest.approx(fixed[1], rel=2e-5)
    assert components["std_dev"].tolist() == pytest.approx(sds, rel=2e-5)
    assert components["variance"].tolist() == pytest.approx(np.square(sds), rel=4e-5)
    assert 2 * model.reml_ == pytest.approx(criterion, abs=2e-6)
    assert found.scores()["-2 log REML"] == f"{criterion:.4f}"
    if correlation is not None:
        assert components["correlation"][1] == pytest.approx(correlation, abs=2e-5)
    assert components["correlation"].notna().sum() == (correlation is not None)


def test_it_has_the_estimates_of_lme4_where_the_covariance_is_singular():
    """Four subjects whose slopes follow from their intercepts: correlation 1."""
    frame = study("sleepstudy")
    frame = frame[frame["subject"].isin([309, 310, 330, 331])]
    model = GAMM("reaction ~ days + (1 + days | subject)").fit(frame)
    components = model.variance_components()
    assert model.converged_
    assert model.reml_ == pytest.approx(174.431701, abs=1e-5)
    assert components["std_dev"].tolist() == pytest.approx([47.18422, 0.22851, 17.74663], rel=2e-3)
    assert components["correlation"][1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("data", "formula", "intervals", "edf", "statistics"),
    [
        (
            "sleepstudy",
            'reaction ~ days + s(subject, bs="re") + s(subject, days, bs="re")',
            [(16.0853654, 39.0150385), (4.0252484, 8.9082631), (22.7917451, 28.6762687)],
            [12.942365, 14.414120],
            [89.286442, 104.556773],
        ),
        (
            "machines",
            'score ~ machine + s(worker, bs="re") + s(worker, machine, bs="re")',
            [(2.24986590, 10.1599651), (2.38281039, 5.8373714), (0.76325353, 1.2114317)],
            [4.1413816, 10.6232240],
            [8501.94679, 594.97654],
        ),
    ],
)
def test_it_has_the_intervals_and_tests_of_mgcv(data, formula, intervals, edf, statistics):
    """Printed by gam.vcomp and summary of mgcv 1.8-41 (fixtures/mixed/reference.R)."""
    model = GAMM(formula, method="REML").fit(study(data))
    components = model.variance_components()
    assert components[["lower", "upper"]].to_numpy() == pytest.approx(np.array(intervals), rel=1e-4)
    smooth = model.summary().smooth
    assert smooth["edf"].tolist() == pytest.approx(edf, rel=1e-4)
    assert smooth["statistic"].tolist() == pytest.approx(statistics, rel=1e-4)
    # on the log scale the interval is symmetric and as wide as its level asks
    narrow = model.variance_components(level=0.5)
    width = np.log(components["upper"] / components["std_dev"])
    assert np.log(components["std_dev"] / components["lower"]).tolist() == pytest.approx(width.tolist())
    assert (np.log(narrow["upper"] / narrow["std_dev"]) / width).tolist() == pytest.approx(
        [0.34413] * 3, rel=1e-4
    )


@pytest.mark.parametrize(
    ("data", "formula", "intervals", "correlation"),
    [
        (
            "sleepstudy",
            "reaction ~ days + (1 + days | subject)",
            [(15.581671, 39.283344), (3.9182810, 8.9507911), (22.800443, 28.724881)],
            (-0.518394608, 0.607804767),
        ),
        (
            "oxboys",
            "height_cm ~ age + (1 + age | boy)",
            [(6.1235309, 10.6644074), (1.2594102, 2.2429648), (0.59546401, 0.73128384)],
            (0.34025597, 0.82307913),
        ),
    ],
)
def test_correlated_effects_have_the_intervals_of_lme4(data, formula, intervals, correlation):
    """Of the Hessian of lme4's deviance in log standard deviations and Fisher's z (fixtures/mixed/reference.R)."""
    components = GAMM(formula).fit(study(data)).variance_components()
    assert components[["lower", "upper"]].to_numpy() == pytest.approx(np.array(intervals), rel=5e-5)
    ends = components[["correlation_lower", "correlation_upper"]]
    assert ends.iloc[1].tolist() == pytest.approx(correlation, rel=1e-4)
    assert ends.iloc[[0, 2]].isna().all(axis=None)


def levels_with_slopes(noise, seed=2, levels=20):
    """Eight rows of each level, with x even about 0; the effects of intercept, x and z correlate."""
    rng = np.random.default_rng(seed)
    g, x = np.repeat(np.arange(levels), 8), np.tile(np.linspace(-1, 1, 8), levels)
    z = np.tile([0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0], levels)
    b = rng.normal(size=(levels, 3)) @ np.array([[1.0, 0.5, -0.3], [0.0, 0.4, 0.2], [0.0, 0.0, 0.6]])
    y = 1 + x + b[g, 0] + b[g, 1] * x + noise * rng.normal(size=len(g))
    frame = pd.DataFrame({"g": g.astype(str), "x": x, "z": z, "y": y, "y_of_z": y + b[g, 2] * z})
    return frame.assign(positive=np.exp(y))


def test_without_noise_the_errors_are_those_of_a_sample_covariance():
    """Of a normal sample with f degrees of freedom: 1 / (2 f) for a log standard deviation, 1 / f for Fisher's z."""
    components = GAMM("y_of_z ~ x + z + (1 + x + z | g)").fit(levels_with_slopes(0.03)).variance_components()
    half = np.log(components["upper"] / components["std_dev"])[:3] / 1.959964
    assert half.tolist() == pytest.approx([1 / np.sqrt(2 * 19)] * 3, rel=5e-3)
    z = np.arctanh(components[["correlation", "correlation_lower", "correlation_upper"]].iloc[1:3])
    assert (z["correlation_upper"] - z["correlation"]).tolist() == pytest.approx(
        [1.959964 / np.sqrt(19)] * 2, rel=5e-3
    )
    assert z["correlation"].tolist() == pytest.approx(z.iloc[:, 1:].mean(axis=1).tolist())


def test_in_a_balanced_design_the_intervals_are_those_of_independent_effects():
    """Least squares intercepts and slopes of the levels are then independent given the effects, as their variances are."""
    frame = levels_with_slopes(0.5)
    correlated, independent = (
        GAMM(f"y ~ x + {term}").fit(frame).variance_components()[["std_dev", "lower", "upper"]].to_numpy()
        for term in ("(1 + x | g)", "(1 + x || g)")
    )
    assert correlated == pytest.approx(independent, rel=1e-4)


@pytest.mark.parametrize(("family", "y"), [("gaussian", "y"), ("scat", "y"), ("gamma", "positive")])
def test_intervals_hold_the_estimate_and_follow_the_units_of_a_column(family, y):
    frame = levels_with_slopes(0.5)
    frame = frame.assign(far=20 * frame["x"])
    near, far = (GAMM(f"{y} ~ {x} + (1 + {x} | g)", family, "REML").fit(frame) for x in ("x", "far"))
    found = near.variance_components()[:2]
    assert (found["lower"] < found["std_dev"]).all()
    assert (found["std_dev"] < found["upper"]).all()
    columns = ["correlation_lower", "correlation", "correlation_upper"]
    ends = found.loc[1, columns].to_numpy(dtype=float)
    assert (np.diff(ends) > 0.02).all()
    assert np.abs(ends).max() < 1
    narrow = near.variance_components(level=0.5).loc[1, columns].to_numpy(dtype=float)
    assert np.diff(np.arctanh(narrow)) == pytest.approx(0.34413 * np.diff(np.arctanh(ends)), rel=1e-4)
    moved = far.variance_components()[:2]
    assert moved.loc[1, columns].to_numpy(dtype=float) == pytest.approx(ends, rel=2e-3)
    sds = ["std_dev", "lower", "upper"]
    assert 20 * moved.loc[1, sds].to_numpy(dtype=float) == pytest.approx(
        found.loc[1, sds].to_numpy(dtype=float), rel=1e-3
    )


def test_intervals_of_correlated_effects_have_their_coverage():
    """Nine in ten of 90 intervals of 30 simulated tables, give or take three standard errors."""
    truth, hits = np.array([1.0, np.hypot(0.5, 0.4), 0.5 / np.hypot(0.5, 0.4)]), []
    for seed in range(30):
        frame = levels_with_slopes(0.5, seed)
        found = GAMM("y ~ x + (1 + x | g)").fit(frame).variance_components(level=0.9)
        ends = [(found["lower"][j], found["upper"][j]) for j in (0, 1)]
        ends.append((found["correlation_lower"][1], found["correlation_upper"][1]))
        hits.append([low < value < high for value, (low, high) in zip(truth, ends, strict=True)])
    assert 0.8 < np.mean(hits) < 0.99
    assert (np.mean(hits, axis=0) > 0.7).all()


class Dense:
    """-log restricted likelihood of y ~ N(X b, sum Z_j Sigma_j Z_j' + sigma^2 R), each Z_j (n, q L) effect by effect."""

    def __init__(self, y, X, blocks, groups=None):
        self.y, self.X, self.blocks, self.groups = y, X, blocks, groups

    def marginal(self, covariances, variance, rho=0.0):
        n = len(self.y)
        lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
        errors = np.eye(n) if self.groups is None else rho**lag * np.equal.outer(self.groups, self.groups)
        V = variance * errors
        for Z, S in zip(self.blocks, covariances, strict=True):
            V = V + Z @ np.kron(S, np.eye(Z.shape[1] // len(S))) @ Z.T
        return V

    def fit(self, V):
        inverse = np.linalg.inv(V)
        information = self.X.T @ inverse @ self.X
        beta = np.linalg.solve(information, self.X.T @ inverse @ self.y)
        return inverse, information, beta, self.y - self.X @ beta

    def score(self, V):
        inverse, information, _, r = self.fit(V)
        parts = np.linalg.slogdet(V)[1] + np.linalg.slogdet(information)[1] + r @ inverse @ r
        return (parts + (len(self.y) - self.X.shape[1]) * np.log(2 * np.pi)) / 2


def indicators(column):
    return (np.asarray(column)[:, None] == np.unique(column)).astype(float)


def covariances_of(model):
    """Covariance of the effects of a level, for each random effect of a fit."""
    components, found = model.variance_components(), []
    for _, rows in components[:-1].groupby("term", sort=False):
        sd, corr = rows["std_dev"].to_numpy(), rows["correlation"].to_numpy()
        S = np.diag(sd**2)
        if len(sd) == 2:
            S[0, 1] = S[1, 0] = corr[1] * sd.prod()
        found.append(S)
    return found, components["variance"].iloc[-1]


def simulated(seed=3):
    rng = np.random.default_rng(seed)
    n = 220
    frame = pd.DataFrame({"x": rng.normal(2.0, 3.0, n), "z": rng.uniform(-1, 1, n)})
    frame["g"] = rng.integers(0, 10, n)
    frame["h"] = [f"h{i}" for i in rng.integers(0, 5, n)]
    frame["f"] = [f"f{i}" for i in rng.integers(0, 4, n)]
    mixing = np.array([[1.0, 0.0, 0.0], [0.3, 0.25, 0.0], [-0.5, 0.2, 0.4]])
    b = rng.normal(size=(10, 3)) @ mixing.T
    u = rng.normal(0, 0.7, (5, 4))
    frame["y"] = 1 + 0.5 * frame["x"] + 2 * frame["z"] + rng.normal(0, 0.6, n)
    frame["y"] += (b[frame["g"]] * np.c_[np.ones(n), frame["x"], frame["z"]]).sum(axis=1)
    frame["y"] += u[frame["h"].str[1].astype(int), frame["f"].str[1].astype(int)]
    return frame


def design(frame, name):
    G, x, z = indicators(frame["g"]), frame["x"].to_numpy()[:, None], frame["z"].to_numpy()[:, None]
    H = indicators(frame["h"] + frame["f"])
    blocks = {
        "slopes": [G, G * x, G * z],
        "product": [G, G * x * z],
        "crossed": [G, H],
        "factor and slope": [H * x],
        "correlated": [np.hstack([G, G * x]), H],
    }[name]
    X = np.c_[np.ones(len(frame)), x, z]
    return Dense(frame["y"].to_numpy(), X, blocks)


@pytest.mark.parametrize(
    ("name", "terms"),
    [
        ("slopes", 's(g, bs="re") + s(g, x, bs="re") + s(g, z, bs="re")'),
        ("product", 's(g, bs="re") + s(g, x, z, bs="re")'),
        ("crossed", 's(g, bs="re") + s(h, f, bs="re")'),
        ("factor and slope", 's(h, f, x, bs="re")'),
        ("correlated", '(1 + x | g) + s(h, f, bs="re")'),
    ],
)
def test_it_maximises_the_dense_restricted_likelihood(name, terms):
    frame = simulated()
    if name == "slopes" or name == "product":
        frame = frame.assign(g=[f"g{i}" for i in frame["g"]])
    model = GAMM(f"y ~ x + z + {terms}").fit(frame)
    dense = design(frame, name)
    found, variance = covariances_of(model)
    V = dense.marginal(found, variance)
    inverse, information, beta, residual = dense.fit(V)
    assert model.reml_ == pytest.approx(dense.score(V), abs=1e-7)
    assert model.coef_[:3] == pytest.approx(beta, abs=1e-8)
    assert np.sqrt(np.diag(model.Vp_)[:3]) == pytest.approx(np.sqrt(np.diag(np.linalg.inv(information))))
    predicted = [
        np.kron(S, np.eye(Z.shape[1] // len(S))) @ Z.T @ inverse @ residual
        for Z, S in zip(dense.blocks, found, strict=True)
    ]
    assert model.coef_[3:] == pytest.approx(np.concatenate(predicted), abs=1e-7)

    def score(roots):
        at, rest = [], roots[1:]
        for S in found:
            q = len(S)
            L = np.zeros((q, q))
            L[np.tril_indices(q)], rest = rest[: q * (q + 1) // 2], rest[q * (q + 1) // 2 :]
            at.append(L @ L.T)
        return dense.score(dense.marginal(at, roots[0] ** 2))

    start = [0.8 * np.sqrt(variance)]
    for S in found:
        start += list(1.2 * np.linalg.cholesky(S)[np.tril_indices(len(S))])
    best = minimize(score, start, method="BFGS")
    assert score(start) > model.reml_ + 0.1
    assert best.fun == pytest.approx(model.reml_, abs=2e-6)
    assert best.x[0] ** 2 == pytest.approx(variance, rel=1e-3)


def test_three_correlated_effects_maximise_it_too():
    frame = simulated().assign(g=lambda f: f["g"].astype(str))
    model = GAMM("y ~ x + z + (1 + x + z | g)").fit(frame)
    G = indicators(frame["g"])
    x, z = frame["x"].to_numpy()[:, None], frame["z"].to_numpy()[:, None]
    dense = Dense(frame["y"].to_numpy(), np.c_[np.ones(len(frame)), x, z], [np.hstack([G, G * x, G * z])])

    def score(roots):
        L = np.zeros((3, 3))
        L[np.tril_indices(3)] = roots[1:]
        return dense.score(dense.marginal([L @ L.T], roots[0] ** 2))

    best = minimize(score, [0.9, 1.0, 0.3, 0.3, -0.5, 0.2, 0.4], method="BFGS")
    assert model.reml_ == pytest.approx(best.fun, abs=2e-6)
    L = np.zeros((3, 3))
    L[np.tril_indices(3)] = best.x[1:]
    covariance = L @ L.T
    components = model.variance_components()
    assert components["effect"].tolist() == ["(Intercept)", "x", "z", ""]
    assert components["std_dev"][:3].tolist() == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-3)
    correlation = covariance[1:, 0] / np.sqrt(covariance[0, 0] * np.diag(covariance)[1:])
    assert components["correlation"][1:3].tolist() == pytest.approx(correlation, abs=1e-3)


def test_correlated_effects_and_autocorrelated_errors_are_estimated_together():
    rng = np.random.default_rng(8)
    g, x = np.repeat(np.arange(10), 8), np.tile(np.linspace(-1, 1, 8), 10)
    b = rng.normal(size=(10, 2)) @ np.array([[1.0, 0.6], [0.0, 0.5]])
    e = rng.normal(0, 0.5, (10, 8))
    for t in range(1, 8):
        e[:, t] = 0.6 * e[:, t - 1] + 0.8 * e[:, t]
    frame = pd.DataFrame({"x": x, "g": g, "y": b[g, 0] + b[g, 1] * x + e.ravel()})
    model = GAMM("y ~ x + (1 + x | g)", ar1_rho="estimate").fit(frame, groups="g")
    G = indicators(g)
    dense = Dense(frame["y"].to_numpy(), np.c_[np.ones(80), x], [np.hstack([G, G * x[:, None]])], g)

    def score(p):
        L = np.array([[p[2], 0.0], [p[3], p[4]]])
        return dense.score(dense.marginal([L @ L.T], p[0] ** 2, np.tanh(p[1])))

    best = minimize(score, [0.5, 0.7, 1.0, 0.6, 0.5], method="BFGS")
    assert model.reml_ == pytest.approx(best.fun, abs=1e-5)
    assert model.ar1_rho_ == pytest.approx(np.tanh(best.x[1]), abs=1e-3)
    found, variance = covariances_of(model)
    assert model.reml_ == pytest.approx(
        dense.score(dense.marginal(found, variance, model.ar1_rho_)), abs=1e-7
    )


def test_with_many_degrees_of_freedom_students_t_has_the_correlated_effects_of_normal_errors():
    frame, formula = study("oxboys").iloc[:90], "height_cm ~ age + (1 + age | boy)"
    normal = GAMM(formula).fit(frame)
    heavy = GAMM(formula, ScaledT(nu=1e6), "REML").fit(frame)
    assert heavy.converged_
    assert heavy.reml_ == pytest.approx(normal.reml_, abs=1e-3)
    columns = ["std_dev", "correlation"]
    found, expected = (model.variance_components()[columns].iloc[:2].to_numpy() for model in (heavy, normal))
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    assert heavy.sigma_ == pytest.approx(np.sqrt(normal.scale_), rel=1e-3)


def test_components_without_an_interval_are_empty():
    frame = study("machines")
    given = GAMM('score ~ machine + s(worker, bs="re")', smoothing_parameters=[0.05]).fit(frame)
    components = given.variance_components()
    assert components["std_dev"][0] == pytest.approx(given.sigma_ / np.sqrt(0.05))
    assert components[["lower", "upper"]].isna().all(axis=None)
    assert "correlation" not in str(given.summary())
    correlated = GAMM("score ~ (1 + late | worker)", smoothing_parameters=[0.1, 0.2])
    found = correlated.fit(frame.assign(late=np.arange(len(frame)) % 3 - 1.0)).variance_components()
    assert found["correlation"].notna().tolist() == [False, True, False]
    assert found[["lower", "upper", "correlation_lower", "correlation_upper"]].isna().all(axis=None)
    heavy = GAMM('score ~ machine + s(worker, bs="re")', "scat").fit(frame).variance_components()
    assert heavy["lower"].notna().tolist() == [True, False]


def test_known_scale_enters_the_components():
    model = GAMM('score ~ machine + s(worker, bs="re")', method="REML").fit(study("machines"))
    fixed = GAMM('score ~ machine + s(worker, bs="re")', Gaussian(scale=model.scale_)).fit(study("machines"))
    components = fixed.variance_components()
    assert components["std_dev"][0] == pytest.approx(5.1465522, rel=1e-3)
    # the error variance is known, so that its interval has no width and the other one no share of it
    assert components["upper"][1] == components["lower"][1] == components["std_dev"][1]
    assert components["upper"][0] < model.variance_components()["upper"][0]


@pytest.mark.parametrize(
    ("noise", "note"), [(1e-6, ""), (1e-9, "too large beside"), (None, "estimated as zero")]
)
def test_effects_far_above_and_below_the_noise(noise, note):
    """Effects 3e5 times the noise have their variance; beyond that, and where there are none, a note says so."""
    rng = np.random.default_rng(0)
    group = np.repeat(np.arange(20), 10)
    effect = rng.normal(0, 0.326, 20)
    errors = np.random.default_rng(3).normal(size=200)
    y = 1 + effect[group] + noise * errors if noise else errors
    model = GAMM('y ~ s(g, bs="re")').fit(pd.DataFrame({"g": group.astype(str), "y": y}))
    assert (note in " ".join(model.notes_)) if note else not model.notes_
    if not note:
        assert model.variance_components()["std_dev"][0] == pytest.approx(effect.std(ddof=1), rel=1e-3)
