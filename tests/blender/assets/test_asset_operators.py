# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists do with assets and scatters: operators, panels, Refine Automatically, undo."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest

from devtools.layouts import Layout
from panels import menus, plants
from tests.blender.assets.scatters import crown, read, scene, species
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tetflora_addon.blender.assets import marks
from tetflora_addon.blender.job import frame_cache
from tetflora_addon.blender.scene.explicit import read_explicit
from tetflora_addon.blender.scene.objects import has_contents, taking_part
from tetflora_addon.blender.species import edits
from tetflora_addon.blender.species.asset_species import asset_species

pytestmark = pytest.mark.usefixtures("clean_file")


def test_refine_scatter_says_what_it_found_and_refuses_with_a_reason(capfd):
    ground, child = add_mesh("ground"), add_mesh("child")
    select(ground)
    with pytest.raises(RuntimeError, match="Select an object that scatters others"):
        bpy.ops.tetflora.mark(what='SCATTER')
    ground.instance_type = 'VERTS'
    with pytest.raises(RuntimeError, match='"ground" shows no instances now'):
        bpy.ops.tetflora.mark(what='SCATTER')
    assert not ground.tetflora.is_scatter
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", 'POINT'))
    scene().collection.objects.link(lamp)
    lamp.parent = ground
    with pytest.raises(RuntimeError, match=r"only objects without faces \(lamp\)"):
        bpy.ops.tetflora.mark(what='SCATTER')
    child.parent, ground.tetflora.is_explicit = ground, True
    capfd.readouterr()
    assert bpy.ops.tetflora.mark(what='SCATTER') == {'FINISHED'}
    assert (
        "4 instances of 1 asset will be refined; 4 instances without faces will not show in results"
        in capfd.readouterr().out
    )
    assert ground.tetflora.is_scatter and not ground.tetflora.is_explicit
    assert bpy.ops.tetflora.mark(what='SCATTER', action='MARK') == {'FINISHED'}
    assert ground.tetflora.is_scatter
    assert bpy.ops.tetflora.mark(what='SCATTER') == {'FINISHED'}
    assert not ground.tetflora.is_scatter


def test_a_scatter_that_results_hide_can_be_left_plain_again():
    ground, child = add_mesh("ground"), add_mesh("child")
    child.parent, ground.instance_type, ground.tetflora.is_scatter = ground, 'VERTS', True
    select(ground)
    ground.hide_viewport = True  # as results do; nobody can select it then
    ground.select_set(False)
    bpy.context.view_layer.update()
    layout = _drawn(plants.TETFLORA_PT_object, active_object=None)  # so it is in a window
    assert "is_scatter" in layout.names("prop", 1)
    assert bpy.ops.tetflora.mark(what='SCATTER') == {'FINISHED'}
    assert not ground.tetflora.is_scatter


def test_instances_of_a_scatterer_are_not_explicit_as_well():
    ground, child = add_mesh("ground"), add_mesh("child")
    child.parent, ground.instance_type = ground, 'VERTS'
    child.tetflora.is_explicit = True
    add_camera()

    def instances():
        return len(read_explicit(depsgraph()).meshes.surface)

    assert instances() >= 4
    ground.tetflora.is_scatter = True
    assert instances() <= 1


def test_operators_take_collections_by_name_and_many_objects():
    held = bpy.data.collections.new("held")
    scene().collection.children.link(held)
    held.objects.link(crown("one"))
    assert bpy.ops.tetflora.use_as_species(collection="held") == {'FINISHED'}
    assert bpy.ops.tetflora.use_as_species(collection="none") == {'CANCELLED'}
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", 'POINT'))
    scene().collection.objects.link(lamp)
    select(crown("two"), crown("three"), lamp)
    assert bpy.ops.tetflora.use_as_species() == {'FINISHED'}
    assert sorted(info.name for i, info in edits.catalog().items() if i in asset_species()) == ["held", "three", "two"]
    select(bpy.data.objects["two"], bpy.data.objects["three"])
    assert bpy.ops.tetflora.use_as_species(stop=True) == {'FINISHED'}
    assert bpy.ops.tetflora.use_as_species(stop=True, collection="held") == {'FINISHED'}
    assert len(scene().tetflora.asset_species) == 0


def _drawn(panel, obj=None, **given):
    if obj is not None:
        select(obj)
    layout, context = Layout(), bpy.context
    names = ("scene", "view_layer", "preferences", "active_object", "mode")
    known = {name: getattr(context, name) for name in names} | given
    panel.draw(SimpleNamespace(layout=layout), SimpleNamespace(region=SimpleNamespace(width=300), **known))
    return layout


def test_panels_offer_what_fits_the_active_object():
    rock, ground, child = crown("Rock"), add_mesh("ground"), add_mesh("child")
    assert _drawn(plants.TETFLORA_PT_object, rock).names("operator").count("tetflora.use_as_species") == 1
    own = species(rock)
    # Again after a change, and no more.
    assert _drawn(plants.TETFLORA_PT_object, rock).names("operator").count("tetflora.use_as_species") == 2
    assert "is_scatter" not in _drawn(plants.TETFLORA_PT_object, ground).names("prop", 1)
    child.parent, ground.instance_type = ground, 'VERTS'
    assert "is_scatter" in _drawn(plants.TETFLORA_PT_object, ground).names("prop", 1)
    plant = add_plant(species=own)
    bpy.data.objects.remove(rock)
    edits.look_again()
    drawn = _drawn(plants.TETFLORA_PT_object, plant).drawn
    labels = [options["text"] for name, _, options in drawn if name == "label"]
    assert '"Rock" is not in the catalog' in labels
    layout = Layout()
    menus.draw_in_outliner(SimpleNamespace(layout=layout), bpy.context)
    assert layout.names("operator") == ["tetflora.use_as_species"] * 2


def test_refine_automatically_hears_of_assets_and_scatters():
    add_camera()
    rock, ground, child = crown("Rock"), add_mesh("ground"), add_mesh("child")
    child.parent, ground.instance_type = ground, 'VERTS'
    seen = []

    def settings():
        depsgraph()
        seen.append(repr(frame_cache.choices(scene())))
        return len(set(seen))

    assert settings() == 1
    species(rock)
    assert settings() == 2
    rock.name = "Boulder"
    assert settings() == 3
    marks.stop_using(rock)
    assert settings() == 3 and seen[-1] == seen[0]
    assert not has_contents(scene())
    ground.tetflora.is_scatter = True
    assert has_contents(scene()) and ground in taking_part(scene())
    own = species(rock)
    assert rock in taking_part(scene())
    digests = {frame_cache.scene_digest(scene(), depsgraph())}
    plant = add_plant(species=own)
    digests.add(frame_cache.scene_digest(scene(), depsgraph()))
    plant.location.x = 1.0
    digests.add(frame_cache.scene_digest(scene(), depsgraph()))
    assert len(digests) == 3


def test_deleting_an_asset_can_be_undone():
    rock = crown("Rock")
    own = species(rock)
    add_plant(species=own)
    select(rock)
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.object.delete()
    bpy.ops.ed.undo_push(message="Deleted")
    edits.look_again()
    assert own not in edits.catalog()
    assert bpy.ops.ed.undo() == {'FINISHED'}
    edits.look_again()
    assert own in edits.catalog() and len(read()) == 1
