"""A drive of a car of round numbers through the whole chain, against arithmetic that is written out here."""

import dataclasses

import numpy as np
import pytest

from tripwatt.physics import DriveConditions, simulate
from tripwatt.physics.drivetrain import propulsion
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.losses import motor_loss
from tripwatt.vehicles.parts import Auxiliaries, Body, RoadLoad

EXACT = {"rel": 1e-9, "abs": 1e-9}


G = 9.80665


def car(capacity_ah: float = 1e3, **battery: object) -> Vehicle:
    """2 t with a payload of 400 kg, drag area 0.6 m², rolling 1 %; 300 W of base load; 350 V without resistance."""
    usual = load_vehicle("bmw_i3_60ah")
    values = {
        "capacity_ah": capacity_ah,
        "cells_in_series": 100.0,
        "ocv_soc": (0.0, 1.0),
        "ocv_v": (3.5, 3.5),
        "resistance_soc": (0.0, 1.0),
        "resistance_ohm": (1e-12, 1e-12),
        "min_cell_voltage_v": 0.5,
        "max_cell_voltage_v": 3.6,
        "displayed_zero_soc": 0.1,
        "displayed_full_soc": 0.9,
    }
    return dataclasses.replace(
        usual,
        body=Body(1500.0, 100.0, 1.05),
        road_load=RoadLoad(
            method="coefficients",
            drag_coefficient=0.3,
            frontal_area_m2=2.0,
            rolling_resistance_coefficient=0.01,
        ),
        tyres=None,
        auxiliaries=Auxiliaries(300.0),
        battery=dataclasses.replace(usual.battery, **{**values, **battery}),
    )


OFF = DriveConditions(climate="off", payload_mass_kg=400.0, air_density_kg_m3=1.2)


@pytest.mark.parametrize(
    ("speed", "expected"), [(0.0, 300.0), (0.7, 300.0 + 0.5 * 380.0), (1.4, 680.0), (20.0, 680.0)]
)
def test_a_moving_car_draws_more_from_walking_pace_on(speed: float, expected: float) -> None:
    vehicle = dataclasses.replace(car(), auxiliaries=Auxiliaries(300.0, moving_load_w=380.0))
    time = np.arange(5.0)
    run = simulate(vehicle, time, np.full(5, speed), conditions=OFF)
    assert run.power_by_cause_w["base_load"][1:] == pytest.approx([expected] * 4, **EXACT)
    drum = dataclasses.replace(OFF, on_dynamometer=True)
    assert (
        simulate(vehicle, time, np.full(5, speed), conditions=drum).power_by_cause_w["base_load"][1] == 300.0
    )


class TestChain:
    """10 to 20 m/s in 10 s, then 20 s at 20 m/s; grades of 0, 2 and 4 %, so 1 and 3 % in the middle."""

    time, speed, grade = [100.0, 110.0, 130.0], [10.0, 20.0, 20.0], [0.0, 0.02, 0.04]

    def run(self, conditions=OFF, **given):
        return simulate(car(), self.time, self.speed, grade=self.grade, conditions=conditions, **given)

    def test_forces(self) -> None:
        run = self.run()
        slope = np.array([0.0, 0.01, 0.03])
        cosine = 1.0 / np.sqrt(1.0 + slope**2)
        assert run.grade == pytest.approx(slope, **EXACT)
        assert run.aero_drag_force_n == pytest.approx(0.36 * np.array([100.0, 225.0, 400.0]), **EXACT)
        assert run.rolling_resistance_force_n == pytest.approx(2000.0 * G * 0.01 * cosine, **EXACT)
        assert run.grade_force_n == pytest.approx(2000.0 * G * slope * cosine, **EXACT)
        assert run.inertia_force_n == pytest.approx([0.0, 2100.0, 0.0], **EXACT)
        force = (
            run.aero_drag_force_n + run.rolling_resistance_force_n + run.grade_force_n + run.inertia_force_n
        )
        assert run.wheel_power_w == pytest.approx(force * [10.0, 15.0, 20.0], **EXACT)

    def test_powers_and_energies(self) -> None:
        run = self.run()
        wire = car().drivetrain
        shaft = run.wheel_power_w / wire.gearbox_efficiency
        turning = np.array([10.0, 15.0, 20.0]) * wire.gear_ratio / wire.wheel_radius_m
        motor = shaft + motor_loss(shaft / turning, turning, wire)
        assert run.motor_power_w == pytest.approx(motor, **EXACT)
        assert run.auxiliary_power_w == pytest.approx([300.0] * 3, **EXACT)
        assert run.battery_power_w == pytest.approx(motor + 300.0, **EXACT)
        assert run.battery_current_a == pytest.approx((motor + 300.0) / 350.0, rel=1e-6)
        energy = np.array(
            [0.0, (motor[1] + 300.0) / 360.0, (motor[1] + 300.0) / 360.0 + (motor[2] + 300.0) / 180.0]
        )
        assert run.energy_wh == pytest.approx(energy, **EXACT)
        assert run.simulated_energy_wh == pytest.approx(energy[-1], **EXACT)
        assert run.soc == pytest.approx(0.8 - energy / 350.0 / 1e3, rel=1e-6)
        causes = run.power_by_cause_w
        speeds = np.array([10.0, 15.0, 20.0])
        assert causes["air"] == pytest.approx(run.aero_drag_force_n * speeds, **EXACT)
        assert causes["rolling"] == pytest.approx(run.rolling_resistance_force_n * speeds, **EXACT)
        assert causes["climb"] == pytest.approx(run.grade_force_n * speeds, **EXACT)
        assert causes["acceleration"] == pytest.approx(run.inertia_force_n * speeds, **EXACT)
        assert causes["drivetrain"] == pytest.approx(motor - run.wheel_power_w, **EXACT)
        assert causes["base_load"] == pytest.approx([300.0] * 3, **EXACT)
        assert causes["shortfall"] == pytest.approx([0.0] * 3, abs=1e-6)
        by_cause = run.cumulative_by_cause_wh
        assert by_cause["base_load"] == pytest.approx([0.0, 300 / 360, 300 / 120], **EXACT)
        assert run.by_cause_wh["base_load"] == pytest.approx(300 / 120, **EXACT)
        assert run.flags == ()
        assert run.battery_loss_w == pytest.approx([0.0] * 3, abs=1e-3)
        assert np.isnan(run.cabin_temperature_degc).all()
        frame = run.to_frame()
        assert frame["energy_air_wh"].to_numpy() == pytest.approx(by_cause["air"], **EXACT)
        assert "flags" not in frame
        assert "power_by_cause_w" not in frame

    def test_air_at_the_mean_height(self) -> None:
        """The density of 500 m of the standard atmosphere at 20 °C; heights that are missing do not count."""
        height = [400.0, np.nan, 600.0]
        run = simulate(
            car(), self.time, self.speed, elevation_m=height, conditions=DriveConditions(climate="off")
        )
        pressure = 101_325.0 * (1.0 - 0.0065 * 500.0 / 288.15) ** (G / (287.05287 * 0.0065))
        density = pressure / (287.05287 * 293.15)
        assert run.aero_drag_force_n == pytest.approx(
            0.3 * density * np.array([100.0, 225.0, 400.0]), **EXACT
        )
        flat = simulate(car(), self.time, self.speed, conditions=DriveConditions(climate="off"))
        sea = 101_325.0 / (287.05287 * 293.15)
        assert flat.aero_drag_force_n[2] == pytest.approx(120.0 * sea, **EXACT)
        assert (flat.grade == 0.0).all()

    def test_given_climate_power(self) -> None:
        assert self.run(climate_power_w=700.0).auxiliary_power_w.tolist() == [1000.0] * 3
        assert self.run(climate_power_w=[0.0, 100.0, 200.0]).climate_power_w.tolist() == [0.0, 100.0, 200.0]
        on = dataclasses.replace(OFF, climate="auto", ambient_temperature_degc=-10.0)
        assert self.run(on).climate_power_w.min() > 500.0
        assert np.isfinite(self.run(on).cabin_temperature_degc).all()
        assert self.run(on, climate_power_w=0.0).climate_power_w.tolist() == [0.0] * 3

    def test_tyres_warm_up_as_their_conditions_are(self) -> None:
        usual = load_vehicle("bmw_i3_60ah")
        with_tyres = dataclasses.replace(car(), tyres=usual.tyres)
        cold = dataclasses.replace(OFF, ambient_temperature_degc=-10.0)
        runs = [
            simulate(
                with_tyres, self.time, self.speed, conditions=dataclasses.replace(cold, initial_warmth=w)
            )
            for w in (0.0, 1.0)
        ]
        tyres = usual.tyres
        weather = 1.0 + tyres.temperature_coefficient_per_k * (tyres.reference_temperature_degc + 10.0)
        first = [weather * (1.0 + tyres.cold_excess) * 2000.0 * G * 0.01, weather * 2000.0 * G * 0.01]
        assert [r.rolling_resistance_force_n[0] for r in runs] == pytest.approx(first, **EXACT)


class TestBraking:
    def test_a_full_battery_accepts_what_its_charge_then_allows(self) -> None:
        """From 95 % of 1 Ah the car drives first, so the battery accepts more where it brakes."""
        small = car(1.0, displayed_full_soc=1.0)
        rules = dataclasses.replace(
            small.regeneration,
            full_soc=0.9,
            zero_soc=1.0,
            zero_temperature_degc=-30.0,
            full_temperature_degc=-20.0,
        )
        small = dataclasses.replace(small, regeneration=rules)
        time = np.array([0.0, 5.0, 10.0, 14.0, 18.0])
        speed = np.array([25.0, 27.0, 27.0, 15.0, 5.0])
        run = simulate(small, time, speed, conditions=dataclasses.replace(OFF, initial_soc=0.95))
        started = np.concatenate(([0.95], run.soc[:-1]))
        acceptance = np.clip((1.0 - started) / 0.1, 0.0, 1.0)
        assert acceptance[3] > 0.6
        mean = np.concatenate((speed[:1], 0.5 * (speed[1:] + speed[:-1])))
        expected = propulsion(run.wheel_power_w, mean, acceptance, small.drivetrain, rules)
        assert run.motor_power_w == pytest.approx(expected.motor_power_w, rel=5e-3)
        assert run.friction_brake_power_w == pytest.approx(expected.friction_brake_power_w, rel=5e-3)
        assert run.friction_brake_power_w[3] > 1000.0
        assert run.regen_power_w == pytest.approx(np.maximum(-run.motor_power_w, 0.0))
        assert run.regen_power_w[3] > 0.0
        energy = sum(run.power_by_cause_w.values())
        assert energy == pytest.approx(run.battery_power_w, rel=1e-9)


class TestFlags:
    def codes(self, run) -> dict[str, float]:
        return {flag.code: flag.value for flag in run.flags}

    def test_limits_and_how_long(self) -> None:
        """Standing, 300 W from 1 Ah of 350 V are 0.857 A: 10.1 % of the charge pass 10 % within the third minute."""
        time = np.arange(0.0, 241.0, 60.0)
        standing = dataclasses.replace(OFF, initial_soc=0.13)
        run = simulate(car(1.0), time, np.zeros(5), conditions=standing)
        step = 300.0 / 350.0 / 60.0
        below = 0.13 - step * np.arange(5.0) < 0.1
        assert self.codes(run) == {"battery_empty": 60.0 * below.sum()}
        assert run.soc == pytest.approx(0.13 - step * np.arange(5.0), abs=1e-4)

    def test_a_full_battery_takes_nothing(self) -> None:
        """Braking for 30 s on a full battery: the base load is all that the motor recovers, the brakes take the rest."""
        full = car(10.0)
        rules = dataclasses.replace(full.regeneration, full_soc=2.0, zero_soc=3.0)
        full = dataclasses.replace(full, regeneration=rules)
        still = dataclasses.replace(OFF, initial_soc=0.9)
        run = simulate(full, [0.0, 30.0, 31.0], [40.0, 10.0, 10.0], conditions=still)
        assert run.battery_power_w[1] == pytest.approx(0.0, abs=1e-9)
        assert run.motor_power_w[1] == pytest.approx(-run.auxiliary_power_w[1])
        assert run.soc[1] == 0.9 > run.soc[2]
        roomy = simulate(full, [0.0, 30.0, 31.0], [40.0, 10.0, 10.0], conditions=OFF)
        assert roomy.battery_power_w[1] < -5_000.0
        kept = run.motor_power_w[1] / roomy.motor_power_w[1]
        losses = [r.power_by_cause_w["drivetrain"][1] for r in (run, roomy)]
        assert losses[0] == pytest.approx(kept * losses[1])
        lost = (run.battery_power_w[1] - roomy.battery_power_w[1]) * 30.0 / 3600.0
        assert self.codes(run)["battery_full"] == pytest.approx(lost)
        assert sum(run.power_by_cause_w.values()) == pytest.approx(run.battery_power_w, abs=1e-9)

    def test_over_voltage(self) -> None:
        high = car(1.0, max_cell_voltage_v=3.5, resistance_ohm=(1e-4, 1e-4))
        middle = dataclasses.replace(OFF, initial_soc=0.5)
        run = simulate(high, [0.0, 4.0, 5.0], [20.0, 10.0, 10.0], conditions=middle)
        assert self.codes(run) == {"battery_over_voltage": 4.0}

    def test_motor(self) -> None:
        fast = (
            car().drivetrain.motor_max_speed_rad_s
            * car().drivetrain.wheel_radius_m
            / car().drivetrain.gear_ratio
        )
        run = simulate(car(), [0.0, 4.0, 10.0], [fast * 0.99, fast * 0.99, fast * 1.05], conditions=OFF)
        assert self.codes(run)["motor_speed_limit"] == 6.0
        pulls = simulate(car(), [0.0, 2.0, 5.0], [0.0, 25.0, 25.0], conditions=OFF)
        assert 2.0 in self.codes(pulls).values()
        assert pulls.power_by_cause_w["shortfall"][1] < 0.0
        assert sum(pulls.power_by_cause_w.values()) == pytest.approx(pulls.battery_power_w, rel=1e-9)


def test_a_plot_has_the_name_of_the_simulation_and_a_battery_that_does_not_settle_has_its_flag(monkeypatch):
    run = simulate(car(), np.arange(60.0), np.full(60, 10.0), conditions=OFF)
    assert run.plot().axes[0].get_title() == "Simulation 59 s, 0.05 kWh, 60 samples"
    assert "battery_not_settled" not in {flag.code for flag in run.flags}
    monkeypatch.setattr("tripwatt.physics.battery.MAX_PASSES", 1)
    run = simulate(load_vehicle("bmw_i3_60ah"), np.arange(60.0), np.linspace(0.0, 30.0, 60), conditions=OFF)
    assert "battery_not_settled" in {flag.code for flag in run.flags}
