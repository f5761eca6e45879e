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
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.forecasting import Forecast
from tripwatt.roads.journey.atlas import Atlas
from tripwatt.roads.journey.charging import WARM_DEGC, ChargingCurve
from tripwatt.roads.journey.forecasting import RoadForecaster
from tripwatt.roads.journey.solver import LEVELS, StopPlan, StopProblem, least_time
from tripwatt.roads.journey.stops import Leg, variance_along
from tripwatt.roads.maps import Station, near
from tripwatt.roads.routers import Road
from tripwatt.routes.places import Place
from tripwatt.units import SECONDS_PER_HOUR

CERTAIN: Final = 0.95
"""Chance to have the reserve at every stop and at the end: "19 of 20 journeys"."""
DETOUR_M: Final = 3000.0
"""Stations farther from the road than this are not used."""
POINT_EVERY_M: Final = 500.0
MAX_STATIONS: Final = 200
DETOUR_FACTOR: Final = 1.3
"""Way to a station over its distance from the road, for estimated legs; a usual value of road networks."""
DETOUR_M_S: Final = 12.0
MAX_ROUNDS: Final = 12
"""Largest number of optima whose legs are routed; after these, only routed legs are used."""
NEARLY: Final = 0.001
CLOSE: Final = {"cheapest": 0.01}
"""A plan of routed legs is accepted if it costs at most the share `NEARLY` more than the optimum with estimates; `CLOSE` has the share of
some labels."""
FEWEST_S: Final = 2e4
CHEAPEST_S: Final = 1e6
SHORT_S: Final = 1e8
"""Costs [s] of a stop, of the energy of a full display, and of a full display missing at the start; time counts little beside them."""
OF_LEG: Final = ("soc", "bms_soc", "follows_trip", "battery_temperature_degc", "departs_at")
"""Fields of a departure that differ between legs."""
SPAN: Final = np.array([0.1, 0.8])
"""Charging from the first to the second displayed charge decides whether heating the battery is worth its energy."""


@dataclass(frozen=True, slots=True)
class StopRules:
    """How a car charges on the way, and what it has to keep.

    Attributes
    ----------
    curve : ChargingCurve
    reserve : float
        Displayed charge to have at every stop and at the end.
    overhead_s : float
        Time of each stop besides charging [s].
    preheat : bool
        Whether the battery may be heated for a stop.
    plugs : frozenset of str
        Plugs of the car; empty if they are not known.
    """

    curve: ChargingCurve
    reserve: float
    overhead_s: float
    preheat: bool = False
    plugs: frozenset[str] = frozenset()


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
    rules : StopRules
        Reserve and rules of charging.
    via : tuple of Place
        Places on the way, which lie at `road.stop_position_m`.
    """

    forecaster: RoadForecaster
    road: Road
    forecast: Forecast
    atlas: Atlas
    rules: StopRules
    via: tuple[Place, ...] = ()
    routed: dict[tuple[int, int], Leg | None] = field(default_factory=dict)
    _widths: dict[float, FloatArray] = field(default_factory=dict)
    _legs: dict[tuple[Leg, float], tuple[float, float]] = field(default_factory=dict)

    def of(self, forecaster: RoadForecaster, road: Road, forecast: Forecast) -> Corridor:
        """Return a corridor with the same rules for another road or another forecast."""
        other = replace(self, forecaster=forecaster, road=road, forecast=forecast)
        return replace(other, routed={}, _widths={}, _legs={})

    @cached_property
    def _found(self) -> list[tuple[float, Station]]:
        """Stations with their position on the road, on the way out and on the way back; if too many, the strongest of each stretch."""
        stations, pairs = self.atlas.stations, list[tuple[float, Station]]()
        for start, end in pairwise((0.0, *self.road.stop_position_m, self.road.distance_m)):
            position = np.append(np.arange(start, end, POINT_EVERY_M), end)
            points = [self.road.place_at(float(at)) for at in position]
            for index, point in near(stations, points, DETOUR_M):
                usable = stations[index].usable_with(self.rules.plugs)
                if usable is not None:
                    pairs.append((float(position[point]), usable))
        if len(pairs) <= MAX_STATIONS:
            return pairs
        stretch_m = 2.0 * self.road.distance_m / MAX_STATIONS
        kept: dict[int, list[tuple[float, Station]]] = {}
        for at, station in sorted(pairs, key=lambda pair: -pair[1].power_w):
            kept.setdefault(int(at / stretch_m), []).append((at, station))
        return sorted((pair for some in kept.values() for pair in some[:2]), key=lambda pair: pair[0])

    @property
    def stations(self) -> list[Station]:
        """Stations in driving order; the station with index k is node k + 1."""
        return [station for _, station in self._found]

    @cached_property
    def _position_m(self) -> FloatArray:
        return np.array([0.0, *(at for at, _ in self._found), self.road.distance_m])

    @cached_property
    def _off_m(self) -> FloatArray:
        """Estimated way from the road to each node [m]."""
        off = [self.road.place_at(at).distance_m(station.place) for at, station in self._found]
        return DETOUR_FACTOR * np.array([0.0, *off, 0.0])

    @cached_property
    def cell_degc(self) -> FloatArray:
        """Temperature of the battery's cells at each node on the way without stops [°C]."""
        run = self.forecast.drive.simulation
        return np.interp(
            self._at(self._series["time_s"]), run.time_s - run.time_s[0], run.battery_temperature_degc
        )

    @cached_property
    def preheat_soc(self) -> FloatArray:
        """Displayed charge to heat the battery for each station; 0 if heating is not worth its energy."""
        wh = self.forecast.charge.wh_per_display
        lacking_k = np.maximum(WARM_DEGC - self.cell_degc, 0.0)
        soc = self.forecast.vehicle.battery.heat_capacity_j_k * lacking_k / SECONDS_PER_HOUR / wh
        for node, station in enumerate(self.stations, 1):
            cold, warm = (
                float(self.rules.curve.seconds(SPAN, station, wh, degc)[-1])
                for degc in (self.cell_degc[node], WARM_DEGC)
            )
            again = warm * float(soc[node]) / float(np.ptp(SPAN))
            soc[node] *= station.direct_current and cold - warm > again
        soc[[0, -1]] = 0.0
        return soc if self.rules.preheat else np.zeros_like(soc)

    @cached_property
    def charging_s(self) -> FloatArray:
        """Time to charge from empty to each of `LEVELS` at each node [s]."""
        wh, table = self.forecast.charge.wh_per_display, np.zeros((len(self._position_m), len(LEVELS)))
        for node, station in enumerate(self.stations, 1):
            degc = WARM_DEGC if self.preheat_soc[node] > 0.0 else float(self.cell_degc[node])
            table[node] = self.rules.curve.seconds(LEVELS, station, wh, degc)
        return table

    @cached_property
    def _series(self) -> dict[str, FloatArray]:
        return self.forecast.along.columns()

    def _at(self, values: FloatArray) -> FloatArray:
        """Interpolate values along the forecast at the nodes."""
        distance = self._series["distance_m"]
        at = self._position_m * distance[-1] / self.road.distance_m
        return np.asarray(np.interp(at, distance, values))

    @cached_property
    def _estimates(self) -> tuple[FloatArray, FloatArray]:
        """Displayed charge that each leg takes, and its driving time [s], with the ways to and from the stations."""
        taken, time = -self._at(self.forecast.along.expected_soc), self._at(self._series["time_s"])
        off_s = self._off_m / DETOUR_M_S
        off = (
            self._off_m * self.forecast.energy_wh / self.road.distance_m / self.forecast.charge.wh_per_display
        )
        leg = taken - taken[:, None] + off + off[:, None] + self.preheat_soc
        leg_s = time - time[:, None] + off_s + off_s[:, None]
        leg_s[np.tril_indices(len(leg_s))] = np.inf
        return leg, leg_s

    def problem(self, first: float, chance: float) -> StopProblem:
        """Return the problem of stops, in which legs arrive with the reserve with the chance `first` (leg from the start) or `chance`."""
        more, more_s = self._standing_starts
        taken, time = self._estimates[0] + more, self._estimates[1] + more_s
        need = taken + self.rules.reserve + self.width(chance)
        need[0] = taken[0] + self.rules.reserve + self.width(first)[0]
        for (i, j), leg in self.routed.items():
            if leg is None:
                time[i, j] = np.inf
                continue
            taken[i, j], need[i, j] = self._of_leg(leg, chance if i else first)
            time[i, j] = leg.forecast.plan.duration_s
        soc = float(self.forecast.along.expected_soc[0])
        return StopProblem(soc, taken, need, time, self.charging_s, self.rules.overhead_s)

    @property
    def _standing_starts(self) -> tuple[float, float]:
        """Mean additional charge and time [s] of routed legs compared with their estimates, since they start and end at rest."""
        of_legs = [
            (
                self._of_leg(leg, 0.5)[0] - self._estimates[0][pair],
                leg.forecast.plan.duration_s - self._estimates[1][pair],
            )
            for pair, leg in self.routed.items()
            if leg is not None
        ]
        more, more_s = np.mean(of_legs or [(0.0, 0.0)], axis=0).tolist()
        return more, more_s

    def _of_leg(self, leg: Leg, chance: float) -> tuple[float, float]:
        """Return the displayed charge that a routed leg takes, and the charge that it needs at its start."""
        if (leg, chance) not in self._legs:
            sure = leg.forecast.along.soc(chance)
            least = min(float(sure[-1]) - self.rules.reserve - leg.preheat_soc, float(sure.min()))
            along = leg.forecast.along.expected_soc
            self._legs[leg, chance] = float(along[0] - along[-1]) + leg.preheat_soc, float(along[0]) - least
        return self._legs[leg, chance]

    def width(self, chance: float) -> FloatArray:
        """Return the margin of displayed charge for the error of each leg: common parts in full, drifts and readings as independent."""
        if chance in self._widths:
            return self._widths[chance]
        factor, wh = self.factor(chance), self.forecast.charge.wh_per_display
        scale = (factor / wh) ** 2
        width2 = self._at(self.forecast.along.expected_soc - self.forecast.along.soc(chance)) ** 2
        common2, own2 = (scale * self._at(part) for part in variance_along(self.forecast))
        own2 = np.maximum.accumulate(np.maximum(width2 - common2, own2))
        reading = scale * (self.forecast.charge.displayed_sd * wh) ** 2
        common = np.maximum.accumulate(np.sqrt(common2))
        own = np.maximum(own2 - own2[:, None], 0.0)
        self._widths[chance] = np.sqrt((common - common[:, None]) ** 2 + own + reading)
        return self._widths[chance]

    def factor(self, chance: float) -> float:
        """Return the number of standard deviations that an error stays below with a chance."""
        return self.forecast.uncertainty.scores.factor(2.0 * chance - 1.0)

    def detour(self, before: int, node: int) -> tuple[float, float]:
        """Return the displayed charge and time [s] of a detour from node `before` to an occupied station `node`."""
        taken, _ = self._estimates
        more = float(taken[before, node] + taken[node, -1] - taken[before, -1])
        return max(more, 0.0), 2.0 * float(self._off_m[node]) / DETOUR_M_S

    def optimum(self, chances: tuple[float, float], label: str) -> StopPlan | None:
        """Find the plan of routed legs that is best by a label; returns None if there is no such plan."""
        for k in range(MAX_ROUNDS + 1):
            problem = self.problem(*chances)
            aim = _aimed(problem, label)
            found, known = least_time(aim), self._known(aim)
            if found is None:
                return None
            cost_s = math.inf if known is None else known.duration_s
            if cost_s <= (1.0 + CLOSE.get(label, NEARLY)) * found.duration_s or k == MAX_ROUNDS:
                break
            self._route(problem, found)
        return known and replace(known, duration_s=problem.duration_s(known.nodes, known.levels))

    def _known(self, problem: StopProblem) -> StopPlan | None:
        """Find the optimum of routed legs alone."""
        pairs = np.array([pair for pair, leg in self.routed.items() if leg is not None], dtype=np.int64)
        nodes = np.union1d(pairs, [0, len(problem.taken) - 1])
        routed = np.full(problem.time_s.shape, np.inf)
        routed[tuple(pairs.reshape(-1, 2).T)] = 0.0
        found = least_time(replace(problem, time_s=problem.time_s + routed).among(nodes))
        return found and replace(found, nodes=tuple(nodes[list(found.nodes)].tolist()))

    def _route(self, problem: StopProblem, plan: StopPlan) -> None:
        """Route and forecast the legs of a plan that are still estimated."""
        elapsed = 0.0
        for (i, j), level in zip(pairwise(plan.nodes), plan.levels, strict=True):
            if (i, j) not in self.routed:
                self.routed[i, j] = self._leg(i, j, level, elapsed)
            elapsed += float(problem.time_s[i, j]) + problem.overhead_s

    def _leg(self, i: int, j: int, level: float, elapsed_s: float) -> Leg | None:
        low, high = self._position_m[[i, j]]
        via = [p for p, at in zip(self.via, self.road.stop_position_m, strict=True) if low < at < high]
        try:
            road = self.atlas.router.roads((self._place(i), *via, self._place(j)))[0]
        except RemoteError:
            raise
        except InvalidInput:  # no road to this station
            return None
        forecaster = self.forecaster
        if i:
            leaves = forecaster.departs_at + dt.timedelta(seconds=elapsed_s)
            departure = replace(
                forecaster.departure,
                soc=level,
                bms_soc=None,
                follows_trip=True,
                battery_temperature_degc=float(self.cell_degc[i]),
                departs_at=leaves if forecaster.departure.departs_at else None,
            )
            forecaster = replace(forecaster, departure=departure)
        forecast = forecaster.forecast(road, f"leg from {self._place(i).title}"[:100])
        return Leg(road, forecast, float(self.preheat_soc[j]))

    def _place(self, node: int) -> Place:
        if 0 < node <= len(self.stations):
            return self.stations[node - 1].place
        return self.road.place_at(float(self._position_m[node]))

    def driven(self, found: StopPlan) -> tuple[Leg, ...]:
        """Return the legs of a plan of routed legs, forecast from the charges with which they begin."""
        legs = []
        for pair, level in zip(pairwise(found.nodes), found.levels, strict=True):
            leg = self.routed[pair]
            assert leg is not None  # `optimum` has no other legs
            legs.append(leg.leaving_with(level) if pair[0] else leg)
            self.routed[pair] = legs[-1]
        return tuple(legs)


def _aimed(problem: StopProblem, label: str) -> StopProblem:
    """Return the problem with the costs of a label added to the time."""
    if label == "fewest stops":
        return replace(problem, overhead_s=problem.overhead_s + FEWEST_S)
    if label == "cheapest":
        return replace(problem, time_s=problem.time_s + CHEAPEST_S * np.maximum(problem.taken, 0.0))
    if label == "best effort":
        need, time = problem.need.copy(), problem.time_s.copy()
        time[0] += SHORT_S * np.maximum(need[0] - problem.start_soc, 0.0)
        need[0] = np.minimum(need[0], problem.start_soc)
        return replace(problem, need=need, time_s=time)
    return problem
