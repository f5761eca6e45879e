"""Plans with stops to charge: the fastest plan with the required chance, and plans that are better in another respect.

All legs of a plan have to have the same chance to hold. The lowest such chance is searched with which the whole journey has the chance
`CERTAIN`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from tripwatt.forecasting.leaving import soc_needed
from tripwatt.roads.journey.corridor import CERTAIN, FARTHEST_M, Corridor
from tripwatt.roads.journey.solver import StopPlan, StopProblem, least_time
from tripwatt.roads.journey.stops import SAME_TIME_S, ChargingPlan, ChargingStop, NextStation

_LEG_RISKS: Final = (5e-4, 1.0 - CERTAIN)
"""Smallest and largest risk of a leg; the smallest is a choice, a failure in 2,000 legs."""
_CHANCE_TOLERANCE: Final = 0.005
"""The search ends if the chance of the whole journey is at most this much over `CERTAIN`: a choice, far below what a forecast
can tell."""
_RISK_FACTOR: Final = 1.1
_MAX_TRIALS: Final = 8
"""The search for the risk of a leg ends if the risk is known to the factor `_RISK_FACTOR`, or after `_MAX_TRIALS` trials. Choices
that bound the time."""
_SAFEST_CHANCES: Final = ((0.9995, 0.9995), (0.998, 0.998), (0.99, 0.99), (CERTAIN, 0.9995))
"""Chances of the first leg and of every other leg of the safest plan; the first possible pair is used. Choices."""
_NEXT_STATION_CHANCES: Final = (CERTAIN, 0.9, 0.8)
"""Chances to reach another station if a station is occupied, tried in this order. Choices."""
BEST_EFFORT: Final = "best effort"

_GAINS: Final[Mapping[str, Callable[[ChargingPlan], float]]] = MappingProxyType(
    {
        "fewest stops": lambda plan: -len(plan.stops),
        "safest": lambda plan: 100.0 * plan.p_reserve,
        "cheapest": lambda plan: -100.0 * math.log(plan.energy_wh),
    }
)
"""Quantity in which each alternative has to exceed the other plans by at least 1: stops, percentage points, percent."""


def find_plans(corridor: Corridor, *, alternatives: bool = True) -> tuple[ChargingPlan, ...]:
    """Find the fastest plan, and as `alternatives` plans that are better in another respect: fewest stops, safest, cheapest by energy.

    A stop less may take `SAME_TIME_S` more in the fastest plan, which so has the fewest stops of plans that are about as fast.

    If no plan has the required chance, the result is only that of `_best_effort`, or empty if no station is in reach of a full battery.
    """
    first, risk = _best_certain_plan(corridor, "fastest", _LEG_RISKS[1])
    if first is None and corridor.detour_m < FARTHEST_M:
        return find_plans(replace(corridor, detour_m=FARTHEST_M), alternatives=alternatives)
    if first is None or not alternatives:
        return tuple(filter(None, [first or _best_effort(corridor)]))
    fewest, _ = _best_certain_plan(corridor, "fewest stops", risk)
    cheapest, _ = _best_certain_plan(corridor, "cheapest", risk)
    # a choice: the safest plan takes at most a quarter longer than the fastest
    candidates = (fewest, _safest_plan(corridor, 1.25 * first.duration_s), cheapest)
    others = [plan for plan in candidates if plan is not None]
    # another plan may cost less than the first, because its legs were estimated as slower before they were routed
    plans = [replace(min((first, *others), key=lambda plan: _cost_s(corridor, plan)), label="fastest")]
    for plan in others:
        gain = _GAINS[plan.label]
        if gain(plan) - max(map(gain, plans)) >= 1.0:
            plans.append(plan)
    return tuple(plans)


def _cost_s(corridor: Corridor, plan: ChargingPlan) -> float:
    """Return the time of a plan with what each of its stops costs besides it, as in the search for the fastest plan [s]."""
    return plan.duration_s + sum(SAME_TIME_S + corridor.other_network_s(stop.station) for stop in plan.stops)


def fastest_plan(corridor: Corridor) -> ChargingPlan | None:
    """Find the fastest plan with stops by the first search alone, else the plan of best effort; returns None if no stop helps."""
    plans = find_plans(corridor, alternatives=False)
    return next((plan for plan in plans if helps(plan, corridor)), None)


def _best_certain_plan(corridor: Corridor, label: str, risk: float) -> tuple[ChargingPlan | None, float]:
    """Return the plan that is best by its label and has the whole chance `CERTAIN`, or None, and the risk of its legs.

    `risk` is the first guess of the risk of each leg. Only the first leg has a given charge. If this charge is too small for a higher
    chance than `CERTAIN` on the first leg, the search is repeated with this chance there, and the other legs make up for it.
    """
    for first_risk in (0.0, _LEG_RISKS[1]):
        (low, high), best = _LEG_RISKS, None
        for _ in range(_MAX_TRIALS):
            chances, p_whole = (1.0 - max(first_risk, risk), 1.0 - risk), 1.0
            optimum = corridor.optimum(chances, label)
            if optimum is not None:
                plan = ChargingPlan(label, (), corridor.legs_of(optimum), corridor.options.reserve)
                p_whole = plan.p_reserve
            if p_whole < CERTAIN:
                high = risk
            else:
                low, best = risk, best if optimum is None else (plan, optimum, chances)
            if low * _RISK_FACTOR >= high or CERTAIN <= p_whole <= CERTAIN + _CHANCE_TOLERANCE:
                break
            # the risk of the whole journey is nearly proportional to that of a leg
            risk *= (1.0 - CERTAIN - 0.5 * _CHANCE_TOLERANCE) / max(1.0 - p_whole, 1e-9)
            if not low < risk < high:
                risk = math.sqrt(low * high)
        if best is not None:
            return _with_stops(corridor, *best), low
    return None, _LEG_RISKS[1]


def _safest_plan(corridor: Corridor, max_s: float) -> ChargingPlan | None:
    for chances in _SAFEST_CHANCES:
        optimum = corridor.optimum(chances, "safest")
        if optimum is not None and optimum.duration_s <= max_s:
            plan = ChargingPlan("safest", (), corridor.legs_of(optimum), corridor.options.reserve)
            return _with_stops(corridor, plan, optimum, chances)
    return None


def _best_effort(corridor: Corridor) -> ChargingPlan | None:
    """Return the plan with the highest chance, with the charge that a plan with stops needs at the start; None without a stop."""
    reserve, tried = corridor.options.reserve, ((CERTAIN, CERTAIN), *_SAFEST_CHANCES[:-3:-1])
    plans = [
        _with_stops(corridor, ChargingPlan(BEST_EFFORT, (), corridor.legs_of(way), reserve), way, chances)
        for chances in tried  # the least first: it routes legs whose estimates are too high for the others
        if (way := corridor.optimum(chances, BEST_EFFORT)) is not None and len(way.nodes) > 2
    ]
    best = max(plans[::-1], key=_by_chance, default=None)
    if best is None or best.p_reserve >= CERTAIN:
        return best and replace(best, label="fastest")
    return replace(best, soc_needed=min(filter(None, map(_first_need, plans)), default=None))


def _by_chance(plan: ChargingPlan) -> tuple[bool, float, float]:
    return plan.p_reserve >= CERTAIN, round(plan.p_reserve, 2), round(plan.p_arrive, 2)


def _first_need(plan: ChargingPlan) -> float | None:
    """Return the charge with which the first leg makes up for the chances of the others; None if it cannot."""
    first, chance = plan.legs[0], CERTAIN / math.prod(plan.leg_chances[1:])
    if chance > 1.0 - _LEG_RISKS[0]:
        return None
    return soc_needed(first.forecast, min(plan.reserve + first.preheat_soc, 1.0), chance)


def helps(plan: ChargingPlan, corridor: Corridor) -> bool:
    """Return whether to drive a plan: if it is certain, or of best effort, better than the road without a stop, and arrives in 1 of 2 journeys.

    It is better if it is more likely to keep the reserve, or as likely and more likely to arrive at all. The bound is a choice: below it, most
    would strand.
    """
    kept, arrived = (corridor.forecast.p_arrive(reserve) for reserve in (plan.reserve, 0.0))
    is_better = (round(plan.p_reserve, 2), plan.p_arrive) > (round(kept, 2), arrived)
    return plan.label != BEST_EFFORT or (kept < CERTAIN and is_better and plan.p_arrive >= 0.5)


def _with_stops(
    corridor: Corridor, plan: ChargingPlan, optimum: StopPlan, chances: tuple[float, float]
) -> ChargingPlan:
    """Return a plan with its stops in driving order, each with the station to go to if it is occupied."""
    problem, stops = corridor.problem(*chances), []
    elapsed = position = 0.0
    wh, overhead = corridor.forecast.charge.wh_per_display, corridor.options.stop_overhead_s
    for k, node in enumerate(optimum.nodes[1:-1]):
        leg, leave = plan.legs[k], optimum.levels[k + 1]
        elapsed += leg.forecast.plan.elapsed_s
        position += leg.road.distance_m
        arrival = leg.soc_arrival
        made = ChargingStop(
            corridor.stations[node - 1],
            position,
            arrival,
            leave,
            leg.soc_interval,
            max(leave - arrival, 0.0) * wh,
            problem.charge_s(node, arrival, leave),
            overhead,
            elapsed,
            plan.leg_chances[k],
            min(float(problem.need[node, optimum.nodes[k + 2]]), 1.0),
            bool(leg.preheat_soc > 0.0),
            _next_station(corridor, optimum, problem, k),
            float(problem.pause_s[node]),
        )
        stops.append(made)
        elapsed += made.more_s
    return replace(plan, stops=tuple(stops))


def _next_station(corridor: Corridor, optimum: StopPlan, problem: StopProblem, k: int) -> NextStation | None:
    """Find the station to go to if stop `k` is occupied, with the highest possible chance of `_NEXT_STATION_CHANCES`; the reserve may be used.

    From there, the journey goes on with its planned stops, or with other stations in reach. Returns None if no other station helps.
    """
    start, level, node, end = optimum.nodes[k], optimum.levels[k], optimum.nodes[k + 1], optimum.nodes[-1]
    detour, detour_s = corridor.detour(start, node)
    occupied, others = corridor.stations[node - 1], np.arange(node + 1, end)
    # a station beside a place on the way is two nodes, beside the road to it and the road from it
    is_other = np.array([corridor.stations[other - 1] != occupied for other in others], dtype=bool)
    reached = others[(problem.taken[start, others] + detour <= level) & is_other]
    nodes = np.union1d([start, *optimum.nodes[k + 2 :]], reached)
    remaining = replace(problem.among(nodes), start_soc=level)
    remaining.taken[0] += detour
    remaining.time_s[0] += detour_s
    for chance in _NEXT_STATION_CHANCES:
        remaining.need[0] = remaining.taken[0] + corridor.width(chance)[start, nodes]
        detour_plan = least_time(remaining)
        if detour_plan is not None:
            break
    if detour_plan is None or len(detour_plan.nodes) < 3:
        return None
    next_node = detour_plan.nodes[1]
    arrival = level - float(remaining.taken[0, next_node])
    width = max(float(remaining.need[0, next_node] - remaining.taken[0, next_node]), 1e-9)
    spare = arrival / width * corridor.factor(chance)
    planned_s = problem.duration_s(optimum.nodes[k:], optimum.levels[k:])
    return NextStation(
        corridor.stations[nodes[next_node] - 1],
        arrival,
        corridor.forecast.uncertainty.scores.probability(spare),
        max(detour_plan.duration_s - planned_s, 0.0),
    )
