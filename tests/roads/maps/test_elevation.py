"""Elevation tiles: sizes, edges, voids, archives, rasters, and the bilinear law."""

import gzip
import sys
import zipfile

import numpy as np
import pytest
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.roads.maps.elevation import ROWS, VOID, Elevation, needed, without_tiles

CELL = (47.1, 9.1, 47.2, 9.2)


def hills(rows):
    """Whole metres, so that a file holds them as they are: a bilinear patch between the heights of 3 arc-seconds."""
    steps = np.arange(rows) * (3 if rows == 1201 else 1)
    north, east = np.sin(steps[::-1] / 300.0), np.cos(steps / 500.0)
    return np.rint(700.0 + 300.0 * np.outer(north, east))


def packed(heights):
    return heights.astype(">i2").tobytes()


def converted(source, out, bounds=CELL):
    terrain = Elevation.from_folder(source).write(out, bounds)
    tiles = {
        path.name: np.fromfile(path, ">i2").reshape(ROWS, ROWS).astype(float) for path in out.rglob("*.hgt")
    }
    return terrain, tiles


@pytest.fixture
def source(tmp_path):
    folder = tmp_path / "source"
    folder.mkdir()
    return folder


def test_a_tile_of_1_arc_second_is_taken_as_it_is(source, tmp_path):
    heights = hills(3601)
    (source / "N47E009.hgt").write_bytes(packed(heights))
    terrain, tiles = converted(source, tmp_path / "out")
    assert terrain == {"known": True, "source": "elevation tiles of 1 arc-second", "tiles": 1, "missing": []}
    np.testing.assert_array_equal(tiles["N47E009.hgt"], heights)


def test_a_tile_of_3_arc_seconds_has_bilinear_heights_between(source, tmp_path):
    coarse = hills(1201)
    (source / "N47E009.hgt").write_bytes(packed(coarse))
    terrain, tiles = converted(source, tmp_path / "out")
    assert terrain["source"] == "elevation tiles of 3 arc-seconds"
    fine = tiles["N47E009.hgt"]
    np.testing.assert_array_equal(fine[::3, ::3], coarse)
    for row, column in np.random.default_rng(3).integers(0, ROWS - 1, (300, 2)):
        (i, k), (v, u) = (row // 3, column // 3), (row % 3 / 3.0, column % 3 / 3.0)
        corners = coarse[i : i + 2, k : k + 2]
        weights = np.outer([1.0 - v, v], [1.0 - u, u])[: len(corners), : corners.shape[1]]
        assert fine[row, column] == pytest.approx((weights * corners).sum(), abs=0.501)


def test_neighbouring_tiles_agree_on_their_edge(source, tmp_path):
    both = np.hstack([hills(1201)[:, :-1], hills(1201)])
    (source / "N47E009.hgt").write_bytes(packed(both[:, :1201]))
    (source / "N47E010.hgt").write_bytes(packed(both[:, 1200:]))
    terrain, tiles = converted(source, tmp_path / "out", (47.1, 9.1, 47.2, 10.2))
    assert terrain["tiles"] == 2
    np.testing.assert_array_equal(tiles["N47E009.hgt"][:, -1], tiles["N47E010.hgt"][:, 0])


def test_a_void_stays_one_and_reaches_no_farther_than_its_neighbours(source, tmp_path):
    rows = 1201
    heights = np.full((rows, rows), 500.0)
    heights[600, 700] = VOID
    (source / "N47E009.hgt").write_bytes(packed(heights))
    fine = converted(source, tmp_path / "out")[1]["N47E009.hgt"]
    share = (ROWS - 1) // (rows - 1)
    void = np.argwhere(fine == VOID)
    assert [600 * share, 700 * share] in void.tolist()
    assert np.abs(void - [600 * share, 700 * share]).max() == share - 1
    assert set(np.unique(fine)) == {VOID, 500.0}


def test_impossible_heights_are_voids(source, tmp_path):
    heights = np.full((1201, 1201), -430.0)
    heights[0, 0], heights[3, 3], heights[9, 9] = 9999, -9999, 8849
    (source / "N47E009.hgt").write_bytes(packed(heights))
    fine = converted(source, tmp_path / "out")[1]["N47E009.hgt"]
    assert [fine[0, 0], fine[9, 9], fine[27, 27], fine[60, 60]] == [VOID, VOID, 8849, -430]


@pytest.mark.parametrize("name", ["n47e009.hgt.gz", "N47E009.SRTMGL1.hgt.zip"])
def test_a_compressed_tile_is_read(source, tmp_path, name):
    content = packed(hills(1201))
    if name.endswith(".gz"):
        (source / name).write_bytes(gzip.compress(content, 1))
    else:
        with zipfile.ZipFile(source / name, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            archive.writestr("readme.txt", "x")
            archive.writestr("N47E009.hgt", content)
    terrain, tiles = converted(source, tmp_path / "out")
    np.testing.assert_array_equal(tiles["N47E009.hgt"][::3, ::3], hills(1201))
    assert terrain["source"] == (
        "SRTM, NASA and USGS" if "SRTM" in name else "elevation tiles of 3 arc-seconds"
    )


def test_every_damaged_tile_is_named(source, tmp_path):
    (source / "N47E009.hgt").write_bytes(b"x" * 100)
    (source / "N47E010.hgt.gz").write_bytes(b"no gzip")
    (source / "N47E011.zip").write_bytes(b"no zip")
    with zipfile.ZipFile(source / "N47E012.zip", "w") as archive:
        archive.writestr("readme.txt", "x")
    with pytest.raises(InvalidInput) as caught:
        converted(source, tmp_path / "out", (47.1, 9.1, 47.2, 12.2))
    faults = caught.value.faults
    assert [fault.where for fault in faults] == [
        "N47E009.hgt",
        "N47E010.hgt.gz",
        "N47E011.zip",
        "N47E012.zip",
    ]
    assert faults[0].got == "100 bytes"
    assert faults[0].allowed == "25934402 (of 3601 x 3601 heights) or 2884802 (of 1201 x 1201 heights)"


@pytest.mark.parametrize("files", [[], ["readme.txt", "heights.hgt", "N47E009.txt"]])
def test_a_folder_without_tiles_is_refused(source, files):
    for name in files:
        (source / name).write_text("x")
    refuses("no elevation tiles: --elevation", Elevation.from_folder, source)


def test_the_tiles_of_a_region_and_a_missing_one():
    assert needed((-0.5, -1.5, 0.1, 0.1)) == [(row, column) for row in (-1, 0) for column in (-2, -1, 0)]
    assert needed((47.99, 9.5, 47.99, 9.5)) == [(47, 9), (48, 9)]  # a road may reach beyond the last place
    assert without_tiles([]) == ""
    text = without_tiles([f"N47E{k:03d}" for k in range(9)])
    assert "N47E005 and 3 more" in text
    assert "SRTM 1 arc-second" in text
    assert "public domain" in text


def test_geotiff_without_its_package_is_one_clear_error(source, monkeypatch):
    (source / "dem.tif").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "rasterio.errors", None)
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(InvalidInput, match="missing package: --elevation with GeoTIFF") as caught:
        Elevation.from_folder(source)
    assert "'.[elevation]'" in caught.value.faults[0].fix


@pytest.fixture
def raster():
    rasterio = pytest.importorskip("rasterio", reason="the extra tripwatt[elevation] is not installed")

    def write(path, heights, west, north, step, **more):
        about = {"driver": "GTiff", "count": 1, "dtype": "float32", "crs": "EPSG:4326"} | more
        about |= {"height": heights.shape[0], "width": heights.shape[1]}
        about["transform"] = rasterio.Affine(step, 0.0, west, 0.0, -step, north)
        with rasterio.open(path, "w", **about) as file:
            file.write(heights.astype("float32"), 1)

    return write


def test_geotiff_rasters_are_joined_and_a_plane_stays_a_plane(source, tmp_path, raster):
    """Two halves of a degree, each with cells of 9 arc-seconds: height rises with latitude and longitude."""
    step = 9.0 / 3600.0
    for name, west in (("Copernicus_DSM_west.tif", 8.9), ("Copernicus_DSM_east.tif", 9.5)):
        latitude = 48.1 - step * (np.arange(480) + 0.5)
        longitude = west + step * (np.arange(240) + 0.5)
        raster(
            source / name,
            np.rint(2000.0 * (latitude[:, None] - 47.0) + 1000.0 * (longitude - 8.0)),
            west,
            48.1,
            step,
        )
    terrain, tiles = converted(source, tmp_path / "out")
    assert terrain["tiles"] == 1
    assert terrain["source"].startswith("Copernicus DEM, © DLR e.V.")
    fine = tiles["N47E009.hgt"]
    for row, column in np.random.default_rng(4).integers(0, ROWS, (200, 2)):
        plane = 2000.0 * (1.0 - row / 3600.0) + 1000.0 * (1.0 + column / 3600.0)
        assert fine[row, column] == pytest.approx(plane, abs=2.0)


def test_where_no_raster_lies_is_missing(source, tmp_path, raster):
    raster(source / "a.tif", np.full((100, 100), 300.0), 20.0, 48.0, 0.01)
    terrain, tiles = converted(source, tmp_path / "out")
    assert (terrain["known"], terrain["missing"], tiles) == (False, ["N47E009"], {})


def test_voids_of_a_raster(source, tmp_path, raster):
    heights = np.full((200, 200), 300.0)
    heights[60:70, 60:70] = -9999.0
    raster(source / "a.tif", heights, 8.5, 48.5, 0.01, nodata=-9999.0)
    fine = converted(source, tmp_path / "out")[1]["N47E009.hgt"]
    assert set(np.unique(fine)) == {VOID, 300.0}
    assert (fine == VOID).mean() == pytest.approx(0.1 * 0.1, rel=0.01)


def test_a_damaged_raster_is_named(source, tmp_path, raster):
    (source / "a.tif").write_bytes(b"no raster")
    refuses(r"cannot read the elevation tile: a\.tif", converted, source, tmp_path / "out")


def test_heights_at_places_are_bilinear_and_unknown_where_no_tile_is(source):
    heights = hills(3601)
    (source / "N47E009.hgt").write_bytes(packed(heights))
    tiles = Elevation.from_folder(source)
    rows, columns = np.array([10.0, 10.5, 3600.0, 1800.25]), np.array([20.0, 20.25, 0.0, 3599.5])
    found = tiles.at(48.0 - rows / 3600.0, 9.0 + columns / 3600.0)
    for row, column, height in zip(rows, columns, found, strict=True):
        i, k = min(int(row), 3599), min(int(column), 3599)
        v, u = row - i, column - k
        corners = heights[i : i + 2, k : k + 2]
        assert height == pytest.approx((np.outer([1 - v, v], [1 - u, u]) * corners).sum(), abs=1e-3)
    elsewhere = tiles.at(np.array([47.5, 12.5, np.nan, 95.0]), np.array([9.5, 9.5, 9.5, 9.5]))
    assert np.isfinite(elsewhere).tolist() == [True, False, False, False]


def test_positions_all_over_the_world_are_none(source):
    (source / "N47E009.hgt").write_bytes(packed(hills(1201)))
    latitude, longitude = np.linspace(47.5, -80.0, 400), np.linspace(9.5, 170.0, 400)
    assert np.isnan(Elevation.from_folder(source).at(latitude, longitude)).all()
