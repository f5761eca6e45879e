"""Values that close the gap between a car's simulated and its certified consumption, from `data/table/anchors.csv`.

`python -m benchmarks.anchors --write` computes the file with `tripwatt.certification` and the current physics. Each row is an entry of
a car: its value, and the mean error of the car without it. The rows of the car `*` hold for the whole class.
"""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from tripwatt.arrays import by_key
from tripwatt.vehicles.catalogue import records

CLASS: Final = "*"
"""Name of the rows that hold for cars without certified figures."""


@dataclass(frozen=True, slots=True)
class Anchor:
    """Changed entries of a car with which its mean error of certified consumption is zero.

    Attributes
    ----------
    level : str
        One of `tripwatt.vehicles.vehicle.ANCHORS`.
    loss : str
        Loss that was changed: "motor", "iron" or "gear" losses, or the "road load".
    entries : mapping of str to (float, str)
        "section.key" -> value and unit.
    before : float
        Mean of simulated over certified consumption less one, without the entries.
    """

    level: str
    loss: str
    entries: Mapping[str, tuple[float, str]]
    before: float

    @property
    def reason(self) -> str:
        """Text for the field `estimated` of the entries: how their values were found."""
        if self.level == "class":
            return f"median of the library's cars; before, their certified consumption was missed by {self.before:+.1%}"
        return f"closes the mean error of the certified consumption, {self.before:+.1%} before ({self.loss})"


@cache
def anchors() -> Mapping[str, Anchor]:
    """Return the anchor of each car by its name; `CLASS` is the name of the class.

    Examples
    --------
    >>> anchors()["vw_id4_pro"].level
    'road_load'
    """
    by_car = {}
    for car, rows in by_key(records("anchors.csv"), lambda row: row["car"]).items():
        entries = {row["entry"]: (float(row["value"]), row["unit"]) for row in rows}
        about = rows[0]
        by_car[car] = Anchor(about["level"], about["loss"], entries, float(about["before"]))
    return types.MappingProxyType(by_car)


def with_anchor(document: Mapping[str, Any], anchor: Anchor | None) -> dict[str, Any]:
    """Return the document with its entries replaced by those of an anchor; unchanged if there is no anchor."""
    if anchor is None:
        return dict(document)
    result: dict[str, Any] = {**document, "anchor": anchor.level}
    for key, (value, unit) in anchor.entries.items():
        section, _, name = key.partition(".")
        entry = {
            "value": value,
            "unit": unit,
            "source": "certified consumption of the car" if anchor.level != "class" else "class of the car",
            "licence": "estimate",
            "estimated": anchor.reason,
        }
        result[section] = {**result.get(section, {}), name: entry}
    return result
