"""A plan simulated and corrected: the expected power of each segment before departure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid import PowerCorrector, SegmentTable
from tripwatt.physics import Simulation
from tripwatt.trips import Plan
from tripwatt.uncertainty import Segments
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

LEAST_RESISTANCE: Final = 0.5
"""Part of air drag and rolling resistance that every trip has: tail wind and good tyres take less than half of them."""
LEAST_CAUSES: Final = ("air", "rolling", "climb", "acceleration")


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
    def climate_w(self) -> FloatArray | None:
        """Expected mean power of climate control in each segment [W]; None where the correction is joint."""
        if self.plan.departure.climate == "off":
            return np.zeros(len(self.segments))
        correction = self.corrector.predict_climate(self.table)
        return None if correction is None else np.asarray(self.segments.hvac_w + correction)

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
    def least_w(self) -> FloatArray:
        """Least possible mean power of each segment [W], shape (segments,).

        A part of air drag and rolling resistance, the climb and the kinetic energy, without any loss or load.
        """
        part = {name: self.table.features[f"{name}_w"].to_numpy() for name in LEAST_CAUSES}
        return np.asarray(
            LEAST_RESISTANCE * (part["air"] + part["rolling"]) + part["climb"] + part["acceleration"]
        )

    @cached_property
    def wh_per_soc(self) -> float:
        """Terminal energy of a unit of the battery management's state of charge [Wh]."""
        return self.vehicle.battery.capacity_ah * float(np.mean(self.simulation.terminal_voltage_v))

    @property
    def departure_soc(self) -> float:
        """State of charge of the battery management at departure."""
        return float(self.simulation.soc[0])
