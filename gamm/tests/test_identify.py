"""Directions that nothing determines are removed and noted; too few rows are refused."""

import numpy as np
import pandas as pd
import pytest

from gamm_samples import X
from tripwatt_gamm import GAMM, Formula, Parametric, Smooth
from tripwatt_gamm.errors import InvalidInput


def test_what_can_be_reduced_is_reduced_and_reported(frame):
    coarse = frame.assign(x=frame["x"].round())
    model = GAMM(Formula("y", (X,))).fit(coarse)
    assert "k reduced from 10 to 8" in model.notes_[0]
    twice = frame.assign(copy=2 * frame["z"] - 1, same=frame["w"])
    model = GAMM(
        Formula("y", (Parametric("z"), Parametric("copy"), Parametric("w"), Parametric("same"), X))
    ).fit(twice)
    assert {"copy", "sameb", "samec"} <= set(model.empty_columns_)
    assert model.fitted_values_ == pytest.approx(
        GAMM(Formula("y", (Parametric("z"), Parametric("w"), X))).fit(frame).fitted_values_, abs=1e-5
    )
    nested = GAMM(Formula("y", (Smooth(("x",)), Smooth(("z",)), Smooth(("x", "z"))))).fit(frame)
    assert "s(x,z) repeats" in nested.notes_[0]
    assert nested.terms_[-1].size == 27


def test_a_fold_with_as_few_rows_as_free_coefficients_is_refused():
    rng = np.random.default_rng(3)
    frame = pd.DataFrame({"x": rng.normal(size=6), "z": rng.normal(size=6), "y": rng.normal(size=6)})
    model = GAMM(Formula("y", (Parametric("x"), Parametric("z"))))
    held_out = model.leave_groups_out(frame, groups=np.arange(6) // 2)
    assert np.isfinite(held_out).all(), "four rows for three coefficients"
    with pytest.raises(InvalidInput) as caught:
        model.leave_groups_out(frame, groups=np.arange(6) // 3)
    (fault,) = caught.value.faults
    assert (fault.what, fault.got) == ("too few rows", "3 rows")
    assert fault.where == "without fold of row 0"
    assert fault.allowed == "more than 3 unpenalised coefficients"
    with pytest.raises(InvalidInput, match="too few rows"):
        model.fit(frame.iloc[:3])
