"""The jobs of journeys, and what they hand on."""

from __future__ import annotations

import datetime as dt
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from tests.support.router_server import write_map

from tripwatt.errors import Fault, InvalidInput
from tripwatt.journey import Atlas, AtlasSettings, Place
from tripwatt.service import journeys
from tripwatt.service.journey_schemas import PlaceRequest, PlanRequest, ReachRequest
from tripwatt.service.journeys import JourneyJobs, departure_of_journey, place_of
from tripwatt.service.schemas import check_request

WEST = {"latitude_deg": 47.0, "longitude_deg": 9.0, "name": "Westend"}
EAST = {"latitude_deg": 47.0, "longitude_deg": 9.1}


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> JourneyJobs:
    folder = write_map(tmp_path_factory.mktemp("map") / "map")
    return JourneyJobs.from_settings(asdict(AtlasSettings(f"{folder}@osrm=http://127.0.0.1:9")))


def faults_of(call: Any, *arguments: Any) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as caught:
        call(*arguments)
    return caught.value.faults


def test_without_a_map_nothing_is_served() -> None:
    none = JourneyJobs.from_settings(asdict(AtlasSettings()))
    assert none.atlas is None
    (fault,) = faults_of(none.places, "a", 1)
    assert fault == Fault("no map", "service", "started without --map", "a service with a map")
    assert none.describe() == {
        "roads": False,
        "places": False,
        "weather": False,
        "tiles": False,
        "stations": 0,
        "bounds_deg": None,
        "attribution": "",
    }


def test_what_a_map_knows(jobs: JourneyJobs) -> None:
    assert jobs.describe() == {
        "roads": True,
        "places": True,
        "weather": False,
        "tiles": False,
        "stations": 1,
        "bounds_deg": [46.9, 8.9, 47.1, 9.2],
        "attribution": "© OpenStreetMap contributors, ODbL 1.0",
    }


def test_what_a_router_alone_knows(jobs: JourneyJobs) -> None:
    assert jobs.atlas is not None
    weather: Any = object()
    bare = JourneyJobs(Atlas(jobs.atlas.router, attribution="me", weather=weather)).describe()
    assert (bare["roads"], bare["places"], bare["weather"], bare["stations"]) == (True, False, True, 0)
    assert (bare["bounds_deg"], bare["attribution"]) == (None, "me")


def test_places_by_name_within_their_limit(jobs: JourneyJobs) -> None:
    assert [place["name"] for place in jobs.places("west", 1)["places"]] == ["Westend"]
    assert len(jobs.places("west", 2)["places"]) == 2


def test_names_are_not_known_without_an_index(jobs: JourneyJobs) -> None:
    assert jobs.atlas is not None
    bare = JourneyJobs(Atlas(jobs.atlas.router))
    (fault,) = faults_of(bare.places, "x" * 61, 1)
    assert (fault.what, fault.got) == ("names of places are not known", "x" * 60)


def test_a_tile_is_inside_of_its_zoom(jobs: JourneyJobs) -> None:
    assert jobs.tile(0, 0, 0) == b""
    assert jobs.tile(3, 7, 7) == b""
    assert faults_of(jobs.tile, 3, 8, 7) == (Fault("tile out of range", "column", "8", "0 to 7 at zoom 3"),)
    assert [fault.where for fault in faults_of(jobs.tile, 0, 1, 1)] == ["column", "row"]


def test_bounds_may_be_a_point_and_not_in_the_wrong_order(jobs: JourneyJobs) -> None:
    point = jobs.view((47.0, 9.0, 47.0, 9.0), 10)
    assert [place["name"] for place in point["settlements"]] == ["Westend"]
    assert point["stations"] == []
    found = faults_of(jobs.view, (47.1, 9.1, 47.0, 9.0), 10)
    assert found == (
        Fault("bounds in the wrong order", "south, north", "47.1 to 47", "the smaller first"),
        Fault("bounds in the wrong order", "west, east", "9.1 to 9", "the smaller first"),
    )


def test_a_view_has_its_limit(jobs: JourneyJobs) -> None:
    assert len(jobs.view((46.0, 8.0, 48.0, 10.0), 1)["settlements"]) == 1
    whole = jobs.view((46.0, 8.0, 48.0, 10.0), 2)
    assert [place["name"] for place in whole["settlements"]] == ["Westend", "Ostheim"]
    assert [station["name"] for station in whole["stations"]] == ["Halbweg"]


def test_a_stop_is_a_text_or_a_place() -> None:
    assert place_of("47, 9") == "47, 9"
    assert place_of(PlaceRequest(**WEST)) == Place(47.0, 9.0, "Westend")


def test_weather_by_hand_is_handed_on() -> None:
    asked = {"start": "a", "weather": {"temperature_degc": -5.0, "wind_speed_m_s": 3.0, "rain_mm_h": 1.0}}
    old = departure_of_journey(check_request(asked, ReachRequest))
    fields = {"ambient_temperature_degc": -5.0, "wind_speed_m_s": 3.0, "wind_from_deg": 0.0, "rain_mm_h": 1.0}
    assert old == departure_of_journey(check_request({"start": "a", **fields}, ReachRequest))
    assert old.to_dict() == fields
    assert not departure_of_journey(check_request({"start": "a"}, ReachRequest)).has_weather


@pytest.mark.parametrize("name", ["departure_utc", "depart"])
def test_a_departure_is_handed_on(name: str) -> None:
    asked = {"start": "a", "soc": 0.5, "climate": "off", name: "2026-02-01T07:30:00+01:00"}
    found = departure_of_journey(check_request(asked, ReachRequest))
    assert (found.soc, found.climate, found.payload_mass_kg) == (0.5, "off", None)
    assert found.departs_at == dt.datetime(2026, 2, 1, 6, 30, tzinfo=dt.UTC)


class Noted:
    """Stands for what a journey returns, and keeps what it was asked with."""

    def __init__(self) -> None:
        self.given: tuple[Any, ...] = ()
        self.more: dict[str, Any] = {}

    def __call__(self, *given: Any, **more: Any) -> Noted:
        self.given, self.more = given, more
        return self

    def to_dict(self) -> dict[str, Any]:
        return {"noted": True}


def test_a_journey_has_the_options_of_its_request(jobs: JourneyJobs, monkeypatch: pytest.MonkeyPatch) -> None:
    noted = Noted()
    monkeypatch.setattr(journeys, "journey_with", noted)
    more = {"reserve": 0.2, "alternatives": 2, "round_trip": True, "answers": False, "soc": 0.6}
    request = check_request({"stops": [WEST, EAST], **more}, PlanRequest)
    model: Any = object()
    assert jobs.plan(request, model) == {"noted": True}
    drive, stops, atlas, options = noted.given
    assert (options.reserve, options.alternatives, options.round_trip, options.answers) == (
        0.2,
        2,
        True,
        False,
    )
    assert (drive.departure.soc, drive.model is model, atlas is jobs.atlas) == (0.6, True, True)
    assert [(stop.latitude_deg, stop.longitude_deg) for stop in stops] == [
        (47.0, 9.0),
        (47.0, 9.1),
        (47.0, 9.0),
    ]
    jobs.plan(check_request({"stops": [WEST, EAST]}, PlanRequest), model)
    assert len(noted.given[1]) == 2


@pytest.mark.parametrize("start", [WEST, "Westend", "47, 9"])
def test_the_reach_begins_at_its_start(
    jobs: JourneyJobs, monkeypatch: pytest.MonkeyPatch, start: Any
) -> None:
    noted = Noted()
    monkeypatch.setattr(journeys, "find_reach", noted)
    model: Any = object()
    request = check_request({"start": start, "reserve": 0.3}, ReachRequest)
    assert jobs.reach(request, model) == {"noted": True}
    _, place, atlas = noted.given
    assert (place.latitude_deg, place.longitude_deg) == (47.0, 9.0)
    assert (noted.more, atlas is jobs.atlas) == ({"reserve": 0.3}, True)


def test_weather_by_hand_comes_before_that_of_a_server(
    jobs: JourneyJobs, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert jobs.atlas is not None
    noted, server = Noted(), Noted()
    monkeypatch.setattr(journeys, "find_reach", noted)
    monkeypatch.setattr(journeys, "journey_with", noted)
    asked = JourneyJobs(Atlas(jobs.atlas.router, weather=server))  # type: ignore[arg-type]
    model: Any = object()
    by_hand = {"weather": {"wind_speed_m_s": 3.0}}
    for kind, run, document in (
        (ReachRequest, asked.reach, {"start": WEST}),
        (PlanRequest, asked.plan, {"stops": [WEST, EAST]}),
    ):
        run(check_request(document, kind), model)  # type: ignore[type-var, operator]
        assert noted.given[0].weather is server
        run(check_request(document | by_hand, kind), model)  # type: ignore[type-var, operator]
        assert noted.given[0].departure.wind_speed_m_s == 3.0
