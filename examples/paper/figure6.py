# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures 6 and 7: the row of eighty with its polygons stored, and with all polygons deferred to the render.

Stored: Refine makes meshes, which stay in the scene and are lit by the renderer. Deferred: the file holds nothing but
seeds; polygons are there while the image is rendered, and the light of what is drawn as an approximation comes from
the shadow pass over tetrahedra, as in the paper (section 8.3). Two more images tell polygons from what stands for the
rest, and the sheet shows all four.
"""

from __future__ import annotations

from pathlib import Path

import bpy

from benchmarks.pictures import difference, plant_mask

from .. import stage
from .pictures import save_sheet
from .scenes import paper_figures, refined, rendered, row

#: Linear colors of what is real and of what stands for it, and of everything else.
REAL, PROXY, REST = (0.02, 0.16, 0.55), (0.95, 0.32, 0.02), (0.55, 0.55, 0.52)


def make(out: Path, images: Path, small: bool) -> dict[str, float]:
    """Make ``paper-figures6-7.jpg``; returns what sections 8.1 and 8.3 tell of them."""
    samples = 1 if small else 32
    scene = row(small)
    statistics = refined(scene)
    stored = out / "figure6.png"
    render_s = rendered(scene, stored, samples)
    stored_mb = _saved_mb(scene, out / "figure6.blend", results=True)
    both, real = out / "kinds.png", out / "real.png"
    counts = _kinds(scene, both, real, 1 if small else 12)
    mask = plant_mask(scene, out / "mask.png", samples=1 if small else 8)

    scene = row(small)
    scene.tetflora.refine_at_render, scene.tetflora.baked_light = True, 'PROXIES'
    deferred = out / "figure7.png"
    seeds_mb = _saved_mb(scene, out / "figure7.blend", results=False)
    deferred_s = rendered(scene, deferred, samples)
    cells = (
        (stored, "Figure 6: polygons stored"),
        (deferred, "Figure 7: polygons deferred to the render, light by tetrahedra"),
        (real, f"Polygons alone: {counts['drawn_real']:,}"),
        (both, f"And what is drawn for the rest: {counts['drawn_proxy']:,} facets and spheres (orange)"),
    )
    save_sheet(cells, 2, images / "paper-figures6-7.jpg", width=640)
    return {
        **paper_figures(statistics),
        **counts,
        "render_s": render_s,
        "deferred_render_s": deferred_s,
        "stored_file_mb": stored_mb,
        "seeds_file_mb": seeds_mb,
        "flip": difference(stored, deferred, mask).flip,
    }


def _saved_mb(scene: bpy.types.Scene, path: Path, results: bool) -> float:
    """Megabytes of the scene's file, with or without the meshes that refinement made."""
    scene.tetflora.output.save_results = results
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=True)
    return path.stat().st_size / 1e6


def _kinds(scene: bpy.types.Scene, both: Path, real: Path, samples: int) -> dict[str, int]:
    """Render both kinds in two colors, and polygons alone; returns how many of either kind there are."""
    made = [o for o in scene.objects if o.data and "tetflora_kind" in o]
    proxies = [o for o in made if o["tetflora_kind"] == "proxy"]
    surfaces = [o for o in scene.objects if o.type in {'MESH', 'POINTCLOUD'}]
    proxy, polygon, rest = (stage.dull("Kind", color) for color in (PROXY, REAL, REST))
    for shown in surfaces:
        for number in range(len(shown.data.materials)):
            shown.data.materials[number] = proxy if shown in proxies else polygon if shown in made else rest
    rendered(scene, both, samples)
    for shown in proxies:
        shown.hide_render = True
    rendered(scene, real, samples)
    for shown in proxies:
        shown.hide_render = False
    counts = {True: 0, False: 0}
    for shown in made:
        counts[shown in proxies] += _amount(shown.data)
    return {"drawn_real": counts[False], "drawn_proxy": counts[True]}


def _amount(data: bpy.types.ID) -> int:
    """Polygons of a mesh, or points of a cloud, which is a mesh of points before Blender 5.1."""
    if isinstance(data, bpy.types.Mesh):
        return len(data.polygons) or len(data.vertices)
    return len(data.points)
