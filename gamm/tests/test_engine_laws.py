"""Laws of penalised regression that hold whatever the data."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import t as student

from bare_matrix import table_rows
from tripwatt_gamm import GAMM, Formula, Parametric, RandomEffect, ScaledT, Smooth, Tensor
from tripwatt_gamm.design import build_design
from tripwatt_gamm.families import Theta, t_derivatives, theta_objective
from tripwatt_gamm.fit import NormalEquations, gaussian_score
from tripwatt_gamm.laplace import LaplaceModel
from tripwatt_gamm.penalties import PenaltyStack

few = settings(max_examples=8, deadline=None)
seeds = st.integers(0, 10_000)


def data(seed, n=160, groups=8, noise=0.4):
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(groups), n // groups)
    x, z = rng.uniform(-2, 5, n), rng.normal(size=n)
    y = np.sin(x) + 0.3 * z + rng.normal(0, 0.5, groups)[group] + noise * rng.standard_t(5, n)
    return pd.DataFrame({"x": x, "z": z, "g": [f"g{i}" for i in group], "y": y})


CURVE = Formula("y", (Smooth(("x",), "ps", 12), RandomEffect("g")))


@few
@given(seed=seeds, basis=st.sampled_from(["ps", "tp", "cr"]), power=st.floats(9, 14))
def test_a_huge_smoothing_parameter_gives_a_straight_line(seed, basis, power):
    frame = data(seed)
    model = GAMM(Formula("y", (Smooth(("x",), basis, 10),)), smoothing_parameters=[10.0**power]).fit(frame)
    line = np.polyval(np.polyfit(frame["x"], frame["y"], 1), frame["x"])
    assert np.abs(model.fitted_values_ - line).max() < 1e-3 * frame["y"].std()
    assert model.edf_.sum() == pytest.approx(2, abs=1e-3)


@few
@given(seed=seeds, logs=st.lists(st.floats(-12, 15), min_size=3, max_size=3))
def test_edf_lies_between_the_null_space_and_k(seed, logs):
    formula = Formula("y", (Smooth(("x",), "tp", 8), Tensor(("x", "z"), "ps", (5, 5))))
    model = GAMM(formula, smoothing_parameters=np.exp(logs)).fit(data(seed))
    for fitted in model.terms_:
        edf = model.edf_[fitted.slice].sum()
        assert fitted.null_dim - 1e-6 <= edf <= fitted.size + 1e-6
        assert edf <= model.edf1_[fitted.slice].sum() + 1e-6


@few
@given(seed=seeds)
def test_relabelling_groups_changes_nothing(seed):
    frame = data(seed)
    other = frame.assign(
        g=frame["g"].map(dict(zip(["g0", "g1", "g2", "g3", "g4", "g5", "g6", "g7"], "pqhxwanb", strict=True)))
    )
    one, two = GAMM(CURVE, "scat").fit(frame), GAMM(CURVE, "scat").fit(other)
    assert np.abs(one.fitted_values_ - two.fitted_values_).max() < 1e-4 * frame["y"].std()
    assert one.reml_ == pytest.approx(two.reml_, rel=1e-6)


@few
@given(seed=seeds, constant=st.floats(-1e3, 1e3), family=st.sampled_from(["gaussian", "scat"]))
def test_a_constant_moves_only_the_intercept(seed, constant, family):
    frame = data(seed)
    one = GAMM(CURVE, family).fit(frame)
    two = GAMM(CURVE, family).fit(frame, frame["y"] + constant)
    assert two.coef_[0] - one.coef_[0] == pytest.approx(constant, abs=1e-3)
    assert two.coef_[1:] == pytest.approx(one.coef_[1:], abs=2e-3)


@few
@given(seed=seeds, factor=st.floats(1e-6, 1e6), family=st.sampled_from(["gaussian", "scat"]))
def test_scaling_the_response_scales_everything(seed, factor, family):
    frame = data(seed)
    one = GAMM(CURVE, family).fit(frame)
    two = GAMM(CURVE, family).fit(frame, frame["y"] * factor)
    assert two.fitted_values_ / factor == pytest.approx(one.fitted_values_, abs=2e-3)
    assert two.sigma_ / factor == pytest.approx(one.sigma_, rel=1e-3)
    assert np.diag(two.Vp_) / factor**2 == pytest.approx(np.diag(one.Vp_), rel=1e-2, abs=1e-4)


@few
@given(seed=seeds)
def test_many_degrees_of_freedom_meet_the_gaussian_fit(seed):
    frame = data(seed)
    normal = GAMM(CURVE, method="REML").fit(frame)
    sigma = float(np.sqrt(normal.scale_))
    # a scaled t has its smoothing parameters relative to the data, a gaussian relative to data over variance
    sp = [value / sigma**2 for value in normal.smoothing_parameters_.values()]
    for method in ("fREML", "REML"):
        limit = GAMM(CURVE, ScaledT(nu=1e7, sigma=sigma), method, smoothing_parameters=sp).fit(frame)
        assert limit.fitted_values_ == pytest.approx(normal.fitted_values_, abs=1e-4)
        assert limit.edf_.sum() == pytest.approx(normal.edf_.sum(), rel=1e-4)
    assert limit.reml_ == pytest.approx(normal.reml_, rel=1e-4)


@few
@given(seed=seeds, nu=st.floats(3.1, 40), sigma=st.floats(0.1, 5))
def test_derivatives_of_the_scaled_t(seed, nu, sigma):
    r = np.random.default_rng(seed).standard_t(3, 6) * sigma
    theta, h = Theta.from_estimates(nu, sigma, 3.0), 1e-5
    d = t_derivatives(r, theta)
    assert d.eta[0] == pytest.approx(student.logpdf(r, nu, scale=sigma), abs=1e-8)
    size = sigma ** -np.arange(5.0)
    for j in range(4):
        difference = (
            t_derivatives(r - h * sigma, theta).eta[j] - t_derivatives(r + h * sigma, theta).eta[j]
        ) / (2 * h * sigma)
        assert difference == pytest.approx(d.eta[j + 1], abs=1e-4 * size[j + 1])
        for i, step in enumerate(((h, 0.0), (0.0, h))):
            up, down = t_derivatives(r, theta.step(*step)), t_derivatives(r, theta.step(-step[0], -step[1]))
            assert (up.eta[j] - down.eta[j]) / (2 * h) == pytest.approx(d.eta_theta[j, i], abs=1e-4 * size[j])
            if j < 3:
                second = (up.eta_theta[j] - down.eta_theta[j]) / (2 * h)
                assert second == pytest.approx(d.eta_theta2[j, i], abs=1e-4 * size[j])
    value, gradient, hessian = theta_objective(r, theta)
    assert value == pytest.approx(d.eta[0].sum())
    assert gradient == pytest.approx(d.eta_theta[0].sum(axis=1), abs=1e-6)
    assert hessian == pytest.approx(d.eta_theta2[0].sum(axis=-1), abs=1e-6)


def central(score, x, h=1e-4):
    """Gradient by central differences, and Hessian from the exact gradients."""
    gradient, hessian = np.empty(len(x)), np.empty((len(x), len(x)))
    for i in range(len(x)):
        step = np.zeros(len(x))
        step[i] = h
        up, down = score(x + step), score(x - step)
        gradient[i], hessian[i] = (up[0] - down[0]) / (2 * h), (up[1] - down[1]) / (2 * h)
    return gradient, hessian


@settings(max_examples=4, deadline=None)
@given(seed=seeds)
def test_scores_have_exact_gradients_and_hessians(seed):
    frame = data(seed)
    formula = Formula(
        "y", (Smooth(("x",), "tp", 8), Tensor(("x", "z"), "cr", (4, 4), "te"), RandomEffect("g"))
    )
    design = build_design(Formula("y", formula.terms[1:]), frame)
    X, y = design.rows.dense(slice(None)), frame["y"].to_numpy()
    active = np.arange(design.p)
    stack, _ = design.penalty_stack(active)
    rows, rng = table_rows(X), np.random.default_rng(seed)
    gram, cross = stack.rotate_both(rows.gram()), stack.rotate(rows.transpose(y))
    normal = NormalEquations(gram, cross, float(y @ y), len(y))
    rho = rng.uniform(-3, 4, stack.size)
    for scale in (None, 0.3):

        def score(x, scale=scale):
            found = gaussian_score(normal, stack, x, scale)
            return found.value, found.gradient, found.hessian

        gradient, hessian = central(score, rho)
        assert score(rho)[1] == pytest.approx(gradient, abs=1e-5)
        assert score(rho)[2] == pytest.approx(hessian, abs=1e-5)
    model = LaplaceModel(rows, y, stack, ScaledT(), gaussian_score(normal, stack, rho, None).beta)

    def laplace(x):
        return model.value(x[:-2], Theta(x[-2], x[-1], 3.0))

    point = np.append(rho, [0.7, -0.8])
    gradient, hessian = central(laplace, point)
    assert laplace(point)[1] == pytest.approx(gradient, abs=1e-4)
    assert laplace(point)[2] == pytest.approx(hessian, abs=1e-4)


@few
@given(logs=st.lists(st.floats(-12, 12), min_size=3, max_size=3), count=st.integers(1, 3))
def test_log_determinant_of_several_penalties(logs, count):
    rng = np.random.default_rng(3)
    D = [np.diff(np.eye(4), axis=0), np.diff(np.eye(3), axis=0)]
    parts = [np.kron(D[0].T @ D[0], np.eye(3)), np.kron(np.eye(4), D[1].T @ D[1])]
    parts.append(parts[0] @ parts[1])
    Q = np.linalg.qr(rng.normal(size=(12, 12)))[0]
    matrices = [Q.T @ S @ Q for S in parts][:count]
    stack = PenaltyStack(14, [(2, matrices)])
    rho = np.array(logs[:count])
    value, gradient, _ = stack.log_determinant(rho)
    # all parts share their eigenvectors, so the truth needs no cancelling sums
    share = np.linalg.eigh(sum(np.pi**j * S for j, S in enumerate(parts)))[1]
    diagonals = np.array([np.diag(share.T @ S @ share).clip(0) for S in parts[:count]])
    diagonals[diagonals < 1e-9] = 0
    seen = diagonals.any(axis=0)
    truth = np.log(np.exp(rho) @ diagonals[:, seen]).sum()
    assert value == pytest.approx(truth, abs=1e-4)
    assert gradient.sum() == pytest.approx(seen.sum(), abs=1e-4)
    assert stack.null_dim == 14 - seen.sum()


def test_factor_smooths_and_parametric_levels_agree_with_least_squares():
    frame = data(1).assign(w=lambda f: np.where(f["z"] > 0, "hi", "lo"))
    formula = Formula("y", (Parametric("w"), Parametric("z"), Smooth(("x",), "ps", 5, by="w")))
    model = GAMM(formula, smoothing_parameters=[1e-10, 1e-10]).fit(frame)
    X = np.hstack([fitted.matrix(frame) for fitted in model.terms_])
    beta = np.linalg.lstsq(X, frame["y"], rcond=None)[0]
    assert model.fitted_values_ == pytest.approx(X @ beta, abs=1e-6)
