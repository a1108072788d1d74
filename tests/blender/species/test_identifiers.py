# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species that come with a .blend of anybody: no button writes, reads or deletes anything but species of the folder."""

from __future__ import annotations

import json
import os
import random
import sys
from pathlib import Path

import bpy
import pytest

from tests.attack import material
from tests.blender.scenes import add_plant
from tetflora_addon import errors, files
from tetflora_addon.blender import file_library, preferences
from tetflora_addon.blender.species import catalog as menus
from tetflora_addon.blender.species import edits

pytestmark = pytest.mark.usefixtures("clean_file", "thumbnails_looked_for")


@pytest.fixture
def own_folder(tmp_path):
    folder = tmp_path / "studio" / "species"
    folder.mkdir(parents=True)
    preferences.preferences().species_folder = str(folder)
    edits.look_again()
    yield folder
    preferences.preferences().species_folder = ""
    edits.look_again()


def _carried(identifier: str, **changes: object) -> None:
    """An edit as a .blend may bring it, shown in the editor."""
    text = json.dumps({**edits.species_data(None, "bush"), **changes})
    edit = bpy.context.scene.tetflora.species_edits.add()
    edit.identifier, edit.text = identifier, text
    bpy.context.scene.tetflora.species_editor.species = identifier


def _press_everything() -> None:
    """All buttons of the species menu, for what the editor shows; what cannot be done is a report."""
    for operator in (bpy.ops.tetflora.save_species, bpy.ops.tetflora.delete_file, bpy.ops.tetflora.revert_species):
        try:
            operator()
        except RuntimeError as error:
            assert "Traceback" not in str(error)


def _contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.parametrize("way", ["../secret", "{0}/secret", "../../secret", "sub/../../secret", "con", "a b"])
def test_identifiers_from_a_file_lead_nowhere(own_folder, tmp_path, way):
    for folder in (tmp_path, own_folder.parent):
        (folder / "secret.json").write_text("mine", encoding="utf-8")
    before = _contents(tmp_path)
    identifier = way.format(tmp_path)
    _carried(identifier)
    assert identifier not in edits.catalog()
    assert not bpy.ops.tetflora.save_species.poll()
    with pytest.raises(RuntimeError, match="no file in your species folder"):
        bpy.ops.tetflora.delete_file()
    _press_everything()
    for do in (menus.save_species, edits.species_for, edits.species_data):
        with pytest.raises(errors.SpeciesError):
            do(bpy.context.scene, identifier)
    with pytest.raises(errors.SpeciesError, match="no file in your species folder"):
        menus.OWN_FILES.delete(identifier)
    with pytest.raises(errors.SpeciesError, match="cannot name a species"):
        edits.store_species(bpy.context.scene, identifier, {})
    with pytest.raises(errors.SpeciesError, match="cannot name a species"):
        menus.write_species(bpy.context.scene, "bush", own_folder / "a b.json")
    assert menus.own_file(identifier) is menus.thumbnail_file(identifier) is None
    assert _contents(tmp_path) == before


def test_a_rule_that_let_it_pass_would_not_be_enough(own_folder, tmp_path, monkeypatch):
    """The path is checked besides: it lies right in the folder, or nothing is written."""
    monkeypatch.setattr(file_library, "is_identifier", lambda text: True)
    with pytest.raises(errors.SpeciesError, match="does not lie in its folder"):
        menus.OWN_FILES.place("../secret")


def test_attack_on_identifiers_of_a_file(own_folder, tmp_path):
    """Sixty edits from a fixed seed, each saved, deleted and reverted: nothing changes outside the folder."""
    rng = random.Random(22)
    (tmp_path / "secret.json").write_text("mine", encoding="utf-8")
    (own_folder.parent / "secret.json").write_text("mine", encoding="utf-8")
    outside = {k: v for k, v in _contents(tmp_path).items() if not k.startswith("studio/species")}
    taken = 0
    for _ in range(60):
        identifier = material.identifier(rng, tmp_path).encode(errors="replace").decode().replace("\0", "?")
        _carried(identifier)
        taken += identifier in edits.catalog()
        menus.items_for(identifier)
        _press_everything()
        bpy.context.scene.tetflora.species_edits.clear()
        now = {k: v for k, v in _contents(tmp_path).items() if not k.startswith("studio/species")}
        assert now == outside, identifier
        assert all(files.is_identifier(p.stem) for p in own_folder.iterdir())
    assert 5 < taken < 55


@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
def test_saving_and_deleting_leave_alone_what_a_link_leads_to(own_folder, tmp_path):
    (tmp_path / "target").write_text("mine", encoding="utf-8")
    link = own_folder / "bush.json"
    link.symlink_to(tmp_path / "target")
    bpy.context.scene.tetflora.species_editor.species = "bush"
    with pytest.raises(RuntimeError, match="no file in your species folder"):
        bpy.ops.tetflora.delete_file()
    bpy.ops.tetflora.save_species()
    assert not link.is_symlink()
    assert (tmp_path / "target").read_text(encoding="utf-8") == "mine"
    bpy.ops.tetflora.delete_file()
    assert not list(own_folder.iterdir())


@pytest.mark.parametrize("name", ["my oak", "CON", "a" * 70, "é"])
def test_a_file_to_load_has_the_name_of_a_species(own_folder, tmp_path, name):
    path = tmp_path / f"{name}.json"
    path.write_bytes(edits.listed()["bush"].path.read_bytes())
    with pytest.raises(RuntimeError, match=r"cannot name a species\. Use only letters"):
        bpy.ops.tetflora.load_species(filepath=str(path))
    assert not list(own_folder.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names themselves")
def test_an_odd_file_is_named_and_menus_stay_full(own_folder, capfd):
    before = menus.items_for()
    sound = edits.listed()["bush"].path.read_bytes()
    for name in (b"\xff.json", b"a\x1b[2Jb.json", b"a b.json", b"a\nb.json"):
        with open(os.path.join(os.fsencode(own_folder), name), "wb") as file:
            file.write(sound)
    assert [item[:3] for item in menus.items_for()] == [item[:3] for item in before]
    assert len(edits.skipped_files()) == 4
    said = capfd.readouterr().err
    assert said.count("TetFlora: warning: species folder: ") == 4
    assert "\x1b" not in said
    menus.items_for()
    assert capfd.readouterr().err == ""  # once


def test_a_text_of_a_file_cannot_break_menus_or_panels(own_folder):
    """Names, descriptions, leaves and numbers as no file of ours has them."""
    for changes in (
        {"name": "a\ud800"},
        {"name": "a\x00b\x1b[2J", "description": "\ud800\n" * 5000},
        {"leaf": {"object": "\x00\ud800"}},
        {"quality": 10**400},
        {"orders": [{"length": [10**400, -(10**400)], "segments": 10**300, "sides": -(10**300)}]},
        {"name": ["x"] * 10_000},
    ):
        _carried("bush", **changes)
        editor = bpy.context.scene.tetflora.species_editor
        for prop in editor.bl_rna.properties:
            getattr(editor, prop.identifier)
        assert [i for i in menus.items_for("bush") if i[0] == "bush"]
        for item in menus.items_for("bush"):
            assert errors.readable(item[1], errors.NAME) == item[1]
            item[2].encode()
        problem = edits.problem_of(bpy.context.scene, "bush")
        assert errors.readable(problem) == problem
        bpy.context.scene.tetflora.species_edits.clear()


def test_names_of_new_species_are_identifiers():
    taken = {"con_2"}
    for name in ("con", "CON", "x" * 300, "ö", "", "../secret", "a\0b"):
        identifier = edits.new_identifier(name, taken.__contains__)
        assert files.is_identifier(identifier)
        assert identifier not in taken
        taken.add(identifier)


def test_a_plant_of_an_odd_species_is_named_in_a_message_that_can_be_shown():
    add_plant(species="a\x1b[2J\n" + "x" * 5000)
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.tetflora.refine()
    assert "unknown species" in str(caught.value) or "no active camera" in str(caught.value)
    assert "\x1b" not in str(caught.value)
