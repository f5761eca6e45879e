"""The area of reach: how far a charge carries in every direction, with 95 % and with 50 %."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any, Final

import numpy as np

from tripwatt.errors import or_none
from tripwatt.forecasting import Forecast
from tripwatt.forecasting.along import first_empty
from tripwatt.roads.journey.atlas import Atlas
from tripwatt.roads.journey.forecasting import RoadForecaster
from tripwatt.roads.routers import Road
from tripwatt.roads.routers.road import no_road
from tripwatt.routes.places import Place, bearings_deg
from tripwatt.trips import Flag
from tripwatt.trips.columns import require_fraction
from tripwatt.trips.messages import flag_to_dict

LEVELS: Final = (0.95, 0.5)
_DIRECTIONS: Final = 24
"""A choice: a road and a forecast in each direction take the time, and an outline of 15° steps looks smooth on a map."""
_FRUGAL_WH_KM: Final = 80.0
"""A choice: no car takes less over a long distance on the flat, so the places to which roads are routed lie beyond every reach."""

LONGEST_CONTOUR_MIN: Final = 120.0
"""Longest isochrone that is requested: servers allow two hours."""

_SLOW_ROAD_M_S: Final = 8.0
"""A choice: no way to the end of a reach has a lower mean speed, so the isochrone lies beyond the reach."""


@dataclass(frozen=True, eq=False, slots=True)
class Reach:
    """The area that a charge reaches.

    Attributes
    ----------
    start : Place
        Place of departure.
    outlines : dict of float to tuple of Place
        Corners of the area, clockwise, for each probability; each corner lies on a road.
    map_ends : bool
        Whether the charge carries beyond the end of a road in at least one direction, so that the area is larger than shown.
    attribution : str
        Text that has to be shown beside the area.

    Examples
    --------
    >>> start = Place(47.0, 9.0)
    >>> corners = tuple(start.moved(bearing, 80_000.0) for bearing in (0.0, 120.0, 240.0))
    >>> area = Reach(start, {0.9: corners}, map_ends=False).to_dict()
    >>> area["areas"][0]["polygon"]["type"], len(area["areas"][0]["polygon"]["coordinates"][0])
    ('Polygon', 4)
    """

    start: Place
    outlines: dict[float, tuple[Place, ...]]
    map_ends: bool
    attribution: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Convert the area to plain values; outlines as GeoJSON polygons.

        Returns
        -------
        dict
            Keys `start`, `areas`, `map_ends`, `flags` and `attribution`.
        """
        flags = [flag_to_dict(Flag("map_ends", "reach"))] if self.map_ends else []
        return {
            "start": self.start.to_dict(),
            "areas": [
                {"probability": level, "polygon": {"type": "Polygon", "coordinates": [_closed_ring(corners)]}}
                for level, corners in self.outlines.items()
            ],
            "map_ends": self.map_ends,
            "flags": flags,
            "attribution": self.attribution,
        }


def find_reach(forecaster: RoadForecaster, start: Place, atlas: Atlas, *, reserve: float = 0.1) -> Reach:
    """Find the area of reach, with one road and one forecast for each of `_DIRECTIONS` directions.

    Roads lead to places beyond the reach of the car: at the edge of an isochrone, or of a circle if the router has no isochrones.
    Along each road, the forecast gives the distance that the charge reaches with each probability before it falls to the reserve.

    Parameters
    ----------
    forecaster : RoadForecaster
        The car, its departure and the weather.
    start : Place
        Place of departure.
    atlas : Atlas
        Atlas with a router.
    reserve : float
        Displayed state of charge that is kept.

    Returns
    -------
    Reach
        One outline for each probability.

    Raises
    ------
    InvalidInput
        If the reserve is not between 0 and 1, or no road leads away from the start.

    Examples
    --------
    >>> find_reach(forecaster, Place(47.14, 9.52), open_atlas("map"), reserve=0.1)  # doctest: +SKIP
    """
    reserve = require_fraction("reserve", reserve)
    forecaster = replace(forecaster, heights=atlas.heights_around([start]))
    targets = _choose_targets(forecaster, start, atlas)
    roads = [found[0] for place in targets if (found := or_none(atlas.router.roads, (start, place)))]
    if not roads:
        atlas.router.roads((start, targets[0]))  # raises the router's own reason if it has one
        raise no_road([start, targets[0]], "no road away from the start")
    forecasts = [forecaster.forecast(road, "reach") for road in roads]
    return reach_along(roads, forecasts, start, reserve, atlas.attribution)


def reach_along(
    roads: list[Road], forecasts: list[Forecast], start: Place, reserve: float, attribution: str = ""
) -> Reach:
    """Return the area of reach on roads that lead away from a place, given the forecast of each road."""
    outlines, ends = {}, False
    for level in LEVELS:
        shares = [reached_share(forecast, level, reserve) for forecast in forecasts]
        ends = ends or max(shares) >= 1.0
        corners = [road.place_at(k * road.distance_m) for k, road in zip(shares, roads, strict=True)]
        outlines[level] = _farthest_in_each_direction(start, corners)
    return Reach(start, outlines, ends, attribution)


def _closed_ring(corners: tuple[Place, ...]) -> list[list[float]]:
    """Return the corners as a closed ring of GeoJSON."""
    return [[round(p.longitude_deg, 6), round(p.latitude_deg, 6)] for p in (*corners, *corners[:1])]


def reached_share(forecast: Forecast, level: float, reserve: float) -> float:
    """Return the share of the road that the charge reaches with the probability `level` before it falls to the reserve, 1 for all of it."""
    distance = forecast.drive.distance_m
    reached_m = first_empty(forecast.along.soc(level) - reserve, distance)
    return 1.0 if reached_m is None else reached_m / float(distance[-1])


def _choose_targets(forecaster: RoadForecaster, start: Place, atlas: Atlas) -> tuple[Place, ...]:
    """Choose a place in each direction that the isochrone has, farther than the charge carries or at the end of the map."""
    soc = forecaster.departure.soc if forecaster.departure.soc is not None else 0.8
    battery = forecaster.model.vehicle.battery
    energy_wh = soc * battery.capacity_ah * battery.cells_in_series * float(np.max(battery.ocv_v))
    farthest_m = energy_wh / _FRUGAL_WH_KM * 1000.0
    if atlas.bounds_deg is not None:
        south, west, north, east = atlas.bounds_deg
        corners = [Place(lat, lon) for lat in (south, north) for lon in (west, east)]
        farthest_m = min(farthest_m, max(start.distance_m(corner) for corner in corners))
    outline = atlas.router.outline(start, min(farthest_m / _SLOW_ROAD_M_S / 60.0, LONGEST_CONTOUR_MIN))
    if not outline:
        return tuple(start.moved(k * 360.0 / _DIRECTIONS, farthest_m) for k in range(_DIRECTIONS))
    return _farthest_in_each_direction(start, outline)


def _farthest_in_each_direction(start: Place, places: Sequence[Place]) -> tuple[Place, ...]:
    """Return the farthest place in each direction, in the order of the directions."""
    farthest: dict[int, tuple[float, float, Place]] = {}
    for place in places:
        way = np.array([(p.latitude_deg, p.longitude_deg) for p in (start, place)]).T
        distance_m, bearing_deg = start.distance_m(place), float(bearings_deg(*way)[0])
        sector = round(bearing_deg / 360.0 * _DIRECTIONS) % _DIRECTIONS
        if sector not in farthest or distance_m > farthest[sector][1]:
            farthest[sector] = bearing_deg, distance_m, place
    return tuple(place for _, _, place in sorted(farthest.values(), key=itemgetter(0)))
