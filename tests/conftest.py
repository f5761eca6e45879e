"""Where tests find the real data; everything that needs it skips with a reason where it is missing."""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import typer.main
import typer.testing
from hypothesis import settings
from tests.support import ROOT
from tests.support.front_end import with_packages

settings.register_profile("gate", derandomize=True, deadline=None)  # no test asserts a time
settings.register_profile("search", deadline=None)
settings.load_profile(os.environ.get("TRIPWATT_HYPOTHESIS", "gate"))
"""The gate draws the same examples in every run; TRIPWATT_HYPOTHESIS=search draws new ones."""


@pytest.fixture(scope="session", autouse=True)
def built_once() -> Iterator[None]:
    """The tree of commands, for which Typer takes a tenth of a second at each call, is built once in a process."""
    with pytest.MonkeyPatch.context() as patch:
        build = cache(typer.main.get_command)
        patch.setattr(typer.main, "get_command", build)
        patch.setattr(typer.testing, "_get_command", build)
        yield


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


@pytest.fixture(scope="session")
def web(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The front end's sources with their packages of Node."""
    return with_packages(tmp_path_factory.mktemp("front-end"))
