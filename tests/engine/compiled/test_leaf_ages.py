# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves that differ along the branch, young ones at its end, and between the inside and the outside of the crown:
what is compiled in closed form against leaves that have grown."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.compiled.averages import own_leaf_integrals
from tetflora_addon.compiled.clumping import fingerprint
from tetflora_addon.compiled.orientation import leaf_moments
from tetflora_addon.growth.foliage import YOUTH, leaf_lights, leaf_sizes, youth
from tetflora_addon.proxies.microsurfaces import FacetRules, subplant_facets
from tetflora_addon.refinement.contents import piece_totals, subplant_totals
from tetflora_addon.subplants.pieces import Pieces, piece_leaf_colors

AGES: dict[str, Any] = {
    "leaf_size_tip": 0.7, "leaf_size_young": 0.3, "leaf_light": 0.1, "leaf_light_tip": 0.9,
    "leaf_color": [[0.1, 0.2, 0.1], [0, 0, 0]], "leaf_color_tip": [0.1, 0.4, 0.1],
    "leaf_color_young": [0.5, 0.2, 0.1],
}  # fmt: skip
UNIT = st.floats(0, 1)
FACTOR = st.sampled_from([1.0, 0.05, 0.4, 2.0, 5.0])


def aged(**order1: Any) -> Any:
    """Leaves of all ages on limbs that fork, and on twigs."""
    forks = {"forks": [2, 0], "fork_at": 0.4, "leaves": [9, 0], "leaf_start": 0.2}
    return support.compiled(support.small(order1={**AGES, **forks, **order1}, order2={**AGES, "leaves": [9, 2]}))


@given(FACTOR, FACTOR, UNIT, UNIT, UNIT, UNIT)
@settings(deadline=None, max_examples=60)
def test_integrals_over_a_branch(tip: float, young: float, low: float, high: float, first: float, last: float) -> None:
    """Closed form against many leaves, evenly spaced."""
    u = (np.arange(20_000) + 0.5) / 20_000
    outward, along = low + (high - low) * u, first + (last - first) * u
    area = ((1 + (tip - 1) * outward) * (1 + (young - 1) * along**YOUTH)) ** 2
    ends = [np.array([v]) for v in (tip, young, low, high, first, last)]
    found = own_leaf_integrals(ends[0], ends[1], tuple(ends[2:4]), tuple(ends[4:6]))
    expected = area.mean(), (area * outward).mean(), (area * along**YOUTH).mean()
    np.testing.assert_allclose(np.ravel(found), expected, rtol=1e-6, atol=1e-8)


def test_area_and_color_of_grown_plants() -> None:
    """Compiled against 150 plants grown to the last leaf, and against their pieces."""
    flora = aged()
    trunk, pieces = support.grown(flora, support.plants(np.arange(150)))
    _, blades = support.meshes(flora, pieces)
    area = sum(support.face_areas(m).sum() for m in blades)
    color = sum(support.face_areas(m) @ m.attributes["tf_color"][1] for m in blades) / area
    own = piece_totals(flora, pieces).leaf_area
    assert area == pytest.approx(subplant_totals(flora, trunk).leaf_area.sum(), rel=0.03)
    assert area == pytest.approx(own.sum(), rel=0.03)
    np.testing.assert_allclose(color, flora.leaf_colors(trunk)[0], rtol=0.03)
    np.testing.assert_allclose(color, own @ piece_leaf_colors(flora, pieces) / own.sum(), rtol=0.03)


@given(st.integers(0, 10**6), st.floats(0.01, 0.99))
@settings(deadline=None, max_examples=10)
def test_pieces_add_up(seed: int, cut: float) -> None:
    """Area and color of the leaves on a branch do not depend on where it is cut."""
    flora = aged()
    _, whole = support.grown(flora, support.plants(seed))
    middle = whole.t0 + cut * (whole.t1 - whole.t0)
    halves = [whole.take(slice(None)) for _ in range(2)]
    object.__setattr__(halves[0], "t1", middle)
    object.__setattr__(halves[1], "t0", middle)
    sums = []
    for pieces in (whole, Pieces.concatenate(halves)):
        area = piece_totals(flora, pieces).leaf_area
        sums.append([area.sum(), *(area @ piece_leaf_colors(flora, pieces))])
    np.testing.assert_allclose(*sums, rtol=1e-9)


def test_facets_have_the_color_of_leaves_of_all_ages() -> None:
    flora = aged()
    trunk, _ = support.grown(flora, support.plants(np.arange(20)))
    facets = subplant_facets(flora, trunk, FacetRules(np.full(20, 0.05)))
    leaves = facets.transmission > 0
    mean = np.average(facets.color[leaves], axis=0, weights=facets.side[leaves] ** 2)
    np.testing.assert_allclose(mean, flora.leaf_colors(trunk)[0], rtol=0.05)


def test_leaves_outside_turn_to_the_sky_and_the_compiled_orientation_knows() -> None:
    flora = aged()
    trunk, pieces = support.grown(flora, support.plants(np.arange(150)))
    _, blades = support.meshes(flora, pieces)
    assert flora.rows["sunlit"].sum() == 3
    np.testing.assert_allclose(support.moment(*blades), leaf_moments(flora.orientation, trunk).mean(axis=0), atol=0.03)
    level = [support.moment(*support.meshes(aged(leaf_light_tip=tip), pieces)[1])[2, 2] for tip in (0.0, 1.0)]
    assert level[1] > level[0] + 0.02


def test_along_one_branch() -> None:
    """At the base of a branch leaves are old; at its end they have the size of young ones, within rounding."""
    flora = aged()
    _, pieces = support.grown(flora, support.plants(3))
    twigs = pieces.branches.take(np.flatnonzero(flora.rows["order"][pieces.branches.row] == 2))
    rows = flora.rows
    key, ends = twigs.key, [np.full(len(twigs), t) for t in (0.0, 1.0)]
    old, young = (leaf_sizes(rows, twigs.row, key, twigs.outward, t) for t in ends)
    np.testing.assert_allclose(young, 0.3 * old)
    assert [youth(rows, twigs.row, t)[0] for t in ends] == [0.0, 1.0]
    np.testing.assert_allclose(leaf_lights(rows, twigs.row, key, twigs.outward), 0.1 + 0.8 * twigs.outward)


def test_species_without_these_keys_are_what_they_were() -> None:
    """The values that keys have where a file does not give them change nothing, nor does the fingerprint."""
    plain = support.compiled(support.small())
    color = support.small()["orders"][2].get("leaf_color", [[0.08, 0.19, 0.03]])[0]
    given = support.compiled(
        support.small(order2={"leaf_light_tip": 0.6, "leaf_size_young": 1, "leaf_color_young": color})
    )
    assert plain.rows.tobytes() == given.rows.tobytes()
    assert not plain.rows["gradient"].any()
    assert fingerprint(plain.rows, plain.forms[0], 1) == fingerprint(given.rows, given.forms[0], 1)
    marks = {fingerprint(aged(**{name: value}).rows, plain.forms[0], 1) for name, value in AGES.items()}
    assert marks == {fingerprint(aged().rows, plain.forms[0], 1)}
    for name, value in (("leaf_light_tip", 0.2), ("leaf_size_young", 0.9), ("leaf_color_young", [0.5, 0.2, 0.2])):
        assert fingerprint(aged(**{name: value}).rows, plain.forms[0], 1) not in marks
