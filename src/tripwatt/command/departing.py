"""The options of a departure, on every command that forecasts: one for each field that a user may give."""

from __future__ import annotations

import datetime as dt
import inspect
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Any

import typer

from tripwatt.command.options import Options, assignments
from tripwatt.errors import Check, InvalidInput
from tripwatt.trips.departure import ASKED, Departure
from tripwatt.trips.fields import Field

DepartureOf = Callable[[], Departure]
"""Parameter of a command with the options of a departure: a function that makes the departure, or raises their faults."""


def departure_options(
    *, without: tuple[str, ...] = (), default: Mapping[str, float] | None = None
) -> Options:
    """Build the options of a departure, to annotate a command's parameter of type `DepartureOf`.

    Parameters
    ----------
    without : tuple of str
        Fields without effect on the command, which get no option.
    default : mapping of str to float, optional
        Default values of fields that the command does not leave unknown.

    Returns
    -------
    Options
        One option for each field, or for several fields that are given together.

    Examples
    --------
    >>> options = departure_options(without=("terrain",))
    >>> names = [parameter.name for parameter in options.parameters]
    >>> "soc" in names, "terrain" in names
    (True, False)
    >>> options.make(soc=0.8, wind="8@270")()
    Departure(soc=0.8, wind_speed_m_s=8.0, wind_from_deg=270.0)
    """
    grouped: dict[str, dict[str, Field]] = {}
    for name, field in ASKED.items():
        if name not in without:
            grouped.setdefault(field.option.removeprefix("--").replace("-", "_"), {})[name] = field
    usual = default or {}
    parameters = [
        inspect.Parameter(
            option,
            inspect.Parameter.KEYWORD_ONLY,
            default=usual.get(next(iter(fields))),
            annotation=_annotation(fields, shows_default=next(iter(fields)) in usual),
        )
        for option, fields in grouped.items()
    ]
    return Options(lambda **asked: partial(_departure, grouped, asked), parameters)


def _annotation(fields: Mapping[str, Field], *, shows_default: bool) -> Any:
    """Build type and help of the option for one field, or for several fields that are given as `A@B`."""
    field = next(iter(fields.values()))
    spoken = " ".join(field.help for field in fields.values())
    kind: Any = str | None
    if field.several or field.type == "values":
        kind, spoken = list[str] | None, f"{spoken} You can repeat the option."
    elif field.type == "time":
        spoken = f"{spoken} Local time, today without a date."
    elif field.column is not None and len(fields) == 1:
        kind = float | None
    metavar = "@".join(field.metavar for field in fields.values())
    option = typer.Option(field.option, metavar=metavar, help=spoken, show_default=shows_default)
    return Annotated[kind, option]


def _departure(grouped: Mapping[str, Mapping[str, Field]], asked: Mapping[str, Any]) -> Departure:
    known: dict[str, Any] = {}
    with Check() as check:
        for option, fields in grouped.items():
            if asked.get(option) is not None:
                known |= check(_values, fields, asked[option]) or {}
        return check(lambda: Departure(**known))


def _values(fields: Mapping[str, Field], value: Any) -> dict[str, Any]:
    """Parse the value of one option into the values of its fields."""
    name, field = next(iter(fields.items()))
    if field.several:
        return {name: tuple(value)}
    if field.type == "values":
        return {name: assignments(value, field.option)}
    if field.type == "time":
        return {name: time_of(value, field.option)}
    if len(fields) == 1:
        return {name: value}
    parts = str(value).split("@", len(fields) - 1)
    try:
        return {
            name: float(part) % 360.0 if field.unit == "°" else float(part)
            for (name, field), part in zip(fields.items(), parts, strict=False)
        }
    except ValueError as error:
        allowed = "@".join(field.metavar for field in fields.values())
        raise InvalidInput.of("not numbers", field.option, str(value)[:40], allowed) from error


def time_of(text: str, option: str = "--depart") -> dt.datetime:
    """Parse a local time: a time of today, or a date and a time.

    Raises
    ------
    InvalidInput
        If the text is neither.

    Examples
    --------
    >>> time_of("2026-02-01 07:30").hour, time_of("7:30").minute
    (7, 30)
    """
    today = dt.datetime.now().astimezone()
    try:
        if len(text) <= 5:
            clock = dt.time.fromisoformat(text.zfill(5))
            return today.replace(hour=clock.hour, minute=clock.minute, second=0, microsecond=0)
        return dt.datetime.fromisoformat(text).astimezone()
    except ValueError as error:
        raise InvalidInput.of("not a time", option, text[:40], "07:30, or 2026-02-01 07:30") from error


Departing = Annotated[DepartureOf, departure_options()]
DepartingNow = Annotated[DepartureOf, departure_options(without=("departs_at",))]
"""Types of the parameter for all options of a departure, and for those without the time of departure."""
