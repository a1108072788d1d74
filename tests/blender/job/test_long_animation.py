# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A long animation leaves nothing behind, neither from frame to frame nor at its end; counts, not seconds."""

from __future__ import annotations

import bpy
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, tiny_render
from tetflora_addon.blender.job import render

FRAMES, LEG = 24, 4


@pytest.mark.parametrize("gigabytes", [0.0, 4.0], ids=["nothing kept", "results kept"])
def test_frames_of_a_animation_leave_nothing_behind(clean_file, tmp_path, gigabytes, keep_memory):
    """The camera goes to and fro: whatever is kept from frame to frame, a third round needs no more than a second."""
    scene = tiny_render(size=24)
    for n, species in enumerate(("bush", "fern")):
        add_plant(species, species, seed=n, location=(2.0 * n - 1.0, 0.0, 0.0))
    stone = add_mesh("stone", size=0.4)
    stone.tetflora.is_explicit = True
    camera = add_camera(location=(-3.0, -8.0, 2.0))
    for leg in range(FRAMES // LEG + 1):
        camera.location.x = 3.0 if leg % 2 else -3.0
        camera.keyframe_insert("location", frame=1 + leg * LEG)
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.frame_set(1)
    scene.tetflora.cutoff, scene.tetflora.leaf_limit = 8.0, 0.5
    keep_memory(gigabytes)
    scene.render.filepath = str(tmp_path / "frame_####")
    before, during, hidden = datablocks(), [], []

    def look(_scene, _depsgraph=None):  # Blender prints what is raised here, and renders on
        during.append({kind: len(names) for kind, names in datablocks().items()})
        hidden.append(stone.hide_render)

    bpy.app.handlers.render_post.append(look)
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.render_post.remove(look)
    assert render.render_errors() == []
    assert len(during) == FRAMES
    assert hidden == [True] * FRAMES
    rounds = [during[n : n + 2 * LEG] for n in range(0, FRAMES, 2 * LEG)]
    for kind in before:
        most = [max(counts[kind] for counts in one) for one in rounds]
        assert most[2] <= most[1], kind
    assert max(counts["meshes"] for counts in during) > len(before["meshes"])
    assert datablocks() == before
    assert not stone.hide_render
