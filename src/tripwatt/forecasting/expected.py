"""A plan simulated and corrected: the expected power of each segment before departure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid import PowerCorrector, SegmentTable
from tripwatt.physics import Simulation
from tripwatt.trips import Plan
from tripwatt.uncertainty import Segments
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle


@dataclass(frozen=True, eq=False)
class ExpectedDrive:
    """What a model expects of one plan.

    Attributes
    ----------
    plan : Plan
        What is known at departure.
    vehicle : Vehicle
    simulation : Simulation
        Of the plan.
    table : SegmentTable
        The plan's segments.
    segments : Segments
        The same segments as the residual process takes them.
    corrector : PowerCorrector
    correction_w : ndarray, shape (segments,)
        Its correction of the simulated power [W].
    """

    plan: Plan
    vehicle: Vehicle
    simulation: Simulation
    table: SegmentTable
    segments: Segments
    corrector: PowerCorrector
    correction_w: FloatArray

    @cached_property
    def power_w(self) -> FloatArray:
        """Expected mean power of each segment [W], shape (segments,)."""
        return self.table.simulated_w + self.correction_w

    @cached_property
    def edges_s(self) -> FloatArray:
        """Time at the edges of the segments [s since departure], shape (segments + 1,)."""
        return np.concatenate(([0.0], np.cumsum(self.segments.step_s)))

    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance at the edges of the segments [m], shape (segments + 1,)."""
        speed = self.table.features["speed_m_s"].to_numpy()
        return np.concatenate(([0.0], np.cumsum(speed * self.table.hours * SECONDS_PER_HOUR)))

    @cached_property
    def wh_per_soc(self) -> float:
        """Terminal energy of a unit of the battery management's state of charge [Wh]."""
        return self.vehicle.battery.capacity_ah * float(np.mean(self.simulation.terminal_voltage_v))

    @property
    def departure_soc(self) -> float:
        """State of charge of the battery management at departure."""
        return float(self.simulation.soc[0])
