# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One hectare that nobody plants, in four years: seeds arrive on bare ground, and a wood comes of it.

    python -m examples.grown            # docs/images/grown.jpg
    python -m examples.grown --out out/grown.jpg --width 480 --samples 16

Birches, aspens and pines come first; oaks, ashes, maples and beeches grow up below them. All pictures are of the same
stand, at four places of the slider, behind a woman of 1.70 m.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from . import stage
from .close_ups import render
from .figure import add_figure
from .haze import add_haze
from .paper.pictures import save_sheet
from .seasons import LOOKS, sky
from .wood import land

YEARS = (8, 25, 70, 150)
SIZE, SAMPLES = (740, 420), 24
_EXPOSURE = 0.9  # one for all, as the light is
#: Species and their shares of the seeds that arrive.
SEEDS = {
    "birch": 5.0,
    "aspen": 2.0,
    "scots_pine": 1.5,
    "rowan": 1.0,
    "oak": 1.0,
    "ash": 1.0,
    "maple": 1.0,
    "beech": 3.0,
    "hazel": 1.0,
}
#: Sides of the stand and of the land, how high the land rolls, and rises behind, and from where on, meters.
_SIDE, _LAND, _ROLL, _RISE, _BEHIND = 100.0, 260.0, 1.4, 12.0, 20.0
#: Stand and land reach beyond both sides of the picture.
_EYE, _AHEAD, _LENS = (-34.0, -95.0, 3.0), (4.0, 0.0, 13.0), 30.0
_FIGURE = (-27.0, -68.0)
#: Where the sun stands, degrees: above the horizon, and from north to the east. It lights the edge from the left.
_SUN = (30.0, 238.0)
#: Fraction below which space counts as hidden: between trunks one sees far.
_HIDDEN = 0.001


def build(scene: bpy.types.Scene, years: int = max(YEARS)) -> bpy.types.Object:
    """Fill an empty scene; the stand."""
    from tetflora_addon.blender.placing.cover import cover_steps
    from tetflora_addon.blender.stands.growing import new_stand_steps
    from tetflora_addon.blender.worker import run_to_end

    ground = land(scene, "Ground", _LAND, 4.0, 0.0, _height, {})
    plot = land(scene, "Plot", _SIDE, 2.0, 0.0, _height, {})
    plot.hide_render = True  # it only says where the stand grows
    stand = scene.tetflora.stand
    stand.years, stand.density, stand.recruits, stand.seed = years, 0.0, 500.0, 3
    for species, share in SEEDS.items():
        entry = stand.species.add()
        entry.species, entry.planted, entry.incoming_seeds = species, 0.0, share
    bpy.context.view_layer.update()
    grown = run_to_end(new_stand_steps(scene, bpy.context.evaluated_depsgraph_get(), [plot]))
    print(f"{grown.plants:,} plants after {grown.years} years, {grown.records:,} records", flush=True)
    run_to_end(cover_steps(scene, bpy.context.evaluated_depsgraph_get(), scene.tetflora.populate, grounds=[ground]))
    add_figure(scene, (*_FIGURE, float(_height(*np.array(_FIGURE))))).rotation_euler.z = 2.6
    stage.camera(scene, _EYE, _AHEAD, lens=_LENS, far=2000.0)
    scene.tetflora.hidden = _HIDDEN
    stage.sun(scene, _SUN[0], _SUN[1] - 180.0)
    scene.world = sky(LOOKS["summer"])
    add_haze(scene, 0.00025, LOOKS["summer"].haze[1])
    return grown.field


def _height(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the land, meters; it rises behind, so that grass instead of the sky is between trunks."""
    rolling = np.sin(0.045 * x + 0.6) * np.cos(0.038 * y) + 0.3 * np.sin(0.11 * (x - y))
    return _ROLL * rolling + _RISE * np.clip((y - _BEHIND) / (0.5 * _LAND - _BEHIND), 0.0, 1.0) ** 2


def render_grown(path: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES) -> None:
    """The stand in all years, as a sheet; in an empty scene."""
    field = build(bpy.context.scene)
    with tempfile.TemporaryDirectory() as folder:
        made = []
        for year in YEARS:
            field.tetflora.stand_year = year
            bpy.context.view_layer.update()
            made.append(Path(folder) / f"{year}.png")
            render(made[-1], size, samples, beyond=0.05, exposure=_EXPOSURE)
        names = [f"{year} years" for year in YEARS]
        save_sheet(list(zip(made, names, strict=True)), 2, path)


if __name__ == "__main__":
    stage.make_picture(__doc__, "grown.jpg", SIZE, SAMPLES, render_grown)
