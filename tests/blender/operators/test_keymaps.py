# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that are free in Blender's own keymap, names that search finds, texts that translations really meet."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest

import operators
from devtools import build
from panels import menus as add_menu
from panels import menus as object_menu
from panels import preferences as keymaps
from tetflora_addon.blender import preferences, properties, translations

pytestmark = pytest.mark.usefixtures("clean_file")

# Keymaps that hear keys over a 3D view in Object Mode.
HEARD = {
    "Object Mode",
    "Object Non-modal",
    "3D View",
    "3D View Generic",
    "Window",
    "Screen",
    "Screen Editing",
    "Frames",
}


def _ids():
    return {cls.bl_idname for cls in operators.CLASSES}


def _default_keys():
    """Blender's own keys as its preset makes them: (keymap, key, ctrl, alt, shift)."""
    path = Path(bpy.utils.system_resource('SCRIPTS')) / "presets/keyconfig/keymap_data/blender_default.py"
    spec = importlib.util.spec_from_file_location("blender_default", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name, _, content in module.generate_keymaps(module.Params()):
        for _, event, _ in content["items"]:
            yield name, event["type"], *(bool(event.get(m)) or bool(event.get("any")) for m in ("ctrl", "alt", "shift"))


def test_keys_are_free_in_blenders_own_keymap():
    taken = {tuple(key[1:]) for key in _default_keys() if key[0] in HEARD}
    assert len(taken) > 100
    keys = keymaps.KEYS
    assert 1 <= len(keys) <= 4
    assert not [key for key in keys if (key.key, key.ctrl, key.alt, key.shift) in taken]


def test_keys_are_registered_once_and_open_what_is_there():
    config = bpy.context.window_manager.keyconfigs.addon
    ours = [
        (item.idname, getattr(item.properties, "name", ""))
        for item in config.keymaps[keymaps.KEYMAP].keymap_items
        if item.idname.startswith("tetflora.") or getattr(item.properties, "name", "").startswith("TETFLORA_")
    ]
    assert sorted(ours) == sorted((key.operator, key.menu) for key in keymaps.KEYS)
    for operator, menu in ours:
        if menu:
            assert operator in {"wm.call_menu", "wm.call_menu_pie"}
            assert issubclass(getattr(bpy.types, menu), bpy.types.Menu)
        else:
            assert operator in _ids()


def test_the_page_in_the_preferences_shows_settings_and_the_cache():
    layout = MagicMock()
    own = preferences.preferences()
    preferences.TetFloraPreferences.draw(SimpleNamespace(layout=layout, species_folder="", use_cache=True), bpy.context)
    assert callable(own.draw)
    column = layout.column()
    drawn = {call.args[1] for call in (*layout.prop.call_args_list, *column.prop.call_args_list)}
    drawn |= {call.args[1] for call in column.row().prop.call_args_list}
    assert drawn == {p.identifier for p in own.bl_rna.properties if not p.is_readonly} - {"bl_idname", "rna_type"}
    assert [call.args[0] for call in column.operator.call_args_list] == ["tetflora.clear_cache"]


def test_every_operator_is_registered_and_named():
    names = {}
    for identifier in _ids():
        group, name = identifier.split(".")
        rna = getattr(getattr(bpy.ops, group), name).get_rna_type()
        assert rna.name, identifier
        assert len(rna.description) > 15, identifier
        names.setdefault(rna.name, []).append(identifier)
    assert {name: found for name, found in names.items() if len(found) > 1} == {}


def test_new_tools_stand_in_menus_so_that_search_finds_them():
    layout = MagicMock()
    for draw in (add_menu.draw_in_add_menu, object_menu.TETFLORA_MT_object.draw):
        draw(SimpleNamespace(layout=layout), bpy.context)
    drawn = {call.args[0] for call in layout.operator.call_args_list}
    menus = {call.args[0] for call in layout.menu.call_args_list}
    assert {f"tetflora.{name}" for name in ("paint_plants", "drop_to_ground", "first_forest")} <= drawn <= _ids()
    assert "TETFLORA_MT_place_plant" in menus
    assert all(hasattr(bpy.types, menu) for menu in menus)


def _texts():
    """All texts that the interface shows, as far as they are registered or written out in panels."""
    found = set()
    for name in dir(bpy.types):
        cls = getattr(bpy.types, name)
        rna = getattr(cls, "bl_rna", None)
        if name.startswith(("TETFLORA_", "TetFlora")) and rna is not None:
            found |= {getattr(cls, "bl_label", ""), rna.name}
            for prop in rna.properties:
                found.add(prop.name)
                if prop.type == 'ENUM':
                    found |= {item.name for item in prop.enum_items}
    for cls in (*properties.CLASSES, preferences.TetFloraPreferences):
        settings = cls.bl_rna.properties
        found |= {p.name for p in settings}
        found |= {item.name for p in settings if p.type == 'ENUM' for item in p.enum_items}
    for identifier in _ids():
        group, name = identifier.split(".")
        found.add(getattr(getattr(bpy.ops, group), name).get_rna_type().name)
    for path in (build.ROOT / "panels").glob("*.py"):
        found |= set(re.findall(r'text="([^"]+)"', path.read_text(encoding="utf-8")))
    return found


def test_every_translated_text_is_in_the_interface():
    dictionary = translations.read_languages()
    texts = _texts()
    assert dictionary
    for language, entries in dictionary.items():
        assert entries
        assert re.fullmatch(r"[a-z]{2}_[A-Z]{2}", language)
        assert [text for (_, text) in entries if text not in texts] == []


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('{"*": {"Wind": "Wind",}}', "line 1 column 22"),
        ('{"Labels": {}}', '"Operator" and "*"'),
        ('["Wind"]', '"Operator" and "*"'),
        ('{"*": ["Wind"]}', 'must map English texts'),
        ('{"*": {"Wind": ""}}', 'translation of "Wind"'),
    ],
)
def test_a_broken_translation_is_named_and_the_others_stay(tmp_path, capsys, text, complaint):
    (tmp_path / "de_DE.json").write_text(text, encoding="utf-8")
    (tmp_path / "fr_FR.json").write_text('{"*": {"Wind": "Vent"}}', encoding="utf-8")
    assert translations.read_languages(tmp_path) == {"fr_FR": {("*", "Wind"): "Vent"}}
    message = capsys.readouterr().err
    assert complaint in message
    assert "de_DE.json" in message
    assert message.count("\n") == 1
