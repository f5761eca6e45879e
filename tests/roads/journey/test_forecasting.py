"""Forecasts of roads: weather, speed on motorways, and what they cost."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest
from tests.roads.journey.made import COLD, KM_H, A, B, joined, journey, straight

import tripwatt as tw
from tripwatt.roads.journey import Place, RoadForecaster
from tripwatt.roads.journey.forecasting import cap_motorway_speed, is_motorway
from tripwatt.roads.weather import Weather


def test_what_climate_wind_and_speed_cost(model):
    windy = replace(COLD, wind_speed_m_s=8.0, wind_from_deg=90.0)
    found = journey(model, windy, charge=False)
    off = journey(model, replace(windy, climate="off"), answers=False)
    calm = journey(model, answers=False)
    assert found.costs_wh["climate"] == pytest.approx(found.forecast.energy_wh - off.forecast.energy_wh)
    assert found.costs_wh["wind"] == pytest.approx(found.forecast.energy_wh - calm.forecast.energy_wh)
    assert min(found.costs_wh.values()) > 100.0
    assert journey(model, stops=(A, Place(47.0, 9.1)), answers=True).costs_wh["wind"] == 0.0


def test_a_cap_slows_motorways_alone():
    road = joined([straight(A, Place(47.0, 9.1), 130.0, "motorway"), straight(Place(47.0, 9.1), B, 90.0)])
    slow = cap_motorway_speed(road, 100.0 * KM_H)
    assert is_motorway(road).tolist() == [True, False]
    assert slow.links.travel_time_s[0] == pytest.approx(road.links.length_m[0] / (100.0 * KM_H))
    assert slow.links.travel_time_s[1] == road.links.travel_time_s[1]
    assert slow.links.moving_speed_m_s == pytest.approx([130.0 * KM_H, 90.0 * KM_H])
    assert slow.links.speed_limit_m_s == pytest.approx([100.0 * KM_H, np.nan], nan_ok=True)
    assert cap_motorway_speed(slow, 110.0 * KM_H).links.speed_limit_m_s == pytest.approx(
        [100.0 * KM_H, np.nan], nan_ok=True
    )
    assert cap_motorway_speed(road, 131.0 * KM_H).duration_s == pytest.approx(road.duration_s)


def test_the_error_of_the_weather_widens_the_interval(model):
    class Source:
        def __init__(self, hours):
            self.hours = hours

        def at(self, places, when):
            return tuple(Weather(0.0, 3.0, 90.0, hours_ahead=self.hours) for _ in places)

    departure = tw.Departure(soc=0.9)
    known = replace(departure, ambient_temperature_degc=0.0, wind_speed_m_s=3.0, wind_from_deg=90.0)
    by_hand = RoadForecaster(model, known).forecast(straight(A, B, level=True))
    soon, late = (
        RoadForecaster(model, departure, Source(hours)).forecast(straight(A, B, level=True))
        for hours in (0.0, 96.0)
    )
    assert by_hand.energy_wh == pytest.approx(soon.energy_wh) == pytest.approx(late.energy_wh)
    assert by_hand.sd_wh < soon.sd_wh < late.sd_wh
    # the standard deviation of the wind at the car is half of 1.0 and 2.6 m/s, that of the temperature 1.0 and 2.6 K
    parts = [np.sqrt(found.state_sd_wh**2 - by_hand.state_sd_wh**2) for found in (soon, late)]
    assert parts[1] / parts[0] == pytest.approx(2.6, rel=0.03)
    known = RoadForecaster(model, COLD, Source(0.0)).forecast(straight(A, B, level=True))
    assert known.state_sd_wh < soon.state_sd_wh  # the driver knows the temperature


def test_the_departure_counts_for_the_hour_of_the_weather(model):
    asked = []

    class Source:
        def at(self, places, when):
            asked.extend(when)
            return tuple(Weather(5.0, hours_ahead=1.0) for _ in places)

    noon = dt.datetime(2030, 1, 1, 12, 0, tzinfo=dt.UTC)
    RoadForecaster(model, tw.Departure(soc=0.9, departs_at=noon), Source()).forecast(
        straight(A, Place(47.0, 9.2))
    )
    assert noon < asked[0] < noon + dt.timedelta(minutes=10)
