# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists see is counted, and stays within what was decided."""

from __future__ import annotations

import bpy
import pytest

from devtools import interface
from devtools.layouts import Layout
from tests.blender.scenes import add_mesh, select

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
