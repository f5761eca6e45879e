"""The uncertainty that a planned route adds: links describe the speed less well than a driven trace.

While a model is fitted, each training trip is cut into links as a router gives them, and a driver model makes a speed
trace of the links. The corrector fitted without that trip predicts the energy of the driven trace and of the trace made from
links. The relative difference of the two energies is the error that links cause. The mean square of the error, by the length of
the links, is the variance that a planned route adds to the forecast of a driven trace. No forecast is shifted: a mean difference
with a known cause is corrected in the driver model, and the rest of it is part of the variance.

The links of the training trips have the travel times that were driven. The error of a router's travel times is not
included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import or_none
from tripwatt.hybrid import PowerCorrector, SegmentTable, segment_table
from tripwatt.physics import simulate_trip
from tripwatt.routes import plan_on_links
from tripwatt.trips import Trip
from tripwatt.vehicles import Vehicle

LENGTHS_M: Final = (250.0, 1000.0, 4000.0)
"""Lengths of links for which the error is measured."""

MAX_TRIPS: Final = 200
"""Largest number of training trips that are cut into links: three variances need no more."""


@dataclass(frozen=True, eq=False)
class RouteUncertainty:
    """Relative variance that links add to the energy of a trip, by their length.

    Attributes
    ----------
    length_m : ndarray, shape (lengths,)
        Lengths of the links, ascending [m].
    variance : ndarray, shape (lengths,)
        Variance of the relative error of the energy; never falls with the length.
    trips : int
        Number of trips that the variance was measured on.

    Examples
    --------
    >>> route = RouteUncertainty(np.array([250.0, 1000.0]), np.array([0.0004, 0.0016]), 20)
    >>> round(route.share(250.0), 6), round(route.share(625.0) ** 2, 6), route.share(0.0), round(route.share(9e9), 6)
    (0.02, 0.001, 0.0, 0.04)
    >>> measured = RouteUncertainty.from_differences(np.full((8, 3), 0.02))
    >>> measured.trips, round(measured.share(250.0), 6)
    (8, 0.02)
    """

    length_m: FloatArray
    variance: FloatArray
    trips: int

    @classmethod
    def from_differences(cls, differences: FloatArray) -> RouteUncertainty | None:
        """Estimate the variance from relative differences of energies.

        Parameters
        ----------
        differences : ndarray, shape (trips, len(LENGTHS_M))
            Result of `LinkedTrips.differences` [1]; NaN for trips without one.

        Returns
        -------
        RouteUncertainty or None
            None if fewer than 5 trips have differences.
        """
        known = differences[np.isfinite(differences).all(axis=1)]
        # three variances from fewer trips would be chance; a choice
        if len(known) < 5:
            return None
        variance = np.maximum.accumulate(np.mean(known**2, axis=0))
        return cls(np.array(LENGTHS_M), variance, len(known))

    def share(self, link_m: float) -> float:
        """Relative standard deviation of the energy for links of a length.

        The variance is interpolated linearly between the measured lengths and from 0 at 0 m; it is constant beyond the longest.

        Parameters
        ----------
        link_m : float
            Length of the links [m].

        Returns
        -------
        float
            Fraction of the trip's energy without its climb [1].
        """
        length, variance = np.concatenate(([0.0], self.length_m)), np.concatenate(([0.0], self.variance))
        return float(np.sqrt(np.interp(link_m, length, variance)))


@dataclass(frozen=True, eq=False)
class LinkedTrips:
    """Training trips as driven by the driver model on their links.

    Attributes
    ----------
    tables : tuple of tuple of SegmentTable
        For each trip its segments on links of every length of `LENGTHS_M`; an empty tuple if the trip was not cut.

    Examples
    --------
    >>> from tripwatt.hybrid import power_corrector, segment_trips
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> trips, car = synthetic_fleet(4).trips, load_vehicle(VEHICLE)
    >>> linked, driven = linked_trips(trips, car), segment_trips(trips, car)
    >>> len(linked.tables), len(linked.tables[0]) == len(LENGTHS_M)
    (4, True)
    >>> corrector = power_corrector("linear").fit(driven.take([0, 1, 2]))
    >>> linked.differences(corrector, driven, np.array([3])).shape
    (1, 3)
    """

    tables: tuple[tuple[SegmentTable, ...], ...]

    def differences(self, corrector: PowerCorrector, driven: SegmentTable, members: IntArray) -> FloatArray:
        """Compare the predicted energies of trips on links with those on their driven traces.

        Parameters
        ----------
        corrector : PowerCorrector
            A corrector fitted without these trips.
        driven : SegmentTable
            All trips, on their driven traces.
        members : ndarray of int
            Indices of the trips to compare.

        Returns
        -------
        ndarray, shape (members, lengths)
            Result of `relative_differences`; NaN for trips that were not cut.

        Examples
        --------
        >>> linked.differences(corrector, driven, np.arange(3)).shape  # doctest: +SKIP
        (3, 3)
        """
        differences = np.full((len(members), len(LENGTHS_M)), np.nan)
        cut = [k for k, i in enumerate(members) if self.tables[int(i)]]
        if not cut:
            return differences
        on_links = SegmentTable.join([table for k in cut for table in self.tables[int(members[k])]])
        differences[cut] = relative_differences(corrector, on_links, driven.take(members[cut]))
        return differences


def relative_differences(
    corrector: PowerCorrector, planned: SegmentTable, driven: SegmentTable
) -> FloatArray:
    """Energy of plans minus that of the driven trace, over the latter without its climb [1], shape (trips, plans of each trip).

    Speeds do not change the potential energy of the climb, so it does not count in the divisor.
    """
    driven_wh, planned_wh = (t.totals_wh(t.simulated_w + corrector.predict(t)) for t in (driven, planned))
    level_wh = driven_wh - driven.totals_wh(driven.columns["climb_w"])
    return np.asarray((planned_wh.reshape(len(driven), -1) - driven_wh[:, None]) / level_wh[:, None])


def linked_trips(trips: Sequence[Trip], vehicle: Vehicle) -> LinkedTrips:
    """Cut trips into links and simulate a driver on the links. O(samples) for each length.

    If there are more than `MAX_TRIPS` trips, only that many are cut, evenly chosen. Trips that do not move are not cut.

    Parameters
    ----------
    trips : sequence of Trip
        Trips that a model is fitted to.
    vehicle : Vehicle
        The car that is simulated on the links.

    Returns
    -------
    LinkedTrips
        One entry for each trip; the entry is empty if the trip was not cut.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> len(linked_trips(synthetic_fleet(1).trips, load_vehicle(VEHICLE)).tables)
    1
    """
    chosen = {int(i) for i in np.linspace(0, len(trips) - 1, min(len(trips), MAX_TRIPS)).round()}
    cut = (or_none(_on_links, trip, vehicle) if i in chosen else None for i, trip in enumerate(trips))
    return LinkedTrips(tuple(tables or () for tables in cut))  # a log that cannot be cut has no link error


def _on_links(trip: Trip, vehicle: Vehicle) -> tuple[SegmentTable, ...]:
    plans = [plan_on_links(trip, length) for length in LENGTHS_M]
    return tuple(segment_table(plan, simulate_trip(vehicle, plan)) for plan in plans)
