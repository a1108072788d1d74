# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each operator does, what it refuses and that a refusal changes nothing."""

from __future__ import annotations

import json
import re

import bpy
import pytest

import operators
from devtools import build
from operators import ground_tools
from panels import outputs
from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, select, tiny_render
from tetflora_addon.blender.job import refine, render
from tetflora_addon.blender.results.collection import has_results

_NAMED = re.compile(r'(?:\bButton\(\s*"|"tetflora\.|\boperator = ")(\w+)"')  # operators of buttons in a source text

pytestmark = pytest.mark.usefixtures("clean_file")


def _ops():
    return bpy.ops.tetflora


def _plants():
    return {o.name: o.tetflora for o in bpy.data.objects if o.tetflora.is_plant}


def _small_forest():
    add_camera(location=(0.0, -60.0, 2.0))
    for i in range(2):
        add_plant(f"p{i}", seed=i, location=(3.0 * i, 3.0 * i, 0.0))
    select()
    return tiny_render()


def test_every_class_of_operators_is_registered_under_its_own_name(blender):
    classes = operators.CLASSES
    registered = {name for name in dir(bpy.types) if name.startswith("TETFLORA_OT_")}
    assert {cls.__name__ for cls in classes} == registered
    assert all(cls.bl_idname == cls.__name__.replace("TETFLORA_OT_", "tetflora.") for cls in classes)


def test_every_button_has_an_operator(blender):
    texts = [path.read_text(encoding="utf-8") for path in (build.ROOT / "panels").glob("*.py")]
    named = {name for text in texts for name in _NAMED.findall(text)}
    known = {cls.bl_idname.removeprefix("tetflora.") for cls in operators.CLASSES}
    assert len(named & known) > 45
    assert sorted(named - known) == []


def test_add_plant_stands_at_the_cursor_with_another_seed_each_time():
    bpy.context.scene.cursor.location = (1.0, 2.0, 3.0)
    _ops().add_plant(species="conifer")
    _ops().add_plant(species="conifer")
    _ops().add_plant(species="bush", seed=9, location=(4.0, 0.0, 0.0), scale=2.0, azimuth=1.0)
    objects = [o for o in bpy.data.objects if o.tetflora.is_plant]
    assert sorted(o.tetflora.species for o in objects) == ["bush", "conifer", "conifer"]
    bush = next(o for o in objects if o.tetflora.species == "bush")
    assert tuple(bush.location) == (4.0, 0.0, 0.0)
    assert (bush.tetflora.seed, bush.scale.z, bush.rotation_euler.z) == (9, 2.0, 1.0)
    assert bpy.context.view_layer.objects.active == bush
    assert bpy.context.selected_objects == [bush]
    conifers = [o for o in objects if o != bush]
    assert all(tuple(o.location) == (1.0, 2.0, 3.0) for o in conifers)
    assert conifers[0].tetflora.seed != conifers[1].tetflora.seed
    assert all(o.empty_display_size > 1.0 for o in conifers)
    assert bpy.context.scene.render.use_lock_interface


def test_reseed_parts_copies_and_leaves_others_alone():
    plants = [add_plant(f"p{i}", seed=5) for i in range(4)]
    select(*plants[:3])
    _ops().reseed()
    first = {name: p.seed for name, p in _plants().items()}
    assert len(set(first.values())) == 4
    assert first["p3"] == 5
    _ops().reseed(roll=1)
    assert not {p.seed for p in _plants().values()} & set(first.values()) - {5}


def test_species_are_selected_assigned_and_removed():
    add_plant("a", "bush")
    add_plant("b", "conifer")
    add_plant("c", "gone")
    mesh = add_mesh("terrain")
    select(bpy.data.objects["a"])
    _ops().select_plants()
    assert [o.name for o in bpy.context.selected_objects] == ["a"]
    _ops().select_plants(species="gone", extend=True)
    assert {o.name for o in bpy.context.selected_objects} == {"a", "c"}
    _ops().assign_species(species="conifer")
    assert {n: p.species for n, p in _plants().items()} == {"a": "conifer", "b": "conifer", "c": "conifer"}
    select(bpy.data.objects["a"], mesh)
    _ops().remove_plants()
    assert sorted(o.name for o in bpy.data.objects) == ["b", "c", "terrain"]
    assert _ops().remove_plants(which='SPECIES', species="bush") == {'CANCELLED'}
    _ops().remove_plants(which='ALL')
    assert [o.name for o in bpy.data.objects] == ["terrain"]


def test_removing_the_last_plant_takes_the_empty_collection_along():
    _ops().add_plant(species="bush")
    assert [c.name for c in bpy.data.collections] == ["TetFlora plants"]
    _ops().remove_plants(which='ALL')
    assert not bpy.data.collections


def test_mark_occluder_toggles_meshes_only():
    first, second = add_mesh("first"), add_mesh("second")
    plant = add_plant()
    select(first, second, plant)
    first.tetflora.is_occluder = True
    _ops().mark(what='OCCLUDER')
    assert first.tetflora.is_occluder
    assert second.tetflora.is_occluder
    assert not plant.tetflora.is_occluder
    _ops().mark(what='OCCLUDER')
    assert not any(o.tetflora.is_occluder for o in bpy.data.objects)


def test_lists_grow_and_shrink():
    settings = bpy.context.scene.tetflora
    assert _ops().edit_list(owner="scene.tetflora.populate", entries="mix", action='REMOVE') == {'CANCELLED'}
    for _ in range(3):
        _ops().edit_list(owner="scene.tetflora.populate", entries="mix", action='ADD')
    species = [entry.species for entry in settings.populate.mix]
    assert len(set(species)) == 3
    assert settings.populate.mix_index == 2
    settings.populate.mix_index = 0
    _ops().edit_list(owner="scene.tetflora.populate", entries="mix", action='REMOVE')
    assert [entry.species for entry in settings.populate.mix] == species[1:]
    _ops().edit_list(owner="scene.tetflora", entries="leaf_objects", action='ADD')
    assert len(settings.leaf_objects) == 1


def test_a_picture_of_a_gallery_adds_its_species_to_the_list():
    group, plant = bpy.context.scene.tetflora, add_plant().tetflora
    lists = (group.populate, "mix"), (group.stand, "species"), (group.output, "species"), (plant, "field_species")
    for owner, entries in (*lists, (group, "leaf_objects")):
        owner.add_species = "birch"
        owner.add_species = "oak"
        assert [entry.species for entry in getattr(owner, entries)] == ["birch", "oak"]
        assert getattr(owner, f"{entries}_index") == 1
        # The button itself shows a plus again, and choosing that adds nothing.
        assert owner.add_species == "PLUS"
        owner.add_species = "PLUS"
        assert len(getattr(owner, entries)) == 2


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("populate", "Select a mesh"),
        ("reseed", "Select plants or a field"),
        ("assign_species", "Select plants or a field"),
        ("refine", "no active camera"),
        ("clear", "No results to clear"),
    ],
)
def test_disabled_buttons_say_why(name, says):
    select()
    with pytest.raises(RuntimeError, match=says):
        getattr(_ops(), name)()


def test_what_a_render_could_not_use_is_forgotten_once_refine_can():
    scene = _small_forest()
    plant = next(o for o in scene.objects if o.tetflora.is_plant)
    plant.scale = (0.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    render.on_render_init(scene)
    render.on_render_pre(scene)
    render.on_render_end(scene)
    assert len(render.render_errors()) == 1
    with pytest.raises(RuntimeError, match="zero scale"):
        _ops().refine()
    assert len(render.render_errors()) == 1
    plant.scale = (1.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    _ops().refine()
    assert render.render_errors() == []


def test_refine_makes_meshes_and_figures_and_clear_takes_them_back():
    scene = _small_forest()
    before = datablocks()
    assert _ops().refine() == {'FINISHED'}
    assert has_results(scene)
    figures = json.loads(scene.tetflora.statistics)
    assert figures["plants"] == 2
    assert figures["polygons_meshed"] + figures["polygons_proxy"] > 0
    rows = dict(outputs.rows_of(scene.tetflora.statistics))
    passes = outputs.steps_of(scene.tetflora.statistics)
    assert [int(row[0]) for row in passes] == list(range(1, len(passes) + 1))
    assert passes[-1][1] == rows["Tetrahedra"]
    assert passes[-1][2] == "0"
    assert rows["Plants"] == "2"
    assert rows["Polygons If Expanded"] == f"{figures['polygons_full']:,}"
    assert len(bpy.data.meshes) > 0
    assert _ops().clear() == {'FINISHED'}
    assert datablocks() == before
    assert outputs.rows_of(scene.tetflora.statistics) == ()
    assert outputs.steps_of(scene.tetflora.statistics) == ()


def _refined_rock():
    """A square that was refined by the button."""
    add_camera(location=(0.0, -60.0, 2.0))
    rock = add_mesh("rock")
    rock.tetflora.is_explicit = True
    tiny_render()
    _ops().refine()
    assert (rock.hide_render, rock.hide_viewport) == (True, True)
    return rock


@pytest.mark.parametrize("unlinked", [False, True])
def test_clear_shows_what_results_that_were_deleted_by_hand_hid(unlinked):
    """Also where the mesh was unlinked from the scene, or the scene was renamed meanwhile."""
    rock, scene = _refined_rock(), bpy.context.scene
    (made,) = (c for c in bpy.data.collections if "tetflora_purpose" in c)
    bpy.data.batch_remove([*made.objects, made])
    if unlinked:
        rock.use_fake_user = True
        scene.collection.objects.unlink(rock)
        scene.name = "renamed"
    assert not has_results(scene)
    assert _ops().clear() == {'FINISHED'}
    assert (rock.hide_render, rock.hide_viewport) == (False, False)
    assert not _ops().clear.poll()


def test_clear_shows_a_mesh_only_when_no_scene_has_results_in_its_place():
    """A scene that is renamed keeps its claim."""
    rock, first = _refined_rock(), bpy.context.scene
    second = bpy.data.scenes.new("second")
    for obj in (rock, first.camera):
        second.collection.objects.link(obj)
    second.camera = first.camera
    with bpy.context.temp_override(scene=second, view_layer=second.view_layers[0]):
        refine.refine(second, bpy.context.evaluated_depsgraph_get())
    assert has_results(second)
    second.name = "other"
    _ops().clear()
    assert (rock.hide_render, rock.hide_viewport) == (True, True)
    assert not _ops().clear.poll()
    refine.clear(second)
    assert (rock.hide_render, rock.hide_viewport) == (False, False)
    assert "tetflora_hidden" not in rock


def _bare_leaf():
    entry = bpy.context.scene.tetflora.leaf_objects.add()
    entry.species, entry.leaf = _plants()["p0"].species, add_mesh("Bald", faces=())


@pytest.mark.parametrize(
    ("break_it", "says"),
    [
        (lambda: _ops().remove_plants(which='ALL'), "No plants to render"),
        (lambda: add_plant("Flat", scale=(0.0, 0.0, 0.0)), '"Flat": zero scale'),
        (lambda: setattr(add_mesh("Bare", faces=()).tetflora, "is_occluder", True), '"Bare" has no faces'),
        (_bare_leaf, "Bald.*no faces"),  # found when the work has begun
    ],
)
def test_refine_reports_what_is_wrong_and_changes_nothing(break_it, says):
    _small_forest()
    break_it()
    before = datablocks()
    with pytest.raises(RuntimeError, match=says):
        _ops().refine()
    assert datablocks() == before


class _Tool(ground_tools.GroundTool):
    """A tool on the ground without a window, which points at its ground at each event."""

    bl_label = "Point"

    def __init__(self):
        self.said = []
        self._look_around(bpy.context)

    def report(self, kind, text):
        self.said.append((kind, text))

    def handle(self, context, event):
        return {'RUNNING_MODAL'} if self._ground.objects[0].name else {'PASS_THROUGH'}


@pytest.mark.parametrize("removed", ["ground", "scene", "view layer"])
def test_a_tool_on_the_ground_ends_with_a_message_when_that_goes(removed):
    bpy.data.scenes.new("another")
    bpy.context.scene.view_layers.new("other")
    add_mesh("ground", size=8.0)
    bpy.context.view_layer.update()
    tool = _Tool()
    assert tool.modal(bpy.context, None) == {'RUNNING_MODAL'}
    if removed == "ground":
        bpy.data.objects.remove(bpy.data.objects["ground"])
    elif removed == "scene":
        bpy.data.scenes.remove(bpy.context.scene)
    else:
        bpy.context.scene.view_layers.remove(bpy.context.view_layer)
    assert tool.modal(bpy.context, None) == {'CANCELLED'}
    assert tool._ground is None
    ((kind, text),) = tool.said
    assert kind == {'ERROR'}
    assert text.startswith("Point was stopped because") and text.endswith("was deleted; start it again")
