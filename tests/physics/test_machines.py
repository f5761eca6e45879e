"""Losses of induction and externally excited machines: the best flux, its limits, and the values by hand."""

from __future__ import annotations

import dataclasses
import math
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tools.data import machines

from tripwatt.arrays import FloatArray
from tripwatt.vehicles import Drivetrain, load_vehicle
from tripwatt.vehicles.losses import motor_loss

CARS = {"induction": "audi_e_tron_55", "externally_excited": "bmw_ix3", "permanent_magnet": "vw_id4_pro"}


def plain(**values: float | str) -> Drivetrain:
    """100 Nm need 100 A at full flux, which lose 3/2 0.1 Ohm 100² A² = 1500 W; the field loses 600 W; no iron, no inverter."""
    nothing = dict.fromkeys(
        (
            "iron_loss_linear",
            "iron_loss_quadratic",
            "iron_loss_torque_exponent",
            "inverter_fixed_loss_w",
            "inverter_voltage_drop_v",
            "inverter_resistance_ohm",
        ),
        0.0,
    )
    own: dict[str, float | str] = {
        "machine": "induction",
        "torque_constant_nm_a": 1.0,
        "phase_resistance_ohm": 0.1,
        "field_loss_w": 600.0,
        "field_weakening_speed_rad_s": 500.0,
    }
    changes = {**nothing, **own, **values}
    return dataclasses.replace(load_vehicle("bmw_i3_60ah").drivetrain, **changes)  # type: ignore[arg-type]


def at(torque: float, speed: float, drivetrain: Drivetrain) -> float:
    return float(motor_loss(np.array([torque]), np.array([speed]), drivetrain)[0])


@pytest.mark.parametrize(
    ("torque", "speed", "expected"),
    [
        (0.0, 100.0, 0.0),
        (20.0, 100.0, 2.0 * math.sqrt(60.0 * 600.0)),  # copper 60 W at full flux: equal parts are best
        (-20.0, 100.0, 2.0 * math.sqrt(60.0 * 600.0)),
        (100.0, 100.0, 1500.0 + 600.0),  # more than full flux would be best
        (20.0, 2000.0, 60.0 * 16.0 + 600.0 / 16.0),  # a quarter of the flux at four times the base speed
        (20.0, 0.0, 2.0 * math.sqrt(60.0 * 600.0)),
    ],
)
def test_values_by_hand(torque: float, speed: float, expected: float) -> None:
    assert at(torque, speed, plain()) == pytest.approx(expected, rel=1e-12)


def test_iron_and_inverter_by_hand() -> None:
    """At 100 rad/s iron loses 1 W s 100 + 0.05 W s2 100² = 600 W at full flux; half of the flux needs twice the current."""
    machine = plain(
        iron_loss_linear=1.0,
        iron_loss_quadratic=0.05,
        inverter_fixed_loss_w=40.0,
        inverter_voltage_drop_v=2.0,
    )
    share = (60.0 / 1200.0) ** 0.25
    expected = 2.0 * math.sqrt(60.0 * 1200.0) + 40.0 + 2.0 * 20.0 / share
    assert at(20.0, 100.0, machine) == pytest.approx(expected, rel=1e-12)


@given(torque=st.floats(1.0, 400.0), speed=st.floats(1.0, 1500.0), flux=st.floats(0.05, 1.0))
def test_no_other_flux_loses_less(torque: float, speed: float, flux: float) -> None:
    machine = plain(iron_loss_quadratic=0.01)
    flux = min(flux, 500.0 / speed)
    copper, field = 0.15 * torque**2, 600.0 + 0.01 * speed**2
    assert at(torque, speed, machine) <= (copper / flux**2 + field * flux**2) * (1.0 + 1e-12)


@pytest.mark.parametrize("kind", CARS)
@given(speed=st.floats(0.0, 1500.0), torque=st.floats(1.0, 300.0))
def test_more_torque_loses_more(kind: str, speed: float, torque: float) -> None:
    drivetrain = load_vehicle(CARS[kind]).drivetrain
    low, high = at(torque, speed, drivetrain), at(1.1 * torque, speed, drivetrain)
    assert 0.0 < low < high


@pytest.mark.parametrize("kind", CARS)
def test_the_table_names_the_type(kind: str) -> None:
    assert load_vehicle(CARS[kind]).drivetrain.machine == kind


def test_induction_keeps_its_efficiency_at_light_load_and_high_speed() -> None:
    """Magnets have to be weakened there, an induction machine just takes less flux."""
    torque, speed = np.array([0.05]), np.array([1.0])
    loss: dict[str, FloatArray] = {}
    for kind in ("induction", "permanent_magnet"):
        loss[kind] = machines.loss_at(torque, speed, load_vehicle(CARS[kind]).drivetrain)
    assert loss["induction"][0] < loss["permanent_magnet"][0]


def test_the_shared_files_are_what_the_benchmark_writes() -> None:
    values = machines.fitted(machines.INDUCTION)
    for name, text in (
        ("induction_motor", machines.induction_toml(values)),
        ("externally_excited_motor", machines.excited_toml(values)),
    ):
        kept = tomllib.loads((machines.SHARED / f"{name}.toml").read_text(encoding="utf-8"))["drivetrain"]
        for key, entry in tomllib.loads(text)["drivetrain"].items():
            if key != "machine":  # values that no point depends on end wherever the search ended
                assert kept[key]["value"] == pytest.approx(entry["value"], rel=0.01, abs=0.01), (name, key)


def test_each_induction_machine_is_predicted_from_the_others() -> None:
    """Loss at light load within 25 %, in the median over the points of its map."""
    for name in machines.INDUCTION:
        others = {other: machine for other, machine in machines.INDUCTION.items() if other != name}
        torque, speed, loss, _ = machines.shares({name: machines.INDUCTION[name]}).T
        light = torque < machines.LIGHT
        found = machines.loss_at(torque, speed, machines.drivetrain(machines.fitted(others)))
        assert abs(float(np.median((found / loss)[light])) - 1.0) < 0.25, name


def test_a_point_of_a_published_map() -> None:
    """Westinghouse at 4000 rpm and 40 lbf ft, 54.2 Nm: 91 %."""
    torque, speed, loss = machines.published("induction_75_kw").T
    point = np.argmin(np.abs(torque - 54.2) + np.abs(speed - 418.9))
    assert loss[point] == pytest.approx((1.0 / 0.91 - 1.0) * 54.2 * 418.9, rel=1e-3)


def test_the_car_with_induction_machines_meets_its_certificate() -> None:
    """Before anchoring within 8 % in the mean, where the map of magnets missed 24 %."""
    from benchmarks.anchors import unanchored
    from tools.data.anchoring import certified_figures

    from tripwatt.certification.consumption import errors

    car = unanchored("audi_e_tron_55")
    assert abs(float(errors(car, certified_figures("audi_e_tron_55", car)).mean())) < 0.08
