"""Scores have exact derivatives, and meet the gaussian ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamm_samples import clustered
from tripwatt_gamm import GAMM, Formula, Gamma, Poisson, RandomEffect, ScaledT, Smooth, Tensor
from tripwatt_gamm.design import build_design
from tripwatt_gamm.families import Response
from tripwatt_gamm.fit import gaussian_score
from tripwatt_gamm.laplace import LaplaceModel
from tripwatt_gamm.moments import NormalEquations

few = settings(max_examples=8, deadline=None)


seeds = st.integers(0, 10_000)


CURVE = Formula("y", (Smooth(("x",), "ps", 12), RandomEffect("g")))


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
    frame = clustered(seed, n=160)
    formula = Formula(
        "y", (Smooth(("x",), "tp", 8), Tensor(("x", "z"), "cr", (4, 4), "te"), RandomEffect("g"))
    )
    design = build_design(Formula("y", formula.terms[1:]), frame)
    rows, y = design.rows, frame["y"].to_numpy()
    active = np.arange(design.rows.p)
    stack, _ = design.penalty_stack(active)
    rng = np.random.default_rng(seed)
    normal = NormalEquations.of_rows(rows, y).rotated(stack)
    rho = rng.uniform(-3, 4, stack.size)
    for scale in (None, 0.3):

        def score(x, scale=scale):
            found = gaussian_score(normal, stack, x, scale)
            return found.value, found.gradient, found.hessian

        gradient, hessian = central(score, rho)
        assert score(rho)[1] == pytest.approx(gradient, abs=1e-5)
        assert score(rho)[2] == pytest.approx(hessian, abs=1e-5)
    mean = np.exp(y - y.mean())
    start = gaussian_score(normal, stack, rho, None).beta
    for family, values, theta in (
        (ScaledT(), y, [0.7, -0.8]),
        (Gamma(), mean, [-0.5]),
        (Poisson(), mean.round(), [0.0]),
    ):
        model = LaplaceModel(rows, Response.of(values), stack, family, start if values is y else 0 * start)
        point = np.append(rho, theta)

        def laplace(x, model=model):
            mode = model.mode(x)
            return model.score(x, mode), model.gradient(x, mode)

        gradient, hessian = central(laplace, point)
        _, exact, differences = model.value(point, np.ones(len(point), dtype=bool))
        assert exact == pytest.approx(gradient, abs=1e-4)
        assert differences == pytest.approx(hessian, abs=1e-3 * np.abs(hessian).max())


@few
@given(seed=seeds)
def test_many_degrees_of_freedom_meet_the_gaussian_fit(seed):
    frame = clustered(seed, n=160)
    normal = GAMM(CURVE, method="REML").fit(frame)
    sigma = float(np.sqrt(normal.scale_))
    # a scaled t has its smoothing parameters relative to the data, a gaussian relative to data over variance
    sp = [value / sigma**2 for value in normal.smoothing_parameters_.values()]
    for method in ("fREML", "REML"):
        limit = GAMM(CURVE, ScaledT(nu=1e7, sigma=sigma), method, smoothing_parameters=sp).fit(frame)
        assert limit.fitted_values_ == pytest.approx(normal.fitted_values_, abs=1e-4)
        assert limit.edf_.sum() == pytest.approx(normal.edf_.sum(), rel=1e-4)
    assert limit.reml_ == pytest.approx(normal.reml_, rel=1e-4)
