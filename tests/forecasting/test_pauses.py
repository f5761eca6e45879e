"""A pause on the way: the car cools down, and takes the energy of a further warm-up."""

from dataclasses import replace
from itertools import pairwise

import pytest

import tripwatt as tw
from tripwatt.forecasting.expected import PARKED_W
from tripwatt.trips import Pause, Plan

HOUR_S = 3600.0
LEG = [{"length_m": 10_000.0, "speed_m_s": 14.0}, {"length_m": 10_000.0, "speed_m_s": 20.0}]
THERE, BACK, BOTH = (tw.read_route(links) for links in (LEG, LEG[::-1], [*LEG, *LEG[::-1]]))
COLD = tw.Departure(soc=0.9, ambient_temperature_degc=-5.0)
MILD = tw.Departure(soc=0.9, ambient_temperature_degc=22.0)


@pytest.fixture(scope="module", params=["bmw_i3_60ah", "vw_id3"])
def model(request) -> tw.ForecastModel:
    return tw.for_car(None, request.param)


def with_pause(*pause_s: float, position_m: float = 20_000.0) -> Plan:
    return replace(BOTH, pauses=tuple(Pause(position_m, seconds, cools=True) for seconds in pause_s))


def taken_wh(model: tw.ForecastModel, pause_s: float, departure: tw.Departure = COLD) -> float:
    """Energy of the round trip without that of the parked car."""
    return model.forecast(with_pause(pause_s), departure).energy_wh - PARKED_W * pause_s / HOUR_S


def test_the_energy_grows_with_the_pause_and_saturates(model):
    energies = [taken_wh(model, hours * HOUR_S) for hours in (0.0, 0.1, 0.5, 1.0, 3.0, 10.0, 100.0)]
    steps = [later - earlier for earlier, later in pairwise(energies)]
    assert min(steps[:-2]) > 1.0
    assert energies[-1] - energies[0] > 200.0
    assert steps[-1] == pytest.approx(0.0, abs=2.0)


def test_a_pause_of_no_time_changes_nothing(model):
    without, paused = (model.forecast(plan, COLD) for plan in (BOTH, with_pause(0.0)))
    assert paused.energy_wh == pytest.approx(without.energy_wh, rel=1e-9)
    assert paused.interval(0.9) == pytest.approx(without.interval(0.9), rel=1e-9)
    assert paused.soc_arrival == pytest.approx(without.soc_arrival, rel=1e-9)


def test_a_long_pause_makes_two_trips_of_one(model):
    singly = sum(model.forecast(plan, COLD).energy_wh for plan in (THERE, BACK))
    assert taken_wh(model, 48.0 * HOUR_S) == pytest.approx(singly, rel=0.01)
    assert abs(taken_wh(model, 0.0) / singly - 1.0) > 0.03


def test_the_whole_pause_takes_the_power_of_a_parked_car(model):
    day, days = (model.forecast(with_pause(hours * HOUR_S), MILD).energy_wh for hours in (24.0, 72.0))
    assert days - day == pytest.approx(48.0 * PARKED_W, abs=1.0)


def test_in_mild_weather_cold_tyres_and_battery_are_left(model):
    more = {at: taken_wh(model, 8.0 * HOUR_S, at) / taken_wh(model, 0.0, at) - 1.0 for at in (COLD, MILD)}
    assert 0.0 <= more[MILD] < 0.04
    assert more[COLD] > 1.5 * more[MILD]


def test_the_interval_is_not_narrower_and_the_causes_add_up(model):
    without, paused = (model.forecast(plan, COLD) for plan in (BOTH, with_pause(8.0 * HOUR_S)))
    (low, high), (lower, higher) = (forecast.interval(0.9) for forecast in (paused, without))
    assert high - low >= (higher - lower) * (1.0 - 1e-9)
    assert sum(paused.by_cause_wh.values()) == pytest.approx(paused.energy_wh)
    assert paused.by_cause_wh["climate"] > without.by_cause_wh["climate"] + 200.0
    assert paused.soc_arrival < without.soc_arrival
    assert paused.plan.elapsed_s == without.plan.elapsed_s + 8.0 * HOUR_S


def test_the_road_after_the_pause_takes_more(model):
    without, paused = (model.forecast(plan, COLD) for plan in (BOTH, with_pause(8.0 * HOUR_S)))
    more = paused.drive.power_w - without.drive.power_w
    middle = int((paused.drive.distance_m < 20_000.0).sum())
    assert abs(more[: middle - 1].sum()) < 0.25 * more[middle:].sum()
    assert more[middle : middle + 10].mean() > 3.0 * abs(more[-10:].mean())


def test_a_preheated_car_is_cold_after_the_pause(model):
    preheated = replace(COLD, cabin_temperature_degc=20.0, battery_temperature_degc=20.0, warmth=1.0)
    singly = model.forecast(THERE, preheated).energy_wh + model.forecast(BACK, COLD).energy_wh
    assert taken_wh(model, 48.0 * HOUR_S, preheated) == pytest.approx(singly, rel=0.01)


@pytest.mark.parametrize("position_m", [0.0, 100.0, 39_990.0, 40_000.0, 50_000.0])
def test_pauses_at_the_ends_and_several_are_forecast(model, position_m):
    energy_wh = model.forecast(with_pause(HOUR_S, HOUR_S, position_m=position_m), COLD).energy_wh
    assert energy_wh == pytest.approx(taken_wh(model, 0.0) + 2.0 * PARKED_W, rel=0.03)


def test_wind_and_heading_of_the_rest_are_those_of_the_road(model):
    wind = replace(COLD, wind_speed_m_s=8.0, wind_from_deg=0.0)
    heading = 0.0 * BOTH.array("time_s")
    north = replace(with_pause(8.0 * HOUR_S), heading_deg=heading)
    straight = replace(BOTH, heading_deg=heading)
    more = model.forecast(north, wind).energy_wh - model.forecast(straight, wind).energy_wh
    calm = taken_wh(model, 8.0 * HOUR_S) - taken_wh(model, 0.0)
    assert more - 8.0 * PARKED_W == pytest.approx(calm, rel=0.1)
    aired = [
        replace(plan.with_departure(wind), weather=plan.with_departure(wind).air)
        for plan in (north, straight)
    ]
    given, without = (model.forecast(plan.with_weather(plan.air)).energy_wh for plan in aired)
    assert given - without == pytest.approx(more, rel=0.02)
