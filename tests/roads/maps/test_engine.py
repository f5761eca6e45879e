"""Valhalla on this machine."""

import json
import os
import tarfile

import pytest
from tests.support.router_server import served_configuration

from tripwatt.errors import InvalidInput
from tripwatt.roads.maps.engine import build_tiles, configuration, valhalla_folder
from tripwatt.roads.maps.folder import build_map

CONFIGURATION = """
class Optional: ...
config = {
    "mjolnir": {"tile_dir": "", "timezone": "x", "traffic_extract": "x", "other": Optional()},
    "additional_data": {"elevation": ""},
    "logging": {"type": "std_out"},
    "service_limits": {"isochrone": {"max_contours": 4}, "trace": {}, "skadi": {}},
    "httpd": {"service": {}},
    "loki": {"service": {}, "service_defaults": {}}, "thor": {"service": {}}, "odin": {"service": {}}, "meili": {"service": {}},
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
    plain, served = configuration(tmp_path), served_configuration(tmp_path, 8123)
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


def test_tiles_are_built_into_one_file_of_the_folder(package, tmp_path):
    script = "mkdir $(dirname $2)/tiles/2; cp $2 $(dirname $2)/tiles/2/a.gph; echo $3 > $(dirname $2)/said"
    (package / "bin" / "valhalla_build_tiles").write_text(f"#!/bin/sh\n{script}\n")
    made = tmp_path / "new" / "map"
    before = configuration(made)
    assert before["mjolnir"]["tile_extract"] == ""
    build_tiles(made, tmp_path / "region.osm")
    with tarfile.open(made / "tiles.tar") as packed:
        assert packed.getnames() == ["2/a.gph"]
        assert json.loads(packed.extractfile("2/a.gph").read()) == before
    assert not (made / "tiles").exists()
    assert configuration(made)["mjolnir"]["tile_extract"] == str(made / "tiles.tar")
    assert (made / "said").read_text() == f"{tmp_path / 'region.osm'}\n"
    assert not (made / "valhalla.json").exists()


def test_a_program_that_does_not_run_is_named(package, tmp_path):
    (package / "bin" / "valhalla_build_tiles").chmod(0o644)
    with pytest.raises(InvalidInput, match=r"cannot run Valhalla: .*valhalla_build_tiles"):
        build_tiles(tmp_path / "map", tmp_path / "region.osm")
    assert not (tmp_path / "map" / "valhalla.json").exists()


def test_without_valhalla_a_map_cannot_be_built(tmp_path, monkeypatch):
    monkeypatch.setattr("tripwatt.roads.maps.engine.valhalla_folder", lambda: None)
    with pytest.raises(
        InvalidInput, match=r"missing package: pyvalhalla: got not installed; use Python 3.12 or newer"
    ):
        build_map(tmp_path / "a.osm.pbf", tmp_path / "map")
