"""The synthetic country: made from a seed, built into a map, and driven in on a real Valhalla."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.support.router_server import valhalla_serving
from tools.data.country import SIZES, Country, Heights, degrees, write_country

import tripwatt as tw
from tripwatt.roads.journey import Atlas, JourneyOptions, open_atlas, plan_journey
from tripwatt.roads.maps.engine import valhalla_folder
from tripwatt.roads.maps.folder import MapFolder, build_map
from tripwatt.roads.maps.stations import near
from tripwatt.routes.places import Place


def test_one_seed_is_one_country() -> None:
    drawn = [Country(SIZES["small"], seed).draw() for seed in (1, 1, 2)]
    assert drawn[0].ways == drawn[1].ways
    assert drawn[0].x_km == drawn[1].x_km != drawn[2].x_km
    assert 2_000 < drawn[0].edges < 5_000


def test_edges_are_pieces_between_junctions() -> None:
    drawing = Country(SIZES["small"], 1).drawing
    a, b, c, d = (drawing.node(float(k), 0.0) for k in range(4))
    drawing.way([a, b, c], "residential")
    assert drawing.edges == 1
    drawing.way([b, d], "residential")
    assert drawing.edges == 3


def test_heights_are_hills_above_the_sea() -> None:
    latitude, longitude = degrees(Country(SIZES["small"], 3).draw())
    north, east = (np.linspace(values.min(), values.max(), 200) for values in (latitude, longitude))
    heights = Heights(3).grid_m(north, east)
    assert heights.min() >= 0.0
    assert 300.0 < np.ptp(heights) < 3000.0
    again = Heights(3).grid_m(north[50:51], east)[0]
    np.testing.assert_allclose(heights[50], again, rtol=1e-9)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> MapFolder:
    if valhalla_folder() is None:
        pytest.skip("Valhalla is not installed: .ci/run prepares it, or set TRIPWATT_VALHALLA to its folder")
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    folder: Path = tmp_path_factory.mktemp("country")
    extract, elevation, _ = write_country(folder / "source")
    return build_map(extract, folder / "map", elevation=elevation)


@pytest.fixture(scope="module")
def atlas(built: MapFolder) -> Iterator[Atlas]:
    with valhalla_serving(built) as address:
        yield open_atlas(address)


def test_what_the_map_of_the_country_holds(built: MapFolder) -> None:
    assert built.info["terrain"]["known"]
    assert built.info["terrain"]["missing"] == []
    assert "(synthetic-country.osm.pbf)" in built.covers
    powers = {station.power_w for station in built.index.stations()}
    assert {22_000.0, 50_000.0, 150_000.0, 300_000.0} <= powers


def test_a_motorway_of_400_km_has_hills_and_stations(atlas: Atlas) -> None:
    cities = [place for place in atlas.settlements((44.0, -34.0, 45.0, -27.0), 9) if place.kind == "city"]
    cities.sort(key=lambda place: place.longitude_deg)
    (road, *_) = atlas.router.roads((cities[0], cities[-1]))
    assert road.distance_m > 400_000.0
    motorway_m = sum(
        m for m, kind in zip(road.links.length_m, road.road_class, strict=True) if kind == "motorway"
    )
    assert motorway_m > 0.9 * road.distance_m
    line = [
        Place(*pair) for pair in zip(road.latitude_deg.tolist(), road.longitude_deg.tolist(), strict=True)
    ]
    at_m = [road.position_m[k] for _, k in near(atlas.stations, line, 3000.0)]
    assert len(at_m) >= 20
    assert np.diff([0.0, *sorted(at_m), road.distance_m]).max() < 60_000.0
    assert road.links.elevation_m is not None
    assert np.abs(np.diff(road.links.elevation_m)).sum() > 1000.0
    east, west = (atlas.router.roads(pair)[0] for pair in (cities[:2], cities[1::-1]))
    assert east.distance_m == pytest.approx(west.distance_m, rel=0.02)  # there is a carriageway back


def test_a_journey_of_the_country_has_its_climb(atlas: Atlas) -> None:
    towns = [place for place in atlas.settlements((44.0, -34.0, 45.0, -27.0), 20) if place.kind == "town"]
    start, *others = sorted(towns, key=lambda place: place.longitude_deg)
    journey = plan_journey(
        [start.title, others[0].title],
        tw.Departure(soc=0.9, ambient_temperature_degc=5.0),
        atlas=atlas,
        options=JourneyOptions(answers=False, alternatives=0),
    )
    assert journey.forecast.plan.has_road
    assert not [flag for flag in journey.forecast.flags if flag.code == "unknown_climb"]
