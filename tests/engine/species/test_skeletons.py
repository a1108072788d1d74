# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Skeletons that artists draw: what any graph of edges becomes, and what any tree is split into."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.errors import SpeciesError
from tetflora_addon.growth.rows import MAX_SEGMENTS, drawn_lines
from tetflora_addon.species.skeletons import MAX_ORDERS, DrawnBranches, Skeleton, drawn_branches, skeleton_from_edges


def _random_tree(points: int, roots: int, bushy: float, seed: int) -> Skeleton:
    """Points that grow on the one before, or on any before where ``bushy`` says so; some with equal radii."""
    rng = np.random.default_rng(seed)
    parent = [int(rng.integers(0, i)) if i > 1 and rng.random() < bushy else i - 1 for i in range(points)]
    parent[:roots] = [-1] * roots
    place = rng.normal(size=(points, 3)) + [0, 0, 1]
    for i in range(roots, points):
        place[i] += place[parent[i]]
    radius = np.ones(points) if seed % 3 == 0 else rng.random(points)
    return Skeleton(place, radius, np.array(parent))


trees = st.builds(
    _random_tree, st.integers(4, 90), st.integers(1, 3), st.sampled_from([0.0, 0.1, 0.5, 1.0]), st.integers(0, 10**6)
)
several = settings(max_examples=60, deadline=None)


def _edges(skeleton: Skeleton) -> np.ndarray:
    child = np.flatnonzero(skeleton.parent >= 0)
    return np.stack([skeleton.parent[child], child], axis=1)


def _chains(drawn: DrawnBranches) -> list[np.ndarray]:
    return np.split(drawn.knots, drawn.first[1:-1])


def _length(chain: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum())


def _sorted_rows(array: np.ndarray) -> np.ndarray:
    rows = array.reshape(len(array), -1)
    return rows[np.lexsort(rows.T)]


def _point_at(chain: np.ndarray, fraction: float) -> np.ndarray:
    """Where a fraction of a chain's length is behind."""
    arc = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))])
    return np.array([np.interp(fraction * arc[-1], arc, column) for column in chain.T])


def _check_structure(drawn: DrawnBranches) -> None:
    """What holds for branches of any skeleton."""
    child = np.flatnonzero(drawn.parent >= 0)
    chains = _chains(drawn)
    assert (np.diff(drawn.order) >= 0).all()
    assert (drawn.parent < np.arange(len(drawn))).all()
    assert ((drawn.order == 0) == (drawn.parent < 0)).all()
    assert (drawn.order[child] == np.minimum(drawn.order[drawn.parent[child]] + 1, MAX_ORDERS - 1)).all()
    assert (np.diff(drawn.first) >= 2).all() and drawn.first[-1] == len(drawn.knots) == len(drawn.radius)
    np.testing.assert_allclose(drawn.length, [_length(chain) for chain in chains], rtol=1e-9)
    leaves = [_point_at(chains[drawn.parent[b]], drawn.insertion[b]) for b in child]
    np.testing.assert_allclose(drawn.knots[drawn.first[child]], np.reshape(leaves, (-1, 3)), atol=1e-6)
    for b in range(len(drawn)):
        line = [b]
        while drawn.parent[line[-1]] >= 0:
            line.append(int(drawn.parent[line[-1]]))
        assert drawn.outward[b] == (drawn.insertion[line[-3]] if len(line) > 2 else 0.0)


def _axes_one_by_one(skeleton: Skeleton) -> list[list[int]]:
    """The same branches, followed by hand from the roots: thickest child first, then the one that leads farthest."""
    points, parent = skeleton.points, skeleton.parent
    children = [np.flatnonzero(parent == i) for i in range(len(points))]
    reach = np.zeros(len(points))
    for i in range(len(points))[::-1]:
        reach[i] = max((reach[c] + np.linalg.norm(points[c] - points[i]) for c in children[i]), default=0.0)
    found, todo = [], [[int(r)] for r in np.flatnonzero(parent < 0)]
    while todo:
        chain = todo.pop()
        while len(here := children[chain[-1]]):
            far = reach[here] + np.linalg.norm(points[here] - points[chain[-1]], axis=1)
            best = here[np.lexsort((-far, -skeleton.radius[here]))]
            todo += [[chain[-1], int(c)] for c in best[1:]]
            chain.append(int(best[0]))
        found.append(chain)
    return [chain for chain in found if len(chain) > 1]


@several
@given(trees)
def test_every_edge_is_in_one_branch_and_nothing_is_added(skeleton: Skeleton) -> None:
    drawn = drawn_branches(skeleton)
    pieces = [np.stack([chain[:-1], chain[1:]], axis=1) for chain in _chains(drawn)]
    np.testing.assert_array_equal(_sorted_rows(np.concatenate(pieces)), _sorted_rows(skeleton.points[_edges(skeleton)]))


@several
@given(trees)
def test_structure(skeleton: Skeleton) -> None:
    _check_structure(drawn_branches(skeleton))


@several
@given(trees)
def test_the_thickest_goes_on(skeleton: Skeleton) -> None:
    chains = {tuple(chain.ravel()) for chain in _chains(drawn_branches(skeleton))}
    assert chains == {tuple(skeleton.points[chain].ravel()) for chain in _axes_one_by_one(skeleton)}


@several
@given(trees)
def test_radii_stay_on_their_points_and_at_forks_below_the_parent(skeleton: Skeleton) -> None:
    drawn = drawn_branches(skeleton)
    given_at = {tuple(p): r for p, r in zip(skeleton.points, skeleton.radius, strict=True)}
    at_points = np.array([given_at[tuple(knot)] for knot in drawn.knots])
    base = drawn.first[:-1][drawn.parent >= 0]
    inner = np.setdiff1d(np.arange(len(at_points)), base)
    np.testing.assert_array_equal(drawn.radius[inner], at_points[inner])
    assert (drawn.radius[base] <= np.maximum(at_points[base], drawn.radius[base + 1])).all()
    assert (drawn.radius[base] >= np.minimum(at_points[base], drawn.radius[base + 1])).all()


@several
@given(trees, st.integers(0, 10**6))
def test_numbering_and_direction_of_edges_do_not_matter(skeleton: Skeleton, seed: int) -> None:
    rng = np.random.default_rng(seed)
    plain = skeleton_from_edges(skeleton.points, skeleton.radius, _edges(skeleton), "form")
    moved = rng.permutation(len(skeleton.points))
    points, radius = np.zeros_like(skeleton.points), np.zeros_like(skeleton.radius)
    points[moved], radius[moved] = skeleton.points, skeleton.radius
    edges = rng.permuted(rng.permutation(moved[_edges(skeleton)]), axis=1)
    other = skeleton_from_edges(points, radius, edges, "form")
    ways = [s.points[_edges(s)] for s in (plain, other)]
    np.testing.assert_array_equal(*(_sorted_rows(w) for w in ways))


@several
@given(trees)
def test_roots_are_the_lowest_ends(skeleton: Skeleton) -> None:
    points = skeleton.points + [0, 0, 1e6]  # far from the origin
    made = skeleton_from_edges(points, skeleton.radius, _edges(skeleton), "form")
    degree = np.bincount(_edges(made).ravel(), minlength=len(made.points))
    part = np.arange(len(made.points))
    for i in np.flatnonzero(made.parent >= 0):
        part[i] = part[made.parent[i]]
    assert (made.parent < 0).any()
    for root in np.flatnonzero(made.parent < 0):
        ends = np.flatnonzero((part == root) & (degree == 1))
        assert degree[root] == 1 and made.points[root, 2] == made.points[ends, 2].min()


@several
@given(trees)
def test_an_end_or_fork_at_the_origin_is_a_root(skeleton: Skeleton) -> None:
    edges = _edges(skeleton)
    degree = np.bincount(edges.ravel(), minlength=len(skeleton.points))
    foot = int(np.flatnonzero((degree > 0) & (degree != 2))[-1])
    made = skeleton_from_edges(skeleton.points - skeleton.points[foot], skeleton.radius, edges, "form")
    assert (made.points[made.parent < 0] == 0).all(axis=1).any()


@several
@given(trees, st.integers(1, 20), st.integers(0, 10**6))
def test_loops_are_cut_and_double_points_become_one(skeleton: Skeleton, loops: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    edges = _edges(skeleton)
    plain = skeleton_from_edges(skeleton.points, skeleton.radius, edges, "form")
    # Each edge with ends of its own, as exporters write them, off by rounding; and lone points besides.
    loose = skeleton.points[edges].reshape(-1, 3)
    loose = loose + rng.uniform(-1e-9, 1e-9, loose.shape)
    joined = skeleton_from_edges(
        np.concatenate([loose, skeleton.points]),
        np.concatenate([skeleton.radius[edges].ravel(), skeleton.radius]),
        np.arange(len(loose)).reshape(-1, 2),
        "form",
    )
    assert len(joined.points) == len(plain.points) and (joined.parent < 0).sum() == (plain.parent < 0).sum()
    # The first of a hundred more edges between points of one part.
    part = np.arange(len(plain.points))
    for i in np.flatnonzero(plain.parent >= 0):
        part[i] = part[plain.parent[i]]
    more = rng.integers(0, len(part), (100, 2))
    more = more[part[more[:, 0]] == part[more[:, 1]]][:loops]
    ringed = skeleton_from_edges(plain.points, plain.radius, np.concatenate([_edges(plain), more]), "form")
    assert len(ringed.points) == len(plain.points) and (ringed.parent < 0).sum() == (plain.parent < 0).sum()


def test_a_ring_has_its_lowest_point_for_a_root() -> None:
    turn = np.arange(12) * np.pi / 6
    points = np.stack([np.sin(turn), 0 * turn, 5 + np.cos(turn)], axis=1)
    made = skeleton_from_edges(points, None, np.stack([np.arange(12), (np.arange(12) + 1) % 12], axis=1), "form")
    np.testing.assert_allclose(made.points[0], [0, 0, 4], atol=1e-12)
    assert (made.parent < 0).sum() == 1 and len(drawn_branches(made)) == 2


@several
@given(trees, st.booleans())
def test_missing_radii_let_cross_sections_add_up(skeleton: Skeleton, zeros: bool) -> None:
    none = np.zeros(len(skeleton.points)) if zeros else None
    made = skeleton_from_edges(skeleton.points, none, _edges(skeleton), "form")
    child = np.flatnonzero(made.parent >= 0)
    below, area = made.parent[child], made.radius**2
    step = np.linalg.norm(made.points[child] - made.points[below], axis=1)
    above = np.bincount(below, weights=area[child], minlength=len(area))
    wood = np.bincount(below, weights=step, minlength=len(area))
    inner = wood > 0
    ratio = (area - above)[inner] / wood[inner]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    assert (made.radius > 0).all() and (made.radius[child] < made.radius[below]).all()


def test_missing_radii_of_a_stem() -> None:
    made = skeleton_from_edges([[0, 0, 0], [0, 0, 5], [0, 0, 10]], None, [[0, 1], [1, 2]], "form")
    np.testing.assert_allclose(made.radius, 0.25 * np.sqrt([1, 5.1 / 10.1, 0.1 / 10.1]))


def test_orders_of_a_tree_that_forks_at_known_places() -> None:
    """A trunk of 4 m, a limb halfway up, on which a branch sits at a quarter, on which a twig sits in the middle."""
    points = [[0, 0, 0], [0, 0, 2], [0, 0, 4], [1, 0, 2], [4, 0, 2], [1, 1, 2], [1, 2, 2], [1, 1, 3]]
    edges = [[0, 1], [1, 2], [1, 3], [3, 4], [3, 5], [5, 6], [5, 7]]
    radius = [1, 0.9, 0.8, 0.5, 0.4, 0.2, 0.2, 0.1]
    drawn = drawn_branches(skeleton_from_edges(points, radius, edges, "form"))
    np.testing.assert_array_equal(drawn.order, [0, 1, 2, 3])
    np.testing.assert_array_equal(drawn.parent, [-1, 0, 1, 2])
    np.testing.assert_allclose(drawn.length, [4, 4, 2, 1])
    np.testing.assert_allclose(drawn.insertion, [0, 0.5, 0.25, 0.5])
    np.testing.assert_allclose(drawn.outward, [0, 0, 0.25, 0.25])
    # The limb tapers by .1 in 3 m, so it had .533 a meter before; one straight piece keeps its radius.
    np.testing.assert_allclose(drawn.radius[drawn.first[:-1]], [1, 0.5 + 0.1 / 3, 0.2, 0.1])


def test_of_several_stems_the_largest_is_the_first() -> None:
    points = np.array([[x, 0, z] for x, top in ((0, 1), (1, 3), (2, 2)) for z in (0, top)], dtype=float)
    drawn = drawn_branches(skeleton_from_edges(points, None, [[0, 1], [2, 3], [4, 5]], "form"))
    np.testing.assert_array_equal(drawn.order, [0, 0, 0])
    assert drawn.length[0] == 3


@several
@given(trees)
def test_even_lines_keep_ends(skeleton: Skeleton) -> None:
    drawn = drawn_branches(skeleton)
    lines = drawn_lines(drawn)
    each = np.arange(len(drawn))
    assert lines.segments.max() <= MAX_SEGMENTS
    np.testing.assert_array_equal(lines.order, drawn.order)
    for at, of in ((0, drawn.first[:-1]), (lines.segments, drawn.first[1:] - 1)):
        np.testing.assert_allclose(lines.knots[each, at], drawn.knots[of], atol=1e-9)
        np.testing.assert_allclose(lines.radii[each, at], np.maximum(drawn.radius[of], 1e-6), atol=1e-9)
    assert (lines.length <= drawn.length * (1 + 1e-9)).all()


def test_even_lines_keep_the_shape_of_a_fine_curve() -> None:
    turn = np.linspace(0, 4, 400)
    spiral = np.stack([np.cos(turn), np.sin(turn), turn], axis=1)
    radius = np.linspace(0.2, 0.1, 400)
    fine = drawn_branches(skeleton_from_edges(spiral, radius, np.stack([np.arange(399), np.arange(1, 400)], 1), "form"))
    coarse = drawn_lines(fine)
    where = np.array([_point_at(coarse.knots[0], fraction) for fraction in np.linspace(0, 1, 400)])
    # An arc of 1/24 of 4 rad bulges by 1 - cos(1/12) = .0035.
    assert np.linalg.norm(where - fine.knots, axis=1).max() < 0.006
    assert abs(coarse.length[0] / fine.length[0] - 1) < 0.002
    np.testing.assert_allclose(np.interp(coarse.knots[0, :, 2], turn, radius), coarse.radii[0], atol=1e-9)


def test_even_lines_of_a_straight_stem_are_even() -> None:
    z = np.arange(101.0)
    stem = skeleton_from_edges(
        np.stack([0 * z, 0 * z, z], 1), None, np.stack([np.arange(100), np.arange(1, 101)], 1), ""
    )
    evenly = Skeleton(stem.points, np.ones(101), stem.parent)
    pieces = np.diff(drawn_lines(drawn_branches(evenly)).knots[0, :, 2])
    assert len(pieces) == MAX_SEGMENTS and pieces.max() < 2.2 * pieces.min()


def test_skeletons_are_equal_by_content_and_cannot_be_changed() -> None:
    one, same, other = _random_tree(20, 1, 0.2, 1), _random_tree(20, 1, 0.2, 1), _random_tree(20, 1, 0.2, 2)
    assert one == same and hash(one) == hash(same) and one != other and one != "tree"
    with pytest.raises(ValueError, match="read-only"):
        one.points[0] = 1.0


@pytest.mark.parametrize("parent", [[0, -1], [-1, 1], [-2, 0], [-1]])
def test_a_parent_stands_before_its_child(parent: list[int]) -> None:
    with pytest.raises(ValueError, match="skeleton"):
        Skeleton(np.zeros((2, 3)), np.zeros(2), np.array(parent))


_TWO = [[0, 0, 0], [0, 0, 1]]


@pytest.mark.parametrize(
    ("points", "radius", "edges", "message"),
    [
        (_TWO, None, np.zeros((0, 2)), "no edges"),
        (_TWO, None, [[0, 0]], "no length"),
        ([[0, 0, 1], [0, 0, 1]], None, [[0, 1]], "no length"),
        ([[0, 0, 0], [0, 0, np.nan]], None, [[0, 1]], "invalid position or radius"),
        (_TWO, [1, np.inf], [[0, 1]], "invalid position or radius"),
        (_TWO, [1, -1], [[0, 1]], "invalid position or radius"),
        (_TWO, None, [[0, 2]], "do not match"),
        (_TWO, [1], [[0, 1]], "do not match"),
        (np.zeros((200_001, 3)), None, np.stack([np.arange(200_000), np.arange(1, 200_001)], 1), "200,001 points"),
    ],
)
def test_what_cannot_be_a_form_is_named(points: list, radius: list | None, edges: list, message: str) -> None:
    with pytest.raises(SpeciesError, match=f'"Old oak".*{message}'):
        skeleton_from_edges(points, radius, edges, "Old oak")
