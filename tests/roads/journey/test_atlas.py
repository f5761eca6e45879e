"""Atlases: what opens them and what cannot."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest
from tests.roads.journey.made import MADE
from tests.support.router_server import write_map

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.roads.journey import AtlasSettings, Place, open_atlas
from tripwatt.roads.maps.elevation import MARGIN_DEG


def test_an_atlas_of_a_map_with_the_roads_of_a_server(tmp_path, monkeypatch):
    folder = write_map(tmp_path / "map")
    atlas = open_atlas(f"{folder}@osrm=http://127.0.0.1:1")
    assert (atlas.router.kind, atlas.router.client.host) == ("osrm", "127.0.0.1:1")
    assert atlas.places.search("ost")[0].name == "Ostheim"
    assert [station.name for station in atlas.stations] == ["Halbweg"]
    assert atlas.bounds_deg == (46.9, 8.9, 47.1, 9.2)
    assert atlas.weather is None
    assert atlas.tile(0, 0, 0) == b""
    assert atlas.covers.startswith(f"this map covers {atlas.folder.covers}; ")
    assert [place.name for place in atlas.settlements(atlas.bounds_deg, 1)] == ["Westend"]
    assert atlas.stations_within(atlas.bounds_deg, 5) == atlas.stations
    monkeypatch.setenv("TRIPWATT_MAP", f"{folder}@http://127.0.0.1:1")
    with pytest.raises(RemoteError, match=r"127\.0\.0\.1:1"):
        open_atlas().router.outline(Place(47.0, 9.0), 10.0)
    server = open_atlas(AtlasSettings("http://127.0.0.1:1", "photon=http://p", "http://w"))
    assert server.settlements((46.9, 8.9, 47.1, 9.2), 5) == ()
    assert server.covers == ""
    assert (server.places.client.host, server.weather.client.host, server.bounds_deg) == ("p", "w", None)


def test_the_attribution_of_a_map_is_that_of_its_folder(tmp_path):
    folder = write_map(tmp_path / "map")
    assert open_atlas(f"{folder}@http://127.0.0.1:1").attribution == "© OpenStreetMap contributors, ODbL 1.0"
    about = json.loads((folder / "map.json").read_text("utf-8")) | {"attribution": "Invented by us"}
    (folder / "map.json").write_text(json.dumps(about), "utf-8")
    assert open_atlas(f"{folder}@http://127.0.0.1:1").attribution == "Invented by us"


def test_every_fault_of_an_atlas_is_named(tmp_path, monkeypatch):
    monkeypatch.delenv("TRIPWATT_MAP", raising=False)
    with pytest.raises(InvalidInput) as caught:
        open_atlas(AtlasSettings("", "bing=http://h", "ftp://h", str(tmp_path / "none.csv")))
    assert [fault.where for fault in caught.value.faults[:3]] == ["--map", "--places", "--weather"]
    assert len(caught.value.faults) == 4


def test_places_lie_at_most_a_margin_outside_of_a_map():
    south, west, north, east = bounds_deg = (46.9, 8.9, 47.1, 9.2)
    folder = SimpleNamespace(info={"bounds_deg": [*bounds_deg]}, covers="")
    atlas = replace(MADE, is_local=True, folder=folder)

    def corners(beyond_deg):
        lat = (south - MARGIN_DEG - beyond_deg, 47.0, north + MARGIN_DEG + beyond_deg)
        lon = (west - MARGIN_DEG - beyond_deg, 9.0, east + MARGIN_DEG + beyond_deg)
        return [Place(lat[1], lon[k]) for k in (0, 2)] + [Place(lat[k], lon[1]) for k in (0, 2)]

    for place in corners(0.0):
        assert atlas.find(place, "to") == place
    for place in corners(1e-6):
        with pytest.raises(InvalidInput, match="place outside of the map"):
            atlas.find(place, "to")
