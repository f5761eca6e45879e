"""Effects of terms: their numbers, and that they draw what they say."""

import numpy as np
import pytest

from tripwatt_gamm.effects import CurveEffect, RandomEffects, SurfaceEffect
from tripwatt_gamm.errors import InvalidInput


def test_curve_is_the_models_own_prediction(waves_fit, waves):
    curve = waves_fit.effects(waves, level=0.9, points=50)["s(x):fup"]
    assert isinstance(curve, CurveEffect)
    table = curve.frame()
    grid = waves.iloc[[0] * 50].assign(x=table["x"].to_numpy(), f="up")
    others = [fitted.label for fitted in waves_fit.terms_ if fitted.label != "s(x):fup"]
    found = waves_fit.intervals(grid, 0.9, others)
    np.testing.assert_allclose(table["effect"], found["mean"], atol=1e-9)
    np.testing.assert_allclose(table["upper"], found["upper"], atol=1e-6)
    own = waves.loc[waves["f"] == "up", "x"]
    assert (table["x"].min(), table["x"].max()) == pytest.approx((own.min(), own.max()))
    assert len(curve.rug) == (waves["f"] == "up").sum()
    truth = np.sin(6 * table["x"])
    assert np.corrcoef(truth, table["effect"])[0, 1] > 0.99


def test_surface_hides_what_is_far_from_all_data(waves_fit, waves):
    surface = waves_fit.effects(waves)["te(u,v)"]
    assert isinstance(surface, SurfaceEffect)
    table = surface.frame()
    assert table.loc[(table["u"] < 0.3) & (table["v"] > 0.8), "effect"].isna().all()
    near = table.dropna()
    assert np.corrcoef(3 * near["u"] * near["v"], near["effect"])[0, 1] > 0.95
    assert waves_fit.effects()["te(u,v)"].frame()["effect"].notna().all()


def test_random_effects_are_sorted_named_and_scaled(waves_fit, waves):
    found = waves_fit.effects()["s(g)"]
    assert isinstance(found, RandomEffects)
    table = found.frame()
    assert table["effect"].is_monotonic_increasing
    assert sorted(table["level"]) == sorted(waves["g"].unique())
    assert found.sd == pytest.approx(0.7, rel=0.5)
    one = waves.iloc[[0]]
    expected = waves_fit.predict_terms(one)["s(g)"].iloc[0]
    assert table.set_index("level").loc[one["g"].iloc[0], "effect"] == pytest.approx(expected)


def test_all_effects_are_drawn_and_labelled(waves_fit, waves):
    found = waves_fit.effects(waves)
    assert list(found) == ["f", "s(x):fdown", "s(x):fup", "te(u,v)", "s(g)"]
    assert found["f"].frame()["level"].tolist() == ["up"]
    figure = waves_fit.plot(waves)
    figure.canvas.draw()
    shown = [ax for ax in figure.axes if ax.axison and ax.get_title()]
    assert [ax.get_title().split(", EDF")[0] for ax in shown] == list(found)
    assert all(ax.get_xlabel() for ax in shown)


def test_effects_refuse_nonsense(waves_fit, waves):
    with pytest.raises(InvalidInput, match=r"value out of range[\s\S]*grid too coarse"):
        waves_fit.effects(level=2.0, points=1)
    with pytest.raises(InvalidInput, match="unknown column"):
        waves_fit.effects(waves.drop(columns="x"))
