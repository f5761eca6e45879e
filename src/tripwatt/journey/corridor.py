"""Stations beside a road as a problem of stops: legs are estimated from the forecast of the road, those of a plan are routed and forecast.

An optimum over estimates is looked for; its legs are routed and take the place of their estimates, until the optimum has no estimated leg (lazy
evaluation of edges, as in Dellin and Srinivasa 2016). So the router is asked about the stations of plans alone.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.forecasting import Forecast
from tripwatt.journey.atlas import Atlas
from tripwatt.journey.charging import WARM_DEGC, ChargingCurve
from tripwatt.journey.forecasting import RoadForecaster
from tripwatt.journey.solver import LEVELS, StopPlan, StopProblem, least_time
from tripwatt.journey.stops import ChargingPlan, ChargingStop, Leg, NextStation, variance_along
from tripwatt.routes.maps import Station, near
from tripwatt.routes.places import Place
from tripwatt.routes.routers import Road
from tripwatt.units import SECONDS_PER_HOUR

CERTAIN: Final = 0.95
"""Chance to have the reserve at every stop and at the end: "19 of 20 journeys"."""
CHANCES: Final = (0.95, 0.96, 0.97, 0.975, 0.98, 0.99, 0.995, 0.999)
SURELY: Final = tuple((chance, CHANCES[-1]) for chance in reversed(CHANCES))
RISING: Final = (*((chance, chance) for chance in CHANCES), *SURELY[1:])
"""Chances of the first leg and of every other that are tried until the chance of the whole journey is `CERTAIN`. The first leg alone has a given
charge: where that does not suffice for more, the others make up for it."""
IF_FULL: Final = (CERTAIN, 0.9, 0.8)
"""Chances to reach another station from an occupied one that are tried, one after the other."""
DETOUR_M: Final = 3000.0
"""Stations farther from the road than this are not looked at."""
POINT_EVERY_M: Final = 500.0
MOST_STATIONS: Final = 200
DETOUR_FACTOR: Final = 1.3
"""Way to a station over its distance from the road, until it is routed; a usual value of road networks."""
DETOUR_M_S: Final = 12.0
MOST_ROUNDS: Final = 12
"""Optima whose legs are routed; then only routed legs count."""
FEWEST_S: Final = 1e6
CHEAPEST_S: Final = 1e7
"""Costs of a stop, and of a full display, beside which the time counts little."""
OBJECTIVES: Final = {"fewest stops": (FEWEST_S, 0.0), "cheapest": (0.0, CHEAPEST_S)}
SAFEST_TIME: Final = 1.25
"""The safest plan takes at most this over the time of the fastest."""
SPAN: Final = np.array([0.1, 0.8])
"""Charge by which it is decided whether heating the battery is worth its energy."""


@dataclass(frozen=True, slots=True)
class StopRules:
    """How a car charges on the way, and what it has to keep.

    Attributes
    ----------
    curve : ChargingCurve
    reserve : float
        Displayed charge to have at every stop and at the end.
    overhead_s : float
        Of each stop [s].
    preheat : bool
        Whether the battery may be heated for a stop.
    """

    curve: ChargingCurve
    reserve: float
    overhead_s: float
    preheat: bool = False


@dataclass(frozen=True, eq=False)
class Corridor:
    """A road, its forecast and the stations beside it.

    Attributes
    ----------
    forecaster : RoadForecaster
        Of the car.
    road : Road
        Without a stop to charge.
    forecast : Forecast
        Of it.
    atlas : Atlas
        With a router and stations.
    rules : StopRules
        Reserve and charging.
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

    @cached_property
    def _found(self) -> list[tuple[float, Station]]:
        """Stations by their position on the road, on the way out and on the way back; of too many the strongest of each stretch."""
        stations, pairs = self.atlas.stations, list[tuple[float, Station]]()
        for start, end in pairwise((0.0, *self.road.stop_position_m, self.road.distance_m)):
            position = np.append(np.arange(start, end, POINT_EVERY_M), end)
            points = [self.road.place_at(float(at)) for at in position]
            pairs += [
                (float(position[at]), stations[index]) for index, at in near(stations, points, DETOUR_M)
            ]
        if len(pairs) <= MOST_STATIONS:
            return pairs
        stretch_m = 2.0 * self.road.distance_m / MOST_STATIONS
        kept: dict[int, list[tuple[float, Station]]] = {}
        for at, station in sorted(pairs, key=lambda pair: -pair[1].power_w):
            kept.setdefault(int(at / stretch_m), []).append((at, station))
        return sorted((pair for some in kept.values() for pair in some[:2]), key=lambda pair: pair[0])

    @property
    def stations(self) -> list[Station]:
        """In driving order; station k is node k + 1."""
        return [station for _, station in self._found]

    @cached_property
    def _position_m(self) -> FloatArray:
        return np.array([0.0, *(at for at, _ in self._found), self.road.distance_m])

    @cached_property
    def _off_m(self) -> FloatArray:
        """Way from the road to each node."""
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
        """Displayed charge to heat the battery for each station; 0 where it is not worth it."""
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
        return {str(name): values.to_numpy() for name, values in self.forecast.series().items()}

    def _at(self, values: FloatArray) -> FloatArray:
        """Values along the forecast at the nodes."""
        distance = self._series["distance_m"]
        at = self._position_m * distance[-1] / self.road.distance_m
        return np.asarray(np.interp(at, distance, values))

    @cached_property
    def _estimates(self) -> tuple[FloatArray, FloatArray]:
        """What each leg takes of the display, and its driving time [s], with the ways to and from the stations."""
        taken, time = -self._at(self.forecast.soc_along(0.5)), self._at(self._series["time_s"])
        off_s = self._off_m / DETOUR_M_S
        off = (
            self._off_m * self.forecast.energy_wh / self.road.distance_m / self.forecast.charge.wh_per_display
        )
        leg = taken - taken[:, None] + off + off[:, None] + self.preheat_soc
        leg_s = time - time[:, None] + off_s + off_s[:, None]
        leg_s[np.tril_indices(len(leg_s))] = np.inf
        return leg, leg_s

    def problem(self, first: float, chance: float, start: int = 0) -> StopProblem:
        """The problem in which the leg from a node and every other have a chance to be driven with the reserve at their ends."""
        taken, time = (values.copy() for values in self._estimates)
        need = taken + self.rules.reserve + self._width(chance)
        need[start] = taken[start] + self.rules.reserve + self._width(first)[start]
        for (i, j), leg in self.routed.items():
            if leg is None:
                time[i, j] = np.inf
                continue
            taken[i, j], need[i, j] = self._of_leg(leg, first if i == start else chance)
            time[i, j] = leg.forecast.plan.duration_s
        soc = float(self.forecast.soc_along(0.5)[0])
        return StopProblem(soc, taken, need, time, self.charging_s, self.rules.overhead_s)

    def _of_leg(self, leg: Leg, chance: float) -> tuple[float, float]:
        """What a routed leg takes of the display and what it needs."""
        if (leg, chance) not in self._legs:
            along, sure = leg.forecast.soc_along(0.5), leg.forecast.soc_along(chance)
            least = min(float(sure[-1]) - self.rules.reserve - leg.preheat_soc, float(sure.min()))
            taken = float(along[0] - along[-1]) + leg.preheat_soc
            self._legs[leg, chance] = taken, float(along[0]) - least
        return self._legs[leg, chance]

    def _width(self, chance: float) -> FloatArray:
        """What the error of each leg may take of the display: common parts in full, drifts and readings as independent ones."""
        if chance in self._widths:
            return self._widths[chance]
        factor, wh = self._factor(chance), self.forecast.charge.wh_per_display
        scale = (factor / wh) ** 2
        width2 = self._at(self.forecast.soc_along(0.5) - self.forecast.soc_along(chance)) ** 2
        common2, own2 = (scale * self._at(part) for part in variance_along(self.forecast))
        own2 = np.maximum.accumulate(np.maximum(width2 - common2, own2))
        reading = scale * (self.forecast.charge.displayed_sd * wh) ** 2
        common = np.maximum.accumulate(np.sqrt(common2))
        own = np.maximum(own2 - own2[:, None], 0.0)
        self._widths[chance] = np.sqrt((common - common[:, None]) ** 2 + own + reading)
        return self._widths[chance]

    def _factor(self, chance: float) -> float:
        return self.forecast.uncertainty.scores.factor(2.0 * chance - 1.0)

    def fastest(self, label: str = "fastest", most_s: float = np.inf) -> ChargingPlan | None:
        """The plan with the least of what a label names, whose whole chance is `CERTAIN` and that takes at most a time [s]; None where there is none."""
        for chances in SURELY if label == "safest" else RISING:
            found = self._optimum(chances, *OBJECTIVES.get(label, (0.0, 0.0)))
            if found is None or found.duration_s > most_s or self._rough(found).p_reserve < CERTAIN:
                continue
            plan = self._plan(found, chances, label)
            if plan.p_reserve >= CERTAIN:
                return plan
        return None

    def _rough(self, found: StopPlan) -> ChargingPlan:
        """A plan with the energies that its legs were forecast with, for its chance."""
        legs = [leg.shifted(level) if pair[0] else leg for pair, leg, level in self._driven(found)]
        return ChargingPlan("", (), tuple(legs), self.rules.reserve)

    def _driven(self, found: StopPlan) -> Iterator[tuple[tuple[int, int], Leg, float]]:
        for pair, level in zip(pairwise(found.nodes), found.levels, strict=True):
            leg = self.routed[pair]
            assert leg is not None  # `_optimum` has no other legs
            yield pair, leg, level

    def _optimum(self, chances: tuple[float, float], stop_s: float, display_s: float) -> StopPlan | None:
        for k in range(MOST_ROUNDS + 1):
            problem = self.problem(*chances)
            time = problem.time_s + display_s * np.maximum(problem.taken, 0.0)
            if k == MOST_ROUNDS:
                known = np.full(time.shape, np.inf)
                for (i, j), leg in self.routed.items():
                    known[i, j] = np.inf if leg is None else 0.0
                time = time + known
            found = least_time(replace(problem, time_s=time, overhead_s=problem.overhead_s + stop_s))
            if found is not None:
                found = replace(found, duration_s=problem.duration_s(found.nodes, found.levels))
            if found is None or all(pair in self.routed for pair in pairwise(found.nodes)):
                return found
            self._route(problem, found)
        return None

    def _route(self, problem: StopProblem, plan: StopPlan) -> None:
        """Route and forecast the legs of a plan that were estimated."""
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
        if i == 0:
            return Leg(road, self.forecaster.forecast(road, "leg 1"), float(self.preheat_soc[j]))
        leaves = self.forecaster.departs_at + dt.timedelta(seconds=elapsed_s)
        departure = replace(
            self.forecaster.departure,
            soc=level,
            bms_soc=None,
            follows_trip=True,
            battery_temperature_degc=float(self.cell_degc[i]),
            departs_at=leaves if self.forecaster.departure.departs_at else None,
        )
        return Leg(
            road, replace(self.forecaster, departure=departure).forecast(road), float(self.preheat_soc[j])
        )

    def _place(self, node: int) -> Place:
        if 0 < node <= len(self.stations):
            return self.stations[node - 1].place
        return self.road.place_at(float(self._position_m[node]))

    def _plan(self, found: StopPlan, chances: tuple[float, float], label: str) -> ChargingPlan:
        legs = [leg.leaving_with(level) if pair[0] else leg for pair, leg, level in self._driven(found)]
        self.routed.update(zip(pairwise(found.nodes), legs, strict=True))
        return ChargingPlan(label, tuple(self._stops(found, chances, legs)), tuple(legs), self.rules.reserve)

    def _stops(
        self, found: StopPlan, chances: tuple[float, float], legs: list[Leg]
    ) -> Iterator[ChargingStop]:
        elapsed = position = 0.0
        problem = self.problem(*chances)
        wh, overhead = self.forecast.charge.wh_per_display, self.rules.overhead_s
        for k, node in enumerate(found.nodes[1:-1]):
            leg, leave = legs[k], found.levels[k + 1]
            elapsed += leg.forecast.plan.duration_s
            position += leg.road.distance_m
            arrival = leg.soc_arrival
            charging_s = problem.charge_s(node, arrival, leave)
            yield ChargingStop(
                self.stations[node - 1],
                position,
                arrival,
                leave,
                leg.soc_interval,
                max(leave - arrival, 0.0) * wh,
                charging_s,
                overhead,
                elapsed,
                leg.chance(self.rules.reserve),
                bool(leg.preheat_soc > 0.0),
                self._if_full(found, chances, k),
            )
            elapsed += charging_s + overhead

    def _if_full(self, found: StopPlan, chances: tuple[float, float], k: int) -> NextStation | None:
        """The station that takes the place of an occupied one, with the highest of `IF_FULL` to reach it; the reserve may be used on the way."""
        here, level, node = found.nodes[k], found.levels[k], found.nodes[k + 1]
        detour_s = 2.0 * float(self._off_m[node]) / DETOUR_M_S
        taken, _ = self._estimates
        detour = float(taken[here, node] + taken[node, -1] - taken[here, -1])
        for chance in IF_FULL:
            problem = self.problem(chance, chances[1], here)
            rest = problem.after(here, level, node, detour_s, max(detour, 0.0))
            rest.need[0] -= self.rules.reserve
            again = least_time(rest)
            if again is not None:
                break
        if again is None or len(again.nodes) < 3:
            return None
        other = again.nodes[1]
        arrival = level - float(rest.taken[0, other])
        width = float(rest.need[0, other] - rest.taken[0, other])
        spare = arrival / max(width, 1e-9) * self._factor(chance)
        original = problem.duration_s(found.nodes[k:], found.levels[k:])
        index = here + other + (here + other >= node)
        p_reach = self.forecast.uncertainty.scores.probability(spare)
        return NextStation(self.stations[index - 1], arrival, p_reach, max(again.duration_s - original, 0.0))


def find_plans(corridor: Corridor) -> tuple[ChargingPlan, ...]:
    """The fastest plan, and those that are better in something: fewest stops, safest, cheapest by energy; empty where no stations help."""
    first = corridor.fastest()
    if first is None:
        return ()
    most_s = SAFEST_TIME * first.duration_s
    found = [corridor.fastest(label, most_s if label == "safest" else np.inf) for label in GAINS]
    others = [plan for plan in found if plan is not None]
    # legs that are routed for another aim may show a way that the estimates had hidden
    plans = [replace(min((first, *others), key=lambda plan: plan.duration_s), label="fastest")]
    for plan in others:
        better = GAINS[plan.label](plan) > GAINS[plan.label](plans[0])
        if better and _charges(plan) not in map(_charges, plans):
            plans.append(plan)
    return tuple(plans)


def _charges(plan: ChargingPlan) -> list[tuple[Station, float]]:
    return [(stop.station, stop.soc_leave) for stop in plan.stops]


GAINS: Final[Mapping[str, Callable[[ChargingPlan], float]]] = MappingProxyType(
    {
        "fewest stops": lambda plan: -len(plan.stops),
        "safest": lambda plan: plan.p_reserve,
        "cheapest": lambda plan: -plan.energy_wh,
    }
)
"""What each alternative has more of than the fastest plan."""
