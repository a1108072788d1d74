# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Projected tetrahedra: silhouettes, thickness and images against rays; and the levels they are taken from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.camera.camera import Camera
from tetflora_addon.growth.growth import trunks
from tetflora_addon.preview import levels, light_plants
from tetflora_addon.preview.levels import THICK, Projected, drawable, project
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import refine
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.tetrahedra.geometry import projected_area, signed_volume, volume
from tetflora_addon.tetrahedra.tree import TetrahedralTree

ORTHO = support.camera((0.0, -9.0, 1.0), (0.0, 0.0, 0.5), kind="ORTHO", view=6.0)
PERSP = support.camera((1.0, -9.0, 1.0), (0.0, 0.0, 0.5), view=0.6)


def tetrahedra(seed: int, number: int = 60) -> np.ndarray:
    vertices = np.random.default_rng(seed).uniform(-1.5, 1.5, (number, 4, 3))
    vertices = vertices[volume(vertices) > 1e-3]
    flipped = signed_volume(vertices) < 0
    vertices[flipped] = vertices[flipped][:, [0, 2, 1, 3]]
    return vertices


def flat(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Points on the image plane, at depth 1 for perspective."""
    local = camera.to_camera_space(points)
    return local[..., :2] / local[..., 2:] if camera.kind == "PERSP" else local[..., :2]


def silhouettes(vertices: np.ndarray, camera: Camera) -> np.ndarray:
    """Areas (n,) of the hulls of four points in a plane: half of what the four triangles of three of them cover."""
    points = flat(vertices, camera)
    total = np.zeros(len(points))
    for i in range(4):
        a, b, c = np.moveaxis(np.delete(points, i, axis=1), 1, 0)
        u, v = b - a, c - a
        total += np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    return total / 2


def areas(projected: Projected, camera: Camera, number: int) -> np.ndarray:
    a, b, c = np.moveaxis(flat(projected.corners.reshape(-1, 3), camera)[projected.triangles], 1, 0)
    u, v = b - a, c - a
    each = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    return np.bincount(projected.triangles[:, 0] // 5, each, number)


def through(vertices: np.ndarray, start: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Length (r, n) of rays, given by starts and unit directions (r, 3), within tetrahedra (n, 4, 3)."""
    planes = support.face_planes(vertices)
    slope = np.einsum("rk,nfk->rnf", toward, planes[..., :3])
    away = np.einsum("rk,nfk->rnf", start, planes[..., :3]) + planes[..., 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -away / slope
    enter = np.where(slope < 0, at, -np.inf).max(axis=2)
    leave = np.where(slope > 0, at, np.inf).min(axis=2)
    return np.maximum(leave - enter, 0.0)


@given(st.integers(0, 2**31), st.sampled_from([ORTHO, PERSP]))
@settings(deadline=None, max_examples=25)
def test_triangles_cover_the_silhouette_once(seed: int, camera: Camera) -> None:
    vertices = tetrahedra(seed)
    projected = project(vertices, np.ones(len(vertices)), camera)
    each = np.bincount(projected.triangles[:, 0] // 5, minlength=len(vertices))
    assert set(each) <= {3, 4}
    expected = silhouettes(vertices, camera)
    np.testing.assert_allclose(areas(projected, camera, len(vertices)), expected, rtol=1e-7)
    if camera.kind == "ORTHO":
        np.testing.assert_allclose(expected, projected_area(vertices, camera.frame[:, 2]), rtol=1e-7)


@given(st.integers(0, 2**31), st.sampled_from([ORTHO, PERSP]))
@settings(deadline=None, max_examples=25)
def test_the_thick_point_is_where_its_ray_is_longest_within(seed: int, camera: Camera) -> None:
    vertices = tetrahedra(seed)
    kappa = np.random.default_rng(seed).uniform(0.0, 5.0, len(vertices))
    projected = project(vertices, kappa, camera)
    np.testing.assert_allclose(projected.opacity, -np.expm1(-kappa * projected.thickness), rtol=1e-12)
    thick = projected.corners[:, THICK]
    toward = thick - camera.position if camera.kind == "PERSP" else np.tile(-camera.frame[:, 2], (len(thick), 1))
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    start = thick - 100 * toward
    own = np.diagonal(through(vertices, start, toward))
    # A ray that grazes a vertex by the last bit may miss it.
    np.testing.assert_allclose(own, projected.thickness, atol=1e-6)
    # The thick point is where the ray comes in: just before it there is nothing.
    planes = support.face_planes(vertices)
    distance = np.einsum("nfk,nk->nf", planes[..., :3], thick) + planes[..., 3]
    np.testing.assert_allclose(distance.max(axis=1), 0.0, atol=1e-9)
    others = np.random.default_rng(seed + 1).normal(0, 0.2, (50, 3))
    if camera.kind == "ORTHO":
        longest = through(vertices, start[:1] + others @ camera.frame @ np.diag([1, 1, 0]) @ camera.frame.T, toward[:1])
        assert (longest <= projected.thickness + 1e-9).all()


def image(projected: Projected, places: np.ndarray, camera: Camera) -> np.ndarray:
    """Opacity (r, n) that a Gouraud shaded image has at places (r, 2), by tetrahedron."""
    corners = flat(projected.corners.reshape(-1, 3), camera)[projected.triangles]
    matrix = np.concatenate([corners.transpose(0, 2, 1), np.ones((len(corners), 1, 3))], axis=1)
    weights = np.einsum("tij,rj->rti", np.linalg.inv(matrix), np.c_[places, np.ones(len(places))])
    inside = (weights >= 0).all(axis=2)
    owner = projected.triangles[:, 0] // 5
    value = np.where(inside, weights[..., 2] * projected.opacity[owner], 0.0)
    out = np.zeros((len(places), len(projected.opacity)))
    np.maximum.at(out, (slice(None), owner), value)
    return out


@pytest.mark.parametrize("seed", range(4))
def test_an_image_is_that_of_rays(seed: int) -> None:
    """Thickness is linear within each triangle: exact for thin fog, and never darker than rays for thick fog."""
    vertices = tetrahedra(seed, 12)
    rng = np.random.default_rng(seed)
    places = rng.uniform(-1.5, 1.5, (400, 2))
    start = ORTHO.position + places @ ORTHO.frame[:, :2].T
    lengths = through(vertices, start, np.tile(-ORTHO.frame[:, 2], (len(start), 1)))
    assert (lengths > 0).mean() > 0.05
    for kappa in (1e-6, 2.0):
        projected = project(vertices, np.full(len(vertices), kappa), ORTHO)
        drawn, exact = image(projected, places, ORTHO), -np.expm1(-kappa * lengths)
        if kappa < 1e-3:
            np.testing.assert_allclose(drawn, exact, atol=1e-6 * kappa * lengths.max() + 1e-15)
        else:
            assert (drawn <= exact + 1e-9).all()
            # A chord of 1 − e^−τ is farthest from it at τ/2 or so.
            assert (exact - drawn).max() < 0.5


@pytest.mark.parametrize("camera", [ORTHO, PERSP])
def test_an_edge_on_tetrahedron_keeps_its_area(camera: Camera) -> None:
    """Cases between the cases: a face seen edge on, two vertices behind each other, no volume at all."""
    ahead = -camera.frame[:, 2] * 1.0
    base = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.2), (0.0, 0.3, 1.0)])
    eye = camera.position if camera.kind == "PERSP" else camera.position + 50 * camera.frame[:, 2]
    behind = base[0] + 0.2 * (base[0] - eye) if camera.kind == "PERSP" else base[0] + 0.7 * ahead
    on_edge = base[0] + (0.5 * (base[1] - base[0]) + 0.3 * ahead)
    cases = np.array([[*base, behind], [*base, on_edge], [*base, (base[0] + base[1]) / 2]])
    projected = project(cases, np.ones(3), camera)
    expected = silhouettes(cases[:2], camera)
    np.testing.assert_allclose(areas(projected, camera, 3)[:2], expected, rtol=1e-6)
    assert projected.thickness[2] == 0.0
    assert projected.opacity[2] == 0.0
    assert np.isfinite(projected.corners).all()


def test_what_is_around_the_eye_or_behind_is_not_drawable() -> None:
    around = np.array([[(-5.0, -5, -5), (5, -5, -5), (0, 5, -5), (0, 0, 5)]])
    camera = support.camera((0, 0, 0), (0, 10, 0))
    moved = np.concatenate([around + [0, offset, 0] for offset in (0.0, 20.0, -20.0)])
    assert drawable(moved, camera).tolist() == [False, True, False]
    assert drawable(moved.astype(np.float32), camera).tolist() == [False, True, False]


def test_panoramas_are_refused() -> None:
    with pytest.raises(ValueError, match="panorama"):
        project(tetrahedra(0), np.ones(1), replace(PERSP, kind="PANO"))


@pytest.fixture(scope="module")
def gathered() -> levels.Levels:
    flora, camera = support.small_flora(), support.camera((0, -30, 4), (0, 0, 1.5), pixels=200)
    options = RefinementSettings(visibility_resolution=64, max_tetrahedra=20_000, leaf_limit=0.6, cutoff=4.0)
    loop = levels.gather(refine(flora, support.grove(16, 2.0), camera, options), flora, camera)
    seen = []
    while True:
        try:
            seen.append(next(loop))
        except StopIteration as stop:
            assert [level.number for level in seen] == list(range(len(seen)))
            assert stop.value.levels == seen
            return stop.value


def test_levels_are_the_states_of_the_loop(gathered: levels.Levels) -> None:
    assert len(gathered) > 2
    assert gathered.at(0) is gathered.levels[0]
    assert gathered.at(10**6) is gathered.levels[-1]
    sizes = [len(level) for level in gathered.levels]
    assert sizes[-1] > sizes[0]
    for level in gathered.levels:
        figures = level.figures
        assert figures.split + figures.proxy + figures.hidden + figures.explicit == len(level)
        assert gathered.vertices(level).shape == (len(level), 4, 3)
        assert ((level.visibility >= 0) & (level.visibility <= 1.001)).all()
        assert (level.extinction > 0).all()
        assert ((level.color > 0) & (level.color < 1)).all()
    assert not (gathered.levels[-1].decision == Decision.SPLIT).any()
    # What is there is spread, and not lost: Σ κ V is half of the leaves and a quarter of the wood at every level, but
    # what a plant is expected to hold and what it holds once it is opened are not quite the same.
    held = [(lv.extinction * volume(gathered.vertices(lv).astype(float))).sum() for lv in gathered.levels]
    np.testing.assert_allclose(held, held[0], rtol=0.05)
    assert gathered.nbytes < 5_000_000


@pytest.mark.parametrize("eye", [(0.0, -14.0, 3.0), (9.0, 4.0, 8.0), (0.3, 0.2, 1.0)])
def test_levels_are_drawn_back_to_front_from_anywhere(gathered: levels.Levels, eye: tuple[float, ...]) -> None:
    """A level's own tree gives the same order as the last one's."""
    camera = support.camera(eye, (0, 0, 1.5))
    for level in (gathered.levels[0], gathered.levels[1], gathered.levels[-1]):
        order = gathered.back_to_front(level, camera)
        assert np.sort(order).tolist() == list(range(len(level)))
        # Of two tetrahedra that a ray meets, the farther one comes first.
        vertices = gathered.vertices(level).astype(float)[order]
        toward = np.random.default_rng(3).normal(size=(200, 3))
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        planes = support.face_planes(vertices)
        slope = np.einsum("rk,nfk->rnf", toward, planes[..., :3])
        away = planes[..., :3] @ np.array(eye) + planes[..., 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            at = -away / slope
        enter = np.where(slope < 0, at, -np.inf).max(axis=2)
        leave = np.where(slope > 0, at, np.inf).min(axis=2)
        met = (leave > enter + 1e-4) & (leave > 1e-4)
        assert met.any()
        for ray in range(len(toward)):
            middles = ((np.maximum(enter, 0) + leave) / 2)[ray, met[ray]]
            assert (np.diff(middles) < 1e-6).all()
    some = np.arange(0, len(level), 3)
    chosen = gathered.back_to_front(level, camera, some)
    assert chosen.tolist() == [i for i in order.tolist() if i % 3 == 0]


def test_too_many_levels_are_thinned(monkeypatch: pytest.MonkeyPatch, gathered: levels.Levels) -> None:
    assert levels.thinned([0, 1, 2, 3, 4]) == [0, 2, 4]
    assert levels.thinned([0, 1, 2, 3]) == [0, 2, 3]
    assert levels.thinned([0, 1]) == [0, 1]
    level = gathered.levels[-1]
    assert level.nbytes < 60 * len(level)


def test_colors_tell_tetrahedra_apart(gathered: levels.Levels) -> None:
    level = gathered.levels[-1]
    for mode in ("LEVEL", "VISIBILITY", "FORM", "CONTRIBUTION"):
        shown = levels.colors_of(level, mode, int(level.depth.max()))
        assert shown.shape == (len(level), 3)
        assert shown.dtype == np.float32
        assert ((shown >= 0) & (shown <= 1)).all()
        assert len(np.unique(shown, axis=0)) > 1
    forms = levels.colors_of(level, "FORM", 1)
    for decision, color in levels.FORMS.items():
        assert np.allclose(forms[level.decision == decision], color)
    shades = levels.ramp(np.linspace(0, 1, 9)) @ [0.3, 0.6, 0.1]
    assert (np.diff(shades) > 0).all()
    with pytest.raises(ValueError, match="FORM"):
        levels.colors_of(level, "MOOD", 1)
    np.testing.assert_allclose(levels.as_shown(np.array([0.0, 0.21404, 1.0])), [0, 0.5, 1], atol=1e-4)


def test_a_tree_that_was_not_divided_has_an_order() -> None:
    tree = TetrahedralTree()
    tree.place([0], tetrahedra(1, 20)[:1])
    gathered = levels.Levels([], tree, PERSP)
    assert gathered.nbytes > 0


@pytest.mark.parametrize("species", ["birch", "conifer", "bush"])
def test_light_plants_stand_where_plants_do(species: str) -> None:
    """Few triangles, within the plant's bound, about as tall as its leaves reach, in the species' color."""
    flora, count = support.alone(species), 5
    positions = np.random.default_rng(1).uniform(-30, 30, (count, 3))
    seeds = support.plants(np.arange(count), 0, positions, 0.7)
    shapes = light_plants.light_plants(flora, seeds)
    stems = trunks(flora.rows, seeds)
    points = shapes.positions.reshape(count, -1, 3) - stems.position[:, None]
    assert len(shapes.indices) / count <= 24
    assert shapes.indices.min() == 0
    assert shapes.indices.max() == len(shapes.positions) - 1
    radius, low, high = flora.sampled_bound[stems.row, :3].T * stems.length
    assert (np.hypot(points[..., 0], points[..., 1]) <= radius[:, None] + 0.02 * stems.length[:, None]).all()
    assert (points[..., 2] <= high[:, None] + 1e-3).all()
    assert (points[..., 2] >= low[:, None] - 0.02 * stems.length[:, None]).all()  # trunks lean
    assert (points[..., 2].max(axis=1) > 0.7 * high).all()
    crown = shapes.colors.reshape(count, -1, 3)[:, 1]
    hue = crown / crown.max(axis=1, keepdims=True)
    leaf = levels.as_shown(flora.leaf_colors(stems))
    np.testing.assert_allclose(hue, leaf / leaf.max(axis=1, keepdims=True), atol=0.15)
    boxes = light_plants.bounds_of_plants(flora, seeds)
    corners = boxes.positions.reshape(count, 8, 3) - stems.position[:, None]
    np.testing.assert_allclose(corners[..., 2].max(axis=1), high, rtol=0.05)
    assert len(boxes.indices) == 12 * count


def test_of_a_large_forest_bounds_are_shown_in_part_and_all_crowns() -> None:
    seeds = support.grove(100, 2.0)
    shapes = light_plants.bounds_of_plants(support.small_flora(), seeds, most=30)
    assert 29 <= shapes.plants <= 30
    assert shapes.of == 100
    shapes = light_plants.light_plants(support.small_flora(), seeds, most=30)
    assert shapes.plants == shapes.of == len(shapes.crowns.positions) == 100


def test_grass_is_thinned_and_not_the_trees_above_it() -> None:
    """Trees among ten times as many low plants stay, whatever the order; few are thinned as evenly as before."""
    low, tall = support.SPECIES.index("bush"), support.SPECIES.index("birch")
    species = np.random.default_rng(2).permutation(np.repeat([low, tall], [2000, 200])).astype(np.int32)
    seeds = support.plants(np.arange(len(species)), tall, np.zeros((len(species), 3)), 1.0)
    seeds = replace(seeds, species=species, scale=np.where(species == low, 0.05, 1.0))
    heights = np.array([support.flora().rows["length"][row, 0] for row in support.flora().first_row])
    kept = light_plants.thinned(seeds, heights, 500)
    assert (kept.species == tall).sum() == 200
    assert 299 <= (kept.species == low).sum() <= 300
    trees = light_plants.thinned(seeds, heights, 100)
    assert (trees.species == tall).sum() >= 95
