"""Plan journeys from A to B: roads, a forecast of each, and answers to the questions of a driver before leaving."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Check, InvalidInput, percent, require_type
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.difference import Difference
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.population import for_car
from tripwatt.roads.journey.atlas import Atlas, AtlasSettings, open_atlas
from tripwatt.roads.journey.charging import WARM_DEGC
from tripwatt.roads.journey.corridor import CERTAIN, LEG_FIELDS, STATION_KIND, Corridor, JourneyOptions
from tripwatt.roads.journey.forecasting import (
    RoadForecaster,
    cap_motorway_speed,
    is_motorway,
    with_expected_times,
)
from tripwatt.roads.journey.plans import BEST_EFFORT, fastest_plan, find_plans, helps
from tripwatt.roads.journey.stops import ENERGY_BAND, LINE_DIGITS, SAME_TIME_S, ChargingPlan, Leg, with_stops
from tripwatt.roads.journey.verdict import Advice, Verdict
from tripwatt.roads.routers import Road
from tripwatt.routes.link_objects import fields_of_route
from tripwatt.routes.places import Place
from tripwatt.trips import Departure, Flag, require_departure
from tripwatt.trips.messages import flag_to_dict, leave_in_words
from tripwatt.units import M_S_PER_KM_H
from tripwatt.vehicles import Vehicle

_MAX_STOPS: Final = 20
"""Most places of a request: a choice, since the work grows with them."""

_NEAR_ROAD_M: Final = 200.0
"""A place that is farther than this from its road is flagged: a choice, a short walk."""

_MOTORWAY_SPEEDS_KM_H: Final = (130.0, 120.0, 110.0, 100.0, 90.0, 80.0)
_CHEAPER_KM_H: Final = 100.0
"""The cost of speed is the energy taken by driving faster than this on motorways. A choice."""

_MIN_MOTORWAY_M: Final = 1000.0
"""Journeys with less motorway get no advice on speed: a choice, because it would change nothing."""


@dataclass(frozen=True, eq=False, slots=True)
class RoadForecast:
    """One road and its forecast.

    Attributes
    ----------
    road : Road
        Road from the router.
    forecast : Forecast
        Forecast of the energy on the road.
    labels : tuple of str
        Those of "fastest", "shortest" and "least energy" that apply, with the time and energy of stops. The fastest and that with the
        least energy are roads on which the car arrives as surely as on the first.
    charging : ChargingPlan or None
        The fastest plan with stops to charge on this road; None if the charge suffices, stops do not help, or none are planned.

    Examples
    --------
    >>> import tripwatt as tw
    >>> from tripwatt.roads.journey import RoadForecaster
    >>> from tripwatt.routes import route_from_links
    >>> from tripwatt.roads.routers import Road
    >>> links = route_from_links([{"length_m": 3000.0, "travel_time_s": 240.0}])
    >>> line = np.array([0.0, 3000.0])
    >>> road = Road(links, ("primary",), np.array([47.0, 47.027]), np.array([9.0, 9.0]), line)
    >>> expected = RoadForecast(road, RoadForecaster(tw.load_model("bmw_i3_tum"), tw.Departure(soc=0.8)).forecast(road))
    >>> expected.soc_at(0.0) > expected.soc_at(3000.0)
    True
    >>> sorted(expected.to_dict(reserve=0.1))[:4]
    ['charging', 'distance_m', 'duration_s', 'elevation']
    """

    road: Road
    forecast: Forecast
    labels: tuple[str, ...] = ()
    charging: ChargingPlan | None = None

    def soc_at(self, position_m: float) -> float:
        """Interpolate the expected displayed charge at a distance from the start.

        Parameters
        ----------
        position_m : float
            Distance from the start along the road [m].

        Returns
        -------
        float
            Displayed charge, 0 to 1.
        """
        along, share = self.forecast.along, position_m / self.road.distance_m
        return float(np.interp(share * along.distance_m[-1], along.distance_m, along.expected_soc))

    def whole(self, reserve: float) -> ChargingPlan:
        """Return the whole journey on this road: the plan with stops to charge if there is one, else a plan with one leg.

        Parameters
        ----------
        reserve : float
            Displayed state of charge to arrive with.

        Returns
        -------
        ChargingPlan
            Its time and energy are those to compare roads, cars and departures by.

        Examples
        --------
        >>> journey = tw.plan_journey(["Vaduz", "Malbun"], tw.Departure(soc=0.12), atlas="map")  # doctest: +SKIP
        >>> [len(road.whole(0.1).stops) for road in journey.roads]  # doctest: +SKIP
        [1]
        """
        legs = (Leg(self.road, self.forecast),)
        return self.charging or ChargingPlan(", ".join(self.labels), (), legs, reserve)

    def to_dict(self, reserve: float = 0.0) -> dict[str, Any]:
        """Convert the forecast to plain values: the line on the map, the kinds of road, the forecast.

        Parameters
        ----------
        reserve : float
            Displayed charge for which the probability to arrive is included.

        Returns
        -------
        dict
            Values in the units that the keys name.
        """
        road = self.road
        return {
            "labels": list(self.labels),
            "distance_m": road.distance_m,
            "duration_s": self.forecast.plan.elapsed_s,
            "whole": self.whole(reserve).in_short,
            "charging": self.charging and self.charging.to_dict(),
            "line": {name: np.round(getattr(road, name), k).tolist() for name, k in LINE_DIGITS.items()},
            **fields_of_route(with_expected_times(road, self.forecast.model).links),
            "road_class": list(road.road_class),
            "stops": [
                {"position_m": position, "displayed_soc": self.soc_at(position)}
                for position in road.stop_position_m
            ],
            "samples": self.forecast.plan.to_dict()["samples"],
            "forecast": self.forecast.to_dict(reserve),
        }


@dataclass(frozen=True, slots=True)
class SpeedAdvice:
    """Highest speed on motorways with which the journey arrives.

    Attributes
    ----------
    speed_m_s : float or None
        Highest speed; None if no speed suffices.
    duration_s : float or None
        Duration of the whole road at this speed.
    """

    speed_m_s: float | None
    duration_s: float | None


@dataclass(frozen=True, eq=False, repr=False)
class Journey:
    """The answer to "from A to B, do I arrive?".

    Attributes
    ----------
    stops : tuple of Place
        Places of the journey, as they were found.
    roads : tuple of RoadForecast
        Roads with their forecasts, the fastest with its stops first, or one of at most 5 min more with fewer stops. The answers are about
        this road.
    reserve : float
        Displayed state of charge to arrive with.
    soc_needed : float
        Displayed charge to leave with, to arrive without a stop and with the reserve in 19 of 20 trips: on the first road if it suffices
        there, else the least of all roads. A value above 1 means that a full battery does not suffice. The value is 0 if any charge suffices.
    costs_wh : dict
        Energy that the journey, with its stops, would save without `climate`, without `wind`, and without `speed` above 100 km/h on
        motorways.
    speed : SpeedAdvice or None
        Highest speed with which the journey arrives; None if it arrives as it is, or has no motorway.
    charging_alternatives : tuple of ChargingPlan
        Plans with the fewest stops, the safest and the cheapest by energy, as far as they differ.
    flags : tuple of Flag
        Assumptions of the answers; the flags of a road are in its forecast.
    attribution : str
        Text that has to be shown beside the road.
    corridor : Corridor or None
        The stations from which stops were or would be chosen; None if no stop is needed.
    soc_needed_with_stops : float or None
        If no plan with stops arrives, the displayed charge to leave with so that one does; None if one arrives, no stop is needed or there is
        no station. A value above 1 means that a full battery does not suffice.

    Examples
    --------
    >>> import tripwatt as tw
    >>> journey = tw.plan_journey(["Vaduz", "Malbun"], tw.Departure(soc=0.6), atlas="map")  # doctest: +SKIP
    >>> journey.forecast.soc_arrival  # doctest: +SKIP
    0.42
    """

    stops: tuple[Place, ...]
    roads: tuple[RoadForecast, ...]
    reserve: float
    soc_needed: float
    costs_wh: dict[str, float] = field(default_factory=dict)
    speed: SpeedAdvice | None = None
    charging_alternatives: tuple[ChargingPlan, ...] = ()
    flags: tuple[Flag, ...] = ()
    attribution: str = ""
    corridor: Corridor | None = None
    soc_needed_with_stops: float | None = None

    @property
    def forecast(self) -> Forecast:
        """Forecast of the fastest road."""
        return self.roads[0].forecast

    @property
    def verdict(self) -> Verdict:
        """Verdict on the whole journey, with its stops to charge if they are needed and help."""
        slower: Advice = "none" if self.speed is None or self.speed.speed_m_s is None else "slower"
        needed = min(self.soc_needed, self.soc_needed_with_stops or 2.0)
        advice_else: Advice = "charge_before" if needed <= 1.0 else slower
        return Verdict.from_plan(self.roads[0].whole(self.reserve), advice_else)

    @property
    def charging(self) -> ChargingPlan | None:
        """The fastest plan with stops to charge on the fastest road; None if the charge suffices, or stops do not help."""
        return self.roads[0].charging

    @property
    def arrives(self) -> bool:
        """Whether at least 19 of 20 such journeys have the reserve at every stop and at the end."""
        return self.verdict.arrives

    @property
    def leave(self) -> str:
        """The charge to leave with as a sentence, or why there is none."""
        return leave_in_words(self.soc_needed, self.reserve, CERTAIN)

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values, as in the answers of the command line and the service.

        Returns
        -------
        dict
            Numbers, texts, lists and further dicts only.

        Examples
        --------
        >>> import tripwatt as tw
        >>> journey = tw.plan_journey(["Vaduz", "Malbun"], tw.Departure(soc=0.6), atlas="map")  # doctest: +SKIP
        >>> journey.to_dict()["arrives"]  # doctest: +SKIP
        True
        """
        verdict = self.verdict
        return {
            "stops": [place.to_dict() for place in self.stops],
            "reserve": self.reserve,
            "verdict": verdict.to_dict(),
            "arrives": verdict.arrives,
            "p_arrive": verdict.p_reserve,
            "soc_needed": self.soc_needed,
            "soc_needed_with_stops": self.soc_needed_with_stops,
            "plugs": sorted(self.corridor.plugs) if self.corridor else [],
            "leave": self.leave,
            "costs_wh": dict(self.costs_wh),
            "motorway_speed_m_s": None if self.speed is None else self.speed.speed_m_s,
            "motorway_duration_s": None if self.speed is None else self.speed.duration_s,
            "needs_motorway_speed": self.speed is not None,
            "charging": self.charging and self.charging.to_dict(),
            "charging_alternatives": [plan.to_dict() for plan in self.charging_alternatives],
            "roads": [road.to_dict(self.reserve) for road in self.roads],
            "flags": [flag_to_dict(flag) for flag in self.flags],
            "attribution": self.attribution,
        }

    def to_frame(self) -> pd.DataFrame:
        """Return one row for each of `ways`.

        Returns
        -------
        DataFrame
            Length, time with charging, number of charges, energy [Wh] and charge at arrival (0 to 1) with their 90 % intervals, probability to
            have the reserve at every stop and at the end.

        Examples
        --------
        >>> import tripwatt as tw
        >>> journey = tw.plan_journey(["Vaduz", "Malbun"], tw.Departure(soc=0.6), atlas="map")  # doctest: +SKIP
        >>> journey.to_frame()  # doctest: +SKIP
        """
        return pd.DataFrame(
            {
                "labels": plan.label,
                "distance_m": plan.distance_m,
                "duration_s": plan.duration_s,
                "charges": len(plan.stops),
                "energy_wh": plan.energy_wh,
                **dict(zip(ENERGY_BAND, plan.energy_interval_wh, strict=True)),
                "soc_arrival": plan.soc_arrival,
                "soc_low": plan.soc_interval[0],
                "soc_high": plan.soc_interval[1],
                "p_arrive": plan.p_reserve,
            }
            for plan in self.ways
        )

    @property
    def charging_plans(self) -> tuple[ChargingPlan, ...]:
        """The fastest plan with stops to charge and its alternatives; empty if no stops are needed or none help."""
        return () if self.charging is None else (self.charging, *self.charging_alternatives)

    @property
    def ways(self) -> tuple[ChargingPlan, ...]:
        """Ways to make the journey: the plans on the fastest road, then each other road with its stops."""
        first, *others = (replace(r.whole(self.reserve), label=", ".join(r.labels)) for r in self.roads)
        return (*(self.charging_plans or (first,)), *others)

    def difference(self, other: Journey, road: int = 0) -> Difference:
        """Compare with another journey of the same car, with the time and energy of the stops to charge.

        Parameters
        ----------
        other : Journey
            The other journey, such as one with another departure.
        road : int
            Index of the road of each; the last road if there are fewer.

        Returns
        -------
        Difference
            This journey minus the other one. The errors are those of the roads without stops.

        Raises
        ------
        InvalidInput
            As in `Forecast.difference`.

        Examples
        --------
        >>> cold, mild = (tw.plan_journey(["Vaduz", "Malbun"], at, atlas="map") for at in departures)  # doctest: +SKIP
        >>> cold.difference(mild).duration_s  # doctest: +SKIP
        840.0
        """
        one, two = (journey.roads[min(road, len(journey.roads) - 1)] for journey in (self, other))
        difference = one.forecast.difference(two.forecast)
        return with_stops(difference, one.whole(self.reserve), two.whole(other.reserve))

    def __repr__(self) -> str:
        title, charges = " to ".join(place.title for place in self.stops), self.verdict.charges
        stops = "" if not charges else f"{charges} {'stop' if charges == 1 else 'stops'} to charge, "
        arrival = f"arrival with {percent(self.verdict.soc_arrival)}, 90 % interval {' to '.join(map(percent, self.verdict.soc_interval))}"
        return f"<Journey {title}: {self.roads[0].road.distance_m / 1000.0:.1f} km, {stops}{arrival}>"


def plan_journey(
    stops: Sequence[Place | str],
    departure: Departure | None = None,
    *,
    atlas: Atlas | AtlasSettings | Path | str | None = None,
    model: ForecastModel | Path | str | None = None,
    car: Vehicle | str | None = None,
    options: JourneyOptions | None = None,
) -> Journey:
    """Plan a journey: find roads, forecast each, and compute the charge to leave with, stops to charge and costs.

    Parameters
    ----------
    stops : sequence of Place or str
        Start, places on the way, destination; a text is a name or latitude and longitude. The car charges at a place on the way of the
        kind "charging_station", such as `Station.place`.
    departure : Departure, optional
        State of the car and time of departure.
    atlas : Atlas, AtlasSettings, path or str, optional
        Folder of a map, or URL of a router's server. By default, the environment variable `TRIPWATT_MAP`.
    model : ForecastModel or path, optional
        Model of the car. By default, the model that comes with the package.
    car : Vehicle or str, optional
        A car other than the model's own.
    options : JourneyOptions, optional
        Reserve at arrival, alternatives, and what is computed.

    Returns
    -------
    Journey
        Roads with their forecasts, and answers about the fastest road.

    Raises
    ------
    InvalidInput
        If a place is unknown, no road connects the places, the model cannot be used, or a charging station on the way has no plug of the
        car.
    RemoteError
        If a server that was named does not answer.

    Examples
    --------
    >>> import tripwatt as tw
    >>> journey = tw.plan_journey(["Vaduz", "Malbun"], tw.Departure(soc=0.6), atlas="map")  # doctest: +SKIP
    >>> journey.arrives, journey.soc_needed  # doctest: +SKIP
    (True, 0.34)
    """
    options = require_type("options", options or JourneyOptions(), JourneyOptions, "a JourneyOptions")
    atlas = atlas if isinstance(atlas, Atlas) else open_atlas(atlas)
    forecaster = RoadForecaster(for_car(model, car), require_departure(departure), atlas.weather)
    return journey_with(forecaster, find_stops(stops, atlas, round_trip=options.round_trip), atlas, options)


def find_stops(stops: Sequence[Place | str], atlas: Atlas, *, round_trip: bool = False) -> tuple[Place, ...]:
    """Find the places of a journey.

    Parameters
    ----------
    stops : sequence of Place or str
        Stops in order; a text is the name of a place, or latitude and longitude.
    atlas : Atlas
        Atlas with a search for places, if stops are names.
    round_trip : bool
        Whether the first place is also the last.

    Returns
    -------
    tuple of Place
        Places in the order of the journey.

    Raises
    ------
    InvalidInput
        If places are unknown, with all of them, or if there are too few or too many stops.

    Examples
    --------
    >>> from tripwatt.roads.journey import Atlas
    >>> from tripwatt.roads.routers import open_server
    >>> atlas = Atlas(open_server("osrm=http://127.0.0.1:5000"))
    >>> len(find_stops(["47.14, 9.52", "47.16, 9.50"], atlas, round_trip=True))
    3
    """
    if not 2 <= len(require_type("stops", stops, Sequence, "a list")) <= _MAX_STOPS:
        raise InvalidInput.of("number of places out of range", "stops", f"{len(stops)}", f"2 to {_MAX_STOPS}")
    with Check() as check:
        places = [check(atlas.find, stop, f"stops[{k}]") for k, stop in enumerate(stops)]
    return (*places, places[0]) if round_trip else tuple(places)


def journey_with(
    forecaster: RoadForecaster, stops: tuple[Place, ...], atlas: Atlas, options: JourneyOptions
) -> Journey:
    """Plan a journey as `plan_journey` does, with atlas and model already opened.

    Parameters
    ----------
    forecaster : RoadForecaster
        The car, its departure and the weather.
    stops : tuple of Place
        Places in the order of the journey, at least two.
    atlas : Atlas
        Atlas with a router.
    options : JourneyOptions
        Options of planning.

    Returns
    -------
    Journey
        Journey with a forecast for each road.

    Raises
    ------
    InvalidInput
        If there is no road; else as in `RoadForecaster.forecast`.

    Examples
    --------
    >>> journey_with(forecaster, find_stops(["Vaduz", "Malbun"], atlas), atlas, JourneyOptions())  # doctest: +SKIP
    """
    reserve, title = options.reserve, " to ".join(place.title for place in stops)[:100]
    forecaster = replace(forecaster, heights=atlas.heights_around(stops))
    found = atlas.router.roads(stops, alternatives=options.alternatives)
    if options.pause_s:
        found = tuple(road.with_pause(options.pause_s) for road in found)
    roads = [RoadForecast(road, forecaster.forecast(road, title)) for road in found]
    is_planned = options.answers and options.charge and bool(atlas.stations)
    is_chosen = any(place.kind == STATION_KIND for place in stops[1:-1])
    corridors = {
        k: Corridor(forecaster, road.road, road.forecast, atlas, options, stops[1:-1])
        for k, road in enumerate(roads)
        if is_planned and (is_chosen or road.whole(reserve).p_reserve < CERTAIN)
    }
    for k, corridor in corridors.items() if len(roads) > 1 else ():
        roads[k] = replace(roads[k], charging=fastest_plan(corridor))
    order = _order([road.whole(reserve) for road in roads], is_planned)
    chosen = corridors.get(order[0])
    plans = find_plans(chosen) if chosen else ()
    with_stops = plans[0].soc_needed if plans else None
    without = roads[order[0]].forecast.p_arrive(reserve)
    plans = tuple(plan for plan in plans if chosen and helps(plan, chosen))
    roads[order[0]] = replace(roads[order[0]], charging=next(iter(plans), None))
    forecasts = _label_roads([roads[k] for k in order], reserve)
    first = forecasts[0]
    alone = forecasts if without < CERTAIN else (first,)
    needed = min(soc_needed(road.forecast, reserve, CERTAIN) for road in alone)
    driven_back = (Flag("no_pause", "road"),) * (options.round_trip and not options.pause_s)
    noted = _far_from_road(stops, first.road) + driven_back
    journey = Journey(stops, forecasts, reserve, needed, flags=noted, attribution=atlas.attribution)
    if not options.answers:
        return journey
    speed = _speed_advice(forecaster, first, reserve)
    journey = replace(journey, speed=speed, charging_alternatives=plans[1:])
    if plans or (options.charge and without < CERTAIN):
        flags = (*noted, *_charging_flags(chosen, plans))
        journey = replace(journey, corridor=chosen, flags=flags, soc_needed_with_stops=with_stops)
    costs = [_leg_costs(leg, forecaster) for leg in first.whole(reserve).legs]
    return replace(journey, costs_wh={cause: sum(cost[cause] for cost in costs) for cause in costs[0]})


def _order(plans: Sequence[ChargingPlan], is_planned: bool) -> list[int]:
    """Return the order of roads by their plans: those that arrive first, then those with the higher chance, each from the fastest on.

    Of two roads that keep the reserve with the same chance, the one that is more likely to arrive at all has the higher chance.

    If the first has stops, of the roads that take at most `SAME_TIME_S` more, the one with the fewest stops comes first, then the one
    with the least energy.
    """
    wanted = CERTAIN * is_planned
    both = [(plan.p_reserve, plan.p_arrive) for plan in plans]
    chances = [[math.ceil(100.0 * max(wanted - p, 0.0)) for p in pair] for pair in both]
    order = sorted(range(len(plans)), key=lambda k: (chances[k], plans[k].duration_s, plans[k].energy_wh))
    latest_s = plans[order[0]].duration_s + SAME_TIME_S
    near = [k for k in order if chances[k] == chances[order[0]] and plans[k].duration_s <= latest_s]
    if plans[order[0]].stops:
        first = min(near, key=lambda k: (len(plans[k].stops), plans[k].energy_wh))
        order.sort(key=lambda k: k != first)
    return order


def _far_from_road(stops: Sequence[Place], road: Road) -> tuple[Flag, ...]:
    """Return a flag for each place that is farther than `_NEAR_ROAD_M` from its point of the road."""
    positions = 0.0, *road.stop_position_m, road.distance_m
    if len(positions) != len(stops):  # the router gave no positions of the places on the way
        return ()
    far = {p.title: p.distance_m(road.place_at(at)) for p, at in zip(stops, positions, strict=True)}
    return tuple(Flag("far_from_road", place, m, "m") for place, m in far.items() if m > _NEAR_ROAD_M)


def _charging_flags(corridor: Corridor | None, plans: tuple[ChargingPlan, ...]) -> tuple[Flag, ...]:
    """Return the assumptions of plans with stops, or why there are none; without a corridor there are no stations."""
    if corridor is None:
        return (Flag("no_stations", "charging"),)
    stations = [stop.station for stop in plans[0].stops] if plans else []
    plugs_known = {bool(corridor.plugs and station.plugs) for station in stations}
    is_cold = float(corridor.cell_degc.min()) < WARM_DEGC
    applies = {
        "no_stop_found": not plans or plans[0].label == BEST_EFFORT,
        "class_charging_curve": bool(plans) and corridor.curve.is_class,
        "plugs_assumed": True in plugs_known,
        "plugs_unknown": False in plugs_known,
        "station_power_assumed": not all(station.power_known for station in stations),
        "cold_charging_assumed": is_cold and any(station.direct_current for station in stations),
    }
    return tuple(Flag(code, "charging") for code, is_so in applies.items() if is_so)


def _label_roads(roads: list[RoadForecast], reserve: float) -> tuple[RoadForecast, ...]:
    """Label the first road as the fastest, as `_order` means it, the shortest, and of those as sure as the first the one with the least energy."""
    wholes = [road.whole(reserve) for road in roads]
    sure = [k for k, one in enumerate(wholes) if one.p_reserve >= max(0.5, min(CERTAIN, wholes[0].p_reserve))]
    index_by_label = {
        "fastest": 0,
        "shortest": int(np.argmin([whole.distance_m for whole in wholes])),
        "least energy": min(sure, key=lambda k: wholes[k].energy_wh, default=None),
    }
    return tuple(
        replace(road, labels=tuple(label for label, index in index_by_label.items() if index == k))
        for k, road in enumerate(roads)
    )


def _leg_costs(leg: Leg, forecaster: RoadForecaster) -> dict[str, float]:
    """Return the energy that climate control, wind and speed cost on one leg [Wh]."""
    forecast, plan = leg.forecast, leg.forecast.plan
    at_start = {name: getattr(plan.departure, name) for name in LEG_FIELDS}
    forecaster = replace(forecaster, departure=replace(forecaster.departure, **at_start))
    off = replace(plan, departure=replace(plan.departure, climate="off"))
    costs = dict.fromkeys(("climate", "wind", "speed"), 0.0)
    costs["climate"] = forecast.energy_wh - forecaster.forecast_plan(off).energy_wh
    if plan.air is not None and bool(plan.air.headwind_m_s.any()):
        calm = plan.with_weather(plan.air.calm())
        costs["wind"] = forecast.energy_wh - forecaster.forecast_plan(calm).energy_wh
    slower = cap_motorway_speed(leg.road, _CHEAPER_KM_H * M_S_PER_KM_H)
    if slower.duration_s > leg.road.duration_s:
        costs["speed"] = forecast.energy_wh - forecaster.forecast(slower).energy_wh
    return costs


def _speed_advice(forecaster: RoadForecaster, first: RoadForecast, reserve: float) -> SpeedAdvice | None:
    """Return the highest motorway speed that suffices; None if the road is certain enough as it is, or has hardly any motorway."""
    road, motorway_m = first.road, float(first.road.links.length_m[is_motorway(first.road)].sum())
    if first.forecast.p_arrive(reserve) >= CERTAIN or motorway_m < _MIN_MOTORWAY_M:
        return None
    for speed in _MOTORWAY_SPEEDS_KM_H:
        slower = cap_motorway_speed(road, speed * M_S_PER_KM_H)
        if slower.duration_s <= road.duration_s:
            continue
        forecast = forecaster.forecast(slower)
        if forecast.p_arrive(reserve) >= CERTAIN:
            return SpeedAdvice(speed * M_S_PER_KM_H, forecast.plan.elapsed_s)
    return SpeedAdvice(None, None)
