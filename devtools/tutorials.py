# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Goes through the manual's tutorials in the real window: ``BLENDER=/path/to/blender python -m devtools.tutorials``.

Names of tutorials choose some: ``own_ground biome grown_forest real_place own_trees film``. Files that they lead to
are rendered, or the window is shown, as docs/images/tutorial-NAME.jpg; the rest stays in ``--out``. ``--no-mouse`` is
fast, ``--pictures`` only renders files of an earlier run. The steps are tests/window/tutorial_steps.py.
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

from . import build, session, window

STEPS = build.ROOT / "tests" / "window" / "tutorial_steps.py"
IMAGES = build.ROOT / "docs" / "images"
SIZE, SAMPLES = (512, 288), 16
#: Picture of the manual, and the renders that it shows side by side, by their names; of those not here, the window.
PICTURES = {
    "grown-forest": ("grown_forest_100",),
    "own-trees": ("own_trees",),
    "film": ("film_4",),
}


def run(blender: str, out: Path, home: Path, seconds: float, names: str = "", mouse: bool = True) -> dict:
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
    mouse : bool, optional
        Whether buttons are clicked, instead of calling what they call.

    Returns
    -------
    dict
        What `devtools.window.run_in_window` returns.
    """
    (out / "place").mkdir(parents=True, exist_ok=True)
    place.write(out / "place")
    os.environ.update(TETFLORA_TUTORIALS=names, TETFLORA_NO_MOUSE="" if mouse else "1")
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


def render(path: Path) -> None:
    """Render a file that a tutorial leads to, as a picture beside it."""
    session.start()
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    scene.tetflora.quality = 'PREVIEW'
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.cycles.samples, scene.cycles.use_denoising = SAMPLES, True
    scene.render.filepath = str(path.with_suffix(".png"))
    bpy.ops.render.render(write_still=True)


def store(out: Path, name: str, parts: tuple[str, ...]) -> None:
    """Render the files of a tutorial, if all are there, and store them side by side."""
    files = [out / f"{part}.blend" for part in parts]
    if not all(path.exists() for path in files):
        return
    for path in files:
        subprocess.run([sys.executable, "-m", "devtools.tutorials", "--render", str(path)], check=True, cwd=build.ROOT)
    pictures = [str(path.with_suffix(".png")) for path in files]
    command = ["montage", *pictures, "-geometry", f"{SIZE[0]}x{SIZE[1]}+0+0", "-tile", "2x" if len(parts) > 1 else "1x"]
    subprocess.run([*command, "-strip", "-quality", "84", str(IMAGES / f"tutorial-{name}.jpg")], check=True)


def main() -> int:
    """Go through them, and store the pictures of those that are complete; 1 if a step failed."""
    parser = argparse.ArgumentParser(prog="devtools.tutorials", description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", help="tutorials; all by default")
    parser.add_argument("--out", type=Path, default=build.ROOT / "out" / "tutorials", help="folder of all pictures")
    parser.add_argument("--no-mouse", action="store_true", help="call what buttons call: a tenth of the time")
    parser.add_argument("--pictures", action="store_true", help="only render what an earlier run has left there")
    parser.add_argument("--render", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.render is not None:
        render(given.render)
        return 0
    result: dict = {"ok": True}
    if not given.pictures:
        blender = os.environ.get("BLENDER")
        if not blender:
            print("Tutorials are left as they are: set BLENDER=/path/to/blender to go through them.")
            return 0
        with tempfile.TemporaryDirectory(prefix="tetflora-tutorials-") as folder:
            home, names = install(blender, Path(folder)), ",".join(given.names)
            result = run(blender, given.out, home, 3600.0, names, not given.no_mouse)
        print(json.dumps(result["values"], indent=1))
    if not result["ok"]:
        print(result["error"], file=sys.stderr)
    for name in ("own_ground", "biome", "real_place"):
        if (seen := given.out / f"{name}_window.png").exists():
            target = IMAGES / f"tutorial-{name.replace('_', '-')}.jpg"
            subprocess.run(
                ["convert", str(seen), "-resize", "1280x", "-strip", "-quality", "84", str(target)], check=True
            )
    chosen = {name.replace("_", "-") for name in given.names} or set(PICTURES)
    for name in chosen & set(PICTURES):
        store(given.out, name, PICTURES[name])
    return 0 if result["ok"] else 1


if __name__ == "__main__":
    sys.exit(main())
