# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A cache folder in which somebody else may write: nobody is led elsewhere, held up, filled or emptied by it."""

from __future__ import annotations

import os
import random
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.attack import material
from tetflora_addon import storage

VALUES = np.linspace(0.0, 1.0, 24).reshape(2, 3, 4)
NAME = "tetflora-test-1-ab.npz"

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links, pipes and owners as Unix has them")


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    made = tmp_path / "cache"
    made.mkdir()
    storage.set_folder(made)
    yield made
    storage.set_folder(None)


def asked(content: str = "ab") -> bool:
    """Whether the result had to be found out; it is the right one."""
    found = []
    result = storage.cached("test", content, VALUES.shape, lambda: found.append(1) or VALUES)
    assert result.tobytes() == VALUES.tobytes()
    return bool(found)


def test_a_link_in_the_place_of_a_result_is_replaced(folder: Path, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"mine")
    (folder / NAME).symlink_to(victim)
    before = victim.stat()
    assert asked()
    assert victim.read_bytes() == b"mine"
    assert victim.stat().st_mtime_ns == before.st_mtime_ns
    assert not (folder / NAME).is_symlink()
    assert not asked()


def test_a_link_to_a_sound_result_is_not_read(folder: Path, tmp_path: Path) -> None:
    asked()
    (folder / NAME).rename(tmp_path / NAME)
    (folder / NAME).symlink_to(tmp_path / NAME)
    assert asked()


def test_a_pipe_holds_nobody_up(folder: Path) -> None:
    os.mkfifo(folder / NAME)
    assert asked()
    assert not asked()


def test_what_is_packed_or_says_to_be_large_takes_no_memory(folder: Path) -> None:
    """Eighty damaged, packed and lying entries from a fixed seed: none is believed, none takes memory."""
    rng = random.Random(20)
    asked()
    tracemalloc.start()
    rebuilt = 0
    for _ in range(80):
        (folder / NAME).write_bytes(material.cache_entry(rng, NAME, VALUES))
        tracemalloc.reset_peak()
        base = tracemalloc.get_traced_memory()[0]
        rebuilt += asked()
        assert tracemalloc.get_traced_memory()[1] - base < 1_000_000
        assert not asked()
    tracemalloc.stop()
    assert 40 < rebuilt < 80


def test_a_file_of_another_size_is_not_read_at_all(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (folder / NAME).open("wb") as file:
        file.truncate(1 << 40)
    assert asked()
    assert (folder / NAME).stat().st_size < VALUES.nbytes + 4096


def test_what_others_own_is_left_alone_and_does_not_count(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who fills the folder does not empty what others have there; everybody clears away his own."""
    asked("a0")
    size = (folder / "tetflora-test-1-a0.npz").stat().st_size
    monkeypatch.setattr(storage, "MOST_BYTES", 3 * size)
    foreign = [folder / f"tetflora-test-1-f{n}.npz" for n in range(10)]
    begun = folder / ".tetflora-aa.part"
    for path in (*foreign, begun):
        path.write_bytes(bytes(10 * size))
        os.utime(path, (time.time() - 10_000,) * 2)
    real, mine = storage._is_own, {f"tetflora-test-1-a{n}.npz" for n in range(9)}
    owned = {path.stat().st_ino for path in (*foreign, begun)}
    monkeypatch.setattr(storage, "_is_own", lambda status: real(status) and status.st_ino not in owned)
    for number in range(9):
        asked(f"a{number}")
        assert not asked(f"a{number}")
    assert all(path.stat().st_size == 10 * size for path in (*foreign, begun))
    assert len([p for p in folder.iterdir() if p.name in mine]) == 3
    assert storage.clear() == 3
    assert sorted(folder.iterdir()) == sorted((*foreign, begun))


def test_the_owner_is_the_user_of_the_process(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked()
    status = (folder / NAME).stat()
    assert storage._is_own(status)
    monkeypatch.setattr(os, "getuid", lambda: status.st_uid + 1)
    assert not storage._is_own(status)


def test_a_file_that_cannot_be_deleted_does_not_stop_the_others(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(3):
        asked(f"a{number}")
    real = os.unlink

    def unlink(path: str, **options: object) -> None:
        if str(path).endswith("a0.npz"):
            raise PermissionError(1, "Operation not permitted")
        real(path, **options)

    monkeypatch.setattr(os, "unlink", unlink)
    monkeypatch.setattr(storage, "MOST_BYTES", 1)
    asked("a3")
    assert [p.name for p in folder.iterdir()] == ["tetflora-test-1-a0.npz"]
    assert storage.last_problem() == ""


def test_no_more_than_so_many_entries_are_looked_at(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked = []
    monkeypatch.setattr(storage, "_is_own", lambda status: looked.append(status) or True)
    monkeypatch.setattr(storage, "_MOST_ENTRIES", 5)
    for number in range(20):
        asked(f"{number:x}")
    looked.clear()
    asked("ff")
    assert len(looked) == 5


@pytest.mark.parametrize("content", ["../x", "", "a/b", "AB", "a\0", "a.npz"])
def test_names_of_results_are_names_of_files(folder: Path, content: str) -> None:
    with pytest.raises(ValueError, match="is no name of a result"):
        storage.cached("test", content, VALUES.shape, lambda: VALUES)
