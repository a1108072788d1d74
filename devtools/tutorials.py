# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Goes through the manual's tutorials in the real window: ``BLENDER=/path/to/blender python -m devtools.tutorials``.

Names of tutorials choose some: ``own_ground biome grown_forest real_place own_trees film``. The renders become
docs/images/tutorial-NAME.jpg; pictures of the window stay in ``--out``. The steps are tests/window/tutorial_steps.py.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from examples import place

from . import build, window

STEPS = build.ROOT / "tests" / "window" / "tutorial_steps.py"
IMAGES = build.ROOT / "docs" / "images"
WIDTH = 960
#: Picture of the manual, and the renders that it shows side by side, by their names.
PICTURES = {
    "own-ground": ("own_ground",),
    "biome": ("biome", "biome_autumn"),
    "grown-forest": ("grown_forest_20", "grown_forest_100"),
    "real-place": ("real_place",),
    "own-trees": ("own_trees",),
    "film": ("film_4", "film_25", "film_40", "film_60"),
}


def run(blender: str, out: Path, home: Path, seconds: float, names: str = "", width: int = WIDTH) -> dict:
    """Go through tutorials in a window.

    Parameters
    ----------
    blender : str
        The executable of a full Blender.
    out : Path
        Receives pictures and renders.
    home : Path
        A home of Blender with TetFlora installed.
    seconds : float
        After which Blender is ended.
    names : str, optional
        Tutorials, with commas; all by default.
    width : int, optional
        Of the renders, pixels.

    Returns
    -------
    dict
        What `devtools.window.run_in_window` returns.
    """
    (out / "place").mkdir(parents=True, exist_ok=True)
    place.write(out / "place")
    os.environ.update(TETFLORA_TUTORIALS=names, TETFLORA_TUTORIAL_WIDTH=str(width))
    return window.run_in_window(blender, STEPS, out, seconds, home)


def install(blender: str, folder: Path) -> Path:
    """A home of Blender in which the extension of this working tree is installed."""
    home = folder / "home"
    home.mkdir()
    archive = build.build(folder / "dist")
    command = [blender, "-b", "--command", "extension", "install-file", "-r", "user_default", "-e", archive]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(home)}
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return home


def main() -> int:
    """Go through them, and store the pictures of those that are complete; 1 if a step failed."""
    parser = argparse.ArgumentParser(prog="devtools.tutorials", description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", help="tutorials; all by default")
    parser.add_argument("--out", type=Path, default=build.ROOT / "out" / "tutorials", help="folder of all pictures")
    given = parser.parse_args()
    blender = os.environ.get("BLENDER")
    if not blender:
        print("Set BLENDER=/path/to/blender: tutorials need the window of a full Blender.", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory(prefix="tetflora-tutorials-") as folder:
        home = install(blender, Path(folder))
        result = run(blender, given.out, home, 3600.0, ",".join(given.names))
    print(json.dumps(result["values"], indent=1))
    if not result["ok"]:
        print(result["error"], file=sys.stderr)
    for name, parts in PICTURES.items():
        renders = [given.out / f"{part}_render.png" for part in parts]
        if all(path.exists() for path in renders):
            half = ("-resize", "50%") if len(parts) > 1 else ()
            command = ["montage", *map(str, renders), "-geometry", "+2+2", "-tile", "2x" if len(parts) > 1 else "1x"]
            target = IMAGES / f"tutorial-{name}.jpg"
            subprocess.run([*command, *half, "-strip", "-quality", "84", str(target)], check=True)
    return 0 if result["ok"] else 1


if __name__ == "__main__":
    sys.exit(main())
