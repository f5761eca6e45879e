"""Log the truth with noise, in the steps in which a car's bus reports it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.study.synthetic.roads import RoadDrive
from tripwatt.study.synthetic.scenario import SENSORS, Scenario, stream
from tripwatt.study.synthetic.world import Truth
from tripwatt.units import M_S_PER_KM_H
from tripwatt.vehicles import Vehicle


def quantise(values: FloatArray, step: float) -> FloatArray:
    """Round values to whole steps, without binary rounding errors such as 0.30000000000000004."""
    steps_per_unit = round(1.0 / step) if step < 1.0 else 1.0 / step
    return np.asarray(np.round(values * steps_per_unit) / steps_per_unit, dtype=np.float64)


def log_samples(
    scenario: Scenario, drive: RoadDrive, truth: Truth, vehicle: Vehicle, seed: int
) -> pd.DataFrame:
    """Log a trip as a table in canonical columns. O(samples)."""
    rng = stream(seed, SENSORS, *scenario.key)
    climate, battery, cells = truth.climate, truth.battery, vehicle.battery
    n = len(drive.profile.time_s)
    true_speed = drive.profile.speed_m_s
    speed_km_h = true_speed / M_S_PER_KM_H + 0.12 * rng.standard_normal(n)
    # a wheel at standstill gives no pulses, so its speed is exactly 0
    speed = np.where(true_speed > 0.1, quantise(np.maximum(speed_km_h, 0.0), 0.1) * M_S_PER_KM_H, 0.0)
    empty, full = cells.displayed_from_soc(0.0), cells.displayed_from_soc(1.0)
    displayed = empty + battery.soc * (full - empty)
    heater_seen = np.where(climate.heating_power_w > 40.0, climate.heating_power_w, 0.0)
    return pd.DataFrame(
        {
            "time_s": drive.profile.time_s,
            "speed_m_s": speed,
            "elevation_m": quantise(drive.elevation_m + 0.15 * rng.standard_normal(n), 0.5),
            "ambient_temperature_degc": quantise(truth.ambient_temperature_degc, 0.5),
            "cabin_temperature_degc": quantise(
                climate.cabin_temperature_degc + 0.05 * rng.standard_normal(n), 0.1
            ),
            "cabin_setpoint_degc": np.full(n, scenario.setpoint_degc),
            "battery_temperature_degc": quantise(battery.temperature_degc, 0.5),
            "voltage_v": quantise(battery.terminal_voltage_v + 0.1 * rng.standard_normal(n), 0.1),
            "current_a": quantise(battery.current_a + 0.15 * rng.standard_normal(n), 0.1),
            "soc": quantise(battery.soc, 0.001),
            "displayed_soc": quantise(np.clip(displayed, 0.0, 1.0), 0.005),
            "heating_power_w": quantise(heater_seen, 20.0),
            "requested_heating_power_w": quantise(climate.requested_heating_power_w, 20.0),
            "aircon_power_w": quantise(climate.aircon_power_w, 20.0),
        }
    )
