# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo after each operator that changes the file brings all of it back, datablock by datablock, and redo the change.

Operators are called as buttons call them, so that Blender pushes the undo step, or not, by what they declare. What is
compared is in `digests`: everything but what Blender's memory of undo does not hold.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import bpy
import pytest

import operators
from tests import places_files
from tests.blender.digests import difference, everything
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tetflora_addon.blender import compat
from tetflora_addon.blender.biomes import library
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.placing import rules
from tetflora_addon.blender.species.catalog import OWN_FILES
from tetflora_addon.species import catalog

# Populations of the cases below: they are small, and of species that are quick to compile.
MIX = "bush:2, conifer"


def ops():
    return bpy.ops.tetflora


def scene():
    return bpy.context.scene


def forest() -> None:
    """Two plants before a small camera, and a ground; the plants are selected."""
    add_mesh("ground", size=8.0)
    add_camera(location=(0.0, -14.0, 3.0), rotation=(1.4, 0.0, 0.0))
    render = scene().render
    render.resolution_x = render.resolution_y = 48
    settings = scene().tetflora  # what is refined is coarse: undo brings back few polygons as it does many
    settings.leaf_limit, settings.cutoff, settings.visibility_resolution = 1.0, 6.0, 64
    plants = [add_plant(s, s, seed=n, location=(3.0 * n - 1.5, 0.0, 1.0)) for n, s in enumerate(("bush", "conifer"))]
    scene().tetflora.populate.count = 12
    bpy.context.view_layer.update()
    select(*plants)


def ground_active() -> None:
    forest()
    select(bpy.data.objects["ground"])


def biome_added() -> None:
    ground_active()
    assert ops().add_biome(biome="copse") == {'FINISHED'}


def change_biome() -> None:
    next(one for one in scene().tetflora.layers if one.kind == 'BIOME').wetness_max = 0.4


def refined() -> None:
    forest()
    bpy_update()
    refine.refine(scene(), depsgraph())


def bpy_update() -> None:
    bpy.context.view_layer.update()


def refined_mesh() -> None:
    """A mesh of the artist's is hidden for its results."""
    forest()
    bpy.data.objects["ground"].tetflora.is_explicit = True
    refine.refine(scene(), depsgraph())


def populated() -> None:
    ground_active()
    assert ops().populate(count=12, species=MIX, min_distance=0.5) == {'FINISHED'}
    bpy_update()


def populated_as_field() -> None:
    ground_active()
    assert ops().populate(count=12, species=MIX, min_distance=0.5, as_field='FIELD') == {'FINISHED'}
    bpy_update()
    select(next(o for o in bpy.data.objects if o.tetflora.is_field))


def stand() -> None:
    """A small stand of one species has grown."""
    ground_active()
    group = scene().tetflora.stand
    group.years, group.interval, group.density = 6, 3, 1500.0
    group.species.add().species = "birch"
    assert ops().grow_stand() == {'FINISHED'}
    group.years = 7


def edges() -> None:
    """A mesh of edges, which can be a plant's form, is active."""
    forest()
    mesh = bpy.data.meshes.new("form")
    mesh.from_pydata([(0, 0, 0), (0, 0, 1), (0.2, 0, 2)], [(0, 1), (1, 2)], [])
    obj = bpy.data.objects.new("form", mesh)
    scene().collection.objects.link(obj)
    select(obj)


def species_chosen() -> None:
    forest()
    scene().tetflora.species_editor.species = "bush"


def species_edited() -> None:
    species_chosen()
    assert ops().edit_orders(action='ADD') == {'FINISHED'}


def listed() -> None:
    forest()
    assert ops().edit_list(owner="scene.tetflora.populate", entries="mix", action='ADD') == {'FINISHED'}


def species_of_mesh() -> None:
    ground_active()
    assert ops().use_as_species() == {'FINISHED'}


def drop() -> None:
    """A collection instance of the ground is selected."""
    forest()
    held = bpy.data.collections.new("held")
    held.objects.link(bpy.data.objects["ground"])
    shown = bpy.data.objects.new("shown", None)
    shown.instance_type, shown.instance_collection = 'COLLECTION', held
    scene().collection.objects.link(shown)
    select(shown)


def small_scale() -> None:
    forest()
    scene().unit_settings.scale_length = 0.01


Case = tuple[str, Callable[[], None], str, dict]

LIST = {"owner": "scene.tetflora.populate", "entries": "mix"}
REROLL, FORGET = {"which": 'ACTIVE', "reroll": True}, {"which": 'ACTIVE', "forget_erased": True}
CASES: list[Case] = [
    ("add_plant", forest, "add_plant", {"species": "bush"}),
    ("populate", ground_active, "populate", {"count": 12, "species": MIX}),
    ("populate as a field", ground_active, "populate", {"count": 12, "species": MIX, "as_field": 'FIELD'}),
    ("populate again", populated, "populate", {"count": 5, "species": MIX, "seed": 3}),
    ("first_forest", lambda: None, "first_forest", {}),
    ("drop_to_ground", forest, "drop_to_ground", {}),
    ("use_as_skeleton", edges, "use_as_skeleton", {}),
    ("assign_species", forest, "assign_species", {"species": "fern"}),
    ("assign_species to a field", populated_as_field, "assign_species", {"species": "fern"}),
    ("reseed", forest, "reseed", {}),
    ("select_plants", populated, "select_plants", {"species": "bush"}),
    ("remove_plants selected", forest, "remove_plants", {}),
    ("remove_plants all", populated, "remove_plants", {"which": 'ALL'}),
    ("mark an occluder", ground_active, "mark", {"what": 'OCCLUDER'}),
    ("mark a mesh to refine", ground_active, "mark", {"what": 'EXPLICIT'}),
    ("use_as_species", ground_active, "use_as_species", {}),
    ("use_as_species of a collection", drop, "use_as_species", {}),
    ("use_as_species no more", species_of_mesh, "use_as_species", {"stop": True}),
    ("mark a scatter", drop, "mark", {"what": 'SCATTER'}),
    ("edit_list add", forest, "edit_list", LIST | {"action": 'ADD'}),
    ("edit_list remove", listed, "edit_list", LIST | {"action": 'REMOVE'}),
    ("refine", forest, "refine", {}),
    ("refine again", refined, "refine", {}),
    ("refine a mesh", lambda: (ground_active(), mark_ground()), "refine", {}),
    ("clear", refined, "clear", {}),
    ("clear a mesh", refined_mesh, "clear", {}),
    ("keep_results", refined, "keep_results", {}),
    ("mark a field", ground_active, "mark", {"what": 'FIELD'}),
    ("convert_plants", forest, "convert_plants", {"to": 'FIELD'}),
    ("convert_plants of a layer", populated, "convert_plants", {"to": 'FIELD'}),
    ("convert_plants of a field", populated_as_field, "convert_plants", {"to": 'OBJECTS'}),
    ("duplicate_species", species_chosen, "duplicate_species", {"name": "Shrub"}),
    ("revert_species", species_edited, "revert_species", {}),
    ("edit_orders", species_chosen, "edit_orders", {"action": 'ADD'}),
    ("edit_orders spur", species_chosen, "edit_orders", {"action": 'SPUR'}),
    ("make_plant_mesh", forest, "make_plant_mesh", {}),
    ("duplicate_layer", populated, "duplicate_layer", {}),
    ("update_layers", lambda: (populated(), change_population()), "update_layers", {}),
    ("update_layers of a field", lambda: (populated_as_field(), change_population()), "update_layers", {}),
    ("update_layers, another seed", populated, "update_layers", REROLL),
    ("move_layer", lambda: (populated(), populated()), "move_layer", {"direction": 'UP'}),
    ("remove_layer", populated, "remove_layer", {}),
    ("remove_layer, plants stay", populated, "remove_layer", {"keep_plants": True}),
    ("select_plants of a layer", lambda: (populated(), select()), "select_plants", {"layer": True}),
    ("update_layers, erased places", lambda: (populated(), erase_place()), "update_layers", FORGET),
    ("ground_cover", populated, "ground_cover", {}),
    ("ground_cover again", lambda: (populated(), cover(), change_population()), "ground_cover", {}),
    ("ground_snow", lambda: (populated(), paint_ground()), "ground_snow", {}),
    ("grow_stand", lambda: (stand(), select(bpy.data.objects["ground"])), "grow_stand", {}),
    ("update_layers of a stand", lambda: (stand(), change_stand()), "update_layers", {}),
    ("animate_growth", stand, "animate_growth", {}),
    ("keep_year", stand, "keep_year", {}),
    ("add_biome", ground_active, "add_biome", {"biome": "copse"}),
    ("update_layers of a biome", lambda: (biome_added(), change_biome()), "update_layers", {}),
    ("remove_layer of a biome", biome_added, "remove_layer", {}),
    ("look", ground_active, "look", {}),
    ("daylight", forest, "daylight", {}),
    ("mend", small_scale, "mend", {"what": "units"}),
    ("set_layer_ground", lambda: (populated(), select(add_mesh("other"))), "set_layer_ground", {}),
]
#: Operators with an undo step that cannot be called without a file from outside; their own case is below.
PLACES = {
    "grid": "import_terrain",
    "big_tiff": "import_canopy",
    "csv": "import_inventory",
    "outlines": "import_outlines",
}
FROM_FILES = {"load_species", *PLACES.values()}


def mark_ground() -> None:
    bpy.data.objects["ground"].tetflora.is_explicit = True
    select(bpy.data.objects["ground"])


def paint_ground() -> None:
    made = bpy.data.materials.new("ground")
    compat.shader_tree(made)
    bpy.data.objects["ground"].data.materials.append(made)


def change_population() -> None:
    scene().tetflora.layers[0].count = 7
    scene().tetflora.layers[0].seed = 5


def change_stand() -> None:
    bpy.context.active_object.tetflora.stand.seed = 5


def cover() -> None:
    assert ops().ground_cover() == {'FINISHED'}


def erase_place() -> None:
    rules.note_erased(scene().tetflora.layers[0], [(0.0, 0.0)], 2.0)


#: A stand, and a cover of a species of the biome's own.
BIOME = {
    "format": "TetFlora biome",
    "version": 1,
    "name": "Copse",
    "ground": {"earth": [0.045, 0.042, 0.04], "turf": [0.06, 0.085, 0.025], "turf_share": 0.2, "hills": 1},
    "species": {"shrub": {"of": "bush", "name": "Shrub"}},
    "layers": [
        {
            "kind": "stand",
            "name": "Birches",
            "years": 6,
            "interval": 0,
            "density": 1500,
            "species": [{"species": "birch"}],
        },
        {"kind": "cover", "name": "Shrubs", "by_density": True, "density": 900, "species": [{"species": "shrub"}]},
    ],
}


@pytest.fixture
def history(clean_file, tmp_path, monkeypatch) -> None:
    """An empty file, the memory of undo included; the only biome is a small one."""
    (tmp_path / "biomes").mkdir()
    (tmp_path / "biomes" / "copse.json").write_text(json.dumps(BIOME), "utf-8")
    monkeypatch.setattr(library, "builtin_folder", lambda: tmp_path / "biomes")
    bpy.ops.ed.undo_push(message="Begin")


def check(operator: str, options: dict) -> None:
    """One call is one step: undo takes all of it back, redo brings all of it again."""
    bpy.ops.ed.undo_push(message="Before")
    before = everything()
    assert getattr(ops(), operator)('EXEC_DEFAULT', True, **options) == {'FINISHED'}
    after = everything()
    assert difference(before, after), "the operator changes nothing: there is nothing to undo"
    assert bpy.ops.ed.undo() == {'FINISHED'}
    assert difference(before, everything()) == []
    assert bpy.ops.ed.redo() == {'FINISHED'}
    assert difference(after, everything()) == []


@pytest.mark.parametrize(("prepare", "operator", "options"), [c[1:] for c in CASES], ids=[c[0] for c in CASES])
def test_undo_and_redo_restore_everything(history, prepare, operator, options):
    prepare()
    check(operator, options)


def test_each_operator_with_an_undo_step_is_tried(blender):
    declared = {cls.bl_idname.split(".")[1] for cls in operators.CLASSES if 'UNDO' in getattr(cls, "bl_options", ())}
    assert declared == {case[2] for case in CASES} | FROM_FILES


@pytest.mark.parametrize("kind", PLACES)
def test_imported_places_can_be_undone(history, tmp_path, kind):
    check(PLACES[kind], {"filepath": str(places_files.write(tmp_path, kind)[1])})


def test_a_species_that_was_loaded_can_be_undone(history, tmp_path):
    path = tmp_path / "shrub.json"
    shipped = Path(catalog.__file__).parent.parent / "catalog"
    data = json.loads((shipped / "bush.json").read_text("utf-8"))
    path.write_text(json.dumps({**data, "name": "Shrub"}), "utf-8")
    forest()
    try:
        check("load_species", {"filepath": str(path)})
        assert scene().tetflora.species_editor.species == "shrub"
    finally:  # the copy in the user's folder is no part of the file, and stays when the step is undone
        OWN_FILES.delete("shrub")


@pytest.mark.parametrize("case", ["refine", "populate", "convert_plants", "remove_plants"])
def test_a_refusal_changes_nothing_and_is_no_step(history, case):
    """An error of the artist's leaves no undo step behind, whose undo would do nothing."""
    ground_active()
    options: dict = {}
    if case == "refine":
        bpy.data.objects["bush"].scale.z = 0.0
    elif case == "populate":
        options = {"count": 12, "species": "quercus"}
    elif case == "convert_plants":
        for name in ("bush", "conifer"):
            bpy.data.objects[name].tetflora.enabled = False
        select(bpy.data.objects["bush"], bpy.data.objects["conifer"])
    else:
        options = {"which": 'SPECIES', "species": "fern"}
    bpy.ops.ed.undo_push(message="Before")
    before = everything()
    bpy.data.objects["ground"].location.x = 1.0
    bpy.ops.ed.undo_push(message="Moved")
    moved = everything()
    try:
        result = getattr(ops(), case)('EXEC_DEFAULT', True, **options)
    except RuntimeError:  # errors of operators are Python's in scripts
        result = {'CANCELLED'}
    assert result == {'CANCELLED'}
    assert difference(moved, everything()) == []
    assert bpy.ops.ed.undo() == {'FINISHED'}
    assert difference(before, everything()) == []


def test_a_chain_of_operators_is_undone_step_by_step(history):
    """From populating to clearing, back to the start and forth again; refined meshes among it."""
    ground_active()
    bpy.ops.ed.undo_push(message="Before")
    states = [everything()]
    steps = (
        ("populate", {"count": 12, "species": MIX}),
        ("refine", {}),
        ("update_layers", REROLL),
        ("refine", {}),
        ("clear", {}),
        ("remove_layer", {}),
    )
    for operator, options in steps:
        assert getattr(ops(), operator)('EXEC_DEFAULT', True, **options) == {'FINISHED'}
        states.append(everything())
    for state in reversed(states[:-1]):
        bpy.ops.ed.undo()
        assert difference(state, everything()) == []
    for state in states[1:]:
        bpy.ops.ed.redo()
        assert difference(state, everything()) == []


def test_a_population_on_a_collection_goes_on_after_undo(history):
    """Grounds within a collection are read again after each undo; Blender's own cache of them does not outlive one."""
    ground_active()
    grounds = bpy.data.collections.new("grounds")
    inner = bpy.data.collections.new("inner")
    scene().collection.children.link(grounds)
    grounds.children.link(inner)
    inner.objects.link(bpy.data.objects["ground"])
    populated_on = {"count": 12, "species": MIX}
    assert ops().populate('EXEC_DEFAULT', True, **populated_on) == {'FINISHED'}
    scene().tetflora.layers[0].grounds.clear()
    scene().tetflora.layers[0].ground_collection = grounds
    bpy.ops.ed.undo_push(message="On a collection")
    for _ in range(2):
        assert ops().update_layers('EXEC_DEFAULT', True, **REROLL) == {'FINISHED'}
        assert ops().refine('EXEC_DEFAULT', True) == {'FINISHED'}
        before = everything()
        assert ops().update_layers('EXEC_DEFAULT', True, which='ACTIVE') == {'FINISHED'}
        bpy.ops.ed.undo()
        assert difference(before, everything()) == []
        for _step in range(2):
            bpy.ops.ed.undo()
        assert scene().tetflora.layers[0].made == 12
