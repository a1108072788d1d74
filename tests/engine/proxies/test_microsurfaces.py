# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Microsurfaces stand for surfaces that are not made: as much area, turned the same way, in the same place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.subplants.test_leaf_meshes import check_topology
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seasons import Season
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.optics import GLOSS
from tetflora_addon.proxies.microsurfaces import CIRCUMRADIUS, STRETCH, FacetRules, subplant_facets
from tetflora_addon.refinement.contents import subplant_totals
from tetflora_addon.species.catalog import load_species


def facets(flora: Flora, subplants: Branches, side: float) -> MeshBuffers:
    return support.facet_mesh(subplant_facets(flora, subplants, FacetRules(np.full(len(subplants), side))))


def part(mesh: MeshBuffers, leaves: bool) -> np.ndarray:
    """Faces that stand for leaves, or for wood."""
    return (mesh.attributes["tf_transmission"][1] > 0) == leaves


def moment_of(mesh: MeshBuffers, chosen: np.ndarray) -> np.ndarray:
    vectors = support.face_vectors(mesh)[chosen]
    areas = np.linalg.norm(vectors, axis=1)
    return np.einsum("ni,nj->ij", vectors / areas[:, None], vectors) / areas.sum()


@pytest.mark.parametrize("side", [0.05, 0.3, 1.5])
@pytest.mark.parametrize("name", ["bush", "conifer", "fern", "grass", "oak", "rowan"])
def test_area_is_kept_at_any_size(name: str, side: float) -> None:
    """Leaves count in full, closed branches half; plants are small enough for facets larger than all of them."""
    flora, species = support.alone(name, support.FEW_POLYGONS), 0
    number = 60 if side > 0.1 else 1
    plants = trunks(flora.rows, support.plants(np.arange(number), species))
    mesh = facets(flora, plants, side)
    check_topology(mesh)
    totals, areas = subplant_totals(flora, plants), support.face_areas(mesh)
    for leaves, expected in ((True, totals.leaf_area), (False, totals.wood_area / 2)):
        found = areas[part(mesh, leaves)]
        error = np.sqrt(number) / 2 * side**2  # of rounding a number of facets up or down, at most
        assert found.sum() == pytest.approx(expected.sum(), abs=4 * error + 1e-3 * expected.sum())


def test_small_numbers_are_met_on_average_and_from_all_samples() -> None:
    """Sub-plants of a tenth of a facet: one in ten gets one, and they do not crowd at a few places."""
    still = {"leaf_light": 0}
    upright = {"length": [3, 0], "angle": [0, 0], "branches": [7, 0]}
    flora = support.compiled(support.small(order0=upright, order1=still, order2=still))
    n = 20_000
    plants = trunks(flora.rows, support.plants(np.arange(n)))
    side = np.sqrt(subplant_totals(flora, plants).leaf_area * 10)
    mesh = support.facet_mesh(subplant_facets(flora, plants, FacetRules(side)))
    leaves = part(mesh, True)
    assert leaves.sum() == pytest.approx(n / 10, abs=4 * np.sqrt(n * 0.09))
    heights = support.face_centers(mesh)[leaves][:, 2]
    assert len(np.unique(np.round(heights, 5))) > 500  # each height is that of one sample
    totals = subplant_totals(flora, plants)
    total = support.face_areas(mesh)[leaves].sum()
    assert total == pytest.approx(totals.leaf_area.sum(), rel=0.1)


@pytest.mark.parametrize("name", ["birch", "bush", "conifer", "oak", "spruce"])
def test_orientation_and_place_are_those_of_the_plant(name: str) -> None:
    """Facets of whole plants against their leaves: moment, mean height and spread; wood against its tubes."""
    flora, species = support.alone(name, support.FEW_POLYGONS), 0
    seeds = support.plants(np.arange(8), species)
    trunk, pieces = support.grown(flora, seeds)
    mesh = facets(flora, trunk, 0.1)
    tubes, leaves = support.meshes(flora, pieces)
    height = trunk.length.mean()
    for is_leaf, meshes in ((True, leaves), (False, tubes)):
        chosen = part(mesh, is_leaf)
        # A facet is flat where a leaf may be bent or of several blades.
        np.testing.assert_allclose(moment_of(mesh, chosen), support.moment(*meshes), atol=0.12 if is_leaf else 0.05)
        areas = np.concatenate([support.face_areas(real) for real in meshes])
        places = np.concatenate([support.face_centers(real) for real in meshes])
        for axis in (0, 1, 2):
            center, other = support.face_centers(mesh)[chosen][:, axis], places[:, axis]
            mean = np.average(other, weights=areas)
            spread = np.sqrt(np.average((other - mean) ** 2, weights=areas))
            assert center.mean() == pytest.approx(mean, abs=0.15 * max(spread, 0.1 * height))
            assert center.std() == pytest.approx(spread, rel=0.15, abs=0.02 * height)


@given(st.integers(-(2**63), 2**63 - 1), st.floats(0.02, 2), st.floats(0.1, 10))
@settings(deadline=None, max_examples=20)
def test_facets_stay_by_their_plant(seed: int, side: float, scale: float) -> None:
    """Centers within the bound, but for half a leaf; corners half a diagonal further."""
    flora = support.small_flora()
    plant = trunks(flora.rows, support.plants(seed, scale=scale, position=(3, 4, 5)))
    mesh = support.facet_mesh(subplant_facets(flora, plant, FacetRules(np.array([side * scale]))))
    assume(mesh.polygons)
    center, radius, half_height = support.bounding_cylinders(flora, plant)
    offset = support.face_centers(mesh) - center
    along = offset @ plant.frame[0, :, 2]
    across = np.linalg.norm(offset - along[:, None] * plant.frame[0, :, 2], axis=1)
    assert np.abs(along).max() <= half_height[0] * (1 + 1e-5)
    assert across.max() <= radius[0] * (1 + 1e-5)
    color, weight = (mesh.attributes[n][1] for n in ("tf_color", "tf_transmission"))
    assert 0 <= color.min() <= color.max() <= 1
    assert set(np.unique(weight)) <= {np.float32(0), np.float32(flora.transmission[0])}
    assert support.face_areas(mesh).min() > 0


def test_facets_have_the_shape_of_their_things_and_share_the_area_of_their_plant() -> None:
    """As large as asked for or as a leaf, but for what it takes to have exactly the area of each plant."""
    flora = support.small_flora()
    plant = trunks(flora.rows, support.plants(np.arange(5)))
    totals = subplant_totals(flora, plant)
    leaf = flora.area_nodes[0, 0] / flora.leaf_count[0]
    for side in (1e-2, 0.1):
        mesh = facets(flora, plant, side)
        corners = mesh.positions.reshape(-1, 3, 3).astype(float)
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        areas, leafy = support.face_areas(mesh), part(mesh, True)
        np.testing.assert_allclose(edges[leafy], np.tile(edges[leafy].mean(axis=1)[:, None], 3), rtol=2e-3)
        # Wood is long and thin: as long as an equilateral triangle would be, times `STRETCH`.
        longest = STRETCH * 1.5 * CIRCUMRADIUS * np.sqrt(areas[~leafy])
        assert edges[~leafy].max(axis=1) == pytest.approx(
            np.hypot(longest, longest / STRETCH**2 / np.sqrt(3)), rel=0.02
        )
        expected = np.where(leafy, max(side**2, leaf), side**2)
        assert (np.abs(areas / expected - 1) < 0.5).all()
        assert areas[leafy].sum() == pytest.approx(totals.leaf_area.sum(), rel=1e-4)
        assert areas[~leafy].sum() == pytest.approx(totals.wood_area.sum() / 2, rel=1e-4)


def test_a_fraction_of_the_area_is_that_and_darkens_as_a_cluster_does() -> None:
    """Recollision: none where all is seen, all light lost within for black weights; white stays white."""
    flora = support.small_flora()
    plant = trunks(flora.rows, support.plants(np.arange(5)))
    side = np.full(5, 0.05)
    whole = subplant_facets(flora, plant, FacetRules(side))
    part_of = subplant_facets(flora, plant, FacetRules(side, weight=np.full(5, 0.5)))
    np.testing.assert_allclose(part_of.side**2, 0.5 * whole.side**2)
    c = whole.color
    leafy = whole.transmission > 0  # of wood as well as of leaves
    assert leafy.any() and not leafy.all()
    np.testing.assert_allclose(part_of.color[~leafy], (c * 0.5 / (1 - 0.5 * c))[~leafy])
    assert (part_of.color <= whole.color + 1e-12).all()
    # What is mirrored is lost as such, and scattered by what it meets: of all light, a cluster sends on as much.
    np.testing.assert_allclose(1.0 - part_of.dull[leafy], 0.5 * (1.0 - whole.dull[leafy]))
    mirrored = [GLOSS * (1.0 - f.dull[leafy])[:, None] for f in (whole, part_of)]
    one, many = ((1 - g) * f.color[leafy] + g for f, g in zip((whole, part_of), mirrored, strict=True))
    np.testing.assert_allclose(many, one * 0.5 / (1 - 0.5 * one))


@pytest.mark.parametrize(
    ("name", "day"), [("cherry_blossom", 105.0), ("cherry_blossom", 120.0), ("cherry_blossom", 200.0), ("rowan", 300.0)]
)
def test_leaves_blossoms_and_fruit_have_the_facets_that_a_day_leaves_of_each(name: str, day: float) -> None:
    """Where a day leaves little of what most samples are on, the few others had facets of 56 times the area."""
    flora, side = support.alone(name).in_year(Season(day)), 0.1
    plants = trunks(flora.rows, support.plants(np.arange(80)))
    made = subplant_facets(flora, plants, FacetRules(np.full(len(plants), side)))
    made = made.take((made.transmission > 0.0) & (made.side > 0.0))
    one = max(np.sqrt(flora.one_leaf_area(plants, kind).max()) for kind in flora.day.kinds.tolist())
    assert made.side.max() < 1.2 * max(side, one)
    area, all_ = made.side**2, flora.leaf_areas(plants)
    assert area.sum() == pytest.approx(all_.sum(), rel=0.02)
    color = np.average(flora.leaf_colors(plants), axis=0, weights=all_)
    np.testing.assert_allclose(np.average(made.color, axis=0, weights=area), color, rtol=0.1)


def test_wood_and_leaves_of_one_kind_do_not_depend_on_what_else_grows() -> None:
    """A beech beside a cherry has the facets that it has alone."""
    named = {name: load_species(name) for name in ("beech", "cherry_blossom")}
    beech, mixed = (compile_species([named[name] for name in names]) for names in (["beech"], named))
    found = []
    for flora in (beech.in_year(Season(105.0)), mixed.in_year(Season(105.0))):
        plants = trunks(flora.rows, support.plants(np.arange(20), 0))
        found.append(subplant_facets(flora, plants, FacetRules(np.full(len(plants), 0.3))))
    for one, other in zip(*(vars(made).values() for made in found), strict=True):
        assert (one is None and other is None) or np.array_equal(one, other)
