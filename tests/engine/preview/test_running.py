# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown of many plants while the timeline runs: as much cover, of the same ones from frame to frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.preview import running

NUMBER, SIDE = 20_000, 300.0
#: Looks to the north from 40 m above the middle of the southern edge, as wide as high, from 1 m to 1,000 m.
VIEW = np.array([[1.0, 0, 0, 0], [0, 0, 1, -40], [0, 1.002, 0, -2.002], [0, 1, 0, 0]])


@pytest.fixture(scope="module")
def seeds() -> Seeds:
    rng = np.random.default_rng(3)
    place = np.column_stack([rng.uniform(-SIDE, SIDE, NUMBER), rng.uniform(-SIDE, SIDE, NUMBER), np.zeros(NUMBER)])
    return support.plants(np.arange(NUMBER), 0, place, 1.0)


def cover(plants: running.InView, areas: np.ndarray, kept: Seeds) -> np.ndarray:
    """Layers (p,) in each part of the view, of those that are kept."""
    some = np.isin(plants.seeds.seed, kept.seed)
    factor = np.median(kept.scale) ** 2
    return np.bincount(plants.part, plants.covered * areas * some * factor, running._PARTS**2)


def test_in_view_are_those_in_front_and_beside(seeds: Seeds) -> None:
    found = running.in_view(seeds, [VIEW])
    x, y, _ = seeds.position.T
    beside = np.abs(x) < y + 15.0
    assert set(found.seeds.seed) <= set(seeds.seed[(y > 0.0) & beside])
    assert set(found.seeds.seed) >= set(seeds.seed[(y > 50.0) & (np.abs(x) < y)])
    turned = VIEW @ np.diag([1.0, -1.0, 1.0, 1.0])
    both = running.in_view(seeds, [VIEW, turned])
    assert set(both.seeds.seed) == set(found.seeds.seed) | set(running.in_view(seeds, [turned]).seeds.seed)
    assert len(running.in_view(seeds, []).seeds) == 0


def test_few_plants_are_all_shown_as_they_are(seeds: Seeds) -> None:
    found = running.in_view(seeds, [VIEW])
    assert running.shown(found, np.full(len(found.seeds), 30.0), most=NUMBER) is found.seeds


def test_what_is_shown_covers_as_much_where_anything_is_seen_through(seeds: Seeds) -> None:
    found = running.in_view(seeds, [VIEW])
    for size in (0.5, 20.0, 30.0):  # of larger ones too few stay in a part to be even
        areas = np.full(len(found.seeds), size)
        every, kept = cover(found, areas, found.seeds), running.shown(found, areas, most=3_000)
        assert len(kept) < 3_300
        some = np.flatnonzero(np.bincount(found.part, minlength=len(every)) > 300)  # others are too few to be even
        expected = np.minimum(every, running.LAYERS)[some]
        np.testing.assert_allclose(cover(found, areas, kept)[some], expected, rtol=0.35)


def test_as_plants_grow_the_same_ones_stay_and_fewer_are_needed(seeds: Seeds) -> None:
    found = running.in_view(seeds, [VIEW])
    shown = [running.shown(found, np.full(len(found.seeds), size), most=5_000) for size in (20.0, 21.0, 60.0)]
    assert all((one.scale == 1.0).all() for one in shown)
    young, next_year, old = (set(one.seed) for one in shown)
    assert len(old) < len(young)
    assert len(next_year - young) < 0.01 * len(young)  # those that fill a part of the view by then
    assert (np.diff(shown[0].position[:, 1]) >= 0.0).all()  # the nearest are drawn first


def test_plants_of_one_seed_are_thinned_like_others(seeds: Seeds) -> None:
    """As where an artist has duplicated one."""
    shown = [
        running.shown(found, np.full(len(found.seeds), 30.0), most=2_000)
        for found in (running.in_view(one, [VIEW]) for one in (seeds, replace(seeds, seed=np.zeros_like(seeds.seed))))
    ]
    assert 0 < len(shown[0]) < len(seeds) // 4
    np.testing.assert_array_equal(shown[0].position, shown[1].position)
