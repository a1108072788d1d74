# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Far from the world's origin results are what they are near it: only their objects stand elsewhere."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, tiny_render
from tetflora_addon.blender.attributes import read, values_of, world_matrix
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results.output import KIND, PARENT
from tetflora_addon.blender.scene.fields import read_field, write_field
from tetflora_addon.blender.viewport.levels import level_steps, read_shapes
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.camera.camera import GRID

#: 1,000 km, where single precision has steps of 6 cm; places in the scene below are multiples of that.
FAR = np.array([977 * GRID, -488 * GRID, GRID])


@pytest.fixture
def scene() -> bpy.types.Scene:
    """A plant to become polygons, some to become proxies, a mesh of the artist's, ground and lights."""
    session.clean_file()
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 80, 60
    add_camera(location=(0.0, -8.0, 1.5))
    for n, place in enumerate([(0, 0, 0), (2.5, 9, 0), (-4, 22, 0), (6, 40, 0), (-9, 60, 0)]):
        add_plant(f"plant {n}", seed=n, location=place)
    rock = add_mesh("rock", size=0.5, z=1.0)
    rock.location, rock.tetflora.is_explicit = (-1.5, -3.0, 0.0), True
    ground = add_mesh("ground", size=64.0)
    ground.tetflora.is_occluder = True
    for kind, place in (('SUN', (0, 0, 0)), ('POINT', (3.0, -4.0, 5.0))):
        lamp = bpy.data.objects.new(kind, bpy.data.lights.new(kind, kind))
        lamp.data.energy, lamp.location, lamp.rotation_euler = 200.0 if kind == 'POINT' else 3.0, place, (0.5, 0.3, 0.0)
        scene.collection.objects.link(lamp)
    return scene


def _moved(scene: bpy.types.Scene, by: np.ndarray) -> None:
    for obj in scene.objects:
        obj.location = np.array(obj.location) + by


def _results(scene: bpy.types.Scene) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Places and attributes of all results, by name."""
    refine.refine(scene, depsgraph())
    return _taken(scene)


def _taken(scene: bpy.types.Scene) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    """The same of what is there, which is cleared."""
    bpy.context.view_layer.update()
    made = [o for o in scene.objects if KIND in o and o[KIND] != PARENT]
    found = {
        o.name: (np.array(o.matrix_world), {a.name: values_of(a) for a in o.data.attributes if not a.is_internal})
        for o in made
    }
    refine.clear(scene)
    return found


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"proxy_kind": 'SHELLS'},
        {"proxy_kind": 'MICROSPHERES', "anchored": True, "shadow_cutoff": 4.0},
        {"baked_light": 'PROXIES'},
        {"expand_everything": True},
    ],
    ids=["automatic", "shells", "anchored", "baked", "expanded"],
)
def test_results_far_out_are_those_at_the_origin(scene: bpy.types.Scene, settings: dict) -> None:
    for name, value in settings.items():
        setattr(scene.tetflora, name, value)
    if "baked_light" in settings:  # sheets of a square meter would take a hundred times as long
        scene.render.resolution_percentage = 25
        for name in ("rock", "SUN", "plant 1", "plant 4"):
            bpy.data.objects.remove(scene.objects[name])
    near = _results(scene)
    _moved(scene, FAR)
    far = _results(scene)
    assert near.keys() == far.keys()
    assert len(near) >= 2
    for name, (place, attributes) in far.items():
        assert np.array_equal(place[:3, 3], FAR)
        assert np.array_equal(near[name][0], np.eye(4))
        assert attributes.keys() == near[name][1].keys()
        for attribute, values in attributes.items():
            assert np.array_equal(values, near[name][1][attribute]), (name, attribute)


def test_between_the_places_of_the_grid_as_well(scene: bpy.types.Scene) -> None:
    """1,000 km sharp: positions differ by what single precision does at half a grid, areas by nothing to speak of."""
    near = _area(scene)
    _moved(scene, np.array([1e6, 0.0, 0.0]))
    assert _area(scene) == pytest.approx(near, rel=2e-3)


def test_expanded_plants_are_whole_wherever_the_camera_is(scene: bpy.types.Scene) -> None:
    scene.tetflora.expand_everything = True
    scene.camera.location.z += 5_000.0  # near leaves and trunks have what the camera makes out
    near = _results(scene)
    for plant in [o for o in scene.objects if o.tetflora.is_plant]:
        plant.location = np.array(plant.location) + FAR
    for name, (place, attributes) in _results(scene).items():
        assert np.array_equal(place[:3, 3], FAR)
        assert np.array_equal(attributes["position"], near[name][1]["position"])


def _area(scene: bpy.types.Scene) -> float:
    """Area of all polygons of the results, m²."""
    refine.refine(scene, depsgraph())
    meshes = [o.data for o in scene.objects if o.get(KIND) in {"leaf", "bark"}]
    total = 0.0
    for mesh in meshes:
        area = np.zeros(len(mesh.polygons), np.float32)
        mesh.polygons.foreach_get("area", area)
        total += float(area.sum(dtype=np.float64))
        assert np.abs(read(mesh, "position")).max() < 2 * GRID
    refine.clear(scene)
    return total


def test_previews_far_out_are_those_at_the_origin(scene: bpy.types.Scene) -> None:
    scene.tetflora.preview.plants = 'LIGHT'
    levels, shapes = run_to_end(level_steps(scene, depsgraph())), read_shapes(scene, depsgraph())
    _moved(scene, FAR)
    far_levels, far_shapes = run_to_end(level_steps(scene, depsgraph())), read_shapes(scene, depsgraph())
    last, far_last = levels.levels[-1], far_levels.levels[-1]
    assert np.array_equal(levels.vertices(last), far_levels.vertices(far_last))
    assert np.array_equal(far_levels.camera.origin, FAR)
    assert np.array_equal(shapes.positions, far_shapes.positions)
    assert np.array_equal(far_shapes.origin, FAR)


@pytest.mark.parametrize("settings", [{}, {"anchored": True}, {"proxy_kind": 'SHELLS', "anchored": True}], ids=str)
def test_a_stray_changes_nothing_and_is_named(
    scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str], settings: dict
) -> None:
    """Beside, ahead and behind."""
    for name, value in settings.items():
        setattr(scene.tetflora, name, value)
    alone = _results(scene)
    plant = add_plant("slipped")
    rock = add_mesh("lost rock")
    rock.tetflora.is_explicit = True
    for place in ((1e6, 0, 0), (0, 1e6, 0), (0, -2e4, 0)):
        plant.location, rock.location = place, np.multiply(place, 1.5)
        capfd.readouterr()
        assert bpy.ops.tetflora.refine() == {'FINISHED'}
        said = capfd.readouterr().out
        assert '"lost rock", "slipped"' in said
        assert f"{np.abs(place).max() / 1e3:,.0f} km from the camera" in said
        assert set(json.loads(scene.tetflora.statistics)["outliers"]) == {"lost rock", "slipped"}
        with_stray = _taken(scene)
        assert alone.keys() == with_stray.keys()
        for name, (_, attributes) in with_stray.items():
            for attribute, values in attributes.items():
                assert np.array_equal(values, alone[name][1][attribute]), (place, name, attribute)


def test_a_render_names_a_stray_once(scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    tiny_render().render.filepath = str(tmp_path / "frame")
    add_plant("slipped", location=(1e6, 0.0, 0.0))
    scene.tetflora.refine_at_render, scene.frame_end = True, 2
    scene.camera.keyframe_insert("location", frame=1)
    scene.camera.location.x += 2000.0  # the distance that the message tells changes
    scene.camera.keyframe_insert("location", frame=2)
    bpy.ops.render.render(animation=True)
    assert capfd.readouterr().err.count('Left out, because too far to be seen: "slipped", 1,000 km') == 1


def test_a_field_with_a_stray_is_named(scene: bpy.types.Scene) -> None:
    points = np.array([[0.0, 12.0, 0.0], [3.0, 15.0, 0.0], [5e5, 0.0, 0.0]])
    rows = np.tile((1.0, 0.0, 0.0, 0.0), (3, 1)), np.ones(3), np.zeros(3, np.int32), np.arange(3, dtype=np.int32)
    field = write_field("meadow", points, *rows, ["bush"])
    scene.collection.objects.link(field)
    statistics = refine.refine(scene, depsgraph())
    assert statistics.outliers == {"meadow": pytest.approx(5e5, rel=1e-3)}


def test_a_new_field_far_out_keeps_its_places(scene: bpy.types.Scene) -> None:
    """In the world's coordinates single precision would move plants by centimeters."""
    points = np.array([[0.123, 12.456, 0.789], [3.21, 15.654, 0.987]]) + 1e6
    rows = np.tile((1.0, 0.0, 0.0, 0.0), (2, 1)), np.ones(2), np.zeros(2, np.int32), np.arange(2, dtype=np.int32)
    field = write_field("meadow", points, *rows, ["bush"])
    scene.collection.objects.link(field)
    found = read_field(field, depsgraph(), world_matrix(field, depsgraph())[None])
    assert np.abs(found.position - points).max() < 1e-4
