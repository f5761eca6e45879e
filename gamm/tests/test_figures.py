"""Residual figures and effects: their numbers, and that they draw what they say."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from scipy import stats

from tripwatt_gamm import autocorrelation, concurvity
from tripwatt_gamm.effects import CurveEffect, RandomEffects, SurfaceEffect
from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.model import GAMM


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(11)
    n, groups = 600, 20
    frame = pd.DataFrame({"x": rng.uniform(0, 1, n), "g": np.repeat(np.arange(groups), n // groups)})
    frame["g"] = "g" + frame["g"].astype(str)
    frame["f"] = np.where(frame["x"] * 0 + rng.uniform(size=n) < 0.5, "up", "down")
    frame["u"] = rng.uniform(0, 1, n)
    frame["v"] = frame["u"] * rng.uniform(0, 1, n)  # a triangle: one corner has no data
    wave = np.sin(6 * frame["x"]) * np.where(frame["f"] == "up", 1, -1)
    frame["y"] = wave + frame["u"] * frame["v"] * 3 + 0.7 * rng.normal(size=groups).repeat(n // groups)
    frame["y"] += 0.2 * rng.standard_t(6, n)
    return frame


@pytest.fixture(scope="module")
def fit(data):
    return GAMM('y ~ f + s(x, by=f, k=8) + te(u, v, k=4) + s(g, bs="re")', family="scat").fit(data)


def test_quantiles_of_a_right_model_follow_the_line(fit):
    qq = fit.diagnosis().qq
    n, (lower, upper) = len(qq.residual), qq.band()
    np.testing.assert_allclose(qq.theoretical, fit.sigma_ * stats.t.ppf((np.arange(n) + 0.5) / n, fit.nu_))
    assert (np.diff(qq.residual) >= 0).all()
    assert ((qq.residual >= lower) & (qq.residual <= upper)).mean() > 0.8


def test_frame_of_the_diagnosis_is_the_data_row_by_row(fit, data):
    table = fit.diagnosis().frame()
    np.testing.assert_allclose(table["response"], data["y"])
    np.testing.assert_allclose(table["response"] - table["fitted"], table["residual"], atol=1e-12)
    assert np.array_equal(table["theoretical"].rank(), table["residual"].rank())


def test_histogram_counts_every_residual_once(fit):
    histogram = fit.diagnosis().histogram
    assert histogram.count.sum() + histogram.below + histogram.above == fit.n_
    assert histogram.expected.sum() == pytest.approx(histogram.count.sum(), rel=0.05)


def test_diagnosis_draws_four_labelled_panels(fit):
    figure = fit.diagnosis().plot()
    assert isinstance(figure, Figure)
    axes = figure.axes
    assert len({ax.get_title() for ax in axes}) == 4
    assert all(ax.get_xlabel() and ax.get_ylabel() for ax in axes)
    figure.canvas.draw()


def test_autocorrelation_refuses_what_it_cannot_use():
    with pytest.raises(InvalidInput, match=r"lengths differ[\s\S]*not finite"):
        autocorrelation([1.0, np.nan], ["a"])
    with pytest.raises(InvalidInput, match="no pair"):
        autocorrelation([1.0, 2.0], ["a", "b"])


def test_concurvity_lies_between_zero_and_one(fit):
    table = concurvity(fit)
    assert list(table.index) == ["parametric", *[b.label for b in fit.terms_ if b.kind != "parametric"]]
    assert table.to_numpy().min() >= 0
    assert table.to_numpy().max() <= 1
    assert (table["worst"] >= table["observed"] - 1e-9).all()


def test_curve_is_the_models_own_prediction(fit, data):
    found = fit.effects(data, level=0.9, points=50)
    curve = found["s(x):fup"]
    assert isinstance(curve, CurveEffect)
    table = curve.frame()
    grid = data.iloc[[0] * 50].assign(x=table["x"].to_numpy(), f="up")
    terms, errors = fit.predict(grid, terms=True, se=True)
    np.testing.assert_allclose(table["effect"], terms["s(x):fup"], atol=1e-9)
    np.testing.assert_allclose(
        table["upper"] - table["effect"], stats.norm.ppf(0.95) * errors["s(x):fup"], rtol=1e-6
    )
    own = data.loc[data["f"] == "up", "x"]
    assert (table["x"].min(), table["x"].max()) == pytest.approx((own.min(), own.max()))
    assert len(curve.rug) == (data["f"] == "up").sum()
    truth = np.sin(6 * table["x"])
    assert np.corrcoef(truth, table["effect"])[0, 1] > 0.99


def test_surface_hides_what_is_far_from_all_data(fit, data):
    surface = fit.effects(data)["te(u,v)"]
    assert isinstance(surface, SurfaceEffect)
    table = surface.frame()
    assert table.loc[(table["u"] < 0.3) & (table["v"] > 0.8), "effect"].isna().all()
    near = table.dropna()
    assert np.corrcoef(3 * near["u"] * near["v"], near["effect"])[0, 1] > 0.95
    assert fit.effects()["te(u,v)"].frame()["effect"].notna().all()


def test_random_effects_are_sorted_named_and_scaled(fit, data):
    found = fit.effects()["s(g)"]
    assert isinstance(found, RandomEffects)
    table = found.frame()
    assert table["effect"].is_monotonic_increasing
    assert sorted(table["level"]) == sorted(data["g"].unique())
    assert found.sd == pytest.approx(0.7, rel=0.5)
    one = data.iloc[[0]]
    expected = fit.predict(one, terms=True)["s(g)"].iloc[0]
    assert table.set_index("level").loc[one["g"].iloc[0], "effect"] == pytest.approx(expected)


def test_all_effects_are_drawn_and_labelled(fit, data):
    found = fit.effects(data)
    assert list(found) == ["f", "s(x):fdown", "s(x):fup", "te(u,v)", "s(g)"]
    assert found["f"].frame()["level"].tolist() == ["up"]
    figure = fit.plot(data)
    figure.canvas.draw()
    shown = [ax for ax in figure.axes if ax.axison and ax.get_title()]
    assert [ax.get_title().split(", EDF")[0] for ax in shown] == list(found)
    assert all(ax.get_xlabel() for ax in shown)


def test_effects_refuse_nonsense(fit, data):
    with pytest.raises(InvalidInput, match=r"value out of range[\s\S]*grid too coarse"):
        fit.effects(level=2.0, points=1)
    with pytest.raises(InvalidInput, match="unknown column"):
        fit.effects(data.drop(columns="x"))
