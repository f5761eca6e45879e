"""Journeys on roads that are made: what a driver asks, by laws and by values worked out by hand."""

import itertools
import json
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from tests.roads.journey.made import COLD, KM_H, MADE, A, MadeRouter, journey
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting.leaving import leaving_with, soc_needed
from tripwatt.roads.journey import Atlas, JourneyOptions, Place, RoadForecaster, plan_journey
from tripwatt.roads.journey.forecasting import cap_motorway_speed
from tripwatt.roads.maps.stations import Station
from tripwatt.trips.showing import period


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
    assert found.to_dict()["leave"].startswith("A full battery is not enough")


def test_the_needed_charge_of_a_forecast_follows_its_quantile(model):
    forecast = journey(model, stops=(A, Place(47.0, 9.2)), answers=False).forecast
    for probability in (0.5, 0.95):
        leaving = leaving_with(forecast, soc_needed(forecast, 0.1, probability))
        assert leaving.arrival.quantile(1.0 - probability) == pytest.approx(0.1, abs=1e-5)
    assert forecast.along.soc(0.95)[-1] == pytest.approx(forecast.arrival.quantile(0.05))
    assert forecast.along.soc(0.95)[0] == pytest.approx(0.9)


def test_roads_are_labelled_and_the_fastest_is_first(model):
    found = journey(model, stops=(A, Place(47.0, 9.2)), alternatives=1, answers=False)
    assert [road.labels for road in found.roads] == [("fastest",), ("shortest", "least energy")]
    assert found.roads[0].road.duration_s < found.roads[1].road.duration_s
    assert found.forecast is found.roads[0].forecast


def test_the_charge_to_drive_without_a_stop_is_that_of_the_road_that_needs_the_least(model):
    stops, low = (A, Place(47.0, 9.7)), replace(COLD, soc=0.6)
    found = journey(model, low, stops, alternatives=1)
    assert found.charging is not None
    assert found.soc_needed == min(soc_needed(road.forecast) for road in found.roads)
    charged = journey(model, replace(COLD, soc=found.soc_needed), stops, alternatives=1)
    (slow,) = [road for road in charged.roads if "shortest" in road.labels]
    assert slow.forecast.p_arrive(0.1) == pytest.approx(0.95, abs=0.01)
    assert charged.soc_needed == pytest.approx(found.soc_needed)


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
    assert drive.forecast(cap_motorway_speed(road, advice)).p_arrive(0.1) >= 0.95
    assert drive.forecast(cap_motorway_speed(road, advice + 10.0 * KM_H)).p_arrive(0.1) < 0.95
    assert found.speed.duration_s > found.forecast.plan.duration_s


def test_every_speed_in_tens_is_advised_where_it_is_the_highest_that_arrives(model):
    far, alone = Place(47.0, 9.6), replace(MADE, stations=())
    known = [tw.Departure(soc=soc, ambient_temperature_degc=10.0) for soc in (0.565, 0.605, 0.65, 0.7, 0.745)]
    found = [journey(model, departure, (A, far), alone) for departure in known]
    speeds = [80.0, 90.0, 100.0, 110.0, 120.0]
    assert [one.speed.speed_m_s / KM_H for one in found] == pytest.approx(speeds)
    for departure, one, km_h in zip(known, found, speeds, strict=True):
        chances = [
            RoadForecaster(model, departure)
            .forecast(cap_motorway_speed(one.roads[0].road, v * KM_H))
            .p_arrive(0.1)
            for v in (km_h, km_h + 10.0)
        ]
        assert chances[1] < 0.95 <= chances[0]


def test_no_speed_is_advised_where_it_is_not_needed_or_does_not_help(model):
    assert journey(model, stops=(A, Place(47.0, 9.2))).speed is None
    found = journey(model, replace(COLD, soc=0.2))
    assert (found.speed.speed_m_s, found.speed.duration_s) == (None, None)
    assert [flag.code for flag in found.flags] == ["no_stop_found"]


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
    one_way = journey(model, stops=(A, Place(47.0, 9.1), Place(47.0, 9.2)), answers=False)
    assert [[flag.code for flag in one.flags] for one in (found, one_way)] == [["no_pause"], []]


HOUR_S = 3600.0
TURN = Place(47.0, 9.2)


def test_a_pause_at_the_destination_counts_in_time_energy_and_flags(model):
    at_once, paused, later = (
        journey(model, stops=(A, Place(47.0, 9.1), TURN), round_trip=True, answers=False, pause_s=pause_s)
        for pause_s in (0.0, 8.0 * HOUR_S, 9.0 * HOUR_S)
    )
    road = paused.roads[0].road
    assert [(p.position_m, p.duration_s) for p in road.links.pauses] == [
        (road.stop_position_m[1], 8.0 * HOUR_S)
    ]
    assert paused.verdict.duration_s == pytest.approx(at_once.verdict.duration_s + 8.0 * HOUR_S)
    assert paused.to_dict()["roads"][0]["duration_s"] == paused.verdict.duration_s
    assert at_once.forecast.energy_wh + 200.0 < paused.forecast.energy_wh < later.forecast.energy_wh
    assert paused.soc_needed > at_once.soc_needed
    assert (paused.flags, at_once.flags[0].code) == ((), "no_pause")
    assert ("pause", 8.0 * HOUR_S) in [(flag.code, flag.value) for flag in paused.forecast.flags]


def test_a_car_charges_in_the_pause_beside_a_station(model):
    """Without a pause the stop costs its time; in the pause, of which plugging in is a part, it takes none, also at a slow station."""
    work = Station(47.0, 9.201, "Work", 11_000.0, direct_current=False)
    atlas = replace(MADE, stations=(work, Station(47.0, 9.1, "Fast", 150_000.0, direct_current=True)))
    low = replace(COLD, soc=0.5)
    at_once, paused, short = (
        journey(model, low, (A, TURN), atlas, round_trip=True, pause_s=pause_s)
        for pause_s in (0.0, 8.0 * HOUR_S, 600.0)
    )
    assert [stop.station.name for stop in at_once.charging.stops] == ["Fast"]
    (stop,) = paused.charging.stops
    assert (stop.station, stop.pause_s, stop.soc_leave) == (work, 8.0 * HOUR_S, 1.0)
    corridor = paused.corridor
    wh, node = corridor.forecast.charge.wh_per_display, 1 + corridor.stations.index(work)
    from_to = np.linspace(stop.soc_arrival, stop.soc_leave, 101)
    whole_s = corridor.curve.seconds(from_to, work, wh, float(corridor.cell_degc[node]))[-1]
    assert stop.charging_s == pytest.approx(whole_s, rel=0.02)  # not the whole pause
    assert (paused.charging.charging_s, stop.overhead_s, stop.more_s) == (0.0, 300.0, 0.0)
    assert f" for {period(stop.charging_s)} in the pause: " in stop.in_words()
    assert paused.verdict.duration_s == pytest.approx(paused.verdict.driving_s)
    course = paused.charging.to_dict()["course"]
    assert (np.diff(course["time_s"]) >= 0.0).all()
    assert course["time_s"][-1] == pytest.approx(paused.charging.duration_s, abs=20.0)
    assert [stop.station.name for stop in short.charging.stops] == ["Fast"]


def test_a_pause_of_more_than_a_week_or_below_zero_is_a_fault():
    for pause_s in (-1.0, 604_801.0):
        refuses("pause_s", JourneyOptions, pause_s=pause_s, round_trip=True)
    refuses("pause without a way back: pause_s: got 3600 s; add --round-trip", JourneyOptions, pause_s=HOUR_S)


def test_a_pause_at_a_turn_of_unknown_position_is_half_of_the_way():
    road = replace(MadeRouter().roads((A, TURN, A))[0], stop_position_m=())
    (pause,) = road.with_pause(HOUR_S).links.pauses
    assert pause.position_m == pytest.approx(0.5 * road.distance_m)


def test_a_plan_with_stops_has_the_pause_once(model):
    far, departure = Place(47.0, 9.6), tw.Departure(soc=0.8, ambient_temperature_degc=0.0)
    at_once, paused = (
        journey(model, departure, stops=(A, far), round_trip=True, pause_s=pause_s)
        for pause_s in (0.0, 8.0 * HOUR_S)
    )
    assert sum(len(leg.road.links.pauses) for leg in paused.charging.legs) == 1
    assert paused.charging.duration_s == pytest.approx(at_once.charging.duration_s + 8.0 * HOUR_S, rel=0.03)
    assert paused.charging.energy_wh > at_once.charging.energy_wh
    for stop in paused.charging.stops:
        turned = stop.position_m > 0.5 * paused.charging.distance_m
        assert (stop.arrives_after_s > 8.0 * HOUR_S) == turned


@pytest.mark.parametrize("beside_deg", [-0.01, -0.001, 0.0, 0.001])
def test_a_pause_is_kept_where_the_car_charges_at_the_turn(model, beside_deg):
    station = Station(47.001, 9.5 + beside_deg, "Am Ziel", 5e4, direct_current=True)
    plan = journey(
        model,
        tw.Departure(soc=0.9, ambient_temperature_degc=0.0),
        (A, Place(47.0, 9.5)),
        replace(MADE, stations=(station,)),
        round_trip=True,
        pause_s=8.0 * HOUR_S,
    ).charging
    assert len(plan.stops) == 1
    assert [pause.duration_s for leg in plan.legs for pause in leg.road.links.pauses] == [8.0 * HOUR_S]


def test_another_car_takes_another_energy_and_is_flagged(model):
    own = journey(model, stops=(A, Place(47.0, 9.2)), answers=False)
    other = plan_journey(
        (A, Place(47.0, 9.2)),
        COLD,
        atlas=MADE,
        model=model,
        car="vw_id3",
        options=JourneyOptions(answers=False),
    )
    assert other.forecast.vehicle.name == "vw_id3"
    assert "no_trips_of_car" in {flag.code for flag in other.forecast.flags}
    assert other.forecast.sd_wh > own.forecast.sd_wh


def test_a_journey_shows_itself(model):
    found = journey(model, stops=(A, Place(47.0, 9.2)), alternatives=1)
    assert repr(found).startswith("<Journey A to 47.00000, 9.20000: 15.9 km, arrival with ")
    frame = found.to_frame()
    assert isinstance(frame, pd.DataFrame)
    assert frame["labels"].tolist() == ["fastest", "shortest, least energy"]
    assert frame["energy_wh"].iloc[0] == found.forecast.energy_wh
    assert json.loads(json.dumps(found.to_dict())) == found.to_dict()
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
    refuses("number of places out of range: stops: got 1; allowed: 2 to 20", journey, model, stops=(A,))


def test_a_place_beside_the_road_is_named_with_its_distance(model):
    @dataclass
    class Beside(MadeRouter):
        """A router whose road passes the places 0.01° in the south of them."""

        def roads(self, stops, *, alternatives=0):
            return super().roads([Place(47.0, place.longitude_deg) for place in stops])

    near, far, end = Place(47.001, 9.0, "Near"), Place(47.01, 9.2, "Far"), Place(47.02, 9.4, "End")
    found = journey(model, stops=(near, far, end), atlas=replace(MADE, router=Beside()), answers=False)
    assert [(flag.code, flag.subject) for flag in found.flags] == [
        ("far_from_road", "Far"),
        ("far_from_road", "End"),
    ]
    for flag, place in zip(found.flags, (far, end), strict=True):
        assert flag.value == pytest.approx(place.distance_m(Place(47.0, place.longitude_deg)))
    assert journey(model, answers=False).flags == ()


class StrictRouter(MadeRouter):
    """Refuses two equal places, as routers do."""

    def roads(self, stops, *, alternatives=0):
        if any(one.distance_m(other) < 1.0 for one, other in itertools.pairwise(stops)):
            raise InvalidInput.of("no way to drive", "stops")
        return super().roads(stops, alternatives=alternatives)


def test_a_car_that_stands_at_a_station_charges_there_first():
    here, far = Place(47.0, 9.0, "Here"), Place(47.0, 9.4, "Far")
    stations = (Station(47.0, 9.0, "At the door", 100_000.0, direct_current=True),)
    low = tw.Departure(soc=0.08, ambient_temperature_degc=-5.0)
    found = plan_journey([here, far], low, atlas=Atlas(StrictRouter(), stations=stations))
    first, *_ = found.charging.stops
    assert (first.station.name, first.soc_arrival) == ("At the door", pytest.approx(0.08, abs=1e-3))
