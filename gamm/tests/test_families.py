"""Derivatives of the scaled t."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import t as student

from tripwatt_gamm.families import Theta, t_derivatives, theta_objective

few = settings(max_examples=8, deadline=None)


seeds = st.integers(0, 10_000)


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
