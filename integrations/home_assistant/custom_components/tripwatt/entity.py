"""What all entities of a car share."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from homeassistant.core import callback
from homeassistant.helpers.device_registry import DeviceEntryType, DeviceInfo
from homeassistant.helpers.entity import Entity, EntityDescription
from homeassistant.helpers.entity_platform import AddConfigEntryEntitiesCallback
from homeassistant.helpers.update_coordinator import CoordinatorEntity

from .const import DOMAIN
from .coordinator import CarState, TripwattCoordinator, TripwattEntry


def device_of(entry: TripwattEntry, car: str) -> tuple[str, str]:
    """What identifies the device of a car: cars of two services may have one name."""
    return DOMAIN, f"{entry.entry_id}_{car}"


class CarEntity(CoordinatorEntity[TripwattCoordinator]):
    """An entity of one car.

    Parameters
    ----------
    coordinator : TripwattCoordinator
    car : str
        Name of the car.
    description : EntityDescription
    """

    _attr_has_entity_name = True

    def __init__(self, coordinator: TripwattCoordinator, car: str, description: EntityDescription) -> None:
        super().__init__(coordinator)
        entry = coordinator.config_entry
        self.car = car
        self.entity_description = description
        self._attr_unique_id = f"{entry.entry_id}_{car}_{description.key}"
        self._attr_device_info = DeviceInfo(
            identifiers={device_of(entry, car)},
            name=car,
            manufacturer="tripwatt",
            entry_type=DeviceEntryType.SERVICE,
        )

    @property
    def available(self) -> bool:
        """Whether the service answers and still has the car."""
        return super().available and self.car in self.coordinator.data

    @property
    def state_of_car(self) -> CarState:
        """The car as the service has it."""
        return self.coordinator.data[self.car]


def add_for_each_car(
    entry: TripwattEntry,
    add: AddConfigEntryEntitiesCallback,
    made: Callable[[TripwattCoordinator, str], Iterable[Entity]],
) -> None:
    """Add the entities of the cars that are there, and later those of cars that come."""
    coordinator = entry.runtime_data
    there: set[str] = set()

    @callback
    def add_new() -> None:
        new = sorted(set(coordinator.data) - there)
        there.update(new)
        there.intersection_update(coordinator.data)
        add([entity for car in new for entity in made(coordinator, car)])

    entry.async_on_unload(coordinator.async_add_listener(add_new))
    add_new()
