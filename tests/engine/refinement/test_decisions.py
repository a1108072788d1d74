# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The refinement step by itself: made-up tetrahedra, what each becomes, and what can never be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.engine import support
from tetflora_addon.refinement.contents import Totals
from tetflora_addon.refinement.decisions import (
    BAND,
    Decision,
    Terminals,
    decide,
    feature_pixels,
    gains_nothing,
    without_splits,
)
from tetflora_addon.refinement.settings import RefinementSettings

CAMERA = support.camera((0, 0, 0), (0, 10, 0), pixels=1000, view=1.0)
SETTINGS = RefinementSettings()


def cell(depth: float, size: float = 1.0) -> NDArray[np.float64]:
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]) * size
    return (corners + [0, depth, 0])[None]


def become(
    pixels: float,
    transmittance: float = 1.0,
    opacity: float = 1.0,
    width: float = 0.1,
    polygons: float = 1e5,
    leaf: float = 1.0,
    wood: float = 0.1,
    depth: float = 1000.0,
    settings: RefinementSettings = SETTINGS,
) -> Decision:
    """One tetrahedron; by default leaves of a tenth of a pixel, seen in full."""
    totals = Totals(*(np.array([v], float) for v in (leaf, wood, polygons, width)))
    span = np.array([np.sqrt(2) / (0.001 * depth)])  # of the unit corner, 1 mm a pixel at 1 m
    seen = (np.array([v], float) for v in (pixels, opacity))
    cells = Terminals(
        np.array([0]), totals, *seen, *feature_pixels(cell(depth), totals.width, CAMERA), span, np.array([True])
    )
    return Decision(decide(cells, np.array([transmittance]), settings)[0])


def test_size_of_features() -> None:
    """A pixel is 1 mm at 1 m here; the nearest corner counts, and nothing is nearer than the near plane."""
    near = cell(5.0, 2.0)
    assert feature_pixels(near, np.array([0.05]), CAMERA)[0] == pytest.approx(0.05 / 0.001 / 5.0)
    assert feature_pixels(cell(-0.5), np.array([0.05]), CAMERA)[0] == pytest.approx(0.05 / 0.001 / CAMERA.near)


def test_each_outcome() -> None:
    assert become(pixels=3000) == Decision.SPLIT
    assert become(pixels=3) == Decision.PROXY
    assert become(pixels=3000, opacity=0.001) == Decision.PROXY
    assert become(pixels=3000, transmittance=0.01) == Decision.HIDDEN
    assert become(pixels=0, transmittance=0.0) == Decision.HIDDEN
    assert become(pixels=3000, leaf=0.0, wood=0.0) == Decision.EMPTY
    assert become(pixels=900, width=1.0) == Decision.EXPLICIT
    assert become(pixels=90_000, width=1.0) == Decision.SPLIT
    assert become(pixels=90_000, width=1.0, polygons=100) == Decision.EXPLICIT
    assert become(pixels=90_000, width=1.0, transmittance=0.01) == Decision.HIDDEN


def test_large_leaves_that_contribute_little_are_still_leaves() -> None:
    assert become(pixels=3, width=1.0) == Decision.EXPLICIT
    assert become(pixels=90_000, width=1.0, transmittance=0.03, opacity=0.001) == Decision.SPLIT


def test_hidden_cells_are_divided_for_shells_only() -> None:
    shell = replace(SETTINGS, hidden_block=8.0)
    assert become(pixels=3000, transmittance=0.0, depth=1000.0, settings=shell) == Decision.HIDDEN  # 1.4 pixels
    assert become(pixels=3000, transmittance=0.0, depth=10.0, settings=shell) == Decision.SPLIT
    assert become(pixels=3000, transmittance=0.0, depth=10.0) == Decision.HIDDEN
    assert become(pixels=0, transmittance=0.0, depth=10.0, leaf=0, wood=0, settings=shell) == Decision.EMPTY


CASE = st.fixed_dictionaries(
    {
        "pixels": st.floats(0, 1e6),
        "transmittance": st.floats(0, 1),
        "opacity": st.floats(0, 1),
        "width": st.floats(1e-4, 3),
        "polygons": st.floats(0, 1e7),
        "depth": st.floats(1, 1e4),
    }
)


@given(CASE, st.floats(0.5, 20))
@settings(deadline=None, max_examples=300)
def test_what_can_never_be(case: dict, cutoff: float) -> None:
    """Leaves of half a pixel that are seen are leaves or become so; what is hidden is never made; a finer cutoff
    never takes detail away."""
    options = replace(SETTINGS, cutoff=cutoff)
    out = become(**case, settings=options)
    large = feature_pixels(cell(case["depth"]), np.array([case["width"]]), CAMERA)[0][0] >= options.leaf_limit
    hidden = case["transmittance"] <= options.hidden
    assert (out == Decision.HIDDEN) == hidden
    if large and not hidden:
        assert out in (Decision.EXPLICIT, Decision.SPLIT)
    if not large:
        assert out != Decision.EXPLICIT
    if out == Decision.PROXY:  # facets take their places from the plants, to which a part of a block is enough
        small = case["pixels"] * case["transmittance"] * case["opacity"] <= cutoff**2
        assert small or case["pixels"] <= options.block**2
        shells = replace(options, proxy_block=1e9)
        assert small or become(**case, settings=shells) == Decision.SPLIT
    if out == Decision.SPLIT:
        assert become(**case, settings=replace(options, cutoff=cutoff / 2)) == Decision.SPLIT


def test_a_limit_leaves_what_is_hidden_hidden_and_makes_no_forest_of_leaves() -> None:
    """Nor large space full of leaves at unknown distances."""
    count = 4
    totals = Totals(*(np.array(v, float) for v in ([1] * 4, [0.1] * 4, [1e6, 1e4, 1e6, 1e6], [1] * 4)))
    pixels, feature = np.array([1e6, 1e6, 900.0, 1e6]), np.array([2.0, 2.0, 2.0, 0.1])
    one = np.ones(count)
    cells = Terminals(np.arange(count), totals, pixels, one, feature, feature, one, np.ones(count, bool))
    split = np.full(count, Decision.SPLIT, np.int8)
    seen = without_splits(split, cells, np.ones(count), SETTINGS)
    assert seen.tolist() == [Decision.PROXY, Decision.EXPLICIT, Decision.EXPLICIT, Decision.PROXY]
    assert (without_splits(split, cells, np.zeros(count), SETTINGS) == Decision.HIDDEN).all()
    # Up to four blocks on each side is not large.
    blocks = replace(cells, pixels=(np.array([4.1, 4.1, 3.9, 3.9]) * SETTINGS.block) ** 2)
    seen = without_splits(split, blocks, np.ones(count), SETTINGS)
    assert seen.tolist() == [Decision.PROXY, Decision.EXPLICIT, Decision.EXPLICIT, Decision.PROXY]
    kept = np.array([Decision.PROXY, Decision.HIDDEN, Decision.EXPLICIT, Decision.EMPTY], np.int8)
    assert (without_splits(kept, cells, np.zeros(count), SETTINGS) == kept).all()


def test_leaves_that_are_large_only_at_the_near_end_are_recognized() -> None:
    """All of a small image's view may be one block: then it is divided in depth, not made explicit as a whole."""
    totals = Totals(*(np.full(1, v) for v in (100.0, 1.0, 1e6, 0.05)))
    one = np.ones(1)

    def decided(least: float, polygons: float) -> int:
        holds = replace(totals, polygons=np.array([polygons]))
        cells = Terminals(np.arange(1), holds, 900.0 * one, one, 5.0 * one, least * one, one, np.ones(1, bool))
        return int(decide(cells, one, SETTINGS)[0])

    assert decided(0.1, 1e6) == Decision.SPLIT
    assert decided(0.9 * SETTINGS.leaf_limit, 1e6) == Decision.EXPLICIT
    assert decided(0.1, 10.0) == Decision.EXPLICIT


def test_the_last_few_cells_are_not_worth_a_pass() -> None:
    """Only if they are few among many, change next to nothing of the image and hold next to nothing."""
    count = 1000
    totals = Totals(*(np.full(count, v) for v in (1.0, 0.1, 1000.0, 0.1)))
    cells = Terminals(
        np.arange(count), totals, *(np.full(count, v) for v in (1000.0, 1.0, 0.1, 0.1, 1.0)), np.ones(count, bool)
    )
    seen, splitting = np.ones(count), np.zeros(count, bool)
    splitting[:2] = True  # 2,000 of a million pixels, 2,000 polygons
    assert gains_nothing(splitting, cells, seen, CAMERA)
    many = np.zeros(count, bool)
    many[:20] = True
    assert not gains_nothing(many, cells, 0.01 * seen, CAMERA)
    assert not gains_nothing(splitting, replace(cells, pixels=1200.0 * seen), seen, CAMERA)
    assert not gains_nothing(splitting, replace(cells, totals=replace(totals, polygons=2e4 * seen)), seen, CAMERA)


@given(
    st.floats(6.0, 40.0).filter(lambda side: abs(side - SETTINGS.block) > 0.01),
    st.floats(0.3, 1.0),
    st.floats(0.01, 2.0 * BAND),
)
def test_how_finely_space_is_divided_does_not_tell_leaves_from_facets(side: float, seen: float, width: float) -> None:
    """Else what is seen of all the others would be known better, or worse, from where on the first leaves are real."""
    width *= SETTINGS.leaf_limit  # a pixel is a meter wide there
    divided = become(side**2, seen, width=width) == Decision.SPLIT
    assert divided == (side > SETTINGS.block)
