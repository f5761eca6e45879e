"""English sentences of flags, from `flags.toml`. Computations pass flags; sentences are made only for output."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cache
from typing import Any, Final

from tripwatt.errors import percent
from tripwatt.files import shipped_toml
from tripwatt.trips.departure import ASKED
from tripwatt.trips.flags import Flag
from tripwatt.trips.showing import in_kwh, period, span
from tripwatt.units import M_S_PER_KM_H


def name_of(field: str) -> str:
    """Return the readable name of a field.

    Examples
    --------
    >>> name_of("cabin_setpoint_degc"), name_of("follows_trip")
    ('cabin set-point', 'follows trip')
    """
    if field in ASKED:
        return ASKED[field].label
    return str(catalogue()["names"].get(field, {}).get("cli", field.replace("_", " ")))


def signal_name(column: str) -> str:
    """Return the readable name of a column of a log.

    Examples
    --------
    >>> signal_name("current_a"), signal_name("grade")
    ('battery current', 'grade')
    """
    return str(catalogue()["signals"].get(column, column.replace("_", " ")))


def _number(flag: Flag) -> float:
    return float(flag.value or 0.0)


def _changed(flag: Flag, k: int) -> str:
    """Return the old (k = 0) or the new (k = -1) value of a flag's "old -> new", with its unit."""
    unit = "" if flag.unit in ("", "1") else f" {flag.unit.replace('degc', '°C')}"
    return f"{str(flag.value).split(' -> ')[k]}{unit}"


FORMS: Final[Mapping[str, Callable[[Flag], str]]] = {
    "subject": lambda f: f.subject,
    "name": lambda f: name_of(f.subject),
    "signal": lambda f: signal_name(f.subject),
    "value": lambda f: str(f.value),
    "quoted": lambda f: repr(f.value),
    "old": lambda f: _changed(f, 0),
    "new": lambda f: _changed(f, -1),
    "number": lambda f: f"{_number(f):.0f}",
    "general": lambda f: f"{_number(f):g}",
    "percent": lambda f: percent(_number(f)),
    "points": lambda f: f"{100.0 * _number(f):.1f}",
    "temperature": lambda f: f"{_number(f):.0f} °C",
    "speed": lambda f: f"{_number(f) / M_S_PER_KM_H:.0f} km/h",
    "distance": lambda f: f"{_number(f) / 1000.0:.1f} km",
    "kwh": lambda f: f"{in_kwh(_number(f))} kWh",
    "span": lambda f: period(_number(f)),
    "seen": lambda f: f", {span(f.subject, *f.seen)}" if f.seen else "",
}
"""Placeholder in the words of a flag -> function that fills it. The web page has its own, in the units of the reader."""


@cache
def catalogue() -> Mapping[str, Any]:
    """Return the tables of `flags.toml` with the words of all flags."""
    return shipped_toml("trips/flags.toml")


def _picked(words: str | Mapping[str, str], flag: Flag) -> str:
    """Choose among words by the subject, the unit or the step of a flag."""
    if isinstance(words, str):
        return words
    steps = catalogue()["flags"][flag.code].get("steps", {})
    step = max((name for name in steps if steps[name] <= _number(flag)), key=steps.get, default="")
    return next((words[key] for key in (flag.subject, flag.unit, step) if key in words), words["other"])


def severity_of(flag: Flag) -> str:
    """Return the severity of a flag: "note", "caution", or "warning" if the trip cannot end as planned.

    Examples
    --------
    >>> severity_of(Flag("battery_empty", "battery", 900.0, "wh")), severity_of(Flag("no_elevation", "road"))
    ('warning', 'note')
    """
    return _picked(catalogue()["flags"].get(flag.code, {}).get("severity", "note"), flag)


def message(flag: Flag) -> str:
    """Return the sentence of a flag; for an unknown code, a text of its fields.

    Examples
    --------
    >>> message(Flag("speed_assumed", "track", 50.0 / 3.6, "m_s"))
    '50 km/h is assumed where the track has no speed'
    >>> message(Flag("outside_training", "duration_s", 2.4, "sd", (300.0, 3200.0)))
    'duration is far outside the range of the training trips, 5 min to 53 min: the error there is not known from trips'
    >>> message(Flag("new", "road", 3.0, "m"))
    'new: road 3.0 m'
    """
    if flag.code not in catalogue()["flags"]:
        value = () if flag.value is None else (str(flag.value), flag.unit)
        return " ".join(filter(None, (f"{flag.code}: {flag.subject}", *value)))
    words = catalogue()["flags"][flag.code]["cli"]

    def filled(template: str) -> str:
        return re.sub(r"\{(\w+)\}", lambda found: form(found[1]), template)

    def form(name: str) -> str:
        return filled(_picked(words[name], flag)) if name in words else FORMS[name](flag)

    return form("text")


def leave_in_words(soc: float, reserve: float, probability: float) -> str:
    """Return a sentence about the charge to leave with, rounded up to whole percent.

    Examples
    --------
    >>> leave_in_words(0.4412, 0.1, 0.95)
    '45 % is enough to arrive with 10 % left in 19 of 20 trips.'
    >>> leave_in_words(1.112, 0.1, 0.9)
    'A full battery is not enough to arrive with 10 % left in 9 of 10 trips: it takes 112 % of one.'
    >>> leave_in_words(3.96, 0.1, 0.9)
    'A full battery is not enough to arrive with 10 % left in 9 of 10 trips: it takes 4.0 full batteries.'
    >>> leave_in_words(0.0, 0.0, 0.5)
    'Any charge is enough to arrive in 1 of 2 trips.'
    """
    fraction = Fraction(probability).limit_denominator(20)
    if abs(float(fraction) - probability) > 1e-9:
        fraction = Fraction(probability).limit_denominator(1000)
    reserve_text = f" with {100.0 * reserve:g} % left" if reserve > 0.0 else ""
    aim = f"to arrive{reserve_text} in {fraction.numerator} of {fraction.denominator} trips"
    excess = math.ceil(100.0 * (soc - 1.0 if soc > 1.0 else soc) - 1e-6)
    if soc > 1.0:
        needed = f"{100 + excess} % of one" if soc < 2.0 else f"{soc:.1f} full batteries"
        return f"A full battery is not enough {aim}: it takes {needed}."
    return f"{excess} % is enough {aim}." if soc > 0.0 else f"Any charge is enough {aim}."


def flag_to_dict(flag: Flag) -> dict[str, Any]:
    """Return the four fields of a flag and its English `message`, as in the JSON of the command line and the service.

    Examples
    --------
    >>> flag_to_dict(Flag("links_too_long", "links", 6000.0, "m"))["code"]
    'links_too_long'
    """
    fields = {"code": flag.code, "subject": flag.subject, "value": flag.value, "unit": flag.unit}
    return {**fields, "message": message(flag)}
