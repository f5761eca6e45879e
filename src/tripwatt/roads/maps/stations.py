"""Charging stations from a map folder or a user's file."""

from __future__ import annotations

import csv
import io
import itertools
import math
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


@dataclass(frozen=True, slots=True)
class PlugKind:
    """What one kind of plug gives.

    Attributes
    ----------
    title : str
        Name for a driver.
    direct_current : bool
    assumed_w : float
        Power that is assumed if the power of a plug is not known [W]: that of the first stations with the kind.
    highest_w : float
        Highest power that the kind can give [W]. A higher power is taken to be a slip.
    """

    title: str
    direct_current: bool
    assumed_w: float
    highest_w: float

    @property
    def lowest_w(self) -> float:
        """Lowest power that the kind can give [W]; a choice."""
        return 5_000.0 if self.direct_current else 1_000.0


PLUG_KINDS: Final[Mapping[str, PlugKind]] = MappingProxyType(
    {
        "type2_combo": PlugKind("CCS", True, 50_000.0, 1_500_000.0),
        "tesla_supercharger_ccs": PlugKind("CCS", True, 50_000.0, 1_500_000.0),
        "tesla_supercharger": PlugKind("Supercharger", True, 50_000.0, 1_500_000.0),
        "nacs": PlugKind("NACS", True, 50_000.0, 1_500_000.0),
        "type1_combo": PlugKind("CCS 1", True, 50_000.0, 1_500_000.0),
        "chademo": PlugKind("CHAdeMO", True, 50_000.0, 400_000.0),
        "type2_cable": PlugKind("Type 2", False, 11_000.0, 44_000.0),
        "type2": PlugKind("Type 2", False, 11_000.0, 44_000.0),
        "tesla_destination": PlugKind("Tesla", False, 11_000.0, 22_000.0),
        "type1": PlugKind("Type 1", False, 6_600.0, 19_200.0),
        "schuko": PlugKind("Schuko", False, 2_300.0, 3_700.0),
        "typee": PlugKind("Type E", False, 2_300.0, 3_700.0),
    }
)
"""Names of plugs on OpenStreetMap, the strongest first. Assumed powers are choices: those of the first rapid chargers, of three phases
with 16 A, of 30 A at 220 V, and of 10 A at 230 V."""

HOUSEHOLD: Final = frozenset({"schuko", "typee"})
"""Sockets of a house, which bicycles use, too."""

UNLISTED: Final = PlugKind("", False, 2_300.0, 44_000.0)
"""Any other plug."""

UNKNOWN_W: Final = 11_000.0
"""Assumed power of a station whose plugs and power are not known: that of three phases with 16 A."""

BOUNDS: Final = {"latitude_deg": (-90.0, 90.0), "longitude_deg": (-180.0, 180.0), "power_kw": (1.0, 1500.0)}
"""Columns that a file of stations needs, with their bounds; `name` is optional."""

DIRECT_FROM_W: Final = 43_001.0
"""A station of unknown plugs with this power or more is taken to have direct current, since alternating current ends at 43 kW."""

MAX_STATIONS: Final = 1_000_000
MAX_STATIONS_BYTES: Final = 1 << 27
"""Largest number of stations in a file, and largest size of the file [bytes]."""


@dataclass(frozen=True, slots=True)
class Plug:
    """One kind of plug of a charging station.

    Attributes
    ----------
    kind : str
        Its name on OpenStreetMap, such as "type2_combo".
    power_w : float
    power_known : bool
        Whether the source gives the power of the plug; else the power is assumed.
    """

    kind: str
    power_w: float
    power_known: bool = True

    @property
    def direct_current(self) -> bool:
        """Whether the plug has direct current."""
        return PLUG_KINDS.get(self.kind, UNLISTED).direct_current


@dataclass(frozen=True, slots=True)
class Station:
    """A charging station.

    Attributes
    ----------
    latitude_deg, longitude_deg : float
    name : str
    power_w : float
        Power of `plug`; of a station that is not yet used by a car, of its strongest plug.
    direct_current : bool
    power_known : bool
        Whether the source gives the power; else the power is assumed.
    plug : str
        Name on OpenStreetMap of the plug that the car uses; empty if it is not known.
    plugs : tuple of Plug
        All plugs of the station; empty if they are not known.
    networks : tuple of str
        The network of the station, who operates it, and its brand; empty if they are not known.
    """

    latitude_deg: float
    longitude_deg: float
    name: str
    power_w: float
    direct_current: bool = False
    power_known: bool = True
    plug: str = ""
    plugs: tuple[Plug, ...] = ()
    networks: tuple[str, ...] = ()

    @classmethod
    def with_plugs(cls, latitude_deg: float, longitude_deg: float, name: str, *plugs: Plug) -> Station:
        """Make a station with known plugs, at least one; its power is that of the strongest.

        Examples
        --------
        >>> Station.with_plugs(47.0, 9.0, "", Plug("type2", 22e3), Plug("chademo", 5e4)).plug
        'chademo'
        """
        station = cls(latitude_deg, longitude_deg, name, 0.0, plugs=plugs)
        return station._used_by(max(plugs, key=lambda plug: plug.power_w))

    @classmethod
    def without_plugs(cls, latitude_deg: float, longitude_deg: float, name: str, power_w: float) -> Station:
        """Make a station of unknown plugs; a power of 0 is not known, and `UNKNOWN_W` is assumed."""
        is_direct, is_known = power_w >= DIRECT_FROM_W, power_w > 0.0
        return cls(latitude_deg, longitude_deg, name, power_w or UNKNOWN_W, is_direct, is_known)

    @property
    def place(self) -> Place:
        """The place of the station."""
        name = self.name or "charging station"
        return Place(self.latitude_deg, self.longitude_deg, name, "charging_station")

    @property
    def power_in_words(self) -> str:
        """Plug and power for a driver.

        Examples
        --------
        >>> Station(47.0, 9.0, "", 2.3e3, power_known=False, plug="schuko").power_in_words
        'Schuko, 2.3 kW assumed'
        """
        power = f"{round(self.power_w / 1000.0, 1):g} kW"
        plug = PLUG_KINDS.get(self.plug, UNLISTED).title
        return ", ".join(filter(None, (plug, power if self.power_known else f"{power} assumed")))

    def usable_with(
        self, plugs: Set[str], most_w: tuple[float, float] = (math.inf, math.inf)
    ) -> Station | None:
        """Return the station as a car can use it, or None if no plug fits.

        Unknown plugs of either are taken to fit, but those of direct current only if the car has one.

        Parameters
        ----------
        plugs : set of str
            Names of the plugs of the car.
        most_w : tuple of float
            Highest power that the car takes with alternating and with direct current [W].

        Returns
        -------
        Station or None
            The station with the power of the plug with which this car charges fastest.

        Examples
        --------
        >>> station = Station.with_plugs(47.0, 9.0, "", Plug("chademo", 1e5), Plug("type2_combo", 5e4), Plug("type2", 22e3))
        >>> [station.usable_with({plug, "type2"}).power_w for plug in ("chademo", "type2_combo", "nacs")]
        [100000.0, 50000.0, 22000.0]
        >>> station.usable_with({"type1"}) is None
        True
        """
        if not self.plugs:
            is_slow = bool(plugs) and not any(Plug(kind, 0.0).direct_current for kind in plugs)
            return None if is_slow and self.direct_current else self
        fitting = [plug for plug in self.plugs if not plugs or plug.kind in plugs]
        if not fitting:
            return None
        best = max(fitting, key=lambda plug: min(plug.power_w, most_w[plug.direct_current]))
        return self._used_by(best)

    def _used_by(self, plug: Plug) -> Station:
        direct, known = plug.direct_current, plug.power_known
        return replace(self, power_w=plug.power_w, direct_current=direct, power_known=known, plug=plug.kind)


def read_stations(path: Path | str) -> tuple[Station, ...]:
    """Read stations from a CSV file with the columns `latitude_deg`, `longitude_deg`, `power_kw` and optionally `name`.

    Raises
    ------
    InvalidInput
        If the file has faults.
    """
    path, what, allowed = Path(path), "cannot read the stations", "a CSV table in UTF-8"
    text = read_text_file(path, MAX_STATIONS_BYTES, what=what, allowed=allowed)
    try:
        reader = csv.DictReader(io.StringIO(text, newline=""))
        names = reader.fieldnames or ()
        rows = list(itertools.islice(reader, MAX_STATIONS + 1))
    except csv.Error as error:
        raise InvalidInput.of(what, f"{path}", f"{error}"[:80], allowed) from error
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
        Station.without_plugs(latitude, longitude, name, 1000.0 * kw)
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
    distance, nearest = cKDTree(on_sphere(points)).query(on_sphere(stations), distance_upper_bound=farthest_m)
    pairs = [(k, int(nearest[k])) for k in range(len(stations)) if np.isfinite(distance[k])]
    return sorted(pairs, key=lambda pair: pair[1])


def on_sphere(places: Sequence[Any]) -> Any:
    """Return what has a latitude and a longitude as points of a sphere [m], shape (places, 3): for distances of some kilometres."""
    lat, lon = np.radians([(place.latitude_deg, place.longitude_deg) for place in places]).T
    return EARTH_RADIUS_M * np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]).T
