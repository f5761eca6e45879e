"""Prediction at rows that training did not have: the stated rules."""

import numpy as np
import pandas as pd
import pytest

from gamm_samples import X, study
from tripwatt_gamm import GAMM, Formula, Parametric, Smooth


def test_unseen_levels_follow_the_stated_rule(frame, model):
    row = frame.iloc[[0]]
    seen = [model.predict(row.assign(w=level, g="new"))[0] for level in "abc"]
    share = frame["w"].value_counts(normalize=True).loc[list("abc")].to_numpy()
    assert model.predict(row.assign(w="never", g="new"))[0] == pytest.approx(np.array(seen) @ share)
    assert model.predict(row.drop(columns="g"))[0] == pytest.approx(model.predict(row, exclude=["s(g)"])[0])
    assert model.extrapolation_mask(row.assign(w="never")).all()
    assert not model.extrapolation_mask(frame).any()


def test_outside_the_range_a_curve_is_held_or_goes_straight(frame):
    far = pd.DataFrame({"x": np.array([5.5, 6.5, 7.5, 1e6])})
    held = GAMM(Formula("y", (X,)), extrapolation="clamp").fit(frame)
    assert np.ptp(held.predict(far)) < 1e-9
    assert held.extrapolation_mask(far).all()
    straight = GAMM(Formula("y", (X,))).fit(frame)
    steps = np.diff(straight.predict(far)[:3])
    assert steps[0] == pytest.approx(steps[1])
    slope = Formula("y", (Parametric("x"),))
    assert np.ptp(GAMM(slope, extrapolation="clamp").fit(frame).predict(far)) < 1e-9
    line = GAMM(slope).fit(frame)
    assert np.diff(line.predict(far))[0] == pytest.approx(line.coef_[1])
    edge = straight.predict(pd.DataFrame({"x": [frame["x"].max() - 0.001, frame["x"].max()]}))
    assert steps[0] == pytest.approx((edge[1] - edge[0]) / 0.001, rel=0.02)


def test_a_level_has_its_own_range(frame):
    half = frame[(frame["w"] != "a") | (frame["x"] < 1)]
    for by in ("w", "on"):
        rows = half if by == "w" else frame[(frame["on"] == 0) | (frame["x"] < 1)]
        level = {"w": "a"} if by == "w" else {"on": 1.0}
        formula = Formula("y", (Smooth(("x",), "ps", 10, by=by),))
        model = GAMM(formula, extrapolation="clamp").fit(rows)
        far = pd.DataFrame({"x": [1.5, 3.0, 4.5]}).assign(**level)
        assert np.ptp(model.predict(far)) < 1e-9
        assert model.extrapolation_mask(far).all()
        assert not model.extrapolation_mask(rows).any()


def test_beyond_its_range_a_slope_is_held_as_the_fixed_effect_is():
    frame = study("sleepstudy")
    far = pd.DataFrame({"days": [9.0, 20.0], "subject": [308, 308]})
    formula = 'reaction ~ days + s(subject, days, bs="re")'
    held = GAMM(formula, extrapolation="clamp").fit(frame)
    assert held.predict(far)[1] == pytest.approx(held.predict(far)[0])
    assert held.extrapolation_mask(far).tolist() == [False, True]
    only = GAMM('reaction ~ s(subject, days, bs="re")', extrapolation="clamp").fit(frame)
    assert only.extrapolation_mask(far).tolist() == [False, True]
    assert only.predict(far)[1] == pytest.approx(only.predict(far)[0])
    straight = GAMM(formula).fit(frame)
    slope = straight.coef_[1] + straight.coef_[2]
    assert np.diff(straight.predict(far))[0] == pytest.approx(11 * slope)
