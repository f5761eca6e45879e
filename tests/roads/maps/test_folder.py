"""Map folders: built whole or not at all."""

import json
import platform

import numpy as np
import pytest
from tests.roads.maps.made import node, osm
from tests.support.router_server import write_map

from tripwatt.errors import Fault, InvalidInput
from tripwatt.roads.maps.folder import build_map, open_map


def names(found):
    return [place.name for place in found]


@pytest.fixture
def builder(monkeypatch, tmp_path):
    """Builds a map of an extract without Valhalla: its tiles are one empty file."""
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    monkeypatch.setattr("tripwatt.roads.maps.folder.require_valhalla", lambda: tmp_path)

    def tiles(work, extract):
        (work / "tiles").mkdir()

    monkeypatch.setattr("tripwatt.roads.maps.folder.build_tiles", tiles)

    def build(*objects, out="deep/map", **more):
        (tmp_path / "region.osm").write_text(osm(*objects), "utf-8")
        return build_map(tmp_path / "region.osm", tmp_path / out, **more)

    return build


DEAD = 1 << 22  # no process has a larger number: proc(5), pid_max

PLACES = (
    node(1, 47.0, 9.0, place="town", name="Westend"),
    node(2, 47.2, 9.1, addr__housenumber="7", addr__street="Ring"),
    node(3, 47.1, 9.4, amenity="charging_station"),
)


def test_a_map_says_what_it_is_made_of(builder, tmp_path):
    steps = []
    made = builder(*PLACES, progress=steps.append)
    assert steps == ["places", "elevation", "roads"]
    assert sorted(path.name for path in made.folder.iterdir()) == ["map.json", "places.sqlite", "tiles"]
    assert (made.folder / "map.json").read_text("utf-8").startswith('{\n "format": 5,\n "extract":')
    assert made.info == {
        "format": 5,
        "extract": "region.osm",
        "extract_bytes": (tmp_path / "region.osm").stat().st_size,
        "attribution": "© OpenStreetMap contributors, ODbL 1.0",
        "bounds_deg": [47.0, 9.0, 47.2, 9.1],
        "terrain": {
            "known": False,
            "source": "",
            "tiles": 0,
            "missing": ["N46E008", "N46E009", "N47E008", "N47E009"],
        },
        "places": 2,
        "stations": 1,
    }
    assert open_map(made.folder).info == made.info
    assert names(made.index.search("ring")) == ["Ring 7, Westend"]
    assert made.index.stations()[0].latitude_deg == 47.1


def test_a_house_is_named_by_a_settlement_and_not_by_what_stands_beside_it(builder):
    made = builder(
        node(1, 47.0, 9.0, place="hamlet", name="Hof"),
        node(2, 47.1, 9.1, amenity="cafe", name="Blau"),
        node(3, 47.1, 9.1, addr__housenumber="7", addr__street="Ring"),
    )
    assert names(made.index.search("ring")) == ["Ring 7, Hof"]


def test_a_map_without_places_has_no_bounds(builder):
    assert builder().info["bounds_deg"] is None


def test_the_elevation_tiles_that_a_map_needs_lie_where_valhalla_looks_for_them(builder, tmp_path):
    source = tmp_path / "heights"
    (source / "more").mkdir(parents=True)
    for name in ("n47e009.hgt", "more/N48E009.hgt", "N46E009.hgt"):
        (source / name).write_bytes(np.full(1201 * 1201, 400, ">i2").tobytes())
    made = builder(
        node(1, 47.1, 9.1, place="town", name="A"),
        node(2, 47.2, 10.1, place="town", name="B"),
        elevation=source,
    )
    assert made.info["terrain"] == {
        "known": True,
        "source": "elevation tiles of 3 arc-seconds",
        "tiles": 1,
        "missing": ["N47E010"],
    }
    kept = [path.relative_to(made.folder).as_posix() for path in made.folder.rglob("*.hgt*")]
    assert kept == ["elevation/N47/N47E009.hgt"]


def test_what_a_map_covers_in_words(builder):
    assert builder(*PLACES).covers == "47.00 to 47.20° N and 9.00 to 9.10° E around Westend (region.osm)"
    towns = [node(k, -0.5 + k, -1.0 + k, place="town", name=f"T{k}", population=f"{9 - k}") for k in range(4)]
    assert (
        builder(*towns).covers
        == "0.50° S to 2.50° N and 1.00° W to 2.00° E around T0, T1 and T2 (region.osm)"
    )
    assert builder().covers == ""


def test_a_map_is_replaced_when_the_new_one_is_complete(builder, tmp_path, monkeypatch):
    left = tmp_path / f".map.{platform.node()}.0.{DEAD}.writing"  # of a process that was killed
    left.mkdir()
    (left / "left.txt").write_text("x")
    old = builder(*PLACES, out="map")
    assert not (old.folder / "left.txt").exists()
    (old.folder / "old.txt").write_text("x")

    def broken(work, extract):
        raise InvalidInput(Fault("cannot build the map", "x"))

    with monkeypatch.context() as patch:
        patch.setattr("tripwatt.roads.maps.folder.build_tiles", broken)
        with pytest.raises(InvalidInput, match="cannot build the map"):
            builder(out="map")
    assert (old.folder / "old.txt").exists()
    assert builder(out="map").info["places"] == 0
    assert not (old.folder / "old.txt").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map", "region.osm"]


def test_words_about_another_format_are_cut(tmp_path):
    (tmp_path / "map.json").write_text(json.dumps({"format": "f" * 99}))
    with pytest.raises(InvalidInput, match="map of another release") as caught:
        open_map(tmp_path)
    assert caught.value.faults[0].got == "format '" + "f" * 52


def test_a_map_folder_is_opened(tmp_path):
    found = open_map(write_map(tmp_path / "map"))
    assert found.info["places"] == 5
    assert found.index.search("ost")[0].name == "Ostheim"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            None,
            "no map: .*: got No such file or directory; allowed: a folder with a map; build one with tripwatt map build",
        ),
        ("{", "no map: .*JSONDecodeError"),
        ("[]", "map of another release: .*: got no object"),
        (json.dumps({"format": 99}), "map of another release: .*: got format 99; allowed: format 5"),
    ],
)
def test_a_folder_without_a_map_is_refused(tmp_path, text, message):
    if text is not None:
        (tmp_path / "map.json").write_text(text)
    with pytest.raises(InvalidInput, match=message):
        open_map(tmp_path)


def test_what_cannot_be_built_is_named_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr("tripwatt.roads.maps.folder.require_valhalla", lambda: tmp_path)
    full = tmp_path / "full"
    full.mkdir()
    (full / "mine.txt").write_text("x")
    with pytest.raises(InvalidInput) as caught:
        build_map(tmp_path / "none.osm.pbf", full, elevation=tmp_path / "nothing")
    assert [fault.what for fault in caught.value.faults] == [
        "no such file",
        "folder holds something else",
        "no elevation tiles",
    ]
    assert [path.name for path in full.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("made", ["nothing", "an empty folder", "a map"])
def test_a_new_folder_or_that_of_a_map_is_free(tmp_path, monkeypatch, made):
    monkeypatch.setattr("tripwatt.roads.maps.folder.require_valhalla", lambda: tmp_path)
    place = tmp_path / "map"
    if made == "a map":
        write_map(place)
    elif made == "an empty folder":
        place.mkdir()
    with pytest.raises(InvalidInput) as caught:
        build_map(tmp_path / "none.osm.pbf", place)
    assert [fault.what for fault in caught.value.faults] == ["no such file"]


def test_a_file_is_no_folder_of_a_map(tmp_path, monkeypatch):
    monkeypatch.setattr("tripwatt.roads.maps.folder.require_valhalla", lambda: tmp_path)
    (tmp_path / "map").write_text("x")
    with pytest.raises(InvalidInput) as caught:
        build_map(tmp_path / "none.osm.pbf", tmp_path / "map")
    assert [fault.what for fault in caught.value.faults] == ["no such file", "folder holds something else"]
