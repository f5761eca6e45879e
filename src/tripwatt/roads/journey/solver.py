"""Where to charge and how much: the least time over a road with stations, by dynamic programming over charge levels.

The car leaves a station with one of a number of displayed levels. A leg may be driven if the charge at its start is at least its need: the
charge that the leg takes, the reserve, and a margin for the error of the leg at the chance required of each leg. Stations are in the order
of the road, so one pass from the start settles every station and level: of all ways to leave a station with a level, the fastest
dominates the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray

STEP: Final = 0.01
LEVELS: Final = np.arange(round(1.0 / STEP) + 1) / round(1.0 / STEP)
"""Displayed charges with which a car may leave a station; a driver reads whole percents."""
LEVELS.flags.writeable = False

MIN_CHARGE_S: Final = 300.0
"""Shortest time of charging at a stop [s]: a choice, because nobody leaves the road for less."""

MIN_GAIN_SOC: Final = 0.05
"""Smallest displayed charge that is gained at a stop: a choice, far above the error of an estimated leg."""

_Z: Final = np.linspace(-6.0, 6.0, 241)
"""Values of the common error in standard deviations, over which it is integrated; a choice."""


@dataclass(frozen=True, eq=False)
class StopProblem:
    """A road with stations. Node 0 is the start, the last node the destination; nodes between are stations in driving order.

    Attributes
    ----------
    start_soc : float
        Displayed charge at the start.
    taken, need : ndarray, shape (nodes, nodes)
        Displayed charge that the leg from one node to a later one takes, and the smallest charge with which the leg may begin.
    time_s : ndarray, shape (nodes, nodes)
        Driving time of each leg [s]; infinite if there is no leg.
    charging_s : ndarray, shape (nodes, levels)
        Time to charge from empty to each of `levels` at each station [s].
    overhead_s : float
        Time of each stop besides charging [s].
    pause_s : ndarray, shape (nodes,)
        Pause of the journey at each station [s], which the legs have. The car is plugged in and charges meanwhile, and leaves no sooner.

    Examples
    --------
    >>> taken = np.array([[0.0, 0.5, 0.9], [0.0, 0.0, 0.4], [0.0, 0.0, 0.0]])
    >>> time = np.where(taken > 0.0, 1e4 * taken, np.inf)
    >>> problem = StopProblem(0.8, taken, taken + 0.1, time, np.tile(3600.0 * LEVELS, (3, 1)), 300.0, np.zeros(3))
    >>> plan = least_time(problem)
    >>> plan.nodes, plan.levels, round(plan.duration_s)
    ((0, 1, 2), (0.8, 0.5), 10020)
    >>> in_pause = least_time(replace(problem, pause_s=np.array([0.0, 1800.0, 0.0])))
    >>> in_pause.levels, round(in_pause.duration_s)
    ((0.8, 0.71), 9000)
    """

    start_soc: float
    taken: FloatArray
    need: FloatArray
    time_s: FloatArray
    charging_s: FloatArray
    overhead_s: float
    pause_s: FloatArray

    @property
    def least_s(self) -> FloatArray:
        """Shortest time of charging at each node [s]; plugging in is part of a pause."""
        return np.maximum(self.pause_s - self.overhead_s, MIN_CHARGE_S)

    @property
    def levels(self) -> FloatArray:
        """Displayed charges with which the car may leave a station, evenly from 0 to 1, one for each column of `charging_s`."""
        count = self.charging_s.shape[1]
        return np.asarray(np.arange(count) / (count - 1))

    def charge_s(self, node: int, arrival: float, leave: float) -> float:
        """Return the time to charge at a station from one charge to another [s], at least `MIN_CHARGE_S`."""
        to_arrival_s, to_leave_s = np.interp([arrival, leave], self.levels, self.charging_s[node])
        return float(max(to_leave_s - to_arrival_s, MIN_CHARGE_S))

    def level_after(self, node: int, arrival: float, leave: float) -> float:
        """Return the level to leave a station with: `leave`, or the level that `least_s` gives if it is higher."""
        to_arrival_s = np.interp(arrival, self.levels, self.charging_s[node])
        reached = np.interp(to_arrival_s + self.least_s[node], self.charging_s[node], self.levels)
        return max(leave, float(self.levels[np.searchsorted(self.levels, reached, side="right") - 1]))

    def duration_s(self, nodes: tuple[int, ...], levels: tuple[float, ...]) -> float:
        """Return the time of driving, charging and overheads of a plan [s], without checking the need of its legs."""
        total = sum(float(self.time_s[pair]) for pair in pairwise(nodes))
        for k in range(1, len(levels)):
            arrival = levels[k - 1] - float(self.taken[nodes[k - 1], nodes[k]])
            charge_s = self.charge_s(nodes[k], min(max(arrival, 0.0), 1.0), levels[k])
            total += max(charge_s + self.overhead_s - float(self.pause_s[nodes[k]]), 0.0)
        return total

    def among(self, nodes: IntArray) -> StopProblem:
        """Return the problem with only some nodes, ascending; the first becomes the start, the last the destination."""
        square = np.ix_(nodes, nodes)
        square_ones = {name: getattr(self, name)[square] for name in ("taken", "need", "time_s")}
        return replace(self, charging_s=self.charging_s[nodes], pause_s=self.pause_s[nodes], **square_ones)


@dataclass(frozen=True, slots=True)
class StopPlan:
    """Stations of a plan, and the charges to leave with.

    Attributes
    ----------
    nodes : tuple of int
        Nodes from the start to the destination.
    levels : tuple of float
        Displayed charge with which the car leaves each node but the last.
    duration_s : float
        Time of driving, charging and overheads [s].
    """

    nodes: tuple[int, ...]
    levels: tuple[float, ...]
    duration_s: float


def least_time(problem: StopProblem) -> StopPlan | None:
    """Find the plan that takes the least time; returns None if there is no possible plan. O(nodes² levels log(nodes levels)).

    Parameters
    ----------
    problem : StopProblem
        Nodes in driving order.

    Returns
    -------
    StopPlan or None
        The exact optimum for the levels of the problem. A stop gains at least `MIN_GAIN_SOC`. A car that reaches a level in less than
        `StopProblem.least_s` charges for that time.
    """
    levels = problem.levels
    n, count = problem.charging_s.shape
    cost = np.full((n, count), np.inf)
    cost[0, 0] = 0.0
    soc = np.tile(levels, (n, 1))
    soc[0] = problem.start_soc
    before = np.zeros((n, count), dtype=np.int64)
    top = max(problem.start_soc, 1.0)
    for node in range(1, n):
        origins = np.flatnonzero((problem.need[:node, node] <= top) & (problem.time_s[:node, node] < np.inf))
        reached = cost[origins] + problem.time_s[origins, node, None]
        reached[soc[origins] < problem.need[origins, node, None]] = np.inf
        ways = np.flatnonzero(np.isfinite(reached))
        if not len(ways):
            continue
        total, way = reached.ravel()[ways], count * origins[ways // count] + ways % count
        if node == n - 1:
            return _trace_plan(problem, before, int(way[np.argmin(total)]))
        arrival = np.clip((soc[origins] - problem.taken[origins, node, None]).ravel()[ways], 0.0, 1.0)
        at_node = problem.charging_s[node], float(problem.least_s[node])
        cost[node], chosen = _best_charging(arrival, total, levels, *at_node)
        cost[node] += problem.overhead_s - problem.pause_s[node]
        before[node] = way[chosen]
    return None


def _best_charging(
    arrival: FloatArray, total: FloatArray, levels: FloatArray, charging_s: FloatArray, least_s: float
) -> tuple[FloatArray, IntArray]:
    """Return the least time to leave a station with each level, and the index of the way that gives it.

    For each level, the candidates are the best way that charges for `least_s` or longer, and the best that reaches the level sooner.
    """
    order = np.argsort(arrival)
    arrival, total = arrival[order], total[order]
    to_arrival_s = np.interp(arrival, levels, charging_s)
    base = total - to_arrival_s
    below = np.searchsorted(arrival, levels - MIN_GAIN_SOC, side="right")
    long = np.minimum(np.searchsorted(to_arrival_s, charging_s - least_s, side="right"), below)
    low = _running_best(base)[np.maximum(long - 1, 0)]
    charged = np.where(long > 0, base[low] + charging_s, np.inf)
    # the least of a range is that of the least rank, which also gives its index
    by_total = np.argsort(total, kind="stable")
    rank = np.append(np.argsort(by_total), len(total))
    least = np.minimum.reduceat(rank, np.column_stack((long, below)).ravel())[::2]
    short = by_total[np.minimum(least, len(total) - 1)]
    waited = np.where(long < below, total[short] + least_s, np.inf)
    return np.minimum(charged, waited), order[np.where(charged <= waited, low, short)]


def _running_best(values: FloatArray) -> IntArray:
    """Return the index of the least value up to each place."""
    lowest = np.minimum.accumulate(values)
    return np.asarray(np.maximum.accumulate(np.where(values <= lowest, np.arange(len(values)), 0)))


def _trace_plan(problem: StopProblem, before: IntArray, way: int) -> StopPlan:
    """Follow the ways back to the start; a way is the number of a node and a level, and `before` has the way before each."""
    nodes, levels = [len(before) - 1], []
    while nodes[-1]:
        node, level = divmod(way, before.shape[1])
        nodes.append(node)
        levels.append(float(problem.levels[level]) if node else problem.start_soc)
        way = int(before[node, level])
    plan, charges = tuple(nodes[::-1]), levels[::-1]
    for k in range(1, len(charges)):
        arrival = charges[k - 1] - float(problem.taken[plan[k - 1], plan[k]])
        charges[k] = problem.level_after(plan[k], min(max(arrival, 0.0), 1.0), charges[k])
    return StopPlan(plan, tuple(charges), problem.duration_s(plan, tuple(charges)))


def joint_chance(chances: FloatArray, shared: FloatArray) -> float:
    """Return the chance that all legs succeed, if legs share an error: a normal copula with one factor.

    Given the common error, legs are independent; the mean over the common error is a sum over 241 values.

    Parameters
    ----------
    chances : ndarray, shape (legs,)
        Chance of each leg.
    shared : ndarray, shape (legs,)
        Share of the common error in the standard deviation of each leg, 0 to 1.

    Returns
    -------
    float
        Joint chance: at most the least of `chances`, at least their product.

    Examples
    --------
    >>> pair = np.array([0.9, 0.9])
    >>> round(joint_chance(pair, np.zeros(2)), 3), round(joint_chance(pair, np.ones(2)), 2)
    (0.81, 0.9)
    """
    from scipy.special import ndtr, ndtri

    if len(chances) == 1:
        return float(chances[0])
    common = np.clip(shared, 0.0, 0.999)[:, None]
    limit = ndtri(np.clip(chances, 1e-12, 1.0 - 1e-12))[:, None]
    given = ndtr((limit - common * _Z) / np.sqrt(1.0 - common**2)).prod(axis=0)
    weight = np.exp(-0.5 * _Z**2)
    return float(min(given @ weight / weight.sum(), chances.min()))
