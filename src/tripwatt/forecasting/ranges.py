"""Comparison of a trip with the training trips: values outside the training range, and unknown values at departure."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Final

import numpy as np

from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.familiarity import Range
from tripwatt.physics import conditions_at_departure, simulate_trip
from tripwatt.physics.cabin import heat_pump_cop
from tripwatt.physics.conditions import UNKNOWN_AMBIENT_DEGC
from tripwatt.trips import TEMPERATURES, Departure, Flag, Plan
from tripwatt.trips.columns import is_number
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

WATCHED: Final = (*TEMPERATURES, "trip_speed_m_s", "duration_s")
"""Quantities of a trip that are compared with the training trips."""


UNKNOWN_SD_K: Final[Mapping[str, float]] = {
    "cabin_setpoint_degc": 1.5,
    "cabin_temperature_degc": 6.0,
    "battery_temperature_degc": 6.0,
}
"""Standard deviation of each temperature of the car around the value assumed if it is unknown [K]. Set-point: drivers choose
20 to 23 °C. Cabin and battery: between a car that stood outside and one from a garage or from a drive."""

UNKNOWN_AIR_SD_K: Final = 8.0
"""Standard deviation of the outside temperature around `UNKNOWN_AMBIENT_DEGC` [K]: that of the hours of a year in central Europe."""

BATTERY_W_PER_K: Final = 10.0
"""Change of power per kelvin of battery temperature at departure [W/K]: 2 to 3 % of a resistive loss of 300 to 500 W."""

FAR_K: Final = 10.0
"""Difference from the given outside temperature [K] above which a cabin or battery temperature of the plan is flagged."""

NEVER_KNOWN: Final = Range(-np.inf, np.inf, 1.0)
"""Range of a quantity that is unknown in all training trips."""


def unknown_state_sd_wh(
    vehicle: Vehicle, unknown: Collection[str], hours: float, is_off: bool = False
) -> float:
    """Standard deviation of a trip's energy due to unknown temperatures of the car at departure [Wh].

    An error of the set-point changes the power, through the heat loss of the cabin. An error of the starting temperature of the
    cabin changes the energy, through its heat capacity. A heat pump needs only a part of the heat as electric energy. The
    errors are independent.

    Parameters
    ----------
    vehicle : Vehicle
    unknown : collection of str
        Names of the unknown temperatures, as in `UNKNOWN_SD_K`.
    hours : float
        Duration of the trip [h].
    is_off : bool
        Whether climate control is off: cabin temperatures then cost no energy.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> round(unknown_state_sd_wh(load_vehicle("bmw_i3_60ah"), ["cabin_setpoint_degc"], 0.5), 1)
    55.3
    """
    climate = None if is_off else vehicle.climate
    parts = [0.0]
    # a set would add them up in an order of its own in each process
    for name in filter(unknown.__contains__, UNKNOWN_SD_K):
        kelvin = UNKNOWN_SD_K[name]
        if name == "battery_temperature_degc":
            parts.append(BATTERY_W_PER_K * kelvin * hours)
        elif climate is not None:
            cost = 1.0 / climate.heater_efficiency
            if climate.heat_pump_max_heat_w > 0.0:
                cost = 1.0 / heat_pump_cop(0.0, climate)
            heat_wh_k = (climate.shell_w_k + climate.fresh_air_low_w_k) * hours
            if name == "cabin_temperature_degc":
                stored = climate.air_heat_capacity_j_k + climate.interior_heat_capacity_j_k
                heat_wh_k = min(heat_wh_k, stored / SECONDS_PER_HOUR)
            parts.append(kelvin * heat_wh_k * cost)
    return float(np.linalg.norm(parts))


def unknown_air_sd_wh(
    vehicle: Vehicle,
    plan: Plan,
    usual_wh: float,
    usual_degc: float = UNKNOWN_AMBIENT_DEGC,
    sd_k: float = UNKNOWN_AIR_SD_K,
) -> float:
    """Standard deviation of a trip's energy due to an unknown outside temperature [Wh].

    The trip is simulated at the temperatures of the three-point Gauss-Hermite rule, because energy is not linear in temperature.

    Parameters
    ----------
    vehicle : Vehicle
    plan : Plan
    usual_wh : float
        Simulated energy of the plan at the usual temperature [Wh].
    usual_degc, sd_k : float
        Usual outside temperature [°C] and its standard deviation [K].

    Examples
    --------
    >>> import tripwatt as tw
    >>> car, plan = tw.load_vehicle("bmw_i3_60ah"), tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> 300.0 < unknown_air_sd_wh(car, plan, tw.simulate(plan, car).simulated_energy_wh) < 800.0
    True
    """
    far_k = np.sqrt(3.0) * sd_k
    airs = (Departure(ambient_temperature_degc=usual_degc + kelvin) for kelvin in (-far_k, far_k))
    cold, warm = (simulate_trip(vehicle, plan.with_departure(air)).simulated_energy_wh for air in airs)
    energies_wh, weights = np.array([cold, usual_wh, warm]), np.array([1.0, 4.0, 1.0]) / 6.0
    return float(np.sqrt(weights @ (energies_wh - weights @ energies_wh) ** 2))


def unknown_wind_sd_wh(vehicle: Vehicle, plan: Plan) -> float:
    """Standard deviation of a trip's energy due to a wind of unknown direction [Wh]: half the difference of head and tail wind.

    The wind keeps its direction relative to the car, as on a straight road; on a road with turns the difference is smaller.
    """
    air = plan.air
    if air is None or not air.any_side_m_s:
        return 0.0
    plans = map(plan.with_weather, air.sides())
    against, behind = (simulate_trip(vehicle, each).simulated_energy_wh for each in plans)
    return 0.5 * abs(against - behind)


def kept_temperatures(plan: Plan, given: Departure | None) -> list[Flag]:
    """Flags for cabin and battery temperatures of the plan that are far from the outside temperature in `given`."""
    if given is None or given.ambient_temperature_degc is None:
        return []
    names = ("cabin_temperature_degc", "battery_temperature_degc")
    kept = {name: getattr(plan.departure, name) for name in names if getattr(given, name) is None}
    far = {n: t for n, t in kept.items() if t is not None and abs(t - given.ambient_temperature_degc) > FAR_K}
    return [Flag("file_value_kept", *pair, "degc") for pair in far.items()]


def compare(
    table: SegmentTable, ranges: Mapping[str, Range], vehicle: Vehicle, departure: Departure
) -> tuple[list[Flag], dict[str, float]]:
    """Compare the one trip of `table` with the training ranges.

    Returns
    -------
    flags : list of Flag
        One for each quantity outside its range, in standard deviations, and for each unknown temperature.
    unknown : dict of str to float
        Temperature that training trips have and the departure lacks -> assumed value [°C].
    """
    known = _watched(table)
    conditions = conditions_at_departure(vehicle, departure)
    cabin = conditions.cabin_start(vehicle)
    assumed = {
        "ambient_temperature_degc": conditions.ambient_temperature_degc,
        "cabin_temperature_degc": cabin.temperature_degc,
        "cabin_setpoint_degc": cabin.setpoint_degc,
        "battery_temperature_degc": conditions.battery_start_degc,
    }
    flags = [
        Flag("outside_training", name, float(beyond), "sd", (seen.low, seen.high))
        for name, value in known.items()
        if (seen := ranges.get(name, NEVER_KNOWN)) and (beyond := seen.beyond(value)) > 0.0
    ]
    # the corrector does not use a temperature that no training trip has
    used = (name for name in TEMPERATURES if np.isfinite(ranges[name].low))
    unknown = {name: assumed[name] for name in used if not np.isfinite(known[name])}
    return [*flags, *(Flag("usual_value_assumed", *pair, "degc") for pair in unknown.items())], unknown


def training_ranges(table: SegmentTable, covariates: Collection[str] = ()) -> dict[str, Range]:
    """Range of each quantity of `WATCHED` and of each covariate over the trips of a table; that of words has no bounds."""
    rows = [_watched(table.take([i])) for i in range(len(table))]
    values = {name: [row.get(name, np.nan) for row in rows] for name in (*WATCHED, *covariates)}
    return {name: Range.from_values(seen) or NEVER_KNOWN for name, seen in values.items()}


def _watched(table: SegmentTable) -> dict[str, float]:
    first = {name: float(table.columns[name][0]) for name in WATCHED if name in table.columns}
    if table.covariates is not None:
        given = table.covariates.iloc[0].items()
        first |= {f"{name}": float(value) for name, value in given if is_number(value)}
    return first | {"duration_s": float(table.hours.sum() * SECONDS_PER_HOUR)}
