"""The cabin: air and interior, outside air and sun, and an automatic climate control with its limits.

Only what is known before departure enters: speed trace, ambient temperature, set-point, the cabin's temperature at
departure and a guess of the sun.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.vehicles import Climate

CONTROL_STEP_S: Final = 10.0
"""Step of the climate control; the cabin's air responds in about a minute."""

UNKNOWN_SUN_W_M2: Final = 300.0
"""Irradiance when nothing is known: about the mean of a bright half-day in middle latitudes."""

SUN_W_M2: Final = (
    ("dark", 0.0),
    ("night", 0.0),
    ("sunrise", 50.0),
    ("sunset", 50.0),
    ("rain", 100.0),
    ("snow", 100.0),
    ("fog", 100.0),
    ("slightly cloudy", 400.0),
    ("partly cloudy", 400.0),
    ("cloudy", 150.0),
    ("overcast", 150.0),
    ("sun", 600.0),
    ("clear", 600.0),
)
"""Global irradiance by day for words of a weather report in summer, the first that occurs.

Under a clear sky the half-day around noon has about 600 W/m² in middle latitudes. Under a share `N` of cloud it is
``1 - 0.75 N**3.4`` of that (Kasten and Czeplak 1980, Solar Energy 24, 177-189): 150 W/m² under an overcast sky, and
310 to 580 W/m² where three to seven eighths are covered, of which "partly cloudy" takes 400. Rain, snow and fog have
less than an overcast sky, 100 W/m²; around sunrise and sunset the sun stands below 5 degrees.
"""

WINTER_SUN: Final = 0.5
"""Irradiance in winter over that in summer: the noon sun stands at 18 to 20 degrees in 48° N."""


def irradiance(weather: str | None, season: str | None = None) -> float:
    """Sun on the car [W/m²] expected from a weather report.

    Examples
    --------
    >>> irradiance("dark, little rainy"), irradiance("sunny", "winter"), irradiance(None)
    (0.0, 300.0, 300.0)
    """
    if weather is None:
        return UNKNOWN_SUN_W_M2
    sun_w_m2 = next((sun for word, sun in SUN_W_M2 if word in weather.lower()), UNKNOWN_SUN_W_M2)
    return sun_w_m2 * (WINTER_SUN if season == "winter" else 1.0)


HEAT_PUMP_RATING_DEGC: Final = 7.0
"""Outside air at which the largest heat of a heat pump is stated, as in EN 14511."""

HEAT_PUMP_HEAT_PER_K: Final = 0.03
"""Change of a heat pump's largest heat for each kelvin of outside air [1/K]. At full speed a compressor moves mass in
proportion to the density of the vapour it draws in; for R134a that evaporates 8 K below the air this is 13.9 kg/m³ at 7 °C,
10.4 at -1 °C and 7.3 at -10 °C (NIST REFPROP)."""

HEAT_PUMP_MOST: Final = 1.5
"""Largest heat of a heat pump in warm air over that at the rating, where the controls stop its rise."""


IDLE_FROM_W: Final = 100.0
"""Cooling from which the compressor's least power counts in full: for less it cycles, and takes a share of it."""

DEFROST_WITHIN_K: Final = 4.0
"""Range of outside air around `defrost_below_degc` in which fewer and fewer cars have dew or frost."""


@dataclass(frozen=True, slots=True)
class CabinStart:
    """What is known of the cabin at departure.

    Attributes
    ----------
    temperature_degc : float
        Of air and interior [°C].
    setpoint_degc : float
        Temperature that the driver has set [°C].
    solar_irradiance_w_m2 : float
    warmth : float
        0 after a long stop, 1 when windows and seats are warm and dry from a drive just before.
    mode : {"auto", "heat", "cool"}
        What climate control may do.
    """

    temperature_degc: float
    setpoint_degc: float
    solar_irradiance_w_m2: float = UNKNOWN_SUN_W_M2
    warmth: float = 0.0
    mode: str = "auto"


@dataclass(frozen=True, slots=True)
class CabinRun:
    """Electric power of the climate control [W] and air temperature [°C], shape (samples,).

    `power_w` is the mean over the interval that ends at the sample, `temperature_degc` the value at the sample. `fan_power_w` is
    the part of the power that blower, rear window and seats take, which no log counts as heater or air conditioner.
    """

    power_w: FloatArray
    temperature_degc: FloatArray
    fan_power_w: FloatArray


def condition_cabin(
    climate: Climate,
    time_s: FloatArray,
    speed_m_s: FloatArray,
    ambient_temperature_degc: float,
    start: CabinStart,
) -> CabinRun:
    """Keep the cabin at its set-point along a speed trace. O(samples + duration / CONTROL_STEP_S).

    Air and interior are two heat capacities, stepped implicitly. The control demands the heat that brings the air
    towards the set-point with its time constant, gets it within the limits of heater and cooler, and blows more
    fresh air the more it demands. Air that is cool enough outside cools without the compressor.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> time = np.arange(0.0, 1201.0)
    >>> run = condition_cabin(load_vehicle("bmw_i3_60ah").climate, time, np.zeros(1201), -10.0, CabinStart(-10.0, 22.0))
    >>> bool(run.power_w[60] > run.power_w[-1]), bool(20.0 < run.temperature_degc[-1] < 22.5)
    (True, True)
    """
    duration = float(time_s[-1] - time_s[0])
    n_steps = max(1, math.ceil(duration / CONTROL_STEP_S))
    edges = time_s[0] + CONTROL_STEP_S * np.arange(n_steps + 1)
    distance = np.zeros_like(time_s)
    step_s = time_s[1:] - time_s[:-1]
    np.cumsum(0.5 * (speed_m_s[1:] + speed_m_s[:-1]) * step_s, out=distance[1:])
    speed = np.diff(np.interp(edges, time_s, distance)) / CONTROL_STEP_S
    heat, fans, air = _control_steps(climate, speed.tolist(), ambient_temperature_degc, start)

    def means(power: FloatArray) -> FloatArray:
        energy_j = np.zeros(n_steps + 1)
        np.cumsum(power * CONTROL_STEP_S, out=energy_j[1:])
        cumulative = np.interp(time_s, edges, energy_j)
        result = np.empty_like(time_s)
        result[0] = power[0]
        result[1:] = (cumulative[1:] - cumulative[:-1]) / step_s
        return np.maximum(result, 0.0)

    fan_power = means(fans)
    return CabinRun(means(heat) + fan_power, np.interp(time_s, edges, air), fan_power)


def _control_steps(
    climate: Climate, speeds: list[float], ambient: float, start: CabinStart
) -> tuple[FloatArray, FloatArray, list[float]]:
    """Electric power of heater and compressor, and of the fans, in each control step, and air temperature at its edges.

    The loop has plain floats and no calls, for speed.
    """
    dt = CONTROL_STEP_S
    air_rate = climate.air_heat_capacity_j_k / dt
    interior_rate = climate.interior_heat_capacity_j_k / dt
    exchange = climate.interior_exchange_w_k
    sun = climate.solar_aperture_m2 * start.solar_irradiance_w_m2
    to_air = climate.occupant_heat_w + climate.solar_share_to_air * sun
    to_interior = (1.0 - climate.solar_share_to_air) * sun
    approach = 1.0 - math.exp(-dt / climate.control_time_s)
    setpoint = start.setpoint_degc
    fan_range = climate.fresh_air_high_w_k - climate.fresh_air_low_w_k
    blower_range = climate.blower_high_power_w - climate.blower_low_power_w
    most_heat = climate.heater_max_heat_w if start.mode != "cool" else 0.0
    most_cooling = climate.cooler_max_heat_w if start.mode != "heat" else 0.0
    full_heat, full_cooling = climate.heater_max_heat_w or math.inf, climate.cooler_max_heat_w
    most_pumped, pump_cop = heat_pump_heat(ambient, climate), heat_pump_cop(ambient, climate)
    resistive, cooler_cop = climate.heater_efficiency, climate.cooler_cop
    idle = climate.compressor_idle_w
    shell, per_speed = climate.shell_w_k, climate.shell_per_speed_w_s_k_m
    low_fresh, high_fresh = climate.fresh_air_low_w_k, climate.fresh_air_high_w_k
    interior_sum = interior_rate + exchange
    air = interior = start.temperature_degc
    fan = 0.0
    powers: list[float] = []
    shares: list[float] = []
    temperatures = [air]
    for speed in speeds:
        fresh = low_fresh + fan * fan_range
        loss = shell + per_speed * speed + fresh
        total = air_rate + loss + exchange
        given = air_rate * air + loss * ambient + exchange * interior + to_air
        wanted = total * (air + approach * (setpoint - air)) - given
        if wanted >= 0.0:
            heat = wanted if wanted < most_heat else most_heat
            pumped = heat if heat < most_pumped else most_pumped
            power = pumped / pump_cop + (heat - pumped) / resistive
            fan = heat / full_heat
        else:
            free = (high_fresh - fresh) * (air - ambient) if air > ambient else 0.0
            free = free if free < -wanted else -wanted
            cooling = -wanted - free
            cooling = cooling if cooling < most_cooling else most_cooling
            heat = -cooling - free
            power = cooling / cooler_cop
            least = idle if cooling > IDLE_FROM_W else idle * (cooling / IDLE_FROM_W)
            power = power if power > least else least
            fan = -heat / full_cooling
            fan = fan if fan < 1.0 else 1.0
        air = (given + heat) / total
        interior = (interior_rate * interior + exchange * air + to_interior) / interior_sum
        powers.append(power)
        shares.append(fan)
        temperatures.append(air)
    fans = climate.blower_low_power_w + blower_range * np.array(shares)
    frost = 0.5 + (climate.defrost_below_degc - ambient) / DEFROST_WITHIN_K
    if frost > 0.0 and start.mode != "cool":
        share = min(frost, 1.0) * (1.0 - start.warmth)
        fans[: math.ceil(climate.defrost_time_s / dt)] += share * climate.defrost_power_w
    return np.array(powers), fans, temperatures


def heat_pump_heat(ambient_temperature_degc: float, climate: Climate) -> float:
    """Largest heat of the heat pump [W] in outside air of a temperature; the heater gives what is missing.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> leaf = load_vehicle("nissan_leaf_24").climate
    >>> heat_pump_heat(7.0, leaf) == leaf.heat_pump_max_heat_w, heat_pump_heat(-40.0, leaf)
    (True, 0.0)
    """
    factor = 1.0 + HEAT_PUMP_HEAT_PER_K * (ambient_temperature_degc - HEAT_PUMP_RATING_DEGC)
    return climate.heat_pump_max_heat_w * min(max(factor, 0.0), HEAT_PUMP_MOST)


def heat_pump_cop(ambient_temperature_degc: float, climate: Climate) -> float:
    """Heat over electric power of the heat pump, linear in the ambient temperature and never below 1.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> heat_pump_cop(-50.0, load_vehicle("bmw_i3_60ah").climate)
    1.0
    """
    cop = climate.heat_pump_cop_at_0_degc + climate.heat_pump_cop_per_k * ambient_temperature_degc
    return max(1.0, cop)
