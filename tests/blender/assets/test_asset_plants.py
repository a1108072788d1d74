# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants whose species is an asset: single ones, fields, instances, variants, and assets that are gone."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.assets.scatters import Nodes, read, scene, species, tree
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tetflora_addon.blender.assets.marks import stop_using
from tetflora_addon.blender.job import contents
from tetflora_addon.blender.job.refine import clear, refine
from tetflora_addon.blender.scene import plants
from tetflora_addon.blender.scene.fields import write_field
from tetflora_addon.blender.scene.objects import has_contents
from tetflora_addon.blender.species.asset_species import find_asset
from tetflora_addon.errors import SceneError

pytestmark = pytest.mark.usefixtures("clean_file")


def test_a_plant_is_the_asset_as_it_stands_stretched_and_mirrored_as_the_plant():
    asset = tree()
    asset.location, asset.rotation_euler, asset.scale = (7.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2), (0.01, 0.01, 0.02)
    scene().collection.objects.link(asset)
    own = species(asset)
    plant = add_plant(species=own, location=(1.0, 2.0, 3.0), scale=(-1.0, 1.0, 5.0))
    (found,) = read()
    assert found.target.datablock == asset and found.owner == plant
    turned = np.array(asset.matrix_world.to_3x3())
    assert found.matrices[0, :3, :3] == pytest.approx(np.diag([-1.0, 1.0, 5.0]) @ turned, abs=1e-6)
    assert found.matrices[0, :3, 3] == pytest.approx([1.0, 2.0, 3.0])
    with pytest.raises(plants.NoPlantsError):
        plants.read_plants(scene(), depsgraph())[0]
    given = contents.read_scene(scene(), depsgraph())
    assert len(given.seeds) == 0 and len(given.places) == 1


def test_grown_plants_and_assets_stand_side_by_side():
    own = species(tree())
    add_plant("bush", species="bush")
    held = [add_plant(f"asset {n}", species=own, seed=n, location=(n, 0.0, 0.0)) for n in range(3)]
    held[2].tetflora.enabled = False
    given = contents.read_scene(scene(), depsgraph())
    assert given.species == ("bush",) and given.owners == (("bush", 1),)
    (found,) = given.places
    assert found.owners == tuple(held[:2]) and found.matrices[:, 0, 3].tolist() == [0.0, 1.0]


def test_a_field_may_hold_both_and_keeps_rotation_and_scale():
    own = species(tree())
    turn = np.array([[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]] * 4)
    position = np.stack([np.arange(4.0), np.zeros(4), np.zeros(4)], axis=1)
    kinds, seeds = np.array([0, 1, 1, 0], np.int32), np.arange(4, dtype=np.int32)
    field = write_field("field", position, turn, np.full(4, 2.0), kinds, seeds, ["bush", own])
    scene().collection.objects.link(field)
    field.scale = (1.0, 1.0, 3.0)
    assert len(plants.read_plants(scene(), depsgraph())[0]) == 2
    (found,) = read()
    assert found.owner == field and len(found) == 2
    assert found.matrices[:, 0, 3] == pytest.approx([1.0, 2.0])
    wanted = np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 6.0]])
    assert found.matrices[0, :3, :3] == pytest.approx(wanted, abs=1e-5)


def test_instances_of_plants_are_individuals():
    one, other = tree("one"), tree("other")
    own = species(one.users_collection[0], variants=True)
    plant = add_plant(species=own)
    scene().collection.objects.unlink(plant)
    bpy.data.collections.new("plants").objects.link(plant)
    ground = add_mesh("ground")
    nodes = Nodes(ground)
    source, socket = nodes.asset(plant)
    nodes.show(nodes.scatter(source, 400, socket=socket))
    found = read()
    assert {p.target.datablock for p in found} == {one, other}
    assert sum(map(len, found)) == 400 and min(map(len, found)) > 140
    keys = np.concatenate([p.keys for p in found])
    assert len(set(keys.tolist())) == 400


def test_the_seed_chooses_the_variant_and_nothing_else_does():
    held = tree("one").users_collection[0]
    tree("other"), tree("third")
    own = species(held, variants=True)
    for seed in range(60):
        add_plant(f"plant {seed}", species=own, seed=seed)
    first = {o: p.target.name for p in read() for o in p.owners}
    assert len(first) == 60 and len(set(first.values())) == 3
    for plant in first:
        plant.location.x += 5.0
        plant.name = f"moved {plant.name}"
    assert {o: p.target.name for p in read() for o in p.owners} == first


def test_a_trunk_with_its_leaves_in_a_collection_is_one_plant_that_stands_where_the_trunk_does():
    trunk, leaves, hidden = tree("trunk"), tree("leaves"), tree("hidden")
    leaves.parent = hidden.parent = trunk
    hidden.hide_render, trunk.location, leaves.location.z = True, (60.0, 0.0, 0.0), 3.0
    own = species(trunk.users_collection[0], variants=True)
    assert find_asset(scene(), own).height == pytest.approx(4.0)
    plants = [add_plant(f"plant {seed}", species=own, seed=seed, location=(seed, 0.0, 0.0)) for seed in range(9)]
    (found,) = read()
    assert found.owners == tuple(plants) and found.target.datablock == trunk.users_collection[0]
    places = [part.matrices[0] for part in found.target.parts(depsgraph())[0]]
    stand = sorted(tuple((found.matrices[4] @ place)[:3, 3]) for place in places)
    assert stand == [pytest.approx((4.0, 0.0, 0.0)), pytest.approx((4.0, 0.0, 3.0))]


def trees_with_leaves(hidden=False):
    """Two trunks with leaves, apart from each other, in a collection."""
    trunks = [tree(f"trunk {n}") for n in range(2)]
    for n, trunk in enumerate(trunks):
        leaves = tree(f"leaves {n}")
        leaves.parent = trunk
        trunk.location, leaves.location.z = (60.0 * (1 + n), 0.0, 0.0), 3.0 + n
        trunk.hide_render = leaves.hide_render = hidden
    return trunks


@pytest.mark.parametrize("hidden", [False, True])
def test_each_trunk_with_its_leaves_in_a_collection_is_a_variant_that_stands_where_the_trunk_does(hidden):
    trunks = trees_with_leaves(hidden)
    own = species(trunks[0].users_collection[0], variants=True)
    assert find_asset(scene(), own).height == pytest.approx(4.5)
    for seed in range(20):
        add_plant(f"plant {seed}", species=own, seed=seed, location=(seed, 0.0, 0.0))
    found = read()
    assert sorted(one.target.name for one in found) == ["trunk 0", "trunk 1"] and sum(map(len, found)) == 20
    for one in found:
        places = [part.matrices for part in one.target.parts(depsgraph())[0]]
        heights = [3.0 + trunks.index(bpy.data.objects[one.target.name])]
        stand = sorted(tuple((one.matrices[0] @ place)[:3, 3]) for part in places for place in part)
        foot = one.matrices[0, :3, 3]
        assert stand == [pytest.approx(foot), pytest.approx(foot + [0.0, 0.0, heights[0]])]


@pytest.mark.parametrize("plain", [True, False])
def test_results_show_trunks_with_their_leaves(plain):
    trunks = trees_with_leaves(hidden=True)
    own = species(trunks[0].users_collection[0], variants=True)
    add_camera(location=(8.0, -60.0, 2.0))
    for seed in range(6):
        add_plant(f"plant {seed}", species=own, seed=seed, location=(3.0 * seed, 0.0, 0.0))
    scene().tetflora.asset_detail = 'AUTO' if plain else 'REFINE'
    statistics = refine(scene(), depsgraph())
    assert statistics.plants + statistics.instances == 6
    tops = [
        max((inst.matrix_world @ v.co).z for v in inst.object.data.vertices)
        for inst in depsgraph().object_instances
        if inst.is_instance and inst.object.type == 'MESH' and len(inst.object.data.polygons)
    ]
    assert {round(top, 3) for top in tops} == {1.0, 4.0, 5.0} and len(tops) == 12
    before = {obj.name for obj in trunks}
    clear(scene())
    assert before <= set(bpy.data.objects.keys()) and not [o for o in bpy.data.objects if o.get("tetflora_made")]
    assert not [c for c in bpy.data.collections if c.get("tetflora_made")]


def test_trees_of_a_common_parent_are_variants_each():
    empty = bpy.data.objects.new("all", None)
    trees = [tree("one"), tree("other")]
    trees[0].users_collection[0].objects.link(empty)
    for one in trees:
        one.parent = empty
    own = species(empty.users_collection[0], variants=True)
    for seed in range(20):
        add_plant(f"plant {seed}", species=own, seed=seed)
    assert {one.target.datablock for one in read()} == set(trees)


def test_a_model_that_is_no_species_any_more_is_told_without_its_identifier():
    own = species(tree())
    add_plant("oak", species=own)
    assert stop_using(bpy.data.objects["tree"]) == 1
    with pytest.raises(SceneError, match='"oak": the object or collection that was their species') as told:
        contents.read_scene(scene(), depsgraph())
    assert own not in str(told.value)


def test_dropped_collections_of_a_species_are_plants_of_it():
    held = tree().users_collection[0]
    drops = []
    for n in range(3):
        drop = bpy.data.objects.new(f"drop {n}", None)
        drop.instance_type, drop.instance_collection = 'COLLECTION', held
        drop.location.x = n
        scene().collection.objects.link(drop)
        drops.append(drop)
    assert read() == [] and not has_contents(scene())
    select(drops[0])
    assert bpy.ops.tetflora.use_as_species() == {'FINISHED'}
    found = read()
    assert [p.owner for p in found] == drops and {p.target.datablock for p in found} == {held}
    assert len({int(p.keys[0]) for p in found}) == 3 and has_contents(scene())
    assert bpy.ops.tetflora.use_as_species(stop=True) == {'FINISHED'}
    assert read() == []


def test_a_deleted_asset_is_named_and_comes_back():
    asset = tree()
    scene().collection.objects.link(asset)
    bpy.data.collections.remove(bpy.data.collections["sources"])
    own = species(asset)
    for n in range(5):
        add_plant(f"plant {n}", species=own, seed=n)
    assert len(read()[0]) == 5
    select(asset)
    bpy.ops.object.delete()
    with pytest.raises(SceneError, match=r'"plant 0", "plant 1", "plant 2" and 2 more: "tree".*was deleted; undo'):
        contents.read_scene(scene(), depsgraph())
    scene().collection.objects.link(asset)
    assert len(read()[0]) == 5
    bpy.data.objects.remove(asset)
    with pytest.raises(SceneError, match=r'"tree".*was deleted'):
        contents.read_scene(scene(), depsgraph())
    assert find_asset(scene(), own) is not None and len(scene().objects) == 5


def test_variants_that_lost_their_faces_are_told():
    held = tree("one").users_collection[0]
    own = species(held, variants=True)
    add_plant(species=own)
    held.objects.unlink(bpy.data.objects["one"])
    with pytest.raises(SceneError, match=r'The collection "sources".*no object with faces'):
        read()
