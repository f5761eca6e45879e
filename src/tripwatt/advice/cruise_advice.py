"""Speeds that a driver can follow: one on each kind of road, and where to lift the foot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.advice.cruise import Cruise
from tripwatt.advice.cruise_problem import SAME, STEP_KM_H, CruiseProblem
from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.journey.kinds import CITY_KM_H, COUNTRY_KM_H
from tripwatt.units import M_S_PER_KM_H, WH_PER_J

KINDS: Final = {"city": CITY_KM_H, "country": COUNTRY_KM_H, "motorway": np.inf}
"""Kinds of road, and the highest speed up to which a link is of them [km/h]."""

MOST_LIFTS: Final = 8
"""Places to lift that a driver is told."""

MOST_WH: Final = 1e9
"""Stands for the cost of a step that is not possible."""


@dataclass(frozen=True, eq=False, slots=True)
class CruiseAdvice:
    """What a driver can follow: one speed to keep on each kind of road, or its limit where that is lower, and where to lift.

    Attributes
    ----------
    speed_m_s : mapping of str to float
        Speed to keep on each of `KINDS` that the road has.
    cruise : Cruise
        What it gives.
    best : Cruise
        The cruise that it stands for.

    Examples
    --------
    >>> from tripwatt.advice import CruiseProblem, least_energy
    >>> from tripwatt.routes import plan_from_links, route_from_links
    >>> from tripwatt.vehicles import load_vehicle
    >>> links = route_from_links([{"length_m": 9000.0, "speed_m_s": v, "stop_s": 0.0} for v in (24.0, 33.0, 33.0)])
    >>> problem = CruiseProblem.from_plan(plan_from_links(links), load_vehicle("vw_id3"), links)
    >>> advice = followable(least_energy(problem, 1050.0))
    >>> {kind: round(3.6 * speed) for kind, speed in advice.speed_m_s.items()}
    {'country': 95, 'motorway': 100}
    >>> advice.cruise.duration_s < 1050.0, advice.lost_wh / advice.best.energy_wh < 0.03
    (True, True)
    """

    speed_m_s: Mapping[str, float]
    cruise: Cruise
    best: Cruise

    @property
    def lost_wh(self) -> float:
        """Energy more than at best [Wh]; negative where it takes longer."""
        return self.cruise.energy_wh - self.best.energy_wh

    @property
    def lost_s(self) -> float:
        """Time more than at best [s]; negative where it takes more energy."""
        return self.cruise.duration_s - self.best.duration_s


def followable(best: Cruise) -> CruiseAdvice:
    """One speed for each kind of road, the best of all choices in steps of `STEP_KM_H`, and up to `MOST_LIFTS` places to lift.

    Parameters
    ----------
    best : Cruise
        From `least_energy`, within whose time the advice stays, or from `least_total_time`, whose price of time it has.

    Returns
    -------
    CruiseAdvice
        With its loss.

    Examples
    --------
    >>> from tripwatt.advice import CruiseProblem, least_total_time
    >>> from tripwatt.routes import plan_from_links, route_from_links
    >>> from tripwatt.vehicles import load_vehicle
    >>> links = route_from_links([{"length_m": 40_000.0, "speed_m_s": 33.0, "stop_s": 0.0}])
    >>> problem = CruiseProblem.from_plan(plan_from_links(links), load_vehicle("vw_id3"), links)
    >>> {kind: round(3.6 * speed) for kind, speed in followable(least_total_time(problem, 11e3)).speed_m_s.items()}
    {'motorway': 90}
    """
    problem = best.problem
    speeds, levels = _one_for_each_kind(problem)
    lifted = _worth_lifting(problem, levels, best.price_w)
    lifted, levels = np.concatenate((lifted, np.zeros_like(lifted))), np.tile(levels, (2, 1))
    time, energy = problem.totals(levels, lifted)
    if np.isfinite(best.limit_s):
        cost = np.where(time <= best.limit_s * (1.0 + SAME), energy, np.inf)
    else:
        cost = energy + best.price_w * WH_PER_J * time
    row = int(cost.argmin())
    took_s, took_wh = float(time[row]), float(energy[row])
    cruise = replace(best, levels=levels[row], lifted=lifted[row], duration_s=took_s, energy_wh=took_wh)
    kept = {kind: float(column[row % len(column)]) for kind, column in speeds.items()}
    return CruiseAdvice(kept, cruise, best)


def _one_for_each_kind(problem: CruiseProblem) -> tuple[dict[str, FloatArray], IntArray]:
    """Every choice of one speed for each kind of road: the speeds by kind, shape (choices,), and levels, shape (choices, nodes)."""
    step = STEP_KM_H * M_S_PER_KM_H
    highest = problem.road.highest_m_s
    kind = np.searchsorted(np.array(list(KINDS.values())) * (M_S_PER_KM_H * (1.0 + SAME)), highest)
    tables = {}
    for number, name in enumerate(KINDS):
        mine = np.flatnonzero((highest > 0.0) & (kind == number))
        if not len(mine):
            continue
        own = problem.speed_m_s[mine]
        tried = own < own[:, :1]
        tried[:, 0] = True
        # above every floor, so that each link has this speed or its highest
        ends = np.ceil(np.array([np.where(tried, own, np.inf).min(axis=1).max(), own.max()]) / step - SAME)
        kept = np.arange(ends[0], ends[1] + 1) * step
        faster = (tried & (own > kept[:, None, None] * (1.0 + SAME))).sum(axis=2)
        tables[name] = mine, kept, np.minimum(faster, tried.sum(axis=1) - 1)
    choices = np.indices([len(kept) for _, kept, _ in tables.values()]).reshape(len(tables), -1)
    levels = np.zeros((choices.shape[1], len(problem.speed_m_s)), dtype=np.int64)
    for choice, (mine, _, table) in zip(choices, tables.values(), strict=True):
        levels[:, mine] = table[choice]
    return {name: kept[c] for c, (name, (_, kept, _)) in zip(choices, tables.items(), strict=True)}, levels


def _worth_lifting(problem: CruiseProblem, levels: IntArray, price_w: float) -> BoolArray:
    """Where lifting costs less than a ramp at a price of time, up to `MOST_LIFTS` in each row; shape (rows, nodes - 1)."""
    rate = (price_w + problem.climate_w) * WH_PER_J
    there = np.arange(levels.shape[1] - 1), levels[:, :-1]
    ramp, lift = (
        problem.step_wh[*there, step] + rate * problem.step_s[*there, step]
        for step in (levels[:, 1:], levels[:, 1:] + problem.speed_m_s.shape[1])
    )
    saved = np.where(np.isfinite(lift), np.minimum(ramp, MOST_WH) - np.minimum(lift, MOST_WH), 0.0)
    most = min(MOST_LIFTS, saved.shape[1])
    least = np.partition(saved, -most, axis=1)[:, [-most]]
    return (saved > SAME) & (saved >= least)
