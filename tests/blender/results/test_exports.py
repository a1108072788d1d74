# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What Refine made goes through Blender's own exporters, and its importers bring back the same faces in the same place.

Formats differ in what they hold. All four hold faces, UV maps and places; USD, OBJ and glTF the names of materials; USD
attributes, so the color of each leaf. glTF holds triangles, and a vertex for each normal that meets in it. Points,
which microspheres are made of, come back from USD alone, and only where Blender lets add-ons fill point clouds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import addon_utils
import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_plant, depsgraph
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import refine

FORMATS = ("usdc", "abc", "obj", "glb")
FORMS = ('MICROSURFACES', 'SHELLS')
#: Formats that a collection is exported in by its name, and what an exporter's option for the selection is called.
COLLECTIONS = ("usdc", "obj", "glb")
SELECTIONS = {
    "usdc": "selected_objects_only",
    "abc": "selected",
    "obj": "export_selected_objects",
    "glb": "use_selection",
}


@dataclass
class Surface:
    """One mesh in world space, as far as any format can tell it."""

    faces: int
    triangles: int
    vertices: int
    area: float
    low: np.ndarray
    high: np.ndarray
    materials: list[str]
    uv: np.ndarray | None
    attributes: dict[str, np.ndarray]


def ready(blender_format: str) -> None:
    """Enable what is an add-on among the exporters."""
    if blender_format == "glb":
        assert addon_utils.enable("io_scene_gltf2") is not None


def is_absent(suffix: str) -> bool:
    """Whether this Blender is built without the library of a format; then it has no exporter for it either."""
    libraries = {"usdc": bpy.app.build_options.usd, "abc": bpy.app.build_options.alembic}
    if libraries.get(suffix, True):
        return False
    names = {"usdc": "usd_export", "abc": "alembic_export"}
    with pytest.raises(AttributeError):
        getattr(bpy.ops.wm, names[suffix])()
    return True


def export(path: Path, **options: object) -> None:
    ready(path.suffix[1:])
    call: Callable = {
        ".usdc": bpy.ops.wm.usd_export,
        ".abc": bpy.ops.wm.alembic_export,
        ".obj": bpy.ops.wm.obj_export,
        ".glb": bpy.ops.export_scene.gltf,
    }[path.suffix]
    assert call(filepath=str(path), **options) == {'FINISHED'}


def read_back(path: Path) -> None:
    """Import into an empty file."""
    session.clean_file()
    ready(path.suffix[1:])
    call: Callable = {
        ".usdc": bpy.ops.wm.usd_import,
        ".abc": bpy.ops.wm.alembic_import,
        ".obj": bpy.ops.wm.obj_import,
        ".glb": bpy.ops.import_scene.gltf,
    }[path.suffix]
    assert call(filepath=str(path)) == {'FINISHED'}
    bpy.context.view_layer.update()


def refined(form: str):
    """Two plants of different species before a small camera, refined: real leaves, bark and proxies."""
    session.clean_file()
    scene = bpy.context.scene
    add_camera(location=(0.0, -14.0, 3.0), rotation=(1.4, 0.0, 0.0))
    scene.render.resolution_x = scene.render.resolution_y = 48
    for n, species in enumerate(("bush", "conifer")):
        add_plant(species, species, seed=n, location=(3.0 * n - 1.5, 0.0, 0.0))
    scene.tetflora.proxy_kind, scene.tetflora.leaf_limit = form, 0.3
    refine.refine(scene, depsgraph())
    bpy.context.view_layer.update()
    return scene


def plain(name: str) -> str:
    """A name as every format spells it: some have underscores for spaces and brackets."""
    return "".join(c if c.isalnum() else "_" for c in name)


def surfaces() -> dict[str, Surface]:
    """All meshes with faces by name, in world space."""
    return {plain(o.name): measure(o) for o in bpy.context.scene.objects if o.type == 'MESH' and o.data.polygons}


def measure(obj) -> Surface:
    mesh = obj.data
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    matrix = np.array(obj.matrix_world)
    places = places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    mesh.calc_loop_triangles()
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    a, b, c = (places[corners.reshape(-1, 3)[:, i]] for i in range(3))
    uv = None
    if mesh.uv_layers:
        uv = np.empty(2 * len(mesh.loops), np.float32)
        mesh.uv_layers[0].uv.foreach_get("vector", uv)
        uv = uv.reshape(-1, 2)
    attributes = {}
    for layer in mesh.attributes:
        if layer.name.startswith("tf_"):
            width = 3 if layer.data_type == 'FLOAT_VECTOR' else 1
            values = np.empty(width * len(layer.data), np.float32)
            layer.data.foreach_get("vector" if width == 3 else "value", values)
            attributes[layer.name] = values
    return Surface(
        faces=len(mesh.polygons),
        triangles=len(mesh.loop_triangles),
        vertices=len(mesh.vertices),
        area=float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0),
        low=places.min(0),
        high=places.max(0),
        materials=[plain(m.name) for m in mesh.materials if m is not None],
        uv=uv,
        attributes=attributes,
    )


@dataclass
class Exported:
    """A refined scene that was written in each format.

    points : how many microspheres it has
    colors : of materials in the viewport, by their names
    """

    folder: Path
    surfaces: dict[str, Surface]
    parents: dict[str, str]
    points: int
    colors: dict[str, tuple[float, ...]]


@pytest.fixture(scope="module", params=FORMS)
def exported(blender, request, tmp_path_factory) -> Exported:
    """One result in each format, and what it was in Blender."""
    folder = tmp_path_factory.mktemp(request.param)
    refined(request.param)
    for suffix in FORMATS:
        if not is_absent(suffix):
            export(folder / f"forest.{suffix}")
    clouds = [o for o in bpy.context.scene.objects if o.get("tetflora_kind") == "proxy"]
    points = sum(len(o.data.points if o.type == 'POINTCLOUD' else o.data.vertices) for o in clouds)
    return Exported(folder, surfaces(), parents(), points, viewport_colors())


def viewport_colors() -> dict[str, tuple[float, ...]]:
    return {plain(m.name): tuple(m.diffuse_color)[:3] for m in bpy.data.materials}


@pytest.fixture(scope="module")
def alone(blender, tmp_path_factory) -> tuple[Path, dict[str, Surface]]:
    """A folder with results of a scene that has a mesh of the artist's as well, without it, and what they were.

    As the collection that they lie in, and as a selection once they are kept: before, none of them can be selected.
    """
    folder = tmp_path_factory.mktemp("alone")
    refined('MICROSURFACES')
    expected = surfaces()
    ground = bpy.data.objects.new("ground", bpy.data.meshes.new("ground"))
    ground.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    bpy.context.scene.collection.objects.link(ground)
    for suffix in COLLECTIONS:
        if not is_absent(suffix):
            export(folder / f"collection.{suffix}", collection="TetFlora")
    bpy.ops.object.select_all(action='SELECT')
    assert ground.select_get()
    assert not any(o.select_get() for o in bpy.data.collections["TetFlora"].objects)
    assert bpy.ops.tetflora.keep_results() == {'FINISHED'}
    bpy.ops.object.select_all(action='DESELECT')
    for obj in bpy.data.collections["TetFlora kept"].objects:
        obj.select_set(True)
    for suffix, option in SELECTIONS.items():
        if not is_absent(suffix):
            export(folder / f"selected.{suffix}", **{option: True})
    return folder, expected


def parents() -> dict[str, str]:
    return {plain(o.name): plain(o.parent.name) for o in bpy.context.scene.objects if o.parent is not None}


@pytest.mark.parametrize("suffix", FORMATS)
def test_what_was_refined_comes_back(exported, suffix):
    expected, families = exported.surfaces, exported.parents
    assert {name.split("_")[-2] for name in expected} == {"bark", "leaf", "proxies"}
    assert set(families.values()) == {"Bush__TetFlora_", "Conifer__TetFlora_"}
    if is_absent(suffix):
        return
    read_back(exported.folder / f"forest.{suffix}")
    found = surfaces()
    assert set(found) == set(expected)
    # OBJ knows no parents; USD has one more where materials are kept.
    back = parents()
    assert {name: back.get(name) for name in families} == (dict.fromkeys(families) if suffix == "obj" else families)
    for name, before in expected.items():
        after = found[name]
        assert after.triangles == before.triangles, name
        if suffix != "glb":
            assert (after.faces, after.vertices) == (before.faces, before.vertices), name
        assert after.area == pytest.approx(before.area, rel=1e-4), name
        np.testing.assert_allclose(after.low, before.low, atol=1e-4, err_msg=name)
        np.testing.assert_allclose(after.high, before.high, atol=1e-4, err_msg=name)
        if suffix != "abc":  # Alembic holds names of groups of faces, and Blender reads them only beside materials
            assert after.materials == before.materials, name
        assert (after.uv is None) == (before.uv is None), name
        if before.uv is not None:
            np.testing.assert_allclose(np.sort(after.uv, 0)[[0, -1]], np.sort(before.uv, 0)[[0, -1]], atol=1e-5)


@pytest.mark.parametrize("exported", ['MICROSURFACES'], indirect=True)
def test_usd_holds_the_color_of_each_leaf(exported):
    if is_absent("usdc"):
        return
    read_back(exported.folder / "forest.usdc")
    for name, after in surfaces().items():
        before = exported.surfaces[name].attributes
        assert {"tf_color", "tf_transmission"} <= set(before)
        for key, values in before.items():
            np.testing.assert_array_equal(after.attributes[key], values, err_msg=f"{name} {key}")


@pytest.mark.parametrize("exported", ['MICROSURFACES'], indirect=True)
def test_obj_holds_the_viewport_color_of_each_material(exported):
    read_back(exported.folder / "forest.obj")
    read = viewport_colors()
    assert read
    for name, color in read.items():
        assert color == pytest.approx(exported.colors[name], abs=1e-3), name


@pytest.mark.parametrize("exported", ['MICROSPHERES'], indirect=True)
@pytest.mark.parametrize("suffix", FORMATS)
def test_microspheres_come_back_from_usd_alone(exported, suffix):
    if is_absent(suffix):
        return
    assert exported.points > 100
    read_back(exported.folder / f"forest.{suffix}")
    read = [o for o in bpy.context.scene.objects if o.type in {'POINTCLOUD', 'MESH'} and "proxies" in o.name]
    found = sum(len(o.data.points if o.type == 'POINTCLOUD' else o.data.vertices) for o in read)
    by_usd = suffix == "usdc" and compat.can_resize_point_clouds()
    assert found == (exported.points if by_usd else 0)
    assert set(surfaces()) == set(exported.surfaces)  # the rest is there all the same
    if by_usd:
        assert all({"radius", "tf_color", "tf_transmission"} <= set(o.data.attributes.keys()) for o in read)


@pytest.mark.parametrize("suffix", FORMATS)
def test_results_are_exported_by_themselves(alone, suffix):
    """As a selection: nothing but results."""
    if is_absent(suffix):
        return
    folder, expected = alone
    read_back(folder / f"selected.{suffix}")
    assert set(surfaces()) == set(expected)


@pytest.mark.parametrize("suffix", COLLECTIONS)
def test_the_collection_is_exported_by_name(alone, suffix):
    """By the exporters of a collection's own panel, which nothing has to be selected for."""
    if is_absent(suffix):
        return
    folder, expected = alone
    read_back(folder / f"collection.{suffix}")
    assert set(surfaces()) == set(expected)
