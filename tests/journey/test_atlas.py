"""Atlases: what opens them and what cannot."""

import json

import pytest
from tests.support.router_server import write_map

from tripwatt.errors import InvalidInput
from tripwatt.journey import (
    AtlasSettings,
    open_atlas,
)


def test_an_atlas_of_a_map_with_the_roads_of_a_server(tmp_path, monkeypatch):
    folder = write_map(tmp_path / "map")
    atlas = open_atlas(f"{folder}@osrm=http://127.0.0.1:1")
    assert atlas.router.name == "osrm at 127.0.0.1:1"
    assert atlas.places.search("ost")[0].name == "Ostheim"
    assert [station.name for station in atlas.stations] == ["Halbweg"]
    assert atlas.bounds_deg == (46.9, 8.9, 47.1, 9.2)
    assert atlas.weather is None
    monkeypatch.setenv("TRIPWATT_MAP", f"{folder}@http://127.0.0.1:1")
    assert open_atlas().router.name == "valhalla at 127.0.0.1:1"
    server = open_atlas(AtlasSettings("http://127.0.0.1:1", "photon=http://p", "http://w"))
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
