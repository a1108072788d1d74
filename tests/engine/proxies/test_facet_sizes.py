# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes of facets: as asked for where they are seen; larger the deeper they are hidden and the farther off the view."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.emission.test_emission import scene
from tetflora_addon.growth.branches import Branches
from tetflora_addon.growth.growth import trunks
from tetflora_addon.proxies.drawn import facet_mesh
from tetflora_addon.proxies.facet_sizes import (
    COARSE,
    COARSEST,
    FacetPixels,
    FacetSizes,
    coarseness,
    opaque_fractions,
)
from tetflora_addon.proxies.microsurfaces import subplant_facets
from tetflora_addon.proxies.thrown_shadows import ThrownShadows
from tetflora_addon.refinement.contents import subplant_totals
from tetflora_addon.refinement.decisions import Decision

PIXELS = FacetPixels(0.33)
PLANTS = 200


def sizes(
    clearance: float, coarse: float, extent: float = 0.01, visibility: float = 0.0
) -> tuple[FacetSizes, Branches]:
    """Of plants so many metres beside a view whose pixels span so many metres there."""
    flora = support.small_flora()
    own = trunks(flora.rows, support.plants(np.arange(PLANTS)))
    camera = SimpleNamespace(
        extent_around=lambda points: np.full(len(points), extent),
        clearance=lambda points: np.full(len(points), clearance),
    )
    totals, every, away = subplant_totals(flora, own), np.ones(PLANTS), np.full(PLANTS, clearance)
    least = np.sqrt(totals.wood_area / 2 / np.maximum(flora.branch_faces(own), 1))
    falls = ThrownShadows(camera).distance(own.position, away)
    view = extent * every, flora.one_leaf_area(own), least, visibility * every, coarse * every, away, falls
    return FacetSizes(*view, totals, every, opaque_fractions(flora, own, totals)), own


@given(st.floats(1e-4, 0.1), st.floats(COARSE, COARSEST))
@examples(deadline=None, max_examples=20)
def test_hidden_wood_in_the_view_has_facets_no_larger_than_seen_wood(extent: float, coarse: float) -> None:
    """A trunk has few faces: as few facets of it would be white shards in each gap of the leaves before it."""
    seen = sizes(-1.0, 1.0, extent, 0.1)[0].sides(PIXELS)[1]
    hidden = sizes(-1.0, coarse, extent)[0]
    hidden = replace(hidden, least_wood=np.full(PLANTS, 0.5))
    assert (hidden.sides(PIXELS)[1] <= 1.7 * extent * (1 + 1e-9)).all()
    assert (seen <= 1.7 * extent * (1 + 1e-9)).all()


@given(st.floats(-100.0, 1e5), st.floats(1e-4, 10.0))
@examples(deadline=None, max_examples=20)
def test_what_is_seen_is_as_fine_as_asked_for(clearance: float, extent: float) -> None:
    """Nothing else matters for it: not what hides others, nor how coarse these may be."""
    seen, _ = sizes(clearance, COARSEST, extent, visibility=1.0)
    for hidden in (1.0, 20.0):
        leaf, wood = seen.sides(FacetPixels(PIXELS.seen, hidden))
        assert not seen.hidden.any()
        assert np.allclose(wood, PIXELS.seen * extent)
        assert np.allclose(leaf, np.maximum(PIXELS.seen * extent, np.sqrt(seen.one_leaf)))


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
@examples(deadline=None, max_examples=20)
def test_the_less_is_seen_of_a_plant_the_larger_its_facets(one: float, other: float) -> None:
    """So that each draws about as much of the image; but a plant that is hardly seen is still drawn."""
    low, high = sorted([max(one, 1e-3), max(other, 1e-3)])
    dim, bright = (sizes(0.0, COARSE, visibility=v)[0].sides(PIXELS)[1] for v in (low, high))
    assert (bright >= PIXELS.seen * 0.01 * (1 - 1e-12)).all()
    assert (dim >= bright * (1 - 1e-12)).all()
    least = sizes(0.0, COARSE, visibility=1e-9)[0].sides(PIXELS)[1]
    assert (least <= 10 * PIXELS.seen * 0.01).all()


@given(st.floats(1.0, 50.0), st.floats(-10.0, 100.0), st.floats(COARSE, COARSEST))
@examples(deadline=None, max_examples=20)
def test_a_factor_on_hidden_facets_makes_them_larger(factor: float, clearance: float, coarse: float) -> None:
    """By just that far beside the view, by that at most within it and near it; wood of few faces stays as it is."""
    hidden, _ = sizes(clearance, coarse)
    larger = FacetPixels(PIXELS.seen, factor)
    assert (hidden.counts(larger) <= hidden.counts(PIXELS) * (1 + 1e-9)).all()
    for ratio in (b / a for a, b in zip(hidden.sides(PIXELS), hidden.sides(larger), strict=True)):
        assert ((ratio > 1 - 1e-9) & (ratio < factor * (1 + 1e-9))).all()
    away, _ = sizes(1e4, coarse)
    assert np.allclose(away.sides(larger)[0], factor * away.sides(PIXELS)[0])


@given(st.floats(0.0, 1e5), st.floats(1.0, 4.0), st.floats(COARSE, COARSEST), st.floats(1e-4, 10.0))
@examples(deadline=None, max_examples=20)
def test_facets_grow_with_the_way_to_the_view_and_with_what_hides_them(
    clearance: float, times: float, coarse: float, extent: float
) -> None:
    near, far = sizes(clearance, COARSE, extent)[0], sizes(times * clearance, coarse, extent)[0]
    for one, other in zip(near.sides(PIXELS), far.sides(PIXELS), strict=True):
        assert (one <= other * (1 + 1e-12)).all()


def test_no_budget_makes_blots_of_what_is_deeply_hidden() -> None:
    """Where facets are large already, depth makes them no larger; nothing is smaller than behind one crown."""
    for pixels in map(FacetPixels, (0.1, 0.33, 0.9, 1.1, 4.0, 20.0)):
        one, deep = (sizes(0.0, coarse, extent=1.0)[0].sides(pixels)[0] for coarse in (COARSE, COARSEST))
        assert (deep <= np.maximum(one, 3.0) * (1 + 1e-12)).all()
        assert (deep >= one).all()


@pytest.mark.parametrize("extent", [1e-4, 1e-3])
def test_what_is_hidden_beside_the_camera_is_no_blot(extent: float) -> None:
    """A facet stands for several leaves only where these are small in the image."""
    hidden = sizes(-1.0, COARSE, extent=extent)[0]
    assert (hidden.sides(PIXELS)[0] <= np.maximum(np.sqrt(hidden.one_leaf), 12.0 * extent) * (1 + 1e-9)).all()


@pytest.mark.parametrize("clearance", [3.0, 30.0, 300.0, 1e6])
def test_shadows_from_beside_the_view_keep_their_area(clearance: float) -> None:
    """However far a plant is, some facets of it are left, and they cover what it covers."""
    flora = support.small_flora()
    beside, plants = sizes(clearance, COARSE)
    mesh = facet_mesh(subplant_facets(flora, plants, *beside.sides(PIXELS)))
    optical = subplant_totals(flora, plants).optical_area.sum()
    assert support.face_areas(mesh).sum() == pytest.approx(optical, rel=0.05)
    assert mesh.polygons == pytest.approx(beside.counts(PIXELS).sum(), rel=0.05)
    assert mesh.polygons >= 4 * PLANTS


def test_a_plant_far_beside_the_view_is_a_handful_of_facets() -> None:
    counts = [sizes(clearance, COARSE, 1e-3)[0].counts(PIXELS).mean() for clearance in (0.0, 10.0, 100.0, 1000.0)]
    assert (np.diff(counts) <= 0).all()
    assert counts[0] > 4 * counts[-1]
    assert counts[-1] < 16


def test_deeper_hidden_is_coarser() -> None:
    """Seen nodes are not; beside the view, where nothing is in front, it is the distance that counts."""
    *_, result = scene()
    coarse = coarseness(result)
    hidden = result.chosen(Decision.HIDDEN)
    assert (coarse[~hidden] == 1.0).all()
    assert (coarse[hidden & ~result.in_view] == COARSE).all()
    for light, expected in ((0.02, COARSE), (1e-3, 5.2), (1e-9, 15.54), (1e-12, COARSEST), (0.0, COARSEST)):
        dark = replace(
            result,
            transmittance=np.full_like(result.transmittance, light),
            decision=np.full_like(result.decision, Decision.HIDDEN),
        )
        assert coarseness(dark)[dark.nodes[dark.in_view[dark.nodes]]] == pytest.approx(expected, rel=0.01)
