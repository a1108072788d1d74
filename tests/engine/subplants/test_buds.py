# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Buds and ends of near branches: where they are, how large, and that they grow from nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import support
from tests.engine.subplants.test_leaf_meshes import check_topology
from tests.engine.subplants.test_wood_detail import assert_same, even, grown
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.growth.growth import WholeBranches, leaf_counts
from tetflora_addon.subplants.rings import BUD_RINGS, bud_numbers, bud_rings, fineness
from tetflora_addon.subplants.tubes import tube_buffers

_BUD = {"length": 0.01, "width": 0.5, "lateral": 1.0, "color": [0.3, 0.1, 0.05]}


def twigs(**bud: float) -> tuple[Flora, WholeBranches]:
    flora = support.compiled(support.small(bud={**_BUD, **bud}))
    return flora, grown(flora)[2]


def test_one_at_each_end_and_in_each_axil() -> None:
    flora, whole = twigs()
    leaves = leaf_counts(flora.rows, whole.branches)
    np.testing.assert_array_equal(bud_numbers(flora, whole), BUD_RINGS * np.where(leaves > 0, leaves + 1, 0))
    rings, owner = bud_rings(flora, whole, fineness(flora, whole, even(1e-5)))
    center = rings.center.reshape(-1, BUD_RINGS, 3)
    length = np.linalg.norm(center[:, -1] - center[:, 0], axis=1)
    assert length.min() > 0.007
    assert length.max() < 0.019
    # They point the way the twig grows.
    along = ((center[:, -1] - center[:, 0]) * whole.branches.frame[owner, :, 2]).sum(axis=1) / length
    assert along.min() > 0.6
    wide = 2 * np.linalg.norm(rings.reach[0], axis=0).reshape(-1, BUD_RINGS).max(axis=1)
    np.testing.assert_allclose(wide / length, 0.5 / 1.08, rtol=1e-3)


def test_some_axils_have_none() -> None:
    flora, whole = twigs(lateral=0.3)
    leaves = leaf_counts(flora.rows, whole.branches)
    lateral = bud_numbers(flora, whole).sum() / BUD_RINGS - (leaves > 0).sum()
    assert lateral / leaves.sum() == pytest.approx(0.3, abs=0.06)


def test_from_afar_there_are_none() -> None:
    with_buds, whole = twigs()
    without = support.compiled(support.small())
    assert_same(tube_buffers(with_buds, [whole], even(0.1)), tube_buffers(without, grown(without)[2:3], even(0.1)))


def test_they_grow_from_nothing_and_stay_where_they_are() -> None:
    flora, whole = twigs()
    some = whole.take(np.s_[:1])
    coarse = float(some.branches.radius[0])
    sizes, places = [], []
    for pixel in (0.99 * coarse, 0.6 * coarse, 0.1 * coarse):
        fine = fineness(flora, some, even(pixel))
        rings, _ = bud_rings(flora, some, fine)
        center = rings.center.reshape(-1, BUD_RINGS, 3)
        sizes.append(np.linalg.norm(center[:, -1] - center[:, 0], axis=1).max())
        places.append(center[:, 0])
    assert sizes[0] < 0.01 * sizes[2] < sizes[1] < sizes[2]
    np.testing.assert_allclose(places[0], places[2], atol=2e-3)


def test_meshes_with_buds_are_whole_and_have_their_color() -> None:
    flora, whole = twigs()
    mesh = tube_buffers(flora, [whole], even(0.0003))
    check_topology(mesh)
    color = mesh.attributes["tf_color"][1]
    assert (np.abs(color - [0.3, 0.1, 0.05]).max(axis=1) < 1e-6).mean() > 0.2


def test_ends_are_closed() -> None:
    """The last ring of each branch is a point: no picture looks into a pipe."""
    flora = support.compiled(support.small(dead={"number": [6, 2]}, order0={"branch_start": 0.4}))
    for whole in grown(flora):
        one = whole.take(np.s_[-1:])
        mesh = tube_buffers(flora, [one], even(float(one.branches.radius[0]) / 50))
        sides = int(fineness(flora, one, even(float(one.branches.radius[0]) / 50)).sides[0])
        if flora.rows["order"][one.branches.row[0]] != 0:
            assert np.ptp(mesh.positions[-sides:], axis=0).max() < 1e-6
