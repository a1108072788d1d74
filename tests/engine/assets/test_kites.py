# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Kites of leaves: as large, where they are, and turned as a face of theirs."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import support
from tests.engine.assets import trees
from tetflora_addon.assets.measures import kite_mesh


@pytest.mark.parametrize("kind", sorted(trees.SOURCES))
def test_kites_have_the_area_that_leaves_block(kind: str) -> None:
    asset = trees.compiled(kind)
    mesh = kite_mesh(asset.leaves)
    assert len(asset.leaves) == asset.clusters.leaves[0] == mesh.polygons
    area = support.face_areas(mesh) if mesh.polygons else np.zeros(0)
    assert area.sum() == pytest.approx(asset.clusters.leaf_optical[0], rel=1e-5)
    for cluster in range(len(asset.clusters)):
        first, number = asset.clusters.first_leaf[cluster], asset.clusters.leaves[cluster]
        own = area[first : first + number].sum()
        assert own == pytest.approx(asset.clusters.leaf_optical[cluster], rel=1e-4, abs=1e-9)
    for value in vars(asset.leaves).values():
        assert np.isfinite(value).all()


@pytest.mark.parametrize("kind", ["leaves", "varied", "closed", "skeleton", "degenerate", "card"])
def test_kites_are_where_leaves_are(kind: str) -> None:
    """Middles within the bound of their cluster."""
    asset = trees.compiled(kind)
    for cluster in np.flatnonzero(asset.clusters.children == 0).tolist():
        own = asset.leaves_of(cluster)
        assert (own.center >= asset.clusters.low[cluster] - 1e-5).all()
        assert (own.center <= asset.clusters.high[cluster] + 1e-5).all()


def test_a_kite_of_a_flat_leaf_is_in_its_plane_and_along_it() -> None:
    source = trees.source_of(trees.surface([[0, 0, 2], [3, -0.4, 2], [6, 0, 2], [3, 0.4, 2]], [(0, 1, 2, 3)]))
    leaf = trees.compile_asset(source).leaves
    assert leaf.center[0] == pytest.approx([3, 0, 2], abs=1e-5)
    assert abs(leaf.along[0, 0]) == pytest.approx(np.linalg.norm(leaf.along[0]), rel=1e-5)
    assert np.cross(leaf.along[0], leaf.across[0])[:2] == pytest.approx(0.0, abs=1e-6)
    assert 2.0 < 2 * np.linalg.norm(leaf.along[0]) < 8.0
    mesh = kite_mesh(leaf)
    assert support.face_areas(mesh) == pytest.approx(2.4, rel=1e-5)


def test_kites_show_the_same_area_from_everywhere_as_leaves_do() -> None:
    """On the mean: planes are chosen by area, so that moments are kept."""
    for kind in ("leaves", "closed"):
        asset = trees.compiled(kind)
        leafy = asset.clusters.take(np.flatnonzero(asset.clusters.parent == (0 if kind == "closed" else -1)))
        row = int(np.argmax(leafy.leaf_optical))
        found = support.moment(kite_mesh(asset.leaves))
        wanted = leafy.moment[row]
        assert np.diag(found) == pytest.approx(wanted[:3], abs=0.05)
        assert found[[0, 0, 1], [1, 2, 2]] == pytest.approx(wanted[3:], abs=0.05)


def test_colors_of_kites_are_those_of_their_leaves() -> None:
    asset, surface = trees.compiled("varied"), trees.source("varied").surfaces[0]
    corners = surface.positions[surface.triangles].astype(float)
    area = trees.areas_of(corners)
    middle = np.stack([np.bincount(surface.face, area * corners.mean(axis=1)[:, k]) for k in range(3)], axis=1)
    middle /= np.bincount(surface.face, area)[:, None]
    some = np.flatnonzero(np.linalg.norm(asset.leaves.along.astype(float), axis=1) > 0.02)[:100]
    for leaf in some.tolist():
        face = np.linalg.norm(middle - asset.leaves.center[leaf], axis=1).argmin()
        assert face >= 88
        assert asset.leaves.color[leaf].astype(float) == pytest.approx(surface.color[face].astype(float), abs=2e-3)
        assert asset.leaves.transmission[leaf] == pytest.approx(float(surface.transmission[face]), abs=2e-3)
