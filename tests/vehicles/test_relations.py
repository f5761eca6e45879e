"""Values that are inside of their bounds, but that no car has together."""

import contextlib
import dataclasses

import pytest
from tests.support.cars import LEVEL_ROAD, extreme_cars

import tripwatt as tw
from tripwatt.certification import describe_car
from tripwatt.errors import InvalidInput
from tripwatt.population.adapting import without_trips
from tripwatt.trips import Departure
from tripwatt.vehicles import load_vehicle, vehicle_names
from tripwatt.vehicles.relations import relation_faults, table_faults
from tripwatt.vehicles.vehicle import SECTIONS

TOGETHER = "no car has these values together"


def test_no_car_of_the_library_is_refused() -> None:
    """Also with the presets, and with what a fit or a test may change by a fifth."""
    for name in vehicle_names():
        for preset in ("default", "paper"):
            car = load_vehicle(name, preset)
            parts = {section: getattr(car, section) for section in SECTIONS}
            assert [*table_faults(parts, name), *relation_faults(parts, name)] == []
            body, motor = parts["body"], parts["drivetrain"]
            for factor in (0.8, 1.25):
                parts["body"] = dataclasses.replace(body, curb_mass_kg=factor * body.curb_mass_kg)
                parts["drivetrain"] = dataclasses.replace(
                    motor, motor_loss_factor=factor * motor.motor_loss_factor
                )
                assert list(relation_faults(parts, name)) == []


@pytest.mark.parametrize(
    ("given", "fields", "words"),
    [
        ({"battery.capacity_ah": 2000.0}, ("battery.capacity_ah", "body.curb_mass_kg"), "2 to 200 Wh/kg"),
        ({"battery.cells_in_series": 1000.0}, ("battery.cells_in_series", "battery.ocv_v"), "24 to 1500 V"),
        (
            {"battery.resistance_ohm": (0.5, 0.5), "battery.resistance_soc": (0.0, 1.0)},
            ("battery.resistance_ohm", "body.curb_mass_kg"),
            "battery power over mass",
        ),
        (
            {"road_load.coastdown_c_n_s2_m2": 15.0},
            ("road_load.coastdown_c_n_s2_m2", "road_load.coastdown_air_density_kg_m3"),
            "0 to 12 m²",
        ),
        (
            {"road_load.coastdown_b_n_s_m": -20.0},
            ("road_load.coastdown_a_n", "road_load.coastdown_b_n_s_m", "drivetrain.gear_ratio"),
            "rolling drag over weight at top speed: -",
        ),
        (
            {"road_load.coastdown_mass_kg": 60_000.0},
            ("road_load.coastdown_mass_kg", "body.curb_mass_kg"),
            "0.25 to 4 1",
        ),
        (
            {"drivetrain.motor_max_power_w": 4000.0},
            ("drivetrain.motor_max_power_w", "body.curb_mass_kg"),
            "motor power over mass",
        ),
        (
            {"drivetrain.gear_ratio": 0.1},
            ("drivetrain.motor_max_torque_nm", "drivetrain.gear_ratio", "drivetrain.wheel_radius_m"),
            "force at the wheels",
        ),
        (
            {"drivetrain.gear_ratio": 50.0},
            ("drivetrain.motor_max_speed_rad_s", "drivetrain.gear_ratio", "drivetrain.wheel_radius_m"),
            "45 to 540 km/h",
        ),
        (
            {"drivetrain.motor_max_power_w": 2e6},
            (
                "drivetrain.motor_max_power_w",
                "drivetrain.motor_max_torque_nm",
                "drivetrain.motor_max_speed_rad_s",
            ),
            "motor power over largest torque",
        ),
        (
            {"climate.heater_max_heat_w": 60_000.0},
            ("climate.heater_max_heat_w", "climate.heater_efficiency", "auxiliaries.base_load_w"),
            "besides driving",
        ),
        (
            {"tyres.temperature_coefficient_per_k": 0.05, "tyres.cold_excess": 2.0},
            ("tyres.temperature_coefficient_per_k", "tyres.reference_temperature_degc", "tyres.cold_excess"),
            "0 to 5 1",
        ),
        (
            {"drivetrain.characteristic_current_a": 1e5},
            ("drivetrain.characteristic_current_a", "drivetrain.torque_constant_nm_a"),
            "efficiency at the top speed",
        ),
        (
            {"road_load.coastdown_a_n": 5000.0},
            ("road_load.coastdown_a_n", "road_load.coastdown_b_n_s_m", "road_load.coastdown_mass_kg"),
            "rolling drag over weight at top speed",
        ),
        (
            {
                "body.curb_mass_kg": 20_000.0,
                "road_load.coastdown_mass_kg": 7000.0,
                "road_load.coastdown_a_n": 4500.0,
                "drivetrain.motor_max_torque_nm": 4000.0,
                "drivetrain.motor_max_power_w": 400_000.0,
                "drivetrain.torque_constant_nm_a": 10.0,
            },
            ("body.curb_mass_kg", "road_load.coastdown_a_n"),
            "at 36 km/h",
        ),
        (
            {"battery.displayed_zero_soc": 0.5, "battery.displayed_full_soc": 0.5},
            ("battery.displayed_zero_soc",),
            "below",
        ),
    ],
)
def test_a_relation_that_no_car_has_names_its_entries(given, fields, words) -> None:
    with pytest.raises(InvalidInput) as caught:
        load_vehicle("vw_id3", overrides=given)
    found = [fault for fault in caught.value.faults if words in str(fault)]
    assert len(found) == 1
    assert all(field in found[0].where for field in fields), found[0].where
    assert found[0].got
    assert found[0].allowed
    assert found[0].what in (TOGETHER, "wrong order")


@pytest.mark.parametrize(
    "given",
    [
        {"body.curb_mass_kg": 2500.0},
        {"drivetrain.motor_max_power_w": 20_000.0},
        {"auxiliaries.base_load_w": 3000.0},
        {"battery.capacity_ah": 40.0},
        {"tyres.cold_excess": 0.0},
        {"regeneration.fraction": 0.0},
    ],
)
def test_unusual_cars_are_cars(given) -> None:
    assert load_vehicle("vw_id3", overrides=given).name == "vw_id3"


def test_a_light_quadricycle_can_be_described() -> None:
    car = describe_car(mass_kg=474, usable_battery_kwh=6.1, motor_power_kw=13)
    assert car.body.curb_mass_kg == 474.0
    assert describe_car(mass_kg=485, usable_battery_kwh=5.5, motor_power_kw=6).body.curb_mass_kg == 485.0


def test_figures_of_a_described_car_that_contradict_each_other_are_named() -> None:
    with pytest.raises(InvalidInput) as caught:
        describe_car(mass_kg=6000, usable_battery_kwh=300, motor_power_kw=5)
    assert [fault.where for fault in caught.value.faults] == ["mass_kg and motor_power_kw"] * 2
    with pytest.raises(
        InvalidInput, match=r"mass_kg and usable_battery_kwh: got battery energy over mass: 794 Wh/kg"
    ):
        describe_car(mass_kg=400, usable_battery_kwh=300)


def test_no_car_that_is_accepted_takes_what_physics_forbids() -> None:
    """33 km of level road with extreme values: never below 0, never above what a truck and trailer takes."""
    model, plan = tw.load_model(), tw.read_route(LEVEL_ROAD)
    departure = Departure(soc=0.9, ambient_temperature_degc=5.0)
    accepted = 0
    for name, values in extreme_cars(150, seed=7):
        found = None
        with contextlib.suppress(InvalidInput):
            found = without_trips(model, load_vehicle(name, overrides=values)).forecast(plan, departure)
        if found is not None:
            accepted += 1
            assert 0.0 < found.energy_wh < 100_000.0, (name, values)
    assert accepted > 40
