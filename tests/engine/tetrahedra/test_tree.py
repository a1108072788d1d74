# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tree of planes and its roots: nothing is lost, points are found, and nearer comes before farther."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine.support import contains
from tetflora_addon.camera.camera import Camera
from tetflora_addon.tetrahedra import geometry
from tetflora_addon.tetrahedra.roots import view_root
from tetflora_addon.tetrahedra.tree import TetrahedralTree

WINDOWS = {
    "middle": (-0.5, 0.5, -0.28, 0.28),
    "shifted": (-0.1, 0.9, -0.5, 0.06),
    "beside the axis": (0.2, 0.7, 0.1, 0.4),
}


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return q


def view(kind, window, seed, far=1000.0):
    rng = np.random.default_rng(seed)
    sides = np.array(WINDOWS[window]) * (1.0 if kind == "PERSP" else 20.0)
    camera = Camera(kind, rng.uniform(-30, 30, 3), rotation(rng), tuple(sides), 0.1, far, 640, 360)
    corner = rng.uniform(-60, 40, 3)
    bounds = np.array([corner, corner + rng.uniform(5, 60, 3)])
    return camera, bounds, rng


def split_at_random(tree, rng, rounds, fraction=0.4):
    for _ in range(rounds):
        nodes = tree.terminals()
        tree.split(nodes[rng.random(len(nodes)) < fraction])


CASES = given(
    st.sampled_from(["PERSP", "ORTHO"]),
    st.sampled_from(list(WINDOWS)),
    st.integers(0, 10**6),
    st.sampled_from([25.0, 1000.0]),
)


@CASES
@settings(deadline=None, max_examples=40)
def test_terminals_fill_the_root_and_keep_doing_so(kind, window, seed, far):
    camera, bounds, rng = view(kind, window, seed, far)
    tree = view_root(camera, bounds)
    vertices = tree.vertices(tree.terminals())
    local = camera.to_camera_space(vertices).reshape(-1, 3)
    box = np.prod(np.ptp(local, axis=0))
    np.testing.assert_allclose(geometry.signed_volume(vertices).sum(), box, rtol=1e-12)
    split_at_random(tree, rng, 6)
    volumes = geometry.signed_volume(tree.vertices(tree.terminals()))
    assert (volumes > 0).all()
    np.testing.assert_allclose(volumes.sum(), box, rtol=1e-12)


@CASES
@settings(deadline=None, max_examples=40)
def test_box_holds_scene_and_view(kind, window, seed, far):
    camera, bounds, rng = view(kind, window, seed, far)
    tree = view_root(camera, bounds)
    nodes = tree.terminals()
    local = camera.to_camera_space(tree.vertices(nodes)).reshape(-1, 3)
    low, high = local.min(axis=0), local.max(axis=0)
    corners = camera.to_camera_space(rng.uniform(*bounds, (500, 3)))
    assert (corners >= low).all() and (corners <= high).all()
    assert (low < 0).all() and high[2] > 0
    # A terminal is inside the view just when its center is seen.
    center = camera.to_camera_space(tree.vertices(nodes).mean(axis=1))
    at_one = center[:, :2] / (center[:, 2:] if kind == "PERSP" else 1.0)
    left, right, bottom, top = camera.window
    reach = camera.to_camera_space(tree.vertices(nodes[tree.inside[nodes]]))[..., 2].max()
    assert reach <= camera.far * (1 + 1e-12)
    seen = (center[:, 2] > 0) & (center[:, 2] < reach)
    seen &= (at_one >= (left, bottom)).all(axis=1) & (at_one <= (right, top)).all(axis=1)
    np.testing.assert_array_equal(tree.inside[nodes], seen)
    assert tree.inside[nodes].sum() == (2 if kind == "PERSP" else 6)


@CASES
@settings(deadline=None, max_examples=30)
def test_points_are_found_in_the_cell_that_holds_them(kind, window, seed, far):
    camera, bounds, rng = view(kind, window, seed, far)
    tree = view_root(camera, bounds)
    split_at_random(tree, rng, 5)
    points = rng.uniform(*bounds, (2000, 3))
    found = tree.locate(points)
    assert (tree.children[found] == -1).all()
    assert contains(tree.vertices(found), points, 1e-7).all()
    # Only one terminal holds the middle of a terminal.
    nodes = tree.terminals()
    np.testing.assert_array_equal(tree.locate(tree.vertices(nodes).mean(axis=1)), nodes)


@CASES
@settings(deadline=None, max_examples=15)
def test_ranks_rise_along_every_ray(kind, window, seed, far):
    camera, bounds, rng = view(kind, window, seed, far)
    tree = view_root(camera, bounds)
    split_at_random(tree, rng, 5)
    target = rng.uniform(*bounds, 3)
    for eye in (camera.position, rng.uniform(*bounds), rng.uniform(-300, 300, 3), None):
        if eye is None:
            direction = rng.normal(size=3)
            ranks = tree.order(direction=direction)
            starts = target - 200 * direction + rng.uniform(-20, 20, (30, 3))
            ends = starts + 400 * direction
        else:
            ranks = tree.order(eye)
            starts, ends = np.broadcast_to(eye, (30, 3)), rng.uniform(-100, 100, (30, 3)) + target
        nodes = tree.terminals()
        np.testing.assert_array_equal(np.sort(ranks[nodes]), np.arange(len(nodes)))
        assert (np.delete(ranks, nodes) == -1).all()
        steps = starts[:, None] + np.linspace(0, 1, 400)[:, None] * (ends - starts)[:, None]
        cells = tree.locate(steps.reshape(-1, 3))
        # Beyond the root's box there are no cells to be in order.
        held = contains(tree.vertices(cells), steps.reshape(-1, 3)).reshape(30, 400)
        along = np.where(held, ranks[cells].reshape(30, 400), -1)
        highest = np.maximum.accumulate(along, axis=1)
        assert (highest == along)[held].all()


def divide_at_random(tree, rng, rounds):
    """Both ways to divide, mixed; some nodes stay."""
    for _ in range(rounds):
        nodes = rng.permutation(tree.terminals())[:400]
        way = rng.integers(0, 3, len(nodes))
        tree.split(nodes[way == 0])
        tree.split_by_shape(nodes[way == 1])


@CASES
@settings(deadline=None, max_examples=15)
def test_any_division_fills_the_root_and_points_are_found(kind, window, seed, far):
    camera, bounds, rng = view(kind, window, seed, far)
    tree = view_root(camera, bounds)
    box = geometry.signed_volume(tree.vertices(tree.terminals())).sum()
    divide_at_random(tree, rng, 3)
    nodes = tree.terminals()
    volumes = geometry.signed_volume(tree.vertices(nodes))
    assert (volumes > 0).all()
    np.testing.assert_allclose(volumes.sum(), box, rtol=1e-12)
    assert tree.tetrahedra_made == (~np.isnan(tree.vertices(np.arange(len(tree)))[:, 0, 0])).sum()
    points = rng.uniform(*bounds, (2000, 3))
    found = tree.locate(points)
    weights = geometry.barycentric(tree.vertices(found), points)
    # Distance from the face that is passed most, meters: rounding of planes.
    heights = 1 / np.linalg.norm(geometry.barycentric_gradients(tree.vertices(found)), axis=-1)
    assert (weights * heights).min() > -1e-6
    thick = nodes[geometry.quality(tree.vertices(nodes)) > 1e-2]
    np.testing.assert_array_equal(tree.locate(tree.vertices(thick).mean(axis=1)), thick)
    # What is in view stays in view, whichever way it is divided.
    parents = tree.parent[1:]
    assert (tree.inside[1:][tree.inside[parents]]).all()


@CASES
@settings(deadline=None, max_examples=8)
def test_both_orders_are_exact_after_any_division(kind, window, seed, far):
    camera, bounds, rng = view(kind, window, seed, far)
    tree = view_root(camera, bounds)
    divide_at_random(tree, rng, 3)
    nodes = tree.terminals()
    corner = tree.vertices(nodes[0])[1]
    for eye in (camera.position, rng.uniform(*bounds), rng.uniform(-300, 300, 3), corner, None):
        if eye is None:
            how = {"direction": rng.normal(size=3)}
            starts = rng.uniform(*bounds, (30, 3)) - 200 * how["direction"]
            ends = starts + 400 * how["direction"]
        else:
            how = {"eye": eye}
            starts = np.broadcast_to(eye, (30, 3))
            ends = starts + 3 * (rng.uniform(*bounds, (30, 3)) - starts)
        ranks, reverse = tree.order(**how), tree.order(**how, back_to_front=True)
        np.testing.assert_array_equal(np.sort(ranks[nodes]), np.arange(len(nodes)))
        np.testing.assert_array_equal(reverse[nodes], len(nodes) - 1 - ranks[nodes])
        assert (np.delete(reverse, nodes) == -1).all()
        steps = starts[:, None] + np.linspace(0, 1, 300)[:, None] * (ends - starts)[:, None]
        cells = tree.locate(steps.reshape(-1, 3))
        held = (geometry.barycentric(tree.vertices(cells), steps.reshape(-1, 3)).min(axis=-1) > 1e-6).reshape(30, 300)
        along = np.where(held, ranks[cells].reshape(30, 300), -1)
        assert (np.maximum.accumulate(along, axis=1) == along)[held].all()
        back = np.where(held, reverse[cells].reshape(30, 300), len(nodes))
        assert (np.minimum.accumulate(back, axis=1) == back)[held].all()


def test_eight_hang_where_they_say():
    camera, bounds, _ = view("PERSP", "middle", 1)
    tree = view_root(camera, bounds)
    nodes = tree.terminals()
    of = np.concatenate([nodes[::3], nodes[1::3]])
    made = tree.split_by_shape(of)
    assert made.shape == (len(of), 8)
    np.testing.assert_array_equal(tree.parent[tree.parent[tree.parent[made]]], np.repeat(of[:, None], 8, axis=1))
    np.testing.assert_array_equal(tree.level[made], np.repeat(tree.level[of, None] + 3, 8, axis=1))
    np.testing.assert_array_equal(tree.inside[made[:, 0]], tree.inside[of])


def test_bisection_does_not_make_slivers():
    camera, bounds, _ = view("PERSP", "middle", 3)
    tree = view_root(camera, bounds)
    rng = np.random.default_rng(0)
    nodes = tree.terminals()[tree.inside[tree.terminals()]]
    worst = [geometry.quality(tree.vertices(nodes)).min()]
    for _ in range(30):
        # Samples of a growing family: all of its 30 generations would be 2^31 cells.
        nodes = tree.split(rng.permutation(nodes)[:2000]).ravel()
        worst.append(geometry.quality(tree.vertices(nodes)).min())
    assert min(worst) > 0.33, worst


def test_split_keeps_numbers_parents_and_the_view():
    camera, bounds, _ = view("PERSP", "middle", 1)
    tree = view_root(camera, bounds)
    before, made = tree.vertices(np.arange(len(tree))).copy(), tree.tetrahedra_made
    assert made == len(tree.terminals())
    nodes = tree.terminals()
    children = tree.split(nodes)
    assert tree.tetrahedra_made == made + children.size
    np.testing.assert_array_equal(tree.vertices(np.arange(len(before))), before)
    np.testing.assert_array_equal(tree.parent[children], np.repeat(nodes[:, None], 2, axis=1))
    np.testing.assert_array_equal(tree.children[nodes], children)
    np.testing.assert_array_equal(tree.inside[children[:, 0]], tree.inside[nodes])
    assert tree.levels == tree.level[children].max() + 1
    center = tree.vertices(children).mean(axis=2)
    side = geometry.plane_distance(tree.planes(nodes)[:, None], center)
    assert (side[:, 0] < 0).all() and (side[:, 1] > 0).all()


def test_only_terminal_tetrahedra_are_split_and_only_once():
    tree = TetrahedralTree()
    tree.place([0], np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]))
    assert len(tree) == tree.levels == 1
    assert tree.order([0, 0, 9]).tolist() == [0]
    assert tree.locate([[5, 5, 5]]).tolist() == [0]
    with pytest.raises(ValueError, match="only once"):
        tree.split([0, 0])
    assert tree.split(np.zeros(0, int)).shape == (0, 2)
    tree.split([0])
    with pytest.raises(ValueError, match="terminal"):
        tree.split([0])
    below = tree.terminals()[:1]
    with pytest.raises(ValueError, match="terminal"):
        tree.split_by_shape([0])
    with pytest.raises(ValueError, match="only once"):
        tree.split_by_shape(np.repeat(below, 2))
    with pytest.raises(ValueError, match="region"):
        TetrahedralTree().split_by_shape([0])
    assert tree.split_by_shape(np.zeros(0, int)).shape == (0, 8)
    with pytest.raises(ValueError, match="region"):
        TetrahedralTree().split([0])
    with pytest.raises(ValueError, match="eye or a direction"):
        tree.order()


def test_scene_behind_the_camera_and_points_without_extent():
    camera, _, _ = view("PERSP", "middle", 5)
    behind = camera.position + camera.frame[:, 2] * 20
    tree = view_root(camera, np.array([behind, behind]))
    assert not tree.inside[tree.locate(behind)].any()
    assert (geometry.signed_volume(tree.vertices(tree.terminals())) > 0).all()
    with pytest.raises(ValueError, match="finite"):
        view_root(camera, np.array([[0, 0, 0], [np.inf, 1, 1]]))
