"""A field of a departure: what it holds, its bounds, and how a person gives it on the command line, in a request and in a form."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from tripwatt.errors import Fault, did_you_mean, excerpt
from tripwatt.trips.columns import BOUNDS, Column, number_faults


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a departure. It has a `column` of numbers, `choices`, or a `type`.

    Attributes
    ----------
    help : str
        One sentence or more: what it is.
    label : str
        Name for people, in flags and beside the input of a form; empty where a form does not ask for it.
    column : Column or None
        Unit and bounds of a number.
    choices : tuple of str
        Words that are allowed.
    several : bool
        Whether it holds any number of the choices.
    type : {"text", "truth", "time"} or ""
        Kind of a value that is neither a number nor a choice.
    option : str
        Option of the command line; two fields of one option are given as `A@B`. Empty without one.
    metavar : str
        What the help of the option shows for the value.

    Examples
    --------
    >>> terrain = Field("Country.", choices=("flat", "hilly"), option="--terrain")
    >>> print(*terrain.faults("terrain", "hily"))
    unknown choice: terrain: got 'hily'; allowed: one of flat, hilly; did you mean 'hilly'?
    """

    help: str
    label: str = ""
    column: Column | None = None
    choices: tuple[str, ...] = ()
    several: bool = False
    type: str = ""
    option: str = ""
    metavar: str = ""

    @property
    def unit(self) -> str:
        """Unit of a number; empty where it has none."""
        return "" if self.column is None or self.column.unit == "1" else self.column.unit

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        if self.column is not None:
            return self.column.allowed
        if self.choices:
            return f"{'any' if self.several else 'one'} of {', '.join(self.choices)}"
        return KINDS[self.type]

    @classmethod
    def from_entry(cls, name: str, entry: Mapping[str, Any]) -> Field:
        """A field of `departure.toml`, with the bounds of its name in the tables of columns and its unit as metavar.

        Parameters
        ----------
        name : str
            Of the field.
        entry : mapping of str to object
            Attributes; the column as the name of another one or as its values, where it is not that of the name.

        Returns
        -------
        Field

        Examples
        --------
        >>> field = Field.from_entry("rain_mm_h", {"help": "Rain."})
        >>> field.allowed, field.metavar
        ('0 to 200 mm/h', 'MM/H')
        """
        about: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()
        }
        column = about.get("column", name)
        column = Column(*column) if isinstance(column, tuple) else BOUNDS.get(column)
        about |= {"column": column, "metavar": about.get("metavar", column.unit.upper() if column else "")}
        return cls(**about)

    def faults(self, name: str, value: Any) -> Iterator[Fault]:
        """The fault of a value; None is unknown and no fault.

        Parameters
        ----------
        name : str
            Of the field, in the message.
        value : object
            What was given.

        Yields
        ------
        Fault
            At most one.
        """
        if value is None:
            return
        if self.column is not None:
            yield from number_faults(name, value, self.column)
        elif self.several:
            if not (
                isinstance(value, tuple | list)
                and all(isinstance(v, str) and v in self.choices for v in value)
            ):
                yield Fault(f"unknown {name.removesuffix('s')}", name, repr(value)[:60], self.allowed)
        elif self.choices:
            yield from choice_faults(name, value, self.choices)
        elif not _is(self.type, value):
            yield Fault("wrong type", name, excerpt(value), self.allowed)


KINDS: Final[Mapping[str, str]] = {
    "text": "a text",
    "truth": "True or False",
    "time": "a datetime, for example datetime.datetime(2024, 1, 5, 8, 30)",
}


def _is(kind: str, value: Any) -> bool:
    """Whether a value is of a kind. Truth values of NumPy count, the missing time of pandas does not."""
    if kind == "truth":
        return isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")
    if kind == "text":
        return isinstance(value, str)
    return isinstance(value, dt.datetime) and bool(value == value)


def choice_faults(name: str, value: object, choices: tuple[str, ...]) -> Iterator[Fault]:
    """The fault of a value that is none of some words; None is unknown and no fault.

    Parameters
    ----------
    name : str
        Of the field, in the message.
    value : object
        What was given.
    choices : tuple of str
        Words that are allowed.

    Yields
    ------
    Fault
        At most one.
    """
    if value is None or (isinstance(value, str) and value in choices):
        return
    fix = did_you_mean(value, choices) if isinstance(value, str) else ""
    yield Fault("unknown choice", name, excerpt(value, 42), f"one of {', '.join(choices)}", fix)
