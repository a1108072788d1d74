# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A file saved before the code was rearranged opens with the same values, refines, and renders to the same.

Blender 4.5 saved it, which all versions can open; the render is that of 5.2 by the code of that day.
"""

from __future__ import annotations

import json
import re

import bpy
import numpy as np
import pytest

from devtools import build

FOLDER = build.ROOT / "tests" / "data"
SAVED = json.loads((FOLDER / "saved_before.json").read_text(encoding="utf-8"))
#: What the file holds, and what is made of it to be drawn. The latter only has about the number of that day: plants are
#: opened later now, and leaves and twigs that hardly show are facets. How space is divided is not compared any more.
HELD = ("plants", "polygons_full")
MADE = ("polygons_meshed", "polygons_proxy")
#: Properties that are gone: never released, and their only use was to be turned into another.
GONE = {"slope_limit"}


@pytest.fixture
def saved_file(clean_file):
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
    assert _chosen(found) == _chosen(SAVED["objects"])


def _chosen(objects):
    """Without the choices of objects that have none stored: what menus offer them first is not in the file."""
    return {
        name: {key: value for key, value in group.items() if key != "species_choice" or group["species"]}
        for name, group in objects.items()
    }


def test_it_refines_to_the_same_names_and_about_the_same_counts(saved_file):
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    counts = json.loads(saved_file.tetflora.statistics)
    saved = SAVED["refined"]["statistics"]
    assert {name: counts[name] for name in HELD} == {name: saved[name] for name in HELD}
    made, then = (sum(some[name] for name in MADE) for some in (counts, saved))
    assert made == pytest.approx(then, rel=0.4)
    # Fewer may be made, but none under another name: others link to them, and keyframes are stored by it.
    names = {o.name for o in bpy.data.objects if o.get("tetflora_kind")}
    materials = {m.name for m in bpy.data.materials if m.name.startswith("TetFlora")}
    numbered = r"(.+) (?:bark|leaf|proxies) \d{3}"
    species, saved = (
        {m[1] for name in some if (m := re.fullmatch(numbered, name))} for some in (names, SAVED["names"])
    )
    assert species == saved
    assert all(name in SAVED["names"] or re.fullmatch(numbered, name) for name in names)
    assert {m for m in materials if "leaf" in m} < materials
    assert all(name in SAVED["materials"] or re.fullmatch(r"TetFlora .+ (?:bark|leaf)", name) for name in materials)


def test_it_renders_the_same(saved_file, tmp_path):
    for switch in ("show_render", "camera", "diffuse", "glossy", "transmission", "shadow"):
        saved_file.tetflora.output.property_unset(switch)  # the file has every property off its default
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    saved_file.tetflora.refine_at_render = False
    saved_file.world = bpy.data.worlds.new("gray")
    render, cycles = saved_file.render, saved_file.cycles
    render.engine, render.resolution_x, render.resolution_y = 'CYCLES', 160, 90
    cycles.samples, cycles.use_denoising = 16, False
    render.filepath, render.image_settings.file_format = str(tmp_path / "saved.png"), 'PNG'
    bpy.ops.render.render(write_still=True)
    pixels = np.array(bpy.data.images.load(render.filepath).pixels[:]).reshape(90, 160, 4)[::-1, :, :3]
    means = pixels.reshape(6, 15, 8, 20, 3).mean(axis=(1, 3))
    # Versions of Cycles differ by their noise and by how they light the world: up to .021 between 4.5 and 5.2.
    # Facets of that version were coarser, and hidden by a fog: .032 between that and this one.
    assert np.abs(means - SAVED["rendered"]).max() < 0.04
