# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rasters and maps as others write them: every kind of file is read as what it is."""

from __future__ import annotations

import lzma
import struct
import zlib

import numpy as np
import pytest
import zstandard

from tests import places_files as files
from tests import places_maps as maps
from tetflora_addon.errors import SceneError
from tetflora_addon.geodata import geotiff
from tetflora_addon.geodata.canopy import checked_canopy, heights_above, without_areas
from tetflora_addon.geodata.geotiff import place_of_image
from tetflora_addon.geodata.grids import mosaic, read_grid
from tetflora_addon.geodata.inventories import read_inventory
from tetflora_addon.geodata.layers import read_features
from tetflora_addon.geodata.outlines import BUILDING, MEADOW, OTHER, ROAD, WATER, WOOD, read_outlines
from tetflora_addon.geodata.projection import PLAIN, System, between
from tetflora_addon.geodata.rasters import Raster, in_degrees
from tetflora_addon.jobs import run_to_end

_HILLS, _ZONE = files.hills(9), System(25832)


@pytest.mark.parametrize("name", maps.cases())
def test_cases(name):
    assert maps.problems(name) == []


_PACKED = {
    "none": (1, bytes),
    "lzw": (5, files.lzw),
    "deflate": (8, zlib.compress),
    "old deflate": (32946, zlib.compress),
    "packbits": (32773, files.packbits),
    "lzma": (34925, lzma.compress),
    "zstd": (50000, lambda data: zstandard.ZstdCompressor(write_checksum=True).compress(data)),
}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("dtype", "predictor"), [("f4", 1), ("f4", 2), ("f4", 3), ("f8", 3), ("u1", 2), ("i2", 2)])
@pytest.mark.parametrize("packed", _PACKED)
def test_compressions_and_predictors(tmp_path, packed, dtype, predictor, order):
    values = (files.hills(70) - (300.0 if dtype == "u1" else 0.0)).astype(dtype)
    path = tmp_path / "a.tif"
    path.write_bytes(files.geotiff(values, order=order, packed=_PACKED[packed], predictor=predictor))
    np.testing.assert_array_equal(run_to_end(read_grid(path)).values, values.astype(np.float32))


@pytest.mark.parametrize("packed", sorted(set(_PACKED) - {"none", "packbits"}))
def test_damage_is_never_ground(tmp_path, packed):
    """A byte in the middle that is another is told, or nothing changes."""
    values = np.random.default_rng(0).uniform(300.0, 400.0, (40, 40)).astype(np.float32)
    whole = files.geotiff(values, packed=_PACKED[packed])
    path, refused = tmp_path / "a.tif", 0
    for part in range(40, 95, 5):
        data = bytearray(whole)
        data[len(data) * part // 100] ^= 0xFF
        path.write_bytes(data)
        try:
            found = run_to_end(read_grid(path)).values
        except SceneError as error:
            assert str(error).startswith("a.tif: ")
            refused += 1
        else:
            assert packed == "lzw" or np.array_equal(found, values)
    assert refused > 5 or packed == "lzw"


def test_what_cannot_be_read_is_named(tmp_path, monkeypatch):
    path = tmp_path / "a.tif"
    monkeypatch.delitem(geotiff._READERS, 50000)  # Python by itself
    for epsg, name in ((34887, "LERC"), (50000, "Zstandard"), (7, "JPEG"), (4711, "4711")):
        path.write_bytes(files.geotiff(files.hills(20), packed=(epsg, zlib.compress)))
        with pytest.raises(SceneError, match=rf"compressed with .*{name}.*gdal_translate"):
            run_to_end(read_grid(path))


def test_codes_of_tables_that_are_full():
    for data in (bytes(30_000), bytes(range(256)) * 60, np.random.default_rng(1).bytes(20_000), b"ab" * 5000, b"a"):
        assert geotiff._lzw(files.lzw(data), len(data)) == data


def test_a_tile_of_the_shuttle_mission(tmp_path):
    values = np.rint(files.hills(12)).astype(">i2")
    values[2, 3] = -32768
    path = tmp_path / "S08W035.hgt"
    path.write_bytes(values.tobytes())
    raster = run_to_end(read_grid(path))
    assert raster.system.epsg == 4326
    assert raster.corner.tolist() == [-35.0, -7.0]
    assert np.isnan(raster.values).sum() == 1
    assert raster.places(np.array([11]), np.array([11]))[0] == pytest.approx([-34.0, -8.0])
    path.rename(tmp_path / "tile.hgt")
    with pytest.raises(SceneError, match=r"N48E009\.hgt"):
        run_to_end(read_grid(tmp_path / "tile.hgt"))


@pytest.mark.parametrize("form", ["{} {} {}", "{},{},{}", "{};{};{}", "{}\t{}\t{}"])
@pytest.mark.parametrize("head", ["", "x y z\n"])
def test_lists_of_places(tmp_path, form, head):
    rows = [
        (5e5 + 2.0 * i, 5e6 + 2.0 * j, 100.0 + i + 10.0 * j) for j in range(3) for i in range(4) if (i, j) != (1, 1)
    ]
    rng = np.random.default_rng(0)
    text = head + "".join(form.format(*rows[k]) + "\n" for k in rng.permutation(len(rows)))
    if ";" in form:
        text = text.replace(".", ",")
    path = tmp_path / "a.xyz"
    path.write_text(text)
    path.with_suffix(".prj").write_text("EPSG:25832")
    raster = run_to_end(read_grid(path))
    assert raster.system.epsg == 25832
    assert raster.corner.tolist() == [5e5, 5e6 + 4.0]
    np.testing.assert_array_equal(raster.values, [[120, 121, 122, 123], [110, np.nan, 112, 113], [100, 101, 102, 103]])
    path.write_text("".join(f"{x} {y} 1\n" for x, y in rng.uniform(0.0, 9.0, (20, 2))))
    with pytest.raises(SceneError, match="not evenly spaced"):
        run_to_end(read_grid(path))


@pytest.mark.parametrize("north", [10.0, 20.0])
def test_a_model_of_the_usgs(tmp_path, north):
    path = tmp_path / "a.dem"
    path.write_bytes(files.usgs(files.hills(8), north))
    raster = run_to_end(read_grid(path))
    np.testing.assert_array_equal(raster.values, np.rint(files.hills(8)))
    assert raster.system.epsg == 26717
    assert raster.corner.tolist() == [files.EAST, files.NORTH + 7.0 * north]


def _raster(values, west=0.0, north=0.0, system=_ZONE, cell=1.0):
    return Raster(
        np.asarray(values, np.float32), np.array([west, north]), np.array([cell, 0.0]), np.array([0.0, -cell]), system
    )


def test_tiles_become_one():
    whole = files.hills(12)
    whole[3, 3] = np.nan
    tiles = [_raster(whole[j : j + 7, i : i + 7], 5e5 + i, 5e6 - j) for j in (5, 0) for i in (0, 5)]
    joined = mosaic(tiles, ["a", "b", "c", "d"])
    np.testing.assert_array_equal(joined.values, whole)
    assert joined.corner.tolist() == [5e5, 5e6]
    for other in (_raster(whole, cell=2.0), _raster(whole, system=System(25833))):
        with pytest.raises(SceneError, match=r"b: its coordinate system or cells are not those of a"):
            mosaic([tiles[0], other], ["a", "b"])
    with pytest.raises(SceneError, match="in all can be read"):
        mosaic([tiles[0], _raster(whole, 5e5 + 50_000.0, 5e6 + 50_000.0)], ["a", "b"])


def test_a_surface_without_its_ground_is_a_canopy():
    """Also where the ground is coarser and in another system."""
    y, x = np.mgrid[0:40, 0:40]
    surface = _raster(300.0 + 0.5 * x + 0.25 * y, 5e5, 5.3e6)
    corner = between(np.array([[5e5 - 40.0, 5.3e6 + 40.0]]), System(25832), System(25833))[0]
    y, x = np.mgrid[0:30, 0:30]
    places = between(corner + np.stack([4.0 * x.ravel(), -4.0 * y.ravel()], axis=1), System(25833), System(25832))
    below = 290.0 + 0.5 * (places[:, 0] - 5e5) + 0.25 * (5.3e6 - places[:, 1])
    ground = _raster(below.reshape(30, 30), *corner, System(25833), 4.0)
    found = heights_above(surface, ground, "x: ").values
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, 10.0, atol=0.01)
    with pytest.raises(SceneError, match="no place in common"):
        heights_above(surface, _raster(np.ones((3, 3)), 6e5, 5.3e6), "x: ")
    with pytest.raises(SceneError, match="set Coordinate System"):
        heights_above(surface, _raster(np.ones((3, 3)), system=System()), "x: ")


def test_what_is_no_canopy_is_told():
    values = files.crowns()
    same, notes = checked_canopy(values, "x: ")
    assert notes == []
    np.testing.assert_array_equal(same, values)
    values[3, 3] = 400.0  # a bird
    same, notes = checked_canopy(values, "x: ")
    assert (int(np.isnan(same).sum()), notes) == (1, ["1 cells higher than 130 m left out"])
    with pytest.raises(SceneError, match=r"set Meters per Value to 0\.01"):
        checked_canopy(100.0 * (files.crowns() - 5.0), "x: ")
    with pytest.raises(SceneError, match="elevations above the sea"):
        checked_canopy(_HILLS, "x: ")
    assert "its lowest cells are 25 m high" in checked_canopy(files.crowns() + 20.0, "x: ")[1][0]


def test_cells_on_buildings_are_left_out():
    raster = _raster(np.ones((20, 30)), 100.0, 200.0)
    area = np.array([[104.5, 195.5], [110.5, 195.5], [110.5, 190.5], [107.5, 193.5], [104.5, 190.5]])
    found, number = without_areas(raster, [area, area + [1000.0, 0.0], area - [7.0, 0.0]])
    row, column = np.nonzero(np.isnan(found.values))
    assert number == len(row) > 20
    assert (column.min(), column.max(), row.min(), row.max()) == (0, 10, 5, 9)
    assert not np.isnan(found.values[9, 7])  # in the notch


def test_cells_as_small_as_degrees():
    assert in_degrees(_raster(_HILLS, 9.0, 48.0, System(), 0.0003), "").system.epsg == 4326
    assert in_degrees(_raster(_HILLS, 9.0, 48.0, System(), 0.5), "").system.epsg == 0
    assert in_degrees(_raster(_HILLS, 5e5, 5e6, System(), 0.02), "").system.epsg == 0
    with pytest.raises(SceneError, match=r"a: its cells are 0.05 wide.*4326.*Plain Meters"):
        in_degrees(_raster(_HILLS, 9.0, 48.0, System(), 0.05), "a: ")


def test_places_of_images(tmp_path):
    path = tmp_path / "a.jpg"
    path.write_bytes(b"")
    with pytest.raises(SceneError, match="nothing tells where it lies"):
        place_of_image(path)
    path.with_suffix(".jgw").write_bytes(files.WORLD)
    assert place_of_image(path).corner.tolist() == [5e5, 5316000.0]


@pytest.mark.parametrize("kind", ["shape", "geopackage"])
def test_layers_of_surveys(tmp_path, kind):
    path = files.write(tmp_path, kind)[1]
    if kind == "shape":  # the table has the name of the shapes
        path.with_suffix(".dbf").write_bytes(files.FILES["dbase"][2])
    found, system, _ = read_outlines(path)
    assert system.epsg == 25832
    assert [outline.kind for outline in found] == [WOOD, BUILDING]
    assert found[0].rings[0][:2].tolist() == [[files.EAST, files.NORTH], [files.EAST, files.NORTH + 50.0]]
    if kind == "shape":
        assert found[1].height == 9.5
        path.with_suffix(".prj").unlink()
        assert read_outlines(path)[1].epsg == 0


def test_shapes_with_holes_feet_and_degrees(tmp_path):
    path = tmp_path / "a.shp"
    outer, hole = [[0, 0], [0, 9], [9, 9], [9, 0], [0, 0]], [[2, 2], [4, 2], [4, 4], [2, 4], [2, 2]]
    other = [[20, 0], [20, 9], [29, 9], [29, 0], [20, 0]]
    path.write_bytes(files.shapefile([outer, other, hole]))
    with pytest.raises(SceneError, match=r"no file tells its coordinate system.*4326.*Plain Meters"):
        read_outlines(path)
    assert [len(outline.rings) for outline in read_outlines(path, PLAIN)[0]] == [2, 1]
    assert read_outlines(path, 4326)[1].epsg == 4326
    path.with_suffix(".prj").write_text('LOCAL["x",UNIT["Foot",0.3048]]')
    path.with_suffix(".prj").write_text('PROJCS["x",GEOGCS["y",DATUM["z"]],PROJECTION["odd"],UNIT["Foot",0.3048]]')
    found, system, _ = read_outlines(path)
    assert system.epsg == 0
    assert between(found[0].rings[0], system, System()).max() == pytest.approx(9 * 0.3048)


def test_trees_of_a_geopackage(tmp_path):
    path = tmp_path / "trees.gpkg"
    rows = [
        (struct.pack("<BI2d", 1, 1, files.EAST + n, files.NORTH), {"art": name, "hoehe": "12"})
        for n, name in enumerate(("Quercus robur", "Tilia cordata"))
    ]
    path.write_bytes(files.geopackage("trees", *rows))
    found = read_inventory(path)
    assert found.system.epsg == files.CODE
    assert found.sizes["height"].tolist() == [12.0, 12.0]
    assert [names[0] for names in found.names] == ["Quercus robur", "Tilia cordata"]


_LINE, _AREA = [[0.0, 0.0], [0.0, 1.0]], [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]]


@pytest.mark.parametrize(
    ("geometry", "tags", "expected"),
    [
        (_AREA, {"NATURE": "Forêt fermée de feuillus"}, (WOOD, 0.0)),
        (_AREA, {"OBJART_TXT": "Laubwald"}, (WOOD, 0.0)),
        (_AREA, {"Nutzart": "Grünland"}, (MEADOW, 0.0)),
        (_AREA, {"type": "Lake"}, (WATER, 0.0)),
        (_AREA, {"class": "Street trees"}, (WOOD, 0.0)),
        (_AREA, {"BLDG_ID": 7, "BLDG_HT_FT": 100}, (BUILDING, 30.48)),
        (_AREA, {"building": "yes", "NumFloors": 4}, (BUILDING, 12.0)),
        (_AREA, {"OBJEKTART": "Wohngebäude", "Hoehe_m": "8,5"}, (BUILDING, 8.5)),
        (_AREA, {"fclass": "residential"}, (OTHER, 0.0)),
        (_AREA, {"name": "Forest"}, (OTHER, 0.0)),
        (_LINE, {"roadtype": "Primary"}, (ROAD, 8.0)),
        (_LINE, {"tipo": "río"}, (WATER, 0.0)),
        (_LINE, {"NATURE": "Chemin", "LARGEUR": 2.5}, (ROAD, 2.5)),
    ],
)
def test_kinds_by_the_keys_of_others(tmp_path, geometry, tags, expected):
    path = tmp_path / "a.geojson"
    kind = "LineString" if geometry is _LINE else "Polygon"
    path.write_text(files.collection(files.feature(kind, geometry, **tags)))
    (found,) = read_outlines(path)[0]
    assert (found.kind, pytest.approx(found.width or found.height)) == (expected[0], expected[1])
    (found,) = read_outlines(path, kind=WATER)[0]
    assert found.kind == WATER


def _record(kind: int, body: bytes) -> bytes:
    body = struct.pack("<i", kind) + body
    return struct.pack(">2i", 1, len(body) // 2) + body


@pytest.mark.parametrize(
    ("kind", "body", "expected"),
    [
        (1, struct.pack("<2d", 3.0, 4.0), [[3.0, 4.0]]),
        (11, struct.pack("<4d", 3.0, 4.0, 9.0, 0.0), [[3.0, 4.0]]),  # with a height and a measure
        (8, struct.pack("<4di4d", 0, 0, 5, 6, 2, 3.0, 4.0, 5.0, 6.0), [[3.0, 4.0], [5.0, 6.0]]),
    ],
)
def test_points_of_shapefiles_are_read(tmp_path, kind, body, expected):
    path = tmp_path / "points.shp"
    head, record = files.shapefile([[[0, 0], [0, 1], [1, 1], [0, 0]]])[:100], _record(kind, body)
    path.write_bytes(head[:24] + struct.pack(">i", 50 + len(record) // 2) + head[28:] + record)
    (found,), _ = read_features(path, PLAIN)
    coordinates = found["geometry"]["coordinates"]
    assert (coordinates if isinstance(coordinates[0], list) else [coordinates]) == expected


def _line(order: str, *points: tuple[float, ...], code: int = 2) -> bytes:
    one = struct.pack(f"{order}BII", order == "<", code, len(points))
    return one + b"".join(struct.pack(f"{order}{len(p)}d", *p) for p in points)


def test_lines_and_collections_of_a_geopackage_are_read(tmp_path):
    """In either byte order, with heights, and one within the other."""
    line, high = _line("<", (0.0, 1.0), (2.0, 3.0)), _line(">", (0.0, 1.0, 9.0), (2.0, 3.0, 9.0), code=1002)
    many = struct.pack("<BII", 1, 5, 2) + line + line
    all_ = struct.pack("<BII", 1, 7, 2) + many + struct.pack("<BI2d", 1, 1, 7.0, 8.0)
    path = tmp_path / "lines.gpkg"
    path.write_bytes(files.geopackage("lines", *((shape, {"art": "x"}) for shape in (line, high, many, all_))))
    plain = [[0.0, 1.0], [2.0, 3.0]]
    kinds = [(one["geometry"]["type"], one["geometry"].get("coordinates")) for one in read_features(path, PLAIN)[0]]
    assert kinds[:3] == [("LineString", plain), ("LineString", plain), ("MultiLineString", [plain, plain])]
    parts = read_features(path, PLAIN)[0][3]["geometry"]["geometries"]
    assert [part["type"] for part in parts] == ["MultiLineString", "Point"]
