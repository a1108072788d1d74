# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays that are kept: never worked out twice while there is room, and never those of something else."""

from __future__ import annotations

import numpy as np
import pytest

from tetflora_addon.storage import memoized


@pytest.fixture
def double():
    """A function that doubles arrays and says what it was asked for."""
    asked = []

    @memoized(most_bytes=8 * 10)
    def function(*arrays):
        asked.append(arrays)
        return tuple(2 * array for array in arrays)

    function.asked = asked
    return function


def test_the_same_arrays_are_worked_out_once(double):
    first = double(np.arange(3.0), np.arange(2.0))
    again = double(np.arange(3.0), np.arange(2.0))
    assert len(double.asked) == 1
    assert all(a is b for a, b in zip(first, again, strict=True))
    assert [a.tolist() for a in again] == [[0.0, 2.0, 4.0], [0.0, 2.0]]


@pytest.mark.parametrize(
    "others",
    [
        [np.array([1.0, 2.0, 3.0, np.nextafter(4.0, 5.0)])],
        [np.array([[1.0, 2.0], [3.0, 4.0]])],
        [np.array([1.0, 2.0]), np.array([3.0, 4.0])],
        [np.array([1.0, 2.0, 3.0, 4.0]).view(np.int64)],
        [np.array([[1.0, 3.0], [2.0, 4.0]]).T],
    ],
    ids=["value", "shape", "number", "type", "order"],
)
def test_other_arrays_are_worked_out_anew(double, others):
    one = np.array([1.0, 2.0, 3.0, 4.0])
    double(one)
    found = double(*others)
    assert len(double.asked) == 2
    assert all(np.array_equal(a, 2 * b) for a, b in zip(found, others, strict=True))


def test_an_array_that_is_changed_in_place_is_another_one(double):
    one = np.arange(3.0)
    double(one)
    one[1] = 7.0
    assert double(one)[0].tolist() == [0.0, 14.0, 4.0]


def test_nobody_can_change_what_others_get(double):
    with pytest.raises(ValueError, match="read-only"):
        double(np.arange(3.0))[0][0] = 1.0


def test_what_nobody_asked_for_longest_goes_first(double):
    a, b, c = (np.full(4, value) for value in (1.0, 2.0, 3.0))
    for one in (a, b, a, c, a):  # room for two of four numbers
        double(one)
    assert [asked[0][0] for asked in double.asked] == [1.0, 2.0, 3.0]
    assert double(b)[0].tolist() == [4.0] * 4
    assert len(double.asked) == 4


def test_what_is_too_large_makes_nothing_else_go(double):
    double(np.arange(3.0))
    double(np.ones(100))
    double(np.arange(3.0))
    assert len(double.asked) == 2


def test_what_is_too_large_is_given_all_the_same(double):
    for _ in range(2):
        assert len(double(np.ones(100))[0]) == 100
    assert len(double.asked) == 2
