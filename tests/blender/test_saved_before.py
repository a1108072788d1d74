# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A file saved before the code was rearranged opens with the same values, and refines to the same."""

from __future__ import annotations

import json

import bpy
import pytest

from devtools import build

FOLDER = build.ROOT / "tests" / "data"
SAVED = json.loads((FOLDER / "saved_before.json").read_text(encoding="utf-8"))
COUNTS = ("plants", "polygons_full", "polygons_meshed", "polygons_proxy")
COUNTS += ("tetrahedra_made", "tetrahedra_terminal", "tetrahedra_proxy")
#: Properties that are gone: never released, and their only use was to be turned into another.
GONE = {"slope_limit"}


@pytest.fixture
def saved_file(clean_file):
    if bpy.app.version < (5, 2):
        pytest.skip("the file was saved by Blender 5.2")
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "saved_before.blend"))
    return bpy.context.scene


def _plain(value, like):
    """A value of a property in the shape in which the JSON holds it."""
    if isinstance(like, dict):
        return {name: _plain(getattr(value, name), part) for name, part in like.items() if name not in GONE}
    if isinstance(value, set):
        return sorted(value)
    if isinstance(like, list):
        return [_plain(v, part) for v, part in zip(value, like, strict=True)]
    return getattr(value, "name", value)  # of a pointer to an object the name


def _without_gone(saved):
    if isinstance(saved, dict):
        return {name: _without_gone(value) for name, value in saved.items() if name not in GONE}
    return [_without_gone(value) for value in saved] if isinstance(saved, list) else saved


def test_every_property_has_the_value_that_was_saved(saved_file):
    assert _plain(saved_file.tetflora, SAVED["scene"]) == _without_gone(SAVED["scene"])
    found = {name: _plain(bpy.data.objects[name].tetflora, saved) for name, saved in SAVED["objects"].items()}
    assert found == SAVED["objects"]


def test_it_refines_to_the_same_counts_and_names(saved_file):
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    counts = json.loads(saved_file.tetflora.statistics)
    saved = SAVED["refined"]["statistics"]
    assert {name: counts[name] for name in COUNTS} == {name: saved[name] for name in COUNTS}
    assert sorted(o.name for o in bpy.data.objects if o.get("tetflora_kind")) == SAVED["names"]
    assert sorted(m.name for m in bpy.data.materials if m.name.startswith("TetFlora")) == SAVED["materials"]
