"""The library reproduces the vectors that the tests of the front end use."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "vectors"


def leaves(document: Any, where: str = "") -> dict[str, Any]:
    """Every value of a document by its path."""
    if isinstance(document, dict):
        pairs = list(document.items())
    elif isinstance(document, list | tuple):
        pairs = list(enumerate(document))
    else:
        return {where: document}
    return {path: leaf for key, part in pairs for path, leaf in leaves(part, f"{where}/{key}").items()}


@pytest.fixture(scope="module")
def computed() -> dict[str, Any]:
    return runpy.run_path(str(FOLDER / "write.py"))["vectors"]()


def test_every_file_is_computed(computed: dict[str, Any]) -> None:
    assert {file.stem for file in FOLDER.glob("*.json")} == computed.keys()


@pytest.mark.parametrize("name", sorted(file.stem for file in FOLDER.glob("*.json")))
def test_the_library_reproduces_the_vectors(computed: dict[str, Any], name: str) -> None:
    written = leaves(json.loads((FOLDER / f"{name}.json").read_text()))
    found = leaves(computed[name])
    assert found.keys() == written.keys()
    numbers = {path: value for path, value in written.items() if isinstance(value, float)}
    assert {path: found[path] for path in numbers} == pytest.approx(numbers, rel=1e-9, abs=1e-9)
    others = written.keys() - numbers.keys()
    assert {path: found[path] for path in others} == {path: written[path] for path in others}
