"""`plan`, `reach`, `places` and `map` on the command line, with the roads of a router on loopback."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.support.command import Run
from tests.support.roads import osrm, valhalla_answers
from tests.support.router_server import RouterServer, answering, write_map

import tripwatt as tw
from tripwatt.roads.journey import JourneyOptions, RoadForecaster, find_reach, open_atlas, plan_journey
from tripwatt.routes.places import Place
from tripwatt.server.cars.folder import create_car

ROADS = osrm(annotated=True)
LICENCE = "© OpenStreetMap contributors, ODbL 1.0"


@pytest.fixture(scope="module")
def router() -> Iterator[RouterServer]:
    with answering(ROADS) as found:
        yield found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_map(tmp_path_factory.mktemp("journeys") / "map")


@pytest.fixture
def asked(run: Run, router: RouterServer, folder: Path) -> Callable[..., Any]:
    """The command with the map and the router."""

    def call(verb: str, *arguments: object) -> Any:
        return run(verb, *arguments, "--map", f"{folder}@osrm={router.url}")

    yield call
    router.document, router.status = ROADS, 200


def numbers(document: Any) -> list[float]:
    if isinstance(document, dict):
        return [n for value in document.values() for n in numbers(value)]
    if isinstance(document, list):
        return [n for value in document for n in numbers(value)]
    return [float(document)] if isinstance(document, int | float) else []


def test_a_plan_has_the_numbers_of_python(
    asked: Callable[..., Any], router: RouterServer, folder: Path
) -> None:
    printed = asked("plan", "Westend", "Ostheim", "--soc", 0.8, "--ambient", -5, "--reserve", 0.2, "--json")
    assert printed.code == 0
    same = plan_journey(
        ["Westend", "Ostheim"],
        tw.Departure(soc=0.8, ambient_temperature_degc=-5.0),
        atlas=open_atlas(f"{folder}@osrm={router.url}"),
        options=JourneyOptions(reserve=0.2, alternatives=2),
    )
    found = json.loads(printed.out)
    assert numbers(found) == pytest.approx(numbers(same.to_dict()), rel=1e-9)
    assert found["reserve"] == 0.2


def test_a_plan_in_words(asked: Callable[..., Any]) -> None:
    printed = asked("plan", "Westend", "Ostheim", "--soc", 0.8, "--ambient", 15)
    assert printed.code == 0
    stops, first, leave = printed.out.splitlines()[:3]
    assert stops == "From Westend (town) to Ostheim (village)."
    assert first.startswith("Westend to Ostheim")
    assert leave.endswith(" % is enough to arrive with 10 % left in 19 of 20 trips.")
    assert "7.6 km" in printed.out
    assert "fastest, shortest, least energy" in printed.out.replace("\n", " ")
    assert LICENCE in printed.out + printed.err


def test_ways_that_look_alike_are_one_row(asked: Callable[..., Any], router: RouterServer) -> None:
    (route,) = ROADS["routes"]
    (leg,) = route["legs"]

    def slower(factor: float) -> dict[str, Any]:
        noted = leg["annotation"]
        seconds = [factor * s for s in noted["duration"]]
        slow = noted | {"duration": seconds, "speed": [s / factor for s in noted["speed"]]}
        return route | {"legs": [leg | {"annotation": slow, "duration": sum(seconds)}]}

    router.document = ROADS | {"routes": [route, slower(1.5), slower(1.5001), slower(2.0)]}
    plan = ("plan", "Westend", "Ostheim", "--soc", 0.8, "--ambient", 15)
    roads = json.loads(asked(*plan, "--json").out)["roads"]
    rows = [line for line in asked(*plan).out.splitlines() if line.startswith(" ") and " km " in line]
    assert (len(roads), len(rows)) == (4, 3)
    assert [row.split()[0] for row in rows[1:]] == ["road", "road"]


def test_options_of_a_plan_count(asked: Callable[..., Any]) -> None:
    def energy(*more: object) -> Any:
        printed = asked("plan", "Westend", "Ostheim", "--soc", 0.8, "--ambient", -5, "--json", *more)
        assert printed.code == 0, printed.err
        return json.loads(printed.out)["roads"][0]["forecast"]["energy_wh"]

    plain = energy()
    assert energy("--climate", "off") < plain - 100.0
    assert energy("--wind", "10@90", "--rain", 4, "--payload", 400) > plain + 70.0  # the road leads east
    assert energy("--wind", "10@270") < plain - 50.0


def test_the_folder_of_my_car_plans_a_journey(
    asked: Callable[..., Any], router: RouterServer, folder: Path, tmp_path: Path
) -> None:
    own = create_car(tmp_path / "car", "vw_id3")
    journey = ("plan", "Westend", "Ostheim", "--soc", 0.8, "--ambient", 5, "--json")
    as_car, as_model = (asked(*journey, option, own.folder) for option in ("--car", "--model"))
    assert as_car.code == 0, as_car.err
    same = plan_journey(
        ["Westend", "Ostheim"],
        tw.Departure(soc=0.8, ambient_temperature_degc=5.0),
        atlas=open_atlas(f"{folder}@osrm={router.url}"),
        model=own.model(),
        options=JourneyOptions(alternatives=2),
    )
    assert numbers(json.loads(as_car.out)) == pytest.approx(numbers(same.to_dict()), rel=1e-9)
    assert as_car.out == as_model.out
    assert "option has no effect: --model" in asked(*journey, "--car", own.folder, "--model", own.folder).err


def test_every_wrong_option_of_a_plan_is_named_at_once(asked: Callable[..., Any]) -> None:
    printed = asked("plan", "Westend", "Ostheim", "--depart", "25:00", "--wind", "strong", "--reserve", 1.5)
    assert printed.code == 2
    for words in ("--depart", "25:00", "--wind", "strong", "reserve", "1.5"):
        assert words in printed.err
    assert printed.out == ""


def test_every_unknown_place_is_named_at_once(asked: Callable[..., Any]) -> None:
    printed = asked("plan", "Nowhere", "Elsewhere")
    assert printed.code == 2
    assert "Nowhere" in printed.err
    assert "Elsewhere" in printed.err


def test_a_router_that_fails_ends_the_plan_with_one_message(
    asked: Callable[..., Any], router: RouterServer
) -> None:
    router.document = {"code": "NoRoute", "message": "no route"}
    no_road = asked("plan", "Westend", "Ostheim")
    router.document = {"code": "Ok", "routes": [{"legs": "none"}]}
    nonsense = asked("plan", "Westend", "Ostheim")
    router.document, router.status = {}, 401
    refused = asked("plan", "Westend", "Ostheim")
    for printed, words in (
        (no_road, "no road found"),
        (nonsense, "legs"),
        (refused, "TRIPWATT_ROUTER_KEY"),
    ):
        assert (printed.code, printed.out) == (2, "")
        assert words in printed.err
        assert "Traceback" not in printed.err


def test_a_wrong_place_has_the_name_that_the_help_gives_it(asked: Callable[..., Any]) -> None:
    wrong = asked("plan", "Nowhere", "Westend", "Somewhere", "Elsewhere")
    assert wrong.code == 2
    for name, place in (("FROM", "Nowhere"), ("VIA", "Somewhere"), ("TO", "Elsewhere")):
        assert f"unknown place: {name}: got {place}" in wrong.err
    assert "out of range: FROM [VIA...] TO: got 1" in asked("plan", "Westend").err


def test_a_map_without_roads_names_what_is_missing(run: Run, folder: Path) -> None:
    printed = run("plan", "Westend", "Ostheim", "--map", folder)
    assert printed.code == 2
    assert "Traceback" not in printed.err
    nothing = run("plan", "Westend", "Ostheim", "--map", folder.parent / "nowhere")
    assert nothing.code == 2
    assert "nowhere" in nothing.err


def test_reach_has_the_numbers_of_python(run: Run, folder: Path) -> None:
    documents = valhalla_answers()

    def answer(path: str) -> Any:
        return documents[path.strip("/").partition("?")[0]]

    with answering(answer) as valhalla:
        named = f"{folder}@valhalla={valhalla.url}"
        asked = ("reach", "47.0, 9.0", "--soc", 0.1, "--ambient", 10, "--map", named)
        document, shown = run(*asked, "--json"), run(*asked)
        atlas = open_atlas(named)
        drive = RoadForecaster(tw.load_model(), tw.Departure(soc=0.1, ambient_temperature_degc=10.0), None)
        same = find_reach(drive, Place(47.0, 9.0), atlas)
    assert (document.code, shown.code) == (0, 0)
    assert numbers(json.loads(document.out)) == pytest.approx(numbers(same.to_dict()), rel=1e-9)
    assert "95 %" in shown.out
    assert "50 %" in shown.out


def test_places_by_the_start_of_their_names(run: Run, folder: Path) -> None:
    printed = run("places", "west", "--map", folder, "--json")
    found = json.loads(printed.out)
    assert [place["name"] for place in found["places"]] == [
        "Westend",
        "Westend Arena, Westend",
        "Hauptstraße, Westend",
        "Hauptstraße 12a, Westend",
    ]
    assert found["attribution"] == LICENCE
    shown = run("places", "haupt", "12", "--map", folder)
    assert "Hauptstraße 12a" in shown.out
    assert "47.00100, 9.00200" in shown.out


def test_what_a_map_holds(run: Run, folder: Path) -> None:
    found = json.loads(run("map", "info", folder, "--json").out)
    assert (found["places"], found["stations"], found["bounds_deg"]) == (5, 1, [46.9, 8.9, 47.1, 9.2])
    shown = run("map", "info", folder)
    assert "46.90 to 47.10° N and 8.90 to 9.20° E around Westend and Ostheim" in shown.out
    missing = run("map", "info", folder.parent / "nowhere")
    assert missing.code == 2
    assert "nowhere" in missing.err


def test_a_map_of_no_extract_is_refused(run: Run, tmp_path: Path) -> None:
    (tmp_path / "region.osm.pbf").write_bytes(b"no extract")
    printed = run("map", "build", tmp_path / "region.osm.pbf", "--out", tmp_path / "made")
    assert printed.code == 2
    assert "Traceback" not in printed.err
    assert not (tmp_path / "made").exists()
    assert not (tmp_path / "made.unfinished").exists()


def test_a_map_without_heights_names_what_is_missing(run: Run, tmp_path: Path) -> None:
    folder = write_map(tmp_path / "map")
    info = json.loads((folder / "map.json").read_text("utf-8"))
    info["terrain"]["missing"] = ["N46E008", "N46E009"]
    (folder / "map.json").write_text(json.dumps(info), "utf-8")
    shown = run("map", "info", folder)
    assert "heights" in shown.out
    assert "unknown" in shown.out
    assert "no heights for N46E008, N46E009" in shown.err
    assert "USGS EarthExplorer" in shown.err


def test_a_place_outside_of_the_map_gets_what_the_map_covers(run: Run, tmp_path: Path) -> None:
    folder = write_map(tmp_path / "map")
    shown = run("places", "Nowhere", "--map", folder)
    assert (
        "this map covers 46.90 to 47.10° N and 8.90 to 9.20° E around Westend and Ostheim (made)" in shown.err
    )
    assert "this map covers" not in run("places", "Westend", "--map", folder).err
