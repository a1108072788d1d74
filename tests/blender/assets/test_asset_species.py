# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects and collections as species: in menus, Populate, the brush, previews, files and linked libraries."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.assets.scatters import crown, read, scene, species
from tests.blender.scenes import add_mesh, add_plant, depsgraph, select
from tetflora_addon.blender.assets import marks
from tetflora_addon.blender.compat import shader_tree
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.placing.distances import distance_of
from tetflora_addon.blender.placing.plant_objects import add_plant as place_plant
from tetflora_addon.blender.scene.crowns import crown_for, crown_to_draw
from tetflora_addon.blender.species import catalog, edits
from tetflora_addon.blender.species.asset_species import PICTURE_SIDE, asset_of, find_asset, picture_of
from tetflora_addon.blender.viewport import levels, state
from tetflora_addon.errors import SceneError, SpeciesError
from tetflora_addon.files import is_identifier

pytestmark = pytest.mark.usefixtures("clean_file", "thumbnails_looked_for")


def test_an_object_is_a_species_in_all_menus_with_its_measures_and_a_picture():
    obj = crown("Scots pine")
    obj.scale = (1.0, 0.5, 2.0)
    select(obj)
    assert bpy.ops.tetflora.use_as_species() == {'FINISHED'}
    (entry,) = scene().tetflora.asset_species
    assert entry.identifier.startswith("asset-") and is_identifier(entry.identifier)
    info = edits.catalog()[entry.identifier]
    assert info.name == "Scots pine" and "10 m" in info.description
    assert entry.identifier in [item[0] for item in catalog.items_for()]
    assert entry.identifier not in edits.grown()
    found = crown_for(scene(), entry.identifier)
    assert found == crown_to_draw(scene(), entry.identifier)
    assert (found.radius, found.height, found.polygons) == pytest.approx((2.0, 10.0, 6.0))
    assert 2.0 <= found.base < 10.0 and found.leaves > 0.0
    assert edits.display_height(entry.identifier) == pytest.approx(10.0)
    picture = picture_of(entry)
    assert picture.shape == (PICTURE_SIDE, PICTURE_SIDE, 4)
    assert 0.1 < (picture[..., 3] > 200).mean() < 0.6
    assert (picture[0, :, 3] == 0).all() and (picture[-1, :, 3] == 0).all()


def test_the_picture_is_lit_and_in_the_colors_of_the_material():
    obj = crown()
    material = bpy.data.materials.new("red")
    shader_tree(material).nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.05, 0.05, 1.0)
    obj.data.materials.append(material)
    entry = find_asset(scene(), species(obj))
    assert tuple(entry.color) == pytest.approx((0.8, 0.05, 0.05), abs=1e-3)
    picture = picture_of(entry)
    seen = picture[picture[..., 3] > 200]
    assert seen[:, 0].mean() > 2 * seen[:, 1].mean()
    assert np.unique(seen[:, 0]).size > 1


def test_broken_pictures_are_none():
    entry = find_asset(scene(), species(crown()))
    for text in ("", "no picture", "é", entry.picture[:40]):
        entry.picture = text
        assert picture_of(entry) is None
        assert catalog.icon_of(entry.identifier) == 0


def test_the_identifier_is_kept_through_renaming_and_comes_again():
    obj, other = crown(), crown("other")
    own = species(obj)
    assert species(other) != own
    obj.name = "renamed"
    assert species(obj) == own and edits.catalog()[own].name == "renamed"
    obj.name = "crown"
    assert marks.stop_using(obj) == 1 and own not in edits.catalog()
    assert species(obj) == own


@pytest.mark.parametrize("what", ["lamp", "camera", "empty", "bare", "plant", "field"])
def test_what_has_no_faces_or_is_a_plant_is_refused(what):
    if what == "lamp":
        obj = bpy.data.objects.new("odd", bpy.data.lights.new("odd", 'POINT'))
    elif what == "camera":
        obj = bpy.data.objects.new("odd", bpy.data.cameras.new("odd"))
    elif what == "bare":
        obj = add_mesh("odd", faces=())
        scene().collection.objects.unlink(obj)
    else:
        obj = bpy.data.objects.new("odd", None)
        obj.tetflora.is_plant, obj.tetflora.is_field = what == "plant", what == "field"
    scene().collection.objects.link(obj)
    with pytest.raises(SceneError, match='"odd" cannot be used as a species: it has no faces'):
        species(obj)
    assert len(scene().tetflora.asset_species) == 0


def test_an_empty_collection_is_refused_and_one_with_variants_measured_over_them():
    held = bpy.data.collections.new("held")
    scene().collection.children.link(held)
    for variants in (False, True):
        with pytest.raises(SceneError, match='"held"'):
            species(held, variants)
    for name, radius in (("small", 1.0), ("large", 3.0)):
        held.objects.link(crown(name, radius))
    own = species(held, True)
    assert find_asset(scene(), own).variants and crown_for(scene(), own).radius == pytest.approx(2.0)
    assert species(held, False) == own
    assert not find_asset(scene(), own).variants and crown_for(scene(), own).radius == pytest.approx(3.0)


def test_plants_are_populated_by_its_crown_and_bear_its_name():
    own = species(crown("Rock", 2.0))
    ground = add_mesh("ground", size=40.0)
    mix = scene().tetflora.populate.mix
    mix.clear()
    mix.add().species = own
    select(ground)
    assert bpy.ops.tetflora.populate() == {'FINISHED'}
    population = scene().tetflora.layers[0]
    assert distance_of(population) == pytest.approx(2.4, rel=0.05)  # 1.2 radii
    made = [o for o in scene().objects if o.tetflora.is_plant]
    assert len(made) > 50 and all(o.name.startswith("Rock") for o in made)
    assert made[0].empty_display_size == pytest.approx(5.0)
    (found,) = read()
    assert len(found) == len(made)
    population.as_field = 'FIELD'
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    (again,) = read()
    assert again.owner.tetflora.is_field and len(again) == len(found)
    assert sorted(map(tuple, np.round(again.matrices[:, :3, 3], 3))) == sorted(
        map(tuple, np.round(found.matrices[:, :3, 3], 3))
    )


def test_a_changed_asset_is_measured_anew_when_plants_are_placed():
    obj = crown("Rock", 2.0)
    own = species(obj)
    obj.scale = (3.0, 3.0, 1.0)
    ground = add_mesh("ground", size=40.0)
    scene().tetflora.populate.mix.add().species = own
    select(ground)
    assert bpy.ops.tetflora.populate() == {'FINISHED'}
    assert crown_for(scene(), own).radius == pytest.approx(6.0)


def test_companions_ground_cover_and_the_brush_take_assets():
    own = species(crown("Rock", 1.0))
    ground = add_mesh("ground", size=20.0)
    mix = scene().tetflora.populate.mix
    one, other = mix.add(), mix.add()
    one.species, other.species = own, "fern"
    other.companion_choice = own
    assert other.companion == own
    other.companion_strength, other.companion_distance = 1.0, 3.0
    select(ground)
    assert bpy.ops.tetflora.populate() == {'FINISHED'}
    assert {o.tetflora.species for o in scene().objects if o.tetflora.is_plant} == {own, "fern"}
    assert bpy.ops.tetflora.ground_cover() == {'FINISHED'}
    brush = scene().tetflora.brush
    brush.source, brush.species, brush.density, brush.radius = 'ONE', own, 20.0, 4.0
    before = sum(map(len, read()))
    assert bpy.ops.tetflora.paint_plants(mode='PAINT', stroke="15 15 0, 16 16 0") == {'FINISHED'}
    assert sum(map(len, read())) > before


def test_the_brush_does_not_plant_on_an_asset():
    rock = crown("Rock", 4.0)
    add_mesh("ground", size=20.0)
    brush = scene().tetflora.brush
    brush.source, brush.species, brush.density = 'ONE', "fern", 20.0
    for asset, heights in ((False, {0.0, 5.0}), (True, {0.0})):
        if asset:
            species(rock)
        assert bpy.ops.tetflora.paint_plants(mode='PAINT', stroke="3.5 0 0, 4.5 0 0") == {'FINISHED'}
        made = [o for o in scene().objects if o.tetflora.is_plant]
        assert {round(o.location.z, 3) for o in made} == heights
        bpy.data.batch_remove(made)


def test_other_operators_on_plants_take_assets():
    own = species(crown())
    plant = add_plant(species="bush")
    select(plant)
    assert bpy.ops.tetflora.assign_species(species=own) == {'FINISHED'}
    assert plant.tetflora.species == own and plant.empty_display_size == pytest.approx(5.0)
    assert bpy.ops.tetflora.select_plants(species=own) == {'FINISHED'}
    assert bpy.ops.tetflora.reseed() == {'FINISHED'}
    assert bpy.ops.tetflora.convert_plants(to='FIELD') == {'FINISHED'}
    assert len(read()[0]) == 1
    assert bpy.ops.tetflora.convert_plants(to='OBJECTS') == {'FINISHED'}
    assert len(read()[0]) == 1


def test_what_needs_a_species_that_grows_says_so():
    own = species(crown("Rock"))
    with pytest.raises(SpeciesError, match='"Rock" is an asset'):
        edits.species_for(scene(), own)
    with pytest.raises(SpeciesError, match='"Rock" is an asset'):
        edits.species_data(scene(), own)
    assert "is an asset" in edits.problem_of(scene(), own)
    (plant,) = place_plant(scene(), (0.0, 0.0, 0.0), 0.0, 1.0, 1, own)
    select(plant)
    with pytest.raises(RuntimeError, match="is an asset"):
        bpy.ops.tetflora.make_plant_mesh()
    editor = scene().tetflora.species_editor
    with pytest.raises(TypeError):
        editor.species_choice = own


def test_previews_show_simple_crowns_of_the_right_size_beside_grown_plants():
    own = species(crown("Rock", 2.0, 1.0, 5.0))
    rock = add_plant(species=own, scale=(1.0, 2.0, 1.0), location=(100.0, 0.0, 0.0))
    scene().tetflora.preview.plants = 'LIGHT'
    shapes = levels.read_shapes(scene(), depsgraph())
    assert shapes.plants == 1 and state.of(scene()).message == ""
    extent = shapes.positions.max(axis=0) - shapes.positions.min(axis=0)
    assert extent[0] == pytest.approx(4.0, rel=0.01) and extent[2] == pytest.approx(5.0, rel=0.01)
    assert 6.5 < extent[1] <= 8.0
    add_plant("bush", species="bush")
    for form, width in (('LIGHT', 3), ('BOUNDS', 2)):
        scene().tetflora.preview.plants = form
        shapes = levels.read_shapes(scene(), depsgraph())
        assert shapes.plants == 2 and shapes.indices.shape[1] == width
        assert shapes.indices.max() == len(shapes.positions) - 1
        reach = (shapes.positions + shapes.origin)[:, 0].max()
        assert reach == pytest.approx(102.0, abs=0.1)
    bpy.data.objects.remove(rock)


def test_simple_crowns_stand_on_trunks_in_the_color_of_the_wood():
    held = bpy.data.collections.new("tree")
    for part, color in ((crown("trunk", 0.2, 0.0, 3.0), (0.4, 0.1, 0.02)), (crown("leaves"), (0.05, 0.4, 0.04))):
        material = bpy.data.materials.new(part.name)
        shader_tree(material).nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1.0)
        part.data.materials.append(material)
        part.location.z = 2.0 * (part.name == "leaves")
        held.objects.link(part)
    add_plant(species=species(held))
    scene().tetflora.preview.plants = 'LIGHT'
    shapes = levels.read_shapes(scene(), depsgraph())
    foot, top = (shapes.colors[pick(shapes.positions[:, 2])] for pick in (np.argmin, np.argmax))
    assert foot[0] > 1.5 * foot[1] and top[1] > 1.5 * top[0]
    assert scene().tetflora.asset_species[0].base > 1.0


def test_a_missing_asset_is_shown_as_such_in_menus():
    obj = crown("Rock")
    own = species(obj)
    scene().tetflora.populate.mix.add().species = own
    select(add_mesh("ground", size=20.0))
    bpy.data.objects.remove(obj)
    edits.look_again()
    item = next(item for item in catalog.items_for(own) if item[0] == own)
    assert item[1] == "Rock (missing)" and item[3] == 'ERROR'
    with pytest.raises(RuntimeError, match='"Rock", which was used as a species, was deleted'):
        bpy.ops.tetflora.populate()


def test_a_model_that_was_deleted_is_missing_although_results_show_it_still():
    """Instances of results are users of it, too: it was made again and again, and listed as if it were there."""
    obj = crown("Rock")
    own = species(obj)
    for number in range(3):
        add_plant(str(number), own, location=(4.0 * number, 0.0, 0.0))
    scene().camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene().camera.location, scene().camera.rotation_euler = (4.0, -40.0, 3.0), (1.5, 0.0, 0.0)
    scene().collection.objects.link(scene().camera)
    assert refine.refine(scene(), depsgraph()).instances_whole == 3
    edits.look_again()
    assert edits.catalog()[own].name == "Rock"
    select(obj)
    bpy.ops.object.delete()
    edits.look_again()
    assert own not in edits.catalog() and obj.users > 0
    with pytest.raises(SceneError, match='"Rock", which was used as their species, was deleted'):
        refine.refine(scene(), depsgraph())


def test_species_are_saved_and_belong_to_their_file(tmp_path):
    own = species(crown("Rock"))
    add_plant(species=own)
    path = str(tmp_path / "rocks.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    edits.look_again()
    assert own not in edits.catalog()
    bpy.ops.wm.open_mainfile(filepath=path)
    edits.look_again()
    assert edits.catalog()[own].name == "Rock" and picture_of(find_asset(None, own)) is not None
    assert len(read()[0]) == 1


@pytest.fixture
def linked(tmp_path):
    """A tree and a ground that scatters it, both linked from another file."""
    tree = crown("Linked tree")
    held = bpy.data.collections.new("library")
    scene().collection.children.link(held)
    held.objects.link(tree)
    ground = add_mesh("Linked ground")
    held.objects.link(ground)
    child = bpy.data.objects.new("Linked child", tree.data)
    held.objects.link(child)
    child.parent, ground.instance_type = ground, 'VERTS'
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {held})
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (found, wanted):
        wanted.collections = list(found.collections)
    scene().collection.children.link(wanted.collections[0])
    return bpy.data.objects["Linked tree"], bpy.data.objects["Linked ground"], tmp_path / "uses.blend"


def test_linked_objects_are_species_and_scatter_without_overrides(linked):
    tree, ground, path = linked
    assert tree.library is not None
    select(tree)
    assert bpy.ops.tetflora.use_as_species() == {'FINISHED'}
    own = asset_of(tree).identifier
    add_plant(species=own)
    select(ground)
    assert bpy.ops.tetflora.mark(what='SCATTER') == {'FINISHED'}
    assert {p.target.datablock.name: len(p) for p in read()} == {"Linked tree": 1, "Linked child": 4}
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert {p.target.datablock.name: len(p) for p in read()} == {"Linked tree": 1, "Linked child": 4}
    select(bpy.data.objects["Linked ground"])
    assert bpy.ops.tetflora.mark(what='SCATTER') == {'FINISHED'}
    assert len(read()) == 1
