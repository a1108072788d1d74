# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rooms of the house: which package may import which, and how large each may become.

    python -m devtools.rooms                                   what breaks the rules
    python -m devtools.rooms --draw docs/images/rooms.png      the allowed arrows as a picture

A room is a folder of source files. `ARROWS` is the only list of allowed imports between rooms: tests, the picture,
and the check in ``make lint`` all read it. Imports count wherever they stand, inside functions too, so that no cycle
can hide there.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ADDON = "tetflora_addon"
PRODUCT = (ADDON, "operators", "panels")

#: Limits of the product: source files, their lines together, lines of one room, levels of imports in ``blender``.
MAX_FILES = 180
MAX_LINES = 36_300
MAX_ROOM_LINES = 3_500
MAX_LEVELS = 9

_SHARED = ("",)  # arrays, buffers, errors, storage
_PLANTS = (*_SHARED, "species", "growth", "compiled", "subplants")
_ENGINE = (*_PLANTS, "tetrahedra", "camera", "refinement")
#: What each room may import besides itself. Names are folders below ``tetflora_addon``; the empty name stands for its
#: own files. ``blender`` alone stands for the files at the top of that folder.
ARROWS: dict[str, tuple[str, ...]] = {
    "": (),
    "species": _SHARED,
    "growth": (*_SHARED, "species"),
    "compiled": (*_SHARED, "species", "growth"),
    "subplants": (*_SHARED, "species", "growth", "compiled"),
    "tetrahedra": _SHARED,
    "camera": (*_SHARED, "tetrahedra"),
    "refinement": (*_PLANTS, "tetrahedra", "camera"),
    "preview": _ENGINE,
    "planting": (*_SHARED, "growth"),
    "proxies": _ENGINE,
    "light": (*_ENGINE, "proxies"),
    "emission": (*_ENGINE, "proxies", "light"),
}
#: Rooms of the engine: numpy and the standard library only, never Blender.
ENGINE = tuple(ARROWS)
_BRIDGE = ("blender", "blender/materials", "blender/species", "blender/scene")
ARROWS |= {
    "blender/materials": (*ENGINE, "blender"),
    "blender/species": (*ENGINE, "blender"),
    "blender/scene": (*ENGINE, "blender", "blender/materials", "blender/species"),
    "blender/results": (*ENGINE, *_BRIDGE),
    "blender/placing": (*ENGINE, *_BRIDGE, "blender/results"),
    "blender/job": (*ENGINE, *_BRIDGE, "blender/results", "blender/placing"),
    "blender/viewport": (*ENGINE, *_BRIDGE, "blender/results", "blender/placing", "blender/job"),
    "blender/cli": (*ENGINE, *_BRIDGE, "blender/results", "blender/job"),
}
#: Files at the top of ``blender`` that gather parts of the rooms; all others are tools that rooms use.
GATHERERS = ("blender/__init__.py", "blender/properties.py")
BLENDER_ROOMS = tuple(room for room in ARROWS if room.startswith("blender/"))
ARROWS |= {
    "blender": ENGINE,
    "operators": ("blender", *BLENDER_ROOMS, *ENGINE),
    "panels": ("operators", "blender", *BLENDER_ROOMS, *ENGINE),
}


@cache
def sources() -> dict[str, Path]:
    """Files of the product by dotted name below the repository's root; a package is its ``__init__.py``."""
    found = {"": ROOT / "__init__.py"}
    for top in PRODUCT:
        for path in sorted((ROOT / top).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def room_of(path: Path) -> str:
    """The room that a file of the product lies in, by its name in `ARROWS`; ``extension`` for the root's own."""
    folder = path.relative_to(ROOT).parent.as_posix()
    return "extension" if folder == "." else folder.removeprefix(ADDON).removeprefix("/")


def _imported(name: str, path: Path) -> Iterator[str]:
    """Dotted names of the product's modules that a file imports, wherever in it."""
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        base = [*package[: len(package) - node.level + 1], *(node.module.split(".") if node.module else ())]
        for alias in node.names:
            whole = ".".join([*base, alias.name])
            yield whole if whole in sources() else ".".join(base)


@cache
def imports() -> dict[str, frozenset[str]]:
    """For each module of the product, the modules of the product that it imports."""
    return {name: frozenset(_imported(name, path)) - {name} for name, path in sources().items()}


def cycles() -> list[list[str]]:
    """Chains of imports between files that lead back to where they began.

    Importing a package counts as importing its ``__init__.py``, which is no cycle for what lies in it.
    """
    found, state, chain = [], {}, []

    def visit(name: str) -> None:
        state[name] = True
        chain.append(name)
        for other in sorted(imports().get(name, ())):
            if other not in state:
                visit(other)
            elif state[other]:
                found.append([*chain[chain.index(other) :], other])
        chain.pop()
        state[name] = False

    for name in sources():
        if name not in state:
            visit(name)
    return found


def levels(prefix: str = f"{ADDON}.blender") -> list[str]:
    """The longest chain of imports between files of a folder, from the top down."""
    inside = {name for name in sources() if name.startswith(prefix + ".")}

    @cache
    def below(name: str) -> tuple[str, ...]:
        chains = [below(other) for other in sorted(imports()[name]) if other in inside]
        return (name, *max(chains, key=len, default=()))

    return list(max((below(name) for name in sorted(inside)), key=len))


def lines() -> Counter[str]:
    """Lines by room."""
    counted: Counter[str] = Counter()
    for path in sources().values():
        counted[room_of(path)] += len(path.read_text(encoding="utf-8").splitlines())
    return counted


def classes() -> dict[str, list[str]]:
    """Files in which each public class of the product is defined."""
    found = defaultdict(list)
    for path in sources().values():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(path.relative_to(ROOT).as_posix())
    return dict(found)


def forbidden() -> list[str]:
    """Imports between rooms that `ARROWS` does not allow, one line each."""
    found = []
    for name, others in imports().items():
        path = sources()[name]
        room = room_of(path)
        if (
            room == "extension"
            or path.relative_to(ROOT / ADDON if room not in PRODUCT else ROOT).as_posix() in GATHERERS
        ):
            continue
        for other in others:
            there = room_of(sources()[other])
            if there not in (room, *ARROWS.get(room, ())):
                found.append(f"{path.relative_to(ROOT).as_posix()}: {room or ADDON} may not import {other}")
    return sorted(found)


def problems() -> list[str]:
    """Everything that breaks a rule of the rooms, one line each."""
    found = [
        f"{path.relative_to(ROOT)}: room {room_of(path)} is not in devtools/rooms.py"
        for path in sources().values()
        if room_of(path) not in (*ARROWS, "extension")
    ]
    found += forbidden()
    found += [f"imports go in a circle: {' -> '.join(cycle)}" for cycle in cycles()]
    counted = lines()
    found += [
        f"room {room}: {number} lines; {MAX_ROOM_LINES} is the limit"
        for room, number in counted.items()
        if number > MAX_ROOM_LINES
    ]
    if len(sources()) > MAX_FILES:
        found.append(f"the product has {len(sources())} files; {MAX_FILES} is the limit")
    if sum(counted.values()) > MAX_LINES:
        found.append(f"the product has {sum(counted.values())} lines; {MAX_LINES} is the limit")
    chain = levels()
    if len(chain) > MAX_LEVELS:
        found.append(f"{len(chain)} levels of imports in blender, {MAX_LEVELS} is the limit: {' -> '.join(chain)}")
    found += [f"class {name} is defined in {', '.join(files)}" for name, files in classes().items() if len(files) > 1]
    return found


def heights() -> dict[str, int]:
    """For each room the length of the longest way down to a room that imports nothing."""

    @cache
    def height(room: str) -> int:
        return 1 + max((height(other) for other in ARROWS[room]), default=-1)

    return {room: height(room) for room in ARROWS}


def draw(path: Path) -> None:
    """The allowed arrows as a picture: rooms in rows, each above all that it may import.

    Arrows that follow from others are left out, as in a Hasse diagram.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    rows = defaultdict(list)
    for room, height in heights().items():
        rows[height].append(room)
    place = {}
    for height, names in rows.items():
        for i, room in enumerate(names):
            place[room] = ((i + 1) / (len(names) + 1) * 10.0 + 0.35 * (height % 2), float(height))
    counted = lines()
    figure, axes = plt.subplots(figsize=(10, 1.0 + 0.72 * len(rows)), dpi=110)
    for room, others in ARROWS.items():
        reached = {far for other in others for far in ARROWS[other]}
        for other in set(others) - reached:
            axes.annotate(
                "",
                place[other],
                place[room],
                zorder=1,
                arrowprops={"arrowstyle": "-|>", "color": "#7a8a99", "shrinkA": 14, "shrinkB": 14, "lw": 1.1},
            )
    for room, (x, y) in place.items():
        colour = "#dcebd6" if room in ENGINE else "#d9e4f2" if room.startswith("blender") else "#f3e2cf"
        axes.text(
            x,
            y,
            f"{room or ADDON}\n{counted[room]:,} lines",
            ha="center",
            va="center",
            fontsize=8,
            zorder=2,
            bbox={"boxstyle": "round,pad=0.35", "fc": colour, "ec": "#44515c", "lw": 0.8},
        )
    axes.set(xlim=(0, 10.6), ylim=(-0.6, max(rows) + 0.6))
    axes.axis("off")
    figure.tight_layout(pad=0.3)
    figure.savefig(path)
    plt.close(figure)


def main(arguments: list[str]) -> int:
    """Print the figures and the problems; 1 when there are any."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", type=Path, metavar="PNG", help="write the picture of allowed arrows")
    chosen = parser.parse_args(arguments)
    if chosen.draw:
        draw(chosen.draw)
    counted = lines()
    room, most = counted.most_common(1)[0]
    print(
        f"{len(sources())} files, {sum(counted.values()):,} lines; largest room {room}: {most:,} lines; "
        f"{len(levels())} levels of imports in blender"
    )
    found = problems()
    print("\n".join(found) or "rules of the rooms: all kept")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
