"""The vectors that the page's own tests use are what the library gives."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "vectors"


def leaves(document: Any, where: str = "") -> dict[str, Any]:
    """Every value of a document by its place."""
    if isinstance(document, dict):
        pairs = list(document.items())
    elif isinstance(document, list | tuple):
        pairs = list(enumerate(document))
    else:
        return {where: document}
    return {place: leaf for key, part in pairs for place, leaf in leaves(part, f"{where}/{key}").items()}


@pytest.fixture(scope="module")
def computed() -> dict[str, Any]:
    return runpy.run_path(str(FOLDER / "write.py"))["vectors"]()


def test_every_file_is_computed(computed: dict[str, Any]) -> None:
    assert {file.stem for file in FOLDER.glob("*.json")} == computed.keys()


@pytest.mark.parametrize("name", sorted(file.stem for file in FOLDER.glob("*.json")))
def test_library_still_gives_the_vectors(computed: dict[str, Any], name: str) -> None:
    written = leaves(json.loads((FOLDER / f"{name}.json").read_text()))
    found = leaves(computed[name])
    assert found.keys() == written.keys()
    numbers = {place: value for place, value in written.items() if isinstance(value, float)}
    assert {place: found[place] for place in numbers} == pytest.approx(numbers, rel=1e-9, abs=1e-9)
    others = written.keys() - numbers.keys()
    assert {place: found[place] for place in others} == {place: written[place] for place in others}
