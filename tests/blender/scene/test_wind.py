# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The wind of a scene: what is refined at a frame is the plants as they are at that frame, and only there."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from devtools.formats import set_format
from tests.blender.scenes import add_camera, add_plant, depsgraph, tiny_render
from tetflora_addon import buffers
from tetflora_addon.blender import settings
from tetflora_addon.blender.job import contents, frame_cache, refine
from tetflora_addon.blender.results import collection, meshes
from tetflora_addon.blender.scene.camera import read_camera
from tetflora_addon.blender.viewport import auto


@pytest.fixture
def scene(clean_file):
    add_camera(location=(0.0, -8.0, 1.0))
    for i in range(2):
        add_plant(f"plant {i}", seed=i, location=(2.0 * i - 1.0, 0.0, 0.0))
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 120
    scene.tetflora.wind.enabled, scene.tetflora.wind.speed = True, 8.0
    return scene


def made(scene):
    """Objects of the last refinement that have vertices or points."""
    objects = collection.result_collections(scene, 'VIEW')[0].all_objects
    return sorted((obj for obj in objects if obj.data is not None), key=lambda obj: obj.name)


def places(scene, frame, subframe=0.0):
    """All vertices of what is refined at a frame."""
    scene.frame_set(frame, subframe=subframe)
    refine.refine(scene, depsgraph())
    found = []
    for obj in (obj for obj in made(scene) if obj.type == 'MESH'):
        flat = np.zeros(3 * len(obj.data.vertices), np.float32)
        obj.data.vertices.foreach_get("co", flat)
        found.append(flat)
    return np.concatenate(found)


def test_each_frame_is_another_and_always_the_same(scene):
    first, second = places(scene, 1), places(scene, 9)
    assert first.shape != second.shape or np.abs(first - second).max() > 1e-3
    np.testing.assert_array_equal(places(scene, 1), first)
    assert not np.array_equal(places(scene, 9, 0.5), second)


def test_a_loop_of_frames_repeats(scene):
    scene.tetflora.wind.loop = 30
    scene.render.fps, scene.render.fps_base = 30, 1.001
    first = places(scene, 5)
    np.testing.assert_array_equal(places(scene, 35), first)
    np.testing.assert_array_equal(places(scene, 605), first)
    assert not np.array_equal(places(scene, 20), first)


@pytest.mark.parametrize("calm", ["off", "no speed"])
def test_without_wind_all_frames_are_alike(scene, calm):
    if calm == "off":
        scene.tetflora.wind.enabled = False
    else:
        scene.tetflora.wind.speed = 0.0
    first = places(scene, 1)
    np.testing.assert_array_equal(places(scene, 40), first)
    assert settings.wind_of(scene) is None


def test_settings_become_a_wind(scene):
    wind = scene.tetflora.wind
    wind.direction, wind.gusts, wind.loop = np.radians(90), 0.25, 48
    scene.render.fps = 24
    scene.frame_set(60)
    found = settings.wind_of(scene)
    assert (found.speed, found.gusts, found.time, found.loop) == (8.0, 0.25, 0.5, 2.0)
    assert found.direction == pytest.approx(np.pi / 2)
    wind.loop = 0
    scene.frame_set(-6, subframe=0.5)
    assert settings.wind_of(scene).time == pytest.approx(-5.5 / 24)


def test_a_frame_is_the_same_whatever_range_is_rendered(scene):
    """Workers of a farm set the scene's range to the frames that they render."""
    scene.frame_set(20)
    wind_of = settings.wind_of
    animation = wind_of(scene)
    scene.frame_start, scene.frame_end = 20, 22
    assert wind_of(scene) == animation


def test_results_of_another_frame_are_not_taken_for_this_one(scene):
    digest = frame_cache.scene_digest

    def at(frame):
        scene.frame_set(frame)
        return digest(scene, depsgraph(), scene.view_layers[0])

    assert at(1) != at(2)
    assert at(1) == at(1)
    scene.tetflora.wind.enabled = False
    assert at(1) == at(2)


def test_it_refines_by_itself_at_another_frame(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    monkeypatch.setattr(auto, "schedule", lambda which: asked.append(which.name))
    asked = []
    scene.frame_set(7)
    assert asked
    scene.tetflora.wind.enabled = False
    asked.clear()
    scene.frame_set(8)
    assert not asked
    scene.tetflora.auto_refine = False


def test_a_plant_is_made_into_a_mesh_at_rest(scene):
    """Meshes that are made of plants, and previews, do not depend on the frame."""
    flora = contents.compile_for(("bush",), scene, depsgraph())
    assert flora.calm is None
    assert contents.in_wind(scene, flora, read_camera(scene, depsgraph())).calm is flora


def test_velocities_are_there_where_there_is_motion_blur(scene):
    def kinds(blur):
        scene.render.use_motion_blur = blur
        refine.refine(scene, depsgraph())
        assert len(made(scene)) > 1
        return ["velocity" in obj.data.attributes for obj in made(scene)]

    assert not any(kinds(False))
    assert all(kinds(True))
    scene.tetflora.wind.enabled = False
    assert not any(kinds(True))


@pytest.mark.parametrize(("position", "middle"), [('START', 0.25), ('CENTER', 0.0), ('END', -0.25)])
def test_with_motion_blur_plants_stand_as_in_the_middle_of_the_exposure(scene, position, middle):
    scene.frame_set(12)
    scene.render.fps = 24
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
    scene.render.motion_blur_position = position
    wind = settings.wind_of(scene)
    assert wind.moving
    assert wind.time == pytest.approx((12 + middle) / 24)


def alpha(path):
    image = bpy.data.images.load(str(path), check_existing=False)
    width, height = image.size
    return np.array(image.pixels[:]).reshape(height, width, 4)[:, :, 3]


def blurred_render(scene, path, size=128, samples=64):
    tiny_render(samples=samples, size=size)
    scene.render.film_transparent = True
    scene.render.use_motion_blur, scene.render.motion_blur_position = True, 'CENTER'
    scene.render.motion_blur_shutter = 0.5
    set_format(scene.render.image_settings, "PNG")
    scene.render.image_settings.color_mode = 'RGBA'
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return alpha(path)


@pytest.mark.parametrize("fps", [24, 48])
def test_cycles_takes_velocities_for_meters_a_second(clean_file, tmp_path, fps):
    """A square of a meter at 12 m/s is smeared by the way that it goes while the shutter is open."""
    square = buffers.MeshBuffers(
        positions=np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]], np.float32),
        edge_verts=np.array([[0, 1], [1, 2], [2, 3], [3, 0]], np.int32),
        corner_verts=np.arange(4, dtype=np.int32),
        corner_edges=np.arange(4, dtype=np.int32),
        face_offsets=np.array([0, 4], np.int32),
        attributes={"velocity": ("POINT", np.tile(np.array([12.0, 0, 0], np.float32), (4, 1)))},
    )
    scene = bpy.context.scene
    scene.collection.objects.link(bpy.data.objects.new("square", meshes.write_mesh("square", square)))
    camera = add_camera(location=(0, 0, 5), rotation=(0, 0, 0))
    camera.data.type, camera.data.ortho_scale = 'ORTHO', 4.0
    scene.render.fps = fps
    row = blurred_render(scene, tmp_path / "square.png")[64]
    way = 12.0 / fps * 0.5
    assert np.count_nonzero(row > 0.02) / 32 == pytest.approx(1 + way, abs=0.08)
    assert np.count_nonzero(row > 0.98) / 32 == pytest.approx(1 - way, abs=0.08)


def test_a_picture_with_motion_blur_is_the_mean_of_pictures_while_the_shutter_is_open(scene, tmp_path):
    """The same plants refined once with velocities, and many times without; what does not move would be farther off."""
    scene.tetflora.refine_at_render = False
    scene.tetflora.wind.speed, scene.render.fps = 20.0, 10
    scene.render.use_motion_blur, scene.render.motion_blur_position = True, 'CENTER'
    scene.render.motion_blur_shutter = 0.5
    scene.camera.data.lens = 80.0
    scene.render.resolution_x = scene.render.resolution_y = 96
    scene.render.use_border = scene.render.use_crop_to_border = True  # the middle half shows enough of both
    scene.render.border_min_y, scene.render.border_max_y = 0.25, 0.75
    scene.frame_set(5)
    refine.refine(scene, depsgraph())
    soft = blurred_render(scene, tmp_path / "soft.png", 96)
    for obj in made(scene):
        obj.data.attributes.remove(obj.data.attributes["velocity"])
    sharp = blurred_render(scene, tmp_path / "sharp.png", 96)
    exposures = []
    for number in range(8):
        at = 5 + ((number + 0.5) / 8 - 0.5) * 0.5
        scene.frame_set(int(at), subframe=at % 1.0)
        scene.render.use_motion_blur = False
        refine.refine(scene, depsgraph())
        exposures.append(blurred_render(scene, tmp_path / "one.png", 96, 16))
    truth = np.mean(exposures, axis=0)
    off, still_off = (np.abs(picture - truth).mean() for picture in (soft, sharp))
    assert off < 0.75 * still_off  # what is left is noise: leaves turn while they move
