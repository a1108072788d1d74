# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Splines as chains of points: where they run, and where one joins another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from tetflora_addon.species.skeletons import (
    Chains,
    bezier_chains,
    drawn_branches,
    joined_edges,
    nurbs_chain,
    skeleton_from_edges,
    smooth_handles,
)

PLAIN = {"cyclic": False, "endpoint": False, "bezier": False}


def _chains(*splines: list, cyclic: bool = False) -> Chains:
    parts = [np.array(s, dtype=float) for s in splines]
    first = np.cumsum([0] + [len(p) for p in parts])
    return Chains(np.concatenate(parts), first, np.full(len(parts), cyclic))


def _random(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, 4))


@given(st.integers(0, 10**6), st.integers(2, 9), st.integers(1, 12), st.booleans())
def test_smooth_splines_run_through_their_points(seed: int, count: int, steps: int, cyclic: bool) -> None:
    control = _chains(_random(seed, count), _random(seed + 1, count + 1), cyclic=cyclic)
    made = bezier_chains(control, *smooth_handles(control), np.array([steps, steps]))
    pieces = np.array([count, count + 1]) - (not cyclic)
    np.testing.assert_array_equal(np.diff(made.first), steps * pieces + (not cyclic))
    np.testing.assert_allclose(made.points[: made.first[1] : steps], control.points[:count], atol=1e-12)
    np.testing.assert_allclose(made.points[made.first[1] :: steps], control.points[count:], atol=1e-12)


def test_a_bezier_spline_is_the_cubic_of_its_handles() -> None:
    control = _chains([[0, 0, 0, 1], [1, 0, 0, 3]])
    left, right = np.array([[0, 0, 0], [1, 1, 0]]), np.array([[0, 1, 0], [1, 0, 0]])
    made = bezier_chains(control, left, right, np.array([2]))
    np.testing.assert_allclose(made.points, [[0, 0, 0, 1], [0.5, 0.75, 0, 2], [1, 0, 0, 3]])


@given(st.integers(0, 10**6), st.integers(2, 8), st.integers(2, 6), st.booleans(), st.booleans())
def test_nurbs_move_with_their_points_and_stay_among_them(
    seed: int, count: int, order: int, endpoint: bool, cyclic: bool
) -> None:
    control, weights = _random(seed, count), np.random.default_rng(seed).uniform(0.2, 3, count)
    made = nurbs_chain(control, weights, order, 4, endpoint=endpoint, cyclic=cyclic, bezier=False)
    turn = np.linalg.qr(_random(seed + 1, 4))[0]
    moved = nurbs_chain(control @ turn + 5, weights, order, 4, endpoint=endpoint, cyclic=cyclic, bezier=False)
    np.testing.assert_allclose(moved.points, made.points @ turn + 5, atol=1e-9)
    assert (made.points >= control.min(axis=0) - 1e-9).all() and (made.points <= control.max(axis=0) + 1e-9).all()
    if endpoint and not cyclic:
        np.testing.assert_allclose(made.points[[0, -1]], control[[0, -1]], atol=1e-12)


@pytest.mark.parametrize("count", [0, 1])
@pytest.mark.parametrize("flag", ["cyclic", "endpoint", "bezier"])
def test_a_nurbs_spline_of_one_point_is_that_point(count: int, flag: str) -> None:
    control = _random(5, count)
    made = nurbs_chain(control, np.ones(count), 4, 12, **{**PLAIN, flag: True})
    np.testing.assert_array_equal(made.points, control)
    np.testing.assert_array_equal(made.first, [0, count])


@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_nurbs_that_end_at_their_points_are_those_of_scipy(order: int) -> None:
    control, weights = _random(7, 9), np.random.default_rng(7).uniform(0.2, 3, 9)
    spans = np.arange(9 - order + 2)
    knots = np.concatenate([np.zeros(order - 1), spans, np.full(order - 1, spans[-1])])
    at = np.linspace(0.0, spans[-1], 5 * spans[-1] + 1)
    above, below = (BSpline(knots, of, order - 1)(at) for of in (control * weights[:, None], weights[:, None]))
    made = nurbs_chain(control, weights, order, 5, **{**PLAIN, "endpoint": True})
    np.testing.assert_allclose(made.points, above / below, atol=1e-9)


def test_a_nurbs_circle_is_round() -> None:
    """Nine points, weights 1 and √½, pieces of degree 2."""
    corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    control = np.array([(*c, 0, 1) for c in corners], dtype=float)
    weights = np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
    made = nurbs_chain(control, weights, 3, 6, endpoint=True, bezier=True, cyclic=False)
    assert len(made.points) == 25
    np.testing.assert_allclose(np.hypot(made.points[:, 0], made.points[:, 1]), 1, atol=1e-12)


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("off", [0.0, 0.15])
def test_a_spline_that_starts_on_another_is_its_branch(off: float, backwards: bool) -> None:
    """The start lies on the trunk's axis or in its wood, not at a point of it."""
    branch = [[off, 0, 3.3, 0.1], [2, 0, 4, 0.05]]
    chains = _chains([[0, 0, 0, 0.3], [0, 0, 5, 0.1], [0, 0, 10, 0.05]], branch[::-1] if backwards else branch)
    points, edges, line = joined_edges(chains)
    drawn = drawn_branches(skeleton_from_edges(points[:, :3], points[:, 3], edges, "form", line))
    np.testing.assert_array_equal(drawn.order, [0, 1])
    np.testing.assert_allclose(drawn.length[0], 10)
    np.testing.assert_allclose(drawn.insertion[1], 0.33)
    np.testing.assert_allclose(drawn.knots[drawn.first[1]], [0, 0, 3.3])


def test_several_splines_on_one_edge_and_on_each_other() -> None:
    heights = [7.0, 2.0, 5.0]
    splines = [[[0, 0, 0, 0.2], [0, 0, 10, 0.1]]]
    splines += [[[0, 0, z, 0.05], [3, 0, z, 0.02]] for z in heights]
    splines += [[[2, 0, 5, 0.02], [2, 2, 5, 0.01]]]
    points, edges, line = joined_edges(_chains(*splines))
    drawn = drawn_branches(skeleton_from_edges(points[:, :3], points[:, 3], edges, "form", line))
    np.testing.assert_array_equal(drawn.order, [0, 1, 1, 1, 2])
    np.testing.assert_allclose(np.sort(drawn.insertion[1:4]), [0.2, 0.5, 0.7])
    np.testing.assert_allclose(drawn.length[[0, 4]], [10, 2])
    np.testing.assert_allclose([drawn.insertion[4], drawn.outward[4]], [2 / 3, 2 / 3])


def test_a_trunk_drawn_in_one_stroke_stays_the_trunk() -> None:
    """Though the limb has more wood beyond the fork, and is thicker."""
    chains = _chains([[0, 0, 0, 0], [0, 0, 4, 0]], [[0, 0, 1, 0], [2, 0, 3, 0], [2, 0, 9, 0]])
    for radius in (0.0, 0.2):
        chains.points[2:, 3] = radius
        points, edges, line = joined_edges(chains)
        made = skeleton_from_edges(points[:, :3], points[:, 3], edges, "form", line)
        np.testing.assert_allclose(drawn_branches(made).length[0], 4)
        assert drawn_branches(skeleton_from_edges(points[:, :3], points[:, 3], edges, "form")).length[0] > 4


def test_a_spline_apart_stays_apart() -> None:
    chains = _chains([[0, 0, 0, 0.2], [0, 0, 10, 0.1]], [[0.5, 0, 0, 0.2], [0.5, 0, 8, 0.1]])
    points, edges, line = joined_edges(chains)
    np.testing.assert_array_equal(points, chains.points)
    np.testing.assert_array_equal(edges, [[0, 1], [2, 3]])
    np.testing.assert_array_equal(line, [0, 1])


def test_stems_from_one_place_are_joined_there() -> None:
    chains = _chains(*([[0.01 * i, 0, 0, 0.2], [i - 1, 0, 8, 0.1]] for i in range(3)))
    points, edges, line = joined_edges(chains)
    made = skeleton_from_edges(points[:, :3], points[:, 3], edges, "form", line)
    assert (made.parent < 0).sum() == 1 and len(drawn_branches(made)) == 3


def test_without_splines_there_are_no_edges() -> None:
    points, edges, line = joined_edges(Chains.concatenate([]))
    assert len(points) == len(edges) == len(line) == 0
