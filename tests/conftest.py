"""Where tests find the real data; everything that needs it skips with a reason where it is missing."""

import os
from pathlib import Path

import pytest
from hypothesis import settings
from tests.support import ROOT

settings.register_profile("gate", derandomize=True, deadline=None)  # no test asserts a time
settings.register_profile("search", deadline=None)
settings.load_profile(os.environ.get("TRIPWATT_HYPOTHESIS", "gate"))
"""The gate draws the same examples in every run; TRIPWATT_HYPOTHESIS=search draws new ones."""


def _shared(variable: str, default: str) -> Path:
    folder = Path(os.environ.get(variable, ROOT / default))
    if not folder.is_dir():
        pytest.skip(f"no data at {folder}: set {variable} to the folder that holds it")
    return folder


@pytest.fixture(scope="session")
def data_dir() -> Path:
    return _shared("TRIPWATT_DATA", "../shared/data")


@pytest.fixture(scope="session")
def reference_dir() -> Path:
    return _shared("TRIPWATT_REFERENCE", "../shared/reference")
