"""Energy on the way that physics forbids is refused; what a descent or a braking car recovers is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tripwatt as tw
from tripwatt.units import GRAVITY_M_S2

MODEL = tw.load_model()
DEPARTURE = tw.Departure(soc=0.7, ambient_temperature_degc=20.0)
MASS_KG = MODEL.vehicle.body.test_mass_kg


def forecast(grade: float | None, length_m: float = 18_000.0) -> tw.Forecast:
    link: dict[str, float] = {"length_m": length_m, "speed_m_s": 20.0}
    if grade is not None:
        link |= {"start_elevation_m": 3000.0, "end_elevation_m": 3000.0 + grade * length_m}
    return MODEL.forecast(tw.read_route([link]), DEPARTURE)


def steady(current_a: float, seconds: float, **more: Any) -> pd.DataFrame:
    time = np.arange(0.0, seconds + 1.0)
    return pd.DataFrame(
        {"time_s": time, "voltage_v": 350.0, "current_a": current_a, "speed_m_s": 20.0, **more}
    )


@pytest.mark.parametrize("grade", [None, 0.0, 0.01])
@pytest.mark.parametrize("seconds", [120.0, 300.0, 800.0])
def test_a_current_of_the_wrong_sign_at_a_steady_speed_is_refused(
    grade: float | None, seconds: float
) -> None:
    before = forecast(grade)
    with pytest.raises(tw.InvalidInput, match=r"less energy than the drive takes.*negate it"):
        before.update(steady(-40.0, seconds))
    assert before.update(steady(40.0, seconds)).energy_wh > 0.0


def test_a_measured_energy_is_held_against_the_road_as_well() -> None:
    observed = pd.DataFrame({"time_s": [0.0, 600.0], "speed_m_s": 20.0, "observed_energy_wh": [0.0, -500.0]})
    with pytest.raises(tw.InvalidInput, match="less energy than the drive takes"):
        forecast(0.0).update(observed)


@given(grade=st.floats(-0.12, -0.03), efficiency=st.floats(0.3, 0.9), seconds=st.floats(60.0, 600.0))
@settings(max_examples=30, deadline=None)
def test_what_a_known_descent_gives_back_is_taken(grade: float, efficiency: float, seconds: float) -> None:
    """At most the potential energy less rolling and air; the law holds for every descent and every efficiency."""
    force = -MASS_KG * GRAVITY_M_S2 * grade - 150.0 - 0.25 * 20.0**2
    recovered_w = max(0.0, efficiency * force * 20.0)
    before = forecast(grade)
    assert before.update(steady(-recovered_w / 350.0, seconds)).measured_until_s > 0.0


def test_a_long_descent_with_bends_is_taken_where_the_heights_are_unknown() -> None:
    """1,150 m down over 14 km, two thirds of it recovered."""
    time = np.arange(0.0, 1001.0)
    speed = 14.0 + 5.0 * np.sin(time / 20.0)
    power = -0.66 * MASS_KG * GRAVITY_M_S2 * 1150.0 / 14_000.0 * speed
    power += MASS_KG * speed * np.gradient(speed, time)
    observed = pd.DataFrame(
        {"time_s": time, "voltage_v": 350.0, "current_a": power / 350.0, "speed_m_s": speed}
    )
    assert forecast(None, 16_000.0).update(observed).measured_until_s > 0.0


def test_braking_to_a_stop_may_give_back_the_kinetic_energy() -> None:
    time = np.arange(0.0, 31.0)
    speed = np.maximum(0.0, 25.0 - time)
    power = -0.8 * MASS_KG * 1.0 * speed
    observed = pd.DataFrame(
        {"time_s": time, "voltage_v": 350.0, "current_a": power / 350.0, "speed_m_s": speed}
    )
    assert forecast(0.0).update(observed).measured_until_s > 0.0
