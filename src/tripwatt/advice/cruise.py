"""Which speeds take least energy for a given time, which take least time with charging, and what minutes cost in between.

Time with charging is driving time plus energy over charging power, a weighted sum: one pass over links and speeds gives its least value
exactly. Least energy for a given time is a shortest path with a bound. The same sum with a price on time bounds it from below; labels of time
and energy search what the bound leaves open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from tripwatt.advice.cruise_problem import SAME, CruiseProblem
from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.errors import InvalidInput
from tripwatt.units import WH_PER_J

LABELS: Final = 20_000
"""Labels that are kept on a road, as many at each border, those with the lowest bounds: all of them on small roads."""

LATE_S: Final = 1e-3
"""More than what the energy adds to the least times to go, by which it decides between equal ones."""

FASTEST_W: Final = 1e12
"""Price of time at which only time counts."""


@dataclass(frozen=True, eq=False, slots=True)
class Cruise:
    """Speeds along a road.

    Attributes
    ----------
    problem : CruiseProblem
        The road with the car.
    levels : ndarray of int, shape (nodes,)
        Level of each node of the problem.
    lifted : ndarray of bool, shape (nodes - 1,)
        Whether the car rolls to the speed of the next node.
    duration_s, energy_wh : float
        Driving time with standstill, and energy at the battery terminals with climate control.
    price_w : float
        Energy that a second less is worth here [W]: charging power where a charge is to follow.
    limit_s : float
        Longest time that was allowed.
    least_wh : float
        No speeds take less energy, in the time that was allowed or at the price of time.

    Examples
    --------
    >>> from tripwatt.routes import plan_from_links, route_from_links
    >>> from tripwatt.vehicles import load_vehicle
    >>> links = route_from_links([{"length_m": 40_000.0, "speed_m_s": 33.0, "stop_s": 0.0}])
    >>> problem = CruiseProblem.from_plan(plan_from_links(links), load_vehicle("vw_id3"), links)
    >>> cruise = least_total_time(problem, 11e3)
    >>> cruise.speed_m_s.shape, round(3.6 * cruise.speed_m_s[20]), len(cruise.lift_at_m)
    ((40,), 90, 0)
    >>> cruise.total_s(11e3) < least_total_time(problem, 50e3).total_s(11e3)
    True
    """

    problem: CruiseProblem
    levels: IntArray
    lifted: BoolArray
    duration_s: float
    energy_wh: float
    price_w: float
    limit_s: float = np.inf
    least_wh: float = -np.inf

    @property
    def speed_m_s(self) -> FloatArray:
        """Speed on each link, shape (links,)."""
        speed = self.problem.speed_m_s[np.arange(len(self.levels)), self.levels]
        return speed[self.problem.road.length_m > 0.0]

    @property
    def lift_at_m(self) -> FloatArray:
        """Distances from the start at which the driver lifts the foot to roll to the next speed."""
        node = np.flatnonzero(self.lifted)
        ends = np.cumsum(self.problem.road.length_m)[node]
        return np.asarray(ends - self.problem.lift_m[node, self.levels[node], self.levels[node + 1]])

    def total_s(self, charging_w: float) -> float:
        """Driving time and that of charging what the drive takes.

        Parameters
        ----------
        charging_w : float
            Mean power into the battery [W].

        Returns
        -------
        float
            Time [s], without what a stop takes beside charging.
        """
        return self.duration_s + self.energy_wh / (charging_w * WH_PER_J)


def _to_go(problem: CruiseProblem, price_w: FloatArray) -> tuple[FloatArray, IntArray]:
    """Least cost from each level to the end, shape (nodes, prices, levels), and the steps that lead there. O(links x levels² x prices).

    The cost is (energy + rate time) / (1 + rate), rate the price with the power of climate control [Wh/s], so that no price is too high.
    """
    rate = (price_w + problem.climate_w) * WH_PER_J
    of_energy, of_time = (1.0 / (1.0 + rate))[:, None, None], (rate / (1.0 + rate))[:, None, None]
    steps = of_energy * problem.step_wh[:, None] + of_time * problem.step_s[:, None]
    nodes, levels = problem.speed_m_s.shape
    to_go = np.zeros((nodes, len(price_w), levels))
    both_ways = steps.reshape(*steps.shape[:3], 2, levels)
    for n in range(nodes - 2, -1, -1):
        both_ways[n] += to_go[n + 1][:, None, None, :]
        steps[n].min(axis=2, out=to_go[n])
    return to_go, steps.argmin(axis=3)


def _at_prices(problem: CruiseProblem, price_w: Sequence[float]) -> list[Cruise]:
    """The cruise with the least sum of energy and price times time, for each price."""
    prices = np.asarray(price_w, dtype=np.float64)
    _, choice = _to_go(problem, prices)
    rows, level = np.arange(len(prices)), np.zeros(len(prices), dtype=np.int64)
    way = np.zeros((len(prices), len(choice)), dtype=np.int64)
    for n in range(len(choice)):
        way[:, n] = choice[n, rows, level]
        level = way[:, n] % problem.speed_m_s.shape[1]
    return _along(problem, way, price_w)


def _along(problem: CruiseProblem, way: IntArray, price_w: Sequence[float]) -> list[Cruise]:
    """Cruises by the steps that each takes, shape (cruises, nodes - 1), as the best at its price."""
    count = problem.speed_m_s.shape[1]
    levels, lifted = np.insert(way % count, 0, 0, axis=1), way >= count
    time, energy = problem.totals(levels, lifted)
    if not np.isfinite(energy).all():
        allowed = "a car that can hold a speed above the floor on every link"
        raise InvalidInput.of("no speeds that the car can hold", "road", f"{len(levels[0])} nodes", allowed)
    rows = zip(levels, lifted, time.tolist(), energy.tolist(), price_w, strict=True)
    return [Cruise(problem, *row, least_wh=row[3]) for row in rows]


def least_total_time(problem: CruiseProblem, charging_w: float) -> Cruise:
    """The speeds with the least driving time plus time to charge what the drive takes: exact. O(links x levels²).

    Parameters
    ----------
    problem : CruiseProblem
        The road with the car.
    charging_w : float
        Power into the battery at the end of a charge [W], where energy that was saved need not be charged. The stop itself is made anyway.

    Returns
    -------
    Cruise
        The faster the station, the faster the drive.

    Raises
    ------
    InvalidInput
        When the power is not positive, or the car can hold no speed on some link.

    Examples
    --------
    >>> from tripwatt.routes import plan_from_links, route_from_links
    >>> from tripwatt.vehicles import load_vehicle
    >>> links = route_from_links([{"length_m": 40_000.0, "speed_m_s": 33.0, "stop_s": 0.0}])
    >>> problem = CruiseProblem.from_plan(plan_from_links(links), load_vehicle("vw_id3"), links)
    >>> [round(3.6 * least_total_time(problem, power).speed_m_s[20]) for power in (11e3, 22e3, 150e3)]
    [90, 105, 123]
    """
    if not charging_w > 0.0:
        raise InvalidInput.of(
            "charging power out of range", "charging_w", f"{charging_w:g} W", "more than 0 W"
        )
    return _at_prices(problem, [min(charging_w, FASTEST_W)])[0]


def least_energy(problem: CruiseProblem, time_s: float) -> Cruise:
    """The speeds that take least energy within a time. O(links x levels² x labels).

    The price of time at which the speeds are just fast enough bounds the energy from below. Labels of time and energy at each border
    search what this bound leaves open; where they are too many, those with the lowest bounds are kept. `Cruise.least_wh` is what is certain.

    Parameters
    ----------
    problem : CruiseProblem
        The road with the car.
    time_s : float
        Longest driving time with standstill [s].

    Returns
    -------
    Cruise
        It takes the whole time only where that saves energy.

    Raises
    ------
    InvalidInput
        When the highest speeds take longer.

    Notes
    -----
    Bound: Handler and Zang, Networks 10 (1980). Labels: Dumitrescu and Boland, Networks 42 (2003).

    Examples
    --------
    >>> from tripwatt.routes import plan_from_links, route_from_links
    >>> from tripwatt.vehicles import load_vehicle
    >>> links = route_from_links([{"length_m": 40_000.0, "speed_m_s": 33.0, "stop_s": 0.0}])
    >>> problem = CruiseProblem.from_plan(plan_from_links(links), load_vehicle("vw_id3"), links)
    >>> cruise = least_energy(problem, 1400.0)
    >>> round(cruise.duration_s), cruise.energy_wh / cruise.least_wh < 1.001
    (1400, True)
    """
    fast, slow = _at_prices(problem, [FASTEST_W, 0.0])
    allowed_s = time_s * (1.0 + SAME)
    if not fast.duration_s <= allowed_s:
        raise InvalidInput.of(
            "no speeds are fast enough", "time_s", f"{time_s:g} s", f"{fast.duration_s:.0f} s or more"
        )
    if slow.duration_s <= allowed_s:
        return replace(slow, limit_s=time_s)
    while True:
        price = _price_between(fast, slow)
        (middle,) = _at_prices(problem, [price])
        cost = middle.energy_wh + price * WH_PER_J * middle.duration_s
        if cost >= (fast.energy_wh + price * WH_PER_J * fast.duration_s) * (1.0 - SAME):
            break
        fast, slow = (middle, slow) if middle.duration_s <= allowed_s else (fast, middle)
    least = cost - price * WH_PER_J * time_s
    return _searched(replace(fast, price_w=price, limit_s=time_s, least_wh=min(least, fast.energy_wh)))


def _price_between(fast: Cruise, slow: Cruise) -> float:
    """Energy that a second less costs between two cruises [W]."""
    return (fast.energy_wh - slow.energy_wh) / (slow.duration_s - fast.duration_s) / WH_PER_J


def _searched(known: Cruise) -> Cruise:
    """The cruise with the least energy in its time, from one that is known and a price of time that bounds all others."""
    problem, limit = known.problem, known.limit_s * (1.0 + SAME)
    prices = np.array([known.price_w, FASTEST_W])
    rate = (prices + problem.climate_w) * WH_PER_J
    to_go = _to_go(problem, prices)[0] * (1.0 + rate[:, None])
    to_go[:, 1] /= rate[1]
    worth = rate[0] - problem.climate_w * WH_PER_J  # the energies of labels are those of `Cruise`
    nodes, count = problem.speed_m_s.shape
    level, time, energy = np.zeros(1, dtype=np.int64), np.zeros(1), np.full(1, problem.fixed_wh)
    way = np.zeros((1, nodes - 1), dtype=np.int64)
    dropped, most = known.energy_wh, LABELS // nodes + 1
    for n in range(nodes - 1):
        step_s, step_wh = problem.step_s[n][level], problem.step_wh[n][level]
        after_s = (time[:, None] + step_s).ravel()
        after_wh = (energy[:, None] + step_wh + problem.climate_w * WH_PER_J * step_s).ravel()
        there = np.tile(np.arange(count), 2 * len(level))
        bound = after_wh + to_go[n + 1, 0][there] + worth * (after_s - limit)
        in_time = after_s + to_go[n + 1, 1][there] <= limit + (LATE_S if n < nodes - 2 else 0.0)
        keep = np.flatnonzero((bound < known.energy_wh * (1.0 - SAME)) & in_time)
        keep = keep[_not_dominated(there[keep], after_s[keep], after_wh[keep])]
        if len(keep) > most:
            keep = keep[np.argpartition(bound[keep], most)]
            dropped, keep = min(dropped, float(bound[keep[most]])), keep[:most]
        level, time, energy, way = there[keep], after_s[keep], after_wh[keep], way[keep // (2 * count)]
        way[:, n] = keep % (2 * count)
    best = _along(problem, way[[energy.argmin()]], [known.price_w])[0] if len(keep) else known
    least = max(known.least_wh, min(best.energy_wh, dropped))
    return replace(best, limit_s=known.limit_s, least_wh=least)


def _not_dominated(level: IntArray, time_s: FloatArray, energy_wh: FloatArray) -> IntArray:
    """Places of the labels that take less energy than every label of their level that is not later. O(labels log labels)."""
    order = np.lexsort((time_s, level))
    if not len(order):
        return order
    # each level lies below the one before it, so that one running minimum serves all
    apart = energy_wh[order] - level[order] * (np.ptp(energy_wh) + 1.0)
    less = np.concatenate(([True], apart[1:] < np.minimum.accumulate(apart)[:-1]))
    return np.asarray(order[less])


@dataclass(frozen=True, eq=False, slots=True)
class Front:
    """What minutes cost: cruises of which none is both faster and cheaper than a mixture of two others.

    Attributes
    ----------
    cruises : tuple of Cruise
        The fastest first.

    Examples
    --------
    >>> from tripwatt.routes import plan_from_links, route_from_links
    >>> from tripwatt.vehicles import load_vehicle
    >>> links = route_from_links([{"length_m": 40_000.0, "speed_m_s": 33.0, "stop_s": 0.0}])
    >>> problem = CruiseProblem.from_plan(plan_from_links(links), load_vehicle("vw_id3"), links)
    >>> of_road = front(problem, 10)
    >>> fastest, knee = of_road.cruises[0], of_road.knee
    >>> round(knee.duration_s / fastest.duration_s, 2), round(knee.energy_wh / fastest.energy_wh, 2)
    (1.14, 0.83)
    """

    cruises: tuple[Cruise, ...]

    @property
    def duration_s(self) -> FloatArray:
        """Driving times [s], rising, shape (cruises,)."""
        return np.array([cruise.duration_s for cruise in self.cruises])

    @property
    def energy_wh(self) -> FloatArray:
        """Energies [Wh], falling, shape (cruises,)."""
        return np.array([cruise.energy_wh for cruise in self.cruises])

    @property
    def knee(self) -> Cruise:
        """The cruise that lies farthest from the line between the two ends: from here on, minutes bring less."""
        time, energy = self.duration_s, self.energy_wh
        line = np.interp(time, time[[0, -1]], energy[[0, -1]])
        return self.cruises[int((line - energy).argmax())]


def front(problem: CruiseProblem, points: int = 20) -> Front:
    """Find cruises on the convex front of time and energy, halving the gaps between neighbours. O(points x links x levels²).

    Parameters
    ----------
    problem : CruiseProblem
        The road with the car.
    points : int
        Number of cruises at most; there are fewer where the front has fewer corners.

    Returns
    -------
    Front
        From the fastest cruise to that of least energy, convex and falling.

    Raises
    ------
    InvalidInput
        As `least_total_time`.

    Notes
    -----
    The next price of time is that of the line between two neighbours: Aneja and Nair, Management Science 25 (1979).

    Examples
    --------
    >>> from tripwatt.routes import plan_from_links, route_from_links
    >>> from tripwatt.vehicles import load_vehicle
    >>> links = route_from_links([{"length_m": 40_000.0, "speed_m_s": 33.0, "stop_s": 0.0}])
    >>> problem = CruiseProblem.from_plan(plan_from_links(links), load_vehicle("vw_id3"), links)
    >>> len(front(problem, 10).cruises)
    10
    """
    cruises = _at_prices(problem, [FASTEST_W, 0.0])
    while len(cruises) < points:
        pairs = [pair for pair in pairwise(cruises) if pair[0].duration_s < pair[1].duration_s]
        between = _at_prices(problem, [_price_between(*pair) for pair in pairs]) if pairs else []
        found = {cruise.duration_s: cruise for cruise in (*between, *cruises)}
        if len(found) <= len(cruises):
            break
        cruises = [found[duration] for duration in sorted(found)]
    chosen = np.linspace(0, len(cruises) - 1, min(points, len(cruises))).round().astype(int)
    return Front(tuple(cruises[k] for k in chosen.tolist()))
