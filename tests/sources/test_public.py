"""Where public sets can be had: each with its address and its licence, and nothing of sets that nobody named."""

from __future__ import annotations

import re

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.sources import where_to_get
from tripwatt.sources.public import public_sets

NAMES = ("tum", "ved", "twizy", "sedan")


def test_the_sets_are_those_of_the_population_and_one_for_research() -> None:
    assert tuple(public_sets()) == NAMES


@pytest.mark.parametrize(
    ("name", "licence", "addresses"),
    [
        ("tum", "CC BY 4.0", ["https://doi.org/10.21227/6jr9-5235"]),
        ("ved", "Apache-2.0", ["https://github.com/gsoh/VED"]),
        (
            "twizy",
            "CC BY 4.0",
            [
                "https://github.com/NaitMalekYoussef/RSK_Twizy_EV_Dataset",
                "https://doi.org/10.1109/ACCESS.2022.3225643",
            ],
        ),
        (
            "sedan",
            "non-commercial, educational and research purposes",
            [
                "https://github.com/MOTIVES-LAB/generalized-energy-consumption-evaluation-for-ev",
                "https://doi.org/10.1016/j.patter.2024.100950",
            ],
        ),
    ],
)
def test_each_set_names_its_licence_and_its_address(name: str, licence: str, addresses: list[str]) -> None:
    text = where_to_get(name)
    (stated,) = re.findall(r"^Licence: (.+)$", text, re.MULTILINE)
    assert licence in stated
    for address in addresses:
        assert address in text
    assert text.endswith("\n")
    assert "tripwatt " in text, "what to do with it"


def test_a_set_that_nobody_named_is_refused_with_all_that_are() -> None:
    with pytest.raises(InvalidInput, match="unknown data set") as caught:
        where_to_get("twizzy")
    (fault,) = caught.value.faults
    assert fault.got == "'twizzy'"
    assert fault.allowed == ", ".join(NAMES)
