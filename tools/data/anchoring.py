"""Which loss of a car closes the mean error of its certified consumption: for the anchors of the library.

For a car with a measured coast-down the gap lies between wheel and battery, and one of three losses is changed: that of the map of motor
and inverter ("motor"), an eddy-current loss of the flux beside the map ("iron", in proportion to the square of speed), or that of the gear
("gear", in proportion to the power through it). Each closes the mean over the rows; the one is taken
that is most probable, by the rows and by what it does to the loss on a motorway. Where that leaves a row off by more than
`ROW_TOLERANCE`, city and highway ask for two losses: that of the map and an eddy-current loss, which differ most in how they grow with
speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Final, cast

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.certification.consumption import (
    FACTORS,
    GEARBOX,
    ROAD_LOAD,
    SCHEDULE_DENSITY_DEGC,
    CertifiedFigure,
    closing_factor,
    driven_wh_per_km,
    errors,
    road_parts,
    with_road_load,
    wltp_test_mass,
)
from tripwatt.physics.road_load import air_density
from tripwatt.units import GRAVITY_M_S2, KG_PER_LB, M_PER_MILE, WH_PER_J
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.anchors import REPEAT_SD, Anchor
from tripwatt.vehicles.catalogue import Cell, Row, catalogue

MOTORWAY_M_S: Final = 36.0
LOSS_SD: Final = 0.45
"""Standard deviation of the logarithm of a car's loss between wheel and battery about its class's (`vehicles.anchors`)."""

ROW_TOLERANCE: Final = 0.04
"""Error of a row that one loss may leave: twice the scatter of certified consumption over tests of the same car."""

LOSSES: Final = ("gear", "motor")
"""Losses of a car with a measured coast-down."""

PAIR: Final = "motor and iron"
"""Both, where one loss does not meet city and highway."""

MIN_MOTOR: Final = 0.4
"""Least factor of the map in a pair: the best and the worst of the published machines lie about so far apart."""

IRON_LOSS_W: Final = 200.0
IRON_SPEED_M_S: Final = 20.0
"""Speed of the car at which raising the factor "iron" by 1 adds `IRON_LOSS_W`."""

KEYS: Final = {
    "motor": "drivetrain.motor_loss_factor",
    "iron": "drivetrain.flux_loss_w_s2_rad2",
    "gear": GEARBOX,
}
BOUNDS: Final = {"motor": (0.0, 2.5), "iron": (1.0, 40.0), "gear": (0.0, 40.0), ROAD_LOAD: FACTORS}
"""Smallest and largest factor of each loss. The map of a motor includes field weakening, which a large factor would raise far beyond the
speeds of the schedules."""

WH_PER_KM: Final = MappingProxyType(
    {"kWh/100 mi": 1e4 / M_PER_MILE, "kWh/100 km": 10.0, "Wh/mi": 1e3 / M_PER_MILE}
)
"""Factor to Wh/km of the units of certified figures."""


_OUTLIER: Final = "ratio_outlier"


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
            The values of the entries, and the mean relative error before.
        """
        entries = {key: cast(float, self.vehicle.value(key)) for key in keys(self.vehicle, self.loss)}
        return Anchor(level, self.loss, MappingProxyType(entries), float(self.before.mean()))


def keys(vehicle: Vehicle, loss: str) -> tuple[str, ...]:
    """Return the entries of a car that the factor of a loss changes."""
    if loss == ROAD_LOAD:
        return *road_parts(vehicle), GEARBOX
    return tuple(KEYS[name] for name in loss.split(" and "))


def scaled(vehicle: Vehicle, loss: str, factor: float) -> Vehicle:
    """Multiply one loss of a car by a factor.

    "motor": the loss factor of the map is multiplied. "gear": the factor is an exponent of the efficiency. "iron": each 1 above a
    factor of 1 adds `IRON_LOSS_W` at `IRON_SPEED_M_S`. "road load": see `with_road_load`.

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
    """
    if loss == ROAD_LOAD:
        return with_road_load(vehicle, factor)
    drivetrain, key = vehicle.drivetrain, KEYS[loss]
    value = cast(float, vehicle.value(key))
    if loss == "gear":
        return vehicle.with_values({key: value**factor})
    if loss == "iron":
        speed = IRON_SPEED_M_S * drivetrain.gear_ratio / drivetrain.wheel_radius_m
        return vehicle.with_values({key: value + (factor - 1.0) * IRON_LOSS_W / speed**2})
    return vehicle.with_values({key: value * factor})


def anchored(vehicle: Vehicle, figures: Sequence[CertifiedFigure], loss: str = ROAD_LOAD) -> Anchored:
    """Change one loss of a car so that the mean error of its certified figures is zero. O(figures x samples).

    Outliers are left out, unless all figures are outliers.
    """
    sound = without_outliers(figures)
    factor = closing_factor(partial(scaled, vehicle, loss), sound, BOUNDS[loss])
    car = scaled(vehicle, loss, factor)
    return Anchored(car, loss, factor, errors(vehicle, sound), errors(car, sound))


def without_outliers(figures: Sequence[CertifiedFigure]) -> list[CertifiedFigure]:
    """Return the figures that are not marked as outliers, or all figures if all are outliers."""
    return [figure for figure in figures if not figure.outlier] or list(figures)


def most_probable(vehicle: Vehicle, figures: Sequence[CertifiedFigure]) -> Anchored:
    """Close the mean error of a car's certified figures by the most probable of its losses. O(losses x figures x samples)."""
    each = [anchored(vehicle, figures, loss) for loss in LOSSES]
    cost = partial(_improbable, published=motorway_loss_wh_per_km(vehicle))
    best = min(each, key=cost)
    if np.abs(best.after).max() > ROW_TOLERANCE:
        best = min(best, _with_two(vehicle, without_outliers(figures), best.before, cost), key=cost)
    return best


def _improbable(car: Anchored, published: float) -> tuple[float, float]:
    """Whether the mean stays open, and how improbable rows and motorway are: squares of standard deviations.

    Losses that meet city and highway alike differ most on a motorway, where no row is: a map with field weakening that is scaled far up
    would take a third of the energy there.
    """
    rows = float(np.sum((car.after / REPEAT_SD) ** 2))
    motorway = np.log(motorway_loss_wh_per_km(car.vehicle) / published) / LOSS_SD
    return round(abs(float(car.after.mean())), 3), rows + float(motorway) ** 2


def motorway_loss_wh_per_km(vehicle: Vehicle) -> float:
    """What the drivetrain loses at `MOTORWAY_M_S`."""
    trace = np.arange(2.0), np.full(2, MOTORWAY_M_S)
    load, mass = vehicle.road_load, vehicle.body.test_mass_kg
    constant, linear = load.rolling_coefficients
    density = load.coastdown_air_density_kg_m3 or air_density(SCHEDULE_DENSITY_DEGC)
    force = mass * GRAVITY_M_S2 * (constant + linear * MOTORWAY_M_S)
    force += 0.5 * density * load.drag_area_m2 * MOTORWAY_M_S**2
    base_load = vehicle.auxiliaries.base_load_w / MOTORWAY_M_S
    return driven_wh_per_km(vehicle, trace, mass) - (force + base_load) * 1000.0 * WH_PER_J


def _with_two(
    vehicle: Vehicle,
    figures: Sequence[CertifiedFigure],
    before: FloatArray,
    cost: Callable[[Anchored], tuple[float, float]],
) -> Anchored:
    """The most probable factor of the map, with an eddy-current loss that closes the mean."""
    from scipy.optimize import minimize_scalar  # slow to import

    def closed(motor: float) -> Anchored:
        two_motors = scaled(vehicle, "motor", motor)
        factor = closing_factor(partial(scaled, two_motors, "iron"), figures, BOUNDS["iron"])
        car = scaled(two_motors, "iron", factor)
        return Anchored(car, PAIR, factor, before, errors(car, figures))

    bounds = (MIN_MOTOR, BOUNDS["motor"][1])
    best = minimize_scalar(
        lambda m: 1e6 * cost(closed(m))[0] + cost(closed(m))[1],
        bounds=bounds,
        method="bounded",
        options={"xatol": 1e-3},
    )
    return closed(float(best.x))


def certified_figures(name: str, vehicle: Vehicle) -> tuple[CertifiedFigure, ...]:
    """List the certified figures of a car of the library.

    Parameters
    ----------
    name : str
        Name of the car in the table.
    vehicle : Vehicle
        The car, whose mass a WLTP figure is for where the table has no test mass.

    Returns
    -------
    tuple of CertifiedFigure
        Empty where the table has none.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> sorted({figure.cycle for figure in certified_figures("vw_id3", load_vehicle("vw_id3"))})
    ['wltc']
    """
    return tuple(_figures(catalogue().get(name, {}), vehicle))


def _figures(row: Row, vehicle: Vehicle) -> Iterator[CertifiedFigure]:
    for cycle in ("udds", "hwfet", "wltc"):
        for suffix, at_wall in (("", True), ("_battery", False)):
            for cell in row.get(f"{cycle}{suffix}", ()):
                yield CertifiedFigure(
                    cycle,
                    cell.number * WH_PER_KM[cell.unit],
                    at_wall,
                    _test_mass(row, cycle, vehicle),
                    cell.citation,
                    _OUTLIER in cell.note,
                )


def _test_mass(row: Row, cycle: str, vehicle: Vehicle) -> float:
    if cycle != "wltc":
        return row["test_weight"][0].number * KG_PER_LB
    if "wltc_mass" in row:
        return row["wltc_mass"][0].number
    largest: tuple[Cell, ...] = row.get("largest_mass", ())
    return wltp_test_mass(vehicle.body.test_mass_kg, largest[0].number if largest else None)
