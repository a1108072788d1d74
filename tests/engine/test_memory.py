# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory the machine and this process have, and what that leaves for results."""

from __future__ import annotations

import ctypes
import math
import sys
from mmap import mmap
from types import SimpleNamespace

import numpy as np
import pytest

from tetflora_addon import memory


def test_the_memory_of_this_machine_is_known():
    assert 2**28 < memory.total() < 2**50
    assert 1e6 < memory.resident() < memory.total()


def test_what_this_process_takes_is_seen():
    before = memory.resident()
    held = np.frombuffer(mmap(-1, 200_000_000), np.uint8)  # pages that nobody had before
    held[:] = 1
    grown = memory.resident() - before
    assert 0.8 * held.nbytes < grown < 1.3 * held.nbytes


def test_the_limit_is_that_of_the_artist_or_half_of_the_machine(monkeypatch):
    monkeypatch.setattr(memory, "total", lambda: 16_000_000_000)
    assert memory.limit(3.0) == 3e9
    assert memory.limit(0.0) == 8e9
    assert memory.limit(40.0) == 40e9  # nobody forbids to swap
    monkeypatch.setattr(memory, "total", lambda: None)
    assert memory.limit(0.0) == math.inf


def test_what_is_left_is_the_limit_less_all_that_others_take(monkeypatch):
    monkeypatch.setattr(memory, "total", lambda: 16_000_000_000)
    monkeypatch.setattr(memory, "resident", lambda: 1_500_000_000)
    assert memory.allowance(4.0) == 2.5e9
    assert memory.allowance(0.0) == 6.5e9
    assert memory.allowance(4.0, memory.picture_bytes(1_000_000)) == 2.5e9 - 1e6 * memory.BYTES_PER_PIXEL
    assert memory.picture_bytes(2_000_000, denoised=True) > 5 * memory.picture_bytes(2_000_000)
    assert memory.allowance(1.0) == memory.LEAST
    monkeypatch.setattr(memory, "resident", lambda: None)
    assert memory.allowance(4.0) == 4e9
    monkeypatch.setattr(memory, "total", lambda: None)
    assert memory.allowance(0.0, 1e12) == math.inf


def test_structures_of_other_systems_have_their_sizes():
    sizes = {memory._Task: 48, memory._Status: 64, memory._Counters: 8 + 8 * ctypes.sizeof(ctypes.c_size_t)}
    assert {kind: ctypes.sizeof(kind) for kind in sizes} == sizes


@pytest.mark.parametrize(
    ("system", "asked"), [("linux", {"malloc_trim"}), ("darwin", {"malloc_zone_pressure_relief"}), ("win32", set())]
)
def test_each_system_is_asked_in_its_own_words_to_take_memory_back(monkeypatch, system, asked):
    called = set()

    class Library:
        def __init__(self, _name):
            pass

        def __getattr__(self, name):
            return lambda *_: called.add(name)

    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(ctypes, "CDLL", Library)
    memory.give_back()
    assert called == asked


def test_windows_is_asked_about_this_process(monkeypatch):
    class Kernel:
        def K32GetProcessMemoryInfo(self, process, counters, length):  # noqa: N802
            assert ctypes.c_ssize_t(process.value).value == -1
            assert length == ctypes.sizeof(counters._obj)
            counters._obj.working_set = 123
            return 1

    monkeypatch.setattr(ctypes, "windll", SimpleNamespace(kernel32=Kernel()), raising=False)
    assert memory._windows_resident() == 123


@pytest.mark.parametrize("failure", [OSError, ValueError, AttributeError])
def test_a_system_that_does_not_tell_is_not_guessed(monkeypatch, failure):
    def fail():
        raise failure

    asked = {"win32": "_windows", "darwin": "_mac"}.get(sys.platform, "_unix")
    for name in ("total", "resident"):
        monkeypatch.setattr(memory, f"{asked}_{name}", fail)
    memory.total.cache_clear()
    try:
        assert memory.total() is None
        assert memory.resident() is None
    finally:
        memory.total.cache_clear()


@pytest.mark.parametrize(
    ("text", "files", "expected"),
    [
        ("0::/job/one", {"job/memory.max": "4000000000", "job/one/memory.max": "max"}, [4_000_000_000]),
        ("0::/job/one", {"job/memory.max": "5", "job/one/memory.max": "3"}, [3, 5]),
        ("0::/", {"memory.max": "7"}, [7]),
        ("4:cpu,memory:/job", {"memory/job/memory.limit_in_bytes": "9"}, [9]),
        ("4:cpuset:/job", {"memory/job/memory.limit_in_bytes": "9", "job/memory.max": "9"}, []),
        ("nonsense", {"memory.max": "7"}, []),
    ],
)
def test_containers_have_limits_of_their_own(monkeypatch, tmp_path, text, files, expected):
    groups = tmp_path / "groups"
    for name, content in files.items():
        (groups / name).parent.mkdir(parents=True, exist_ok=True)
        (groups / name).write_text(content + "\n", encoding="utf-8")
    (tmp_path / "own").write_text(text + "\n", encoding="utf-8")
    monkeypatch.setattr(memory, "_CGROUPS", groups)
    monkeypatch.setattr(memory, "_OWN_GROUPS", tmp_path / "own")
    assert memory._container_limits() == expected
    monkeypatch.setattr(memory, "_OWN_GROUPS", tmp_path / "missing")
    assert memory._container_limits() == []
