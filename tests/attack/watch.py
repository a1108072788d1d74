# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs cases of an attack and watches what they do: exceptions, writes, time and memory.

A case is a function of a random generator and a `Jail`, and stands for what somebody hands over: it may end with an
error that is meant for users, and with nothing else. Python tells of every file that it opens for writing, renames,
removes or links; what Blender itself writes shows in the files outside, which are compared after each case.
"""

from __future__ import annotations

import os
import random
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.report import forget_peak, peak_mb
from tetflora_addon.errors import TetFloraError

#: Processor seconds that no case may take.
SLOW = 5.0
SECRET = "the artist's own"
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGING = {"os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod"}


@dataclass(frozen=True)
class Jail:
    """Folders of one attack.

    Attributes
    ----------
    inside : Path
        Where cases and the program may write.
    outside : Path
        Beside it; holds files that must stay as they are.
    """

    inside: Path
    outside: Path

    @classmethod
    def made(cls, folder: Path) -> Jail:
        """In an empty folder."""
        jail = cls(folder / "inside", folder / "outside")
        for path in (jail.inside, jail.outside, jail.outside / "deep"):
            path.mkdir()
        for name in ("secret.json", "secret.png", "secret", "id_rsa", "deep/secret.json"):
            (jail.outside / name).write_text(SECRET, encoding="utf-8")
        (folder / "secret.json").write_text(SECRET, encoding="utf-8")
        return jail

    def state(self) -> list[tuple[str, int, int]]:
        """What lies outside: names, sizes and times."""
        found = []
        for root in (self.outside.parent, self.outside, self.outside / "deep"):
            for entry in os.scandir(root):
                if entry.path != str(self.inside):
                    status = entry.stat(follow_symlinks=False)
                    found.append((entry.path, status.st_size, status.st_mtime_ns if entry.is_file() else 0))
        return sorted(found)


Case = Callable[[random.Random, Jail], None]


@dataclass
class Findings:
    """What an attack has found.

    Attributes
    ----------
    cases : int
    refused : int
        Those that ended with an error for users.
    raw, outside, slow : list of str
        Cases that ended with any other exception, wrote outside the jail, or took too long.
    """

    cases: int = 0
    refused: int = 0
    raw: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)
    slow: list[str] = field(default_factory=list)
    #: Megabytes that the process had before the first case: in a test, what earlier tests have left.
    begun_mb: float = 0.0

    def figures(self) -> dict[str, float]:
        """For the benchmark's record."""
        return {
            "cases": self.cases,
            "refused": self.refused,
            "raw_exceptions": len(self.raw),
            "writes_outside": len(self.outside),
            "over_5s": len(self.slow),
            "peak_mb": peak_mb(),
            "grown_mb": peak_mb() - self.begun_mb,
        }


def attack(kinds: Mapping[str, tuple[Case, int]], folder: Path, seed: int = 1) -> Findings:
    """Run cases.

    Parameters
    ----------
    kinds : mapping of str to (case, number)
    folder : Path
        Empty; for the jail.
    seed : int
        Case i of a kind follows from the seed, the kind's name and i alone.
    """
    forget_peak()  # of other tests in this process
    jail, findings = Jail.made(folder), Findings(begun_mb=peak_mb())
    for kind, (case, number) in kinds.items():
        for index in range(number):
            one(f"{kind} {index}", case, random.Random(f"{seed} {kind} {index}"), jail, findings)
    return findings


def one(name: str, case: Case, rng: random.Random, jail: Jail, findings: Findings) -> None:
    """Run a single case and note what it did."""
    before, begun = jail.state(), time.process_time()
    findings.cases += 1
    with _watched(jail) as written:
        try:
            with warnings.catch_warnings(), open(os.devnull, "w") as nowhere:
                warnings.simplefilter("ignore")  # numbers of any size overflow
                with redirect_stdout(nowhere), redirect_stderr(nowhere):
                    case(rng, jail)
        except TetFloraError as error:
            findings.refused += 1
            if not str(error).isprintable():
                findings.raw.append(f"{name}: a message that no terminal can show: {error!r:.200}")
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            findings.raw.append(f"{name}: {type(error).__name__}: {error!s:.300} ({last.filename}:{last.lineno})")
    took = time.process_time() - begun
    if took > SLOW:
        findings.slow.append(f"{name}: {took:.1f} s")
    if jail.state() != before:
        written.append("a file outside has changed")
        for path in (jail.outside / "secret.json", jail.outside.parent / "secret.json"):
            path.write_text(SECRET, encoding="utf-8")
    findings.outside += [f"{name}: {path}" for path in written]


_watching: tuple[tuple[str, ...], list[str]] | None = None
_hooked = False


@contextmanager
def _watched(jail: Jail) -> Iterator[list[str]]:
    """Collects paths outside the jail, Blender's own folders and compiled modules that Python is about to change."""
    global _watching, _hooked
    if not _hooked:
        sys.addaudithook(_audit)
        _hooked = True
    own = jail.inside, os.environ.get("BLENDER_USER_RESOURCES"), sys.pycache_prefix
    allowed = [os.path.realpath(path) for path in own if path]
    if "bpy" in sys.modules:
        allowed.append(os.path.realpath(sys.modules["bpy"].app.tempdir))
    written: list[str] = []
    _watching = tuple(allowed), written
    try:
        yield written
    finally:
        _watching = None


def _audit(event: str, arguments: tuple) -> None:
    if _watching is None or (event != "open" and event not in _CHANGING):
        return
    if event == "open":
        path, mode, flags = arguments
        if not (flags or 0) & _WRITING and not set(mode or "") & set("wax+"):
            return
        paths = [path]
    else:
        paths = [a for a in arguments[:2] if isinstance(a, str | bytes | os.PathLike)]
        paths = paths[-1:] if event in ("os.link", "os.symlink") else paths
    allowed, written = _watching
    for path in paths:
        if isinstance(path, int):
            continue
        text = os.fsdecode(path)
        # Links are followed by what opens, and changed themselves by all else.
        follows = event == "open" and not (arguments[2] or 0) & (getattr(os, "O_NOFOLLOW", 0) | os.O_EXCL)
        folder, name = os.path.split(text)
        real = os.path.realpath(text) if follows else os.path.join(os.path.realpath(folder or "."), name)
        if real != os.devnull and "__pycache__" not in real and not real.startswith(tuple(a + os.sep for a in allowed)):
            written.append(f"{event} {real!r:.200}")
