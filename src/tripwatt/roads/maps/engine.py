"""Valhalla on this machine: the folder of its programs, its configuration for a map folder, and the router in this process.

`pyvalhalla` has wheels for Python 3.12 and newer. Its programs run without Python, so for other versions of Python, the environment
variable `TRIPWATT_VALHALLA` names the folder of an unpacked wheel.
"""

from __future__ import annotations

import importlib.util
import json
import os
import runpy
import shutil
import subprocess
import tarfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import InvalidInput, RemoteError, install, system_errors
from tripwatt.roads.routers.valhalla import ValhallaRouter

FOLDER_VARIABLE: Final = "TRIPWATT_VALHALLA"
INSTALL: Final = f"use Python 3.12 or newer and {install('routing')}, or "
PACKED: Final = "tiles.tar"
"""File with all tiles, which Valhalla maps into memory, so that processes on the same map share one copy of the tiles."""

FARTHEST_M: Final = 5_000_000.0
LONGEST_CONTOUR_MIN: Final = 600
SHOWN_FROM_ZOOM: Final = (4, 5, 6, 8, 10, 11, 12, 13)
"""Smallest zoom of the vector tiles that have the roads of each class, from motorways to service roads."""


def valhalla_folder() -> Path | None:
    """Return the folder of the package `valhalla` with its programs in `bin`, or None if there is none."""
    named = os.environ.get(FOLDER_VARIABLE, "")
    candidates = [Path(named), Path(named) / "valhalla"] if named else []
    spec = importlib.util.find_spec("valhalla")
    if spec is not None and spec.origin is not None:
        candidates.append(Path(spec.origin).parent)
    return next((path for path in candidates if (path / "bin" / "valhalla_build_tiles").is_file()), None)


def require_valhalla() -> Path:
    """Return `valhalla_folder`, and raise if there is none.

    Raises
    ------
    InvalidInput
        If Valhalla is not installed.
    """
    folder = valhalla_folder()
    if folder is None:
        fix = f"{INSTALL}set {FOLDER_VARIABLE} to the folder of an unpacked pyvalhalla wheel"
        raise InvalidInput.of("missing package", "pyvalhalla", "not installed", fix=fix)
    return folder


def configuration(folder: Path) -> dict[str, Any]:
    """Return Valhalla's configuration for a map folder.

    Parameters
    ----------
    folder : Path
        Map folder with `elevation`, and with `tiles`, or `tiles.tar` once the tiles are built.

    Raises
    ------
    InvalidInput
        If Valhalla is not installed.
    """
    module = runpy.run_path(str(require_valhalla() / "valhalla_build_config.py"))
    config = _given(module["config"], module["Optional"])
    here = folder.resolve()
    config["mjolnir"] |= {
        "tile_dir": str(here / "tiles"),
        "tile_extract": str(here / PACKED) if (here / PACKED).is_file() else "",
        **dict.fromkeys(("traffic_extract", "admin", "timezone", "landmarks"), ""),
        **dict.fromkeys(("transit_dir", "transit_feeds_dir"), ""),
        "concurrency": os.cpu_count() or 1,
    }
    config["additional_data"]["elevation"] = str(here / "elevation")
    config["logging"] = {"type": "std_err", "color": False}
    limits = config["service_limits"]
    limits["isochrone"] |= {"max_time_contour": LONGEST_CONTOUR_MIN, "max_distance": FARTHEST_M}
    limits["trace"] |= {"max_distance": FARTHEST_M, "max_shape": 1_000_000}
    config["loki"]["service_defaults"]["mvt_min_zoom_road_class"] = list(SHOWN_FROM_ZOOM)
    limits["skadi"] |= {"max_shape": 1_000_000, "min_resample": 10.0}
    return config


def _given(values: Mapping[str, Any], unset: type) -> dict[str, Any]:
    return {
        name: _given(value, unset) if isinstance(value, dict) else value
        for name, value in values.items()
        if not isinstance(value, unset)
    }


def build_tiles(folder: Path, extract: Path) -> None:
    """Build routing tiles from an OpenStreetMap extract into `tiles.tar` of a folder.

    Raises
    ------
    InvalidInput
        If Valhalla is not installed, cannot be run, or cannot read the extract.
    """
    program = require_valhalla() / "bin" / "valhalla_build_tiles"
    for name in ("tiles", "elevation"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    config = folder / "valhalla.json"
    config.write_text(json.dumps(configuration(folder)), "utf-8")
    try:
        command = [str(program), "-c", str(config), str(extract)]
        with system_errors("cannot run Valhalla", str(program), "an executable file", program.name):
            done = subprocess.run(command, capture_output=True, text=True, errors="replace")
    finally:
        config.unlink(missing_ok=True)
    if done.returncode != 0 or not any((folder / "tiles").rglob("*.gph")):
        output = (done.stdout + done.stderr).splitlines()
        lines = [line for line in output if "ERROR" in line or "FATAL" in line]
        got = lines[-1][-120:] if lines else f"exit code {done.returncode}, no tiles"
        allowed = "an OpenStreetMap extract with roads"
        raise InvalidInput.of("cannot build the map", extract.name, got, allowed)
    with tarfile.open(folder / PACKED, "w", format=tarfile.USTAR_FORMAT) as packed:
        for tile in sorted((folder / "tiles").rglob("*.gph")):
            packed.add(tile, tile.relative_to(folder / "tiles").as_posix())
    shutil.rmtree(folder / "tiles")


def router_in_process(folder: Path) -> ValhallaRouter:
    """Make a router by Valhalla in this process, on the tiles of a map folder.

    Raises
    ------
    InvalidInput
        If the package is not installed for this Python.
    """
    try:
        import valhalla
    except ImportError as error:
        fix = f"{INSTALL}name a server by its URL"
        raise InvalidInput.of("missing package", "pyvalhalla", str(error)[:80], fix=fix) from error
    actor = valhalla.Actor({**configuration(folder), "logging": {"type": ""}})

    def ask(action: str, request: dict[str, Any]) -> Any:
        try:
            return json.loads(getattr(actor, action)(json.dumps(request)))
        except valhalla.ValhallaError as error:
            return {"error": str(error), "error_code": error.code}
        except RuntimeError as error:
            raise RemoteError.of("the router failed", action, str(error)[:120]) from error

    def tile(request: dict[str, Any]) -> bytes:
        try:
            return bytes(actor.tile(json.dumps(request)))
        except RuntimeError:  # ValhallaError is one: a tile that the map does not have
            return b""

    return ValhallaRouter(ask, tile)
