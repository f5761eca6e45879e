"""How far a car on the road may be from its values, by what they were held against.

A car whose own coast-down and certified consumption are known is known better than one with the consumption alone, and that one
better than a class average. Its own trips come on top (`tripwatt.population`).
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
"""Rolling resistance of a car's tyres about those of its certification: half of the 15 % between neighbouring classes of the EU tyre label
(Regulation (EU) 2020/740, annex I)."""

TRIM_SD: Final = 0.05
"""Drag area of wheels and trims about that of the certification: 5 % between the wheels of one car in the EPA test car list (BMW
iX xDrive50, coefficient C of 0.01995 to 0.02131)."""

REPEAT_SD: Final = 0.02
"""Scatter of certified consumption over tests of the same car and road load."""

ROAD_GAIN: Final = 0.05
"""Mean rise of rolling resistance from the test to the road, where tyres are neither run in nor at their pressure and the surface is rough or wet.
A choice between two figures: dry, warm roads show none (`tools/data/steady_tests.csv`, without the BMW i3), and 12 % is left of the 6 % of the
consumption by which the certification differs (Komnos et al., Energy Conversion and Management 270 (2022) 116161) once
`Auxiliaries.moving_load_w` is taken off and the rest is divided by rolling's 36 % of the WLTC. The published drag area needs no rise."""

ROAD_GAIN_SD: Final = 0.05
"""Standard deviation of that rise: published gaps of single electric cars are 5 to 20 % with everything in them."""


CLASS_ANCHORS: Final = ("certification", "class")
"""Anchors of cars with values of a class."""


@cache
def loss_sd() -> float:
    """Relative standard deviation of the consumption that the simulation misses before anchoring.

    Of the cars with a measured coast-down, so that it is what lies between wheel and battery.
    """
    return statistics.stdev(a.before for a in anchors().values() if a.level == "road_load")


@cache
def spreads(anchor: str, beyond: float = 0.0) -> Mapping[str, float]:
    """Relative standard deviation of rolling resistance and air drag of a car by what it was held against; empty for "published" and "road".

    How far the drivetrain is off is part of what certified consumption shows of everything (`tripwatt.hybrid.factors`).

    Parameters
    ----------
    anchor : str
        `Vehicle.anchor`.
    beyond : float
        How far the car's mass lies outside of the library (`catalogue.beyond_classes`). Values of a class that are carried so far in
        proportion to the mass may as well not depend on it: that error is the distance itself.

    Examples
    --------
    >>> spreads("road_load")["air"] < spreads("certification")["air"] < spreads("class")["air"]
    True
    """
    if anchor in _NO_TEST:
        return types.MappingProxyType({})
    classes = class_values()
    # the consumption fixes the sum of rolling and air drag of a class, so that half of each variance is left
    unknown = {"road_load": 0.0, "certification": math.sqrt(0.5), "class": 1.0}[anchor]
    by_part = {
        "rolling": math.hypot(TYRES_SD, ROAD_GAIN_SD, unknown * math.hypot(classes.rolling_sd, beyond)),
        "air": math.hypot(TRIM_SD, ROAD_GAIN_SD, unknown * math.hypot(classes.drag_area_sd, beyond)),
    }
    return types.MappingProxyType(by_part)


_NO_TEST: Final = ("published", "road")
