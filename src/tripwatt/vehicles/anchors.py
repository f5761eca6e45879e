"""Values that close the gap between a car's simulated and its certified consumption, from `data/table/anchors.csv`, and the spreads that they leave.

`python -m benchmarks.anchors --write` computes the file with `tripwatt.certification` and the current physics. Each row is an entry of
a car: its value, and the mean error of the car without it. The rows of the car `*` hold for the whole class.

A car with its own coast-down and certified consumption is known better than a car with a certified consumption only, and this one
better than a car with class values. What the trips of a car add is in `tripwatt.population`.
"""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from tripwatt.arrays import by_key
from tripwatt.vehicles.catalogue import class_values, entry, records, with_entries

CLASS: Final = "*"
"""Name of the rows that all cars without certified figures have in common; those of a kind of body are named by `class_of`."""


@dataclass(frozen=True, slots=True)
class Anchor:
    """Changed entries of a car with which its mean error of certified consumption is zero.

    Attributes
    ----------
    level : str
        One of `tripwatt.vehicles.vehicle.ANCHORS`.
    loss : str
        Loss that was changed: "motor", "iron" or "gear" losses, or the "road load".
    entries : mapping of str to float
        "section.key" -> value; those of a class see `class_of`.
    before : float
        Mean of simulated over certified consumption less one, without the entries.
    """

    level: str
    loss: str
    entries: Mapping[str, float]
    before: float

    @property
    def reason(self) -> str:
        """Text for the field `estimated` of the entries: how their values were found."""
        if self.level == "class":
            return f"that of the library's cars; before, their certified consumption was missed by {self.before:+.1%}"
        return f"closes the mean error of the certified consumption, {self.before:+.1%} before ({self.loss})"


@cache
def anchors() -> Mapping[str, Anchor]:
    """Return the anchor of each car by its name, and those of classes.

    Examples
    --------
    >>> anchors()["vw_id4_pro"].level
    'road_load'
    """
    by_car = {}
    for car, rows in by_key(records("anchors.csv"), lambda row: row["car"]).items():
        entries = {row["entry"]: float(row["value"]) for row in rows}
        about = rows[0]
        by_car[car] = Anchor(about["level"], about["loss"], entries, float(about["before"]))
    return types.MappingProxyType(by_car)


def class_of(body: str) -> str:
    """Return the name of the anchor of cars with a kind of body, of which only mass, power and battery are known.

    Its entries are the `factor` of the road load at which such cars meet their certified consumption in the mean, the relative
    `scatter` of single cars about that, and the number of `makers`, each with one vote.

    Parameters
    ----------
    body : str
        Kind of body, one of `BODIES`.

    Examples
    --------
    >>> van, car = (anchors()[class_of(body)].entries["factor"] for body in ("van", "sedan"))
    >>> van > car > 1.0
    True
    """
    return CLASS + ("van" if body == "van" else "car")


def with_anchor(document: Mapping[str, Any], anchor: Anchor | None) -> dict[str, Any]:
    """Return the document with its entries replaced by those of an anchor; unchanged if there is no anchor."""
    if anchor is None:
        return dict(document)
    source = "class of the car" if anchor.level == "class" else "certified consumption of the car"
    entries = {k: entry(value, source, "estimate", anchor.reason) for k, value in anchor.entries.items()}
    return with_entries({**document, "anchor": anchor.level}, entries)


TYRES_SD: Final = 0.08
"""Relative scatter of the rolling resistance of a car's tyres about that of its certification: half of the 15 % between neighbouring
classes of the EU tyre label (Regulation (EU) 2020/740, annex I)."""

TRIM_SD: Final = 0.05
"""Relative scatter of the drag area by wheels and trims about that of the certification: 5 % between the wheels of one car in the
EPA test car list (BMW iX xDrive50, coefficient C of 0.01995 to 0.02131)."""

REPEAT_SD: Final = 0.02
"""Relative scatter of certified consumption between tests of one car with one road load."""

ROAD_GAIN: Final = 0.05
"""Mean rise of rolling resistance from the test to the road, where tyres are not run in or at their pressure and roads are rough or wet.
A choice between two figures: dry, warm roads show none (`tools/data/steady_tests.csv`, without the BMW i3), and 12 % is left of the 6 % of the
consumption by which the certification differs (Komnos et al., Energy Conversion and Management 270 (2022) 116161) once
`Auxiliaries.moving_load_w` is taken off and the rest is divided by rolling's 36 % of the WLTC. The published drag area needs no rise."""

ROAD_GAIN_SD: Final = 0.05
"""Standard deviation of `ROAD_GAIN`: published gaps of single electric cars are 5 to 20 %, all causes together."""

CLASS_ANCHORS: Final = ("certification", "class")
"""Anchors of cars whose road load has values of a class."""


@cache
def spreads(anchor: str, beyond: float = 0.0) -> Mapping[str, float]:
    """Relative standard deviations of "rolling" and "air" drag of a car with an anchor; empty for "published" and "road".

    The drivetrain has no entry: its error is part of the error of the certified consumption (`tripwatt.hybrid.factors`).

    Parameters
    ----------
    anchor : str
        `Vehicle.anchor`.
    beyond : float
        Distance of the car's mass from the masses of the library (`catalogue.beyond_classes`). It is added as a standard deviation,
        because class values extrapolated in proportion to the mass may as well not depend on the mass.

    Examples
    --------
    >>> spreads("road_load")["air"] < spreads("certification")["air"] < spreads("class")["air"]
    True
    """
    # the consumption fixes the sum of rolling and air drag, so half of each variance of the class is left
    unknown = {"road_load": 0.0, "certification": math.sqrt(0.5), "class": 1.0}.get(anchor)
    if unknown is None:
        return types.MappingProxyType({})
    classes = class_values()
    by_part = {
        "rolling": math.hypot(TYRES_SD, ROAD_GAIN_SD, unknown * math.hypot(classes.rolling_sd, beyond)),
        "air": math.hypot(TRIM_SD, ROAD_GAIN_SD, unknown * math.hypot(classes.drag_area_sd, beyond)),
    }
    return types.MappingProxyType(by_part)
