# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A file that is saved in the middle of a refinement or a render holds what it held before, and the work goes on."""

from __future__ import annotations

import bpy
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, tiny_render
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results import collection

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def scene():
    scene = tiny_render(size=96)
    add_camera(location=(0.0, -5.0, 1.0))
    add_plant()
    add_mesh("stone", size=0.5).tetflora.is_explicit = True
    scene.tetflora.output.save_results = True
    return scene


@pytest.mark.parametrize("moment", ["Refining", "Making polygons", "Keeping polygons", "Making proxies"])
def test_half_a_result_is_in_no_file(scene, tmp_path, moment):
    refine.refine(scene, depsgraph())
    names = sorted(o.name for o in bpy.data.collections["TetFlora"].objects)
    scene.tetflora.leaf_limit = 0.5  # another result
    saved = 0
    for step in refine.refine_steps(scene, depsgraph()):
        if step.message.startswith(moment):
            bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "meanwhile.blend"), copy=True)
            saved += 1
    assert saved
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "after.blend"), copy=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "meanwhile.blend"))
    assert [c.name for c in bpy.data.collections] == ["TetFlora"]
    assert sorted(o.name for o in bpy.data.collections["TetFlora"].objects) == names
    assert bpy.data.objects["stone"].hide_render
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "after.blend"))
    assert len(collection.result_collections(bpy.context.scene, 'VIEW')) == 1


def test_bounces_that_are_raised_for_a_render_are_not_saved(scene, tmp_path):
    scene.tetflora.proxy_kind = 'SHELLS'
    cycles = scene.cycles
    cycles.transparent_max_bounces, cycles.min_transparent_bounces = 8, 2
    path = tmp_path / "meanwhile.blend"
    seen = []

    def save(*_):
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
        seen.append((cycles.transparent_max_bounces, cycles.min_transparent_bounces))

    bpy.app.handlers.render_pre.append(save)
    try:
        scene.render.filepath = str(tmp_path / "picture")
        bpy.ops.render.render(write_still=True)
    finally:
        bpy.app.handlers.render_pre.remove(save)
    assert seen == [(256, 256)]
    assert (cycles.transparent_max_bounces, cycles.min_transparent_bounces) == (8, 2)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    cycles = bpy.context.scene.cycles
    assert (cycles.transparent_max_bounces, cycles.min_transparent_bounces) == (8, 2)
    assert collection.result_collections(bpy.context.scene) == []
    assert not bpy.data.objects["stone"].hide_render
