"""Advice while a car drives: a message only when the verdict changes, with the speed that would restore it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import pandas as pd

from tripwatt.forecasting import Forecast
from tripwatt.forecasting.leaving import forecasts_like
from tripwatt.roads.advice.actions import cap_speed, limits_below
from tripwatt.trips.columns import require_fraction
from tripwatt.units import SECONDS_PER_MINUTE

Verdict = Literal["arrives", "open", "does_not_arrive"]

EVERY_S: Final = SECONDS_PER_MINUTE
"""Shortest time between two evaluations of a trip [s]: a choice, because the chance changes little in a minute."""
QUIET_S: Final = 5.0 * SECONDS_PER_MINUTE
"""Shortest time between two messages [s]: a choice that spares the driver."""
POINTS: Final = 61
"""Points of the curves of a trip. A choice: a phone shows no more, and a stream sends them every few seconds."""
MARGIN: Final = 0.03
"""Margin by which a chance has to pass the limit of a verdict to end it, so that small fluctuations give no messages. A choice."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message to the driver on the way.

    Attributes
    ----------
    time_s : float
        Time since departure [s].
    verdict : {"arrives", "open", "does_not_arrive"}
        Whether the car arrives with the reserve: "arrives" with the required chance, "does_not_arrive" with the same
        chance, or else "open".
    soc_arrival, p_arrive : float
        Expected displayed charge at arrival, and the chance to arrive with the reserve.
    speed_m_s : float or None
        Highest speed from here on that restores the required chance; None if it is not needed, or no speed suffices.
    p_at_speed : float or None
        Chance with this speed.

    Examples
    --------
    >>> Message(600.0, "open", 0.06, 0.48, 26.4, 0.95).to_dict()["verdict"]
    'open'
    """

    time_s: float
    verdict: Verdict
    soc_arrival: float
    p_arrive: float
    speed_m_s: float | None = None
    p_at_speed: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values.

        Returns
        -------
        dict
            The fields by their names.

        Examples
        --------
        >>> Message(600.0, "arrives", 0.2, 0.99).to_dict()["speed_m_s"] is None
        True
        """
        return {name: getattr(self, name) for name in Message.__slots__}


@dataclass(frozen=True)
class Progress:
    """Displayed state of charge along the road, as forecast at departure and as forecast now.

    Attributes
    ----------
    distance_m : list of float
        Equally spaced distances since departure [m].
    planned : list of float
        Expected charge as forecast at departure.
    expected, low, high : list of float
        Expected charge as forecast now, with its central 90 % interval.

    Examples
    --------
    >>> import tripwatt as tw
    >>> forecast = tw.load_model().forecast(tw.sample_trips().trips[0])
    >>> progress = Progress.of(forecast, forecast)
    >>> progress.planned == progress.expected, len(progress.low) == len(progress.distance_m)
    (True, True)
    """

    distance_m: list[float]
    planned: list[float]
    expected: list[float]
    low: list[float]
    high: list[float]

    @classmethod
    def of(cls, departure: Forecast, now: Forecast) -> Progress:
        """Return the progress of a trip.

        Parameters
        ----------
        departure : Forecast
            Forecast of the trip before departure.
        now : Forecast
            The same forecast, updated on the way.

        Returns
        -------
        Progress
            `POINTS` distances.
        """
        distance_m, (low, expected, high) = now.along.distance_m, now.along.soc_band
        at_m = np.linspace(0.0, distance_m[-1], POINTS)
        curves = np.clip([departure.along.expected_soc, expected, low, high], 0.0, 1.0)
        return cls(at_m.tolist(), *(np.interp(at_m, distance_m, curve).tolist() for curve in curves))


class Companion:
    """Follows one trip by updated forecasts, and returns a message when the verdict changes.

    Parameters
    ----------
    departure : Forecast
        Forecast of the trip before departure.
    reserve : float
        Displayed state of charge to arrive with, 0 to 1.
    chance : float
        Required chance to arrive with the reserve, 0.5 to 0.999.

    Attributes
    ----------
    latest : Message or None
        The latest evaluation, also where it is no message; None before the first.

    Examples
    --------
    >>> import tripwatt as tw
    >>> trip = tw.sample_trips().trips[0]
    >>> companion = Companion(tw.load_model().forecast(trip))
    >>> samples = trip.samples[trip.samples["time_s"] <= 600.0]
    >>> companion.update(samples) is None
    True
    """

    def __init__(self, departure: Forecast, reserve: float = 0.1, probability: float = 0.95) -> None:
        self.departure = departure
        self.reserve = require_fraction("reserve", reserve)
        self.probability = require_fraction("probability", probability, 0.5, 0.999)
        self.latest: Message | None = None
        self._evaluated_s = self._message_s = -np.inf
        self._verdict: Verdict | None = None
        self._verdict = self._verdict_of(departure.p_arrive(reserve))

    def update(self, observed: pd.DataFrame, updated: Forecast | None = None) -> Message | None:
        """Evaluate the trip with the samples measured so far.

        Parameters
        ----------
        observed : DataFrame
            Samples since departure, as for `Forecast.update`.
        updated : Forecast, optional
            Forecast already updated with these samples, if there is one.

        Returns
        -------
        Message or None
            None if the verdict is the same as in the last message (at first, as before departure), if the last message is less than
            `QUIET_S` ago, or if the last evaluation is less than `EVERY_S` ago.

        Raises
        ------
        InvalidInput
            As in `Forecast.update`.
        """
        at_s = float(observed["time_s"].iloc[-1]) - self.departure.plan.start_s
        if at_s - self._evaluated_s < EVERY_S:
            return None
        self._evaluated_s = at_s
        forecast = updated or self.departure.update(observed)
        chance = forecast.p_arrive(self.reserve)
        verdict = self._verdict_of(chance)
        until_s = forecast.measured_until_s
        speeds = (None, None) if verdict == "arrives" else self._restoring_speed(observed, until_s)
        self.latest = Message(at_s, verdict, forecast.soc_arrival, chance, *speeds)
        if verdict == self._verdict or at_s - self._message_s < QUIET_S:
            return None
        self._message_s, self._verdict = at_s, verdict
        return self.latest

    def _verdict_of(self, chance: float) -> Verdict:
        """Return the verdict of a chance; the limits of the last verdict are wider by `MARGIN`."""
        margin = {v: MARGIN if self._verdict == v else 0.0 for v in ("arrives", "does_not_arrive")}
        if chance >= self.probability - margin["arrives"]:
            return "arrives"
        return "does_not_arrive" if chance <= 1.0 - self.probability + margin["does_not_arrive"] else "open"

    def _restoring_speed(self, observed: pd.DataFrame, at_s: float) -> tuple[float | None, float | None]:
        """Return the highest speed that restores the required chance and the chance with this speed, or None for both."""
        if self.departure.model is None:
            return None, None
        plan, forecast_again = self.departure.plan, forecasts_like(self.departure)
        ahead = plan.array("speed_m_s")[plan.array("time_s") - plan.array("time_s")[0] > at_s]
        for limit in limits_below(float(ahead.max(initial=0.0))):
            chance = forecast_again(cap_speed(plan, limit, at_s)).update(observed).p_arrive(self.reserve)
            if chance >= self.probability:
                return limit, chance
        return None, None
