# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen of parts of plants is the mean over their points, and what is mixed is opened until it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.emission.test_emission import scene, with_decision
from tests.engine.refinement.test_loop import run
from tetflora_addon.emission.portions import CLOSE_WOOD, MIXED, Portions, Sight, in_chunks
from tetflora_addon.emission.seen import SOME
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement

EXPLICIT, PROXY, HIDDEN = Decision.EXPLICIT, Decision.PROXY, Decision.HIDDEN


def patchwork(seed: int) -> Refinement:
    """Any decision and any transmittance side by side."""
    *_, result = scene()
    rng = np.random.default_rng(seed)
    count = len(result.nodes)
    decisions = rng.choice(np.array([EXPLICIT, PROXY, HIDDEN]), count, p=rng.dirichlet([1, 1, 1]))
    return with_decision(result, decisions, rng.uniform(0.05, 1.0, count))


def sight(result: Refinement, facets: bool = True) -> Sight:
    flora, _, camera, _ = scene()
    return Sight(flora, result, camera, facets)


def let_in(found: Portions) -> np.ndarray:
    """Portions whose thick wood is looked for although none of their points is seen."""
    _, _, camera, _ = scene()
    branches = found.parts.branches
    thick = 2.0 * branches.radius >= 0.5 * CLOSE_WOOD * camera.extent_around(branches.position)
    return thick & (found.visibility == CLOSE_WOOD**-4.0) & found.mixed


@given(st.integers(0, 2**31))
@settings(deadline=None, max_examples=15)
def test_visibility_is_the_mean_over_the_points(seed: int) -> None:
    """Weighted by the area that can block light; by hand, part for part."""
    result = patchwork(seed)
    found = sight(result).portions()
    points, parts = result.plants.points, result.plants.parts
    seen, real = np.zeros((2, len(result.tree)))
    shown = result.decision != HIDDEN
    seen[result.nodes[shown]] = result.transmittance[shown]
    real[result.nodes[result.decision == EXPLICIT]] = 1.0
    place = {(k, *p): i for i, (k, p) in enumerate(zip(parts.branches.key, parts.branches.position, strict=True))}
    assert len(found.parts) == len(parts)
    for row in range(len(parts)):
        branches = found.parts.branches
        part = place[(branches.key[row], *branches.position[row])]
        own = np.flatnonzero(points.part == part)
        weight, cell = points.optical_area[own].astype(float), points.cell[own]
        weight /= weight.sum()
        fraction = weight @ (seen[cell] > 0)
        expected = weight @ seen[cell] if fraction > SOME else 0.0
        if not expected and found.visibility[row]:
            assert let_in(found)[row]
            continue
        assert found.visibility[row] == pytest.approx(expected, rel=1e-6)
        assert found.real[row] == bool(real[cell].any())
        assert found.mixed[row] == (SOME < fraction < 1 - SOME)
        assert found.mixed[row] <= (found.visibility[row] > 0)


def test_without_facets_it_is_the_fraction_that_is_explicit() -> None:
    """However little light comes through."""
    *_, result = scene()
    for light in (1.0, 1e-3, 0.0):
        found = sight(with_decision(result, EXPLICIT, light), facets=False).portions()
        assert (found.visibility == pytest.approx(1.0)) and found.real.all() and not found.mixed.any()
    assert (sight(with_decision(result, PROXY, 1.0), facets=False).portions().visibility == 0).all()


def test_what_is_seen_of_all_is_all() -> None:
    *_, result = scene()
    for decision, light in ((PROXY, 0.3), (EXPLICIT, 0.7), (HIDDEN, 0.01)):
        found = sight(with_decision(result, decision, light)).portions()
        thick = let_in(found)
        assert thick.any() == (decision == HIDDEN)
        assert found.visibility[~thick] == pytest.approx(0.0 if decision == HIDDEN else light)
        assert (found.mixed == thick).all() and not found.real[thick].any()
        assert (found.coarse == 1).all() == (decision != HIDDEN)


def opened_to_the_end(one: Sight) -> Portions:
    """Portions as they are drawn: what is mixed and not small is opened."""
    left, done = one.portions(), []
    while len(left):
        again = left.parts.can_open(one.flora) & left.mixed & (one.pixels(left) > MIXED)
        done.append(left.take(np.flatnonzero(~again)))
        left = one.opened(left.take(np.flatnonzero(again))) if again.any() else Portions.empty()
    return Portions.concatenate(done)


@given(st.integers(0, 2**31))
@settings(deadline=None, max_examples=10)
def test_what_is_opened_ends_on_one_side_or_small(seed: int) -> None:
    """And has, all together, the area of the whole, of which about as much is seen as before."""
    result = patchwork(seed)
    one = sight(result)
    before, after = one.portions(), opened_to_the_end(one)
    left = after.mixed & ~after.parts.alone
    assert (one.pixels(after)[left] <= MIXED).all()
    for area in ("leaf_area", "wood_area"):
        whole, sum_ = (getattr(p.parts.totals, area).sum() for p in (before, after))
        assert sum_ == pytest.approx(whole, rel=0.05)
    shown = [p.parts.totals.optical_area @ p.visibility for p in (before, after)]
    # A few points tell for each of the new parts, and what is hardly seen counts as not seen.
    assert shown[1] == pytest.approx(shown[0], abs=0.1 * before.parts.totals.optical_area.sum())


def test_what_is_not_mixed_inherits_what_is_seen_of_its_plant() -> None:
    one = sight(patchwork(3))
    every = one.portions()
    some = every.take(np.flatnonzero(~every.mixed & every.parts.can_open(one.flora)))
    assert len(some)
    own = one.opened(some)
    assert set(own.visibility) <= set(some.visibility)
    assert len(own) > len(some)
    assert own.parts.alone.sum() >= len(some)


def test_portions_come_front_to_back_whatever_the_order_of_plants() -> None:
    result = patchwork(5)
    found = sight(result).portions()
    assert (np.diff(found.rank) >= 0).all()
    plants, parts = result.plants, result.plants.parts
    order = np.random.default_rng(0).permutation(len(parts))
    inverse = np.argsort(order).astype(np.int32)
    shuffled = plants.with_parts(parts.take(order), replace(plants.points, part=inverse[plants.points.part]))
    other = sight(replace(result, plants=shuffled)).portions()
    assert np.array_equal(other.parts.branches.key, found.parts.branches.key)
    assert np.array_equal(other.visibility, found.visibility)


@given(st.lists(st.floats(0.0, 50.0), max_size=60), st.floats(1.0, 100.0))
def test_runs_hold_about_what_is_asked_for(numbers: list[float], limit: float) -> None:
    """Each thing once and in order; only one more than the limit, and none empty."""
    expected = np.array(numbers)
    runs = list(in_chunks(expected, limit))
    assert np.concatenate([np.zeros(0, int), *runs]).tolist() == list(range(len(expected)))
    assert all(expected[run[1:]].sum() <= limit * (1 + 1e-9) for run in runs)
    assert not numbers or all(len(run) for run in runs)


@pytest.mark.parametrize("anchored", [False, True])
def test_a_part_without_a_point_around_it_is_as_visible_as_its_neighbours(anchored: bool) -> None:
    """A tree of a hundred pixels alone, in which nothing is hidden: no place in its crown counts as hidden either."""
    flora = support.compiled(support.shipped("oak"))
    seeds = support.plants(1)
    camera = support.camera((0, -76, 4), (0, 0, 4), pixels=100, view=0.15)

    _, result = run(flora, seeds, camera, hidden=0.0, anchored=anchored)
    own = Sight(flora, result, camera)
    _, pieces = support.grown(flora, seeds)
    place = pieces.end[camera.clearance(pieces.end) < -0.5]
    cell = result.tree.locate(place)
    known = np.zeros(len(result.tree), bool)
    known[result.nodes] = True
    assert (~known[cell]).any()  # places in nodes that hold no point
    assert (own.nodes.visibility[cell] > 0.0).mean() > 0.99
    assert own.nodes.inside[cell].mean() > 0.99
