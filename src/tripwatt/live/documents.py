"""What a car on the road is as plain values: the same over HTTP, over MQTT and on the page."""

from __future__ import annotations

import math
from typing import Any, Final, Literal, TypedDict

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting import Forecast

QUANTILES: Final = (0.05, 0.5, 0.95)
LOW, HIGH = f"{QUANTILES[0]:g}", f"{QUANTILES[-1]:g}"
"""Ends of the 90 % interval."""


class LiveForecast(TypedDict):
    """The forecast of a whole trip, given what was measured so far. Energies [Wh], states of charge 0 to 1."""

    energy_wh: float
    quantiles_wh: dict[str, float]
    soc_arrival: float
    soc_quantiles: dict[str, float]
    reserve: float
    p_arrive: float
    p_arrive_at_all: float
    measured_until_s: float
    distance_m: float


class LiveTripState(TypedDict):
    """The trip that a car is on: its departure [s since 1970], and what was driven of it."""

    departure_utc: float
    duration_s: float
    distance_m: float
    samples: int


class LiveState(TypedDict):
    """A car on the road; `trip` is None while it is on none."""

    vehicle: str
    seconds_since_message: float | None
    messages: dict[str, int]
    soc: float | None
    trip: LiveTripState | None


class LiveDocument(LiveState):
    """A car on the road with the forecast of its trip, and why the last messages are not in it."""

    plan: Literal["given", "usual"] | None
    usual_trip: str | None
    forecast: LiveForecast | None
    faults: list[dict[str, str]]


def live_forecast(forecast: Forecast, reserve: float) -> LiveForecast:
    """A forecast as plain values.

    Raises
    ------
    InvalidInput
        When a value is not finite: no car can drive the trip.
    """
    document: Any = {
        "energy_wh": forecast.energy_wh,
        "quantiles_wh": {f"{p:g}": forecast.quantile(p) for p in QUANTILES},
        "soc_arrival": forecast.soc_arrival,
        "soc_quantiles": {f"{p:g}": forecast.soc_quantile(p) for p in QUANTILES},
        "reserve": reserve,
        "p_arrive": forecast.p_arrive(reserve),
        "p_arrive_at_all": forecast.p_arrive(),
        "measured_until_s": forecast.measured_until_s,
        "distance_m": float(forecast.drive.distance_m[-1]),
    }
    values = [value for value in document.values() if isinstance(value, float)]
    if not math.isfinite(sum([*values, *document["quantiles_wh"].values()])):
        raise InvalidInput(Fault("no forecast", "trip", "implausible results", "a trip that a car can drive"))
    found: LiveForecast = document
    return found
