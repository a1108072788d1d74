# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers as one list: what each is and has, order, copies, removal, what is due, and files that had none."""

from __future__ import annotations

import bpy
import pytest

from tests.blender.scenes import add_mesh, select
from tetflora_addon.blender.biomes import layers
from tetflora_addon.blender.compat import stored_properties
from tetflora_addon.blender.placing import plant_objects, populations
from tetflora_addon.blender.scene import crowns
from tetflora_addon.blender.scene.fields import write_field

pytestmark = pytest.mark.usefixtures("clean_file")


def _ops():
    return bpy.ops.tetflora


def _group():
    return bpy.context.scene.tetflora


def _names():
    return [layer.name for layer in _group().layers]


def _ground(name="ground", size=10.0):
    ground = add_mesh(name, size=size)
    select(ground)
    return ground


def _scatter(name, count=5, ground=None):
    """A layer with so many bushes."""
    select(ground or bpy.data.objects.get("ground") or _ground())
    assert _ops().populate(count=count, species="bush", min_distance=0.1) == {'FINISHED'}
    layer = layers.active_layer(bpy.context.scene)
    layer.name = name
    return layer


def _biome(*parts):
    """A biome of layers without plants."""
    group = _group()
    biome = group.layers.add()
    biome.kind, biome.uid, biome.name = 'BIOME', "b", "Biome"
    for part in parts:
        made = populations.add_population(bpy.context.scene, name=part)
        made.biome = "b"
    group.layers_index = layers.index_of(bpy.context.scene, "b")


def _field():
    """A field of two plants that no layer has."""
    made = write_field("Own", [[0, 0, 0], [1, 0, 0]], [[1, 0, 0, 0]] * 2, [1.0, 1.0], [0, 0], [1, 2], ["bush"])
    bpy.context.scene.collection.objects.link(made)
    return made


def test_kinds_are_told_apart_and_plants_are_counted():
    first = _scatter("Bushes", 4)
    assert (layers.kind_of(first), layers.plants_in(first)) == (layers.SCATTERED, 4)
    first.covers = "plants"
    assert layers.kind_of(first) is layers.COVERING
    field = plant_objects.link_field(bpy.context.scene, _field())
    last = layers.active_layer(bpy.context.scene)
    assert (last.field, layers.kind_of(last), layers.plants_in(last)) == (field, layers.IMPORTED, 2)
    field[plant_objects.PAINTED_MARK] = True
    assert layers.kind_of(last) is layers.PAINTED
    field.tetflora.stand.is_grown = True
    assert layers.kind_of(last) is layers.STAND
    _biome("Trees", "Herbs")
    biome = layers.active_layer(bpy.context.scene)
    biome.id_data.tetflora.layers[-1].made = 7
    assert (layers.kind_of(biome), layers.plants_in(biome)) == (layers.GROUP, 7)


def test_a_biome_moves_with_its_layers_and_they_stay_within_it():
    _ground()
    populations.add_population(bpy.context.scene, name="First")
    _biome("Trees", "Herbs")
    populations.add_population(bpy.context.scene, name="Last")
    _group().layers_index = 1
    assert _ops().move_layer(direction='UP') == {'FINISHED'}
    assert _names() == ["Biome", "Trees", "Herbs", "First", "Last"]
    assert _ops().move_layer(direction='UP') == {'CANCELLED'}
    _group().layers_index = 2
    assert _ops().move_layer(direction='UP') == {'FINISHED'}
    assert _names() == ["Biome", "Herbs", "Trees", "First", "Last"]
    assert _ops().move_layer(direction='UP') == {'CANCELLED'}
    _group().layers_index = 3
    assert _ops().move_layer(direction='DOWN') == {'FINISHED'}
    assert _ops().move_layer(direction='DOWN') == {'CANCELLED'}
    assert _names()[-2:] == ["Last", "First"]
    assert layers.active_layer(bpy.context.scene).name == "First"


def test_layers_are_grouped_with_the_one_above_and_taken_out_again():
    _scatter("A", 4), _scatter("B", 5), _scatter("C", 2)
    due = layers.due_layers(bpy.context.scene)
    _group().layers_index = 1
    assert _ops().move_layer(direction='IN') == {'FINISHED'}
    assert _names() == ["Group", "A", "B", "C"]
    assert layers.active_layer(bpy.context.scene).name == "B"
    group = _group().layers[0]
    assert [one.name for one in layers.children_of(group)] == ["A", "B"]
    assert (layers.plants_in(group), group.grounds[0].object.name) == (9, "ground")
    assert _ops().move_layer(direction='IN') == {'CANCELLED'}  # it is in one
    _group().layers_index = 3
    _ops().move_layer(direction='IN')
    assert [one.name for one in layers.children_of(_group().layers[0])] == ["A", "B", "C"]
    assert layers.due_layers(bpy.context.scene) == due == []  # a group limits nothing at first
    assert _ops().update_layers(which='ACTIVE') == {'FINISHED'}
    assert not bpy.data.objects["ground"].data.materials  # nor is it a biome with a soil
    _group().layers_index = 1
    _ops().move_layer(direction='OUT')
    assert _names() == ["Group", "B", "C", "A"]
    assert _ops().move_layer(direction='OUT') == {'CANCELLED'}


def test_copies_grow_on_the_same_or_on_another_ground():
    layer = _scatter("Bushes", 5)
    layer.clumping, uid = 0.5, layer.uid
    _ops().duplicate_layer()
    copy = layers.active_layer(bpy.context.scene)
    assert (copy.uid != uid, copy.clumping, copy.made, copy.grounds[0].object.name) == (True, 0.5, 0, "ground")
    select(add_mesh("hill", size=4.0))
    _biome("Trees", "Herbs")
    _ops().duplicate_layer(to_selected=True)
    copy = layers.active_layer(bpy.context.scene)
    own = layers.children_of(copy)
    assert (copy.kind, copy.uid != "b", [one.name for one in own]) == ('BIOME', True, ["Trees.001", "Herbs.001"])
    assert {entry.object.name for one in (copy, *own) for entry in one.grounds} == {"hill"}
    select()
    with pytest.raises(RuntimeError, match="Select a mesh to copy"):
        _ops().duplicate_layer(to_selected=True)


@pytest.mark.parametrize("rules", [dict(by_density=True, density=300.0, min_distance=0.3), dict(count=40)])
def test_plants_of_a_copy_stand_elsewhere(rules):
    """At the places of the original there is no room, or two plants would be in one."""
    layer = _scatter("Bushes", 40)
    layer.min_distance = 0.0
    for name, value in rules.items():
        setattr(layer, name, value)
    for _ in range(2):
        _ops().duplicate_layer()
    assert _ops().update_layers() == {'FINISHED'}
    made = [one.made for one in _group().layers]
    assert min(made) > 0.7 * max(made) > 0
    places = {tuple(round(c, 4) for c in o.location) for o in bpy.context.scene.objects if o.tetflora.is_plant}
    assert len(places) == sum(made)


def test_update_grows_what_is_due_and_nothing_else(capfd):
    first, _ = _scatter("A", 5), _scatter("B", 6)
    first = _group().layers[0]
    kept = set(populations.own_objects(bpy.context.scene, _group().layers[1]))
    assert _ops().update_layers() == {'CANCELLED'}  # it is no error, and no step that one could undo
    said = capfd.readouterr().out
    assert "Info: No setting and no ground has changed" in said
    assert "Update This Layer" in said
    first.count = 8
    assert layers.due_layers(bpy.context.scene) == [first.uid]
    assert _ops().update_layers() == {'FINISHED'}
    assert (_group().layers[0].made, layers.due_layers(bpy.context.scene)) == (8, [])
    assert set(populations.own_objects(bpy.context.scene, _group().layers[1])) == kept
    _group().layers[0].count = _group().layers[1].count = 3
    _group().layers[1].frozen = True
    assert _ops().update_layers() == {'FINISHED'}
    assert [layer.made for layer in _group().layers] == [3, 6]


@pytest.mark.parametrize("kind", ['SCATTER', 'STAND'])
def test_update_of_a_layer_whose_ground_is_gone_says_so(kind, capfd):
    """It said that no ground had changed."""
    ground = _ground(size=20.0)
    select(ground)
    _group().stand.years, _group().stand.density = 2, 100.0
    assert (_ops().populate(count=4, species="bush") if kind == 'SCATTER' else _ops().grow_stand()) == {'FINISHED'}
    bpy.context.scene.collection.objects.unlink(ground)
    bpy.context.view_layer.update()
    capfd.readouterr()
    assert _ops().update_layers() == {'CANCELLED'}
    said = capfd.readouterr().out
    assert f'Info: "{ground.name}" is not in the scene; select a ground and choose Use Selected Meshes' in said
    assert "No setting and no ground" not in said


def test_trees_of_a_layer_grow_in_a_wood_and_free_again():
    def species():
        return {o.tetflora.species for o in bpy.context.scene.objects if o.tetflora.is_plant}

    select(_ground(size=40.0))
    _ops().populate(count=12, species="beech:1, bush:1")
    in_wood = {"beech_in_wood", "bush"}
    for found in (in_wood, {"beech", "bush"}, in_wood):
        assert _ops().update_layers(which='WOOD') == {'FINISHED'}
        assert {entry.species for entry in _group().layers[0].mix} == found == species()
    free, dense = (crowns.crown_for(bpy.context.scene, name) for name in ("beech", "beech_in_wood"))
    assert dense.radius < 0.8 * free.radius
    _scatter("Bushes")
    with pytest.raises(RuntimeError, match="has no trees"):
        _ops().update_layers(which='WOOD')


def test_the_eye_hides_plants_everywhere():
    layer = _scatter("Bushes", 3)
    assert layer.shown
    layer.shown = False
    assert not layer.shown
    assert layer.collection.hide_render and layer.collection.hide_viewport
    layer.shown = True
    assert not layer.collection.hide_render


def test_a_layer_goes_with_its_plants_or_leaves_them():
    _scatter("A", 4), _scatter("B", 5)
    _ops().remove_layer(keep_plants=True)
    assert _names() == ["A"]
    assert sum(o.tetflora.is_plant for o in bpy.data.objects) == 9
    _ops().remove_layer()
    assert _names() == []
    assert sum(o.tetflora.is_plant for o in bpy.data.objects) == 5


def test_limits_are_shown_where_they_are_set_and_gone_when_switched_off():
    layer = populations.add_population(bpy.context.scene, [_ground()])
    assert layer.limits == {'SLOPE'}
    layer.vertex_group, layer.wetness_min = "wet", 0.3
    assert layer.limits == {'GROUP', 'SLOPE', 'WETNESS'}
    layer.limits = {'ALTITUDE', 'PATHS'}
    assert layer.limits == {'ALTITUDE', 'PATHS'}
    assert (layer.vertex_group, layer.wetness_min, layer.use_altitude) == ("", 0.0, True)
    assert layer.slope_max == pytest.approx(1.5707963)
    layer.limits = set()
    assert not layer.use_altitude


def test_a_file_without_layers_gets_them_when_it_is_opened(tmp_path):
    """Fields of any origin become layers; those that are gone do no harm; layers of a biome follow it."""
    _ground()
    _biome("Trees")
    _group().layers.move(0, 1)
    _field()
    gone = plant_objects.link_field(bpy.context.scene, _field())
    bpy.data.objects.remove(gone)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert _names() == ["Biome", "Trees", "Own"]
    assert _group().layers[2].field == bpy.data.objects["Own"]


def test_a_field_that_somebody_deletes_is_no_layer_any_more():
    _ground()
    field = plant_objects.link_field(bpy.context.scene, _field())
    layer = _group().layers[0]
    assert not layers.is_gone(layer)
    select(field)
    bpy.ops.object.delete()
    assert layers.is_gone(_group().layers[0])
    layers.forget_gone(bpy.context.scene)
    assert not _names()


def test_what_is_added_next_grows_on_the_ground_of_the_active_layer():
    _scatter("Bushes", 3)
    select()
    assert _ops().populate(count=2, species="fern", min_distance=0.1) == {'FINISHED'}
    assert [entry.object.name for entry in layers.active_layer(bpy.context.scene).grounds] == ["ground"]


def test_files_from_before_there_were_layers_open_with_all_of_them(tmp_path):
    """They kept populations, and in another list biomes, which these belong to."""
    _biome("trees", "shrubs")
    _scatter("alone")
    _group().layers[-1].mix.add().species = "birch"
    before = [(one.name, one.kind, len(one.mix), len(layers.children_of(one))) for one in _group().layers]
    assert {kind for _, kind, *_ in before} == {'BIOME', 'SCATTER'}
    stored = stored_properties(bpy.context.scene)["tetflora"]
    kept = [one.to_dict() for one in stored["layers"]]
    stored["biomes"] = [one for one in kept if one.pop("kind", 0) == 1]
    stored["populations"] = [one for one in kept if one.get("uid") != "b"]
    stored["populations_index"] = len(stored["populations"]) - 1
    del stored["layers"]
    assert not _group().layers
    path = str(tmp_path / "old.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    now = [(one.name, one.kind, len(one.mix), len(layers.children_of(one))) for one in _group().layers]
    assert now == before
    assert layers.active_layer(bpy.context.scene).name == "alone"
    assert [entry.object.name for entry in _group().layers[-1].grounds] == ["ground"]
    assert not {"populations", "biomes"} & set(stored_properties(bpy.context.scene)["tetflora"].keys())


def test_a_copy_of_a_stand_has_its_plants_and_is_due_on_another_ground():
    ground = _ground(size=12.0)
    group = _group().stand
    group.years, group.interval, group.density = 8, 4, 1500.0
    group.species.add().species = "birch"
    assert _ops().grow_stand() == {'FINISHED'}
    source = layers.active_layer(bpy.context.scene).field
    number = len(source.data.vertices)
    _ops().duplicate_layer()
    copy = layers.active_layer(bpy.context.scene).field
    assert copy is not source and copy.data is not source.data
    assert len(copy.data.vertices) == number > 0
    assert copy.tetflora.stand.grown_by == source.tetflora.stand.grown_by
    assert [entry.object for entry in copy.tetflora.stand.grounds] == [ground]
    hill = add_mesh("hill", size=6.0)
    select(hill)
    _ops().duplicate_layer(to_selected=True)
    moved = layers.active_layer(bpy.context.scene).field
    assert [entry.object for entry in moved.tetflora.stand.grounds] == [hill]
    assert layers.is_due(layers.active_layer(bpy.context.scene))
    assert _ops().update_layers() == {'FINISHED'}
    grown = layers.active_layer(bpy.context.scene).field
    assert max(abs(value) for vertex in grown.data.vertices for value in vertex.co[:2]) <= 6.5
    assert len(source.data.vertices) == number
