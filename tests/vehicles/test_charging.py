"""Charging curves of cars."""

import tomllib
from importlib import resources
from typing import Any

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.vehicles import (
    load_vehicle,
    vehicle_from_document,
    vehicle_names,
)
from tripwatt.vehicles.parts import Charging


@pytest.fixture
def document() -> dict[str, Any]:
    text = (resources.files("tripwatt.vehicles") / "data" / "bmw_i3_60ah.toml").read_text("utf-8")
    return tomllib.loads(text)


def faults_of(document: dict[str, Any], **more: Any) -> list[str]:
    with pytest.raises(InvalidInput) as caught:
        vehicle_from_document(document, "car", "car.toml", **more)
    return [str(fault) for fault in caught.value.faults]


def entry(value: object, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit, "source": "a chart", "licence": "user"}


@pytest.mark.parametrize(
    ("soc", "power", "word"),
    [
        ([0.0, 1.0], [50_000.0, 20_000.0, 10_000.0], "differ in length"),
        ([0.0, 0.9], [50_000.0, 20_000.0], "does not cover"),
        ([0.1, 1.0], [50_000.0, 20_000.0], "does not cover"),
        ([0.0, 0.5, 0.5, 1.0], [50_000.0] * 4, "does not increase"),
        ([0.0, 1.0], [50_000.0, 0.0], "out of range"),
    ],
)
def test_a_charging_curve_goes_from_empty_to_full(document, soc, power, word) -> None:
    document["charging"] = {
        "displayed_soc": entry(soc, "1"),
        "power_w": entry(power, "W"),
        "alternating_power_w": entry(7_400.0, "W"),
    }
    (fault,) = [f for f in faults_of(document) if "charging" in f]
    assert word in fault


def test_a_charging_curve_is_part_of_a_car(document) -> None:
    assert vehicle_from_document(document, "car", "car.toml").charging is None
    document["charging"] = {
        "displayed_soc": entry([0.0, 0.6, 1.0], "1"),
        "power_w": entry([100_000.0, 80_000.0, 10_000.0], "W"),
        "alternating_power_w": entry(7_400.0, "W"),
    }
    found = vehicle_from_document(document, "car", "car.toml").charging
    assert found == Charging((0.0, 0.6, 1.0), (100_000.0, 80_000.0, 10_000.0), 7_400.0)
    del document["charging"]["power_w"]
    assert any("missing entry" in f and "power_w" in f for f in faults_of(document))


def test_curves_of_the_library_are_of_their_own_cars() -> None:
    """Written out from the public list, in percent of the display and kilowatts."""
    zoe = load_vehicle("renault_zoe_ze50_r135").charging
    assert zoe == Charging((0.0, 0.52, 0.8, 1.0), (41_000.0, 46_000.0, 27_000.0, 22_000.0), 22_000.0)
    known = [car for name in vehicle_names() if (car := load_vehicle(name)).charging is not None]
    assert len(known) == 51
    for car in known:
        assert car.entries["charging.power_w"].licence == "MIT"
        assert 20_000.0 <= max(car.charging.power_w) <= 350_000.0
        assert 3_000.0 < car.charging.alternating_power_w <= 22_000.0
