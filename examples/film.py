# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A film of ten seconds: from the edge of a wood to one leaf of an oak, and the same place through a year.

    python -m examples.film                                  # docs/images/film.mp4, from frames in out/film
    python -m examples.film --out out/try --width 240 --every 12
    python -m examples.film --every 4 --first 1              # a quarter of the frames, for one of four processes

Every frame is refined for its own camera and day. Frames that are there already are not rendered again, so that the
film goes on where it was stopped. Looked for: no jump of the camera, leaves and shadows that do not flicker, snow
that comes and goes by degrees, colors of all seasons, an exposure that changes by degrees.
"""

from __future__ import annotations

import sys
from dataclasses import fields, replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from devtools import session

from . import stage, wood
from .close_ups import render
from .seasons import AHEAD, EYE, LENS, LOOKS, Look, build, dress, height

ROOT = Path(__file__).resolve().parent.parent
SIZE, SAMPLES, RATE = (480, 270), 32, 12
#: Frames of the way to the leaf, and of the year.
WAY, YEAR = 72, 48
#: Where the oak stands, meters, how far from the leaf the way ends, and the lens that it ends with.
_OAK, _END, _LENS = (8.0, 10.0), 0.2, 40.0
#: Stops of the exposure at both ends of the way, and of the year: snow is bright, leaves in shade are dark.
_FAR, _NEAR = 1.0, 1.25
#: With which the year begins, as the way ends in summer.
_DAY = 200.0
_DAYS = 365.0
#: The light of the way comes from behind the camera, onto the leaf.
_SUMMER = replace(LOOKS["summer"], sun=(38.0, 150.0))


def along(frame: int) -> float:
    """How far the way has come in a frame, 0 to 1: softly at both ends."""
    part = frame / (WAY - 1)
    return 0.5 * (part + part * part * (3.0 - 2.0 * part))


def fly(scene: bpy.types.Scene, leaf: Vector, eye: Vector, ahead: Vector, part: float) -> None:
    """Move the camera from an eye to a leaf: nearer by the same ratio for the same part of the way."""
    begin = eye - leaf
    distance = begin.length * (_END / begin.length) ** part
    toward = begin.normalized().lerp(Vector(wood.TOWARD), part).normalized()
    target = ahead.lerp(leaf, 1.0 - (1.0 - part) ** 3)
    wood.aim(scene, target, leaf + toward * distance, LENS + part * (_LENS - LENS))


def look_of(day: float) -> Look:
    """The light, snow and air of a day, between those of the seasons."""
    known = list(LOOKS.values())
    days = np.array([look.day for look in known])
    after = int(np.searchsorted(days, day)) % len(known)
    before, first = (after - 1) % len(known), days[after - 1]
    part = ((day - first) % _DAYS) / ((days[after] - first) % _DAYS)

    def mixed(old: object, new: object) -> object:
        if isinstance(old, tuple):
            return tuple(mixed(a, b) for a, b in zip(old, new, strict=True))
        return (1.0 - part) * old + part * new

    values = {field.name: mixed(getattr(known[before], field.name), getattr(known[after], field.name))
              for field in fields(Look)}  # fmt: skip
    return Look(**{**values, "day": day})


def place(scene: bpy.types.Scene) -> tuple[Vector, Vector, Vector]:
    """Fill an empty scene with the place of the seasons; the leaf of its oak, and whence and where the year is seen."""
    build(scene)
    bpy.data.objects.remove(next(o for o in scene.objects if o.tetflora.is_plant and o.tetflora.species == "oak"))
    stage.plant(scene, "oak", 1, _on_land(*_OAK, 0.0), name="The oak")
    return wood.leaf_of_the_oak(scene), _on_land(*EYE), _on_land(*AHEAD)


def _on_land(x: float, y: float, above: float) -> Vector:
    return Vector((x, y, above + float(height(np.float64(x), np.float64(y)))))


def render_film(
    path: Path | None,
    folder: Path,
    size: tuple[int, int] = SIZE,
    samples: int = SAMPLES,
    chosen: range = range(WAY + YEAR),
) -> None:
    """Render frames into a folder, in an empty scene, and store them as an MP4 where a path is given."""
    from .paper.animation import save_film

    scene = bpy.context.scene
    leaf, eye, ahead = place(scene)
    folder.mkdir(parents=True, exist_ok=True)
    pictures = [folder / f"{frame:04d}.png" for frame in chosen]
    for frame, picture in zip(chosen, pictures, strict=True):
        if picture.exists():
            continue
        look = _SUMMER if frame < WAY else look_of(_DAY + _DAYS * (frame - WAY) / YEAR)
        dress(scene, look)
        if frame < WAY:
            fly(scene, leaf, eye, ahead, along(frame))
            render(picture, size, samples, exposure=_FAR + (_NEAR - _FAR) * along(frame))
        else:
            wood.aim(scene, ahead, eye, LENS)
            render(picture, size, samples, gray=look.gray)
    if path is not None:
        save_film(pictures, RATE, path)


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = stage.words(__doc__, ROOT / "out" / "film", SIZE, SAMPLES)
    parser.add_argument("--every", type=int, default=1, help="only every so many frames")
    parser.add_argument("--first", type=int, default=0, help="frame to begin with")
    given = parser.parse_args(arguments)
    session.start()
    session.clean_file()
    chosen = range(given.first, WAY + YEAR, given.every)
    path = ROOT / "docs" / "images" / "film.mp4" if len(chosen) == WAY + YEAR else None
    render_film(path, given.out, stage.size_of(given, SIZE), given.samples, chosen)
    return 0


if __name__ == "__main__":
    sys.exit(main())
