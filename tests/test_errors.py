"""Faults are collected, named and translated in one place."""

import re
from typing import Any

import pytest
from tests.support import ROOT

from tripwatt.errors import Check, Fault, InvalidInput, places_named, system_errors

FIRST, SECOND = Fault("a", "b"), Fault("c", "d")


def fail(*faults: Fault) -> None:
    raise InvalidInput(faults)


def faults_of(call: Any) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as error:
        call()
    return error.value.faults


def test_checks_collect_their_faults() -> None:
    check = Check()
    assert (check(int, "3"), check(sorted, [2, 1], reverse=True), check.faults) == (3, [2, 1], {})

    def together() -> None:
        with Check() as found:
            found(fail, FIRST)
            found(fail, SECOND, FIRST)

    assert faults_of(together) == (FIRST, SECOND)

    def without_its_own() -> None:
        with Check() as found:
            found(fail)

    assert faults_of(without_its_own) == ()


def test_another_error_in_a_block_of_checks_goes_first() -> None:
    def ended() -> None:
        with Check() as check:
            check(fail, FIRST)
            raise KeyError

    with pytest.raises(KeyError):
        ended()


def test_places_get_other_names_and_what_has_none_keeps_its_own() -> None:
    def named() -> None:
        with places_named({"b": "--option"}):
            fail(FIRST, SECOND)

    assert [fault.where for fault in faults_of(named)] == ["--option", "d"]


@pytest.mark.parametrize(
    ("error", "path", "got"),
    [
        (PermissionError(13, "Permission denied"), "out", "out: Permission denied"),
        (OSError("no regular file"), "", "no regular file"),
    ],
)
def test_an_error_of_the_system_is_an_invalid_input(error: OSError, path: str, got: str) -> None:
    def fails() -> None:
        with system_errors("cannot write", "--out", "a folder", path):
            raise error

    assert faults_of(fails) == (Fault("cannot write", "--out", got, "a folder"),)


def test_percentages_for_people_are_written_by_one_function() -> None:
    by_hand = re.compile(r":[+]?\.\d%\}")  # anchors write a text of the files of cars
    sources = [path for path in (ROOT / "src/tripwatt").rglob("*.py") if path.name != "anchors.py"]
    assert not [f"{path}" for path in sources if by_hand.search(path.read_text("utf-8"))]
