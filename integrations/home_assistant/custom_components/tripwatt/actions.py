"""The actions `plan` and `advise`, a journey of a car and what to do about it as a response, and `set_plan` for the next trip of a car."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Any, Final

import voluptuous as vol
from homeassistant.config_entries import ConfigEntryState
from homeassistant.const import ATTR_DEVICE_ID
from homeassistant.core import HomeAssistant, ServiceCall, ServiceResponse, SupportsResponse, callback
from homeassistant.exceptions import HomeAssistantError, ServiceValidationError
from homeassistant.helpers import config_validation as cv
from homeassistant.helpers import device_registry as dr
from homeassistant.util import dt as dt_util

from .client import ServiceAwayError, ServiceProblemError, TokenRefusedError
from .const import DOMAIN
from .coordinator import AIR, CarState, TripwattCoordinator
from .entity import device_of

PLAN: Final = "plan"
ADVISE: Final = "advise"
SET_PLAN: Final = "set_plan"

PLAN_FIELDS: Final = (
    "stops,reserve,verdict,arrives,p_arrive,soc_needed,leave,costs_wh,needs_motorway_speed,motorway_speed_m_s,"
    "motorway_duration_s,charging,flags,attribution"
)
"""What an automation reads of a journey: without the roads, which are long."""

FOR_A_MAP: Final = ("line", "course")
"""Fields of a plan of charging that only a map or a chart shows."""

_PERCENT = vol.All(vol.Coerce(float), vol.Range(0.0, 100.0))

_COMMON: Final = {
    vol.Required(ATTR_DEVICE_ID): cv.string,
    vol.Optional("soc"): _PERCENT,
    vol.Optional("reserve"): _PERCENT,
    vol.Optional("temperature"): vol.Coerce(float),
    vol.Optional("departs_at"): cv.datetime,
    vol.Optional("more", default=dict): dict,
}
_STOPS = vol.All(cv.ensure_list, [vol.Any(cv.string, dict)], vol.Length(1, 20))
PLAN_SCHEMA: Final = vol.Schema({**_COMMON, vol.Required("stops"): _STOPS})
ADVISE_SCHEMA: Final = vol.All(
    vol.Schema(
        {
            **_COMMON,
            vol.Exclusive("stops", "road"): _STOPS,
            vol.Exclusive("links", "road"): vol.All([dict], vol.Length(1)),
            vol.Optional("probability"): vol.All(vol.Coerce(float), vol.Range(50.0, 99.9)),
        }
    ),
    cv.has_at_least_one_key("stops", "links"),
)
SET_PLAN_SCHEMA: Final = vol.Schema(
    {**_COMMON, vol.Required("stops"): _STOPS, vol.Optional("destination"): cv.string}
)


@callback
def register_actions(hass: HomeAssistant) -> None:
    """Register the actions, once."""
    if hass.services.has_service(DOMAIN, PLAN):
        return
    hass.services.async_register(
        DOMAIN, PLAN, _plan, schema=PLAN_SCHEMA, supports_response=SupportsResponse.ONLY
    )
    hass.services.async_register(
        DOMAIN, ADVISE, _advise, schema=ADVISE_SCHEMA, supports_response=SupportsResponse.ONLY
    )
    hass.services.async_register(DOMAIN, SET_PLAN, _set_plan, schema=SET_PLAN_SCHEMA)


@callback
def remove_actions(hass: HomeAssistant) -> None:
    """Remove the actions."""
    for name in (PLAN, ADVISE, SET_PLAN):
        hass.services.async_remove(DOMAIN, name)


def _car_of(call: ServiceCall) -> tuple[TripwattCoordinator, CarState]:
    """The car of a call, and who asks for it.

    Raises
    ------
    ServiceValidationError
        For a device that is none of ours, and a car whose service is not there.
    """
    device = dr.async_get(call.hass).async_get(call.data[ATTR_DEVICE_ID])
    entries = [] if device is None else call.hass.config_entries.async_entries(DOMAIN)
    for entry in entries:
        if device is None or entry.entry_id not in device.config_entries:
            continue
        if entry.state is not ConfigEntryState.LOADED:
            raise ServiceValidationError(translation_domain=DOMAIN, translation_key="not_loaded")
        coordinator: TripwattCoordinator = entry.runtime_data
        for name, car in coordinator.data.items():
            if device_of(entry, name) in device.identifiers:
                return coordinator, car
    raise ServiceValidationError(translation_domain=DOMAIN, translation_key="no_such_car")


def _stop(hass: HomeAssistant, stop: Any) -> Any:
    """A stop of a request: an entity with a position, such as zone.work, is its coordinates."""
    state = hass.states.get(stop) if isinstance(stop, str) else None
    if state is None or "latitude" not in state.attributes:
        return stop
    latitude, longitude = (state.attributes[name] for name in ("latitude", "longitude"))
    return {"latitude_deg": latitude, "longitude_deg": longitude, "name": state.name}


def _request(call: ServiceCall, coordinator: TripwattCoordinator, car: CarState) -> dict[str, Any]:
    """The fields of a request, in units of the service; one stop alone is where to go from home."""
    data = call.data
    request = dict(car.known)
    if "temperature" in data or coordinator.has_weather:
        request[AIR] = data.get("temperature")  # else that of the car
    for ours, theirs in (("soc", "soc"), ("reserve", "reserve"), ("probability", "probability")):
        if ours in data:
            request[theirs] = data[ours] / 100.0
    if "departs_at" in data:
        leaves = data["departs_at"]
        local = leaves if leaves.tzinfo else leaves.replace(tzinfo=dt_util.get_default_time_zone())
        request["departs_at"] = local.isoformat()
    if "stops" in data:
        stops = [_stop(call.hass, stop) for stop in data["stops"]]
        request["stops"] = [coordinator.home, *stops] if len(stops) == 1 else stops
    if "links" in data:
        request["links"] = data["links"]
    more: dict[str, Any] = data["more"]
    return request | more


async def _asked(coordinator: TripwattCoordinator, answering: Awaitable[Any]) -> dict[str, Any]:
    """The answer of the service.

    Raises
    ------
    ServiceValidationError
        When the service refuses the request, with its faults.
    HomeAssistantError
        When it does not answer, or refuses the token.
    """
    try:
        answer: dict[str, Any] = await answering
    except ServiceProblemError as problem:
        raise ServiceValidationError(
            translation_domain=DOMAIN,
            translation_key="refused",
            translation_placeholders={"why": str(problem)},
        ) from problem
    except TokenRefusedError as error:
        coordinator.config_entry.async_start_reauth(coordinator.hass)
        raise HomeAssistantError(translation_domain=DOMAIN, translation_key="token_refused") from error
    except ServiceAwayError as error:
        raise HomeAssistantError(
            translation_domain=DOMAIN, translation_key="away", translation_placeholders={"why": str(error)}
        ) from error
    return answer


async def _plan(call: ServiceCall) -> ServiceResponse:
    """A journey of a car."""
    coordinator, car = _car_of(call)
    body = _request(call, coordinator, car)
    journey = await _asked(coordinator, coordinator.client.post("/v1/journeys", body, fields=PLAN_FIELDS))
    if journey.get("charging"):
        kept = {name: value for name, value in journey["charging"].items() if name not in FOR_A_MAP}
        journey["charging"] = kept
    return journey


async def _advise(call: ServiceCall) -> ServiceResponse:
    """What to do about a journey or a road of a car."""
    coordinator, car = _car_of(call)
    path = "/v1/journeys/advice" if "stops" in call.data else "/v1/advice"
    return await _asked(coordinator, coordinator.client.post(path, _request(call, coordinator, car)))


async def _set_plan(call: ServiceCall) -> None:
    """Give a car the plan of its next trip."""
    coordinator, car = _car_of(call)
    plan = _request(call, coordinator, car)
    plan.pop("car", None)  # the plan is of the car that it is given to
    if "destination" in call.data:
        plan["destination"] = call.data["destination"]
    await _asked(coordinator, coordinator.client.put(f"/v1/live/{car.live['car']}/plan", plan))
    await coordinator.async_request_refresh()
