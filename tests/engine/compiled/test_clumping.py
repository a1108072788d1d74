# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays through tetrahedra and polygons, what surfaces show of themselves, and the factor on extinction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.engine import support
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.compiled.clumping import (
    LEAST,
    MOST,
    Clumping,
    _path_lengths,
    basis,
    cell_numbers,
    covered,
    elements_of,
    factors,
)
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.refinement.contents import Contents, InCells, subplant_totals
from tetflora_addon.refinement.summaries import Summaries, extinction_matrices, summarize

seeds = st.integers(0, 2**31)


def direction_of(rng: np.random.Generator) -> NDArray[np.float64]:
    one = rng.normal(size=3)
    return one / np.linalg.norm(one)


def whole_plants(flora: Flora, seeds: Seeds) -> Contents:
    """Plants that are not opened, all in one tetrahedron."""
    whole = trunks(flora.rows, seeds)
    return Contents(InCells(whole, np.zeros(len(whole), np.int32), subplant_totals(flora, whole)))


def crossings(mesh: MeshBuffers, direction: NDArray[np.float64], spacing: float) -> float:
    """Area that the faces of a mesh show in a direction, each for itself: hits of rays × the area of each ray."""
    flat = mesh.positions[mesh.corner_verts].astype(float) @ np.stack(basis(direction), axis=1)
    face, _ = covered(flat / spacing - 0.31, mesh.face_offsets[:-1], np.diff(mesh.face_offsets))
    return len(face) * spacing**2


@given(seeds)
@settings(deadline=None, max_examples=30)
def test_ways_through_cells_add_up(seed: int) -> None:
    """To the way through the box; and each cell is met in proportion to its volume, which is the same for all."""
    rng = np.random.default_rng(seed)
    direction, shape = direction_of(rng), np.array([2, 3, 1])
    u, v = basis(direction)
    grid = (np.stack(np.meshgrid(np.arange(120), np.arange(120)), axis=-1).reshape(-1, 2) - 60 + rng.random(2)) * 0.05
    origin = shape / 2 + grid[:, :1] * u + grid[:, 1:] * v
    ray, cell, length = _path_lengths(origin, direction, shape)
    ends = np.sort(np.stack([-origin / direction, (shape - origin) / direction]), axis=0)
    whole = np.maximum(ends[1].min(axis=1) - ends[0].max(axis=1), 0)
    np.testing.assert_allclose(np.bincount(ray, length, len(origin)), whole, atol=1e-9)
    volume = np.bincount(cell, length, 6 * shape.prod()) * 0.05**2
    np.testing.assert_allclose(volume, 1 / 6, rtol=0.12)


def test_points_are_in_the_cells_that_rays_meet_there() -> None:
    rng = np.random.default_rng(5)
    points, shape = rng.random((200, 3)) * [2, 3, 1], np.array([2, 3, 1])
    direction = direction_of(rng)
    ray, cell, length = _path_lengths(points, direction, shape)
    # The way that lies on both sides of the origin is the one through the point's own cell.
    own = cell_numbers(points.T, shape)
    assert all(own[i] in cell[ray == i] for i in range(200))
    assert (length > 0).all()


@given(seeds)
@settings(deadline=None, max_examples=30)
def test_covered_points_are_as_many_as_the_area(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = np.sort(rng.random(7)) * 2 * np.pi
    polygon = 30 * rng.uniform(0.6, 1, 7)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    x, y = polygon.T
    area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    _, point = covered(polygon + rng.random(2), np.array([0]), np.array([7]))
    assert len(point) == pytest.approx(area, abs=60)
    assert len(np.unique(point, axis=0)) == len(point)


def test_nothing_covers_nothing() -> None:
    none = np.zeros(0, np.int64)
    assert len(covered(np.zeros((0, 2)), none, none)[0]) == 0


@pytest.mark.parametrize("identifier", ["oak", "birch", "conifer", "fern", "bush", "maple"])
def test_what_rays_meet_is_the_extinction_of_the_moment(identifier: str) -> None:
    """Rays meet a leaf once and a closed tube twice: Σ A |ω·n| with weights 1 and ½, which √(ωᵀSω) gives back."""
    flora, rng = support.alone(identifier, support.FEW_POLYGONS), np.random.default_rng(7)
    _, pieces = support.grown(flora, support.plants(3))
    tubes, leaves = support.meshes(flora, pieces)
    parts = [(m, w) for meshes, w in ((leaves, 1.0), (tubes, 0.5)) for m in meshes]
    areas = [w * support.face_areas(m).sum() for m, w in parts]
    moment = sum(a * support.moment(m) for a, (m, _) in zip(areas, parts, strict=True)) / sum(areas)
    summary = Summaries(np.array([sum(areas)]), np.zeros((1, 3)), np.zeros(1), moment[None])
    xx, yy, zz, xy, xz, yz = extinction_matrices(summary, np.ones(1))[0][0]
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    spacing = np.sqrt(sum(areas) / 200_000)
    for _ in range(3):
        direction = direction_of(rng)
        met = sum(w * crossings(m, direction, spacing) for m, w in parts)
        assert np.sqrt(direction @ matrix @ direction) == pytest.approx(met, rel=0.06)


def test_closed_tubes_show_a_quarter_of_their_surface_and_sheets_half_of_theirs() -> None:
    """On the mean over all directions (Cauchy); weights ½ and 1 therefore give both κ = optical area / 2 V."""
    flora = support.small_flora()
    tubes, leaves = support.meshes(flora, support.grown(flora, support.plants([1, 2]))[1])
    i = np.arange(24) + 0.5
    z, turn = i / 24, np.pi * (1 + np.sqrt(5)) * i
    sphere = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    for meshes, share in ((tubes, 0.5), (leaves, 1.0)):
        area = sum(support.face_areas(m).sum() for m in meshes)
        spacing = np.sqrt(area / 60_000)
        met = np.mean([sum(crossings(m, d, spacing) for m in meshes) for d in sphere])
        assert share * met == pytest.approx(share * area / 2, rel=0.03)


def test_outlines_show_what_meshes_show() -> None:
    """What the fit looks at is as dark as the plant that is made: area in any direction, of leaves and wood."""
    flora, rng = support.small_flora(), np.random.default_rng(2)
    whole, pieces = support.grown(flora, support.plants(4))
    tubes, leaves = support.meshes(flora, pieces)
    length = np.ones(len(flora.rows))
    things = elements_of(flora.rows, flora.forms[0], whole, np.arange(len(flora.rows)), 0, length)
    for _ in range(3):
        direction = direction_of(rng)
        shown = sum(p.shown(direction).sum() for p in things.parts)
        area = 0.0
        for meshes, weight in ((leaves, 1.0), (tubes, 0.5)):
            area += sum(weight * crossings(m, direction, 0.004) for m in meshes)
        assert shown == pytest.approx(area, rel=0.05)


def test_clusters_are_lighter_than_fog_and_more_so_in_large_cells() -> None:
    flora = support.compiled(support.shipped("bush"))
    clumping = flora.clumping
    assert flora.clumping is clumping  # fitted once
    whole = trunks(flora.rows, support.plants(np.arange(5)))
    found = clumping.coefficients(whole, clumping.whole)
    small, large = (factors(found, np.full(5, size**3)) for size in (0.15, 1.0))
    assert (large < small).all()
    assert (large < 0.8).all()
    again = support.compiled(support.shipped("bush"), support.shipped("fern")).clumping
    # whatever it is compiled with
    np.testing.assert_allclose(again.branch_only[: len(flora.rows)], clumping.branch_only)


def test_scale_of_a_plant_changes_nothing_in_cells_that_grow_with_it() -> None:
    flora = support.small_flora()
    clumping = flora.clumping
    one, other = (trunks(flora.rows, support.plants(3, scale=s)) for s in (1.0, 2.5))
    sizes = np.array([0.2**3]), np.array([0.5**3])
    offset = clumping.branch_only
    a, b = (factors(clumping.coefficients(t, offset), v) for t, v in zip((one, other), sizes, strict=True))
    np.testing.assert_allclose(a, b)


def test_leaves_strewn_at_random_are_hardly_clustered() -> None:
    """One leaf at the end of each of many twigs that stand all around: a fog, whose factor is about 1."""
    data = support.small()
    data["orders"] = [
        {"length": [2, 0], "thickness": [0.002, 0], "segments": 2, "sides": 3, "branches": [900, 0],
         "branch_start": 0.0, "azimuth": [137.5, 40]},
        {"length": [0.5, 0.49], "thickness": [0.01, 0], "segments": 1, "sides": 3, "angle": [90, 60],
         "leaves": [1, 0], "leaf_start": 0.95, "leaf_size": [0.12, 0], "leaf_angle": [90, 90]},
    ]  # fmt: skip
    scattered = support.compiled(data).clumping
    bunched = support.compiled(support.shipped("scots_pine")).clumping
    volume = np.array([0.3**3])
    of = [factors(np.array([[c.whole[0], c.root[0]]]), volume)[0] for c in (scattered, bunched)]
    assert of[0] > 0.7
    assert of[0] > of[1] + 0.1


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(1e-9, 1e9))
def test_factors_are_within_bounds(constant: float, root: float, volume: float) -> None:
    factor = factors(np.array([[constant, root]]), np.array([volume]))[0]
    assert LEAST <= factor <= MOST


def test_species_without_leaves_and_of_one_order_are_fitted() -> None:
    bare = support.small(order1={"leaves": [0, 0]}, order2={"leaves": [0, 0]})
    single = support.small()
    single["orders"] = single["orders"][:1]
    single["orders"][0]["branches"] = [0, 0]
    pole = {**single, "orders": [{"length": [10, 0], "thickness": [0.003, 0]}]}  # one thing, without extent
    flag = {**single, "orders": [{"length": [10, 0], "thickness": [0.003, 0], "leaves": 0.5, "leaf_size": [20, 0]}]}
    for data in (bare, single, pole, flag):
        found = support.compiled(data).clumping
        assert all(np.isfinite(getattr(found, name)).all() for name in ("whole", "branch_only", "root", "density"))


def test_summaries_weigh_factors_by_area() -> None:
    """Half of two equal plants' summary is either plant's; extinction takes the factor, the area stays as it is."""
    flora = support.small_flora()
    contents = whole_plants(flora, support.plants([1, 2]))
    both = summarize(flora, contents, np.zeros(1, np.int64), 1)
    volumes = np.array([8.0])
    found = flora.clumping.coefficients(contents.subplants.items, flora.clumping.whole)
    totals = contents.subplants.totals
    weight = totals.leaf_area + totals.wood_area / 2
    np.testing.assert_allclose(both.clumping[0], weight @ found / weight.sum())
    assert both.optical_area[0] == pytest.approx(weight.sum())
    even = replace(both, clumping=None)
    ratio = extinction_matrices(both, volumes)[0] / extinction_matrices(even, volumes)[0]
    np.testing.assert_allclose(ratio**0.5, factors(both.clumping, volumes)[0])


def test_light_goes_through_the_leaves_alone() -> None:
    """Transmission of leaves and wood together: that of the leaves times their share of the optical area."""
    flora = support.small_flora()
    tubes, leaves = support.meshes(flora, support.grown(flora, support.grove(100, 2.0))[1])
    leaf, wood = (sum(support.face_areas(m).sum() for m in meshes) for meshes in (leaves, tubes))
    summary = summarize(flora, whole_plants(flora, support.grove(100, 2.0)), np.zeros(1, np.int64), 1)
    expected = flora.transmission[0] * leaf / (leaf + wood / 2)
    assert summary.transmission[0] == pytest.approx(expected, rel=0.03)


def test_fitting_does_not_depend_on_unrelated_species() -> None:
    first, both = support.compiled(support.SMALL), support.compiled(support.SMALL, support.RICH)
    assert isinstance(first.clumping, Clumping)
    n = len(first.rows)
    np.testing.assert_allclose(both.clumping.root[:n], first.clumping.root)
