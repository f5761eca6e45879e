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
    line = next(line for line in page.text().splitlines() if line.startswith("kind & co_1<never>"))
    assert line.split()[-2:] == ["0.0000", "0.0000"]


def test_text_says_what_was_estimated_and_what_went_wrong(fit):
    page = fit.summary()
    assert f"nu {page.nu:.4g}" in page.text()
    assert ("at bound" in page.text()) == page.nu_at_bound
    for value in (f"{page.reml:.4f}", f"{page.r2:.3f}", "n:                  240"):
        assert value in page.text()
    broken = replace(page, converged=False, message="120 passes", nu_at_bound=True, notes=("s(z) reduced",))
    for word in ("did not converge", "120 passes", "(at bound)", "Note: s(z) reduced"):
        assert word in broken.text()


def test_constant_model_has_an_empty_smooth_table(data):
    page = GAMM("y ~ 1").fit(data).summary()
    assert page.parametric.loc["(Intercept)", "estimate"] == pytest.approx(data["y"].mean())
    assert len(page.smooth) == 0
    assert "Smooth terms" not in page.text()


def test_stars_change_at_their_levels():
    assert [stars(p) for p in (0.0009, 0.001, 0.009, 0.01, 0.049, 0.05)] == ["***", "**", "**", "*", "*", ""]
