"""Objects of an OpenStreetMap extract."""

from dataclasses import replace

import pytest
from tests.roads.maps.made import node, osm, way

from tripwatt.errors import InvalidInput
from tripwatt.roads.maps.extract import Height, Named, read_objects, station_of_tags
from tripwatt.roads.maps.stations import PLUG_KINDS, Plug, Station


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
        node(2, 47.0, 9.1, addr__housenumber="h" * 30, addr__street="s" * 250, addr__city="c" * 250),
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
        Named("village", "As a way", 47.02, 9.0),
        Named("street", "Street", 47.03, 9.0),
        Named("poi", "Museum", 47.02, 9.0),
        Named("poi", "Park", 47.03, 9.0),
        Named("street", "Cut off", 47.04, 9.0),
    ]


def test_heights_beside_roads(objects_of):
    assert objects_of(
        node(1, 47.0, 9.0, highway="bus_stop", ele="455.5 m"),
        node(2, 47.1, 9.0, natural="peak", place="locality", ele="2000"),
        node(3, 47.2, 9.0, tourism="viewpoint", ele="900"),
        node(4, 47.3, 9.0, railway="halt", ele="about 500"),
        node(5, 47.4, 9.0, tourism="information", information="guidepost", ele="576"),
        way(6, [5], highway="residential", ele="1"),
    ) == [Height(47.0, 9.0, 455.5, at_stop=True), Height(47.4, 9.0, 576.0)]


def test_other_names_and_inhabitants(objects_of):
    names = {"name:sv": "Alexandersgatan", "alt_name": "Aleksi; Aleksi ;A", "old_name:de": "Alexanderstrasse"}
    no_names = {"name:etymology": "a tsar", "name:pronunciation": "x", "name_prefix": "y"}
    tags = {key.replace(":", "__"): value for key, value in (names | no_names).items()}
    (street,) = objects_of(
        node(1, 47.0, 9.0), way(1, [1], highway="residential", name="A", population="x", **tags)
    )
    assert street.also == ("Aleksi", "Alexandersgatan", "Alexanderstrasse")
    sizes = [
        objects_of(node(1, 47.0, 9.0, place="town", name="A", population=p))
        for p in ("5000", "5 000", "9" * 10)
    ]
    assert [town.population for (town,) in sizes] == [5000, 0, 0]


def test_what_is_wrong_with_an_extract_is_cut(tmp_path):
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    deep = tmp_path / ("d" * 150)
    with pytest.raises(InvalidInput, match="cannot read the extract") as caught:
        list(read_objects(deep / "none.osm"))
    assert len(caught.value.faults[0].got) == 120


def plugs_of(tags, longitude_deg=9.0):
    station = station_of_tags(tags, 47.0, longitude_deg)
    return [(plug.kind, plug.power_w, plug.power_known) for plug in station.plugs]


def test_each_plug_has_its_own_power():
    tags = {f"socket:{kind}": "1" for kind in ("chademo", "type2_combo", "type2", "schuko")}
    tags |= {"socket:chademo:output": "100 kW", "socket:type2_combo:output": "50 kW; 500 V; 125 A"}
    station = station_of_tags(tags, 47.0, 9.0)
    assert plugs_of(tags) == [
        ("type2_combo", 50e3, True),
        ("chademo", 100e3, True),
        ("type2", 11e3, False),
        ("schuko", 2.3e3, False),
    ]
    assert (station.power_w, station.plug, station.direct_current) == (100e3, "chademo", True)


@pytest.mark.parametrize("kind", PLUG_KINDS)
def test_no_plug_has_or_is_assumed_to_have_more_than_its_kind_gives(kind):
    bounds = PLUG_KINDS[kind]
    for kw in (0.5, 2.3, 3.7, 7.4, 11, 22, 43, 50, 150, 400, 1500, 2000):
        ((name, power, known),) = plugs_of({f"socket:{kind}": "2", f"socket:{kind}:output": f"{kw} kW"})
        inside = bounds.lowest_w <= 1e3 * kw <= bounds.highest_w
        assert (name, power, known) == (kind, 1e3 * kw if inside else bounds.assumed_w, inside)
        assert bounds.lowest_w <= power <= bounds.highest_w
    station = station_of_tags({f"socket:{kind}": "1"}, 47.0, 9.0)
    assert (station.direct_current, station.power_known) == (bounds.direct_current, False)


@pytest.mark.parametrize(
    ("tags", "plugs"),
    [
        ({}, []),
        ({"socket:unknown": "yes"}, []),
        ({"socket:type2_combo": "no", "socket:type2": "0", "socket:type1": "1"}, [("type1", 6.6e3, False)]),
        ({"socket:type2:output": "22 kW"}, [("type2", 22e3, True)]),
        ({"socket:type2": "no", "socket:type2:output": "22 kW"}, []),
        (
            {"socket:type2": "1", "socket:type2:voltage": "400", "socket:type2:current": "32"},
            [("type2", 22e3, True)],
        ),
        ({"socket:ccs": "1", "socket:ccs:output": "1 MW"}, [("type2_combo", 1e6, True)]),
        ({"socket:cee_blue": "2"}, [("cee_blue", 2.3e3, False)]),
        (
            {"socket:type2_combo": "4", "socket:type2": "1", "charging_station:output": "300 kW"},
            [("type2_combo", 300e3, True), ("type2", 11e3, False)],
        ),
        (
            {"socket:type2_combo": "1", "socket:chademo": "1", "maxpower": "24 kW"},
            [("type2_combo", 24e3, True), ("chademo", 24e3, False)],
        ),
        (
            {
                "socket:chademo": "1",
                "socket:chademo:output": "50 kW",
                "socket:type2": "1",
                "maxpower": "43 kW",
            },
            [("chademo", 50e3, True), ("type2", 43e3, True)],
        ),
    ],
)
def test_the_powers_of_a_station(tags, plugs):
    assert plugs_of(tags) == plugs


def test_a_station_of_unknown_plugs_has_its_own_power_or_an_assumed_one():
    found = [station_of_tags(tags, 47.0, 9.0) for tags in ({}, {"maxpower": "22 kW"}, {"maxpower": "300 kW"})]
    assert [(s.power_w, s.direct_current, s.power_known, s.plug) for s in found] == [
        (11e3, False, False, ""),
        (22e3, False, True, ""),
        (300e3, True, True, ""),
    ]


def test_ccs_is_the_plug_of_the_region():
    assert [plugs_of({"socket:ccs": "1"}, at)[0][0] for at in (9.0, -71.0)] == ["type2_combo", "type1_combo"]


@pytest.mark.parametrize(
    "tags",
    [
        {"access": "private"},
        {"access": "no"},
        {"motorcar": "no"},
        {"disused": "yes"},
        {"bicycle": "yes", "socket:schuko": "4"},
    ],
)
def test_stations_that_no_car_of_the_public_may_use_are_left_out(tags):
    assert station_of_tags(tags, 47.0, 9.0) is None
    assert station_of_tags({"access": "customers", "motorcar": "yes"}, 47.0, 9.0) is not None
    assert (
        station_of_tags({"bicycle": "yes", "socket:schuko": "4", "socket:type2": "1"}, 47.0, 9.0) is not None
    )


def test_a_station_is_named_by_its_operator_where_it_has_no_name():
    assert station_of_tags({"operator": "Strom"}, 47.0, 9.0).name == "Strom"
    assert station_of_tags({"operator": "Strom", "name": "Mitte"}, 47.0, 9.0).name == "Mitte"
    assert station_of_tags({}, 47.0, 9.0).place.title == "charging station"
    assert station_of_tags({"brand": "b" * 201, "network": "n"}, 47.0, 9.0).name == "b" * 200
    assert station_of_tags({"network": "n"}, 47.0, 9.0).name == "n"


def test_a_station_has_its_network_its_operator_and_its_brand():
    tags = {"name": "Mitte", "network": "Netz", "brand": "Marke", "operator": "Strom"}
    found = station_of_tags(tags, 47.0, 9.0)
    assert (found.name, {*found.networks}) == ("Mitte", {"Netz", "Marke", "Strom"})
    with_plug = station_of_tags(tags | {"socket:type2": "1"}, 47.0, 9.0)
    assert with_plug.networks == with_plug.usable_with({"type2"}).networks == found.networks
    assert station_of_tags({"name": "Mitte", "operator": ""}, 47.0, 9.0).networks == ()


def test_places_streets_houses_and_stations_of_an_extract(objects_of):
    charger = {"amenity": "charging_station", "operator": "Strom AG", "socket__type2_combo": "2"}
    objects = (
        node(1, 47.0, 9.0, place="town", name="Westend"),
        *(node(k, 46.99 + k / 100, 9.0) for k in (2, 3, 4)),
        node(5, 47.01, 9.01, addr__housenumber="7", addr__street="Ring", addr__city="Altdorf"),
        node(6, 47.02, 9.02, socket__type2_combo__output="150 kW", **charger),
        node(7, 47.02, 9.03, amenity="cafe", name="Café Blau"),
        node(8, 47.02, 9.04, highway="bus_stop", name="Halt"),
        node(9, 47.02, 9.05, amenity="bench"),
        way(1, [2, 3, 4], highway="primary", name="Ring"),
        way(2, [99, 98], highway="primary", name="Nowhere"),
    )
    assert objects_of(*objects) == [
        Named("town", "Westend", 47.0, 9.0),
        Named("house", "7", 47.01, 9.01, "Ring", "Altdorf"),
        replace(
            Station.with_plugs(47.02, 9.02, "Strom AG", Plug("type2_combo", 150_000.0)),
            networks=("Strom AG",),
        ),
        Named("poi", "Café Blau", 47.02, 9.03),
        Named("street", "Ring", 47.02, 9.0),
    ]
    assert objects_of(*objects, settlements_only=True) == [Named("town", "Westend", 47.0, 9.0)]


def test_a_damaged_extract_is_one_clear_error(tmp_path):
    pytest.importorskip("osmium", reason="the extra tripwatt[routing] is not installed")
    for name, content in (("a.osm.pbf", b"\0\0\0\x20nonsense"), ("a.osm", b"<osm><node"), ("a.txt", b"x")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InvalidInput, match=f"cannot read the extract: {name}"):
            list(read_objects(tmp_path / name))
