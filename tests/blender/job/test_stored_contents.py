# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What takes part in refinement is known as texts that differ after each change of it, and read no more often."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest
from mathutils import Matrix

from devtools import session
from tests.blender.scenes import add_camera, add_mesh, add_plant, select
from tetflora_addon.blender import compat, runtime
from tetflora_addon.blender.job import stored_contents
from tetflora_addon.blender.scene import fields
from tetflora_addon.blender.viewport import auto

CHANGES = {
    "moved": ("the plants", lambda scene: _set("plant", location=(3.0, 0.0, 0.0))),
    "turned": ("the plants", lambda scene: _set("plant", rotation_euler=(0.0, 0.0, 1.0))),
    "scaled": ("the plants", lambda scene: _set("plant", scale=(2.0, 2.0, 2.0))),
    "carried": ("the plants", lambda scene: _set("carrier", location=(0.0, 0.0, 1.0))),
    "reseeded": ("the plants", lambda scene: _set("plant", "tetflora", seed=77)),
    "another species": ("the plants", lambda scene: _set("plant", "tetflora", species="oak")),
    "older": ("the plants", lambda scene: _set("plant", "tetflora", age=20.0)),
    "disabled": ("the plants", lambda scene: _set("plant", "tetflora", enabled=False)),
    "field moved": ("the plants", lambda scene: _set("field", location=(3.0, 0.0, 0.0))),
    "points moved": ("the plants", lambda scene: _stretch("field")),
    "field has nodes": ("the plants", lambda scene: bpy.data.objects["field"].modifiers.new("more", 'ARRAY')),
    "occluder moved": ("the meshes", lambda scene: _set("wall", location=(3.0, 0.0, 0.0))),
    "no occluder": ("the meshes", lambda scene: _set("wall", "tetflora", is_occluder=False)),
    "own tree grows": ("the meshes", lambda scene: bpy.data.objects["own"].modifiers.new("more", 'ARRAY')),
    "own tree modeled": ("the meshes", lambda scene: _stretch("own")),
    "own tree painted": ("the meshes", lambda scene: _paint("own")),
    "sun turned": ("the light", lambda scene: _set("sun", rotation_euler=(1.0, 0.0, 0.0))),
    "wind": ("the wind", lambda scene: setattr(scene.tetflora.wind, "enabled", True)),
    "species edited": ("the species", lambda scene: setattr(scene.tetflora.species_edits.add(), "identifier", "a")),
    "renamed": (None, lambda scene: _set("held", name="another")),
    "selected": (None, lambda scene: bpy.data.objects["plant"].select_set(False)),
    "something else": (None, lambda scene: _stretch("rock")),
}


def _set(obj, group="", **values):
    obj = bpy.data.objects[obj]
    for key, value in values.items():
        setattr(getattr(obj, group) if group else obj, key, value)
    if group:
        obj.update_tag()  # as the window does


def _stretch(name):
    mesh = bpy.data.objects[name].data
    mesh.transform(Matrix.Scale(1.5, 4))
    mesh.update()


def _paint(name):
    material = bpy.data.objects[name].data.materials[0]
    compat.shader_tree(material).nodes["Principled BSDF"].inputs["Base Color"].default_value = (1.0, 0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def refined(blender):
    """A scene with all kinds of things that take part, and its results."""
    session.clean_file()
    scene = bpy.context.scene
    add_camera(location=(0.0, -30.0, 3.0))
    scene.tetflora.quality = 'DRAFT'
    add_plant("plant")
    add_plant("held", location=(4.0, 0.0, 0.0)).parent = carrier = bpy.data.objects.new("carrier", None)
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", 'SUN'))
    for obj in (carrier, sun):
        scene.collection.objects.link(obj)
    add_mesh("wall").tetflora.is_occluder = True
    add_mesh("sheet").tetflora.is_explicit = True
    add_mesh("rock")
    field, own = add_mesh("field"), add_mesh("own")
    field.tetflora.is_field, field.tetflora.species = True, "bush"
    own.data.materials.append(bpy.data.materials.new("bark"))
    select(own)
    bpy.ops.tetflora.use_as_species()
    add_plant("of mine", species=scene.tetflora.asset_species[0].identifier)
    bpy.context.view_layer.update()
    bpy.ops.tetflora.refine()
    assert auto.changed_since(scene) == []
    return scene


@pytest.mark.parametrize("change", CHANGES)
def test_results_say_what_of_the_scene_has_changed(refined, change):
    scene, (what, make) = refined, CHANGES[change]
    bpy.context.view_layer.update()
    auto.note_results(scene, auto.results_made_for(scene))
    assert auto.changed_since(scene) == []
    make(scene)
    bpy.context.view_layer.update()
    assert auto.changed_since(scene) == ([what] if what else [])


def test_what_takes_part_is_read_only_after_a_change_of_it(refined, monkeypatch):
    scene, plant, rock, read = refined, bpy.data.objects["plant"], bpy.data.objects["rock"], []
    bpy.context.view_layer.update()
    auto.note_results(scene, auto.results_made_for(scene))
    real = stored_contents._read
    monkeypatch.setattr(stored_contents, "_read", lambda *given: read.append(1) or real(*given))
    for _ in range(3):
        assert auto.changed_since(scene) == []
    plant.select_set(False)
    scene.tetflora.cutoff *= 1.0
    bpy.context.view_layer.update()
    assert auto.changed_since(scene) == [] and read == []
    plant.location.x += 1.0
    bpy.context.view_layer.update()
    assert auto.changed_since(scene) == ["the plants"] and read == [1]
    plant.location.x -= 1.0
    rock.location.x += 1.0
    bpy.context.view_layer.update()
    assert auto.changed_since(scene) == []


def test_years_of_stands_are_not_looked_for_among_objects_where_no_mesh_has_any(refined, monkeypatch):
    monkeypatch.setattr(fields, "has_history", lambda _obj: pytest.fail("looked at an object"))
    assert fields.stand_years(refined) == []


class _Looks:
    """What panels say, looked for as timers do it, on a clock by which each step takes a millisecond."""

    def __init__(self, monkeypatch, layer):
        self.layer, self.now, self.begun, self.slices = layer, 0.0, 0, []
        monkeypatch.setattr(runtime, "time", SimpleNamespace(perf_counter=lambda: self.now))
        monkeypatch.setattr(runtime, "call_soon", lambda *_: None)
        window = SimpleNamespace(scene=layer.id_data, view_layer=layer, screen=SimpleNamespace(areas=[]))
        context = SimpleNamespace(window_manager=SimpleNamespace(windows=[window]))
        monkeypatch.setattr(runtime, "bpy", SimpleNamespace(app=SimpleNamespace(background=False), context=context))
        stored_contents._forget()
        self.outlook = runtime.Outlook(self._steps)
        self.outlook.ask()

    def _steps(self, scene, layer):
        self.begun += 1
        steps = stored_contents.stored_contents_steps(scene, layer)
        while True:
            self.now += 1e-3
            try:
                next(steps)
            except StopIteration as stop:
                return stop.value
            yield

    def look(self, times=10**6):
        """Look as often, or to the end; what was found."""
        for _ in range(times):
            before = self.now
            again = self.outlook._look()
            self.slices.append(self.now - before)
            self.now += again or 0.0
            if again is None:
                break
        return self.outlook.of(self.layer.id_data, self.layer)


@pytest.fixture
def plants(blender):
    """A view layer with many plants."""
    session.clean_file()
    for number in range(300):
        add_plant(f"plant {number}", seed=number, location=(number, 0.0, 0.0))
    bpy.context.view_layer.update()
    return bpy.context.view_layer


def test_many_plants_are_read_in_slices_and_come_to_the_same(plants, monkeypatch):
    whole = stored_contents.stored_contents(plants.id_data, plants)
    looks = _Looks(monkeypatch, plants)
    assert looks.look() == whole
    assert len(looks.slices) > 30
    assert max(looks.slices) < 0.02
    # What has not changed is not read again.
    looks.slices.clear()
    looks.outlook.ask()
    assert looks.look() == whole
    assert len(looks.slices) < 40


def test_a_change_in_the_middle_begins_anew_after_a_pause(plants, monkeypatch):
    looks = _Looks(monkeypatch, plants)
    assert looks.look(35) is None
    bpy.data.objects["plant 1"].location.z = 5.0
    plants.update()
    stored_contents._on_update(plants.id_data, plants.depsgraph)
    looks.outlook.ask()
    waits = looks.outlook._look()
    assert waits >= 0.2
    assert looks.begun == 1
    found = looks.look()
    assert looks.begun == 2
    stored_contents._forget()
    assert found == stored_contents.stored_contents(plants.id_data, plants)


def test_panels_that_ask_do_not_disturb_a_look(plants, monkeypatch):
    looks = _Looks(monkeypatch, plants)
    for _ in range(10**3):
        if looks.look(1) is not None:
            break
    assert looks.begun == 1


def test_a_plant_that_is_deleted_in_the_middle_is_no_error(plants, monkeypatch):
    looks = _Looks(monkeypatch, plants)
    assert looks.look(40) is None
    for number in range(100, 300):
        bpy.data.objects.remove(bpy.data.objects[f"plant {number}"])
    found = looks.look()
    assert looks.begun == 2
    assert found == stored_contents.stored_contents(plants.id_data, plants)


@pytest.mark.parametrize("what", ["many plants", "a mesh of many points"])
def test_no_step_reads_more_than_one_thing(plants, monkeypatch, what):
    """A plant, or an attribute of a mesh."""
    if what == "a mesh of many points":
        ground = add_mesh("wall")
        ground.tetflora.is_occluder = True
        for number in range(50):
            ground.data.attributes.new(f"paint {number}", 'FLOAT', 'POINT')
        plants.update()
    stored_contents._forget()
    number = sum(1 for _ in stored_contents.stored_contents_steps(plants.id_data, plants))
    assert number >= 2 * 300 + (50 if "mesh" in what else 0)


@pytest.mark.parametrize("hidden", ["lamp", "wall", "plant"])
def test_undo_of_something_else_does_not_make_results_out_of_date(blender, hidden):
    """Nobody evaluates what is hidden: after undo its place in the world was none, and the light had changed."""
    session.clean_file()
    scene = bpy.context.scene
    add_camera()
    add_plant("plant", location=(1.0, 2.0, 0.0))
    add_mesh("wall").tetflora.is_occluder = True
    add_mesh("rock")
    scene.collection.objects.link(bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", 'SUN')))
    for name in ("wall", "lamp"):
        bpy.data.objects[name].location = (5.0, 1.0, 2.0)
    bpy.context.view_layer.update()
    bpy.data.objects[hidden].hide_viewport = True
    bpy.context.view_layer.update()
    before = auto.results_made_for(scene)
    bpy.ops.ed.undo_push(message="made")
    bpy.data.objects["rock"].location.z = 1.0
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    assert auto.results_made_for(scene) == before
    for name in (hidden, "rock"):  # Blender tells of no change of what is hidden, but of the other
        bpy.data.objects[name].location.z += 1.0
    bpy.context.view_layer.update()
    assert auto.results_made_for(scene) != before


def test_a_parent_of_a_mesh_that_results_hide_is_heard_of(blender):
    """Its place in the world stays what it was before it was hidden."""
    session.clean_file()
    scene = bpy.context.scene
    add_camera()
    sheet, carrier = add_mesh("sheet"), bpy.data.objects.new("carrier", None)
    scene.collection.objects.link(carrier)
    sheet.tetflora.is_explicit, sheet.parent = True, carrier
    carrier.location = (1.0, 2.0, 3.0)
    bpy.context.view_layer.update()
    before = auto.results_made_for(scene)
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert not sheet.visible_get()
    assert auto.results_made_for(scene) == before
    carrier.location.x += 1.0
    bpy.context.view_layer.update()
    assert [name for name, text in auto.results_made_for(scene).items() if before[name] != text] == ["the meshes"]
