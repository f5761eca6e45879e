"""Spline bases: what a smooth becomes without wiggliness."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamm_samples import clustered
from tripwatt_gamm import GAMM, Formula, Smooth

few = settings(max_examples=8, deadline=None)


seeds = st.integers(0, 10_000)


@few
@given(seed=seeds, basis=st.sampled_from(["ps", "tp", "cr"]), power=st.floats(9, 14))
def test_a_huge_smoothing_parameter_gives_a_straight_line(seed, basis, power):
    frame = clustered(seed, n=160)
    model = GAMM(Formula("y", (Smooth(("x",), basis, 10),)), smoothing_parameters=[10.0**power]).fit(frame)
    line = np.polyval(np.polyfit(frame["x"], frame["y"], 1), frame["x"])
    assert np.abs(model.fitted_values_ - line).max() < 1e-3 * frame["y"].std()
    assert model.edf_.sum() == pytest.approx(2, abs=1e-3)
