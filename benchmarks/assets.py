# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees that no species of ours grew, scattered by geometry nodes: refined against the renderer's own instances.

    python -m benchmarks assets [--quick]                                  # everything, with targets
    python -m benchmarks assets --only crown pictures [--quick]            # some parts
    python -m benchmarks assets --call woods '["leaves", true]'            # one case, as a line of JSON

Parts: ``compile`` (seconds, bytes, areas and bounds), ``pictures`` (FLIP), ``crown`` (light through a crown of cards,
color of its tenths), ``forest`` (10,000 and a million instances), ``cycles`` (from a .blend file to an image).

Each case runs in a process of its own; memory is that of this process alone, and ``_others_mb`` that of processes that
work for it. ``_cached`` has compiled its asset in an earlier process. Images are left in ``out/assets``. Refined and
plain cases begin with a .blend file and end with an image in it. Plain is what an artist has without the extension:
nothing is marked and nothing refined. What is compared in images is where trees cover more than a twentieth of a pixel
of the plain one; woods are refined with everything that the extension does to assets (`REFINE`), even where plain
instances would be cheaper.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import ceil, radians, sqrt
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from examples import stage
from tetflora_addon import parallel, storage
from tetflora_addon.assets import asset_cache
from tetflora_addon.assets.compiled import compile_steps
from tetflora_addon.blender.assets.places import Target, digest_of, read_source_steps
from tetflora_addon.blender.job import refine
from tetflora_addon.jobs import run_to_end
from tetflora_addon.processes import pool

from . import asset_trees
from .pictures import changed, difference, read_picture, render, timed_refine, timed_render
from .report import ROOT, Targets, apart, cpu_s, forget_peak

FOLDER = ROOT / "out" / "assets"
#: Triangles from which on seconds and bytes of compiling are told for each of them.
LARGE = 250_000
#: Instances and distances of the race in Cycles, and samples of its images.
COUNTS, QUICK_COUNTS, ENDS, TIMED = (20, 1_000, 10_000), (20,), ("near", "far"), 16
FOREST, MILLION = 10_000, 1_000_000
_STATUS = Path("/proc/self/status")
#: Meters between trees, and of the eye above the ground.
SPACING, EYE = 7.0, 1.7
#: Meters from the eye to the edge of the wood.
DISTANCES = {"near": 5.0, "middle": 50.0, "far": 250.0}
#: Elevation of the sun and where its light goes, degrees; the camera looks to 0.
LIGHTS = {"front": (42.0, 35.0), "back": (28.0, 160.0)}
SIZE, PICTURE = (1920, 1080), (320, 180)
#: Holes behind holes that rays go through; Blender's default of 8 makes crowns of cards black.
_TRANSPARENT = 64
#: One tree is seen from so far, in an image so wide, meters.
_ALONE, _WIDE = 200.0, 18.0
INSTANCES = 16
#: By distance: what is far is small and cheap, and has many trees in a pixel.
SAMPLES, QUICK_DIVISOR = {"near": 64, "middle": 256, "far": 256}, 8
COVERAGE_SAMPLES = 64
LEAST_COVERAGE = 0.05
#: Meters of the pixels that crowns are refined for, and of those of the pictures that are compared, with samples.
#: Cards of .4 m are real in smaller ones.
COARSE, FINE, CROWN_SAMPLES = (0.8, 1.0, 1.2), 0.1, 256
TENTHS = 10
#: Of the renderer's passes, those that sum up to the color of a surface.
_PASSES = "diffuse", "glossy", "transmission"
#: Least of a crown's row that is covered where its color counts.
_LEAST_ROW = 0.02

TARGETS: Targets = {
    "area_error": {"max": 1e-6},
    "beyond_bounds": {"max": 1e-5},
    "flip_mean": {"max": 0.05},
    "flip_max": {"max": 0.08},
    "dT_max": {"max": 0.01},
    "tenth_max": {"max": 0.03},
    "refine_emit_s_10k": {"max": 20.0},
    "peak_mb_10k": {"max": 4000.0},
    "refine_emit_s_1m": {"max": 60.0},
    "peak_mb_1m": {"max": 8000.0},
    "cycles_time_ratio": {"max": 1.05},
    "cycles_memory_ratio": {"max": 1.05},
    "compile_s_per_mtri": {"max": 8.0},
    "compile_again_s": {"max": 0.3},
    "bytes_per_triangle": {"max": 100.0},
}
QUICK_TARGETS: Targets = {
    "area_error": {"max": 1e-6},
    "beyond_bounds": {"max": 1e-5},
    "dT_max": {"max": 0.02},
    "compile_s_per_mtri": {"max": 10.0},
}


def options(parser: argparse.ArgumentParser) -> None:
    """What may be asked for beside everything."""
    parser.add_argument("--only", nargs="+", choices=tuple(PARTS), default=(), metavar="PART", help=", ".join(PARTS))


def run(given: argparse.Namespace) -> dict[str, float]:
    """Figures of parts, by default of all, or for a quick run of those that take least."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    figures: dict[str, float] = {}
    for name in given.only or (QUICK_PARTS if given.quick else tuple(PARTS)):
        figures |= PARTS[name](given.quick)
    return figures


def tried(function: Callable[..., dict], *given: object) -> dict[str, float]:
    """As `apart`; none, and why not on stderr, where it fails."""
    try:
        return apart(function, *given)
    except RuntimeError as error:
        print(error, file=sys.stderr, flush=True)
        return {}


def compiling(quick: bool) -> dict[str, float]:
    """Seconds, bytes and exactness of compiling each kind; the worst of all kinds has no name of a kind.

    Seconds and bytes a triangle count of kinds with more than `LARGE` triangles: others cost what any asset does.
    """
    made = {kind: tried(compiled, kind, quick) for kind in asset_trees.KINDS}
    figures = {f"{key}_{kind}": value for kind, found in made.items() for key, value in found.items()}
    worst = {"area_error": "area_error", "beyond_bounds": "beyond_bounds", "compile_s_per_mtri": "compile_s_per_mtri"}
    worst |= {"compile_again_s": "again_s", "bytes_per_triangle": "bytes_per_triangle"}
    for name, key in worst.items():
        per = name.endswith(("per_mtri", "per_triangle"))
        values = [found[key] for found in made.values() if not per or found.get("triangles", 0) > LARGE]
        figures |= {name: max(values)} if all(made.values()) and values else {}
    return figures


def pictures(quick: bool) -> dict[str, float]:
    """FLIP of all kinds; quick: of one."""
    figures: dict[str, float] = {}
    for kind in asset_trees.KINDS[:1] if quick else asset_trees.KINDS:
        figures |= tried(woods, kind, quick)
    flips = [value for key, value in figures.items() if key.startswith("flip_")]
    noises = [value for key, value in figures.items() if key.startswith("noise_")]
    if flips:
        figures |= {"flip_mean": sum(flips) / len(flips), "flip_max": max(flips)}
    if noises:
        figures |= {"flip_noise_mean": sum(noises) / len(noises), "flip_noise_max": max(noises)}
    return figures


def crowns(quick: bool) -> dict[str, float]:
    """Transmittance of a crown of cards, and color of its tenths: of its surfaces, and as they are lit."""
    found = tried(crown, "cards", quick)
    for name, key in (("dT_max", "dT_"), ("tenth_max", "tenth_"), ("tenth_lit_max", "lit_")):
        values = [abs(value) for other, value in found.items() if other.startswith(key)]
        found |= {name: max(values)} if values else {}
    return found


def forest(quick: bool) -> dict[str, float]:
    """10,000 and a million instances, refined with all that the extension does to assets; quick: the former."""
    figures: dict[str, float] = {}
    for count, end in ((FOREST, "10k"), *(() if quick else ((MILLION, "1m"),))):
        for cached in ("", "_cached"):
            given = False, "REFINE", str(FOLDER / "cache") if cached else ""
            if cached:
                _timed("refined", 20, "far", *given)
            found = _timed("refined", count, "near", *given)
            if not found:
                continue
            figures |= {f"refine_emit_s_{end}{cached}": found["refine_s"], f"total_s_{end}{cached}": found["total_s"]}
            figures |= {f"peak_mb_{end}{cached}": found["peak_mb"], f"others_mb_{end}{cached}": found["others_mb"]}
    return figures


def cycles(quick: bool) -> dict[str, float]:
    """Refined beside plain in Cycles; the ratios without numbers are the worst of all."""
    figures: dict[str, float] = {}
    for count in QUICK_COUNTS if quick else COUNTS:
        for distance in ENDS:
            end = f"{count}_{distance}"
            theirs = _timed("plain", count, distance, quick)
            ours = _timed("refined", count, distance, quick)
            figures |= _named("cycles", "plain", end, theirs) | _named("cycles", "refined", end, ours)
            if ours and theirs:
                figures[f"cycles_time_ratio_{end}"] = ours["total_s"] / theirs["total_s"]
                figures[f"cycles_memory_ratio_{end}"] = ours["peak_mb"] / theirs["peak_mb"]
    for what in ("time", "memory"):
        ratios = [value for key, value in figures.items() if key.startswith(f"cycles_{what}_ratio_")]
        figures |= {f"cycles_{what}_ratio": max(ratios)} if ratios else {}
    return figures


def _named(engine: str, what: str, end: object, found: dict[str, float]) -> dict[str, float]:
    return {f"{engine}_{what}_{key}_{end}": value for key, value in found.items()}


PARTS: dict[str, Callable[[bool], dict[str, float]]] = {
    "compile": compiling,
    "pictures": pictures,
    "crown": crowns,
    "forest": forest,
    "cycles": cycles,
}
QUICK_PARTS = ("compile", "crown")


def _timed(what: str, instances: int, distance: str, quick: bool, *given: str) -> dict[str, float]:
    """As `timed`, from a file that another process has written."""
    path = FOLDER / f"leaves-{instances}-{distance}{'-quick' if quick else ''}.blend"
    if not path.exists():
        tried(stored, str(path), instances, distance, quick)
    return tried(timed, str(path), what, *given)


def stored(path: str, instances: int, distance: str, quick: bool) -> dict[str, float]:
    """Save a wood of leafy trees, which is read more quickly without compression."""
    build(bpy.context.scene, Scatter("leaves", instances, distance, quick=quick))
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=False)
    return {"stored": 1.0}


@dataclass(frozen=True)
class Scatter:
    """A wood.

    Attributes
    ----------
    kind : str
        Out of `asset_trees.KINDS`.
    instances : int
    distance, light : str
        Out of `DISTANCES` and `LIGHTS`.
    size : tuple of int
        Of the image, pixels.
    quick : bool
        With trees of fewer triangles.
    """

    kind: str = "leaves"
    instances: int = 20
    distance: str = "near"
    light: str = "front"
    size: tuple[int, int] = SIZE
    quick: bool = False


def build(scene: bpy.types.Scene, wanted: Scatter) -> bpy.types.Object:
    """Fill an empty scene with a wood of one asset, with meadow, camera, sun and sky; its instancer."""
    assets = bpy.data.collections.new("Assets")
    assets.objects.link(asset_trees.make(wanted.kind, wanted.quick))
    scene.collection.children.link(assets)
    bpy.context.view_layer.layer_collection.children[assets.name].exclude = True
    instancer = scatter(scene, assets, wanted.instances)
    add_meadow(scene, wanted.instances)
    stage.camera(scene, *sight(DISTANCES[wanted.distance]), wanted.size, far=10_000.0)
    stage.daylight(scene, *LIGHTS[wanted.light])
    prepare(scene)
    return instancer


def scatter(scene: bpy.types.Scene, assets: bpy.types.Collection, instances: int, seed: int = 1) -> bpy.types.Object:
    """An object whose nodes put so many instances of members of a collection on a jittered grid, turned and scaled.

    The grid begins at y = 0 and is as wide as deep; its object is a patch of ground, which stays in what nodes give.
    """
    side = ceil(sqrt(instances))
    bpy.ops.mesh.primitive_grid_add(size=1.0, x_subdivisions=2, y_subdivisions=2)
    ground = bpy.context.object
    ground.name, ground.data.name = "Scatter", "Scatter"
    wide = side * SPACING
    ground.data.transform(Matrix.Translation((0.0, wide / 2, 0.01)) @ Matrix.Diagonal((wide, wide, 1.0, 1.0)))
    ground.data.materials.append(stage.dull("Forest floor", (0.09, 0.075, 0.045)))
    ground.modifiers.new("Scatter", 'NODES').node_group = _scatter_nodes(assets, side, instances, seed)
    bpy.context.view_layer.update()
    return ground


def _scatter_nodes(assets: bpy.types.Collection, side: int, instances: int, seed: int) -> bpy.types.GeometryNodeTree:
    tree, given, placed, made = stage.instancing("Scatter", assets)
    new, link = tree.nodes.new, tree.links.new
    grid, moved, both = (new(f"GeometryNode{kind}") for kind in ("MeshGrid", "SetPosition", "JoinGeometry"))
    wide = (side - 1) * SPACING
    for name, value in (("Size X", wide), ("Size Y", wide), ("Vertices X", max(side, 2)), ("Vertices Y", max(side, 2))):
        grid.inputs[name].default_value = value
    jitter = 0.3 * SPACING
    middle = wide / 2 + SPACING / 2
    offset = _random(tree, 'FLOAT_VECTOR', (-jitter, middle - jitter, 0.0), (jitter, middle + jitter, 0.0), seed)
    turn = _random(tree, 'FLOAT_VECTOR', (0.0, 0.0, 0.0), (0.0, 0.0, 6.2831853), seed + 1)
    scale = _random(tree, 'FLOAT', 0.7, 1.3, seed + 2)
    link(grid.outputs["Mesh"], moved.inputs["Geometry"])
    link(offset, moved.inputs["Offset"])
    link(moved.outputs[0], placed.inputs["Points"])
    link(turn, placed.inputs["Rotation"])
    link(_random(tree, 'INT', 0, 10_000, seed + 3), placed.inputs["Instance Index"])
    link(scale, placed.inputs["Scale"])
    # The grid has more points where their number is no square.
    index, fewer = new("GeometryNodeInputIndex"), new("FunctionNodeCompare")
    fewer.data_type, fewer.operation = 'INT', 'LESS_THAN'
    ends = [socket for socket in fewer.inputs if socket.enabled]
    link(index.outputs[0], ends[0])
    ends[1].default_value = instances
    link(fewer.outputs[0], placed.inputs["Selection"])
    link(given.outputs[0], both.inputs[0])
    link(placed.outputs[0], both.inputs[0])
    link(both.outputs[0], made.inputs[0])
    return tree


def _random(
    tree: bpy.types.GeometryNodeTree, kind: str, least: object, most: object, seed: int
) -> bpy.types.NodeSocket:
    node = tree.nodes.new("FunctionNodeRandomValue")
    node.data_type = kind
    sockets = {socket.name: socket for socket in node.inputs if socket.enabled}
    sockets["Min"].default_value, sockets["Max"].default_value, sockets["Seed"].default_value = least, most, seed
    return next(socket for socket in node.outputs if socket.enabled)


def add_meadow(scene: bpy.types.Scene, instances: int) -> None:
    """Ground that reaches beyond the wood."""
    bpy.ops.mesh.primitive_plane_add(size=2.0 * (1000.0 + SPACING * sqrt(instances)))
    bpy.context.object.name = "Meadow"
    bpy.context.object.data.materials.append(stage.dull("Meadow", (0.12, 0.16, 0.06)))


def sight(distance: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """From eye height, so far before the wood, to the middle of the first crowns."""
    return (0.0, -distance, EYE), (0.0, SPACING, 5.0)


def set_sun(scene: bpy.types.Scene, light: str) -> None:
    """Turn the sun."""
    bpy.data.objects.remove(scene.objects["Sun"])
    stage.sun(scene, *LIGHTS[light])


def prepare(scene: bpy.types.Scene) -> None:
    """What an artist sets for such trees; refinement is called by the benchmark."""
    scene.cycles.transparent_max_bounces = _TRANSPARENT
    scene.view_settings.exposure = 0.6
    scene.tetflora.refine_at_render = False
    bpy.context.view_layer.update()


def alone(scene: bpy.types.Scene, kind: str, quick: bool = False) -> bpy.types.Object:
    """One tree under an even sky, in parallel rays, so far that none of it is near; its instancer."""
    instancer = build(scene, Scatter(kind, 1, quick=quick))
    bpy.data.objects.remove(scene.objects["Sun"])
    stage.even_sky(scene, strength=0.7)
    camera = scene.camera
    camera.data.type = 'ORTHO'
    camera.location, camera.rotation_euler = (0.0, -_ALONE, _WIDE / 2 - 1.0), (radians(90.0), 0.0, 0.0)
    return instancer


def frame(scene: bpy.types.Scene, pixel: float) -> None:
    """Let a pixel of the view of one tree be so large, meters."""
    scene.camera.data.ortho_scale = _WIDE
    scene.render.resolution_x = scene.render.resolution_y = round(_WIDE / pixel)
    bpy.context.view_layer.update()


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


def timed(path: str, what: str, detail: str = "AUTO", cache: str = "") -> dict[str, float]:
    """From the file to the image: seconds by the clock, and memory.

    detail: what refinement may leave plain; cache: folder in which compiled assets are kept for later processes.
    """
    if cache:
        storage.set_folder(Path(cache))
    begun = time.perf_counter()
    bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    read_s, figures, refine_s = time.perf_counter() - begun, {}, 0.0
    if what == "refined":
        mark(detail)
        statistics, refine_s = timed_refine(scene)
        figures["polygons"] = statistics.polygons_meshed + statistics.polygons_proxy
    refined = memory()["peak_mb"]
    render_s = timed_render(scene, Path(path).with_suffix(f".{what}.png"), TIMED)
    return {
        **figures,
        "read_s": read_s,
        "refine_s": refine_s,
        "render_s": render_s,
        "total_s": read_s + refine_s + render_s,
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
    asset = run_to_end(compile_steps(source))
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


def woods(kind: str, quick: bool) -> dict[str, float]:
    """FLIP of a refined wood in each light and from each distance, and of two plain pictures in the first light."""
    scene = bpy.context.scene
    build(scene, Scatter(kind, INSTANCES, size=PICTURE, quick=quick))
    found: dict[str, float] = {}
    masks: dict[str, NDArray[np.bool_]] = {}
    for distance, light in _views(scene):
        name, samples = f"{kind}-{distance}-{light}", _samples(distance, quick)
        render(scene, FOLDER / f"{name}-plain.png", samples)
        if light == next(iter(LIGHTS)):
            masks[distance] = coverage(scene, FOLDER / "coverage.png") > LEAST_COVERAGE
            render(scene, FOLDER / f"{name}-again.png", samples, seed=1)
            pair = FOLDER / f"{name}-plain.png", FOLDER / f"{name}-again.png"
            found[f"noise_{kind}_{distance}"] = difference(*pair, masks[distance]).flip
    mark("REFINE")
    for distance, light in _views(scene):
        name, samples = f"{kind}-{distance}-{light}", _samples(distance, quick)
        statistics, _ = timed_refine(scene)
        render(scene, FOLDER / f"{name}-refined.png", samples)
        pair = FOLDER / f"{name}-plain.png", FOLDER / f"{name}-refined.png"
        made = difference(*pair, masks[distance])
        key = f"{kind}_{distance}_{light}"
        found |= {f"flip_{key}": made.flip, f"color_{key}": made.color}
        found[f"polygons_{kind}_{distance}"] = statistics.polygons_meshed + statistics.polygons_proxy
    return found


def _samples(distance: str, quick: bool) -> int:
    return SAMPLES[distance] // (QUICK_DIVISOR if quick else 1)


def _views(scene: bpy.types.Scene) -> Iterator[tuple[str, str]]:
    """Names of distances and lights, which the scene has while each lasts."""
    for distance, meters in DISTANCES.items():
        stage.look(scene, *sight(meters))
        for light in LIGHTS:
            set_sun(scene, light)
            bpy.context.view_layer.update()
            yield distance, light


def crown(kind: str, quick: bool) -> dict[str, float]:
    """How much light a crown lets through, and the color of its tenths from below to above, refined and plain."""
    scene = bpy.context.scene
    alone(scene, kind, quick)
    samples = CROWN_SAMPLES // (QUICK_DIVISOR if quick else 1)
    frame(scene, FINE)
    plain = silhouette(scene, FOLDER / f"crown-{kind}-plain.exr", samples), albedo(scene, FOLDER / "albedo.exr")
    again = silhouette(scene, FOLDER / f"crown-{kind}-again.exr", samples, 1), albedo(scene, FOLDER / "albedo.exr", 1)
    found = {f"noise_{key}": value for key, value in _compared(plain, again).items()}
    mark("REFINE")
    for pixel in COARSE:
        frame(scene, pixel)
        statistics, _ = timed_refine(scene)
        frame(scene, FINE)
        test = silhouette(scene, FOLDER / f"crown-{kind}-{pixel}.exr", samples), albedo(scene, FOLDER / "albedo.exr")
        found |= {f"{key}_{pixel}": value for key, value in _compared(plain, test).items()}
        found[f"crown_polygons_{pixel}"] = statistics.polygons_meshed + statistics.polygons_proxy
    refine.clear(scene)
    return found


def _compared(plain: tuple[NDArray, NDArray], test: tuple[NDArray, NDArray]) -> dict[str, float]:
    """How much less of the image a crown covers than a plain one, and how far the colors of its tenths are from its.

    Both are given as what `silhouette` and `albedo` return. ``tenth`` is of the albedo, ``lit`` under the sky, where
    the crown shades itself.
    """
    light, own = plain[0], plain[1]
    # Of all of the image: facets are larger than what they stand for, and reach beyond its outline.
    found = {"dT": float((light[..., 3] - test[0][..., 3]).sum() / (light[..., 3] > LEAST_COVERAGE).sum())}
    rows = crown_rows(light)
    for name, a, b in (("tenth", own, test[1]), ("lit", light, test[0])):
        theirs, ours = tenths(a, rows), tenths(b, rows)
        found[name] = float((np.abs(ours - theirs).mean(axis=1) / theirs.mean(axis=1)).max())
    return found


def crown_rows(silhouette: NDArray[np.float32]) -> tuple[int, int]:
    """First row of a crown from below, and the one after its last; the lowest fifth of a tree is trunk."""
    covered = np.flatnonzero((silhouette[::-1, :, 3] > LEAST_COVERAGE).mean(axis=1) > _LEAST_ROW)
    end = int(covered[-1]) + 1
    return int(covered[0]) + (end - int(covered[0])) // 5, end


def tenths(silhouette: NDArray[np.float32], rows: tuple[int, int]) -> NDArray[np.float64]:
    """Mean color (10, 3) of what is covered in each tenth of a crown's rows, from below to above."""
    bands = np.array_split(silhouette[::-1].astype(np.float64)[slice(*rows)], TENTHS)
    return np.array([band[..., :3].sum(axis=(0, 1)) / band[..., 3].sum() for band in bands])


def silhouette(scene: bpy.types.Scene, path: Path, samples: int, seed: int = 0) -> NDArray[np.float32]:
    """Light and alpha (height, width, 4), linear and premultiplied, of what is not ground or sky."""
    with ground_as_holes(scene):
        render(scene, path, samples, seed, form='OPEN_EXR')
    return read_picture(path)


def albedo(scene: bpy.types.Scene, path: Path, seed: int = 0) -> NDArray[np.float32]:
    """Color of surfaces, all that they do with light, and alpha (height, width, 4), premultiplied, without ground."""
    bpy.utils.expose_bundled_modules()
    import OpenImageIO  # Blender's own, which it shows only now

    layer = bpy.context.view_layer
    passes = [(layer, f"use_pass_{kind}_color", True) for kind in _PASSES]
    with ground_as_holes(scene), changed((scene.cycles, "max_bounces", 0), *passes):
        render(scene, path, COVERAGE_SAMPLES, seed, form='OPEN_EXR_MULTILAYER')
    parts = [OpenImageIO.ImageBuf(str(path), i, 0) for i in range(OpenImageIO.ImageBuf(str(path)).nsubimages)]
    named = {}
    for part in parts:
        pixels = part.get_pixels(OpenImageIO.FLOAT)
        named |= {name.split(".", 1)[1]: pixels[..., i] for i, name in enumerate(part.spec().channelnames)}
    colors = [sum(named[f"{kind.title()} Color.{c}"] for kind in _PASSES) for c in "RGB"]
    return np.stack([*colors, named["Combined.A"]], axis=2)


def coverage(scene: bpy.types.Scene, path: Path) -> NDArray[np.float32]:
    """How much of each pixel (height, width) is not ground or sky, 0 to 1."""
    with changed((scene.cycles, "max_bounces", 0)):
        return silhouette(scene, path.with_suffix(".exr"), COVERAGE_SAMPLES)[..., 3]


@contextmanager
def ground_as_holes(scene: bpy.types.Scene) -> Iterator[None]:
    """Make holes in the image of sky and ground; instances come out of ground, so it is its material that does it."""
    trees = [bpy.data.materials[name].node_tree for name in ("Meadow", "Forest floor")]
    before = []
    for tree in trees:
        output = next(node for node in tree.nodes if node.type == 'OUTPUT_MATERIAL')
        hole = tree.nodes.new("ShaderNodeHoldout")
        before.append((tree, output, hole, output.inputs["Surface"].links[0].from_socket))
        tree.links.new(hole.outputs[0], output.inputs["Surface"])
    try:
        with changed((scene.render, "film_transparent", True), (scene.render.image_settings, "color_mode", 'RGBA')):
            yield
    finally:
        for tree, output, hole, socket in before:
            tree.links.new(socket, output.inputs["Surface"])
            tree.nodes.remove(hole)
