"""What can go wrong, said once: every problem names what, where, what was found and what is allowed.

The library raises; the command line and the service translate. All faults of an input travel together in
one `InvalidInput`, so that a user mends a file once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


class TripwattError(Exception):
    """Base of every error that the library raises on purpose."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong with an input.

    Attributes
    ----------
    what : str
        The problem in a few words.
    where : str
        File, row, column, key or argument.
    got : str
        What was found there.
    allowed : str
        What would have been right.
    fix : str
        What the user can do, empty when `allowed` says it all.

    Examples
    --------
    >>> print(Fault("speed out of range", "A01.csv row 12", "912", "0 to 250 km/h"))
    speed out of range: A01.csv row 12: got 912; allowed: 0 to 250 km/h
    """

    what: str
    where: str
    got: str = ""
    allowed: str = ""
    fix: str = ""

    def __str__(self) -> str:
        text = f"{self.what}: {self.where}"
        parts = [
            f"{label}{value}"
            for label, value in (("got ", self.got), ("allowed: ", self.allowed), ("", self.fix))
            if value
        ]
        return f"{text}: {'; '.join(parts)}" if parts else text


class InvalidInput(TripwattError):
    """An input that cannot be used, with every fault that was found in it.

    Examples
    --------
    >>> error = InvalidInput([Fault("no trips", "data/", "0 CSV files", "at least one Trip*.csv")])
    >>> print(error)
    no trips: data/: got 0 CSV files; allowed: at least one Trip*.csv
    """

    def __init__(self, faults: Iterable[Fault] | Fault) -> None:
        self.faults: tuple[Fault, ...] = (faults,) if isinstance(faults, Fault) else tuple(faults)
        super().__init__("\n".join(map(str, self.faults)))

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[tuple[Fault, ...]]]:
        return (type(self), (self.faults,))  # survives the way back from a worker process


class RemoteError(InvalidInput):
    """A server that was asked gave no answer, or none that can be used: a router, a search for places, the weather.

    Examples
    --------
    >>> print(RemoteError(Fault("the router does not respond", "127.0.0.1:8002", "connection refused")))
    the router does not respond: 127.0.0.1:8002: got connection refused
    """
