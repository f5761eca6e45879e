"""The trips of a car: those of the calendar that was chosen for it, each with what it needs."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from homeassistant.components.calendar import CalendarEntity, CalendarEvent
from homeassistant.core import HomeAssistant
from homeassistant.exceptions import HomeAssistantError
from homeassistant.helpers.entity import EntityDescription
from homeassistant.helpers.entity_platform import AddConfigEntryEntitiesCallback
from homeassistant.util import dt as dt_util

from .client import ServiceAwayError, ServiceProblemError, TokenRefusedError
from .const import CONF_CALENDARS, DOMAIN, MAX_NEEDS
from .coordinator import TripwattEntry
from .entity import CarEntity, add_for_each_car
from .trips import CalendarTrip, trips_between

PARALLEL_UPDATES = 0

TRIPS = EntityDescription(key="trips", translation_key="trips")


async def async_setup_entry(
    hass: HomeAssistant, entry: TripwattEntry, async_add_entities: AddConfigEntryEntitiesCallback
) -> None:
    """Add a calendar for each car that has one to read."""
    sources = entry.options.get(CONF_CALENDARS, {})
    add_for_each_car(
        entry,
        async_add_entities,
        lambda coordinator, car: [CarCalendar(coordinator, car, TRIPS)] if car in sources else [],
    )


def shown(trip: CalendarTrip, need: dict[str, Any] | None) -> CalendarEvent:
    """A trip as an event; its title has the charge to leave with, where that is known."""
    soc = None if need is None else need.get("soc_needed")
    return CalendarEvent(
        start=trip.starts_at,
        end=trip.ends_at,
        summary=trip.title if soc is None else f"{trip.title} ({100.0 * soc:.0f} %)",
        description=None if need is None else need.get("message"),
        location=trip.place or None,
    )


class CarCalendar(CarEntity, CalendarEntity):
    """The trips of one car."""

    @property
    def event(self) -> CalendarEvent | None:
        """The next trip."""
        ahead = self.state_of_car.ahead
        return None if ahead.trip is None else shown(ahead.trip, ahead.need)

    async def async_get_events(
        self, hass: HomeAssistant, start_date: datetime, end_date: datetime
    ) -> list[CalendarEvent]:
        """The trips between two times; of the next ones, what they need.

        Raises
        ------
        HomeAssistantError
            When the service or the calendar does not answer.
        """
        source = self.coordinator.config_entry.options[CONF_CALENDARS][self.car]
        trips = await trips_between(hass, source, start_date, end_date)
        ahead = [trip for trip in trips if trip.starts_at > dt_util.utcnow()][:MAX_NEEDS]
        try:
            needs = {trip: await self.coordinator.need(self.state_of_car, trip) for trip in ahead}
        except (ServiceAwayError, ServiceProblemError, TokenRefusedError) as error:
            raise HomeAssistantError(
                translation_domain=DOMAIN,
                translation_key="away",
                translation_placeholders={"why": str(error)},
            ) from error
        return [shown(trip, needs.get(trip)) for trip in trips]
