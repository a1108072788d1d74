# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file stores of plants and settings, and that it survives."""

from __future__ import annotations

from dataclasses import fields

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, add_plant
from tetflora_addon import blender
from tetflora_addon.blender import preferences, properties, saved_files
from tetflora_addon.blender.biomes import library
from tetflora_addon.blender.job import contents
from tetflora_addon.blender.placing.properties import TetFloraBrush, TetFloraLayer
from tetflora_addon.blender.results import leaf_objects
from tetflora_addon.blender.settings import TetFloraWind, TetFloraYear
from tetflora_addon.blender.species import catalog, edits
from tetflora_addon.growth import seasons, wind
from tetflora_addon.planting import rules, strokes
from tetflora_addon.refinement import settings

pytestmark = pytest.mark.usefixtures("clean_file")


def _reopen(path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))


def test_settings_mirror_the_engine():
    defaults = settings.RefinementSettings()
    scene = bpy.context.scene
    read = contents.settings_from(scene)
    for field in fields(defaults):
        assert getattr(read, field.name) == pytest.approx(getattr(defaults, field.name), rel=1e-6), field.name
    scene.tetflora.cutoff = 3.5
    scene.tetflora.max_tetrahedra = 1234
    read = contents.settings_from(scene)
    assert (read.cutoff, read.max_tetrahedra) == (3.5, 1234)


def _without_labels(settings_class):
    return {field.name for field in fields(settings_class) if not field.metadata}


@pytest.mark.parametrize(
    ("engine", "group", "engine_only"),
    [
        (settings.RefinementSettings, properties.TetFloraScene, {"hidden_block", "proxy_block", "margin"}),
        (rules.Rules, TetFloraLayer, {"density", "weights", "companions"}),
        (strokes.Brush, TetFloraBrush, {"density", "scale_min", "scale_max", "weights"}),
        (wind.Wind, TetFloraWind, {"time", "loop", "moving", "origin"}),
        (seasons.Season, TetFloraYear, set()),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_properties_are_made_from_the_fields_of_the_engine(engine, group, engine_only):
    assert _without_labels(engine) == engine_only
    for field in fields(engine):
        if field.metadata:
            made = group.bl_rna.properties[field.name]
            if "name" in field.metadata:
                assert (made.name, made.description) == (field.metadata["name"], field.metadata["description"])
                ranges = (p for p in group.bl_rna.properties if p.identifier.endswith("_range"))
                assert made.is_hidden == any(made.description in p.description for p in ranges)
            else:
                assert made.is_hidden
            assert made.default == pytest.approx(field.metadata.get("default", field.default), rel=1e-6)
            kind = getattr(field.type, "__name__", field.type)  # text where annotations are evaluated late
            assert kind in {"bool", "int", "float"}
            assert made.type == {"bool": 'BOOLEAN'}.get(kind, kind.upper())


def test_ranges_and_switches_show_what_is_stored():
    """Artists see them; scripts and files have the single ones, whose limits stay their own."""
    scene = bpy.context.scene.tetflora
    layer = scene.layers.add()
    layer.slope_range = 0.25, 9.0, 0.0
    assert (layer.slope_min, layer.slope_max, layer.slope_softness) == pytest.approx((0.25, np.pi / 2, 0.0))
    layer.altitude_falloff, layer.altitude_softness = 3.0, 7.0
    assert layer.altitude_range[2] == 3.0
    layer.kind = 'BIOME'
    assert layer.altitude_range[2] == 7.0
    layer.altitude_range[2] = 8.0
    assert (layer.altitude_falloff, layer.altitude_softness) == (3.0, 8.0)
    scene.brush.scale_max = 3.0
    assert tuple(scene.brush.scale_range) == pytest.approx((0.8, 3.0))
    output = scene.output
    assert output.results_in == {'SHOW_VIEWPORT', 'SHOW_RENDER'}
    output.ray_visibility = {'CAMERA', 'SHADOW'}
    assert (output.camera, output.diffuse, output.glossy, output.shadow) == (True, False, False, True)


def test_qualities_set_what_they_say_and_are_recognized():
    qualities = settings.QUALITIES
    own = bpy.context.scene.tetflora
    assert own.quality == 'FINAL'
    for name, values in qualities.items():
        own.quality = name
        assert own.quality == name
        for field, value in values.items():
            assert getattr(own, field) == pytest.approx(value)
    own.cutoff = 3.7
    assert own.quality == 'CUSTOM'
    own.quality = 'CUSTOM'
    assert own.cutoff == pytest.approx(3.7)


def test_everything_the_artist_sees_is_explained():
    groups = {cls.__name__: cls.bl_rna for cls in properties.CLASSES}
    operators = {name: getattr(bpy.types, name).bl_rna for name in dir(bpy.types) if name.startswith("TETFLORA_OT_")}
    assert len(operators) >= 9
    unexplained = [
        f"{owner}.{p.identifier}"
        for owner, rna in {**groups, **operators}.items()
        for p in rna.properties
        if not p.is_readonly
        and not p.is_hidden
        and p.identifier not in {"rna_type", "name"}
        and not p.identifier.startswith("bl_")
        and not p.description
    ]
    assert unexplained == []


def test_labels_and_tooltips_follow_blenders_guidelines():
    """Labels in title case; tooltips begin with a capital and end without a full stop."""
    small = {
        "a",
        "an",
        "and",
        "as",
        "at",
        "by",
        "for",
        "from",
        "in",
        "into",
        "of",
        "on",
        "or",
        "per",
        "the",
        "to",
        "with",
    }
    classes = [*properties.CLASSES, preferences.TetFloraPreferences]
    found = [(owner.__name__, p) for owner in classes for p in owner.bl_rna.properties if not p.is_readonly]
    for name in dir(bpy.types):
        if name.startswith("TETFLORA_OT_"):
            found += [(name, p) for p in getattr(bpy.types, name).bl_rna.properties if not p.is_readonly]
    found = [(owner, p) for owner, p in found if not p.identifier.startswith("bl_")]
    texts = {(owner, p.name, p.description) for owner, p in found}
    texts |= {(owner, i.name, i.description) for owner, p in found if p.type == 'ENUM' for i in p.enum_items_static}
    assert len(texts) > 200
    assert [t for t in texts if any(word[0].islower() and word not in small for word in t[1].split())] == []
    assert [t for t in texts if t[2].endswith(".") or t[2][:1].islower()] == []


def test_an_unknown_species_survives_the_panel_and_the_file(tmp_path):
    plant = add_plant(species="not_in_the_catalog", seed=-7)
    assert plant.tetflora.species_choice == "not_in_the_catalog"
    _reopen(tmp_path / "a.blend")
    plant = bpy.data.objects["plant"].tetflora
    assert (plant.species, plant.seed, plant.is_plant, plant.enabled) == ("not_in_the_catalog", -7, True, True)
    plant.species_choice = "bush"
    assert plant.species == "bush"
    assert plant.species_choice == "bush"


def test_items_keep_their_numbers_when_the_catalog_grows(tmp_path):
    items = catalog.items_for("gone")
    numbers = {item[0]: item[4] for item in items}
    assert len(set(numbers.values())) == len(numbers)
    assert numbers["gone"] == catalog.number_of("gone")
    assert {i[0]: i[4] for i in catalog.items_for()} == {k: v for k, v in numbers.items() if k != "gone"}


def test_numbers_of_items_survive_popups_which_keep_floats():
    numbers = [item[4] for item in (*catalog.items_for(), *library.items())]
    assert np.array(numbers, np.float32).astype(int).tolist() == numbers


def test_species_of_the_users_own_folder(tmp_path):
    shipped = edits.catalog()
    own = bpy.context.preferences.addons[preferences.ROOT_PACKAGE].preferences
    (tmp_path / "mine.json").write_text(shipped["bush"].path.read_text(encoding="utf-8"), encoding="utf-8")
    try:
        own.species_folder = str(tmp_path)
        assert preferences.species_folders() == (tmp_path,)
        assert set(edits.catalog()) == {*shipped, "mine"}
        own.species_folder = str(tmp_path / "missing")
        assert preferences.species_folders() == ()
    finally:
        own.species_folder = ""


def test_leaf_objects_are_pointers(tmp_path):
    leaf = add_mesh("my leaf")
    entry = bpy.context.scene.tetflora.leaf_objects.add()
    entry.species, entry.leaf = "bush", leaf
    assert bpy.context.scene.tetflora.leaf_objects.add().species == ""
    leaf.name = "renamed"
    _reopen(tmp_path / "a.blend")
    found = leaf_objects.leaf_objects(bpy.context.scene)
    assert {k: v.name for k, v in found.items()} == {"bush": "renamed"}


def test_files_are_stamped_and_those_of_a_newer_version_left_alone(tmp_path, capsys):
    add_plant("old")
    newer = add_plant("newer")
    newer.tetflora.version = saved_files.VERSION + 1
    add_mesh("other")
    bpy.context.scene.tetflora.cutoff = 5.0
    _reopen(tmp_path / "a.blend")
    versions = {o.name: o.tetflora.version for o in bpy.data.objects}
    assert versions == {"old": saved_files.VERSION, "newer": saved_files.VERSION + 1, "other": 0}
    assert bpy.context.scene.tetflora.version == saved_files.VERSION
    assert "a newer version saved 1 of" in capsys.readouterr().err


def test_rooms_are_themselves_and_no_module_of_the_same_name():
    for room in ("materials", "species", "scene", "results", "placing", "job", "viewport", "cli"):
        assert getattr(blender, room).__path__
