"""Trips of a calendar: its events, their place, and the kilometres that they name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from homeassistant.core import HomeAssistant
from homeassistant.exceptions import HomeAssistantError
from homeassistant.util import dt as dt_util

from .const import LOOK_AHEAD

KILOMETRES: Final = re.compile(r"(?<![\w.,])(\d{1,4}(?:[.,]\d)?)\s*km\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class CalendarTrip:
    """An event of a calendar that is a trip: the car leaves when it starts."""

    starts_at: datetime
    ends_at: datetime
    title: str
    place: str
    """empty where the event has none"""
    distance_km: float | None
    """of the words "80 km" in its title or description"""


def kilometres(text: str) -> float | None:
    """The first distance that a text names [km]."""
    named = KILOMETRES.search(text)
    return None if named is None else float(named[1].replace(",", "."))


def trip_of(event: dict[str, Any]) -> CalendarTrip | None:
    """The trip of an event; None for one of whole days, which has no time of departure."""
    starts_at, ends_at = (dt_util.parse_datetime(event[name]) for name in ("start", "end"))
    if starts_at is None or ends_at is None or "T" not in event["start"]:
        return None
    title = event.get("summary") or ""
    distance_km = kilometres(f"{title}\n{event.get('description') or ''}")
    return CalendarTrip(starts_at, ends_at, title, event.get("location") or "", distance_km)


async def trips_between(
    hass: HomeAssistant, calendar: str, start: datetime, end: datetime
) -> list[CalendarTrip]:
    """The trips of a calendar that are not over at the start, the first one first.

    Raises
    ------
    HomeAssistantError
        When there is no such calendar, or it does not answer.
    """
    answer: Any = await hass.services.async_call(
        "calendar",
        "get_events",
        {
            "entity_id": calendar,
            "start_date_time": start.isoformat(),
            "end_date_time": end.isoformat(),
        },
        blocking=True,
        return_response=True,
    )
    events = (answer or {}).get(calendar, {}).get("events", ())
    trips = [trip for event in events if (trip := trip_of(event)) is not None]
    return sorted(trips, key=lambda trip: trip.starts_at)


async def next_trip(hass: HomeAssistant, calendar: str) -> CalendarTrip | None:
    """The next trip of a calendar that has not begun; None where it has none, or is not there yet."""
    now = dt_util.utcnow()
    if hass.states.get(calendar) is None:
        return None
    try:
        trips = await trips_between(hass, calendar, now, now + LOOK_AHEAD)
    except HomeAssistantError:
        return None
    return next((trip for trip in trips if trip.starts_at > now), None)
