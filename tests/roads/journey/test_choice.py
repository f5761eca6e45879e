"""Charging stations that a driver chooses, avoids, or whose network he prefers."""

from dataclasses import replace

import pytest
from tests.roads.journey.made import MADE, A, B, journey
from tests.roads.journey.test_stops import FAR, LOW, row

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.roads.maps.stations import Plug, Station
from tripwatt.routes.places import Place

MILD = tw.Departure(soc=0.8, ambient_temperature_degc=12.0)
NEAR = Station(47.0, 9.01, "Near", 5e4, direct_current=True)
CLOSE = Place(47.0, 9.5, "Close")
ROW = replace(MADE, stations=row(14))
# beside the road there is no detour, so the time of a leg is estimated as it is routed, and the search is exact
BESIDE = [replace(station, latitude_deg=47.0) for station in ROW.stations]


def names(found):
    return [[stop.station.name for stop in plan.stops] for plan in found.charging_plans]


@pytest.fixture(scope="module")
def free(model):
    return names(journey(model, MILD, (A, FAR), ROW))


@pytest.mark.parametrize("chosen", [2, 5, 8, 11])
def test_every_plan_stops_at_a_chosen_station_once(model, free, chosen):
    station = ROW.stations[chosen]
    found = names(journey(model, MILD, (A, station.place, FAR), ROW))
    assert [plan.count(station.name) for plan in found] == [1] * len(found)
    assert found[0] != free[0]


def test_a_chosen_station_is_not_the_one_to_go_to_if_it_is_occupied(model):
    for station in ROW.stations[1:6]:
        for stop in journey(model, MILD, (A, station.place, FAR), ROW).charging.stops:
            assert stop.if_full is None or stop.if_full.station != stop.station


def test_a_chosen_station_is_a_stop_also_where_the_charge_suffices_and_near_the_start(model):
    atlas = replace(MADE, stations=(NEAR, *MADE.stations))
    assert journey(model, LOW, (A, CLOSE), atlas).arrives
    for station in atlas.stations:
        found = journey(model, LOW, (A, station.place, CLOSE), atlas)
        assert names(found)[0] == [station.name]
        assert found.verdict.advice == ("charge_first" if station == NEAR else "stop")


def test_a_battery_that_is_too_full_to_charge_drives_on(model):
    found = journey(model, replace(LOW, soc=1.0), (A, NEAR.place, CLOSE), replace(MADE, stations=(NEAR,)))
    assert (found.charging, found.arrives) == (None, True)


def test_a_chosen_station_without_a_plug_of_the_car_is_a_fault(model):
    chademo = replace(MADE.stations[0], plugs=(Plug("chademo", 50_000.0),))
    with pytest.raises(InvalidInput, match="no charging station for this car: Halbweg"):
        journey(model, LOW, (A, chademo.place, B), replace(MADE, stations=(chademo,)))


def test_no_plan_has_an_avoided_station_nor_names_it_as_the_next_one(model, free):
    used = free[0]
    avoid = tuple(station.place for station in ROW.stations if station.name in used)
    found = journey(model, MILD, (A, FAR), ROW, avoid=avoid)
    nexts = {
        stop.if_full.station.name for plan in found.charging_plans for stop in plan.stops if stop.if_full
    }
    assert found.charging is not None
    assert not {*used} & {*nexts, *(name for plan in names(found) for name in plan)}


@pytest.mark.parametrize("own", [{"networks": ("Betreiber", "Netz AG")}, {"name": "Netz 1"}])
def test_a_preferred_network_is_used_where_it_costs_little_time(model, own):
    """A station of no known network is found by its name; the name of another one is not that of its network."""

    mixed = [
        replace(station, networks=("Betreiber",)) if k % 2 else replace(station, **own)
        for k, station in enumerate(BESIDE)
    ]

    def plan(stations, *networks):
        return journey(
            model, MILD, (A, FAR), replace(ROW, stations=tuple(stations)), networks=networks
        ).charging

    def others(of):
        return sum(not is_own(stop.station) for stop in of.stops)

    def cost_s(of):
        """A stop less is worth five minutes."""
        return of.duration_s + 300.0 * len(of.stops)

    def is_own(station):
        return all(getattr(station, name) == value for name, value in own.items())

    free, found = plan(mixed), plan(mixed, "netz")
    assert others(found) < others(free)
    assert 0.0 <= cost_s(found) - cost_s(free) <= 900.0 * (others(free) - others(found))
    slow = [replace(one, power_w=3000.0) if is_own(one) else one for one in mixed]
    slowest = plan(slow, "netz")
    assert others(slowest) == len(slowest.stops)


@pytest.mark.parametrize("networks", [(), ("Netz",)])
@pytest.mark.parametrize("soc", [0.6, 0.7, 0.8, 0.9])
def test_the_first_plan_has_the_fewest_stops_of_those_about_as_fast_with_as_few_of_other_networks(
    model, soc, networks
):
    mixed = tuple(
        replace(station, networks=("Netz" if k % 3 else "Betreiber",)) for k, station in enumerate(BESIDE)
    )
    first, *more = journey(
        model, replace(MILD, soc=soc), (A, FAR), replace(ROW, stations=mixed), networks=networks
    ).charging_plans

    def others(plan):
        return sum(bool(networks) and stop.station.networks != networks for stop in plan.stops)

    for plan in more:
        if others(plan) <= others(first):
            fewer = len(first.stops) - len(plan.stops)
            assert plan.duration_s > first.duration_s + 300.0 * fewer or fewer < 0
