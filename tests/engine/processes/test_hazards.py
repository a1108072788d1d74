# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Other processes that cannot be started, die, or have to end; and folders as artists name them."""

from __future__ import annotations

import operator
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from shutil import copytree

import pytest

from tests.engine.processes import in_child
from tetflora_addon import parallel
from tetflora_addon.processes import child, pool
from tetflora_addon.processes.messages import Closed
from tetflora_addon.processes.pool import in_processes

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def told(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """What is told; two processes, and none of an earlier test."""
    texts: list[str] = []
    monkeypatch.setattr(parallel, "threads", lambda: 2)
    monkeypatch.setattr(pool, "tell", texts.append)
    monkeypatch.setattr(pool._pool, "largest", pool._BYTES_EACH)  # whatever earlier work has needed
    pool.stop()
    pool.resume()
    yield texts
    pool.set_memory_limit(float("inf"))
    pool.stop()
    pool.resume()


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen]:
    """Processes that are started from now on."""
    all: list[subprocess.Popen] = []
    start = subprocess.Popen

    def counted(*given: object, **named: object) -> subprocess.Popen:
        all.append(start(*given, **named))
        return all[-1]

    monkeypatch.setattr(pool.subprocess, "Popen", counted)
    return all


def soon(true: Callable[[], object]) -> bool:
    """Whether something becomes true; what is waited for takes milliseconds."""
    end = time.monotonic() + 10.0
    while not true() and time.monotonic() < end:
        time.sleep(0.002)
    return bool(true())


def test_a_python_that_ends_at_once_is_not_started_for_each_item(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, started: list, told: list[str]
) -> None:
    dead = tmp_path / "python-dead"
    dead.write_text("#!/bin/sh\nexit 1\n")
    dead.chmod(0o755)
    monkeypatch.setattr(pool, "_python", lambda: str(dead))
    assert list(in_processes(operator.add, 1, range(30))) == list(range(1, 31))
    assert 1 <= len(started) <= 2
    assert list(in_processes(operator.add, 1, range(30))) == list(range(1, 31))
    assert len(started) <= 2
    (text,) = told
    assert "cannot be started" in text and "python-dead" in text and "Restart Blender" in text


def test_a_python_without_the_engines_modules_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, told: list[str]
) -> None:
    monkeypatch.setattr(sys, "path", [path for path in sys.path if "site-packages" not in path])
    assert list(in_processes(operator.add, 1, range(3))) == [1, 2, 3]
    assert len(told) == 1 and "numpy" in told[0]


def test_work_that_kills_processes_does_not_go_on_doing_so(started: list, told: list[str]) -> None:
    assert list(in_processes(in_child.dies, os.getpid(), range(12))) == list(range(12))
    assert len(started) <= pool._MOST_DEATHS + 2
    assert len(told) == 1 and "times at their work" in told[0]


def test_a_process_that_had_nothing_to_do_is_replaced_without_a_word(started: list, told: list[str]) -> None:
    list(in_processes(operator.add, 1, range(4)))
    for own in started:
        own.stdin.close()  # it then ends as it does after a minute
        own.wait()
    assert list(in_processes(operator.add, 1, range(4))) == [1, 2, 3, 4]
    assert not told and pool._pool.deaths == 0


def test_memory_is_given_back_in_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "threads", lambda: 4)
    list(in_processes(in_child.after_a_while, 0.05, range(12)))
    assert len(pool._pool.children) == 4
    assert soon(lambda: not any(own._known for own in pool._pool.children))


def test_none_is_started_after_the_end(started: list, told: list[str]) -> None:
    list(in_processes(operator.add, 1, range(4)))
    pool.stop()
    assert all(own.poll() is not None for own in started)
    number = len(started)
    pool.start()
    assert list(in_processes(operator.add, 1, range(4))) == [1, 2, 3, 4]
    assert len(started) == number and not told
    pool.resume()
    assert list(in_processes(operator.add, 1, range(4))) == [1, 2, 3, 4]
    assert len(started) > number


def test_who_waits_for_a_process_learns_that_all_have_ended(started: list, told: list[str]) -> None:
    def work() -> list[object]:
        return list(in_processes(in_child.after_a_while, 60.0, range(6)))

    with ThreadPoolExecutor(1) as threads:
        waiting = threads.submit(work)
        assert soon(lambda: len(started) == 2 and all(own._ready for own in pool._pool.children))
        pool.stop()
        with pytest.raises(Closed):
            waiting.result(10.0)
    assert [own.returncode for own in started] == [-9, -9] and not told
    assert soon(lambda: not pool._pool.children)


def test_threads_end_and_begin_again() -> None:
    assert list(parallel.on_all_cores(abs, [-1, 2])) == [1, 2]
    parallel.stop()
    assert soon(lambda: not any(one.name.startswith("tetflora") for one in threading.enumerate()))
    assert list(parallel.on_all_cores(abs, [-1, 2])) == [1, 2]


def test_they_keep_to_a_part_of_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "threads", lambda: 16)
    assert pool.number(1e12) == 16 and pool.share(1e12) == 16 * pool._BYTES_EACH
    for limit in (1e9, 2e9, 4e9, 8e9):
        assert pool.share(limit) <= limit / 4
        assert pool.share(limit) == pool.number(limit, pool._BYTES_EACH) * pool._BYTES_EACH
    assert pool.share(1e9) == 0.0
    pool.set_memory_limit(2e9)
    list(in_processes(in_child.after_a_while, 0.02, range(12)))
    assert len(pool._pool.children) == pool.number() == 2
    pool.set_memory_limit(1e9)
    assert not pool._pool.children


@pytest.mark.parametrize("name", ["My Add-ons; old: new", "Äußere Wälder, 森", "a" * 120 + "/" + "b" * 120])
def test_in_folders_of_any_name(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, told: list[str]) -> None:
    folder = tmp_path / name / "tetflora_addon"
    copytree(Path(child.__file__).parent, folder / "processes", ignore=lambda *_: {"__pycache__"})
    for file in ("__init__.py", "memory.py"):
        (folder / file).write_bytes((ROOT / "tetflora_addon" / file).read_bytes())
    own = folder / "processes" / "child.py"
    before = sorted(tmp_path.rglob("*"))
    for path in (folder, folder / "processes"):
        path.chmod(0o555)
    monkeypatch.setattr(pool.child_module, "__file__", str(own))
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path / name)])
    try:
        found = list(in_processes(in_child.surroundings, None, range(2)))
    finally:
        for path in (folder, folder / "processes"):
            path.chmod(0o755)
    assert found == [([path for path in sys.path if path], False, str(own))] * 2
    assert not told and sorted(tmp_path.rglob("*")) == before


def test_they_end_with_the_one_that_started_them() -> None:
    """However that ends: nobody could tell them to."""
    script = (
        "import os, signal, operator\n"
        "from tetflora_addon import parallel\n"
        "from tetflora_addon.processes import pool\n"
        "parallel.threads = lambda: 2\n"
        "if __name__ == '__main__':\n"
        "    list(pool.in_processes(operator.add, 1, range(4)))\n"
        "    print(*[own._process.pid for own in pool._pool.children], flush=True)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )
    pids = done.stdout.split()
    assert len(pids) == 2

    def runs(pid: str) -> bool:
        stat = Path("/proc", pid, "stat")
        return stat.exists() and stat.read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()[0] != "Z"

    assert soon(lambda: not any(runs(pid) for pid in pids))


def test_without_a_console() -> None:
    script = (
        "import os, sys, operator; from tetflora_addon import parallel; from tetflora_addon.processes import pool\n"
        "parallel.threads = lambda: 2; sys.stdout = sys.stderr = None\n"
        "if __name__ == '__main__':\n"
        "    made = list(pool.in_processes(operator.add, 1, range(4)))\n"
        "    os._exit(0 if made == [1, 2, 3, 4] and len(pool._pool.children) == 2 else 1)\n"
    )
    shell = ["/bin/sh", "-c", 'exec "$@" 0<&- 1>&- 2>&-', "sh", sys.executable, "-c", script]
    assert subprocess.run(shell, cwd=ROOT, check=False, timeout=60).returncode == 0
