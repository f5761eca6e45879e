"""A plan simulated and corrected: the expected power of each segment before departure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.hybrid import PowerCorrector, SegmentTable
from tripwatt.hybrid.segments import driving_w
from tripwatt.physics import Simulation
from tripwatt.physics.batch import energies_on_grades
from tripwatt.routes.terrain import LOCAL_M, NetClimbs
from tripwatt.trips import Plan
from tripwatt.uncertainty import Segments
from tripwatt.uncertainty.climb import ClimbingEnergy
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

MIN_RESISTANCE: Final = 0.5
"""Part of air drag and rolling resistance that every trip has: tail wind and good tyres take less than half of them."""
FAR: Final = 0.99
"""Quantile of the net climb up to which a road of unknown heights is simulated; energy is linear beyond."""
EVEN: Final = (-1.0, -0.3, 0.3, 1.0)
"""Grades beyond the expected ones that are simulated, as multiples of the grade of that quantile; half of them fall."""
HILLS: Final = (0.03, 0.08)
"""Grades of the simulated roads that go up and down in turn."""
COOLING_S: Final = 1800.0
"""Time constant with which a parked car cools [s], see `tripwatt.physics.conditions.warmth_from_cabin`."""
PARKED_W: Final = 10.0
"""Power of a parked car [W]. A choice: a quarter of a kilowatt-hour a day for control units that wake up at times."""
WARM_STATE: Final = ("cabin_temperature_degc", "battery_temperature_degc", "follows_trip", "warmth")
"""Fields of a departure that show whether the car is warm."""
MIN_CAUSES: Final = ("air", "rolling", "climb", "acceleration")


@dataclass(frozen=True, eq=False)
class ExpectedTrip:
    """Simulation and correction of one plan.

    Attributes
    ----------
    plan : Plan
        What is known at departure.
    vehicle : Vehicle
    simulation : Simulation
        Simulation of the plan.
    table : SegmentTable
        Segments of the plan.
    segments : Segments
        The same segments in the form that the residual process takes.
    corrector : PowerCorrector
    correction_w : ndarray, shape (segments,)
        Correction of the simulated power [W].
    """

    plan: Plan
    vehicle: Vehicle
    simulation: Simulation
    table: SegmentTable
    segments: Segments
    corrector: PowerCorrector
    correction_w: FloatArray

    def with_pauses(self, forecast: Callable[[Plan], Any]) -> ExpectedTrip:
        """Add the energy that the car takes in the pauses in which it cools down, and to get warm again after each.

        The roads before and after a pause are forecast as two trips; the second begins with a cold car. The share of the warmth that is
        lost in the pause is the share of their power that counts. The additional energy has the cause climate control.
        """
        simulated_w, hours = self.table.simulated_w.copy(), self.table.hours
        for k, pause in ((k, pause) for k, pause in enumerate(self.plan.pauses) if pause.cools):
            first = min(int(np.searchsorted(self.distance_m, pause.position_m)), len(hours) - 1)
            lost = 1.0 - np.exp(-pause.duration_s / COOLING_S)
            if first:
                apart_w = np.concatenate([forecast(plan).drive.power_w for plan in self._parted(first, k)])
                simulated_w += lost * (apart_w - simulated_w - self.correction_w)
            simulated_w[first] += PARKED_W * pause.duration_s / SECONDS_PER_HOUR / hours[first]
        return replace(self, table=replace(self.table, simulated_w=simulated_w))

    def _parted(self, first: int, pauses: int) -> Iterator[Plan]:
        """Yield the plan up to the start of a segment, with its first pauses, and the rest as a trip of a car that has stood for long."""
        plan, run = self.plan, self.simulation
        at = int(np.searchsorted(run.time_s - run.time_s[0], self.edges_s[first] - 1e-6))
        samples = plan.samples.assign(grade=run.grade)
        cold = replace(plan.departure, **dict.fromkeys(WARM_STATE), bms_soc=float(run.soc[at]))
        for part, departure in ((slice(at + 1), plan.departure), (slice(at, None), cold)):
            wind = plan.weather and replace(plan.weather, headwind_m_s=plan.weather.headwind_m_s[part])
            heading = None if plan.heading_deg is None else plan.heading_deg[part]
            known = replace(plan, samples=samples.iloc[part], departure=departure, pauses=())
            yield replace(known, weather=wind, heading_deg=heading, pauses=plan.pauses[:pauses])
            pauses = 0

    @cached_property
    def power_w(self) -> FloatArray:
        """Expected mean power of each segment [W], shape (segments,)."""
        return self.table.simulated_w + self.correction_w

    def with_more_driving(self, share: float) -> ExpectedTrip:
        """Copy of the trip in which the power of driving is higher by a share."""
        return replace(self, correction_w=self.correction_w + share * self._driving_w)

    @property
    def driving_wh(self) -> float:
        """Expected energy of driving, without climb, climate control and the season [Wh]."""
        return float((self._driving_w * self.table.hours).sum())

    @property
    def _driving_w(self) -> FloatArray:
        return driving_w(self.table) + self.corrector.predict_driving(self.table)

    @cached_property
    def climate_w(self) -> FloatArray | None:
        """Expected mean power of climate control in each segment [W]; None if the corrector has no separate part for it."""
        if self.plan.departure.climate == "off":
            return np.zeros(len(self.segments))
        correction = self.corrector.predict_climate(self.table)
        return None if correction is None else np.asarray(self.segments.climate_w + correction)

    @cached_property
    def edges_s(self) -> FloatArray:
        """Time at the edges of the segments [s since departure], shape (segments + 1,)."""
        return running_sum(self.segments.step_s)

    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance at the edges of the segments [m], shape (segments + 1,)."""
        return running_sum(self.table.columns["speed_m_s"] * self.table.hours * SECONDS_PER_HOUR)

    @cached_property
    def min_w(self) -> FloatArray:
        """Least possible mean power of each segment [W], shape (segments,).

        It is `MIN_RESISTANCE` of air drag and rolling resistance, plus climb and kinetic energy, without any loss or load.
        """
        air, rolling, climb, acceleration = (self.table.columns[f"{cause}_w"] for cause in MIN_CAUSES)
        return np.asarray(MIN_RESISTANCE * (air + rolling) + climb + acceleration)

    def climbing_energy(self, net: NetClimbs) -> ClimbingEnergy:
        """Energy of climbing on a road of unknown heights, from simulations at grades around the expected ones. O(samples) for each."""
        even = np.array(EVEN) * max(net.steepest(FAR, float(self.distance_m[-1])), 1e-3)
        time_s, run = self.simulation.time_s - self.simulation.time_s[0], self.simulation
        at = np.interp(time_s, self.edges_s, self.distance_m)
        by_turns = np.where((at / LOCAL_M).astype(np.int64) % 2, -1.0, 1.0)
        # beyond those of the plan: a battery that its climb empties takes the energy of its descent, and hills on it waste little
        more_wh = energies_on_grades(self.vehicle, self.plan, run, [*even, *np.outer(HILLS, by_turns)])
        extra_wh = [np.interp(self.edges_s, time_s, row) for row in more_wh - run.energy_wh]
        even_wh, hill_wh = np.split(extra_wh, [len(EVEN)])
        # the plan itself has none of them
        grade, even_wh = np.insert(even, len(EVEN) // 2, 0.0), np.insert(even_wh, len(EVEN) // 2, 0.0, axis=0)
        hill_wh = np.insert(hill_wh, 0, 0.0, axis=0)
        return ClimbingEnergy(grade, even_wh, np.array((0.0, *HILLS)), hill_wh, self.distance_m, net)
