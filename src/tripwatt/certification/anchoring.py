"""One loss of a car, by its physical name, closes the mean error of its certified consumption.

The simulation of a car with published values misses its certified consumption. Of a car with a measured coast-down the gap lies
between wheel and battery, and one of three losses is changed: that of the map of motor and inverter ("motor"), an eddy-current loss of
the flux beside the map ("iron", in proportion to the square of speed), or that of the gear ("gear", in proportion to the power through
it); `tools.data.anchoring` chooses which. Of a car without one, all is changed that its class leaves open ("road load"), after the
losses that cars have in common: rolling, air drag and gear, each in the proportion in which it is most probably the cause (`OPEN`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, cast

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.certification.consumption import CertifiedFigure, relative_error
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.anchors import Anchor

TOLERANCE: Final = 1e-4
"""Mean error that counts as none, and the accuracy of a factor."""

IRON_LOSS_W: Final = 200.0
IRON_SPEED_M_S: Final = 20.0
"""Speed of the car at which a factor of 2 stands for `IRON_LOSS_W` of iron loss."""

BOUNDS: Final = {"motor": (0.0, 2.5), "iron": (1.0, 40.0), "gear": (0.0, 40.0), "road load": (0.3, 4.0)}
"""Smallest and largest factor of each. The map of a motor has field weakening, which a large factor carries far beyond the speeds of the
schedules."""

ROAD_LOAD: Final = "road load"

OPEN: Final = {"rolling": 0.4, "air": 0.2, "gear": 1.0}
"""Powers of a factor of the "road load". A gap is closed most probably by changes in proportion to variance times share of the energy:
cars of a class scatter by 17 % in rolling, 11 % in air drag and 45 % in the losses between wheel and battery (`vehicles.spreads`, without
tyres and trims), which take 36, 42 and 13 % of the WLTC. A factor of all three parts of the road load alone would put most of the gap
into the air drag of the motorway."""

UNITS: Final = {
    "drivetrain.motor_loss_factor": "1",
    "drivetrain.flux_loss_w_s2_rad2": "W s2/rad2",
    "drivetrain.gearbox_efficiency": "1",
}
"""Unit of the entry of each loss."""


@dataclass(frozen=True, slots=True)
class Anchored:
    """A car and the factor that closes its mean error.

    Attributes
    ----------
    vehicle : Vehicle
        With the factor.
    loss : str
        What it multiplies.
    factor : float
        Factor of the loss.
    before, after : ndarray, shape (figures,)
        Relative errors.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> met = Anchored(car, "motor", 1.0, np.array([0.02, 0.04]), np.array([-0.01, 0.01]))
    >>> round(met.anchor("certification").before, 3)
    0.03
    """

    vehicle: Vehicle
    loss: str
    factor: float
    before: FloatArray
    after: FloatArray

    def anchor(self, level: str) -> Anchor:
        """Collect the entries that the factor changes.

        Parameters
        ----------
        level : str
            A key of `tripwatt.vehicles.ANCHORS`.

        Returns
        -------
        Anchor
            With the values of the entries, their units, and the mean relative error that the factor closes.
        """
        known = self.vehicle.entries
        entries = {
            key: (cast(float, self.vehicle.value(key)), known[key].unit if key in known else UNITS[key])
            for key in keys(self.vehicle, self.loss)
        }
        return Anchor(level, self.loss, MappingProxyType(entries), float(self.before.mean()))


def keys(vehicle: Vehicle, loss: str) -> tuple[str, ...]:
    """Entries that a factor changes."""
    if loss == ROAD_LOAD:
        return *road_parts(vehicle), _KEYS["gear"]
    return tuple(_KEYS[one] for one in loss.split(" and "))


def road_parts(vehicle: Vehicle) -> dict[str, str]:
    """Entries of a road load, and whether each is rolling or air."""
    if vehicle.road_load.method == "coastdown":
        parts = {"a_n": "rolling", "b_n_s_m": "rolling", "c_n_s2_m2": "air"}
        return {f"road_load.coastdown_{part}": kind for part, kind in parts.items()}
    return {"road_load.drag_coefficient": "air", "road_load.rolling_resistance_coefficient": "rolling"}


_KEYS: Final = {
    "motor": "drivetrain.motor_loss_factor",
    "iron": "drivetrain.flux_loss_w_s2_rad2",
    "gear": "drivetrain.gearbox_efficiency",
}


def scaled(vehicle: Vehicle, loss: str, factor: float) -> Vehicle:
    """Multiply one loss of a car by a factor.

    The gear's factor is an exponent of its efficiency; 1 more of iron is `IRON_LOSS_W` at `IRON_SPEED_M_S`; that of the road load
    counts in powers (`OPEN`).

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    loss : str
        A key of `BOUNDS`.
    factor : float
        How many times the loss.

    Returns
    -------
    Vehicle
        A copy with other parts; its entries stay as they are.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> scaled(car, "motor", 2.0).drivetrain.motor_loss_factor
    2.0
    """
    values: dict[str, float] = {}
    road = road_parts(vehicle) if loss == ROAD_LOAD else {}
    for key in keys(vehicle, loss):
        value = cast(float, vehicle.value(key))
        if key in road:
            value *= factor ** OPEN[road[key]]
        elif key == _KEYS["gear"]:
            value = value ** (factor ** OPEN["gear"])
        elif loss == "iron":
            drivetrain = vehicle.drivetrain
            speed = IRON_SPEED_M_S * drivetrain.gear_ratio / drivetrain.wheel_radius_m
            value += (factor - 1.0) * IRON_LOSS_W / speed**2
        else:
            value *= factor
        values[key] = value
    return vehicle.with_values(values)


def anchored(vehicle: Vehicle, figures: Sequence[CertifiedFigure], loss: str = ROAD_LOAD) -> Anchored:
    """Close the mean error of a car's certified figures by one of its losses. O(figures x samples).

    Parameters
    ----------
    vehicle : Vehicle
        Not anchored yet.
    figures : sequence of CertifiedFigure
        At least one. Those marked as outliers are left out, unless all are.
    loss : str
        A key of `BOUNDS`.

    Returns
    -------
    Anchored
        The car with the loss.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> figure = CertifiedFigure("udds", 110.0, at_wall=False, test_mass_kg=1400.0, source="example")
    >>> met = anchored(car, [figure], "motor")
    >>> bool(abs(met.after[0]) <= abs(met.before[0]))
    True
    """
    sound = without_outliers(figures)
    factor = closing_factor(vehicle, sound, loss)
    car = scaled(vehicle, loss, factor)
    return Anchored(car, loss, factor, errors(vehicle, sound), errors(car, sound))


def without_outliers(figures: Sequence[CertifiedFigure]) -> list[CertifiedFigure]:
    """Those that are not marked as outliers, or all of them where all are."""
    return [figure for figure in figures if not figure.outlier] or list(figures)


def errors(vehicle: Vehicle, figures: Sequence[CertifiedFigure]) -> FloatArray:
    """Relative error of each figure, shape (figures,)."""
    return np.array([relative_error(vehicle, figure) for figure in figures])


def closing_factor(vehicle: Vehicle, figures: Sequence[CertifiedFigure], loss: str) -> float:
    """The factor of a loss at which the mean error of some figures is zero, or else the bound that is nearest to it."""
    from scipy.optimize import brentq  # slow to import

    def mean_error(factor: float) -> float:
        return float(errors(scaled(vehicle, loss, factor), figures).mean())

    low, high = BOUNDS[loss]
    at_one = mean_error(1.0)
    if abs(at_one) <= TOLERANCE:
        return 1.0
    bound = high if at_one < 0.0 else low
    if at_one * mean_error(bound) > 0.0:
        return bound
    return float(brentq(mean_error, min(1.0, bound), max(1.0, bound), xtol=TOLERANCE, rtol=TOLERANCE))
