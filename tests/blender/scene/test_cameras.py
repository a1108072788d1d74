# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of all sorts as they are read: lenses, shutters and panoramas, and a panorama that is rendered."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

from tests.blender import renders
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.scene.camera import read_camera

pytestmark = pytest.mark.usefixtures("clean_file")


def _read():
    return read_camera(bpy.context.scene, depsgraph())


def test_a_pinhole_that_stands_still_has_neither_lens_nor_shutter():
    add_camera()
    camera = _read()
    assert (camera.lens_radius, camera.shutter) == (0.0, ())


@pytest.mark.parametrize(("kind", "length"), [('PERSP', 0.05), ('ORTHO', 1.0)])
def test_the_lens_has_the_diameter_that_the_f_stop_says(kind, length):
    obj = add_camera()
    obj.data.type, obj.data.lens = kind, 50.0
    obj.data.dof.use_dof, obj.data.dof.aperture_fstop, obj.data.dof.focus_distance = True, 2.0, 7.5
    camera = _read()
    assert camera.lens_radius == pytest.approx(length / 4)
    assert camera.focus == pytest.approx(7.5)


def test_the_focus_object_counts_by_its_depth():
    obj = add_camera(location=(0.0, -20.0, 2.0))
    obj.data.dof.use_dof, obj.data.dof.focus_object = True, add_mesh()
    assert _read().focus == pytest.approx(20.0, rel=1e-5)


@pytest.mark.parametrize(("position", "expected"), [('START', [3.5]), ('CENTER', [2.75, 3.25]), ('END', [2.5])])
def test_an_animated_camera_is_read_while_its_shutter_is_open(position, expected):
    scene = bpy.context.scene
    obj = add_camera(location=(0.0, 0.0, 0.0))
    rail = add_mesh("rail")
    rail.location = (0.0, 5.0, 0.0)
    obj.parent = rail
    for frame in (1, 11):
        obj.location.x = float(frame)
        obj.keyframe_insert("location", frame=frame)
    for curve in obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot).fcurves:
        for key in curve.keyframe_points:
            key.interpolation = 'LINEAR'
    scene.frame_set(3)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = False, 0.5
    assert _read().shutter == ()
    scene.render.use_motion_blur = True
    scene.render.motion_blur_position = position
    camera = _read()
    assert [other.position[0] for other in camera.shutter] == pytest.approx(expected, abs=1e-4)
    assert all(other.position[1] == pytest.approx(5.0) for other in camera.shutter)
    assert (scene.frame_current, obj.location.x) == (3, 3.0)
    obj.animation_data_clear()
    assert _read().shutter == ()


def test_a_turning_camera_is_read_in_every_rotation_mode():
    scene = bpy.context.scene
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    scene.render.motion_blur_position = 'CENTER'
    for mode, path, ends in (
        ('XYZ', "rotation_euler", ((math.pi / 2, 0, 0), (math.pi / 2, 0, 0.4))),
        ('AXIS_ANGLE', "rotation_axis_angle", ((0.1, 0, 0, 1), (0.5, 0, 0, 1))),
        ('QUATERNION', "rotation_quaternion", ((1, 0, 0, 0), (math.cos(0.2), 0, 0, math.sin(0.2)))),
    ):
        obj = add_camera()
        obj.rotation_mode = mode
        for frame, value in zip((1, 3), ends, strict=True):
            setattr(obj, path, value)
            obj.keyframe_insert(path, frame=frame)
        scene.frame_set(2)
        camera = _read()
        frames = [other.frame for other in camera.shutter]
        assert len(frames) == 2
        between = frames[0].T @ frames[1]
        assert np.arccos((np.trace(between) - 1) / 2) > 0.1


def test_equirectangular_cameras_have_their_limits():
    obj = add_camera()
    obj.data.type, obj.data.panorama_type = 'PANO', 'EQUIRECTANGULAR'
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 400, 200
    camera = _read()
    assert (camera.kind, camera.width, camera.height) == ("PANO", 400, 200)
    assert camera.window == pytest.approx((-math.pi, math.pi, -math.pi / 2, math.pi / 2), abs=1e-6)
    obj.data.longitude_min, obj.data.longitude_max, obj.data.latitude_max = -1.0, 0.5, 0.25
    assert _read().window == pytest.approx((-1.0, 0.5, -math.pi / 2, 0.25), abs=1e-6)


def test_a_fisheye_is_a_whole_sphere_of_its_density():
    obj = add_camera()
    obj.data.type, obj.data.panorama_type, obj.data.fisheye_fov = 'PANO', 'FISHEYE_EQUIDISTANT', math.pi
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 300
    camera = _read()
    assert camera.window == pytest.approx((-math.pi, math.pi, -math.pi / 2, math.pi / 2))
    assert camera.pixel_size == pytest.approx(math.pi / 300, rel=1e-3)


@pytest.mark.parametrize("kind", ["FISHEYE_EQUIDISTANT", "FISHEYE_EQUISOLID"])
def test_a_narrow_fisheye_is_no_whole_sphere(kind):
    """It would be an image of 13,000 columns for one of 200; but a square in its corner is in the part that counts."""
    scene = bpy.context.scene
    renders.small_scene(0.8, 4)
    obj = add_camera(location=(1.0, -2.0, 1.0), rotation=(1.3, 0.2, 0.4))
    obj.data.type, obj.data.panorama_type = 'PANO', kind
    obj.data.fisheye_fov, obj.data.fisheye_lens, obj.data.sensor_width = 1.2, 50.0, 40.0
    scene.render.resolution_x, scene.render.resolution_y = 80, 60
    square = add_mesh(size=0.1)
    material = bpy.data.materials.new("black")
    compat.shader_tree(material).nodes["Principled BSDF"].inputs["Base Color"].default_value = (0, 0, 0, 1)
    square.data.materials.append(material)
    square.rotation_euler, square.location.z = obj.rotation_euler, -1e3
    depsgraph().update()
    camera = _read()
    assert camera.width == camera.height < 150
    assert camera.window[1] == -camera.window[0] == camera.window[3] == -camera.window[2] < 0.65
    bare, half, there = renders.picture(), camera.window[1], []
    for angle in (0.85 * half, 1.1 * half):
        toward = np.array([0.8 * math.sin(angle), 0.6 * math.sin(angle), -math.cos(angle)])
        square.location = camera.position + 4.0 * camera.frame @ toward
        depsgraph().update()
        there.append(bool(np.abs(renders.picture() - bare).max() > 0.3))
    assert there == [True, False]


@pytest.mark.parametrize("sensor", [1.0, 5.0])
def test_a_fisheye_of_a_few_degrees_sees_what_is_before_it(sensor):
    """Its first buffer had no pixel within the view: nothing was refined."""
    scene = bpy.context.scene
    renders.small_scene(0.8, 4)
    obj = add_camera(location=(0.0, -40.0, 1.0), rotation=(math.pi / 2.0, 0.0, 0.0))
    obj.data.type, obj.data.panorama_type = 'PANO', 'FISHEYE_EQUISOLID'
    obj.data.fisheye_lens, obj.data.sensor_width = 100.0, sensor
    scene.render.resolution_x = scene.render.resolution_y = 60
    add_plant("bush")
    depsgraph().update()
    statistics = refine.refine(scene, depsgraph())
    assert statistics.passes > 3


def _around():
    """Bushes around a panorama, and a spot that each longitude shows."""
    scene = bpy.context.scene
    renders.small_scene(0.8, 8, sun=40.0)
    obj = add_camera(location=(0.0, 0.0, 1.0))
    obj.data.type, obj.data.panorama_type = 'PANO', 'EQUIRECTANGULAR'
    scene.render.resolution_x, scene.render.resolution_y = 192, 96
    add_mesh(size=30.0)
    for i, angle in enumerate((0.0, 0.9, 1.7, 2.6, 3.6, 5.0)):
        add_plant(f"bush {i}", seed=i, location=(4.0 * math.sin(angle), 4.0 * math.cos(angle), 0.0))
    return scene


def test_a_panorama_is_rendered_as_if_all_were_expanded():
    scene = _around()
    scene.tetflora.refine_at_render = False
    scene.tetflora.leaf_limit = 0.2  # all leaves of half a pixel are real
    bare = renders.picture()
    pictures = []
    for everything in (False, True):
        scene.tetflora.expand_everything = everything
        refine.refine(scene, depsgraph())
        pictures.append(renders.picture())
    refined, expanded = pictures
    plants = np.abs(expanded - bare).max(axis=2) > 0.1
    columns = plants.any(axis=0)
    assert columns[:48].any()
    assert columns[-48:].any()
    assert 0.02 < plants.mean() < 0.5
    assert np.abs(refined - expanded)[plants].mean() < 0.1 * np.abs(expanded - bare)[plants].mean() + 0.02
    assert refined[plants].mean() == pytest.approx(expanded[plants].mean(), rel=0.05)


def test_longitudes_and_latitudes_are_those_of_cycles():
    """A small dark square is where the engine says, right of the middle and left, above and below."""
    scene = bpy.context.scene
    renders.small_scene(0.8, 4)
    obj = add_camera(location=(1.0, -2.0, 1.0), rotation=(1.3, 0.2, 0.4))
    obj.data.type, obj.data.panorama_type = 'PANO', 'EQUIRECTANGULAR'
    obj.data.longitude_min, obj.data.longitude_max = -1.0, 1.5
    obj.data.latitude_min, obj.data.latitude_max = -0.9, 0.6
    scene.render.resolution_x, scene.render.resolution_y = 100, 60
    square = add_mesh(size=0.25)
    material = bpy.data.materials.new("black")
    compat.shader_tree(material).nodes["Principled BSDF"].inputs["Base Color"].default_value = (0, 0, 0, 1)
    square.data.materials.append(material)
    for longitude, latitude in ((0.9, 0.3), (-0.5, -0.6)):
        depsgraph().update()
        camera = _read()
        toward = [
            math.cos(latitude) * math.sin(longitude),
            math.sin(latitude),
            -math.cos(latitude) * math.cos(longitude),
        ]
        square.location = camera.position + 4.0 * camera.frame @ toward
        square.rotation_euler = obj.rotation_euler
        depsgraph().update()
        rows, columns = np.nonzero(renders.picture().mean(axis=2) < 0.4)
        left, right, bottom, top = camera.window
        found = left + (columns.mean() + 0.5) * (right - left) / 100, bottom + (rows.mean() + 0.5) * (top - bottom) / 60
        assert found == pytest.approx((longitude, latitude), abs=0.03)
