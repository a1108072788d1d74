# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of plants with crown shapes before they grow: totals, bounds, samples and sizes of grown ones."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from tests.engine.support import (
    RICH,
    bounding_cylinders,
    compiled,
    expanded,
    leaves_of,
    meshes,
    plants,
    small,
    small_flora,
    whole_of,
)
from tetflora_addon.arrays import spread
from tetflora_addon.compiled.flora import Flora, compile_species, extents, placed_samples
from tetflora_addon.compiled.sizes import fitted, measured
from tetflora_addon.growth.growth import leaf_counts, trunks
from tetflora_addon.growth.seasons import Season
from tetflora_addon.growth.seeds import LEAST, MOST, PLAIN, WIDTH, Branches, Seeds, crown_shapes
from tetflora_addon.species.ages import with_age
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.quality import with_quality
from tetflora_addon.subplants.pieces import wood_areas

KINDS = ("rich", "spruce 20", "beech")
FORMS = (
    {"width": 2.0, "thickness": 1.5},
    {"width": 0.5, "base": 0.5, "leaves": 0.6},
    {"base": 0.35, "east": 0.5, "north": -0.4},
)


@cache
def flora_of(kind: str, quality: float = 0.004) -> Flora:
    if kind == "rich":
        return compiled(RICH)
    name, _, years = kind.partition(" ")
    species = load_species(name)
    return compile_species([with_quality(with_age(species, float(years)) if years else species, quality)])


def shaped(n: int, **form: float) -> Seeds:
    return replace(plants(np.arange(n)), crown=crown_shapes(n, **form))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", KINDS)
def test_expected_totals_are_means_of_grown_plants(kind: str, form: dict[str, float]) -> None:
    flora, n = flora_of(kind, 0.01), 160
    own = trunks(flora.rows, shaped(n, **form))
    pieces = expanded(flora, own)
    branches = whole_of(flora, pieces).branches
    owner, _, size = leaves_of(flora, branches)
    leaf = size**2 * flora.leaf.area[branches.row][owner]
    faces = leaf_counts(flora.rows, branches) @ flora.leaf.polygons[branches.row]
    rows = flora.rows[branches.row]
    wood_faces = (rows["sides"] * (rows["segments"] + rows["rings"])).sum()
    assert_allclose(flora.leaf_areas(own).sum(), leaf.sum(), rtol=0.05)
    assert_allclose(flora.wood_areas(own).sum(), wood_areas(flora, pieces).sum(), rtol=0.05)
    assert_allclose(flora.branch_faces(own).sum(), wood_faces, rtol=0.05)
    assert_allclose(flora.face_counts(own).sum(), wood_faces + faces, rtol=0.05)


def test_days_leave_as_much_of_formed_crowns_as_of_others() -> None:
    flora = compile_species([load_species("beech")])
    bare = flora.in_year(Season(day=285.0))
    summer, autumn = (trunks(some.rows, shaped(50, width=0.6, base=0.4)) for some in (flora, bare))
    plain = [trunks(some.rows, plants(np.arange(50))) for some in (flora, bare)]
    left = [some.leaf_areas(own) for some, own in zip((bare, flora), (autumn, summer), strict=True)]
    assert_allclose(left[0] / left[1], bare.leaf_areas(plain[1]) / flora.leaf_areas(plain[0]), rtol=1e-6)
    assert left[0].sum() < 0.95 * left[1].sum()


@pytest.mark.parametrize("kind", KINDS)
def test_plain_forms_have_the_same_totals_and_samples(kind: str) -> None:
    flora, n = flora_of(kind), 20
    own, plain = trunks(flora.rows, shaped(n)), trunks(flora.rows, plants(np.arange(n)))
    for name in ("leaf_areas", "wood_areas", "face_counts", "branch_faces"):
        assert_array_equal(getattr(flora, name)(own), getattr(flora, name)(plain))
    assert_array_equal(extents(flora, own), extents(flora, plain))
    for one, other in zip(bounding_cylinders(flora, own), bounding_cylinders(flora, plain), strict=True):
        assert_array_equal(one, other)


@given(seed=st.integers(0, 1000), part=st.tuples(*[st.floats(0.0, 1.0)] * 6), kind=st.sampled_from((*KINDS, "small")))
@settings(max_examples=12, deadline=None)
def test_all_vertices_are_within_the_bounds(seed: int, part: tuple[float, ...], kind: str) -> None:
    flora = small_flora() if kind == "small" else flora_of(kind, 0.001)
    form = LEAST + np.array(part) * (MOST - LEAST)
    within_bounds(flora, trunks(flora.rows, replace(plants(seed), crown=form[None])))


@pytest.mark.parametrize("base", [0.3, 0.5, 0.95])
@pytest.mark.parametrize("forks", [0, 2])
@pytest.mark.parametrize("tip", [10, 90])
def test_long_limbs_that_sit_high_are_within_the_bounds(base: float, forks: int, tip: float) -> None:
    """The crown begins farther up and keeps its shape: limbs that are described near the ground are near the top."""
    flora = compiled(
        small(
            order0={
                "length": [10, 0], "curvature": [0, 0], "angle": [0, 0], "branches": [40, 0], "branch_start": 0.05,
                "crown": "conical", "forks": [forks, 0], "fork_at": 0.4, "fork_angle": [30, 0],
            },
            order1={"length": [0.8, 0], "curvature": [0, 0], "angle": [10, 0], "angle_tip": tip, "branches": [0, 0]},
        )
    )  # fmt: skip
    within_bounds(flora, trunks(flora.rows, shaped(1, base=base)))


def within_bounds(flora: Flora, whole: Branches) -> None:
    tubes, leaves = meshes(flora, expanded(flora, whole))
    center, radius, half = bounding_cylinders(flora, whole)
    axis = whole.frame[0, :, 2]
    for mesh in (*tubes, *leaves):
        offset = mesh.positions - center[0]
        along = offset @ axis
        across = np.linalg.norm(offset - along[:, None] * axis, axis=1)
        assert np.abs(along).max() <= half[0] + 1e-4
        assert across.max() <= radius[0] + 1e-4


def sampled(flora: Flora, own: Branches) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places of leaves of plants by their samples, and what each stands for."""
    points = flora.samples.leaves
    first, number = points.runs(own)
    owner, index = spread(number)
    place, share = placed_samples(flora, points, own, owner, first[owner] + index)
    world = np.einsum("nij,nj->ni", own.frame[owner], place) * own.length[owner, None]
    return world, np.ones(len(owner)) if share is None else share


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", KINDS)
def test_samples_are_where_leaves_grow(kind: str, form: dict[str, float]) -> None:
    flora = flora_of(kind)
    own = trunks(flora.rows, shaped(40, **form))
    branches = whole_of(flora, expanded(flora, own)).branches
    _, place, size = leaves_of(flora, branches)
    there, share = sampled(flora, own)
    assert_allclose(share.mean(), 1.0, rtol=0.05)
    height = np.average(place[:, 2], weights=size**2)
    spread_ = np.sqrt(np.average((place[:, :2] ** 2).sum(axis=1), weights=size**2))
    assert_allclose(np.average(there[:, 2], weights=share), height, rtol=0.08)
    assert_allclose(np.sqrt(np.average((there[:, :2] ** 2).sum(axis=1), weights=share)), spread_, rtol=0.12)
    assert_allclose(
        np.average(there[:, :2], axis=0, weights=share),
        np.average(place[:, :2], axis=0, weights=size**2),
        atol=0.12 * spread_,
    )


@pytest.mark.parametrize(
    "form", [*FORMS, {"width": 3.0, "east": 0.5, "north": 0.5}, {"width": 0.3}, {"base": 0.8}], ids=str
)
@pytest.mark.parametrize("kind", [*KINDS, "willow", "hazel"])
def test_samples_are_within_the_extents(kind: str, form: dict[str, float]) -> None:
    """What is looked for where samples are finds all of them, on the side to which a crown leans too."""
    flora = flora_of(kind)
    own = trunks(flora.rows, shaped(2, **form))
    radius, low, high = extents(flora, own).T * 1.001
    for points in (flora.samples.leaves, flora.samples.wood):
        first, number = points.runs(own)
        owner, index = spread(number)
        place, _ = placed_samples(flora, points, own, owner, first[owner] + index)
        assert (np.hypot(place[:, 0], place[:, 1]) <= radius[owner]).all()
        assert (place[:, 2] <= high[owner]).all() and (place[:, 2] >= low[owner] - 1e-6).all()


def test_turned_samples_reach_to_the_light_as_others_do() -> None:
    flora = flora_of("beech")
    own = trunks(flora.rows, shaped(30, east=0.6))
    points, turn = flora.samples.leaves, 2.0
    first, number = points.runs(own)
    owner, index = spread(number)
    place, share = placed_samples(flora, points, own, owner, first[owner] + index, np.full(len(owner), turn))
    c, s = np.cos(turn), np.sin(turn)
    place = place @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    world = np.einsum("nij,nj->ni", own.frame[owner], place) * own.length[owner, None]
    straight = np.average(*sampled(flora, own)[:1], axis=0, weights=sampled(flora, own)[1])
    turned = np.average(world, axis=0, weights=share)
    assert turned[0] > 0.5
    assert_allclose(turned, straight, atol=0.3)


def grown_sizes(flora: Flora, seeds: Seeds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Heights and crown widths of plants, when all of them has grown."""
    own = trunks(flora.rows, seeds)
    sizes = []
    for i in range(len(own)):
        tubes, leaves = meshes(flora, expanded(flora, own.take(np.array([i]))))
        points = np.concatenate([mesh.positions for mesh in (*tubes, *leaves)])
        extent = np.ptp(points, axis=0)
        sizes.append((points[:, 2].max(), extent[:2].mean()))
    return tuple(np.array(sizes).T)


@pytest.mark.parametrize("kind", KINDS)
def test_sizes_are_measured_and_fitted_as_plants_grow(kind: str) -> None:
    flora, n = flora_of(kind, 0.06), 12
    rng = np.random.default_rng(3)
    seeds = replace(plants(np.arange(n)), crown=crown_shapes(n, rng.uniform(0.6, 1.6, n), rng.uniform(0, 0.5, n)))
    height, width = measured(flora, seeds)
    real = grown_sizes(flora, seeds)
    assert_allclose(height, real[0], rtol=0.08)
    assert_allclose(width, real[1], rtol=0.16)
    assert_allclose(np.mean(width / real[1]), 1.0, rtol=0.05)
    assert_allclose(measured(flora, seeds.take(np.array([3]))), [height[3:4], width[3:4]], rtol=1e-12)  # alone
    wanted = height * rng.uniform(0.9, 1.1, n), width * rng.uniform(0.8, 1.2, n)
    factors = fitted(flora, seeds, *wanted)
    crown = seeds.crown.copy()
    crown[:, WIDTH] *= factors[:, 1]
    found = measured(flora, replace(seeds, scale=seeds.scale * factors[:, 0], crown=crown))
    for own, other in zip(found, wanted, strict=True):
        assert (np.abs(own / other - 1) < 0.05).mean() > 0.8


def test_sizes_depend_on_no_other_plants() -> None:
    flora, n = flora_of("beech"), 30
    seeds = replace(plants(np.arange(n)), crown=np.tile(PLAIN, (n, 1)))
    some = np.arange(0, n, 3)
    for all_of, one in zip(measured(flora, seeds), measured(flora, seeds.take(some)), strict=True):
        assert_array_equal(all_of[some], one)
    wanted = np.linspace(8, 14, n), np.linspace(4, 9, n)
    few = fitted(flora, seeds.take(some), *(one[some] for one in wanted))
    assert_array_equal(fitted(flora, seeds, *wanted)[some], few)
