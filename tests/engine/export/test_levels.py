# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels of detail have fewer polygons and look like their plant from where they take over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.export import levels as levels_room
from tetflora_addon.export.levels import ANGLE, PIXELS, Grid, PlantLevel, levels_of
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.catalog import load_species


def square(z: float, color: tuple[float, float, float], side: float = 1.0) -> MeshBuffers:
    """A level square, seen from above."""
    corners = np.array([(0, 0, z), (side, 0, z), (side, side, z), (0, side, z)], np.float32)
    ring = np.arange(4, dtype=np.int32)
    attributes = {"tf_color": ("FACE", np.array([color], np.float32))}
    edges = np.stack([ring, np.roll(ring, -1)], axis=1)
    return MeshBuffers(corners, edges, ring, ring, np.array([0, 4], np.int32), attributes)


def test_a_view_shows_what_is_nearest_and_how_much_of_it():
    below, above = square(0.0, (1.0, 0.0, 0.0)), square(1.0, (0.0, 1.0, 0.0), 0.5)
    grid = Grid.around(np.array([0.0, 0.0, 1.0]), 0.01, below.positions, 0.1)
    for meshes in ([below, above], [above, below]):
        seen = grid.view(meshes)
        assert seen.cover == pytest.approx(10_000, rel=0.01)
        assert seen.color == pytest.approx((0.75, 0.25, 0.0), abs=0.01)
    assert grid.view([below]).outline_off(grid.view([below])) == 0.0
    moved = replace(below, positions=below.positions + np.float32([0.03, 0.0, 0.0]))
    off = max(
        grid.view([below]).outline_off(grid.view([m]))
        for m in (moved, replace(moved, positions=moved.positions[:, [1, 0, 2]]))
    )
    assert off == pytest.approx(3.0, abs=0.2)


def differences(levels: Sequence[PlantLevel]) -> tuple[PlantLevel, ...]:
    """Levels of a plant but the first, with how far each is off that one, seen anew."""
    full, *rest = levels
    grids = levels_room._grids(full, 0.0, max(level.pixel for level in rest))
    truth, found = levels_room._views(grids, full.parts), []
    for level in rest:
        seen = levels_room._views(grids, level.parts)
        cover = sum(view.cover for view in seen) / sum(view.cover for view in truth) - 1.0
        color = float(np.abs(levels_room._mean_color(seen) / levels_room._mean_color(truth) - 1.0).max())
        outline = levels_room._outlines(seen, truth, grids, level.pixel)
        found.append(replace(level, cover=cover, color=color, outline=outline))
    return tuple(found)


@pytest.fixture(scope="module")
def bush():
    flora = compile_species([load_species("bush")])
    return flora, levels_of(flora, Seeds.upright(1))


def test_levels_are_coarser_and_take_over_farther_away(bush):
    _, levels = bush
    polygons, away = [level.polygons for level in levels], [level.distance for level in levels]
    assert 3 <= len(levels) <= 6
    assert polygons == sorted(polygons, reverse=True) and polygons[-1] < 600
    assert away == sorted(away) and away[0] == 0.0
    size = [level.screen_size(2.0) for level in levels]
    assert size[0] == 1.0 and size == sorted(size, reverse=True)
    assert size[1] == pytest.approx(2.0 / (2.0 * np.tan(ANGLE / 2.0) * away[1]))
    assert levels[1].pixel * PIXELS == pytest.approx(2.0 * np.tan(ANGLE / 2.0) * away[1])


def test_levels_cover_as_much_in_the_same_color_and_outline(bush):
    _, levels = bush
    for level in differences(levels):
        assert abs(level.cover) < 0.02
        assert level.color < 0.03
        assert level.outline < 1.5


def test_so_many_levels_are_made_as_are_asked_for(bush):
    flora, _ = bush
    assert len(levels_of(flora, Seeds.upright(1), 4)) == 4
    assert len(levels_of(flora, Seeds.upright(1), 1)) == 1


def test_a_plant_without_leaves_has_levels():
    flora = compile_species([load_species("dead_tree")])
    levels = levels_of(flora, Seeds.upright(1), 3)
    polygons = [level.polygons for level in levels]
    assert polygons == sorted(polygons, reverse=True) and polygons[-1] > 0


def test_levels_of_another_plant_cover_as_much_as_that_does():
    """Plants of a kind hide their wood and each other's leaves to different degrees, wherever they look to."""
    fern, plants = compile_species([load_species("fern")]), Seeds.upright(2)
    plants = replace(plants, frame=np.array([np.eye(3), [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]))
    like = levels_of(fern, plants.take(slice(0, 1)))
    levels = differences(levels_of(fern, plants.take(slice(1, 2)), 0, like))
    assert [level.pixel for level in levels] == [level.pixel for level in like[1:]]
    assert all(abs(level.cover) < 0.02 and level.color < 0.03 for level in levels)
