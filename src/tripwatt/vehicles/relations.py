"""Checks of relations between values of a car that are each within bounds, but impossible together.

The limits leave room around every road vehicle from a light quadricycle to a truck and trailer of 60 t. They do not judge
whether a car is likely.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from tripwatt.errors import Fault
from tripwatt.units import (
    DRY_AIR_GAS_CONSTANT_J_KG_K,
    GRAVITY_M_S2,
    M_S_PER_KM_H,
    SEA_LEVEL_PRESSURE_PA,
    SEA_LEVEL_TEMPERATURE_K,
    SECONDS_PER_HOUR,
)
from tripwatt.vehicles.losses import motor_loss
from tripwatt.vehicles.parts import Battery

POWER_W_KG: Final = (5.0, math.inf)
"""Power of motor and battery over mass: 5 kW/t are required of trucks with trailers (Directive 97/27/EC, annex I, 7.10)."""

FORCE_OF_WEIGHT: Final = (0.05, math.inf)
"""Force at the wheels over weight: a car that cannot start on 5 % can use no ordinary road. Trucks with trailers start on
12 % (Regulation (EU) 1230/2012, annex I, part A, 5); the torque of a described car is that of a class and may be too low."""

TOP_SPEEDS_KM_H: Final = (45.0, 540.0)
"""Speed at the highest motor speed: that of a light quadricycle (Regulation (EU) 168/2013) to above the fastest cars."""

DRAG_AREAS_M2: Final = (0.0, 12.0)
"""Up to twice the 5 to 6 m² of tractors with semi-trailers (Regulation (EU) 2017/2400)."""

ROLLING: Final = (0.0, 0.1)
"""Rolling and driveline drag over weight at top speed: up to that of loose sand."""

TEST_MASSES: Final = (0.25, 4.0)
"""Mass of the coast-down over that of the car; the difference is load."""

PEAK_EFFICIENCY: Final = (0.5, 1.0)
"""Efficiency of motor and inverter at peak power. The least of the library is 0.75."""

BATTERY_WH_KG: Final = (2.0, 200.0)
"""Energy of the battery over the mass of the car: plug-in hybrids have 3 Wh/kg, cars of the library up to 50, and half
of a car made of cells of 400 Wh/kg would have 200."""

PACK_V: Final = (24.0, 1500.0)
"""Mean voltage of the battery: UN Regulation 100 covers up to 1500 V."""

TYRE_FACTORS: Final = (0.0, 5.0)
"""Rolling resistance of a cold tyre at `COLD_DEGC` over that of a warm one. Cars have 1.7."""

COLD_DEGC: Final = -20.0

MAX_LOAD_W: Final = 20_000.0
"""Largest electric power besides driving of a car of up to 3.5 t; for heavier cars it grows with the mass."""

LEVEL_ROAD_WH_KM: Final = (0.0, 3000.0)
"""Consumption on a level road at 36 or 90 km/h: up to twice that of a loaded truck of 40 t."""

Relation = tuple[str, float, tuple[float, float], str]
"""What is compared, its value, the smallest and the largest value of a car, and their unit."""


class _Traced:
    """A part of a car that notes which of its entries are read, so that a fault names the entries of its relation."""

    def __init__(self, section: str, part: object, read: dict[str, None]) -> None:
        self._section, self._part, self._read = section, part, read

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(type(self._part), name)
        if isinstance(attribute, property):  # it reads entries of its own
            return attribute.__get__(self)
        self._read[f"{self._section}.{name}"] = None
        return getattr(self._part, name)


def table_faults(parts: Mapping[str, Any], where: str) -> Iterator[Fault]:
    """Yield the faults of the tables of a car, and of pairs of values in the wrong order. Arguments as in `relation_faults`."""
    tables = [("battery", "ocv_soc", "ocv_v"), ("battery", "resistance_soc", "resistance_ohm")]
    tables += [] if parts["charging"] is None else [("charging", "displayed_soc", "power_w")]
    for section, grid, values in tables:
        x, y = getattr(parts[section], grid), getattr(parts[section], values)
        place = f"{where}, {section}.{grid}"
        if len(x) != len(y):
            got = f"{len(x)} and {len(y)} values"
            yield Fault("tables differ in length", f"{place} and {values}", got, "equal numbers of values")
        if any(b <= a for a, b in itertools.pairwise(x)):
            yield Fault("table does not increase", place, str(list(x)), "increasing values")
        elif section == "charging" and (x[0], x[-1]) != (0.0, 1.0):
            yield Fault("table does not cover the display", place, str(list(x)), "values from 0 to 1")
    battery: Battery = parts["battery"]
    if any(b < a for a, b in itertools.pairwise(battery.ocv_v)):
        yield Fault("table decreases", f"{where}, battery.ocv_v", "a falling voltage", "rising with soc")
    if battery.min_cell_voltage_v >= battery.ocv_v[0]:
        got, place = f"{battery.min_cell_voltage_v:g} V", f"{where}, battery.min_cell_voltage_v"
        yield Fault("cell voltage limit too high", place, got, f"below {battery.ocv_v[0]:g} V of ocv_v")
    pairs = (
        ("battery", "displayed_zero_soc", "displayed_full_soc"),
        ("regeneration", "zero_speed_m_s", "full_speed_m_s"),
        ("regeneration", "full_soc", "zero_soc"),
        ("regeneration", "zero_temperature_degc", "full_temperature_degc"),
        ("climate", "fresh_air_low_w_k", "fresh_air_high_w_k"),
    )
    for section, low, high in pairs:
        if parts[section] is not None and getattr(parts[section], low) >= getattr(parts[section], high):
            got = f"{getattr(parts[section], low):g} and {getattr(parts[section], high):g}"
            yield Fault("wrong order", f"{where}, {section}.{low} and {high}", got, f"{low} below {high}")


def relation_faults(parts: Mapping[str, Any], where: str) -> Iterator[Fault]:
    """Yield a fault for every combination of values that no car can have.

    Parameters
    ----------
    parts : mapping of str to part
        Section -> part of the car, or None for a part that the car lacks. Every value is within its own bounds, and the tables
        are sound.
    where : str
        Name of the car's document in messages.
    """
    read: dict[str, None] = {}
    car = {section: part and _Traced(section, part, read) for section, part in parts.items()}
    for what, value, (low, high), unit in _relations(car):
        if not low <= value <= high:
            *others, last = read
            place = f"{where}, {', '.join(others)} and {last}"
            allowed = f"{low:g} {unit} or more" if math.isinf(high) else f"{low:g} to {high:g} {unit}"
            fix = "check the values and units of these entries"
            got = f"{what}: {value:.4g} {unit}"
            yield Fault("no car has these values together", place, got, allowed, fix)
        read.clear()


def _relations(car: Mapping[str, Any]) -> Iterator[Relation]:
    """Yield the relations of a car, each right after its entries are read."""
    body, load, battery, motor = (car[name] for name in ("body", "road_load", "battery", "drivetrain"))
    wh_kg = battery.capacity_ah * _pack_v(battery) / body.curb_mass_kg
    yield "battery energy over mass", wh_kg, BATTERY_WH_KG, "Wh/kg"
    yield "mean voltage of the battery", _pack_v(battery), PACK_V, "V"
    pack_ohm = battery.cells_in_series * float(np.mean(battery.resistance_ohm))
    pack_w_kg = _pack_v(battery) ** 2 / (4.0 * max(pack_ohm, 1e-9)) / body.test_mass_kg
    yield "battery power over mass", pack_w_kg, POWER_W_KG, "kW/t"
    yield "drag area", load.drag_area_m2, DRAG_AREAS_M2, "m²"
    constant, linear = load.rolling_coefficients
    rolling = constant + linear * min(_top_speed(motor), 150.0)
    yield "rolling drag over weight at top speed", rolling, ROLLING, "1"
    coast_down = load.coastdown_mass_kg or body.test_mass_kg
    yield "coast-down mass over mass", coast_down / body.test_mass_kg, TEST_MASSES, "1"
    yield "motor power over mass", motor.motor_max_power_w / body.test_mass_kg, POWER_W_KG, "kW/t"
    force = motor.motor_max_torque_nm * motor.gear_ratio / motor.wheel_radius_m * motor.gearbox_efficiency
    share = force / body.test_mass_kg / GRAVITY_M_S2
    yield "force at the wheels over weight", share, FORCE_OF_WEIGHT, "1"
    yield "speed at the highest motor speed", _top_speed(motor) / M_S_PER_KM_H, TOP_SPEEDS_KM_H, "km/h"
    share = motor.motor_max_power_w / (motor.motor_max_torque_nm * motor.motor_max_speed_rad_s)
    yield "motor power over largest torque times speed", share, (0.0, 1.0), "1"
    loads = _largest_load_w(car) / (MAX_LOAD_W * max(body.curb_mass_kg / 3500.0, 1.0))
    yield "power besides driving over its limit", loads, (0.0, 1.0), "1"
    yield "rolling drag of cold over that of warm tyres", _cold_drag(car["tyres"]), TYRE_FACTORS, "1"
    corner = _peak_efficiency(motor, motor.motor_max_power_w / motor.motor_max_torque_nm)
    yield "efficiency at the corner speed of the motor", corner, PEAK_EFFICIENCY, "1"
    top = _peak_efficiency(motor, motor.motor_max_speed_rad_s)
    yield "efficiency at the top speed of the motor", top, PEAK_EFFICIENCY, "1"
    for km_h in (36, 90):
        wh_km = _level_road_wh_km(car, km_h / 3.6)
        yield f"consumption on a level cold road at {km_h} km/h", wh_km, LEVEL_ROAD_WH_KM, "Wh/km"


def _pack_v(battery: Any) -> float:
    return float(battery.cells_in_series * np.mean(battery.ocv_v))


def _peak_efficiency(drivetrain: Any, speed_rad_s: float) -> float:
    """Return the efficiency of motor and inverter at the largest power that they have at a speed of the motor [1]."""
    power = float(min(drivetrain.motor_max_power_w, drivetrain.motor_max_torque_nm * speed_rad_s))
    return power / (power + _loss_w(power, speed_rad_s, drivetrain))


def _top_speed(drivetrain: Any) -> float:
    """Return the speed of the car at the highest motor speed [m/s]."""
    return float(drivetrain.motor_max_speed_rad_s * drivetrain.wheel_radius_m / drivetrain.gear_ratio)


def _largest_load_w(car: Mapping[str, Any]) -> float:
    climate, loads = car["climate"], car["auxiliaries"]
    load = float(loads.base_load_w + loads.moving_load_w)
    if climate is None:
        return load
    heating = climate.heater_max_heat_w / climate.heater_efficiency + climate.defrost_power_w
    cooling = climate.cooler_max_heat_w / climate.cooler_cop
    return float(load + max(heating, cooling) + max(climate.blower_low_power_w, climate.blower_high_power_w))


def _cold_drag(tyres: Any) -> float:
    """Return the rolling drag of a cold tyre at `COLD_DEGC` over that of a warm one [1]."""
    if tyres is None:
        return 1.0
    colder = tyres.temperature_coefficient_per_k * (tyres.reference_temperature_degc - COLD_DEGC)
    return float((1.0 + max(colder, 0.0)) * (1.0 + tyres.cold_excess))


def _level_road_wh_km(car: Mapping[str, Any], speed_m_s: float) -> float:
    """Return the consumption at a constant speed on a level road in the cold, with all loads, or at the top speed of a slower car."""
    drivetrain, load = car["drivetrain"], car["road_load"]
    speed = min(speed_m_s, _top_speed(drivetrain))
    constant, linear = load.rolling_coefficients
    rolling = car["body"].test_mass_kg * GRAVITY_M_S2 * max(constant + linear * speed, 0.0) * speed
    density = SEA_LEVEL_PRESSURE_PA / (DRY_AIR_GAS_CONSTANT_J_KG_K * SEA_LEVEL_TEMPERATURE_K)
    air = 0.5 * density * load.drag_area_m2 * speed**3
    shaft = (rolling + air) / drivetrain.gearbox_efficiency
    loss = _loss_w(shaft, speed * drivetrain.gear_ratio / drivetrain.wheel_radius_m, drivetrain)
    power = _cold_drag(car["tyres"]) * rolling + air + loss + _largest_load_w(car)
    return float(power / drivetrain.gearbox_efficiency / speed / SECONDS_PER_HOUR * 1000.0)


def _loss_w(shaft_w: float, speed_rad_s: float, drivetrain: Any) -> float:
    return float(motor_loss(np.array([shaft_w / speed_rad_s]), np.array([speed_rad_s]), drivetrain)[0])
