# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Random numbers as a function of seed, path and attribute; pytest turns every warning into an error."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.growth.hashing import Draw, child_key, key_of_seed, mix, signed, uniform

GOLDEN, MASK = 0x9E3779B97F4A7C15, 2**64 - 1


def splitmix(state: int) -> int:
    """The finaliser in Python's own integers."""
    state = (state ^ (state >> 30)) * 0xBF58476D1CE4E5B9 & MASK
    state = (state ^ (state >> 27)) * 0x94D049BB133111EB & MASK
    return state ^ (state >> 31)


@pytest.mark.parametrize(
    ("seed", "outputs"),
    [
        (0, [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]),
        (1234567, [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431]),
    ],
)
def test_published_sequences_of_splitmix64(seed: int, outputs: list[int]) -> None:
    """The generator adds the golden ratio to its state and mixes; both sequences are in its authors' test vectors."""
    states = np.array([(seed + GOLDEN * (i + 1)) & MASK for i in range(len(outputs))], np.uint64)
    assert mix(states).tolist() == outputs


@given(st.integers(0, MASK))
@settings(deadline=None)
def test_mix_is_the_same_in_unlimited_integers(value: int) -> None:
    assert int(mix(np.uint64(value))) == splitmix(value)


@given(st.integers(-(2**63), 2**63 - 1), st.integers(0, 2**41), st.integers(0, 300))
@settings(deadline=None)
def test_one_alone_is_the_same_as_one_of_many(seed: int, index: int, draw: int) -> None:
    """Scalars, 0-d arrays, arrays of any layout: the same numbers, and no warning of overflow."""
    alone = uniform(child_key(key_of_seed(seed), index), draw)
    many = np.full((3, 4), seed)
    for layout in (many, np.asfortranarray(many), np.repeat(many, 2, axis=1)[:, ::2], many.T, many[::-1]):
        numbers = uniform(child_key(key_of_seed(layout), np.full(layout.shape, index, np.int64)), draw)
        assert numbers.shape == layout.shape
        assert (numbers == alone).all()
    assert uniform(child_key(key_of_seed(np.int64(seed)), np.int64(index)), draw) == alone
    assert 0.0 <= alone < 1.0
    assert signed(child_key(key_of_seed(seed), index), draw) == 2 * alone - 1


def test_small_integer_types_hold_the_same_seed() -> None:
    for kind in (np.int8, np.uint8, np.int16, np.int32, np.uint32, np.int64, np.uint64):
        assert key_of_seed(kind(77)) == key_of_seed(77)
    assert key_of_seed(np.int8(-3)) == key_of_seed(np.int64(-3))


def test_numbers_are_even() -> None:
    """χ² over 64 bins and the mean of products with neighbors: for seeds, siblings and draws in a row."""
    n = 64_000
    siblings = uniform(child_key(key_of_seed(5), np.arange(n)), Draw.LENGTH)
    seeds = uniform(key_of_seed(np.arange(n)), Draw.LENGTH)
    draws = np.concatenate([uniform(key_of_seed(np.arange(n // 64)), d) for d in range(64)])
    generations = uniform(child_key(child_key(key_of_seed(np.arange(n)), 0), 0), Draw.LENGTH)
    for numbers in (siblings, seeds, draws, generations):
        bins = np.bincount((numbers * 64).astype(int), minlength=64)
        chi2 = ((bins - n / 64) ** 2 / (n / 64)).sum()
        assert chi2 < 63 + 5 * np.sqrt(2 * 63)
        centered = numbers - 0.5
        for step in (1, 2, 64):
            assert abs((centered[step:] * centered[:-step]).mean()) < 5 / 12 / np.sqrt(n)


def test_attributes_children_and_parents_are_independent() -> None:
    n = 40_000
    key = key_of_seed(np.arange(n))
    columns = [uniform(key, d) for d in Draw] + [uniform(child_key(key, i), d) for i in (0, 1, 1 << 32) for d in (1, 6)]
    correlation = np.corrcoef(np.array(columns))
    np.fill_diagonal(correlation, 0)
    assert np.abs(correlation).max() < 5 / np.sqrt(n)


def test_keys_do_not_collide() -> None:
    keys = child_key(key_of_seed(np.arange(300))[:, None], np.arange(300))
    grandchildren = child_key(keys[:, :20, None], np.arange(20))
    every = np.concatenate([keys.ravel(), grandchildren.ravel(), key_of_seed(np.arange(300))])
    assert len(np.unique(every)) == len(every)
