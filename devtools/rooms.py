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
MAX_FILES = 330
MAX_LINES = 64_217
MAX_ROOM_LINES = 4_000
MAX_LEVELS = 10

_LOW = "blender blender/materials blender/species blender/scene"
_ASSETS = "assets blender/assets"
_HIGH = "blender/results blender/placing blender/job"
_LAND = "blender/stands blender/geodata blender/biomes blender/export"
#: What each room may import besides itself: folders below ``tetflora_addon`` in words separated by spaces. A dot stands
#: for the files beside these folders, and ``blender`` alone for the files at the top of that folder.
_TABLE = {
    ".": "",
    "processes": ".",
    "leaves": ".",
    "species": ". leaves",
    "growth": ". species",
    "compiled": ". leaves species growth",
    "assets": ". growth compiled",
    "subplants": ". leaves growth compiled",
    "tetrahedra": ".",
    "camera": ". tetrahedra",
    "refinement": ". growth assets compiled subplants tetrahedra camera",
    "preview": ". growth compiled subplants tetrahedra camera refinement",
    "planting": ". growth",
    "stands": ". species growth",
    "geodata": ".",
    "proxies": ". species growth assets compiled subplants camera refinement",
    "light": ". compiled tetrahedra camera refinement proxies",
    "emission": ". processes leaves species growth assets compiled subplants tetrahedra camera refinement proxies "
    "light",
    "export": ". species growth compiled subplants",
    "blender": ". processes growth camera refinement",
    "blender/materials": ". growth light blender",
    "blender/species": ". leaves species blender",
    "blender/scene": ". species growth assets compiled camera refinement planting light "
    "blender blender/materials blender/species",
    "blender/assets": f". growth assets {_LOW}",
    "blender/results": f". leaves species refinement light emission {_LOW}",
    "blender/placing": f". species growth compiled planting {_LOW} blender/assets",
    "blender/stands": ". species compiled planting stands blender blender/species blender/scene blender/placing",
    "blender/geodata": f". species growth compiled planting geodata {_LOW} blender/placing",
    "blender/biomes": f". species growth planting {_LOW} blender/placing blender/stands",
    "blender/job": f". processes species growth compiled camera refinement proxies light emission {_LOW} {_ASSETS} "
    "blender/results",
    "blender/viewport": f". species growth compiled tetrahedra camera refinement preview {_LOW} {_HIGH}",
    "blender/export": ". species growth compiled camera planting export blender blender/species blender/scene "
    "blender/placing blender/geodata blender/materials blender/results blender/job",
    "blender/cli": ". blender blender/scene blender/job blender/export",
    "operators": ". species assets camera refinement preview planting geodata blender blender/species blender/scene "
    f"blender/assets {_HIGH} {_LAND} blender/viewport",
    "panels": f". species blender blender/species blender/scene blender/assets {_HIGH} "
    "blender/geodata blender/biomes blender/viewport operators",
}
ARROWS = {room: tuple(others.split()) for room, others in _TABLE.items()}
#: Rooms of the engine: numpy and the standard library only, never Blender.
ENGINE = tuple(room for room in ARROWS if not room.startswith(("blender", "operators", "panels")))
#: Files at the top of ``blender`` that gather parts of all its rooms; the others are tools that its rooms use.
GATHERERS = (f"{ADDON}/blender/__init__.py", f"{ADDON}/blender/properties.py")


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
    return "extension" if folder == "." else folder.removeprefix(ADDON).removeprefix("/") or "."


@cache
def tree(path: Path) -> ast.Module:
    """A source file as Python reads it."""
    return ast.parse(path.read_text(encoding="utf-8"))


def _imported(name: str, path: Path) -> Iterator[str]:
    """Dotted names of the product's modules that a file imports, wherever in it."""
    package = [part for part in name.split(".") if part]
    if path.name != "__init__.py":
        package.pop()
    for node in ast.walk(tree(path)):
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
        for node in tree(path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(path.relative_to(ROOT).as_posix())
    return dict(found)


def arrows() -> dict[tuple[str, str], list[str]]:
    """Imports between rooms as they are: for each pair of rooms, what imports what."""
    found = defaultdict(list)
    for name, others in imports().items():
        path = sources()[name].relative_to(ROOT).as_posix()
        room = room_of(sources()[name])
        for other in others if room != "extension" and path not in GATHERERS else ():
            there = room_of(sources()[other])
            if there != room:
                found[room, there].append(f"{path} imports {other}")
    return dict(found)


def forbidden() -> list[str]:
    """Imports between rooms that `ARROWS` does not allow, one line each."""
    return sorted(
        f"{room} may not import {there}: {use}"
        for (room, there), uses in arrows().items()
        for use in uses
        if there not in ARROWS.get(room, ())
    )


def unused() -> list[str]:
    """Arrows that are allowed and that no file needs any more, one line each."""
    used = arrows()
    return [
        f"{room} imports nothing of {there}"
        for room, all in ARROWS.items()
        for there in all
        if (room, there) not in used
    ]


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


#: Where rooms stand across the picture, so that few arrows pass behind a third room; 0 is left.
_LANES = {
    **dict.fromkeys(("leaves", "species", "growth", "compiled", "subplants", ".", "blender/placing"), 0.3),
    **dict.fromkeys(("tetrahedra", "camera"), 0.62),
    **dict.fromkeys(("preview", "blender/viewport"), 0.12),
    **dict.fromkeys(("blender/species", "blender"), 0.9),
    **dict.fromkeys(("blender/results", "blender/job"), 0.68),
    "emission": 0.72,
    "planting": 0.78,
    "processes": 0.46,
    "geodata": 0.82,
    "assets": 0.62,
    "blender/assets": 0.4,
    "blender/scene": 0.6,
    "export": 0.72,
    "blender/export": 0.85,
    "blender/geodata": 0.72,
    "blender/cli": 0.85,
    "operators": 0.3,
    "panels": 0.3,
}


@cache
def _reached(room: str) -> frozenset[str]:
    """Rooms that a room imports, and those that they import in turn."""
    return frozenset(ARROWS[room]).union(*(_reached(other) for other in ARROWS[room]))


def draw(path: Path) -> None:
    """The allowed arrows as a picture: rooms in rows, each above all that it may import.

    Arrows that follow from others are left out, as in a Hasse diagram.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    rows, counted = heights(), lines()
    figure, axes = plt.subplots(figsize=(6.4, 0.66 * (max(rows.values()) + 1)), dpi=110)
    axes.set(xlim=(0, 1), ylim=(-0.5, max(rows.values()) + 0.5))
    axes.axis("off")
    boxes = {}
    for room, height in rows.items():
        fill = "#dcebd6" if room in ENGINE else "#d9e4f2" if room.startswith("blender") else "#f3e2cf"
        boxes[room] = axes.text(
            _LANES.get(room, 0.5),
            height,
            f"{ADDON if room == '.' else room}\n{counted[room]:,} lines",
            ha="center",
            va="center",
            fontsize=8,
            zorder=2,
            bbox={"boxstyle": "round,pad=0.35", "fc": fill, "ec": "#44515c", "lw": 0.8},
        )
    figure.tight_layout(pad=0.2)
    figure.canvas.draw()  # boxes get their sizes
    for room, others in ARROWS.items():
        for other in set(others) - set().union(*(_reached(other) for other in others)):
            arrow = {"arrowstyle": "-|>", "color": "#7a8a99", "lw": 1.1, "shrinkA": 1, "shrinkB": 1}
            patches = {"patchA": boxes[room].get_bbox_patch(), "patchB": boxes[other].get_bbox_patch()}
            axes.annotate(
                "", boxes[other].get_position(), boxes[room].get_position(), arrowprops=arrow | patches, zorder=1
            )
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
