# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 8: the row of eighty after passes of the loop, its tetrahedra drawn as volumes of microspheres.

After each pass that is shown, all that is not flagged for polygons is drawn as it is: *Max Passes* with *Shells*. Edges
of tetrahedra lie over it.
"""

from __future__ import annotations

from pathlib import Path

import bpy

from devtools.partition import partition

from .pictures import save_sheet
from .scenes import refined, rendered, row
from .wires import draw_wires

#: Passes after which an image is made; 0 is the end.
PASSES, SMALL_PASSES = (2, 3, 4, 5, 6, 7, 8, 0), (4, 0)
#: A ray goes through many tetrahedra, each of them a surface to the renderer.
_THROUGH = 128


def make(out: Path, images: Path, small: bool) -> dict[str, float]:
    """Make ``paper-figure8.jpg``; returns tetrahedra and polygons after each pass that is shown."""
    scene = row(small, (480, 270))
    scene.tetflora.proxy_kind = 'SHELLS'
    scene.cycles.transparent_max_bounces = _THROUGH
    steps = refined(scene).steps
    cells, figures = [], {"passes": len(steps)}
    for last in SMALL_PASSES if small else PASSES:
        scene.tetflora.max_passes = last
        statistics = refined(scene)
        number = last or len(steps)
        picture = out / f"figure8-{number:02d}.png"
        rendered(scene, picture, 1 if small else 16)
        draw_wires(picture, *partition(scene, bpy.context.evaluated_depsgraph_get()))
        # What waited for the next pass when this one was over; stopped here, it was drawn as it is.
        waiting = steps[number - 1].split
        made, meshed = statistics.tetrahedra_made, statistics.polygons_meshed
        cells.append((picture, f"Pass {number}: {made:,} tetrahedra, {waiting:,} to divide; {meshed:,} polygons"))
        figures |= {f"tetrahedra_{number}": made, f"waiting_{number}": waiting, f"polygons_{number}": meshed}
    save_sheet(cells, 2, images / "paper-figure8.jpg")
    return figures
