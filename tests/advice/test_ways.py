"""Other ways to make a trip: another road, another hour."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import replace

import pytest
from tests.journey.made import COLD, A, B, journey, straight

import tripwatt as tw
from tripwatt.advice import leaving_later
from tripwatt.advice.actions import ALONE
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
