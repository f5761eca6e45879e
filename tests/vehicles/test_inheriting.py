"""What a car's file takes over from shared data and other cars."""

import copy
import itertools

import numpy as np
import pytest
from benchmarks.anchors import unanchored

from tripwatt.errors import Fault, InvalidInput
from tripwatt.vehicles import (
    load_vehicle,
    vehicle_from_document,
)
from tripwatt.vehicles.inheriting import bundled_document, bundled_files, inherit
from tripwatt.vehicles.loading import file_names
from tripwatt.vehicles.losses import motor_loss


def faults_of(error: pytest.ExceptionInfo[InvalidInput]) -> str:
    return str(error.value)


def test_scaled_losses_are_the_reference_at_equal_shares() -> None:
    # the i3 94 Ah has the motor of the reference itself
    reference, car = load_vehicle("bmw_i3_94ah").drivetrain, unanchored("hyundai_kona_64").drivetrain
    torque_ratio = car.motor_max_torque_nm / reference.motor_max_torque_nm
    speed_ratio = car.motor_max_speed_rad_s / reference.motor_max_speed_rad_s
    torque = np.array([5.0, 40.0, 120.0, 200.0])[:, None]
    speed = np.array([30.0, 300.0, 700.0, 1100.0])[None, :]
    theirs = motor_loss(torque, speed, reference) * torque_ratio * speed_ratio
    mine = motor_loss(torque * torque_ratio, speed * speed_ratio, car)
    np.testing.assert_allclose(mine, theirs, rtol=1e-9)


@pytest.mark.parametrize(
    ("section", "key"), [("drivetrain", "motor_max_speed_rad_s"), ("battery", "capacity_ah")]
)
def test_a_missing_entry_that_others_are_scaled_by_is_one_fault(section: str, key: str) -> None:
    document = copy.deepcopy(bundled_document("vw_id3"))
    del document[section][key]
    with pytest.raises(InvalidInput) as caught:
        vehicle_from_document(document, "car", "car.toml")
    assert [(f.what, f.allowed) for f in caught.value.faults] == [("missing entry", f"an entry {key!r}")]


def test_scaled_resistance_is_inverse_to_capacity() -> None:
    reference, car = load_vehicle("bmw_i3_94ah").battery, load_vehicle("vw_id3").battery
    np.testing.assert_allclose(
        np.array(car.resistance_ohm) * car.capacity_ah,
        np.array(reference.resistance_ohm) * reference.capacity_ah,
    )
    assert "bmw_i3_94ah" in load_vehicle("vw_id3").entries["battery.resistance_ohm"].estimated


def test_own_entries_win_over_inherited_ones() -> None:
    faults: list[Fault] = []
    own = {"value": 99.0, "unit": "W", "source": "here", "licence": "user"}
    document = {"extends": ["passenger_car", "nmc_cells"], "auxiliaries": {"base_load_w": own}}
    result = inherit(document, "car.toml", faults)
    assert not faults
    assert result["auxiliaries"]["base_load_w"] == own
    assert result["battery"]["ocv_v"]["source"].startswith("Collath")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"extends": ["pasenger_car"]},
            ("unknown base", "pasenger_car", "did you mean 'passenger_car'?"),
        ),
        ({"extends": 3}, ("unknown base", "got 3")),
        ({"scaled": {"motor_loses": "bmw_i3_60ah"}}, ("unknown key", "scaled.motor_loses", "motor_losses")),
        ({"scaled": {"motor_losses": "bmw_i4"}}, ("unknown base", "scaled.motor_losses", "bmw_i4")),
    ],
)
def test_wrong_inheritance_is_named(change: dict[str, object], words: tuple[str, ...]) -> None:
    with pytest.raises(InvalidInput) as error:
        vehicle_from_document({**bundled_document("vw_id3"), **change}, "car", "car.toml")
    assert all(word in faults_of(error) for word in words)


def test_bases_are_files_and_names_are_cars() -> None:
    shared = {"passenger_car", "nmc_cells", "lmo_cells", "lfp_cells"}
    shared |= {"permanent_magnet_motor", "induction_motor", "externally_excited_motor"}
    assert {*shared, *file_names()} == set(bundled_files())
    assert all(a < b for a, b in itertools.pairwise(bundled_files()))
