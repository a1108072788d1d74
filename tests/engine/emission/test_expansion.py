# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of expanded plants are known before they are made, near a camera as well as far from it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.emission.expansion import expanded_faces
from tetflora_addon.emission.plants import expanded_blocks


@pytest.mark.parametrize("name", ["bush", "birch"])
@pytest.mark.parametrize("depth", [1.0, 6.0, 60.0])
def test_near_plants_count_as_they_are_made(name: str, depth: float) -> None:
    flora = support.compiled(support.shipped(name))
    seeds = support.plants(np.arange(2), np.zeros(2, int), np.array([[0.0, depth, 0.0], [1.0, depth + 4.0, 0.0]]))
    camera = support.camera((0, 0, 1.7), (0, 60, 3.0), pixels=320, view=1.0)
    expected = list(expanded_faces(flora, seeds, camera))
    made = sum(len(block.buffers.face_offsets) - 1 for block in expanded_blocks(flora, seeds, camera))
    assert expected == sorted(expected)
    assert expected[-1] == pytest.approx(made, rel=0.15)
    if depth == 1.0:
        assert expected[-1] > 1.5 * expected[0]


def test_of_many_plants_some_tell() -> None:
    flora, camera = support.compiled(support.shipped("bush")), support.camera((0, 0, 1.7), (0, 60, 1.7), pixels=960)
    place = np.zeros((200, 3))
    place[:, 1] = np.linspace(1.0, 30.0, 200)
    expected = list(expanded_faces(flora, support.plants(np.arange(200), np.zeros(200, int), place), camera))
    made = 0
    for one in range(0, 200, 20):
        seeds = support.plants([one], [0], place[one : one + 1])
        made += 20 * sum(len(block.buffers.face_offsets) - 1 for block in expanded_blocks(flora, seeds, camera))
    assert len(expected) < 60
    assert expected[-1] == pytest.approx(made, rel=0.5)
