"""Plans with stops to charge: the fastest plan with the required chance, and plans that are better in another respect.

All legs of a plan have to have the same chance to hold. The lowest such chance is searched with which the whole journey has the chance
`CERTAIN`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from tripwatt.roads.journey.corridor import CERTAIN, Corridor
from tripwatt.roads.journey.solver import STEP, StopPlan, StopProblem, least_time
from tripwatt.roads.journey.stops import ChargingPlan, ChargingStop, Leg, NextStation

RISKS: Final = (5e-4, 1.0 - CERTAIN)
"""Smallest and largest risk of a leg."""
CLOSE: Final = 0.005
"""The search ends if the chance of the whole journey is at most this much over `CERTAIN`."""
NARROW: Final = 1.1
MAX_TRIALS: Final = 8
"""The search for the risk of a leg ends if the risk is known to the factor `NARROW`, or after `MAX_TRIALS` trials."""
SAFEST: Final = ((0.9995, 0.9995), (0.998, 0.998), (0.99, 0.99), (CERTAIN, 0.9995))
"""Chances of the first leg and of every other leg of the safest plan; the first possible pair is used."""
SAFEST_TIME: Final = 1.25
"""Longest time of the safest plan over that of the fastest."""
IF_FULL: Final = (CERTAIN, 0.9, 0.8)
"""Chances to reach another station if a station is occupied, tried in this order."""
BEST_EFFORT: Final = "best effort"
EVEN: Final = 0.5

GAINS: Final[Mapping[str, Callable[[ChargingPlan], float]]] = MappingProxyType(
    {
        "fewest stops": lambda plan: -len(plan.stops),
        "safest": lambda plan: 100.0 * plan.p_reserve,
        "cheapest": lambda plan: -100.0 * math.log(plan.energy_wh),
    }
)
"""Quantity in which each alternative has to exceed the other plans by at least 1: stops, percentage points, percent."""


def find_plans(corridor: Corridor) -> tuple[ChargingPlan, ...]:
    """Find the fastest plan, and plans that are better in another respect: fewest stops, safest, cheapest by energy.

    If no plan has the required chance, the result is only the plan with the highest chance to reach a first station. It is empty if no
    station helps.
    """
    first, risk = _certain(corridor, "fastest", RISKS[1])
    if first is None:
        return _best_effort(corridor)
    fewest, _ = _certain(corridor, "fewest stops", risk)
    cheapest, _ = _certain(corridor, "cheapest", risk)
    found = (fewest, _safest(corridor, SAFEST_TIME * first.duration_s), cheapest)
    others = [plan for plan in found if plan is not None]
    # another plan may be faster than the first, because its legs were estimated as slower before they were routed
    plans = [replace(min((first, *others), key=lambda plan: plan.duration_s), label="fastest")]
    for plan in others:
        gain = GAINS[plan.label]
        if gain(plan) - max(map(gain, plans)) >= 1.0:
            plans.append(plan)
    return tuple(plans)


def fastest_plan(corridor: Corridor) -> ChargingPlan | None:
    """Find the fastest plan with stops, by the first search alone; returns None if no plan has the required chance."""
    return _certain(corridor, "fastest", RISKS[1])[0]


def _certain(corridor: Corridor, label: str, risk: float) -> tuple[ChargingPlan | None, float]:
    """Find the plan that is best by its label and has the whole chance `CERTAIN`, or None; return it and the risk of its legs.

    `risk` is the first guess of the risk of each leg. Only the first leg has a given charge. If this charge is too small for a higher
    chance than `CERTAIN` on the first leg, the search is repeated with this chance there, and the other legs make up for it.
    """
    for first in (0.0, RISKS[1]):
        (low, high), best = RISKS, None
        for _ in range(MAX_TRIALS):
            chances, whole = (1.0 - max(first, risk), 1.0 - risk), 1.0
            found = corridor.optimum(chances, label)
            if found is not None:
                plan = ChargingPlan(label, (), corridor.driven(found), corridor.rules.reserve)
                whole = plan.p_reserve
            if whole < CERTAIN:
                high = risk
            else:
                low, best = risk, best if found is None else (plan, found, chances)
            if low * NARROW >= high or CERTAIN <= whole <= CERTAIN + CLOSE:
                break
            # the risk of the whole journey is nearly proportional to that of a leg
            risk *= (1.0 - CERTAIN - 0.5 * CLOSE) / max(1.0 - whole, 1e-9)
            if not low < risk < high:
                risk = math.sqrt(low * high)
        if best is not None:
            return _with_stops(corridor, *_trimmed(corridor, *best)), low
    return None, RISKS[1]


def _trimmed(
    corridor: Corridor, plan: ChargingPlan, found: StopPlan, chances: tuple[float, float]
) -> tuple[ChargingPlan, StopPlan, tuple[float, float]]:
    """Lower the charge to leave each station with by one step, if that is faster and the whole chance still suffices."""
    problem = corridor.problem(*chances)
    for k in range(1, len(found.levels)):
        levels = (*found.levels[:k], found.levels[k] - STEP, *found.levels[k + 1 :])
        legs = (*plan.legs[:k], plan.legs[k].shifted(levels[k]), *plan.legs[k + 1 :])
        less = StopPlan(found.nodes, levels, problem.duration_s(found.nodes, levels))
        trimmed = replace(plan, legs=legs)
        if less.duration_s < found.duration_s and trimmed.p_reserve >= CERTAIN:
            plan, found = trimmed, less
    return plan, found, chances


def _safest(corridor: Corridor, max_s: float) -> ChargingPlan | None:
    for chances in SAFEST:
        found = corridor.optimum(chances, "safest")
        if found is not None and found.duration_s <= max_s:
            plan = ChargingPlan("safest", (), corridor.driven(found), corridor.rules.reserve)
            return _with_stops(corridor, plan, found, chances)
    return None


def _best_effort(corridor: Corridor) -> tuple[ChargingPlan, ...]:
    """Return the plan with the highest chance to reach its first station, in a tuple.

    Returns an empty tuple if the plan is not better than driving without a stop, or if the battery is more likely to run empty than not.
    """
    reserve, chances = corridor.rules.reserve, SAFEST[-2]
    found = corridor.optimum(chances, BEST_EFFORT)
    if found is None or len(found.nodes) < 3:
        return ()
    plan = ChargingPlan(BEST_EFFORT, (), corridor.driven(found), reserve)
    if plan.p_reserve <= corridor.forecast.p_arrive(reserve) or plan.p_arrive < EVEN:
        return ()
    return (_with_stops(corridor, plan, found, chances),)


def _with_stops(
    corridor: Corridor, plan: ChargingPlan, found: StopPlan, chances: tuple[float, float]
) -> ChargingPlan:
    return replace(plan, stops=tuple(_stops(corridor, plan.legs, found, corridor.problem(*chances))))


def _stops(
    corridor: Corridor, legs: tuple[Leg, ...], found: StopPlan, problem: StopProblem
) -> Iterator[ChargingStop]:
    elapsed = position = 0.0
    wh, overhead = corridor.forecast.charge.wh_per_display, corridor.rules.overhead_s
    for k, node in enumerate(found.nodes[1:-1]):
        leg, leave = legs[k], found.levels[k + 1]
        elapsed += leg.forecast.plan.duration_s
        position += leg.road.distance_m
        arrival = leg.soc_arrival
        charging_s = problem.charge_s(node, arrival, leave)
        yield ChargingStop(
            corridor.stations[node - 1],
            position,
            arrival,
            leave,
            leg.soc_interval,
            max(leave - arrival, 0.0) * wh,
            charging_s,
            overhead,
            elapsed,
            leg.chance(corridor.rules.reserve),
            bool(leg.preheat_soc > 0.0),
            _if_full(corridor, found, problem, k),
        )
        elapsed += charging_s + overhead


def _if_full(corridor: Corridor, found: StopPlan, problem: StopProblem, k: int) -> NextStation | None:
    """Find the station to go to if stop `k` is occupied, with the highest possible chance of `IF_FULL`; the reserve may be used.

    From there, the journey goes on with its planned stops, or with other stations in reach. Returns None if no other station helps.
    """
    here, level, node, end = found.nodes[k], found.levels[k], found.nodes[k + 1], found.nodes[-1]
    detour, detour_s = corridor.detour(here, node)
    reached = np.arange(node + 1, end)[problem.taken[here, node + 1 : end] + detour <= level]
    nodes = np.union1d([here, *found.nodes[k + 2 :]], reached)
    rest = replace(problem.among(nodes), start_soc=level)
    rest.taken[0] += detour
    rest.time_s[0] += detour_s
    for chance in IF_FULL:
        rest.need[0] = rest.taken[0] + corridor.width(chance)[here, nodes]
        again = least_time(rest)
        if again is not None:
            break
    if again is None or len(again.nodes) < 3:
        return None
    other = again.nodes[1]
    arrival = level - float(rest.taken[0, other])
    spare = arrival / max(float(rest.need[0, other] - rest.taken[0, other]), 1e-9) * corridor.factor(chance)
    original = problem.duration_s(found.nodes[k:], found.levels[k:])
    return NextStation(
        corridor.stations[nodes[other] - 1],
        arrival,
        corridor.forecast.uncertainty.scores.probability(spare),
        max(again.duration_s - original, 0.0),
    )
