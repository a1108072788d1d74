# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""*Max Memory* holds for Blender and its other processes together, and for *Expand Everything* too."""

from __future__ import annotations

import re
from contextlib import nullcontext

import bpy
import pytest

from tests.blender.scenes import add_camera, add_plant, datablocks
from tetflora_addon import errors, memory, parallel
from tetflora_addon.blender.job import contents, refine
from tetflora_addon.blender.results.collection import has_results
from tetflora_addon.blender.scene.camera import read_camera
from tetflora_addon.processes import pool

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def scene() -> bpy.types.Scene:
    """A camera at the height of eyes, far from a spruce."""
    add_camera(location=(0.0, -300.0, 1.7))
    add_plant(species="spruce")
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 1280, 720
    scene.tetflora.quality = 'DRAFT'
    return scene


def test_what_would_not_fit_is_refused_before_it_is_begun(scene, monkeypatch) -> None:
    """The spruce alone has more than ten million polygons from so near, and half of one from afar."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    refine.refine(scene, depsgraph)
    before = datablocks()
    begun = []
    monkeypatch.setattr(refine, "expanded_blocks", lambda *_: begun.append(1) or iter(()))
    scene.tetflora.expand_everything = True
    scene.tetflora.max_memory = memory.resident() / 1e9 + 2.0
    scene.camera.location.y = -4.0
    with pytest.raises(errors.SceneError, match="Expand Everything would make more than") as caught:
        refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    polygons, needed, left = map(float, re.findall(r"(\d+\.\d)", str(caught.value)))
    assert polygons > 3.0 and needed > left and "Raise Max Memory" in str(caught.value)
    assert not begun and datablocks() == before and has_results(scene)
    scene.camera.location.y = -300.0
    refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    assert begun


def test_leaves_of_many_corners_need_more_memory(monkeypatch) -> None:
    """Six oaks are 2.5 million polygons, but five times as many triangles: such take 300 bytes each, and more."""
    add_camera(location=(0.0, -300.0, 1.7))
    for number in range(6):
        add_plant(f"p{number}", species="oak", seed=number, location=(9.0 * number, 0.0, 0.0))
    scene = bpy.context.scene
    monkeypatch.setattr(refine, "expanded_blocks", lambda *_: iter(()))
    scene.tetflora.expand_everything = True
    for gigabytes, fits in ((4.0, False), (8.0, True)):
        monkeypatch.setattr(contents, "memory_left", lambda *_, left=gigabytes * 1e9: left)
        with (
            nullcontext() if fits else pytest.raises(errors.SceneError, match=r"2\.5 million polygons, which take 5\.0")
        ):
            refine.refine(scene, bpy.context.evaluated_depsgraph_get())


def test_other_processes_have_a_part_of_the_limit(scene, monkeypatch) -> None:
    camera = read_camera(scene, bpy.context.evaluated_depsgraph_get())
    scene.tetflora.max_memory = 64.0
    left = []
    for threads in (1, 8, 16):
        monkeypatch.setattr(parallel, "threads", lambda threads=threads: threads)
        left.append(contents.memory_left(scene, camera))
    each = pool._BYTES_EACH
    assert left[0] - left[1] == pytest.approx(8 * each, abs=2e8)
    assert left[1] - left[2] == pytest.approx(8 * each, abs=2e8)
    scene.tetflora.max_memory = 2.0
    assert pool.share(2e9) <= 5e8  # fewer processes, rather than no plants
    before = pool.share(2e9)
    monkeypatch.setattr(pool._pool, "largest", 4e8)  # as the second frame of a film knows
    assert pool.share(2e9) == before > 0.0


def test_a_job_tells_processes_how_much_they_may_take(scene, monkeypatch) -> None:
    told = []
    monkeypatch.setattr(pool, "set_memory_limit", told.append)
    scene.tetflora.max_memory = 3.0
    refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    assert told == [3e9]
