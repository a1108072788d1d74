# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What Windows and macOS have not, or have otherwise, tried where it can be tried."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from devtools import rooms
from tetflora_addon import files

#: Modules and functions of Unix that Windows has none of.
_UNIX = ("resource", "fcntl", "pwd", "grp", "termios", "posix_ipc")
_ONLY_UNIX = ("sched_getaffinity", "getuid", "geteuid", "sysconf", "O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "fork")

#: Works as the extension does: reads what ships, writes and reads what is the user's own, asks for processes.
_USE = """
import importlib, operator, os, pkgutil, sys, time
from pathlib import Path
if len(sys.argv) > 2:
    for name in sys.argv[2].split():
        sys.modules[name] = None
    for name in sys.argv[3].split():
        if hasattr(os, name):
            delattr(os, name)
    os.supports_dir_fd = os.supports_follow_symlinks = set()
import tetflora_addon
for module in pkgutil.walk_packages(tetflora_addon.__path__, "tetflora_addon."):
    if not module.name.startswith("tetflora_addon.blender") and module.name != "tetflora_addon.processes.child":
        importlib.import_module(module.name)
from tetflora_addon import files, memory, parallel, storage
from tetflora_addon.processes import pool
from tetflora_addon.species.catalog import list_species, load_species
if __name__ == "__main__":
    folder = Path(sys.argv[1])
    assert len([load_species(name) for name in sorted(list_species())]) > 20
    files.write_whole(folder / "species.json", '{"name": "Wei\\u00dfdorn"}')
    assert files.parse_json(files.read_whole(folder / "species.json", 1000)) == {"name": "Wei\\u00dfdorn"}
    assert memory.limit(0.0) > 0 and memory.allowance(0.0) > 0
    parallel.threads = lambda: 2
    assert list(pool.in_processes(operator.add, 1, range(4))) == [1, 2, 3, 4]
    assert len(pool._pool.children) == 2
    assert storage.clear(folder) == 0
    print("all done")
"""


def use(folder: Path, *given: str, options: tuple[str, ...] = (), **environment: str) -> None:
    """Run it in a process with a folder to write to."""
    command = [sys.executable, *options, "-c", _USE, str(folder), *given]
    done = subprocess.run(
        command, cwd=rooms.ROOT, env={**os.environ, **environment}, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0 and "all done" in done.stdout, done.stderr


def test_without_what_only_unix_has(tmp_path: Path) -> None:
    use(tmp_path, " ".join(_UNIX), " ".join(_ONLY_UNIX))


def test_with_another_language_clock_and_letters(tmp_path: Path) -> None:
    """Where text is not UTF-8 by itself, as on Windows, in a folder of a German user, at another time."""
    folder = tmp_path / "Bäume im März"
    folder.mkdir()
    options = ("-X", "warn_default_encoding", "-W", "error::EncodingWarning")
    surroundings = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "TZ": "Asia/Kathmandu"}
    use(folder, options=options, **surroundings)


def test_texts_are_utf_8_and_nothing_forks_or_asks_for_the_language() -> None:
    """Else Windows would take its own code page; binary files have none."""
    looked_at = re.compile(r"\b(?:multiprocessing|locale|fork|strptime|open|read_text|write_text)\b")
    for path in rooms.sources().values():
        if not looked_at.search(path.read_text(encoding="utf-8")):
            continue  # nothing of that is in it; to read it node by node takes twenty times as long
        for node in ast.walk(rooms.tree(path)):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            assert not {"multiprocessing", "locale"} & {name.split(".")[0] for name in names}, path
            assert getattr(node, "attr", "") not in {"fork", "strptime"}, path
            if isinstance(node, ast.Call):
                name = getattr(node.func, "attr", getattr(node.func, "id", ""))
                modes = [a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
                binary = any(re.fullmatch(r"[rwxa]\+?b", mode) for mode in modes)
                opens = name in {"read_text", "write_text"} or (isinstance(node.func, ast.Name) and name == "open")
                told = any(keyword.arg == "encoding" for keyword in node.keywords)
                assert told or binary or not opens, f"{path}:{node.lineno}"


def test_paths_of_the_extension_are_short_and_of_plain_letters() -> None:
    """Windows allows 260 letters with those of the folder: that of a user has about 100."""
    tracked = subprocess.run(
        ["git", "ls-files", *rooms.PRODUCT], cwd=rooms.ROOT, capture_output=True, text=True, check=False
    ).stdout.splitlines() or [path.relative_to(rooms.ROOT).as_posix() for path in rooms.sources().values()]
    assert max(map(len, tracked)) <= 100
    assert all(path.isascii() and not re.search(r'[<>:"\\|?*]', path) for path in tracked)
    parts = {Path(path).stem for path in tracked}
    assert not [part for part in parts if part != "__init__" and files._RESERVED.fullmatch(part)]
    assert max(Counter(path.casefold() for path in tracked).values()) == 1


def held(times: int, number: int, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Let another program have files open for so many tries, as Windows says it; the waits between them."""
    original, left, waits = Path.replace, [times], []

    def replace(self: Path, target: Path) -> Path:
        if left[0]:
            left[0] -= 1
            error = PermissionError(13, "the file is being used by another process")
            error.winerror = number
            raise error
        return original(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    monkeypatch.setattr(files.time, "sleep", waits.append)
    return waits


@pytest.mark.parametrize("number", [5, 32])
def test_a_file_that_another_program_has_open_is_waited_for(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits = held(3, number, monkeypatch)
    files.write_whole(tmp_path / "own.json", json.dumps({"a": 1}))
    assert json.loads((tmp_path / "own.json").read_text(encoding="utf-8")) == {"a": 1}
    assert len(waits) == 3 and sum(waits) < 1.0


def test_but_not_for_ever_and_the_earlier_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "own.json"
    files.write_whole(path, "1")
    waits = held(10**6, 32, monkeypatch)
    with pytest.raises(PermissionError, match="another process"):
        files.write_whole(path, "2")
    assert sum(waits) < 2.0
    assert path.read_text(encoding="utf-8") == "1" and [p.name for p in tmp_path.iterdir()] == ["own.json"]


def test_a_folder_that_is_for_reading_only_is_no_reason_to_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits = held(10**6, 0, monkeypatch)
    with pytest.raises(PermissionError):
        files.write_whole(tmp_path / "own.json", "2")
    assert not waits
