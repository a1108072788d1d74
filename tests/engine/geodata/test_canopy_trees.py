# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees from canopy heights: each crown that stands by itself is one, where it stands and as large as it is."""

from __future__ import annotations

import numpy as np
import pytest

from tetflora_addon.geodata.canopy import find_trees
from tetflora_addon.jobs import run_to_end

_CELL = 0.5


def _canopy(trees, size=60.0, squeeze=1.0):
    """Round crowns as paraboloids: x, y, height and width in meters; the ground is 0."""
    along = (np.arange(int(size / _CELL)) + 0.5) * _CELL
    x, y = np.meshgrid(along, along)
    out = np.zeros_like(x)
    for east, south, height, width in trees:
        off = np.hypot((x - east) * squeeze, y - south) / (width / 2.0)
        out = np.maximum(out, np.where(off < 1.0, height * (1.0 - 0.5 * off**2), 0.0))
    return out.astype(np.float32)


_GROVE = [(10.0 + 12.0 * i, 10.0 + 12.0 * j, 12.0 + 1.5 * i + j, 6.0 + i) for i in range(4) for j in range(4)]


def test_crowns_by_themselves():
    found = run_to_end(find_trees(_canopy(_GROVE), _CELL, 2.0))
    assert len(found.height) == len(_GROVE)
    place = (np.stack([found.column, found.row], axis=1) + 0.5) * _CELL
    given = np.array(_GROVE)
    nearest = np.linalg.norm(place[:, None] - given[None, :, :2], axis=2).argmin(axis=1)
    assert sorted(nearest) == list(range(len(_GROVE)))
    assert np.abs(place - given[nearest, :2]).max() <= _CELL
    assert found.height == pytest.approx(given[nearest, 2], rel=0.01)
    assert found.width == pytest.approx(given[nearest, 3], rel=0.08)
    assert np.abs(found.offset).max() < 0.15


def test_flat_tops_twins_and_gaps_are_no_trees():
    """A plateau is one tree, a second summit within a crown none; what nobody knows and what is low does not count."""
    canopy = np.zeros((80, 80), np.float32)
    canopy[10:20, 10:20] = 15.0
    canopy[50:58, 50:58], canopy[53, 51], canopy[53, 56] = 17.0, 18.0, 18.5
    canopy[60:70, 10:20], canopy[30, 30] = np.nan, 1.5
    found = run_to_end(find_trees(canopy, _CELL, 2.0))
    assert found.height.tolist() == [15.0, 18.5]


def test_a_crown_beside_its_top_has_an_offset():
    canopy = _canopy([(30.0, 30.0, 20.0, 8.0)])
    low = _canopy([(33.0, 30.0, 12.0, 8.0)])
    found = run_to_end(find_trees(np.maximum(canopy, low), _CELL, 2.0))
    assert len(found.height) == 1
    assert found.offset[0, 0] > 0.1
    assert abs(found.offset[0, 1]) < 0.08


def test_nothing_high_is_nothing():
    assert len(run_to_end(find_trees(np.ones((5, 5), np.float32), 1.0, 2.0)).height) == 0
