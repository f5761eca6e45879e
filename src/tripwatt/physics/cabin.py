"""Model of the cabin: heat of air and interior, outside air, sun, and an automatic climate control with its limits.

The inputs are known before departure: speed trace, ambient temperature, set-point, cabin temperature at departure, and an
estimate of the sun.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import truth
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, distance_driven, running_sum
from tripwatt.vehicles import Climate

CONTROL_STEP_S: Final = 10.0
"""Step of the climate control; the cabin's air responds in about a minute."""

MIN_SIDE_BY_SIDE: Final = 32
"""Smallest number of cabins whose steps are computed with arrays; for fewer, plain numbers are faster."""

UNKNOWN_SUN_W_M2: Final = 300.0
"""Irradiance assumed if the weather is unknown: about the mean of a bright half-day in middle latitudes."""

SUN_W_M2: Final = (
    (("dark", "night"), 0.0),
    (("sunrise", "sunset"), 50.0),
    (("rain", "snow", "fog"), 100.0),
    (("slightly cloudy", "partly cloudy"), 400.0),
    (("cloudy", "overcast"), 150.0),
    (("sun", "clear"), 600.0),
)
"""Global irradiance for words of a weather report in summer; the first entry with a word of the report counts.

Under a clear sky the half-day around noon has about 600 W/m² in middle latitudes. Under a share `N` of cloud it is
``1 - 0.75 N**3.4`` of that (Kasten and Czeplak 1980, Solar Energy 24, 177-189): 150 W/m² under an overcast sky, and
310 to 580 W/m² if three to seven eighths are covered, from which 400 is taken for "partly cloudy". Rain, snow and fog have
less than an overcast sky, 100 W/m²; around sunrise and sunset the sun stands below 5 degrees.
"""

WINTER_SUN: Final = 0.5
"""Irradiance in winter over that in summer: the noon sun stands at 18 to 20 degrees in 48° N."""


def irradiance(weather: str | None, season: str | None = None) -> float:
    """Solar irradiance [W/m²] expected from a weather report; `UNKNOWN_SUN_W_M2` without a report.

    Examples
    --------
    >>> irradiance("dark, little rainy"), irradiance("sunny", "winter"), irradiance(None)
    (0.0, 300.0, 300.0)
    """
    if weather is None:
        return UNKNOWN_SUN_W_M2
    told = weather.lower()
    sun_w_m2 = next((sun for words, sun in SUN_W_M2 if any(w in told for w in words)), UNKNOWN_SUN_W_M2)
    return sun_w_m2 * (WINTER_SUN if season == "winter" else 1.0)


HEAT_PUMP_RATING_DEGC: Final = 7.0
"""Outside air at which the largest heat of a heat pump is stated, as in EN 14511."""

HEAT_PUMP_HEAT_PER_K: Final = 0.03
"""Change of a heat pump's largest heat for each kelvin of outside air [1/K]. At full speed a compressor moves mass in
proportion to the density of the vapour it draws in; for R134a that evaporates 8 K below the air this is 13.9 kg/m³ at 7 °C,
10.4 at -1 °C and 7.3 at -10 °C (NIST REFPROP)."""

HEAT_PUMP_MOST: Final = 1.5
"""Largest heat of a heat pump in warm air over that at the rating: controls let it rise no further."""


@dataclass(frozen=True, slots=True)
class CabinStart:
    """What is known of the cabin at departure.

    Attributes
    ----------
    temperature_degc : float
        Temperature of air and interior [°C].
    setpoint_degc : float
        Temperature that the driver has set [°C].
    solar_irradiance_w_m2 : float
    warmth : float
        0 after a long stop, 1 when windows and seats are warm and dry from a drive just before.
    mode : {"auto", "heat", "cool"}
        What climate control may do.
    interior_degc : float, optional
        Temperature of the interior if it differs from the air, as after a short preheating [°C].
    """

    temperature_degc: float
    setpoint_degc: float
    solar_irradiance_w_m2: float = UNKNOWN_SUN_W_M2
    warmth: float = 0.0
    mode: str = "auto"
    interior_degc: float | None = None


@dataclass(frozen=True, eq=False, slots=True)
class CabinRun:
    """Powers and temperatures of a cabin: in each step of the climate control, and at the samples of the drive.

    Attributes
    ----------
    time_s : ndarray, shape (samples,)
    edges_s : ndarray, shape (steps + 1,)
        Times between the steps of the control [s].
    heat_w, fan_w : ndarray, shape (steps,)
        Electric power of heater and compressor, and of blower, rear window and seats, in each step.
    air_degc, interior_degc : ndarray, shape (steps + 1,)
        Temperature of the air, and of seats, trim and glass, at the edges.
    """

    time_s: FloatArray
    edges_s: FloatArray
    heat_w: FloatArray
    fan_w: FloatArray
    air_degc: FloatArray
    interior_degc: FloatArray

    @property
    def power_w(self) -> FloatArray:
        """Electric power of the climate control [W], shape (samples,): mean over the interval that ends at the sample."""
        return self.means(self.heat_w + self.fan_w)

    @property
    def fan_power_w(self) -> FloatArray:
        """Part of `power_w` that blower, rear window and seats take; logs do not count it as heater or air conditioner."""
        return self.means(self.fan_w)

    @property
    def temperature_degc(self) -> FloatArray:
        """Temperature of the air at the samples [°C], shape (samples,)."""
        return np.interp(self.time_s, self.edges_s, self.air_degc)

    def means(self, power_w: FloatArray) -> FloatArray:
        """Average a power given in steps of the control over the interval that ends at each sample. O(samples)."""
        cumulative = np.interp(self.time_s, self.edges_s, running_sum(power_w * CONTROL_STEP_S))
        mean_w = (cumulative[1:] - cumulative[:-1]) / (self.time_s[1:] - self.time_s[:-1])
        return np.maximum(np.concatenate((power_w[:1], mean_w)), 0.0)


@dataclass(frozen=True, eq=False, slots=True)
class CabinTask:
    """A cabin to keep at its set-point along a speed trace: arrays of shape (samples,)."""

    climate: Climate
    time_s: FloatArray
    speed_m_s: FloatArray
    ambient_temperature_degc: float
    start: CabinStart

    def edges(self) -> FloatArray:
        """Times between the steps of the control [s], shape (steps + 1,)."""
        steps = max(1, math.ceil(float(self.time_s[-1] - self.time_s[0]) / CONTROL_STEP_S))
        return np.asarray(self.time_s[0] + CONTROL_STEP_S * np.arange(steps + 1))

    def mean_speeds(self) -> FloatArray:
        """Mean speed in each step of the control [m/s], shape (steps,)."""
        distance = np.interp(self.edges(), self.time_s, distance_driven(self.time_s, self.speed_m_s))
        return np.asarray((distance[1:] - distance[:-1]) / CONTROL_STEP_S)

    def run_from(self, air_degc: FloatArray, interior_degc: FloatArray) -> CabinRun:
        """Simulate the cabin from several temperatures of air and interior at departure, each of shape (starts,). O(steps).

        The arrays of the run have shape (steps, starts).
        """
        control = control_values(self.climate, self.ambient_temperature_degc, self.start)[2:]
        # NumPy multiplies by an array without dimensions faster than by a number
        start = air_degc, interior_degc, *map(np.asarray, control)
        speeds = self.mean_speeds().tolist()
        return self.run(*_control_steps(start, speeds, np.minimum, np.maximum, np.logical_or.reduce))

    def run(self, heat_w: FloatArray, fan: FloatArray, *degc: FloatArray) -> CabinRun:
        """Build the run from the results of the control steps.

        `heat_w` is the power of heater and compressor, `fan` the share of the blower, `degc` are the temperatures of air and
        interior at the edges.
        """
        climate = self.climate
        fans = climate.blower_low_power_w + (climate.blower_high_power_w - climate.blower_low_power_w) * fan
        # over 4 K around the threshold fewer and fewer cars have dew or frost; a choice
        frost = 0.5 + (climate.defrost_below_degc - self.ambient_temperature_degc) / 4.0
        if frost > 0.0 and self.start.mode != "cool":
            share = min(frost, 1.0) * (1.0 - self.start.warmth)
            fans[: math.ceil(climate.defrost_time_s / CONTROL_STEP_S)] += share * climate.defrost_power_w
        return CabinRun(self.time_s, self.edges(), heat_w, fans, *degc)


def condition_cabins(tasks: Sequence[CabinTask]) -> list[CabinRun]:
    """Simulate cabins that climate control keeps at their set-points. O(samples + duration / CONTROL_STEP_S).

    Air and interior are two heat capacities, stepped implicitly. The control demands the heat that brings the air
    towards the set-point with its time constant; heater and cooler deliver it up to their limits. The more heat is
    demanded, the more fresh air is blown in. Cool outside air cools without the compressor. Give cabins of similar
    durations together: shorter ones are padded.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> time, cold = np.arange(0.0, 1201.0), CabinStart(-10.0, 22.0)
    >>> (run,) = condition_cabins([CabinTask(load_vehicle("bmw_i3_60ah").climate, time, np.zeros(1201), -10.0, cold)])
    >>> bool(run.power_w[60] > run.power_w[-1]), bool(20.0 < run.temperature_degc[-1] < 22.5)
    (True, True)
    """
    speeds = [task.mean_speeds() for task in tasks]
    controls = [control_values(task.climate, task.ambient_temperature_degc, task.start) for task in tasks]
    return [task.run(*of) for task, of in zip(tasks, control_steps(controls, speeds), strict=True)]


def control_steps(
    controls: Sequence[tuple[float, ...]], speeds: Sequence[FloatArray]
) -> list[tuple[FloatArray, ...]]:
    """Compute the control steps of several cabins from their `control_values` and the speed in each step [m/s]. O(steps).

    Returns four arrays for each cabin: the power of heater and compressor [W] and the share of the blower in each step, and the
    temperatures of the air and of the interior [°C] before the first step and after each step.
    """
    if len(speeds) < MIN_SIDE_BY_SIDE:
        return [
            _control_steps(control, own.tolist(), _smaller, _larger, truth)
            for control, own in zip(controls, speeds, strict=True)
        ]
    together = np.zeros((max(map(len, speeds)), len(speeds)))
    for column, own in enumerate(speeds):
        together[: len(own), column] = own
    steps = _control_steps(np.array(controls).T, together, np.minimum, np.maximum, np.logical_or.reduce)
    return [
        tuple(of[: n + (len(of) > len(together)), column] for of in steps)
        for column, n in enumerate(map(len, speeds))
    ]


def control_values(climate: Climate, ambient: float, start: CabinStart) -> tuple[float, ...]:
    """Return the constants of the control steps of a cabin, in the order in which `_control_steps` unpacks them."""
    dt = CONTROL_STEP_S
    air_rate, interior_rate = climate.air_heat_capacity_j_k / dt, climate.interior_heat_capacity_j_k / dt
    exchange, share = climate.interior_exchange_w_k, climate.solar_share_to_air
    sun = climate.solar_aperture_m2 * start.solar_irradiance_w_m2
    shell, fresh = climate.shell_w_k + climate.fresh_air_low_w_k, climate.fresh_air_high_w_k
    inflow = climate.occupant_heat_w + share * sun + shell * ambient
    approach = 1.0 - math.exp(-dt / climate.control_time_s)
    max_heat, max_cooling = climate.heater_max_heat_w, climate.cooler_max_heat_w
    resistive, pumped = 1.0 / climate.heater_efficiency, 1.0 / heat_pump_cop(ambient, climate)
    settled = interior_rate + exchange
    within = start.temperature_degc if start.interior_degc is None else start.interior_degc
    air = start.temperature_degc, within, ambient, air_rate, exchange, air_rate + shell + exchange, inflow
    flows = climate.shell_per_speed_w_s_k_m, fresh - climate.fresh_air_low_w_k
    aims = 1.0 - approach, approach * start.setpoint_degc
    limits = max_heat * (start.mode != "cool"), max_cooling * (start.mode != "heat")
    powers = resistive, pumped - resistive, 1.0 / climate.cooler_cop, climate.compressor_idle_w
    fans = 1.0 / (max_heat or math.inf), 1.0 / max_cooling
    interior = interior_rate / settled, exchange / settled, (1.0 - share) * sun / settled
    return *air, *flows, *aims, *limits, heat_pump_heat(ambient, climate), *powers, *fans, *interior


def _control_steps(
    control: Iterable[Any], speeds: Iterable[Any], smaller: Any, larger: Any, some: Any
) -> tuple[FloatArray, ...]:
    """Compute the four arrays of `control_steps` for one cabin, or for several cabins together.

    For one cabin the values are numbers, and the functions are `_smaller`, `_larger` and `truth`; for several they are arrays
    and functions of NumPy.
    """
    air, interior, ambient, air_rate, exchange, rates, inflow, per_speed, fan_range, *others = control
    keep, aim, max_heat, max_cooling, max_pumped, resistive, pumped, cooler, idle, *others = others
    per_heat, per_cooling, interior_keeps, interior_takes, interior_gains = others
    fan = 0.0 * air
    powers, shares, temperatures, interiors = [], [], [air], [interior]
    for speed in speeds:
        through = per_speed * speed + fan * fan_range
        total = rates + through
        given = air_rate * air + exchange * interior + through * ambient + inflow
        wanted = total * (keep * air + aim) - given
        demand = larger(wanted, 0.0)
        heat = smaller(demand, max_heat)
        power = heat * resistive + smaller(heat, max_pumped) * pumped
        blown, fan = fan, heat * per_heat
        if some(wanted < 0.0):
            surplus = demand - wanted
            free = smaller((1.0 - blown) * fan_range * larger(air - ambient, 0.0), surplus)
            cooling = smaller(surplus - free, max_cooling)
            # for less than 100 W of cooling the compressor cycles and takes a share of its idle power; a choice
            power = power + larger(cooling * cooler, idle * smaller(cooling * (1.0 / 100.0), 1.0))
            fan = fan + smaller((cooling + free) * per_cooling, 1.0)
            heat = heat - (cooling + free)
        air = (given + heat) / total
        interior = interior_keeps * interior + interior_takes * air + interior_gains
        powers.append(power)
        shares.append(fan)
        temperatures.append(air)
        interiors.append(interior)
    return np.array(powers), np.array(shares), np.array(temperatures), np.array(interiors)


def _smaller(a: float, b: float) -> float:
    return a if a < b else b  # half the time of `min`


def _larger(a: float, b: float) -> float:
    return a if a > b else b


def heat_pump_heat(ambient_temperature_degc: float, climate: Climate) -> float:
    """Largest heat of the heat pump [W] at an outside temperature; the resistive heater supplies the rest.

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
    """Coefficient of performance of the heat pump [1], linear in the ambient temperature and at least 1.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> heat_pump_cop(-50.0, load_vehicle("bmw_i3_60ah").climate)
    1.0
    """
    cop = climate.heat_pump_cop_at_0_degc + climate.heat_pump_cop_per_k * ambient_temperature_degc
    return max(1.0, cop)
