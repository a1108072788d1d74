# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A film of ten seconds: from a wood to one leaf of an oak, and the oak through a year.

    python -m examples.film                                  # docs/images/film.mp4, from frames in out/film
    python -m examples.film --out out/try --width 240 --every 12

Every frame is refined for its own camera and day. Frames that are there already are not rendered again, so that the
film goes on where it was stopped. Looked for: no jump of the camera, leaves and shadows that do not flicker, snow
that comes and goes by degrees, colors of all seasons, an exposure that never changes in the first part.
"""

from __future__ import annotations

import sys
from dataclasses import fields
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from devtools import session

from . import stage, wood
from .close_ups import render
from .seasons import LOOKS, Look, dress

ROOT = Path(__file__).resolve().parent.parent
SIZE, SAMPLES, RATE = (480, 270), 16, 12
#: Frames of the way to the leaf, and of the year.
WAY, YEAR = 72, 48
#: From how far the way begins and ends, and the year is seen, meters.
_BEGIN, _END, _YEAR = 300.0, 0.2, 26.0
#: Stops of the exposure on the way, over that of a bare `render`.
_EXPOSURE = 1.0
_DAYS = 365.0


def distances() -> np.ndarray:
    """Meters from the leaf in each frame of the way: nearer by the same part in each, softly at both ends."""
    along = np.linspace(0.0, 1.0, WAY)
    soft = along + 0.5 * (along * along * (3.0 - 2.0 * along) - along)
    return np.asarray(_BEGIN * (_END / _BEGIN) ** soft)


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


def render_film(path: Path, folder: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES, every: int = 1) -> None:
    """Render every so many frames into a folder, in an empty scene, and store them as an MP4."""
    from .paper.animation import save_film

    scene, made = bpy.context.scene, []
    wood.build(scene)
    leaf, toward = wood.leaf_of_the_oak(scene), Vector(wood.TOWARD)
    folder.mkdir(parents=True, exist_ok=True)
    for frame in range(0, WAY + YEAR, every):
        made.append(folder / f"{frame:04d}.png")
        if made[-1].exists():
            continue
        if frame < WAY:
            wood.aim(scene, leaf, leaf + toward * float(distances()[frame]), 40.0)
            render(made[-1], size, samples, exposure=_EXPOSURE)
        else:
            look = look_of(18.0 + _DAYS * (frame - WAY) / YEAR)
            wood.aim(scene, leaf + Vector((0.0, 0.0, 2.5)), leaf + toward * _YEAR, 32.0)
            dress(scene, look)
            render(made[-1], size, samples, gray=look.gray)
    save_film(made, RATE, path)


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = stage.words(__doc__, ROOT / "out" / "film", SIZE, SAMPLES)
    parser.add_argument("--every", type=int, default=1, help="only every so many frames")
    given = parser.parse_args(arguments)
    session.start()
    session.clean_file()
    path = given.out / "film.mp4" if given.every > 1 else ROOT / "docs" / "images" / "film.mp4"
    render_film(path, given.out, stage.size_of(given, SIZE), given.samples, given.every)
    return 0


if __name__ == "__main__":
    sys.exit(main())
