"""What a model has to say where less is known: the same trips with the signals hidden that another car's log may lack.

A correction learned with a known cabin and battery temperature is about a car that was simulated from them. Where a log
does not know them the car is simulated from guesses, and what is left over is something else. So the trips of the first
car are simulated and learned once more as if nobody had known.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting.model import ForecastModel, process_blocks, training_blocks
from tripwatt.forecasting.scale import TAIL_DF, TotalScale
from tripwatt.forecasting.scores import Scores
from tripwatt.hybrid import BlockTable
from tripwatt.hybrid.transfer import Members
from tripwatt.trips import FloatArray, Trip
from tripwatt.vehicles import Vehicle

HIDEABLE: Final = ("cabin_temperature_degc", "cabin_setpoint_degc", "battery_temperature_degc")
"""Signals of the departure that corrections depend on and that many logs lack."""


@dataclass(frozen=True, eq=False)
class Elsewhere:
    """What was learned on one car, for use on others, with how sure it was on held-out trips of its own.

    Attributes
    ----------
    members : Members
        Its Gaussian processes.
    scale : TotalScale
    scores : Scores
    hidden : tuple of str
        Signals that were hidden from it, and from the simulation that it corrects.
    """

    members: Members
    scale: TotalScale
    scores: Scores
    hidden: tuple[str, ...] = ()

    @classmethod
    def of(cls, model: ForecastModel) -> Elsewhere:
        """The Gaussian processes of a fitted model, nothing hidden.

        Raises
        ------
        InvalidInput
            When it is not fitted or has none.
        """
        if model.fitted_ is None or model.scale_ is None or model.scores_ is None:
            raise InvalidInput(
                Fault("model is not fitted", "base", "no training trips", fix="call fit first")
            )
        return cls(Members.of(model.fitted_), model.scale_, model.scores_)

    @classmethod
    def learned(
        cls, trips: Sequence[Trip], vehicle: Vehicle, hidden: Collection[str] = HIDEABLE, *, seed: int = 0
    ) -> Elsewhere:
        """Simulate and learn trips with some signals hidden, one Gaussian process for all of the residual."""
        seen = [without_signals(trip, hidden) for trip in trips]
        model = ForecastModel(vehicle, "kriging", seed).fit_blocks(training_blocks(seen, vehicle))
        return replace(cls.of(model), hidden=tuple(hidden))

    def variances_wh2(self, table: BlockTable, measured: Sequence[Trip] = ()) -> FloatArray:
        """Variance of each trip's energy [Wh²] apart from what the mean does not know, shape (trips,).

        With the trips themselves it holds the error of an energy that was taken from the state of charge.
        """
        trips = [table.take([i]) for i in range(len(table))]
        none = [np.zeros((len(trip.hours), 1)) for trip in trips]
        sd = [self.scale.sd_wh(process_blocks(t, zero)) for t, zero in zip(trips, none, strict=True)]
        own = np.array([trip.observed_energy_std_wh or 0.0 for trip in measured] or [0.0])
        variance = (
            np.square(sd) * TAIL_DF / (TAIL_DF - 2.0)
        )  # of the t distribution that the scale belongs to
        return np.asarray(variance + own**2)


def elsewhere_of(model: ForecastModel, trips: Sequence[Trip]) -> Elsewhere | None:
    """What a fitted model gives to cars whose logs know less than its own; None where that is all it has.

    Parameters
    ----------
    model : ForecastModel
    trips : sequence of Trip
        Those that it was fitted on.
    """
    hidden = tuple(name for name in HIDEABLE if name not in unknown_signals(trips))
    if not hidden or model.corrector not in ("linear", "kriging", "ensemble", "channels"):
        return None
    return Elsewhere.learned(trips, model.vehicle, hidden, seed=model.seed)


def without_signals(trip: Trip, hidden: Collection[str]) -> Trip:
    """A trip of which nobody knew some signals, nor season, weather, set-point and the trip before it.

    Examples
    --------
    >>> import pandas as pd
    >>> log = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0], "cabin_temperature_degc": [20.0, 20.0]})
    >>> "cabin_temperature_degc" in without_signals(Trip.from_samples("t", log), {"cabin_temperature_degc"})
    False
    """
    dropped = [name for name in hidden if name in trip]
    if not dropped and not hidden:
        return trip
    context = replace(trip.context, season=None, weather=None, follows_trip=False)
    if "cabin_setpoint_degc" in hidden:
        context = replace(context, cabin_setpoint_degc=None)
    return replace(trip, samples=trip.samples.drop(columns=dropped), context=context)


def unknown_signals(trips: Sequence[Trip], candidates: Collection[str] = HIDEABLE) -> tuple[str, ...]:
    """Signals that no trip knows at its departure, in the order of the candidates."""
    known = {
        name
        for trip in trips
        for name in candidates
        if trip.has(name) or (name == "cabin_setpoint_degc" and trip.context.cabin_setpoint_degc is not None)
    }
    return tuple(name for name in candidates if name not in known)
