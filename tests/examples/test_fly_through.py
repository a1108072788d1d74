# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The walks of the example: as fast as somebody walks, over the ground, and clear of plants."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils.kdtree import KDTree

from devtools import session
from examples import fly_through, row80
from tests.blender.scenes import depsgraph
from tetflora_addon.blender.scene.plants import read_plants


def _walked(frames: int, of: str) -> np.ndarray:
    """Places of the camera (frames, 3), one a frame."""

    scene = bpy.context.scene
    fly_through.build(scene, frames=frames, of=of)
    assert (scene.frame_start, scene.frame_end, scene.frame_current) == (1, frames, 1)
    places = []
    for frame in range(1, frames + 1):
        scene.frame_set(frame)
        places.append(scene.camera.matrix_world.translation.copy())
    return np.array(places)


@pytest.mark.parametrize("of", ["row80", "landscape"])
def test_camera_walks_over_the_ground(clean_file, of):

    places = _walked(25, of)
    steps = np.diff(places[:, :2], axis=0)
    assert np.allclose(np.linalg.norm(steps, axis=1), fly_through.SPEED / 24, rtol=1e-3)
    assert np.ptp(places[:, 0]) < 1e-5, "the walk is straight"
    ground = bpy.data.objects["Ground"]
    heights = [p[2] - ground.ray_cast((p[0], p[1], 1e4), (0, 0, -1))[1].z for p in places.tolist()]
    assert np.ptp(heights) < 1e-3
    assert 1.5 < heights[0] < 4.0


def test_walk_between_frames_is_straight(clean_file):
    places = _walked(3, "row80")
    scene = bpy.context.scene
    scene.frame_set(1, subframe=0.25)
    between = np.array(scene.camera.matrix_world.translation)
    assert np.allclose(between, places[0] + 0.25 * (places[1] - places[0]), atol=1e-4)


def test_first_frame_of_the_row_is_its_still(clean_file):

    first = _walked(2, "row80")[0]
    session.clean_file()
    row80.build(bpy.context.scene)
    depsgraph()
    # The walk stands on the ground's mesh, the still on the land that the mesh samples.
    assert np.allclose(first, bpy.context.scene.camera.matrix_world.translation, atol=1e-4)


def test_walk_through_the_landscape_is_clear_of_plants(clean_file):
    places = _walked(25, "landscape")
    plants = read_plants(bpy.context.scene, depsgraph())[0].position
    away = np.linalg.norm(plants[None, :, :2] - places[:, None, :2], axis=2).min()

    tree = KDTree(len(plants))
    for number, place in enumerate(plants.tolist()):
        tree.insert((*place[:2], 0.0), number)
    tree.balance()
    neighbors = [tree.find_n((*place[:2], 0.0), 2)[1][2] for place in plants[::50].tolist()]
    assert away > np.median(neighbors), "half of all plants have a neighbor that is closer"


def test_unknown_scene_is_named(clean_file):

    with pytest.raises(ValueError, match="no walk through 'sea'"):
        fly_through.build(bpy.context.scene, of="sea")
