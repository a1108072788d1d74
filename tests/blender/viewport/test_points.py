# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Dots where the plants of a population would stand, and what the panel says of them."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, depsgraph, select
from tetflora_addon.blender.runtime import _after_renders
from tetflora_addon.blender.viewport import points

pytestmark = pytest.mark.usefixtures("clean_file")


def _ops():
    return bpy.ops.tetflora


def _settings():
    return bpy.context.scene.tetflora


def _populate(count, **options):
    select(add_mesh("ground", size=20.0))
    _ops().populate(count=count, **{"min_distance": 1.0, "species": "bush:2, conifer", **options})
    bpy.context.view_layer.update()


def _dots():
    return points._dots_of(bpy.context.scene, depsgraph())


def test_dots_stand_where_plants_will():
    _populate(count=15)
    _settings().layers[0].seed = 9
    dots = _dots()
    assert dots.plants == 15
    _ops().update_layers(which='ACTIVE')
    own = [o for o in bpy.context.scene.objects if o.tetflora.is_plant]
    places = np.array([tuple(o.location) for o in own])
    assert np.allclose(np.sort(dots.position[:, :2], axis=0), np.sort(places[:, :2], axis=0), atol=1e-4)
    assert len(np.unique(dots.color, axis=0)) == len({o.tetflora.species for o in own})


def test_without_a_population_dots_stand_on_what_is_selected():
    first, second = add_mesh("first", size=5.0), add_mesh("second", size=5.0, z=7.0)
    select(second)
    assert first is not second
    dots = _dots()
    assert dots.plants > 0
    assert (dots.position[:, 2] > 7.0).all()


def test_the_preview_shows_few_dots_of_many_and_says_how_many(monkeypatch):
    _populate(count=500, min_distance=0.0)
    monkeypatch.setattr(points, "MOST_DOTS", 60)
    dots = _dots()
    assert (len(dots.position), dots.plants, dots.more) == (60, 500, False)
    monkeypatch.setattr(points, "MOST_PLACED", 100)
    dots = _dots()
    assert (dots.plants, dots.more) == (100, True)


def test_in_the_background_nothing_is_drawn():
    _populate(count=5)
    try:
        bpy.context.window_manager.tetflora_points = True
        assert bpy.app.background
        assert points.switch.shown_in(bpy.context.scene)
        assert points._state.handle is None
        assert not bpy.app.timers.is_registered(_after_renders(points.switch.refresh))
    finally:
        points.switch.show(bpy.context.scene, False)
    assert points._state.handle is None


@pytest.mark.parametrize(
    ("count", "as_field", "says"),
    [
        (1200, 'AUTOMATIC', "1,200 plants, as empties"),
        (40_000, 'AUTOMATIC', "40,000 plants, as one field"),
        (3, 'FIELD', "3 plants, as one field"),
        (1, 'EMPTIES', "1 plant, as empties"),
    ],
)
def test_the_panel_says_what_will_be_made(count, as_field, says):
    draft = _settings().populate
    draft.count, draft.as_field = count, as_field
    assert points.status(draft) == says
    draft.by_density = True
    assert "As many plants" in points.status(draft)
