# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The anchored root: it holds the scene, has few shapes, and is the same for every camera."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.refinement.test_loop import check, run
from tetflora_addon.refinement.decisions import ACROSS_THE_BORDER, Decision
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.tetrahedra.geometry import quality, volume
from tetflora_addon.tetrahedra.roots import _world_cubes, world_root
from tetflora_addon.tetrahedra.tree import TetrahedralTree

corners = st.tuples(*[st.floats(-3000, 3000, allow_subnormal=False)] * 3)


@given(corners, st.tuples(*[st.floats(0.01, 900)] * 3))
@example((-1e-17, 0.0, 0.0), (float(np.nextafter(64.0, 65.0)), 1.0, 1.0))
@example((0.0, 0.0, 0.0), (64.0, 1.0, 1.0))
@settings(deadline=None, max_examples=40)
def test_the_root_fills_cubes_around_the_scene(low: tuple, size: tuple) -> None:
    bounds = np.array([low, np.add(low, size)])
    side, first, number = _world_cubes(bounds)
    assert np.log2(side) % 1 == 0
    assert np.isin(number, [1, 2]).all()
    assert (first * side <= bounds[0]).all()
    assert ((first + number) * side >= bounds[1]).all()
    tree = world_root(bounds)
    terminals = tree.terminals()
    vertices = tree.vertices(terminals)
    assert len(terminals) == 6 * number.prod() == tree.tetrahedra_made
    assert volume(vertices) == pytest.approx(side**3 / 6)
    assert not tree.inside.any()
    points = np.random.default_rng(1).uniform(*bounds, (200, 3))
    assert support.contains(tree.vertices(tree.locate(points)), points).all()


def test_bisection_makes_three_shapes_that_fit_face_to_face() -> None:
    tree = world_root([[-3, 2, 0], [5, 9, 6]])
    shapes = []
    for _ in range(9):
        tree.split(tree.terminals())
        shapes.append(quality(tree.vertices(tree.terminals())))
    assert len(np.unique(np.round(np.concatenate(shapes), 9))) == 3
    assert np.concatenate(shapes).min() > 0.6
    # Each face belongs to two tetrahedra with the same corners, or lies on the boundary.
    vertices = tree.vertices(tree.terminals())
    faces = vertices[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3, 3)
    order = np.lexsort((faces[..., 2], faces[..., 1], faces[..., 0]), axis=1)
    faces = np.take_along_axis(faces, order[..., None], axis=1).reshape(-1, 9)
    found, number = np.unique(faces, axis=0, return_counts=True)
    assert number.max() == 2
    once = found[number == 1].reshape(-1, 3, 3)
    flat = (once == once[:, :1]).all(axis=1)
    assert flat.any(axis=1).all()


def test_small_changes_of_the_scene_do_not_move_it() -> None:
    one, other = world_root([[1, 2, 0], [60, 50, 9]]), world_root([[1.7, 2.2, -0.0], [58, 55, 12]])
    assert np.array_equal(one.vertices(one.terminals()), other.vertices(other.terminals()))


def test_cubes_are_those_of_the_world_wherever_coordinates_begin() -> None:
    bounds, origin = np.array([[3000.0, 2, 0], [5300, 9, 6]]), np.array([3072.0, 0, -1024])
    one, other = world_root(bounds), world_root(bounds - origin, origin)
    for tree in (one, other):
        tree.split(tree.terminals())
    assert np.array_equal(one.vertices(one.terminals()) - origin, other.vertices(other.terminals()))
    points = np.random.default_rng(2).uniform(*bounds, (200, 3))
    assert np.array_equal(one.locate(points), other.locate(points - origin))


@pytest.mark.parametrize("bounds", [np.full((2, 3), np.nan), [[0, 0, 0], [1, 1, np.inf]]])
def test_bounds_that_are_no_numbers_are_refused(bounds: np.ndarray) -> None:
    with pytest.raises(ValueError, match="finite"):
        world_root(bounds)


def _paths(tree: TetrahedralTree) -> dict[tuple[bytes, ...], int]:
    """Nodes by their tetrahedron."""
    nodes = np.flatnonzero(np.isfinite(tree.vertices(np.arange(len(tree)))[:, 0, 0]))
    return {tree.vertices(n).tobytes(): int(n) for n in nodes}


def test_two_cameras_divide_the_same_space_alike() -> None:
    """Nodes of the same place have the same tetrahedra and planes to the last bit, up to the root."""
    flora, seeds = support.small_flora(), support.grove(9, 2.0)
    eyes = ((0, -14, 3), (0.4, -13.2, 3.1))
    trees = [run(flora, seeds, support.camera(eye, (0, 0, 1.5), pixels=256), anchored=True)[1].tree for eye in eyes]
    one, other = (_paths(tree) for tree in trees)
    common = [(one[place], other[place]) for place in one.keys() & other.keys()]
    # Most is common; where one goes deeper, its pieces are within those of the other.
    assert len(common) > 0.5 * len(one)
    a, b = np.array(common).T
    divided = (trees[0].children[a, 0] >= 0) & (trees[1].children[b, 0] >= 0)
    assert divided.any()
    assert np.array_equal(trees[0].planes(a[divided]), trees[1].planes(b[divided]))
    place_of = {node: place for place, node in other.items()}
    for x, y in common:
        up, also = trees[0].parent[x], trees[1].parent[y]
        both = trees[0].vertices(up), trees[1].vertices(also)
        assert np.array_equal(*both, equal_nan=True)
        assert np.array_equal(trees[0].planes(up), trees[1].planes(also))
        assert also not in place_of or place_of[also] in one


def test_what_is_beside_the_view_is_coarse_and_what_is_in_it_fine() -> None:
    """A row across the border of the view: nothing that is seen is hidden, little that is not becomes polygons."""
    flora = support.small_flora()
    seeds = support.plants(np.arange(30), position=[(x, 0.0, 0.0) for x in np.linspace(0, 60, 30)])
    camera = support.camera((0, -12, 1.5), (0, 0, 1.5), pixels=512)
    result = run(flora, seeds, camera, anchored=True)[1]
    check(flora, seeds, result)
    middle = result.tree.vertices(result.nodes).mean(axis=1)
    distance_to_view = camera.widened(0.04).distance_to_view(middle)
    explicit = result.decision == Decision.EXPLICIT
    assert explicit.any()
    many = result.totals.polygons > RefinementSettings().few_polygons
    wide = ACROSS_THE_BORDER * RefinementSettings().block * camera.extent_around(middle)
    assert (distance_to_view[explicit & many] <= wide[explicit & many]).all()
    assert (result.decision[many & (distance_to_view > 20)] == Decision.HIDDEN).all()
    assert result.in_view[result.nodes[explicit]].all()


def test_the_view_is_as_with_its_own_root() -> None:
    """What is made of both roots differs by little more than by where space is divided."""
    flora, seeds = support.small_flora(), support.grove(16, 2.0)
    camera = support.camera((0, -14, 3), (0, 0, 1.5), pixels=400)
    own, anchored = (run(flora, seeds, camera, anchored=flag)[1] for flag in (False, True))
    polygons = [r.totals.polygons[r.decision == Decision.EXPLICIT].sum() for r in (own, anchored)]
    assert polygons[1] == pytest.approx(polygons[0], rel=0.3)
