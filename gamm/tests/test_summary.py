"""The summary of a fitted model: what it prints, levels without data."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tripwatt_gamm.model import GAMM
from tripwatt_gamm.summary import stars


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(4)
    n, groups = 240, 12
    frame = pd.DataFrame(
        {"x": rng.uniform(0, 1, n), "z": rng.normal(size=n), "g": np.repeat(np.arange(groups), n // groups)}
    )
    frame["g"] = "g" + frame["g"].astype(str)
    frame["kind & co_1"] = pd.Categorical(rng.choice(["a", "b"], n), categories=["a", "b", "<never>"])
    shift = rng.normal(size=groups).repeat(n // groups)
    frame["y"] = np.sin(6 * frame["x"]) + shift + (frame["kind & co_1"] == "b") + 0.3 * rng.standard_t(4, n)
    return frame


@pytest.fixture(scope="module")
def fit(data):
    return GAMM('y ~ `kind & co_1` + s(x) + s(z, k=5) + s(g, bs="re")', family="scat").fit(data)


def test_level_without_data_is_zero_everywhere(fit):
    page = fit.summary()
    row = page.parametric.loc["kind & co_1<never>"]
    assert (row["estimate"], row["std_error"]) == (0.0, 0.0)
    assert np.isnan(row["p_value"])
    assert ("kind & co_1<never>", "0.00 (0.00)", "") in page.rows()
    line = next(line for line in str(page).splitlines() if line.startswith("kind & co_1<never>"))
    assert line.split()[-2:] == ["0.0000", "0.0000"]


def test_text_says_what_was_estimated_and_what_went_wrong(fit):
    page = fit.summary()
    assert f"Family: Scaled t({page.nu:.4g},{page.sigma:.4g})" in str(page)
    assert ("at bound" in page.distribution()) == page.nu_at_bound
    for value in (f"fREML = {page.reml:.5g}", f"R-sq.(adj) = {page.r2:6.3g}", "n = 240"):
        assert value in str(page)
    broken = replace(page, converged=False, message="120 passes", notes=("s(z) reduced",))
    for word in ("did not converge", "120 passes", "Note: s(z) reduced"):
        assert word in str(broken)


def test_constant_model_has_an_empty_smooth_table(data):
    page = GAMM("y ~ 1").fit(data).summary()
    assert page.parametric.loc["(Intercept)", "estimate"] == pytest.approx(data["y"].mean())
    assert len(page.smooth) == 0
    assert "smooth terms" not in str(page)


def test_stars_change_at_their_levels():
    assert [stars(p) for p in (0.0009, 0.001, 0.009, 0.01, 0.049, 0.05)] == ["***", "**", "**", "*", "*", ""]
