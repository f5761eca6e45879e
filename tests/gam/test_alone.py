"""The engine needs no car, no trip and no figure until one is drawn: it works without the rest of the package."""

import shutil
import subprocess
import sys
from pathlib import Path

import tripwatt

PACKAGE = Path(tripwatt.__file__).parent
SHARED = ("errors.py", "arrays.py", "figures.py")

SCRIPT = """
import sys
import numpy as np, pandas as pd
from tripwatt.gam import GAMM

assert "matplotlib" not in sys.modules
g = np.repeat(np.arange(6), 20)
x = np.tile(np.linspace(0, 1, 20), 6)
y = np.sin(5 * x) + 0.3 * (g % 3) * x + 0.1 * np.cos(37 * np.arange(120))
model = GAMM("y ~ s(x, k=6) + (1 + x | g)").fit(pd.DataFrame({"x": x, "g": g, "y": y}))
assert "Variance components:" in model.summary().text()
assert len(model.plot().axes) == 3
print(*sorted(name for name in sys.modules if name.startswith("tripwatt.") and name.count(".") == 1))
"""


def test_it_works_without_the_rest_of_the_package(tmp_path):
    alone = tmp_path / "tripwatt"
    shutil.copytree(PACKAGE / "gam", alone / "gam", ignore=shutil.ignore_patterns("__pycache__"))
    for name in SHARED:
        shutil.copy(PACKAGE / name, alone)
    (alone / "__init__.py").touch()
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, env={"PYTHONPATH": str(tmp_path)}
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["tripwatt.arrays", "tripwatt.errors", "tripwatt.figures", "tripwatt.gam"]
