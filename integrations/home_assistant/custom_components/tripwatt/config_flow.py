"""The dialogues: the service, a new token or address, and what is asked of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import voluptuous as vol
from homeassistant.config_entries import ConfigFlow, ConfigFlowResult, OptionsFlow
from homeassistant.const import CONF_TOKEN, CONF_URL
from homeassistant.core import callback
from homeassistant.helpers import selector
from homeassistant.helpers.aiohttp_client import async_get_clientsession

from .client import (
    NoServiceError,
    ServiceAwayError,
    ServiceClient,
    ServiceProblemError,
    TokenRefusedError,
    service_url,
)
from .const import (
    CONF_CALENDARS,
    CONF_INTERVAL,
    CONF_PLUG,
    CONF_PROBABILITY,
    CONF_RESERVE,
    CONF_WEATHER,
    DOMAIN,
    INTERVAL_S,
    PROBABILITY,
)
from .coordinator import TripwattEntry

PASSWORD = selector.TextSelector(selector.TextSelectorConfig(type=selector.TextSelectorType.PASSWORD))
ADDRESS = selector.TextSelector(selector.TextSelectorConfig(type=selector.TextSelectorType.URL))
SERVICE_SCHEMA = vol.Schema({vol.Required(CONF_URL): ADDRESS, vol.Optional(CONF_TOKEN): PASSWORD})
TOKEN_SCHEMA = vol.Schema({vol.Required(CONF_TOKEN): PASSWORD})


def _number(low: float, high: float, unit: str) -> vol.All:
    chosen = selector.NumberSelectorConfig(
        min=low, max=high, unit_of_measurement=unit, mode=selector.NumberSelectorMode.BOX
    )
    return vol.All(selector.NumberSelector(chosen), vol.Coerce(float))


class TripwattConfigFlow(ConfigFlow, domain=DOMAIN):
    """Add a service, give it another token, or find it at another address."""

    VERSION = 1

    async def _errors(self, url: str, token: str) -> dict[str, str]:
        """Why a service cannot be used, by field; empty where it can."""
        try:
            client = ServiceClient(async_get_clientsession(self.hass), url, token)
            await client.get("/v1/live")
        except ValueError:
            return {CONF_URL: "invalid_url"}
        except NoServiceError:
            return {"base": "no_service"}
        except ServiceAwayError:
            return {"base": "cannot_connect"}
        except TokenRefusedError:
            return {CONF_TOKEN: "invalid_auth" if token else "token_needed"}
        except ServiceProblemError as problem:
            return {"base": "no_cars" if problem.kind == "no-live" else "no_service"}
        return {}

    async def async_step_user(self, user_input: dict[str, Any] | None = None) -> ConfigFlowResult:
        """Ask for a service."""
        errors: dict[str, str] = {}
        if user_input is not None:
            errors = await self._errors(user_input[CONF_URL], user_input.get(CONF_TOKEN, ""))
            if not errors:
                url = service_url(user_input[CONF_URL])
                await self.async_set_unique_id(str(url))
                self._abort_if_unique_id_configured()
                title = f"{url.host}:{url.port}{url.path.rstrip('/')}"
                return self.async_create_entry(title=title, data={**user_input, CONF_URL: str(url)})
        schema = self.add_suggested_values_to_schema(SERVICE_SCHEMA, user_input)
        return self.async_show_form(step_id="user", data_schema=schema, errors=errors)

    async def async_step_reconfigure(self, user_input: dict[str, Any] | None = None) -> ConfigFlowResult:
        """Ask for another address of the same service."""
        entry = self._get_reconfigure_entry()
        errors: dict[str, str] = {}
        if user_input is not None:
            errors = await self._errors(user_input[CONF_URL], user_input.get(CONF_TOKEN, ""))
            if not errors:
                url = str(service_url(user_input[CONF_URL]))
                if url != entry.unique_id:
                    await self.async_set_unique_id(url)
                    self._abort_if_unique_id_configured()
                data = {**user_input, CONF_URL: url}
                return self.async_update_reload_and_abort(entry, unique_id=url, data=data)
        schema = self.add_suggested_values_to_schema(SERVICE_SCHEMA, user_input or entry.data)
        return self.async_show_form(step_id="reconfigure", data_schema=schema, errors=errors)

    async def async_step_reauth(self, entry_data: Mapping[str, Any]) -> ConfigFlowResult:
        """The service refused the token."""
        return await self.async_step_reauth_confirm()

    async def async_step_reauth_confirm(self, user_input: dict[str, Any] | None = None) -> ConfigFlowResult:
        """Ask for another token."""
        entry = self._get_reauth_entry()
        errors: dict[str, str] = {}
        if user_input is not None:
            errors = await self._errors(entry.data[CONF_URL], user_input[CONF_TOKEN])
            if not errors:
                return self.async_update_reload_and_abort(entry, data_updates=user_input)
        return self.async_show_form(step_id="reauth_confirm", data_schema=TOKEN_SCHEMA, errors=errors)

    @staticmethod
    @callback
    def async_get_options_flow(config_entry: TripwattEntry) -> TripwattOptionsFlow:
        """The dialogue of the options."""
        return TripwattOptionsFlow()


class TripwattOptionsFlow(OptionsFlow):
    """What is asked of the service, and the calendar of each car."""

    def __init__(self) -> None:
        self.chosen: dict[str, Any] = {}

    async def async_step_init(self, user_input: dict[str, Any] | None = None) -> ConfigFlowResult:
        """How often, how sure, and the plug at home."""
        if user_input is not None:
            self.chosen = user_input
            return await self.async_step_calendars()
        schema = vol.Schema(
            {
                vol.Required(CONF_INTERVAL, default=INTERVAL_S): _number(5, 600, "s"),
                vol.Required(CONF_PROBABILITY, default=PROBABILITY): _number(50, 99, "%"),
                vol.Optional(CONF_RESERVE): _number(0, 100, "%"),
                vol.Optional(CONF_PLUG): _number(0, 400_000, "W"),
                vol.Optional(CONF_WEATHER): selector.EntitySelector(
                    selector.EntitySelectorConfig(domain="weather")
                ),
            }
        )
        shown = self.add_suggested_values_to_schema(schema, self.config_entry.options)
        return self.async_show_form(step_id="init", data_schema=shown)

    async def async_step_calendars(self, user_input: dict[str, Any] | None = None) -> ConfigFlowResult:
        """The calendar with the trips of each car, by the name of the car."""
        entry: TripwattEntry = self.config_entry
        before = entry.options.get(CONF_CALENDARS, {})
        cars = (
            sorted({*entry.runtime_data.data, *before}) if hasattr(entry, "runtime_data") else sorted(before)
        )
        if user_input is not None or not cars:
            return self.async_create_entry(data={**self.chosen, CONF_CALENDARS: user_input or {}})
        calendar = selector.EntitySelector(selector.EntitySelectorConfig(domain="calendar"))
        schema = vol.Schema({vol.Optional(car): calendar for car in cars})
        shown = self.add_suggested_values_to_schema(schema, before)
        return self.async_show_form(step_id="calendars", data_schema=shown)
