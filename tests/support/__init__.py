"""What tests and benchmarks share: a running service, its load and its fuzzing, folders of the project."""

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
"""The folder of the project."""
