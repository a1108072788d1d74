# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every benchmark prints and writes."""

from __future__ import annotations

import json
import os
import platform
import resource
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
CLEAR_PEAK = Path("/proc/self/clear_refs")
#: Seconds between two looks at the memory of all processes.
LOOK = 0.05
Targets = dict[str, dict[str, float]]


def peak_mb() -> float:
    """Largest resident memory so far of this process and of those that work for it, megabytes."""
    from tetflora_addon.processes import pool  # as Blender has loaded it: not before `session.start`

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3) + pool.peak() / 1e6


def cpu_s() -> float:
    """Seconds of all processors so far, of this process and of those that it started, the ended ones included.

    Those that still run count only where the system has a ``/proc``.
    """
    own = os.times()
    return own.user + own.system + own.children_user + own.children_system + sum(_running_children_s())


def _running_children_s() -> Iterator[float]:
    tick = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 1
    for _, fields in children():
        yield (int(fields[11]) + int(fields[12])) / tick


def children() -> Iterator[tuple[int, list[str]]]:
    """Processes that this one has started and that still run, or wait for it to learn of their end.

    Their numbers, and what the system tells of each: state, parent, …, ticks in programs and in the system.
    """
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # ended meanwhile
            fields = path.read_text("ascii", "replace").rpartition(")")[2].split()  # a name may hold anything
            if int(fields[1]) == os.getpid():
                yield int(path.parent.name), fields


class Watch:
    """The largest sum of resident memory of this process and those that it has started at one time.

    Attributes
    ----------
    most : float
        Megabytes, looked at every `LOOK` seconds; pages that processes share count in each.
    """

    def __init__(self) -> None:
        self.most = 0.0
        threading.Thread(target=self._look, daemon=True).start()

    def _look(self) -> None:
        page = os.sysconf("SC_PAGE_SIZE")
        while True:
            held = 0
            for pid in ("self", *(pid for pid, _ in children())):
                with suppress(OSError):
                    held += int(Path("/proc", str(pid), "statm").read_text("ascii").split()[1])
            self.most = max(self.most, held * page / 1e6)
            time.sleep(LOOK)


def forget_peak() -> None:
    """Let `peak_mb` begin with what the process has now, where the system can do that."""
    if CLEAR_PEAK.exists():
        CLEAR_PEAK.write_text("5")


def records_of(words: list[str], timeout: float = 3600.0, **variables: str) -> list[dict]:
    """What ``python -m benchmarks`` prints as lines of JSON, called with words in a process of its own.

    timeout: seconds; variables: of its environment.

    Raises
    ------
    RuntimeError
        It has failed, with the end of what it says.
    """
    command, own = [sys.executable, "-m", __package__, *words], os.environ | variables
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=timeout, check=False, env=own)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not lines:
        raise RuntimeError(f"{' '.join(words)} failed with {done.returncode}:\n{done.stderr[-3000:]}")
    for line in lines:
        print(line, flush=True)
    return [json.loads(line) for line in lines]


def apart(function: Callable[..., dict], *given: object, timeout: float = 3600.0, **variables: str) -> dict:
    """What a function of a benchmark returns in a process of its own; see `records_of`.

    What it is given and what it returns has to be what JSON can tell.
    """
    name = function.__module__.rpartition(".")[2]
    return records_of([name, "--call", function.__name__, json.dumps(given)], timeout, **variables)[-1]


@cache
def published(name: str) -> dict[str, Any]:
    """What ``tests/data`` has of that name."""
    return json.loads((ROOT / "tests" / "data" / f"{name}.json").read_text(encoding="utf-8"))


def size_of(text: str) -> tuple[int, int]:
    """Width and height in a word: ``960x540``."""
    width, height = text.lower().split("x")
    return int(width), int(height)


def setting(text: str) -> tuple[str, str]:
    """A name and its value in a word: ``max_memory=2``."""
    name, value = text.split("=")
    return name, value


def machine() -> str:
    """Processor, cores and system in a line."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        names = [line.split(":", 1)[1].strip() for line in lines]
        model = names[0] if names else model
    return f"{model}, {os.cpu_count()} cores, {platform.system()}"


def commit() -> str:
    """Commit of the repository, with a plus sign where files are changed; empty outside of a repository."""
    return head() + ("+" if _git("status", "--porcelain", "-uno") else "")


def head() -> str:
    """Commit of the repository; empty outside of one."""
    return _git("rev-parse", "--short", "HEAD")


def _git(*words: str) -> str:
    with suppress(OSError, subprocess.CalledProcessError):
        done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True)
        return done.stdout.strip()
    return ""


def report(name: str, figures: dict[str, float], targets: Targets) -> dict:
    """The record of one benchmark as it is written to JSON."""
    import bpy

    return {
        "name": name,
        "figures": figures,
        "targets": targets,
        "machine": machine(),
        "blender": bpy.app.version_string,
        "commit": commit(),
    }


def write(path: Path | None, record: object) -> None:
    """Keep a record, or a list of them, where that is asked for."""
    if path:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def missed(record: dict) -> list[str]:
    """Targets that do not hold, in words; a figure that is missing counts."""
    out = []
    for key, target in record["targets"].items():
        value = record["figures"].get(key)
        for kind, limit in target.items():
            if value is None or (value > limit if kind == "max" else value < limit):
                out.append(f"{key} is {value}, should be at {'most' if kind == 'max' else 'least'} {limit}")
    return out


def table(record: dict) -> str:
    """Figures beside their targets, one a line."""
    lines = [f"{record['name']}  (Blender {record['blender']}, {record['machine']}, {record['commit']})"]
    for key, value in record["figures"].items():
        if isinstance(value, list):
            shown = f"{len(value)} rows"
        else:
            shown = f"{value:,}" if isinstance(value, int) else f"{value:,.4g}"
        target = record["targets"].get(key, {})
        limits = "  ".join(f"{'≤' if kind == 'max' else '≥'} {limit:,g}" for kind, limit in target.items())
        lines.append(f"  {key:24s} {shown:>14s}   {limits}")
    return "\n".join(lines)
