"""Charging stations from a map folder or a user's file."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput, excerpt, raise_faults
from tripwatt.files import read_text_file
from tripwatt.routes.places import Place
from tripwatt.routes.points import EARTH_RADIUS_M

DC_SOCKETS: Final = (
    "type2_combo",
    "chademo",
    "tesla_supercharger",
    "tesla_supercharger_ccs",
    "type1_combo",
    "nacs",
)
"""Names of sockets with direct current on OpenStreetMap."""

ASSUMED_POWER_W: Final[Mapping[bool, float]] = MappingProxyType({True: 50_000.0, False: 11_000.0})
"""Assumed power of a station with direct current (True) or without, if it is not known: that of the first generation of rapid chargers,
and of a three-phase socket of 16 A."""

BOUNDS: Final = {"latitude_deg": (-90.0, 90.0), "longitude_deg": (-180.0, 180.0), "power_kw": (1.0, 1500.0)}
"""Columns that a file of stations needs, with their bounds; `name` is optional."""

DIRECT_FROM_W: Final = 43_001.0
"""A station of a file with this power or more is taken to have direct current, since alternating current ends at 43 kW."""

MAX_STATIONS: Final = 1_000_000
MAX_STATIONS_BYTES: Final = 1 << 27
"""Largest number of stations in a file, and largest size of the file [bytes]."""


@dataclass(frozen=True, slots=True)
class Station:
    """A charging station.

    Attributes
    ----------
    latitude_deg, longitude_deg : float
    name : str
    power_w : float
        Power of the strongest socket.
    direct_current : bool
    power_known : bool
        Whether the source gives the power; else the power is assumed.
    plugs : tuple of str
        Names of the sockets on OpenStreetMap; empty if they are not known.
    """

    latitude_deg: float
    longitude_deg: float
    name: str
    power_w: float
    direct_current: bool = False
    power_known: bool = True
    plugs: tuple[str, ...] = ()

    @property
    def place(self) -> Place:
        """The place of the station."""
        name = self.name or "charging station"
        return Place(self.latitude_deg, self.longitude_deg, name, "charging_station")

    def usable_with(self, plugs: Set[str]) -> Station | None:
        """Return the station as a car with these plugs can use it, or None if no plug fits; unknown plugs of either are taken to fit.

        Examples
        --------
        >>> station = Station(47.0, 9.0, "", 5e4, direct_current=True, plugs=("chademo", "type2"))
        >>> station.usable_with({"type2_combo", "type2"}).direct_current, station.usable_with({"type1"})
        (False, None)
        """
        fitting = plugs & {*self.plugs}
        if not plugs or not self.plugs:
            return self
        direct = self.direct_current and not fitting.isdisjoint(DC_SOCKETS)
        return replace(self, direct_current=direct) if fitting else None


def read_stations(path: Path | str) -> tuple[Station, ...]:
    """Read stations from a CSV file with the columns `latitude_deg`, `longitude_deg`, `power_kw` and optionally `name`.

    Raises
    ------
    InvalidInput
        If the file has faults.
    """
    path = Path(path)
    text = read_text_file(
        path, MAX_STATIONS_BYTES, what="cannot read the stations", allowed="a CSV table in UTF-8"
    )
    try:
        reader = csv.DictReader(io.StringIO(text, newline=""))
        names = reader.fieldnames or ()
        rows = list(itertools.islice(reader, MAX_STATIONS + 1))
    except csv.Error as error:
        raise InvalidInput.of(
            "cannot read the stations", f"{path}", f"{error}"[:80], "a CSV table"
        ) from error
    missing = [name for name in BOUNDS if name not in names]
    if missing:
        raise InvalidInput.of("missing column", path.name, ", ".join(missing), ", ".join(BOUNDS))
    if len(rows) > MAX_STATIONS:
        raise InvalidInput.of("too many stations", path.name, f"{len(rows)}", f"at most {MAX_STATIONS}")
    faults, columns = [], []
    for column, (low, high) in BOUNDS.items():
        values = pd.Series(pd.to_numeric([row[column] for row in rows], errors="coerce")).to_numpy(np.float64)
        wrong = np.flatnonzero(~((values >= low) & (values <= high)))
        if len(wrong):
            where = f"{path.name}, column '{column}', row {wrong[0] + 1}"
            got = excerpt(rows[wrong[0]][column])
            faults.append(Fault("value out of range", where, got, f"{low:g} to {high:g}"))
        columns.append(values.tolist())
    raise_faults(faults)
    called = [row.get("name") or "" for row in rows]
    return tuple(
        Station(latitude, longitude, name, 1000.0 * kw, direct_current=1000.0 * kw >= DIRECT_FROM_W)
        for latitude, longitude, kw, name in zip(*columns, called, strict=True)
    )


def within(
    stations: Sequence[Station], south: float, west: float, north: float, east: float, limit: int
) -> tuple[Station, ...]:
    """Return the stations inside of bounds [°], the strongest first, at most `limit`. O(n log n).

    Examples
    --------
    >>> stations = [Station(47.0, 9.0, "a", 5e4), Station(47.1, 9.0, "b", 1.5e5), Station(48.0, 9.0, "c", 5e4)]
    >>> [station.name for station in within(stations, 46.0, 8.0, 47.5, 10.0, 2)]
    ['b', 'a']
    """
    inside = [s for s in stations if south <= s.latitude_deg <= north and west <= s.longitude_deg <= east]
    return tuple(sorted(inside, key=lambda station: -station.power_w)[:limit])


def near(stations: Sequence[Station], points: Sequence[Place], farthest_m: float) -> list[tuple[int, int]]:
    """Find stations within a distance of a line of points. O(n log n).

    Returns pairs (index of the station, index of the nearest point), in the order of the points.

    Examples
    --------
    >>> stations = [Station(47.0, 9.0, "a", 5e4), Station(48.0, 9.0, "b", 5e4)]
    >>> near(stations, [Place(47.001, 9.0), Place(46.0, 9.0)], 500.0)
    [(0, 0)]
    """
    from scipy.spatial import cKDTree

    if not stations or not points:
        return []
    line = cKDTree(_on_sphere([(p.latitude_deg, p.longitude_deg) for p in points]))
    where = _on_sphere([(s.latitude_deg, s.longitude_deg) for s in stations])
    distance, nearest = line.query(where, distance_upper_bound=farthest_m)
    pairs = [(k, int(nearest[k])) for k in range(len(stations)) if np.isfinite(distance[k])]
    return sorted(pairs, key=lambda pair: pair[1])


def _on_sphere(pairs: Sequence[tuple[float, float]]) -> Any:
    lat, lon = np.radians(np.array(pairs)).T
    return EARTH_RADIUS_M * np.column_stack(
        (np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat))
    )
