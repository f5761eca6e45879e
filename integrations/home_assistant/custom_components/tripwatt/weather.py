"""The outside temperature of a weather entity: its forecast at a departure, else the one of now."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any, Final

from homeassistant.const import UnitOfTemperature
from homeassistant.core import HomeAssistant
from homeassistant.exceptions import HomeAssistantError
from homeassistant.util import dt as dt_util
from homeassistant.util.unit_conversion import TemperatureConverter

NEAR: Final = timedelta(hours=1)
"""A forecast that is further from the departure does not count."""


async def temperature_degc(hass: HomeAssistant, entity: str, at: datetime | None) -> float | None:
    """The temperature at a time, or now [°C]; None where the entity has none."""
    state = hass.states.get(entity)
    if state is None:
        return None
    value = state.attributes.get("temperature")
    if at is not None:
        value = await _forecast(hass, entity, at, value)
    unit = state.attributes.get("temperature_unit", UnitOfTemperature.CELSIUS)
    return (
        None
        if value is None
        else round(TemperatureConverter.convert(value, unit, UnitOfTemperature.CELSIUS), 1)
    )


async def _forecast(hass: HomeAssistant, entity: str, at: datetime, otherwise: float | None) -> float | None:
    """The hourly forecast that is nearest to a time, in the unit of the entity."""
    asked = {"entity_id": entity, "type": "hourly"}
    try:
        answer: Any = await hass.services.async_call(
            "weather", "get_forecasts", asked, blocking=True, return_response=True
        )
    except HomeAssistantError:  # the entity has none by the hour
        return otherwise
    hours = [
        (abs(time - at), row["temperature"])
        for row in (answer or {}).get(entity, {}).get("forecast", ())
        if (time := dt_util.parse_datetime(row["datetime"])) is not None
        and row.get("temperature") is not None
    ]
    away, value = min(hours, key=lambda hour: hour[0], default=(NEAR * 2, None))
    return value if away <= NEAR else otherwise
