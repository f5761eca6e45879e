"""The type of a prediction follows from its options."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

SCRIPT = """
from typing import assert_type
import pandas as pd
from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm import GAMM, Summary

frame = pd.DataFrame({"x": [1.0], "y": [2.0]})
model = GAMM("y ~ s(x)").fit(frame)
assert_type(model, GAMM)
assert_type(model.predict(frame), FloatArray)
assert_type(model.predict(frame, se=True), tuple[FloatArray, FloatArray])
assert_type(model.predict(frame, terms=True), pd.DataFrame)
assert_type(model.predict(frame, ["s(x)"], se=True, terms=True), tuple[pd.DataFrame, pd.DataFrame])
assert_type(model.summary(), Summary)
"""


@pytest.mark.skipif(find_spec("mypy") is None, reason="no mypy: the extra `dev` has it")
@pytest.mark.parametrize(
    ("line", "code"), [("", 0), ("model.predict(frame).columns", 1), ("model.predict(frame, ses=True)", 1)]
)
def test_mypy_infers_them(tmp_path, line, code):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT + line + "\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(script)],
        cwd=Path(__file__).parents[1] / "src",
        capture_output=True,
        text=True,
    )
    assert done.returncode == code, done.stdout
