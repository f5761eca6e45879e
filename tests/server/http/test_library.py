"""Cars, routes and tables as the service tells them."""

from __future__ import annotations

import pytest

from tripwatt.physics.battery import usable_energy_wh
from tripwatt.server.http import library
from tripwatt.server.http.library import (
    describe_vehicle,
    example_summaries,
    examples,
    vehicles,
)
from tripwatt.server.http.problems import Problem
from tripwatt.vehicles import load_vehicle, vehicle_names


def test_the_cars_of_the_library() -> None:
    found = {row["name"]: row for row in vehicles()}
    assert list(found) == list(vehicle_names())
    car = load_vehicle("bmw_i3_60ah")
    assert found["bmw_i3_60ah"] == {
        "name": "bmw_i3_60ah",
        "title": car.title,
        "test_mass_kg": car.body.test_mass_kg,
        "usable_energy_wh": usable_energy_wh(car.battery),
        "has_climate": True,
        "anchor": car.anchor,
    }
    climates = {name: load_vehicle(name).climate is not None for name in found}
    assert {name: row["has_climate"] for name, row in found.items()} == climates


def test_a_car_is_described_with_its_certified_interval() -> None:
    car = load_vehicle("bmw_i3_60ah")
    found = describe_vehicle(car)
    assert (found["title"], found["test_mass_kg"]) == (car.title, car.body.test_mass_kg)
    assert found["wltp_low_kwh_per_100km"] < found["wltp_kwh_per_100km"] < found["wltp_high_kwh_per_100km"]


def test_an_example_without_its_samples() -> None:
    summaries = example_summaries()["examples"]
    assert [row["trip"] for row in summaries] == list(examples())
    assert {frozenset(library.example(row["trip"])) - frozenset(row) for row in summaries} == {
        frozenset({"request", "observed"})
    }
    with pytest.raises(Problem, match="unknown example"):
        library.example("none")


def test_examples_begin_with_the_charge_that_is_shown() -> None:
    found = examples()
    assert len(found) == 8
    for name, example in found.items():
        request, observed = example["request"], example["observed"]
        assert request["trip"] == example["trip"] == name
        assert 0.0 <= request["soc"] <= 1.0
        assert list(request["samples"])[:2] == ["time_s", "speed_m_s"]
        assert list(observed) == ["time_s", "voltage_v", "current_a", "bms_soc"]
        assert example["car"] == "bmw_i3_60ah"


def test_the_charge_of_an_example_is_the_first_measured_one_as_shown() -> None:
    from tripwatt.forecasting import load_model

    charge = load_model().fitted_parts("examples")[1].charge
    battery = load_vehicle("bmw_i3_60ah").battery
    for example in examples().values():
        managed = example["observed"]["bms_soc"][0]
        shown = battery.displayed_from_soc(managed) if charge is None else charge.displayed(managed)
        assert example["request"]["soc"] == min(max(float(shown), 0.0), 1.0)
        assert (
            example["observed"]["bms_soc"][1] is None or example["observed"]["bms_soc"][1] <= managed + 0.01
        )
