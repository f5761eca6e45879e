"""What tests of cars on the road share."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from tests.server.cars.messages import measured
from tests.support.drives import example_trip


@pytest.fixture(scope="session")
def drive() -> pd.DataFrame:
    """Ten minutes of a drive, a row each second."""
    return measured(example_trip()).iloc[:600]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "my-i3"
