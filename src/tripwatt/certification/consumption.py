"""Consumption of a car on the schedules of certification: simulated, certified, and brought together.

`data/schedules.csv` has one speed trace each for UDDS, HWFET and WLTC (class 3b). It contains each change from one speed to another as
often as the schedule does, on a grid of `SPEED_STEP_M_S`, but in another order. Distance, stops and, for a warm car without climate
control, energy are those of the schedule. `python -m tools.data.schedules --write` makes the file.

Anchoring changes the road load of a car so that the mean error of its certified consumption is zero: the simulation of a car with published
values misses it. For a car without a coast-down, everything that its class leaves open is changed together: rolling, air drag and gear,
each in the proportion in which it is most probably the cause (`OPEN`). For the library's cars with a measured coast-down,
`tools.data.anchoring` changes a loss between wheel and battery.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from statistics import fmean
from typing import Final, cast

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.physics import DriveConditions, simulate
from tripwatt.physics.road_load import air_density
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.catalogue import catalogue

SPEED_STEP_M_S: Final = 0.1
"""Step of the grid of speeds; at 0.1 m/s the energy of a schedule changes by at most 0.1 %."""

CYCLES: Final = ("udds", "hwfet", "wltc")
"""City and highway schedule of the EPA (40 CFR 600.111), and the cycle of UN GTR 15 for cars of class 3b."""

CELL_TEMPERATURE_DEGC: Final = 23.0
"""Air temperature of the test cell: 20 to 30 degC (40 CFR 86.135), 23 degC (UN GTR 15)."""

INITIAL_SOC: Final = 0.6
"""State of charge of the simulation: both procedures drive the battery from full to empty."""

WLTP_LOAD_KG: Final = 25.0
"""Luggage in the test mass, Regulation (EU) 2017/1151 Annex XXI."""

WLTP_SHARE_OF_LOAD: Final = 0.15
"""Share of the largest load that is added to the test mass of passenger cars, same annex."""

USUAL_LOAD_KG: Final = 350.0
"""Largest load less 25 kg, assumed if the largest mass of a car is unknown: four more people and luggage."""

SCHEDULE_DENSITY_DEGC: Final = 20.0


@dataclass(frozen=True, slots=True)
class CertifiedFigure:
    """A certified consumption of a car on one schedule.

    Attributes
    ----------
    cycle : str
        One of `CYCLES`, or "town": the WLTC with no speed above 50 km/h.
    wh_per_km : float
        Consumption [Wh/km].
    at_wall : bool
        Whether the figure is measured at the wall, with the losses of charging, or else at the battery terminals.
    test_mass_kg : float
        Mass of the car in the test [kg].
    source : str
        Where the figure comes from.
    outlier : bool
        Whether the list marks the figure as out of proportion to the work at the wheels.

    Examples
    --------
    >>> CertifiedFigure("wltc", 160.0, at_wall=True, test_mass_kg=1900.0, source="list of the maker").outlier
    False
    """

    cycle: str
    wh_per_km: float
    at_wall: bool
    test_mass_kg: float
    source: str
    outlier: bool = False


@cache
def schedule(cycle: str) -> tuple[FloatArray, FloatArray]:
    """Return time [s] and speed [m/s] of the trace that stands for a schedule, shape (samples,) each.

    Parameters
    ----------
    cycle : str
        One of `CYCLES`, or "town": the WLTC with no speed above 50 km/h.

    Examples
    --------
    >>> time, speed = schedule("udds")
    >>> float(time[-1]), round(float(np.trapezoid(speed, time)) / 1000.0, 2)
    (1369.0, 11.99)
    """
    # 50 km/h is the highest speed of the urban cycle of UN Regulation 83, in which quadricycles are tested
    if cycle == "town":
        time, speed = schedule("wltc")
        return time, np.minimum(speed, 50.0 / 3.6)
    file = resources.files("tripwatt.certification") / "data" / "schedules.csv"
    rows = csv.DictReader(file.read_text(encoding="utf-8").splitlines())
    speed = SPEED_STEP_M_S * np.array([float(row["speed"]) for row in rows if row["cycle"] == cycle])
    time = np.arange(len(speed), dtype=np.float64)
    for values in (time, speed):
        values.setflags(write=False)
    return time, speed


@cache
def charging_efficiency() -> float:
    """Energy at the battery over energy at the wall [1]: mean of the certificates of the table that state both.

    Examples
    --------
    >>> round(charging_efficiency(), 3)
    0.894
    """
    return fmean(cell.number for row in catalogue().values() for cell in row.get("charging_efficiency", ()))


def wltp_test_mass(running_order_kg: float, largest_mass_kg: float | None = None) -> float:
    """WLTP test mass of a car without options [kg], Regulation (EU) 2017/1151 Annex XXI.

    Parameters
    ----------
    running_order_kg : float
        Mass in running order, with a driver of 75 kg [kg].
    largest_mass_kg : float, optional
        Technically permissible mass [kg]; a usual load is assumed if not given.

    Examples
    --------
    >>> round(wltp_test_mass(1577.0, 1988.0), 1)
    1659.9
    """
    load = USUAL_LOAD_KG if largest_mass_kg is None else largest_mass_kg - running_order_kg - WLTP_LOAD_KG
    return running_order_kg + WLTP_LOAD_KG + WLTP_SHARE_OF_LOAD * load


def driven_wh_per_km(vehicle: Vehicle, trace: tuple[FloatArray, FloatArray], test_mass_kg: float) -> float:
    """Simulate the consumption of a warm car on a dynamometer without climate control, at the battery terminals. O(samples).

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    trace : tuple of ndarray
        Time [s] and speed [m/s], shape (samples,) each.
    test_mass_kg : float
        Mass of the car in the test [kg].

    Returns
    -------
    float
        Consumption [Wh/km].

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> trace = np.arange(60.0), np.full(60, 15.0)
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> driven_wh_per_km(car, trace, 1300.0) < driven_wh_per_km(car, trace, 1500.0)
    True
    """
    time, speed = trace
    load = vehicle.road_load
    density = load.coastdown_air_density_kg_m3 if load.method == "coastdown" else None
    run = simulate(
        vehicle,
        time,
        speed,
        conditions=DriveConditions(
            on_dynamometer=True,
            ambient_temperature_degc=CELL_TEMPERATURE_DEGC,
            payload_mass_kg=test_mass_kg - vehicle.body.test_mass_kg,
            initial_soc=INITIAL_SOC,
            initial_warmth=1.0,
            climate="off",
            air_density_kg_m3=air_density(SCHEDULE_DENSITY_DEGC) if density is None else density,
        ),
    )
    return float(run.simulated_energy_wh / (np.trapezoid(speed, time) / 1000.0))


def simulated_wh_per_km(vehicle: Vehicle, figure: CertifiedFigure) -> float:
    """Simulate the test of a certified figure, and return its consumption at the wall or at the battery terminals. O(samples).

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    figure : CertifiedFigure
        The figure, of which cycle, test mass and place of measurement are used.

    Returns
    -------
    float
        Consumption where the figure was measured [Wh/km].

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> at_wall, inside = (CertifiedFigure("udds", 110.0, wall, 1400.0, "example") for wall in (True, False))
    >>> simulated_wh_per_km(car, at_wall) > simulated_wh_per_km(car, inside)
    True
    """
    at_terminals = driven_wh_per_km(vehicle, schedule(figure.cycle), figure.test_mass_kg)
    return at_terminals / charging_efficiency() if figure.at_wall else at_terminals


def relative_error(vehicle: Vehicle, figure: CertifiedFigure) -> float:
    """Return simulated over certified consumption, less one. O(samples).

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    figure : CertifiedFigure
        Its certified consumption.

    Returns
    -------
    float
        Positive if the simulated consumption is larger.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> figure = CertifiedFigure("udds", simulated_wh_per_km(car, CertifiedFigure("udds", 1.0, False, 1400.0, "")), False, 1400.0, "")
    >>> relative_error(car, figure)
    0.0
    """
    return simulated_wh_per_km(vehicle, figure) / figure.wh_per_km - 1.0


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
