"""The type of a prediction follows from its options."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
from typing import assert_type
import pandas as pd
from tripwatt_gamm import GAMM, Summary
from tripwatt_gamm.arrays import FloatArray

frame = pd.DataFrame({"x": [1.0], "y": [2.0]})
model = GAMM("y ~ s(x)").fit(frame)
assert_type(model, GAMM)
assert_type(model.predict(frame), FloatArray)
assert_type(model.predict(frame, se=True), tuple[FloatArray, FloatArray])
assert_type(model.predict(frame, terms=True), pd.DataFrame)
assert_type(model.predict(frame, ["s(x)"], se=True, terms=True), tuple[pd.DataFrame, pd.DataFrame])
assert_type(model.summary(), Summary)
model.predict(frame).columns  # type: ignore[attr-defined]
model.predict(frame, ses=True)  # type: ignore[call-overload]
"""


def test_mypy_infers_them(tmp_path):
    """Strict mypy also refuses an ignored line that has no fault."""
    pytest.importorskip("mypy", reason="no mypy: the extra `dev` has it")
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, "-m", "mypy", "--strict", f"{tmp_path / 'script.py'}"]
    done = subprocess.run(command, cwd=Path(__file__).parents[1] / "src", capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
