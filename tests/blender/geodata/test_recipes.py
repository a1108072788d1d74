# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's recipes for real places, step by step, on made-up files of the form that others write."""

from __future__ import annotations

import json
import re

import bpy
import numpy as np
import pytest

from devtools import build
from tests import places_files as files
from tetflora_addon.blender.attributes import read
from tetflora_addon.blender.geodata.origin import origin_of
from tetflora_addon.geodata.inventories import preview
from tetflora_addon.geodata.projection import System, to_degrees

pytestmark = pytest.mark.usefixtures("clean_file")
TUTORIALS = (build.ROOT / "docs" / "manual" / "tutorials.md").read_text(encoding="utf-8")


def _recipe(title):
    """The steps of a recipe as one line each."""
    text = re.split(r"\n##+ ", TUTORIALS.split(f"### {title}\n")[1])[0]
    return [" ".join(step.split()) for step in re.split(r"\n\d\. ", text)[1:]]


def _call(operator, path, **options):
    """Use an operator whose settings are called as the recipe has them."""
    assert getattr(bpy.ops.tetflora, operator)(filepath=str(path), **options) == {'FINISHED'}
    return bpy.context.view_layer.objects.active


def _labels(step, operator, *settings):
    kind = getattr(bpy.ops.tetflora, operator).get_rna_type()
    for name in settings:
        assert f"**{kind.properties[name].name}**" in step
    assert kind.name in step


def test_my_citys_trees(tmp_path, monkeypatch, capfd):
    """A register as cities of Germany write it: words of the office, places as well-known text, vacant sites."""
    steps = _recipe("My City's Trees")
    columns = "baumid;gattung_art;art_dtsch;pflanzjahr;kronendm;stammumfang_cm;baumhoehe;strasse;geom"
    rows = [
        f"{n};Tilia cordata 'Greenspire';Winter-Linde;19{60 + n};7;110;12,5;Weg;POINT (11.5{n:02d} 48.1)"
        for n in range(20)
    ]
    rows += ["20;;freier Standort;;;;;Weg;POINT (11.501 48.1)", "21;Quercus robur;Stiel-Eiche;;;;;Weg;POINT (0 0)"]
    path = tmp_path / "trees.csv"
    path.write_text("\n".join([columns, *rows]) + "\n", encoding="latin-1")
    _labels(steps[1], "import_inventory")
    _labels(steps[2] + "Import Tree Inventory", "import_inventory", "units", "epsg", "crop", "crop_size")
    taken = {column.title: column.field for column in preview(path)}
    assert taken["gattung_art"] == "name" and taken["kronendm"] == "crown_width" and taken["geom"] == "place"
    with pytest.raises(RuntimeError, match=r"line 23.*0, 0 is .* Skip Broken Rows"):
        _call("import_inventory", path)
    _labels(steps[3] + "Import Tree Inventory", "import_inventory", "skip")
    field = _call("import_inventory", path, skip=True, crop='MIDDLE', crop_size=500.0)
    told = capfd.readouterr().out
    assert "left out: vacant (1)" in told and "beyond the Crop" in told and "coordinates: EPSG:4326" in told
    assert read(field.data, "tf_height") == pytest.approx(12.5) and len(field.data.vertices) < 20
    assert "**Refine**" in steps[4]
    # The script below the steps, word by word, on a table with its column.
    path.write_text("species,H,lon,lat\noak,40,11.51,48.1\nelm,about 3 or 4,11.51,48.1\n")
    monkeypatch.chdir(tmp_path)
    exec(re.search(r"`(bpy\.ops\.tetflora\.import_inventory\([^`]*)`", steps[4])[1])
    assert read(bpy.context.view_layer.objects.active.data, "tf_height") == pytest.approx([12.192])


def test_a_laser_canopy(tmp_path):
    """Lists of places as survey offices of Germany write them, buildings of a shapefile."""
    steps = _recipe("A Laser Canopy")
    bumps = files.crowns()[::-1]
    for name, values in (("dgm1.xyz", 0.0 * bumps + 410.0), ("dom1.xyz", 410.0 + bumps)):
        (tmp_path / name).write_text(files.xyz(values))
    _labels(steps[1], "import_terrain")
    _call("import_terrain", tmp_path / "dgm1.xyz", epsg=25832)
    building = [[files.EAST + x, files.NORTH + y] for x, y in ((0, 15), (0, 23), (8, 23), (8, 15), (0, 15))]
    path = tmp_path / "hausumringe.shp"
    path.write_bytes(files.shapefile([building]))
    path.with_suffix(".prj").write_text("EPSG:25832")
    assert "Map Outlines" in steps[2]
    _call("import_outlines", path)
    assert len(bpy.data.collections["Buildings"].objects) == 1
    _labels(steps[3], "import_canopy", "below", "species")
    _labels(steps[4] + "Import Canopy Height", "import_canopy", "epsg")
    field = _call(
        "import_canopy", tmp_path / "dom1.xyz", below=str(tmp_path / "dgm1.xyz"), species="beech:3, spruce", epsg=25832
    )
    assert len(field.data.vertices) == 8
    assert np.allclose(read(field.data, "position")[:, 2] + field.location.z, 410.0, atol=0.01)


def test_an_area_of_openstreetmap(tmp_path):
    """What overpass turbo exports: tags as properties, an address as id, the time of the data."""
    steps = _recipe("An OpenStreetMap Area")
    ring = np.array([[0, 0], [60, 0], [60, 50], [0, 50], [0, 0]], float) + [files.EAST, files.NORTH]
    places = to_degrees(System(25832), ring).tolist()
    features = [
        files.feature("Polygon", [places], **{"@id": "way/1", "landuse": "forest"}),
        files.feature("LineString", places[:2], **{"@id": "way/2", "highway": "residential", "name": "Weg"}),
        files.feature("Point", places[0], **{"@id": "node/3", "natural": "tree"}),
        files.feature("Polygon", [places], **{"@id": "way/4", "building": "yes", "building:levels": "2"}),
    ]
    for number, feature in enumerate(features):
        feature["id"] = f"way/{number}"
    data = {"type": "FeatureCollection", "generator": "overpass-turbo", "timestamp": "2026-01-01T00:00:00Z"}
    path = tmp_path / "export.geojson"
    path.write_text(json.dumps({**data, "features": features}, indent=2))
    assert path.name in steps[2]
    bpy.ops.mesh.primitive_plane_add(size=400.0)
    ground = bpy.context.view_layer.objects.active
    _labels(steps[2], "import_outlines")
    _call("import_outlines", path)
    settings = bpy.context.scene.tetflora.populate
    for kind, setting in (("Woods", "areas"), ("Roads", "paths")):
        assert f"*{kind}* as **{settings.bl_rna.properties[setting].name}**" in steps[3]
        setattr(settings, setting, bpy.data.collections[kind])
    bpy.context.view_layer.objects.active = ground
    ground.select_set(True)
    assert bpy.ops.tetflora.populate.get_rna_type().name in steps[3]
    assert bpy.ops.tetflora.populate() == {'FINISHED'}


def test_a_digital_elevation_model(tmp_path, capfd):
    """A part of a tile of degrees, whole numbers of 16 bits with their corner at a point, as GDAL cuts it."""
    steps = _recipe("A Digital Elevation Model")
    step = 1.0 / 3600.0
    values = np.rint(files.hills(40)).astype(np.int16)
    assert "part.tif" in steps[2]
    path = tmp_path / "part.tif"
    path.write_bytes(files.geotiff(values, step, west=9.1, north=48.4, epsg=4326, nothing=b"-32768\0"))
    _labels(steps[2], "import_terrain", "image")
    ground = _call("import_terrain", path)
    told = capfd.readouterr().out
    assert "coordinates: EPSG:4326" in told
    assert re.search(r"one every (2\d|3\d)\.\d\d m", told)
    assert ground.dimensions.x == pytest.approx(39 * step * 111_320.0 * np.cos(np.radians(48.4)), rel=0.01)
    place = origin_of(bpy.context.scene)
    assert (place.system.longitude, place.system.latitude) == pytest.approx(
        (9.1 + 20 * step, 48.4 - 20 * step), abs=1e-4
    )
    (tmp_path / "N48E009.hgt").write_bytes(np.rint(files.hills(31)).astype(">i2").tobytes())
    _call("import_terrain", tmp_path / "N48E009.hgt", new_origin=True)
