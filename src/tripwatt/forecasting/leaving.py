"""The charge to leave with: a forecast from another charge, and the charge that is needed to arrive."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from tripwatt.errors import require_type
from tripwatt.forecasting.document import LeaveWith
from tripwatt.forecasting.forecast import NOT_MEASURED, Forecast, with_empty_flag
from tripwatt.forecasting.measured import ChargeReading
from tripwatt.trips import Departure, Plan
from tripwatt.trips.columns import require_fraction
from tripwatt.trips.messages import leave_in_words

SOC_PRECISION: Final = 1e-7
"""Precision of the charge to leave with."""
MAX_SECANTS: Final = 8
"""Secant steps of `charge_with_spare`, after which the interval is halved."""
OF_CHARGE: Final = frozenset({"soc_assumed", "battery_empty", "battery_full", "battery_over_voltage"})
"""Flags that depend on the charge at departure."""


def leaving_with(forecast: Forecast, soc: float) -> Forecast:
    """Forecast a trip again from another charge.

    The charge changes the voltage, the resistance and the energy that the battery recovers. On the way, the measurements are kept,
    and the battery is taken as charged to `soc` at the time of the last reading.

    Parameters
    ----------
    forecast : Forecast
        Forecast of the trip.
    soc : float
        Displayed state of charge, 0 to 1.

    Returns
    -------
    Forecast
        Forecast of the same trip from the new charge.

    Raises
    ------
    InvalidInput
        If the charge is outside of 0 to 1.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
    >>> tw.leaving_with(forecast, 0.6).soc_arrival < forecast.soc_arrival
    True
    """
    departure = Departure(soc=soc)  # checks it
    require_type("forecast", forecast, Forecast, "a Forecast")
    if forecast.model is None or forecast.measured is not NOT_MEASURED:
        charged = ChargeReading(forecast.along.read_s, soc, displayed=True, charged=True)
        return with_empty_flag(replace(forecast, measured=replace(forecast.measured, anchor=charged)))
    again = forecast.model.forecast(forecast.plan.with_departure(departure))
    kept = (flag for flag in forecast.flags if flag.code not in OF_CHARGE)
    flags = tuple(dict.fromkeys((*kept, *again.flags)))
    return replace(again, state_sd_wh=forecast.state_sd_wh, flags=flags)


def soc_needed(forecast: Forecast, reserve: float = 0.1, probability: float = 0.95) -> float:
    """Displayed state of charge to leave with, so that the car arrives with a reserve with a given probability.

    `leaving_with` this charge, the forecast has this probability; the result does not depend on the charge of the plan. The search
    takes two forecasts in the median.

    Parameters
    ----------
    forecast : Forecast
        Forecast of the trip.
    reserve : float
        Displayed state of charge to arrive with, 0 to 1.
    probability : float
        Probability of arriving with the reserve, 0.5 to 1.

    Returns
    -------
    float
        Displayed charge, 0 to 1. Returns 0 if any charge is enough, such as on a way down. If a full battery is not enough, returns 1
        plus the charge that is missing.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
    >>> leave = tw.soc_needed(forecast, reserve=0.2, probability=0.95)
    >>> round(tw.leaving_with(forecast, leave).p_arrive(0.2), 3)
    0.95
    """
    reserve = require_fraction("reserve", reserve)
    probability = require_fraction("probability", probability, 0.5)
    require_type("forecast", forecast, Forecast, "a Forecast")
    planned = forecast.plan.departure.soc if forecast.measured is NOT_MEASURED else None

    def spare(soc: float) -> float:
        left = forecast if soc == planned else leaving_with(forecast, soc)
        return left.along.spare(reserve, probability)

    return charge_with_spare(spare, 0.5 if planned is None else planned)


def leave_with(forecast: Forecast, reserve: float, probability: float) -> LeaveWith:
    """Return the charge to leave with as plain values, with a sentence in English: see `soc_needed`."""
    needed = soc_needed(forecast, reserve, probability)
    sentence = leave_in_words(needed, reserve, probability)
    return {"soc_needed": needed, "reserve": reserve, "probability": probability, "message": sentence}


def forecasts_like(forecast: Forecast) -> Callable[[Plan], Forecast]:
    """Return a function that forecasts other plans with the model of a forecast.

    The error of the weather forecast that was added to `forecast` is added to the other forecasts as well.
    """
    model = forecast.model
    assert model is not None, "a forecast that was put together has no model"
    added = forecast.state_sd_wh**2 - model.forecast(forecast.plan).state_sd_wh ** 2

    def make(plan: Plan) -> Forecast:
        made = model.forecast(plan)
        return replace(made, state_sd_wh=math.sqrt(made.state_sd_wh**2 + max(added, 0.0)))

    return make


def charge_with_spare(spare: Callable[[float], float], near: float = 0.5) -> float:
    """Find the charge, 0 to 1, at which the function `spare` is zero; `near` is the first guess.

    Returns 0 if `spare` is not negative at 0, and ``1 - spare(1)``, above 1, if it is negative at 1. More charge leaves about as
    much more spare, so the secant method needs few steps. If a secant step leaves the interval of the root, the interval is halved.

    Examples
    --------
    >>> round(charge_with_spare(lambda soc: soc**2 - 0.25), 5)
    0.5
    >>> charge_with_spare(lambda soc: soc + 0.1), charge_with_spare(lambda soc: soc - 1.5)
    (0.0, 1.5)
    """
    low, high, soc, slope = 0.0, 1.0, near, 1.0
    before: tuple[float, float] | None = None
    for step in itertools.count():
        left = spare(soc)
        if (soc == 0.0 and left >= 0.0) or 0.0 <= left <= 2.0 * SOC_PRECISION:
            return soc
        if soc == 1.0 and left < 0.0:
            return 1.0 - left
        low, high = (soc, high) if left < 0.0 else (low, soc)
        if high - low <= SOC_PRECISION:
            return high
        if before is not None and before[0] != soc:
            slope = (left - before[1]) / (soc - before[0])
        before = soc, left
        has_guess = slope > 0.0 and step < MAX_SECANTS
        guess = soc - (left - SOC_PRECISION) / slope if has_guess else math.nan
        is_end = (low == 0.0 and guess <= low) or (high == 1.0 and guess >= high)
        soc = min(max(guess, low), high) if is_end or low < guess < high else 0.5 * (low + high)
    raise AssertionError("unreachable: the interval is halved until it is narrow")
