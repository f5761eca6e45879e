"""One stop to charge: which station, how long, and the probability of each leg."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.forecasting import Forecast
from tripwatt.journey.atlas import Atlas
from tripwatt.journey.charging import STOP_S, ChargingCurve
from tripwatt.journey.forecasting import RoadForecaster
from tripwatt.routes.maps import Station, near
from tripwatt.routes.places import Place
from tripwatt.routes.routers import Road

CERTAIN: Final = 0.95
DETOUR_M: Final = 3000.0
"""Stations farther from the road than this are not looked at."""

POINT_EVERY_M: Final = 500.0
MOST_CANDIDATES: Final = 6
"""Stations whose detour is routed."""

FULL_STOP: Final = 1.0
LEAST_ARRIVAL: Final = 0.02
"""Displayed charge to reach a station with."""


@dataclass(frozen=True, eq=False, slots=True)
class ChargingStop:
    """A journey with one stop to charge.

    Attributes
    ----------
    station : Station
        Where the car charges.
    soc_arrival : float
        Displayed charge that is expected at the station.
    soc_leave : float
        Displayed charge to leave the station with.
    charging_s : float
        Time at the station.
    duration_s : float
        Of the whole journey with the stop.
    p_station, p_arrive : float
        Probability to reach the station, and to reach the destination with the reserve after it.

    Examples
    --------
    >>> from tripwatt.routes.maps import Station
    >>> station = Station(47.0, 9.0, "A", 5e4, direct_current=True)
    >>> stop = ChargingStop(station, 0.2, 0.8, 1800.0, 9000.0, p_station=0.99, p_arrive=0.95)
    >>> sorted(stop.to_dict())
    ['charging_s', 'duration_s', 'p_arrive', 'p_station', 'soc_arrival', 'soc_leave', 'station']
    """

    station: Station
    soc_arrival: float
    soc_leave: float
    charging_s: float
    duration_s: float
    p_station: float
    p_arrive: float

    def to_dict(self) -> dict[str, Any]:
        """Convert the stop to plain values.

        Returns
        -------
        dict
            One key for each attribute; the station as a dict.
        """
        return {
            "station": self.station.to_dict(),
            "soc_arrival": self.soc_arrival,
            "soc_leave": self.soc_leave,
            "charging_s": self.charging_s,
            "duration_s": self.duration_s,
            "p_station": self.p_station,
            "p_arrive": self.p_arrive,
        }


def find_stop(
    forecaster: RoadForecaster,
    road: Road,
    forecast: Forecast,
    atlas: Atlas,
    curve: ChargingCurve,
    reserve: float,
) -> ChargingStop | None:
    """The stop with which the journey takes the least time; None where no station helps.

    Stations near the road that are reached with 95 % are compared by the time that they promise; the detours of the
    best are routed and forecast.
    """
    start, end = road.place_at(0.0), road.place_at(road.distance_m)
    best: ChargingStop | None = None
    for station in _candidates(road, forecast, atlas, curve, reserve):
        try:
            legs = (
                atlas.router.roads((start, station.place))[0],
                atlas.router.roads((station.place, end))[0],
            )
            stop = _with_stop(forecaster, legs, station, curve, reserve)
        except RemoteError:
            raise
        except InvalidInput:  # no road to this one
            continue
        if stop is not None and (best is None or stop.duration_s < best.duration_s):
            best = stop
    return best


def _candidates(
    road: Road, forecast: Forecast, atlas: Atlas, curve: ChargingCurve, reserve: float
) -> list[Station]:
    position = np.arange(0.0, road.distance_m + POINT_EVERY_M, POINT_EVERY_M)
    points: list[Place] = [road.place_at(float(at)) for at in position]
    series = forecast.series()
    scale = float(series["distance_m"].iloc[-1]) / road.distance_m
    surely = np.interp(position * scale, series["distance_m"], forecast.soc_along(CERTAIN))
    expected = np.interp(position * scale, series["distance_m"], forecast.soc_along(0.5))
    lacking = forecast.soc_needed(reserve, CERTAIN) - float(forecast.soc_along(0.5)[0])
    ranked = []
    for index, at in near(atlas.stations, points, DETOUR_M):
        if surely[at] < LEAST_ARRIVAL:
            continue
        station, arrival = atlas.stations[index], float(expected[at])
        leave = min(arrival + lacking, FULL_STOP)
        ranked.append((curve.seconds(arrival, leave, station, forecast.charge.wh_per_display), index))
    return [atlas.stations[index] for _, index in sorted(ranked)[:MOST_CANDIDATES]]


def _with_stop(
    forecaster: RoadForecaster,
    legs: tuple[Road, Road],
    station: Station,
    curve: ChargingCurve,
    reserve: float,
) -> ChargingStop | None:
    first = forecaster.forecast(legs[0], "to the station")
    p_station = first.p_arrive(LEAST_ARRIVAL)
    if p_station < CERTAIN:
        return None
    arrival = first.soc_arrival
    guess = forecaster.forecast(legs[1], "from the station", soc=FULL_STOP, bms_soc=None, follows_trip=True)
    leave = guess.soc_needed(reserve, CERTAIN)
    if leave > FULL_STOP:
        return None
    leave = max(leave, arrival)
    second = guess.leaving_with(leave)
    charging_s = curve.seconds(arrival, leave, station, first.charge.wh_per_display) + STOP_S
    driving_s = first.plan.duration_s + second.plan.duration_s
    p_arrive = second.p_arrive(reserve)
    if p_arrive < CERTAIN - 0.01:
        return None
    return ChargingStop(station, arrival, leave, charging_s, driving_s + charging_s, p_station, p_arrive)
