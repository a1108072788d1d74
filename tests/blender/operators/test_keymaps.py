# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that are free in Blender's own keymap, names that search finds, texts that translations really meet."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

import operators
import panels
from devtools import build
from devtools.layouts import Layout
from panels.layers import TETFLORA_MT_layers
from panels.menus import TETFLORA_MT_object, draw_in_add_menu, draw_in_import_menu
from panels.preferences import KEYMAP, KEYS
from tests.blender.scenes import add_camera, add_plant
from tetflora_addon.blender import preferences, properties, translations
from tetflora_addon.blender.scene.ages import FULL_GROWN
from tetflora_addon.blender.settings import MONTHS
from tetflora_addon.species.ages import STAGES

pytestmark = pytest.mark.usefixtures("clean_file")

PLACES = ("terrain", "canopy", "inventory", "outlines")

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
    assert 1 <= len(KEYS) <= 4
    assert not [key for key in KEYS if (key.key, key.ctrl, key.alt, key.shift) in taken]


def test_keys_are_registered_once_and_open_what_is_there():
    config = bpy.context.window_manager.keyconfigs.addon
    ours = [
        (item.idname, getattr(item.properties, "name", ""))
        for item in config.keymaps[KEYMAP].keymap_items
        if item.idname.startswith("tetflora.") or getattr(item.properties, "name", "").startswith("TETFLORA_")
    ]
    assert sorted(ours) == sorted((key.operator, key.menu) for key in KEYS)
    for operator, menu in ours:
        if menu:
            assert operator in {"wm.call_menu", "wm.call_menu_pie"}
            assert issubclass(getattr(bpy.types, menu), bpy.types.Menu)
        else:
            assert operator in _ids()


class _Page(SimpleNamespace):
    """The preferences as the page draws them: Blender gives an instance a layout only while it draws."""

    bl_rna = preferences.TetFloraPreferences.bl_rna


def test_the_page_in_the_preferences_shows_settings_and_the_cache():
    layout = Layout()
    page = _Page(layout=layout, species_folder="", use_cache=True)
    preferences.TetFloraPreferences.draw(page, bpy.context)
    own = preferences.preferences().bl_rna.properties
    assert set(layout.names("prop", 1)) >= {p.identifier for p in own if not p.is_readonly} - {"bl_idname", "rna_type"}
    assert "tetflora.delete_file" in layout.names("operator")


DRAWN = [cls for cls in panels.CLASSES if not issubclass(cls, bpy.types.UIList)]


@pytest.mark.parametrize("cls", DRAWN, ids=lambda cls: cls.__name__)
def test_panels_and_menus_draw_only_what_blender_knows(cls):
    add_camera()
    bpy.context.view_layer.objects.active = add_plant()
    layout = Layout()
    drawing = SimpleNamespace(layout=layout)
    for name in ("draw_settings", "column"):
        if hasattr(cls, name):
            setattr(drawing, name, getattr(cls, name).__get__(drawing))
    if hasattr(cls, "operator"):
        drawing.operator = cls.operator
    cls.draw(drawing, _Context())
    if hasattr(cls, "draw_header"):
        cls.draw_header(drawing, _Context())
    assert layout.drawn


class _Context:
    """The context, with the region and the space of a sidebar, which the background does not have."""

    region = SimpleNamespace(width=300)
    space_data = SimpleNamespace(bl_rna=bpy.types.SpaceView3D.bl_rna)

    def __getattr__(self, name):
        return getattr(bpy.context, name)


def test_every_operator_is_registered_and_named():
    names = {}
    for identifier in _ids():
        group, name = identifier.split(".")
        rna = getattr(getattr(bpy.ops, group), name).get_rna_type()
        assert rna.name, identifier
        assert len(rna.description) > 15, identifier
        names.setdefault(rna.name, []).append(identifier)
    assert {name: found for name, found in names.items() if len(found) > 1} == {}


def test_new_tools_are_in_menus_so_that_search_finds_them():
    layout = Layout()
    for draw in (draw_in_add_menu, TETFLORA_MT_object.draw, TETFLORA_MT_layers.draw, draw_in_import_menu):
        draw(SimpleNamespace(layout=layout), bpy.context)
    drawn, menus = set(layout.names("operator")), layout.names("menu")
    tools = (
        "paint_plants",
        "drop_to_ground",
        "first_forest",
        "ground_cover",
        "grow_stand",
        "keep_results",
        "preview_levels",
        "look",
        "daylight",
        "update_layers",
        "save_biome",
    )
    files = tuple(f"import_{name}" for name in PLACES)
    assert {f"tetflora.{name}" for name in tools + files} <= drawn <= _ids()
    assert {"TETFLORA_MT_place_plant", "TETFLORA_MT_layers"} <= set(menus)
    assert all(hasattr(bpy.types, menu) for menu in menus)


def test_places_are_in_the_import_menu_of_files():
    layout = Layout()
    draw_in_import_menu(SimpleNamespace(layout=layout), bpy.context)
    assert layout.names("operator") == [f"tetflora.import_{name}" for name in PLACES]


def test_the_search_for_refine_plants_has_one_answer():
    """Blender lists what cannot be clicked too: above Refine Plants, Return would do nothing."""
    path = build.ROOT / "panels" / "menus.py"
    texts = {n.value for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.Constant)}
    found = [text for text in texts if isinstance(text, str) and len(text) < 60]
    assert [text for text in found if {"refin", "plant"} <= {word[:5] for word in text.lower().split()}] == [
        "Refine Plants"
    ]


def _texts():
    """All texts that the interface shows, as far as they are registered or written out in panels."""
    found = set()
    for name in dir(bpy.types):
        cls = getattr(bpy.types, name)
        rna = getattr(cls, "bl_rna", None)
        if name.startswith(("TETFLORA_", "TetFlora")) and rna is not None:
            found |= {getattr(cls, "bl_label", ""), rna.name}
            for prop in rna.properties:
                found |= {prop.name, prop.description}
                if prop.type == 'ENUM':
                    found |= {item.name for item in prop.enum_items}
    for cls in (*properties.CLASSES, preferences.TetFloraPreferences):
        settings = cls.bl_rna.properties
        found |= {text for p in settings for text in (p.name, p.description)}
        found |= {item.name for p in settings if p.type == 'ENUM' for item in p.enum_items}
    for identifier in _ids():
        group, name = identifier.split(".")
        rna = getattr(getattr(bpy.ops, group), name).get_rna_type()
        found |= {rna.name, *(prop.name for prop in rna.properties)}
        found |= {item.name for prop in rna.properties if prop.type == 'ENUM' for item in prop.enum_items}
    found |= {FULL_GROWN, *MONTHS, *(stage.capitalize() for stage in STAGES)}
    # Importing an inventory draws a table of its own.
    for path in (*(build.ROOT / "panels").glob("*.py"), build.ROOT / "operators" / "places.py"):
        found |= {n.value for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.Constant)}
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
        ('{"*": {"Wind": "Wind" "Loop"}}', "line 1 column 23"),
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
