# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Other processes give what this one gives, to the bit: in order, with its errors, and without them as well."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tests.engine import support
from tests.engine.emission.test_emission import scene
from tetflora_addon import parallel
from tetflora_addon.emission.drawing import TILE
from tetflora_addon.growth.hashing import uniform
from tetflora_addon.processes import pool
from tetflora_addon.processes.messages import Closed, receive, send
from tetflora_addon.processes.pool import in_processes

KEYS = np.arange(1000, dtype=np.uint64)


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Two processes, on any machine, however little there is to do."""
    monkeypatch.setattr(parallel, "threads", lambda: 2)
    yield
    assert not pool._pool.broken


@given(
    st.lists(
        hnp.arrays(
            st.sampled_from([np.float32, np.int64, bool]), hnp.array_shapes(min_dims=0, min_side=0, max_side=40)
        ),
        max_size=4,
    )
)
def test_messages_come_out_as_they_went_in(arrays: list[np.ndarray]) -> None:
    arrays += [arrays[0].T, np.arange(9000.0)[::3]] if arrays else []
    stream = io.BytesIO()
    send(stream, "call", arrays, {"name": None})
    stream.seek(0)
    kind, back, rest = receive(stream)
    assert (kind, rest) == ("call", {"name": None})
    for one, other in zip(arrays, back, strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.dtype == other.dtype and other.flags.writeable
    with pytest.raises(Closed):
        receive(stream)


def test_results_are_in_order(two: None) -> None:
    made = list(in_processes(uniform, KEYS, range(7)))
    assert [m.tolist() for m in made] == [uniform(KEYS, number).tolist() for number in range(7)]


def test_an_error_is_raised_here_and_names_where_it_happened(two: None) -> None:
    made = in_processes(uniform, KEYS, [1, "one"])
    next(made)
    with pytest.raises(ValueError, match="one") as caught:
        next(made)
    assert "in uniform" in caught.value.__notes__[0]


def test_who_is_killed_is_replaced(two: None) -> None:
    list(in_processes(uniform, KEYS, range(4)))
    for child in list(pool._pool.children):
        child._process.kill()
    assert len(list(in_processes(uniform, KEYS, range(7)))) == 7


def test_without_another_python_the_work_is_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "threads", lambda: 2)
    monkeypatch.setattr(pool, "_python", lambda: "")
    assert len(list(in_processes(lambda shared, item: shared + item, 1, range(3)))) == 3


def test_what_cannot_be_sent_is_an_error(two: None) -> None:
    with pytest.raises((AttributeError, TypeError), match=r"lambda|pickle"):
        list(in_processes(lambda shared, item: shared + item, 1, range(3)))


def arrays_of(thing: object) -> list[np.ndarray]:
    """All arrays of a block, in a fixed order."""
    if isinstance(thing, np.ndarray):
        return [thing]
    if isinstance(thing, dict):
        thing = list(thing.values())
    if not isinstance(thing, (list, tuple)):
        thing = list(vars(thing).values()) if hasattr(thing, "__dict__") else []
    return [array for one in thing for array in arrays_of(one)]


def test_blocks_do_not_depend_on_the_number_of_processes(two: None, monkeypatch: pytest.MonkeyPatch) -> None:
    flora, _, camera, result = scene()
    camera = replace(camera, width=2 * TILE, height=120)
    found = []
    for number in (2, 1):
        monkeypatch.setattr(parallel, "threads", lambda number=number: number)
        blocks, facets, _ = support.drawn(flora, result, camera, 1.5, 0.6)
        found.append(arrays_of([blocks, facets]))
    assert len(found[0]) == len(found[1]) > 10
    for one, other in zip(*found, strict=True):
        assert one.tobytes() == other.tobytes()
