# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Terrain of tiles and with an orthophoto, canopies of two rasters and without roofs, outlines of one kind."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from devtools import session
from tests import places_files as files
from tests.blender.digests import difference, everything
from tetflora_addon.blender.attributes import read
from tetflora_addon.blender.geodata.origin import origin_of
from tetflora_addon.geodata.projection import System, to_degrees

pytestmark = pytest.mark.usefixtures("clean_file")


def _call(operator, path, **options):
    assert getattr(bpy.ops.tetflora, operator)(filepath=str(path), **options) == {'FINISHED'}
    return bpy.context.view_layer.objects.active


def test_several_tiles_are_one_ground(tmp_path, capfd):
    values = files.hills(20)
    for name, part, west in (("a.tif", values[:, :12], 0.0), ("b.tif", values[:, 10:], 50.0)):
        (tmp_path / name).write_bytes(files.geotiff(np.ascontiguousarray(part), 5.0, west=files.EAST + west))
    ground = _call(
        "import_terrain", tmp_path / "a.tif", directory=str(tmp_path), files=[{"name": "a.tif"}, {"name": "b.tif"}]
    )
    assert len(ground.data.vertices) == values.size
    assert ground.dimensions.x == pytest.approx(95.0)
    assert "coordinates: EPSG:25832" in capfd.readouterr().out


def test_an_orthophoto_is_the_color_of_the_ground(tmp_path):
    """Each place has the color of the pixel that lies there, in another system and at other resolution."""
    path = tmp_path / "dem.tif"
    path.write_bytes(files.geotiff(files.hills(20), 5.0))
    photo = tmp_path / "photo.png"
    image = bpy.data.images.new("x", 40, 30)
    image.file_format = 'PNG'
    image.save(filepath=str(photo))
    bpy.data.images.remove(image)
    corner = np.array([files.EAST - 50.0, files.NORTH + 50.0])
    photo.with_suffix(".pgw").write_text(f"5\n0\n0\n-10\n{corner[0]}\n{corner[1]}\n")
    ground = _call("import_terrain", path, image=str(photo))
    place = origin_of(bpy.context.scene)
    world = read(ground.data, "position") + np.array(ground.location)
    uv = np.zeros((len(world), 2))
    corners = np.array([loop.vertex_index for loop in ground.data.loops])
    uv[corners] = read(ground.data, ground.data.uv_layers[0].name)
    pixel = (world[:, :2] + [place.east, place.north] - corner) / [5.0, -10.0] + 0.5
    np.testing.assert_allclose(uv, np.stack([pixel[:, 0] / 40.0, 1.0 - pixel[:, 1] / 30.0], axis=1), atol=1e-3)
    (material,) = ground.data.materials
    (texture,) = (node for node in material.node_tree.nodes if node.type == 'TEX_IMAGE')
    assert bpy.path.abspath(texture.image.filepath) == str(photo)
    # One that lies elsewhere leaves nothing behind.
    photo.with_suffix(".pgw").write_text(f"5\n0\n0\n-10\n{corner[0] + 9000.0}\n{corner[1]}\n")
    before = everything()
    with pytest.raises(RuntimeError, match=r"photo\.png: the image lies elsewhere"):
        _call("import_terrain", path, image=str(photo))
    photo.write_bytes(b"no image")
    with pytest.raises(RuntimeError, match=r"photo\.png: Blender cannot read this image"):
        _call("import_terrain", path, image=str(photo))
    assert difference(before, everything()) == []


def test_a_surface_and_its_ground_become_trees(tmp_path, capfd):
    ground, surface = tmp_path / "ground.tif", tmp_path / "surface.tif"
    ground.write_bytes(files.geotiff(files.hills()))
    surface.write_bytes(files.geotiff(files.hills() + files.crowns()))
    with pytest.raises(RuntimeError, match=r"surface\.tif: its values are .* elevations above the sea.*Ground Below"):
        _call("import_canopy", surface, species="beech")
    field = _call("import_canopy", surface, species="beech", below=str(ground))
    expected = [14.0 + (i + j) % 5 for j in (4, 12, 20) for i in (4, 12, 20)]
    assert read(field.data, "tf_height") == pytest.approx(expected, abs=0.01)
    assert "coordinates: EPSG:25832" in capfd.readouterr().out


def test_roofs_are_no_crowns(tmp_path, capfd):
    """What lies within outlines of buildings is no tree."""
    heights = files.crowns()
    path, outline = tmp_path / "canopy.tif", tmp_path / "map.geojson"
    path.write_bytes(files.geotiff(heights))
    assert len(_call("import_canopy", path, species="beech").data.vertices) == 9
    # About the first crown, which is 4.5 m from the corner.
    ring = np.array([[0, 0], [8, 0], [8, -8], [0, -8], [0, 0]]) + [files.EAST, files.NORTH]
    feature = files.feature("Polygon", [to_degrees(System(files.CODE), ring).tolist()], NAME="x")
    outline.write_text(files.collection(feature))
    session.clean_file()
    _call("import_outlines", outline, kind='BUILDINGS')
    assert len(bpy.data.collections["Buildings"].objects) == 1
    field = _call("import_canopy", path, species="beech")
    assert len(field.data.vertices) == 8
    assert "cells on buildings left out" in capfd.readouterr().out


def test_plain_meters(tmp_path):
    path = tmp_path / "a.tif"
    path.write_bytes(files.geotiff(files.hills(), epsg=5514))
    with pytest.raises(RuntimeError, match=r"a\.tif: EPSG:5514 is none.*Plain Meters"):
        _call("import_terrain", path)
    ground = _call("import_terrain", path, plain=True)
    assert ground.dimensions.x == pytest.approx(23.0)
    assert origin_of(bpy.context.scene).system.epsg == 0


@pytest.mark.parametrize("epsg", [2056, 3006, 2263, 5070])
def test_scenes_of_national_systems(tmp_path, epsg):
    """Ground in a national system and trees by longitude and latitude meet, and meters are meters."""
    path = tmp_path / "a.tif"
    unit = System(epsg).definition.unit
    west, north = {2056: (2.6e6, 1.2e6), 3006: (6e5, 6.6e6), 2263: (1e6, 2e5), 5070: (5e5, 1.6e6)}[epsg]
    path.write_bytes(files.geotiff(files.hills(), 2.0 / unit, west=west, north=north, epsg=epsg))
    ground = _call("import_terrain", path)
    cells = (read(ground.data, "position") + np.array(ground.location))[:, :2].reshape(24, 24, 2)
    assert np.linalg.norm(cells[0, -1] - cells[0, 0]) == pytest.approx(46.0, rel=0.01 if epsg == 5070 else 1e-3)
    lon, lat = to_degrees(System(epsg), np.array([[west + 20.0 / unit, north - 20.0 / unit]]))[0]
    table = tmp_path / "trees.csv"
    table.write_text(f"species,height,lon,lat\nQuercus robur,12,{lon:.9f},{lat:.9f}\n")
    field = _call("import_inventory", table)
    tree = read(field.data, "position")[0] + np.array(field.location)
    assert tree[:2] == pytest.approx(cells[9:11, 9:11].mean(axis=(0, 1)), abs=0.01)


def test_plain_feet_become_meters(tmp_path):
    """Of a file by itself, and beside others on a map of meters; a map of degrees cannot tell where they are."""
    path = tmp_path / "a.asc"
    path.write_text(files.ascii_grid(files.hills(20), 10.0))
    path.with_suffix(".prj").write_text('PROJCS["x",GEOGCS["y",DATUM["z"]],PROJECTION["odd"],UNIT["Foot",0.3048]]')
    assert _call("import_terrain", path).dimensions.x == pytest.approx(19 * 3.048, abs=1e-3)
    bpy.context.scene["tetflora_place"] = dict(bpy.context.scene["tetflora_place"]) | {"epsg": 25832}
    ground = _call("import_terrain", path, crop='EXISTING')
    assert ground.dimensions.x == pytest.approx(19 * 3.048, abs=1e-3)
    place = origin_of(bpy.context.scene)
    assert ground.location.x + place.east == pytest.approx(0.3048 * (files.EAST + 100.0), abs=1.0)
    bpy.context.scene["tetflora_place"] = dict(bpy.context.scene["tetflora_place"]) | {"epsg": -1}
    for crop in ('EXISTING', 'WHOLE'):
        with pytest.raises(RuntimeError, match="coordinate system of the file is not known"):
            _call("import_terrain", path, crop=crop)
