"""Cars without the values that a data set gave."""

import pytest

from tripwatt.vehicles import load_vehicle, vehicle_names, without_data
from tripwatt.vehicles.without import names_data


@pytest.mark.parametrize("name", vehicle_names())
def test_every_value_of_a_data_sets_logs_has_another_without_it(name: str) -> None:
    car = load_vehicle(name)
    logged = {key for key, entry in car.entries.items() if names_data(entry, "tum")}
    assert "climate.sensor_minimum_degc" in logged or "climate.cooler_cop" in logged
    bare = without_data(car, "tum")
    assert not any(names_data(entry, "tum") for entry in bare.entries.values())
    differ = {key for key, entry in bare.entries.items() if entry.value != car.entries[key].value}
    assert differ == logged
    for key in logged:
        section, _, field = key.partition(".")
        assert getattr(getattr(bare, section), field) == bare.entries[key].value
        assert bare.entries[key].unit == car.entries[key].unit
    assert without_data(bare, "tum") is bare
    assert without_data(car, "ved") is car
