# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Flights far from all plants share more frames than walks among them, and each frame is still the frame alone."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph
from tetflora_addon.blender.job import contents, frame_cache, render
from tetflora_addon.blender.results.output import result_collections

FRAMES = 9


@pytest.fixture
def flight(clean_file):
    """Two bushes, as seen from 60 m by a long lens, and a camera that goes 12 m aside."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 64, 36
    camera = add_camera(location=(-6.0, -60.0, 2.0))
    camera.data.lens = 300.0
    camera.keyframe_insert("location", frame=1)
    camera.location.x = 6.0
    camera.keyframe_insert("location", frame=FRAMES)
    add_plant("one", seed=1)
    add_plant("two", seed=2, location=(1.5, 3.0, 0.0))
    settings = scene.tetflora
    settings.leaf_limit, settings.cutoff, settings.visibility_resolution = 1.0, 6.0, 64
    depsgraph()
    yield scene
    render.on_render_end(scene)


def at(scene, frame):
    """Vertices of all meshes of a frame, by name."""
    scene.frame_set(frame)
    render.on_render_pre(scene)
    assert render.render_errors() == []
    (collection,) = result_collections(scene, 'RENDER')
    found = {}
    for obj in collection.objects:
        if obj.type == 'MESH':
            places = np.empty(3 * len(obj.data.vertices), np.float32)
            obj.data.attributes["position"].data.foreach_get("vector", places)
            found[obj.name] = places.tobytes()
    assert found
    return found


def rooms(scene):
    """How much room the cells of all frames have for their cameras, meters."""
    found = []
    for frame in range(1, FRAMES + 1):
        scene.frame_set(frame)
        given = contents.read_scene(scene, depsgraph())
        found.append(frame_cache.shared_camera(scene, depsgraph(), given).cell_radius)
    return found


def test_each_frame_of_a_flight_is_the_frame_alone(flight):
    sequence = {n: at(flight, n) for n in range(1, FRAMES + 1)}
    assert len({min(found) for found in sequence.values()}) < FRAMES
    for n in range(FRAMES, 0, -1):
        render.on_render_end(flight)
        assert at(flight, n) == sequence[n]


@pytest.mark.parametrize("thing", ["plant", "mesh", "tall plant"])
def test_cells_are_larger_far_from_all_that_is_refined(flight, thing):
    small = frame_cache.shared_camera(flight, depsgraph()).cell_radius
    assert min(rooms(flight)) >= 2.0 * small
    if thing == "plant":
        add_plant("near", seed=3, location=(0.0, -57.0, 0.0))
    elif thing == "tall plant":
        add_plant("near", seed=3).scale = (60.0,) * 3
    else:
        add_mesh("near", size=0.5, z=2.0).tetflora.is_explicit = True
        flight.objects["near"].location.y = -57.0
    assert rooms(flight) == pytest.approx([small] * FRAMES)
