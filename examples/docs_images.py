# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the rendered images of the documentation anew: ``python -m examples.docs_images [IMAGE ...]``.

Without names it makes what this commit has not made yet, so that it goes on where it was stopped (``make
docs-images``). Each is made in a process of its own. Pictures of the window come from `devtools.window_pictures` and
`devtools.tutorials`, which need a full Blender.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image

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


def _landscape(out: Path) -> None:
    from .landscape import render_landscape

    render_landscape(out / "landscape.png")
    store(out / "landscape.png", IMAGES / "landscape.jpg")


def _million(out: Path) -> None:
    from .million import render_million

    render_million(out / "million.png", memory=6.0)
    store(out / "million.png", IMAGES / "million.jpg")


def _species(_out: Path) -> None:
    from .species_sheet import render_sheet

    render_sheet(IMAGES / "species.jpg")


def _orders(_out: Path) -> None:
    from .species_sheet import render_opening

    render_opening(IMAGES / "orders.jpg")


def _close_ups(_out: Path) -> None:
    from .close_ups import render_sheet

    render_sheet(IMAGES / "close_ups.jpg")


def _wood(_out: Path) -> None:
    import bpy

    from .wood import build, render_dolly

    build(bpy.context.scene)
    render_dolly(IMAGES / "dolly.jpg")


def _seasons(_out: Path) -> None:
    from .seasons import render_sheet

    render_sheet(IMAGES / "seasons.jpg")


def _ages(_out: Path) -> None:
    from .ages import render_ages

    render_ages(IMAGES / "ages.jpg")


def _grown(_out: Path) -> None:
    from .grown import render_grown

    render_grown(IMAGES / "grown.jpg")


def _interior(out: Path) -> None:
    from .biomes import render_interior

    render_interior(out / "interior.png")
    store(out / "interior.png", IMAGES / "interior.jpg")


def _biomes(out: Path) -> None:
    from .biomes import render_sheets

    render_sheets(IMAGES, out)


def _assets(_out: Path) -> None:
    from .scattered import main

    main([])


#: What makes each image; ``row80`` are three, ``wood`` is the dolly.
KINDS: dict[str, Callable[[Path], None]] = {
    "row80": _row,
    "landscape": _landscape,
    "million": _million,
    "species": _species,
    "orders": _orders,
    "close_ups": _close_ups,
    "wood": _wood,
    "interior": _interior,
    "seasons": _seasons,
    "ages": _ages,
    "grown": _grown,
    "biomes": _biomes,
    "assets": _assets,
}


def make(name: str) -> None:
    """Make an image in this process."""
    session.start()
    session.clean_file()
    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        KINDS[name](Path(folder))
    session.stop()


def _commit() -> str:
    command = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def is_made(name: str) -> bool:
    """Whether this commit has made an image."""
    mark = MADE / name
    return mark.exists() and mark.read_text() == _commit() != ""


def main(arguments: list[str] | None = None) -> int:
    """Render; exit code 1 if one fails, or an image is larger than the repository wants."""
    parser = argparse.ArgumentParser(prog="python -m examples.docs_images", description=__doc__.partition("\n")[0])
    parser.add_argument(
        "names", nargs="*", metavar="IMAGE", help=f"all that are missing, or some of {', '.join(KINDS)}"
    )
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if unknown := set(given.names) - set(KINDS):
        parser.error(f"unknown images {', '.join(sorted(unknown))}; known are {', '.join(KINDS)}")
    if given.here:
        make(*given.names)
        return 0
    MADE.mkdir(parents=True, exist_ok=True)
    failed = []
    for name in given.names or [name for name in KINDS if not is_made(name)]:
        begin = time.perf_counter()
        done = subprocess.run([sys.executable, "-m", "examples.docs_images", name, "--here"], cwd=ROOT, check=False)
        print(f"{name}: {time.perf_counter() - begin:.0f} s, exit code {done.returncode}", flush=True)
        if done.returncode:
            failed.append(name)
        else:
            (MADE / name).write_text(_commit())
    large = [path.name for path in IMAGES.iterdir() if path.stat().st_size > LARGEST]
    if failed or large:
        print("failed:", ", ".join(failed) or "–", "larger than 500 kB:", ", ".join(large) or "–", file=sys.stderr)
    return 1 if failed or large else 0


if __name__ == "__main__":
    sys.exit(main())
