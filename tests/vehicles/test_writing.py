"""A car as a document and as text, and back."""

import dataclasses
import json

import pytest
from tests.support.cars import some_cars

from tripwatt.vehicles import (
    Vehicle,
    load_vehicle,
    render_vehicle,
    vehicle_document,
    vehicle_from_document,
)


@pytest.mark.parametrize("name", some_cars(6))
def test_a_written_car_is_read_back(name: str, tmp_path) -> None:
    car = load_vehicle(name)
    path = tmp_path / f"{name}.toml"
    path.write_text(render_vehicle(car), encoding="utf-8")
    again = load_vehicle(path)
    assert again == car
    assert again.entries == car.entries


@pytest.fixture(scope="module")
def car():
    return load_vehicle("bmw_i3_60ah", overrides={"mass": 1300.0})


def again(car: Vehicle) -> Vehicle:
    document = json.loads(json.dumps(vehicle_document(car)))
    return dataclasses.replace(vehicle_from_document(document, car.name, "test"), preset=car.preset)


@pytest.mark.parametrize("name", some_cars(20))
def test_every_car_comes_back(name: str) -> None:
    for preset in ("default", "paper"):
        car = load_vehicle(name, preset)
        assert again(car) == car
        assert again(car).entries == car.entries


def test_a_car_changed_after_loading_comes_back_as_changed(car) -> None:
    changed = dataclasses.replace(
        car,
        auxiliaries=dataclasses.replace(car.auxiliaries, base_load_w=411.0),
        battery=dataclasses.replace(car.battery, capacity_ah=55.5),
        climate=None,
    )
    assert again(changed) == changed
    assert again(changed).entries["auxiliaries.base_load_w"].source == "set after the car was loaded"
    assert again(changed).entries["auxiliaries.base_load_w"].licence == "user"
    assert again(changed).entries["body.driver_mass_kg"] == car.entries["body.driver_mass_kg"]
    bolt = load_vehicle("chevrolet_bolt")  # its capacity is on the displayed scale
    lighter = dataclasses.replace(bolt, body=dataclasses.replace(bolt.body, curb_mass_kg=1500.0))
    assert again(lighter) == lighter
    wider = dataclasses.replace(bolt, battery=dataclasses.replace(bolt.battery, displayed_full_soc=0.98))
    assert again(wider) == wider
