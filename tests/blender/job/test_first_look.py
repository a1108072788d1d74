# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A coarse result while the job goes on: when it comes, what it leaves, and that the real one is as without it."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest

from operators.refine import TETFLORA_OT_refine
from tests.blender.digests import difference, everything
from tests.blender.scenes import add_camera, add_plant, datablocks
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results.collection import has_results, result_collections

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def scene(monkeypatch):
    """Two trees, for which a first look is worth its while."""
    monkeypatch.setattr(refine, "_MANY", 1)
    monkeypatch.setattr(refine, "FIRST_LOOK", 150)
    add_camera(location=(0.0, -60.0, 4.0))
    for i in range(2):
        add_plant(f"tree {i}", seed=i, location=(4.0 * i - 4.0, 500.0 * i, 0.0))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    return scene


def _steps(scene):
    return refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get(), first_look=True)


def _until_shown(steps, scene):
    """Go on until a result is shown."""
    for _ in steps:
        if found := result_collections(scene, 'VIEW'):
            return found[0]
    raise AssertionError("there was no first look")


def _polygons(collection):
    return sum(len(o.data.polygons) for o in collection.objects if o.type == 'MESH')


def test_a_coarse_result_is_shown_first_and_replaced(scene):
    steps = _steps(scene)
    coarse = _polygons(_until_shown(steps, scene))
    assert coarse > 0
    for _ in steps:
        pass
    (collection,) = result_collections(scene, 'VIEW')
    assert _polygons(collection) > 2 * coarse


def test_the_result_is_the_same_as_without_it(scene):
    scene.tetflora.facet = 5.0  # one tile: objects of several lie in the collection in the order in which they come
    refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    expected = everything()
    refine.clear(scene)
    for _ in _steps(scene):
        pass
    found = [path for path in difference(expected, everything()) if "statistics" not in path]  # they hold seconds
    assert found == []


def test_it_stays_when_the_job_is_closed(scene):
    steps = _steps(scene)
    _until_shown(steps, scene)
    next(steps)
    steps.close()
    assert has_results(scene)
    refine.clear(scene)
    assert not has_results(scene)


def test_esc_in_refine_takes_it_away(scene):
    before = datablocks()
    steps = TETFLORA_OT_refine.steps(SimpleNamespace(), bpy.context)
    _until_shown(steps, scene)
    next(steps)
    steps.close()
    assert not has_results(scene)
    assert datablocks() == before


def test_an_image_that_is_hardly_larger_has_none(scene, monkeypatch):
    """Of First Forest it took 12 of 46 seconds."""
    monkeypatch.setattr(refine, "FIRST_LOOK", 160)
    monkeypatch.setattr(refine, "_first_look", lambda *_: pytest.fail("it takes half as long as all"))
    for _ in _steps(scene):
        pass
    assert has_results(scene)


def test_nobody_waits_for_it_in_the_background(scene, monkeypatch):
    monkeypatch.setattr(refine, "_first_look", lambda *_: pytest.fail("nobody sees it"))
    assert bpy.ops.tetflora.refine() == {'FINISHED'}


def test_little_is_spent_on_what_nobody_sees_in_it(scene, monkeypatch):
    """Of a small image it had half of what the whole result has, and took half of its time."""
    found, original = [], refine.drawing
    monkeypatch.setattr(refine, "drawing", lambda *a, **k: found.append(original(*a, **k)) or found[-1])
    for _ in _steps(scene):
        pass
    first, whole = found
    assert first.facet > whole.facet
    assert first.hidden >= 4.0 * whole.hidden
    assert first.shadow > 16.0 and whole.shadow == 0.0
