"""The service plans journeys with the roads of a router on loopback, and says clearly what fails."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.support.command import answered
from tests.support.roads import osrm
from tests.support.router_server import RouterServer, answering, write_map
from tests.support.service_process import Service, serving
from tests.support.service_schema import conformance

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
    with serving(folder / "logs", "--workers", "1", "--map", named) as found:
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


def test_a_round_trip_and_answers_that_are_not_asked(planner: Service) -> None:
    document = {**ROADS, "routes": [{**ROADS["routes"][0]}]}
    assert document["code"] == "Ok"
    found = plan(planner, answers=False).json()
    assert found["costs_wh"] == {}
    assert found["charging"] is None
    windy = plan(
        planner, weather={"wind_speed_m_s": 10.0, "wind_from_deg": 90.0, "temperature_degc": -5.0}
    ).json()
    assert windy["costs_wh"]["wind"] > 50.0


def test_the_area_of_reach(planner: Service, router: RouterServer) -> None:
    found = planner.client.post("/v1/reachable", json={"start": "Westend", "soc": 0.04})
    assert found.status_code == 422  # this router knows one road, so that all other directions fail
    assert found.json()["faults"][0]["what"] == "place outside of the map"


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
    one = planner.client.get("/v1/map/view", params=bounds | {"limit": 1, "west": 9.06}).json()
    assert ([place["name"] for place in one["settlements"]], one["stations"]) == (["Ostheim"], [])
    wrong = planner.client.get("/v1/map/view", params=bounds | {"south": 48.0, "west": 10.0})
    assert wrong.status_code == 422
    assert [fault["where"] for fault in wrong.json()["faults"]] == ["south, north", "west, east"]
    assert planner.client.get("/v1/map/view", params=bounds | {"south": "nan"}).status_code == 422


def test_tiles_of_the_router_are_served_and_kept_by_the_browser(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    with (
        answering(b"\x1a\x00tile") as valhalla,
        serving(tmp_path / "logs", "--workers", "1", "--map", f"valhalla={valhalla.url}") as found,
    ):
        assert found.client.get("/v1/map").json()["tiles"] is True
        tile = found.client.get("/v1/tiles/12/2156/1436")
        assert (tile.status_code, tile.content) == (200, b"\x1a\x00tile")
        assert tile.headers["content-type"] == "application/vnd.mapbox-vector-tile"
        assert tile.headers["cache-control"] == "private, max-age=3600"
        assert found.client.get("/v1/tiles/2/3/0").status_code == 200
        outside = found.client.get("/v1/tiles/2/4/5")
        assert outside.status_code == 422
        assert [(f["where"], f["allowed"]) for f in outside.json()["faults"]] == [
            ("column", "0 to 3 at zoom 2"),
            ("row", "0 to 3 at zoom 2"),
        ]
        assert found.client.get("/v1/tiles/23/0/0").status_code == 422
        nothing = found.client.get("/v1/map/view", params={"south": 0, "west": 0, "north": 1, "east": 1})
        assert (nothing.json()["settlements"], nothing.json()["stations"]) == ([], [])
        valhalla.status = 403
        assert found.client.get("/v1/tiles/12/0/0").status_code == 502


def test_a_router_without_tiles_gives_empty_ones(planner: Service) -> None:
    assert planner.client.get("/v1/tiles/0/0/0").content == b""


def test_what_the_service_knows(planner: Service) -> None:
    assert planner.client.get("/v1/map").json() == {
        "roads": True,
        "places": True,
        "weather": False,
        "tiles": False,
        "stations": 1,
        "bounds_deg": [46.9, 8.9, 47.1, 9.2],
        "attribution": "© OpenStreetMap contributors, ODbL 1.0",
    }


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


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"stops": [WEST]}, "stops"),
        ({"stops": ["", EAST]}, "stops.0"),
        ({"stops": [{"latitude_deg": 91.0, "longitude_deg": 0.0}, EAST]}, "stops.0"),
        ({"stops": ["Nowhere", "Elsewhere"]}, "stops[0]"),
        ({"soc": 1.5}, "soc"),
        ({"reserve": -0.1}, "reserve"),
        ({"alternatives": 9}, "alternatives"),
        ({"depart": "07:30"}, "depart"),
        ({"depart": "2026-02-01T07:30:00"}, "depart"),
        ({"vehicle": "../car.toml"}, "vehicle"),
        ({"weather": {"wind_speed_m_s": 1e9}}, "weather.wind_speed_m_s"),
        ({"unknown": 1}, "unknown"),
    ],
)
def test_what_is_wrong_with_a_request_is_named(planner: Service, changed: dict[str, Any], where: str) -> None:
    found = plan(planner, **changed)
    assert found.status_code == 422
    assert any(fault["where"].startswith(where) for fault in found.json()["faults"])


def test_without_a_map_there_are_no_journeys(service: Service) -> None:
    for path, asked in (("/v1/journeys", ASKED), ("/v1/plan", ASKED), ("/v1/reachable", {"start": WEST})):
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
        3,
        only="^/v1/(journeys|reachable|places|map|map/view|tiles/.*)$",
        phases="examples,fuzzing",
        timeout_s=400.0,
    )
    assert found.clean, found.text[-4000:]


def test_a_map_that_is_none_stops_the_start(tmp_path: Path) -> None:
    answer = answered("serve", "--port", 0, "--map", tmp_path)
    assert answer.code == 2
    assert "no map" in answer.err


def test_a_part_of_a_name_is_a_problem_with_candidates(planner: Service) -> None:
    answer = plan(planner, stops=["West", "Ostheim"])
    assert answer.status_code == 422
    (fault,) = answer.json()["faults"]
    assert (fault["where"], fault["got"]) == ("stops[0]", "West")
    assert "did you mean 'Westend' (town)" in fault["fix"]
    taken = plan(planner, stops=["westend", "Ostheim"]).json()["stops"]
    assert [(stop["name"], stop["kind"]) for stop in taken] == [("Westend", "town"), ("Ostheim", "village")]
