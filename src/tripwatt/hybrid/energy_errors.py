"""Errors of the measured energies of trips."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.hybrid.rows import Records
from tripwatt.routes.terrain import net_climbs
from tripwatt.trips import Plan, Trip
from tripwatt.trips.energy import resolution
from tripwatt.units import GRAVITY_M_S2, WH_PER_J
from tripwatt.vehicles import Vehicle


def unknown_climb_wh(plan: Plan, vehicle: Vehicle) -> float:
    """Standard deviation of a trip's energy due to the unknown climb of its road [Wh]; 0 if the heights are known.

    It is the potential energy of a typical climb: losses are added on the way up and saved on the way down. The far tails of the
    distribution of climbs are left out, because errors of trips are expected to have heavy tails anyway.

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
class EnergyErrors(Records):
    """Measurement errors of trips.

    Attributes
    ----------
    own_wh : ndarray, shape (trips,)
        Standard deviation of each energy, independent of other trips [Wh]; 0 if negligible.
    common : ndarray, shape (trips,)
        Relative standard deviation of the error that all energies of the car share [1].
    along : ndarray of bool, shape (trips,)
        Whether the energy was measured along the trip: from voltage and current, or by a counter that steps at least once in a
        segment. A coarser counter and an energy from the state of charge count only for the whole trip.
    """

    own_wh: FloatArray
    common: FloatArray
    along: BoolArray

    @classmethod
    def from_trip(cls, trip: Trip, climb_wh: float = 0.0, segments: int = 1) -> EnergyErrors:
        """Make the errors of one trip; `climb_wh`, by the unknown climb of its road, counts as an error of the energy."""
        along = {"voltage_v", "current_a"} <= set(trip.samples.columns)
        if not along and "observed_energy_wh" in trip and not trip.observed_energy_common_std:
            step_wh = resolution(trip.array("observed_energy_wh"))
            along = step_wh * segments <= abs(trip.observed_energy_wh or 0.0)
        return cls(
            np.array([math.hypot(trip.observed_energy_own_std_wh, climb_wh)]),
            np.array([trip.observed_energy_common_std]),
            np.array([along]),
        )
