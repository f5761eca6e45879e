"""Docstrings of the door, by numpydoc's own checks: parameters, returns, an example."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator
from typing import Any

import pytest

import tripwatt as tw

validate = pytest.importorskip("numpydoc.validate", reason="numpydoc builds the site").validate

CHECKS = {
    "GL08",
    "SS03",
    "SS05",
    "PR01",
    "PR02",
    "PR03",
    "PR04",
    "PR06",
    "PR07",
    "RT01",
    "RT03",
    "YD01",
    "EX01",
}
NO_PARAMETERS = {"PR01"}
"""Checks that a dataclass meets with a section `Attributes`: its fields are its parameters."""
NO_RESULT = {"RT01", "EX01"}
"""Checks that a property meets by its summary: it takes nothing and is what it says."""


def names() -> Iterator[tuple[str, Any]]:
    """The door, and the public methods and properties that its classes define."""
    for name in tw.__all__:
        thing = getattr(tw, name)
        if name == "__version__":
            continue
        yield f"tripwatt.{name}", thing
        for member, value in vars(thing).items() if inspect.isclass(thing) else ():
            kinds = (classmethod, staticmethod, property)
            is_shown = inspect.isfunction(value) or isinstance(value, kinds) or hasattr(value, "attrname")
            if not member.startswith("_") and is_shown:
                yield f"tripwatt.{name}.{member}", value


@pytest.mark.parametrize(("name", "thing"), [pytest.param(*found, id=found[0]) for found in names()])
def test_a_name_of_the_door_is_documented(name: str, thing: Any) -> None:
    checks = set(CHECKS)
    if inspect.isclass(thing) and dataclasses.is_dataclass(thing) and "Attributes\n" in (thing.__doc__ or ""):
        checks -= NO_PARAMETERS
    if isinstance(thing, property) or hasattr(thing, "attrname"):
        checks -= NO_RESULT
    found = [f"{code}: {text}" for code, text in validate(name)["errors"] if code in checks]
    assert not found, name


def test_the_checks_find_what_is_missing() -> None:
    codes = {code for code, _ in validate("tripwatt.arrays.eigen")["errors"]}
    assert codes & CHECKS
