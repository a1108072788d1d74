# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of expanded plants are known before they are made, near a camera as well as far from it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.emission.budget import expanded_faces
from tetflora_addon.emission.plants import Block, expanded_blocks


def counted(blocks: Iterable[Block]) -> np.ndarray:
    """Polygons and triangles (2,) of blocks."""
    every = [(b.buffers.polygons, len(b.buffers.corner_verts) - 2 * b.buffers.polygons) for b in blocks]
    return np.sum(every, axis=0)


@pytest.mark.parametrize(("name", "depth"), [("bush", 1.0), ("bush", 6.0), ("birch", 1.0), ("birch", 60.0)])
def test_near_plants_count_as_they_are_made(name: str, depth: float) -> None:
    flora = support.compiled(support.shipped(name))
    seeds = support.plants(np.arange(2), np.zeros(2, int), np.array([[0.0, depth, 0.0], [1.0, depth + 4.0, 0.0]]))
    camera = support.camera((0, 0, 1.7), (0, 60, 3.0), pixels=320, view=1.0)
    expected = np.array(list(expanded_faces(flora, seeds, camera)))
    assert (np.diff(expected, axis=0) >= 0.0).all()
    np.testing.assert_allclose(expected[-1], counted(expanded_blocks(flora, seeds, camera)), rtol=0.15)
    if depth == 1.0:
        assert (expected[-1] > 1.3 * expected[0]).all()


def test_of_many_plants_some_tell() -> None:
    flora, camera = support.compiled(support.shipped("bush")), support.camera((0, 0, 1.7), (0, 60, 1.7), pixels=960)
    place = np.zeros((200, 3))
    place[:, 1] = np.linspace(1.0, 30.0, 200)
    expected = list(expanded_faces(flora, support.plants(np.arange(200), np.zeros(200, int), place), camera))
    made = np.zeros(2)
    for one in range(0, 200, 20):
        made += 20 * counted(expanded_blocks(flora, support.plants([one], [0], place[one : one + 1]), camera))
    assert len(expected) < 60
    np.testing.assert_allclose(expected[-1], made, rtol=0.5)
