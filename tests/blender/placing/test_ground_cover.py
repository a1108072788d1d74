# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground Cover: a population under another, soil in its colors, and what of the artist's is left alone."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from operators.layers import TETFLORA_OT_ground_cover
from tests.blender.scenes import add_mesh, add_plant, depsgraph, select
from tetflora_addon.blender.attributes import values_of
from tetflora_addon.blender.materials.soil import is_soil
from tetflora_addon.blender.placing import population_data, populations, rules
from tetflora_addon.blender.placing.canopy import canopy_of
from tetflora_addon.blender.placing.cover import cover_steps
from tetflora_addon.blender.scene import fields
from tetflora_addon.blender.species.edits import change_species, find_edit, species_for
from tetflora_addon.compiled import recorded_sizes, sizes

pytestmark = pytest.mark.usefixtures("clean_file")


def _group():
    return bpy.context.scene.tetflora


def _covers():
    return [p for p in _group().layers if p.covers]


def _field(population=None):
    (field,) = populations.own_objects(bpy.context.scene, population or _covers()[0])
    return field


def _wood(size=12.0, **options):
    """A ground with trees in its western half."""
    ground = add_mesh("ground", size=size)
    ground.vertex_groups.new(name="west").add([0, 3], 1.0, 'REPLACE')
    select(ground)
    values = {"count": 14, "species": "birch:2, spruce", "min_distance": 1.0, **options}
    assert bpy.ops.tetflora.populate(**values) == {'FINISHED'}
    return ground


def _cover(**options):
    assert bpy.ops.tetflora.ground_cover(**options) == {'FINISHED'}
    bpy.context.view_layer.update()
    return _covers()[0]


def _places(name, population=None):
    """Places of the plants of one species of a cover."""
    field = _field(population)
    kinds = [entry.species for entry in field.tetflora.field_species]
    read = fields.read_field(field, depsgraph(), np.eye(4)[None])
    return read.position[read.species == kinds.index(name)]


def test_the_ground_of_a_population_is_covered_by_what_grows_and_falls_there():
    ground = _wood()
    cover = _cover()
    species = {entry.species: entry for entry in cover.mix}
    assert {"moss", "wood_grass", "wood_sorrel", "fern", "birch_litter", "spruce_litter"} <= set(species)
    assert {"birch_branch", "spruce_branch"} <= set(species)
    assert species["birch_litter"].shed_by == "birch"
    assert species["wood_grass"].habitat == 'LIGHT'
    assert cover.covers == _group().layers[0].uid
    assert _group().layers_index == 0  # the trees stay what the panel shows
    assert [entry.object for entry in cover.grounds] == [ground]
    assert cover.made == fields.stored_size(_field()) > 2000
    assert _field().display_type == 'BOUNDS'  # black points would hide the ground
    assert len(_places("birch_litter")) > 100
    for name in species:
        species_for(bpy.context.scene, name)
    # 8 to 24 plants on a square meter: as many as the panel's number promises at most.
    assert cover.made < cover.density / 10_000 * 24.0**2


def test_litter_lies_under_its_own_trees_and_grass_in_the_light():
    _wood(size=15.0, count=60, min_distance=0.5)
    trees = [o for o in bpy.context.scene.objects if o.tetflora.is_plant]
    for tree in trees:  # birches in the west, spruces beside them, nothing in the east
        tree.location.x = -12.0 + 0.2 * tree.location.x if tree.tetflora.species == "birch" else -2.0
        tree.location.z = 0.0
    bpy.context.view_layer.update()
    _cover()
    assert _places("birch_litter")[:, 0].mean() < -7.0
    assert abs(_places("spruce_litter")[:, 0].mean() + 2.0) < 3.0
    assert _places("wood_grass")[:, 0].mean() > 3.0
    assert _places("moss")[:, 0].mean() < _places("wood_grass")[:, 0].mean() - 3.0


def test_masks_of_the_population_hold_for_its_cover():
    _wood(size=12.0)
    population = _group().layers[0]
    population.vertex_group = "west"
    path = bpy.data.curves.new("path", 'CURVE')
    spline = path.splines.new('POLY')
    spline.points.add(1)
    for point, y in zip(spline.points, (-20.0, 20.0), strict=True):
        point.co = (-6.0, y, 0.0, 1.0)
    population.paths = bpy.data.collections.new("paths")
    population.paths.objects.link(bpy.data.objects.new("path", path))
    bpy.context.scene.collection.children.link(population.paths)
    population.path_distance = 1.5
    cover = _cover()
    x = fields.read_field(_field(), depsgraph(), np.eye(4)[None]).position[:, 0]
    assert cover.vertex_group == "west"
    assert (np.abs(x + 6.0) >= 1.5).all()
    # The weight falls from the west to nothing in the east; without it a third would be here.
    assert (x < -2.0).mean() > 0.48
    assert (x > 6.0).sum() < (x < -8.0).sum()


def test_again_replaces_and_keeps_what_the_artist_changed():
    _wood()
    cover = _cover()
    entry = next(e for e in cover.mix if e.species == "moss")
    entry.weight = 0.0
    cover.name = "Mine"
    change_species(bpy.context.scene, "birch_litter", lambda page: page.update(name="My litter"))
    _cover()
    assert len(_covers()) == 1
    assert len([o for o in bpy.context.scene.objects if o.tetflora.is_field]) == 1
    assert _covers()[0].name == "Mine"
    assert "My litter" in find_edit(bpy.context.scene, "birch_litter").text
    assert len(_places("moss")) == 0
    assert _covers()[0].made > 0


def test_the_button_on_the_cover_renews_it_and_update_does_the_same():
    _wood()
    first = _cover().made
    _group().layers_index = 1
    _cover()
    assert len(_group().layers) == 2
    assert _covers()[0].made == first
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    assert _group().layers[1].made == first


def test_the_same_scene_gets_the_same_cover():
    _wood()
    _cover()
    before = {name: values_of(_field().data.attributes[name]).copy() for name in ("position", "seed", "species")}
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}  # the trees, at the same places
    _cover()
    for name, values in before.items():
        assert (values_of(_field().data.attributes[name]) == values).all()


def test_cover_keeps_no_tree_away_and_casts_no_shade():
    _wood(min_distance=2.0)
    trees = _group().layers[0].made
    canopy, _ = canopy_of(bpy.context.scene, depsgraph())
    _cover()
    assert len(canopy_of(bpy.context.scene, depsgraph())[0]) == len(canopy) == trees
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    assert _group().layers[0].made == trees


def test_the_brush_paints_and_thins_through_a_cover_and_erases_it():
    _wood()
    cover = _cover()
    covered = cover.made
    brush = _group().brush
    brush.density, brush.radius, brush.distance_from, brush.min_distance = 20.0, 5.0, 'OWN', 0.5
    trees = len(canopy_of(bpy.context.scene, depsgraph())[0])
    assert bpy.ops.tetflora.paint_plants(mode='PAINT', stroke="8 8 0") == {'FINISHED'}
    bpy.context.view_layer.update()
    assert len(canopy_of(bpy.context.scene, depsgraph())[0]) > trees
    bpy.ops.tetflora.paint_plants(mode='THIN', stroke="8 8 0")
    assert fields.stored_size(_field()) == covered
    assert bpy.ops.tetflora.paint_plants(mode='ERASE', stroke="8 8 0") == {'FINISHED'}
    assert fields.stored_size(_field()) < covered
    _cover()  # and what was erased stays bare
    left = fields.read_field(_field(), depsgraph(), np.eye(4)[None]).position
    assert np.hypot(left[:, 0] - 8.0, left[:, 1] - 8.0).min() >= 5.0


def test_a_frozen_cover_is_refused_and_stays():
    _wood()
    cover = _cover()
    cover.frozen, made = True, cover.made
    with pytest.raises(RuntimeError, match='"Ground cover" is frozen'):
        bpy.ops.tetflora.ground_cover()
    assert _covers()[0].made == made


def test_without_population_ground_or_plants_it_says_what_to_do():
    with pytest.raises(RuntimeError, match="Click a Scatter or Cover layer first"):
        bpy.ops.tetflora.ground_cover()
    ground = _wood()
    for tree in [o for o in bpy.context.scene.objects if o.tetflora.is_plant]:
        bpy.data.objects.remove(tree)
    with pytest.raises(RuntimeError, match="no plants whose ground could be covered; click Update first"):
        bpy.ops.tetflora.ground_cover()
    bpy.ops.tetflora.update_layers(which='ACTIVE')
    bpy.data.objects.remove(ground)
    with pytest.raises(RuntimeError, match="no ground in this scene; select meshes and click Use Selected Meshes"):
        bpy.ops.tetflora.ground_cover()
    assert not _covers()
    assert not _group().species_edits


@pytest.mark.parametrize("until", ["Light and litter under the plants", "Planting", "Looking for places"])
def test_closing_the_steps_leaves_everything_as_it_was(until):
    _wood()
    before = (len(_group().layers), len(bpy.data.objects), len(bpy.data.materials), len(bpy.data.images))
    steps = cover_steps(bpy.context.scene, depsgraph(), _group().layers[0])
    for progress in steps:
        assert 0.0 <= progress.fraction <= 1.0
        if progress.message == until:
            break
    steps.close()
    after = (len(_group().layers), len(bpy.data.objects), len(bpy.data.materials), len(bpy.data.images))
    assert after == before
    assert not _group().species_edits


@pytest.mark.parametrize("renewed", [False, True])
def test_crowns_of_a_stand_above_are_measured_beside_the_window(monkeypatch, renewed):
    """They stopped it for nine seconds as a biome was added: species were found in a thread, their ages were not."""
    ground = _wood()
    _cover()
    select(ground)
    _group().stand.years, _group().stand.density, _group().stand.recruits = 4, 300.0, 0.0
    _group().stand.species.add().species = "birch"
    assert bpy.ops.tetflora.grow_stand() == {'FINISHED'}
    threads = set()

    def noted(original):
        def found(*given):
            threads.add(threading.current_thread())
            return original(*given)

        return found

    known = {one: crown for one, crown in sizes._known.items() if one.identifier != "birch"}
    monkeypatch.setattr(sizes, "_known", known)  # of the trees, which are of several ages, nothing
    monkeypatch.setattr(sizes, "_crown_of", noted(sizes._crown_of))
    monkeypatch.setattr(recorded_sizes.Measure, "fitted", noted(recorded_sizes.Measure.fitted))
    scene = bpy.context.scene
    steps = populations.make_plants_steps(scene, depsgraph(), _covers()[0])
    if renewed:
        steps = cover_steps(scene, depsgraph(), _group().layers[0])
    assert len(list(steps)) > 1
    assert threads and threading.main_thread() not in threads


def test_a_cover_that_is_there_is_kept_where_its_renewal_is_stopped():
    _wood()
    _cover()
    (cover,) = _covers()
    cover.mix.remove(0)  # what a renewal adds again
    before = ([e.species for e in cover.mix], cover.density, cover.made, len(bpy.data.objects))
    steps = cover_steps(bpy.context.scene, depsgraph(), _group().layers[0])
    next(progress for progress in steps if progress.message == "Looking for places")
    steps.close()
    (cover,) = _covers()
    assert ([e.species for e in cover.mix], cover.density, cover.made, len(bpy.data.objects)) == before


def test_a_cover_that_is_done_stays_where_strewing_its_leaves_is_stopped():
    _wood()
    scene = bpy.context.scene
    scene.tetflora.year.enabled, scene.tetflora.year.day = True, 300.0
    made = SimpleNamespace(soil=True, fallen=True)
    steps = TETFLORA_OT_ground_cover.steps(made, bpy.context)
    for _ in steps:
        assert not hasattr(made, "cancelled") or _covers()
        if hasattr(made, "cancelled"):
            break
    steps.close()
    assert made.cancelled == "Stopped; the cover stays, without fallen leaves"
    (cover,) = _covers()
    assert cover.made


def test_soil_is_browner_under_trees_and_greener_in_the_light():
    ground = _wood(size=15.0, count=60, min_distance=0.5)
    for tree in [o for o in bpy.context.scene.objects if o.tetflora.is_plant]:
        tree.location.x = -10.0 + 0.2 * tree.location.x
    bpy.context.view_layer.update()
    _cover()
    material = ground.material_slots[0].material
    assert is_soil(material)
    image = next(n.image for n in material.node_tree.nodes if n.type == 'TEX_IMAGE')
    assert image.packed_file is not None  # it is in the file, and needs none beside it
    columns, rows = image.size
    pixels = np.zeros(4 * columns * rows, np.float32)
    image.pixels.foreach_get(pixels)
    rgba = pixels.reshape(rows, columns, 4)
    west, east = rgba[:, : columns // 3].mean(axis=(0, 1)), rgba[:, -columns // 4 :].mean(axis=(0, 1))
    assert east[3] > west[3] + 0.05
    assert east[3] > 0.6  # grass covers most of a meadow
    assert (east[:3] > west[:3]).all()  # and has dead grass between
    assert west[0] - west[1] > east[0] - east[1]  # redder than green where litter lies
    assert max(material.diffuse_color[:3]) >= 0.5  # Solid shading has no sun: soil would be nearly black
    # The map lies over the ground.
    nodes = material.node_tree.nodes
    assert [s.default_value for s in nodes["Soil Corner"].inputs][:2] == pytest.approx([-15.0, -15.0])
    assert [s.default_value for s in nodes["Soil Size"].inputs][:2] == pytest.approx([30.0, 30.0])


def _green(ground):
    """Mean fraction of a ground that its soil shows as green."""
    image = next(n.image for n in ground.material_slots[0].material.node_tree.nodes if n.type == 'TEX_IMAGE')
    pixels = np.zeros(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    return pixels[3::4].mean()


def test_soil_of_large_ground_is_as_green_as_if_all_were_planted(monkeypatch):
    """What a limit leaves out is missing far away; there the ground shows its color."""
    ground = _wood(size=15.0)
    _cover()
    whole = _green(ground)
    populations.remove_layer(bpy.context.scene, list(_group().layers).index(_covers()[0]))
    monkeypatch.setattr("tetflora_addon.blender.placing.cover.MOST", 400)
    cover = _cover()
    assert cover.made <= 400
    assert _green(ground) == pytest.approx(whole, abs=0.02)
    cover.density /= 4.0  # less by the artist's own wish is less green
    _cover()
    assert _green(ground) < whole - 0.03


def test_a_material_of_the_artist_stays_and_soil_is_there_for_use():
    ground = _wood()
    own = bpy.data.materials.new("mine")
    ground.data.materials.append(own)
    _cover()
    assert ground.material_slots[0].material == own
    (soil,) = [m for m in bpy.data.materials if is_soil(m)]
    assert soil.use_fake_user
    _cover(soil=False)
    assert len([m for m in bpy.data.materials if is_soil(m)]) == 1


def test_changed_nodes_of_the_soil_stay_and_its_map_follows():
    ground = _wood()
    _cover()
    material = ground.material_slots[0].material
    first = next(n.image for n in material.node_tree.nodes if n.type == 'TEX_IMAGE').name
    material.node_tree.nodes.new("ShaderNodeEmission").name = "mine"
    _cover()
    assert ground.material_slots[0].material == material
    assert "mine" in material.node_tree.nodes
    assert len([i for i in bpy.data.images if i.get("tetflora_soil")]) == 1
    assert first  # the map before it is gone, the new one is in its place


def test_habitats_are_written_to_files_and_read_again():
    _wood()
    _cover()
    data = population_data.population_data(_group().layers[1])
    read = populations.add_population(bpy.context.scene)
    population_data.fill_population(read, data, bpy.context.scene)
    assert [(e.species, e.habitat, e.shed_by) for e in read.mix] == [
        (e.species, e.habitat, e.shed_by) for e in _group().layers[1].mix
    ]


def test_large_ground_has_no_more_plants_than_blender_bears(monkeypatch):
    most = 20_000
    monkeypatch.setattr("tetflora_addon.blender.placing.cover.MOST", most)
    _wood(size=500.0)
    add_plant("one", "birch")
    cover = _cover(soil=False)
    # Nearly as many stand as may: what finds no place, as litter far from its tree, takes none from the others.
    assert 0.8 * most < cover.made <= most
    assert not rules.awaits_update(cover)
