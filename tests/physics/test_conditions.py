"""Conditions at the start of a drive."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.physics import simulate_trip
from tripwatt.physics.conditions import DriveConditions
from tripwatt.physics.simulate import conditions_at_departure, simulate
from tripwatt.trips import Departure, Plan
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.parts import Auxiliaries, Body, RoadLoad


def test_an_unknown_climate_mode_is_refused() -> None:
    refuses(r"climate.*one of auto, off, heat, cool", DriveConditions, climate="warm")
    refuses(r"climate.*one of auto, off, heat, cool", Departure, climate="warm")


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


class TestConditions:
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
        assert found == DriveConditions(ambient_temperature_degc=10.0, initial_cabin_temperature_degc=10.0)
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
        graded = simulate_trip(car(), Plan.from_trace("p", rows.assign(grade=0.03, elevation_m=0.0), known))
        assert graded.grade.tolist() == [0.03] * 3
        assert graded.climate_power_w.tolist() == [0.0] * 3
        raised = simulate_trip(car(), Plan.from_trace("p", rows.assign(elevation_m=[0.0, 7.5, 15.0]), known))
        assert raised.grade == pytest.approx([0.05] * 3, rel=0.1)
        bare = simulate_trip(car(), Plan.from_trace("p", rows, known))
        assert (bare.grade == 0.0).all()
