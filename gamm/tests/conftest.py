"""Where tests find the fits of real trips by mgcv; what needs them skips where they are missing."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("gate", derandomize=True, deadline=None)  # no test asserts a time
settings.load_profile("gate")


@pytest.fixture(scope="session")
def reference_dir():
    folder = Path(os.environ.get("TRIPWATT_REFERENCE", "../shared/reference"))
    if not (folder / "mgcv").is_dir():
        pytest.skip(f"no fits of mgcv at {folder}: set TRIPWATT_REFERENCE to the folder that holds them")
    return folder
