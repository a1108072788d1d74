# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Near wood: round, bent and footed where a pixel shows it, and the coarse tube, to the bit, everywhere else."""

from __future__ import annotations

from functools import partial
from itertools import islice

import numpy as np
import pytest

from tests.engine import support
from tests.engine.subplants.test_leaf_meshes import check_topology
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.compiled.averages import tube_perimeter
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.growth.growth import WholeBranches, radius_at
from tetflora_addon.growth.rows import DEAD_ORDER, FORK, SPUR_ORDER
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.members import expected_polygons
from tetflora_addon.species.quality import with_quality
from tetflora_addon.subplants.pieces import expand
from tetflora_addon.subplants.rings import (
    DEVIATION,
    MOST_SIDES,
    PLACES,
    Fineness,
    Pixels,
    _roots,
    buttresses,
    collars,
    fine_counts,
    fine_rings,
    fine_sides,
    fineness,
    finer,
    has_foot,
    root_number,
    round_up_to,
)
from tetflora_addon.subplants.tubes import tube_buffers


def even(pixel: float) -> Pixels:
    """The same number of meters to a pixel everywhere."""
    return Pixels(lambda points, _reach: np.full(len(points), pixel))


def grown(flora: Flora, species: int = 0, seed: int = 1) -> list[WholeBranches]:
    return list(expand(flora, support.trunks(flora.rows, support.plants([seed], species))))


def straight(**order0: object) -> tuple[Flora, WholeBranches]:
    """A branch that neither bends nor bears others."""
    base = {"curvature": [0, 0], "angle": [0, 0], "branches": [0, 0], "sides": 5}
    flora = support.compiled(support.small(order0={**base, **order0}))
    return flora, grown(flora)[0]


def ends(flora: Flora, whole: WholeBranches) -> float:
    """Surface of the half balls that close branches, of 3 rings."""
    rows, branches = flora.rows, whole.branches
    own = branches.take(np.flatnonzero(rows["next"][branches.row, FORK] < 0))
    radius = radius_at(rows, own, np.ones(len(own))) * tube_perimeter(rows["sides"][own.row]) / (2 * np.pi)
    return 0.955 * 2 * np.pi * float((radius**2).sum())


def assert_same(one: MeshBuffers, other: MeshBuffers) -> None:
    for name in ("positions", "edge_verts", "corner_verts", "corner_edges", "face_offsets"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name, (_, values) in one.attributes.items():
        np.testing.assert_array_equal(values, other.attributes[name][1])


@pytest.mark.parametrize("species", range(len(support.SPECIES)), ids=support.SPECIES)
def test_wood_from_afar_is_the_coarse_tube_to_the_bit(species: int) -> None:
    flora = support.lean()
    whole = grown(flora, species)
    assert_same(tube_buffers(flora, whole), tube_buffers(flora, whole, even(1.0)))


@pytest.mark.parametrize("species", range(len(support.SPECIES)), ids=support.SPECIES)
def test_meshes_of_near_wood(species: int) -> None:
    """Whole pipes, with the surface of coarse ones but for feet, collars, and what bends and flares."""
    flora = support.lean()
    whole = [some.take(np.s_[::7]) for some in grown(flora, species)]
    coarse, near = tube_buffers(flora, whole), tube_buffers(flora, whole, even(0.001))
    check_topology(near)
    assert near.polygons > coarse.polygons or max(some.branches.radius.max() for some in whole) < 0.002
    assert (near.attributes["tf_girth"][1] > 0).all()
    feet = has_foot(flora.rows, whole[0].branches).any()
    areas = support.face_areas(coarse).sum(), support.face_areas(near).sum() - sum(map(partial(ends, flora), whole))
    assert 0.97 < areas[1] / areas[0] < (1.5 if feet else 1.26)


@pytest.mark.parametrize("sides", [3, 4, 7, 14, 64])
def test_sides_pass_for_circles(sides: int) -> None:
    pixels = np.geomspace(0.01, 2000.0, 200)
    found = fine_sides(np.full(200, sides), pixels)
    off = pixels * (1.0 - np.cos(np.pi / found))
    assert ((off <= DEVIATION * (1 + 1e-6)) | (2 * found > MOST_SIDES)).all()
    assert (found[pixels < DEVIATION / (1.0 - np.cos(np.pi / sides))] == sides).all()
    assert (np.diff(found) >= 0).all()
    assert (found % sides == 0).all()


def test_round_tubes_are_as_thick_as_coarse_ones() -> None:
    """Half of the perimeter is what is seen on average."""
    flora, whole = straight()
    coarse, near = tube_buffers(flora, [whole]), tube_buffers(flora, [whole], even(0.0005))
    assert near.polygons >= 8 * coarse.polygons
    area = support.face_areas(near).sum() - ends(flora, whole)
    assert area == pytest.approx(support.face_areas(coarse).sum(), rel=2e-3)


def test_nothing_appears_at_once() -> None:
    """Where a branch begins to be finer, its rings are where they were, to within the deviation."""
    flora = support.compiled(support.small(order0={"curvature": [80, 0], "segments": 6, "sides": 8}))
    whole = grown(flora)[0]
    limit = float(round_up_to(np.array([8]))[0])
    pixels = fineness(flora, whole, even(1.0)).pixels[0]
    pixel = pixels / limit
    coarse, near = tube_buffers(flora, [whole], even(1.001 * pixel)), tube_buffers(flora, [whole], even(0.99 * pixel))
    assert near.polygons > coarse.polygons
    apart = np.linalg.norm(coarse.positions[:, None] - near.positions, axis=2).min(axis=1)
    assert apart.max() < 2 * DEVIATION * pixel


def test_joints_become_a_curve_within_the_wood() -> None:
    """Segments are off the curve by no more than the deviation, which goes through the joints."""
    flora = support.compiled(
        support.small(order0={"curvature": [40, 0], "segments": 4, "thickness": 0.1, "taper": 0.8})
    )
    whole, pixel = grown(flora)[0], 0.002
    near = tube_buffers(flora, [whole], even(pixel))
    sides = int(fineness(flora, whole, even(pixel)).sides[0])
    center = near.positions.reshape(-1, sides, 3).mean(axis=1).astype(np.float64)
    step = np.diff(center, axis=0)
    length = np.linalg.norm(step, axis=1)
    turn = np.arccos(np.clip((step[1:] * step[:-1]).sum(axis=1) / (length[1:] * length[:-1]), -1, 1))
    assert (turn * (length[1:] + length[:-1]) / 16 < 2 * DEVIATION * pixel).all()
    coarse = tube_buffers(flora, [whole]).positions.reshape(5, -1, 3).mean(axis=1)
    np.testing.assert_allclose(np.linalg.norm(center[:, None] - coarse, axis=2).min(axis=0), 0.0, atol=1e-4)


def test_near_wood_is_the_same_in_any_order() -> None:
    flora = support.lean()
    whole = grown(flora, 0)[1]
    pixel = even(0.002)

    def sorted_points(order: np.ndarray) -> np.ndarray:
        points = tube_buffers(flora, [whole.take(order)], pixel).positions
        return points[np.lexsort(points.T)]

    every = np.arange(len(whole))
    np.testing.assert_array_equal(sorted_points(every), sorted_points(every[::-1]))


def test_buttresses_take_what_they_give() -> None:
    """The radius is that of the coarse tube on average around the foot; no two trunks have the same foot."""
    flora, whole = straight(flare=1.0, segments=8)
    near, coarse = tube_buffers(flora, [whole], even(0.001)), tube_buffers(flora, [whole])
    sides = int(fineness(flora, whole, even(0.001)).sides[0])

    def radii(mesh: MeshBuffers, number: int, height: float) -> np.ndarray:
        rings = mesh.positions[: len(mesh.positions) // number * number].reshape(-1, number, 3)
        ring = rings[np.abs(rings[:, :, 2].mean(axis=1) - height).argmin()]
        return np.linalg.norm(ring[:, :2], axis=1)

    foot = radii(near, sides, 0.0)
    assert np.ptp(foot) > 0.5 * whole.branches.radius[0]
    as_round = tube_perimeter(np.array([5]))[0] / (2 * np.pi)
    assert foot.mean() == pytest.approx(as_round * radii(coarse, 5, 0.0).mean(), rel=0.06)
    top = radii(near, sides, float(whole.branches.length[0]))
    assert np.ptp(top) < 1e-3 * top.mean()
    angle, size = buttresses(np.arange(9, dtype=np.uint64))
    assert len(np.unique(np.round(angle[:, 0], 6))) == 9
    assert ((size > 0).sum(axis=1) == root_number(np.arange(9, dtype=np.uint64))).all()


def test_roots_lead_into_the_ground() -> None:
    flora, whole = straight(flare=1.0)
    path, width, trunk = _roots(flora.rows, whole.branches, np.ones(1))
    assert len(path) == root_number(whole.branches.key).sum()
    assert path.shape[1] == PLACES
    assert (trunk == 0).all()
    away = np.linalg.norm(path[:, :, :2], axis=2)
    assert (away[:, 0] < 1.5 * whole.branches.radius[0]).all(), "begins in the trunk"
    assert (away[:, -1] > 2.0 * whole.branches.radius[0]).all()
    assert (path[:, -1, 2] + width[:, -1] < 0).all(), "ends in the ground"
    assert ((path[:, :, 2] + width).max(axis=1) > 0).all(), "can be seen"


def test_the_estimate_expects_what_near_wood_has() -> None:
    for species in map(load_species, ("ash", "beech")):
        flora = compile_species([with_quality(species, 50_000.0 / expected_polygons(species))])
        for some in islice(expand(flora, support.trunks(flora.rows, support.plants([1]))), 2):
            for pixel in (0.004, 0.001):
                made = tube_buffers(flora, [some], even(pixel)).polygons
                rows = flora.rows[some.branches.row]
                around, along = finer(rows["sides"], some.branches.radius / pixel)
                expected = (around * (rows["segments"] + rows["rings"]) * along).sum()
                assert 0.4 < made / expected < 2.5


@pytest.mark.parametrize("forks", [1, 2, 4])
def test_stems_leave_a_fork_without_a_gap(forks: int) -> None:
    """From every side the place of a fork is covered, by what forks or by a stem, and both are as wide there."""
    flora = support.compiled(
        support.small(
            order0={"forks": [forks, 0], "fork_at": 0.4, "fork_angle": [40, 5], "branches": [0, 0], "sides": 9}
        )
    )
    stems = grown(flora, seed=4)
    trunk = next(some for some in stems if not flora.rows["continues"][some.branches.row].any())
    place, radius = trunk.lines.at(np.zeros(1, int), np.ones(1))[0][0], float(trunk.branches.radius[0])
    near = tube_buffers(flora, stems, even(0.0004))
    beyond = near.positions - place.astype(np.float32)
    away = np.linalg.norm(beyond, axis=1)
    directions = np.random.default_rng(1).normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    # The ball around the place of the fork is wood: no direction is farther from a vertex of it than a few degrees.
    ball = beyond[(away > 0.4 * radius) & (away < 1.5 * radius)]
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    assert np.degrees(np.arccos(np.clip((directions @ ball.T).max(axis=1), -1.0, 1.0))).max() < 30.0


@pytest.mark.parametrize("weight", [0.02, 0.3, 1.0])
def test_ends_are_round_however_much_there_is_of_them(weight: float) -> None:
    """A flat end would turn the normals of all wood before it, which gets snow and light by them."""
    forks = {"forks": [2, 0], "fork_at": 0.4, "fork_angle": [40, 5], "branches": [0, 0]}
    flora = support.compiled(support.small(order0=forks))
    for whole in grown(flora, seed=4):
        fine = Fineness(flora.rows["sides"][whole.branches.row], np.full(len(whole), weight), np.full(len(whole), 5.0))
        rings = fine_rings(flora, whole, fine, fine_counts(flora, whole, fine, even(0.01)))
        radius = np.linalg.norm(rings.reach[0], axis=0)
        for outside, step in ((rings.t > 1.0, -1), (rings.t < 0.0, 1)):
            first = np.flatnonzero(outside & ~np.roll(outside, -step))
            assert (rings.branch[first] == rings.branch[first + step]).all()
            away = np.linalg.norm(rings.center[first] - rings.center[first + step], axis=1)
            assert (radius[first + step] - radius[first] < 0.3 * away).all()


def test_only_what_grows_on_living_wood_has_a_collar() -> None:
    """Neither trunks, nor short shoots and dead branches, nor what flares."""
    flora = support.compiled(support.RICH)
    branches = Branches.concatenate([some.branches for some in grown(flora)])
    order, thicker = flora.rows["order"][branches.row], collars(flora.rows, branches)[0] > 0
    assert {0, 1, 2, SPUR_ORDER, DEAD_ORDER} <= set(order)
    assert not thicker[(order == 0) | (order >= SPUR_ORDER)].any()
    assert thicker[(order == 1) | (order == 2)].any()
