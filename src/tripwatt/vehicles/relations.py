"""Checks of relations between values of a car that are each within bounds, but impossible together.

The limits leave room around every road vehicle from a light quadricycle to a truck and trailer of 60 t. They do not judge
whether a car is likely.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
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
from tripwatt.vehicles.parts import Battery, Body, Climate, Drivetrain, RoadLoad, Tyres

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

MASS: Final = ("body.curb_mass_kg", "body.driver_mass_kg")
PACK: Final = ("battery.cells_in_series", "battery.ocv_v")
TURNING: Final = ("drivetrain.motor_max_speed_rad_s", "drivetrain.gear_ratio", "drivetrain.wheel_radius_m")
LIMITS: Final = tuple(f"drivetrain.motor_max_{name}" for name in ("power_w", "torque_nm", "speed_rad_s"))
LOSS_MAP: Final = tuple(
    f"drivetrain.{field.name}"
    for field in fields(Drivetrain)
    if field.name.startswith(("torque_", "phase_", "field_", "characteristic_", "iron_", "inverter_"))
    or field.name in ("motor_loss_factor", "flux_loss_w_s2_rad2")
)
"""Entries of the loss map of motor and inverter."""
AIR: Final = {
    "coastdown": ("road_load.coastdown_c_n_s2_m2", "road_load.coastdown_air_density_kg_m3"),
    "coefficients": ("road_load.drag_coefficient", "road_load.frontal_area_m2"),
}
DRAG: Final = {
    "coastdown": ("road_load.coastdown_a_n", "road_load.coastdown_b_n_s_m", "road_load.coastdown_mass_kg"),
    "coefficients": ("road_load.rolling_resistance_coefficient",),
}
"""Method of the road load -> entries of rolling and driveline drag; in `AIR` those of air drag."""
COLD_TYRES: Final = (
    "tyres.temperature_coefficient_per_k",
    "tyres.reference_temperature_degc",
    "tyres.cold_excess",
)
HEATERS: Final = ("heater_max_heat_w", "heater_efficiency", "defrost_power_w", "blower_high_power_w")
LOADS: Final = (
    *("auxiliaries.base_load_w", "auxiliaries.moving_load_w"),
    *(f"climate.{name}" for name in (*HEATERS, "cooler_max_heat_w", "cooler_cop")),
)
"""Entries of the electric power besides driving."""


def table_faults(parts: Mapping[str, Any], where: str) -> Iterator[Fault]:
    """Yield the faults of the tables of a car, and of pairs of values in the wrong order. Arguments as in `relation_faults`."""
    tables = [("battery", "ocv_soc", "ocv_v"), ("battery", "resistance_soc", "resistance_ohm")]
    tables += [] if parts["charging"] is None else [("charging", "displayed_soc", "power_w")]
    for section, grid, values in tables:
        x, y, place = (
            getattr(parts[section], grid),
            getattr(parts[section], values),
            f"{where}, {section}.{grid}",
        )
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
    body: Body = parts["body"]
    battery: Battery = parts["battery"]
    drivetrain: Drivetrain = parts["drivetrain"]
    load: RoadLoad = parts["road_load"]
    mass = body.test_mass_kg
    wh_kg = battery.capacity_ah * _pack_v(battery) / body.curb_mass_kg
    pack_ohm = battery.cells_in_series * float(np.mean(battery.resistance_ohm))
    pack_w_kg = _pack_v(battery) ** 2 / (4.0 * max(pack_ohm, 1e-9)) / mass
    power, torque = drivetrain.motor_max_power_w, drivetrain.motor_max_torque_nm
    power_share = power / (torque * drivetrain.motor_max_speed_rad_s)
    force = torque * drivetrain.gear_ratio / drivetrain.wheel_radius_m * drivetrain.gearbox_efficiency
    top_km_h = _top_speed(drivetrain) / M_S_PER_KM_H
    constant, linear = load.rolling_coefficients
    rolling = constant + linear * min(_top_speed(drivetrain), 150.0)
    coast_down = (load.coastdown_mass_kg or mass) / mass
    corner, top = (
        _peak_efficiency(drivetrain, w) for w in (power / torque, drivetrain.motor_max_speed_rad_s)
    )
    slow, fast = (_level_road_wh_km(parts, speed_m_s) for speed_m_s in (10.0, 25.0))
    most_loads_w = MAX_LOAD_W * max(body.curb_mass_kg / 3500.0, 1.0)
    loads = _largest_load_w(parts) / most_loads_w
    pull = ("drivetrain.motor_max_torque_nm", *TURNING[1:], *MASS)
    air, drag = AIR[load.method], DRAG[load.method]
    driving = (*MASS, *drag, *air, "drivetrain.motor_loss_factor", *LOADS)
    relations = [
        ("battery energy over mass", wh_kg, BATTERY_WH_KG, "Wh/kg", ("battery.capacity_ah", *PACK, *MASS)),
        ("mean voltage of the battery", _pack_v(battery), PACK_V, "V", PACK),
        ("battery power over mass", pack_w_kg, POWER_W_KG, "kW/t", (*PACK, "battery.resistance_ohm", *MASS)),
        ("drag area", load.drag_area_m2, DRAG_AREAS_M2, "m²", air),
        ("rolling drag over weight at top speed", rolling, ROLLING, "1", (*drag, *TURNING)),
        ("coast-down mass over mass", coast_down, TEST_MASSES, "1", ("road_load.coastdown_mass_kg", *MASS)),
        ("motor power over mass", power / mass, POWER_W_KG, "kW/t", (LIMITS[0], *MASS)),
        ("force at the wheels over weight", force / mass / GRAVITY_M_S2, FORCE_OF_WEIGHT, "1", pull),
        ("speed at the highest motor speed", top_km_h, TOP_SPEEDS_KM_H, "km/h", TURNING),
        ("motor power over largest torque times speed", power_share, (0.0, 1.0), "1", LIMITS),
        ("power besides driving over its limit", loads, (0.0, 1.0), "1", (*LOADS, "body.curb_mass_kg")),
        ("rolling drag of cold over that of warm tyres", _cold_drag(parts), TYRE_FACTORS, "1", COLD_TYRES),
        ("efficiency at the corner speed of the motor", corner, PEAK_EFFICIENCY, "1", LOSS_MAP),
        ("efficiency at the top speed of the motor", top, PEAK_EFFICIENCY, "1", LOSS_MAP),
        ("consumption on a level cold road at 36 km/h", slow, LEVEL_ROAD_WH_KM, "Wh/km", driving),
        ("consumption on a level cold road at 90 km/h", fast, LEVEL_ROAD_WH_KM, "Wh/km", driving),
    ]
    for what, value, (low, high), unit, entries in relations:
        if not low <= value <= high:
            present = [entry for entry in entries if parts[entry.partition(".")[0]] is not None]
            place = f"{where}, {', '.join(present[:-1])} and {present[-1]}"
            allowed = f"{low:g} {unit} or more" if math.isinf(high) else f"{low:g} to {high:g} {unit}"
            fix = "check the values and units of these entries"
            got = f"{what}: {value:.4g} {unit}"
            yield Fault("no car has these values together", place, got, allowed, fix)


def _pack_v(battery: Battery) -> float:
    return battery.cells_in_series * float(np.mean(battery.ocv_v))


def _peak_efficiency(drivetrain: Drivetrain, speed_rad_s: float) -> float:
    """Return the efficiency of motor and inverter at the largest power that they have at a speed of the motor [1]."""
    power = min(drivetrain.motor_max_power_w, drivetrain.motor_max_torque_nm * speed_rad_s)
    return power / (power + _loss_w(power, speed_rad_s, drivetrain))


def _top_speed(drivetrain: Drivetrain) -> float:
    """Return the speed of the car at the highest motor speed [m/s]."""
    return drivetrain.motor_max_speed_rad_s * drivetrain.wheel_radius_m / drivetrain.gear_ratio


def _largest_load_w(parts: Mapping[str, Any]) -> float:
    climate: Climate | None = parts["climate"]
    load = float(parts["auxiliaries"].base_load_w + parts["auxiliaries"].moving_load_w)
    if climate is None:
        return load
    heating = climate.heater_max_heat_w / climate.heater_efficiency + climate.defrost_power_w
    cooling = climate.cooler_max_heat_w / climate.cooler_cop
    return load + max(heating, cooling) + max(climate.blower_low_power_w, climate.blower_high_power_w)


def _cold_drag(parts: Mapping[str, Any]) -> float:
    """Return the rolling drag of a cold tyre at `COLD_DEGC` over that of a warm one [1]."""
    tyres: Tyres | None = parts["tyres"]
    if tyres is None:
        return 1.0
    colder = tyres.temperature_coefficient_per_k * (tyres.reference_temperature_degc - COLD_DEGC)
    return (1.0 + max(colder, 0.0)) * (1.0 + tyres.cold_excess)


def _level_road_wh_km(parts: Mapping[str, Any], speed_m_s: float) -> float:
    """Return the consumption at a constant speed on a level road in the cold, with all loads, or at the top speed of a slower car."""
    drivetrain: Drivetrain = parts["drivetrain"]
    load: RoadLoad = parts["road_load"]
    speed = min(speed_m_s, _top_speed(drivetrain))
    constant, linear = load.rolling_coefficients
    rolling = parts["body"].test_mass_kg * GRAVITY_M_S2 * max(constant + linear * speed, 0.0) * speed
    density = SEA_LEVEL_PRESSURE_PA / (DRY_AIR_GAS_CONSTANT_J_KG_K * SEA_LEVEL_TEMPERATURE_K)
    air = 0.5 * density * load.drag_area_m2 * speed**3
    shaft = (rolling + air) / drivetrain.gearbox_efficiency
    loss = _loss_w(shaft, speed * drivetrain.gear_ratio / drivetrain.wheel_radius_m, drivetrain)
    power = _cold_drag(parts) * rolling + air + loss + _largest_load_w(parts)
    return float(power / drivetrain.gearbox_efficiency / speed / SECONDS_PER_HOUR * 1000.0)


def _loss_w(shaft_w: float, speed_rad_s: float, drivetrain: Drivetrain) -> float:
    return float(motor_loss(np.array([shaft_w / speed_rad_s]), np.array([speed_rad_s]), drivetrain)[0])
