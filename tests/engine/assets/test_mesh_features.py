# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a mesh is made of: which faces are leaves, which are solid, and how wide they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from tests.engine.refinement.test_polygons import SEEDS, surface, thicket
from tetflora_addon.assets.patches import mesh_features
from tetflora_addon.growth.hashing import mix


def tube(radius: float, length: float, sides: int = 8, rings: int = 20) -> tuple[np.ndarray, list[list[int]]]:
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    positions = np.concatenate([ring + [0, 0, z] for z in np.linspace(0, length, rings)])
    faces = [
        [i * sides + j, i * sides + (j + 1) % sides, (i + 1) * sides + (j + 1) % sides, (i + 1) * sides + j]
        for i in range(rings - 1)
        for j in range(sides)
    ]
    return positions, faces


@pytest.mark.parametrize(("radius", "length"), [(0.1, 2.0), (0.01, 1.0), (0.5, 40.0)])
@pytest.mark.parametrize("split", [False, True])
def test_tubes_are_solid_and_as_wide_as_they_are(radius: float, length: float, split: bool) -> None:
    """Open ends or not, with vertices shared or with those of each face by themselves."""
    positions, faces = tube(radius, length)
    if split:
        positions, faces = positions[np.ravel(faces)], np.arange(4 * len(faces)).reshape(-1, 4).tolist()
    one = surface(positions, faces)
    assert one.solid.all()
    assert not one.leaf.any()
    np.testing.assert_allclose(one.width, 2 * radius, rtol=0.1)


def test_a_face_of_no_area_bends_nothing() -> None:
    """A triangle between two rings whose corners are on one line, as boolean operations leave them."""
    positions, faces = tube(0.125, 2.375, 4)
    positions = np.rint(8.0 * positions) / 8.0  # so that its area is 0 to the last bit
    before = surface(positions, faces).width
    first, second, *others = faces[40]
    middle = len(positions)
    changed = [*faces[:40], [first, middle, second, *others], *faces[41:], [second, middle, first]]
    after = surface(np.concatenate([positions, positions[[first, second]].mean(axis=0, keepdims=True)]), changed)
    assert after.solid.all()
    np.testing.assert_allclose(after.width[:-1], before, rtol=0.1)


def test_cards_are_leaves_and_ground_and_walls_are_neither_leaf_nor_solid() -> None:
    card = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.2, 0], [0, 0.2, 0]], float)
    many = np.concatenate([card + [i, 0, 0] for i in range(100)])
    own = [[4 * i + k for k in face] for i in range(100) for face in ([0, 1, 2], [0, 2, 3])]
    cards, wall = surface(many, own), surface(card, [[0, 1, 2, 3]])
    assert cards.leaf.all()
    assert not (cards.solid.any() or wall.solid.any() or wall.leaf.any())
    assert cards.width == pytest.approx(0.09, abs=0.01)
    side = 20
    place = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1).reshape(-1, 2)
    height = mix(np.arange(side * side).astype(np.uint64)) / 2**64
    faces = [[i, i + side, i + side + 1, i + 1] for i in range(side * (side - 1)) if (i + 1) % side]
    ground = surface(np.c_[place, height].astype(float), faces)
    assert not (ground.leaf.any() or ground.solid.any())
    assert ground.width.min() > 10


@given(SEEDS)
@settings(deadline=None, max_examples=15)
def test_features_do_not_depend_on_the_unit(seed: int) -> None:
    one = thicket(seed, 20)
    _, _, width = mesh_features(1000 * one.positions, one.corner_verts, one.face_offsets)
    np.testing.assert_allclose(width, 1000 * one.width, rtol=1e-6)
    assert np.isfinite(width).all()
