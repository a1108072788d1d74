# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of many corners, such as outlines that were traced: they cost what their corners do."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import support
from tests.engine.refinement.test_polygons import refined, surface
from tetflora_addon.emission import polygons as emitted
from tetflora_addon.emission.polygons import kept_polygons, polygon_blocks
from tetflora_addon.refinement import loop
from tetflora_addon.refinement.polygons import Meshes, Polygons


def test_blocks_of_faces_with_many_corners_are_no_larger_than_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are cut by corners, as if of quads."""
    limit, corners, copies = 500, 200, 40
    monkeypatch.setattr(emitted, "BLOCK_POLYGONS", limit)
    turn = np.arange(corners) * 2 * np.pi / corners
    disc = surface(np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1) / 9, [list(range(corners))])
    matrices = np.tile(np.eye(4), (copies, 1, 1))
    matrices[:, 1, 3] = np.linspace(0, 3, copies)
    blocks = list(polygon_blocks(Polygons.everything(Meshes([disc], np.zeros(copies, int), matrices))))
    assert sum(b.buffers.polygons for b in blocks) >= copies
    assert len(blocks) > 3
    assert max(len(b.buffers.corner_verts) for b in blocks) <= 4 * limit + corners


def test_faces_that_cross_each_other_everywhere_are_not_cut_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a number of fragments on they go whole to where most of them is; nothing is lost."""
    rng = np.random.default_rng(4)
    faces = [rng.choice(60, 20, replace=False).tolist() for _ in range(60)]
    meshes = Meshes([surface(rng.uniform(-2, 2, (60, 3)), faces)], np.zeros(1, int), np.eye(4)[None])
    camera = support.camera((0, -6, 0), (0, 60, 0), 160, 1.0)
    free = refined(meshes, camera)
    monkeypatch.setattr(loop, "MOST_FRAGMENTS", 5_000)
    bound = refined(meshes, camera)
    assert len(free.cell_polygons) > 40_000
    assert len(bound.cell_polygons) < 20_000
    whole = Polygons.everything(meshes).areas().sum()
    assert bound.cell_polygons.polygons.items.areas().sum() == pytest.approx(whole, rel=1e-9)
    assert sum(len(b.buffers.corner_verts) for b in polygon_blocks(kept_polygons(bound))) > 0
