"""Journeys on a real Valhalla: a map is built of an OpenStreetMap extract, and its roads are served on loopback.

`.ci/run` prepares Valhalla's programs; `TRIPWATT_VALHALLA` names their folder. From Python 3.12 on, with `pyvalhalla`
installed, the same tests run in process as well.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from tests.support.refusals import refuses
from tests.support.router_server import valhalla_serving

import tripwatt as tw
from tripwatt.command.sentences import chance_to_arrive, journey_in_words, unknown_climb_in_words
from tripwatt.errors import InvalidInput
from tripwatt.roads.journey import Atlas, JourneyOptions, RoadForecaster, find_reach, open_atlas, plan_journey
from tripwatt.roads.maps.engine import valhalla_folder
from tripwatt.roads.maps.folder import MapFolder, build_map
from tripwatt.roads.routers import Road, Router, open_server
from tripwatt.routes.links import FLAT_ROAD
from tripwatt.routes.places import Place

IN_PROCESS = importlib.util.find_spec("valhalla") is not None


@pytest.fixture(scope="session")
def elevation(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One elevation tile of a plane that rises by 1000 m a degree to the north, as SRTM writes it with 3601 rows."""
    folder = tmp_path_factory.mktemp("elevation")
    rows = 3601
    height = np.round(1000.0 * (1.0 - np.arange(rows) / (rows - 1)) + 500.0).astype(">i2")
    (folder / "N47E009.hgt").write_bytes(np.repeat(height[:, None], rows, axis=1).tobytes())
    return folder


@pytest.fixture(scope="session")
def built(data_dir: Path, elevation: Path, tmp_path_factory: pytest.TempPathFactory) -> MapFolder:
    if valhalla_folder() is None:
        pytest.skip("Valhalla is not installed: .ci/run prepares it, or set TRIPWATT_VALHALLA to its folder")
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    extract = data_dir / "osm" / "liechtenstein.osm.pbf"
    if not extract.is_file():
        pytest.skip(f"no extract at {extract}")
    return build_map(extract, tmp_path_factory.mktemp("built") / "map", elevation=elevation)


@pytest.fixture(scope="session", params=["server", "in process"])
def atlas(request: pytest.FixtureRequest, built: MapFolder) -> Iterator[Atlas]:
    if request.param == "in process":
        if not IN_PROCESS:
            pytest.skip("pyvalhalla is not installed for this Python: it needs 3.12 or newer")
        yield open_atlas(built.folder)
        return
    with valhalla_serving(built) as address:
        yield open_atlas(address)


def test_the_map_holds_roads_places_and_elevation(built: MapFolder) -> None:
    assert built.info["places"] > 2000
    assert built.info["terrain"]["tiles"] == 1
    assert (built.folder / "elevation" / "N47" / "N47E009.hgt").is_file()
    assert list(built.folder.parent.glob(".map.*")) == []
    south, west, north, east = built.info["bounds_deg"]
    assert 47.0 < south < 47.1 < 47.2 < north < 47.3
    assert 9.4 < west < 9.5 < 9.6 < east < 9.7


@pytest.fixture(scope="session")
def places(built: MapFolder) -> Atlas:
    """The places and the end of the map; its roads are not asked."""
    return Atlas(open_server("osrm=http://127.0.0.1:9"), built.index, folder=built, is_local=True)


def test_an_atlas_has_the_heights_of_its_map(places: Atlas, built: MapFolder) -> None:
    assert places.heights is not None
    south, north, elsewhere = places.heights(np.array([47.1, 47.2, 51.0]), np.array([9.52, 9.61, 0.0]))
    assert (south, north) == pytest.approx((600.0, 700.0), abs=1.0)
    assert np.isnan(elsewhere)
    flat = replace(built, info={**built.info, "terrain": {}})
    assert replace(places, folder=flat).heights is None
    assert replace(places, folder=None).heights is None


def test_a_town_outside_of_the_map_is_no_street_inside(places: Atlas) -> None:
    with pytest.raises(InvalidInput) as caught:
        places.find("Feldkirch", "stops[1]")
    (fault,) = caught.value.faults
    assert (fault.what, fault.where, fault.got) == ("unknown place", "stops[1]", "Feldkirch")
    assert "'Feldkircherstrasse, Nendeln' (street)" in fault.fix
    assert (
        "this map covers 47.06 to 47.27° N and 9.48 to 9.63° E around Schaan, Vaduz and Triesen" in fault.fix
    )


@pytest.mark.parametrize(
    ("text", "described"),
    [
        ("Vaduz", "Vaduz (village)"),
        ("schaan", "Schaan (village)"),
        ("Malbun", "Malbun, Triesenberg (hamlet)"),
        ("Landstrasse Schaan", "Landstrasse, Schaan (street)"),
    ],
)
def test_a_whole_name_is_taken_with_its_kind(places: Atlas, text: str, described: str) -> None:
    assert places.find(text, "x").described == described


@pytest.mark.parametrize(
    ("text", "meant"),
    [("Vadutz", "Vaduz"), ("Schan", "Schaan"), ("Triesenbrg", "Triesenberg"), ("Landstr", "Landstrasse")],
)
def test_a_typing_error_is_a_question(places: Atlas, text: str, meant: str) -> None:
    with pytest.raises(InvalidInput, match=f"did you mean '{meant}"):
        places.find(text, "x")


def test_suggestions_name_no_place_twice(built: MapFolder) -> None:
    for text in ("Vaduz", "Schaan", "Post", "Landstr", "Bal"):
        names = [place.name for place in built.index.search(text, limit=20)]
        assert len(names) == len(set(names))


def test_coordinates_outside_of_the_map_are_refused(places: Atlas) -> None:
    refuses(r"place outside of the map: stops\[0\].*this map covers", places.find, "47.24, 9.75", "stops[0]")
    refuses("place outside of the map", places.find, Place(40.0, 9.5, "far"), "stops[0]")
    assert places.find("47.14, 9.52", "stops[0]") == Place(47.14, 9.52)


@pytest.mark.parametrize("text", ["Vaduz", "Triesenb", "malbun", "Landstrasse 117 Vaduz"])
def test_places_of_the_country_are_found(built: MapFolder, text: str) -> None:
    (found,) = built.index.search(text, limit=1)
    assert found.name.lower().startswith(text.lower()[:6])


def test_a_journey_from_name_to_name(atlas: Atlas, model: tw.ForecastModel) -> None:
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=-5.0)
    found = plan_journey(["Vaduz", "Ruggell"], departure, atlas=atlas, model=model)
    road = found.roads[0].road
    assert 11_000.0 < road.distance_m < 14_000.0
    assert 600.0 < road.duration_s < 1500.0
    assert found.arrives
    assert 1500.0 < found.forecast.energy_wh < 4000.0
    assert "no_elevation" not in {flag.code for flag in found.forecast.flags}
    # the tile rises by 1000 m a degree of latitude, and Ruggell lies 0.1 degrees north of Vaduz
    north = road.place_at(road.distance_m).latitude_deg - road.place_at(0.0).latitude_deg
    ends = road.links.elevation_at([0.0, road.distance_m])
    assert ends is not None
    assert ends[1] - ends[0] == pytest.approx(1000.0 * north, abs=3.0)


def test_the_way_up_takes_more_than_the_way_down(atlas: Atlas, model: tw.ForecastModel) -> None:
    options = JourneyOptions(answers=False)
    up, down = (
        plan_journey(stops, tw.Departure(soc=0.8, climate="off"), atlas=atlas, model=model, options=options)
        for stops in (["Balzers", "Ruggell"], ["Ruggell", "Balzers"])
    )
    assert up.forecast.energy_wh > down.forecast.energy_wh + 500.0


def test_alternatives_are_other_roads(atlas: Atlas) -> None:
    start, end = (atlas.places.search(name, limit=1)[0] for name in ("Vaduz", "Ruggell"))
    roads = atlas.router.roads((start, end), alternatives=2)
    assert len({round(road.distance_m) for road in roads}) == len(roads) >= 2
    via = atlas.places.search("Nendeln", limit=1)[0]
    (through,) = atlas.router.roads((start, via, end))
    assert through.place_at(through.stop_position_m[0]).distance_m(via) < 300.0


def test_the_area_of_reach_of_a_small_charge(atlas: Atlas, model: tw.ForecastModel) -> None:
    start = atlas.places.search("Vaduz", limit=1)[0]
    drive = RoadForecaster(model, tw.Departure(soc=0.05, ambient_temperature_degc=10.0))
    found = find_reach(drive, start, atlas, reserve=0.0)
    sure, likely = (max(start.distance_m(p) for p in found.outlines[level]) for level in (0.95, 0.5))
    assert 500.0 < sure < likely < 15_000.0
    more = find_reach(RoadForecaster(model, replace(drive.departure, soc=0.08)), start, atlas, reserve=0.0)
    assert max(start.distance_m(p) for p in more.outlines[0.95]) > sure


@pytest.mark.parametrize(
    ("stops", "what"),
    [
        (["Vaduz", "46.5, 9.5"], "place outside of the map|no road found"),
        (["Vaduz", "0, 0"], "place outside of the map|no road found"),
        (["Vaduz", "Atlantis"], "unknown place"),
        (["Vaduz", "Vaduz"], "no way to drive"),
    ],
)
def test_what_cannot_be_driven_is_one_clear_error(
    atlas: Atlas, model: tw.ForecastModel, stops: list[str], what: str
) -> None:
    with pytest.raises(InvalidInput, match=what) as caught:
        plan_journey(stops, tw.Departure(soc=0.8), atlas=atlas, model=model)
    assert len(caught.value.faults) == 1


def test_the_links_of_a_road_have_classes_and_free_speeds(atlas: Atlas) -> None:
    (road,) = atlas.router.roads((Place(47.141, 9.5209), Place(47.2415, 9.5285)))
    assert set(road.road_class) & {"primary", "secondary", "tertiary"}
    assert road.links.free_flow
    assert (road.links.moving_speed_m_s <= 36.2).all()
    assert len(road.links) < 60
    assert (road.links.travel_time_s >= road.links.length_m / road.links.moving_speed_m_s - 0.1).all()


def test_a_damaged_extract_leaves_nothing_behind(tmp_path: Path, built: MapFolder) -> None:
    (tmp_path / "bad.osm.pbf").write_bytes(b"no extract")
    refuses(r"cannot read the extract: bad.osm.pbf", build_map, tmp_path / "bad.osm.pbf", tmp_path / "map")
    assert [path.name for path in tmp_path.iterdir()] == ["bad.osm.pbf"]


def test_a_mountain_road_without_heights_has_no_certain_verdict(
    atlas: Atlas, model: tw.ForecastModel
) -> None:
    """Malbun lies 1,150 m above Vaduz; a map without elevation tiles does not have it."""
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=10.0)
    journey = plan_journey(["Vaduz", "Malbun"], departure, atlas=atlas, model=model)
    road = journey.roads[0].road
    bare = replace(road.links, elevation_position_m=None, elevation_m=None, flags=(FLAT_ROAD,))
    found = RoadForecaster(model, departure).forecast(road.with_links(bare))
    assert "unknown_climb" in {flag.code for flag in found.flags}
    climb = found.climb_to(0.1)
    assert climb is not None
    assert 1150.0 < climb < 3000.0
    assert chance_to_arrive(found, 0.1) == "over 99 %, unless it climbs far"
    (sentence,) = unknown_climb_in_words(found, 0.1)
    assert sentence.startswith("The heights of the road are unknown.")
    assert f"{climb:,.0f} m of climb" in sentence
    assert found.quantile(0.999) > found.energy_wh + 3000.0  # of the 5 kWh that the climb takes
    mountains = RoadForecaster(model, replace(departure, terrain="mountains")).forecast(road.with_links(bare))
    assert mountains.quantile(0.99) > found.quantile(0.99)


@dataclass(frozen=True)
class WithoutHeights:
    """The roads of a router as they are on a map without elevation tiles."""

    router: Router
    name: str = "without heights"

    def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
        roads = self.router.roads(stops, alternatives=alternatives)
        flat = {"elevation_position_m": None, "elevation_m": None, "flags": (FLAT_ROAD,)}
        return tuple(road.with_links(replace(road.links, **flat)) for road in roads)

    def outline(self, start: Place, minutes: float) -> tuple[Place, ...]:
        return self.router.outline(start, minutes)


def test_a_road_of_unknown_heights_into_the_mountains_is_not_promised(atlas: Atlas, built: MapFolder) -> None:
    """Malbun lies 1,150 m above Vaduz: the map has the heights of villages and of bus stops."""
    hidden = replace(atlas, router=WithoutHeights(atlas.router), places=built.index, folder=built)
    heights = hidden.heights_around([hidden.find("Vaduz", "x"), hidden.find("Ruggell", "x")])
    assert heights is not None
    assert heights.terrain == "mountains"
    mild = tw.Departure(soc=0.14, ambient_temperature_degc=15.0)
    zoe, plain = (
        plan_journey(
            ["Vaduz", "Malbun"],
            replace(mild, terrain=terrain),
            atlas=hidden,
            car="renault_zoe_ze50_r135",
            options=JourneyOptions(answers=False),
        )
        for terrain in (None, "flat")
    )
    assert zoe.forecast.plan.departure.terrain == "mountains"
    assert plain.forecast.plan.departure.terrain == "flat"
    assert zoe.verdict.p_arrive < 0.5
    assert not zoe.verdict.arrives
    assert 0.22 < zoe.soc_needed < 0.3
    assert plain.verdict.p_arrive < 0.5, "whoever calls the country flat still climbs to Malbun"
    assert not plain.verdict.arrives
    climb = zoe.forecast.plan.climb
    assert climb is not None
    assert plain.forecast.plan.climb.climb_m == pytest.approx(climb.climb_m)
    assert abs(climb.climb_m[-1] - 1150.0) < 2.0 * climb.sd_m[-1] < 200.0
    assert f"ends at {round(climb.climb_m[-1]):+,} m, seen from the start" in journey_in_words(zoe)[0]
