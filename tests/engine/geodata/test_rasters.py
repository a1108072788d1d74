# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rasters: where their cells lie, and what is broken in a file."""

from __future__ import annotations

import numpy as np
import pytest

from tests import places_files as files
from tetflora_addon.errors import SceneError
from tetflora_addon.geodata import rasters
from tetflora_addon.geodata.geotiff import read_tiff
from tetflora_addon.geodata.projection import System, place_about
from tetflora_addon.geodata.rasters import Raster, read_ascii, world_file
from tetflora_addon.jobs import run_to_end

_HILLS = files.hills(9)


def _tiff(path):
    return run_to_end(read_tiff(path))


def _grid(tmp_path, text):
    path = tmp_path / "a.asc"
    path.write_text(text)
    return run_to_end(read_ascii(path))


def test_an_ascii_grid(tmp_path):
    values = _HILLS.copy()
    values[2, 3] = np.nan
    (tmp_path / "a.prj").write_text('PROJCS["WGS_1984_UTM_Zone_32N",GEOGCS["GCS_WGS_1984"]]')
    raster = _grid(tmp_path, files.ascii_grid(values, cell=5.0))
    np.testing.assert_allclose(raster.values, values, atol=0.006)
    assert raster.system.epsg == 32632
    corners = raster.outline
    assert corners.min(axis=0).tolist() == [files.EAST, files.NORTH]
    assert (corners.max(axis=0) - corners.min(axis=0)).tolist() == [45.0, 45.0]
    # The first row of the file is the northernmost.
    assert raster.places(np.zeros(1), np.zeros(1))[0].tolist() == [files.EAST + 2.5, files.NORTH + 42.5]


def test_centers_and_oblong_cells(tmp_path):
    head = "NCOLS 3\nnrows 2\nXLLCENTER 10\nyllcenter 20\ndx 2\ndy 4\n"
    raster = _grid(tmp_path, head + "1 2 3\r\n4 5\n6\n")
    assert raster.values.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert raster.places(np.array([2]), np.array([1]))[0].tolist() == [14.0, 20.0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("ncols 9", "ncols 9.5", "whole numbers"),
        ("ncols 9", "ncols nine", "line 1: ncols is 'nine'"),
        ("ncols 9", "columns 9", "line 1: 'columns 9'"),
        ("nrows 9", "nrows 8", "more than the 72 values"),
        ("nrows 9", "nrows 10", "ends after 81 of 90"),
        ("nrows 9", "nrows 9000", "more than the file can hold"),
        ("nrows 9", "nrows 90000000", "40,000,000 in all"),
        ("cellsize 1.0", "cellsize 0", "cellsize must be"),
        ("cellsize 1.0\n", "", "cellsize is missing"),
        ("\n4", "\n4,1 4", "line 7: '4,1' is not a number"),
    ],
)
def test_a_broken_grid_is_told_by_its_line(tmp_path, old, new, message):
    text = files.ascii_grid(_HILLS)
    with pytest.raises(SceneError, match=message):
        _grid(tmp_path, text.replace(old, new, 1))


def test_blank_text_holds_no_numbers(tmp_path, monkeypatch):
    """Also where a piece of the file begins and ends between two blank lines."""
    monkeypatch.setattr(rasters, "_PIECE", 1)
    head = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    assert _grid(tmp_path, head + "1 2\n\n \n\n3 4\n\n \n").values.tolist() == [[1, 2], [3, 4]]


def test_a_file_that_is_missing_or_none(tmp_path):
    with pytest.raises(FileNotFoundError):
        _tiff(tmp_path / "a.tif")
    with pytest.raises(SceneError, match="not a regular file"):
        _tiff(tmp_path)
    with pytest.raises(SceneError, match="not a regular file"):
        _tiff(tmp_path / "a\0.tif")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_tags_of_a_geotiff(tmp_path, order, big):
    path = tmp_path / "a.tif"
    path.write_bytes(files.geotiff(_HILLS, 2.0, order=order, big=big))
    raster = _tiff(path)
    np.testing.assert_array_equal(raster.values, _HILLS)
    assert raster.system.epsg == files.CODE
    assert raster.corner.tolist() == [files.EAST + 1.0, files.NORTH - 1.0]
    assert (raster.along.tolist(), raster.down.tolist()) == ([2.0, 0.0], [0.0, -2.0])


def test_points_matrices_and_feet(tmp_path):
    path = tmp_path / "a.tif"
    # Values belong to points, and the plane has no code and counts in feet, heights too.
    keys = [1, 1, 0, 4, 1025, 0, 1, 2, 3072, 0, 1, 32767, 3076, 0, 1, 9002, 4099, 0, 1, 9002]
    path.write_bytes(files.geotiff(_HILLS, 10.0, extra={34735: (3, keys)}))
    raster = _tiff(path)
    assert raster.system == System(unit=0.3048)
    assert raster.system.name == "plain units of 0.3048 m"
    place = place_about(raster.system, *np.sort(raster.outline[::2], axis=0))
    local = place.local(raster.places(np.array([0, 1]), np.zeros(2)), raster.system, "")
    assert local[1] - local[0] == pytest.approx([3.048, 0.0])
    assert local[0] == pytest.approx(
        [-3.048 * 0.5 * (_HILLS.shape[1] - 1), 3.048 * 0.5 * (_HILLS.shape[0] - 1)], abs=0.6
    )
    np.testing.assert_allclose(raster.values, 0.3048 * _HILLS, rtol=1e-6)
    assert raster.notes == ("heights in feet read as such",)
    # A unit that nobody knows counts as a meter.
    keys = [1, 1, 0, 3, 1025, 0, 1, 2, 3072, 0, 1, 32767, 3076, 0, 1, 9998]
    path.write_bytes(files.geotiff(_HILLS, 10.0, extra={34735: (3, keys)}))
    assert _tiff(path).system == System(unit=1.0)
    # A turned raster.
    matrix = [0.0, 2.0, 0.0, 100.0, 2.0, 0.0, 0.0, 200.0, *(8 * [0.0])]
    path.write_bytes(files.geotiff(_HILLS, extra={34264: (12, matrix)}))
    raster = _tiff(path)
    assert (raster.along.tolist(), raster.down.tolist(), raster.corner.tolist()) == ([0, 2], [2, 0], [101, 201])


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ({256: None}, r"ImageWidth \(256\) is missing"),
        ({256: (4, [4_000_000_000])}, "in all can be read"),
        ({259: (3, [34887])}, r"Compression \(259\): it is compressed with LERC.*COMPRESS=DEFLATE"),
        ({259: (3, [7])}, "compressed with JPEG"),
        ({259: (3, [8])}, "strip 1 of 1 is damaged"),
        ({259: (3, [5])}, "strip 1 of 1 ends too early; get it again"),
        ({278: (4, [0])}, r"RowsPerStrip \(278\) gives pieces of 9 by 0"),
        ({258: (3, [12])}, r"BitsPerSample \(258\) is 12"),
        ({273: None}, r"StripOffsets \(273\) is missing"),
        ({273: (4, [10_000])}, r"StripOffsets \(273\) leads beyond"),
        ({279: (4, [2**31])}, "leads beyond"),
        ({277: (3, [3])}, r"SamplesPerPixel \(277\) is 3.*-b 1"),
        ({33550: (12, [0.0, 0.0, 0.0])}, r"ModelPixelScale \(33550\) gives cells without a size"),
        ({33922: (12, [float("nan")] * 6)}, r"ModelTiepoint \(33922\) must be"),
        ({34735: (3, [1, 1, 0, 9])}, r"GeoKeyDirectory \(34735\)"),
        ({42113: (2, b"nothing\0")}, r"GDAL_NODATA \(42113\)"),
    ],
)
def test_a_broken_geotiff_is_told_by_its_tag(tmp_path, extra, message):
    path = tmp_path / "a.tif"
    path.write_bytes(files.geotiff(_HILLS, extra=extra))
    with pytest.raises(SceneError, match=message):
        _tiff(path)


def test_world_files(tmp_path):
    path = tmp_path / "a.png"
    with pytest.raises(SceneError, match=r"a.png: nothing tells where it lies.*\.pgw"):
        world_file(path)
    path.with_suffix(".pgw").write_bytes(files.WORLD)
    corner, along, down = world_file(path)
    assert (corner.tolist(), along.tolist(), down.tolist()) == ([500000, 5316000], [5, 0], [0, -5])
    path.with_suffix(".pgw").write_text("5\n0\n0\nx\n1\n2\n")
    with pytest.raises(SceneError, match=r"a.pgw: line 4"):
        world_file(path)
    path.with_suffix(".pgw").write_text("0\n0\n0\n0\n1\n2\n")
    with pytest.raises(SceneError, match="no size"):
        world_file(path)


def test_values_between_cells_and_coarser_rasters():
    """A plane stays one, with and without averaging; holes stay holes."""
    row, column = np.mgrid[0:12, 0:15]
    values = (3.0 * column - 2.0 * row).astype(np.float32)
    raster = Raster(values, np.array([7.0, 9.0]), np.array([2.0, 0.0]), np.array([0.0, -2.0]), System())
    some = np.random.default_rng(1).uniform(0.0, 11.0, (2, 50))
    np.testing.assert_allclose(raster.at(*some), 3.0 * some[0] - 2.0 * some[1], atol=1e-4)
    assert raster.coarser(200) is raster
    coarse = raster.coarser(20)
    assert coarse.values.shape == (4, 5)
    x, y = coarse.places(column[:4, :5].ravel(), row[:4, :5].ravel()).T
    np.testing.assert_allclose(coarse.values.ravel(), 3.0 * (x - 7.0) / 2.0 + (y - 9.0), atol=1e-4)
    values[3:9, 3:9] = np.nan
    assert np.isnan(raster.coarser(20).values).sum() == 4
    assert np.isnan(raster.at(np.array([5.0]), np.array([5.0])))
