# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results appear as the scene's output settings say: in files, in renders, to rays, in passes, with whose materials."""

from __future__ import annotations

import sys

import bpy
import pytest

from tests.blender.scenes import add_mesh, add_plant, datablocks, depsgraph
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results import output
from tetflora_addon.blender.results.collection import has_results
from tetflora_addon.blender.results.output import result_collections


@pytest.fixture
def scene(clean_file):
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    camera.location, camera.rotation_euler = (0.0, -14.0, 3.0), (1.4, 0.0, 0.0)
    scene.camera = camera
    scene.render.resolution_x = scene.render.resolution_y = 48
    for n, species in enumerate(("bush", "conifer")):
        add_plant(species=species, seed=n).location = (3.0 * n - 1.5, 0.0, 0.0)
    return scene


def refined(scene):
    refine.refine(scene, depsgraph())
    bpy.context.view_layer.update()
    return [o for o in scene.objects if o.get("tetflora_kind", "species") != "species"]


@pytest.mark.fine
def test_files_hold_results_only_if_asked(scene, tmp_path):
    path = str(tmp_path / "forest.blend")
    refined(scene)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    light = (tmp_path / "forest.blend").stat().st_size
    assert has_results(scene)
    bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    assert not has_results(scene)
    assert scene.tetflora.statistics == ""
    assert sorted(o.name for o in bpy.data.objects) == ["camera", "plant", "plant.001"]
    scene.tetflora.output.save_results = True
    made = len(refined(scene))
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert (tmp_path / "forest.blend").stat().st_size > 1.5 * light
    bpy.ops.wm.open_mainfile(filepath=path)
    assert len([o for o in bpy.context.scene.objects if o.get("tetflora_kind", "species") != "species"]) == made
    assert bpy.context.scene.tetflora.statistics


def test_a_mesh_that_is_hidden_for_results_is_shown_where_the_file_lacks_them(scene, tmp_path):
    rock = add_mesh("rock")
    rock.tetflora.is_explicit = True
    refined(scene)
    assert rock.hide_render
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "rock.blend"))
    assert rock.hide_render  # here results still stand for it
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "rock.blend"))
    rock = bpy.data.objects["rock"]
    assert not (rock.hide_render or rock.hide_viewport)


def test_an_edited_material_outlives_files_without_results(scene, tmp_path):
    path = str(tmp_path / "edited.blend")
    made = next(o for o in refined(scene) if o["tetflora_kind"] == "bark")
    name = made.data.materials[0].name
    made.data.materials[0].diffuse_color = (1.0, 0.0, 0.0, 1.0)
    for _ in range(2):  # the second time nothing uses it
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    again = next(o for o in refined(scene) if o.data.materials[0].name == name)
    assert tuple(again.data.materials[0].diffuse_color) == (1.0, 0.0, 0.0, 1.0)
    assert not again.data.materials[0].use_fake_user
    refine.clear(scene)
    assert name not in bpy.data.materials


def test_settings_reach_results_that_are_there_and_new_ones(scene):
    made = refined(scene)
    output = scene.tetflora.output
    output.shadow, output.camera, output.pass_index, output.light_group = False, False, 7, "forest"
    entry = output.species.add()
    entry.species, entry.pass_index, entry.light_group = "conifer", 9, "conifers"
    for again in (False, True):
        objects = refined(scene) if again else made
        own = {o["tetflora_species"]: (o.pass_index, o.lightgroup) for o in objects}
        assert own["bush"] == (7, "forest")
        assert own["conifer"] == (9, "conifers")
        assert not any(o.visible_shadow or o.visible_camera for o in objects)
        assert all(o.visible_glossy and o.visible_diffuse for o in objects)


def test_hidden_results_are_hidden(scene):
    refined(scene)
    scene.tetflora.output.show_viewport = False
    collection = result_collections(scene, 'VIEW')[0]
    assert collection.hide_viewport
    assert not collection.hide_render
    refined(scene)
    assert result_collections(scene, 'VIEW')[0].hide_viewport


@pytest.mark.parametrize("form", ['AUTOMATIC', 'MICROSURFACES', 'MICROSPHERES'])
def test_every_object_has_one_species_and_its_parent(scene, form):
    """Cryptomatte's assets are parents: one for each species, with its name."""
    scene.tetflora.proxy_kind = form
    scene.tetflora.leaf_limit = 4.0
    made = refined(scene)
    assert {o["tetflora_species"] for o in made} == {"bush", "conifer"}
    assert any(o["tetflora_kind"] == "proxy" for o in made)
    for obj in made:
        assert obj.parent.name == {"bush": "Bush (TetFlora)", "conifer": "Conifer (TetFlora)"}[obj["tetflora_species"]]
        assert obj.matrix_world.is_identity


def test_parents_keep_their_names_and_go_with_the_last_results(scene):
    before = datablocks()
    names = [{o.parent.name for o in refined(scene)} for _ in range(2)]
    refine.refine(scene, depsgraph(), for_render=True)
    render = result_collections(scene, 'RENDER')[0]
    names.append({o.parent.name for o in render.objects if o.parent is not None})
    assert names[0] == names[1] == names[2]
    refine.clear(scene, for_render=True)
    assert names[0] <= {o.name for o in bpy.data.objects}
    refine.clear(scene)
    assert datablocks() == before


def test_materials_of_the_artist_take_the_place_of_ours(scene):
    given = bpy.data.materials.new("wax")
    scene.tetflora.leaf_limit = 0.05
    made = next(o for o in refined(scene) if (o["tetflora_kind"], o["tetflora_species"]) == ("leaf", "bush"))
    made.material_slots[0].material = given  # by hand, on the result
    again = [o for o in refined(scene) if (o["tetflora_kind"], o["tetflora_species"]) == ("leaf", "bush")]
    assert [o.data.materials[0].name for o in again] == ["wax"] * len(again)
    assert scene.tetflora.output.species[0].leaf == given
    scene.tetflora.output.species[0].leaf = None
    again = [o for o in refined(scene) if o["tetflora_kind"] == "leaf"]
    assert "wax" not in {o.data.materials[0].name for o in again}


def test_kept_results_are_the_artists(scene, tmp_path):
    rock = add_mesh("rock")
    rock.tetflora.is_explicit = True
    made = refined(scene)
    assert bpy.ops.tetflora.keep_results() == {'FINISHED'}
    assert not has_results(scene)
    assert not scene.tetflora.refine_at_render
    assert refine.clear(scene) == 0
    assert rock.hide_render
    assert all(not o.hide_select for o in made)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    assert sum("proxies" in o.name or "leaf" in o.name for o in bpy.context.scene.objects) >= 2
    assert bpy.data.collections["TetFlora kept"].objects


def test_renamed_and_moved_results_are_replaced_and_cleared(scene):
    bare = datablocks()
    refined(scene)
    collection = result_collections(scene)[0]
    folder = bpy.data.collections.new("folder")
    scene.collection.children.link(folder)
    scene.collection.children.unlink(collection)
    folder.children.link(collection)
    collection.name = "my forest"
    refined(scene)
    assert [c.name for c in result_collections(scene)] == ["my forest"]
    assert sorted(c.name for c in bpy.data.collections) == ["folder", "my forest"]
    refine.clear(scene)
    bpy.data.collections.remove(folder)
    assert datablocks() == bare


def test_copies_of_results_are_the_artists_when_these_are_gone(scene):
    refined(scene)
    copied = result_collections(scene)[0].copy()
    scene.collection.children.link(copied)
    assert [c.name for c in result_collections(scene)] == ["TetFlora"]
    refine.clear(scene)
    assert result_collections(scene) == []
    assert list(scene.collection.children) == [copied]


def test_a_full_copy_of_a_scene_has_results_of_its_own(scene):
    rock = add_mesh("rock", size=0.5)
    rock.tetflora.is_explicit = True
    refined(scene)
    theirs = next(o for o in result_collections(scene)[0].objects if o.type == 'MESH').copy()
    result_collections(scene)[0].objects.link(theirs)
    bpy.ops.scene.new(type='FULL_COPY')
    copy = bpy.context.scene
    bpy.context.view_layer.update()
    (found,), (before,) = result_collections(copy), result_collections(scene)
    assert found != before
    assert not has_results(bpy.data.scenes.new("empty"))
    inside = set(before.objects)
    assert bpy.ops.tetflora.clear() == {'FINISHED'}
    assert [o.name for o in copy.objects if "tetflora_kind" in o] == [f"{theirs.name[:-4]}.003"]
    assert not [o.name for o in copy.objects if o.type == 'MESH' and o.hide_render]
    assert set(result_collections(scene)[0].objects) == inside
    assert rock.hide_render
    refined(copy)
    assert has_results(copy)
    refine.clear(scene)
    assert not has_results(scene)
    assert not rock.hide_render
    assert has_results(copy)


def test_there_is_nothing_to_keep_without_results(scene):
    assert not bpy.ops.tetflora.keep_results.poll()


def _calls_of(function, *arguments):
    """What a function returns, and how many calls it makes on the way."""
    events = []
    sys.setprofile(lambda _frame, event, _what: events.append(event))
    try:
        made = function(*arguments)
    finally:
        sys.setprofile(None)
    return made, len(events)


def test_the_file_is_searched_for_a_parent_once_a_collection(scene):
    """It may have as many objects as plants, and a forest has hundreds of result objects."""
    for _ in range(1000):
        bpy.data.objects.new("A plant", None)  # before the parent in the alphabet
    parents, searches = [], []
    for _ in range(2):
        collection = bpy.data.collections.new("results")
        for _ in range(3):
            parent, calls = _calls_of(output.parent_of, collection, "bush", "Bush")
            parents.append(parent)
            searches.append(calls > 900)
        assert list(collection.objects) == parents[:1]
    assert len(set(parents)) == 1
    assert searches == [True, False, False] * 2
