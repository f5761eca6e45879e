"""A map folder: routing tiles, elevation, places and stations of one region, made from an OpenStreetMap extract."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import Check, Fault, InvalidInput, raise_faults
from tripwatt.files import read_text_file, replace_folder
from tripwatt.roads.maps.elevation import Elevation, needed, tile_name
from tripwatt.roads.maps.engine import build_tiles, require_valhalla
from tripwatt.roads.maps.extract import Named, read_objects
from tripwatt.roads.maps.index import PlaceIndex, write_index

INFO_NAME: Final = "map.json"
INDEX_NAME: Final = "places.sqlite"
FORMAT: Final = 5
MAX_INFO_BYTES: Final = 1 << 20
ATTRIBUTION: Final = "© OpenStreetMap contributors, ODbL 1.0"
"""Text that has to be shown wherever a map, a road or a place of an extract is shown."""


MAX_NAMED: Final = 3
"""Largest number of settlements that are named to say where a map is."""


@dataclass(frozen=True)
class MapFolder:
    """A map that was built.

    Attributes
    ----------
    folder : Path
    info : dict
        Source, time, bounds and counts.
    """

    folder: Path
    info: dict[str, Any]

    @cached_property
    def index(self) -> PlaceIndex:
        """Index of places and stations."""
        return PlaceIndex(self.folder / INDEX_NAME)

    @property
    def covers(self) -> str:
        """The region in words: bounds, the largest places, and the extract; empty for a map without places."""
        if self.info.get("bounds_deg") is None:
            return ""
        south, west, north, east = map(float, self.info["bounds_deg"])
        names = [place.title for place in self.index.settlements(south, west, north, east, MAX_NAMED)]
        *others, last = names or [""]
        around = f" around {', '.join(others)}{' and ' if others else ''}{last}" if last else ""
        return f"{_span(south, north, 'SN')} and {_span(west, east, 'WE')}{around} ({self.info['extract']})"


def open_map(folder: Path | str) -> MapFolder:
    """Open a map.

    Raises
    ------
    InvalidInput
        If the folder has no map, or a map of another format.
    """
    folder = Path(folder)
    try:
        info = json.loads(read_text_file(folder / INFO_NAME, MAX_INFO_BYTES))
    except (InvalidInput, ValueError, RecursionError) as error:
        fix = "build one with tripwatt map build REGION.osm.pbf"
        got = error.faults[0].got if isinstance(error, InvalidInput) else type(error).__name__
        allowed = "a folder with a map"
        raise InvalidInput.of("no map", str(folder), got, allowed, fix) from error
    if not isinstance(info, dict) or info.get("format") != FORMAT:
        got = f"format {info.get('format')!r}" if isinstance(info, dict) else "no object"
        fix = "build the map again with tripwatt map build"
        raise InvalidInput.of("map of another release", str(folder), got[:60], f"format {FORMAT}", fix)
    bounds, limits = info.get("bounds_deg"), (90.0, 180.0, 90.0, 180.0)
    try:
        sound = bounds is None or all(abs(at) <= limit for at, limit in zip(bounds, limits, strict=True))
    except (TypeError, ValueError):
        sound = False
    if not (sound and isinstance(info.get("extract"), str) and isinstance(info.get("terrain"), dict)):
        raise InvalidInput.of("no map", str(folder / INFO_NAME), "damaged facts", "a folder with a map")
    return MapFolder(folder, info)


def build_map(
    extract: Path | str,
    folder: Path | str,
    *,
    elevation: Path | str | None = None,
    attribution: str = ATTRIBUTION,
    progress: Callable[[str], object] = lambda step: None,
) -> MapFolder:
    """Build a map from an OpenStreetMap extract. The folder is written completely or not at all.

    Parameters
    ----------
    extract : path
        Extract of a region as `.osm.pbf`.
    folder : path
        Folder of the map; an existing map is replaced.
    elevation : path, optional
        Folder with elevation tiles, also in subfolders: tiles of SRTM (`N47E009.hgt`, also `.hgt.gz` or in a `.zip`), or GeoTIFF with
        the extra `tripwatt[elevation]`. Only the tiles that the map needs are used.
    attribution : str
        Text that has to be shown with the map; by default, that of OpenStreetMap.
    progress : callable
        Called with the name of each step.

    Raises
    ------
    InvalidInput
        If the extract cannot be read, a package is missing, or the folder has other contents than a map.
    """
    extract, folder = Path(extract), Path(folder)
    require_valhalla()
    heights = _require_paths(extract, folder, elevation)

    def write(work: Path) -> None:
        progress("places")
        places = [place for place in read_objects(extract, settlements_only=True) if isinstance(place, Named)]
        indexed = write_index(work / INDEX_NAME, places, read_objects(extract))
        bounds = indexed["bounds_deg"]
        progress("elevation")
        missing = [] if bounds is None else [tile_name(cell) for cell in needed(bounds)]
        terrain: dict[str, Any] = {"known": False, "source": "", "tiles": 0, "missing": missing}
        if heights is not None:
            terrain = heights.write(work / "elevation", bounds)
        progress("roads")
        build_tiles(work, extract)
        info = {
            "format": FORMAT,
            "extract": extract.name,
            "extract_bytes": extract.stat().st_size,
            "attribution": attribution,
            "terrain": terrain,
            **indexed,
        }
        (work / INFO_NAME).write_text(json.dumps(info, indent=1) + "\n", "utf-8")

    try:
        replace_folder(folder, write)
    except (OSError, sqlite3.Error) as error:  # a full disk is an error of either
        got = f"{getattr(error, 'strerror', None) or error}"
        raise InvalidInput.of("cannot write the map", f"{folder}", got, "a writable folder") from error
    return open_map(folder)


def _require_paths(extract: Path, folder: Path, elevation: Path | str | None) -> Elevation | None:
    """Return the elevation tiles, if a folder is given; raise `InvalidInput` with every path that cannot be used."""
    faults = []
    if not extract.is_file():
        faults.append(Fault("no such file", "EXTRACT", str(extract), "an OpenStreetMap extract"))
    if folder.exists() and not (
        folder.is_dir() and ((folder / INFO_NAME).is_file() or not any(folder.iterdir()))
    ):
        allowed = "a new folder, or one with a map"
        faults.append(Fault("folder holds something else", "--out", str(folder), allowed))
    with Check() as check:
        check(raise_faults, faults)
        return None if elevation is None else check(Elevation.from_folder, Path(elevation))


def _span(low: float, high: float, letters: str) -> str:
    """Return a range of degrees as text with its directions.

    Examples
    --------
    >>> _span(47.06, 47.27, "SN"), _span(-34.0, -27.0, "WE"), _span(-1.0, 1.0, "WE")
    ('47.06 to 47.27° N', '34.00 to 27.00° W', '1.00° W to 1.00° E')
    """
    first, last = (letters[int(degrees >= 0.0)] for degrees in (low, high))
    between = "" if first == last else f"° {first}"
    return f"{abs(low):.2f}{between} to {abs(high):.2f}° {last}"
