"""Model of the high-voltage battery: an open-circuit voltage and one resistance in series, a charge count, one temperature."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, PerTrip, Relaxation
from tripwatt.units import SECONDS_PER_HOUR, ZERO_CELSIUS_K
from tripwatt.vehicles import Battery
from tripwatt.vehicles.losses import TINY

MOLAR_GAS_CONSTANT_J_MOL_K: Final = 8.314462618
"""CODATA 2018."""


MAX_PASSES: Final = 60
"""Largest number of passes of `discharge`, which bounds its time; a choice: the passes settle after four or five."""


def open_circuit_voltage(soc: PerTrip, battery: Battery) -> FloatArray:
    """Open-circuit voltage of the pack [V], by linear interpolation in the table of the cells. Shape of `soc`.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> open_circuit_voltage(np.array([0.5]), load_vehicle("bmw_i3_60ah").battery).round(1)
    array([356.9])
    """
    return np.asarray(battery.cells_in_series * _between(soc, battery.ocv_soc, battery.ocv_v))


def _between(soc: PerTrip, grid: tuple[float, ...], values: tuple[float, ...]) -> FloatArray:
    """Interpolate a table linearly, shape of `soc`; if `values` has two dimensions, each trip has its own row."""
    if isinstance(values, tuple):
        return np.asarray(np.interp(soc, _points(grid), _points(values)))
    rows = np.broadcast_to(soc, (len(values), np.shape(soc)[-1] if np.ndim(soc) else 1))
    return np.stack([np.interp(row, _points(grid), own) for row, own in zip(rows, values, strict=True)])


_points: Final = lru_cache(1024)(np.array)
"""Arrays of the tables of cars, which take as long to make as an interpolation."""


def usable_energy_wh(battery: Battery) -> float:
    """Return the energy between a displayed state of charge of 0 and of 1 [Wh]."""
    window = np.linspace(battery.displayed_zero_soc, battery.displayed_full_soc, 101)
    mean_v = float(open_circuit_voltage(window, battery).mean())
    return battery.capacity_ah * mean_v * float(window[-1] - window[0])


def internal_resistance(soc: FloatArray, temperature_degc: FloatArray, battery: Battery) -> FloatArray:
    """Resistance of the pack [ohm]: a table over state of charge times an Arrhenius factor of temperature. Shape of `soc`.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> battery = load_vehicle("bmw_i3_60ah").battery
    >>> internal_resistance(np.array([0.5, 0.5]), np.array([25.0, 0.0]), battery).round(3)
    array([0.079, 0.165])
    """
    table = battery.cells_in_series * _between(soc, battery.resistance_soc, battery.resistance_ohm)
    scale = battery.resistance_activation_energy_j_mol / MOLAR_GAS_CONSTANT_J_MOL_K
    reference = battery.resistance_temperature_degc + ZERO_CELSIUS_K
    exponent = scale / (temperature_degc + ZERO_CELSIUS_K) - scale / reference
    return np.asarray(table * np.exp(exponent), dtype=np.float64)


def battery_current(power_w: FloatArray, ocv_v: FloatArray, resistance_ohm: FloatArray) -> FloatArray:
    """Current I [A] at which the battery gives a terminal power P: the smaller root of P = (U - I R) I. + discharges.

    U is the open-circuit voltage, R the resistance. The caller has to keep P below U²/(4 R). The form used here,
    2 P / (U + sqrt(U² - 4 R P)), also holds for R = 0.

    Examples
    --------
    >>> battery_current(np.array([900.0]), np.array([100.0]), np.array([1.0]))
    array([10.])
    """
    root = np.sqrt(np.maximum(ocv_v * ocv_v - 4.0 * resistance_ohm * power_w, 0.0))
    return np.asarray(2.0 * power_w / (ocv_v + root), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class BatteryRun:
    """State of the battery along a trip. Arrays have shape (..., samples); value k belongs to the interval that ends at k.

    `power_w` [W] is the terminal power, without what a full battery refused, `refused_power_w` [W] the charging power that the full battery did not take,
    `open_circuit_power_w` [W] the terminal power plus the heat in the battery. `soc` and `temperature_degc` are the values at the
    end of the interval. `soc` never rises above full; it falls below empty if the drive takes more than the battery holds.
    `voltage_floor` marks intervals with more than the largest power at the lowest cell voltage. `converged` states whether the passes
    settled, shape (..., 1).
    """

    power_w: FloatArray
    refused_power_w: FloatArray
    current_a: FloatArray
    open_circuit_power_w: FloatArray
    terminal_voltage_v: FloatArray
    soc: FloatArray
    temperature_degc: FloatArray
    voltage_floor: BoolArray
    converged: BoolArray


def largest_power(ocv_v: FloatArray, resistance_ohm: FloatArray, floor_v: PerTrip) -> FloatArray:
    """Largest terminal power [W] that keeps the voltage above `floor_v`. Shape of `ocv_v`.

    Examples
    --------
    >>> largest_power(np.array([100.0]), np.array([1.0]), 90.0), largest_power(np.array([100.0]), np.array([1.0]), 0.0)
    (array([900.]), array([2500.]))
    """
    voltage = lowest_voltage(ocv_v, floor_v)
    # a battery without resistance has a power without limit; this keeps the number finite
    resistance = np.maximum(resistance_ohm, 1e-12)
    return np.asarray(voltage * (ocv_v - voltage) / resistance, dtype=np.float64)


def lowest_voltage(ocv_v: FloatArray, floor_v: PerTrip) -> FloatArray:
    """Terminal voltage at the largest power [V]: the floor, or half the open-circuit voltage if that is higher. Shape of `ocv_v`.

    Examples
    --------
    >>> lowest_voltage(np.array([100.0]), 90.0), lowest_voltage(np.array([100.0]), 0.0)
    (array([90.]), array([50.]))
    """
    return np.minimum(np.maximum(0.5 * ocv_v, floor_v), ocv_v)


def shift(initial: PerTrip, values: FloatArray) -> FloatArray:
    """State at the start of each interval, from the states at the ends and the initial one. Shape of `values`.

    Examples
    --------
    >>> shift(0.0, np.array([1.0, 2.0]))
    array([0., 1.])
    """
    result = np.empty_like(values)
    result[..., :1] = initial
    result[..., 1:] = values[..., :-1]
    return result


def kept_charge(gains: FloatArray, room: PerTrip) -> tuple[FloatArray, FloatArray]:
    """Sum the gains of charge without exceeding `room`, and return this sum and the refused part of each gain, or one 0. O(samples).

    The charge refused up to an interval is the largest excess of the unlimited sum over `room` up to there (Skorokhod reflection).

    Examples
    --------
    >>> kept_charge(np.array([1.0, 2.0, -1.0, 2.0]), 2.0)
    (array([1., 2., 1., 2.]), array([0., 1., 0., 1.]))
    """
    free = gains.cumsum(axis=-1)
    if (free.max(axis=-1, keepdims=True) <= room).all():
        return free, np.zeros_like(room)
    lost = np.maximum.accumulate(np.maximum(free - room, 0.0), axis=-1)
    return free - lost, lost - shift(0.0, lost)


def first_guess(
    battery: Battery,
    power_w: FloatArray,
    step_s: FloatArray,
    initial_soc: PerTrip,
    initial_temperature_degc: PerTrip,
) -> tuple[FloatArray, FloatArray]:
    """Estimate the state of charge, shape of `power_w`, and the constant temperature with which `discharge` starts. O(samples)."""
    nominal = open_circuit_voltage(initial_soc, battery)
    drawn = (power_w * (step_s / (battery.capacity_ah * SECONDS_PER_HOUR))).cumsum(axis=-1) / nominal
    halfway = open_circuit_voltage(initial_soc - 0.5 * drawn[..., -1:], battery)
    soc = initial_soc - drawn * (nominal / halfway)
    return soc, np.broadcast_to(initial_temperature_degc, (*soc.shape[:-1], 1))


def discharge(
    battery: Battery,
    power_w: FloatArray,
    step_s: FloatArray,
    ambient_temperature_degc: PerTrip,
    initial_soc: PerTrip,
    initial_temperature_degc: PerTrip,
    *,
    guess: tuple[FloatArray, FloatArray] | None = None,
) -> BatteryRun:
    """Draw a terminal power from the battery. O(samples x passes), no loop over samples.

    The state in an interval depends only on earlier intervals, so repeated passes over the whole trip (open-circuit
    voltage -> current -> charge -> state) settle, usually after four or five. A trip that has settled repeats its last pass
    while other trips go on, so its result is the same as for this trip alone.

    A full battery takes no more charge: the state of charge never rises above the one that the display shows as full or, if
    higher, the one at the start. An empty battery keeps its voltage and resistance at empty: charge that a drive takes beyond
    empty is counted as a state of charge below empty. Beyond the largest power the voltage stays at its lowest value. In both cases
    the power is not cut: the energy that a trip needs does not fall when the battery cannot give it.

    Parameters
    ----------
    power_w, step_s : ndarray, shape (samples,) or (trips, samples)
        Terminal power wanted [W], + discharges, and length [s] of the interval that ends at each sample.
    guess : tuple of ndarray, optional
        State of charge and temperature of a run under a similar power, with which the passes start.
    """
    per_step = step_s / (battery.capacity_ah * SECONDS_PER_HOUR)
    loss = battery.heat_loss_w_k
    warming = Relaxation(step_s * (np.asarray(loss) / battery.heat_capacity_j_k))
    floor_v = battery.min_cell_voltage_v * battery.cells_in_series
    soc, temperature = guess or first_guess(battery, power_w, step_s, initial_soc, initial_temperature_degc)
    empty = np.minimum(initial_soc, battery.displayed_zero_soc)
    room = np.maximum(battery.displayed_full_soc - initial_soc, 0.0)
    highest_w, cools = power_w.max(axis=-1, keepdims=True), np.all(loss > 0.0)
    for _ in range(MAX_PASSES):
        before = np.maximum(shift(initial_soc, soc), empty)
        ocv = open_circuit_voltage(before, battery)
        resistance = internal_resistance(before, shift(initial_temperature_degc, temperature), battery)
        least = largest_power(
            ocv.min(axis=-1, keepdims=True), resistance.max(axis=-1, keepdims=True), floor_v
        )
        limited = (highest_w > least).any()  # some power exceeds the smallest bound of its trip
        bound = largest_power(ocv, resistance, floor_v) if limited else least
        wanted = battery_current(power_w, ocv, resistance)
        if limited:
            wanted = np.where(power_w > bound, power_w / lowest_voltage(ocv, floor_v), wanted)
        gained, refused = kept_charge(wanted * -per_step, room)
        spills = bool(refused.any())
        current = wanted + refused / np.maximum(per_step, TINY) if spills else wanted
        new_soc = initial_soc + gained
        drop = current * resistance
        if limited:
            drop = np.where(power_w > bound, ocv - lowest_voltage(ocv, floor_v), drop)
        heat = current * drop
        if cools:
            warmed = warming.solve(initial_temperature_degc, ambient_temperature_degc + heat / loss)
        else:
            gained_k = heat * (step_s / battery.heat_capacity_j_k)
            warmed = initial_temperature_degc + gained_k.cumsum(axis=-1)
        # passes that agree to 5e-5 have converged: each cuts the error by about 50
        settled = np.abs(new_soc - soc).max(axis=-1, keepdims=True) < 5e-5
        if settled.all():
            break
        soc, temperature = np.where(settled, soc, new_soc), np.where(settled, temperature, warmed)
    power = np.where(refused > 0.0, (ocv - drop) * current, power_w) if spills else power_w
    return BatteryRun(
        power_w=power,
        refused_power_w=power - power_w,
        current_a=current,
        open_circuit_power_w=ocv * current,
        terminal_voltage_v=ocv - drop,
        soc=new_soc,
        temperature_degc=warmed,
        voltage_floor=power_w > bound,
        converged=settled,
    )
