"""The area of reach."""

from dataclasses import replace

import pytest
from tests.roads.journey.made import COLD, MADE, A, MadeRouter, journey, straight

import tripwatt as tw
from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.roads.journey import Place, RoadForecaster, find_reach
from tripwatt.roads.journey.reach import reach_along, reached_share


def test_a_charge_reaches_as_far_as_the_forecast_says(model):
    drive = RoadForecaster(model, tw.Departure(soc=0.3, ambient_temperature_degc=10.0))
    found = find_reach(drive, A, MADE, reserve=0.0)
    assert not found.map_ends
    sure, likely = found.outlines[0.95], found.outlines[0.5]
    assert len(sure) == len(likely) == 24
    assert all(A.distance_m(s) < A.distance_m(m) for s, m in zip(sure, likely, strict=True))
    # the place of 50 % is where the journey there arrives with an empty display
    there = journey(model, drive.departure, stops=(A, likely[3]), answers=False, reserve=0.0).forecast
    assert there.along.soc(0.5)[-1] == pytest.approx(0.0, abs=0.02)
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


def test_the_reason_of_the_router_is_said(model):
    class Closed(MadeRouter):
        def roads(self, stops, *, alternatives=0):
            raise InvalidInput.of("no road found", "A", "the pass is closed")

    with pytest.raises(InvalidInput, match="the pass is closed"):
        find_reach(RoadForecaster(model, COLD), A, replace(MADE, router=Closed()))


def test_a_router_that_fails_ends_the_search_at_once(model):
    calls = []

    class Broken(MadeRouter):
        def roads(self, stops, *, alternatives=0):
            calls.append(1)
            raise RemoteError([])

    with pytest.raises(RemoteError):
        find_reach(RoadForecaster(model, COLD), A, replace(MADE, router=Broken()))
    assert len(calls) == 1
