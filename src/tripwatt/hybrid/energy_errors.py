"""How well the measured energies of trips are known, beside their segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.trips import Trip


@dataclass(frozen=True, eq=False)
class EnergyErrors:
    """Measurement errors of trips.

    Attributes
    ----------
    own_wh : ndarray, shape (trips,)
        Standard deviation of each energy that is independent of other trips [Wh]; 0 where it is negligible.
    common : ndarray, shape (trips,)
        Relative standard deviation that all energies of the car have in common.
    along : ndarray of bool, shape (trips,)
        Whether the energy was measured along the trip; an energy from the state of charge counts for the whole trip only.
    """

    own_wh: FloatArray
    common: FloatArray
    along: BoolArray

    @classmethod
    def from_trip(cls, trip: Trip) -> EnergyErrors:
        """Of one trip."""
        along = not trip.observed_energy_std_wh or {"voltage_v", "current_a"} <= set(trip.samples.columns)
        return cls(
            np.array([trip.observed_energy_own_std_wh]),
            np.array([trip.observed_energy_common_std]),
            np.array([along]),
        )

    def take(self, members: IntArray) -> EnergyErrors:
        """Those of some of the trips."""
        return EnergyErrors(self.own_wh[members], self.common[members], self.along[members])

    @classmethod
    def join(cls, parts: Sequence[EnergyErrors]) -> EnergyErrors:
        """Side by side."""
        return cls(
            np.concatenate([part.own_wh for part in parts]),
            np.concatenate([part.common for part in parts]),
            np.concatenate([part.along for part in parts]),
        )
