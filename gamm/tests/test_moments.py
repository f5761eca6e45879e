"""Sums over autocorrelated rows are those of the whitened rows."""

import numpy as np
import pandas as pd
import pytest

from tripwatt_gamm import GAMM, Formula, Smooth


def test_autocorrelation_is_found_and_widens_the_bands():
    rng = np.random.default_rng(2)
    n, rho = 400, 0.8
    e = rng.normal(size=(10, n))
    for i in range(1, n):
        e[:, i] = rho * e[:, i - 1] + np.sqrt(1 - rho**2) * e[:, i]
    frame = pd.DataFrame({"t": np.tile(np.linspace(0, 1, n), 10), "g": np.repeat(np.arange(10), n)})
    frame["y"] = np.sin(5 * frame["t"]) + e.ravel()
    formula = Formula("y", (Smooth(("t",), "ps", 20),))
    plain = GAMM(formula).fit(frame)
    model = GAMM(formula, ar1_rho="estimate").fit(frame, groups="g")
    assert model.ar1_rho_ == pytest.approx(rho, abs=0.03)
    assert model.scale_ == pytest.approx(1, abs=0.15)
    assert model.edf_.sum() < plain.edf_.sum()
    # against the whitened rows themselves
    y, whitened = frame["y"].to_numpy(), model.ar1_rho_
    dense = np.hstack([fitted.matrix(frame) for fitted in model.terms_])
    first = np.r_[True, np.diff(frame["g"]) != 0]
    W = np.where(
        first[:, None], dense, (dense - whitened * np.roll(dense, 1, axis=0)) / np.sqrt(1 - whitened**2)
    )
    v = np.where(first, y, (y - whitened * np.roll(y, 1)) / np.sqrt(1 - whitened**2))
    S = np.zeros((20, 20))
    S[1:, 1:] = model.smoothing_parameters_["s(t)"] * model.terms_[1].penalties[0]
    assert model.coef_ == pytest.approx(np.linalg.solve(W.T @ W + S, W.T @ v), abs=1e-6)
    shuffled = frame.sample(frac=1, random_state=0).sort_values(["t"], kind="stable")
    assert GAMM(formula, ar1_rho="estimate").fit(shuffled, groups="g").reml_ == pytest.approx(
        model.reml_, rel=1e-6
    )
    assert np.isfinite(GAMM(formula, ar1_rho=0.8).leave_groups_out(frame, groups="g")).all()
