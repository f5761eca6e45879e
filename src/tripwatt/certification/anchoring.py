"""Anchoring: change the road load of a car so that the mean error of its certified consumption is zero.

The simulation of a car with published values misses its certified consumption. For a car without a coast-down, everything that its class
leaves open is changed together: rolling, air drag and gear, each in the proportion in which it is most probably the cause (`OPEN`).
For the library's cars with a measured coast-down, `tools.data.anchoring` changes a loss between wheel and battery.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, cast

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.certification.consumption import CertifiedFigure, relative_error
from tripwatt.vehicles import Vehicle

TOLERANCE: Final = 1e-4
"""Mean error that counts as zero, and the accuracy of a factor."""

ROAD_LOAD: Final = "road load"
"""Name of the changed loss in an `Anchor`."""

FACTORS: Final = (0.3, 4.0)
"""Smallest and largest factor of a road load; a choice, far beyond what cars of one class differ by."""

OPEN: Final = {"rolling": 0.4, "air": 0.2, "gear": 1.0}
"""Exponents of the factor "road load" for each part. The most probable changes are in proportion to variance times share of the energy:
cars of a class scatter by 17 % in rolling, 11 % in air drag and 45 % in the losses between wheel and battery (`vehicles.anchors`, without
tyres and trims), which take 36, 42 and 13 % of the WLTC. One factor for the whole road load would put most of the gap into the
air drag of the motorway."""

GEARBOX: Final = "drivetrain.gearbox_efficiency"


def road_parts(vehicle: Vehicle) -> dict[str, str]:
    """Return the entries of a car's road load that a factor changes, each with its kind: "rolling" or "air"."""
    if vehicle.road_load.method == "coastdown":
        parts = {"a_n": "rolling", "b_n_s_m": "rolling", "c_n_s2_m2": "air"}
        return {f"road_load.coastdown_{part}": kind for part, kind in parts.items()}
    return {"road_load.drag_coefficient": "air", "road_load.rolling_resistance_coefficient": "rolling"}


def with_road_load(vehicle: Vehicle, factor: float) -> Vehicle:
    """Return the car with rolling, air drag and gear losses multiplied by the factor raised to the exponents of `OPEN`.

    The factor of the gear is an exponent of its efficiency. The `entries` of the car are not updated.
    """
    exponents = {key: OPEN[kind] for key, kind in road_parts(vehicle).items()}
    values = {key: cast(float, vehicle.value(key)) * factor**exponent for key, exponent in exponents.items()}
    values[GEARBOX] = vehicle.drivetrain.gearbox_efficiency ** (factor ** OPEN["gear"])
    return vehicle.with_values(values)


def errors(vehicle: Vehicle, figures: Sequence[CertifiedFigure]) -> FloatArray:
    """Return the relative error of the simulation for each figure, shape (figures,)."""
    return np.array([relative_error(vehicle, figure) for figure in figures])


def closing_factor(
    change: Callable[[float], Vehicle], figures: Sequence[CertifiedFigure], bounds: tuple[float, float]
) -> float:
    """Find the factor at which the mean error of some figures is zero, or else the nearest bound of the factor.

    `change` returns the car with a factor, for 1 the unchanged one.
    """
    from scipy.optimize import brentq  # slow to import

    def mean_error(factor: float) -> float:
        return float(errors(change(factor), figures).mean())

    low, high = bounds
    at_one = mean_error(1.0)
    if abs(at_one) <= TOLERANCE:
        return 1.0
    bound = high if at_one < 0.0 else low
    if at_one * mean_error(bound) > 0.0:
        return bound
    return float(brentq(mean_error, min(1.0, bound), max(1.0, bound), xtol=TOLERANCE, rtol=TOLERANCE))
