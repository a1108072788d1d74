# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scatters: plants that can be placed anew, and what of the artist's is left alone."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, add_plant, datablocks, depsgraph, select
from tetflora_addon.blender.placing import plant_objects, population_data, populations
from tetflora_addon.blender.scene import fields

pytestmark = pytest.mark.usefixtures("clean_file")


def _ops():
    return bpy.ops.tetflora


def _settings():
    return bpy.context.scene.tetflora


def _active():
    return _settings().layers[_settings().layers_index]


def _plants():
    return [o for o in bpy.context.scene.objects if o.tetflora.is_plant]


def _own(population=None):
    return populations.own_objects(bpy.context.scene, population or _active())


def _populate(count=30, size=20.0, name="ground", **options):
    ground = bpy.data.objects.get(name) or add_mesh(name, size=size)
    select(ground)
    _ops().populate(count=count, **{"min_distance": 1.0, "species": "bush:2, conifer", **options})
    bpy.context.view_layer.update()
    return ground


def _state():
    """All that populations could change, datablock by datablock."""
    objects = {
        o.name: (
            o.type,
            tuple(o.location),
            tuple(o.rotation_euler),
            tuple(o.scale),
            o.tetflora.species,
            o.tetflora.seed,
            o.tetflora.population,
            o.tetflora.population_number,
            tuple(c.name for c in o.users_collection),
            o.select_get(),
        )
        for o in bpy.context.scene.objects
    }
    populations = [(p.uid, p.frozen, p.made, p.message) for p in _settings().layers]
    return objects, populations, [population_data.population_data(one) for one in _settings().layers], datablocks()


def _places(objects):
    return np.array([tuple(o.location) for o in objects])


def test_populate_makes_a_population_that_knows_its_settings():
    ground = _populate(count=25, seed=6, slope_max=0.5, scale_min=0.4, scale_max=0.6)
    population = _active()
    assert (population.count, population.seed, population.made) == (25, 6, 25)
    assert population.slope_max == pytest.approx(0.5)
    assert [e.object for e in population.grounds] == [ground]
    assert [(e.species, e.weight) for e in population.mix] == [("bush", 2.0), ("conifer", 1.0)]
    assert set(_own()) == set(_plants())
    assert {o for o in population.collection.objects} == set(_plants())


def test_update_with_the_same_settings_gives_the_same_plants():
    _populate()
    before = _state()
    _ops().update_layers(which='ACTIVE')
    after = _state()
    assert {k: v[:-1] for k, v in before[0].items() if k != "ground"} == {
        k: v[:-1] for k, v in after[0].items() if k != "ground"
    }
    assert before[1:] == after[1:]


def test_an_edit_replaces_the_plants_and_nothing_else():
    _populate(count=30)
    hand = add_plant("by hand", location=(0.0, 0.0, 0.0))
    _active().count, _active().min_distance = 45, 2.0
    depsgraph()
    _ops().update_layers(which='ACTIVE')
    own = _own()
    assert len(own) == 45
    assert hand not in own
    assert hand.tetflora.seed == 1
    gaps = np.linalg.norm(_places(own)[:, :2], axis=1)
    assert gaps.min() >= 2.0 - 1e-4  # its own former plants took no space, the one by hand did


def test_other_populations_keep_their_room_and_their_plants():
    _populate(count=40, size=15.0, min_distance=2.0, seed=1)
    first = {o.name: tuple(o.location) for o in _plants()}
    _populate(count=40, min_distance=2.0, seed=2, as_field='FIELD')
    _active().seed = 3
    _ops().update_layers(which='ACTIVE')
    depsgraph()
    assert {o.name: tuple(o.location) for o in _plants()} == first
    (field,) = _own()
    points = np.array([v.co[:2] for v in field.data.vertices])
    gaps = np.linalg.norm(points[:, None] - np.array(list(first.values()))[None, :, :2], axis=-1)
    assert gaps.min() >= 2.0 - 1e-4


def test_reroll_is_another_arrangement_that_can_be_repeated():
    _populate()
    first = _places(_own())
    _ops().update_layers(which='ACTIVE', reroll=True)
    second, seed = _places(_own()), _active().seed
    assert seed != 0
    assert not np.allclose(np.sort(first, axis=0), np.sort(second, axis=0))
    _active().seed = 0
    _ops().update_layers(which='ACTIVE')
    assert np.allclose(_places(_own()), first)
    _ops().update_layers(which='ACTIVE', reroll=True)
    assert _active().seed == seed
    assert np.allclose(_places(_own()), second)


def test_frozen_plants_stay_whatever_is_pressed():
    _populate()
    _active().frozen = True
    before = {o.name for o in _plants()}
    for reroll in (False, True):
        with pytest.raises(RuntimeError, match="frozen"):
            _ops().update_layers(which='ACTIVE', reroll=reroll)
    _ops().remove_layer()
    assert {o.name for o in _plants()} == before
    assert not any(o.tetflora.population for o in _plants())
    assert not _settings().layers


def test_freeze_can_be_taken_back():
    _populate(count=12)
    _active().frozen = True
    _active().frozen = False
    _active().count = 5
    _ops().update_layers(which='ACTIVE')
    assert len(_plants()) == 5


@pytest.mark.parametrize("as_field", ['EMPTIES', 'FIELD'])
def test_remove_takes_the_plants_and_leaves_nothing_behind(as_field):
    ground = add_mesh("ground", size=20.0)
    add_plant("by hand")
    select(ground)
    before = datablocks()
    _populate(as_field=as_field)
    _ops().remove_layer()
    assert datablocks() == before


def test_remove_may_keep_the_plants():
    _populate(count=8)
    _ops().remove_layer(keep_plants=True)
    assert len(_plants()) == 8
    assert not any(o.tetflora.population for o in _plants())


def test_fields_are_told_by_the_name_that_the_list_shows(capfd):
    """They are renamed there, which names the object."""
    obj = add_mesh("Field")
    obj.tetflora.is_field = True
    plant_objects.note_field(bpy.context.scene, obj)
    obj.name = "Edge of the wood"
    with pytest.raises(RuntimeError, match="Edge of the wood"):
        _ops().update_layers(which='ACTIVE')
    _ops().remove_layer()
    assert '"Edge of the wood" removed' in capfd.readouterr().out


def test_what_is_kind_of_storage_changes_with_the_setting():
    _populate(count=20)
    places = _places(_own())
    _active().as_field = 'FIELD'
    _ops().update_layers(which='ACTIVE')
    (field,) = _own()
    assert np.allclose([v.co for v in field.data.vertices], places, atol=1e-5)
    _active().as_field = 'EMPTIES'
    _ops().update_layers(which='ACTIVE')
    assert np.allclose(_places(_own()), places)


def test_renamed_copied_and_deleted_plants_do_not_confuse_a_population():
    _populate(count=10)
    own = _own()
    own[0].name = "My favorite"
    copy = own[1].copy()
    copy.location.x += 0.5
    bpy.context.collection.objects.link(copy)
    bpy.data.objects.remove(own[2])
    _active().name = "Bushes"
    assert len(_own()) == 9
    assert copy not in _own()
    name = copy.name
    _ops().update_layers(which='ACTIVE')
    assert len(_own()) == 10
    assert "My favorite" not in bpy.data.objects
    assert bpy.data.objects[name].tetflora.population == ""
    assert _active().collection.name == "Bushes"
    assert len(_plants()) == 11


def test_plants_deleted_by_hand_come_back_and_it_is_said(capfd):
    _populate(count=10)
    bpy.data.batch_remove(_own()[:3])
    _ops().update_layers(which='ACTIVE')
    assert len(_own()) == 10
    assert "3 deleted plants restored" in capfd.readouterr().out


def test_copies_in_the_collection_outlive_the_population():
    _populate(count=4)
    copy = _own()[0].copy()
    _active().collection.objects.link(copy)
    _ops().remove_layer()
    assert _plants() == [copy]
    assert [c.name for c in copy.users_collection] == ["TetFlora plants"]
    assert bpy.data.objects.get(copy.name) == copy


@pytest.mark.parametrize("delete", [True, False])
def test_ground_that_is_gone_is_said_and_plants_stay(delete):
    ground = _populate(count=6)
    if delete:
        bpy.data.objects.remove(ground)
    else:  # as Blender's Delete does it where something still points to the object
        bpy.context.scene.collection.objects.unlink(ground)
    with pytest.raises(RuntimeError, match='"Scatter" has no ground in this scene; select meshes'):
        _ops().update_layers(which='ACTIVE')
    assert len(_plants()) == 6


def test_ground_without_faces_is_named_and_plants_stay():
    ground = _populate(count=6)
    ground.data.clear_geometry()
    before = _state()
    with pytest.raises(RuntimeError, match='"ground" has no faces'):
        _ops().update_layers(which='ACTIVE')
    assert _state() == before


def test_a_reroll_that_fails_keeps_the_seed():
    _populate(count=6, seed=4)
    _active().mix[0].species = "quercus"
    with pytest.raises(RuntimeError, match='Unknown species "quercus"'):
        _ops().update_layers(which='ACTIVE', reroll=True)
    assert _active().seed == 4


def test_a_collection_of_grounds_takes_what_is_added_later():
    _populate(count=6)
    grounds = bpy.data.collections.new("Grounds")
    bpy.context.scene.collection.children.link(grounds)
    far = add_mesh("far", size=5.0)
    far.location.x = 500.0
    _active().ground_collection = grounds
    _active().grounds.clear()
    with pytest.raises(RuntimeError, match="no ground"):
        _ops().update_layers(which='ACTIVE')
    grounds.objects.link(far)
    depsgraph()
    _ops().update_layers(which='ACTIVE')
    assert (_places(_own())[:, 0] > 400.0).all()


def test_linked_plants_are_neither_counted_nor_deleted(tmp_path):
    _populate(count=5)
    bpy.data.libraries.write(str(tmp_path / "lib.blend"), {_active().collection})
    with bpy.data.libraries.load(str(tmp_path / "lib.blend"), link=True) as (_, to):
        to.collections = [_active().collection.name]
    bpy.context.scene.collection.children.link(to.collections[0])
    assert len(_plants()) == 10
    assert len(_own()) == 5
    _active().count, _active().min_distance = 3, 0.0
    _ops().update_layers(which='ACTIVE')
    assert sum(o.library is not None for o in _plants()) == 5
    assert sum(o.library is None for o in _plants()) == 3


def test_density_is_by_the_hectare():
    _populate(count=5, size=100.0)  # 4 hectares
    _active().by_density, _active().density, _active().min_distance = True, 50.0, 0.0
    _ops().update_layers(which='ACTIVE')
    assert 150 <= len(_own()) <= 250  # 200 expected


def test_companions_and_masks_reach_the_engine():
    ground = _populate(count=400, size=50.0, min_distance=0.0)
    group = ground.vertex_groups.new(name="wood")
    group.add([0, 3], 1.0, 'REPLACE')
    _active().vertex_group = "wood"
    entry = _active().mix[0]
    entry.companion, entry.companion_strength, entry.companion_distance = "conifer", -1.0, 4.0
    _ops().update_layers(which='ACTIVE')
    bpy.context.view_layer.update()
    own = _own()
    assert _places(own)[:, 0].mean() < -10.0  # vertices 0 and 3 are at -x
    bush = _places([o for o in own if o.tetflora.species == "bush"])
    conifer = _places([o for o in own if o.tetflora.species == "conifer"])
    assert len(bush) and len(conifer)
    assert np.linalg.norm(bush[:, None, :2] - conifer[None, :, :2], axis=-1).min() >= 4.0 - 1e-4


def test_tilted_empties_and_fields_agree():
    ground = _populate(count=20, size=20.0, min_distance=0.0)
    ground.rotation_euler = (0.4, 0.2, 0.0)
    depsgraph()
    _active().tilt = 1.0
    _ops().update_layers(which='ACTIVE')
    graph = depsgraph()
    up = np.array([o.matrix_world.to_3x3().normalized().col[2] for o in _own()])
    normal = np.array(ground.matrix_world.to_3x3().col[2])
    assert np.allclose(up, normal, atol=1e-4)
    empties = {o.tetflora.seed: np.array(o.matrix_world.to_3x3().normalized()) for o in _own()}
    _active().as_field = 'FIELD'
    _ops().update_layers(which='ACTIVE')
    graph = depsgraph()
    read = fields.read_field(_own()[0], graph, np.eye(4)[None])
    for seed, frame in zip(read.seed.tolist(), read.frame, strict=True):
        assert np.allclose(empties[seed], frame, atol=1e-4)


def test_new_populations_begin_like_the_one_that_is_shown():
    _populate(count=7)
    _active().clumping = 0.25
    other = add_mesh("other", size=5.0)
    select(other)
    _ops().duplicate_layer(to_selected=True)
    assert [p.name for p in _settings().layers] == ["Scatter", "Scatter.001"]
    assert _active().clumping == 0.25
    assert [e.object for e in _active().grounds] == [other]
    assert _active().uid != _settings().layers[0].uid
    assert len(_plants()) == 7
    select(_settings().layers[0].grounds[0].object)
    _ops().set_layer_ground()
    assert [e.object.name for e in _active().grounds] == ["ground"]
    _settings().layers_index = 0
    _ops().select_plants(layer=True)
    assert {o for o in _plants() if o.select_get()} == set(_own())


def test_populations_survive_save_and_load(tmp_path):
    _populate(count=9)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    before = _state()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    after = _state()
    assert before[1:] == after[1:]
    _ops().update_layers(which='ACTIVE')
    assert len(_own()) == len(_plants()) == 9


@pytest.mark.parametrize("options", [{"which": 'ACTIVE'}, {"which": 'ACTIVE', "reroll": True}])
def test_undo_restores_everything_in_one_step(options):
    bpy.ops.ed.undo_push(message="begin")
    _populate()
    bpy.ops.ed.undo_push(message="populated")
    before = _state()
    _ops().update_layers(**options)
    bpy.ops.ed.undo_push(message="updated")
    bpy.ops.ed.undo()
    assert _state() == before


def test_a_second_scatter_does_not_look_for_room_where_the_first_has_its_plants() -> None:
    for _ in range(2):
        _populate(size=40.0, by_density=True, species="beech", min_distance=1.5)
    first, second = _settings().layers
    assert first.seed == 0 and second.seed != 0
    assert second.made > first.made / 2
    _populate(seed=7)
    assert _active().seed == 7  # what a script asks for


def test_of_several_layers_it_is_said_which_have_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in (0, 1):
        _populate(size=40.0, by_density=True, species="beech", seed=seed)
    for layer in _settings().layers:
        layer.density += 1.0
    _settings().layers[1].min_distance, _settings().layers[1].distance_by_species = 60.0, False
    said = []
    monkeypatch.setattr(
        bpy.types.TETFLORA_OT_update_layers, "done", lambda _self, text, **_: said.append(text) or {'FINISHED'}
    )
    _ops().update_layers()
    assert f'without plants: {_settings().layers[1].name}: ' in said[0]


@pytest.mark.parametrize(
    ("name", "free"),
    [("Scatter", "Scatter.002"), ("Scatter.001", "Scatter.002"), ("No. 1", "No. 1"), ("a.x", "a.x.001")],
)
def test_a_copy_of_a_copy_has_one_number(name, free):
    for taken in ("Scatter", "Scatter.001", "a.x"):
        _settings().layers.add().name = taken
    assert populations.free_name(_settings().layers, name) == free
