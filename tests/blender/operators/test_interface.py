# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists see is counted, and stays within what was decided."""

from __future__ import annotations

from types import SimpleNamespace

import blf
import bpy
import pytest

import operators.layers
from devtools import interface
from devtools.layouts import Layout
from panels import base, layers
from tests.blender.scenes import add_mesh, select
from tetflora_addon.blender.biomes.layers import active_layer
from tetflora_addon.blender.geodata.origin import KEY
from tetflora_addon.blender.placing import rules
from tetflora_addon.blender.placing.populations import add_population
from tetflora_addon.blender.placing.rules import fingerprint
from tetflora_addon.jobs import run_to_end

pytestmark = pytest.mark.usefixtures("clean_file")


def test_controls_in_closed_sections_are_told_from_those_in_sight():
    layout = Layout()
    layout.operator("tetflora.refine")
    _, body = layout.panel("Closed", default_closed=True)
    body.operator("tetflora.clear")
    body.label(text="None")
    _, body = layout.panel("Open", default_closed=False)
    body.menu("TETFLORA_MT_species")
    assert interface.controls(layout.drawn) == 3
    assert interface.controls(layout.drawn, closed=False) == 2


def test_every_setting_and_operator_has_a_short_name_and_settings_have_a_tooltip():
    found = interface.named(interface.classes("TETFLORA_PT_"))
    assert found["bare"] == []
    assert found["long_labels"] == {}
    assert 100 < sum(found["properties_of"].values()) <= interface.LIMITS["properties"]


def test_panels_and_operators_are_few(blender):
    panels = interface.classes("TETFLORA_PT_")
    assert len(panels) <= interface.LIMITS["panels"]
    assert len(interface.sidebar(panels)) <= interface.LIMITS["sidebar_panels"]
    assert 40 < len(interface.operator_types()) <= interface.LIMITS["operators"]


def test_no_label_of_the_sidebar_is_cut():
    """Four tenths of a sidebar of usual width are for labels, less their margin: measured in the window, at scale 1."""
    select(add_mesh("ground", size=20.0))
    bpy.ops.tetflora.populate(count=3, species="bush", min_distance=0.1)
    select(next(obj for obj in bpy.data.objects if obj.tetflora.is_plant))
    layer = active_layer(bpy.context.scene)
    layer.vertex_group, layer.use_altitude, layer.wetness_min, layer.age, layer.clumping = "a", True, 0.1, 9.0, 0.5
    layer.mix[0].companion = "oak"
    bpy.context.scene.tetflora.species_editor.shown = True
    blf.size(0, 11)
    layout = Layout()
    for cls in interface.sidebar(interface.classes("TETFLORA_PT_")):
        interface.drawn(cls, interface._context(), layout)
    assert {"Quality", "Altitude", "Day of Year", "Angle Tip"} <= set(layout.beside)
    assert {text for text in layout.beside if blf.dimensions(0, text)[0] > 84.0} == set()


@pytest.mark.parametrize(
    ("epsg", "text"), [(25832, "500,000, 5,300,000 of EPSG:25832"), (-1, "the plane about 50.00000, 9.00000")]
)
def test_the_scene_tab_says_where_on_earth_the_scene_lies(epsg, text):
    bpy.context.scene[KEY] = {"epsg": epsg, "longitude": 9.0, "latitude": 50.0, "east": 5e5, "north": 5.3e6}
    layout = Layout()
    interface.drawn(bpy.types.TETFLORA_PT_scene, interface._context(), layout)
    assert text in [options.get("text") for name, _, options in layout.drawn if name == "label"]


def test_a_ground_that_is_not_in_the_scene_is_told_as_missing_with_what_to_do():
    """Its name stood there as before."""

    def labels():
        layout = Layout()
        interface.drawn(layers.TETFLORA_PT_layers, interface._context(), layout)
        return " ".join(options.get("text") or "" for name, _, options in layout.drawn if name == "label")

    ground = add_mesh("meadow", size=20.0)
    select(ground)
    bpy.ops.tetflora.populate(count=3, species="bush", min_distance=0.1)
    assert "meadow" in labels() and "not in the scene" not in labels()
    bpy.context.scene.collection.objects.unlink(ground)
    assert '"meadow" is not in the scene; choose Use Selected Meshes' in labels()


def test_a_list_whose_only_layer_was_deleted_with_its_object_is_said_to_be_empty():
    """*Select a layer* stood below a list without rows."""
    select(add_mesh("ground", size=20.0))
    bpy.context.scene.tetflora.stand.years = 2
    bpy.context.scene.tetflora.stand.species.add().species = "birch"
    bpy.ops.tetflora.grow_stand()
    bpy.data.objects.remove(active_layer(bpy.context.scene).field)
    layout = Layout()
    interface.drawn(layers.TETFLORA_PT_layers, interface._context(), layout)
    assert "Click + to let something grow" in [options.get("text") for _, _, options in layout.drawn]


@pytest.mark.parametrize("width", [220, 292])
@pytest.mark.parametrize("name", ["Grid", "Plane", "North slope", "Meadow 1", "A"])
def test_lines_of_messages_fit_into_a_section_of_the_sidebar(width, name):
    """80 pixels are tabs, margins and the icon, measured in the window: *Use Selected* was cut to *Use Sel...*"""
    blf.size(0, 11)
    layout = Layout()
    region = SimpleNamespace(width=width)
    text = f'"{name}" is not in the scene; choose Use Selected Meshes in the menu'
    base.draw_message(interface._context(region=region), layout, text)
    lines = [options["text"] for kind, _, options in layout.drawn if kind == "label"]
    assert " ".join(lines) == text
    assert max(blf.dimensions(0, line)[0] for line in lines) <= width - 80


def test_without_a_selected_mesh_biomes_are_said_to_bring_land():
    """*Select a mesh to plant on* stood above biomes that need none."""
    layout = Layout()
    interface.drawn(layers.TETFLORA_PT_add_layer, interface._context(), layout)
    texts = [options.get("text") or "" for _, _, options in layout.drawn]
    assert "A biome brings land of its own; select a mesh to plant on it" in texts


def test_grounds_are_not_looked_up_while_panels_are_drawn(monkeypatch):
    """In a window; each draw of a layer on 2,000 meshes took 240 ms, what + opens 8 ms for each button that asks."""

    def labels(panel=layers.TETFLORA_PT_layers):
        layout = Layout()
        interface.drawn(panel, interface._context(), layout)
        return [options.get("text") or "" for name, _, options in layout.drawn if name == "label"]

    grounds = [add_mesh(f"meadow {n}", size=20.0) for n in range(12)]
    select(grounds[0])
    bpy.ops.tetflora.populate(count=3, species="bush", min_distance=0.1)
    scene, layer = bpy.context.scene, active_layer(bpy.context.scene)
    rules.set_grounds(layer, grounds)
    for obj in grounds[:8]:
        scene.collection.objects.unlink(obj)
    seen = run_to_end(rules.ground_steps(scene, bpy.context.view_layer))
    grounds[0].select_set(False)
    for module in (rules, operators.layers, layers):
        monkeypatch.setattr(module, "grounds_of", lambda *_: pytest.fail("looked up grounds"), raising=False)
    monkeypatch.setattr(rules.seen_grounds, "of", lambda *_: seen)
    assert "meadow 8, meadow 9 and 2 more" in labels()
    assert "On meadow 8, meadow 9 and 2 more" in labels(layers.TETFLORA_PT_add_layer)
    assert bpy.ops.tetflora.populate.poll() and bpy.ops.tetflora.grow_stand.poll()
    assert sum("is not in the scene" in text for text in labels()) == 3  # not a screen of them
    monkeypatch.setattr(rules.seen_grounds, "of", lambda *_: None)
    assert "…" in labels()


def test_the_wind_says_that_it_is_a_speed():
    speed = bpy.context.scene.tetflora.wind.bl_rna.properties["speed"]
    assert speed.unit == 'VELOCITY'


def test_rows_of_lists_are_drawn_to_be_timed():
    timed = {bpy.types.TETFLORA_UL_layers, bpy.types.TETFLORA_UL_species}
    assert set(interface.classes("TETFLORA_UL_")) - timed == {bpy.types.TETFLORA_UL_inventory_columns}  # of a dialog
    select(add_mesh("ground", size=20.0))
    bpy.ops.tetflora.populate(count=3, species="bush, birch", min_distance=0.1)
    bpy.context.scene.tetflora.output.add_species = "oak"
    rows = {name: draw() for name, draw in interface.lists(interface._context()).items()}
    assert rows == {"TETFLORA_UL_layers.0": 1, "TETFLORA_UL_species.0": 2, "TETFLORA_UL_species.1": 1}


@pytest.mark.parametrize(("kind", "icons"), [('BIOME', 3), ('SCATTER', 2)])
def test_names_of_layers_have_most_of_their_row(kind, icons):
    """A list of usual width has 195 pixels, of which each icon takes 20; the name is a field without any."""
    layer = add_population(bpy.context.scene, name="Beech Forest with Ferns")
    layer.kind, layer.made, layer.placed_by = kind, 26_123, fingerprint(layer)
    layout = Layout()
    layers.TETFLORA_UL_layers.draw_item(None, None, layout, None, layer, 0, None, "", 0, 0)
    shown = [options.get("icon", 'NONE') for _, _, options in layout.drawn]
    assert sum(icon not in {'NONE', 'FILE_REFRESH'} for icon in shown) <= icons  # the latter is in place of a number
    assert next(o.get("icon") for name, given, o in layout.drawn if name == "prop" and given[1] == "name") is None


@pytest.mark.parametrize(
    ("number", "text"), [(999, "999"), (1213, "1.2k"), (9950, "10k"), (26_123, "26k"), (999_500, "1.0M")]
)
def test_numbers_beside_names_are_short(number, text):
    assert layers._short(number) == text


@pytest.mark.parametrize("message", ["", "Too few"])
def test_the_line_below_the_list_of_layers_is_not_cut(message):
    """A sidebar of usual width has 206 pixels for it at scale 1: measured in the window."""
    select(add_mesh("ground", size=20.0))
    bpy.ops.tetflora.populate(count=3, species="bush", min_distance=0.1)
    layer = active_layer(bpy.context.scene)
    layer.message = message
    said = {layers._status(layer, True)}
    layer.made = 1_000_000
    said.add(layers._status(layer, True))
    layer.count = 2_000_000
    said.add(layers._status(layer, True))
    layer.by_density = True
    said.add(layers._status(layer, True))
    blf.size(0, 11)
    assert len(said) == 4
    assert {text for text in said if blf.dimensions(0, text)[0] > 206.0} == set()


@pytest.mark.parametrize(("width", "scale"), [(700, 1.0), (1000, 1.0), (1000, 1.4), (4000, 2.0)])
def test_a_gallery_is_as_wide_as_its_window_at_most(width, scale):
    """With its margins, 26 pixels: measured in the window."""
    found = base.gallery_scale(width, scale)
    assert (8 * 20.0 * found + 26.0) * scale < width and 2.0 < found <= base.GALLERY


def test_the_sidebar_stays_short():
    """With a layer of plants and a plant active, closed sections included."""
    select(add_mesh("ground", size=20.0))
    bpy.ops.tetflora.populate(count=3, species="bush", min_distance=0.1)
    select(next(obj for obj in bpy.data.objects if obj.tetflora.is_plant))
    drawn = {}
    for cls in interface.sidebar(interface.classes("TETFLORA_PT_")):
        layout = Layout()
        if interface.drawn(cls, interface._context(), layout):
            drawn[cls.__name__] = interface.controls(layout.drawn)
    assert set(drawn) == {f"TETFLORA_PT_{name}" for name in ("refine", "layers", "plant", "season")}
    assert sum(drawn.values()) <= interface.LIMITS["sidebar_controls"]
