# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sharp by parts: what is fine takes the place of the first look tile by tile, and nothing is there twice or left."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest

from tests.blender.scenes import add_camera, add_plant, datablocks
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results import collection
from tetflora_addon.blender.results.collection import Results, result_collections

pytestmark = [pytest.mark.usefixtures("clean_file"), pytest.mark.fine]


@pytest.fixture
def scene(monkeypatch):
    """A far tree on the left, a near one on the right and one beside the image, whose middle tile of three is empty."""
    monkeypatch.setattr(refine, "_MANY", 1)
    monkeypatch.setattr(refine, "FIRST_LOOK", 150)
    add_camera(location=(0.0, 0.0, 3.0))
    for seed, (x, y) in enumerate(((-14.0, 60.0), (5.0, 25.0), (40.0, 25.0))):
        add_plant(f"tree {seed}", seed=seed, location=(x, y, 0.0))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 480, 120
    scene.tetflora.quality = 'DRAFT'
    return scene


@pytest.fixture
def swaps(monkeypatch):
    """What each tile is replaced by: its number, and the primitives that it loses and gets."""
    found, original = [], Results._replace

    def replace(self, tile):
        found.append((tile, *(primitives(one.tiles.get(tile, ())) for one in (self.first, self))))
        original(self, tile)

    monkeypatch.setattr(Results, "_replace", replace)
    return found


def primitives(objects):
    """Faces and points of objects; where Python cannot resize point clouds, points are vertices."""
    kinds = ("polygons", "points", "vertices")
    return sum(next((n for kind in kinds if (n := len(getattr(o.data, kind, ())))), 0) for o in objects)


def seen(scene):
    """Those of all results of the scene."""
    return primitives(o for c in result_collections(scene, 'VIEW') for o in c.objects)


def steps(scene):
    return refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get(), first_look=True)


def test_each_tile_is_coarse_or_fine_and_never_both(scene, swaps):
    totals = []
    for _ in steps(scene):
        if (now := seen(scene)) and now != (totals or [0])[-1]:
            totals.append(now)
    expected = [totals[0]]
    for _, lost, got in swaps:
        expected += [expected[-1] + got - lost] if got != lost else []
    assert totals == expected[: len(totals)] and len(totals) >= 3
    assert seen(scene) == expected[-1] == sum(got for *_, got in swaps)
    assert sum(lost for _, lost, _ in swaps) == totals[0]


def test_the_nearest_tile_comes_first_and_what_is_outside_last(scene, swaps):
    for _ in steps(scene):
        pass
    assert [tile for tile, *_ in swaps if tile is not None] == [2, 0, 3]
    assert all(lost and got for tile, lost, got in swaps if tile is not None)


def test_tiles_that_take_long_to_draw_are_shown_together(scene, swaps, monkeypatch):
    clock = [1000.0]
    monkeypatch.setattr(collection, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    shown, waited = [], []
    for progress in steps(scene):
        if progress.waiting and len(swaps) > len(shown):
            waited.append(len(swaps))
            clock[0] += 5.0  # the window draws
        shown = [*swaps]
    assert waited == [1], "the first tile alone; the others when all is made"
    assert [tile for tile, *_ in swaps if tile is not None] == [2, 0, 3]


def until_one_is_sharp(scene, swaps):
    """A job that has shown one tile of two."""
    job = steps(scene)
    while len(swaps) < 1:
        next(job)
    return job


def test_stopped_in_the_middle_the_picture_is_whole_and_nothing_waits(scene, swaps):
    before = datablocks()
    until_one_is_sharp(scene, swaps).close()
    (shown,) = result_collections(scene, 'VIEW')
    (tile, lost, got), coarse = swaps[0], sum(primitives([o]) for o in shown.objects)
    assert tile == 2 and got > lost
    assert coarse == seen(scene) > got
    assert {o for o in bpy.data.objects if "tetflora_kind" in o} == {*shown.objects}
    assert all(mesh.users for mesh in bpy.data.meshes)
    assert [c for c in bpy.data.collections if not c.users] == []
    refine.clear(scene)
    assert datablocks() == before


def test_clear_in_the_middle_leaves_nothing(scene, swaps):
    before = datablocks()
    job = until_one_is_sharp(scene, swaps)
    assert bpy.ops.tetflora.clear() == {'FINISHED'}
    job.close()
    assert datablocks() == before


def test_a_file_that_is_saved_in_the_middle_holds_what_is_seen(scene, swaps, tmp_path):
    scene.tetflora.output.save_results = True
    job, path = until_one_is_sharp(scene, swaps), str(tmp_path / "meanwhile.blend")
    expected = seen(scene)
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    job.close()
    bpy.ops.wm.open_mainfile(filepath=path)
    assert seen(bpy.context.scene) == expected
    assert len(bpy.data.collections) == 1


def test_baked_light_takes_the_place_of_all_at_once(scene, swaps):
    scene.tetflora.baked_light = 'PROXIES'
    totals = {seen(scene) for _ in steps(scene)} | {seen(scene)}
    assert len(totals) == 3  # nothing, coarse, fine
