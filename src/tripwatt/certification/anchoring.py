"""Anchoring: change one physical loss of a car so that the mean error of its certified consumption is zero.

The simulation of a car with published values misses its certified consumption. For a car with a measured coast-down the gap lies
between wheel and battery, and one of three losses is changed: that of the map of motor and inverter ("motor"), an eddy-current loss of
the flux beside the map ("iron", in proportion to the square of speed), or that of the gear ("gear", in proportion to the power through
it); `tools.data.anchoring` chooses which. For a car without a coast-down, everything that its class leaves open is changed together
("road load"): rolling, air drag and gear, each in the proportion in which it is most probably the cause (`OPEN`).
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
"""Mean error that counts as zero, and the accuracy of a factor."""

IRON_LOSS_W: Final = 200.0
IRON_SPEED_M_S: Final = 20.0
"""Speed of the car at which raising the factor "iron" by 1 adds `IRON_LOSS_W`."""

BOUNDS: Final = {"motor": (0.0, 2.5), "iron": (1.0, 40.0), "gear": (0.0, 40.0), "road load": (0.3, 4.0)}
"""Smallest and largest factor of each loss. The map of a motor includes field weakening, which a large factor would raise far beyond the
speeds of the schedules."""

ROAD_LOAD: Final = "road load"

OPEN: Final = {"rolling": 0.4, "air": 0.2, "gear": 1.0}
"""Exponents of the factor "road load" for each part. The most probable changes are in proportion to variance times share of the energy:
cars of a class scatter by 17 % in rolling, 11 % in air drag and 45 % in the losses between wheel and battery (`vehicles.spreads`, without
tyres and trims), which take 36, 42 and 13 % of the WLTC. One factor for the whole road load would put most of the gap into the
air drag of the motorway."""

UNITS: Final = {
    "drivetrain.motor_loss_factor": "1",
    "drivetrain.flux_loss_w_s2_rad2": "W s2/rad2",
    "drivetrain.gearbox_efficiency": "1",
}
"""Entry of each loss -> its unit."""


@dataclass(frozen=True, slots=True)
class Anchored:
    """A car after anchoring, with the factor and the errors before and after.

    Attributes
    ----------
    vehicle : Vehicle
        The car with the changed loss.
    loss : str
        The loss that was changed, a key of `BOUNDS`.
    factor : float
        Factor of the loss.
    before, after : ndarray, shape (figures,)
        Relative error of each figure before and after.

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
        """Collect the entries that the factor has changed.

        Parameters
        ----------
        level : str
            A key of `tripwatt.vehicles.vehicle.ANCHORS`.

        Returns
        -------
        Anchor
            The values of the entries, their units, and the mean relative error before.
        """
        known = self.vehicle.entries
        entries = {
            key: (cast(float, self.vehicle.value(key)), known[key].unit if key in known else UNITS[key])
            for key in keys(self.vehicle, self.loss)
        }
        return Anchor(level, self.loss, MappingProxyType(entries), float(self.before.mean()))


def keys(vehicle: Vehicle, loss: str) -> tuple[str, ...]:
    """Return the entries of a car that the factor of a loss changes."""
    if loss == ROAD_LOAD:
        return *road_parts(vehicle), _KEYS["gear"]
    return tuple(_KEYS[one] for one in loss.split(" and "))


def road_parts(vehicle: Vehicle) -> dict[str, str]:
    """Return the entries of a car's road load that a factor changes, each with its kind: "rolling" or "air"."""
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

    "motor": the loss factor of the map is multiplied. "gear": the factor is an exponent of the efficiency. "iron": each 1 above a
    factor of 1 adds `IRON_LOSS_W` at `IRON_SPEED_M_S`. "road load": the factor is raised to the exponents of `OPEN`.

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    loss : str
        A key of `BOUNDS`.
    factor : float
        1 leaves the car as it is.

    Returns
    -------
    Vehicle
        A copy with other values; its `entries` are not updated.

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
    """Change one loss of a car so that the mean error of its certified figures is zero. O(figures x samples).

    Parameters
    ----------
    vehicle : Vehicle
        A car that is not anchored yet.
    figures : sequence of CertifiedFigure
        At least one. Outliers are left out, unless all figures are outliers.
    loss : str
        A key of `BOUNDS`.

    Returns
    -------
    Anchored
        The car with the changed loss, the factor and the errors.

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
    """Return the figures that are not marked as outliers, or all figures if all are outliers."""
    return [figure for figure in figures if not figure.outlier] or list(figures)


def errors(vehicle: Vehicle, figures: Sequence[CertifiedFigure]) -> FloatArray:
    """Return the relative error of the simulation for each figure, shape (figures,)."""
    return np.array([relative_error(vehicle, figure) for figure in figures])


def closing_factor(vehicle: Vehicle, figures: Sequence[CertifiedFigure], loss: str) -> float:
    """Find the factor of a loss at which the mean error of some figures is zero, or else the nearest bound of the factor."""
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
