# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Patches: each triangle is in one, islands that are small stay whole, and no face is ever divided."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine.assets import trees
from tetflora_addon.assets.asset import AssetSurface
from tetflora_addon.assets.patches import MOST_FACES, Patches, islands, patches_of


def check(one: AssetSurface) -> Patches:
    found = patches_of(one)
    assert np.array_equal(np.sort(found.triangle), np.arange(len(one.triangles)))
    assert found.first[0] == 0 and found.first[-1] == len(one.triangles)
    assert (np.diff(found.first) > 0).all()
    owner = np.repeat(np.arange(len(found)), np.diff(found.first))
    face = one.face[found.triangle]
    pairs = np.unique(np.stack([face, owner], axis=1), axis=0)
    assert len(np.unique(face)) == len(pairs)  # no face in two patches
    assert (np.diff(face) != 0).sum() == len(pairs) - 1  # the triangles of each together
    assert np.array_equal(np.bincount(pairs[:, 1], minlength=len(found)), found.faces)
    assert found.faces.max() <= MOST_FACES
    island = islands(one)[found.triangle]
    of = island[found.first[:-1]]
    assert np.array_equal(island, of[owner])  # no patch of two islands
    counts = {i: len(np.unique(face[island == i])) for i in np.unique(island).tolist()}
    for i, number, pieces in zip(of.tolist(), found.faces.tolist(), found.pieces.tolist(), strict=True):
        assert pieces == -(-counts[i] // MOST_FACES)
        assert pieces > 1 or number == counts[i]
    for name in ("width", "center", "island"):
        assert np.isfinite(getattr(found, name)).all()
    corners = one.positions[one.triangles].astype(float)
    area = np.bincount(islands(one), trees.areas_of(corners))
    assert found.island == pytest.approx(area[of], rel=1e-5, abs=1e-9)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    assert ((found.center >= low - 1e-5) & (found.center <= high + 1e-5)).all()
    return found


@pytest.mark.parametrize("kind", sorted(trees.SOURCES))
def test_patches_of_trees(kind: str) -> None:
    for one in trees.source(kind).surfaces:
        check(one)


def test_leaves_are_patches_of_their_own_and_trunks_are_cut() -> None:
    found = check(trees.tree(1, 300))
    assert (found.faces == 1).sum() == 300
    assert not found.solid[found.pieces == 1].any()
    cut = found.pieces > 1
    assert cut.sum() == 2 and found.solid[cut].all() and found.faces[cut].sum() == 88


@given(st.integers(0, 2**31), st.integers(1, 40), st.integers(1, 200))
def test_any_mesh(seed: int, vertices: int, faces: int) -> None:
    """Polygons among few vertices, some of which are at the same place: faces of no area, edges of many faces."""
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 4, (vertices, 3)) * rng.choice([0.0, 1.0, 1e-20, 1e6])
    own = [rng.integers(0, vertices, rng.integers(3, 7)).tolist() for _ in range(faces)]
    check(trees.surface(positions, own))


@given(st.integers(0, 2**31))
def test_islands_are_what_hangs_together_by_places(seed: int) -> None:
    """By brute force over corners."""
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 6, (40, 3)).astype(float)
    one = trees.surface(positions, [rng.integers(0, 40, rng.integers(3, 5)).tolist() for _ in range(12)])
    places = [{tuple(p) for p in one.positions[t].tolist()} for t in one.triangles]
    group = list(range(len(places)))
    for _ in group:
        for i in range(len(group)):
            for k in range(len(group)):
                if places[i] & places[k] or one.face[i] == one.face[k]:
                    group[i] = group[k] = min(group[i], group[k])
    found = islands(one)
    assert np.array_equal(found[:, None] == found, np.array(group)[:, None] == np.array(group))


def test_vertices_that_are_split_at_seams_are_one() -> None:
    """Positive and negative zero, too."""
    whole = trees.trunk(rings=4)
    corners = whole.positions[whole.triangles].reshape(-1, 3)
    corners[::2] = np.where(corners[::2] == 0.0, np.float32(-0.0), corners[::2])
    split = replace(whole, positions=corners, triangles=np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
    assert len(np.unique(islands(split))) == 1
    assert len(check(split)) == len(check(whole)) == 1
    assert patches_of(split).solid.all()


def test_pieces_of_a_large_island_lie_together() -> None:
    found, one = check(trees.trunk(30.0, rings=200, sides=8)), trees.trunk(30.0, rings=200, sides=8)
    height = one.positions[one.triangles[found.triangle]].mean(axis=1)[:, 2]
    first = found.first[:-1]
    extent = np.maximum.reduceat(height, first) - np.minimum.reduceat(height, first)
    assert np.median(extent) < 3.0
