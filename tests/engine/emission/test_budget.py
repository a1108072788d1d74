# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Budgets: what is made fits, the best goes first, what is hidden takes the least, and enough changes nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import settings as examples
from hypothesis import strategies as st

from tests.engine.emission.test_emission import scene, with_decision
from tetflora_addon.emission import budget, expected
from tetflora_addon.emission.budget import (
    BYTES_PER_POLYGON,
    BYTES_PER_SPHERE,
    Detail,
    afford,
    enough,
)
from tetflora_addon.emission.expected import Expected
from tetflora_addon.emission.facets import facet_parts
from tetflora_addon.emission.plants import Transition, explicit_blocks
from tetflora_addon.proxies.facet_sizes import FacetPixels
from tetflora_addon.refinement.decisions import Decision, contributions
from tetflora_addon.refinement.loop import Refinement
from tetflora_addon.refinement.settings import RefinementSettings

SETTINGS = RefinementSettings()


@dataclass(frozen=True)
class Made:
    """Polygons, and facets of what is seen and of what is not, that come of a budget."""

    detail: Detail
    polygons: int
    seen: int
    hidden: int

    @property
    def facets(self) -> int:
        return self.seen + self.hidden

    @property
    def whole(self) -> int:
        return self.polygons + self.facets

    def memory(self, primitive_bytes: float) -> float:
        return self.polygons * BYTES_PER_POLYGON + self.facets * primitive_bytes


def made(limits: RefinementSettings = SETTINGS, result: Refinement | None = None, **options: float) -> Made:
    """What comes of limits."""
    flora, _, camera, own = scene()
    detail = afford(flora, own if result is None else result, camera, limits, **options)
    transition = Transition(flora, camera, detail.leaf_limit)
    polygons = sum(b.buffers.polygons for b in explicit_blocks(flora, detail.refinement, camera, transition))
    numbers = [0, 0]
    for parts in facet_parts(flora, detail.refinement, camera, detail.pixels, transition):
        for facets, seen in parts:
            numbers[seen] += len(facets)
    return Made(detail, polygons, numbers[1], numbers[0])


def at_most(polygons: float) -> RefinementSettings:
    return replace(SETTINGS, max_polygons=int(polygons))


def test_a_budget_that_suffices_changes_nothing() -> None:
    flora, _, camera, result = scene()
    for unlimited in (SETTINGS, at_most(10**9), replace(SETTINGS, max_memory=1e6)):
        detail = afford(flora, result, camera, unlimited)
        assert detail.refinement is result
        assert (detail.pixels, detail.leaf_limit) == (FacetPixels(SETTINGS.facet), SETTINGS.leaf_limit)


@given(st.floats(0.03, 1.2))
@example(0.9922)  # what is expected without a look at some plants would fit, and what is made would not
@examples(deadline=None, max_examples=8)
def test_what_is_made_fits(fraction: float) -> None:
    """Polygons and facets together, whatever the budget; and most of it is used where there is use for it."""
    limit = int(fraction * made().whole)
    fitted = made(at_most(limit))
    assert fitted.whole <= limit
    if fraction < 0.9:
        assert fitted.whole > 0.9 * limit - 4.0 * limit**0.5
    assert not (fitted.detail.refinement.decision == Decision.SPLIT).any()


def test_leaves_and_facets_give_way_together() -> None:
    """The tighter a budget, the earlier leaves become facets, and the larger these are; facets give way first."""
    whole = made().whole
    factors = []
    for fraction in (0.8, 0.4, 0.2, 0.1, 0.03):
        detail = made(at_most(fraction * whole)).detail
        factors.append([detail.leaf_limit / SETTINGS.leaf_limit, detail.pixels.seen / SETTINGS.facet])
    leaves, facets = np.array(factors).T
    assert (facets >= leaves * (1 - 1e-9)).all()
    assert leaves[0] >= 1 < facets[0]
    assert (np.diff(leaves) >= 0).all() and leaves[-1] > 1
    assert (np.diff(facets) >= 0).all() and facets[-1] > facets[0]


def test_more_is_better() -> None:
    """Real leaves become more with the budget, and facets finer."""
    whole = made().whole
    results = [made(at_most(fraction * whole)) for fraction in (0.1, 0.3, 0.6, 0.9)]
    assert np.all(np.diff([r.polygons for r in results]) >= 0)
    assert results[0].polygons < results[-1].polygons
    assert np.all(np.diff([r.detail.pixels.seen for r in results]) <= 0)


def mostly_hidden(light: float = 0.0) -> Refinement:
    """All plants near the eye, which would have the most facets, are hidden as deeply; those far off are seen."""
    *_, result = scene()
    hidden = result.tree.vertices(result.nodes)[:, :, 1].mean(axis=1) < 130
    return with_decision(result, np.where(hidden, Decision.HIDDEN, Decision.PROXY), np.where(hidden, light, 0.3))


@pytest.mark.parametrize("allowed", [600.0, 1_200.0])
def test_what_is_hidden_never_has_more_than_what_is_seen(monkeypatch: pytest.MonkeyPatch, allowed: float) -> None:
    """By default, wherever a picture shows fewer facets than a scene would have."""
    flora, _, camera, _ = scene()
    settings, result = replace(SETTINGS, facet=0.1), mostly_hidden()
    count = Expected(flora, result, camera)
    assert count.unseen(FacetPixels(0.1)) + count.seen(0.1, SETTINGS.leaf_limit, 1.0) > allowed
    monkeypatch.setattr(budget, "NEVER_TOO_MANY", allowed)
    monkeypatch.setattr(budget, "ENOUGH_A_PIXEL", 0.0)
    monkeypatch.setattr(budget, "_FEW_HIDDEN", 0.0)
    assert enough(camera) == allowed
    after = afford(flora, result, camera, settings)
    assert count.unseen(after.pixels) <= 1.15 * count.seen(after.pixels.seen, after.leaf_limit, 1.0)
    assert made(settings, result).whole <= 1.15 * allowed


@given(st.floats(0.02, 0.9))
@examples(deadline=None, max_examples=5)
def test_what_is_hidden_and_cannot_become_less_is_paid_for_by_what_is_seen(fraction: float) -> None:
    """Facets that are just hidden do not grow for ever; the limit that somebody sets holds all the same."""
    fine = replace(SETTINGS, facet=0.1)
    limit = fraction * made(fine, mostly_hidden(0.01)).whole
    fitted = made(replace(fine, max_polygons=int(limit)), mostly_hidden(0.01))
    assert 0.5 * limit < fitted.whole <= limit


def test_enough_follows_the_pixels_of_the_image() -> None:
    *_, camera, _ = scene()
    small, large, huge = (enough(replace(camera, width=side, height=side)) for side in (64, 4_000, 8_000))
    assert small == enough(camera)
    assert huge == 4 * large > 4 * small


@pytest.mark.parametrize("limit", [5_000, 20_000])
def test_shells_are_not_made_larger(limit: int) -> None:
    """They make room for real leaves where these gain the most for each polygon."""
    flora, _, camera, result = scene()
    detail = afford(flora, result, camera, at_most(limit), faces=4.0)
    assert (detail.pixels, detail.leaf_limit) == (FacetPixels(SETTINGS.facet), SETTINGS.leaf_limit)
    wanted, kept = (r.decision == Decision.EXPLICIT for r in (result, detail.refinement))
    assert result.totals.polygons[kept].sum() + 4 * (~kept).sum() <= limit
    assert not (kept & ~wanted).any()
    gain = contributions(result.cells, result.transmittance) / result.totals.polygons
    assert kept.any()
    assert np.median(gain[kept]) > np.median(gain[wanted & ~kept])
    assert afford(flora, result, camera, SETTINGS, faces=4.0).refinement is result


def test_memory_and_polygons_limit_each_other() -> None:
    """Whichever is tighter decides, whatever the other allows."""
    flora, _, camera, result = scene()
    tight, loose = 5_000, 50_000

    def side(polygons: int, gigabytes: float) -> float:
        both = replace(SETTINGS, max_polygons=polygons, max_memory=gigabytes)
        return afford(flora, result, camera, both).pixels.seen

    tight_memory, loose_memory = (n * BYTES_PER_POLYGON / 1e9 for n in (tight, loose))
    assert side(tight, loose_memory) == side(tight, 0.0) > side(loose, 0.0)
    assert side(loose, tight_memory) == side(0, tight_memory) > side(0, loose_memory)


def test_spheres_take_less_of_a_budget_of_memory_and_as_much_of_one_of_polygons() -> None:
    *_, result = scene()
    everything = with_decision(result, Decision.PROXY)

    def spheres(primitive_bytes: float = BYTES_PER_SPHERE, **limits: float) -> Made:
        return made(replace(SETTINGS, **limits), everything, primitive_bytes=primitive_bytes)

    whole = spheres()
    memory = 0.3 * whole.memory(BYTES_PER_SPHERE)
    tight = spheres(max_memory=memory / 1e9)
    assert 0.7 * memory < tight.memory(BYTES_PER_SPHERE) <= memory
    both = spheres(max_memory=memory / 1e9, max_polygons=tight.whole // 2)
    assert 0.7 * tight.whole / 2 < both.whole <= tight.whole / 2
    assert spheres(max_memory=memory / 1e9, max_polygons=whole.whole).detail == tight.detail
    facets = spheres(BYTES_PER_POLYGON, max_memory=memory / 1e9)
    assert facets.memory(BYTES_PER_POLYGON) <= memory
    assert facets.detail.pixels.seen > tight.detail.pixels.seen


@given(st.floats(-2.0, 9.0), st.floats(0.2, 3.0), st.sampled_from(["power", "floor", "step", "bend"]))
@examples(max_examples=100)
def test_the_factor_is_the_smallest_that_fits(size: float, power: float, kind: str) -> None:
    """Whatever way a load falls; straight lines take few steps."""
    asked = []

    def load(factor: float) -> float:
        asked.append(factor)
        whole = np.exp(size) * factor**-power
        return {
            "power": whole,
            "floor": max(whole, 0.3 * np.exp(size)),
            "step": np.exp(size) if factor < 20.0 else 1e-4,
            "bend": (whole + np.exp(size) * min(1.0, (3.0 / factor) ** 4)) / 2.0,
        }[kind]

    found = budget._smallest(load)
    assert len(asked) <= (20 if kind == "power" else 44)
    if found < 250.0:
        assert load(found) <= 1.0
    if found > 1.0:
        assert load(found * np.exp(-1.01 * budget._CLOSE)) > 1.0


def test_some_parts_tell_about_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """On average over samples, polygons and facets that are expected are those of all."""
    (flora, _, camera, _), result = scene(), mostly_hidden(0.1)
    asked = [(lambda e, p=p: e.seen(p, p, 1.0), lambda e, p=p: e.unseen(FacetPixels(p))) for p in (0.3, 1.0, 4.0)]

    def counts(found: Expected) -> list[float]:
        return [count(found) for both in asked for count in both]

    whole = Expected(flora, result, camera)
    monkeypatch.setattr(expected, "_TELLING", (len(whole.portions) + len(whole.unseen_portions)) // 4)
    made = []
    for draw in range(40):
        monkeypatch.setattr(expected, "_CHOSEN", 1000 + draw)
        some = Expected(flora, result, camera)
        assert len(some.portions) < len(whole.portions)
        made.append(counts(some))
    noise = np.std(made, axis=0) / np.sqrt(len(made))
    assert (np.abs(np.mean(made, axis=0) - counts(whole)) <= 4.0 * noise + 1e-9 * np.array(counts(whole))).all()
    assert (noise <= 0.06 * np.array(counts(whole))).all()


def test_what_is_drawn_tells_about_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of it exactly; some of it on average over samples, and the more the closer."""
    flora, _, camera, result = scene()
    pixels, limit = FacetPixels(0.6), 0.4
    count = Expected(flora, result, camera)
    monkeypatch.setattr(expected, "_WORK", 0.0)

    def whole(drawn: int, sample: int) -> float:
        monkeypatch.setattr(expected, "_DRAWN", (drawn, drawn))
        monkeypatch.setattr(expected, "_SAMPLE", sample)
        count.calibrate(pixels, limit, True)
        return count.seen(pixels.seen, limit, 1.0) + count.unseen(pixels)

    fitted = made(replace(SETTINGS, facet=pixels.seen, leaf_limit=limit))
    # But for faces of several triangles, which count for more.
    assert fitted.whole <= whole(10**9, 0) <= 1.01 * fitted.whole
    assert count.undrawn == 0.0
    errors = []
    for drawn in (20, 60):
        found = np.array([whole(drawn, 1000 + sample) for sample in range(12)]) / fitted.whole - 1.0
        assert 0.0 < count.undrawn < 1.0
        assert abs(found.mean()) <= 3.0 * found.std() / len(found) ** 0.5 + 0.02
        errors.append(found.std())
    assert errors[1] < errors[0] < 0.3
