# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of a linked file: they are refined, but no button changes them, as the change would be gone after loading."""

from __future__ import annotations

import bpy
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, select, tiny_render

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def linked(clean_file, tmp_path):
    """Linked plants of another file in the scene, selected."""
    select(add_mesh("ground", size=10.0))
    bpy.ops.tetflora.populate(count=4, species="bush")
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {bpy.context.scene.tetflora.layers[0].collection})
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (found, wanted):
        wanted.collections = list(found.collections)
    bpy.context.scene.collection.children.link(wanted.collections[0])
    plants = [o for o in bpy.context.scene.objects if o.tetflora.is_plant]
    assert len(plants) == 4
    select(*plants)
    return plants


def _state(plants):
    return [(o.name, o.tetflora.species, o.tetflora.seed, o.tetflora.enabled) for o in plants]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("reseed", {}),
        ("assign_species", {"species": "oak"}),
        ("make_plant_mesh", {}),
        ("convert_plants", {"to": 'FIELD'}),
        ("drop_to_ground", {}),
    ],
)
def test_buttons_say_that_they_are_linked_and_change_nothing(linked, name, options):
    before, objects = _state(linked), len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="linked from another file"):
        getattr(bpy.ops.tetflora, name)(**options)
    assert _state(linked) == before
    assert len(bpy.data.objects) == objects


@pytest.mark.parametrize("which", ['SELECTED', 'ALL'])
def test_they_are_not_removed_and_it_is_said(linked, which, capfd):
    assert bpy.ops.tetflora.remove_plants(which=which) == {'CANCELLED'}
    assert "linked from another file" in capfd.readouterr().out
    assert len(_state(linked)) == 4


def test_plants_of_this_file_among_them_are_changed(linked):
    before = _state(linked)
    own = add_plant("own", location=(3.0, 0.0, 0.0))
    seed = own.tetflora.seed
    select(own, *linked)
    bpy.ops.tetflora.reseed()
    bpy.ops.tetflora.make_plant_mesh()
    assert own.tetflora.seed != seed
    assert [o.name for o in bpy.data.objects if o.type == 'MESH'] == ["own mesh"]
    assert _state(linked) == before


def test_they_are_refined(linked):
    add_camera()
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert '"plants": 4' in bpy.context.scene.tetflora.statistics


def test_what_is_changed_of_overrides_is_there_when_the_file_is_opened_again(linked, tmp_path):
    def overridden():
        return [o for o in bpy.context.scene.objects if o.tetflora.is_plant and o.override_library is not None]

    scene = bpy.context.scene
    scene.collection.children[0].override_hierarchy_create(scene, bpy.context.view_layer)
    plants = overridden()
    assert len(plants) == 4
    for plant in plants:  # as Object > Library Override > Make leaves those that are meant to be edited
        plant.override_library.is_system_override = False
    before = {plant.name: plant.tetflora.seed for plant in plants}
    select(*plants)
    bpy.ops.tetflora.reseed()
    bpy.ops.tetflora.assign_species(species="oak")
    plants[0].tetflora.enabled = False
    plants[0].tetflora.is_occluder = plants[0].tetflora.is_explicit = True
    changed = {p.name: (p.tetflora.species, p.tetflora.seed, p.tetflora.enabled) for p in plants}
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    found = overridden()
    assert {p.name: (p.tetflora.species, p.tetflora.seed, p.tetflora.enabled) for p in found} == changed
    assert all(seed != before[name] and species == "oak" for name, (species, seed, _) in changed.items())
    assert [p.name for p in found if p.tetflora.is_occluder and p.tetflora.is_explicit] == [min(before)]


def test_scatter_finds_a_place_beside_overridden_plants(linked):
    scene, layer = bpy.context.scene, bpy.context.view_layer
    overridden = scene.collection.children[0].override_hierarchy_create(scene, layer)
    overridden["tetflora_plants"] = True
    select(add_mesh("own ground", size=10.0))
    assert bpy.ops.tetflora.populate(count=3, species="bush") == {'FINISHED'}
    assert scene.tetflora.layers[0].made == 3


def test_a_linked_scene_is_refused_with_what_to_do(clean_file, tmp_path, capfd):
    add_plant()
    add_camera()
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {bpy.context.scene})
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (found, wanted):
        wanted.scenes = list(found.scenes)
    home, bpy.context.window.scene = bpy.context.scene, wanted.scenes[0]
    try:
        for name in ("refine", "look", "daylight", "paint_plants", "update_layers"):
            with pytest.raises(RuntimeError, match="scene is linked; open its file, or append it"):
                getattr(bpy.ops.tetflora, name)()
        tiny_render()
        bpy.ops.render.render()
        assert "is linked from another file; open that file" in capfd.readouterr().err
    finally:
        bpy.context.window.scene = home
