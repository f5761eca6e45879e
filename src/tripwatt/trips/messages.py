"""English sentences for flags. Code that computes passes flags on; sentences are made where somebody reads them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import Any, Final

from tripwatt.trips.departure import ASKED
from tripwatt.trips.flags import Flag
from tripwatt.trips.showing import period
from tripwatt.units import M_S_PER_KM_H

NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {name: field.label for name, field in ASKED.items()}
    | {"trip_speed_m_s": "mean speed", "duration_s": "duration"}
)
"""Names for people of the fields that flags are about."""


def name_of(field: str) -> str:
    """Name for people of a field.

    Examples
    --------
    >>> name_of("cabin_setpoint_degc"), name_of("follows_trip")
    ('cabin set-point', 'follows trip')
    """
    return NAMES.get(field, field.replace("_", " "))


SIGNALS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "speed_m_s": "speed",
        "elevation_m": "elevation",
        "ambient_temperature_degc": "outside temperature",
        "cabin_temperature_degc": "cabin temperature",
        "cabin_setpoint_degc": "cabin set-point",
        "battery_temperature_degc": "battery temperature",
        "voltage_v": "battery voltage",
        "current_a": "battery current",
        "soc": "state of charge",
        "displayed_soc": "displayed state of charge",
        "motor_torque_nm": "motor torque",
        "heating_power_w": "heating power",
        "requested_heating_power_w": "requested heating power",
        "aircon_power_w": "power of the air conditioner",
        "climate_power_w": "power of climate control",
    }
)
"""Names for people of the signals of a log."""


def signal_name(column: str) -> str:
    """Name for people of a column of a log.

    Examples
    --------
    >>> signal_name("current_a"), signal_name("grade")
    ('battery current', 'grade')
    """
    return SIGNALS.get(column, column.replace("_", " "))


def _number(flag: Flag) -> float:
    return float(flag.value or 0.0)


def _kwh(flag: Flag) -> str:
    """Energy of a flag [Wh] in kWh: to 0.1, below 1 kWh to 0.01."""
    value = _number(flag) / 1000.0
    return f"{value:.1f}" if abs(value) >= 1.0 else f"{value:.2f}"


def _limit(what: str) -> Callable[[Flag], str]:
    return lambda flag: f"the car cannot reach the speed of the trace for {period(_number(flag))}: {what}"


def _state(what: str) -> Callable[[Flag], str]:
    return lambda flag: f"{what} for {period(_number(flag))}"


def _changed(flag: Flag) -> str:
    if isinstance(flag.value, float):
        return f"{flag.value:.0f} more values of the car are changed"
    known, _, value = str(flag.value).partition(" -> ")
    unit = "" if flag.unit in ("", "1") else f" {flag.unit.replace('degc', '°C')}"
    return f"{flag.subject} is {value}{unit} in place of {known}{unit}"


COUNTRIES: Final[Mapping[str, str]] = MappingProxyType(
    {"flat": "of flat country", "hilly": "of hilly country", "mountains": "in the mountains"}
)
"""Terrains as part of a sentence."""

MESSAGES: Final[Mapping[str, Callable[[Flag], str]]] = MappingProxyType(
    {
        "outside_training": lambda f: (
            f"{name_of(f.subject)} is {'far ' if _number(f) >= 1.0 else ''}outside the range of the training "
            "trips: the interval is wider"
        ),
        "usual_value_assumed": lambda f: f"{name_of(f.subject)} is unknown: {_number(f):.0f} °C is assumed",
        "soc_assumed": lambda f: f"state of charge at departure is unknown: {_number(f):.0%} is assumed",
        "no_elevation": lambda f: "elevation is unknown",
        "unknown_climb": lambda f: (
            "the heights of the road are unknown: the interval has the climb that roads "
            f"{'of any country' if f.subject == 'unknown' else COUNTRIES.get(f.subject, f.subject)} may have; each 100 m of climb takes "
            f"{100.0 * _number(f):.1f} points of charge"
        ),
        "no_trips_of_car": lambda f: (
            f"the model has no trips of this car: the forecast uses its published values and the correction learned "
            f"on a {f.subject}"
        ),
        "changed_car": lambda f: (
            _changed(f)
            + ": the trips of the model were of the unchanged car, so that its correction counts as that of another car and the "
            "interval is wider"
        ),
        "outside_classes": lambda f: (
            f"no car of the library is as {'light' if f.subject == 'lighter' else 'heavy'} as {_number(f):.0f} kg: road load, drivetrain and "
            "climate control are extrapolated from its classes and the interval is wider"
        ),
        "route_error_unknown": lambda f: (
            "the error of planned routes was not measured for this model: the interval is too narrow"
        ),
        "links_too_long": lambda f: (
            f"links of {_number(f):.0f} m are longer than the links with which the error of planned routes was measured"
        ),
        "free_flow_times": lambda f: (
            "travel times are those of an empty road; the usual loss of time is added from the trips of the model"
        ),
        "travel_time_error_unknown": lambda f: (
            "the error of free-flow travel times was not measured for this model: the interval is too narrow"
        ),
        "no_stations": lambda f: "no charging stations are known on this map",
        "no_stop_found": lambda f: "no single charging stop makes the journey arrive with 95 %",
        "class_charging_curve": lambda f: (
            "the charging curve of the car is unknown: that of a middle-class car is assumed"
        ),
        "wind_direction_unknown": lambda f: (
            f"the direction of the wind of {_number(f):.0f} m/s to the road is unknown: it counts as from any side and the interval has a "
            "head wind and a tail wind"
        ),
        "map_ends": lambda f: "the map ends before the charge: the area of reach is larger than shown",
        "file_value_kept": lambda f: (
            f"{name_of(f.subject)} is {_number(f):.0f} °C as in the file; the outside temperature that you gave does not "
            "change it"
        ),
        "motor_torque_limit": _limit("motor torque limit"),
        "motor_power_limit": _limit("motor power limit"),
        "motor_speed_limit": _limit("motor speed limit"),
        "battery_voltage_floor": _limit("lowest voltage of the battery"),
        "battery_empty": lambda f: (
            f"the trip takes {_kwh(f)} kWh more than the battery holds: it is empty before the end"
            if f.unit == "wh"
            else f"the battery is empty for {period(_number(f))}"
        ),
        "battery_full": lambda f: (
            f"the battery is too full for {_kwh(f)} kWh of recovered energy: the friction brakes take it"
        ),
        "battery_over_voltage": _state("the battery voltage is above its limit"),
        "battery_not_settled": lambda f: "the simulated battery state did not converge",
        "elevation_relative": lambda f: "elevation is relative: the lowest place of the road is set to 0 m",
        "times_ignored": lambda f: "times are ignored: the first or the last point has no time",
        "elevation_interpolated": lambda f: "elevation is interpolated at points without elevation",
        "times_interpolated": lambda f: "times are interpolated at points without time",
        "speed_assumed": lambda f: (
            f"{_number(f) / M_S_PER_KM_H:.0f} km/h is assumed where the track has no speed"
        ),
        "car_assumed": lambda f: (
            f"the car is unknown: {f.subject} is assumed; give --vehicle (see `tripwatt vehicles`)"
        ),
        "synthetic": lambda f: "the trips are synthetic: no figure describes a real car",
        "planted_faults": lambda f: (
            f"{_number(f):.0f} logs have a planted fault: a frozen signal, a current of the wrong sign, a filled gap; "
            "tripwatt.synthetic.faulty_fleet lists them"
        ),
        "files_not_read": lambda f: (
            f"{_number(f):.0f} CSV files were not read: their names are not those of trips"
        ),
        "trips_skipped": lambda f: (
            f"{_number(f):.0f} trips of combustion cars and hybrids, or without samples, were skipped"
        ),
        "rows_without_trip": lambda f: f"{f.subject}: {_number(f):.0f} rows without a trip were left out",
        "rows_without_time": lambda f: f"{f.subject}: {_number(f):.0f} rows without a time were left out",
        "rows_sorted": lambda f: f"{f.subject}: rows were sorted by their time stamps",
        "samples_missing": lambda f: (
            f"{f.subject}: no samples for {_number(f):.0f} s; the audit splits the trip there"
        ),
        "time_goes_back": lambda f: (
            f"{f.subject}: the time decreases by {_number(f):.0f} s; if the file contains several trips, name their "
            "column under [trip] in the mapping"
        ),
        "no_energy": lambda f: (
            "no energy is measured: map voltage_v and current_a, or battery_power_w, or a state of charge with "
            "[battery] usable_capacity_kwh"
        ),
        "nominal_voltage": lambda f: (
            f"no voltage was logged: {_number(f):g} V is assumed, only the power is measured"
        ),
        "energy_from_soc": lambda f: (
            f"energy is calculated from the state of charge and {f.subject}: the standard error of the median trip is "
            f"{_number(f):.0%}"
        ),
        "sheet_missing": lambda f: (
            f"{f.subject} is missing: season, weather and departure of every trip are unknown"
        ),
        "sheet_row_twice": lambda f: f"{f.value} has two rows of {f.subject}: the first is used",
        "sheet_row_missing": lambda f: f"{f.value} has no {f.subject}: season and weather are unknown",
        "same_departure": lambda f: (
            f"{f.value} gives {f.subject} the same time of departure: at least one is wrong"
        ),
        "value_not_used": lambda f: f"{f.subject}: {f.value!r} is not plausible and is not used",
        "gap_bridged": lambda f: (
            f"no samples for {period(_number(f))} in all: {signal_name(f.subject)} is interpolated over the gaps"
        ),
        "first_of_several": lambda f: f"the first of {_number(f):.0f} {f.subject} is used",
        "geometries_skipped": lambda f: f"{_number(f):.0f} geometries that are not lines are left out",
    }
)
"""Code of a flag -> its sentence."""

SERIOUS: Final = frozenset({"battery_empty"})
"""Flags of trips that cannot end as planned."""


def message(flag: Flag) -> str:
    """The sentence of a flag; one of an unknown code is named with its fields.

    Examples
    --------
    >>> message(Flag("speed_assumed", "track", 50.0 / 3.6, "m_s"))
    '50 km/h is assumed where the track has no speed'
    >>> message(Flag("outside_training", "duration_s", 2.4, "sd"))
    'duration is far outside the range of the training trips: the interval is wider'
    >>> message(Flag("new", "road", 3.0, "m"))
    'new: road 3.0 m'
    """
    made = MESSAGES.get(flag.code)
    return made(flag) if made else " ".join(filter(None, (f"{flag.code}: {flag.subject}", *_value(flag))))


def leave_in_words(soc: float, reserve: float, probability: float) -> str:
    """What a driver reads of a charge to leave with, as `Forecast.soc_needed` gives it; rounded up.

    Examples
    --------
    >>> leave_in_words(0.4412, 0.1, 0.95)
    'Leave with 45 % to arrive with 10 % or more in 19 of 20 trips.'
    >>> leave_in_words(1.112, 0.1, 0.9)
    'A full battery does not suffice to arrive with 10 % or more in 9 of 10 trips: 12 % of it are missing.'
    >>> leave_in_words(0.0, 0.0, 0.5)
    'Any charge suffices to arrive in 1 of 2 trips.'
    """
    share = Fraction(probability).limit_denominator(20)
    if abs(float(share) - probability) > 1e-9:
        share = Fraction(probability).limit_denominator(1000)
    left = f" with {100.0 * reserve:g} % or more" if reserve > 0.0 else ""
    aim = f"to arrive{left} in {share.numerator} of {share.denominator} trips"
    percent = math.ceil(100.0 * (soc - 1.0 if soc > 1.0 else soc) - 1e-6)
    if soc > 1.0:
        return f"A full battery does not suffice {aim}: {percent} % of it are missing."
    return f"Leave with {percent} % {aim}." if soc > 0.0 else f"Any charge suffices {aim}."


def flag_to_dict(flag: Flag) -> dict[str, Any]:
    """The four fields of a flag and its English `message`, as the command line and the service give them in JSON.

    Examples
    --------
    >>> flag_to_dict(Flag("links_too_long", "links", 6000.0, "m"))["code"]
    'links_too_long'
    """
    return {
        "code": flag.code,
        "subject": flag.subject,
        "value": flag.value,
        "unit": flag.unit,
        "message": message(flag),
    }


def _value(flag: Flag) -> tuple[Any, ...]:
    return () if flag.value is None else (str(flag.value), flag.unit)
