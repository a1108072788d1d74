# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of the benchmark `assets` that are about seconds and memory; each runs in a process of its own.

Refined and plain cases begin with a .blend file and end with an image in it. Plain is what an artist has without the
extension: nothing is marked and nothing refined.
"""

from __future__ import annotations

import re
import time
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session
from tetflora_addon import parallel
from tetflora_addon.assets import asset_cache
from tetflora_addon.assets.compiled import compile_asset
from tetflora_addon.blender.assets.parts import Target, digest_of, read_source_steps
from tetflora_addon.jobs import run_to_end
from tetflora_addon.processes import pool

from . import asset_scenes, asset_trees
from .asset_scenes import Scatter
from .report import cpu_s, forget_peak
from .row80 import timed_refine, timed_render
from .time_to_picture import of_render

#: Samples that images have in Cycles, of which few are rendered, and in EEVEE: its first sample takes most, so that
#: more of them cannot be told from few.
SAMPLES, TIMED, EEVEE_SAMPLES = 64, 3, 2
_STATUS = Path("/proc/self/status")


def resident_mb(what: str = "VmHWM") -> float:
    """Largest resident memory of this process alone, or with ``VmRSS`` that of now, megabytes."""
    found = re.search(rf"^{what}:\s+(\d+) kB", _STATUS.read_text(), re.MULTILINE)
    return int(found.group(1)) * 1024 / 1e6


def memory() -> dict[str, float]:
    """Largest memory so far of this process, and beside it of those that work for it, megabytes."""
    return {"peak_mb": resident_mb(), "others_mb": pool.peak() / 1e6}


def mark(detail: str) -> None:
    """Mark all instancers of the open file; detail: ``AUTO`` or ``REFINE``, whether Cycles may keep all as they are."""
    scene = bpy.context.scene
    scene.tetflora.asset_detail = detail
    for obj in scene.objects:
        if any(modifier.type == 'NODES' for modifier in obj.modifiers):
            obj.tetflora.is_scatter = True


def timed(path: Path, what: str, engine: str, detail: str = "AUTO") -> dict[str, float]:
    """From the file to the image: seconds by the clock, memory; all samples of the image extrapolated from few."""
    begun = time.perf_counter()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    kind = session.eevee() if engine == "EEVEE" else engine
    scene.render.engine = kind
    read_s, figures = time.perf_counter() - begun, {}
    opened, held = memory()["peak_mb"], resident_mb("VmRSS")
    refine_s = 0.0
    if what == "refined":
        mark(detail)
        statistics, refine_s = timed_refine(scene)
        figures["polygons"] = statistics.polygons_meshed + statistics.polygons_proxy
    refined = memory()["peak_mb"]
    image = path.with_name(f"{path.stem}-{what}-{engine}.png")
    if engine == "EEVEE":
        figures["render_s"] = timed_render(scene, image, EEVEE_SAMPLES, engine=kind)
    else:
        times = of_render(scene, image, kind, TIMED)
        figures |= {"setup_s": times["setup_s"], "sample_s": times["sample_s"]}
        figures["render_s"] = times["setup_s"] + SAMPLES * times["sample_s"]
    return {
        **figures,
        "read_s": read_s,
        "refine_s": refine_s,
        "total_s": read_s + refine_s + figures["render_s"],
        "opened_mb": opened,
        "held_opened_mb": held,
        "refined_mb": refined,
        **memory(),
    }


def compiled(kind: str, quick: bool) -> dict[str, float]:
    """Seconds, bytes and exactness of compiling a tree on one core; seconds are those of the processor."""
    scene, tree = bpy.context.scene, asset_trees.make(kind, quick)
    scene.collection.objects.link(tree)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    target = Target(tree, None, None, tree.name)
    parallel.set_threads(1)
    forget_peak()
    before, begun = resident_mb("VmRSS"), cpu_s()
    source, _ = run_to_end(read_source_steps(target, depsgraph))
    read = cpu_s()
    asset = compile_asset(source)
    done = cpu_s()
    triangles = sum(len(source.surfaces[i].triangles) for i in source.surface.tolist())
    figures = {
        "triangles": triangles,
        "clusters": len(asset.clusters),
        "read_s_per_mtri": (read - begun) / triangles * 1e6,
        "compile_s_per_mtri": (done - begun) / triangles * 1e6,
        "bytes_per_triangle": (resident_mb() - before) * 1e6 / triangles,
        "held_bytes_per_triangle": asset.nbytes / triangles,
    }
    asset_cache.keep(asset)
    asset_cache.forget()
    begun = cpu_s()
    digest = digest_of(target, depsgraph)
    figures["digest_s"] = cpu_s() - begun
    found = asset_cache.find(digest)
    figures["again_s"] = cpu_s() - begun
    if found is None or len(found.clusters) != len(asset.clusters):
        raise RuntimeError("the compiled asset was not found again")
    return figures | exactness(source, asset)


def exactness(source: object, asset: object) -> dict[str, float]:
    """How far a compiled asset's areas are from the original's, and its vertices from their clusters' bounds."""
    part, face = asset.part, asset.face
    areas, low, high = (np.concatenate(arrays) for arrays in zip(*_faces_of(source), strict=True))
    first = np.cumsum([0, *(source.surfaces[i].faces for i in source.surface.tolist())])
    own = first[part] + face
    clusters = asset.clusters
    area = clusters.leaf_area + clusters.wood_area
    lowest, highest, every = low[own], high[own], areas[own]
    # Faces of a cluster follow one another, and so do those of its children: sums of all before tell each.
    ends = clusters.first_face + clusters.faces
    before = np.concatenate([[0.0], np.cumsum(every)])
    true_area = before[ends] - before[clusters.first_face]
    leaf = clusters.children == 0
    of = np.repeat(np.flatnonzero(leaf), clusters.faces[leaf])
    order = np.concatenate([np.arange(a, b) for a, b in zip(clusters.first_face[leaf], ends[leaf], strict=True)])
    beyond = np.maximum(clusters.low[of] - lowest[order], highest[order] - clusters.high[of])
    child = np.flatnonzero(clusters.parent >= 0)
    up = clusters.parent[child]
    outside = np.maximum(clusters.low[up] - clusters.low[child], clusters.high[child] - clusters.high[up])
    root = clusters.parent < 0
    return {
        "area_error": abs(area[root].sum() / areas.sum() - 1.0),
        "cluster_area_error": float((np.abs(area - true_area) / np.maximum(true_area, 1e-12)).max()),
        "beyond_bounds": float(max(beyond.max(initial=0.0), outside.max(initial=0.0))),
        "faces_missing": float(len(areas) - len(np.unique(own))),
    }


def _faces_of(source: object) -> list[tuple[NDArray, NDArray, NDArray]]:
    """Areas without what is transparent (f,), and least and greatest coordinates (f, 3) of faces, part by part."""
    made = []
    for number, matrix in zip(source.surface.tolist(), source.matrices, strict=True):
        surface = source.surfaces[number]
        corners = (surface.positions @ matrix[:3, :3].T + matrix[:3, 3])[surface.triangles]
        a, b, c = np.moveaxis(corners, 1, 0)
        each = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
        area = np.bincount(surface.face, each, surface.faces) * surface.coverage.astype(np.float64)
        low, high = np.full((surface.faces, 3), np.inf), np.full((surface.faces, 3), -np.inf)
        np.minimum.at(low, surface.face, corners.min(axis=1))
        np.maximum.at(high, surface.face, corners.max(axis=1))
        made.append((area, low, high))
    return made


def wood_file(folder: Path, wanted: Scatter) -> Path:
    """Where the file of a wood is, or shall be."""
    quick = "-quick" if wanted.quick else ""
    return folder / f"{wanted.kind}-{wanted.instances}-{wanted.distance}-{wanted.size[0]}{quick}.blend"


def many_file(folder: Path, number: int, layout: str, triangles: int) -> Path:
    """Where the file of a wood of different assets is, or shall be; layout as of `store_many`."""
    return folder / f"many-{number}-{layout}-{triangles}.blend"


def libraries(folder: Path, number: int, triangles: int) -> dict[str, float]:
    """Make the library files of different assets that are not there yet."""
    begun = time.perf_counter()
    paths = asset_trees.store_libraries(folder / f"libraries-{triangles}", number, triangles)
    return {"seconds": time.perf_counter() - begun, "bytes": float(sum(path.stat().st_size for path in paths))}


def store_many(folder: Path, number: int, layout: str, triangles: int, each: int) -> None:
    """Save a wood of different assets, so many instances of each.

    layout: ``grown``, by nodes at evaluation; ``unseen``, the same with an instancer that is disabled in viewports, as
    artists do with what is heavy; ``linked`` from library files, or ``inside`` the file.
    """
    path = many_file(folder, number, layout, triangles)
    if layout in {"grown", "unseen"}:
        trees = list(asset_trees.grown(number, triangles))
        asset_scenes.store_trees(path, trees, each * number, unseen=layout == "unseen")
        return
    files = asset_trees.store_libraries(folder / f"libraries-{triangles}", number, triangles)
    asset_scenes.store_many(path, files, layout == "linked", each * number)


def window_file(folder: Path, what: str, instances: int, quick: bool) -> dict[str, float]:
    """Save a wood for the window, which refines it if it shall be."""
    asset_scenes.build(bpy.context.scene, Scatter(instances=instances, distance="middle", quick=quick))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"window-{what}.blend"), compress=False)
    return {"instances": instances}
