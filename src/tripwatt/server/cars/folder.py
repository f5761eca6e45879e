"""The folder `live` of a car: its finished trips as tables, and the forecasts that were made of them on the way."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import pandas as pd

from tripwatt.errors import InvalidInput, system_errors
from tripwatt.files import write_file
from tripwatt.server.cars.on_the_way import MadeForecast, read_forecasts, write_forecasts
from tripwatt.server.cars.own_car import LIVE, VALID_NAME
from tripwatt.server.cars.telemetry import FIRST_TIME_S, LAST_TIME_S
from tripwatt.sources.canonical import read_canonical
from tripwatt.trips import Context, Log

TRIPS: Final = "trips"
FORECASTS: Final = "forecasts.json"
"""Forecasts of the trip that the car is on; of a finished trip, the end of the name of its file."""
NAMES: Final = re.compile(r"\d{8}T\d{6}Z")
NAMED: Final = "%Y%m%dT%H%M%SZ"
"""Name of a finished trip: its departure in UTC."""


def live_folder(place: Path) -> Path:
    """The folder `live` of a car, made where it is missing.

    Raises
    ------
    InvalidInput
        When the name of the car cannot be one, or the folder cannot be made.
    """
    if VALID_NAME.fullmatch(place.name) is None:
        allowed = "up to 64 letters, digits, '.', '_' and '-'"
        raise InvalidInput.of("name cannot be used", f"{place}", place.name, allowed)
    with system_errors("cannot write the folder", f"{place}", "a writable folder"):
        (place / LIVE).mkdir(mode=0o700, parents=True, exist_ok=True)
    return place / LIVE


def finished_names(folder: Path) -> list[str]:
    """Names of the trips that a car has finished, in the order of their departure; files that others put there are left out."""
    files = (folder / LIVE / TRIPS).glob("*.csv")
    return sorted(path.stem for path in files if _is_name(path.stem))


def _is_name(name: str) -> bool:
    try:
        return (
            NAMES.fullmatch(name) is not None and FIRST_TIME_S <= started_at(name).timestamp() <= LAST_TIME_S
        )
    except ValueError:  # no such day or time of day
        return False


def finished_logs(folder: Path, names: Iterable[str] | None = None) -> tuple[Log, ...]:
    """Trips that a car has finished, all or those of some names. Another process may follow the car meanwhile.

    Raises
    ------
    InvalidInput
        When one of them cannot be read.
    """
    return tuple(_read_trip(folder, name) for name in (finished_names(folder) if names is None else names))


def keep_trip(folder: Path, start_s: float, table: pd.DataFrame, made: tuple[MadeForecast, ...]) -> None:
    """Write a trip that a car has finished, with the forecasts that were made on the way.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    trips = folder / LIVE / TRIPS
    trips.mkdir(mode=0o700, exist_ok=True)
    name = f"{dt.datetime.fromtimestamp(start_s, dt.UTC):{NAMED}}"
    if made:  # first: who reads the trip as soon as it is there reads its forecasts as well
        write_forecasts(trips / f"{name}.{FORECASTS}", start_s, made)
    write_file(trips / f"{name}.csv", lambda part: table.to_csv(part, index=False))


def erase_trips(folder: Path, before_s: float) -> int:
    """Erase finished trips whose departure is earlier [s since 1970]; their number. O(finished trips)."""
    old = [name for name in finished_names(folder) if started_at(name).timestamp() < before_s]
    for name in old:
        for end in (FORECASTS, "csv"):
            (folder / LIVE / TRIPS / f"{name}.{end}").unlink(missing_ok=True)
    return len(old)


def log_name(car: str, name: str) -> str:
    """Name of the log of a finished trip.

    Examples
    --------
    >>> log_name("leaf", "20240501T080000Z")
    'leaf-20240501T080000Z'
    """
    return f"{car}-{name}"


def forecasts_of(folder: Path, trip_id: str) -> tuple[MadeForecast, ...]:
    """Forecasts that were made during a finished trip, by the name of its log; none where none were made."""
    name = trip_id.removeprefix(log_name(folder.name, ""))
    if not _is_name(name):
        return ()
    return read_forecasts(folder / LIVE / TRIPS / f"{name}.{FORECASTS}")[1]


def started_at(name: str) -> dt.datetime:
    """Departure of a finished trip, by its name."""
    return dt.datetime.strptime(name, NAMED).replace(tzinfo=dt.UTC)


def _read_trip(folder: Path, name: str) -> Log:
    local = started_at(name).astimezone().replace(tzinfo=None)
    table = read_canonical(folder / LIVE / TRIPS / f"{name}.csv")
    return Log.from_samples(log_name(folder.name, name), table, Context(started_at=local))
