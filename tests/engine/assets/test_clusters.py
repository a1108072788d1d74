# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Clusters: every patch in one of each level, children are all of their parent, kinds are apart."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon.assets.patches import GENERATIONS, SMALL, Hierarchy, hierarchy_of


def patches(seed: int, count: int, kinds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    center = rng.integers(0, 8, (count, 3)) * rng.choice([0.0, 1e-3, 1.0, 1e5])
    most = rng.choice([1, 40, 3 * SMALL])
    return center.astype(np.float32), rng.integers(1, most + 1, count), rng.integers(0, kinds, count).astype(np.int8)


def check(found: Hierarchy, triangles: np.ndarray, kind: np.ndarray) -> None:
    count = len(found.parent)
    assert np.array_equal(np.sort(found.order), np.arange(len(triangles)))
    assert found.parent[0] == -1 and (found.first[0], found.last[0]) == (0, len(triangles))
    assert (found.parent[1:] >= 0).all() and (found.parent < np.arange(count)).all()
    assert (found.last > found.first).all()
    for cluster in range(count):
        own = np.flatnonzero(found.parent == cluster)
        assert len(own) == found.children[cluster] <= 2**GENERATIONS and found.children[cluster] != 1
        if len(own):
            assert np.array_equal(own, found.child[cluster] + np.arange(len(own)))
            assert found.first[own[0]] == found.first[cluster] and found.last[own[-1]] == found.last[cluster]
            assert np.array_equal(found.first[own[1:]], found.last[own[:-1]])
            continue
        inside = found.order[found.first[cluster] : found.last[cluster]]
        assert triangles[inside].sum() <= SMALL or len(inside) == 1
    kinds = kind[found.order]
    for cluster in range(1, count):
        assert len(set(kinds[found.first[cluster] : found.last[cluster]].tolist())) == 1 or len(set(kind.tolist())) == 1
    assert found.children[0] == 0 or len(set(kind.tolist())) == 1 or found.children[0] == len(set(kind.tolist()))


@given(st.integers(0, 2**31), st.integers(1, 300), st.integers(1, 3))
def test_any_patches(seed: int, count: int, kinds: int) -> None:
    center, triangles, kind = patches(seed, count, kinds)
    check(hierarchy_of(center, triangles, kind), triangles, kind)


@given(st.integers(0, 2**31))
def test_the_same_patches_make_the_same_clusters(seed: int) -> None:
    given_ = patches(seed, 500, 3)
    one, other = hierarchy_of(*given_), hierarchy_of(*given_)
    for name, value in vars(one).items():
        assert np.array_equal(value, getattr(other, name))


@pytest.mark.parametrize("count", [256, 257, 2_000, 20_000])
def test_clusters_are_balanced_and_compact(count: int) -> None:
    """No smallest cluster is much smaller than half of what it may be, and those of one are boxes side by side."""
    rng = np.random.default_rng(1)
    center = rng.random((count, 3)).astype(np.float32)
    found = hierarchy_of(center, np.ones(count, np.int32), np.zeros(count, np.int8))
    check(found, np.ones(count, np.int32), np.zeros(count, np.int8))
    size = (found.last - found.first)[found.children == 0]
    assert size.min() >= min(SMALL // 2 - 2, count)
    boxes = [center[found.order[a:b]] for a, b in zip(found.first, found.last, strict=True)]
    volume = np.array([np.prod(np.ptp(box, axis=0)) for box in boxes])
    assert volume[found.children == 0].sum() <= 1.0
