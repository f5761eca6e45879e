"""A drive of a car of round numbers through the whole chain, against arithmetic that is written out here."""

import dataclasses
import math

import numpy as np
import pandas as pd
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.physics import DriveConditions, simulate, simulate_trip
from tripwatt.physics.conditions import UNKNOWN_AMBIENT_DEGC
from tripwatt.physics.drivetrain import propulsion
from tripwatt.physics.simulate import conditions_at_departure
from tripwatt.trips import Departure, Plan
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
        assert run.traction_force_n == pytest.approx(force, **EXACT)
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
        by_cause = run.energy_by_cause_wh
        assert by_cause["base_load"] == pytest.approx([0.0, 300 / 360, 300 / 120], **EXACT)
        assert run.flags == ()
        assert run.battery_loss_w == pytest.approx([0.0] * 3, abs=1e-3)
        assert np.isnan(run.cabin_temperature_degc).all()
        frame = run.frame()
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
        assert self.run(hvac_power_w=700.0).auxiliary_power_w.tolist() == [1000.0] * 3
        assert self.run(hvac_power_w=[0.0, 100.0, 200.0]).hvac_power_w.tolist() == [0.0, 100.0, 200.0]
        on = dataclasses.replace(OFF, climate="auto", ambient_temperature_degc=-10.0)
        assert self.run(on).hvac_power_w.min() > 500.0
        assert np.isfinite(self.run(on).cabin_temperature_degc).all()
        assert self.run(on, hvac_power_w=0.0).hvac_power_w.tolist() == [0.0] * 3

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


class TestConditions:
    def test_defaults(self) -> None:
        known = DriveConditions()
        assert (known.ambient_temperature_degc, known.initial_soc, known.payload_mass_kg) == (20.0, 0.8, 0.0)
        assert (known.solar_irradiance_w_m2, known.initial_warmth, known.climate) == (300.0, 0.0, "auto")
        assert UNKNOWN_AMBIENT_DEGC == 20.0
        assert DriveConditions(initial_battery_temperature_degc=5.0).battery_start_degc == 5.0
        usual = load_vehicle("bmw_i3_60ah")
        start = DriveConditions(ambient_temperature_degc=3.0, initial_warmth=0.5, climate="heat").cabin_start(
            usual
        )
        assert (start.temperature_degc, start.setpoint_degc) == (3.0, usual.climate.setpoint_degc)
        assert (start.solar_irradiance_w_m2, start.warmth, start.mode) == (300.0, 0.5, "heat")
        bare = dataclasses.replace(usual, climate=None)
        assert DriveConditions().cabin_start(bare).setpoint_degc == 22.0
        own = DriveConditions(initial_cabin_temperature_degc=9.0, cabin_setpoint_degc=24.0).cabin_start(bare)
        assert (own.temperature_degc, own.setpoint_degc) == (9.0, 24.0)

    @pytest.mark.parametrize(
        ("name", "low", "high", "beyond"),
        [
            ("ambient_temperature_degc", -60.0, 70.0, 0.1),
            ("initial_soc", 0.0, 1.0, 0.01),
            ("initial_battery_temperature_degc", -60.0, 100.0, 0.1),
            ("payload_mass_kg", -750.0, 60_000.0, 0.1),
            ("initial_cabin_temperature_degc", -60.0, 100.0, 0.1),
            ("cabin_setpoint_degc", 0.0, 50.0, 0.1),
            ("solar_irradiance_w_m2", 0.0, 1500.0, 0.1),
            ("initial_warmth", 0.0, 1.0, 0.01),
            ("air_density_kg_m3", 0.0, 10.0, 0.01),
        ],
    )
    def test_bounds(self, name, low, high, beyond) -> None:
        """A test may be lighter than the car by half of its 1500 kg."""
        for value, allowed in (
            (low, True),
            (high, True),
            (low - beyond, False),
            (high + beyond, False),
            (np.nan, False),
        ):
            conditions = dataclasses.replace(DriveConditions(), **{name: value})
            if allowed:
                with np.errstate(all="ignore"):
                    assert len(simulate(car(), [0.0, 1.0], [0.0, 0.0], conditions=conditions).time_s) == 2
            else:
                with pytest.raises(InvalidInput) as caught:
                    simulate(car(), [0.0, 1.0], [0.0, 0.0], conditions=conditions)
                assert name in [fault.where for fault in caught.value.faults]

    def test_at_departure(self) -> None:
        usual = load_vehicle("bmw_i3_60ah")
        found = conditions_at_departure(usual, Departure())
        assert found == DriveConditions(initial_cabin_temperature_degc=20.0)
        given = Departure(
            soc=0.5,
            ambient_temperature_degc=2.0,
            cabin_setpoint_degc=22.0,
            cabin_temperature_degc=12.0,
            battery_temperature_degc=7.0,
            payload_mass_kg=80.0,
            season="winter",
            weather="sunny",
            climate="heat",
        )
        found = conditions_at_departure(usual, given)
        assert found.initial_soc == pytest.approx(0.08 + 0.5 * 0.82)
        assert found.initial_warmth == pytest.approx(0.5)
        assert (found.initial_cabin_temperature_degc, found.cabin_setpoint_degc) == (12.0, 22.0)
        assert (found.initial_battery_temperature_degc, found.payload_mass_kg) == (7.0, 80.0)
        assert (found.solar_irradiance_w_m2, found.climate) == (300.0, "heat")
        follows = conditions_at_departure(usual, dataclasses.replace(given, follows_trip=True, bms_soc=0.3))
        assert (follows.initial_warmth, follows.initial_soc) == (1.0, 0.3)
        assert conditions_at_departure(usual, Departure(follows_trip=False)).initial_warmth == 0.0
        assert conditions_at_departure(usual, Departure(soc=1.0)).initial_soc == pytest.approx(0.9)

    def test_a_trip_is_simulated_on_its_own_road(self) -> None:
        rows = pd.DataFrame({"time_s": [0.0, 10.0, 20.0], "speed_m_s": 15.0})
        known = Departure(climate="off")
        graded = simulate_trip(car(), Plan.from_samples("p", rows.assign(grade=0.03, elevation_m=0.0), known))
        assert graded.grade.tolist() == [0.03] * 3
        assert graded.hvac_power_w.tolist() == [0.0] * 3
        raised = simulate_trip(
            car(), Plan.from_samples("p", rows.assign(elevation_m=[0.0, 7.5, 15.0]), known)
        )
        assert raised.grade == pytest.approx([0.05] * 3, rel=0.1)
        bare = simulate_trip(car(), Plan.from_samples("p", rows, known))
        assert (bare.grade == 0.0).all()


class TestArguments:
    def faults(self, time=(0.0, 1.0, 2.0), speed=(1.0, 1.0, 1.0), **given) -> list[str]:
        with pytest.raises(InvalidInput) as caught:
            simulate(car(), time, speed, conditions=OFF, **given)
        return [str(fault) for fault in caught.value.faults]

    def test_shapes(self) -> None:
        assert (
            self.faults([0.0], [1.0])[0]
            == "wrong shape: time_s: got (1,); allowed: one dimension, at least 2 samples"
        )
        assert (
            self.faults(speed=[1.0])[0] == "wrong shape: speed_m_s: got (1,); allowed: that of time_s, (3,)"
        )
        assert self.faults([[0.0, 1.0]], [[1.0, 1.0]])[0].startswith("wrong shape: time_s: got (1, 2)")
        assert self.faults(hvac_power_w=[1.0, 2.0])[0].startswith("wrong shape: hvac_power_w")
        assert len(simulate(car(), [0.0, 1.0], [1.0, 1.0], hvac_power_w=5.0, conditions=OFF).time_s) == 2

    def test_missing_and_infinite(self) -> None:
        assert self.faults(speed=[1.0, 2.0, np.nan])[0].startswith(
            "missing value: speed_m_s, sample 2: got nan"
        )
        assert self.faults(grade=[0.0, np.inf, np.nan])[0].startswith(
            "missing value: grade, sample 1: got inf"
        )
        assert self.faults(elevation_m=[0.0, np.nan, -math.inf])[0].startswith("infinite value: elevation_m")

    def test_times(self) -> None:
        assert self.faults([0.0, 2.0, 2.0])[0] == (
            "time does not increase: time_s, sample 2: got 2 s after 2 s; allowed: increasing times"
        )
        assert self.faults([0.0, -1.0, 2.0])[0].startswith(
            "time does not increase: time_s, sample 1: got -1 s after 0 s"
        )

    def test_bounds(self) -> None:
        assert (
            self.faults(speed=[1.0, 90.1, 1.0])[0]
            == "value out of range: speed_m_s: got 90.1; allowed: 0 to 90"
        )
        assert self.faults(speed=[-0.1, 91.0, 1.0])[0].startswith("value out of range: speed_m_s: got -0.1")
        assert self.faults(grade=[0.0, 0.7, 0.0])[0].startswith("value out of range: grade: got 0.7")
        assert (
            self.faults(hvac_power_w=-1.0)[0]
            == "value out of range: hvac_power_w: got -1; allowed: 0 to 100000"
        )
        assert self.faults(hvac_power_w=1e5 + 1.0)[0].startswith(
            "value out of range: hvac_power_w: got 100001"
        )
        edge = simulate(
            car(), [0.0, 1.0], [0.0, 90.0], grade=[-0.6, 0.6], hvac_power_w=[0.0, 1e5], conditions=OFF
        )
        assert np.isfinite(edge.energy_wh).all()
