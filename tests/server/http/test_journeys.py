"""The service plans journeys with the roads of a router on loopback, and says clearly what fails."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.roads.journey.made import MADE, A, B
from tests.support.command import answered
from tests.support.roads import osrm
from tests.support.router_server import RouterServer, answering, write_map
from tests.support.service_process import Service, serving
from tests.support.service_schema import conformance

import tripwatt as tw
from tripwatt.errors import Fault, InvalidInput, RemoteError
from tripwatt.roads.journey import Atlas, open_atlas
from tripwatt.server.http import journeys
from tripwatt.server.http.journey_schemas import (
    AdviceResponse,
    JourneyAdviceRequest,
    JourneyDifferenceRequest,
    PlanRequest,
    PlanResponse,
    ReachRequest,
)
from tripwatt.server.http.journeys import JourneyJobs
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.schemas import check_request

WEST, EAST = {"latitude_deg": 47.0, "longitude_deg": 9.0}, {"latitude_deg": 47.0, "longitude_deg": 9.1}
ASKED = {"stops": [WEST, EAST], "soc": 0.8, "ambient_temperature_degc": -5.0}
ROADS = osrm(annotated=True)


@pytest.fixture(scope="module")
def router() -> Iterator[RouterServer]:
    with answering(ROADS) as found:
        yield found


@pytest.fixture(scope="module")
def planner(router: RouterServer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("planner")
    named = f"{write_map(folder / 'map')}@osrm={router.url}"
    (folder / "logs").mkdir()
    (folder / "cars").mkdir()
    with serving(folder / "logs", "--workers", "1", "--map", named, "--cars", f"{folder / 'cars'}") as found:
        yield found


@pytest.fixture(autouse=True)
def _sound(router: RouterServer) -> Iterator[None]:
    yield
    router.document, router.status, router.delay_s = ROADS, 200, 0.0


def plan(service: Service, **changed: Any) -> httpx.Response:
    return service.client.post("/v1/journeys", json=ASKED | changed)


def test_a_journey_by_names_is_that_by_coordinates(planner: Service) -> None:
    by_name, by_place = plan(planner, stops=["Westend", "Ostheim"]), plan(planner)
    assert by_name.status_code == by_place.status_code == 200
    named, placed = by_name.json(), by_place.json()
    assert [stop["name"] for stop in named["stops"]] == ["Westend", "Ostheim"]
    assert named["roads"][0]["forecast"]["energy_wh"] == placed["roads"][0]["forecast"]["energy_wh"]
    assert named["arrives"] is True
    assert named["attribution"] == "© OpenStreetMap contributors, ODbL 1.0"
    assert placed["roads"][0]["distance_m"] == pytest.approx(7584.0)
    assert placed["roads"][0]["forecast"]["given"] == "a planned route, free flow"
    assert (
        len(placed["roads"][0]["line"]["latitude_deg"]) == len(placed["roads"][0]["line"]["position_m"]) == 97
    )


def test_a_plan_by_stops_is_the_fastest_road_between_them(planner: Service) -> None:
    car = planner.client.post("/v1/cars", json={"name": "leaf", "car": "nissan_leaf_40"}).json()["name"]
    token = planner.client.post(f"/v1/cars/{car}/token").json()["token"]
    assert token
    asked = {"stops": ["Westend", "Ostheim"], "soc": 0.8, "ambient_temperature_degc": 5.0}
    shown = planner.client.put(f"/v1/live/{car}/plan", json=asked)
    assert shown.status_code == 200, shown.text
    assert (shown.json()["plan"], shown.json()["destination"]) == ("given", "Ostheim")
    road = plan(planner, ambient_temperature_degc=5.0, car="nissan_leaf_40").json()["roads"][0]
    assert shown.json()["forecast"]["distance_m"] == pytest.approx(road["distance_m"], rel=1e-3)
    assert shown.json()["forecast"]["energy_wh"] == pytest.approx(road["forecast"]["energy_wh"], rel=0.01)
    refused = planner.client.put(f"/v1/live/{car}/plan", json={"stops": ["Westend", "no such place at all"]})
    assert refused.status_code == 422
    assert planner.client.delete(f"/v1/cars/{car}").status_code == 200


def test_advice_on_a_journey_is_that_on_its_road(planner: Service) -> None:
    asked = {**ASKED, "soc": 0.13, "extras": ["roof_box"]}
    found = planner.client.post("/v1/journeys/advice", json={**asked, "probability": 0.9})
    assert found.status_code == 200, found.text
    advice, road = found.json(), plan(planner, **asked).json()["roads"][0]
    assert advice["soc_arrival"] == pytest.approx(road["forecast"]["soc_arrival"])
    assert advice["p_arrive"] == pytest.approx(road["forecast"]["p_arrive_by_soc"]["0.1"])
    assert advice["singly"] == []  # nothing saves 0.2 kWh over 8 km
    assert advice["whole"] is None
    assert planner.client.post("/v1/journeys/advice", json={**asked, "probability": 2.0}).status_code == 422


def test_advice_on_a_journey_that_needs_a_stop_has_the_time_in_all() -> None:
    stops = [{"latitude_deg": place.latitude_deg, "longitude_deg": place.longitude_deg} for place in (A, B)]
    asked = {"stops": stops, "soc": 0.7, "ambient_temperature_degc": 0.0}
    jobs, model = JourneyJobs(MADE), tw.load_model()
    charging = jobs.plan(check_request(asked, PlanRequest), model)["charging"]
    advice = jobs.advice(check_request(asked, JourneyAdviceRequest), model)
    assert advice["whole"]["duration_s"] == pytest.approx(charging["duration_s"])
    assert advice["whole"]["charges"] == len(charging["stops"]) == 1
    assert advice["whole"]["p_reserve"] == pytest.approx(charging["p_reserve"])
    assert [one["whole"]["charges"] for one in advice["singly"] if one["whole"]] != []
    AdviceResponse.model_validate(advice)
    alone = jobs.advice(check_request({**asked, "charge": False}, JourneyAdviceRequest), model)
    assert alone["whole"] is None


def test_each_road_of_a_response_has_its_own_stops() -> None:
    stops = [{"latitude_deg": place.latitude_deg, "longitude_deg": place.longitude_deg} for place in (A, B)]
    asked = {"stops": stops, "soc": 0.7, "ambient_temperature_degc": 0.0, "alternatives": 1}
    found = JourneyJobs(MADE).plan(check_request(asked, PlanRequest), tw.load_model())
    plans = [road.charging for road in PlanResponse.model_validate(found).roads]
    assert [plan and len(plan.stops) for plan in plans] == [r["whole"]["charges"] for r in found["roads"]]
    assert found["roads"][0]["charging"] == found["charging"]
    assert plans[1] is not None
    assert plans[1].duration_s == found["roads"][1]["whole"]["duration_s"]


def test_a_request_chooses_and_avoids_stations() -> None:
    model, (halfway,) = tw.load_model(), MADE.stations
    beside = replace(halfway, longitude_deg=9.42, name="Netz Daneben")
    jobs = JourneyJobs(replace(MADE, stations=(halfway, beside)))
    place = {"latitude_deg": halfway.latitude_deg, "longitude_deg": halfway.longitude_deg}
    ends = [{"latitude_deg": one.latitude_deg, "longitude_deg": one.longitude_deg} for one in (A, B)]

    def names(*via: dict[str, Any], **more: Any) -> list[str]:
        asked = {"stops": [ends[0], *via, ends[1]], "soc": 0.7, "ambient_temperature_degc": 0.0}
        found = jobs.plan(check_request(asked | more, PlanRequest), model)
        return [stop["station"]["name"] for stop in found["charging"]["stops"]]

    assert names(place | {"kind": "charging_station"}) == ["Halbweg"]
    assert names(avoid=[place]) == names(networks=["netz"]) == ["Netz Daneben"]
    for wrong in ({"avoid": [place] * 101}, {"networks": [""]}):
        with pytest.raises(InvalidInput):
            names(**wrong)


def test_the_difference_of_two_journeys_is_that_of_their_roads(planner: Service) -> None:
    asked = {**ASKED, "soc": 0.5}
    warmer = {**asked, "ambient_temperature_degc": 15.0}
    one, other = (plan(planner, **each).json()["roads"][0]["forecast"] for each in (warmer, asked))
    found = planner.client.post("/v1/journeys/difference", json={"one": warmer, "other": asked})
    assert found.status_code == 200, found.text
    difference = found.json()
    assert difference["energy_wh"] == pytest.approx(one["energy_wh"] - other["energy_wh"])
    assert difference["soc_arrival"] == pytest.approx(one["soc_arrival"] - other["soc_arrival"])
    low, high = difference["interval_wh"]
    (one_low, one_high), (other_low, other_high) = (
        (each["quantiles_wh"]["0.05"], each["quantiles_wh"]["0.95"]) for each in (one, other)
    )
    assert low < difference["energy_wh"] < high
    # what both share cancels
    assert high - low < 0.7 * math.hypot(one_high - one_low, other_high - other_low)
    for wrong in ({"one": warmer}, {"one": warmer, "other": asked, "road": 7}):
        assert planner.client.post("/v1/journeys/difference", json=wrong).status_code == 422


def test_the_difference_of_two_journeys_counts_their_stops() -> None:
    stops = [{"latitude_deg": place.latitude_deg, "longitude_deg": place.longitude_deg} for place in (A, B)]
    asked = {"stops": stops, "soc": 0.7, "ambient_temperature_degc": 0.0}
    warmer = {**asked, "ambient_temperature_degc": 18.0}
    jobs, model = JourneyJobs(MADE), tw.load_model()
    one, other = (jobs.plan(check_request(each, PlanRequest), model)["verdict"] for each in (warmer, asked))
    # a quick request has the same difference
    pair = {"one": {**warmer, "answers": False}, "other": asked}
    found = jobs.difference(check_request(pair, JourneyDifferenceRequest), lambda _: model)
    for name in ("duration_s", "energy_wh", "soc_arrival"):
        assert found[name] == pytest.approx(one[name] - other[name])
    assert found["duration_s"] < one["driving_s"] - other["driving_s"] - 60.0


def test_places_by_the_start_of_their_names(planner: Service) -> None:
    found = planner.client.get("/v1/places", params={"q": "haupt 12"}).json()
    assert [place["name"] for place in found["places"]] == ["Hauptstraße 12a, Westend"]
    assert len(planner.client.get("/v1/places", params={"q": "west", "limit": 1}).json()["places"]) == 1
    assert planner.client.get("/v1/places").status_code == 422


def test_what_is_named_in_a_part_of_the_map(planner: Service) -> None:
    bounds = {"south": 46.9, "west": 8.9, "north": 47.1, "east": 9.2}
    found = planner.client.get("/v1/map/view", params=bounds).json()
    assert [place["name"] for place in found["settlements"]] == ["Westend", "Ostheim"]
    assert [(s["name"], s["power_w"]) for s in found["stations"]] == [("Halbweg", 150_000.0)]
    assert found["attribution"] == "© OpenStreetMap contributors, ODbL 1.0"
    assert planner.client.get("/v1/map/view", params=bounds | {"south": "nan"}).status_code == 422


def test_tiles_are_those_of_the_router() -> None:
    with answering(b"\x1a\x00tile") as valhalla:
        tiles = JourneyJobs(open_atlas(f"valhalla={valhalla.url}"))
        assert tiles.describe()["tiles"] is True
        assert tiles.tile(12, 2156, 1436) == b"\x1a\x00tile"
        nothing = tiles.view((0.0, 0.0, 1.0, 1.0), 10)
        assert (nothing["settlements"], nothing["stations"]) == ([], [])
        valhalla.status = 403
        with pytest.raises(RemoteError, match="refuses access"):
            tiles.tile(12, 0, 0)


@pytest.mark.parametrize(
    ("document", "status", "http", "what"),
    [
        ({"code": "NoRoute"}, 200, 422, "no road found"),
        (b"<html>", 200, 502, "the router gives no JSON"),
        ({"code": "Ok", "routes": []}, 200, 502, "too few entries"),
        ({}, 503, 502, "the router does not respond"),
        ({}, 403, 502, "the router refuses access"),
    ],
)
def test_what_fails_at_the_router_is_a_problem_document(
    planner: Service, router: RouterServer, document: Any, status: int, http: int, what: str
) -> None:
    router.document, router.status = document, status
    found = plan(planner)
    assert found.status_code == http
    assert found.headers["content-type"] == "application/problem+json"
    assert found.json()["faults"][0]["what"] == what
    router.document, router.status = ROADS, 200
    assert plan(planner, answers=False).status_code == 200  # the worker serves on


def test_what_is_wrong_with_a_request_is_named(planner: Service) -> None:
    wrong = {"soc": 1.5, "departs_at": "07:30", "car": "../car.toml", "unknown": 1}
    found = plan(planner, **wrong)
    assert found.status_code == 422
    assert {fault["where"] for fault in found.json()["faults"]} == set(wrong)
    for stops, where in ((["", EAST], "stops.0"), (["Nowhere", "Elsewhere"], "stops[0]")):
        assert plan(planner, stops=stops).json()["faults"][0]["where"].startswith(where)


def test_without_a_map_there_are_no_journeys(service: Service) -> None:
    for path, asked in (("/v1/journeys", ASKED), ("/v1/reachable", {"start": WEST})):
        found = service.client.post(path, json=asked)
        assert found.status_code == 501
        assert found.json()["type"] == "/problems/no-map"
    assert service.client.get("/v1/places", params={"q": "a"}).status_code == 501
    assert service.client.get("/v1/tiles/0/0/0").status_code == 501
    bounds = {"south": 0, "west": 0, "north": 1, "east": 1}
    assert service.client.get("/v1/map/view", params=bounds).status_code == 501
    assert service.client.get("/v1/map").json()["roads"] is False


def test_the_operations_are_as_their_document_says(planner: Service) -> None:
    """Examples and a small sample; the phase that covers the schema takes minutes of journeys."""
    found = conformance(
        planner.url,
        2,
        only="^/v1/(journeys|reachable|places|map|map/view|tiles/.*)$",
        phases="examples,fuzzing",
        timeout_s=400.0,
    )
    assert found.clean, found.text[-4000:]


def test_a_map_that_is_none_stops_the_start(tmp_path: Path) -> None:
    answer = answered("serve", "--port", 0, "--map", tmp_path)
    assert answer.code == 2
    assert "no map" in answer.err


WEST = {"latitude_deg": 47.0, "longitude_deg": 9.0, "name": "Westend"}
EAST = {"latitude_deg": 47.0, "longitude_deg": 9.1}


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> JourneyJobs:
    folder = write_map(tmp_path_factory.mktemp("map") / "map")
    return JourneyJobs(open_atlas(f"{folder}@osrm=http://127.0.0.1:9"))


def faults_of(call: Any, *arguments: Any) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as caught:
        call(*arguments)
    return caught.value.faults


def test_without_a_map_nothing_is_served() -> None:
    none = JourneyJobs()
    assert none.atlas is None
    with pytest.raises(Problem, match="no-map") as caught:
        none.places("a", 1)
    assert caught.value.detail == "start the service with --map"
    assert none.describe() == {
        "roads": False,
        "places": False,
        "weather": False,
        "tiles": False,
        "stations": 0,
        "bounds_deg": None,
        "covers": "",
        "terrain": {"known": False, "source": ""},
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
        "covers": "46.90 to 47.10° N and 8.90 to 9.20° E around Westend and Ostheim (made)",
        "terrain": {"known": False, "source": ""},
        "attribution": "© OpenStreetMap contributors, ODbL 1.0",
    }


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
    more = {
        "reserve": 0.2,
        "alternatives": 2,
        "round_trip": True,
        "pause_s": 3600.0,
        "answers": False,
        "soc": 0.6,
    }
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
    assert options.pause_s == 3600.0
    assert (drive.departure.soc, drive.model is model, atlas is jobs.atlas) == (0.6, True, True)
    assert [(stop.latitude_deg, stop.longitude_deg) for stop in stops] == [
        (47.0, 9.0),
        (47.0, 9.1),
        (47.0, 9.0),
    ]
    jobs.plan(check_request({"stops": [WEST, EAST]}, PlanRequest), model)
    assert len(noted.given[1]) == 2


def test_the_reach_begins_at_its_start(jobs: JourneyJobs, monkeypatch: pytest.MonkeyPatch) -> None:
    noted = Noted()
    monkeypatch.setattr(journeys, "find_reach", noted)
    model: Any = object()
    for start in (WEST, "Westend", "47, 9"):
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
    by_hand = {"wind_speed_m_s": 3.0}
    for kind, run, document in (
        (ReachRequest, asked.reach, {"start": WEST}),
        (PlanRequest, asked.plan, {"stops": [WEST, EAST]}),
    ):
        run(check_request(document, kind), model)  # type: ignore[type-var, operator]
        assert noted.given[0].weather is server
        run(check_request(document | by_hand, kind), model)  # type: ignore[type-var, operator]
        assert noted.given[0].departure.wind_speed_m_s == 3.0
