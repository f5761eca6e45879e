"""Fields of a departure: meaning and bounds, and how a person gives a value on the command line, in a request and in a form."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from tripwatt.errors import Fault, did_you_mean, excerpt
from tripwatt.trips.columns import BOUNDS, Column, is_number, number_faults


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a departure. It has a `column` of numbers, `choices`, or a `type`.

    Attributes
    ----------
    help : str
        Meaning, in one sentence or more.
    label : str
        Name in flags and beside the input of a form; empty if the form has no such input.
    column : Column or None
        Unit and bounds of a number.
    choices : tuple of str
        Allowed words.
    several : bool
        Whether a value may have any number of the choices.
    type : {"text", "truth", "time", "values"} or ""
        Kind of a value that is neither a number nor a choice.
    option : str
        Option of the command line, empty without one; two fields with the same option are given as `A@B`.
    metavar : str
        Placeholder of the value in the help of the option.

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
        """Unit of a number; empty if there is none."""
        return "" if self.column is None or self.column.unit == "1" else self.column.unit

    @property
    def allowed(self) -> str:
        """Text of the allowed values."""
        if self.column is not None:
            return self.column.allowed
        if self.choices:
            return f"{'any' if self.several else 'one'} of {', '.join(self.choices)}"
        return KINDS[self.type]

    @classmethod
    def from_entry(cls, name: str, entry: Mapping[str, Any]) -> Field:
        """Make a field from an entry of `departure.toml`; bounds come from `BOUNDS`, and the unit is the default metavar.

        Parameters
        ----------
        name : str
            Name of the field.
        entry : mapping of str to object
            Attributes. `column` is a name of `BOUNDS` or the values of a column; by default, it is the column of `name`.

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
        """Yield a fault if a value is not allowed; None means unknown and is allowed.

        Parameters
        ----------
        name : str
            Name of the field in the message.
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
            words = value if isinstance(value, tuple | list) else (None,)
            if not all(isinstance(word, str) and word in self.choices for word in words):
                yield Fault(f"unknown {name.removesuffix('s')}", name, repr(value)[:60], self.allowed)
        elif self.choices:
            if not isinstance(value, str) or value not in self.choices:
                fix = did_you_mean(value, self.choices) if isinstance(value, str) else ""
                yield Fault("unknown choice", name, excerpt(value, 42), self.allowed, fix)
        elif not _is(self.type, value):
            yield Fault("wrong type", name, excerpt(value), self.allowed)


KINDS: Final[Mapping[str, str]] = {
    "text": "a text",
    "truth": "True or False",
    "values": "a dict of names to finite numbers or texts",
    "time": "a datetime, for example datetime.datetime(2024, 1, 5, 8, 30)",
}


def _is(kind: str, value: Any) -> bool:
    """Return whether a value is of a kind of `KINDS`. Truth values of NumPy count as "truth", NaT of pandas is no "time"."""
    if kind == "truth":
        return isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")
    if kind == "values":
        return isinstance(value, Mapping) and all(
            isinstance(name, str) and (isinstance(each, str) or (is_number(each) and math.isfinite(each)))
            for name, each in value.items()
        )
    if kind == "text":
        return isinstance(value, str)
    return isinstance(value, dt.datetime) and bool(value == value)
