"""Expected travel times from those of an empty road: how much longer drives take, by the free speed of a link.

A router without traffic gives the time on an empty road. If a log has the speed limit of the road, the free speed is the limit.
For other logs it is the speed class of the link: the smallest of `_CLASSES_KM_H` that is not below the 90th percentile of the
car's moving speed on the link. This proxy uses the drive itself, so it is better than a map.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray, distance_driven
from tripwatt.routes.links import SHORTEST_STRETCH_M, LinkRoute, links_of_trip
from tripwatt.trips import Plan, Recorded
from tripwatt.units import M_S_PER_KM_H

_CLASSES_KM_H: Final = (30.0, 50.0, 70.0, 100.0, 120.0, 130.0)
"""Free speeds of the classes of roads [km/h]; a choice, usual limits in Europe."""
LINK_M: Final = 250.0
"""Length of the links into which a drive is cut [m]; a choice."""

SHARES: Final = (0.6, 0.7, 0.8, 0.9, 1.0)
"""Candidates for the speed between two stops as a share of the free speed."""


@dataclass(frozen=True, eq=False, slots=True)
class TravelTimeFactors:
    """Ratio of the expected travel time to that on an empty road, by the free speed.

    Attributes
    ----------
    speed_m_s : ndarray, shape (classes,)
        Free speed of each class [m/s], ascending.
    factor : ndarray, shape (classes,)
        Ratio of each class.
    moving_share : float
        Speed between two stops over the free speed.

    Examples
    --------
    >>> factors = TravelTimeFactors(np.array([10.0, 20.0]), np.array([1.4, 1.1]))
    >>> factors.at(np.array([5.0, 15.0, 99.0])).tolist()
    [1.4, 1.25, 1.1]
    """

    speed_m_s: FloatArray
    factor: FloatArray
    moving_share: float = 1.0

    @classmethod
    def from_links(
        cls, routes: Sequence[LinkRoute], driven_s: Sequence[FloatArray], *, moving_share: float = 1.0
    ) -> TravelTimeFactors:
        """Estimate the factors from free-flow links and the times in which they were driven. O(links).

        The factor of a class with little road is shrunk to that of the class and its two neighbours together; if these have little
        road as well, to that of all classes: a motorway is not as slow as the town streets that most links belong to. The speed of a
        class is the mean free speed of its links.
        """
        length = np.concatenate([route.length_m for route in routes])
        speed = np.concatenate([route.moving_speed_m_s for route in routes])
        seconds = np.concatenate(driven_s)
        classes = np.array(_CLASSES_KM_H) * M_S_PER_KM_H
        free_s = length / speed
        overall = float(seconds.sum() / free_s.sum())
        nearest_class = np.argmin(np.abs(speed[:, None] - classes[None, :]), axis=1)
        # 20 km of a class weigh as much as the factor assumed from the other classes; a choice
        prior_s = 20_000.0 / classes
        class_s, class_free_s = (
            np.bincount(nearest_class, values, len(classes)) for values in (seconds, free_s)
        )
        near_s, near_free_s = (np.convolve(values, np.ones(3), "same") for values in (class_s, class_free_s))
        near = (near_s + overall * prior_s) / (near_free_s + prior_s)
        factor = (class_s + near * prior_s) / (class_free_s + prior_s)
        driven = class_free_s > 0.0
        classes[driven] = np.bincount(nearest_class, length, len(classes))[driven] / class_free_s[driven]
        # no class takes more than three times its free time, or less than a third; a choice
        return cls(classes, np.clip(factor, 1.0 / 3.0, 3.0), moving_share)

    def at(self, speed_m_s: FloatArray) -> FloatArray:
        """Factors at given free speeds, linear between the classes, shape of `speed_m_s`."""
        return np.asarray(np.interp(speed_m_s, self.speed_m_s, self.factor), dtype=np.float64)

    def with_expected_times(self, route: LinkRoute) -> LinkRoute:
        """Free-flow links with expected moving speeds and travel times, the latter never shorter than those of the router. O(links).

        If the speed limit of a link is below its free speed, the car drives at the limit, but the factor is that of the free speed.
        """
        free = np.where(np.isnan(route.moving_speed_m_s), route.speed_m_s, route.moving_speed_m_s)
        moving = free if route.speed_limit_m_s is None else np.fmin(free, route.speed_limit_m_s)
        travel_time_s = np.maximum(route.length_m / moving * self.at(free), route.travel_time_s)
        return replace(route, travel_time_s=travel_time_s, moving_speed_m_s=self.moving_share * moving)


def log_energy_ratios(
    trip: Recorded, route: LinkRoute, driven_s: FloatArray, energy: Callable[[Plan], float]
) -> FloatArray:
    """Logarithm of the ratio of planned to driven energy, both by `energy`, for each of `SHARES`. O(samples).

    The plan takes the free-flow links in the times in which they were driven, at a share of the free speed between stops.

    Parameters
    ----------
    trip : Trip
        The drive.
    route : LinkRoute
        Free-flow links of the drive.
    driven_s : ndarray, shape (links,)
        Time in which each link was driven [s].
    energy : callable
        Returns the positive energy of a plan, such as the simulated energy of the car.

    Returns
    -------
    ndarray, shape (len(SHARES),)
        Logarithm of the energy of the plan over that of the drive.
    """
    timed = replace(route, travel_time_s=driven_s, measured=True)
    moving = [replace(timed, moving_speed_m_s=share * route.moving_speed_m_s) for share in SHARES]
    planned = [energy(links.plan().with_departure(trip.departure)) for links in moving]
    return np.asarray(np.log(np.array(planned) / energy(Plan.from_trip(trip))))


def moving_share(log_ratios: Sequence[FloatArray]) -> float:
    """Share of the free speed at which the planned energies of trips agree with the driven ones on average.

    `log_ratios` has the result of `log_energy_ratios` for each trip; their mean is interpolated to 0.

    Examples
    --------
    >>> round(moving_share([np.linspace(-0.1, 0.3, 5), np.linspace(-0.3, 0.1, 5)]), 3)
    0.8
    """
    return float(np.interp(0.0, np.maximum.accumulate(np.mean(log_ratios, axis=0)), SHARES))


def free_flow_links(trip: Recorded, length_m: float = LINK_M) -> tuple[LinkRoute, FloatArray]:
    """Links of a drive as a router without traffic would give them, and the time in which each was driven. O(samples).

    A log with speed limits is cut where the limit changes, any other every `length_m`. Heights are kept every `length_m`.

    Raises
    ------
    InvalidInput
        As `links_of_trip`.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt.trips import Trip
    >>> log = pd.DataFrame({"time_s": np.arange(61.0), "speed_m_s": np.full(61, 10.0)})
    >>> route, driven_s = free_flow_links(Trip.from_samples("t", log))
    >>> (3.6 * route.speed_m_s).round(6).tolist(), driven_s.tolist()
    ([50.0, 50.0], [25.0, 35.0])
    """
    driven = links_of_trip(trip, length_m)
    time, speed = trip.array("time_s"), trip.array("speed_m_s")
    position = distance_driven(time, speed)
    if trip.has("speed_limit_m_s"):
        limit = trip.array("speed_limit_m_s")
        kept = _limit_starts(position, limit)
        border = np.concatenate(([0], kept[1:], [len(time) - 1]))
        length, driven_s, free = np.diff(position[border]), np.diff(time[border]), limit[kept]
    else:
        inner = np.searchsorted(position, np.cumsum(driven.length_m)[:-1])
        free = np.array([_class_speed(piece) for piece in np.split(speed, inner)])
        length, driven_s = driven.length_m, driven.travel_time_s
    unknown, road = np.full(len(length), np.nan), (driven.elevation_position_m, driven.elevation_m)
    return LinkRoute(length, length / free, unknown, free, *road, driven.flags, free_flow=True), driven_s


def driven_by_kind(trip: Recorded) -> FloatArray:
    """Lengths [m] and times [s] of a trip in the city, in the country and on the motorway, shape (6,): lengths first. O(samples).

    Raises
    ------
    InvalidInput
        As `links_of_trip`.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> trip = synthetic_fleet(1).trips[0]
    >>> bool(abs(driven_by_kind(trip)[:3].sum() / trip.distance_m - 1.0) < 0.01)
    True
    """
    route, driven_s = free_flow_links(trip)
    # highest free speed of a road in the city, and of one in the country
    bounds = np.array([50.0, 100.0]) * M_S_PER_KM_H + 1e-6
    kind = np.searchsorted(bounds, route.moving_speed_m_s)
    return np.concatenate([np.bincount(kind, part, 3) for part in (route.length_m, driven_s)])


def _limit_starts(position_m: FloatArray, limit_m_s: FloatArray) -> IntArray:
    """Samples at which a speed limit begins that holds for a link.

    A piece that is short or has no limit is joined to the link before it, at the start of the drive to the first link.
    """
    start = np.flatnonzero(np.append(True, np.diff(limit_m_s) != 0.0))
    piece_m = np.diff(np.append(position_m[start], position_m[-1]))
    known_m = np.where(np.isfinite(limit_m_s[start]), piece_m, -1.0)
    return np.asarray(start[known_m >= min(SHORTEST_STRETCH_M, float(known_m.max()))])


def _class_speed(speed_m_s: FloatArray) -> float:
    """Speed class of a link [m/s] from its driven speeds: lowest if the car never moves, highest if it is faster than all classes."""
    # below 0.5 m/s the car stands
    moving = speed_m_s[speed_m_s > 0.5]
    if not len(moving):
        return _CLASSES_KM_H[0] * M_S_PER_KM_H
    # the free speed: the car is faster for a tenth of the moving time; a choice
    high = float(np.percentile(moving, 90.0)) / M_S_PER_KM_H
    return next((v for v in _CLASSES_KM_H if v >= high - 1e-9), _CLASSES_KM_H[-1]) * M_S_PER_KM_H
