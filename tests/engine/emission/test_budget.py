# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Budgets: what is made fits, the best goes first, and a budget that suffices changes nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.emission.test_emission import scene, with_decision
from tetflora_addon.emission.budget import BYTES_PER_POLYGON, BYTES_PER_SPHERE, afford, polygons_allowed
from tetflora_addon.emission.forms import Refined, sphere_blocks
from tetflora_addon.emission.plants import explicit_blocks
from tetflora_addon.refinement.decisions import Decision, contributions
from tetflora_addon.refinement.settings import RefinementSettings

SETTINGS = RefinementSettings()


def made(limit: int, faces: float | None = None) -> tuple[int, int, float, object]:
    """Polygons of plants and of proxies that come of a budget, the facets' side, and the decisions."""
    flora, _, camera, result = scene()
    fitted, side = afford(flora, result, camera, replace(SETTINGS, max_polygons=limit), faces)
    leaves = sum(b.buffers.polygons for b in explicit_blocks(flora, fitted))
    proxies = support.facet_buffers(flora, fitted, camera, side)
    return leaves, proxies.polygons if proxies else 0, side, fitted


def test_a_budget_that_suffices_changes_nothing() -> None:
    flora, _, camera, result = scene()
    for unlimited in (SETTINGS, replace(SETTINGS, max_polygons=10**9), replace(SETTINGS, max_memory=1e6)):
        assert afford(flora, result, camera, unlimited) == (result, SETTINGS.facet)
        assert afford(flora, result, camera, unlimited)[0] is result


@given(st.floats(0.03, 1.2))
@examples(deadline=None, max_examples=8)
def test_what_is_made_fits(fraction: float) -> None:
    """Polygons and facets together, whatever the budget; and most of it is used where there is use for it."""
    whole = sum(made(0)[:2])
    limit = int(fraction * whole)
    leaves, proxies, side, fitted = made(limit)
    assert leaves + proxies <= limit
    if fraction < 0.9:
        assert leaves + proxies > 0.6 * limit
    assert side >= SETTINGS.facet
    assert not (fitted.decision == Decision.SPLIT).any()


def test_more_is_better() -> None:
    """Real leaves become more with the budget, facets finer, and what is kept gains more than what is not."""
    whole = sum(made(0)[:2])
    results = [made(int(fraction * whole)) for fraction in (0.1, 0.3, 0.6, 0.9)]
    assert [r[0] for r in results] == sorted(r[0] for r in results)
    *_, first = scene()
    wanted = first.decision == Decision.EXPLICIT
    gain = contributions(first.cells, first.transmittance) / first.totals.polygons
    for *_, fitted in results:
        kept = fitted.decision == Decision.EXPLICIT
        assert not (kept & ~wanted).any()
        if kept.any() and (wanted & ~kept).any():
            assert np.median(gain[kept]) > np.median(gain[wanted & ~kept])


def test_shells_are_not_made_larger() -> None:
    flora, _, camera, result = scene()
    fitted, side = afford(flora, result, camera, replace(SETTINGS, max_polygons=20_000), faces=4.0)
    assert side == SETTINGS.facet
    kept = fitted.decision == Decision.EXPLICIT
    assert fitted.totals.polygons[kept].sum() + 4 * (~kept).sum() <= 20_000


def test_memory_and_polygons_limit_each_other() -> None:
    both = replace(SETTINGS, max_polygons=5_000_000, max_memory=1.0)
    assert polygons_allowed(both) == pytest.approx(1e9 / BYTES_PER_POLYGON)
    assert polygons_allowed(replace(both, max_memory=100.0)) == 5_000_000
    assert np.isinf(polygons_allowed(SETTINGS))


def test_spheres_take_less_of_a_budget_of_memory_and_as_much_of_one_of_polygons() -> None:
    flora, _, camera, result = scene()
    everything = with_decision(result, Decision.PROXY)

    def spheres(**limits: float) -> int:
        settings = replace(SETTINGS, **limits)
        fitted, side = afford(flora, everything, camera, settings, primitive_bytes=BYTES_PER_SPHERE)
        return sum(block.polygons for block in sphere_blocks(Refined(flora, fitted, camera, side)))

    whole = spheres()
    memory = 0.3 * whole * BYTES_PER_SPHERE / 1e9
    assert 0.6 * 0.3 * whole < spheres(max_memory=memory) <= 0.3 * whole
    assert 0.6 * 0.2 * whole < spheres(max_memory=memory, max_polygons=whole // 5) <= 0.2 * whole
    assert spheres(max_memory=memory, max_polygons=whole) == spheres(max_memory=memory)
    tight = replace(SETTINGS, max_memory=memory)
    sides = [afford(flora, everything, camera, tight, None, size)[1] for size in (BYTES_PER_POLYGON, BYTES_PER_SPHERE)]
    assert sides[0] > sides[1]
