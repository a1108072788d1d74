# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine Automatically: it follows changes, drops what is overtaken, and does nothing where nothing has changed."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, depsgraph, part


@pytest.fixture
def scene(clean_file):
    import bpy

    add_camera(location=(0.0, -30.0, 3.0))
    for i in range(3):
        add_plant(f"tree {i}", seed=i, location=(4.0 * i - 4.0, 0.0, 0.0))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 120, 90
    yield scene
    scene.tetflora.auto_refine = False


def auto():
    return part("auto_refresh")


def settle(monkeypatch) -> int:
    """Let time pass until nothing is left to do; the number of slices of work."""
    monkeypatch.setattr(auto(), "QUIET", 0.0)
    monkeypatch.setattr(auto(), "SLICE", 0.0)
    auto()._state.due = 0.0
    slices = 0
    while auto().tick() is not None:
        slices += 1
        assert slices < 10_000
    return slices


def results(scene):
    return part("emit").result_collections(scene, 'VIEW')


def test_it_refines_when_it_is_switched_on(scene, monkeypatch):
    assert not results(scene)
    scene.tetflora.auto_refine = True
    assert settle(monkeypatch) > 5
    assert len(results(scene)) == 1
    assert auto().message() == ""


def test_nothing_is_done_where_nothing_has_changed(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    made = results(scene)[0]
    auto().schedule(scene)
    assert settle(monkeypatch) == 0
    assert results(scene) == [made]


@pytest.mark.parametrize("change", ["camera", "plant", "cutoff", "seed", "new", "form"])
def test_what_changes_is_refined_again(scene, monkeypatch, change):
    import bpy

    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    made = results(scene)[0].name_full
    uid = results(scene)[0].session_uid
    plant = bpy.data.objects["tree 1"]
    if change == "camera":
        scene.camera.location.x += 1.0
    elif change == "plant":
        plant.location.x += 1.0
    elif change == "cutoff":
        scene.tetflora.cutoff *= 2.0
    elif change == "seed":
        plant.tetflora.seed += 1
    elif change == "form":
        scene.tetflora.proxy_form = 'MICROSURFACES'
    else:
        add_plant("another", seed=9, location=(0.0, 5.0, 0.0))
    bpy.context.view_layer.update()
    auto().on_change(scene, depsgraph())
    auto().schedule(scene)
    assert settle(monkeypatch) > 0
    assert len(results(scene)) == 1
    assert results(scene)[0].session_uid != uid, made


def test_what_has_nothing_to_do_with_plants_starts_nothing(scene, monkeypatch):
    import bpy

    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    made = results(scene)[0]
    add_mesh("box")
    bpy.data.materials.new("paint")
    bpy.context.view_layer.update()
    auto().schedule(scene)
    assert settle(monkeypatch) == 0
    assert results(scene) == [made]


def test_a_change_in_the_middle_drops_what_is_half_made(scene, monkeypatch):
    before = datablocks()
    scene.tetflora.auto_refine = True
    monkeypatch.setattr(auto(), "SLICE", 0.0)
    auto()._state.due = 0.0
    for _ in range(400):
        auto().tick()
        if results(scene) and results(scene)[0].objects:
            break
    assert results(scene)
    auto().on_interruption()
    assert datablocks() == before
    assert settle(monkeypatch) > 5
    assert results(scene)


def test_switched_off_it_keeps_what_is_there_and_stops(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    scene.tetflora.auto_refine = False
    scene.camera.location.x += 3.0
    assert auto().tick() is None
    assert len(results(scene)) == 1


def test_what_cannot_be_refined_is_said(scene, monkeypatch):
    import bpy

    bpy.data.objects["tree 0"].tetflora.species = "quercus"
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    assert "quercus" in auto().message()
    assert not results(scene)
    bpy.data.objects["tree 0"].tetflora.species = "bush"
    auto().schedule(scene)
    settle(monkeypatch)
    assert auto().message() == ""
    assert results(scene)


@pytest.mark.parametrize("moved", [False, True])
def test_only_a_change_of_plants_stops_the_job_not_the_flags_that_results_update(scene, monkeypatch, moved):
    import bpy

    scene.tetflora.auto_refine = True
    auto().on_change(scene, SimpleNamespace(updates=[]))  # settings as they are
    monkeypatch.setattr(auto(), "SLICE", 0.0)
    auto()._state.due = 0.0
    for _ in range(5):
        auto().tick()
    job = auto()._state.steps
    assert job is not None
    # What Blender tells of every object when a collection of results is linked.
    update = SimpleNamespace(
        id=SimpleNamespace(original=bpy.data.objects["tree 1"]),
        is_updated_transform=moved,
        is_updated_geometry=False,
        is_updated_shading=True,
    )
    auto().on_change(scene, SimpleNamespace(updates=[update]))
    assert (auto()._state.steps is job) == (not moved)
    settle(monkeypatch)
    assert len(results(scene)) == 1


def test_a_plant_hidden_while_it_works_is_heard_afterwards(scene, monkeypatch):
    import bpy

    scene.tetflora.auto_refine = True
    auto().on_change(scene, SimpleNamespace(updates=[]))
    monkeypatch.setattr(auto(), "SLICE", 0.0)
    auto()._state.due = 0.0
    for _ in range(5):
        auto().tick()
    plant = bpy.data.objects["tree 1"]
    plant.hide_render = True
    flags = {"is_updated_transform": False, "is_updated_geometry": False}
    auto().on_change(scene, SimpleNamespace(updates=[SimpleNamespace(id=SimpleNamespace(original=plant), **flags)]))
    settle(monkeypatch)
    assert '"plants": 2' in scene.tetflora.statistics or '"plants":2' in scene.tetflora.statistics
