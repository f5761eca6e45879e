"""Uncertainty that the travel times of an empty road add to a planned route, measured on held-out trips.

Each training trip is planned on its free-flow links with the travel-time factors of the other trips. The corrector fitted without
that trip predicts the energy of this plan and that of the driven trace. The mean square of the relative difference is the variance
that the unknown travel times add, including that of the links. It has a part that is common to a whole trip (traffic and driver),
and a local part (signals, queues) that evens out over the distance.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import or_none
from tripwatt.hybrid import PowerCorrector, SegmentTable, segment_table
from tripwatt.physics import simulate_trip
from tripwatt.routes.free_flow import TravelTimeFactors, free_flow_links, log_energy_ratios, moving_share
from tripwatt.routes.links import LinkRoute
from tripwatt.trips import Plan, Trip
from tripwatt.uncertainty.route import relative_differences
from tripwatt.vehicles import Vehicle

MIN_TRIPS: Final = 5
"""Fewest trips from which the two variances are estimated; a choice, because with fewer trips they would be chance."""


@dataclass(frozen=True, eq=False)
class FreeFlowUncertainty:
    """Expected travel times of a free-flow route, and the relative variance that they add to its energy.

    Attributes
    ----------
    factors : TravelTimeFactors
    scale_variance : float
        Relative variance that is the same at any length of a trip [1].
    local_variance_m : float
        Local part: divided by the length of the trip, a relative variance [m].
    trips : int
        Number of trips that the variances were measured on.
    """

    factors: TravelTimeFactors
    scale_variance: float
    local_variance_m: float
    trips: int

    @classmethod
    def from_differences(
        cls, factors: TravelTimeFactors, differences: FloatArray, distance_m: FloatArray
    ) -> FreeFlowUncertainty | None:
        """Estimate both variances from relative differences and distances of held-out trips.

        They are the non-negative least-squares fit to the squared differences. A difference is NaN if a trip has none; returns None
        if fewer than `MIN_TRIPS` have one.

        Examples
        --------
        >>> factors = TravelTimeFactors(np.array([10.0]), np.array([1.2]))
        >>> distance = np.array([1e4, 1e4, 4e4, 4e4, 4e4])
        >>> measured = FreeFlowUncertainty.from_differences(factors, np.sqrt(0.0004 + 4.0 / distance), distance)
        >>> round(measured.scale_variance, 6), round(measured.local_variance_m, 6), round(measured.share(1e4), 6)
        (0.0004, 4.0, 0.028284)
        """
        from scipy.optimize import nnls

        known = np.isfinite(differences)
        if known.sum() < MIN_TRIPS:
            return None
        design = np.column_stack((np.ones(int(known.sum())), 1.0 / distance_m[known]))
        parts, _ = nnls(design, differences[known] ** 2)
        return cls(factors, float(parts[0]), float(parts[1]), int(known.sum()))

    def share(self, distance_m: float) -> float:
        """Relative standard deviation of the energy of a route of the given length [1]."""
        return float(np.sqrt(self.scale_variance + self.local_variance_m / distance_m))


@dataclass(frozen=True, eq=False)
class FreeFlowTrips:
    """Training trips as planned by a router without traffic.

    Attributes
    ----------
    trips : tuple of Trip
    vehicle : Vehicle
    links : tuple of (LinkRoute, ndarray) or None
        Free-flow links of each trip and the times that were driven on them; None if the trip could not be cut.
    shares : tuple of ndarray or None
        For each trip the result of `log_energy_ratios` with the car's simulated energy; None if its log carries no speed limits.
    """

    trips: tuple[Trip, ...]
    vehicle: Vehicle
    links: tuple[tuple[LinkRoute, FloatArray] | None, ...]
    shares: tuple[FloatArray | None, ...] = ()

    @classmethod
    def from_trips(cls, trips: Sequence[Trip], vehicle: Vehicle) -> FreeFlowTrips:
        """Cut trips into free-flow links. O(samples)."""
        links = tuple(or_none(free_flow_links, trip) for trip in trips)  # None if a log cannot be cut

        def energy(plan: Plan) -> float:
            table = segment_table(plan, simulate_trip(vehicle, plan))
            return float(table.totals_wh(table.simulated_w)[0])

        shares = tuple(
            log_energy_ratios(trip, *cut, energy) if cut is not None and trip.has("speed_limit_m_s") else None
            for trip, cut in zip(trips, links, strict=True)
        )
        return cls(tuple(trips), vehicle, links, shares)

    def factors(self, without: Collection[int] = ()) -> TravelTimeFactors | None:
        """Travel-time factors of the trips, without some of them by index; None if no trip has links."""
        known = [links for i, links in enumerate(self.links) if links is not None and i not in without]
        shown = [shares for i, shares in enumerate(self.shares) if shares is not None and i not in without]
        share = moving_share(shown) if shown else 1.0
        return TravelTimeFactors.from_links(*zip(*known, strict=True), moving_share=share) if known else None

    def plan(self, k: int, factors: TravelTimeFactors) -> Plan | None:
        """Plan of trip `k` on its free-flow links with the expected times; None if the trip could not be cut."""
        links, trip = self.links[k], self.trips[k]
        if links is None:
            return None
        plan = factors.with_expected_times(links[0]).plan(trip_id=trip.trip_id)
        return replace(plan.with_departure(trip.departure), start_s=float(trip.array("time_s")[0]))

    def differences(self, corrector: PowerCorrector, driven: SegmentTable, members: IntArray) -> FloatArray:
        """Compare the predicted energies of trips on free-flow links with those on their driven traces.

        Parameters
        ----------
        corrector : PowerCorrector
            A corrector fitted without these trips.
        driven : SegmentTable
            All trips, on their driven traces.
        members : ndarray of int
            Indices of the trips; the travel-time factors are those of the other trips.

        Returns
        -------
        ndarray, shape (members,)
            Results of `relative_differences`; NaN for trips that could not be planned.
        """
        differences = np.full(len(members), np.nan)
        factors = self.factors(members.tolist())
        if factors is None:
            return differences
        for row, k in enumerate(members):
            plan = self.plan(int(k), factors)
            if plan is not None:
                table = segment_table(plan, simulate_trip(self.vehicle, plan))
                differences[row] = relative_differences(corrector, table, driven.take([int(k)]))[0, 0]
        return differences

    def uncertainty(self, differences: FloatArray) -> FreeFlowUncertainty | None:
        """Uncertainty shown by these trips, from the difference of each trip when it was held out; None if there are too few."""
        factors = self.factors()
        if factors is None:
            return None
        distance = np.array([np.nan if f is None else f[0].distance_m for f in self.links])
        return FreeFlowUncertainty.from_differences(factors, differences, distance)
