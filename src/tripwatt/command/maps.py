"""Commands of maps: build a map of an OpenStreetMap extract, show what a map holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tripwatt.command.options import Answer, argument, make_group
from tripwatt.command.printing import print_notes, print_table
from tripwatt.command.shared import OutFolder, Tiles

if TYPE_CHECKING:
    from tripwatt.roads.maps import MapFolder


def build(
    extract: Annotated[Path, argument("REGION.osm.pbf", "An OpenStreetMap extract.")],
    out: OutFolder = Path("map"),
    elevation: Tiles = None,
) -> Answer:
    """Build a map of an OpenStreetMap extract: roads for Valhalla, an index of places, charging stations.

    The command requires the extra `tripwatt[routing]`. FOLDER is complete or not there; a map that it replaces stays until the new one is complete.

    For example:

      # roads, places and charging stations
      tripwatt map build liechtenstein.osm.pbf --out map
      # with elevation tiles (N47E009.hgt, N47E009.hgt.zip, GeoTIFF)
      tripwatt map build region.osm.pbf --elevation srtm --out map
    """
    from tripwatt.roads.maps import build_map

    def progress(step: str) -> None:
        print_notes([f"building: {step}"])

    return _shown(build_map(extract, out, elevation=elevation, progress=progress))


def info(folder: Annotated[Path, argument("FOLDER", "Folder of the map.")]) -> Answer:
    """Show what a map holds.

    For example:

      # what a map holds
      tripwatt map info map
    """
    from tripwatt.roads.maps import open_map

    return _shown(open_map(folder))


def _shown(folder: MapFolder) -> Answer:
    from tripwatt.roads.maps.elevation import without_tiles

    about, terrain = folder.info, folder.info["terrain"]
    rows = [
        ("extract", str(about["extract"])),
        ("covers", folder.covers or "no place"),
        ("places", str(about["places"])),
        ("charging stations", str(about["stations"])),
        ("heights", f"{terrain['source']} ({terrain['tiles']})" if terrain["known"] else "unknown"),
    ]

    def shown() -> None:
        print_table("Map", ("map", ""), rows)
        print_notes(filter(None, (without_tiles(terrain["missing"]), str(about["attribution"]))))

    return Answer(about | {"covers": folder.covers}, shown)


MAP = make_group("Maps of a region on this machine.", (build, info))
