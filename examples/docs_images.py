# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the rendered images of the documentation anew: ``python -m examples.docs_images [IMAGE ...]``.

Without names it makes what this commit has not made yet, so that it goes on where it was stopped (``make
docs-images``). Each is made in a process of its own. Pictures of the window come from `devtools.window_pictures` and
`devtools.tutorials`, which need a full Blender.
"""

from __future__ import annotations

import argparse
import importlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from benchmarks.report import head
from devtools import session

from .paper.pictures import LARGEST, save_jpeg

ROOT = Path(__file__).resolve().parent.parent
IMAGES, MADE = ROOT / "docs" / "images", ROOT / "out" / "docs-images"


def store(source: Path, target: Path) -> None:
    """Store an image as a JPEG, without what Blender writes into it, such as the path of the file."""
    save_jpeg(Image.open(source).convert("RGB"), target)


def _row(out: Path) -> None:
    from .demo import run

    run(out, 960)
    for name in ("cycles", "eevee", "top"):
        store(out / f"{name}.png", IMAGES / f"row80-{name}.jpg")


def _biomes(out: Path) -> None:
    from .biomes import render_sheets

    render_sheets(IMAGES, out)


#: Sheets: modules, functions that store one as a JPEG, and its file.
SHEETS = {
    "species": ("species_sheet", "render_sheet", "species.jpg"),
    "orders": ("species_sheet", "render_opening", "orders.jpg"),
    "close_ups": ("close_ups", "render_sheet", "close_ups.jpg"),
    "wood": ("wood", "render_dolly", "dolly.jpg"),
    "seasons": ("seasons", "render_sheet", "seasons.jpg"),
    "ages": ("ages", "render_ages", "ages.jpg"),
    "grown": ("grown", "render_grown", "grown.jpg"),
    "assets": ("scattered", "render_pair", "assets.jpg"),
}
#: Single pictures: functions that have Blender write one, in modules of their names or another one.
PICTURES = {
    "landscape": ("landscape", "render_landscape"),
    "million": ("million", "render_million"),
    "interior": ("biomes", "render_interior"),
}
#: Those that make several.
OTHERS: dict[str, Callable[[Path], None]] = {"row80": _row, "biomes": _biomes}
NAMES = (*OTHERS, *PICTURES, *SHEETS)


def make(name: str) -> None:
    """Make an image in this process."""
    session.start()
    session.clean_file()
    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        if name in OTHERS:
            OTHERS[name](Path(folder))
            return
        module, function, *sheet = SHEETS.get(name) or PICTURES[name]
        path = IMAGES / sheet[0] if sheet else Path(folder) / f"{name}.png"
        getattr(importlib.import_module(f"{__package__}.{module}"), function)(path)
        if not sheet:
            store(path, IMAGES / f"{name}.jpg")


def is_made(name: str) -> bool:
    """Whether this commit has made an image."""
    mark = MADE / name
    return mark.exists() and mark.read_text() == head() != ""


def main(arguments: list[str] | None = None) -> int:
    """Render; exit code 1 if one fails, or an image is larger than the repository wants."""
    parser = argparse.ArgumentParser(prog="python -m examples.docs_images", description=__doc__.partition("\n")[0])
    parser.add_argument(
        "names", nargs="*", metavar="IMAGE", help=f"all that are missing, or some of {', '.join(NAMES)}"
    )
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if unknown := set(given.names) - set(NAMES):
        parser.error(f"unknown images {', '.join(sorted(unknown))}; known are {', '.join(NAMES)}")
    if given.here:
        make(*given.names)
        return 0
    MADE.mkdir(parents=True, exist_ok=True)
    failed = []
    for name in given.names or [name for name in NAMES if not is_made(name)]:
        begin = time.perf_counter()
        done = subprocess.run([sys.executable, "-m", "examples.docs_images", name, "--here"], cwd=ROOT, check=False)
        print(f"{name}: {time.perf_counter() - begin:.0f} s, exit code {done.returncode}", flush=True)
        if done.returncode:
            failed.append(name)
        else:
            (MADE / name).write_text(head())
    large = [path.name for path in IMAGES.iterdir() if path.stat().st_size > LARGEST]
    if failed or large:
        print("failed:", ", ".join(failed) or "–", "larger than 500 kB:", ", ".join(large) or "–", file=sys.stderr)
    return 1 if failed or large else 0


if __name__ == "__main__":
    sys.exit(main())
