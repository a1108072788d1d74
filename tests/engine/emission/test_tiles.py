# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles that take the place of others: what is made is the same in any order, and lies within the same borders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tetflora_addon import parallel
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.emission import drawing as subject
from tetflora_addon.emission.coverage import Coverage
from tetflora_addon.emission.emitters import facet_blocks
from tetflora_addon.emission.plants import Block
from tetflora_addon.proxies.primitives import triangles_of


@pytest.fixture
def wood(monkeypatch):
    """Birches in three tiles, of which the right one shows the nearest and the left one the farthest."""
    monkeypatch.setattr(subject, "TILE", 40)
    monkeypatch.setenv(parallel.VARIABLE, "1")  # other processes would know nothing of these tiles
    flora, seeds = support.alone("birch", 20_000.0), support.grove(12, 5.0)
    position = seeds.position.copy()
    position[:, 1] -= 1.5 * position[:, 0]
    camera = support.camera((0, -60, 8), (0, 0, 8), pixels=120, view=0.5)
    return flora, replace(seeds, position=position), camera


def made_by_tile(flora, seeds, camera, tiles, facet=2.0):
    """Positions of all that is made of each tile, mesh by mesh, in the order of the tiles."""
    scene, found, tile = support.refined(flora, run(flora, seeds, camera)[1], camera, facet, 2.0), {}, None
    scene = replace(scene, drawing=replace(scene.drawing, tiles=tiles, form=as_seen))
    for made in scene.tiles(facet_blocks):
        if isinstance(made, int):
            tile, found[made] = made, found.get(made, [])
            continue
        made = made.buffers if isinstance(made, Block) else made
        found[tile].append(made.positions if isinstance(made, MeshBuffers) else np.zeros((0, 3), np.float32))
    return found


def as_seen(facets, seen):
    """Triangles of what is seen alone."""
    return triangles_of(facets.take(np.flatnonzero(np.full(len(facets), seen))))


def test_the_nearest_comes_first_and_all_is_as_from_left_to_right(wood):
    usual, by_distance = (made_by_tile(*wood, tiles) for tiles in (0, 3))
    assert list(usual) == [0, 1, 2] and list(by_distance) == [2, 1, 0]
    for tile, made in usual.items():
        assert len(made) > 1
        for one, other in zip(made, by_distance[tile], strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_first_look_has_the_borders_of_what_replaces_it(wood, monkeypatch):
    """Of crowns that stand across them as well."""
    flora, seeds, _ = wood
    monkeypatch.setattr(subject, "TILE", 160)
    small = support.camera((0, -60, 8), (0, 0, 8), pixels=480, view=0.7).smaller(192)
    coverage = Coverage(small, (0, 1))
    ends = np.linspace(0, coverage.width, 4)
    for tile, made in made_by_tile(flora, seeds, small, 3, facet=4.0).items():
        column = coverage.project(np.concatenate(made).astype(np.float64))[0]
        beyond = np.maximum(ends[tile] - column, column - ends[tile + 1])
        assert len(column) > 100
        assert np.quantile(beyond, 0.99) < 3.5
