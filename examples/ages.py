# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One oak at six ages in a studio, each beside a woman of 1.70 m.

    python -m examples.ages            # docs/images/ages.jpg
    python -m examples.ages --out out/ages.jpg --width 266 --samples 16

All six have the same seed: it is the same individual throughout.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

from . import figure, stage
from .paper.pictures import save_sheet

SPECIES, SEED = "oak", 3
AGES = (8.0, 18.0, 35.0, 80.0, 300.0, 545.0)
SIZE, SAMPLES = (530, 400), 24
#: Where the figure stands: so far to the left of the trunk's surface, and before it, meters.
_BESIDE, _BEFORE = 0.9, 1.2


def cell(age: float) -> Callable[[], tuple[np.ndarray, str]]:
    """Puts the oak of an age in years into the scene, with the figure."""
    from .species_sheet import plant_cell

    def build() -> tuple[np.ndarray, str]:
        points, title = plant_cell(SPECIES, f"{age:g} years", {}, SEED, age)()
        stem = points[points[:, 2] < 0.1 * points[:, 2].max()]
        beside = _BESIDE + float(np.quantile(np.abs(stem[:, 0]), 0.5))
        figure.add_figure(bpy.context.scene, (-beside, -_BEFORE, 0.0)).rotation_euler.z = 0.5
        # The studio frames all but what few points reach.
        top = np.tile([beside + 0.5, 0.0, 1.05 * figure.HEIGHT], (len(points) // 100 + 1, 1))
        return np.concatenate([points, top]), title

    return build


def render_ages(path: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES) -> None:
    """The oaks as a JPEG."""
    from .studio import render_cells

    with tempfile.TemporaryDirectory() as folder:
        save_sheet(render_cells([cell(age) for age in AGES], Path(folder), size, samples), 3, path)


if __name__ == "__main__":
    stage.make_picture(__doc__, "ages.jpg", SIZE, SAMPLES, render_ages)
