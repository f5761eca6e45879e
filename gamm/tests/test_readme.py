"""The README runs and prints what it shows; the engine needs nothing of tripwatt."""

import doctest
import subprocess
import sys
from pathlib import Path

GAMM = Path(__file__).parents[1]
SCRIPT = """
import sys
from tripwatt_gamm import GAMM

assert not {"matplotlib", "sklearn", "tripwatt"} & set(sys.modules)
sys.modules["matplotlib"] = None
import tripwatt_gamm.figures
"""


def test_the_readme_prints_what_it_shows(monkeypatch):
    monkeypatch.chdir(GAMM)
    result = doctest.testfile(f"{GAMM / 'README.md'}", module_relative=False)
    assert (result.failed, result.attempted > 6) == (0, True)


def test_it_needs_nothing_of_tripwatt_and_figures_say_what_installs_them():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert done.stderr.strip().endswith("ImportError: figures need matplotlib: pip install matplotlib")
