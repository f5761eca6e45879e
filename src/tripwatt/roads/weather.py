"""The weather along a road: given by hand, or from a server with the interface of Open-Meteo. By default, no server is used."""

from __future__ import annotations

import datetime as dt
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Protocol

import numpy as np

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.errors import InvalidInput
from tripwatt.roads.routers.road import Road
from tripwatt.routes.documents import Node
from tripwatt.routes.places import Place, driven_m
from tripwatt.routes.web import WebClient, as_remote, require_url
from tripwatt.trips import Flag, Plan, PlanWeather, raise_faults
from tripwatt.trips.columns import scalar_faults
from tripwatt.trips.weather import WIND_AT_CAR, air_density_at
from tripwatt.units import M_PER_MILE, M_S_PER_KM_H, SECONDS_PER_HOUR

POINT_EVERY_M: Final = 30_000.0
"""Distance between the points of a road for which the weather is requested [m]: a few cells of a weather model. A choice."""

MAX_POINTS: Final = 20
"""A choice that bounds the request: the URL holds the coordinates of all points."""
_CACHE_S: Final = 3600.0
"""Time for which an answer is used again [s]: a choice, because weather models run every few hours."""

MAX_CACHED: Final = 5000
"""Largest number of answers that are kept: a choice that bounds the memory."""
_CELL_DEG: Final = 0.05
"""Size of a cell [°]: a choice, because places in a cell of 5 km have the same weather. They share an answer."""

TEMPERATURE_SD_K: Final = (1.0, 0.4)
WIND_SD_M_S: Final = (1.0, 0.4)
"""Standard deviation of a forecast of temperature and wind: now, and its growth per day ahead. A choice, of the
order of the errors that weather services publish for the temperature at 2 m and the wind at 10 m."""

_UNITS: Final[Mapping[str, Mapping[str, tuple[float, float]]]] = {
    "temperature_2m": {"°C": (1.0, 0.0), "°F": (5.0 / 9.0, -160.0 / 9.0)},
    "precipitation": {"mm": (1.0, 0.0), "inch": (25.4, 0.0)},
    "surface_pressure": {"hPa": (100.0, 0.0)},
    "wind_speed_10m": {
        "m/s": (1.0, 0.0),
        "km/h": (M_S_PER_KM_H, 0.0),
        "mp/h": (M_PER_MILE / SECONDS_PER_HOUR, 0.0),
        "kn": (1852.0 / 3600.0, 0.0),
    },
    "wind_direction_10m": {"°": (1.0, 0.0)},
}
"""Factor and offset to our unit for each unit of each hourly variable; the first unit is that of the request."""

_CellAndHour = tuple[int, int, dt.datetime]
"""Row and column of a cell, and an hour."""


@dataclass(frozen=True, slots=True)
class Weather:
    """The weather at one place and hour.

    Attributes
    ----------
    temperature_degc : float or None
        None = not known.
    wind_speed_m_s, wind_from_deg : float
        Wind 10 m above the ground: speed, and the direction from which it blows, clockwise from north.
    rain_mm_h : float
    pressure_pa : float or None
        Air pressure at the ground; None = not known.
    hours_ahead : float or None
        Time from now to the hour of a forecast [h]; None for values given by hand, which count as exact.
    unknown : tuple of str
        Fields of a departure that the source should have and does not.

    Raises
    ------
    InvalidInput
        If values are out of their bounds.
    """

    temperature_degc: float | None = None
    wind_speed_m_s: float = 0.0
    wind_from_deg: float = 0.0
    rain_mm_h: float = 0.0
    pressure_pa: float | None = None
    hours_ahead: float | None = None
    unknown: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = ("wind_speed_m_s", "wind_from_deg", "rain_mm_h", "pressure_pa")
        values = {name: getattr(self, name) for name in names}
        raise_faults(scalar_faults({"ambient_temperature_degc": self.temperature_degc, **values}))


def forecast_sd(weather: Sequence[Weather]) -> tuple[float, float]:
    """Return the mean standard deviations of forecast temperatures [K] and of the wind against the car, 10 m above the ground [m/s].

    Examples
    --------
    >>> forecast_sd([Weather(hours_ahead=-5.0), Weather(hours_ahead=48.0)])
    (1.4, 1.4)
    """
    days = float(np.mean([max(w.hours_ahead or 0.0, 0.0) for w in weather])) / 24.0
    return TEMPERATURE_SD_K[0] + TEMPERATURE_SD_K[1] * days, WIND_SD_M_S[0] + WIND_SD_M_S[1] * days


class WeatherSource(Protocol):
    """A source of weather by place and time."""

    def at(self, places: Sequence[Place], when: Sequence[dt.datetime]) -> tuple[Weather, ...]:
        """Return the weather at places, each at its time."""
        ...


@dataclass(frozen=True)
class WeatherServer:
    """A source of weather by a server with the interface of Open-Meteo.

    Attributes
    ----------
    client : WebClient
    """

    client: WebClient
    _cache: dict[_CellAndHour, tuple[float, Weather]] = field(default_factory=dict, repr=False)

    @classmethod
    def from_url(cls, url: str, where: str = "--weather") -> WeatherServer:
        """Make a source of weather from the URL of its server.

        Raises
        ------
        InvalidInput
            If the URL is not valid.
        """
        url = require_url(url, where)
        return cls(WebClient(url, "the weather server", "TRIPWATT_WEATHER_KEY", "query:apikey"))

    def at(self, places: Sequence[Place], when: Sequence[dt.datetime]) -> tuple[Weather, ...]:
        """See `WeatherSource.at`. Answers are kept for an hour.

        Raises
        ------
        RemoteError
            If the server does not answer, or its answer does not have these hours.
        """
        keys = [_cell_and_hour(place, hour) for place, hour in zip(places, when, strict=True)]
        now = time.monotonic()
        oldest = now - _CACHE_S
        missing = [key for key in dict.fromkeys(keys) if self._cache.get(key, (-math.inf,))[0] < oldest]
        if len(self._cache) + len(missing) > MAX_CACHED:
            self._cache.clear()
            missing = list(dict.fromkeys(keys))
        if missing:
            answers = zip(missing, self._request(missing), strict=True)
            self._cache.update({key: (now, weather) for key, weather in answers})
        return tuple(self._cache[key][1] for key in keys)

    def _request(self, keys: Sequence[_CellAndHour]) -> list[Weather]:
        """Request the weather of all cells from the first to the last hour; return that of each key."""
        first, last = min(key[2] for key in keys), max(key[2] for key in keys)
        query = {
            "latitude": ",".join(f"{key[0] * _CELL_DEG:.2f}" for key in keys),
            "longitude": ",".join(f"{key[1] * _CELL_DEG:.2f}" for key in keys),
            "hourly": ",".join(_UNITS),
            "wind_speed_unit": "ms",
            "timezone": "UTC",
            "start_hour": f"{first:%Y-%m-%dT%H:%M}",
            "end_hour": f"{last:%Y-%m-%dT%H:%M}",
        }
        answer = self.client.get_json("/v1/forecast", query)
        host = self.client.host
        with as_remote():
            if isinstance(answer, dict) and answer.get("error"):
                raise InvalidInput.of("no weather", host, str(answer.get("reason"))[:120])
            tables = answer if isinstance(answer, list) else [answer]
            if len(tables) != len(keys):
                raise InvalidInput.of("weather of other places", host, f"{len(tables)}", f"{len(keys)}")
            return [_weather_at(Node(table, host), key[2]) for table, key in zip(tables, keys, strict=True)]


def _cell_and_hour(place: Place, when: dt.datetime) -> _CellAndHour:
    """Return the cell of a place and the nearest hour of a time; a time without a zone is local time of this machine."""
    hour = (when.astimezone(dt.UTC) + dt.timedelta(minutes=30)).replace(minute=0, second=0, microsecond=0)
    return round(place.latitude_deg / _CELL_DEG), round(place.longitude_deg / _CELL_DEG), hour


def _weather_at(table: Node, hour: dt.datetime) -> Weather:
    """Return the weather of an hour from the table of one cell."""
    hourly, offset_s = table["hourly"], table["utc_offset_seconds"]
    local = hour + dt.timedelta(seconds=0.0 if offset_s.value is None else offset_s.number())
    time_text = f"{local:%Y-%m-%dT%H:%M}"
    times = [entry.value for entry in hourly["time"].entries(min_count=1)]
    if time_text not in times:
        allowed = f"{times[0]} to {times[-1]}"
        raise InvalidInput.of("no weather for this hour", table.where, time_text, allowed)
    k = times.index(time_text)
    temperature, rain, pressure, wind, wind_from = (_value(table, name, k) for name in _UNITS)
    wind = None if wind_from is None and wind else wind  # without a direction, it says nothing of the drag
    names = ("ambient_temperature_degc", "rain_mm_h", "pressure_pa", "wind_speed_m_s")
    values = zip(names, (temperature, rain, pressure, wind), strict=True)
    unknown = tuple(name for name, value in values if value is None)
    ahead = max((hour - dt.datetime.now(dt.UTC)).total_seconds() / SECONDS_PER_HOUR, 0.0)
    return Weather(
        temperature, wind or 0.0, (wind_from or 0.0) % 360.0, rain or 0.0, pressure, ahead, unknown
    )


def _value(table: Node, name: str, hour: int) -> float | None:
    """Return the value of a variable in our unit; None if the server has no value or another unit."""
    values, units = table["hourly"][name], table["hourly_units"].value
    unit = str(units.get(name)) if isinstance(units, dict) else next(iter(_UNITS[name]))
    if values.value is None or unit not in _UNITS[name]:
        return None
    entry = values.entries(min_count=hour + 1)[hour]
    factor, offset = _UNITS[name][unit]
    return None if entry.value is None else factor * entry.number() + offset


def weather_along(
    road: Road, source: WeatherSource, departs_at: dt.datetime
) -> tuple[FloatArray, tuple[Weather, ...]]:
    """Return positions along a road [m], and the weather at each position at the time when the car passes it.

    Parameters
    ----------
    road : Road
    source : WeatherSource
    departs_at : datetime
        Time of departure.

    Raises
    ------
    RemoteError
        As in `source.at`.
    """
    n_points = min(max(round(road.distance_m / POINT_EVERY_M), 1), MAX_POINTS)
    position = (np.arange(n_points) + 0.5) / n_points * road.distance_m
    passed_s = np.interp(position, running_sum(road.links.length_m), running_sum(road.links.travel_time_s))
    passed_s += road.links.paused_s(position)
    when = [departs_at + dt.timedelta(seconds=float(seconds)) for seconds in passed_s]
    return position, source.at([road.place_at(float(at)) for at in position], when)


def plan_with_weather(plan: Plan, road: Road, position_m: FloatArray, weather: Sequence[Weather]) -> Plan:
    """Return a plan with the weather along its road. O(samples).

    Wind is interpolated between the positions, as a vector. Temperature, pressure and rain are means over the positions, since a
    simulation uses one value of each; a value that is unknown at one position is unknown. The temperature is used only if
    the departure of the plan has none.

    Examples
    --------
    >>> plan_with_weather(plan, road, np.array([0.0]), (Weather(10.0, rain_mm_h=0.5),)).weather.rain_mm_h  # doctest: +SKIP
    0.5
    """
    distance = driven_m(plan, road.distance_m)
    angle = np.radians([w.wind_from_deg for w in weather])
    speed = np.array([w.wind_speed_m_s for w in weather])
    east = np.interp(distance, position_m, speed * np.sin(angle))
    north = np.interp(distance, position_m, speed * np.cos(angle))
    heading = np.radians(road.heading_at(distance))
    headwind = WIND_AT_CAR * (east * np.sin(heading) + north * np.cos(heading))
    pressure = _mean_if_known([w.pressure_pa for w in weather])
    ambient = plan.departure.ambient_temperature_degc
    if ambient is None:
        ambient = _mean_if_known([w.temperature_degc for w in weather])
    departure = replace(plan.departure, ambient_temperature_degc=ambient)
    density = air_density_at(replace(departure, pressure_pa=pressure))
    rain = float(np.mean([w.rain_mm_h for w in weather]))
    unknown = dict.fromkeys(name for w in weather for name in w.unknown)
    flags = (*plan.flags, *(Flag("weather_unknown", name) for name in unknown))
    return replace(plan, departure=departure, weather=PlanWeather(headwind, density, rain), flags=flags)


def _mean_if_known(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if len(known) == len(values) and known else None
