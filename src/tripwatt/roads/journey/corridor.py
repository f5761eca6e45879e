"""The problem of stops at the stations beside a road: legs are estimated from its forecast; legs of plans are routed and forecast.

The optimum over estimated legs is computed; its legs are routed and replace their estimates, until the optimum has no estimated leg (lazy
evaluation of edges, as in Dellin and Srinivasa 2016). So the router is called only for the stations of plans.
"""

from __future__ import annotations

import datetime as dt
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from operator import itemgetter
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, or_none, raise_faults
from tripwatt.forecasting import Forecast
from tripwatt.roads.journey.atlas import Atlas
from tripwatt.roads.journey.charging import OVERHEAD_S, WARM_DEGC, ChargingCurve, plugs_of
from tripwatt.roads.journey.forecasting import RoadForecaster
from tripwatt.roads.journey.solver import LEVELS, StopPlan, StopProblem, least_time
from tripwatt.roads.journey.stops import SAME_TIME_S, START_M, Leg, variance_along
from tripwatt.roads.maps.stations import Station, near
from tripwatt.roads.routers import Road
from tripwatt.routes.places import Place
from tripwatt.trips.columns import Column, number_faults, scalar_faults
from tripwatt.units import SECONDS_PER_HOUR

CERTAIN: Final = 0.95
"""Chance to have the reserve at every stop and at the end: "19 of 20 journeys"."""
_DETOUR_M: Final = 3000.0
"""Stations farther from the road than this are not used: a choice, because there are nearer ones beside long roads."""
FARTHEST_M: Final = 20_000.0
"""The same if no station within `_DETOUR_M` helps, or the car leaves below the reserve: a choice, about the way of 8 % of a small battery."""
_WALK_M: Final = 500.0
"""Distance of a station from the place of a pause at which the car charges during the pause [m]: a choice, a short walk."""
_POINT_EVERY_M: Final = 500.0
"""Distance between the points of a road from which stations are searched [m]: a choice, small against `_DETOUR_M`."""
_MAX_STATIONS: Final = 200
"""A choice that bounds the time of the search."""
_DETOUR_FACTOR: Final = 1.3
"""Way to a station over its distance from the road, for estimated legs; a usual value of road networks."""
_DETOUR_M_S: Final = 12.0
"""Speed on the way to a station, for estimated legs: a choice, the mean speed on roads of towns and villages."""
_MAX_ROUNDS: Final = 12
"""Largest number of optima whose legs are routed; after these, only routed legs are used. A choice."""
_TOLERANCE: Final = 0.001
_TOLERANCES: Final = {"cheapest": 0.01}
"""A plan of routed legs is accepted if it costs at most the share `_TOLERANCE` more than the optimum with estimates; `_TOLERANCES` has the share of
some labels."""
_STOP_COSTS_S: Final = {"fastest": SAME_TIME_S, "best effort": SAME_TIME_S, "fewest stops": 2e4}
_CHARGE_COST_S: Final = 1e6
"""Costs [s] of a stop by the label of a plan, and of a full display, taken on the way or missing at the start; time counts little beside all but the
first. Choices."""
_NUDGE_DEG: Final = 3e-5
"""Latitude by which one of two equal places is moved for a router [°], 3 m."""
LEG_FIELDS: Final = ("soc", "bms_soc", "follows_trip", "battery_temperature_degc", "departs_at")
"""Fields of a departure that differ between legs."""
STATION_KIND: Final = "charging_station"
"""Kind of a place on the way at which the car has to charge: that of `Station.place`."""
_SAME_STATION_M: Final = 30.0
"""A place that is at most this far from a station is the station: a choice, about the length of a row of chargers."""
_OTHER_NETWORK_S: Final = 900.0
"""Additional time that is taken for a station of a preferred network [s]: a choice."""
_CHARGED_SOC: Final = np.array([0.1, 0.8])
"""Charging from the first to the second displayed charge decides whether heating the battery is worth its energy. A
choice: a usual stop."""


_MAX_ALTERNATIVES: Final = 3
_MAX_OVERHEAD_S: Final = 7200.0
_MAX_PAUSE_S: Final = 604_800.0
"""Bounds of the options: choices, since the work grows with the roads."""


@dataclass(frozen=True, slots=True)
class JourneyOptions:
    """Options of planning a journey.

    Attributes
    ----------
    reserve : float
        Displayed state of charge to arrive with.
    alternatives : int
        Number of other roads besides the fastest.
    round_trip : bool
        Whether the journey leads back to the start.
    pause_s : float
        Time of a round trip at its last place before the way back [s]; the car cools down meanwhile.
    answers : bool
        Whether costs, speed and charging are computed besides the forecasts.
    charging_curve : ChargingCurve or None
        Charging curve; if None, that of the car or of its class.
    charge : bool
        Whether stops to charge are planned if the charge does not suffice.
    stop_overhead_s : float
        Time for parking, plugging in and paying at each stop [s].
    preheat_battery : bool
        Whether the battery may be heated on the way to a stop.
    avoid : tuple of Place
        Stations at which the car does not charge, within 30 m.
    networks : tuple of str
        Networks that are preferred, by the beginnings of `Station.networks`, or of the name of a station without any. A stop at one of them
        may take a quarter of an hour more.

    Examples
    --------
    >>> JourneyOptions(reserve=0.15, alternatives=2).round_trip
    False
    """

    reserve: float = 0.1
    alternatives: int = 0
    round_trip: bool = False
    pause_s: float = 0.0
    answers: bool = True
    charging_curve: ChargingCurve | None = None
    charge: bool = True
    stop_overhead_s: float = OVERHEAD_S
    preheat_battery: bool = False
    avoid: tuple[Place, ...] = ()
    networks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        faults = list(scalar_faults({"reserve": self.reserve}))
        roads = Column("", 0, _MAX_ALTERNATIVES, "")
        faults += number_faults("alternatives", self.alternatives, roads, whole=True)
        faults += number_faults("pause_s", self.pause_s, Column("s", 0, _MAX_PAUSE_S, ""))
        faults += number_faults("stop_overhead_s", self.stop_overhead_s, Column("s", 0, _MAX_OVERHEAD_S, ""))
        fix = "add --round-trip (round_trip), or leave out the pause"
        if self.pause_s and not self.round_trip:
            faults.append(Fault("pause without a way back", "pause_s", f"{self.pause_s:g} s", fix=fix))
        raise_faults(faults)


@dataclass(frozen=True, eq=False)
class Corridor:
    """A road, its forecast and the stations beside the road.

    Attributes
    ----------
    forecaster : RoadForecaster
        Forecaster of the car.
    road : Road
        The road without a stop to charge.
    forecast : Forecast
        Forecast of this road.
    atlas : Atlas
        Atlas with a router and stations.
    options : JourneyOptions
        Reserve and rules of charging.
    via : tuple of Place
        Places on the way, which lie at `road.stop_position_m`. The car has to charge at those of the kind `STATION_KIND`.
    detour_m : float
        Farthest distance of a station from the road.
    """

    forecaster: RoadForecaster
    road: Road
    forecast: Forecast
    atlas: Atlas
    options: JourneyOptions
    via: tuple[Place, ...] = ()
    detour_m: float = _DETOUR_M
    routed: dict[tuple[int, int], Leg | None] = field(default_factory=dict, init=False)
    _leg_needs: dict[tuple[Leg, float, float], tuple[float, float]] = field(default_factory=dict, init=False)

    @cached_property
    def curve(self) -> ChargingCurve:
        """The charging curve of the options, else that of the car."""
        wh = self.forecast.charge.wh_per_display
        return self.options.charging_curve or ChargingCurve.from_vehicle(self.forecast.vehicle, wh)

    @cached_property
    def plugs(self) -> frozenset[str]:
        """Plugs of the car where it starts; empty if they are not known."""
        return plugs_of(self.forecast.vehicle.name, self.road.place_at(0.0))

    def other_network_s(self, station: Station) -> float:
        """Return the additional time that is taken for a station of a preferred network instead [s]; 0 if there is no preference."""
        known, networks = station.networks or (station.name,), self.options.networks
        is_preferred = any(k.casefold().startswith(n.casefold()) for k in known for n in networks)
        return _OTHER_NETWORK_S * (bool(networks) and not is_preferred)

    @cached_property
    def _stations_along(self) -> list[tuple[float, Station]]:
        """Stations with their position on the road, on the way out and on the way back; if too many, the two strongest of each stretch."""
        stations, pairs = self.atlas.stations, list[tuple[float, Station]]()
        is_low = bool(self.forecast.along.expected_soc[0] < self.options.reserve)
        for start, end in pairwise((0.0, *self.road.stop_position_m, self.road.distance_m)):
            position = np.append(np.arange(start, end, _POINT_EVERY_M), end)
            points = [self.road.place_at(float(at)) for at in position]
            for index, point in near(stations, points, FARTHEST_M if is_low else self.detour_m):
                usable = stations[index].usable_with(self.plugs, self.curve.most_w)
                at = float(position[point])
                if usable is None or any(_is_at(station, usable) for station in self.options.avoid):
                    continue
                is_away = max(at, points[0].distance_m(usable.place)) >= START_M
                # who is low charges at the next station
                if is_away or is_low or self._is_chosen(at, usable):
                    pairs.append((at, usable))
        if len(pairs) <= _MAX_STATIONS:
            return pairs
        stretch_m = 2.0 * self.road.distance_m / _MAX_STATIONS
        by_stretch: dict[int, list[tuple[float, Station]]] = {}
        for at, station in sorted(pairs, key=lambda pair: (not self._is_chosen(*pair), -pair[1].power_w)):
            by_stretch.setdefault(int(at / stretch_m), []).append((at, station))
        return sorted((pair for stretch in by_stretch.values() for pair in stretch[:2]), key=itemgetter(0))

    @property
    def _chosen(self) -> list[tuple[float, Place]]:
        """Stations that were chosen as places on the way, with their position on the road."""
        places = zip(self.road.stop_position_m, self.via, strict=False)
        return [(at, place) for at, place in places if place.kind == STATION_KIND]

    def _is_chosen(self, position_m: float, station: Station) -> bool:
        return any(abs(at - position_m) < 1.0 and _is_at(place, station) for at, place in self._chosen)

    @cached_property
    def _chosen_nodes(self) -> list[tuple[int, int]]:
        """The first and the last node of each chosen station, which is beside the road to it and beside the road from it.

        Raises
        ------
        InvalidInput
            If there is no station for the car at a chosen place.
        """
        along = list(enumerate(self._stations_along, 1))
        chosen = [
            (place.title, [k for k, (p, station) in along if abs(p - at) < 1.0 and _is_at(place, station)])
            for at, place in self._chosen
        ]
        what, allowed = "no charging station for this car", "a station with a plug of the car"
        raise_faults(Fault(what, title, "", allowed) for title, nodes in chosen if not nodes)
        return [(nodes[0], nodes[-1]) for _, nodes in chosen]

    def _with_choice(self, problem: StopProblem) -> StopProblem:
        """Return the problem without legs past a chosen station, and with the cost of stations of other networks in the time."""
        time = problem.time_s + np.array([0.0, *map(self.other_network_s, self.stations), 0.0])
        for first, last in self._chosen_nodes:
            time[:first, last + 1 :] = np.inf
        return replace(problem, time_s=time)

    @property
    def stations(self) -> list[Station]:
        """Stations in driving order; the station with index k is node k + 1."""
        return [station for _, station in self._stations_along]

    @cached_property
    def _position_m(self) -> FloatArray:
        return np.array([0.0, *(at for at, _ in self._stations_along), self.road.distance_m])

    @cached_property
    def _detour_m(self) -> FloatArray:
        """Estimated way from the road to each node [m]."""
        distances = [self.road.place_at(at).distance_m(station.place) for at, station in self._stations_along]
        return _DETOUR_FACTOR * np.array([0.0, *distances, 0.0])

    @cached_property
    def cell_degc(self) -> FloatArray:
        """Temperature of the battery's cells at each node on the way without stops [°C]."""
        run = self.forecast.drive.simulation
        time_s, driven_s = self._at_nodes(self.forecast.along.time_s), run.time_s - run.time_s[0]
        # a choice: cars cool hotter cells, or limit their power
        return np.minimum(np.interp(time_s, driven_s, run.battery_temperature_degc), 60.0)

    @cached_property
    def preheat_soc(self) -> FloatArray:
        """Displayed charge to heat the battery for each node; 0 if the rules forbid heating or it is not worth its energy."""
        wh = self.forecast.charge.wh_per_display
        lacking_k = np.maximum(WARM_DEGC - self.cell_degc, 0.0)
        soc = self.forecast.vehicle.battery.heat_capacity_j_k * lacking_k / SECONDS_PER_HOUR / wh
        for node, station in enumerate(self.stations, 1):
            cold, warm = (
                float(self.curve.seconds(_CHARGED_SOC, station, wh, degc)[-1])
                for degc in (self.cell_degc[node], WARM_DEGC)
            )
            recharging_s = warm * float(soc[node]) / float(np.ptp(_CHARGED_SOC))
            soc[node] *= station.direct_current and cold - warm > recharging_s
        soc[[0, -1]] = 0.0
        return soc if self.options.preheat_battery else np.zeros_like(soc)

    @cached_property
    def charging_s(self) -> FloatArray:
        """Time to charge from empty to each of `LEVELS` at each node [s]; 0 at the first and the last node, which have no station."""
        wh, table = self.forecast.charge.wh_per_display, np.zeros((len(self._position_m), len(LEVELS)))
        for node, station in enumerate(self.stations, 1):
            degc = WARM_DEGC if self.preheat_soc[node] > 0.0 else float(self.cell_degc[node])
            table[node] = self.curve.seconds(LEVELS, station, wh, degc)
        return table

    @cached_property
    def pause_s(self) -> FloatArray:
        """Time of the pause at each node [s]; of the stations beside its place, the strongest on the way there has it."""
        pause_s = np.zeros(len(self._position_m))
        for pause in self.road.links.pauses:
            beside = near(self.stations, [self.road.place_at(pause.position_m)], _WALK_M)
            before = [k for k, _ in beside if self._position_m[k + 1] <= pause.position_m + 1.0]
            if before and not pause.carried_m:
                pause_s[1 + max(before, key=lambda k: self.stations[k].power_w)] = pause.duration_s
        return pause_s

    def _at_nodes(self, values: FloatArray) -> FloatArray:
        """Interpolate values along the forecast at the nodes."""
        distance = self.forecast.along.distance_m
        return np.asarray(np.interp(self._position_m * distance[-1] / self.road.distance_m, distance, values))

    @cached_property
    def _estimates(self) -> tuple[FloatArray, FloatArray]:
        """Displayed charge that each leg takes, and its time [s], with the ways to and from stations; infinite if it leads back."""
        taken = -self._at_nodes(self.forecast.along.expected_soc)
        time = self._at_nodes(self.forecast.along.time_s)
        time += self.road.links.paused_s(self._position_m)
        detour_s = self._detour_m / _DETOUR_M_S
        whole_soc = self.forecast.energy_wh / self.forecast.charge.wh_per_display
        detour_soc = self._detour_m / self.road.distance_m * whole_soc
        leg = taken - taken[:, None] + detour_soc + detour_soc[:, None] + self.preheat_soc
        leg_s = time - time[:, None] + detour_s + detour_s[:, None]
        leg_s[np.tril_indices(len(leg_s))] = np.inf
        return leg, leg_s

    def problem(self, first_chance: float, chance: float) -> StopProblem:
        """Return the problem of stops in which the first leg has the reserve with `first_chance`, and every other leg with `chance`."""
        extra_soc, extra_s = self._standing_start_cost
        taken, time = self._estimates[0] + extra_soc, self._estimates[1] + extra_s
        need = taken + self.options.reserve + self.width(chance)
        need[0] = taken[0] + self.options.reserve + self.width(first_chance)[0]
        soc = float(self.forecast.along.expected_soc[0])
        # the reserve of a car that has less counts after the first stop
        exempt = self.options.reserve * (soc < self.options.reserve)
        need[0, :-1] -= exempt
        for (i, j), leg in self.routed.items():
            if leg is None:
                time[i, j] = np.inf
                continue
            reserve = self.options.reserve - exempt * (i == 0 and j < len(taken) - 1)
            taken[i, j], need[i, j] = self._leg_need(leg, chance if i else first_chance, reserve)
            time[i, j] = leg.forecast.plan.elapsed_s
        return StopProblem(
            soc, taken, need, time, self.charging_s, self.options.stop_overhead_s, self.pause_s
        )

    @property
    def _standing_start_cost(self) -> tuple[float, float]:
        """Mean additional charge and time [s] of routed legs, which start and end at rest, over their estimates; 0 if none is routed."""
        soc, time = self._estimates
        legs = [(pair, leg) for pair, leg in self.routed.items() if leg is not None]
        extra_soc = [self._leg_need(leg, 0.5, self.options.reserve)[0] - soc[pair] for pair, leg in legs]
        extra_s = [leg.forecast.plan.elapsed_s - time[pair] for pair, leg in legs]
        return (float(np.mean(extra_soc)), float(np.mean(extra_s))) if legs else (0.0, 0.0)

    def _leg_need(self, leg: Leg, chance: float, reserve: float) -> tuple[float, float]:
        """Return the displayed charge that a routed leg takes, and the charge that it needs at its start."""
        key = leg, chance, reserve
        if key not in self._leg_needs:
            low_soc = leg.forecast.along.soc(chance)
            spare = min(float(low_soc[-1]) - reserve - leg.preheat_soc, float(low_soc.min()))
            along = leg.forecast.along.expected_soc
            self._leg_needs[key] = float(along[0] - along[-1]) + leg.preheat_soc, float(along[0]) - spare
        return self._leg_needs[key]

    def width(self, chance: float) -> FloatArray:
        """Return the margin of displayed charge for the error of each leg, shape (nodes, nodes).

        Common errors add up over the legs; drifts and readings are independent.
        """
        factor, wh = self.factor(chance), self.forecast.charge.wh_per_display
        scale = (factor / wh) ** 2
        width2 = self._at_nodes(self.forecast.along.expected_soc - self.forecast.along.soc(chance)) ** 2
        common2, drift2 = (scale * self._at_nodes(part) for part in variance_along(self.forecast))
        drift2 = np.maximum.accumulate(np.maximum(width2 - common2, drift2))
        reading2 = scale * (self.forecast.charge.displayed_sd * wh) ** 2
        common = np.maximum.accumulate(np.sqrt(common2))
        leg_drift2 = np.maximum(drift2 - drift2[:, None], 0.0)
        return np.sqrt((common - common[:, None]) ** 2 + leg_drift2 + reading2)

    def factor(self, chance: float) -> float:
        """Return the number of standard deviations that an error stays below with a chance."""
        return self.forecast.uncertainty.scores.factor(2.0 * chance - 1.0)

    def detour(self, before: int, node: int) -> tuple[float, float]:
        """Return the displayed charge and time [s] of a detour from node `before` to an occupied station `node`."""
        taken, _ = self._estimates
        extra_soc = float(taken[before, node] + taken[node, -1] - taken[before, -1])
        return max(extra_soc, 0.0), 2.0 * float(self._detour_m[node]) / _DETOUR_M_S

    def optimum(self, chances: tuple[float, float], label: str) -> StopPlan | None:
        """Find the plan of routed legs that is best by a label; returns None if there is no such plan."""
        for k in range(_MAX_ROUNDS + 1):
            problem = self.problem(*chances)
            labelled = self._with_choice(_problem_for_label(problem, label))
            estimated, routed = least_time(labelled), self._routed_optimum(labelled)
            if estimated is None:
                return None
            cost_s = math.inf if routed is None else routed.duration_s
            max_s = (1.0 + _TOLERANCES.get(label, _TOLERANCE)) * estimated.duration_s
            if cost_s <= max_s or k == _MAX_ROUNDS:
                break
            self._route_legs(problem, estimated)
        return routed and replace(routed, duration_s=problem.duration_s(routed.nodes, routed.levels))

    def _routed_optimum(self, problem: StopProblem) -> StopPlan | None:
        """Find the optimum of routed legs alone."""
        pairs = np.array([pair for pair, leg in self.routed.items() if leg is not None], dtype=np.int64)
        nodes = np.union1d(pairs, [0, len(problem.taken) - 1])
        routed = np.full(problem.time_s.shape, np.inf)
        routed[tuple(pairs.reshape(-1, 2).T)] = 0.0
        plan = least_time(replace(problem, time_s=problem.time_s + routed).among(nodes))
        return plan and replace(plan, nodes=tuple(nodes[list(plan.nodes)].tolist()))

    def _route_legs(self, problem: StopProblem, plan: StopPlan) -> None:
        """Route and forecast the legs of a plan that are still estimated."""
        for k, (pair, level) in enumerate(zip(pairwise(plan.nodes), plan.levels, strict=True), start=1):
            if pair not in self.routed:
                elapsed_s = problem.duration_s(plan.nodes[:k], plan.levels[:k])
                self.routed[pair] = self._route_leg(*pair, level, elapsed_s)

    def _route_leg(self, i: int, j: int, level: float, elapsed_s: float) -> Leg | None:
        """Route and forecast a leg; all but the first begin with `level`, `elapsed_s` after departure. None if there is no road."""
        low, high = self._position_m[[i, j]]
        places = zip(self.via, self.road.stop_position_m, strict=False)
        # a place beside a station is driven to after charging; a place that is the station is not
        via = [p for p, at in places if low < at < high or (at == low and p.kind != STATION_KIND)]
        start, end = self._place(i), self._place(j)
        if start.distance_m(end) < 2.0:  # a car that stands at the station drives there, too
            end = replace(end, latitude_deg=end.latitude_deg - math.copysign(_NUDGE_DEG, end.latitude_deg))
        found = or_none(self.atlas.router.roads, (start, *via, end))
        if found is None:  # no road to this station
            return None
        road = found[0]
        for pause in self.road.links.pauses:
            if low <= pause.position_m < high and not pause.carried_m:
                road = road.with_pause(pause.duration_s)
        forecaster = self.forecaster
        if i:
            leaves = forecaster.departure.departs_at
            departure = replace(
                forecaster.departure,
                soc=level,
                bms_soc=None,
                follows_trip=True,
                battery_temperature_degc=float(self.cell_degc[i]),
                departs_at=leaves and leaves + dt.timedelta(seconds=elapsed_s),
            )
            forecaster = replace(forecaster, departure=departure)
        forecast = forecaster.forecast(road, f"leg from {self._place(i).title}"[:100])
        return Leg(road, forecast, float(self.preheat_soc[j]))

    def _place(self, node: int) -> Place:
        if 0 < node <= len(self.stations):
            return self.stations[node - 1].place
        return self.road.place_at(float(self._position_m[node]))

    def legs_of(self, plan: StopPlan) -> tuple[Leg, ...]:
        """Return the legs of a plan of routed legs, forecast from the charges at their start; these legs replace those in `routed`."""
        legs = []
        for pair, level in zip(pairwise(plan.nodes), plan.levels, strict=True):
            leg = self.routed[pair]
            assert leg is not None  # `optimum` has no other legs
            legs.append(leg.leaving_with(level) if pair[0] else leg)
            self.routed[pair] = legs[-1]
        return tuple(legs)


def _is_at(place: Place, station: Station) -> bool:
    return place.distance_m(station.place) <= _SAME_STATION_M


def _problem_for_label(problem: StopProblem, label: str) -> StopProblem:
    """Return the problem with the costs of a label added to the time; best effort may begin the first leg with less than its need."""
    problem = replace(problem, overhead_s=problem.overhead_s + _STOP_COSTS_S.get(label, 0.0))
    if label == "cheapest":
        return replace(problem, time_s=problem.time_s + _CHARGE_COST_S * np.maximum(problem.taken, 0.0))
    if label == "best effort":
        need, time = problem.need.copy(), problem.time_s.copy()
        time[0] += _CHARGE_COST_S * np.maximum(need[0] - problem.start_soc, 0.0)
        need[0] = np.minimum(need[0], problem.start_soc)
        return replace(problem, need=need, time_s=time)
    return problem
