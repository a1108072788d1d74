# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields with recorded sizes, and histories of stands: plants have the sizes that are written down."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.blender.scene.ages import kind_species, plainly_aged
from tetflora_addon.blender.scene.fields import read_aged_field
from tetflora_addon.blender.scene.plants import read_asset_plants, read_plants
from tetflora_addon.blender.species.asset_species import asset_species
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.recorded_sizes import fits_of, heights, measure_of
from tetflora_addon.compiled.sizes import measured
from tetflora_addon.growth.growth import radius_at, trunks
from tetflora_addon.growth.seeds import BASE, EAST, LEAVES, THICKNESS
from tetflora_addon.species.ages import ages_of
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.kinds import Kind

pytestmark = pytest.mark.usefixtures("clean_file")

KEYS = {'INT': "value", 'FLOAT': "value", 'FLOAT_VECTOR': "vector"}


def field_of(number, kinds=("birch",), places=None, **attributes):
    """A field of points a meter apart; attributes are (type, values)."""
    mesh = bpy.data.meshes.new("field")
    mesh.vertices.add(number)
    places = np.arange(number)[:, None] * [1.0, 0.0, 0.0] if places is None else places
    mesh.attributes["position"].data.foreach_set("vector", np.asarray(places, np.float32).reshape(-1))
    for key, (kind, values) in attributes.items():
        shape = (number, 3) if kind == 'FLOAT_VECTOR' else (number,)
        values = np.broadcast_to(np.asarray(values, np.int32 if kind == 'INT' else np.float32), shape)
        mesh.attributes.new(key, kind, 'POINT').data.foreach_set(KEYS[kind], values.reshape(-1).copy())
    obj = bpy.data.objects.new("field", mesh)
    obj.tetflora.is_field = True
    for identifier in kinds:
        obj.tetflora.field_species.add().species = identifier
    bpy.context.scene.collection.objects.link(obj)
    return obj


def plants():
    return read_plants(bpy.context.scene, depsgraph())[0]


def compiled(kind):
    return compile_species([kind_species(load_species(kind.split("\n")[0]), kind)])


def test_plants_have_the_sizes_that_are_recorded():
    height = np.array([0.8, 3.0, 9.0, 15.0, 21.0, 28.0])
    field_of(
        6,
        seed=('INT', np.arange(6)),
        tf_height=('FLOAT', height),
        tf_diameter=('FLOAT', height / 80.0),
        tf_crown_width=('FLOAT', height / 3.0),
        tf_crown_base=('FLOAT', height / 2.0),
        tf_crown_offset=('FLOAT_VECTOR', (0.2, 0.0, 0.0)),
    )
    read = plants()
    assert all(Kind.read(kind).age > 0.0 for kind in read.identifiers)
    np.testing.assert_allclose(read.crown[:, BASE], 0.5, rtol=1e-5)
    np.testing.assert_allclose(read.crown[:, EAST], 0.2, rtol=1e-5)
    for n, tall in enumerate(height.tolist()):
        one = read.take(np.array([n]))
        flora = compiled(read.identifiers[read.species[n]])
        trunk = trunks(flora.rows, replace(one, species=one.species * 0))
        if tall > 2.0:
            girth = 2.0 * radius_at(flora.rows, trunk, 1.3 / trunk.length)[0]
            assert girth == pytest.approx(tall / 80.0, rel=1e-3)


@pytest.mark.parametrize(("species", "fits"), [("birch", False), ("beech", False), ("beech", True), ("hazel", True)])
def test_plants_grow_to_their_recorded_heights_and_widths(species, fits):
    rng = np.random.default_rng(4)
    full = measure_of(load_species(species)).height
    height = full * rng.uniform(0.2, 1.2, 24)
    width, seed = rng.uniform(0.8, 1.1, 24) * height * (0.4 if species != "hazel" else 1.0), np.arange(24)
    obj = field_of(24, (species,), tf_height=('FLOAT', height), tf_crown_width=('FLOAT', width), seed=('INT', seed))
    if fits:
        seeds, _, sizes = read_aged_field(obj, depsgraph(), np.eye(4)[None])
        found = np.pad(fits_of(seeds, sizes, load_species), ((0, 0), (0, 1))).astype(np.float32)
        obj.data.attributes.new("tf_fit", 'FLOAT_VECTOR', 'POINT').data.foreach_set("vector", found.reshape(-1))
    read = plants()
    flora = compile_species([kind_species(load_species(species), kind) for kind in read.identifiers])
    tall, wide = measured(flora, read)
    off = np.abs(np.log([tall / height, wide / width]))
    if fits:
        assert off[0].max() < 0.05
        assert (off[1] < 0.05).mean() >= 0.9
    else:
        assert np.median(off[0]) < 0.04
        assert off[0].max() < 0.15
        assert np.median(off[1]) < 0.1


def test_assets_are_stretched_to_their_recorded_sizes():
    ball = add_mesh("ball", size=0.5)
    ball.scale.z = 3.0
    select(ball)
    assert bpy.ops.tetflora.use_as_species() == {'FINISHED'}
    (asset,) = asset_species(bpy.context.scene).values()
    field_of(2, (asset.identifier,), tf_height=('FLOAT', [5.0, 0.0]), tf_crown_width=('FLOAT', [4.0, 4.0]))
    (found,) = read_asset_plants(bpy.context.scene, depsgraph())
    sizes = np.linalg.norm(found.matrices[:, :3, :3], axis=1)
    wide, tall = 2.0 / asset.radius, 5.0 / asset.height
    np.testing.assert_allclose(sizes, [[wide, wide, tall], [1.0, 1.0, 1.0]], rtol=1e-5)


def history():
    """Two plants: one in the years 10, 20 and 30, which has died in between, the other in 20 and 40."""
    return field_of(
        5,
        places=[(0, 0, 0)] * 3 + [(5, 0, 0)] * 2,
        seed=('INT', [1, 1, 1, 2, 2]),
        tf_plant=('INT', [7, 7, 7, 8, 8]),
        tf_year=('FLOAT', [10, 20, 30, 20, 40]),
        tf_height=('FLOAT', [2, 4, 4, 1, 3]),
        tf_dead=('FLOAT', [0, 0, 6, 0, 0]),
    )


def at_year(obj, year, smooth=False):
    obj.tetflora.stand_year, obj.tetflora.stand_smooth = year, smooth
    seeds, _, sizes = read_aged_field(obj, depsgraph(), np.eye(4)[None])
    return seeds.seed.tolist(), sizes.height.tolist(), sizes.dead.tolist()


@pytest.mark.parametrize(
    ("year", "wanted"),
    [
        (0.0, ([], [], [])),  # nothing has come up yet
        (10.0, ([1], [2.0], [0.0])),
        (15.0, ([1], [3.0], [0.0])),
        (20.0, ([1, 2], [4.0, 1.0], [0.0, 0.0])),
        (24.0, ([1, 2], [4.0, 1.4], [0.0, 0.0])),
        (28.0, ([1, 2], [4.0, 1.8], [4.0, 0.0])),
        (31.0, ([2], [2.1], [0.0])),
        (90.0, ([2], [3.0], [0.0])),
    ],
)
def test_histories_are_read_at_their_year(year, wanted):
    obj = history()
    for smooth in (False, True):
        for found, own in zip(at_year(obj, year, smooth), wanted, strict=True):
            assert found == pytest.approx(own, abs=1e-5)


def test_years_follow_keys_and_subframes():
    obj, scene = history(), bpy.context.scene
    for frame, year in ((1, 10.0), (21, 30.0)):
        obj.tetflora.stand_year = year
        obj.tetflora.keyframe_insert("stand_year", frame=frame)
    for frame, subframe in ((1, 0.0), (8, 0.5)):
        scene.frame_set(frame, subframe=subframe)
        year = obj.tetflora.stand_year
        assert read_aged_field(obj, depsgraph(), np.eye(4)[None])[2].height[0] == pytest.approx(
            2.0 + (year - 10.0) / 5.0
        )


def test_years_follow_keys_where_blender_does_not_evaluate_the_field():
    obj, scene = history(), bpy.context.scene
    obj.tetflora.stand_year = 15.0
    for frame, year in ((1, 10.0), (21, 20.0)):
        obj.tetflora.stand_year = year
        obj.tetflora.keyframe_insert("stand_year", frame=frame)
    obj.hide_viewport = True
    for frame, height in ((1, [2.0]), (11, [3.0]), (21, [4.0, 1.0])):
        scene.frame_set(frame)
        found = read_aged_field(obj, depsgraph(), np.eye(4)[None])[2]
        assert found.height == pytest.approx(height)


def test_the_dead_are_dead_at_the_size_of_their_death():
    obj = history()
    obj.tetflora.stand_year = 28.0
    read = plants()
    assert sorted(Kind.read(kind).dead > 0.0 for kind in read.identifiers) == [False, True]
    for n, kind in enumerate(read.identifiers):
        flora = compiled(kind)
        tall = trunks(flora.rows, replace(read.take(read.species == n), species=np.zeros(1, np.int32))).length
        assert (flora.leaf_count[0] > 0.0) == (Kind.read(kind).dead == 0.0)
        assert tall == pytest.approx(4.0 if Kind.read(kind).dead else 1.8, rel=0.5)


def test_growth_that_is_smooth_has_no_jumps():
    obj = history()
    obj.tetflora.stand_smooth = True
    ages, length = [], []
    for year in np.arange(24.0, 39.0, 1.0).tolist():
        obj.tetflora.stand_year = year
        read = plants()
        own = np.flatnonzero(read.seed == 2)
        kind = read.identifiers[read.species[own[0]]]
        ages.append(Kind.read(kind).age)
        length.append(trunks(compiled(kind).rows, replace(read.take(own), species=np.zeros(1, np.int32))).length[0])
    assert 0.0 <= np.diff(ages).min() <= np.diff(ages).max() < 1.5
    assert np.abs(np.diff(np.log(length))).max() < 0.1


def test_trees_of_a_dense_stand_have_its_habit_and_free_ones_have_not():
    """A free beech with its limbs cut short to the crown of a stand has next to no twigs."""
    field_of(
        3,
        kinds=("beech",),
        seed=('INT', np.arange(3)),
        tf_height=('FLOAT', 21.0),
        tf_diameter=('FLOAT', [0.24, 0.24, 0.7]),
        tf_crown_width=('FLOAT', [4.8, 4.8, 16.0]),
        tf_crown_base=('FLOAT', [13.0, 2.0, 2.0]),
    )
    read = plants()
    kinds = [read.identifiers[n] for n in read.species]
    assert [Kind.read(kind).crowded for kind in kinds] == [True, False, False]
    assert Kind.read(kinds[0]).age == load_species("beech").ages.full  # tall, but not as thick as an old one
    assert 0.4 < read.crown[0, LEAVES] < 1.5
    assert 0.5 < read.crown[0, THICKNESS] < 1.5
    plain = plainly_aged(bpy.context.scene, read, None, None)[0]
    assert set(plain.identifiers) == {"beech"}
    free = replace(plain.take(np.array([0])), identifiers=("beech",), species=np.zeros(1, np.int32))
    assert measured(compile_species([load_species("beech")]), free)[1] == pytest.approx(4.8, rel=0.4)


def test_trees_keep_their_habit_through_the_years_of_an_animation():
    years = np.tile([10.0, 40.0, 80.0], 2)
    obj = field_of(
        6,
        kinds=("beech",),
        tf_plant=('INT', [0, 0, 0, 1, 1, 1]),
        tf_year=('FLOAT', years),
        seed=('INT', [0, 0, 0, 1, 1, 1]),
        tf_height=('FLOAT', [4.0, 14.0, 20.0, 4.0, 14.0, 20.0]),
        tf_crown_width=('FLOAT', [2.5, 3.5, 4.5, 2.5, 8.0, 14.0]),
        tf_crown_base=('FLOAT', [0.5, 7.0, 12.0, 0.5, 1.0, 2.0]),
    )
    obj.tetflora.stand_smooth = True
    for year in (12.0, 60.0):
        obj.tetflora.stand_year = year
        read = plants()
        assert [Kind.read(read.identifiers[n]).crowded for n in read.species[np.argsort(read.seed)]] == [True, False]


def test_growth_is_smooth_where_the_year_has_keys():
    """Whoever keys it by hand has the same plants as Animate Growth gives."""
    found = []
    for smooth, keyed in ((False, False), (True, False), (False, True)):
        obj = history()
        obj.tetflora.stand_year, obj.tetflora.stand_smooth = 24.0, smooth
        if keyed:
            obj.tetflora.keyframe_insert("stand_year", frame=1)
        read = plants()
        found.append(sorted(read.identifiers[n] for n in read.species))
        bpy.data.objects.remove(obj)
    still, smooth, keyed = found
    assert keyed == smooth != still


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("tf_height", [1.0, np.nan, -1.0], "2 of 3 points have tf_height .* the first is point 1"),
        ("tf_height", [1.0, 2.0, 201.0], "1 of 3 points have tf_height"),
        ("tf_dead", [0.0, -2.0, 0.0], "tf_dead"),
    ],
)
def test_sizes_that_cannot_be_are_refused(name, values, message):
    field_of(3, **{name: ('FLOAT', values)})
    with pytest.raises(errors.SceneError, match=message):
        plants()


def test_sizes_without_prefix_and_zeros_say_nothing():
    field_of(3, height=('FLOAT', 3.0), dead=('FLOAT', 1.0), year=('FLOAT', 1.0))
    before = plants()
    field_of(3, tf_height=('FLOAT', 0.0), tf_dead=('FLOAT', 0.0), tf_fit=('FLOAT_VECTOR', 0.0))
    assert before.crown is None
    assert set(plants().identifiers) == set(before.identifiers) == {"birch"}
    assert plants().crown is None


def test_a_dead_tree_is_old_and_as_small_in_what_has_no_dead_kinds():
    """Plain fields know ages, not years since death: what died young has the years of the dead, and its own height."""
    species = load_species("beech")
    field_of(
        3,
        kinds=("beech",),
        seed=('INT', np.arange(3)),
        tf_height=('FLOAT', [12.0, 12.0, 20.0]),
        tf_diameter=('FLOAT', [0.12, 0.12, 0.3]),
        tf_dead=('FLOAT', [0.0, 6.0, 6.0]),
    )
    read = plants()
    dead = np.array([Kind.read(read.identifiers[n]).dead for n in read.species])
    assert (dead > 0.0).tolist() == [False, True, True]
    plain, ages = plainly_aged(bpy.context.scene, read, None, None)
    assert set(plain.identifiers) == {"beech"}
    np.testing.assert_allclose(ages[1:], ages_of(species).lifespan + dead[1:])
    assert 0.0 < ages[0] < ages_of(species).lifespan
    found = []
    for seeds, years in ((read, [Kind.read(read.identifiers[n]).age for n in read.species]), (plain, ages)):
        found.append(seeds.scale * heights(species, np.array(years)))
    np.testing.assert_allclose(*found, rtol=1e-6)
