# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The wind of a scene: what is refined at a frame is the plants as they are at that frame, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_plant, depsgraph, part


@pytest.fixture
def scene(clean_file):
    import bpy

    add_camera(location=(0.0, -8.0, 1.0))
    for i in range(2):
        add_plant(f"plant {i}", seed=i, location=(2.0 * i - 1.0, 0.0, 0.0))
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 120
    scene.tetflora.wind.enabled, scene.tetflora.wind.speed = True, 8.0
    return scene


def places(scene, frame, subframe=0.0):
    """All vertices of what is refined at a frame."""
    scene.frame_set(frame, subframe=subframe)
    part("job").refine(scene, depsgraph())
    objects = part("emit").result_collections(scene, 'VIEW')[0].all_objects
    found = []
    for obj in sorted((o for o in objects if o.type == 'MESH'), key=lambda o: o.name):
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
    scene.frame_start = 1
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
    assert part("wind_properties").wind_of(scene) is None


def test_settings_become_a_wind(scene):
    wind = scene.tetflora.wind
    wind.direction, wind.gusts, wind.loop = np.radians(90), 0.25, 48
    scene.render.fps, scene.frame_start = 24, 10
    scene.frame_set(22)
    found = part("wind_properties").wind_of(scene)
    assert (found.speed, found.gusts, found.time, found.loop) == (8.0, 0.25, 0.5, 2.0)
    assert found.direction == pytest.approx(np.pi / 2)
    wind.loop = 0
    scene.frame_set(4, subframe=0.5)
    assert part("wind_properties").wind_of(scene).time == pytest.approx(-5.5 / 24)


def test_results_of_another_frame_are_not_taken_for_this_one(scene):
    digest = part("scene_digest").scene_digest

    def at(frame):
        scene.frame_set(frame)
        return digest(scene, depsgraph(), scene.view_layers[0])

    assert at(1) != at(2)
    assert at(1) == at(1)
    scene.tetflora.wind.enabled = False
    assert at(1) == at(2)


def test_it_refines_by_itself_at_another_frame(scene, monkeypatch):
    auto = part("auto_refresh")
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
    flora = part("job").compile_for(("bush",), scene, depsgraph())
    assert flora.calm is None
    assert part("job").blown(scene, flora).calm is flora
