"""Charging stops of a journey."""

from dataclasses import replace

import pytest
from tests.journey.made import COLD, MADE, journey

from tripwatt.routes.maps import Station


def test_a_stop_to_charge_where_the_charge_does_not_suffice(model):
    found = journey(model, replace(COLD, soc=0.7))
    stop = found.charging
    assert stop.station.name == "Halbweg"
    assert 0.02 < stop.soc_arrival < 0.7
    assert stop.soc_arrival < stop.soc_leave <= 1.0
    assert stop.p_station >= 0.95
    assert stop.p_arrive == pytest.approx(0.95, abs=0.02)
    assert 600.0 < stop.charging_s < 7200.0
    assert stop.duration_s > found.forecast.plan.duration_s + stop.charging_s - 60.0
    assert [flag.code for flag in found.flags] == ["class_charging_curve"]


def test_a_slower_station_takes_longer_and_the_better_one_is_taken(model):
    slow = Station(47.0, 9.41, "Langsam", 20_000.0, direct_current=True)
    off = Station(47.1, 9.4, "Abseits", 300_000.0, direct_current=True)  # 11 km from the road
    both = replace(MADE, stations=(slow, *MADE.stations, off))
    found = journey(model, replace(COLD, soc=0.7), atlas=both).charging
    assert found.station.name == "Halbweg"
    alone = journey(model, replace(COLD, soc=0.7), atlas=replace(MADE, stations=(slow,))).charging
    assert alone.charging_s > found.charging_s + 200.0
    assert journey(model, replace(COLD, soc=0.7), atlas=replace(MADE, stations=(off,))).charging is None


def test_without_stations_it_is_said_that_none_are_known(model):
    found = journey(model, replace(COLD, soc=0.7), atlas=replace(MADE, stations=()))
    assert [flag.code for flag in found.flags] == ["no_stations"]
