# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""View layers with plants of their own, render regions, stereo and markers: what is rendered is what is refined."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_plant, datablocks, depsgraph
from tetflora_addon.blender.job import frame_cache, render
from tetflora_addon.blender.results.output import result_collections
from tetflora_addon.blender.scene import objects
from tetflora_addon.blender.scene.camera import read_camera


@pytest.fixture
def scene(clean_file):
    """Two plants, each in a collection of its own, left and right of the middle."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    camera.location, camera.rotation_euler = (0.0, -14.0, 1.5), (np.pi / 2, 0.0, 0.0)
    scene.camera = camera
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x, scene.render.resolution_y = 64, 32
    scene.render.film_transparent = True
    for n, side in enumerate((-3.0, 3.0)):
        plant = add_plant(species="bush", seed=n)
        plant.location.x = side
        held = bpy.data.collections.new(f"side {n}")
        scene.collection.children.link(held)
        held.objects.link(plant)
        for other in [c for c in plant.users_collection if c != held]:
            other.objects.unlink(plant)
    return scene


def groups(scene):
    return [[layer.name for layer in group] for group in objects.view_layer_groups(scene)]


def alpha(scene, path) -> np.ndarray:
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.array(image.pixels[:]).reshape(height, width, 4)[..., 3]
    bpy.data.images.remove(image)
    return pixels


def test_layers_with_the_same_plants_share_a_refinement(scene):
    first, second = scene.view_layers[0], scene.view_layers.new("second")
    assert groups(scene) == [[first.name, "second"]]
    second.layer_collection.children["side 1"].exclude = True
    assert groups(scene) == [[first.name], ["second"]]
    second.use = False
    assert groups(scene) == [[first.name]]


def two_layers(scene):
    first, second = scene.view_layers[0], scene.view_layers.new("second")
    first.layer_collection.children["side 1"].exclude = True
    second.layer_collection.children["side 0"].exclude = True
    return first, second


@pytest.mark.parametrize("number", [0, 1])
def test_a_layer_renders_its_own_plants(scene, tmp_path, number):
    two_layers(scene)[1 - number].use = False
    picture = alpha(scene, tmp_path / "a.png")
    shown = [bool(half.mean() > 0.02) for half in (picture[:, :32], picture[:, 32:])]
    assert shown == [number == 0, number == 1]


def test_layers_with_different_plants_are_refined_one_by_one(scene, tmp_path):
    two_layers(scene)
    before, made = datablocks(), []

    def look(_scene, _depsgraph=None):
        for collection in result_collections(scene, 'RENDER'):
            shown = [not layer.layer_collection.children[collection.name].exclude for layer in scene.view_layers]
            made.append(shown)

    bpy.app.handlers.render_pre.append(look)
    try:
        for _ in range(2):
            alpha(scene, tmp_path / "both.png")
    finally:
        bpy.app.handlers.render_pre.remove(look)
    assert made == [[True, False], [False, True]] * 2
    assert datablocks() == before
    assert render.render_errors() == []


def test_a_render_region_is_refined_alone(scene, tmp_path):
    read = read_camera
    whole = read(scene, depsgraph())
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.5, 1.0
    scene.render.border_min_y, scene.render.border_max_y = 0.25, 0.75
    region = read(scene, depsgraph(), region_only=True)
    assert (region.width, region.height) == (32, 16)
    assert region.pixel_size == pytest.approx(whole.pixel_size)
    assert region.window == pytest.approx((0.0, whole.window[1], whole.window[2] / 2, whole.window[3] / 2), abs=1e-6)
    assert read(scene, depsgraph()).window == whole.window  # in the viewport all of it
    scene.cycles.samples = 16
    picture = alpha(scene, tmp_path / "region.png")
    assert picture[8:24, 32:].mean() > 0.02
    scene.render.use_border = False
    reference = alpha(scene, tmp_path / "whole.png")
    assert np.abs(picture - reference)[8:24, 33:].mean() < 0.2 * reference[8:24, 33:].mean()


@pytest.mark.parametrize("mode", ['OFFAXIS', 'PARALLEL', 'TOE'])
@pytest.mark.parametrize("pivot", ['CENTER', 'LEFT', 'RIGHT'])
def test_both_eyes_lie_within_what_is_refined(scene, mode, pivot):
    """At the distance of convergence the middle of both pictures is the same point, but for parallel ones."""
    scene.render.use_multiview = True
    stereo = scene.camera.data.stereo
    stereo.interocular_distance, stereo.convergence_distance, stereo.convergence_mode = 0.5, 4.0, mode
    stereo.pivot = pivot
    camera = read_camera(scene, depsgraph())
    assert len(camera.shutter) == (2 if pivot == 'CENTER' else 1)
    for eye in camera.shutter:
        away = np.linalg.norm(eye.position - camera.position)
        assert away == pytest.approx(0.25 if pivot == 'CENTER' else 0.5)
        middle = np.array([(eye.window[0] + eye.window[1]) / 2, 0.0, -1.0])
        ray = eye.frame @ middle
        met = eye.position + ray * 4.0 / (ray @ -camera.frame[:, 2])
        off = np.linalg.norm((met - camera.position) - 4.0 * -camera.frame[:, 2])
        assert off == pytest.approx(away if mode == 'PARALLEL' else 0.0, abs=1e-6)


def test_cameras_of_multi_view_are_found_by_their_suffix(scene):
    scene.camera.name = "shot_L"
    other = bpy.data.objects.new("shot_R", scene.camera.data)
    scene.collection.objects.link(other)
    other.location, other.rotation_euler = (1.0, -14.0, 1.5), scene.camera.rotation_euler
    scene.render.use_multiview, scene.render.views_format = True, 'MULTIVIEW'
    (seen,) = read_camera(scene, depsgraph()).shutter
    assert seen.position == pytest.approx((1.0, -14.0, 1.5))


def test_markers_switch_the_camera_that_is_refined_for(scene, tmp_path):
    """In animations, as ``-b -a`` renders them: frame 2 is seen from the other side."""
    other = bpy.data.objects.new("other", scene.camera.data)
    scene.collection.objects.link(other)
    other.location, other.rotation_euler = (-3.0, 14.0, 1.5), (np.pi / 2, 0.0, np.pi)
    for frame, camera in ((1, scene.camera), (2, other)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    seen = []
    real = frame_cache.read_camera

    def look(scene, *arguments, **options):
        camera = real(scene, *arguments, **options)
        seen.append((scene.frame_current, round(float(camera.position[1]))))
        return camera

    frame_cache.read_camera = look
    scene.frame_start, scene.frame_end = 1, 2
    scene.render.filepath = str(tmp_path / "frame")
    try:
        bpy.ops.render.render(animation=True)
    finally:
        frame_cache.read_camera = real
    assert seen == [(1, -14), (2, 14)]
    assert render.render_errors() == []
