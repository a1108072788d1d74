# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Import of real places: pixels as Blender reads them, layers that align, sizes that fields have, nothing half done."""

from __future__ import annotations

import json
import random
import shutil
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from devtools import session
from operators import base, places
from tests import places_files as files
from tests import places_inventories as inventories
from tests.blender.digests import difference, everything
from tests.blender.scenes import depsgraph, select
from tetflora_addon.blender.attributes import read
from tetflora_addon.blender.geodata import terrain, trees
from tetflora_addon.blender.geodata.origin import KEY, Import, importing, origin_of
from tetflora_addon.blender.geodata.terrain import read_raster
from tetflora_addon.blender.geodata.trees import curves_of
from tetflora_addon.blender.placing.terrain import _lines_of, read_ground
from tetflora_addon.blender.runtime import GoneError
from tetflora_addon.blender.species.edits import species_for
from tetflora_addon.errors import SceneError
from tetflora_addon.geodata.projection import System, to_degrees
from tetflora_addon.jobs import run_to_end

pytestmark = pytest.mark.usefixtures("clean_file")


def _call(operator, path, **options):
    assert getattr(bpy.ops.tetflora, operator)(filepath=str(path), **options) == {'FINISHED'}
    return bpy.context.view_layer.objects.active


def _raster(path, **settings):
    return importing(read_raster)(Import(bpy.context.scene, depsgraph(), path, **settings))


def _vertices(obj):
    return read(obj.data, "position").astype(np.float64) + np.array(obj.location)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint16, np.int16, np.uint8, np.uint32])
def test_pixels_of_tiff_are_what_was_written(tmp_path, dtype, order):
    values = np.rint(files.hills(6) - (300.0 if np.dtype(dtype).itemsize == 1 else 0.0)).astype(dtype)
    if np.dtype(dtype).kind != "u":
        values[1, 2] = -9999
        values[3, 3] = -250
    path = tmp_path / "a.tif"
    path.write_bytes(files.geotiff(values, order=order))
    raster = run_to_end(_raster(path))
    expected = values.astype(np.float64)
    expected[expected == -9999] = np.nan
    np.testing.assert_allclose(raster.values, expected, atol=1e-2 if dtype != np.uint32 else 200.0)
    assert not bpy.data.images


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_cells_of_a_tiff_that_are_no_number_are_holes(tmp_path, dtype):
    values = files.hills(6).astype(dtype)
    values[0, 1], values[2, 3], values[4, 4] = np.nan, np.inf, -np.inf
    path = tmp_path / "a.tif"
    path.write_bytes(files.geotiff(values, nothing=None))
    found = run_to_end(_raster(path)).values
    np.testing.assert_allclose(found, np.where(np.isfinite(values), values, np.nan), rtol=1e-6)


@pytest.mark.parametrize("dtype", [np.uint16, np.int16, np.uint8, np.int32])
def test_whole_numbers_of_a_tiff_stay_whole(tmp_path, dtype):
    """And each that stands for nothing is found."""
    limits = np.iinfo(dtype)
    low, high = max(limits.min, -30_000), min(limits.max, 65_535)
    values = np.rint(np.linspace(low, high, 64 * 64)).astype(dtype).reshape(64, 64)
    path = tmp_path / "a.tif"
    for nothing in (low, 0, int(values[17, 5]), high):
        path.write_bytes(files.geotiff(values, nothing=f"{nothing}\0".encode()))
        found = run_to_end(_raster(path)).values
        np.testing.assert_array_equal(found, np.where(values == nothing, np.nan, values.astype(np.float64)))
    values[3, 3] = limits.min
    path.write_bytes(files.geotiff(values, nothing=f"{limits.min}\0".encode()))
    assert np.isnan(run_to_end(_raster(path)).values[3, 3])


@pytest.mark.parametrize("ending", [".asc", ".tif", ".png"])
def test_a_missing_raster_is_told(tmp_path, ending):
    with pytest.raises(SceneError, match="No such file or directory"):
        run_to_end(_raster(tmp_path / f"a{ending}"))


def test_pixels_of_png_and_ascii_grids(tmp_path):
    """The same heights, to the centimeter, from both; a factor and a shift make meters of other values."""
    values = np.rint(files.hills(6) * 100.0).astype(np.uint16)
    path = tmp_path / "a.png"
    path.write_bytes(files.png(values))
    path.with_suffix(".pgw").write_bytes(files.WORLD)
    image = run_to_end(_raster(path, epsg=25832, scale=0.01, offset=-5.0))
    grid = tmp_path / "a.asc"
    grid.write_text(files.ascii_grid(values / 100.0 - 5.0, 5.0, 499_997.5, 5_315_972.5))
    text = run_to_end(_raster(grid, epsg=25832))
    np.testing.assert_allclose(image.values, text.values, atol=1e-3)
    np.testing.assert_allclose(image.outline, text.outline)
    path.with_suffix(".pgw").unlink()
    with pytest.raises(SceneError, match="nothing tells where it lies, neither tags nor a world file"):
        run_to_end(_raster(path))


def test_terrain_trees_and_outlines_align(tmp_path):
    values = files.hills()
    path = tmp_path / "dem.tif"
    path.write_bytes(files.geotiff(values, 5.0))
    ground = _call("import_terrain", path)
    mesh = ground.data
    assert (len(mesh.vertices), len(mesh.polygons)) == (values.size, 23 * 23)
    assert all(p.normal.z > 0.5 and p.use_smooth for p in mesh.polygons)
    assert ground.tetflora.is_occluder
    assert mesh.materials[0] is not None
    uv = read(mesh, mesh.uv_layers[0].name)
    assert (uv.min(), uv.max()) == (0.0, 1.0)
    assert not mesh.validate()
    place = origin_of(bpy.context.scene)
    assert place.system.epsg == files.CODE
    found = _vertices(ground)
    # The first row is the northernmost, and heights are those of the file.
    first = found[np.lexsort((found[:, 0], -found[:, 1]))]
    np.testing.assert_allclose(first[:, 2], values.ravel(), atol=1e-3)
    np.testing.assert_allclose(first[0, :2] + [place.east, place.north], [files.EAST + 2.5, files.NORTH - 2.5])
    # Trees by longitude and latitude stand on it, where the raster says.
    spots = np.array([[files.EAST + 30.0, files.NORTH - 40.0], [files.EAST + 81.0, files.NORTH - 77.0]])
    degrees = to_degrees(System(files.CODE), spots)
    table = tmp_path / "trees.csv"
    rows = "".join(f"Quercus robur,{12 + n},{x:.9f},{y:.9f}\n" for n, (x, y) in enumerate(degrees))
    table.write_text("species,height,lon,lat\n" + rows)
    select()
    field = _call("import_inventory", table)
    found = _vertices(field)
    np.testing.assert_allclose(found[:, :2], spots - [place.east, place.north], atol=2e-3)
    column, row = (spots[:, 0] - files.EAST) / 5.0 - 0.5, (files.NORTH - spots[:, 1]) / 5.0 - 0.5
    raster = run_to_end(_raster(path))
    np.testing.assert_allclose(found[:, 2], raster.at(column, row), atol=0.1)
    # Outlines too; a road is a path of its width, a wood with a hole one closed curve.
    ring = [[0.0, 0.0], [50.0, 0.0], [50.0, 50.0], [0.0, 50.0]]
    wood, hole, line = (
        to_degrees(System(files.CODE), np.array(points) + [files.EAST + 30.0, files.NORTH - 90.0]).tolist()
        for points in (ring, [[20.0, 20.0], [30.0, 20.0], [30.0, 30.0]], [[0.0, 10.0], [60.0, 10.0]])
    )
    features = (
        files.feature("Polygon", [wood, hole], landuse="forest"),
        files.feature("LineString", line, highway="track"),
        files.feature("Polygon", [hole], building="yes"),
    )
    path = tmp_path / "map.geojson"
    path.write_text(files.collection(*features))
    _call("import_outlines", path)
    woods, roads = bpy.data.collections["Woods"], bpy.data.collections["Roads"]
    assert [o.dimensions.z > 6.0 for o in bpy.data.collections["Buildings"].objects] == [True]
    (road,) = _lines_of(roads.objects[0], depsgraph())
    assert road.half_width == pytest.approx(1.5)
    assert np.ptp(road.points[:, 0]) == pytest.approx(60.0, abs=0.01)
    ground_in = read_ground([ground], depsgraph(), areas=woods, paths=roads)
    (area,) = ground_in.areas
    low = np.array([30.0, -90.0]) + [files.EAST - place.east, files.NORTH - place.north]
    np.testing.assert_allclose([area.min(axis=0), area.max(axis=0)], [low, low + 50.0], atol=2e-3)
    assert ground_in.paths[0].half_width == pytest.approx(1.5)


def test_terrain_is_made_coarser_and_has_holes(tmp_path):
    values = files.hills(40)
    values[:10, :10] = np.nan
    path = tmp_path / "a.asc"
    path.write_text(files.ascii_grid(values))
    ground = _call("import_terrain", path, max_faces=400)
    assert 300 < len(ground.data.polygons) < 400
    assert bpy.context.scene[KEY]["epsg"] == 0
    other = _call("import_terrain", path, new_origin=True, max_faces=100)
    assert len(other.data.polygons) < len(ground.data.polygons)


def test_an_inventory_becomes_a_field_of_recorded_sizes(tmp_path):
    operator, path = files.write(tmp_path, "csv")
    field = _call(operator, path)
    kinds = [entry.species for entry in field.tetflora.field_species]
    species = [kinds[n] for n in read(field.data, "species")]
    assert species == ["oak", "linden", "broadleaf_tree", "spruce"]
    heights = read(field.data, "tf_height")
    assert heights[[0, 1, 3]].tolist() == [14.5, 9.0, 22.0]
    # The height of the third follows from its trunk.
    curves = curves_of(species_for(None, "broadleaf_tree"))
    assert np.interp(0.88 / np.pi, curves.diameter, curves.height) == pytest.approx(heights[2], rel=0.02)
    assert read(field.data, "tf_crown_width").tolist() == [11.0, 6.0, 0.0, 5.5]
    assert read(field.data, "tf_diameter") == pytest.approx(np.array([2.1, 0.0, 0.88, 1.3]) / np.pi)
    assert len(set(read(field.data, "seed").tolist())) == 4
    assert np.ptp(_vertices(field)[:, :2], axis=0) == pytest.approx([19.5, 8.0], abs=1e-3)
    _call(operator, path, unknown='SPECIES', species="fern")
    _call(operator, path, unknown='LEAVE_OUT')
    assert len(bpy.context.view_layer.objects.active.data.vertices) == 3


def test_what_is_unknown_or_of_kin_is_told(tmp_path, capfd):
    operator, path = files.write(tmp_path, "csv", files.INVENTORY.replace("Tilia cordata", "Ulmus glabra").encode())
    _call(operator, path)
    told = capfd.readouterr().out
    assert "4 trees imported; 1 of unknown species: Foo bar (1)" in told
    assert "1 stand as their nearest kin: Ulmus glabra" in told


def test_what_is_no_tree_is_told(tmp_path, capfd):
    path = tmp_path / "a.csv"
    path.write_text("species,x,y\nTilia cordata,0,0\nvacant,5,5\nStump,9,9\nAcer rubrum,12,0\n")
    field = _call("import_inventory", path)
    assert len(field.data.vertices) == 2
    told = capfd.readouterr().out
    assert "2 trees imported; rows without a tree left out: stump (1), vacant (1)" in told
    assert "unknown" not in told


def test_thin_trunks_are_trees_above_breast_height():
    """It is where their diameter is measured."""
    _call("import_inventory", inventories.FOLDER / "inv25_thin_trunks.csv")
    heights = read(bpy.context.view_layer.objects.active.data, "tf_height")
    assert heights.min() > 1.3
    assert heights.max() < 6.0


def test_trees_beside_the_ground_are_told(tmp_path, capfd):
    ground = tmp_path / "a.asc"
    ground.write_text(files.ascii_grid(files.hills(20), 5.0))
    _call("import_terrain", ground)
    path = tmp_path / "a.csv"
    path.write_text(
        f"species,x,y\noak,{files.EAST + 50},{files.NORTH + 50}\noak,{files.EAST + 50},{files.NORTH + 500}\n"
    )
    field = _call("import_inventory", path)
    assert "1 stand beside the ground" in capfd.readouterr().out
    assert (_vertices(field)[:, 2] > 300.0).all()


def test_far_rows_are_named_before_any_import():
    path = inventories.FOLDER / "inv06_two_far_rows.csv"
    with pytest.raises(RuntimeError, match=r"line 12.*line 13") as caught:
        _call("import_inventory", path)
    assert "imported before" not in str(caught.value)
    assert len(_call("import_inventory", path, skip=True).data.vertices) == 10


def test_large_areas_are_cropped(tmp_path, capfd):
    path = tmp_path / "a.csv"
    rows = [(9.0 + 0.5 * n, 48.0) for n in range(15)] + [(12.5001, 48.0001)]
    path.write_text("species,lon,lat\n" + "".join(f"oak,{x},{y}\n" for x, y in rows))
    with pytest.raises(RuntimeError, match=r"it is 52\d by \d km large; choose a Crop"):
        _call("import_inventory", path)
    with pytest.raises(RuntimeError, match="nothing was imported yet"):
        _call("import_inventory", path, crop='EXISTING')
    assert len(_call("import_inventory", path, crop='MIDDLE', crop_size=1000.0).data.vertices) == 2
    assert "14 beyond the Crop" in capfd.readouterr().out
    # What the scene has is now a box of some meters about two trees.
    assert len(_call("import_inventory", path, crop='EXISTING').data.vertices) == 2


def test_rasters_and_outlines_are_cropped(tmp_path, capfd):
    path = tmp_path / "a.tif"
    values = files.hills(40)
    path.write_bytes(files.geotiff(values, 5.0))
    ground = _call("import_terrain", path, crop='MIDDLE', crop_size=50.0)
    assert len(ground.data.vertices) == 12 * 12  # cells that the box touches
    np.testing.assert_allclose(np.unique(_vertices(ground)[:, 2]), np.unique(values[14:26, 14:26]), atol=1e-4)
    whole = _call("import_terrain", path, crop='EXISTING')
    assert len(whole.data.vertices) in range(12 * 12, 14 * 14 + 1)
    squares = tmp_path / "a.geojson"
    corner = np.array([origin_of(bpy.context.scene).east, origin_of(bpy.context.scene).north])
    rings = [np.array([[0, 0], [9, 0], [9, 9], [0, 0]], float) + off for off in (corner, corner + 900.0)]
    features = [files.feature("Polygon", [to_degrees(System(25832), ring).tolist()], building="yes") for ring in rings]
    squares.write_text(files.collection(*features))
    _call("import_outlines", squares, crop='EXISTING')
    assert len(bpy.data.collections["Buildings"].objects) == 1
    assert "1 beyond the Crop" in capfd.readouterr().out
    path.write_bytes(files.geotiff(values, 5.0, west=files.EAST + 5000.0))
    for operator, file in (("import_terrain", path), ("import_canopy", path)):
        with pytest.raises(RuntimeError, match="nothing of it lies within the Crop"):
            _call(operator, file, crop='EXISTING')


def test_a_mapping_from_scripts_and_from_the_dialog(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("species,top,x,y\nTilia cordata,30,0,0\nAcer rubrum,40,5,5\n")
    field = _call("import_inventory", path, columns='{"top": "height ft"}')
    assert read(field.data, "tf_height") == pytest.approx([9.144, 12.192])
    for broken in ("{", "[]", '{"top": 1}', '{"none": "height"}'):
        with pytest.raises(RuntimeError, match="Columns"):
            _call("import_inventory", path, columns=broken)


def test_the_dialog_shows_what_columns_were_taken_for(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Art;top;x;y\nTilia cordata;30;0;0\nAcer rubrum;40;5;5\n")

    class Rows(list):
        def add(self):
            self.append(SimpleNamespace(unit='AUTO'))
            return self[-1]

    dialog = SimpleNamespace(table=Rows())
    trees.show_columns(dialog.table, path)
    assert [(row.name, row.field, row.values) for row in dialog.table] == [
        ("Art", 'NAME', "Tilia cordata, Acer rubrum"),
        ("top", 'NONE', "30, 40"),
        ("x", 'X', "0, 5"),
        ("y", 'Y', "0, 5"),
    ]
    dialog.table[1].field, dialog.table[1].unit = 'HEIGHT', 'ft'
    assert json.loads(trees.chosen_columns(dialog.table)) == {"Art": "name", "top": "height ft", "x": "x", "y": "y"}


def test_canopy_heights_become_trees(tmp_path):
    operator, path = files.write(tmp_path, "big_tiff")
    field = _call(operator, path, species="beech:1, spruce:2")
    assert read(field.data, "tf_height").tolist() == pytest.approx(
        [14.0 + (i + j) % 5 for j in (4, 12, 20) for i in (4, 12, 20)]
    )
    assert read(field.data, "tf_crown_width").min() > 5.0
    assert [entry.species for entry in field.tetflora.field_species] == ["beech", "spruce"]
    place, found = origin_of(bpy.context.scene), _vertices(field)
    np.testing.assert_allclose(
        found[0, :2] + [place.east, place.north], [files.EAST + 4.5, files.NORTH - 4.5], atol=1e-3
    )


@pytest.mark.parametrize("kind", files.FILES)
def test_broken_files_leave_everything_as_it_was(tmp_path, kind):
    before = everything()
    for seed in range(6):
        operator, path = files.write(tmp_path, kind, files.mutated(random.Random(seed), files.FILES[kind][2]))
        try:
            getattr(bpy.ops.tetflora, operator)(filepath=str(path))
        except RuntimeError as error:
            assert path.stem in str(error)
            assert difference(before, everything()) == []
        else:
            session.clean_file()
            before = everything()


@pytest.mark.parametrize("kind", ["grid", "csv", "outlines"])
def test_closing_the_steps_leaves_everything_as_it_was(tmp_path, kind):
    scene, path = bpy.context.scene, files.write(tmp_path, kind)[1]
    before = everything()
    for number in (1, 2, 4, 6):
        steps = {
            "grid": lambda: terrain.terrain_steps(Import(scene, depsgraph(), path), 1000),
            "csv": lambda: trees.inventory_steps(Import(scene, depsgraph(), path), "GENERIC", "METRIC", False),
            "outlines": lambda: terrain.outline_steps(Import(scene, depsgraph(), path)),
        }[kind]()
        for _ in range(number):
            if next(steps, None) is None:
                break
        else:
            steps.close()
            assert difference(before, everything()) == []


@pytest.mark.parametrize("kind", ["csv", "big_tiff", "outlines"])
def test_imports_stop_when_their_view_layer_goes(tmp_path, kind):
    """Its dependency graph goes with it."""
    scene, path = bpy.context.scene, files.write(tmp_path, kind)[1]
    graph = depsgraph()
    scene.view_layers.new("Other")
    steps = {
        "csv": lambda: trees.inventory_steps(Import(scene, graph, path), "GENERIC", "METRIC", False),
        "big_tiff": lambda: trees.canopy_steps(Import(scene, graph, path), {"beech": 1.0}, 3.0),
        "outlines": lambda: terrain.outline_steps(Import(scene, graph, path)),
    }[kind]()
    next(steps)
    scene.view_layers.remove(scene.view_layers["ViewLayer"])
    with pytest.raises(GoneError, match='the view layer "ViewLayer"'):
        run_to_end(steps)


def test_a_refusal_after_the_file_browser_is_a_report(monkeypatch):
    """The window's call is one from Python, for which Blender turns reports of errors into exceptions."""

    def again(*_, **__):
        raise RuntimeError("Error: a.tif: it is broken\n")

    ops = SimpleNamespace(tetflora=SimpleNamespace(import_terrain=again))
    monkeypatch.setattr(base, "bpy", SimpleNamespace(app=SimpleNamespace(background=False), ops=ops))

    class Browsing:
        bl_idname = places.TETFLORA_OT_import_terrain.bl_idname
        _browsing = True
        reports = ()
        failed = places.TETFLORA_OT_import_terrain.failed

        def as_keywords(self):
            return {"filepath": "a.tif"}

        def report(self, kind, text):
            self.reports += ((kind, text),)

    operator = Browsing()
    assert places.TETFLORA_OT_import_terrain.execute(operator, None) == {'CANCELLED'}
    assert operator.reports == (({'ERROR'}, "a.tif: it is broken"),)


def test_places_on_a_path_that_is_not_plain(tmp_path):
    folder = tmp_path / "Straße 漢字"
    folder.mkdir()
    operator, path = files.write(tmp_path, "grid")
    _call(operator, shutil.copy(path, folder / "Gelände.asc"))
    assert bpy.context.view_layer.objects.active.name == "Gelände"


def test_a_stored_place_that_is_none_is_told(tmp_path):
    bpy.context.scene[KEY] = {"epsg": "x"}
    operator, path = files.write(tmp_path, "grid")
    with pytest.raises(RuntimeError, match="is no place; remove it"):
        _call(operator, path)
    _call(operator, path, new_origin=True)
