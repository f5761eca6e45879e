"""Messages on the way: silence while the verdict stays, five minutes between two, a speed that restores the chance."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest

import tripwatt as tw
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.roads.advice import Companion, Message
from tripwatt.roads.advice.on_the_way import QUIET_S
from tripwatt.trips import Departure

RESERVE = 0.1


def told(model: tw.ForecastModel, power_factor: float, chance: float) -> tuple[list[Message], Companion]:
    """Messages of an hour on a fast road whose energy is a factor of the expected one."""
    plan = tw.read_route([{"length_m": 60_000.0, "speed_m_s": 29.0, "grade": 0.0}])
    known = Departure(ambient_temperature_degc=15.0, cabin_temperature_degc=21.0)
    soc = soc_needed(model.forecast(plan, known), RESERVE, chance)
    departure = model.forecast(
        plan, tw.Departure(soc=soc, ambient_temperature_degc=15.0, cabin_temperature_degc=21.0)
    )
    companion, heard = Companion(departure, RESERVE), []
    time = np.arange(0.0, plan.duration_s, 10.0)
    energy = power_factor * np.interp(time, departure.drive.edges_s, departure.along.energy_wh)
    for until in range(60, int(plan.duration_s) - 30, 60):
        seen = time <= until
        samples = {"time_s": time[seen], "speed_m_s": 29.0, "observed_energy_wh": energy[seen]}
        message = companion.update(pd.DataFrame(samples))
        if message is not None:
            heard.append(message)
    return heard, companion


def test_nothing_is_told_while_all_goes_as_expected(model: tw.ForecastModel) -> None:
    assert told(model, 1.0, 0.99)[0] == []


def test_what_takes_more_is_told_with_a_speed_that_helps(model: tw.ForecastModel) -> None:
    heard, companion = told(model, 1.12, 0.96)
    assert heard
    assert heard[0].verdict == "open"
    assert heard[0].speed_m_s is not None
    assert (heard[0].p_at_speed or 0.0) >= companion.probability > heard[0].p_arrive


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.12, 1.3])
def test_what_to_do_now_is_known_while_nothing_is_told(model: tw.ForecastModel, factor: float) -> None:
    heard, companion = told(model, factor, 0.8)
    assert companion.latest is not None
    assert companion.latest.time_s > max((message.time_s for message in heard), default=0.0)
    assert (companion.latest.speed_m_s is None) or companion.latest.verdict != "arrives"


@pytest.mark.parametrize("factor", [0.8, 0.9, 1.2, 1.3])
def test_messages_are_few_and_each_is_another_verdict(model: tw.ForecastModel, factor: float) -> None:
    heard, _ = told(model, factor, 0.8)
    for one, other in itertools.pairwise(heard):
        assert other.time_s - one.time_s >= QUIET_S
        assert other.verdict != one.verdict
    assert heard[-1].verdict == ("arrives" if factor < 1.0 else "does_not_arrive")
