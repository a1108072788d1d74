# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What instances cost a renderer: which of them are left as they are, and which assets fit into memory."""

from __future__ import annotations

import numpy as np

from tetflora_addon.assets.costs import CYCLES_WHOLE, EEVEE_FEW, NEVER, SAFE, AssetCosts


def costs(triangles: list[int], instances: list[int], pixels: list[float] | None = None) -> AssetCosts:
    pixels = [np.inf] * len(triangles) if pixels is None else pixels
    return AssetCosts(np.array(triangles), np.array(instances), np.array(pixels, float))


def test_few_are_plain_and_many_are_not() -> None:
    few, many = costs([1000], [EEVEE_FEW // 1000]), costs([1000], [EEVEE_FEW // 1000 + 1])
    assert few.plain(False, 0.0) and not many.plain(False, np.inf)
    # Cycles holds an asset once: what counts there is memory.
    assert many.plain(True, 1e9)
    assert costs([1_200_000], [1_000_000]).plain(True, 8e9)
    assert not costs([1_200_000], [1_000_000]).plain(True, 1e9)
    assert not costs([2_000_000] * 60, [1] * 60).plain(True, 16e9)
    assert costs([2_000_000] * 60, [1] * 60).plain(True, np.inf)
    assert costs([], []).plain(True, 0.0) and costs([], []).plain(False, 0.0)
    # Numbers beyond 32 bit.
    assert not costs([20_000_000], [1_000_000]).plain(False, np.inf)


def test_what_is_kept_fits_and_shows_most_for_its_memory() -> None:
    rng = np.random.default_rng(3)
    own = costs(rng.integers(1, 2_000_000, 60).tolist(), rng.integers(1, 500, 60).tolist(), rng.uniform(0, 1e6, 60))
    memory = 290.0 * own.triangles + (1_670.0 + 160.0) * own.instances
    for left in (0.0, 1e9, 4e9, 1e12, np.inf):
        found = own.originals(True, left)
        assert found.fraction > 1.0 and found.shared and found.kites
        assert memory[found.always].sum() <= SAFE * left
        assert found.always.all() == (left >= 1e12)
        worth = own.pixels / memory
        if found.always.any() and not found.always.all():
            # None of the others would still fit, and of those that do the one that is worth most is there.
            assert (memory[~found.always] > SAFE / 2 * left - memory[found.always].sum()).all()
            assert found.always[np.argmax(np.where(memory <= SAFE / 2 * left, worth, -1.0))]
    assert not own.originals(True, 0.0).always.any()


def test_what_is_refined_whatever_it_costs_is_never_always_the_original() -> None:
    own = costs([1000, 2000], [50, 60])
    assert own.plain(True, 8e9)
    found = own.originals(True, 8e9, always=False)
    assert not found.always.any() and found.fraction == CYCLES_WHOLE and found.shared and not found.kites
    found = own.originals(True, 1e5, always=False)
    assert not found.always.any() and found.fraction == NEVER and found.shared


def test_eevee_keeps_nothing_for_its_own_sake() -> None:
    for always in (False, True):
        found = costs([1, 10**6], [10**6, 1]).originals(False, np.inf, always)
        assert not found.always.any() and 0.0 < found.fraction < 1.0 and not found.shared
