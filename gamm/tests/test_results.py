"""Degrees of freedom and likelihoods."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from gamm_samples import clustered
from tripwatt_gamm import GAMM, Formula, Smooth, Tensor

few = settings(max_examples=8, deadline=None)


seeds = st.integers(0, 10_000)


@few
@given(seed=seeds, logs=st.lists(st.floats(-12, 15), min_size=3, max_size=3))
def test_edf_lies_between_the_null_space_and_k(seed, logs):
    formula = Formula("y", (Smooth(("x",), "tp", 8), Tensor(("x", "z"), "ps", (5, 5))))
    model = GAMM(formula, smoothing_parameters=np.exp(logs)).fit(clustered(seed, n=160))
    for fitted in model.terms_:
        edf = model.edf_[fitted.slice].sum()
        assert fitted.null_dim - 1e-6 <= edf <= fitted.size + 1e-6
        assert edf <= model.edf1_[fitted.slice].sum() + 1e-6


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
