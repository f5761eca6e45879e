"""Elevation tiles of a map: read in the published formats, written in the format that Valhalla reads.

Valhalla reads tiles of one degree with a height each arc-second (`N47/N47E009.hgt`). For tiles of 3 arc-seconds, the heights between are
interpolated bilinearly. This does not change Valhalla's own bilinear interpolation, since a part of a bilinear patch is bilinear.
"""

from __future__ import annotations

import gzip
import io
import math
import re
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray
from tripwatt.containers import Budget, open_archive
from tripwatt.errors import Check, InvalidInput, require_extras
from tripwatt.files import read_file

ROWS: Final = 3601
ARC_SECONDS: Final[Mapping[int, str]] = MappingProxyType({ROWS: "1 arc-second", 1201: "3 arc-seconds"})
"""Distance between the heights of a tile, by its number of rows."""

VOID: Final = -32768
LOWEST_M: Final = -500.0
HIGHEST_M: Final = 9000.0
"""Heights of a tile outside of `LOWEST_M` to `HIGHEST_M` are voids; the shore of the Dead Sea lies at -430 m."""

MARGIN_DEG: Final = 0.02
"""Roads of a map reach this far beyond its places [°]."""

MAX_CELLS: Final = 100
"""No drive crosses more cells; heights of places in more cells are not looked up, since these places cannot be positions of a drive."""
KEPT_CELLS: Final = 4
"""Number of tiles that stay in memory, 52 MB each: the next drive begins where the last one ended."""

NAME: Final = re.compile(r"([NS])(\d{2})([EW])(\d{3})", re.IGNORECASE)
PACKED: Final = (".hgt", ".hgt.gz", ".zip")
RASTERS: Final = (".tif", ".tiff")

CREDITS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "copernicus": "Copernicus DEM, © DLR e.V. 2010-2014 and © Airbus Defence and Space GmbH 2014-2018, provided under "
        "COPERNICUS by the European Union and ESA; all rights reserved",
        "srtm": "SRTM, NASA and USGS",
        "_1arc_v3": "SRTM, NASA and USGS",
    }
)
"""Notice that has to be, or usually is, shown beside heights, by a part of the names of the publisher's files."""

SOURCES: Final = (
    "get them of the SRTM 1 arc-second global tiles (NASA and USGS, public domain; USGS EarthExplorer or NASA Earthdata) "
    "or of the Copernicus DEM GLO-30 (free with its notice; GeoTIFF, needs the extra elevation), put them into a folder, and "
    "build the map again with --elevation FOLDER; the sea has no tiles"
)

Heights = npt.NDArray[np.float32]
"""Heights of a tile [m], one per arc-second or three, NaN for voids, shape (rows, rows): from north to south, from west to east."""

Cell = tuple[int, int]
"""Southern and western edge of a tile [°]."""


@dataclass(frozen=True)
class Elevation:
    """The elevation tiles of a folder.

    Attributes
    ----------
    packed : dict
        File of each cell, in the format of SRTM, plain or compressed.
    rasters : tuple of Path
        GeoTIFF files, of any extent and projection.
    """

    packed: dict[Cell, Path]
    rasters: tuple[Path, ...] = ()

    @classmethod
    def from_folder(cls, folder: Path) -> Elevation:
        """Find the tiles in a folder and its subfolders.

        Raises
        ------
        InvalidInput
            If there are no tiles, or there are GeoTIFF files and the package to read them is missing.
        """
        files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
        named = ((NAME.match(path.name), path) for path in files if path.name.lower().endswith(PACKED))
        packed = {_cell(name): path for name, path in named if name is not None}
        rasters = tuple(path for path in files if path.suffix.lower() in RASTERS)
        if not packed and not rasters:
            allowed = "files such as N47E009.hgt, N47E009.hgt.zip or GeoTIFF"
            raise InvalidInput.of("no elevation tiles", "--elevation", str(folder), allowed)
        if rasters:
            require_extras({"elevation": "--elevation with GeoTIFF"})
        return cls(packed, rasters)

    def write(self, folder: Path, bounds_deg: Sequence[float] | None) -> dict[str, Any]:
        """Write the tiles that a map needs, and return a description of its terrain. O(tiles of the map).

        Parameters
        ----------
        folder : Path
        bounds_deg : sequence of float, optional
            South, west, north and east of the map. If not given, all tiles in the format of SRTM are written.

        Raises
        ------
        InvalidInput
            If tiles are damaged, with all of them.
        """
        cells = sorted(self.packed) if bounds_deg is None else needed(bounds_deg)
        credits: dict[str, None] = {}
        missing: list[str] = []
        with Check() as check:
            for cell in cells:
                name, heights = tile_name(cell), check(self._heights, cell, credits)
                if heights is None:
                    missing.append(name)
                    continue
                (folder / name[:3]).mkdir(parents=True, exist_ok=True)
                whole = np.where(np.isnan(heights), VOID, np.rint(heights)).astype(">i2")
                whole.tofile(folder / name[:3] / f"{name}.hgt")
        tiles = len(cells) - len(missing)
        return {"known": tiles > 0, "source": "; ".join(credits), "tiles": tiles, "missing": missing}

    def at(self, latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
        """Interpolate heights at places bilinearly from the tiles. O(places + tiles).

        Parameters
        ----------
        latitude_deg, longitude_deg : ndarray, shape (places,)
            Places; NaN if a place is not known.

        Returns
        -------
        ndarray, shape (places,)
            Heights above sea level [m]; NaN if no tile has the height, or the places lie in more than `MAX_CELLS` cells.

        Raises
        ------
        InvalidInput
            If a tile is damaged.
        """
        from scipy.ndimage import map_coordinates  # slow to import

        heights = np.full(len(latitude_deg), np.nan)
        known = (np.abs(latitude_deg) < 90.0) & (np.abs(longitude_deg) < 180.0)
        corners = np.floor(np.column_stack([latitude_deg, longitude_deg])[known]).astype(int)
        cells, cell_of_place = np.unique(corners, axis=0, return_inverse=True)
        for number, (south, west) in enumerate(cells.tolist() if len(cells) <= MAX_CELLS else ()):
            tile = self._kept((south, west))
            if tile is not None:
                here = np.flatnonzero(known)[cell_of_place.ravel() == number]
                rows, columns = south + 1.0 - latitude_deg[here], longitude_deg[here] - west
                heights[here] = map_coordinates(tile, (ROWS - 1) * np.array([rows, columns]), order=1)
        return heights

    @cached_property
    def _kept(self) -> Callable[[Cell], Heights | None]:
        return lru_cache(KEPT_CELLS)(lambda cell: self._heights(cell, {}))

    def _heights(self, cell: Cell, credits: dict[str, None]) -> Heights | None:
        """Return the heights of a cell each arc-second, NaN for voids, or None if no file has any; add the notice to `credits`."""
        if cell not in self.packed:
            return _warped(self.rasters, cell, credits)
        heights = _read(self.packed[cell])
        credits[_credit(self.packed[cell], f"elevation tiles of {ARC_SECONDS[len(heights)]}")] = None
        return heights if len(heights) == ROWS else _refined(_refined(heights).T).T


def needed(bounds_deg: Sequence[float]) -> list[Cell]:
    """Return the cells of a region with a margin.

    Examples
    --------
    >>> needed((47.06, 9.48, 47.27, 9.63)), [tile_name(cell) for cell in needed((-0.5, -1.5, 0.0, -1.2))]
    ([(47, 9)], ['S01W002', 'N00W002'])
    """
    south, west, north, east = bounds_deg
    return [
        (row, column)
        for row in range(math.floor(south - MARGIN_DEG), math.floor(north + MARGIN_DEG) + 1)
        for column in range(math.floor(west - MARGIN_DEG), math.floor(east + MARGIN_DEG) + 1)
    ]


def tile_name(cell: Cell) -> str:
    """Return the name of a tile by its south-western corner, as in SRTM."""
    south, west = cell
    return f"{'S' if south < 0 else 'N'}{abs(south):02d}{'W' if west < 0 else 'E'}{abs(west):03d}"


def without_tiles(missing: Sequence[str]) -> str:
    """Return a sentence on the missing tiles of a map and where to get them, or an empty text if none is missing.

    Examples
    --------
    >>> without_tiles(["N47E009"])[:87]
    'no heights for N47E009: the climb of roads there is unknown, and their interval wider; '
    """
    if not missing:
        return ""
    named = ", ".join(missing[:6]) + (f" and {len(missing) - 6} more" if len(missing) > 6 else "")
    return f"no heights for {named}: the climb of roads there is unknown, and their interval wider; {SOURCES}"


def _cell(name: re.Match[str]) -> Cell:
    rows, columns = ("SN".index(name[1].upper()), int(name[2])), ("WE".index(name[3].upper()), int(name[4]))
    return (rows[1] if rows[0] else -rows[1], columns[1] if columns[0] else -columns[1])


def _read(path: Path) -> Heights:
    """Read the heights of a file in the format of SRTM."""
    limit = 2 * ROWS**2 + 1
    try:
        content = read_file(path, 2 * limit, what="cannot read the elevation tile", allowed="a tile of SRTM")
        if path.name.lower().endswith(".zip"):
            # a tile of the sea is nothing but zeros
            archive = open_archive(content, Budget(path.name), max_ratio=limit)
            inside = [name for name in archive.namelist() if name.lower().endswith(".hgt")]
            content = archive.open(inside[0] if inside else "*.hgt").read(limit)
        elif path.name.lower().endswith(".gz"):
            content = gzip.GzipFile(fileobj=io.BytesIO(content)).read(limit)
    except (OSError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        got = str(error)[:80]
        raise InvalidInput.of("cannot read the elevation tile", path.name, got, "a tile of SRTM") from error
    rows = math.isqrt(len(content) // 2)
    if 2 * rows * rows != len(content) or rows not in ARC_SECONDS:
        allowed = " or ".join(f"{2 * n * n} (of {n} x {n} heights)" for n in ARC_SECONDS)
        raise InvalidInput.of("no elevation tile", path.name, f"{len(content)} bytes", allowed)
    return _known(np.frombuffer(content, ">i2").reshape(rows, rows).astype(np.float32))


def _known(heights_m: Heights) -> Heights:
    return np.where((heights_m >= LOWEST_M) & (heights_m <= HIGHEST_M), heights_m, np.float32(np.nan))


def _refined(heights_m: Heights) -> Heights:
    """Insert two rows between each pair of rows, by linear interpolation; NaN beside a void."""
    fine = np.empty((3 * len(heights_m) - 2, heights_m.shape[1]), dtype=heights_m.dtype)
    above, below = heights_m[:-1], heights_m[1:]
    fine[::3], fine[1::3], fine[2::3] = heights_m, (2.0 * above + below) / 3.0, (above + 2.0 * below) / 3.0
    return fine


def _warped(paths: Sequence[Path], cell: Cell, credits: dict[str, None]) -> Heights | None:
    """Read the heights of a cell from all rasters that overlap it; returns None if no raster has any."""
    if not paths:
        return None
    import rasterio.errors  # an extra
    import rasterio.warp

    south, west = cell
    step = 1.0 / (ROWS - 1)
    pixels = rasterio.Affine(step, 0.0, west - 0.5 * step, 0.0, -step, south + 1.0 + 0.5 * step)
    heights = np.full((ROWS, ROWS), np.nan, dtype=np.float32)
    for path in paths:
        try:
            with rasterio.open(path) as raster:
                bounds = rasterio.warp.transform_bounds(raster.crs, "EPSG:4326", *raster.bounds)
                if bounds[0] > west + 1 or bounds[2] < west or bounds[1] > south + 1 or bounds[3] < south:
                    continue
                part = np.full_like(heights, np.nan)
                rasterio.warp.reproject(
                    rasterio.band(raster, 1),
                    part,
                    src_nodata=VOID if raster.nodata is None else raster.nodata,
                    dst_transform=pixels,
                    dst_crs="EPSG:4326",
                    dst_nodata=np.nan,
                    resampling=rasterio.warp.Resampling.bilinear,
                )
        except (rasterio.errors.RasterioError, rasterio.errors.CRSError) as error:
            got = str(error)[:80]
            raise InvalidInput.of("cannot read the elevation tile", path.name, got, "a GeoTIFF") from error
        part = _known(part)
        if not np.isnan(part).all():
            credits[_credit(path, "elevation tiles (GeoTIFF)")] = None
        heights = np.where(np.isnan(heights), part, heights)
    return None if np.isnan(heights).all() else heights


def _credit(path: Path, otherwise: str) -> str:
    """Return the notice to show beside the heights of a file."""
    return next((credit for part, credit in CREDITS.items() if part in path.name.lower()), otherwise)
