"""What an extract, a file of stations and an index keep of their objects, each bound from both sides."""

import json
import os
from concurrent.futures import ThreadPoolExecutor

import pytest

from tripwatt.errors import Fault, InvalidInput
from tripwatt.routes.maps import PlaceIndex, Station, build_map, near, open_map, read_stations, stations
from tripwatt.routes.maps.engine import build_tiles, configuration, valhalla_folder
from tripwatt.routes.maps.extract import DC_SOCKETS, Named, read_objects, station_of_tags
from tripwatt.routes.maps.index import write_index
from tripwatt.routes.places import Place

DEGREE_M = 111_195.0797343687
"""Of a great circle of the mean earth."""


def osm(*objects):
    return f'<?xml version="1.0"?><osm version="0.6">{"".join(objects)}</osm>'


def node(number, latitude, longitude, **tags):
    inside = "".join(f'<tag k="{k.replace("__", ":")}" v="{v}"/>' for k, v in tags.items())
    return f'<node id="{number}" lat="{latitude}" lon="{longitude}">{inside}</node>'


def way(number, nodes, **tags):
    inside = "".join(f'<nd ref="{k}"/>' for k in nodes)
    return (
        f'<way id="{number}">{inside}{"".join(f"""<tag k="{k}" v="{v}"/>""" for k, v in tags.items())}</way>'
    )


@pytest.fixture
def objects_of(tmp_path):
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")

    def read(*objects, **more):
        (tmp_path / "region.osm").write_text(osm(*objects), "utf-8")
        return list(read_objects(tmp_path / "region.osm", **more))

    return read


def test_names_of_an_extract_are_cut(objects_of):
    (place, house) = objects_of(
        node(1, 47.0, 9.0, place="town", name="n" * 250),
        node(
            2,
            47.0,
            9.1,
            addr__housenumber="h" * 30,
            addr__street="s" * 250,
            addr__city="c" * 250,
        ),
    )
    assert place == Named("town", "n" * 200, 47.0, 9.0)
    assert house == Named("house", "h" * 20, 47.0, 9.1, "s" * 200, "c" * 200)


def test_a_house_has_a_number_and_a_street(objects_of):
    assert objects_of(
        node(1, 47.0, 9.0, addr__housenumber="7"),
        node(2, 47.0, 9.0, addr__street="Ring"),
        node(3, 47.0, 9.0, addr__housenumber="8", addr__place="Weiler"),
        node(4, 47.0, 9.0, addr__housenumber="9", addr__street="Ring", addr__place="Weiler"),
    ) == [Named("house", "8", 47.0, 9.0, "Weiler"), Named("house", "9", 47.0, 9.0, "Ring")]


def test_kinds_of_objects(objects_of):
    corner = [node(k, 47.0 + k / 100, 9.0) for k in range(1, 5)]
    found = objects_of(
        *corner,
        node(5, 47.0, 9.5, place="island", name="No settlement"),
        node(6, 47.0, 9.6, place="island", name="With a shop", shop="yes"),
        node(7, 47.0, 9.7, addr__housenumber="1", name="Only a name"),
        node(8, 47.0, 9.8, amenity="cafe", highway="crossing", name="Crossing"),
        way(1, [1, 2], place="village", name="As a way"),
        way(2, [1, 2, 3, 4], highway="residential", amenity="cafe", name="Street"),
        way(3, [1, 2, 3], tourism="museum", name="Museum"),
        way(4, [3], leisure="park", name="Park"),
        way(5, [99, 2, 98, 4], highway="primary", name="Cut off"),
    )
    assert found == [
        Named("poi", "With a shop", 47.0, 9.6),
        Named("street", "Street", 47.03, 9.0),
        Named("poi", "Museum", 47.02, 9.0),
        Named("poi", "Park", 47.03, 9.0),
        Named("street", "Cut off", 47.04, 9.0),
    ]


def test_what_is_wrong_with_an_extract_is_cut(tmp_path):
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    deep = tmp_path / ("d" * 150)
    with pytest.raises(InvalidInput, match="cannot read the extract") as caught:
        list(read_objects(deep / "none.osm"))
    assert len(caught.value.faults[0].got) == 120


# charging stations


@pytest.mark.parametrize(
    ("output", "power_w"),
    [
        ("1000 W", 1000.0),
        ("999 W", None),
        ("1 kW", 1000.0),
        ("0,9 kW", None),
        ("1500 kW", 1_500_000.0),
        ("1501 kW", None),
        ("1500000 W", 1_500_000.0),
        ("22", 22_000.0),
        ("11 kVA", 11_000.0),
        ("50 kW;22 kW;2000 kW", 50_000.0),
        ("x" * 194 + " 22 kW", 22_000.0),
        ("x" * 195 + " 22 kW", 22_000.0),
        ("x" * 198 + " 22 kW", 2_000.0),
        ("x" * 199 + " 22 kW", None),
    ],
)
def test_powers_of_a_socket(output, power_w):
    """From 1 kW to 1.5 MW, in the first 200 characters; kilowatts where there is no unit."""
    found = station_of_tags({"socket:type2": "1", "socket:type2:output": output}, 47.0, 9.0)
    assert (found.power_w, found.power_known) == ((power_w or 11_000.0), power_w is not None)
    assert not found.direct_current


def test_the_strongest_of_several_powers_counts():
    tags = {"socket:type2": "2", "socket:chademo": "1", "socket:chademo:output": "50 kW", "maxpower": "43 kW"}
    assert station_of_tags(tags, 47.0, 9.0).power_w == 50_000.0
    assert station_of_tags({**tags, "maxpower": "60000 W"}, 47.0, 9.0).power_w == 60_000.0
    assert station_of_tags({"socket:type2": "no", "socket:type2:output": "22 kW"}, 47.0, 9.0).power_w == 11e3


@pytest.mark.parametrize("socket", DC_SOCKETS)
def test_sockets_of_direct_current(socket):
    found = station_of_tags({f"socket:{socket}": "1"}, 47.0, 9.0)
    assert (found.direct_current, found.power_w, found.power_known) == (True, 50_000.0, False)


def test_the_name_of_a_station_is_cut():
    assert station_of_tags({"brand": "b" * 201, "network": "n"}, 47.0, 9.0).name == "b" * 200
    assert station_of_tags({"network": "n"}, 47.0, 9.0).name == "n"
    assert station_of_tags({"access": "customers", "motorcar": "yes"}, 47.0, 9.0) is not None


def table(path, *rows, header="latitude_deg,longitude_deg,power_kw"):
    path.write_text("\n".join((header, *rows)) + "\n")
    return path


def test_bounds_of_a_file_of_stations(tmp_path):
    path = tmp_path / "s.csv"
    assert read_stations(table(path, "90,180,1500", "-90,-180,1")) == (
        Station(90.0, 180.0, "", 1_500_000.0, direct_current=True),
        Station(-90.0, -180.0, "", 1000.0),
    )
    for row in ("90.1,0,50", "-90.1,0,50", "0,180.1,50", "0,-180.1,50", "0,0,0.9", "0,0,1500.1", "0,,50"):
        with pytest.raises(InvalidInput, match=r"value out of range: s\.csv, column '.*', row 2"):
            read_stations(table(path, "0,0,50", row, row))


def test_direct_current_begins_at_43_001_watts(tmp_path):
    found = read_stations(table(tmp_path / "s.csv", "0,0,43", "0,0,43.001"))
    assert [(s.power_w, s.direct_current, s.power_known) for s in found] == [
        (43_000.0, False, True),
        (43_001.0, True, True),
    ]


def test_the_most_stations_of_a_file(tmp_path, monkeypatch):
    assert stations.MOST_STATIONS == 1_000_000
    monkeypatch.setattr(stations, "MOST_STATIONS", 2)
    path = table(tmp_path / "s.csv", "0,0,50", "0,0,50")
    assert len(read_stations(path)) == 2
    with pytest.raises(InvalidInput, match=r"too many stations: s.csv: got 3; allowed: at most 2"):
        read_stations(table(path, *["0,0,50"] * 5))


def test_words_about_a_file_of_stations_are_cut(tmp_path):
    with pytest.raises(InvalidInput, match="cannot read the stations") as caught:
        read_stations(tmp_path / ("x" * 100))
    assert len(caught.value.faults[0].got) == 80


def test_a_station_is_near_up_to_a_distance():
    """The straight line through the earth: a degree of 111 195 m has a chord that is 1.4 m shorter."""
    north = [Station(48.0, 9.0, "a", 5e4)]
    assert near(north, [Place(47.0, 9.0)], DEGREE_M - 1.0) == [(0, 0)]
    assert near(north, [Place(47.0, 9.0)], DEGREE_M - 2.0) == []
    east = [Station(0.0, 10.0, "a", 5e4)]
    assert near(east, [Place(0.0, 9.0)], DEGREE_M - 1.0) == [(0, 0)]
    assert near(east, [Place(0.0, 9.0)], DEGREE_M - 2.0) == []
    polar = [Station(60.0, 10.0, "a", 5e4)]
    assert near(polar, [Place(60.0, 9.0)], 0.5 * DEGREE_M) == [(0, 0)]
    assert near(polar, [Place(60.0, 9.0)], 0.5 * DEGREE_M - 5.0) == []


# the index


def written(path, objects, settlements=()):
    write_index(path / "i.sqlite", list(settlements), objects)
    return PlaceIndex(path / "i.sqlite")


def names(found):
    return [place.name for place in found]


def test_the_most_places_of_a_search(tmp_path):
    made = written(tmp_path, [Named("poi", f"Halt {k:03d}", 47.0, 9.0) for k in range(201)])
    assert names(made.search("halt")) == [f"Halt {k:03d}" for k in range(10)]
    assert len(made.search("halt", limit=49)) == 49
    assert len(made.search("halt", limit=50)) == 50
    assert len(made.search("halt", limit=99)) == 50
    assert made.search("halt", limit=0) == ()


def test_two_hundred_matches_are_compared(tmp_path):
    """The best match is the last in the index, behind all streets."""
    for streets, first in ((199, "Ring"), (200, "Ring 000")):
        objects = [Named("street", f"Ring {k:03d}", 47.0, 9.0) for k in range(streets)]
        made = written(tmp_path, [*objects, Named("poi", "Ring", 47.0, 9.0)])
        assert names(made.search("ring", limit=1)) == [first]


def test_ten_words_of_two_hundred_characters_are_searched(tmp_path):
    words = " ".join("abcdefghij")
    made = written(tmp_path, [Named("poi", words, 47.0, 9.0), Named("poi", "q" * 250, 47.0, 9.0)])
    assert names(made.search(f"{words} zz")) == [words]
    assert made.search("j i h g f e d c b zz") == ()
    assert names(made.search("q" * 200 + "z")) == ["q" * 250]
    assert made.search("q" * 199 + "z") == ()


def test_the_order_of_matches(tmp_path):
    """The whole name, what begins with the text, the kind, short names."""
    made = written(
        tmp_path,
        [
            Named("town", "Neu Ring", 47.0, 9.0),
            Named("poi", "Ring", 47.0, 9.0),
            Named("poi", "Ringlokal", 47.0, 9.0),
            Named("poi", "Ringbad", 47.0, 9.0),
            Named("street", "Ringstraße", 47.0, 9.0),
            Named("village", "Ober-Ring", 47.0, 9.0),
        ],
    )
    assert names(made.search("ring")) == [
        "Ring",
        "Ringstraße",
        "Ringbad",
        "Ringlokal",
        "Neu Ring",
        "Ober-Ring",
    ]


def test_the_settlement_of_an_object(tmp_path):
    """0.3 degrees of latitude away at most; a degree of longitude is half as long at 60 degrees."""
    towns = [Named("town", "Stadt", 60.0, 9.0), Named("hamlet", "Hof", 60.0, 9.4)]
    objects = [
        Named("poi", "Inside", 60.0, 9.59),
        Named("poi", "Outside", 60.0, 9.61),
        Named("poi", "Own", 60.0, 9.0, city="Vorort"),
        Named("poi", "Stadt", 60.0, 9.0),
        Named("house", "7", 60.0, 9.0, "Stadt"),
    ]
    made = written(tmp_path, objects, towns)
    found = [names(made.search(text)) for text in ("inside", "outside", "own")]
    assert found == [["Inside, Stadt"], ["Outside"], ["Own, Vorort"]]
    assert names(made.search("stadt"))[:2] == ["Stadt", "Stadt 7, Stadt"]
    only = written(tmp_path, objects[:1], towns[1:])
    assert names(only.search("inside")) == ["Inside, Hof"]


def test_a_settlement_is_near_up_to_a_bound(tmp_path):
    objects = [Named("poi", "On", 0.3, 0.0), Named("poi", "Beyond", 0.3001, 0.0)]
    made = written(tmp_path, objects, [Named("town", "Stadt", 0.0, 0.0)])
    assert names(made.search("on")) == ["On, Stadt"]
    assert names(made.search("beyond")) == ["Beyond"]


def test_an_index_is_read_by_several_threads(tmp_path):
    made = written(tmp_path, [Named("poi", "Halt", 47.0, 9.0)])
    with ThreadPoolExecutor(1) as other:
        assert names(other.submit(made.search, "halt").result()) == ["Halt"]


def test_settlements_without_a_limit_of_their_kind(tmp_path):
    kinds = ("city", "town", "village", "suburb", "quarter", "hamlet", "neighbourhood", "isolated_dwelling")
    objects = [Named(kind, kind, 47.0, 9.0) for kind in (*reversed(kinds), "street", "poi")]
    found = written(tmp_path, objects).settlements(46.0, 8.0, 48.0, 10.0, 99)
    assert tuple(place.name for place in found) == kinds


# folders


@pytest.fixture
def builder(monkeypatch, tmp_path):
    """Builds a map of an extract without Valhalla: its tiles are one empty file."""
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    monkeypatch.setattr("tripwatt.routes.maps.folder.require_valhalla", lambda: tmp_path)

    def tiles(work, extract):
        (work / "tiles").mkdir()

    monkeypatch.setattr("tripwatt.routes.maps.folder.build_tiles", tiles)

    def build(*objects, out="deep/map", **more):
        (tmp_path / "region.osm").write_text(osm(*objects), "utf-8")
        return build_map(tmp_path / "region.osm", tmp_path / out, **more)

    return build


PLACES = (
    node(1, 47.0, 9.0, place="town", name="Westend"),
    node(2, 47.2, 9.1, addr__housenumber="7", addr__street="Ring"),
    node(3, 47.1, 9.4, amenity="charging_station"),
)


def test_a_map_says_what_it_is_made_of(builder, tmp_path):
    steps = []
    made = builder(*PLACES, progress=steps.append)
    assert steps == ["roads", "places"]
    assert sorted(path.name for path in made.folder.iterdir()) == ["map.json", "places.sqlite", "tiles"]
    assert (made.folder / "map.json").read_text("utf-8").startswith('{\n "format": 1,\n "extract":')
    assert made.info == {
        "format": 1,
        "extract": "region.osm",
        "extract_bytes": (tmp_path / "region.osm").stat().st_size,
        "attribution": "© OpenStreetMap contributors, ODbL 1.0",
        "bounds_deg": [47.0, 9.0, 47.2, 9.1],
        "elevation_tiles": 0,
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


def test_elevation_tiles_lie_where_valhalla_looks_for_them(builder, tmp_path):
    source = tmp_path / "heights"
    (source / "more").mkdir(parents=True)
    for name in ("n47e009.hgt", "N47E010.hgt.gz", "more/S05W070.hgt.lz4", "readme.txt"):
        (source / name).write_bytes(name.encode())
    made = builder(elevation=source)
    assert made.info["elevation_tiles"] == 3
    kept = {p.relative_to(made.folder).as_posix(): p.read_bytes() for p in made.folder.rglob("*.hgt*")}
    assert kept == {
        "elevation/N47/N47E009.hgt": b"n47e009.hgt",
        "elevation/N47/N47E010.hgt.gz": b"N47E010.hgt.gz",
        "elevation/S05/S05W070.hgt.lz4": b"more/S05W070.hgt.lz4",
    }


def test_a_map_is_replaced_when_the_new_one_is_complete(builder, tmp_path, monkeypatch):
    (tmp_path / "map.unfinished").mkdir()
    (tmp_path / "map.unfinished" / "left.txt").write_text("x")
    old = builder(*PLACES, out="map")
    assert not (old.folder / "left.txt").exists()
    (old.folder / "old.txt").write_text("x")

    def broken(work, extract):
        raise InvalidInput(Fault("cannot build the map", "x"))

    with monkeypatch.context() as patch:
        patch.setattr("tripwatt.routes.maps.folder.build_tiles", broken)
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


# Valhalla


CONFIGURATION = """
class Optional: ...
config = {
    "mjolnir": {"tile_dir": "", "timezone": "x", "traffic_extract": "x", "other": Optional()},
    "additional_data": {"elevation": ""},
    "logging": {"type": "std_out"},
    "service_limits": {"isochrone": {"max_contours": 4}, "trace": {}, "skadi": {}},
    "httpd": {"service": {}},
    "loki": {"service": {}}, "thor": {"service": {}}, "odin": {"service": {}}, "meili": {"service": {}},
}
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A folder that looks like an installed Valhalla; its program does what a test writes into it."""
    place = tmp_path / "wheel" / "valhalla"
    (place / "bin").mkdir(parents=True)
    (place / "valhalla_build_config.py").write_text(CONFIGURATION)
    program = place / "bin" / "valhalla_build_tiles"
    program.write_text("#!/bin/sh\nexit 0\n")
    program.chmod(0o755)
    monkeypatch.setenv("TRIPWATT_VALHALLA", str(tmp_path / "wheel"))
    return place


def test_valhalla_is_found_in_the_folder_or_below_it(package, monkeypatch):
    assert valhalla_folder() == package
    monkeypatch.setenv("TRIPWATT_VALHALLA", str(package))
    assert valhalla_folder() == package
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for named in (str(package / "bin"), ""):
        monkeypatch.setenv("TRIPWATT_VALHALLA", named)
        assert valhalla_folder() is None


def test_limits_of_valhalla(package, tmp_path):
    plain, served = configuration(tmp_path), configuration(tmp_path, port=8123)
    unused = ("tile_extract", "traffic_extract", "admin", "timezone", "landmarks", "transit_dir")
    assert plain["mjolnir"] == {
        "tile_dir": str(tmp_path.resolve() / "tiles"),
        **dict.fromkeys((*unused, "transit_feeds_dir"), ""),
        "concurrency": os.cpu_count(),
    }
    assert plain["additional_data"] == {"elevation": str(tmp_path.resolve() / "elevation")}
    assert plain["logging"] == {"type": "std_err", "color": False}
    assert plain["service_limits"] == served["service_limits"]
    assert plain["service_limits"] == {
        "isochrone": {"max_contours": 4, "max_time_contour": 600, "max_distance": 5_000_000.0},
        "trace": {"max_distance": 5_000_000.0, "max_shape": 1_000_000},
        "skadi": {"max_shape": 1_000_000, "min_resample": 10.0},
    }
    assert plain["httpd"] == {"service": {}}
    assert served["httpd"]["service"] == {
        "listen": "tcp://127.0.0.1:8123",
        "drain_seconds": 0,
        "loopback": f"ipc://{tmp_path.resolve()}/loopback.socket",
        "interrupt": f"ipc://{tmp_path.resolve()}/interrupt.socket",
    }
    for part in ("loki", "thor", "odin", "meili"):
        assert served[part]["service"] == {"proxy": f"ipc://{tmp_path.resolve()}/{part}.socket"}


@pytest.mark.parametrize(
    ("script", "got"),
    [
        ("exit 0", "exit code 0, no tiles"),
        ("exit 3", "exit code 3, no tiles"),
        ("touch $(dirname $2)/tiles/a.gph; exit 3", "exit code 3, no tiles"),
        ("echo '[ERROR] first'; echo '[FATAL] last'; echo INFO", "[FATAL] last"),
        ("echo '[ERROR] of the output'; echo '[ERROR] of errors' >&2", "[ERROR] of errors"),
        ("printf 'ERROR%0200d\n' 7", "0" * 119 + "7"),
    ],
)
def test_what_valhalla_says_about_an_extract(package, tmp_path, script, got):
    (package / "bin" / "valhalla_build_tiles").write_text(f"#!/bin/sh\n{script}\n")
    with pytest.raises(InvalidInput, match=r"cannot build the map: region\.osm") as caught:
        build_tiles(tmp_path / "map", tmp_path / "region.osm")
    assert caught.value.faults[0].got == got
    assert sorted(path.name for path in (tmp_path / "map").iterdir()) == ["elevation", "tiles"]


def test_tiles_are_built_below_the_folder(package, tmp_path):
    script = "mkdir $(dirname $2)/tiles/2; cp $2 $(dirname $2)/tiles/2/a.gph; echo $3 > $(dirname $2)/said"
    (package / "bin" / "valhalla_build_tiles").write_text(f"#!/bin/sh\n{script}\n")
    build_tiles(tmp_path / "new" / "map", tmp_path / "region.osm")
    build_tiles(tmp_path / "new" / "other", tmp_path / "region.osm")
    (tmp_path / "new" / "map" / "tiles" / "2" / "a.gph").unlink()
    (tmp_path / "new" / "map" / "tiles" / "2").rmdir()
    build_tiles(tmp_path / "new" / "map", tmp_path / "region.osm")
    made = tmp_path / "new" / "map"
    assert json.loads((made / "tiles" / "2" / "a.gph").read_text()) == configuration(made)
    assert (made / "said").read_text() == f"{tmp_path / 'region.osm'}\n"
    assert not (made / "valhalla.json").exists()


def test_a_program_that_does_not_run_is_named(package, tmp_path):
    (package / "bin" / "valhalla_build_tiles").chmod(0o644)
    with pytest.raises(InvalidInput, match=r"cannot run Valhalla: .*valhalla_build_tiles"):
        build_tiles(tmp_path / "map", tmp_path / "region.osm")
    assert not (tmp_path / "map" / "valhalla.json").exists()
