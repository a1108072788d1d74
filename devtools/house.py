# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""House rules that ruff does not know: ``python -m devtools.house`` lists what breaks them.

Each source file names its license and stays short, and no file names the machine that it was written on. The check
runs in ``make lint``. Rules about rooms, imports and sizes are in `devtools.rooms`, those about names in
`devtools.words`.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from . import rooms, words

ROOT = Path(__file__).resolve().parent.parent
LONGEST = 800  # lines; a file has one subject, however long that is
SOURCES = {".py", ".toml", ".sh", ".yml", ".yaml"}
SOURCE_NAMES = {"Makefile", "run"}
HEADER = ("SPDX-FileCopyrightText:", "SPDX-License-Identifier: GPL-3.0-or-later")

# Written so that they do not match themselves.
_FOREIGN = {
    "a path of one machine": re.compile(
        r"(?<![\w.~}/-])/(?:w[o]rk|r[o]ot|h[o]me/\w+|U[s]ers/\w+|tmp/s[e]tup)\b|C:\\U[s]ers"
    ),
    "the host of a package registry": re.compile(
        r"p[y]pi\.org|p[y]thonhosted\.|a[n]aconda\.(?:org|com)|blender\.org/p[y]pi"
    ),
    "a folder outside the repository": re.compile(r"\.\./s[h]ared\b"),
}
_ALLOWED = {(".ci/run", "a folder outside the repository")}


def files() -> list[Path]:
    """Files under version control, and new ones that git does not ignore; paths below the root."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return sorted(p for name in set(listed.split("\0")) if name and (p := ROOT / name).is_file())


def problems() -> list[str]:
    """Everything that breaks a rule, one line each; empty when the house is in order."""
    found = rooms.problems()
    for path in rooms.sources().values():
        found += words.fillers(path.relative_to(rooms.ROOT).as_posix(), rooms.tree(path))
    for path in files():
        name = path.relative_to(ROOT).as_posix()
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a picture
        lines = text.splitlines()
        if (path.suffix in SOURCES or path.name in SOURCE_NAMES) and lines:
            head = "\n".join(lines[:4])
            if not all(part in head for part in HEADER):
                found.append(f"{name}:1: no SPDX header")
            if len(lines) > LONGEST:
                found.append(f"{name}: {len(lines)} lines; split it by subject, {LONGEST} is the most")
        found += words.problems(name, lines)
        for what, pattern in _FOREIGN.items():
            if (name, what) in _ALLOWED:
                continue
            found += [
                f"{name}:{i}: names {what}: {line.strip()[:80]}"
                for i, line in enumerate(lines, 1)
                if pattern.search(line)
            ]
    return found


def main() -> int:
    """Print the problems; 1 when there are any."""
    found = problems()
    print("\n".join(found) or "house rules: all kept")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
