"""Speeds that a driver can follow: one on each class of road, and where to lift the foot."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.advice.cruise import Cruise
from tripwatt.advice.cruise_problem import SAME, STEP_KM_H, CruiseProblem
from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.units import M_S_PER_KM_H, WH_PER_J

CLASSES_KM_H: Final = (60.0, 90.0, 110.0)
"""Highest speeds between the classes of road: town, road, fast road, motorway."""

MOST_LIFTS: Final = 8
"""Places to lift that a driver is told."""

MOST_WH: Final = 1e9
"""Stands for the cost of a step that is not possible."""


@dataclass(frozen=True, eq=False, slots=True)
class CruiseAdvice:
    """What a driver can follow: one speed to keep on each class of road, or the highest where that is lower, and where to lift.

    Attributes
    ----------
    kept_m_s : tuple of (float, float)
        For each class, the highest speed that is driven on any of its links, and the speed to keep.
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
    >>> [(round(3.6 * highest), round(3.6 * kept)) for highest, kept in advice.kept_m_s]
    [(90, 90), (123, 100)]
    >>> advice.cruise.duration_s < 1050.0, advice.lost_wh / advice.best.energy_wh < 0.03
    (True, True)
    """

    kept_m_s: tuple[tuple[float, float], ...]
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
    """One speed for each class of road, the best of all choices in steps of `STEP_KM_H`, and up to `MOST_LIFTS` places to lift.

    Parameters
    ----------
    best : Cruise
        From `least_energy`, within whose time the advice stays where a choice is that fast, or from `least_total_time`, whose price of time it has.

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
    >>> [(round(3.6 * highest), round(3.6 * kept)) for highest, kept in followable(least_total_time(problem, 11e3)).kept_m_s]
    [(123, 90)]
    """
    problem = best.problem
    highest, speeds, levels = _one_for_each_class(problem)
    lifted = _worth_lifting(problem, levels, best.price_w)
    lifted, levels = np.concatenate((lifted, np.zeros_like(lifted))), np.tile(levels, (2, 1))
    time, energy = problem.totals(levels, lifted)
    if np.isfinite(best.limit_s):
        cost = np.where(time <= best.limit_s * (1.0 + SAME), energy, MOST_WH + time)
    else:
        cost = energy + best.price_w * WH_PER_J * time
    row = int(cost.argmin())
    took_s, took_wh = float(time[row]), float(energy[row])
    cruise = replace(best, levels=levels[row], lifted=lifted[row], duration_s=took_s, energy_wh=took_wh)
    kept = speeds[row % len(speeds)].tolist()
    return CruiseAdvice(tuple(zip(highest.tolist(), kept, strict=True)), cruise, best)


def _one_for_each_class(problem: CruiseProblem) -> tuple[FloatArray, FloatArray, IntArray]:
    """Highest speed of each class, every choice of one speed for each, shape (choices, classes), and their levels, shape (choices, nodes)."""
    step = STEP_KM_H * M_S_PER_KM_H
    highest = problem.road.highest_m_s
    of_node = np.searchsorted(np.array(CLASSES_KM_H) * (M_S_PER_KM_H * (1.0 + SAME)), highest)
    members = [
        np.flatnonzero((highest > 0.0) & (of_node == one)) for one in np.unique(of_node[highest > 0.0])
    ]
    kept, tables = [], []
    for mine in members:
        own = problem.speed_m_s[mine]
        tried = own < own[:, :1]
        tried[:, 0] = True
        # above every floor, so that each link has this speed or its highest
        ends = np.ceil(np.array([np.where(tried, own, np.inf).min(axis=1).max(), own.max()]) / step - SAME)
        kept.append(np.arange(ends[0], ends[1] + 1) * step)
        faster = (tried & (own > kept[-1][:, None, None] * (1.0 + SAME))).sum(axis=2)
        tables.append(np.minimum(faster, tried.sum(axis=1) - 1))
    choices = np.indices([len(speeds) for speeds in kept]).reshape(len(kept), -1)
    levels = np.zeros((choices.shape[1], len(highest)), dtype=np.int64)
    for choice, mine, table in zip(choices, members, tables, strict=True):
        levels[:, mine] = table[choice]
    speeds = np.stack([each[choice] for each, choice in zip(kept, choices, strict=True)], axis=1)
    return np.array([highest[mine].max() for mine in members]), speeds, _with_room(problem, levels)


def _with_room(problem: CruiseProblem, levels: IntArray) -> IntArray:
    """The levels, slower where a ramp from or to a slower node has no room; shape (choices, nodes). O(links x (choices + levels²))."""
    count = problem.speed_m_s.shape[1]
    fits = np.isfinite(problem.step_wh[:, :, :count])
    tried: BoolArray = np.asarray(fits.any(axis=1))
    rises = np.asarray(problem.speed_m_s[1:, None, :] > problem.speed_m_s[:-1, :, None])
    before_tried = np.concatenate((np.eye(1, count, dtype=bool), tried[:-1]))
    after = _first_allowed((fits | ~rises) & tried[:, None, :], 2)
    before = _first_allowed((fits | rises) & before_tried[:, :, None], 1)
    for n in range(len(fits)):
        levels[:, n + 1] = after[n, levels[:, n], levels[:, n + 1]]
    for n in reversed(range(len(fits))):
        levels[:, n] = before[n, levels[:, n], levels[:, n + 1]]
    return levels


def _first_allowed(allowed: BoolArray, axis: int) -> IntArray:
    """For each place along an axis, the first allowed one from it on; the place itself where there is none."""
    place, none = np.indices(allowed.shape)[axis], allowed.shape[axis]
    from_end = np.flip(np.where(allowed, place, none), axis)
    first = np.flip(np.minimum.accumulate(from_end, axis=axis), axis)
    return np.asarray(np.where(first < none, first, place))


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
