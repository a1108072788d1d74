# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What takes part in refinement is known as texts that differ after each change of it, and read no more often."""

from __future__ import annotations

import bpy
import pytest
from mathutils import Matrix

from devtools import session
from tests.blender.scenes import add_camera, add_mesh, add_plant, select
from tetflora_addon.blender import compat
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
