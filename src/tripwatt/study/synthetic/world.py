"""The hidden truth of a trip: the i3's physics in a world with wind, weather, habits, a cabin and heavy tails.

Forces that are not in the package's physics act on the true car as an equivalent slope; loads that are not in it
come on top at the battery terminals. Every number here *defines* the synthetic world and does not describe a real one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, changes
from tripwatt.physics import DriveConditions, simulate
from tripwatt.physics.battery import BatteryRun, discharge
from tripwatt.routes.driver import autoregression, smooth_noise
from tripwatt.study.synthetic.roads import RoadDrive
from tripwatt.study.synthetic.scenario import AIR, NOISE, WORLD, Scenario, stream
from tripwatt.units import (
    DRY_AIR_GAS_CONSTANT_J_KG_K,
    GRAVITY_M_S2,
    SEA_LEVEL_PRESSURE_PA,
    WH_PER_J,
    ZERO_CELSIUS_K,
)
from tripwatt.vehicles import Battery, Vehicle


class Cabin:
    """The true cabin: one heat capacity, losses that grow with speed, a slow heater and an air conditioner."""

    heat_capacity_j_k: Final = 40e3
    loss_w_k: Final = 60.0
    loss_per_speed_w_s_k_m: Final = 1.3
    gain_w_k: Final = 350.0
    heater_max_w: Final = 5500.0
    heater_efficiency: Final = 0.92
    heater_lag_s: Final = 45.0
    aircon_max_w: Final = 2200.0
    aircon_idle_w: Final = 240.0
    aircon_performance: Final = 2.3
    cools_down_s: Final = 2400.0


SUN_W: Final = {"sunny": 480.0, "slightly cloudy": 280.0, "cloudy": 120.0, "rainy": 60.0, "dark": 0.0}
"""Solar heat [W] in the cabin on a summer day; half of it in winter."""


@dataclass(frozen=True, eq=False, slots=True)
class CabinClimate:
    """Cabin temperature [°C] and the electric powers of heating and cooling [W], at each sample."""

    cabin_temperature_degc: FloatArray
    requested_heating_power_w: FloatArray
    heating_power_w: FloatArray
    aircon_power_w: FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Truth:
    """The true values of a trip, before any sensor.

    Attributes
    ----------
    ambient_temperature_degc : ndarray, shape (samples,)
    climate : CabinClimate
    battery : BatteryRun
        Power, current, voltage, temperature and charge of the true battery.
    effects : dict of str to float
        Hidden effects by name, see `tripwatt.study.synthetic.synthetic_world`.
    """

    ambient_temperature_degc: FloatArray
    climate: CabinClimate
    battery: BatteryRun
    effects: dict[str, float]


def simulate_truth(scenario: Scenario, drive: RoadDrive, vehicle: Vehicle, seed: int) -> Truth:
    """Simulate the truth of one trip. O(samples)."""
    rng = stream(seed, WORLD, *scenario.key)
    time, speed = drive.profile.time_s, drive.profile.speed_m_s
    # values per sample have their own random streams: the number of samples does not change effects of the trip
    air = stream(seed, AIR, *scenario.key)
    ambient = _draw_ambient(scenario, time, air)
    climate = _heat_balance(scenario, time, speed, ambient, rng)
    # a compressor's power differs from what the cooling needs by 10 %, in waves of 20 s
    hunting = np.maximum(1.0 + 0.1 * smooth_noise(time, 20.0, air), 0.5)
    climate = replace(climate, aircon_power_w=climate.aircon_power_w * hunting)
    wind_n, headwind, rolling_n, rolling_share = hidden_forces(scenario, drive, ambient, vehicle, rng)
    weight_n = (vehicle.body.test_mass_kg + scenario.payload_mass_kg) * GRAVITY_M_S2
    trips_before = 0 if scenario.parked_s is None else scenario.key[1]
    rested_degc = 0.5 * (float(ambient[0]) + scenario.day.mean_temperature_degc) + rng.uniform(0.0, 3.0)
    conditions = DriveConditions(
        ambient_temperature_degc=float(ambient.mean()),
        initial_soc=scenario.soc,
        # a heavy battery pack follows the mean temperature of the day, and each trip before on this day has warmed it
        initial_battery_temperature_degc=float(rested_degc + 2.0 * trips_before),
        payload_mass_kg=scenario.payload_mass_kg,
    )
    driven = simulate(
        vehicle,
        time,
        speed,
        grade=drive.grade + (wind_n + rolling_n) / weight_n,
        elevation_m=drive.elevation_m,  # for the air density; the slope is the given one
        climate_power_w=0.0,
        conditions=conditions,
    )
    trip_share = 0.015 * float(rng.standard_t(4.0))  # heavier tails than any model assumes
    noise = stream(seed, NOISE, *scenario.key)
    loads = _battery_loads(scenario, drive, climate, _at_samples(driven.battery_power_w), trip_share, noise)
    total_w, step_s = np.sum(list(loads.values()), axis=0), changes(time)
    start = conditions.ambient_temperature_degc, scenario.soc, conditions.battery_start_degc
    battery = discharge(age_battery(vehicle.battery), total_w, step_s, *start)
    effects = {f"{name}_energy_wh": _energy_wh(power, time) for name, power in loads.items()}
    effects |= {
        "energy_wh": _energy_wh(battery.power_w, time),
        "wind_work_wh": _energy_wh(wind_n * speed, time),
        "rolling_work_wh": _energy_wh(rolling_n * speed, time),
        "ambient_temperature_degc": conditions.ambient_temperature_degc,
        "headwind_m_s": headwind,
        "rolling_share": rolling_share,
        "driver_share": scenario.driver.power_share,
        "trip_share": trip_share,
        "end_soc": float(battery.soc[-1]),
    }
    return Truth(ambient, climate, battery, effects)


def _battery_loads(
    scenario: Scenario,
    drive: RoadDrive,
    climate: CabinClimate,
    driving_w: FloatArray,
    trip_share: float,
    rng: np.random.Generator,
) -> dict[str, FloatArray]:
    """Return the power at the battery terminals [W] by hidden cause, each of shape (samples,); the sum is the true power."""
    time, speed = drive.profile.time_s, drive.profile.speed_m_s
    propelling = np.maximum(driving_w, 0.0)
    wet, unlit = scenario.day.sky == "rainy", scenario.day.dark_at(scenario.hour)
    lamps = 40.0 + 110.0 * (wet or unlit) + 90.0 * wet  # control units beyond the data sheet, lamps, wipers
    return {
        "driving": driving_w,
        "heating": climate.heating_power_w,
        "aircon": climate.aircon_power_w,
        "lamps": np.full_like(time, lamps),
        "driver": scenario.driver.power_share * propelling,
        "trip": trip_share * propelling,
        "noise": _heavy_tailed_noise(time, speed, driving_w, rng),
    }


def _at_samples(of_intervals: FloatArray) -> FloatArray:
    """Convert means over the intervals that end at each sample to values at the samples: the mean of both neighbours.

    Examples
    --------
    >>> _at_samples(np.array([0.0, 2.0, 4.0]))
    array([2., 3., 4.])
    """
    inner = 0.5 * (of_intervals[1:-1] + of_intervals[2:])
    return np.concatenate((of_intervals[1:2], inner, of_intervals[-1:]))


def age_battery(battery: Battery) -> Battery:
    """Return the battery as it is in the true car: 4 % less capacity and 15 % more resistance than in the data sheet."""
    return replace(
        battery,
        capacity_ah=battery.capacity_ah * (1.0 - 0.04),
        resistance_ohm=tuple(r * (1.0 + 0.15) for r in battery.resistance_ohm),
    )


def _energy_wh(power_w: FloatArray, time_s: FloatArray) -> float:
    return float(np.trapezoid(power_w, time_s)) * WH_PER_J


def _draw_ambient(scenario: Scenario, time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw the outside temperature along the trip [°C]: the day's course and differences from street to street."""
    now, in_an_hour = (scenario.day.temperature_at(scenario.hour + h) for h in (0.0, 1.0))
    course = now + (in_an_hour - now) * (time_s / 3600.0)
    return np.asarray(course + 0.5 * smooth_noise(time_s, 400.0, rng), dtype=np.float64)


def _heat_balance(
    scenario: Scenario,
    time_s: FloatArray,
    speed_m_s: FloatArray,
    ambient_degc: FloatArray,
    rng: np.random.Generator,
) -> CabinClimate:
    """Simulate the true cabin in steps of 1 s: `C dT/dt = loss (T_out - T) + sun + heater - cooling`. O(seconds)."""
    sun_w = SUN_W[scenario.weather] * (0.5 if scenario.day.season == "winter" else 1.0)
    soaked = ambient_degc[0] + sun_w / Cabin.loss_w_k * rng.uniform(0.3, 1.0) + rng.uniform(0.0, 1.5)
    warmth_left = 0.0 if scenario.parked_s is None else math.exp(-scenario.parked_s / Cabin.cools_down_s)
    cabin = soaked + warmth_left * (scenario.setpoint_degc - soaked)

    seconds = np.arange(math.ceil(time_s[-1]) + 1, dtype=np.float64)
    outside = np.interp(seconds, time_s, ambient_degc)
    loss = Cabin.loss_w_k + Cabin.loss_per_speed_w_s_k_m * np.interp(seconds, time_s, speed_m_s)
    steady_w = loss * (scenario.setpoint_degc - outside) - sun_w
    rows: list[tuple[float, ...]] = []
    heater = 0.0
    for loss_w_k, outside_degc, steady in zip(
        loss.tolist(), outside.tolist(), steady_w.tolist(), strict=True
    ):
        needed = steady + Cabin.gain_w_k * (scenario.setpoint_degc - cabin)
        wanted = needed / Cabin.heater_efficiency
        request = min(wanted, Cabin.heater_max_w) if wanted > 0.0 else 0.0
        heater += (request - heater) / Cabin.heater_lag_s
        cooling = -needed / Cabin.aircon_performance
        cooling = min(cooling, Cabin.aircon_max_w - Cabin.aircon_idle_w) if cooling > 0.0 else 0.0
        aircon = cooling + Cabin.aircon_idle_w if cooling > 0.0 else 0.0
        rows.append((cabin, request, heater, aircon))
        heat = Cabin.heater_efficiency * heater - Cabin.aircon_performance * cooling
        cabin += (loss_w_k * (outside_degc - cabin) + sun_w + heat) / Cabin.heat_capacity_j_k
    return CabinClimate(*(np.interp(time_s, seconds, column) for column in np.transpose(rows)))


def hidden_forces(
    scenario: Scenario, drive: RoadDrive, ambient_degc: FloatArray, vehicle: Vehicle, rng: np.random.Generator
) -> tuple[FloatArray, float, FloatArray, float]:
    """Return extra force of wind and drag [N], mean headwind [m/s], extra rolling force [N] and its share of the car's own."""
    speed = drive.profile.speed_m_s
    ambient_k = ambient_degc + ZERO_CELSIUS_K
    scale_heights = GRAVITY_M_S2 * drive.elevation_m / (DRY_AIR_GAS_CONSTANT_J_KG_K * ambient_k)
    density = SEA_LEVEL_PRESSURE_PA * np.exp(-scale_heights) / (DRY_AIR_GAS_CONSTANT_J_KG_K * ambient_k)
    # at the height of a car the wind has 60 % of its speed at the weather station
    headwind = scenario.day.wind_m_s * 0.6 * np.cos(drive.heading_rad - scenario.day.wind_from_rad)
    flow = speed + headwind
    area = vehicle.road_load.drag_area_m2
    # the true car has 4 % more drag than its data sheet
    wind_n = 0.5 * density * area * ((1.0 + 0.04) * flow * np.abs(flow) - speed**2)
    below_20_k = max(20.0 - float(ambient_degc.mean()), 0.0)
    # a wet road, winter tyres, cold tyres, and the surface of the roads of this trip
    share = float(
        0.12 * (scenario.day.sky == "rainy")
        + 0.04 * (scenario.day.season == "winter")
        + 0.002 * below_20_k
        + 0.05 * rng.standard_normal()
    )
    constant, per_speed = vehicle.road_load.rolling_coefficients
    weight_n = (vehicle.body.test_mass_kg + scenario.payload_mass_kg) * GRAVITY_M_S2
    rolling_n = share * weight_n * (constant + per_speed * speed)
    return wind_n, float(headwind.mean()), rolling_n, share


def _heavy_tailed_noise(
    time_s: FloatArray, speed_m_s: FloatArray, power_w: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Draw unexplained power [W]: Student's t shocks, half of their variance autocorrelated, larger while moving."""
    memory = math.exp(-float(time_s[1] - time_s[0]) / 6.0)
    df = 3.0
    shocks = rng.standard_t(df, (2, len(time_s))) * math.sqrt((df - 2.0) / df)  # of unit variance
    remembered = math.sqrt(1.0 - memory**2) * autoregression(shocks[0], memory)
    unit = math.sqrt(0.5) * (remembered + shocks[1])
    size = np.where(speed_m_s > 0.0, 450.0, 60.0) + 0.02 * np.abs(power_w)
    return np.asarray(size * unit, dtype=np.float64)
