"""Roads of which only the kind is known: shares of the distance in city, country and motorway, their speeds and their spread.

The class of a piece of road follows from its free speed: city up to 50 km/h, country up to 100 km/h, motorway above. Logged drives have no
classes of roads, so the free speed of a piece of 250 m is the proxy of `tripwatt.routes.free_flow`. Properties that the kind does not
determine (speeds, stops, the order of the roads) give a variance of the energy: a part that all of a trip shares and one that evens out
over the distance. The climb is that of a road of unknown heights, by terrain.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, excerpt
from tripwatt.forecasting.ranges import UNKNOWN_AIR_SD_K
from tripwatt.physics.conditions import UNKNOWN_AMBIENT_DEGC
from tripwatt.routes.links import LinkRoute
from tripwatt.trips import Plan
from tripwatt.units import M_S_PER_KM_H

Shares = tuple[float, ...]
"""Shares of the distance in city, country and motorway; they add up to 1."""

KINDS: Final[Mapping[str, Shares]] = MappingProxyType(
    {
        "city": (1.0, 0.0, 0.0),
        "country": (0.25, 0.75, 0.0),
        "motorway": (0.1, 0.15, 0.75),
    }
)
"""Shares of each named kind of road. `UNKNOWN` is the kind of a road of which nothing is known: it has the shares of all logged roads, and
a wider spread."""

UNKNOWN: Final = "mixed"
USUAL_KM_H: Final = (28.0, 62.0, 110.0)
"""Prior mean speeds in city, country and motorway, with standstill [km/h]. Choices."""
USUAL_SHARES: Final[Shares] = (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0)
"""Prior shares of city, country and motorway."""
USUAL_M: Final = 20_000.0
"""Length of road of a class with which a data set has half the weight of the prior for this class; its weight never exceeds that of the
prior, since a data set is of one region."""
_SHARE_PARTS: Final = 4
"""Shares are rounded to quarters: a choice, because drivers do not name finer shares."""
TOWN_M: Final = 15_000.0
"""A named kind has its share of town up to this distance, and no more town beyond: the logs of the TUM show 3 to 5 km of town on
trips of any length. A trip between two places does not pass more towns because it is longer."""
TYPICAL_M: Final = (5_000.0, 40_000.0)
"""Lengths of the typical roads with which own trips are compared; their energy is linear in the length. Choices."""
_PATTERN_M: Final = 10_000.0
"""Length over which the classes of a road repeat: a choice, because towns in densely settled country lie so far apart."""
_END_S_PER_M_S: Final = 0.7
"""Additional time to start or to arrive compared with driving through, for each m/s of the speed: the driver model's ramps (`LinkStyle`)
with 0.8 m/s² at standstill. The mean speeds of the classes are those of roads that are driven through."""


@dataclass(frozen=True, slots=True)
class RoadStudy:
    """Statistics of roads by kind from the logs of a data set, made by ``python -m benchmarks.need --fit``.

    Attributes
    ----------
    length_m, time_s : tuple of float
        Driven length and time in each class.
    known, unknown : tuple of float
        Relative square of the error of the energy of a trip at `USUAL_KM_H`, with the known shares of the trip, and with `USUAL_SHARES`:
        the part of a trip of any length [1], and the part to be divided by the distance [m]. The difference between the region and the
        choices is part of the error.
    """

    length_m: tuple[float, float, float]
    time_s: tuple[float, float, float]
    known: tuple[float, float]
    unknown: tuple[float, float]


STUDIES: Final[Mapping[str, RoadStudy]] = MappingProxyType(
    {
        "tum": RoadStudy(
            (223_233.0, 496_998.0, 233_500.0), (37_721.0, 31_184.0, 7_295.0), (0.00191, 66.4), (0.0197, 56.4)
        ),
        "ved": RoadStudy(
            (202_645.0, 483_295.0, 250.0), (52_940.0, 42_800.0, 9.0), (0.01467, 48.8), (0.0, 130.7)
        ),
    }
)
"""Data sets whose licences allow it: TUM (CC BY 4.0) and VED (Apache-2.0)."""


@dataclass(frozen=True, slots=True)
class RoadPrior:
    """Speeds of the classes of road, and the spread of the energy if only the kind of a road is known.

    Attributes
    ----------
    speed_m_s : tuple of float
        Mean speed with standstill in city, country and motorway.
    usual : tuple of float
        Shares of a road of which nothing is known.
    known, unknown : tuple of float
        As in `RoadStudy`.
    extra : tuple of float
        Share by which driving takes more than on typical roads, for a known and for an unknown kind.

    Examples
    --------
    >>> prior = road_prior()
    >>> prior.relative_sd(20_000.0, known=True) < prior.relative_sd(20_000.0, known=False)
    True
    """

    speed_m_s: tuple[float, ...]
    usual: Shares
    known: tuple[float, ...]
    unknown: tuple[float, ...]
    extra: tuple[float, float] = (0.0, 0.0)

    def relative_sd(self, distance_m: float, known: bool) -> float:
        """Return the relative standard deviation of the energy of a road of which only the kind is known, or nothing if not `known`."""
        common, local_m = self.known if known else self.unknown
        return math.sqrt(common + local_m / distance_m)

    @lru_cache(maxsize=32)  # noqa: B019 - a prior is a value
    def plan(self, distance_m: float, shares: Shares) -> Plan:
        """Make the plan of a typical drive with some shares. O(distance).

        Parameters
        ----------
        distance_m : float
            Length [m].
        shares : tuple of float
            Shares in city, country and motorway.

        Returns
        -------
        Plan
            City, country, motorway, country and city by turns, of unknown heights.

        Examples
        --------
        >>> round(road_prior().plan(20_000.0, KINDS["motorway"]).distance_m)
        20000
        """
        turns = max(round(distance_m / _PATTERN_M), 1)
        halves = ((0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5))
        pieces = [(distance_m / turns * part * shares[k], self.speed_m_s[k]) for k, part in halves]
        length, speed = np.array([p for p in pieces if p[0] > 0.0] * turns).T
        time, unknown = length / speed, np.full(len(length), np.nan)
        np.add.at(time, [0, -1], _END_S_PER_M_S * speed[[0, -1]])
        return LinkRoute(length, time, unknown, unknown).plan(trip_id="distance")


_DISTANCE_LOG_SD: Final = 0.5
"""Standard deviation of the logarithm of the distance, by which own trips are weighted for a distance. A choice."""
_SEASON_DAYS: Final = 20.0
"""Standard deviation of the day of the year, by which own trips are weighted for the outside temperature of a day. A choice."""
_DAYS_OF_YEAR: Final = 365.25
_MAX_ERROR: Final = 1.0
"""Relative errors are clipped to this: trips that take twice as much as typical roads, or nothing, are standstill with the car switched on,
or a few metres. A choice."""
PRIOR_TRIPS: Final = 5.0
"""Weight of the roads of all logs compared with own trips, as a number of trips near a distance. A choice."""


@dataclass(frozen=True, eq=False)
class OwnRoads:
    """Roads of a car's own trips, combined with the roads of all logs: their shares, energy and spread over a distance.

    Attributes
    ----------
    prior : RoadPrior
        Roads of all logs, with the car's own speeds.
    length_m : ndarray, shape (trips, 3)
        Length of each trip in city, country and motorway.
    driving_wh : ndarray, shape (trips,)
        Expected energy of the driven speeds, without climb, climate control and the season.
    typical_wh : ndarray, shape (2, 3)
        The same energy of typical roads of each class, of the lengths `TYPICAL_M`.
    air : ndarray, shape (trips, 2)
        Outside temperature [°C] and day [days since 1970] of each departure; NaN where unknown.
    """

    prior: RoadPrior
    length_m: FloatArray
    driving_wh: FloatArray
    typical_wh: FloatArray
    air: FloatArray

    @classmethod
    def from_trips(
        cls, prior: RoadPrior, driven: FloatArray, driving_wh: Callable[[Plan], float]
    ) -> OwnRoads:
        """Make the own roads from the rows of `tripwatt.hybrid.segments.driven_roads` and a function for the driving energy of a plan."""
        length_m, time_s = driven[:, :3], driven[:, 3:6]
        s_m = USUAL_M / np.array(prior.speed_m_s) + time_s.sum(axis=0)
        own = replace(prior, speed_m_s=tuple(((USUAL_M + length_m.sum(axis=0)) / s_m).tolist()))
        kinds: list[Shares] = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
        typical = [[driving_wh(own.plan(length, kind)) for kind in kinds] for length in TYPICAL_M]
        return cls(own, length_m, driven[:, 6], np.array(typical), driven[:, 7:])

    def at(self, distance_m: float) -> RoadPrior:
        """Return the prior for a distance [m], in which own trips are weighted by how near their distance is. O(trips)."""
        driven_m = self.length_m.sum(axis=1)
        weight = np.exp(-0.5 * (np.log(driven_m / distance_m) / _DISTANCE_LOG_SD) ** 2)
        total_weight, own_shares = PRIOR_TRIPS + weight.sum(), self.length_m / driven_m[:, None]
        usual_shares = np.array(shares_over(self.prior.usual, distance_m))
        short, long = TYPICAL_M
        by_kind = self.typical_wh[0] + np.outer(
            (driven_m - short) / (long - short), self.typical_wh[1] - self.typical_wh[0]
        )
        usual = (PRIOR_TRIPS * usual_shares + weight @ own_shares) / total_weight

        def mean_and_variance(shares: FloatArray, is_known: bool) -> tuple[float, tuple[float, ...]]:
            typical = np.maximum((shares * by_kind).sum(axis=1), 1.0)
            error = np.clip(self.driving_wh / typical - 1.0, -_MAX_ERROR, _MAX_ERROR)
            mean = float(weight @ error / total_weight)
            square = PRIOR_TRIPS * self.prior.relative_sd(distance_m, is_known) ** 2
            square += weight @ (error - mean) ** 2
            return mean, (float(square / total_weight), 0.0)  # common variance, local length

        known_mean, known_var = mean_and_variance(np.array([round_shares(row) for row in own_shares]), True)
        unknown_mean, unknown_var = mean_and_variance(usual, False)
        extra = known_mean, unknown_mean
        return RoadPrior(self.prior.speed_m_s, tuple(usual.tolist()), known_var, unknown_var, extra)


def usual_air(air: FloatArray, day: float) -> tuple[float, float]:
    """Return the outside temperature [°C] around a day of the year where trips were driven, and its standard deviation [K].

    Parameters
    ----------
    air : ndarray, shape (trips, 2)
        Outside temperature [°C] and day of the year of each trip; NaN if unknown.
    day : float
        If it is NaN, both are of all the year.
    """
    degc, trip_day = air[np.isfinite(air[:, 0])].T
    apart = np.abs(trip_day - day) % _DAYS_OF_YEAR
    weight = np.exp(-0.5 * (np.minimum(apart, _DAYS_OF_YEAR - apart) / _SEASON_DAYS) ** 2)
    weight = np.where(np.isfinite(weight), weight, float(not np.isfinite(day)))
    trips = PRIOR_TRIPS + weight.sum()
    mean = float((PRIOR_TRIPS * UNKNOWN_AMBIENT_DEGC + weight @ degc) / trips)
    prior = PRIOR_TRIPS * (UNKNOWN_AIR_SD_K**2 + (UNKNOWN_AMBIENT_DEGC - mean) ** 2)
    return mean, float(np.sqrt((prior + weight @ (degc - mean) ** 2) / trips))


def round_shares(length_m: FloatArray) -> Shares:
    """Return the shares of city, country and motorway in quarters, as a driver names them; the largest remainders are rounded up.

    Examples
    --------
    >>> round_shares(np.array([3000.0, 8000.0, 3000.0]))
    (0.25, 0.5, 0.25)
    """
    exact = _SHARE_PARTS * length_m / length_m.sum()
    rounded = np.floor(exact)
    rounded[np.argsort(rounded - exact)[: _SHARE_PARTS - int(rounded.sum())]] += 1.0
    return tuple((rounded / _SHARE_PARTS).tolist())


@lru_cache(maxsize=8)
def road_prior(without: str | None = None) -> RoadPrior:
    """Return the prior of roads by kind, from the data sets of `STUDIES`.

    Parameters
    ----------
    without : str, optional
        A data set to leave out, so that scores on its trips do not depend on them.

    Returns
    -------
    RoadPrior
        The mean of the choices and the data sets: speeds are weighted by `USUAL_M`, shares equally. The variances are the mean over the
        data sets.
    """
    studies = [study for name, study in STUDIES.items() if name != without]
    length, time = (np.array([getattr(s, name) for s in studies]) for name in ("length_m", "time_s"))
    weight = np.vstack((np.ones(3), length / (length + USUAL_M)))
    s_m = np.vstack((1.0 / (np.array(USUAL_KM_H) * M_S_PER_KM_H), time / length))
    shares = np.vstack((USUAL_SHARES, length / length.sum(axis=1, keepdims=True)))
    known, unknown = (np.mean([getattr(s, name) for s in studies], axis=0) for name in ("known", "unknown"))
    return RoadPrior(
        tuple((weight.sum(axis=0) / (weight * s_m).sum(axis=0)).tolist()),
        tuple(shares.mean(axis=0).tolist()),
        tuple(known.tolist()),
        tuple(unknown.tolist()),
    )


def shares_over(shares: Shares, distance_m: float) -> Shares:
    """Return the shares of a named kind over a distance [m].

    Beyond `TOWN_M`, the rest of the road is country and motorway. A kind that is all town stays all town.

    Examples
    --------
    >>> city, country, motorway = shares_over(KINDS["country"], 150_000.0)
    >>> round(city, 9), round(country, 9), motorway
    (0.025, 0.975, 0.0)
    """
    city, *others = shares
    town = city if city == 1.0 else city * min(TOWN_M / distance_m, 1.0)
    country, motorway = (share * (1.0 - town) / max(1.0 - city, 1e-9) for share in others)
    return town, country, motorway


def typical_road(distance_m: float, kind: str | Sequence[float]) -> Plan:
    """Make the plan of a typical drive of a kind, or of shares, over a distance [m] of a flat road."""
    shares = shares_over(shares_of(kind), distance_m) if isinstance(kind, str) else shares_of(kind)
    plan = road_prior().plan(distance_m, shares)
    return replace(plan, samples=plan.samples.assign(grade=0.0))


def shares_of(kind: str | Sequence[float]) -> Shares:
    """Return the shares of a named kind, or the given shares.

    Raises
    ------
    InvalidInput
        If the name is unknown, or the shares do not add up to 1.

    Examples
    --------
    >>> shares_of("city"), shares_of([0.5, 0.5, 0.0])
    ((1.0, 0.0, 0.0), (0.5, 0.5, 0.0))
    """
    if isinstance(kind, str):
        known = {**KINDS, UNKNOWN: road_prior().usual}
        if kind not in known:
            raise InvalidInput.of("unknown kind of road", "kind", kind[:40], ", ".join(known))
        return known[kind]
    three = isinstance(kind, Collection) and len(kind) == 3
    if not (three and min(kind) >= 0.0 and abs(sum(kind) - 1.0) <= 1e-6):
        allowed = "three shares of city, country and motorway that add up to 1"
        raise InvalidInput.of("not shares of a distance", "kind", excerpt(kind), allowed)
    return tuple(kind)
