# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Between real leaves and facets nothing pops: fractions grow smoothly, what is real stays real, and areas add up."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tetflora_addon.buffers import concatenate_buffers
from tetflora_addon.emission import facets as subject
from tetflora_addon.emission.facets import facet_parts
from tetflora_addon.emission.plants import BAND, Transition, explicit_blocks
from tetflora_addon.growth.growth import trunks
from tetflora_addon.proxies.facet_weights import COUNTS, FacetWeights
from tetflora_addon.refinement.decisions import Decision


def scene(**options):
    flora = support.small_flora()
    camera = support.camera((0, -60, 6), (0, 0, 1.5), pixels=256, view=0.3)
    return flora, camera, run(flora, support.grove(6, 3.0), camera, **options)[1]


@given(st.floats(0.01, 100.0), st.floats(0.01, 100.0), st.floats(0.1, 4.0))
def test_fractions_grow_with_the_width(a: float, b: float, limit: float) -> None:
    """None up to the limit, all beyond the band, monotonous between."""
    flora = support.small_flora()
    camera = support.camera((0, -50, 0), (0, 0, 0))
    transition = Transition(flora, camera, limit)
    place = np.zeros((2, 3))
    width = np.array([a, b]) * camera.extent_around(place)
    fraction = transition.fraction(width, place)
    assert ((fraction >= 0) & (fraction <= 1)).all()
    for one, pixels in zip(fraction, (a, b), strict=True):
        if pixels <= limit:
            assert one == pytest.approx(0.0, abs=1e-12)
        if pixels >= limit * BAND * (1 + 1e-9):
            assert one == pytest.approx(1.0)
    assert (fraction[0] - fraction[1]) * (a - b) >= 0


def leaf_area(blocks) -> float:
    made = concatenate_buffers([b.buffers for b in blocks if b.kind == "leaf"])
    return 0.0 if made is None else float(support.face_areas(made).sum())


def facets_of_leaves(flora, result, camera, transition) -> float:
    parts = [f for block in facet_parts(flora, result, camera, 0.3, transition) for f, _ in block]
    return float(sum((f.side**2)[f.transmission > 0].sum() for f in parts))


def test_real_leaves_and_facets_together_are_all_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the limit, but for what leaves of a cluster hide of each other."""
    flora, camera, result = scene()
    every = replace(result, decision=np.full_like(result.decision, Decision.EXPLICIT))
    whole = leaf_area(explicit_blocks(flora, every))
    ones = np.ones((len(flora.rows), len(COUNTS)))
    monkeypatch.setattr(subject, "facet_weights", lambda _: FacetWeights(ones, ones))
    pixels = float(np.median(result.cells.feature))
    fractions = []
    for limit in pixels * np.array([3.0, 0.9, 0.7, 0.5, 0.1]):
        transition = Transition(flora, camera, float(limit))
        real = leaf_area(explicit_blocks(flora, every, transition))
        fractions.append(real / whole)
        assert real + facets_of_leaves(flora, every, camera, transition) == pytest.approx(whole, rel=0.08)
    assert fractions == sorted(fractions)
    assert fractions[0] == 0.0
    assert 0.02 < fractions[2] < 0.98
    assert fractions[-1] == pytest.approx(1.0)


def test_what_is_real_stays_real_as_the_limit_falls() -> None:
    flora, camera, result = scene()
    every = replace(result, decision=np.full_like(result.decision, Decision.EXPLICIT))
    pixels = float(np.median(result.cells.feature))
    leaves = []
    for limit in pixels * np.array([0.8, 0.7]):
        made = [b.buffers for b in explicit_blocks(flora, every, Transition(flora, camera, limit)) if b.kind == "leaf"]
        leaves.append({tuple(p) for m in made for p in m.positions.round(4)})
    assert leaves[0] < leaves[1]


def test_thick_wood_is_real_among_proxies() -> None:
    """A trunk of many pixels is a tube, and has no facets, although all around it is drawn as proxies."""
    flora, camera, result = scene()
    proxies = replace(result, decision=np.full_like(result.decision, Decision.PROXY))
    trunk = trunks(flora.rows, support.grove(6, 3.0))
    wide = 2 * trunk.radius.max() / camera.extent_around(trunk.position).min()
    near = Transition(flora, camera, wide / 10)
    blocks = list(explicit_blocks(flora, proxies, near))
    assert {b.kind for b in blocks} == {"bark"}
    wood = [
        sum(
            float((f.side**2)[f.transmission == 0].sum())
            for b in facet_parts(flora, proxies, camera, 0.3, t)
            for f, _ in b
        )
        for t in (None, near)
    ]
    assert wood[1] < wood[0]
    assert list(explicit_blocks(flora, proxies, Transition(flora, camera, 100 * wide))) == []


def test_facets_do_not_depend_on_how_space_is_divided() -> None:
    """Those of plants that are seen are the same after a coarser cutoff, but for what hides and is hidden."""
    made = []
    for cutoff in (2.0, 2.6):
        flora, camera, result = scene(cutoff=cutoff, hidden=-1.0)
        seen = replace(result, decision=np.full_like(result.decision, Decision.PROXY))
        parts = [f for b in facet_parts(flora, seen, camera, 0.3, Transition(flora, camera, 50.0)) for f, s in b if s]
        made.append({tuple(c) for f in parts for c in f.centre.round(5)})
    assert len(made[0] & made[1]) > 0.8 * len(made[0] | made[1])


def test_few_are_opened_at_a_time_and_it_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    flora, camera, result = scene()
    transition, opened, inner = Transition(flora, camera, 50.0), [], subject.open_subplants

    def facets() -> np.ndarray:
        parts = [f for block in facet_parts(flora, result, camera, 0.3, transition) for f, _ in block]
        every = np.concatenate([np.column_stack([f.centre, f.along, f.side]) for f in parts])
        return every[np.lexsort(every.T)]

    def counted(flora, subplants):
        opened.append(len(subplants))
        return inner(flora, subplants)

    once = facets()
    monkeypatch.setattr(subject, "open_subplants", counted)
    monkeypatch.setattr(subject, "OPENED_AT_ONCE", 40)
    assert np.array_equal(facets(), once)
    assert max(opened) == 40
