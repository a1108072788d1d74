# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves that fill solids evenly, and leaves that stand by an inclination distribution."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.engine import support
from tests.engine.refinement.test_loop import check, run
from tetflora_addon.arrays import spread
from tetflora_addon.compiled.clumping import fingerprint
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.compiled.orientation import leaf_moments
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.errors import SpeciesError
from tetflora_addon.growth.axes import axes
from tetflora_addon.growth.foliage import leaf_keys, leaf_places, place_leaves, settled
from tetflora_addon.growth.growth import leaf_counts, trunks
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.jobs import run_to_end
from tetflora_addon.proxies.facet_weights import facet_weights, fitting
from tetflora_addon.refinement.shared_parts import SharedPlants
from tetflora_addon.species.species import LEAF_ENVELOPES, LEAF_INCLINATIONS

SOLIDS, RADIUS, BARE = LEAF_ENVELOPES[1:], 0.3, 0.2
#: Mean |cos| of the inclination, by integration of the densities.
MEANS = {
    "spherical": 1 / 2,
    "planophile": 8 / (3 * np.pi),
    "erectophile": 4 / (3 * np.pi),
    "plagiophile": 32 / (15 * np.pi),
    "extremophile": 28 / (15 * np.pi),
    "uniform": 2 / np.pi,
}


def one_order(solid: str = "sphere", leaves: int = 20_000, **keys: Any) -> dict[str, Any]:
    """A species of one branch, 4 m long, with all leaves of the plant."""
    order = {
        "length": 4, "thickness": 0.001, "taper": 0, "sides": 3, "leaves": leaves, "leaf_start": BARE,
        "leaf_size": [0.1, 0.03], "leaf_light": 0, "leaf_envelope": solid, "leaf_envelope_radius": RADIUS,
        "leaf_inclination": "spherical", **keys,
    }  # fmt: skip
    return {"format": 1, "name": "Discs", "leaf": {"model": "round"}, "orders": [order]}


@cache
def compiled(solid: str, leaves: int = 20_000) -> Flora:
    return support.compiled(one_order(solid, leaves))


def leaves_on(flora: Flora, branches: Branches, some: NDArray[np.int64] | None = None) -> tuple[NDArray, NDArray]:
    """Middles (m, 3) and frames (m, 3, 3) of leaves of branches, or some of them."""
    rows, counts = flora.rows, leaf_counts(flora.rows, branches)
    owner, index = spread(counts) if some is None else (of[some] for of in spread(counts))
    key = leaf_keys(branches, owner, index)
    t = leaf_places(rows, branches, owner, index, counts, key)
    leaves = place_leaves(rows, branches, axes(rows, branches), owner, index, key, t)
    frame = settled(rows, branches.row[owner], leaves.frame, leaves.light, leaves.sky)
    return leaves.position + 0.5 * leaves.size[:, None] * frame[:, :, 1], frame


def plant(flora: Flora, seed: int = 3) -> Branches:
    return trunks(flora.rows, support.plants(seed))


def even_numbers(solid: str, place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Three numbers (n, 3) that are even and independent for points (n, 3) that are even in a solid of size 1."""
    x, y, up = place.T
    if solid == "box":
        return np.stack([(x + 1) / 2, (y + 1) / 2, up], axis=1)
    below, width = {
        "sphere": (up * up * (3 - 2 * up), 2 * np.sqrt(up * (1 - up))),
        "cylinder": (up, 1.0),
        "cone": (1 - (1 - up) ** 3, 1 - up),
    }[solid]
    return np.stack([(x * x + y * y) / width**2, np.arctan2(y, x) / (2 * np.pi) + 0.5, below], axis=1)


@pytest.mark.parametrize("solid", SOLIDS)
def test_middles_of_leaves_are_even_in_the_solid(solid: str) -> None:
    """Counts in 216 parts of equal volume differ as chance has it (chi-square), and none is outside."""
    flora = compiled(solid)
    whole = plant(flora)
    local = (leaves_on(flora, whole)[0] - whole.position) @ whole.frame[0] / whole.length[0]
    local = np.stack([local[:, 0] / RADIUS, local[:, 1] / RADIUS, (local[:, 2] - BARE) / (1 - BARE)], axis=1)
    numbers = even_numbers(solid, local)
    assert numbers.min() > -1e-5
    assert numbers.max() < 1 + 1e-5
    counts = np.histogramdd(numbers.clip(0, 1 - 1e-12), (np.linspace(0, 1, 7),) * 3)[0]
    expected = len(numbers) / counts.size
    assert ((counts - expected) ** 2 / expected).sum() < counts.size + 5 * np.sqrt(2 * counts.size)


@pytest.mark.parametrize("kind", LEAF_INCLINATIONS[1:])
@pytest.mark.parametrize("solid", ["none", "sphere"])
def test_leaves_stand_by_the_distribution(kind: str, solid: str) -> None:
    flora = support.compiled(one_order(solid, leaf_inclination=kind))
    whole = plant(flora)
    frame = whole.frame[0].T @ leaves_on(flora, whole)[1]
    normal = frame[:, :, 2]
    assert np.abs(normal[:, 2]).mean() == pytest.approx(MEANS[kind], abs=0.01)
    moment = normal.T @ normal / len(normal)
    np.testing.assert_allclose(moment, np.diag(np.diag(moment)), atol=0.012)  # all around
    assert moment[0, 0] == pytest.approx(moment[1, 1], abs=0.015)
    assert np.abs(normal.mean(axis=0)).max() < 0.02  # both sides alike
    level = np.stack([-normal[:, 1], normal[:, 0], 0 * normal[:, 0]], axis=1)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    assert ((frame[:, :, 1] * level).sum(axis=1) ** 2).mean() == pytest.approx(0.5, abs=0.015)  # in their plane
    np.testing.assert_allclose(frame.transpose(0, 2, 1) @ frame, np.tile(np.eye(3), (len(frame), 1, 1)), atol=1e-5)
    assert np.linalg.det(frame.astype(float)).min() > 0


def test_spherical_leaves_have_no_direction() -> None:
    flora = compiled("cone")
    np.testing.assert_allclose(leaf_moments(flora.orientation, plant(flora))[0], np.eye(3) / 3, atol=0.006)


@pytest.mark.parametrize("solid", SOLIDS)
def test_a_leaf_is_the_same_alone_and_in_the_whole(solid: str) -> None:
    flora = compiled(solid)
    some = np.array([19_999, 7, 4_000])
    whole, alone = (leaves_on(flora, plant(flora), of) for of in (None, some))
    for all_of, own in zip(whole, alone, strict=True):
        np.testing.assert_array_equal(own, all_of[some])


@pytest.mark.parametrize("solid", SOLIDS)
def test_expected_area_is_that_of_leaves_of_all_places(solid: str) -> None:
    """Leaves differ by the part of the solid below them, of which averages know."""
    flora = support.compiled(one_order(solid, 5_000, leaf_size_tip=0.4, leaf_size_young=1.5, leaf_size=0.1))
    seeds = support.plants(2)
    leaves = [block.buffers for block in expanded_blocks(flora, seeds) if block.kind == "leaf"]
    grown = sum(support.face_areas(buffers).sum() for buffers in leaves)
    assert grown == pytest.approx(flora.leaf_areas(trunks(flora.rows, seeds))[0], rel=1e-3)


def test_boxes_stand_as_their_plants_do() -> None:
    flora = support.compiled(one_order("box"), one_order("sphere"))
    frames = trunks(flora.rows, support.plants(np.arange(4), [0, 0, 1, 1])).frame
    np.testing.assert_allclose(frames[:2], np.tile(np.eye(3), (2, 1, 1)), atol=1e-12)
    assert np.abs(frames[2:, 0, 1]).min() > 1e-3


def of_two_orders() -> dict[str, Any]:
    """A cone upon a trunk."""
    cone = one_order("cone", 3_000)["orders"][0]
    trunk = {"length": 0.5, "thickness": 0.1, "taper": 1, "sides": 8, "branches": 1, "branch_start": 0.99}
    return {**one_order(), "orders": [trunk, {**cone, "length": 8}]}


SCENES = {**{solid: one_order(solid, 4_000) for solid in SOLIDS}, "cone on a trunk": of_two_orders()}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("pixels", [2, 20, 200])
def test_all_area_is_drawn_at_any_size(name: str, pixels: int) -> None:
    """Real leaves and facets together have the plants' area, and facets lie where leaves are."""
    flora = support.compiled(SCENES[name])
    seeds = support.grove(9, 5.0)
    camera = support.camera((30, 0, 18), (0, 0, 2), pixels=5 * pixels, view=20.0, kind="ORTHO")
    _, result = run(flora, seeds, camera)
    check(flora, seeds, result)
    blocks, made, _ = support.drawn(flora, result, camera, 0.5, 1.5, weighted=False, hidden=0.4)
    area = (made.side**2).sum()
    for block in blocks:
        area += support.face_areas(block.buffers).sum() / (2 if block.kind == "bark" else 1)
    whole = trunks(flora.rows, seeds)
    expected = flora.leaf_areas(whole).sum()
    assert area == pytest.approx(expected + flora.wood_areas(whole).sum() / 2, rel=0.03)
    if pixels >= 8 and len(made):
        beside = made.center - [0.0, 0.0, 2.0]
        away = np.abs(beside[:, None, :2] - seeds.position[None, :, :2]).max(axis=2).min(axis=1)
        assert away.max() < RADIUS * 4 + 0.2


def test_points_of_a_solid_are_all_different_and_even() -> None:
    """It cannot be opened, and proxies that fill their cells must find it everywhere."""
    flora = compiled("sphere")
    seeds = support.plants(5)
    camera = support.camera((30, 0, 18), (0, 0, 2), pixels=1000, view=10.0, kind="ORTHO")
    points = SharedPlants(flora, seeds, camera, filled=True).points
    place = points.position[points.leaf > 0].astype(float)
    assert len(np.unique(place, axis=0)) == len(place) > 3_000
    assert points.leaf.sum() == pytest.approx(flora.leaf_areas(trunks(flora.rows, seeds))[0], rel=1e-5)
    center = [0.0, 0.0, 4 * (BARE + 1) / 2]
    relative = (place - center) / np.array([4 * RADIUS, 4 * RADIUS, 2 * (1 - BARE)])
    assert (relative**2).sum(axis=1).mean() == pytest.approx(0.6, abs=0.02)


def test_weights_of_solids_are_whole_where_facets_are_as_small_as_leaves() -> None:
    flora = support.compiled(one_order("sphere", 30_000, leaf_size=0.03, leaf_start=0))
    found = run_to_end(fitting(flora, 0, 6_000.0))
    assert np.isfinite(found).all()
    assert (np.diff(found[1, 0, 2:]) > -0.03).all()
    assert found[1, 0, 0] < 0.8
    weights = facet_weights(flora)
    many = weights.of_pieces(np.zeros(3, int), np.array([1024.0, 16 * 1024.0, 1e12]))
    assert many[0] == pytest.approx(weights.branch_only[0, 0, -1])
    assert 1 - many[1] == pytest.approx((1 - many[0]) / 4)
    assert many[2] == pytest.approx(1.0, abs=1e-4)


def test_each_key_of_an_envelope_counts_in_the_fingerprint() -> None:
    prints = set()
    for changes in ({}, {"leaf_envelope_radius": 0.2}, {"leaf_envelope": "cone"}, {"leaf_inclination": "uniform"}):
        other = support.compiled(one_order(**changes))
        prints.add(fingerprint(other.rows, other.forms[0], 1))
    assert len(prints) == 4


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"forks": [2, 0]}, "leaf_envelope: must be"),
        ({"leaf_envelope": "pyramid"}, "must be one of none, sphere"),
        ({"leaf_inclination": 3}, "must be one of branch, spherical"),
        ({"leaf_envelope_radius": 0}, "0.001 to 20"),
    ],
)
def test_mistakes_are_named(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(SpeciesError, match=told):
        support.compiled(one_order(**changes))
