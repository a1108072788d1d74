# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera, plants and occluders as the engine gets them."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mathutils import Vector

from devtools import session
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph
from tetflora_addon import errors
from tetflora_addon.blender.scene import objects
from tetflora_addon.blender.scene.camera import read_camera
from tetflora_addon.blender.scene.plants import read_plants

pytestmark = pytest.mark.usefixtures("clean_file")


def _camera():
    return read_camera(bpy.context.scene, depsgraph())


def _plants():
    return read_plants(bpy.context.scene, depsgraph())[0]


def _occluders():
    return objects.read_occluders(depsgraph())


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(
    kind=st.sampled_from(['PERSP', 'ORTHO']),
    fit=st.sampled_from(['AUTO', 'HORIZONTAL', 'VERTICAL']),
    lens=st.floats(12.0, 200.0),
    shift=st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8)),
    size=st.tuples(st.integers(16, 2000), st.integers(16, 2000)),
    aspect=st.sampled_from([(1.0, 1.0), (2.0, 1.0), (1.0, 1.5)]),
    rotation=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    scale=st.sampled_from([(1.0, 1.0, 1.0), (2.5, 2.5, 2.5), (1.0, 3.0, 0.5)]),
)
def test_projections_agree_with_blenders(kind, fit, lens, shift, size, aspect, rotation, scale):
    scene = bpy.context.scene
    obj = scene.camera or add_camera()
    obj.rotation_euler, obj.scale, obj.location = rotation, scale, (3.0, -2.0, 5.0)
    data = obj.data
    data.type, data.sensor_fit, data.lens, data.ortho_scale = kind, fit, lens, 7.0
    data.sensor_width, data.sensor_height = 36.0, 20.0
    data.shift_x, data.shift_y = shift
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    camera = _camera()
    assert np.allclose(camera.frame.T @ camera.frame, np.eye(3), atol=1e-6)
    assert np.linalg.det(camera.frame) == pytest.approx(1.0, abs=1e-5)
    local = np.array([[0.3, -0.2, -4.0], [-1.0, 0.8, -9.0], [0.0, 0.0, -1.5]])
    points = local @ camera.frame.T + camera.position
    ours = camera.to_camera_space(points)
    left, right, bottom, top = camera.window
    picture = ours[:, :2] / (ours[:, 2:] if kind == 'PERSP' else 1.0)
    seen = (picture - [left, bottom]) / [right - left, top - bottom]
    # Blender's function takes the matrix with its scale; renderers take it without.
    unscaled = obj.matrix_world.copy()
    obj.scale = (1.0, 1.0, 1.0)
    depsgraph()
    wanted = [world_to_camera_view(scene, obj, Vector(p)) for p in points]
    assert unscaled.translation == obj.matrix_world.translation
    assert np.allclose(seen, np.array(wanted)[:, :2], atol=2e-4)
    assert np.allclose(ours[:, 2], np.array(wanted)[:, 2], atol=1e-4)


def test_size_of_the_picture_and_clipping():
    camera = add_camera()
    camera.data.clip_start, camera.data.clip_end = 0.25, 750.0
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 1921, 1080, 50
    read = _camera()
    assert (read.width, read.height, read.kind) == (960, 540, 'PERSP')
    assert (read.near, read.far) == pytest.approx((0.25, 750.0))


def test_a_parented_and_animated_camera_is_read_where_it_is():
    camera = add_camera(location=(0.0, 0.0, 0.0))
    rail = bpy.data.objects.new("rail", None)
    bpy.context.scene.collection.objects.link(rail)
    camera.parent = rail
    rail.location = (0.0, 0.0, 1.0)
    rail.keyframe_insert("location", frame=1)
    rail.location = (10.0, 0.0, 1.0)
    rail.keyframe_insert("location", frame=11)
    for frame in (1, 11):
        bpy.context.scene.frame_set(frame)
        assert np.allclose(_camera().position, [frame - 1, 0.0, 1.0], atol=1e-5)


@pytest.mark.parametrize(
    ("break_it", "says"),
    [
        (lambda scene, obj: setattr(scene, "camera", None), "no active camera"),
        (lambda scene, obj: setattr(scene, "camera", add_plant("empty")), "is not a camera object"),
        (lambda scene, obj: setattr(obj, "scale", (0.0, 1.0, 1.0)), "zero scale"),
        (lambda scene, obj: setattr(obj, "location", (float("nan"), 0.0, 0.0)), "invalid position"),
        (lambda scene, obj: setattr(obj.data, "clip_start", 5000.0), "Clip End"),
    ],
)
def test_cameras_that_cannot_be_used_are_named(break_it, says):
    break_it(bpy.context.scene, add_camera())
    with pytest.raises(errors.SceneError, match=says):
        _camera()


def test_plants_come_as_arrays_sorted_by_name():
    add_plant("b", "conifer", seed=-3, location=(1.0, 2.0, 3.0))
    add_plant("a", "bush", seed=5, scale=(2.0, 2.0, 2.0), rotation_euler=(0.0, 0.0, 0.5))
    seeds = _plants()
    assert seeds.identifiers == ("bush", "conifer")
    assert seeds.species.tolist() == [0, 1]
    assert seeds.species.dtype == np.int32
    assert seeds.seed.tolist() == [5, -3]
    assert seeds.seed.dtype == np.int64
    assert np.allclose(seeds.position, [[0, 0, 0], [1, 2, 3]])
    assert np.allclose(seeds.scale, [2, 1])
    turn = [[np.cos(0.5), -np.sin(0.5), 0], [np.sin(0.5), np.cos(0.5), 0], [0, 0, 1]]
    assert np.allclose(seeds.frame, [turn, np.eye(3)], atol=1e-6)


def test_only_enabled_plants_that_render_count():
    scene = bpy.context.scene
    add_plant("seen")
    add_plant("hidden", hide_render=True)
    add_plant("disabled").tetflora.enabled = False
    add_plant("hidden in viewport only", hide_viewport=True, location=(7.0, 0.0, 0.0))
    unseen = bpy.data.collections.new("unseen")
    scene.collection.children.link(unseen)
    inner = bpy.data.collections.new("inner")
    unseen.children.link(inner)
    unseen.hide_render = True
    add_plant("in hidden collection", collection=inner)
    both = add_plant("in a hidden and a shown one", collection=inner, location=(8.0, 0.0, 0.0))
    scene.collection.objects.link(both)
    excluded = bpy.data.collections.new("excluded")
    scene.collection.children.link(excluded)
    add_plant("in excluded collection", collection=excluded)
    bpy.context.view_layer.layer_collection.children["excluded"].exclude = True
    assert sorted(_plants().position[:, 0].tolist()) == [0.0, 7.0, 8.0]


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(
    rotation=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    scale=st.tuples(*[st.floats(0.1, 5.0)] * 3),
    signs=st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3),
)
def test_any_scale_gives_a_rotation_that_keeps_the_trunk(rotation, scale, signs):
    plant = bpy.data.objects.get("plant") or add_plant()
    plant.rotation_euler = rotation
    plant.scale = np.multiply(scale, signs)
    seeds = _plants()
    frame = seeds.frame[0]
    assert np.allclose(frame.T @ frame, np.eye(3), atol=1e-6)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-6)
    assert seeds.scale[0] == pytest.approx(np.mean(scale), rel=1e-4)
    trunk = np.array(plant.matrix_world)[:3, 2]
    assert np.allclose(frame[:, 2], trunk / np.linalg.norm(trunk), atol=1e-5)


def test_parents_constraints_and_animation_move_plants():
    parent = add_mesh("parent")
    parent.location = (5.0, 0.0, 0.0)
    add_plant("a", parent=parent)
    add_plant("b").constraints.new('COPY_LOCATION').target = parent
    animated = add_plant("c")
    animated.keyframe_insert("location", frame=1)
    animated.location = (5.0, 0.0, 0.0)
    animated.keyframe_insert("location", frame=3)
    bpy.context.scene.frame_set(3)
    assert np.allclose(_plants().position, [[5.0, 0.0, 0.0]] * 3, atol=1e-5)


def test_instanced_collections_grow_individuals():
    grove = bpy.data.collections.new("grove")
    add_plant("a", seed=4, location=(1.0, 0.0, 0.0), collection=grove)
    for x in (0.0, 10.0):
        instance = bpy.data.objects.new("instance", None)
        instance.instance_type, instance.instance_collection, instance.location = 'COLLECTION', grove, (x, 0.0, 0.0)
        bpy.context.scene.collection.objects.link(instance)
    seeds = _plants()
    assert sorted(seeds.position[:, 0].tolist()) == [1.0, 11.0]
    assert len(set(seeds.seed.tolist())) == 2
    assert sorted(_plants().seed.tolist()) == sorted(seeds.seed.tolist())


def test_linked_plants_are_read(tmp_path):

    add_plant("from the library", location=(2.0, 0.0, 0.0))
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    session.clean_file()
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["from the library"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    assert np.allclose(_plants().position, [[2.0, 0.0, 0.0]])


def _excluded(plants):
    collection = bpy.data.collections.new("excluded")
    bpy.context.scene.collection.children.link(collection)
    for plant in plants:
        for home in plant.users_collection:
            home.objects.unlink(plant)
        collection.objects.link(plant)
    bpy.context.view_layer.layer_collection.children["excluded"].exclude = True


@pytest.mark.parametrize(
    ("break_it", "says"),
    [
        (lambda: None, "No plants to render.*Add > TetFlora Plant"),
        (lambda: setattr(add_plant(), "hide_render", True), "to render; 1 are hidden in renders"),
        (lambda: _excluded([add_plant(f"x{i}") for i in range(3)]), "3 are hidden.*excluded from the view layer"),
        (lambda: setattr(add_plant().tetflora, "enabled", False), "are disabled; enable some in Properties > Object"),
        (lambda: add_plant("Old oak", "quercus"), '"Old oak": unknown species "quercus".*quercus.json'),
        (lambda: add_plant("Old oak", ""), '"Old oak": unknown species ""'),
        (lambda: add_plant("Flat", scale=(1.0, 1.0, 0.0)), '"Flat": zero scale'),
        (lambda: add_plant("Giant", scale=(1.0, 1e6, 1.0)), '"Giant": zero scale, a scale above 100,000'),
        (lambda: add_plant("Nowhere", location=(0.0, float("nan"), 0.0)), '"Nowhere".*invalid position'),
        (lambda: [add_plant(f"x{i}", "nix") for i in range(5)], '"x0", "x1", "x2" and 2 more: unknown species "nix"'),
    ],
)
def test_plants_that_cannot_be_used_are_named(break_it, says):
    break_it()
    with pytest.raises(errors.SceneError, match=says):
        _plants()


def test_occluders_are_triangles_in_world_space_with_modifiers():
    ground = add_mesh("ground", size=1.0)
    ground.tetflora.is_occluder = True
    add_mesh("other")
    ground.location, ground.scale = (0.0, 0.0, 4.0), (3.0, 1.0, 1.0)
    triangles = _occluders()
    assert triangles.shape == (2, 3, 3)
    assert np.allclose(triangles.reshape(-1, 3).min(axis=0), [-3, -1, 4])
    assert np.allclose(triangles.reshape(-1, 3).max(axis=0), [3, 1, 4])
    ground.modifiers.new("more", 'ARRAY').count = 3
    assert len(_occluders()) == 6
    ground.hide_render = True
    assert _occluders().shape == (0, 3, 3)


def test_occluders_that_hide_nothing_are_named():
    bare = add_mesh("Bare", faces=())
    bare.tetflora.is_occluder = True
    with pytest.raises(errors.SceneError, match='"Bare" has no faces'):
        _occluders()
    bpy.data.objects.remove(bare)
    curve = bpy.data.objects.new("Path", bpy.data.curves.new("Path", 'CURVE'))
    bpy.context.scene.collection.objects.link(curve)
    curve.tetflora.is_occluder = True
    with pytest.raises(errors.SceneError, match='"Path" is not a mesh; an occluder must be'):
        _occluders()
