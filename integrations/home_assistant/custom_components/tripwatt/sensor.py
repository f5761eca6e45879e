"""The figures of a car: those that the service also publishes over MQTT, and when to leave and to preheat."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from homeassistant.components.sensor import (
    SensorDeviceClass,
    SensorEntity,
    SensorEntityDescription,
    SensorStateClass,
)
from homeassistant.const import PERCENTAGE, UnitOfEnergy, UnitOfLength, UnitOfTime
from homeassistant.core import HomeAssistant
from homeassistant.helpers.entity_platform import AddConfigEntryEntitiesCallback

from .coordinator import CarState, TripwattEntry, parsed_time
from .entity import CarEntity, add_for_each_car

PARALLEL_UPDATES = 0


@dataclass(frozen=True, kw_only=True)
class CarSensorDescription(SensorEntityDescription):
    """A figure of a car."""

    value: Callable[[CarState], float | datetime | None]
    more: Callable[[CarState], Mapping[str, Any]] | None = None


def _at(document: Mapping[str, Any] | None, *path: str) -> Any:
    """A value inside of documents that may be missing."""
    value: Any = document
    for name in path:
        value = None if value is None else value.get(name)
    return value


def _figure(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _of_live(*path: str, factor: float = 1.0) -> Callable[[CarState], float | None]:
    return lambda car: _figure(_at(car.live, *path), factor)


def _of_need(name: str, factor: float = 1.0) -> Callable[[CarState], float | None]:
    return lambda car: _figure(_at(car.ahead.need, name), factor)


def _messages(answer: Mapping[str, Any] | None) -> list[str]:
    return [flag["message"] for flag in (answer or {}).get("flags", ())]


def _of_range(car: CarState) -> dict[str, Any]:
    """What the range counts from and down to, and what was assumed."""
    reach = car.ahead.reach or {}
    return {name: reach[name] for name in ("soc", "reserve") if name in reach} | {"flags": _messages(reach)}


def _need_in_words(car: CarState) -> dict[str, Any]:
    need = car.ahead.need or {}
    names = (
        "message",
        "kind",
        "usual_trip",
        "departs_at",
        "probability",
        "reserve",
        "charging_s",
        "wall_wh",
        "preheat",
        "temperature",
    )
    about = {name: need[name] for name in names if name in need}
    about["flags"] = _messages(need)
    return about if car.ahead.trip is None else about | {"trip": car.ahead.trip.title}


def _percent(
    key: str,
    value: Callable[[CarState], float | None],
    kind: SensorDeviceClass | None = None,
    digits: int = 0,
    more: Callable[[CarState], Mapping[str, Any]] | None = None,
) -> CarSensorDescription:
    return CarSensorDescription(
        key=key,
        translation_key=key,
        value=value,
        more=more,
        device_class=kind,
        state_class=SensorStateClass.MEASUREMENT,
        native_unit_of_measurement=PERCENTAGE,
        suggested_display_precision=digits,
    )


def _energy(key: str, value: Callable[[CarState], float | None]) -> CarSensorDescription:
    return CarSensorDescription(
        key=key,
        translation_key=key,
        value=value,
        device_class=SensorDeviceClass.ENERGY_STORAGE,
        state_class=SensorStateClass.MEASUREMENT,
        native_unit_of_measurement=UnitOfEnergy.KILO_WATT_HOUR,
        suggested_display_precision=1,
    )


def _duration(key: str, value: Callable[[CarState], float | None]) -> CarSensorDescription:
    return CarSensorDescription(
        key=key,
        translation_key=key,
        value=value,
        device_class=SensorDeviceClass.DURATION,
        state_class=SensorStateClass.MEASUREMENT,
        native_unit_of_measurement=UnitOfTime.MINUTES,
        suggested_display_precision=0,
    )


def _time(key: str, *path: str) -> CarSensorDescription:
    return CarSensorDescription(
        key=key,
        translation_key=key,
        value=lambda car: parsed_time(_at(car.ahead.need, *path)),
        device_class=SensorDeviceClass.TIMESTAMP,
    )


SENSORS: Final = (
    _percent("soc", _of_live("soc", factor=100.0), SensorDeviceClass.BATTERY),
    _energy("energy", _of_live("forecast", "energy_wh", factor=0.001)),
    _percent("arrival", _of_live("forecast", "soc_quantiles", "0.5", factor=100.0)),
    _percent("arrival_low", _of_live("forecast", "soc_quantiles", "0.05", factor=100.0)),
    _percent("arrival_high", _of_live("forecast", "soc_quantiles", "0.95", factor=100.0)),
    _percent("p_arrive", _of_live("forecast", "p_arrive", factor=100.0), digits=1),
    _percent("p_arrive_at_all", _of_live("forecast", "p_arrive_at_all", factor=100.0), digits=1),
    CarSensorDescription(
        key="range",
        translation_key="range",
        value=lambda car: _figure(_at(car.ahead.reach, "range_m"), 0.001),
        more=_of_range,
        device_class=SensorDeviceClass.DISTANCE,
        state_class=SensorStateClass.MEASUREMENT,
        native_unit_of_measurement=UnitOfLength.KILOMETERS,
        suggested_display_precision=0,
    ),
    _energy(
        "need",
        lambda car: _figure(
            _at(car.ahead.need, "energy_quantile_wh") or _at(car.ahead.need, "energy_wh"), 0.001
        ),
    ),
    _percent("soc_needed", _of_need("soc_needed", 100.0), more=_need_in_words),
    _energy("charge", _of_need("charge_wh", 0.001)),
    _duration("silence", lambda car: _figure(car.silence_s, 1.0 / 60.0)),
    _duration("charging", _of_need("charging_s", 1.0 / 60.0)),
    _time("departs_at", "departs_at"),
    _time("preheat_at", "preheat", "starts_at"),
)


async def async_setup_entry(
    hass: HomeAssistant, entry: TripwattEntry, async_add_entities: AddConfigEntryEntitiesCallback
) -> None:
    """Add the sensors of every car."""
    add_for_each_car(
        entry,
        async_add_entities,
        lambda coordinator, car: [CarSensor(coordinator, car, one) for one in SENSORS],
    )


class CarSensor(CarEntity, SensorEntity):
    """One figure of a car."""

    entity_description: CarSensorDescription

    @property
    def native_value(self) -> float | datetime | None:
        """The figure; None where it is not known."""
        return self.entity_description.value(self.state_of_car)

    @property
    def extra_state_attributes(self) -> Mapping[str, Any] | None:
        """What belongs to the figure."""
        more = self.entity_description.more
        return None if more is None or not self.available else more(self.state_of_car)
