# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One unit of Blender is one meter; the panel says where Unit Scale is something else."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest

from devtools.layouts import Layout
from panels import refine as panel


@pytest.mark.parametrize(
    ("system", "scale", "shown"),
    [("METRIC", 1.0, ""), ("NONE", 0.01, ""), ("METRIC", 0.01, "20 cm"), ("IMPERIAL", 0.3048, "20'")],
)
def test_the_panel_tells_how_large_plants_are_in_the_units_of_the_scene(clean_file, system, scale, shown):
    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = system, scale
    context = SimpleNamespace(
        scene=bpy.context.scene,
        view_layer=bpy.context.view_layer,
        active_object=None,
        region=SimpleNamespace(width=4000),
        preferences=bpy.context.preferences,
    )
    layout = Layout()
    panel.TETFLORA_PT_warnings.draw(SimpleNamespace(layout=layout), context)
    said = " ".join(options.get("text", "") for *_, options in layout.drawn)
    assert ("One unit" in said) == bool(shown)
    assert shown in said
    assert layout.names("operator") == ["tetflora.mend"] * bool(shown)
    if shown:
        bpy.ops.tetflora.mend(what="units")
        assert units.scale_length == 1.0
