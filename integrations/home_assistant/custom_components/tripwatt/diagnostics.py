"""What helps to find a fault, without what is nobody's business."""

from __future__ import annotations

from typing import Any, Final

from homeassistant.components.diagnostics import async_redact_data
from homeassistant.const import CONF_TOKEN, CONF_URL
from homeassistant.core import HomeAssistant

from .const import CONF_CALENDARS
from .coordinator import TripwattEntry

SECRET: Final = {
    CONF_TOKEN,
    CONF_URL,
    CONF_CALENDARS,
    "usual_trip",
    "departs_at",
    "starts_at",
}
"""The token, addresses, and when somebody leaves the house."""


async def async_get_config_entry_diagnostics(hass: HomeAssistant, entry: TripwattEntry) -> dict[str, Any]:
    """The entry, and the cars as the service gave them."""
    coordinator = entry.runtime_data
    cars = {
        name: {
            "live": car.live,
            "described": car.described,
            "need": car.ahead.need,
            "range": car.ahead.reach,
            "has_trip": car.ahead.trip is not None,
        }
        for name, car in (coordinator.data or {}).items()
    }
    document = {
        "data": dict(entry.data),
        "options": dict(entry.options),
        "answers": coordinator.last_update_success,
        "cars": cars,
    }
    return async_redact_data(document, SECRET)
