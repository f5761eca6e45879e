"""The battery: by hand, and against a loop over samples."""

import math

import numpy as np
import pytest

from tripwatt.physics import battery as battery_module
from tripwatt.physics.battery import (
    discharge,
    internal_resistance,
    largest_power,
    open_circuit_voltage,
)
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.parts import Battery

EXACT = {"rel": 1e-12, "abs": 1e-12}


def pack(**changes: object) -> Battery:
    """100 cells of 3.5 V and 1 mOhm, 100 Ah, that lose no heat."""
    values: dict[str, object] = {
        "capacity_ah": 100.0,
        "cells_in_series": 100.0,
        "ocv_soc": (0.0, 1.0),
        "ocv_v": (3.5, 3.5),
        "resistance_soc": (0.0, 1.0),
        "resistance_ohm": (0.001, 0.001),
        "resistance_temperature_degc": 25.0,
        "resistance_activation_energy_j_mol": 0.0,
        "min_cell_voltage_v": 3.4,
        "max_cell_voltage_v": 3.6,
        "heat_capacity_j_k": 9_000.0,
        "heat_loss_w_k": 0.0,
        "displayed_zero_soc": 0.1,
        "displayed_full_soc": 0.9,
    }
    return Battery(**{**values, **changes})


class TestBattery:
    def test_arrhenius(self) -> None:
        """With an activation energy of 1000 K times the gas constant the exponent is 1000 K (1/T - 1/298.15 K)."""
        cold = pack(resistance_activation_energy_j_mol=8_314.462618)
        given = internal_resistance(np.array([0.5]), np.array([0.0]), cold)
        assert given == pytest.approx([0.1 * math.exp(1000.0 / 273.15 - 1000.0 / 298.15)], **EXACT)

    def test_largest_power(self) -> None:
        volts, ohms = np.full(4, 100.0), np.array([1.0, 1.0, 2.0, 1.0])
        assert largest_power(volts, ohms, 90.0)[:3] == pytest.approx([900.0, 900.0, 450.0], **EXACT)
        assert largest_power(volts, ohms, 0.0)[0] == 50.0 * 50.0
        assert (largest_power(volts, ohms, 110.0) == 0.0).all()

    def test_discharge_by_hand(self) -> None:
        """345 V 50 A: 50 A for 360 s are 5 Ah of 100; 50² 0.1 W for 360 s warm 9 kJ/K by 10 K."""
        step, power = np.array([0.0, 360.0, 360.0]), np.array([0.0, 17_250.0, -17_750.0])
        run = discharge(pack(), power, step, -10.0, 0.5, 20.0)
        assert run.converged
        assert run.power_w == pytest.approx(power, **EXACT)
        assert run.current_a == pytest.approx([0.0, 50.0, -50.0], **EXACT)
        assert run.terminal_voltage_v == pytest.approx([350.0, 345.0, 355.0], **EXACT)
        assert run.open_circuit_power_w == pytest.approx([0.0, 17_500.0, -17_500.0], **EXACT)
        assert run.soc == pytest.approx([0.5, 0.45, 0.5], **EXACT)
        assert run.temperature_degc == pytest.approx([20.0, 30.0, 40.0], **EXACT)
        assert not run.voltage_floor.any()

    def test_a_pack_that_loses_heat_settles(self) -> None:
        """25 W/K lose 9 kJ/K in 360 s; 250 W keep it 10 K above the air."""
        step, power = np.array([0.0, 360.0]), np.array([0.0, 17_250.0])
        run = discharge(pack(heat_loss_w_k=25.0), power, step, -10.0, 0.5, 20.0)
        assert run.temperature_degc == pytest.approx([20.0, 0.0 + 20.0 * math.exp(-1.0)], **EXACT)

    def test_voltage_floor(self) -> None:
        """At 340 V of 350 V flow 100 A: 34 kW. More is counted at this voltage."""
        power = np.array([33_000.0, 34_000.0, 40_000.0])
        run = discharge(pack(), power, np.zeros(3), 20.0, 0.5, 20.0)
        assert run.power_w == pytest.approx(power, **EXACT)
        assert run.current_a[1:] == pytest.approx([100.0, 40_000.0 / 340.0], **EXACT)
        assert run.terminal_voltage_v[1:] == pytest.approx([340.0, 340.0], **EXACT)
        assert run.voltage_floor[[0, 2]].tolist() == [False, True]

    def test_first_guess(self, monkeypatch) -> None:
        """One pass from the guess: 30 kW for 360 s at the voltage of half the way, 341.43 V."""
        monkeypatch.setattr(battery_module, "MAX_PASSES", 1)
        ideal = pack(ocv_v=(3.0, 4.0), resistance_ohm=(0.0, 0.0), min_cell_voltage_v=0.5)
        power, step = np.full(3, 30_000.0), np.array([0.0, 360.0, 360.0])
        with np.errstate(over="ignore"):
            run = discharge(ideal, power, step, 20.0, 0.5, 20.0)
        drawn = 2 * 30_000.0 * 0.001 / 350.0
        halfway = 300.0 + 100.0 * (0.5 - drawn / 2)
        guess = 0.5 - 30.0 / halfway
        volts = np.array([350.0, 350.0, 300.0 + 100.0 * guess])
        assert run.current_a == pytest.approx(30_000.0 / volts, **EXACT)
        assert not run.converged

    def test_passes_settle_where_the_state_repeats(self) -> None:
        """The current of the second interval belongs to the charge after the first."""
        ideal = pack(ocv_v=(3.0, 4.0), min_cell_voltage_v=0.5)
        power, step = np.full(3, 30_000.0), np.array([0.0, 360.0, 360.0])
        run = discharge(ideal, power, step, 20.0, 0.5, 20.0)
        first = (350.0 - math.sqrt(350.0**2 - 0.4 * 30_000.0)) / 0.2
        volts = 300.0 + 100.0 * (0.5 - 0.001 * first)
        second = (volts - math.sqrt(volts**2 - 0.4 * 30_000.0)) / 0.2
        assert run.converged
        assert run.soc == pytest.approx(
            [0.5, 0.5 - 0.001 * first, 0.5 - 0.001 * (first + second)], rel=0, abs=2e-6
        )
        again = discharge(ideal, power, step, 20.0, 0.5, 20.0, guess=(run.soc, run.temperature_degc))
        assert again.soc == pytest.approx(
            [0.5, 0.5 - 0.001 * first, 0.5 - 0.001 * (first + second)], rel=0, abs=1e-8
        )


@pytest.mark.parametrize(("soc", "temperature"), [(0.8, 20.0), (0.3, -15.0), (0.95, 35.0)])
def test_battery_passes_agree_with_a_loop_over_samples(i3: Vehicle, soc: float, temperature: float) -> None:
    battery = i3.battery
    rng = np.random.default_rng(3)
    step = rng.choice([0.1, 1.0, 20.0], size=400)
    step[0] = 0.0
    power = rng.normal(5_000.0, 15_000.0 if temperature > 0.0 else 4_000.0, 400)
    run = discharge(battery, power, step, 5.0, soc, temperature)
    charge, heat_c, full = soc, temperature, max(soc, battery.displayed_full_soc)
    for k in range(400):
        ocv = open_circuit_voltage(np.array([charge]), battery)[0]
        ohm = internal_resistance(np.array([charge]), np.array([heat_c]), battery)[0]
        current = (ocv - np.sqrt(ocv**2 - 4.0 * ohm * power[k])) / (2.0 * ohm)
        hours = step[k] / 3600.0
        if hours > 0.0:  # charge that finds no room is refused
            current = max(current, (charge - full) * battery.capacity_ah / hours)
        charge -= current * hours / battery.capacity_ah
        decay = np.exp(-step[k] * battery.heat_loss_w_k / battery.heat_capacity_j_k)
        heat_c = 5.0 + current**2 * ohm / battery.heat_loss_w_k * (1 - decay) + (heat_c - 5.0) * decay
        assert run.current_a[k] == pytest.approx(current, rel=1e-4, abs=1e-3)
    assert run.converged
    assert run.soc[-1] == pytest.approx(charge, abs=1e-5)
    assert run.temperature_degc[-1] == pytest.approx(heat_c, abs=1e-3)


def test_an_empty_battery_gives_what_the_drive_takes(i3: Vehicle) -> None:
    """Charge below empty is counted; the energy does not fall because the battery has none left."""
    power, step = np.full(1800, 15_000.0), np.ones(1800)
    low, high = (discharge(i3.battery, power, step, 20.0, soc, 20.0) for soc in (0.1, 0.8))
    assert low.soc[-1] < 0.0
    assert low.power_w == pytest.approx(high.power_w)
    empty = low.soc < i3.battery.displayed_zero_soc
    assert np.ptp(low.current_a[empty][1:]) < 0.05 * low.current_a[-1]  # the cells warm a little
