# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Points, lines and polygons in the plane, against brute force."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine.planting.test_planting import SIZE, _gaps, _hills, _inside, _least_gap
from tetflora_addon.planting import plane
from tetflora_addon.planting.plane import Neighbors, Spacing, border_of


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), distance=st.floats(0.05, 4.0), least=st.integers(1, 3))
def test_neighbors_are_those_of_brute_force(seed, distance, least):
    rng = np.random.default_rng(seed)
    points, others = rng.uniform(-5, 5, (80, 2)), rng.uniform(-5, 5, (60, 2)) * rng.random((60, 1))
    expected = (_gaps(points, others) < distance).sum(axis=1) >= least
    assert np.array_equal(Neighbors(others, distance).near(points, least), expected)
    kept = points[Spacing(distance, others).admit(points, 50)]
    assert (_gaps(kept, others) >= distance).all() and _least_gap(kept) >= distance


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), longest=st.floats(0.1, 30.0))
def test_lines_are_as_near_as_by_brute_force(seed, longest):
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, 20.0, (30, 2))
    end, reach = start + rng.uniform(-longest, longest, (30, 2)), rng.uniform(0.1, 5.0, 30)
    points = rng.uniform(-10.0, 30.0, (200, 2))
    along = end - start
    fraction = np.clip(((points[:, None] - start) * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    gap = np.linalg.norm(points[:, None] - start - fraction[..., None] * along, axis=-1)
    expected = np.minimum((gap / reach).min(axis=1), 1.0)
    assert np.allclose(plane.Lines(start, end, reach).nearness(points), expected, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), corners=st.integers(3, 300))
def test_insides_of_polygons(seed, corners):
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    polygon = rng.uniform(1.0, 5.0, corners)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = rng.uniform(-5.0, 5.0, (300, 2))
    assert np.array_equal(plane.inside_any(points, [polygon]), _inside(points, polygon))


def test_the_border_is_where_the_ground_ends():
    border = border_of(np.concatenate([_hills(0), _hills(0)[:0]]))
    assert len(border) == 4 * 12
    outer = (border[..., :2] == 0.0) | (border[..., :2] == SIZE)
    assert outer.all(axis=1).any(axis=1).all()
