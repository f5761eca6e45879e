"""Describe a forecast in a few sentences for a driver, in metric units and with numbers from the forecast alone."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import tripwatt as tw
from tripwatt.errors import counted, percent
from tripwatt.trips.showing import in_kwh, period
from tripwatt.units import M_S_PER_KM_H

if TYPE_CHECKING:
    from tripwatt.roads.journey import ChargingPlan
    from tripwatt.trips.plan import KnownClimb

NINE_IN_TEN: Final = 0.9
"""Level of the interval that sentences call "9 in 10"."""


def forecast_in_words(forecast: tw.Forecast, subject: str = "This trip") -> str:
    """Describe the energy of a forecast, its 90 % interval and the charge at arrival, or where the battery runs empty.

    Parameters
    ----------
    forecast : Forecast
        Forecast before departure or on the way.
    subject : str
        Name of the trip at the start of the sentence.

    Returns
    -------
    str
        For example: "This trip, 12.3 km in 24 min at 3 °C: 2.1 kWh; 9 in 10 such trips take 1.8 to 2.5 kWh. Leaving with
        80 % you arrive with 69 % (66 to 71 %)."
    """
    low, high = forecast.interval(NINE_IN_TEN)
    about = (
        f"{subject}, {_how_far(forecast)}: {in_kwh(forecast.energy_wh)} kWh; "
        f"9 in 10 such trips take {in_kwh(low)} to {in_kwh(high)} kWh."
    )
    return f"{about} {_arrival(forecast)}"


def _how_far(forecast: tw.Forecast) -> str:
    """Describe length, duration and outside temperature; on the way also the time driven."""
    along = forecast.to_frame().iloc[-1]
    text = f"{along['distance_m'] / 1000.0:.1f} km in {period(along['time_s'])}"
    ambient = forecast.plan.departure.ambient_temperature_degc
    if ambient is not None:
        text += f" at {round(ambient)} °C"
    if forecast.measured_until_s > 0.0:
        text += f", {period(forecast.measured_until_s)} of it driven"
    return text


def _arrival(forecast: tw.Forecast) -> str:
    """Describe the displayed charge at departure and at arrival, or where the battery runs empty."""
    along = forecast.to_frame()
    start = forecast.plan.departure.soc or float(along["displayed_soc"].iloc[0])
    end, low, high = along[["displayed_soc", "displayed_soc_low", "displayed_soc_high"]].iloc[-1]
    arrives = f"The probability to arrive is {chance_to_arrive(forecast)}."
    if forecast.along.missing_wh[1] > 0.0:
        least, missing, most = forecast.along.missing_wh
        kilometres = (None if m is None else f"{m / 1000.0:.0f}" for m in forecast.along.empty_at_m)
        early, expected, late = kilometres
        between = f"{early} to {late} km" if late else f"{early} km or later"
        text = (
            f"Leaving with {percent(start)} the battery is empty after {expected} km ({between}): the trip takes {in_kwh(missing)} kWh "
            f"({in_kwh(least)} to {in_kwh(most)} kWh) more than it holds. {arrives}"
        )
        return f"{text} At best you arrive with {percent(high)}." if percent(high) != "0 %" else text
    text = f"Leaving with {percent(start)} you arrive with {percent(end)} ({percent(low)[:-2]} to {percent(high)})."
    # the battery may be empty before the end: the interval of the charge at the end says nothing of that
    return f"{text} {arrives}" if low <= 0.0 or forecast.p_arrive(0.0) < 0.95 else text


def journey_in_words(journey: tw.Journey) -> list[str]:
    """Describe a journey for a driver, in a sentence each: arrival, charge to leave with, speed, stops to charge."""
    forecast, reserve = journey.forecast, percent(journey.reserve)
    title = " to ".join(place.title for place in journey.stops)
    sentences = [*unknown_climb_in_words(forecast, journey.reserve), forecast_in_words(forecast, title)]
    turns_m = () if journey.charging else journey.roads[0].road.stop_position_m
    for place, at_m in zip(journey.stops[1:], turns_m, strict=False):
        sentences.append(f"At {place.title} you have {percent(journey.roads[0].soc_at(at_m))}.")
    sentences.append(journey.leave)
    with_stops = journey.soc_needed_with_stops
    if with_stops is not None and with_stops <= 1.0:
        sentences.append(f"With stops to charge, leave with at least {math.ceil(100.0 * with_stops)} %.")
    advice = journey.speed
    if advice is not None and advice.speed_m_s is not None:
        speed = round(advice.speed_m_s / M_S_PER_KM_H)
        sentences.append(f"Drive at most {speed} km/h on motorways to arrive with {reserve}.")
    if journey.charging is not None:
        sentences += _plan_in_words(journey.charging, title, journey.verdict.departs_at)
    return sentences


def _plan_in_words(plan: ChargingPlan, title: str, leaves: dt.datetime | None = None) -> list[str]:
    """Describe a journey with its stops to charge: a sentence on the whole, then one for each stop."""
    low, high = plan.soc_interval
    sentences = [
        f"{title} with {counted(len(plan.stops), 'stop')} to charge: {period(plan.duration_s)}, "
        f"{period(plan.charging_s)} of it at stations. You arrive with {percent(plan.soc_arrival)} "
        f"({percent(low)[:-2]} to {percent(high)}); the probability to have {percent(plan.reserve)} at every stop and at the "
        f"end is {chance(plan.p_reserve)}."
    ]
    return sentences + [stop.in_words(leaves) for stop in plan.stops]


def unknown_climb_in_words(forecast: tw.Forecast, reserve: float) -> list[str]:
    """Say what unknown heights of the road may change; returns no sentence if they are known or cannot change the arrival."""
    per_metre, climb = forecast.soc_per_climb_m, forecast.climb_to(reserve)
    if per_metre is None or climb is None:
        return []
    more = " of climb" if forecast.plan.climb is None else " of climb beyond these heights"
    change = f"; with {climb:,.0f} m{more} you arrive with {percent(reserve)}" if climb > 0.0 else ""
    return [
        f"The heights of the road are unknown. {_climb_in_words(forecast.plan.climb)}"
        f"Each 100 m{more} takes {1e4 * per_metre:.1f} points{change}."
    ]


def _climb_in_words(known: KnownClimb | None) -> str:
    if known is None:
        return ""
    top_m, end_m = known.climb_m.max(), known.climb_m[-1]
    return f"By places beside it, it rises to {top_m:+z,.0f} m and ends at {end_m:+z,.0f} m, seen from the start. "


def begins(before_s: float, departs_at: dt.datetime | None) -> str:
    """Say when an action on the plug begins, by clock if the time of departure is known.

    Examples
    --------
    >>> begins(1200.0, None), begins(1200.0, dt.datetime(2026, 1, 5, 7, 30))
    ('20 min before you leave', 'start at 07:10')
    """
    if departs_at is None:
        return f"{period(before_s)} before you leave"
    return f"start at {departs_at - dt.timedelta(seconds=before_s):%H:%M}"


UNCERTAIN: Final = 0.99
"""Highest probability shown if an unknown climb could change the arrival: logs do not show how often roads climb that far."""


def chance_to_arrive(forecast: tw.Forecast, reserve: float = 0.0) -> str:
    """Say the probability to arrive with a reserve; at most `UNCERTAIN` is stated if an unknown climb could change the arrival."""
    probability = forecast.p_arrive(reserve)
    if probability > UNCERTAIN and forecast.climb_to(reserve) is not None:
        return f"over {percent(UNCERTAIN)}, unless it climbs far"
    return chance(probability)


def chance(probability: float) -> str:
    """Format a probability in percent; values near 0 and 1 are not shown as certain.

    Examples
    --------
    >>> chance(0.9996), chance(0.934), chance(0.0)
    ('over 99.9 %', '93.4 %', 'under 0.1 %')
    """
    if probability > 0.999:
        return "over 99.9 %"
    return "under 0.1 %" if probability < 0.001 else percent(probability, 1)


def by_cause(causes: Mapping[str, float]) -> dict[str, float]:
    """Energies [Wh] by the name of their cause; what was not delivered only if there is some."""
    from tripwatt.physics.chain import CAUSE_NAMES

    return {CAUSE_NAMES.get(k, k).replace("_", " "): wh for k, wh in causes.items() if wh or k != "shortfall"}


def change(value: Mapping[str, Any], key: str, sign: str = "+") -> str:
    """Format the entry `key` of a car's learned change, such as the change or its uncertainty, in the unit of the change.

    Examples
    --------
    >>> change({"change": 0.05, "unit": "1"}, "change"), change({"sd": 0.3, "unit": "kW"}, "sd", sign="")
    ('+5.0 %', '0.30 kW')
    """
    return f"{value[key]:{sign}.2f} kW" if value["unit"] == "kW" else percent(value[key], 1, sign)
