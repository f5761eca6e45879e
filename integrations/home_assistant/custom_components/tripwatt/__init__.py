"""tripwatt in Home Assistant: the cars of a service, their next trips, and actions that plan and advise."""

from __future__ import annotations

from homeassistant.const import Platform
from homeassistant.core import HomeAssistant
from homeassistant.helpers import config_validation as cv
from homeassistant.helpers.device_registry import DeviceEntry
from homeassistant.helpers.typing import ConfigType

from .actions import register_actions, remove_actions
from .const import DOMAIN
from .coordinator import TripwattCoordinator, TripwattEntry
from .entity import device_of

CONFIG_SCHEMA = cv.config_entry_only_config_schema(DOMAIN)

PLATFORMS = (Platform.CALENDAR, Platform.SENSOR)


async def async_setup(hass: HomeAssistant, config: ConfigType) -> bool:
    """Register the actions: automations that name them are valid while the service is away."""
    register_actions(hass)
    return True


async def async_setup_entry(hass: HomeAssistant, entry: TripwattEntry) -> bool:
    """Follow the cars of one service."""
    register_actions(hass)
    coordinator = TripwattCoordinator(hass, entry)
    await coordinator.async_config_entry_first_refresh()
    entry.runtime_data = coordinator
    await hass.config_entries.async_forward_entry_setups(entry, PLATFORMS)
    entry.async_on_unload(entry.add_update_listener(_reload))
    entry.async_create_background_task(hass, coordinator.listen(), "tripwatt: stream")
    return True


async def _reload(hass: HomeAssistant, entry: TripwattEntry) -> None:
    """Take changed options."""
    await hass.config_entries.async_reload(entry.entry_id)


async def async_unload_entry(hass: HomeAssistant, entry: TripwattEntry) -> bool:
    """Leave the service."""
    return await hass.config_entries.async_unload_platforms(entry, PLATFORMS)


async def async_remove_entry(hass: HomeAssistant, entry: TripwattEntry) -> None:
    """Leave nothing behind: the actions go with the last service."""
    if not hass.config_entries.async_entries(DOMAIN):
        remove_actions(hass)


async def async_remove_config_entry_device(
    hass: HomeAssistant, entry: TripwattEntry, device: DeviceEntry
) -> bool:
    """Whether the device of a car may be removed by hand: when the service has the car no more."""
    return not any(device_of(entry, car) in device.identifiers for car in entry.runtime_data.data)
