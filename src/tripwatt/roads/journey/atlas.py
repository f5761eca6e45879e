"""The atlas of a journey: roads, names of places, charging stations, weather."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tripwatt.errors import Check, InvalidInput
from tripwatt.roads.maps.elevation import MARGIN_DEG, Elevation
from tripwatt.roads.maps.engine import router_in_process
from tripwatt.roads.maps.folder import ATTRIBUTION, MapFolder, open_map
from tripwatt.roads.maps.heights import KnownHeights
from tripwatt.roads.maps.stations import Station, read_stations, within
from tripwatt.roads.routers import Router, ValhallaRouter, is_server, open_server
from tripwatt.roads.search import PlaceSearch, find_place, open_search
from tripwatt.roads.weather import WeatherServer, WeatherSource
from tripwatt.routes.places import Place
from tripwatt.sources.table import Heights

_MAP_VARIABLE: Final = "TRIPWATT_MAP"
"""Environment variable of the map or router that is used if none is named."""

Bounds = tuple[float, float, float, float]
"""South, west, north and east [°]."""

_HOW_TO_GET_A_MAP: Final = "build a map with tripwatt map build, or name a router by its URL"
_HOW_TO_COVER_MORE: Final = "build a map of a larger region for places outside of it"


@dataclass(frozen=True)
class AtlasSettings:
    """Places of the parts of an atlas, as a user names them. Empty texts are not used.

    Attributes
    ----------
    map : str
        Folder of a map, or a router's server as `KIND=URL`.
    places : str
        Server that finds places, as `KIND=URL`; if empty, the index of the map is used.
    weather : str
        URL of a server with the interface of Open-Meteo.
    stations : str
        CSV file of charging stations; if empty, the stations of the map are used.

    Examples
    --------
    >>> AtlasSettings("map", stations="stations.csv").weather
    ''
    """

    map: str = ""
    places: str = ""
    weather: str = ""
    stations: str = ""


@dataclass(frozen=True)
class Atlas:
    """A source of roads and, if known, of places, charging stations and weather.

    Attributes
    ----------
    router : Router
        Router that finds roads.
    places : PlaceSearch or None
        Search for places by name; None if only coordinates are accepted.
    stations : tuple of Station
        Charging stations; empty if none are known.
    weather : WeatherSource or None
        Source of weather forecasts; None if there is none.
    folder : MapFolder or None
        The folder of the map; None if there is only a server of roads.
    is_local : bool
        Whether the roads are those of the folder, and end at the bounds of its map.

    Examples
    --------
    >>> from tripwatt.roads.maps.stations import Station
    >>> from tripwatt.roads.routers import open_server
    >>> router = open_server("osrm=http://127.0.0.1:5000")
    >>> atlas = Atlas(router, stations=(Station(47.0, 9.0, "A", 5e4), Station(48.0, 9.0, "B", 5e4)))
    >>> [station.name for station in atlas.stations_within((46.0, 8.0, 47.5, 10.0), 9)]
    ['A']
    >>> atlas.tile(14, 8620, 5750), atlas.settlements((46.0, 8.0, 47.5, 10.0), 9)
    (b'', ())
    """

    router: Router
    places: PlaceSearch | None = None
    stations: tuple[Station, ...] = ()
    weather: WeatherSource | None = None
    folder: MapFolder | None = field(default=None, repr=False)
    is_local: bool = False

    @property
    def attribution(self) -> str:
        """Text that has to be shown beside a road or a place."""
        return ATTRIBUTION if self.folder is None else str(self.folder.info.get("attribution", ATTRIBUTION))

    @property
    def bounds_deg(self) -> Bounds | None:
        """South, west, north and east of the map folder; None without bounds."""
        bounds = None if self.folder is None else self.folder.info.get("bounds_deg")
        return None if bounds is None else (bounds[0], bounds[1], bounds[2], bounds[3])

    @property
    def has_tiles(self) -> bool:
        """Whether the router has tiles of its roads, to draw a map."""
        return isinstance(self.router, ValhallaRouter) and self.router.ask_tile is not None

    @property
    def heights(self) -> Heights | None:
        """Function from latitudes and longitudes to heights, as `tripwatt.roads.maps.Elevation.at`; None for a map without heights."""
        if self.folder is None or not self.folder.info["terrain"].get("known"):
            return None
        return Elevation.from_folder(self.folder.folder).at

    @property
    def covers(self) -> str:
        """The region of the map in words, and what to do about places outside of the region; empty without a map folder."""
        covered = "" if self.folder is None else self.folder.covers
        return f"this map covers {covered}; {_HOW_TO_COVER_MORE}" if covered else ""

    def heights_around(self, places: Sequence[Place]) -> KnownHeights | None:
        """Return the heights around places on the map; None if there are too few, or without a map folder."""
        return None if self.folder is None else self.folder.index.heights_around(places)

    def find(self, stop: Place | str, where: str) -> Place:
        """Find a place on the map.

        Parameters
        ----------
        stop : Place or str
            A place, its whole name, or latitude and longitude.
        where : str
            Name of the field, for messages.

        Returns
        -------
        Place
            The place, with its kind if the search has one.

        Raises
        ------
        InvalidInput
            If the name is not that of exactly one place, or the place lies outside of the map.

        Examples
        --------
        >>> from tripwatt.roads.routers import open_server
        >>> Atlas(open_server("osrm=http://127.0.0.1:5000")).find("47.14, 9.52", "from").title
        '47.14000, 9.52000'
        """
        place = stop if isinstance(stop, Place) else find_place(stop, self.places, where, self.covers)
        if self.is_local and self.bounds_deg is not None:
            south, west, north, east = self.bounds_deg
            inside = south - MARGIN_DEG <= place.latitude_deg <= north + MARGIN_DEG
            if not (inside and west - MARGIN_DEG <= place.longitude_deg <= east + MARGIN_DEG):
                allowed, _, fix = self.covers.partition("; ")
                raise InvalidInput.of("place outside of the map", where, place.title, allowed, fix)
        return place

    def tile(self, zoom: int, column: int, row: int) -> bytes:
        """Read a vector tile of the roads. See `ValhallaRouter.tile`.

        Parameters
        ----------
        zoom : int
            Level of the tile, 0 for the world.
        column : int
            Column of the tile, counted from west, 0 to 2^zoom - 1.
        row : int
            Row of the tile, counted from north, 0 to 2^zoom - 1.

        Returns
        -------
        bytes
            The tile; empty if there are no roads in it, or the router is not Valhalla.
        """
        return self.router.tile(zoom, column, row) if isinstance(self.router, ValhallaRouter) else b""

    def settlements(self, bounds_deg: Bounds, limit: int) -> tuple[Place, ...]:
        """List the settlements of the map inside of bounds, the most important first.

        Parameters
        ----------
        bounds_deg : tuple of float
            South, west, north and east [°].
        limit : int
            Largest number of settlements.

        Returns
        -------
        tuple of Place
            Empty without a map folder.
        """
        return () if self.folder is None else self.folder.index.settlements(*bounds_deg, limit)

    def stations_within(self, bounds_deg: Bounds, limit: int) -> tuple[Station, ...]:
        """List the charging stations inside of bounds, those with the most power first.

        Parameters
        ----------
        bounds_deg : tuple of float
            South, west, north and east [°].
        limit : int
            Largest number of stations.

        Returns
        -------
        tuple of Station
            Empty if there are no stations.
        """
        return within(self.stations, *bounds_deg, limit)


def open_atlas(settings: AtlasSettings | Path | str | None = None) -> Atlas:
    """Open an atlas.

    Parameters
    ----------
    settings : AtlasSettings, path or str, optional
        Settings, or only the folder of a map or the URL of a router. By default, the environment variable `TRIPWATT_MAP`.

    Returns
    -------
    Atlas
        Atlas with the parts that the settings name or the map has; other parts are None or empty.

    Raises
    ------
    InvalidInput
        If parts cannot be opened, with all of them.

    Examples
    --------
    >>> open_atlas("map").bounds_deg  # doctest: +SKIP
    """
    if not isinstance(settings, AtlasSettings):
        settings = AtlasSettings("" if settings is None else str(settings))
    name = settings.map or os.environ.get(_MAP_VARIABLE, "")
    with Check() as check:
        router, folder = check(_open_roads, name) or (None, None)
        index = None if folder is None else folder.index
        places = check(open_search, settings.places) if settings.places else index
        weather = check(WeatherServer.from_url, settings.weather) if settings.weather else None
        stations = () if index is None or settings.stations else check(index.stations)
        if settings.stations:
            stations = check(read_stations, settings.stations)
    assert router is not None  # `check` has raised its fault otherwise
    return Atlas(router, places, stations, weather, folder, folder is not None and not is_server(name))


def _open_roads(name: str) -> tuple[Router, MapFolder | None]:
    """Open the router and the map folder, if any. `FOLDER@URL` means the places of a map folder with the roads of a server."""
    if not name:
        raise InvalidInput.of(
            "no map", "--map", "none", "a folder with a map, or the URL of a router", _HOW_TO_GET_A_MAP
        )
    if not is_server(name):
        folder = open_map(name)
        return router_in_process(folder.folder), folder
    folder_name, separator, url = name.partition("@")
    if separator and "://" not in folder_name:
        return open_server(url, "--map"), open_map(folder_name)
    return open_server(name, "--map"), None
