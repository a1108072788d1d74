# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Summaries of tetrahedra and their extinction, against what flakes of known orientation show."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.refinement.contents import Contents, InCells, as_pieces, piece_totals, subplant_totals
from tetflora_addon.refinement.summaries import Summaries, extinction_matrices, summarize
from tetflora_addon.tetrahedra.tree import TetrahedralTree


def of_everything(flora: Flora, contents: Contents, nodes: int) -> Summaries:
    return summarize(flora, contents, np.zeros(nodes, np.int64), 1)


def as_summaries(moment: NDArray[np.float64], area: float = 1.0) -> Summaries:
    return Summaries(np.array([area]), np.zeros((1, 3)), np.zeros(1), np.asarray(moment, float)[None])


def kappa(packed: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """√(ωᵀSω) for directions (n, 3)."""
    xx, yy, zz, xy, xz, yz = packed
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", directions, matrix, directions), 0))


def sphere(count: int, seed: int = 0) -> NDArray[np.float64]:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def test_isotropic_surfaces_show_half_their_area_everywhere() -> None:
    packed, _, plane = extinction_matrices(as_summaries(np.eye(3) / 3, area=5.0), np.array([2.0]))
    np.testing.assert_allclose(kappa(packed[0], sphere(50)), 5.0 / 2 / 2.0, rtol=1e-9)
    assert plane[0] == pytest.approx(0, abs=1e-9)


@given(st.integers(0, 2**31))
@settings(deadline=None, max_examples=30)
def test_parallel_flakes_show_the_cosine(seed: int) -> None:
    normal = sphere(1, seed)[0]
    packed, axis, plane = extinction_matrices(as_summaries(np.outer(normal, normal), area=3.0), np.array([1.5]))
    directions = sphere(50, seed + 1)
    np.testing.assert_allclose(kappa(packed[0], directions), 2.0 * np.abs(directions @ normal), atol=1e-3)
    assert abs(axis[0] @ normal) == pytest.approx(1)
    assert plane[0] == pytest.approx(1)


@given(st.integers(0, 2**31), st.floats(0, 4))
@settings(deadline=None, max_examples=30)
def test_extinction_is_close_to_that_of_real_flakes(seed: int, order: float) -> None:
    """Flakes gathered about an axis, from all ways round to nearly parallel: Σ A |ω·n| / V within 6 %."""
    rng = np.random.default_rng(seed)
    normals = sphere(20_000, seed)
    normals[:, 2] *= 1 + order
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    normals = normals @ turn.T
    packed, _, _ = extinction_matrices(as_summaries(normals.T @ normals / len(normals)), np.ones(1))
    directions = sphere(40, seed + 1)
    real = np.abs(directions @ normals.T).mean(axis=1)
    assert np.abs(kappa(packed[0], directions) - real).max() < 0.06 * real.max()


def whole(flora: Flora, seeds: Seeds) -> Contents:
    """Plants that are not divided, in one node."""
    plants = trunks(flora.rows, seeds)
    return Contents(InCells(plants, np.zeros(len(plants), np.int32), subplant_totals(flora, plants)))


def divided(
    flora: Flora, seeds: Seeds, seed: int, kind: str = "PERSP", rounds: int = 2
) -> tuple[TetrahedralTree, Contents]:
    """Plants shared among the nodes that the loop makes for some camera; then all are divided, and plants opened."""
    place = np.random.default_rng(seed).uniform(-1, 1, 3) * [30, 30, 10] + [0, 0, 12]
    camera = support.camera(place, (0, 0, 1.5), pixels=128, view=0.5 if kind == "PERSP" else 10.0, kind=kind)
    result = run(flora, seeds, camera, cutoff=2.0)[1]
    tree, plants = result.tree, result.plants
    for _ in range(rounds):
        nodes = np.unique(plants.points.cell)
        tree.split(nodes)
        dividing = np.zeros(len(tree), bool)
        dividing[nodes] = True
        plants.update(tree, dividing, np.zeros(len(tree)))
    return tree, Contents(*plants.held_apart(len(tree)))


@given(st.integers(0, 2**31), st.sampled_from(["PERSP", "ORTHO"]))
@settings(deadline=None, max_examples=12)
def test_summaries_of_any_division(seed: int, kind: str) -> None:
    """Means are means: colors within those of the species, moments of trace 1, areas those of the contents."""
    flora = support.small_flora()
    tree, contents = divided(flora, support.grove(4, 2.0), seed, kind)
    nodes = np.unique(np.concatenate([contents.subplants.cell, contents.pieces.cell]))
    assert len(nodes) > 4
    index = np.full(len(tree), -1)
    index[nodes] = np.arange(len(nodes))
    each = summarize(flora, contents, index, len(nodes))
    held = [
        np.bincount(kind.cell, kind.totals.optical_area, len(tree)) for kind in (contents.subplants, contents.pieces)
    ]
    np.testing.assert_allclose(each.optical_area, sum(held)[nodes])
    everything = of_everything(flora, contents, len(tree))
    assert each.optical_area.sum() == pytest.approx(everything.optical_area[0], rel=1e-9)
    undivided = subplant_totals(flora, trunks(flora.rows, support.grove(4, 2.0)))
    assert everything.optical_area[0] == pytest.approx(undivided.optical_area.sum(), rel=0.15)
    held = each.optical_area > 0
    np.testing.assert_allclose(np.trace(each.moment[held], axis1=1, axis2=2), 1)
    assert np.linalg.eigvalsh(each.moment[held]).min() > -1e-9
    np.testing.assert_allclose(each.moment, each.moment.transpose(0, 2, 1), atol=1e-12)
    colors = np.concatenate([flora.rows[n][:, 0] for n in ("leaf_color", "branch_color")])
    assert (each.color[held] >= colors.min(axis=0) - 1e-9).all()
    assert (each.color[held] <= colors.max(axis=0) + 1e-9).all()
    assert ((each.transmission >= 0) & (each.transmission <= flora.transmission[0] + 1e-12)).all()
    weighted = each.optical_area @ each.color / each.optical_area.sum()
    np.testing.assert_allclose(weighted, everything.color[0], rtol=1e-9)


def test_sums_do_not_depend_on_how_contents_are_opened() -> None:
    """Many plants held whole, or opened to all branches alone: area, color, transmission and moment stay."""
    data = support.small(
        order1={"leaf_color": [[0.6, 0.5, 0.1], [0, 0, 0]], "branch_color": [[0.1, 0.1, 0.1], [0, 0, 0]]},
        order2={"leaf_color": [[0.1, 0.3, 0.1], [0, 0, 0]], "branch_color": [[0.4, 0.2, 0.1], [0, 0, 0]]},
    )
    flora = support.compiled(data)
    seeds = support.grove(250, 1.5)
    one = of_everything(flora, whole(flora, seeds), 1)
    _, every = support.grown(flora, seeds)
    alone = as_pieces(every.branches.take(np.flatnonzero(every.t0 == 0)))
    opened = Contents(pieces=InCells(alone, np.zeros(len(alone), np.int32), piece_totals(flora, alone)))
    tree, contents = divided(flora, seeds, 5, rounds=1)
    assert min(len(contents.pieces), len(contents.subplants)) > 200
    for other in (of_everything(flora, opened, 1), of_everything(flora, contents, len(tree))):
        assert other.optical_area[0] == pytest.approx(one.optical_area[0], rel=0.03)
        np.testing.assert_allclose(other.color, one.color, rtol=0.03)
        np.testing.assert_allclose(other.transmission, one.transmission, rtol=0.03)
        np.testing.assert_allclose(other.moment, one.moment, atol=0.03)


def test_summaries_against_the_polygons_that_would_be_made() -> None:
    flora = support.small_flora()
    seeds = support.grove(100, 2.0)
    summary = of_everything(flora, whole(flora, seeds), 1)
    tubes, leaves = support.meshes(flora, support.grown(flora, seeds)[1])
    faces = [(m, w) for meshes, w in ((leaves, 1.0), (tubes, 0.5)) for m in meshes]
    area = sum(w * support.face_areas(m).sum() for m, w in faces)
    assert summary.optical_area[0] == pytest.approx(area, rel=0.03)
    moment = sum(w * support.face_areas(m).sum() * support.moment(m) for m, w in faces) / area
    np.testing.assert_allclose(summary.moment[0], moment, atol=0.03)
    color = sum(w * support.face_areas(m) @ m.attributes["tf_color"][1] for m, w in faces) / area
    np.testing.assert_allclose(summary.color[0], color, rtol=0.03)


def test_contents_of_other_nodes_are_passed_over() -> None:
    flora = support.small_flora()
    contents = whole(flora, support.grove(3, 2.0))
    nothing = summarize(flora, contents, np.array([-1]), 2)
    assert (nothing.optical_area == 0).all()
    assert np.isfinite(nothing.moment).all()
    packed, _, _ = extinction_matrices(nothing, np.ones(2))
    assert (packed == 0).all()
