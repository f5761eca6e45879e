"""Trips that a car finished on the road, and their way into its model.

The trips are files of the folder `live`. The store of the car holds those that it was given, its diary those that it learned: a
process that is killed at any moment leaves work to do again, and counts no trip twice.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

from tripwatt.errors import InvalidInput
from tripwatt.files import read_text_file, write_text
from tripwatt.server.cars.folder import finished_logs, finished_names, log_name
from tripwatt.server.cars.own_car import LIVE, Learned, is_car, open_car
from tripwatt.trips import Log

TAUGHT: Final = "taught.json"
"""File in the folder `live` with the names of finished trips that the car was given; it only saves work."""

MOST_TAUGHT_BYTES: Final = 1 << 24


def has_news(folder: Path) -> bool:
    """Tell whether a car has finished a trip that it was not given to learn. O(finished trips).

    Parameters
    ----------
    folder : Path
        Of the car.

    Returns
    -------
    bool
        False for a folder without the description of a car.

    Examples
    --------
    >>> has_news(Path("no-such-car"))
    False
    """
    return is_car(folder) and not set(finished_names(folder)) <= _taught(folder)


def learn_finished(folder: Path | str, *, progress: Callable[[int, int], None] | None = None) -> Learned:
    """Give a car the trips that it finished on the road: each is forecast before the model is adapted to it, and enters the diary.

    Parameters
    ----------
    folder : path
        Of a car with a description; another process may follow it meanwhile.
    progress : callable, optional
        As of `Car.add`.

    Returns
    -------
    Learned
        Trips that the car was given earlier are `known`.

    Raises
    ------
    InvalidInput
        As `open_car` and `Car.add`.

    Examples
    --------
    >>> learn_finished("cars/my-leaf")  # doctest: +SKIP
    Learned(added=1, known=12, entries=1, left_out=(), flat=0)
    """
    own = open_car(folder)
    names = finished_names(own.folder)
    # by id, not by content: the local time of a departure may be another one after the machine has moved
    there = set(own.store.trips(columns=["trip_id"])["trip_id"])
    new = [name for name in names if log_name(own.name, name) not in there]
    logs: list[Log] = []
    unreadable: list[str] = []
    for name in new:
        try:
            logs += finished_logs(own.folder, [name])
        except InvalidInput as error:  # somebody changed the file: the other trips count
            unreadable.append(f"{log_name(own.name, name)}: {error}")
    done = own.add(logs, progress=progress)
    write_text(own.folder / LIVE / TAUGHT, json.dumps({"trips": names}) + "\n")
    known = done.known + len(names) - len(new)
    return replace(done, known=known, left_out=(*done.left_out, *unreadable))


def _taught(folder: Path) -> set[str]:
    try:
        return set(json.loads(read_text_file(folder / LIVE / TAUGHT, MOST_TAUGHT_BYTES))["trips"])
    except (InvalidInput, ValueError, KeyError, TypeError):
        return set()
