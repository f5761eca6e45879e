"""Overrides of a car's values and their short names."""

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.vehicles import (
    ALIASES,
    load_vehicle,
    parse_overrides,
)
from tripwatt.vehicles.vehicle import SECTIONS


def faults_of(error: pytest.ExceptionInfo[InvalidInput]) -> str:
    return str(error.value)


# ------------------------------------------------------------------------------------------------ overrides
def test_short_names_reach_entries_that_exist() -> None:
    known = {f"{section}.{name}" for section, part in SECTIONS.items() for name in part.__dataclass_fields__}
    assert set(ALIASES.values()) <= known


def test_overrides_with_short_names_change_the_car_and_say_so() -> None:
    car = load_vehicle("peugeot_e_208", overrides=parse_overrides(["mass=1700", "c_d=0.3", "payload=150"]))
    assert car.body.test_mass_kg == 1850.0
    assert car.road_load.drag_coefficient == 0.3
    assert car.entries["body.curb_mass_kg"].source == "given by the caller"


def test_override_without_effect_is_refused() -> None:
    with pytest.raises(InvalidInput) as error:
        load_vehicle("nissan_leaf_40", overrides={"c_d": 0.3})
    assert "override has no effect" in faults_of(error)
    every = {"c_d": 0.28, "area": 2.3, "c_rr": 0.009, "road_load": "coefficients"}
    assert load_vehicle("nissan_leaf_40", overrides=every).road_load.drag_area_m2 == pytest.approx(0.644)


def test_every_wrong_override_is_named_at_once() -> None:
    with pytest.raises(InvalidInput) as error:
        parse_overrides(["mas=3", "mass", "c_d=1", "c_d=2"])
    text = faults_of(error)
    assert len(error.value.faults) == 3
    assert "did you mean 'mass'?" in text
    assert "override given twice" in text
