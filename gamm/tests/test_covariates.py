"""Columns of a frame: rounding, and the support of training data."""

import numpy as np
import pandas as pd
import pytest

from tripwatt_gamm import GAMM, Formula, Smooth, Tensor
from tripwatt_gamm.covariates import Points, Support, grid_limit


def test_discretised_points_stay_within_half_a_step():
    x = np.random.default_rng(0).normal(size=(5000, 2))
    limit = grid_limit(x, 1000)
    points = Points.from_values(x, (limit, limit))
    assert len(points.values) <= 10_000
    step = np.ptp(x, axis=0) / (limit - 1)
    assert (np.abs(points.values[points.index] - x) <= step / 2 + 1e-12).all()
    assert points.counts.sum() == 5000


def test_a_surface_stays_bounded_far_from_its_data(frame):
    rng = np.random.default_rng(5)
    diagonal = pd.DataFrame({"x": rng.uniform(0, 1, 300)})
    diagonal["z"] = diagonal["x"] + rng.normal(0, 0.02, 300)
    diagonal["y"] = 5 * diagonal["x"] + rng.normal(0, 0.1, 300)
    surface = GAMM(Formula("y", (Tensor(("x", "z"), "ps", (6, 6), "te"),))).fit(diagonal)
    corner = pd.DataFrame({"x": [0.0, 1.0, 50.0], "z": [1.0, 0.0, -50.0]})
    assert surface.extrapolation_mask(corner).all()
    low, high = diagonal["y"].min() - 3, diagonal["y"].max() + 3
    assert ((surface.predict(corner) > low) & (surface.predict(corner) < high)).all()
    points = Support(frame[["x", "z"]].to_numpy())
    moved = points.clamp(np.array([[100.0, 100.0]]))
    assert not points.outside(moved).any()


def test_terms_of_one_covariate_are_held_at_the_same_point(frame):
    terms = (Smooth(("x",), "ps", 8), Smooth(("z",), "ps", 8), Tensor(("x", "z"), "ps", (5, 5)))
    model = GAMM(Formula("y", terms), extrapolation="clamp").fit(frame)
    support = model.training_.supports[("x", "z")]
    far = pd.DataFrame({"x": [-2.0, 5.0, 9.0], "z": [3.0, -3.0, 9.0]})
    there = pd.DataFrame(support.clamp(far.to_numpy()), columns=["x", "z"])
    assert model.predict(far) == pytest.approx(model.predict(there))
