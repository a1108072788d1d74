# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light by the paper: what arrives in clouds and behind polygons, and what facets and clouds send on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.camera.camera import Camera
from tetflora_addon.emission.shells import set_apart
from tetflora_addon.light import buffers
from tetflora_addon.light.illumination import Illumination, Sources, Surfaces, _shadow_steps
from tetflora_addon.light.receivers import MediumCells, SurfaceElements
from tetflora_addon.light.scattering import (
    DIRECTIONS,
    SOLID_ANGLE,
    harmonics,
    irradiance,
    particle_ambient,
    scattered_fractions,
    sphere_phase,
)
from tetflora_addon.light.sources import Near, World, arriving, buffers_of, split_areas
from tetflora_addon.optics import GLOSS
from tetflora_addon.refinement.lights import Light
from tetflora_addon.tetrahedra.geometry import signed_volume

DARK = World.plain((0, 0, 0))
DOWN = np.array([0.0, 0.0, -1.0])
SUN = Light("SUN", np.zeros(3), DOWN, color=np.array([3.0, 2.0, 1.0]))
NONE = np.array([-1])  # no tetrahedron
NOTHING = np.zeros((0, 3, 3))
# Kuhn's division of a cube.
_KUHN = [(1, 3, 7), (1, 5, 7), (2, 3, 7), (2, 6, 7), (4, 5, 7), (4, 6, 7)]


def shadow_pass(
    cells: MediumCells, lights: Sequence[Light], world: World, occluders: np.ndarray | None = None, **options
) -> Illumination:
    """All steps of the pass at once; ``ground`` is the color of the occluders."""
    occluders = np.zeros((0, 3, 3)) if occluders is None else occluders
    sources = Sources(lights, world, occluders, np.array(options.pop("ground", (0.0, 0.0, 0.0))))
    steps = _shadow_steps(cells, sources, **options)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def box(kappa: float, cells: int = 4, size: float = 4.0, color: float = 0.0, transmission: float = 0.0) -> MediumCells:
    """A cube of even density with its top at z = 0, divided into 6 × cells³ tetrahedra."""
    corner = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)], float)
    cube = corner[np.array([(0, *rest) for rest in _KUHN])]
    at = np.stack(np.meshgrid(*[np.arange(cells)] * 3), axis=-1).reshape(-1, 1, 1, 3)
    vertices = ((cube + at) / cells * size).reshape(-1, 4, 3) - [size / 2, size / 2, size]
    turned = signed_volume(vertices) < 0
    vertices[turned] = vertices[turned][:, [0, 2, 1, 3]]
    return clouds(vertices, kappa, color, transmission)


def clouds(vertices: np.ndarray, kappa: float, color: float, transmission: float) -> MediumCells:
    n = len(vertices)
    return MediumCells(
        vertices,
        np.tile([kappa**2] * 3 + [0.0] * 3, (n, 1)),
        np.full((n, 3), color),
        np.full(n, transmission),
        np.tile([0.0, 0.0, 1.0], (n, 1)),
        np.zeros(n),
    )


def inside(seed: int, count: int, cloud: MediumCells) -> tuple[np.ndarray, np.ndarray]:
    """Random points and their cells."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(len(cloud), size=count)
    return np.einsum("nk,nkx->nx", rng.dirichlet(np.ones(4), count), cloud.vertices[cells]), cells


def only(found: Illumination, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Sum of all lamps' light (m, 3)."""
    return sum(light for _, light in found.direct(points, cells))


@pytest.mark.parametrize("cells", [1, 5])
@pytest.mark.parametrize("kappa", [0.05, 0.5, 2.0])
def test_a_slab_lets_through_what_it_must(kappa: float, cells: int) -> None:
    """T = e^−κd at every depth, however coarse cells and pixels are."""
    cloud = box(kappa, cells)
    points, owner = inside(1, 300, cloud)
    # Not at the sides, where a pixel is half full.
    keep = np.abs(points[:, :2]).max(axis=1) < 1.9
    points, owner = points[keep], owner[keep]
    found = shadow_pass(cloud, [SUN], DARK, resolution=96, orders=1)
    wanted = np.exp(kappa * points[:, 2])[:, None] * SUN.color
    assert only(found, points, owner) == pytest.approx(wanted, abs=0.02 * 3.0)
    below = np.array([[0.3, -0.4, -9.0], [1.0, 1.0, -4.1]])
    behind = only(found, below, np.full(2, -1))
    assert behind == pytest.approx(np.tile(np.exp(-4.0 * kappa) * SUN.color, (2, 1)), rel=0.02)


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA"])
def test_lamps_inside_and_outside_agree_with_the_chord(kind: str) -> None:
    """From a lamp the depth is that of the straight way through the box."""
    lamp = Light(kind, np.array([0.2, 0.1, 6.0]), DOWN, angle=1.2, span=np.zeros((2, 3)))
    cloud = box(0.3)
    points, owner = inside(2, 200, cloud)
    keep = np.abs(points[:, :2]).max(axis=1) < 1.0
    points, owner = points[keep], owner[keep]
    found = shadow_pass(cloud, [lamp], DARK, resolution=256, orders=1)
    free = only(shadow_pass(box(0.0), [lamp], DARK, resolution=32, orders=1), points, owner)
    slant = np.linalg.norm(lamp.position - points, axis=1) / (6.0 - points[:, 2])
    wanted = np.exp(0.3 * points[:, 2] * slant)
    assert only(found, points, owner)[:, 0] / free[:, 0] == pytest.approx(wanted, abs=0.02)


def test_a_lamp_in_the_middle_shines_all_around() -> None:
    lamp = Light("POINT", np.array([0.01, 0.02, -2.0]), DOWN, shadow=True)
    cloud = box(0.4)
    points, owner = inside(3, 200, cloud)
    away = np.linalg.norm(points - lamp.position, axis=1)
    keep = away > 0.5
    found = only(shadow_pass(cloud, [lamp], DARK, resolution=256, orders=1), points, owner)[:, 0]
    wanted = np.exp(-0.4 * away) / away**2
    assert (found * away**2)[keep] == pytest.approx((wanted * away**2)[keep], abs=0.04)


def test_polygons_shadow_what_is_behind_them_and_not_themselves() -> None:
    plate = np.array([[[-9, -9, -2.0], [9, -9, -2.0], [0, 18, -2.0]]], float)
    cloud = box(0.1)
    points, owner = inside(4, 300, cloud)
    found = shadow_pass(cloud, [SUN], DARK, plate, resolution=128, orders=1)
    light, free = (
        only(f, points, owner)[:, 0] for f in (found, shadow_pass(cloud, [SUN], DARK, resolution=128, orders=1))
    )
    assert light[points[:, 2] < -2.2] == pytest.approx(0.0, abs=1e-9)
    assert light[points[:, 2] > -2.0] == pytest.approx(free[points[:, 2] > -2.0])
    on = only(found, np.array([[0.3, 0.2, -2.0]]), np.array([-1]))[0, 0]
    assert on == pytest.approx(3.0 * np.exp(-0.2), rel=0.02)


def test_lights_add_and_those_without_shadow_pass_through() -> None:
    cloud = box(0.7)
    points, owner = inside(5, 50, cloud)
    other = Light("SUN", np.zeros(3), np.array([0.6, 0.0, -0.8]), shadow=False)
    one, two, both = (
        only(shadow_pass(cloud, lights, DARK, resolution=64, orders=1), points, owner)
        for lights in ([SUN], [other], [SUN, other])
    )
    assert both == pytest.approx(one + two)
    assert two == pytest.approx(1.0)


def test_the_order_of_tetrahedra_and_lights_does_not_matter() -> None:
    cloud = box(0.5, 2, color=0.5)
    turn = np.random.default_rng(6).permutation(len(cloud))
    turned = clouds(cloud.vertices[turn], 0.5, 0.5, 0.0)
    lights = [SUN, Light("POINT", np.array([5.0, 0.0, 1.0]), DOWN)]
    world = World.plain((0.3, 0.4, 0.5))
    first = shadow_pass(cloud, lights, world, resolution=64)
    second = shadow_pass(turned, lights[::-1], world, resolution=64)
    assert second.ambient == pytest.approx(first.ambient[turn], rel=1e-5, abs=1e-7)
    camera = support.camera((9, 0, 2), (0, 0, -2))
    assert second.cell_sources(camera) == pytest.approx(first.cell_sources(camera)[turn], rel=1e-5)


def test_light_is_linear_within_a_tetrahedron() -> None:
    cloud = box(0.5, 1)
    found = shadow_pass(cloud, [], World.of(lambda d: 1.0 + d[:, 2:] * [1.0, 0.5, 0.2]), resolution=64)
    ends = np.array([cloud.key_points[2, 0], cloud.key_points[2, 3]])
    fraction = np.linspace(0.0, 1.0, 5)[:, None]
    points = ends[0] * (1 - fraction) + ends[1] * fraction
    samples = found.ambient[2, [0, 3]].reshape(2, -1)
    wanted = samples[:1] * (1 - fraction) + samples[1:] * fraction
    assert found.around(points, np.full(5, 2)).reshape(5, -1) == pytest.approx(wanted, abs=1e-6)


def test_nothing_beside_or_behind_a_cone_is_lit() -> None:
    spot = Light("SPOT", np.zeros(3), DOWN, angle=0.4, blend=0.2)
    rng = np.random.default_rng(7)
    points = rng.normal(size=(400, 3)) * 3.0
    away = np.arccos(np.clip(-points[:, 2] / np.linalg.norm(points, axis=1), -1, 1))
    light = arriving(spot, points)[1][:, 0] * np.linalg.norm(points, axis=1) ** 2
    assert not light[away > 0.4].any()
    assert light[away < 0.25] == pytest.approx(1.0)
    assert ((light >= 0.0) & (light <= 1.0 + 1e-9)).all()


def test_points_of_an_area_add_up_to_it() -> None:
    span = np.array([[0.5, 0.0, 0.0], [0.0, 2.0, 0.0]])
    for ellipse in (False, True):
        area = Light("AREA", np.zeros(3), DOWN, span=span, ellipse=ellipse)
        parts = split_areas((area,))
        assert sum(p.color for p in parts) == pytest.approx(area.color)
        assert np.mean([p.position for p in parts], axis=0) == pytest.approx(np.zeros(3), abs=0.3)
        point = np.array([[0.0, 0.0, -20.0]])
        far = sum(arriving(p, point)[1] for p in parts)
        assert far == pytest.approx(arriving(area, point)[1], rel=0.02)
        assert not any(arriving(p, -point)[1].any() for p in parts)


def test_directions_are_even_and_harmonics_hold_an_even_sky() -> None:
    assert np.linalg.norm(DIRECTIONS, axis=1) == pytest.approx(1.0)
    basis = harmonics(DIRECTIONS)
    assert basis.T @ basis * SOLID_ANGLE == pytest.approx(np.eye(9), abs=1e-9)
    normals = np.random.default_rng(8).normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sky = World.plain((1.0, 2.0, 3.0)).parts.sum(axis=0)
    assert irradiance(np.tile(sky, (20, 1, 1)), normals) == pytest.approx(np.tile([1, 2, 3], (20, 1)) * np.pi, rel=1e-3)
    half = World.of(lambda d: np.maximum(d[:, 2:], 0.0)).parts.sum(axis=0)
    # ∫ cos² over the half sphere.
    assert irradiance(half[None], np.array([[0.0, 0.0, 1.0]]))[0] == pytest.approx([2 * np.pi / 3] * 3, rel=0.01)


@cache
def _empty() -> Illumination:
    return shadow_pass(box(0.0, 1), [], World.plain((1, 1, 1)), resolution=32)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_white_facets_under_an_even_sky_are_white(transmission: float, seed: int) -> None:
    """A furnace: nothing is gained nor lost."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(8, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    found = _empty()
    points, cells = inside(seed, 8, found.clouds)
    camera = support.camera((20, 3, 1), (0, 0, -2))
    surfaces = Surfaces(points, normal, np.ones((8, 3)), np.full(8, transmission), cells)
    sides = found.facet_radiance(surfaces, camera)
    # White stays white in each color where nothing tints it on its way through.
    assert np.array(sides)[..., :2] == pytest.approx(1.0, abs=0.01)
    seen = found.cloud_radiance(surfaces, camera, np.full(8, 0.4))
    assert seen[:, :2] == pytest.approx(1.0, abs=0.01)


def test_dull_facets_mirror_less() -> None:
    """Black ones, whose light is gloss alone, send back what is left of it."""
    found = _empty()
    points, cells = inside(3, 8, found.clouds)
    surfaces = Surfaces(points, np.tile([0.0, 0.0, 1.0], (8, 1)), np.zeros((8, 3)), np.full(8, 0.5), cells)
    camera = support.camera((20, 3, 1), (0, 0, -2))
    bright = found.facet_radiance(surfaces, camera)[0]
    dull = found.facet_radiance(replace(surfaces, dull=np.full(8, 0.75)), camera)[0]
    assert bright == pytest.approx(GLOSS, rel=0.01)
    assert dull == pytest.approx(0.25 * bright)


@pytest.mark.parametrize("kappa", [0.2, 2.0])
def test_a_white_cloud_under_an_even_sky_is_white(kappa: float) -> None:
    """What is scattered makes up for what is hidden."""
    found = shadow_pass(box(kappa, 2, color=1.0), [], World.plain((1, 1, 1)), resolution=400, orders=16)
    assert found.cell_sources(support.camera((20, 3, 1), (0, 0, -2))) == pytest.approx(1.0, abs=0.04)


def test_more_orders_change_little() -> None:
    """The geometric series stands for those that are left out."""
    cloud = box(1.0, 3, color=0.5)
    few, many = (shadow_pass(cloud, [SUN], DARK, resolution=64, orders=n).ambient[:, :, 0] for n in (2, 8))
    assert few.mean() == pytest.approx(many.mean(), rel=0.02)
    assert shadow_pass(cloud, [SUN], DARK, resolution=64, orders=1).ambient[:, :, 0].mean() < 0.9 * many.mean()


def test_crowns_are_darker_inside_and_below() -> None:
    found = shadow_pass(box(0.6, 6, color=0.2), [], World.of(lambda d: np.maximum(d[:, 2:], 0.0)), resolution=128)
    height = found.clouds.key_points[..., 2]
    light = found.ambient[:, :, 0, 0]
    layers = [light[(height < top) & (height >= top - 1.0)].mean() for top in (0.0, -1.0, -2.0, -3.0)]
    assert layers == sorted(layers, reverse=True)


def test_ground_lights_from_below() -> None:
    plate = np.array([[[-90, -90, -4.5], [90, -90, -4.5], [0, 180, -4.5]]], float)
    down = np.array([[0.0, 0.0, -1.0]])
    at = np.array([[0.0, 0.0, -3.9]])
    dark, bright = (
        irradiance(shadow_pass(box(0.01), [SUN], DARK, plate, resolution=128, ground=(c,) * 3).around(at, NONE), down)
        for c in (0.0, 0.5)
    )
    assert dark == pytest.approx(0.0, abs=0.01)
    # Half of the sun's light comes back from a plane without end.
    assert bright == pytest.approx(0.5 * SUN.color[None], rel=0.15)


def test_phases_keep_all_light() -> None:
    x, weight = np.polynomial.legendre.leggauss(40)
    assert 2 * np.pi * (weight * sphere_phase(x)).sum() == pytest.approx(1.0, abs=1e-4)
    even = np.tile(World.plain((1, 1, 1)).parts.sum(axis=0), (1, 1, 1))
    for transmission in (0.0, 0.4):
        fractions = scattered_fractions(np.full((1, 3), 0.5), np.array([transmission]))
        total = fractions[0] + fractions[1] + fractions[2][:, None]
        assert particle_ambient(fractions, even, np.array([[0.0, 0.6, 0.8]])) == pytest.approx(total, rel=1e-3)


def test_nothing_to_light() -> None:
    """No tetrahedra, and points beside them."""
    found = shadow_pass(clouds(np.zeros((0, 4, 3)), 1.0, 0.5, 0.0), [SUN], World.plain((1, 1, 1)))
    up = np.array([[0.0, 0.0, 1.0]])
    assert irradiance(found.around(np.zeros((1, 3)), NONE), up) == pytest.approx(np.full((1, 3), np.pi), rel=1e-3)
    assert [light.tolist() for _, light in found.direct(np.zeros((1, 3)), NONE)] == [[SUN.color.tolist()]]
    assert found.cell_sources(support.camera((9, 0, 2), (0, 0, -2))).shape == (0, 4, 3)


def random_sheets(seed: int, count: int, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Level squares (count, 4, 3) at random in the cube of `box`, and the cells (of six) that hold their middles."""
    rng = np.random.default_rng(seed)
    cloud = box(1.0, 1)
    cell = rng.integers(len(cloud), size=count)
    middle = np.einsum("nk,nkx->nx", rng.dirichlet(np.ones(4), count), cloud.vertices[cell])
    return middle[:, None] + side / 2 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]), cell


def counted_points(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of points that buffers look up together from now on."""
    held, inner = [], buffers.image_places

    def counted(camera: Camera, points: np.ndarray, size: np.ndarray) -> object:
        held.append(len(points))
        return inner(camera, points, size)

    monkeypatch.setattr(buffers, "image_places", counted)
    return held


def sheets_in(corners: np.ndarray, cell: np.ndarray, count: int) -> SurfaceElements:
    """Sheets that cast the shadows of the tetrahedra which have some."""
    return SurfaceElements(corners, cell, np.bincount(cell, minlength=count) > 0)


def test_sheets_shadow_those_below_and_not_themselves() -> None:
    """As rays find it: a sheet is lit as far as none lies above its middle."""
    corners, cell = random_sheets(9, 120, 0.4)
    sheets = sheets_in(corners, cell, 6)
    found = shadow_pass(box(5.0, 1), [SUN], DARK, resolution=128, sheets=sheets)
    middle, every = corners.mean(axis=1), np.arange(120)
    light = next(found.direct(middle, cell, every))[1][:, 0] / 3.0
    away = np.abs(middle[:, None, :2] - middle[None, :, :2]).max(axis=2)
    covered = ((away < 0.2) & (middle[None, :, 2] > middle[:, None, 2])).any(axis=1)
    # Not where an edge lies within a pixel or two.
    clear = (np.abs(away - 0.2) > 0.07).all(axis=1)
    assert light[clear & ~covered] == pytest.approx(1.0, abs=1e-6)
    assert (light[clear & covered] < 0.1).all()
    assert light.mean() == pytest.approx((~covered).mean(), abs=0.05)


def test_however_many_sheets_are_drawn_few_points_are_held_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small ones and large ones, which are cut into many parts; the light is the same to the last digit."""
    parts = [random_sheets(seed, 60, side) for seed, side in ((1, 0.01), (2, 0.1), (3, 0.6))]
    corners, cell = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    sheets = sheets_in(corners, cell, 6)

    def light() -> np.ndarray:
        found = shadow_pass(box(5.0, 1), [SUN], DARK, resolution=128, sheets=sheets)
        return next(found.direct(corners.mean(axis=1), cell, np.arange(len(cell))))[1]

    once, held = light(), counted_points(monkeypatch)
    monkeypatch.setattr(buffers, "POINT_BATCH", 5_000)
    assert np.array_equal(light(), once)
    assert sum(held) > 50_000
    assert max(held) <= 5_000


@pytest.mark.parametrize("outline", [[(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0.5), (0.5, 0), (1, 0.5), (0.5, 1)]])
@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_a_blade_of_grass_has_few_parts_and_no_gaps(outline, turn, monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as it is long, not the square of that; it hides as much as its area."""
    corners = np.array([(*np.array(point) * (0.5, 0.008), -1.0) for point in outline])
    corners = corners @ [[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]]
    held = counted_points(monkeypatch)
    blade = SurfaceElements(corners[None], np.zeros(1, int), np.ones(6, bool))
    (buffer,) = buffers_of(SUN, box(1.0, 1), blade, NOTHING, 256)
    pixel = 4.0 / 256
    assert sum(held) < 10 * 0.5 / pixel
    area = np.linalg.norm(np.cross(corners[2] - corners[0], corners[3] - corners[1])) / 2
    assert -np.expm1(-buffer._depth).sum() * pixel**2 == pytest.approx(area, rel=0.01)
    column, row = buffer._pixel % buffer.width, buffer._pixel // buffer.width
    along = np.unique(column if np.ptp(column) > np.ptp(row) else row)
    assert np.diff(along)[1:-1].max() == 1  # tips are as good as nothing


def test_what_a_view_of_a_lamp_does_not_show_costs_it_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six views look all around a lamp; what stands beside one of them would have parts without end there."""
    corners, cell = random_sheets(11, 200, 0.01)
    held = counted_points(monkeypatch)
    lamp = Light("POINT", np.array([0.1, 0.2, -2.0]), DOWN)
    made = buffers_of(lamp, box(1.0, 1), sheets_in(corners, cell, 6), NOTHING, 128)
    assert len(made) == 6
    assert sum(held) < 6 * 200


def test_samples_stand_for_their_key_points() -> None:
    corners, cell = random_sheets(10, 40, 0.2)
    cloud = box(1.0, 1)
    points, cells, sheets, keys = sheets_in(corners, np.where(cell == 2, 3, cell), 6).samples(cloud)
    assert (sheets[cells == 2] == -1).all()
    assert len(points[cells == 2]) == 4
    assert keys.means(np.ones((len(points), 2))) == pytest.approx(1.0)
    of_cell = keys.by_cell(keys.means(points))
    for one in range(6):
        assert of_cell[one] == pytest.approx(points[cells == one].mean(axis=0))


@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.integers(1, 200))
@settings(max_examples=25, deadline=None)
def test_fewer_sheets_have_the_area_of_all(seed, count, most):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(count, 1, 3)) + rng.normal(scale=0.1, size=(1, 4, 3))
    cells = rng.integers(0, 5, count)
    fewer, number = sheets_in(corners, cells, 5).thinned(most)
    assert len(fewer) <= max(most, 1)
    assert sorted(number[number >= 0]) == list(range(len(fewer)))
    if len(fewer):
        chosen = np.flatnonzero(number >= 0)
        assert (fewer.cell[number[chosen]] == cells[chosen]).all()
        assert fewer.corners[number[chosen]].mean(axis=1) == pytest.approx(corners[chosen].mean(axis=1))

        def area(c):
            return np.linalg.norm(np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1]), axis=1).sum()

        assert area(fewer.corners) == pytest.approx(area(corners), rel=1e-6)


def test_a_view_of_what_is_near_gives_the_light_of_the_whole():
    """Cells, and ground beneath: the shadow at points that both views see is the same, but for the pixels' size."""
    cloud = box(0.3)
    points, cells = inside(3, 200, cloud)
    whole = buffers_of(SUN, cloud, SurfaceElements.none(len(cloud)), NOTHING, 256)
    near = Near(np.array([1.0, 1.0, 0.0]), (0.8,))
    both = buffers_of(SUN, cloud, SurfaceElements.none(len(cloud)), NOTHING, 256, near)
    assert len(whole) == 1
    assert len(both) == 2
    own = cloud.own_depth(points, cells, np.array([0.0, 0.0, 1.0]))
    everywhere, _ = whole[0].transmittance(points, cells, own)
    near, seen = both[0].transmittance(points, cells, own)
    assert 0 < seen.sum() < len(points)
    assert near[seen] == pytest.approx(everywhere[seen], abs=0.03)


def test_shells_stand_apart_and_are_as_dark_as_before():
    cloud = box(2.0)
    for offset in (0.0, 5000.0):
        apart = set_apart(replace(cloud, vertices=cloud.vertices + offset))
        vertices, matrices = apart.vertices, apart.matrices
        stored = vertices.astype(np.float32).reshape(-1, 3)
        assert len(np.unique(stored, axis=0)) == len(stored)
        size = np.linalg.norm(vertices[:, 1] - vertices[:, 0], axis=1)
        before = np.linalg.norm(cloud.vertices[:, 1] - cloud.vertices[:, 0], axis=1)
        assert size * np.sqrt(matrices[:, 0]) == pytest.approx(before * 2.0)
        assert (size > 0.949 * before).all()
