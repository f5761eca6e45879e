"""Docstrings of every public name, by numpydoc's own checks: parameters, returns, an example."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from typing import Any

import pytest
from tests.support import ROOT

import tripwatt as tw

ClassDoc = pytest.importorskip("numpydoc.docscrape", reason="numpydoc builds the site").ClassDoc
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


PACKAGES = [
    *sorted(
        f"tripwatt.{found.name}"
        for found in pkgutil.iter_modules(tw.__path__)
        if found.ispkg and hasattr(importlib.import_module(f"tripwatt.{found.name}"), "__all__")
    ),
    "tripwatt_gamm",
]

WITH_A_PAGE_OF_THEIR_OWN = ("tripwatt.command", "tripwatt.server.http")
"""Packages that the command line and the requests describe, not the reference."""


def names() -> Iterator[tuple[str, Any]]:
    """What the door and each package export, and the public methods and properties that their classes define."""
    for place in ("tripwatt", *PACKAGES):
        for name in importlib.import_module(place).__all__:
            thing = getattr(importlib.import_module(place), name)
            if inspect.isclass(thing) or inspect.isroutine(thing):
                yield f"{place}.{name}", thing
                yield from members(f"{place}.{name}", thing)


def members(name: str, thing: Any) -> Iterator[tuple[str, Any]]:
    """The public methods and properties that a class itself defines."""
    fields = {field.name for field in dataclasses.fields(thing)} if dataclasses.is_dataclass(thing) else set()
    for member, value in vars(thing).items() if inspect.isclass(thing) else ():
        kinds = (classmethod, staticmethod, property)
        is_shown = inspect.isfunction(value) or isinstance(value, kinds) or hasattr(value, "attrname")
        if not member.startswith("_") and is_shown and member not in fields:
            yield f"{name}.{member}", value


def is_shown_with_its_class(name: str) -> bool:
    """Whether the example of a class calls the method: one example may show several methods together."""
    holder, _, member = name.rpartition(".")
    package, _, kind = holder.rpartition(".")
    thing = (
        getattr(importlib.import_module(package), kind, None) if package in ("tripwatt", *PACKAGES) else None
    )
    _, _, example = (inspect.getdoc(thing) or "").partition("Examples\n----")
    return bool(re.search(rf"^(>>>|\.\.\.) .*\.{member}\(", example, flags=re.MULTILINE))


@pytest.mark.parametrize(("name", "thing"), [pytest.param(*found, id=found[0]) for found in names()])
def test_a_public_name_is_documented(name: str, thing: Any) -> None:
    checks = set(CHECKS)
    if inspect.isclass(thing) and dataclasses.is_dataclass(thing) and "Attributes\n" in (thing.__doc__ or ""):
        checks -= NO_PARAMETERS
    if isinstance(thing, property) or hasattr(thing, "attrname"):
        checks -= NO_RESULT
    if getattr(thing, "_is_protocol", False):
        checks -= {"PR01"}  # nobody constructs it
    if is_shown_with_its_class(name):
        checks -= {"EX01"}
    found = [f"{code}: {text}" for code, text in validate(name)["errors"] if code in checks]
    assert not found, name


@pytest.mark.parametrize(
    ("name", "thing"),
    [pytest.param(*found, id=found[0]) for found in names() if dataclasses.is_dataclass(found[1])],
)
def test_every_field_of_a_dataclass_is_described(name: str, thing: Any) -> None:
    document = ClassDoc(thing, config={"show_class_members": False})
    described = {
        field.strip(): bool("".join(entry.desc).strip())
        for section in ("Attributes", "Parameters")
        for entry in document[section]
        for field in entry.name.split(",")
    }
    inherited = {field for kind in thing.__mro__[1:] for field in getattr(kind, "__dataclass_fields__", ())}
    shown = {field.name for field in dataclasses.fields(thing) if not field.name.startswith("_")}
    assert shown - inherited <= set(described), name
    assert [field for field, is_described in described.items() if not is_described] == []


def test_the_checks_find_what_is_missing() -> None:
    codes = {code for code, _ in validate("tripwatt.arrays.eigen")["errors"]}
    assert codes & CHECKS


def test_the_reference_lists_every_package() -> None:
    listed = (ROOT / "tools" / "docs" / "site" / "build.py").read_text("utf-8")
    missing = {package for package in PACKAGES if f'"{package}",' not in listed}
    assert missing == set(WITH_A_PAGE_OF_THEIR_OWN) & set(PACKAGES)
