# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures of arrays that change in small steps hold what plain copies would hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tetflora_addon import arrays
from tetflora_addon.arrays import Arrays, Chunks, Growing, column, nested


@dataclass(frozen=True)
class Marks(Arrays):
    """Things with a number, and a place that follows from it."""

    number: NDArray[np.int32] = column(dtype=np.int32)
    place: NDArray[np.float32] = column(3, dtype=np.float32)


@dataclass(frozen=True)
class Boxes(Arrays):
    """Things with marks."""

    marks: Marks = nested(Marks)
    size: NDArray[np.float64]


def marks(start: int, count: int) -> Marks:
    """Things with numbers of their own, places with either layout."""
    number = np.arange(start, start + count, dtype=np.int32)
    place = np.stack([number, 2 * number, -number], axis=start % 2).astype(np.float32)
    return Marks(number, place if start % 2 else place.T)


#: How many are dropped, as a fraction, and how many come, again and again.
STEPS = st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(0, 40)), max_size=12)


@given(STEPS, st.integers(0, 30), st.integers(0, 2**31))
def test_what_grows_holds_what_stays_and_what_comes_in_order(steps: list, first: int, seed: int) -> None:
    """Rows that stay and rows that come keep their order, nothing is lost, and little room is to spare."""
    rng, made = np.random.default_rng(seed), first
    growing, most, old = Growing(marks(0, first)), first, np.arange(first)
    for fraction, coming in steps:
        gone = np.flatnonzero(rng.random(len(growing)) < fraction)
        left = np.delete(growing.rows.number, gone)
        growing.exchange(gone, marks(made, coming))
        number, place = growing.rows.number, growing.rows.place
        np.testing.assert_array_equal(number[number < made], left)
        np.testing.assert_array_equal(number[number >= made], np.arange(made, made + coming))
        np.testing.assert_array_equal(place, np.stack([number, 2 * number, -number], axis=1))
        same = min(len(old), len(number)) if coming >= len(gone) else gone[coming]
        unmoved = np.setdiff1d(np.arange(same), gone)
        np.testing.assert_array_equal(number[unmoved], old[unmoved])
        made, most, old = made + coming, max(most, len(number)), number.copy()
        assert len(growing) == len(number) == len(left) + coming
        assert growing.nbytes <= 16 * most * (1 + 1 / arrays._SPARE)
        assert place.flags.c_contiguous


@given(STEPS, st.integers(0, 30), st.integers(0, 2**31))
def test_chunks_hold_what_is_not_taken_out(steps: list, first: int, seed: int) -> None:
    """In the order in which it came, whether they are joined on the way or not."""

    def boxes(start: int, count: int) -> Boxes:
        return Boxes(marks(start, count), np.arange(start, start + count) / 2)

    rng, made, left = np.random.default_rng(seed), first, np.arange(first)
    some, other = Chunks(boxes(0, first)), Chunks(boxes(0, first))
    for fraction, coming in steps:
        out = rng.random(len(left)) < fraction
        asked = other.take_out(np.flatnonzero(out))
        found = some.take_out(np.flatnonzero(some.unmarked)[out])
        for each in (asked, found):
            np.testing.assert_array_equal(each.marks.number, left[out])
            np.testing.assert_array_equal(each.size, left[out] / 2)
        some.append(boxes(made, coming))
        other.append(boxes(made, coming))
        left = np.concatenate([left[~out], np.arange(made, made + coming)])
        np.testing.assert_array_equal(other.joined().marks.number, left)
        assert len(other) == len(left) == len(some) - some.marked
        made += coming
    for each in (some, other):
        np.testing.assert_array_equal(each.joined().marks.place[:, 1], 2.0 * left)
        assert each.joined() is each.joined()
        assert each.unmarked.all()
