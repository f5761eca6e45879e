"""Journeys on roads that are made: what a driver asks, by laws and by values worked out by hand."""

import datetime as dt
import itertools
import json
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from tests.support.router_server import write_map

import tripwatt as tw
from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.journey import (
    Atlas,
    AtlasSettings,
    ChargingCurve,
    JourneyOptions,
    Place,
    RoadForecaster,
    find_reach,
    open_atlas,
    plan_journey,
)
from tripwatt.journey.charging import EFFICIENCY
from tripwatt.journey.forecasting import capped, on_motorway
from tripwatt.journey.reach import reach_along, reached_share
from tripwatt.routes.maps import Station
from tripwatt.routes.routers import Edges, Road, pooled
from tripwatt.routes.weather import Weather
from tripwatt.vehicles import load_vehicle

A, B = Place(47.0, 9.0, "A"), Place(47.0, 9.8, "B")
KM_H = 1.0 / 3.6


def straight(start, end, speed_km_h=100.0, kind="primary", factor=1.0, level=False):
    """A road on the straight line between two places, its heights unknown or all alike."""
    length = factor * start.distance_m(end)
    n = max(round(length / 2000.0), 1)
    edges = Edges(
        np.full(n, length / n),
        np.full(n, length / n / (speed_km_h * KM_H)),
        np.full(n, np.nan),
        np.full(n, np.nan),
        (kind,) * n,
        np.zeros(n, dtype=bool),
    )
    links, kinds = pooled(edges)
    if level:
        links = replace(
            links, elevation_position_m=np.array([0.0, length]), elevation_m=np.zeros(2), flags=()
        )
    line = np.linspace(0.0, 1.0, n + 1)
    latitude = start.latitude_deg + line * (end.latitude_deg - start.latitude_deg)
    longitude = start.longitude_deg + line * (end.longitude_deg - start.longitude_deg)
    return Road(links, kinds, latitude, longitude, line * length)


@dataclass
class MadeRouter:
    """A motorway between any two places, and a slower and shorter road beside it."""

    name: str = "made"
    fails_at: float = 90.0

    def roads(self, stops, *, alternatives=0):
        if max(stop.latitude_deg for stop in stops) > self.fails_at:
            raise InvalidInput([])
        legs = [straight(a, b, 130.0, "motorway", 1.05) for a, b in itertools.pairwise(stops)]
        road = legs[0] if len(legs) == 1 else joined(legs)
        if not alternatives:
            return (road,)
        return (straight(stops[0], stops[-1], 80.0), road)

    def outline(self, start, minutes):
        return ()


def joined(legs):
    from tripwatt.routes.links import join_routes

    links = join_routes([leg.links for leg in legs])
    starts = np.cumsum([0.0, *(leg.distance_m for leg in legs)])
    return Road(
        links,
        tuple(kind for leg in legs for kind in leg.road_class),
        np.concatenate([leg.latitude_deg for leg in legs]),
        np.concatenate([leg.longitude_deg for leg in legs]),
        np.concatenate([leg.position_m + at for leg, at in zip(legs, starts[:-1], strict=True)]),
        tuple(starts[1:-1].tolist()),
    )


@pytest.fixture(scope="module")
def model():
    return tw.load_model()


MADE = Atlas(MadeRouter(), stations=(Station(47.0, 9.4, "Halbweg", 100_000.0, direct_current=True),))
COLD = tw.Departure(soc=0.9, ambient_temperature_degc=0.0)


def journey(model, departure=COLD, stops=(A, B), atlas=MADE, **options):
    return plan_journey(stops, departure, atlas=atlas, model=model, options=JourneyOptions(**options))


def test_the_charge_to_leave_with_arrives_in_19_of_20_trips(model):
    near = Place(47.0, 9.3)
    found = journey(model, stops=(A, near), answers=False)
    assert 0.1 < found.soc_needed < 1.0
    again = journey(model, replace(COLD, soc=found.soc_needed), stops=(A, near), answers=False)
    assert again.forecast.p_arrive(0.1) == pytest.approx(0.95, abs=0.01)
    more = journey(model, stops=(A, near), answers=False, reserve=0.2)
    assert more.soc_needed == pytest.approx(found.soc_needed + 0.1, abs=0.01)


def test_where_a_full_battery_does_not_suffice_the_answer_is_above_one(model):
    far = Place(47.0, 14.0)
    found = journey(model, stops=(A, far), answers=False)
    assert found.soc_needed > 1.0
    assert (
        found.soc_needed == journey(model, replace(COLD, soc=0.3), stops=(A, far), answers=False).soc_needed
    )
    assert not found.arrives
    assert found.to_dict()["soc_needed"] == found.soc_needed
    assert found.to_dict()["leave"].startswith("A full battery does not suffice")


def test_the_needed_charge_of_a_forecast_follows_its_quantile(model):
    forecast = journey(model, stops=(A, Place(47.0, 9.2)), answers=False).forecast
    for probability in (0.5, 0.95):
        leaving = forecast.leaving_with(forecast.soc_needed(0.1, probability))
        assert leaving.soc_quantile(1.0 - probability) == pytest.approx(0.1, abs=1e-5)
    assert forecast.soc_along(0.95)[-1] == pytest.approx(forecast.soc_quantile(0.05))
    assert forecast.soc_along(0.95)[0] == pytest.approx(0.9)


def test_roads_are_labelled_and_the_fastest_is_first(model):
    found = journey(model, alternatives=1, answers=False)
    assert [road.labels for road in found.roads] == [("fastest",), ("shortest", "least energy")]
    assert found.roads[0].road.duration_s < found.roads[1].road.duration_s
    assert found.forecast is found.roads[0].forecast


def test_what_climate_wind_and_speed_cost(model):
    windy = replace(COLD, wind_speed_m_s=8.0, wind_from_deg=90.0)
    found = journey(model, windy)
    off = journey(model, replace(windy, climate="off"), answers=False)
    calm = journey(model, answers=False)
    assert found.costs_wh["climate"] == pytest.approx(found.forecast.energy_wh - off.forecast.energy_wh)
    assert found.costs_wh["wind"] == pytest.approx(found.forecast.energy_wh - calm.forecast.energy_wh)
    assert min(found.costs_wh.values()) > 100.0
    assert journey(model, stops=(A, Place(47.0, 9.1)), answers=True).costs_wh["wind"] == 0.0


def test_a_cap_slows_motorways_alone():
    road = joined([straight(A, Place(47.0, 9.1), 130.0, "motorway"), straight(Place(47.0, 9.1), B, 90.0)])
    slow = capped(road, 100.0 * KM_H)
    assert on_motorway(road).tolist() == [True, False]
    assert slow.links.travel_time_s[0] == pytest.approx(road.links.length_m[0] / (100.0 * KM_H))
    assert slow.links.travel_time_s[1] == road.links.travel_time_s[1]
    assert slow.links.moving_speed_m_s == pytest.approx([100.0 * KM_H, 90.0 * KM_H])
    assert capped(road, 131.0 * KM_H).duration_s == pytest.approx(road.duration_s)


def test_the_speed_with_which_the_journey_arrives_is_the_highest_one(model):
    far = Place(47.0, 9.9)
    found = journey(
        model,
        tw.Departure(soc=0.88, ambient_temperature_degc=10.0),
        stops=(A, far),
        atlas=replace(MADE, stations=()),
    )
    assert not found.arrives
    advice = found.speed.speed_m_s
    assert advice in [pytest.approx(v * KM_H) for v in (120.0, 110.0, 100.0, 90.0, 80.0)]
    drive = RoadForecaster(model, tw.Departure(soc=0.88, ambient_temperature_degc=10.0))
    road = found.roads[0].road
    assert drive.forecast(capped(road, advice)).p_arrive(0.1) >= 0.95
    assert drive.forecast(capped(road, advice + 10.0 * KM_H)).p_arrive(0.1) < 0.95
    assert found.speed.duration_s > found.forecast.plan.duration_s


def test_no_speed_is_advised_where_it_is_not_needed_or_does_not_help(model):
    assert journey(model, stops=(A, Place(47.0, 9.2))).speed is None
    found = journey(model, replace(COLD, soc=0.2))
    assert (found.speed.speed_m_s, found.speed.duration_s) == (None, None)
    assert [flag.code for flag in found.flags] == ["no_stop_found"]


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


def test_a_curve_of_ones_own_is_no_class_curve(model):
    curve = ChargingCurve((0.0, 1.0), (60_000.0, 60_000.0))
    found = journey(model, replace(COLD, soc=0.7), charging_curve=curve)
    assert found.flags == ()
    stop = found.charging
    wh = found.forecast.charge.wh_per_display
    seconds = (stop.soc_leave - stop.soc_arrival) * wh / (EFFICIENCY * 60_000.0) * 3600.0
    assert stop.charging_s == pytest.approx(300.0 + seconds, rel=1e-6)


def test_a_car_has_its_own_curve_or_that_of_its_class():
    kona = ChargingCurve.from_vehicle(load_vehicle("hyundai_kona_64"), 64_000.0)
    own = load_vehicle("hyundai_kona_64").charging
    assert (kona.soc, kona.power_w, kona.is_class) == (own.displayed_soc, own.power_w, False)
    assert kona.alternating_w == own.alternating_power_w == 11_000.0
    assert ChargingCurve.from_vehicle(load_vehicle("nissan_leaf_40"), 38_000.0).alternating_w == 6_600.0
    i3 = ChargingCurve.from_vehicle(load_vehicle("bmw_i3_60ah"), 20_000.0)
    assert i3 == ChargingCurve.from_class(20_000.0)
    assert (i3.is_class, i3.power_w[0], i3.power_w[-1]) == (True, 24_000.0, 2_000.0)


@pytest.mark.parametrize(
    ("soc", "power"),
    [
        ((0.0, 0.5), (1.0, 1.0)),
        ((0.1, 1.0), (1.0, 1.0)),
        ((0.0, 1.0), (1.0, 0.0)),
        ((0.0, 1.0), (1.0,)),
        ((0.0, 0.0, 1.0), (1.0, 1.0, 1.0)),
    ],
)
def test_what_is_no_charging_curve_is_refused(soc, power):
    with pytest.raises(InvalidInput, match="no charging curve"):
        ChargingCurve(soc, power)


def test_minutes_of_a_charge_follow_the_curve():
    curve = ChargingCurve((0.0, 1.0), (100_000.0, 100_000.0), alternating_w=7_000.0)
    direct, slow = Station(0.0, 0.0, "", 50_000.0, direct_current=True), Station(0.0, 0.0, "", 22_000.0)
    assert curve.seconds(0.2, 0.7, direct, 46_000.0) == pytest.approx(23_000.0 / (0.92 * 50_000.0) * 3600.0)
    assert curve.seconds(0.2, 0.7, slow, 46_000.0) == pytest.approx(23_000.0 / (0.92 * 7_000.0) * 3600.0)
    assert curve.seconds(0.7, 0.7, slow, 46_000.0) == 0.0
    falling = ChargingCurve((0.0, 1.0), (100_000.0, 50_000.0))
    # the integral of dx / (1 - x/2) from 0 to 1 is 2 ln 2
    fast = replace(direct, power_w=1e6)
    assert falling.seconds(0.0, 1.0, fast, 92_000.0) == pytest.approx(3600.0 * 2.0 * np.log(2.0), rel=1e-4)


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


def test_stops_and_the_way_back(model):
    found = journey(model, stops=(A, Place(47.0, 9.1), Place(47.0, 9.2)), round_trip=True, answers=False)
    assert found.stops[0] == found.stops[-1] == A
    road = found.roads[0]
    assert len(road.road.stop_position_m) == 2
    charges = [road.soc_at(at) for at in (0.0, *road.road.stop_position_m, road.road.distance_m)]
    assert charges == sorted(charges, reverse=True)
    assert charges[0] == pytest.approx(0.9)
    assert charges[-1] == pytest.approx(road.forecast.soc_arrival)
    assert len(found.to_dict()["roads"][0]["stops"]) == 2


def test_another_car_takes_another_energy_and_is_flagged(model):
    own = journey(model, stops=(A, Place(47.0, 9.2)), answers=False)
    other = plan_journey(
        (A, Place(47.0, 9.2)),
        COLD,
        atlas=MADE,
        model=model,
        vehicle="vw_id3",
        options=JourneyOptions(answers=False),
    )
    assert other.forecast.vehicle.name == "vw_id3"
    assert "no_trips_of_car" in {flag.code for flag in other.forecast.flags}
    assert other.forecast.sd_wh > own.forecast.sd_wh


def test_a_journey_shows_itself(model):
    found = journey(model, stops=(A, Place(47.0, 9.2)), alternatives=1)
    assert repr(found).startswith("<Journey A to 47.00000, 9.20000: 15.9 km, arrival with ")
    assert found._repr_html_().startswith("<table><caption>")
    frame = found.to_frame()
    assert isinstance(frame, pd.DataFrame)
    assert frame["labels"].tolist() == ["fastest", "shortest, least energy"]
    assert frame["energy_wh"].iloc[0] == found.forecast.energy_wh
    assert json.loads(json.dumps(found.to_dict())) == found.to_dict()
    assert found.plot().axes
    assert found.forecast.given == "a planned route, free flow"


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"reserve": 1.1}, "reserve"),
        ({"alternatives": 4}, "alternatives"),
        ({"alternatives": -1}, "alternatives"),
    ],
)
def test_impossible_options_are_refused(options, where):
    with pytest.raises(InvalidInput, match=f"value out of range: {where}"):
        JourneyOptions(**options)


def test_every_unknown_place_is_named(model):
    with pytest.raises(InvalidInput) as caught:
        journey(model, stops=("Nowhere", A, "Elsewhere"))
    assert [fault.where for fault in caught.value.faults] == ["stops[0]", "stops[2]"]
    with pytest.raises(InvalidInput, match="number of places out of range: stops: got 1; allowed: 2 to 20"):
        journey(model, stops=(A,))


# the area of reach


def test_a_charge_reaches_as_far_as_the_forecast_says(model):
    drive = RoadForecaster(model, tw.Departure(soc=0.3, ambient_temperature_degc=10.0))
    found = find_reach(drive, A, MADE)
    assert not found.map_ends
    sure, likely = found.outlines[0.95], found.outlines[0.5]
    assert len(sure) == len(likely) == 24
    assert all(A.distance_m(s) < A.distance_m(m) for s, m in zip(sure, likely, strict=True))
    # the place of 50 % is where the journey there arrives with an empty display
    there = journey(model, drive.departure, stops=(A, likely[3]), answers=False, reserve=0.0).forecast
    assert there.soc_along(0.5)[-1] == pytest.approx(0.0, abs=0.02)
    there = journey(model, drive.departure, stops=(A, sure[3]), answers=False, reserve=0.0).forecast
    assert there.p_arrive(0.0) == pytest.approx(0.95, abs=0.05)


def test_a_reserve_shortens_the_reach(model):
    drive = RoadForecaster(model, tw.Departure(soc=0.3, ambient_temperature_degc=10.0))
    forecast = drive.forecast(straight(A, Place(47.0, 11.0)))
    shares = [reached_share(forecast, 0.5, reserve) for reserve in (0.0, 0.15, 0.3, 0.31)]
    assert shares == sorted(shares, reverse=True)
    assert shares[1] == pytest.approx(0.5 * shares[0], rel=0.1)
    assert shares[3] == 0.0
    assert reached_share(drive.forecast(straight(A, Place(47.0, 9.05))), 0.5, 0.0) == 1.0


def test_the_outline_is_made_of_the_farthest_point_in_each_direction(model):
    drive = RoadForecaster(model, tw.Departure(soc=0.3, ambient_temperature_degc=10.0))
    places = [Place(47.2, 9.0), Place(47.0, 9.1), Place(46.9, 9.0), Place(47.1, 9.0)]
    roads = [straight(A, place) for place in places]
    found = reach_along(roads, [drive.forecast(road) for road in roads], A, 0.0, "source")
    assert found.map_ends
    assert [(round(p.latitude_deg, 3), round(p.longitude_deg, 3)) for p in found.outlines[0.95]] == [
        (47.2, 9.0),
        (47.0, 9.1),
        (46.9, 9.0),
    ]
    about = found.to_dict()
    ring = about["areas"][0]["polygon"]["coordinates"][0]
    assert ring[0] == ring[-1] == [9.0, 47.2]
    assert [flag["code"] for flag in about["flags"]] == ["map_ends"]
    assert about["attribution"] == "source"


def test_directions_without_a_road_are_left_out(model):
    drive = RoadForecaster(model, tw.Departure(soc=0.1, ambient_temperature_degc=10.0))
    south = replace(MADE, router=MadeRouter(fails_at=47.0001))
    found = find_reach(drive, A, south)
    assert max(place.latitude_deg for place in found.outlines[0.5]) < 47.001
    with pytest.raises(InvalidInput):
        find_reach(drive, A, replace(MADE, router=MadeRouter(fails_at=-90.0)))


def test_a_router_that_fails_ends_the_search_at_once(model):
    calls = []

    class Broken(MadeRouter):
        def roads(self, stops, *, alternatives=0):
            calls.append(1)
            raise RemoteError([])

    with pytest.raises(RemoteError):
        find_reach(RoadForecaster(model, COLD), A, replace(MADE, router=Broken()))
    assert len(calls) == 1


# atlases


def test_an_atlas_of_a_map_with_the_roads_of_a_server(tmp_path, monkeypatch):
    folder = write_map(tmp_path / "map")
    atlas = open_atlas(f"{folder}@osrm=http://127.0.0.1:1")
    assert atlas.router.name == "osrm at 127.0.0.1:1"
    assert atlas.places.search("ost")[0].name == "Ostheim"
    assert [station.name for station in atlas.stations] == ["Halbweg"]
    assert atlas.bounds_deg == (46.9, 8.9, 47.1, 9.2)
    assert atlas.weather is None
    monkeypatch.setenv("TRIPWATT_MAP", f"{folder}@http://127.0.0.1:1")
    assert open_atlas().router.name == "valhalla at 127.0.0.1:1"
    server = open_atlas(AtlasSettings("http://127.0.0.1:1", "photon=http://p", "http://w"))
    assert (server.places.client.host, server.weather.client.host, server.bounds_deg) == ("p", "w", None)


def test_every_fault_of_an_atlas_is_named(tmp_path, monkeypatch):
    monkeypatch.delenv("TRIPWATT_MAP", raising=False)
    with pytest.raises(InvalidInput) as caught:
        open_atlas(AtlasSettings("", "bing=http://h", "ftp://h", str(tmp_path / "none.csv")))
    assert [fault.where for fault in caught.value.faults[:3]] == ["--map", "--places", "--weather"]
    assert len(caught.value.faults) == 4


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
