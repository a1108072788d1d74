# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines of blades never cross themselves, keep within their tolerance, and lie where their parameters say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.leaves.models import LEAF_MODELS
from tetflora_addon.leaves.outlines import Blade, distance_to_links, simplified, traced
from tetflora_addon.leaves.surfaces import blade_surface, crossings, outline
from tetflora_addon.parameters import keys_of

BLADES = {name: model.shape for name, model in LEAF_MODELS.items() if isinstance(model.shape, Blade)}


def limits(name: str) -> st.SearchStrategy:
    """Values of a field within its limits."""
    key = keys_of(Blade)[name]
    if key.choices:
        return st.sampled_from(key.choices)
    return st.integers(key.low, key.high) if key.kind == "integer" else st.floats(key.low, key.high)


#: Blades as plants have them; what is far from that may be refused, see `check_outline`.
blades = st.builds(
    Blade,
    width=st.floats(0.08, 1.3),
    widest=st.floats(0.2, 0.75),
    base=limits("base"),
    apex=limits("apex"),
    lobing=limits("lobing"),
    lobes=st.integers(0, 7),
    lobe_depth=st.floats(0, 0.8),
    lobe_round=limits("lobe_round"),
    teeth=st.integers(0, 30),
    tooth=limits("tooth"),
    tooth_size=st.floats(0, 0.03),
)


@given(blades)
@settings(deadline=None, max_examples=40)
def test_outlines_do_not_cross_themselves(blade: Blade) -> None:
    for tolerance in (0.03, 0.002):
        assert crossings(outline(blade, tolerance)) == 0


def test_crossings_are_found() -> None:
    assert crossings(np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])) == 1
    assert crossings(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])) == 0


@given(blades, st.sampled_from([0.03, 0.004, 0.0005]))
@settings(deadline=None, max_examples=20)
def test_links_keep_within_the_tolerance(blade: Blade, tolerance: float) -> None:
    """Against an evaluation that is far finer, whatever the tolerance."""
    for side in (1, -1):
        s = traced(blade, side, tolerance)
        fine = np.linspace(0.0, 1.0, 20_001)
        curve, ends = blade.margin(fine, side), blade.margin(s, side)
        link = np.clip(np.searchsorted(s, fine, side="right") - 1, 0, len(s) - 2)
        assert distance_to_links(curve, ends[link], ends[link + 1]).max() < tolerance


@pytest.mark.parametrize("lobes", [5, 7, 9])
def test_palmate_margins_are_smooth_between_their_knots(lobes: int) -> None:
    """Tips and sinuses are knots: between them the distance from the base has no corner and no sinus."""
    blade = Blade(width=1.0, lobing="palmate", lobes=lobes, lobe_depth=0.6, lobe_round=0.0)
    s = np.linspace(0.06, 1.0, 20_001)
    reach = np.linalg.norm(blade.margin(s, 1), axis=1)
    turns = s[1:-1][np.diff(np.sign(np.diff(reach))) != 0]  # lobes and sinuses in turn
    assert len(turns) >= lobes - 2
    assert np.abs(turns[:, None] - blade.knots(1)).min(axis=1).max() < 1e-3


@given(blades)
@settings(deadline=None, max_examples=30)
def test_rays_lead_outwards(blade: Blade) -> None:
    """The right half lies on the right, from the base to the tip, and the left half on the left."""
    for side in (1, -1):
        points = blade.margin(np.linspace(0.0, 1.0, 400), side)
        assert (side * points[:, 0] >= -1e-12).all()
        np.testing.assert_allclose(points[[0, -1]], [[0.0, 0.0], [0.0, 1.0]], atol=1e-9)


def test_what_is_kept_for_a_tolerance_is_kept_for_smaller_ones() -> None:
    lines = np.random.default_rng(1).normal(size=(300, 2, 3)).cumsum(axis=0) / 100
    kept = [set(simplified(lines, tolerance)) for tolerance in (0.1, 0.03, 0.01)]
    assert kept[0] < kept[1] < kept[2]
    assert {0, 299} <= kept[0]


@pytest.mark.parametrize("name", BLADES)
@pytest.mark.parametrize("tolerance", [0.03, 0.004, 0.0005])
def test_faces_look_up(name: str, tolerance: float) -> None:
    """Flat, no face is turned over: they cover the outline once. Texture coordinates are those of the blade."""
    blade = BLADES[name]
    made = blade_surface(dataclasses.replace(blade, fold=0, curl=0, wave=0, petiole=0), tolerance, amount=0.0)
    points = made.positions[0, made.corner_verts]
    following = np.arange(1, len(points) + 1)
    following[made.face_offsets[1:] - 1] = made.face_offsets[:-1]
    cross = points[:, 0] * points[following, 1] - points[:, 1] * points[following, 0]
    areas = np.add.reduceat(cross, made.face_offsets[:-1]) / 2
    assert areas.min() > -1e-9
    line = outline(blade, 1e-4)
    after = np.roll(line, -1, axis=0)
    whole = (line[:, 0] * after[:, 1] - line[:, 1] * after[:, 0]).sum() / 2
    assert areas.sum() == pytest.approx(whole, abs=2.2 * tolerance)
    np.testing.assert_allclose(made.uv, points[:, :2] + [0.5, 0.0], atol=1e-6)
