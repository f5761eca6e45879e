"""How well the measured energies of trips are known, beside their segments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.routes.terrain import net_climbs
from tripwatt.trips import Plan, Trip
from tripwatt.units import GRAVITY_M_S2, WH_PER_J
from tripwatt.vehicles import Vehicle


def unknown_climb_wh(plan: Plan, vehicle: Vehicle) -> float:
    """Standard deviation of a trip's energy by the climb of its road [Wh]; 0 where the heights are known.

    The potential energy: losses come on top of it on the way up and are saved on the way down. It is that of the core of the climbs,
    because errors with heavy tails are expected of trips anyway.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan, car = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}]), tw.load_vehicle("bmw_i3_60ah")
    >>> 50.0 < unknown_climb_wh(plan, car) < 150.0
    True
    """
    if plan.has_road:
        return 0.0
    climb_m = net_climbs(plan.departure.terrain or "unknown").typical_m(plan.distance_m)
    mass_kg = vehicle.body.test_mass_kg + (plan.departure.payload_mass_kg or 0.0)
    return mass_kg * GRAVITY_M_S2 * climb_m * WH_PER_J


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
    def from_trip(cls, trip: Trip, climb_wh: float = 0.0) -> EnergyErrors:
        """Of one trip; the unknown climb of its road is an error of its energy."""
        along = not trip.observed_energy_std_wh or {"voltage_v", "current_a"} <= set(trip.samples.columns)
        return cls(
            np.array([math.hypot(trip.observed_energy_own_std_wh, climb_wh)]),
            np.array([trip.observed_energy_common_std]),
            np.array([along]),
        )

    def take(self, members: IntArray) -> EnergyErrors:
        """Those of some of the trips."""
        return EnergyErrors(self.own_wh[members], self.common[members], self.along[members])

    @classmethod
    def join(cls, parts: Sequence[EnergyErrors]) -> EnergyErrors:
        """Side by side."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))
