"""Standard deviations of the values of a car on the road, by the tests to which the values were anchored.

A car with its own coast-down and certified consumption is known better than a car with a certified consumption only, and this one
better than a car with class values. What the trips of a car add is in `tripwatt.population`.
"""

from __future__ import annotations

import math
import statistics
import types
from collections.abc import Mapping
from functools import cache
from typing import Final

from tripwatt.vehicles.anchors import anchors
from tripwatt.vehicles.catalogue import class_values

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
def loss_sd() -> float:
    """Relative standard deviation of the error of certified consumption before anchoring.

    Only cars with a measured coast-down count, so the error lies between wheel and battery.
    """
    return statistics.stdev(a.before for a in anchors().values() if a.level == "road_load")


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
