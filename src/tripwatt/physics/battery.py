"""The high-voltage battery: open-circuit voltage behind one resistance, charge counting, one temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, PerTrip
from tripwatt.physics.relaxation import Relaxation
from tripwatt.units import SECONDS_PER_HOUR, ZERO_CELSIUS_K
from tripwatt.vehicles import Battery

MOLAR_GAS_CONSTANT_J_MOL_K: Final = 8.314462618
"""CODATA 2018."""


MOST_PASSES: Final = 60
"""A bound of the time; a choice, because the passes settle after four or five."""
TINY: Final = float(np.finfo(np.float64).tiny)


def open_circuit_voltage(soc: PerTrip, battery: Battery) -> FloatArray:
    """Open-circuit voltage of the pack [V], linear between the table's points. Shape of `soc`.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> open_circuit_voltage(np.array([0.5]), load_vehicle("bmw_i3_60ah").battery).round(1)
    array([356.9])
    """
    return np.asarray(battery.cells_in_series * _between(soc, battery.ocv_soc, battery.ocv_v))


def _between(soc: PerTrip, grid: tuple[float, ...], values: tuple[float, ...]) -> FloatArray:
    """Values of a table between its points, shape of `soc`; each trip has its own table where `values` are several."""
    if np.ndim(values) == 1:
        return np.asarray(np.interp(soc, grid, values))
    rows = np.broadcast_to(soc, (len(values), np.shape(soc)[-1] if np.ndim(soc) else 1))
    return np.stack([np.interp(row, grid, own) for row, own in zip(rows, values, strict=True)])


def usable_energy_wh(battery: Battery) -> float:
    """Energy between 0 and 1 of the displayed state of charge [Wh]."""
    window = np.linspace(battery.displayed_zero_soc, battery.displayed_full_soc, 101)
    mean_v = float(open_circuit_voltage(window, battery).mean())
    return battery.capacity_ah * mean_v * float(window[-1] - window[0])


def internal_resistance(soc: FloatArray, temperature_degc: FloatArray, battery: Battery) -> FloatArray:
    """Resistance of the pack [ohm]: table over state of charge, Arrhenius law over temperature. Shape of `soc`.

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
    inverse_k = 1.0 / (temperature_degc + ZERO_CELSIUS_K)
    return np.asarray(table * np.exp(scale * (inverse_k - 1.0 / reference)), dtype=np.float64)


def battery_current(power_w: FloatArray, ocv_v: FloatArray, resistance_ohm: FloatArray) -> FloatArray:
    """Current [A] that gives a terminal power, from P = (U - I R) I, the smaller root. + discharges.

    The caller keeps the power below U²/(4 R). The form 2 P / (U + sqrt(U² - 4 R P)) also holds without resistance.

    Examples
    --------
    >>> battery_current(np.array([900.0]), np.array([100.0]), np.array([1.0]))
    array([10.])
    """
    root = np.sqrt(np.maximum(ocv_v * ocv_v - 4.0 * resistance_ohm * power_w, 0.0))
    return np.asarray(2.0 * power_w / (ocv_v + root), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class BatteryRun:
    """The battery over a trip. Arrays have shape (..., samples); value k belongs to the interval that ends at k.

    `power_w` [W] is the terminal power after limits, `refused_power_w` [W] the charging power that found no room,
    `open_circuit_power_w` [W] the terminal power with the heat in the battery; `soc` and `temperature_degc` are those at the
    end of the interval: `soc` is never above full, and falls below empty where the drive takes more than the battery
    holds. `converged` is whether the passes settled, shape (..., 1).
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
    voltage = np.minimum(np.maximum(0.5 * ocv_v, floor_v), ocv_v)
    # a battery without resistance has a power without limit; this keeps the number finite
    resistance = np.maximum(resistance_ohm, 1e-12)
    return np.asarray(voltage * (ocv_v - voltage) / resistance, dtype=np.float64)


def shift(initial: PerTrip, values: FloatArray) -> FloatArray:
    """State at the start of each interval, for the states at their ends. Shape of `values`.

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
    """Charge gained since the start when it may not exceed `room`, and what found none of each gain. O(samples).

    What is refused up to an interval is the largest excess of the free sum up to there (the reflection of Skorokhod).

    Examples
    --------
    >>> kept_charge(np.array([1.0, 2.0, -1.0, 2.0]), 2.0)
    (array([1., 2., 1., 2.]), array([0., 1., 0., 1.]))
    """
    free = gains.cumsum(axis=-1)
    if (free.max(axis=-1, keepdims=True) <= room).all():
        return free, np.zeros_like(free)
    lost = np.maximum.accumulate(np.maximum(free - room, 0.0), axis=-1)
    return free - lost, lost - shift(0.0, lost)


def first_guess(
    battery: Battery,
    power_w: FloatArray,
    step_s: FloatArray,
    initial_soc: PerTrip,
    initial_temperature_degc: PerTrip,
) -> tuple[FloatArray, FloatArray]:
    """State of charge, shape of `power_w`, and constant temperature to start the passes of `discharge` from. O(samples)."""
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

    The state of an interval depends on those before it alone, so repeated passes over the whole trip (open-circuit
    voltage -> current -> charge -> state) settle; four or five do. Of several trips, one that has settled takes its last pass
    again while the others go on, so each ends as it does alone.

    A full battery takes no more: the charge never rises above what the display shows as full, or above that of the
    start. An empty one keeps the voltage and the resistance that it has at empty: what a drive takes beyond its charge
    is counted as charge below empty, not cut.

    Parameters
    ----------
    power_w, step_s : ndarray, shape (samples,) or (trips, samples)
        Terminal power wanted [W], + discharges, and length [s] of the interval that ends at each sample.
    guess : tuple of ndarray, optional
        State of charge and temperature of a run under a similar power, to start from.
    """
    per_step = step_s / (battery.capacity_ah * SECONDS_PER_HOUR)
    loss = battery.heat_loss_w_k
    warming = Relaxation(step_s * (np.asarray(loss) / battery.heat_capacity_j_k))
    floor_v = battery.min_cell_voltage_v * battery.cells_in_series
    if guess is None:
        guess = first_guess(battery, power_w, step_s, initial_soc, initial_temperature_degc)
    soc, temperature = guess
    empty = np.minimum(initial_soc, battery.displayed_zero_soc)
    room = np.maximum(battery.displayed_full_soc - initial_soc, 0.0)
    highest_w = power_w.max(axis=-1, keepdims=True)
    for _ in range(MOST_PASSES):
        before = np.maximum(shift(initial_soc, soc), empty)
        ocv = open_circuit_voltage(before, battery)
        resistance = internal_resistance(before, shift(initial_temperature_degc, temperature), battery)
        least = largest_power(
            ocv.min(axis=-1, keepdims=True), resistance.max(axis=-1, keepdims=True), floor_v
        )
        limited = (highest_w > least).any()  # the power of a trip beyond the least bound of its intervals
        bound = largest_power(ocv, resistance, floor_v) if limited else least
        allowed = np.minimum(power_w, bound) if limited else power_w
        wanted = battery_current(allowed, ocv, resistance)
        gained, refused = kept_charge(-wanted * per_step, room)
        spills = bool(refused.any())
        current = wanted + refused / np.maximum(per_step, TINY) if spills else wanted
        new_soc = initial_soc + gained
        heat = current * current * resistance
        if np.all(loss > 0.0):
            warmed = warming.solve(initial_temperature_degc, ambient_temperature_degc + heat / loss)
        else:
            gained_k = heat * (step_s / battery.heat_capacity_j_k)
            warmed = initial_temperature_degc + gained_k.cumsum(axis=-1)
        # passes that agree to 5e-5 have converged: each cuts the error by about 50
        settled = np.abs(new_soc - soc).max(axis=-1, keepdims=True) < 5e-5
        if settled.all():
            break
        soc, temperature = np.where(settled, soc, new_soc), np.where(settled, temperature, warmed)
    power = np.where(refused > 0.0, (ocv - current * resistance) * current, allowed) if spills else allowed
    return BatteryRun(
        power_w=power,
        refused_power_w=power - allowed,
        current_a=current,
        open_circuit_power_w=ocv * current,
        terminal_voltage_v=ocv - current * resistance,
        soc=new_soc,
        temperature_degc=warmed,
        voltage_floor=power_w > bound,
        converged=settled,
    )
