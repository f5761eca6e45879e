"""Other ways to make a trip: another road, another hour."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.journey.made import COLD, A, B, journey, straight

import tripwatt as tw
from tripwatt.advice import leaving_later
from tripwatt.advice.actions import ALONE, actions
from tripwatt.advice.advise import _advised, maker_like
from tripwatt.journey import Place, RoadForecaster
from tripwatt.routes.weather import Weather

NOON = dt.datetime(2026, 1, 15, 12, 0, tzinfo=dt.UTC)


class Warming:
    """Weather that warms by 3 K each hour from noon on."""

    def at(self, places: Sequence[Place], when: Sequence[dt.datetime]) -> tuple[Weather, ...]:
        return tuple(Weather(-5.0 + 3.0 * (time - NOON).total_seconds() / 3600.0) for time in when)


@pytest.fixture(scope="module")
def model() -> tw.ForecastModel:
    return tw.load_model()


def test_the_slower_road_of_a_journey_is_a_way_to_arrive(model: tw.ForecastModel) -> None:
    found = journey(model, replace(COLD, soc=0.93), alternatives=1, charge=False)
    advice = tw.advise(found)
    (other,) = (one for one in advice.singly if one.actions[0].code == "other_road")
    slower = found.roads[1].forecast
    assert other.difference.energy_wh == pytest.approx(slower.energy_wh - found.forecast.energy_wh)
    assert other.difference.duration_s == pytest.approx(
        slower.plan.duration_s - found.forecast.plan.duration_s
    )
    assert other.p_arrive == slower.p_arrive(0.1)
    for one in advice.least:
        assert len(one.actions) == 1 or not {action.group for action in one.actions} & {*ALONE}


def test_two_roads_share_neither_climb_nor_traffic(model: tw.ForecastModel) -> None:
    forecaster = RoadForecaster(model, COLD)
    road, longer = straight(A, B, 100.0), straight(A, B, 100.0, factor=1.1)
    slower = straight(A, B, 90.0)
    base = forecaster.forecast(road)
    of_one_road, of_two = (forecaster.forecast(other).difference(base) for other in (slower, longer))
    assert of_one_road.sd_wh < 0.5 * of_two.sd_wh


def test_leaving_later_has_the_weather_of_its_hour(model: tw.ForecastModel) -> None:
    departure = tw.Departure(soc=0.9, departs_at=NOON)
    road = straight(A, B, 100.0)
    forecaster = RoadForecaster(model, departure, Warming())
    ways = leaving_later(forecaster, road, NOON)
    assert [action.value for action, _ in ways] == [3600.0, 7200.0, 10_800.0]
    energies = [forecaster.forecast(road).energy_wh, *(forecast.energy_wh for _, forecast in ways)]
    assert energies == sorted(energies, reverse=True)
    advice = tw.advise(forecaster.forecast(road), others=ways)
    assert "leave_later" in [one.actions[0].code for one in advice.singly]
    assert leaving_later(replace(forecaster, weather=None), road, NOON) == []
    windy = replace(forecaster, departure=replace(departure, wind_speed_m_s=3.0))
    assert leaving_later(windy, road, NOON) == []


def test_the_error_of_the_weather_stays_in_what_is_advised(model: tw.ForecastModel) -> None:
    road = straight(A, B, 130.0, "motorway")
    departure = tw.Departure(soc=0.9, departs_at=NOON, cabin_temperature_degc=5.0)
    forecast = RoadForecaster(model, departure).forecast(road)
    unsure = replace(forecast, state_sd_wh=float(np.hypot(forecast.state_sd_wh, 800.0)))
    sure, wide = (tw.advise(one).singly[0] for one in (forecast, unsure))
    assert wide.forecast.sd_wh > 1.05 * sure.forecast.sd_wh
    assert wide.difference.sd_wh == pytest.approx(sure.difference.sd_wh, rel=0.3)


def test_a_saving_is_not_known_better_than_to_a_fifth_of_what_changes(model: tw.ForecastModel) -> None:
    forecaster = RoadForecaster(model, COLD)
    fast, slow = (forecaster.forecast(straight(A, B, speed, level=True)) for speed in (120.0, 90.0))
    saved = slow.difference(fast)
    causes = [wh for cause, wh in saved.by_cause_wh.items() if cause != "correction"]
    assert saved.sd_wh >= 0.2 * float(np.linalg.norm(causes)) > 0.0


def test_heated_seats_are_part_of_the_energy_and_of_the_charge(model: tw.ForecastModel) -> None:
    base = RoadForecaster(model, replace(COLD, ambient_temperature_degc=-10.0)).forecast(straight(A, B, 80.0))
    seats = next(action for action in actions(base) if action.code == "seats")
    one = _advised(base, maker_like(base), (seats,), 0.1)
    assert one.difference.energy_wh == pytest.approx(sum(one.difference.by_cause_wh.values()))
    hours = base.plan.duration_s / 3600.0
    assert one.difference.energy_wh == pytest.approx(one.forecast.energy_wh - base.energy_wh + 100.0 * hours)
    assert one.soc_arrival - base.soc_arrival == pytest.approx(one.difference.soc_arrival)
