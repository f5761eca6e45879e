"""A donor model: the part of a model of one car that is used for cars with fewer logged signals.

A correction that was fitted with a known cabin and battery temperature belongs to a car that was simulated from them.
Without these signals the car is simulated from assumed temperatures, and its residual is another one. The trips of the
first car are therefore simulated and fitted once more with these inputs masked. Most departures of a car without trips lack them as well.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.hierarchy import Members
from tripwatt.trips import Trip
from tripwatt.uncertainty import ConformalScores, TotalScale
from tripwatt.uncertainty.held_out import process_segments
from tripwatt.uncertainty.scale import T_VARIANCE

MASKABLE: Final = ("cabin_temperature_degc", "cabin_setpoint_degc", "battery_temperature_degc")
"""Inputs of a departure that corrections depend on and that many logs lack."""


@dataclass(frozen=True, eq=False)
class DonorModel:
    """What was fitted on one car, for use on others, with its uncertainty on held-out trips of its own.

    Attributes
    ----------
    members : Members
        Its Gaussian processes.
    scale : TotalScale
    scores : ConformalScores
    masked_inputs : tuple of str
        Signals that were masked for it and for the simulation that it corrects.
    """

    members: Members
    scale: TotalScale
    scores: ConformalScores
    masked_inputs: tuple[str, ...] = ()

    def variances_wh2(self, table: SegmentTable, measured: Sequence[Trip] = ()) -> FloatArray:
        """Variance of each trip's energy [Wh²] without the corrector's own uncertainty, shape (trips,).

        With `measured`, it contains the error of an energy that was taken from the state of charge.
        """
        trips = [table.take([i]) for i in range(len(table))]
        none = [np.zeros((len(trip.hours), 1)) for trip in trips]
        sd = [self.scale.sd_wh(process_segments(t, zero)) for t, zero in zip(trips, none, strict=True)]
        own = np.array([trip.observed_energy_std_wh or 0.0 for trip in measured] or [0.0])
        variance = np.square(sd) * T_VARIANCE  # of the t distribution with this scale
        return np.asarray(variance + own**2)


def without_inputs(trip: Trip, masked: Collection[str]) -> Trip:
    """A trip with some inputs masked, and with them season, weather and the trip before it.

    Examples
    --------
    >>> import pandas as pd
    >>> log = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0], "cabin_temperature_degc": [20.0, 20.0]})
    >>> "cabin_temperature_degc" in without_inputs(Trip.from_samples("t", log), {"cabin_temperature_degc"})
    False
    """
    dropped = [name for name in masked if name in trip]
    if not dropped and not masked:
        return trip
    context = replace(trip.context, season=None, weather=None, follows_trip=False)
    if "cabin_setpoint_degc" in masked:
        context = replace(context, cabin_setpoint_degc=None)
    return replace(trip, samples=trip.samples.drop(columns=dropped), context=context)


def unknown_inputs(trips: Sequence[Trip], candidates: Collection[str] = MASKABLE) -> tuple[str, ...]:
    """Inputs that no trip has at its departure, in the order of the candidates."""
    known = {
        name
        for trip in trips
        for name in candidates
        if trip.has(name) or (name == "cabin_setpoint_degc" and trip.context.cabin_setpoint_degc is not None)
    }
    return tuple(name for name in candidates if name not in known)
