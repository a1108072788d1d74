# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The species editor: a slider for every key, edits that live in the file and reach refinement, files in and out."""

from __future__ import annotations

import json
import math
import shutil

import bpy
import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_plant, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.blender import preferences
from tetflora_addon.blender.job import contents
from tetflora_addon.blender.species import edits
from tetflora_addon.blender.species.catalog import OWN_FILES, load_species_file
from tetflora_addon.blender.species.editor import set_species_value
from tetflora_addon.species import catalog, skeletons

pytestmark = pytest.mark.usefixtures("clean_file")


def _editor(species="bush", order=0):
    editor = bpy.context.scene.tetflora.species_editor
    editor.species, editor.order_index = species, order
    return editor


def _edited(identifier="bush"):
    return edits.species_for(bpy.context.scene, identifier)


def _shipped(identifier="bush"):
    return catalog.load_species(identifier)


@pytest.fixture
def own_folder(tmp_path):
    own = bpy.context.preferences.addons[preferences.ROOT_PACKAGE].preferences
    own.species_folder = str(tmp_path / "species")
    yield tmp_path / "species"
    own.species_folder = ""


def test_every_key_of_an_order_has_its_sliders_with_limits_and_tooltip():
    keys = catalog.ORDER_KEYS
    properties = _editor().bl_rna.properties
    for name, key in keys.items():
        assert name in properties, name
        assert key.meaning[1:] in properties[name].description
        assert (name + "_variation" in properties) == (key.kind == "color")
        assert getattr(properties[name], "array_length", 0) == {"range": 2, "color": 3, "rgb": 3}.get(key.kind, 0)
        if key.kind in {"range", "number", "integer"}:
            scale = math.pi / 180.0 if key.unit == "degrees" else 1.0
            low = min(key.low, 0.0) if key.kind == "range" else key.low  # variations begin at 0
            assert properties[name].hard_min == pytest.approx(low * scale, rel=1e-6)
            assert properties[name].hard_max == pytest.approx(key.high * scale, rel=1e-6)


@pytest.mark.parametrize("identifier", ["bush", "conifer", "broadleaf_tree"])
def test_sliders_show_what_the_species_has(identifier):
    species = _shipped(identifier)
    for index, order in enumerate(species.orders):
        editor = _editor(identifier, index)
        for name, key in catalog.ORDER_KEYS.items():
            shown, value = getattr(editor, name), getattr(order, name)
            if key.kind == "range":
                shown, value = tuple(shown), tuple(value)
            elif key.kind == "color":
                shown = (*shown, *getattr(editor, name + "_variation"))
                value = (*value.mean, *value.variation)
            if key.unit == "degrees":
                shown = [math.degrees(s) for s in shown] if isinstance(shown, tuple) else math.degrees(shown)
            if key.kind == "rgb":
                shown = tuple(shown)
            if isinstance(value, str):
                assert shown == value
            else:
                assert shown == pytest.approx(value, rel=1e-5, abs=1e-6), (index, name)


def test_a_range_takes_no_mean_and_no_variation_beyond_its_own_limits():
    """Both share the limits that Blender knows of, which are wider than those of either."""
    editor = _editor("bush", 1)
    editor.length = 0.0, 0.0
    assert tuple(_edited().orders[1].length) == (0.001, 0.0)
    editor.curvature = -0.5, -0.5
    assert tuple(_edited().orders[1].curvature) == (pytest.approx(math.degrees(-0.5), rel=1e-5), 0.0)


def test_looking_stores_nothing():
    editor = _editor("conifer", 1)
    for name in catalog.ORDER_KEYS:
        getattr(editor, name)
    assert len(bpy.context.scene.tetflora.species_edits) == 0
    assert _edited("conifer") == _shipped("conifer")


def test_every_slider_changes_its_own_value_and_no_other():
    keys = catalog.ORDER_KEYS
    last = len(_shipped().orders) - 1
    for name, key in keys.items():
        if name == "branches":
            continue  # none after the last order
        editor = _editor("bush", last)
        if key.kind == "range":
            value = getattr(editor, name)[0] * 0.9 + 0.01 * min(editor.bl_rna.properties[name].hard_max, 10.0)
            getattr(editor, name)[0] = value
            meant = math.degrees(value) if key.unit == "degrees" else value
        elif key.kind == "number":
            value = getattr(editor, name) * 0.9 + 0.01 * min(editor.bl_rna.properties[name].hard_max, 10.0)
            setattr(editor, name, value)
            meant = math.degrees(value) if key.unit == "degrees" else value
        elif key.kind == "integer":
            meant = int(key.low) + 1
            setattr(editor, name, meant)
        elif key.kind in {"color", "rgb"}:
            meant = (0.5, 0.25, 0.125)
            setattr(editor, name, meant)
        else:
            items = [i.identifier for i in editor.bl_rna.properties[name].enum_items]
            meant = next(i for i in items if i != getattr(editor, name))
            setattr(editor, name, meant)
        changed, old = (s.orders[last] for s in (_edited(), _shipped()))
        for other in keys:
            before, now = getattr(old, other), getattr(changed, other)
            if other != name and other != f"{name}_tip":  # its default follows
                assert now == before, (name, other)
        value = getattr(changed, name)
        value = getattr(value, "mean", value)
        assert value == (meant if isinstance(meant, str) else pytest.approx(meant, rel=1e-4)), name
        assert _edited().orders[:last] == _shipped().orders[:last]
        bpy.ops.tetflora.revert_species()
    assert _edited() == _shipped()


def test_edits_live_in_the_file_and_override_the_catalog(tmp_path):
    editor = _editor("bush", 2)
    editor.leaf_size[0] = 0.2
    editor.leaf_form, editor.leaf_transmission = "kite", 0.1
    editor.species_name = "Broad Bush"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    species = _edited()
    assert species.orders[2].leaf_size.mean == pytest.approx(0.2)
    assert (species.leaf[0].polygons, species.leaf_transmission, species.name) == (1, 0.1, "Broad Bush")
    assert edits.catalog()["bush"].name == "Broad Bush"
    assert _shipped().name == "Bush"
    session.clean_file()
    assert _edited() == _shipped()


def test_edits_hold_for_all_scenes_of_the_file_and_are_kept_once():
    _editor().length[0] = 0.3
    other = bpy.data.scenes.new("other")
    assert edits.species_for(other, "bush").orders[0].length.mean == pytest.approx(0.3)
    other.tetflora.species_editor.species = "bush"
    other.tetflora.species_editor.length[0] = 0.4
    assert sum(len(s.tetflora.species_edits) for s in bpy.data.scenes) == 1
    assert _edited().orders[0].length.mean == pytest.approx(0.4)


def test_refinement_takes_the_edited_species():
    add_camera()
    plant = add_plant()
    before = contents.estimate(bpy.context.scene, depsgraph()).polygons_full
    editor = _editor("bush", 3)
    editor.leaves = 10.0, 0.0
    after = contents.estimate(bpy.context.scene, depsgraph()).polygons_full
    assert after > before * 1.3
    bpy.ops.tetflora.duplicate_species(name="My Own")
    plant.tetflora.species = "my_own"
    bpy.ops.tetflora.refine()
    assert json.loads(bpy.context.scene.tetflora.statistics)["polygons_full"] == after


def test_what_breaks_a_rule_is_said_and_stops_refinement():
    add_plant()
    editor = _editor("bush", 1)
    editor.angle[1] = math.radians(100.0)
    problem = edits.problem_of(bpy.context.scene, "bush")
    assert "orders[1].angle" in problem
    assert "0 to 180" in problem
    with pytest.raises(errors.SpeciesError, match=r"orders\[1\].angle"):
        contents.estimate(bpy.context.scene, depsgraph())
    assert editor.angle[1] == pytest.approx(math.radians(100.0), rel=1e-5)  # the slider stays where it was put
    editor.angle[1] = 0.1
    assert edits.problem_of(bpy.context.scene, "bush") == ""


@pytest.mark.parametrize("text", ["", "[1]", "{", '{"orders": 3}', '{"orders": [1]}', '{"name": 4, "orders": [{}]}'])
def test_a_broken_text_breaks_no_panel(text):
    edit = bpy.context.scene.tetflora.species_edits.add()
    edit.identifier, edit.text = "bush", text
    editor = _editor()
    for prop in editor.bl_rna.properties:
        getattr(editor, prop.identifier)
    assert edits.problem_of(bpy.context.scene, "bush")
    assert "bush" in edits.catalog()


def test_duplicate_revert_and_orders():
    plant, other = add_plant("a"), add_plant("b")
    select(plant)
    editor = _editor("bush", 0)
    bpy.ops.tetflora.duplicate_species(assign=True)
    bpy.ops.tetflora.duplicate_species()
    assert editor.species == "bush_2_2"
    assert (plant.tetflora.species, other.tetflora.species) == ("bush_2", "bush")
    assert editor.species_name == "Bush 2 2"
    number = len(_edited("bush_2_2").orders)
    while bpy.ops.tetflora.edit_orders(action='ADD') == {'FINISHED'}:
        number += 1
        assert len(_edited("bush_2_2").orders) == number  # and it is sound
        assert editor.order == str(number - 1)
    assert number == skeletons.MAX_ORDERS
    while bpy.ops.tetflora.edit_orders(action='REMOVE') == {'FINISHED'}:
        number -= 1
        assert len(_edited("bush_2_2").orders) == number
    assert number == 1
    bpy.ops.tetflora.revert_species()
    assert "bush_2_2" not in edits.catalog()
    assert "bush_2" in edits.catalog()
    assert not bpy.ops.tetflora.revert_species.poll()


def test_saved_species_come_back_as_they_were(own_folder, tmp_path):
    editor = _editor("conifer", 1)
    bpy.ops.tetflora.duplicate_species(name="Łąka fir")
    editor.curvature[0] = 0.5
    identifier, species = editor.species, _edited(editor.species)
    assert identifier.isascii()
    bpy.ops.tetflora.save_species()
    bpy.ops.tetflora.export_species(filepath=str(tmp_path / "given.json"))
    session.clean_file()
    assert _edited(identifier) == species
    _editor(identifier)
    bpy.ops.tetflora.delete_file()
    assert identifier not in edits.catalog()
    assert bpy.ops.tetflora.load_species(filepath=str(tmp_path / "given.json")) == {'FINISHED'}
    given = _edited("given")
    assert (given.orders, given.leaf, given.name) == (species.orders, species.leaf, "Łąka fir")
    assert bpy.context.scene.tetflora.species_editor.species == "given"
    assert [p.name for p in own_folder.iterdir()] == ["given.json"]


def test_shipped_species_cannot_be_deleted(own_folder):
    _editor("bush")
    with pytest.raises(RuntimeError, match="no file in your species folder"):
        bpy.ops.tetflora.delete_file()
    with pytest.raises(errors.SpeciesError, match="built-in"):
        OWN_FILES.delete("bush")


@pytest.mark.parametrize("text", ["{", '{"format": 1}', '{"format": 1, "name": "x", "orders": [], "leaf": {}}'])
def test_broken_files_are_refused_with_the_reason(own_folder, tmp_path, text):
    (tmp_path / "broken.json").write_text(text, encoding="utf-8")
    with pytest.raises(RuntimeError, match=r"broken\.json: "):
        bpy.ops.tetflora.load_species(filepath=str(tmp_path / "broken.json"))
    assert not own_folder.exists() or not list(own_folder.iterdir())


def test_loading_replaces_only_when_told(own_folder, tmp_path):
    _editor("bush")
    bpy.ops.tetflora.export_species(filepath=str(tmp_path / "mine.json"))
    load_species_file(tmp_path / "mine.json")
    before = (own_folder / "mine.json").read_bytes()
    _editor("conifer")
    bpy.ops.tetflora.export_species(filepath=str(tmp_path / "mine.json"))
    with pytest.raises(errors.SpeciesError, match="Replace"):
        load_species_file(tmp_path / "mine.json")
    assert (own_folder / "mine.json").read_bytes() == before
    load_species_file(tmp_path / "mine.json", replace=True)
    assert (own_folder / "mine.json").read_bytes() == (tmp_path / "mine.json").read_bytes()
    assert load_species_file(own_folder / "mine.json") == "mine"  # the file browser may well stand there


def test_a_broken_species_is_not_saved(own_folder):
    _editor("bush", 1).length[1] = 19.0
    with pytest.raises(RuntimeError, match=r"orders\[1\].length"):
        bpy.ops.tetflora.save_species()
    assert not own_folder.exists() or not list(own_folder.iterdir())


def test_the_default_folder_stays_when_the_extension_is_removed():
    """Blender deletes a folder of the extension with it."""
    folder = preferences.own_species_folder()
    try:
        assert folder.is_relative_to(bpy.utils.user_resource('DATAFILES'))
        assert not folder.is_relative_to(bpy.utils.user_resource('EXTENSIONS'))
        assert preferences.species_folders() == (folder,)
        assert OWN_FILES.folder() == folder
    finally:
        shutil.rmtree(folder)


def test_undo_takes_an_edit_back():
    _editor("bush")
    bpy.ops.ed.undo_push(message="before")
    bpy.context.scene.tetflora.species_editor.length[0] = 0.3
    bpy.ops.ed.undo_push(message="slider")
    bpy.ops.ed.undo()
    assert _edited() == _shipped()
    bpy.ops.ed.redo()
    assert _edited().orders[0].length.mean == pytest.approx(0.3)


def test_panels_look_at_folders_once_in_a_while_and_see_own_changes_at_once(monkeypatch, tmp_path):
    """In the window: what TetFlora writes is there at once, what others write a moment later."""
    looked = []
    real = edits.list_species
    monkeypatch.setattr(edits, "list_species", lambda folders: looked.append(1) or real(folders))
    monkeypatch.setattr(edits, "_TRUSTED", 1000.0)
    edits.look_again()
    for _ in range(50):
        edits.catalog()
        edits.species_data(None, "oak")
    assert len(looked) == 1
    edits.tell_listeners()
    edits.catalog()
    assert len(looked) == 2
    monkeypatch.setattr(edits, "_TRUSTED", 0.0)
    edits.catalog()
    edits.catalog()
    assert len(looked) == 4


@pytest.mark.parametrize("orders", [[1.0], [], {}, None, "a"])
@pytest.mark.parametrize("action", ["ADD", "REMOVE", "SPUR"])
def test_orders_that_cannot_be_read_are_not_edited(orders, action):
    """Species of a .blend may hold anything; an attack found a traceback."""
    edit = bpy.context.scene.tetflora.species_edits.add()
    edit.identifier, edit.text = "mine", json.dumps({"format": 1, "name": "Mine", "orders": orders})
    bpy.context.scene.tetflora.species_editor.species = "mine"
    assert bpy.ops.tetflora.edit_orders(action=action) == {'CANCELLED'}
    assert json.loads(edit.text)["orders"] == orders


@pytest.mark.parametrize("model", [["kite"], {"kite": 1}, 3, None])
def test_a_leaf_whose_model_is_no_name_is_that_of_the_file(model):
    editor = _editor()
    set_species_value(editor, "leaf", {"model": model})
    assert editor.leaf_form == "OWN"
