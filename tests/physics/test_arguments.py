"""Arguments of a simulation, each bound from both sides."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.physics import DriveConditions, simulate
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.parts import Auxiliaries, Body, RoadLoad


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


class TestArguments:
    def faults(self, time=(0.0, 1.0, 2.0), speed=(1.0, 1.0, 1.0), **given) -> list[str]:
        with pytest.raises(InvalidInput) as caught:
            simulate(car(), time, speed, conditions=OFF, **given)
        return [str(fault) for fault in caught.value.faults]

    def test_bounds(self) -> None:
        assert (
            self.faults(speed=[1.0, 90.1, 1.0])[0]
            == "value out of range: speed_m_s: got 90.1; allowed: 0 to 90"
        )
        assert self.faults(speed=[-0.1, 91.0, 1.0])[0].startswith("value out of range: speed_m_s: got -0.1")
        assert self.faults(grade=[0.0, 0.7, 0.0])[0].startswith("value out of range: grade: got 0.7")
        assert (
            self.faults(climate_power_w=-1.0)[0]
            == "value out of range: climate_power_w: got -1; allowed: 0 to 100000"
        )
        assert self.faults(climate_power_w=1e5 + 1.0)[0].startswith(
            "value out of range: climate_power_w: got 100001"
        )
        assert self.faults(time=[0.0]) == [
            "wrong shape: time_s: got (1,); allowed: one dimension, at least 2 samples",
            "wrong shape: speed_m_s: got (3,); allowed: that of time_s, (1,)",
        ]
        assert self.faults(time=[0.0, 2.0, 1.5], speed=[1.0, np.nan, 1.0]) == [
            "time does not increase: time_s, sample 2: got 1.5 s after 2 s; allowed: increasing times",
            "missing value: speed_m_s, sample 1: got nan; allowed: finite numbers",
        ]
        with pytest.raises(InvalidInput, match="ambient_temperature_degc"):
            simulate(car(), [0.0, 1.0], [1.0, 1.0], conditions=DriveConditions(200.0))
        edge = simulate(
            car(), [0.0, 1.0], [0.0, 90.0], grade=[-0.6, 0.6], climate_power_w=[0.0, 1e5], conditions=OFF
        )
        assert np.isfinite(edge.energy_wh).all()


EXAMPLES = settings(max_examples=40, deadline=None)


@given(
    st.lists(
        st.sampled_from(["time", "speed", "grade", "soc", "ambient", "shape"]),
        min_size=1,
        max_size=6,
        unique=True,
    )
)
@EXAMPLES
def test_every_bad_argument_is_named_at_once(broken) -> None:
    time, speed, grade = np.arange(5.0), np.full(5, 3.0), np.zeros(5)
    climate, conditions = None, {}
    expected = set()
    if "time" in broken:
        time[3] = time[2]
        expected.add("time_s")
    if "speed" in broken:
        speed[1] = np.nan
        expected.add("speed_m_s")
    if "grade" in broken:
        grade[0] = 3.0
        expected.add("grade")
    if "soc" in broken:
        conditions["initial_soc"] = 80.0
        expected.add("initial_soc")
    if "ambient" in broken:
        conditions["ambient_temperature_degc"] = np.nan
        expected.add("ambient_temperature_degc")
    if "shape" in broken:
        climate = np.zeros(4)
        expected.add("climate_power_w")
    with pytest.raises(InvalidInput) as caught:
        simulate(
            load_vehicle("bmw_i3_60ah"),
            time,
            speed,
            grade=grade,
            climate_power_w=climate,
            conditions=DriveConditions(**conditions),
        )
    named = " ".join(fault.where for fault in caught.value.faults)
    assert all(name in named for name in expected)
