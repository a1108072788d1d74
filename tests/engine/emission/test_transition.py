# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Between real leaves and facets nothing pops: fractions grow smoothly, what is real stays real, and areas add up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tetflora_addon.emission.plants import Transition, expanded_blocks
from tetflora_addon.growth.growth import trunks
from tetflora_addon.refinement.decisions import BAND, explicit_fraction
from tetflora_addon.species.species import LEAF_KINDS


def scene():
    """A few plants that hide next to nothing of each other, leaf by leaf."""
    flora = support.small_flora()
    camera = support.camera((0, -60, 6), (0, 0, 1.5), pixels=256, view=0.3)
    return flora, camera, run(flora, support.grove(6, 3.0), camera)[1]


def widths(flora, camera) -> np.ndarray:
    branches = trunks(flora.rows, support.grove(6, 3.0))
    return flora.leaf_width[branches.row] * branches.scale / camera.extent_around(branches.position)


@given(st.floats(0.01, 100.0), st.floats(0.01, 100.0), st.floats(0.1, 4.0))
def test_fractions_grow_with_the_width(a: float, b: float, limit: float) -> None:
    """None up to the limit, all beyond the band, monotonous between."""
    fraction = explicit_fraction(np.array([a, b]), limit)
    assert ((fraction >= 0) & (fraction <= 1)).all()
    for one, pixels in zip(fraction, (a, b), strict=True):
        if pixels <= limit:
            assert one == pytest.approx(0.0, abs=1e-12)
        if pixels >= limit * BAND * (1 + 1e-9):
            assert one == pytest.approx(1.0)
    assert (fraction[0] - fraction[1]) * (a - b) >= 0


def leaf_area(blocks) -> float:
    return float(sum(support.face_areas(b.buffers).sum() for b in blocks if b.kind == "leaf"))


def corners(blocks) -> set[tuple[float, ...]]:
    return {tuple(p) for b in blocks if b.kind == "leaf" for p in b.buffers.positions.round(4)}


def test_real_leaves_and_facets_together_are_all_leaves() -> None:
    """Whatever the limit. Those that nobody sees count with what stands for them."""
    flora, camera, result = scene()
    whole = leaf_area(expanded_blocks(flora, support.grove(6, 3.0)))
    width = float(np.median(widths(flora, camera)))
    fractions = []
    for limit in width * np.array([3.0, 0.9, 0.6, 0.35, 0.01]):
        blocks, facets, _ = support.drawn(flora, result, camera, 0.3, float(limit), weighted=False, hidden=0.33)
        leafy, real = facets.transmission > 0, leaf_area(blocks)
        fractions.append(real / whole)
        assert real + (facets.side**2)[leafy].sum() == pytest.approx(whole, rel=0.05)
    assert fractions == sorted(fractions)
    assert fractions[0] == 0.0
    assert 0.1 < fractions[2] < fractions[-1]


def test_what_is_real_stays_real_as_the_limit_falls() -> None:
    flora, camera, result = scene()
    width = float(np.median(widths(flora, camera)))
    leaves = [corners(support.drawn(flora, result, camera, 0.3, limit * width)[0]) for limit in (0.8, 0.65, 0.5)]
    assert set() < leaves[0]
    # What comes in front of a leaf may hide it.
    for fewer, more in ((0, 1), (1, 2)):
        assert len(leaves[fewer] - leaves[more]) < 0.1 * len(leaves[fewer])
        assert len(leaves[fewer]) < len(leaves[more])


def test_facets_do_not_depend_on_how_space_is_divided() -> None:
    """Those of plants that are seen are where they were after a coarser cutoff."""
    flora, camera, _ = scene()
    made = []
    for cutoff in (2.0, 4.0):
        result = run(flora, support.grove(6, 3.0), camera, cutoff=cutoff)[1]
        _, facets, seen = support.drawn(flora, result, camera, 0.5)
        made.append({tuple(c) for c in facets.center[seen].round(5)})
    assert len(made[0] & made[1]) > 0.8 * len(made[0] | made[1])


@pytest.mark.parametrize("seed", range(4))
def test_a_trunk_that_fills_the_picture_is_there(seed: int) -> None:
    """Hardly any of a tall birch is seen from so near: whatever share of the plant its trunk has, it is a tube."""
    flora, seeds = support.alone("birch"), support.plants([seed])
    radius = float(trunks(flora.rows, seeds).radius[0])
    camera = support.camera((0.0, -8.0 * radius, 1.3), (0.0, 0.0, 1.3), pixels=256)
    blocks, _, _ = support.drawn(flora, run(flora, seeds, camera)[1], camera, 1.0, 0.5)
    points = np.concatenate([b.buffers.positions for b in blocks if b.kind == "bark"])
    assert (np.hypot(points[:, 0], points[:, 1]) < 3.0 * radius).any()


def test_widths_are_of_leaves_alone() -> None:
    """Without leaves nothing is real for their sake."""
    flora, camera, _ = scene()
    branches = trunks(flora.rows, support.grove(6, 3.0))
    bare = replace(flora, leaf_count=np.zeros_like(flora.leaf_count))
    assert Transition(flora, camera, 1e-6).of_branches(branches).min() == 1.0
    assert Transition(bare, camera, 1e-6).of_branches(branches).max() == 0.0


def test_large_leaves_of_a_leader_are_themselves() -> None:
    """What a branch bears decides by its own size, not by the smaller leaves of all that grows on it."""
    flora = support.compiled(support.shipped("spruce"))
    leaders = trunks(flora.rows, support.grove(6, 3.0))
    camera = scene()[1]
    size = flora.rows["leaf_size"][leaders.row, 0] * flora.leaf.width[leaders.row]
    assert (size > 3.0 * flora.leaf_width[leaders.row]).all()
    limit = float((size / camera.extent_around(leaders.position)).max()) / BAND
    transition = Transition(flora, camera, limit)
    assert transition.of_own_leaves(leaders).max() == 1.0
    assert transition.of_branches(leaders).max() < 0.5


@pytest.mark.parametrize(
    ("name", "kind", "kites"), [("spruce", "blossom", (0, 0)), ("spruce", "leaf", (0, 1)), ("beech", "leaf", (1, 1))]
)
def test_cones_of_two_pixels_are_no_kites(name: str, kind: str, kites: tuple[float, float]) -> None:
    """No kites could stand for the sides of what is solid, and no single one for a spray; a leaf as wide has one."""
    flora = support.compiled(support.shipped(name))
    bears = (flora.rows["leaf_kind"] == LEAF_KINDS.index(kind)) & (flora.rows["leaves"].sum(axis=1) > 0)
    branch = replace(trunks(flora.rows, support.grove(1, 3.0)), row=np.flatnonzero(bears)[:1])
    width = (flora.rows["leaf_size"][:, 0] * flora.leaf.width)[branch.row] * branch.scale
    extent = support.camera((0, -1, 0), (0, 0, 0), pixels=100, view=0.3).extent_around(branch.position)
    camera = support.camera((0, -width[0] / (1.99 * extent[0]), 0), (0, 0, 0), pixels=100, view=0.3)
    found = [float(of[0]) for of in Transition(flora, camera, 1.0).of_kites(branch)]
    assert found == pytest.approx(kites, abs=1e-3)
