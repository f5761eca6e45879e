"""The index of places, charging stations, and map folders; a map is written as text, so nothing is built here."""

import json
import sqlite3

import pytest
from tests.support.router_server import OBJECTS, SETTLEMENTS, write_map

from tripwatt.errors import InvalidInput
from tripwatt.routes.maps import PlaceIndex, Station, build_map, near, open_map, read_stations, within
from tripwatt.routes.maps.extract import Named, station_of_tags
from tripwatt.routes.maps.index import write_index
from tripwatt.routes.places import Place
from tripwatt.routes.search import find_place

OSM = """<?xml version="1.0"?><osm version="0.6">
<node id="1" lat="47.0" lon="9.0"><tag k="place" v="town"/><tag k="name" v="Westend"/></node>
<node id="2" lat="47.01" lon="9.0"/><node id="3" lat="47.02" lon="9.0"/><node id="4" lat="47.03" lon="9.0"/>
<node id="5" lat="47.01" lon="9.01"><tag k="addr:housenumber" v="7"/><tag k="addr:street" v="Ring"/>
 <tag k="addr:city" v="Altdorf"/></node>
<node id="6" lat="47.02" lon="9.02"><tag k="amenity" v="charging_station"/><tag k="operator" v="Strom AG"/>
 <tag k="socket:type2_combo" v="2"/><tag k="socket:type2_combo:output" v="150 kW"/></node>
<node id="7" lat="47.02" lon="9.03"><tag k="amenity" v="cafe"/><tag k="name" v="Café Blau"/></node>
<node id="8" lat="47.02" lon="9.04"><tag k="highway" v="bus_stop"/><tag k="name" v="Halt"/></node>
<node id="9" lat="47.02" lon="9.05"><tag k="amenity" v="bench"/></node>
<way id="1"><nd ref="2"/><nd ref="3"/><nd ref="4"/><tag k="highway" v="primary"/><tag k="name" v="Ring"/></way>
<way id="2"><nd ref="99"/><nd ref="98"/><tag k="highway" v="primary"/><tag k="name" v="Nowhere"/></way>
</osm>"""


@pytest.fixture(scope="module")
def index(tmp_path_factory):
    path = tmp_path_factory.mktemp("index") / "places.sqlite"
    assert write_index(path, SETTLEMENTS, OBJECTS) == {"places": 5, "stations": 1}
    return PlaceIndex(path)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("west", ["Westend", "Westend Arena, Westend", "Hauptstraße, Westend", "Hauptstraße 12a, Westend"]),
        (
            "Westend",
            ["Westend", "Westend Arena, Westend", "Hauptstraße, Westend", "Hauptstraße 12a, Westend"],
        ),
        ("haupt 12 west", ["Hauptstraße 12a, Westend"]),
        ("HAUPTSTRASSE", ["Hauptstraße, Westend", "Hauptstraße 12a, Westend"]),
        ("hauptstraße", ["Hauptstraße, Westend", "Hauptstraße 12a, Westend"]),
        ("ost", ["Ostheim"]),
        ("heim", []),
        ("", []),
        ("' OR 1=1 --", []),
        ('"*(', []),
        ("NEAR(west", []),
    ],
)
def test_places_are_found_by_the_start_of_their_words(index, text, names):
    assert [place.name for place in index.search(text)] == names


def test_a_place_has_its_kind_and_its_coordinates(index):
    assert index.search("ostheim") == (Place(47.0, 9.1, "Ostheim", "village"),)
    assert len(index.search("west", limit=2)) == 2


def test_the_stations_are_as_they_were_written(index):
    assert index.stations() == (OBJECTS[-1],)


def test_settlements_inside_of_bounds_the_largest_first(index):
    names = lambda *bounds, limit=9: [place.name for place in index.settlements(*bounds, limit)]  # noqa: E731
    assert names(46.0, 8.0, 48.0, 10.0) == ["Westend", "Ostheim"]  # no street, house or arena
    assert names(46.0, 8.0, 48.0, 10.0, limit=1) == ["Westend"]
    assert names(47.0, 9.1, 47.0, 9.1) == ["Ostheim"]  # bounds belong to it
    assert names(46.0, 9.01, 48.0, 9.09) == []
    assert names(47.01, 8.0, 48.0, 10.0) == names(46.0, 8.0, 46.99, 10.0) == []
    (town,) = index.settlements(47.0, 9.0, 47.0, 9.0, 9)
    assert town == Place(47.0, 9.0, "Westend", "town")


def test_an_index_without_streets_has_all_its_settlements(tmp_path):
    write_index(tmp_path / "i.sqlite", SETTLEMENTS, SETTLEMENTS)
    found = PlaceIndex(tmp_path / "i.sqlite").settlements(-90.0, -180.0, 90.0, 180.0, 9)
    assert [place.kind for place in found] == ["town", "village"]


def test_stations_inside_of_bounds_those_with_power_first():
    made = [
        Station(47.0, 9.0, "slow", 11e3),
        Station(47.2, 9.2, "fast", 150e3),
        Station(47.1, 9.3, "far", 5e4),
    ]
    found = lambda *bounds, limit=9: [s.name for s in within(made, *bounds, limit)]  # noqa: E731
    assert found(47.0, 9.0, 47.2, 9.2) == ["fast", "slow"]
    assert found(47.0, 9.0, 47.2, 9.3, limit=2) == ["fast", "far"]
    assert found(47.01, 9.0, 47.19, 9.2) == found(46.0, 9.4, 48.0, 9.5) == []


def test_pieces_of_a_street_in_one_settlement_are_one_place(tmp_path):
    path = tmp_path / "i.sqlite"
    pieces = [Named("street", "Ring", 47.0, 9.0), Named("street", "Ring", 47.002, 9.0)]
    far = Named("street", "Ring", 47.0, 9.1)
    assert write_index(path, SETTLEMENTS, [*pieces, far]) == {"places": 2, "stations": 0}
    found = PlaceIndex(path).search("ring")
    assert {(place.name, round(place.latitude_deg, 6)) for place in found} == {
        ("Ring, Westend", 47.001),
        ("Ring, Ostheim", 47.0),
    }


def test_far_from_any_settlement_a_place_has_its_name_alone(tmp_path):
    path = tmp_path / "i.sqlite"
    write_index(path, SETTLEMENTS, [Named("poi", "Hut", 47.5, 9.0), Named("poi", "Inn", 47.29, 9.0)])
    assert [place.name for place in PlaceIndex(path).search("hut")] == ["Hut"]
    assert [place.name for place in PlaceIndex(path).search("inn")] == ["Inn, Westend"]
    write_index(path, [], [Named("poi", "Hut", 47.5, 9.0)])
    assert [place.name for place in PlaceIndex(path).search("hut")] == ["Hut"]


def test_what_is_no_index_is_refused(tmp_path):
    (tmp_path / "i.sqlite").write_bytes(b"no database")
    with pytest.raises(InvalidInput, match="no index of places"):
        PlaceIndex(tmp_path / "i.sqlite")
    with pytest.raises(InvalidInput, match="no index of places"):
        PlaceIndex(tmp_path / "missing.sqlite")


# charging stations


@pytest.mark.parametrize(
    ("tags", "power_w", "direct", "known"),
    [
        ({}, 11_000.0, False, False),
        ({"socket:type2": "2", "socket:type2:output": "22 kW"}, 22_000.0, False, True),
        ({"socket:type2_combo": "yes"}, 50_000.0, True, False),
        ({"socket:type2_combo": "no", "socket:type2": "1"}, 11_000.0, False, False),
        ({"socket:chademo": "1", "socket:chademo:output": "62,5 kW"}, 62_500.0, True, True),
        ({"socket:type2_combo": "1", "socket:type2_combo:output": "50 kW;150 kW"}, 150_000.0, True, True),
        ({"socket:type2": "1", "socket:type2:output": "3700 W"}, 3_700.0, False, True),
        ({"charging_station:output": "300 kW", "socket:type2_combo": "4"}, 300_000.0, True, True),
        ({"socket:type2": "1", "socket:type2:output": "9999999 kW"}, 11_000.0, False, False),
        ({"socket:type2": "1", "socket:type2:output": "999 W"}, 11_000.0, False, False),
    ],
)
def test_the_power_of_a_station(tags, power_w, direct, known):
    station = station_of_tags(tags, 47.0, 9.0)
    assert (station.power_w, station.direct_current, station.power_known) == (power_w, direct, known)


@pytest.mark.parametrize("tags", [{"access": "private"}, {"access": "no"}, {"motorcar": "no"}])
def test_stations_that_no_car_of_the_public_may_use_are_left_out(tags):
    assert station_of_tags(tags, 47.0, 9.0) is None


def test_a_station_is_named_by_its_operator_where_it_has_no_name():
    assert station_of_tags({"operator": "Strom"}, 47.0, 9.0).name == "Strom"
    assert station_of_tags({"operator": "Strom", "name": "Mitte"}, 47.0, 9.0).name == "Mitte"
    assert station_of_tags({}, 47.0, 9.0).place.title == "charging station"


def test_stations_near_a_line_in_its_order():
    stations = [Station(47.0, 9.05, "c", 5e4), Station(47.0, 9.0, "a", 5e4), Station(47.1, 9.0, "far", 5e4)]
    line = [Place(47.0, 9.0), Place(47.0, 9.02), Place(47.0, 9.05)]
    assert near(stations, line, 100.0) == [(1, 0), (0, 2)]
    assert near(stations, line, 12_000.0) == [(1, 0), (2, 0), (0, 2)]
    assert near([], line, 100.0) == near(stations, [], 100.0) == []


def test_a_file_of_stations(tmp_path):
    path = tmp_path / "stations.csv"
    path.write_text("name,latitude_deg,longitude_deg,power_kw\nA,47.0,9.0,150\n,47.1,9.1,43\nC,47.1,9.1,44\n")
    assert read_stations(path) == (
        Station(47.0, 9.0, "A", 150_000.0, direct_current=True),
        Station(47.1, 9.1, "", 43_000.0),
        Station(47.1, 9.1, "C", 44_000.0, direct_current=True),
    )
    path.write_text("latitude_deg,longitude_deg,power_kw\n47.0,9.0,22\n")
    assert read_stations(path)[0].name == ""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("latitude_deg,power_kw\n1,2\n", "missing column: stations.csv: got longitude_deg"),
        (
            "latitude_deg,longitude_deg,power_kw\n91,9,150\n47,181,x\n",
            "value out of range: stations.csv, column 'latitude_deg', row 1: got 91; allowed: -90 to 90\n"
            "value out of range: stations.csv, column 'longitude_deg', row 2: got 181; allowed: -180 to 180\n"
            "value out of range: stations.csv, column 'power_kw', row 2: got x; allowed: 1 to 1500",
        ),
        ("", "cannot read the stations"),
    ],
)
def test_every_fault_of_a_file_of_stations_is_named(tmp_path, text, message):
    (tmp_path / "stations.csv").write_text(text)
    with pytest.raises(InvalidInput) as caught:
        read_stations(tmp_path / "stations.csv")
    assert message in str(caught.value)


# extracts


def test_places_streets_houses_and_stations_of_an_extract(tmp_path):
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    from tripwatt.routes.maps.extract import read_objects

    path = tmp_path / "region.osm"
    path.write_text(OSM)
    assert list(read_objects(path)) == [
        Named("town", "Westend", 47.0, 9.0),
        Named("house", "7", 47.01, 9.01, "Ring", "Altdorf"),
        Station(47.02, 9.02, "Strom AG", 150_000.0, direct_current=True),
        Named("poi", "Café Blau", 47.02, 9.03),
        Named("street", "Ring", 47.02, 9.0),
    ]
    assert list(read_objects(path, settlements_only=True)) == [Named("town", "Westend", 47.0, 9.0)]


def test_a_damaged_extract_is_one_clear_error(tmp_path):
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    from tripwatt.routes.maps.extract import read_objects

    for name, content in (("a.osm.pbf", b"\0\0\0\x20nonsense"), ("a.osm", b"<osm><node"), ("a.txt", b"x")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InvalidInput, match=f"cannot read the extract: {name}"):
            list(read_objects(tmp_path / name))


# folders


def test_a_map_folder_is_opened(tmp_path):
    found = open_map(write_map(tmp_path / "map"))
    assert found.info["places"] == 5
    assert found.index.search("ost")[0].name == "Ostheim"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            None,
            "no map: .*: got FileNotFoundError; allowed: a folder with a map; build one with tripwatt map build",
        ),
        ("{", "no map: .*JSONDecodeError"),
        ("[]", "map of another release: .*: got no object"),
        (json.dumps({"format": 99}), "map of another release: .*: got format 99; allowed: format 1"),
    ],
)
def test_a_folder_without_a_map_is_refused(tmp_path, text, message):
    if text is not None:
        (tmp_path / "map.json").write_text(text)
    with pytest.raises(InvalidInput, match=message):
        open_map(tmp_path)


def test_what_cannot_be_built_is_named_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr("tripwatt.routes.maps.folder.require_valhalla", lambda: tmp_path)
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
    monkeypatch.setattr("tripwatt.routes.maps.folder.require_valhalla", lambda: tmp_path)
    place = tmp_path / "map"
    if made == "a map":
        write_map(place)
    elif made == "an empty folder":
        place.mkdir()
    with pytest.raises(InvalidInput) as caught:
        build_map(tmp_path / "none.osm.pbf", place)
    assert [fault.what for fault in caught.value.faults] == ["no such file"]


def test_a_file_is_no_folder_of_a_map(tmp_path, monkeypatch):
    monkeypatch.setattr("tripwatt.routes.maps.folder.require_valhalla", lambda: tmp_path)
    (tmp_path / "map").write_text("x")
    with pytest.raises(InvalidInput) as caught:
        build_map(tmp_path / "none.osm.pbf", tmp_path / "map")
    assert [fault.what for fault in caught.value.faults] == ["no such file", "folder holds something else"]


def test_without_valhalla_a_map_cannot_be_built(tmp_path, monkeypatch):
    monkeypatch.setattr("tripwatt.routes.maps.engine.valhalla_folder", lambda: None)
    with pytest.raises(
        InvalidInput, match=r"missing package: pyvalhalla: got not installed; use Python 3.12 or newer"
    ):
        build_map(tmp_path / "a.osm.pbf", tmp_path / "map")


def test_the_index_is_read_only(index):
    with pytest.raises(sqlite3.OperationalError, match="readonly"):
        index.database.execute("DELETE FROM places")


@pytest.mark.parametrize("text", ["Westendd", "Wetsend", "Vestend", "westnd"])
def test_a_misspelt_settlement_is_found_as_the_most_similar_one(index, text):
    assert [place.name for place in index.search(text, limit=1)] == ["Westend"]
    with pytest.raises(InvalidInput, match=r"did you mean 'Westend' \(\w+\)"):
        find_place(text, index, "from")
