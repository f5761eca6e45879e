"""Checks of relations between values of a car that are each within bounds, but impossible together.

The limits leave room around every road vehicle from a light quadricycle to a truck and trailer of 60 t. They do not judge
whether a car is likely.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
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
from tripwatt.vehicles.parts import Battery, Body, Charging, Climate, Drivetrain, RoadLoad, Tyres

MIN_POWER_W_KG: Final = 5.0
"""Least motor power over mass: 5 kW/t are required of trucks with trailers (Directive 97/27/EC, annex I, 7.10)."""

MIN_FORCE_OF_WEIGHT: Final = 0.05
"""Least force at the wheels over weight: a car that cannot start on 5 % can use no ordinary road. Trucks with trailers start on
12 % (Regulation (EU) 1230/2012, annex I, part A, 5); the torque of a described car is that of a class and may be too low."""

TOP_SPEEDS_M_S: Final = (45.0 * M_S_PER_KM_H, 150.0)
"""Speed at the highest motor speed: 45 km/h of a light quadricycle (Regulation (EU) 168/2013) to above the fastest cars."""

MAX_DRAG_AREA_M2: Final = 12.0
"""Twice the 5 to 6 m² of tractors with semi-trailers (Regulation (EU) 2017/2400)."""

MAX_ROLLING: Final = 0.1
"""Rolling and driveline drag over weight at `ROLLING_AT_M_S`, as for a coefficient of rolling resistance: that of loose sand."""

ROLLING_AT_M_S: Final = 25.0

COAST_DOWN_MASSES: Final = (0.25, 4.0)
"""Smallest and largest mass of the coast-down over that of the car; the difference is load."""

MIN_EFFICIENCY: Final = {10.0: 0.25, 25.0: 0.5}
"""Least efficiency of motor and inverter on a level road, by speed [m/s]. The least of the library are 0.66 and 0.79."""

MIN_PEAK_EFFICIENCY: Final = 0.5
"""Least efficiency of motor and inverter at peak power. The least of the library is 0.75."""

BATTERY_WH_KG: Final = (2.0, 200.0)
"""Energy of the battery over the mass of the car: plug-in hybrids have 3 Wh/kg, cars of the library up to 50, and half
of a car made of cells of 400 Wh/kg would have 200."""

PACK_V: Final = (24.0, 1500.0)
"""Lowest and highest voltage of the battery: UN Regulation 100 covers up to 1500 V."""

MAX_TYRE_FACTOR: Final = 5.0
"""Largest rolling resistance of a cold tyre at -20 °C over that of a warm one. Cars have 1.7."""

COLD_DEGC: Final = -20.0

MAX_LOAD_W: Final = 20_000.0
"""Largest electric power besides driving of a car of up to `MAX_LOAD_MASS_KG`; for heavier cars it grows with the mass."""

MAX_LOAD_MASS_KG: Final = 3500.0

MAX_WH_KM: Final = 3000.0
"""Largest consumption on a level road, twice that of a loaded truck of 40 t."""


def table_faults(parts: Mapping[str, Any], where: str) -> Iterator[Fault]:
    """Yield the faults of the tables of a car, and of pairs of values in the wrong order. Arguments as in `relation_faults`."""
    yield from _battery_table_faults(parts["battery"], where)
    if parts["charging"] is not None:  # from an empty to a full display
        yield from _table_faults(
            parts["charging"], "displayed_soc", "power_w", f"{where}, charging", (0.0, 1.0)
        )
    yield from _order_faults(parts, where)


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
    simple = [
        *_battery_faults(parts["battery"], parts["body"], where),
        *_resistance_faults(parts["road_load"], parts["drivetrain"], parts["body"], where),
        *_limit_faults(parts["drivetrain"], parts["body"], where),
        *_load_faults(parts, where),
    ]
    # losses and consumption are checked only if these are sound: they would blame the same entries again
    yield from simple or list(_loss_faults(parts, where)) or _consumption_faults(parts, where)


def _impossible(where: str, fields: tuple[str, ...], got: str, allowed: str) -> Fault:
    named = f"{', '.join(fields[:-1])} and {fields[-1]}" if len(fields) > 1 else fields[0]
    fix = "check the values and units of these entries"
    return Fault("no car has these values together", f"{where}, {named}", got, allowed, fix)


def _battery_table_faults(battery: Battery, where: str) -> Iterator[Fault]:
    for grid, values in (("ocv_soc", "ocv_v"), ("resistance_soc", "resistance_ohm")):
        yield from _table_faults(battery, grid, values, f"{where}, battery")
    if any(b < a for a, b in itertools.pairwise(battery.ocv_v)):
        yield Fault("table decreases", f"{where}, battery.ocv_v", "a falling voltage", "rising with soc")
    if battery.min_cell_voltage_v >= battery.ocv_v[0]:
        got = f"{battery.min_cell_voltage_v:g} V and {battery.ocv_v[0]:g} V"
        yield Fault(
            "cell voltage limit too high", f"{where}, battery.min_cell_voltage_v", got, "less than ocv_v"
        )


def _table_faults(
    part: Battery | Charging, grid: str, values: str, where: str, ends: tuple[float, float] | None = None
) -> Iterator[Fault]:
    """Yield the faults of a table of values over a grid; if `ends` are given, the grid has to begin and end with them."""
    x, y, place = getattr(part, grid), getattr(part, values), f"{where}.{grid}"
    if len(x) != len(y):
        got = f"{len(x)} and {len(y)} values"
        yield Fault("tables differ in length", f"{place} and {values}", got, "equal numbers of values")
    if any(b <= a for a, b in itertools.pairwise(x)) or (ends is not None and (x[0], x[-1]) != ends):
        allowed = "increasing values" + ("" if ends is None else f" from {ends[0]:g} to {ends[1]:g}")
        yield Fault("table does not increase", place, str(list(x)), allowed)


def _order_faults(parts: Mapping[str, Any], where: str) -> Iterator[Fault]:
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


def _battery_faults(battery: Battery, body: Body, where: str) -> Iterator[Fault]:
    cells = battery.cells_in_series
    energy = battery.capacity_ah * cells * float(np.mean(battery.ocv_v))
    low, high = BATTERY_WH_KG
    if not low <= energy / body.curb_mass_kg <= high:
        fields = ("battery.capacity_ah", "battery.cells_in_series", "battery.ocv_v", "body.curb_mass_kg")
        got = f"{energy / 1000.0:.3g} kWh in a car of {body.curb_mass_kg:g} kg, {energy / body.curb_mass_kg:.3g} Wh/kg"
        yield _impossible(where, fields, got, f"{low:g} to {high:g} Wh/kg")
    empty, full = cells * battery.ocv_v[0], cells * battery.ocv_v[-1]
    if empty < PACK_V[0] or full > PACK_V[1]:
        got = f"{empty:.4g} V empty, {full:.4g} V full"
        yield _impossible(
            where, ("battery.cells_in_series", "battery.ocv_v"), got, f"{PACK_V[0]:g} to {PACK_V[1]:g} V"
        )
    voltage = cells * float(np.mean(battery.ocv_v))
    resistance = cells * float(np.mean(battery.resistance_ohm))
    # no load takes more from a voltage behind a resistance than U²/(4 R)
    if voltage**2 < 4.0 * resistance * MIN_POWER_W_KG * body.test_mass_kg:
        fields = ("battery.cells_in_series", "battery.ocv_v", "battery.resistance_ohm", "body.curb_mass_kg")
        got = f"at most {voltage**2 / (4.0 * resistance) / 1000.0:.3g} kW from the battery for {body.test_mass_kg:g} kg"
        yield _impossible(where, fields, got, f"{MIN_POWER_W_KG:g} kW/t or more")


def _names(load: RoadLoad) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the entries that determine the drag area, and those that determine the rolling resistance."""
    if load.method == "coastdown":
        return (
            ("road_load.coastdown_c_n_s2_m2", "road_load.coastdown_air_density_kg_m3"),
            ("road_load.coastdown_a_n", "road_load.coastdown_b_n_s_m", "road_load.coastdown_mass_kg"),
        )
    return (
        ("road_load.drag_coefficient", "road_load.frontal_area_m2"),
        ("road_load.rolling_resistance_coefficient",),
    )


def top_speed(drivetrain: Drivetrain) -> float:
    """Speed of the car at the highest motor speed [m/s]."""
    return drivetrain.motor_max_speed_rad_s * drivetrain.wheel_radius_m / drivetrain.gear_ratio


def _resistance_faults(load: RoadLoad, drivetrain: Drivetrain, body: Body, where: str) -> Iterator[Fault]:
    air, rolling = _names(load)
    if load.drag_area_m2 > MAX_DRAG_AREA_M2:
        got = f"a drag area of {load.drag_area_m2:.3g} m²"
        yield _impossible(where, air, got, f"at most {MAX_DRAG_AREA_M2:g} m²")
    constant, linear = load.rolling_coefficients
    at_speed = constant + linear * ROLLING_AT_M_S
    if at_speed > MAX_ROLLING:
        got = f"a rolling resistance of {at_speed:.3g} of the weight"
        yield _impossible(where, rolling, got, f"at most {MAX_ROLLING:g}")
    top = min(top_speed(drivetrain), TOP_SPEEDS_M_S[1])
    if constant + linear * top < 0.0:
        got = f"rolling resistance below 0 from {-constant / linear / M_S_PER_KM_H:.0f} km/h on"
        gear = ("drivetrain.motor_max_speed_rad_s", "drivetrain.gear_ratio", "drivetrain.wheel_radius_m")
        allowed = f"A + B v of 0 or more up to the top speed of {top / M_S_PER_KM_H:.0f} km/h"
        yield _impossible(where, (*rolling[:2], *gear), got, allowed)
    if load.method == "coastdown" and load.coastdown_mass_kg is not None:
        low, high = COAST_DOWN_MASSES
        share = load.coastdown_mass_kg / body.test_mass_kg
        if not low <= share <= high:
            fields = ("road_load.coastdown_mass_kg", "body.curb_mass_kg", "body.driver_mass_kg")
            got = f"{load.coastdown_mass_kg:g} kg in the coast-down, {body.test_mass_kg:g} kg on the road"
            yield _impossible(where, fields, got, f"a coast-down with {low:g} to {high:g} times the mass")


def _limit_faults(drivetrain: Drivetrain, body: Body, where: str) -> Iterator[Fault]:
    weight = body.test_mass_kg * GRAVITY_M_S2
    power, torque = drivetrain.motor_max_power_w, drivetrain.motor_max_torque_nm
    mass = ("body.curb_mass_kg", "body.driver_mass_kg")
    if power < MIN_POWER_W_KG * body.test_mass_kg:
        got = f"{power / 1000.0:.3g} kW for {body.test_mass_kg:g} kg"
        allowed = f"{MIN_POWER_W_KG:g} kW/t or more"
        yield _impossible(where, ("drivetrain.motor_max_power_w", *mass), got, allowed)
    force = torque * drivetrain.gear_ratio / drivetrain.wheel_radius_m * drivetrain.gearbox_efficiency
    wheel = ("drivetrain.gear_ratio", "drivetrain.wheel_radius_m")
    if force < MIN_FORCE_OF_WEIGHT * weight:
        got = f"{force:.4g} N at the wheels for {body.test_mass_kg:g} kg: it cannot start on {force / weight:.1%}"
        fields = ("drivetrain.motor_max_torque_nm", *wheel, *mass)
        yield _impossible(where, fields, got, f"{MIN_FORCE_OF_WEIGHT:.0%} of the weight or more")
    top, speeds = top_speed(drivetrain), TOP_SPEEDS_M_S
    if not speeds[0] <= top <= speeds[1]:
        allowed = f"{speeds[0] / M_S_PER_KM_H:.0f} to {speeds[1] / M_S_PER_KM_H:.0f} km/h"
        got = f"{top / M_S_PER_KM_H:.3g} km/h at the highest motor speed"
        yield _impossible(where, ("drivetrain.motor_max_speed_rad_s", *wheel), got, allowed)
    if power > torque * drivetrain.motor_max_speed_rad_s:
        limits = tuple(f"drivetrain.motor_max_{name}" for name in ("power_w", "torque_nm", "speed_rad_s"))
        most = torque * drivetrain.motor_max_speed_rad_s
        got = (
            f"{power / 1000.0:.3g} kW from {torque:g} Nm at up to {drivetrain.motor_max_speed_rad_s:g} rad/s"
        )
        yield _impossible(where, limits, got, f"at most torque times speed, {most / 1000.0:.3g} kW")


def _load_faults(parts: Mapping[str, Any], where: str) -> Iterator[Fault]:
    tyres: Tyres | None = parts["tyres"]
    load = _largest_load(parts)
    most = MAX_LOAD_W * max(parts["body"].curb_mass_kg / MAX_LOAD_MASS_KG, 1.0)
    if load > most:
        got = f"{load / 1000.0:.3g} kW besides driving"
        yield _impossible(
            where, _load_fields(parts), got, f"at most {most / 1000.0:.3g} kW in a car of this mass"
        )
    if tyres is not None and _tyre_factor(tyres) > MAX_TYRE_FACTOR:
        names = ("temperature_coefficient_per_k", "reference_temperature_degc", "cold_excess")
        got = f"{_tyre_factor(tyres):.3g} times the warm rolling resistance at {COLD_DEGC:g} °C"
        yield _impossible(
            where, tuple(f"tyres.{name}" for name in names), got, f"at most {MAX_TYRE_FACTOR:g} times"
        )


def _largest_load(parts: Mapping[str, Any]) -> float:
    """Largest electric power besides driving [W]."""
    climate: Climate | None = parts["climate"]
    load = float(parts["auxiliaries"].base_load_w + parts["auxiliaries"].moving_load_w)
    if climate is None:
        return load
    heating = climate.heater_max_heat_w / climate.heater_efficiency + climate.defrost_power_w
    cooling = climate.cooler_max_heat_w / climate.cooler_cop
    return load + max(heating, cooling) + max(climate.blower_low_power_w, climate.blower_high_power_w)


def _load_fields(parts: Mapping[str, Any]) -> tuple[str, ...]:
    loads = ("auxiliaries.base_load_w", "auxiliaries.moving_load_w")
    if parts["climate"] is None:
        return loads
    names = ("heater_max_heat_w", "heater_efficiency", "cooler_max_heat_w", "cooler_cop")
    return (*loads, *(f"climate.{name}" for name in (*names, "blower_high_power_w", "defrost_power_w")))


def _tyre_factor(tyres: Tyres) -> float:
    """Rolling resistance right after a cold night over that of the warm car at the reference temperature [1]."""
    colder = tyres.temperature_coefficient_per_k * (tyres.reference_temperature_degc - COLD_DEGC)
    return (1.0 + max(colder, 0.0)) * (1.0 + tyres.cold_excess)


def _loss_faults(parts: Mapping[str, Any], where: str) -> Iterator[Fault]:
    """Yield at most one fault: the first loss of motor and inverter that is too large, at peak power or on a level road."""
    drivetrain: Drivetrain = parts["drivetrain"]
    power, torque = drivetrain.motor_max_power_w, drivetrain.motor_max_torque_nm
    top = drivetrain.motor_max_speed_rad_s
    points = [(min(power, torque * w), w, MIN_PEAK_EFFICIENCY) for w in (min(power / torque, top), top)]
    for speed, least in MIN_EFFICIENCY.items():
        level = _level_road(parts, speed)
        points.append((level.shaft_w, level.motor_rad_s, least))
    peak = ("drivetrain.motor_max_power_w", "drivetrain.motor_max_torque_nm")
    for shaft, turning, least in points:
        loss = _loss(shaft, turning, drivetrain)
        if loss > shaft * (1.0 / least - 1.0):
            got = f"a loss of {loss / 1000.0:.4g} kW for {shaft / 1000.0:.4g} kW at {turning:.4g} rad/s of the motor"
            fields = (*_loss_fields(shaft, turning, drivetrain), *peak)
            allowed = f"an efficiency of motor and inverter of {least:.0%} or more"
            yield _impossible(where, fields, got, allowed)
            return


def _consumption_faults(parts: Mapping[str, Any], where: str) -> Iterator[Fault]:
    """Yield at most one fault: a consumption on a level road, in the cold with all loads, beyond that of any vehicle."""
    drivetrain: Drivetrain = parts["drivetrain"]
    air, rolling = _names(parts["road_load"])
    cold = 1.0 if parts["tyres"] is None else _tyre_factor(parts["tyres"])
    for speed in MIN_EFFICIENCY:
        level = _level_road(parts, speed)
        loss = _loss(level.shaft_w, level.motor_rad_s, drivetrain)
        watt = (cold * level.rolling_w, level.air_w, loss, _largest_load(parts))
        total = sum(watt) / drivetrain.gearbox_efficiency
        if total > MAX_WH_KM * level.speed_m_s * SECONDS_PER_HOUR / 1000.0:
            losses = _loss_fields(level.shaft_w, level.motor_rad_s, drivetrain)
            names = (("body.curb_mass_kg", *rolling), air, losses, _load_fields(parts))
            large = [entries for entries, power in zip(names, watt, strict=True) if power > 0.2 * total]
            fields = tuple(itertools.chain.from_iterable(large))
            wh_km = total / level.speed_m_s / SECONDS_PER_HOUR * 1000.0
            got = (
                f"{wh_km:.4g} Wh/km on a level road at {level.speed_m_s / M_S_PER_KM_H:.0f} km/h in the cold"
            )
            yield _impossible(where, fields, got, f"at most {MAX_WH_KM:g} Wh/km")
            return


@dataclass(frozen=True, slots=True)
class _LevelRoad:
    """A car at a constant speed on a level road, warm and in calm air."""

    speed_m_s: float
    motor_rad_s: float
    rolling_w: float
    air_w: float
    shaft_w: float


def _level_road(parts: Mapping[str, Any], speed_m_s: float) -> _LevelRoad:
    """Compute a level road at a speed, or at the top speed of a slower car."""
    drivetrain: Drivetrain = parts["drivetrain"]
    load: RoadLoad = parts["road_load"]
    speed = min(speed_m_s, top_speed(drivetrain))
    constant, linear = load.rolling_coefficients
    rolling = parts["body"].test_mass_kg * GRAVITY_M_S2 * max(constant + linear * speed, 0.0) * speed
    density = SEA_LEVEL_PRESSURE_PA / (DRY_AIR_GAS_CONSTANT_J_KG_K * SEA_LEVEL_TEMPERATURE_K)
    air = 0.5 * density * load.drag_area_m2 * speed**3
    return _LevelRoad(
        speed,
        speed * drivetrain.gear_ratio / drivetrain.wheel_radius_m,
        rolling,
        air,
        (rolling + air) / drivetrain.gearbox_efficiency,
    )


def _loss(shaft_w: float, speed_rad_s: float, drivetrain: Drivetrain) -> float:
    return float(motor_loss(np.array([shaft_w / speed_rad_s]), np.array([speed_rad_s]), drivetrain)[0])


_LOSSES: Final = {f.name: f.metadata["lossless"] for f in fields(Drivetrain) if "lossless" in f.metadata}
"""Entry of the loss map -> the value at which its loss is smallest."""


def _loss_fields(shaft_w: float, speed_rad_s: float, drivetrain: Drivetrain) -> tuple[str, ...]:
    """Return the entries without whose loss the total loss would be at least a fifth smaller."""
    most = 0.8 * _loss(shaft_w, speed_rad_s, drivetrain)
    without = {name: replace(drivetrain, **{name: value}) for name, value in _LOSSES.items()}
    names = [name for name, car in without.items() if _loss(shaft_w, speed_rad_s, car) < most]
    return tuple(f"drivetrain.{name}" for name in names) or ("drivetrain.motor_loss_factor",)
