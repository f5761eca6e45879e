"""The summary of a fitted model: figures against mgcv, the paper's layout, levels without data."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from oracle import SYNTH
from tripwatt_gamm.model import GAMM
from tripwatt_gamm.summary import stars

FORMULAS = {
    "A": 'y ~ weather + season + s(time, by=season, bs="ps", k=12) + s(tamb, bs="ps", k=10) + s(vel, k=10)'
    ' + s(delev, bs="ps", k=10) + ti(tamb, delev, bs="ps", k=c(5, 5)) + s(trip, bs="re")',
    "B": 'y ~ weather + s(time) + s(vel) + s(tamb, delev, k=25) + s(trip, bs="re")',
}


PS = 'bs="ps", k=12'
TUM = {
    "core60s": 'y ~ weather + s(time) + s(tamb) + s(vel) + s(delev) + s(trip, bs="re")',
    "ps60s": f'y ~ weather + s(time, bs="ps", k=20) + s(tamb, {PS}) + s(vel, {PS}) + s(delev, {PS})'
    ' + ti(tamb, delev, bs="ps", k=c(6, 6)) + s(trip, bs="re")',
    "psby60s": f'y ~ weather + season + s(time, by=season, bs="ps", k=20) + s(tamb, {PS}) + s(vel, by=season, {PS})'
    f' + s(delev, by=season, {PS}) + ti(tamb, delev, bs="ps", k=c(6, 6)) + s(trip, bs="re")',
}


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


@pytest.mark.parametrize("kind", ["A", "B"])
@pytest.mark.parametrize("family", ["gaussian", "scat"])
def test_the_whole_page_is_that_of_mgcv_at_its_parameters(kind, family):
    folder = SYNTH / f"{kind}_gam_{family}"
    parameters = pd.read_csv(folder / "sp.csv")["sp"].to_numpy()
    model = GAMM(FORMULAS[kind], family=family, method="REML", smoothing_parameters=parameters)
    page = model.fit(pd.read_csv(SYNTH / "data.csv")).summary()
    smooths, parametric = pd.read_csv(folder / "smooths.csv"), pd.read_csv(folder / "parametric.csv")
    scalars = pd.read_csv(folder / "scalars.csv").iloc[0]
    assert list(page.smooth.index) == list(smooths["term"])
    assert list(page.parametric.index) == list(parametric["term"])
    np.testing.assert_allclose(page.smooth["edf"], smooths["edf"], atol=0.01)
    np.testing.assert_allclose(page.smooth[["ref_df", "statistic"]], smooths.iloc[:, 1:3], rtol=5e-4)
    np.testing.assert_allclose(page.smooth["p_value"], smooths.iloc[:, 3], atol=1e-3)
    np.testing.assert_allclose(page.parametric, parametric.iloc[:, :4], rtol=5e-4)
    assert page.reml == pytest.approx(scalars["score"], rel=1e-6)
    if family == "scat":
        assert (page.nu, page.sigma) == pytest.approx((scalars["nu"], scalars["sigma"]), rel=1e-4)


@pytest.mark.parametrize(
    "fit", ["core60s_gam_gauss", "core60s_gam_scat", "ps60s_gam_scat", "psby60s_gam_scat"]
)
def test_terms_are_those_of_mgcv_on_the_tum_regressions(reference_dir, fit):
    folder = reference_dir / "mgcv" / fit
    name, _, family = fit.split("_")
    family = {"gauss": "gaussian"}.get(family, family)
    parameters = pd.read_csv(folder / "sp.csv")["sp"].to_numpy()
    model = GAMM(TUM[name], family=family, method="REML", smoothing_parameters=parameters)
    page = model.fit(pd.read_csv(folder.parent / "tum_60s.csv")).summary()
    printed = pd.read_csv(folder / "edf.csv")
    np.testing.assert_allclose(page.smooth["edf"], printed["edf"], atol=0.01)
    tested = printed["stat"].notna().to_numpy()  # the random effect was not
    ours = page.smooth[tested]
    np.testing.assert_allclose(
        ours[["ref_df", "statistic"]], printed.loc[tested, ["ref.df", "stat"]], rtol=5e-4
    )
    np.testing.assert_allclose(ours["p_value"], printed.loc[tested, "p"], atol=1e-3)
    assert page.reml == pytest.approx(pd.read_csv(folder / "scalars.csv")["score"][0], rel=1e-6)


def test_level_without_data_is_zero_everywhere(fit):
    page = fit.summary()
    row = page.frame().set_index("term").loc["kind & co_1<never>"]
    assert (row["estimate"], row["std_error"], row["stars"]) == (0.0, 0.0, "")
    assert np.isnan(row["p_value"])
    line = next(line for line in page.text().splitlines() if line.startswith("kind & co_1<never>"))
    assert line.split()[-2:] == ["0.0000", "0.0000"]
    assert "no data" in page.html()
    assert r"kind \& co\_1<never> & $0.00 \; (0.00)$ \\" in re.sub(" +&", " &", page.latex())


def test_html_is_well_formed_and_holds_every_row(fit):
    page = fit.summary()
    table = ElementTree.fromstring(page.html("TUM & co"))
    body = table.find("tbody")
    assert [row.findtext("th") for row in body] == [label for label, _, _ in page.rows()]
    assert len(body) == len(page.frame()) == 7 - 1


def test_latex_has_the_layout_of_the_paper(fit):
    lines = fit.summary().latex("Model TUM").splitlines()
    assert lines[:4] == [r"\begin{tabular}{l c}", r"\hline", r" & Model TUM \\", r"\hline"]
    smooth = next(line for line in lines if line.startswith("EDF: s(x)"))
    assert re.fullmatch(r"EDF: s\(x\) +& \$\d+\.\d\d \\; \(\d+\.\d\d\)\^\{\*\*\*\}\$ \\\\", smooth)


def test_text_says_what_was_estimated_and_what_went_wrong(fit):
    page = fit.summary()
    assert f"nu {page.nu:.4g}" in page.text()
    assert ("at bound" in page.text()) == page.nu_at_bound
    for value in (f"{page.reml:.4f}", f"{page.r2:.3f}", "n:                  240"):
        assert value in page.text()
    broken = replace(page, converged=False, message="120 passes", nu_at_bound=True, notes=("s(z) reduced",))
    for word in ("did not converge", "120 passes", "(at bound)", "Note: s(z) reduced"):
        assert word in broken.text()
        assert word.removeprefix("Note: ") in broken.html()


def test_constant_model_has_an_empty_smooth_table(data):
    page = GAMM("y ~ 1").fit(data).summary()
    assert page.parametric.loc["(Intercept)", "estimate"] == pytest.approx(data["y"].mean())
    assert len(page.smooth) == 0
    assert "Smooth terms" not in page.text()


def test_stars_change_at_their_levels():
    assert [stars(p) for p in (0.0009, 0.001, 0.009, 0.01, 0.049, 0.05)] == ["***", "**", "**", "*", "*", ""]
