# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A real forest at full HD: seconds and memory of what an artist tries first, beside instances of a few variants.

    python -m benchmarks forest [--quick]                       # everything, with targets
    python -m benchmarks forest --case birch --no-render        # one case, as a line of JSON
    python -m benchmarks forest --case mix --size 480x270 --side 50 --samples 2 --cover
    python -m benchmarks forest --keep                          # what an earlier run has not left in out/forest

A case is a species, ``mix`` (five species, 5 m apart), ``eye`` (inside a wood of five species) or ``million`` (that of
the README). Each is measured in a process of its own, so that the largest memory is its own. The wood is made as
somebody makes it who tries the extension for the first time: a grid of 300 m is the ground, Populate is asked for
100,000 plants at the distance that it suggested in 2026, and the camera stands at the edge, 30 m up. Everything else is
as in a new file, with the sun and sky of First Forest. How near its image is to the truth is what `exact` measures.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from examples import million, stage, stands
from tetflora_addon import memory
from tetflora_addon.blender import worker
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.job.contents import compile_for, in_year, read_scene
from tetflora_addon.blender.job.forecast import forecast
from tetflora_addon.blender.job.plant_mesh import plant_mesh, plant_parts, single_seed
from tetflora_addon.blender.placing.first_forest import sky
from tetflora_addon.emission.budget import Detail
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.jobs import Progress
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement, Statistics
from tetflora_addon.species import catalog

from .pictures import timed_render
from .report import ROOT, Targets, Watch, cpu_s, forget_peak, peak_mb, records_of, setting, size_of

#: Left by a run: what each process has measured.
FOLDER = ROOT / "out" / "forest"
WHATS = ("refine", "instances")
QUICK = ("birch", "mix")
#: Samples of timed images, and of the whole image to which seconds are extrapolated.
TIMED, SAMPLES = 4, 64
#: Gigabytes that the process may have.
LIMITS = (2, 4, 8)
#: Ground: meters along each side, and faces. With these 14,891 plants have room, 2,446 at 5 m.
SIDE, SUBDIVISIONS = 300.0, 120
WIDTH, HEIGHT = 1920, 1080
MIX = ("birch", "spruce", "oak", "beech", "scots_pine")
#: The catalog does not say what a tree is: all that grow at least so high, meters.
TREE = 4.0
MILLION_GB = 6.0
#: The eye looks at this height above the middle of the ground, meters.
_CROWNS = 7.0
#: Steps of the job that are named, longest first; seconds that Blender may stand still.
_NAMED, STILL = 5, 0.2
#: Different plants in all, for instances; species have equal parts of them, rounded up.
VARIANTS = 8
_NAME = "Variants"
#: Attributes of places: their types, and the sockets that they feed.
_SOCKETS = (
    ("turned", 'FLOAT_VECTOR', "Rotation"),
    ("size", 'FLOAT', "Scale"),
    ("variant", 'INT', "Instance Index"),
)
#: Figures of single cases that go into the record as they are.
_OURS = (
    "plants",
    "refine_emit_s",
    "peak_mb",
    "polygons_meshed",
    "polygons_proxy",
    "longest_step_s",
    "hidden_open",
    "render_s",
    "peak_render_mb",
)
_THEIRS = ("build_s", "render_s", "peak_render_mb")

TARGETS: Targets = {
    "refine_emit_s_max": {"max": 20.0},
    "peak_mb_max": {"max": 3000.0},
    "polygons_max": {"max": 6e6},
    "mix_s": {"max": 15.0},
    "eye_s": {"max": 15.0},
    "longest_step_s": {"max": 0.2},
    "render_ratio_max": {"max": 1.1},
    "total_ratio_max": {"max": 1.05},
    "memory_ratio_max": {"max": 2.0},
    "hidden_open_ratio_max": {"max": 1.0},
    "limit_ratio_max": {"max": 1.0},
    "million_s": {"max": 60.0},
    "million_mb": {"max": 6000.0},
}
QUICK_TARGETS = {key: TARGETS[key] for key in ("longest_step_s", "hidden_open_ratio_max")}


def options(parser: argparse.ArgumentParser) -> None:
    """What may be asked for beside everything."""
    add = parser.add_argument
    add("--case", help="only a species, mix, eye or million, as a line of JSON")
    add("--keep", action="store_true", help="go on with what earlier runs left")
    add("--what", choices=WHATS, default="refine", help="refine, or variants as instances")
    add("--asked", "--plants", type=int, help="plants that Populate is asked for, by default 100,000")
    add("--side", type=float, help="of the ground, by default 300 m: a smaller wood of the same density")
    add("--distance", type=float, help="minimum distance between plants, meters")
    add("--eye", type=float, help="height of the camera, meters")
    add("--away", type=float, help="least distance of the camera from the middle, meters; it looks so far")
    add("--cover", action="store_true", help="with ground cover")
    add("--size", type=size_of, default=(WIDTH, HEIGHT), metavar="WxH")
    add("--set", type=setting, nargs="+", default=[], metavar="NAME=VALUE", help="settings of the scene")
    add("--run-to-end", action="store_true", help="as scripts and renders refine, not in steps as the window does")
    add("--no-render", action="store_true")
    add("--samples", type=int, default=TIMED, help="of images that are timed, beside one with one sample")


def run(given: argparse.Namespace) -> dict[str, float] | None:
    """Measure; quick: a smaller wood in a smaller image, of birches and of five species."""
    if given.case:
        print(json.dumps(one(given)), flush=True)
        return None
    folder = FOLDER / "quick" if given.quick else FOLDER
    if not given.keep:
        for path in folder.glob("*.json"):
            path.unlink()
    small = ("--size", "480x270", "--side", "60") if given.quick else ()
    records = {}
    for case in QUICK if given.quick else (*trees(), "mix", "eye"):
        for what in WHATS:
            records[case, what] = measured(folder, case, "--what", what, *small)
    if not given.quick:
        records["million", "refine"] = measured(folder, "million", "--no-render", "--run-to-end")
        for limit in LIMITS:
            limited = ("--set", f"max_memory={limit}", "--samples", "1")
            records["birch", f"limit_{limit}"] = measured(folder, "birch", *limited)
    return sums(records)


def measured(folder: Path, *words: str) -> dict:
    """What a process of its own measures of a case, or has left in a folder in an earlier run."""
    path = folder / ("-".join(words).replace("--", "").replace("=", "-") + ".json")
    if path.exists():
        return json.loads(path.read_text())
    found = records_of(["forest", "--case", *words])[-1]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found) + "\n")
    return found


def one(given: argparse.Namespace) -> dict:
    """Measure one case in this process."""
    scene = bpy.context.scene
    if given.case == "million":
        planted = build_million(scene, given.asked)
    else:
        changes = {name: getattr(given, name) for name in ("asked", "side", "distance", "eye", "away", "cover")}
        case = replace(case_of(given.case), **{name: value for name, value in changes.items() if value})
        planted = build(scene, case, given.size)
    for name, value in given.set:
        set_named(scene.tetflora, name, value)
    figures = {"case": given.case, "what": given.what, "planted": planted, "expected": expected(scene)}
    figures |= build_instances(scene) if given.what == "instances" else refined(scene, given.run_to_end)
    if not given.no_render:
        with tempfile.TemporaryDirectory() as folder:
            figures |= rendered(scene, Path(folder), given.samples)
        figures["peak_render_mb"] = max(figures["peak_mb"], figures["peak_render_mb"])
    return figures


def expected(scene: bpy.types.Scene) -> dict[str, float]:
    """What the panel says that refining will take."""
    bpy.context.view_layer.update()
    found = forecast(scene, bpy.context.view_layer)
    return {"primitives": found.primitives, "seconds": found.seconds, "memory_mb": found.memory / 1e6}


def set_named(group: object, name: str, value: str) -> None:
    """Set a property from text; one of a group within it is named with that."""
    *groups, name = name.split(".")
    for inner in groups:
        group = getattr(group, inner)
    kind = type(getattr(group, name))
    setattr(group, name, value == "True" if kind is bool else kind(value))


@dataclass(frozen=True)
class Case:
    """A wood and where it is seen from.

    Attributes
    ----------
    species : tuple of str
        In equal parts.
    asked : int
        Plants that Populate is asked for; as many come as have room.
    distance : float
        Minimum distance between plants, meters.
    eye : float
        Height of the camera, meters.
    inside : bool
        The camera stands in the middle of the wood and looks ahead, not at the edge.
    side : float
        Of the ground, meters.
    away : float
        Least distance of the camera from the middle of the ground, meters, and how far ahead it then looks. 0: to the
        middle.
    cover : bool
        The ground is covered.
    """

    species: tuple[str, ...]
    asked: int = 100_000
    distance: float = 2.0
    eye: float = 30.0
    inside: bool = False
    side: float = SIDE
    away: float = 0.0
    cover: bool = False


def case_of(name: str) -> Case:
    """A case by its name: that of a species, ``mix`` or ``eye``."""
    if name == "mix":
        return Case(MIX, distance=5.0)
    if name == "eye":
        return Case(MIX, asked=20_000, eye=1.7, inside=True)
    return Case((name,))


def trees() -> tuple[str, ...]:
    """Species of the catalog that are trees."""
    return tuple(name for name in catalog.list_species() if stands.height_of(name, 1) >= TREE)


def build(scene: bpy.types.Scene, case: Case, size: tuple[int, int] = (WIDTH, HEIGHT)) -> int:
    """Fill an empty scene with ground, plants, camera, sun and sky; how many plants there are."""
    bpy.ops.mesh.primitive_grid_add(size=case.side, x_subdivisions=SUBDIVISIONS, y_subdivisions=SUBDIVISIONS)
    bpy.ops.tetflora.populate(count=case.asked, min_distance=case.distance, species=", ".join(case.species))
    if case.cover:
        bpy.ops.tetflora.ground_cover()
    add_camera(scene, case)
    add_light(scene)
    render = scene.render
    render.engine = 'CYCLES'  # before plants are refined: engines draw spheres of different sizes
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    scene.tetflora.refine_at_render = False
    bpy.context.view_layer.update()
    return sum(population.made for population in scene.tetflora.layers)


def add_camera(scene: bpy.types.Scene, case: Case) -> None:
    """The camera that Blender adds, where the case has it; its range reaches to the end of the wood."""
    eye = Vector((0.0, 0.0 if case.inside else -max(case.side / 2, case.away), case.eye))
    ahead = Vector((0.0, case.away or case.side / 2, 0.0 if case.inside else min(_CROWNS, case.eye) - case.eye))
    stage.camera(scene, eye, eye + ahead, lens=50.0, far=max(1000.0, 2.0 * case.side))


def add_light(scene: bpy.types.Scene) -> None:
    """Sun and sky of First Forest."""
    stage.sun(scene, 38.0, 68.0, color=(1.0, 0.93, 0.82))
    scene.world = sky("Sky")
    scene.view_settings.exposure = 0.9


def build_million(scene: bpy.types.Scene, plants: int | None = None) -> int:
    """The forest of a million plants of the README, within the gigabytes of its image; how many plants there are."""
    plants = plants or million.PLANTS
    million.build(scene, plants)
    scene.tetflora.refine_at_render, scene.tetflora.max_memory = False, MILLION_GB
    return plants


@contextmanager
def watching(look: Callable[[Refinement], None]) -> Iterator[None]:
    """While it lasts, jobs show what the loop left."""
    fit_to_budget = refine.fit_to_budget

    def watched(refinement: Refinement, *rest: object) -> Detail:
        look(refinement)
        return fit_to_budget(refinement, *rest)

    refine.fit_to_budget = watched
    try:
        yield
    finally:
        refine.fit_to_budget = fit_to_budget


def refined(scene: bpy.types.Scene, run_to_end: bool = False) -> dict:
    """Refine as the operator does; figures of the job and of what the loop left.

    run_to_end: as scripts and renders do, without a thread; steps are then those of the engine, which nobody waits for.
    """
    kept: list[Refinement] = []
    taken: list[tuple[float, str]] = []
    watch = Watch()
    with watching(kept.append):
        start, processor, every = time.perf_counter(), time.process_time(), cpu_s()
        steps = _timed(refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get()), taken)
        statistics = worker.run_to_end(steps) if run_to_end else worker.run(steps)
        seconds, processor = time.perf_counter() - start, time.process_time() - processor
        every = cpu_s() - every
    peak = watch.most
    found = left_open(kept.pop()) if kept else {}
    memory.give_back()  # as the job has done, but for what was kept here to be counted
    forget_peak()  # counting made copies
    longest = sorted(taken, reverse=True)[:_NAMED]
    return {
        "plants": statistics.plants,
        "refine_emit_s": seconds,
        "refine_emit_cpu_s": processor,
        "refine_emit_all_cpu_s": every,
        "peak_mb": peak,
        "longest_step_s": longest[0][0],
        "steps": len(taken),
        "steps_too_long": sum(one > STILL for one, _ in taken),
        "polygons_meshed": statistics.polygons_meshed,
        "polygons_proxy": statistics.polygons_proxy,
        "polygons": statistics.polygons_meshed + statistics.polygons_proxy,
        "polygons_full": statistics.polygons_full,
        "facet_pixels": statistics.facet_pixels,
        "passes": statistics.passes,
        "tetrahedra_made": statistics.tetrahedra_made,
        "complete": statistics.complete,
        "mesh_mb": statistics.memory_mb,
        **found,
        "seconds": {stage: round(value, 3) for stage, value in statistics.seconds.items()},
        "longest_steps": [f"{one:.2f} s  {what}" for one, what in longest],
    }


def _timed(steps: Iterator[Progress], taken: list[tuple[float, str]]) -> Generator[Progress, None, Statistics]:
    """A job that notes the seconds of each step, between which messages."""
    before = "begin"
    while True:
        begun = time.perf_counter()
        try:
            progress = next(steps)
        except StopIteration as stop:
            taken.append((time.perf_counter() - begun, f"{before} > end"))
            return stop.value
        taken.append((time.perf_counter() - begun, f"{before} > {progress.message}"))
        before = progress.message
        yield progress


def left_open(refinement: Refinement) -> dict[str, float]:
    """How many parts of plants are open, by what was decided on the tetrahedra that they are in.

    A part that several tetrahedra share counts in each by the fraction of its area there. Whole plants are not open.
    """
    nodes = np.zeros(len(refinement.tree), np.int8)
    nodes[refinement.nodes] = refinement.decision
    parts, points = refinement.plants.parts, refinement.plants.points
    # Plants grow from the first row of their species.
    trunks = np.flatnonzero(np.diff(refinement.plants.flora.rows["species"], prepend=-1))
    whole = ~parts.branch_only & np.isin(parts.branches.row, trunks)
    area = points.optical_area.astype(np.float64)
    share = area / np.maximum(np.bincount(points.part, area, len(parts)), 1e-300)[points.part]
    share[whole[points.part]] = 0.0
    found = np.bincount(nodes[points.cell], share, minlength=len(Decision))
    cells = np.bincount(refinement.decision, minlength=len(Decision))
    seen = float(found[Decision.EXPLICIT] + found[Decision.PROXY])
    return {
        "open_hidden": float(found[Decision.HIDDEN]),
        "open_seen": seen,
        "hidden_open": float(found[Decision.HIDDEN] / max(seen, 1.0)),
        **{
            f"cells_{one.name.lower()}": int(cells[one]) for one in (Decision.HIDDEN, Decision.EXPLICIT, Decision.PROXY)
        },
    }


def rendered(scene: bpy.types.Scene, folder: Path, samples: int) -> dict[str, float]:
    """Render twice; seconds before the first sample (sync and BVH), of each, and of an image with `SAMPLES`.

    The same in processor seconds, which others that run beside it hardly change. With a single sample: render once, for
    the memory.
    """
    watch = Watch()
    taken = {number: _render_seconds(scene, folder / "picture.png", number) for number in sorted({1, samples})}
    figures = {}
    for place, clock in enumerate(("", "cpu_")):
        first, last = taken[1][place], taken[samples][place]
        each = max(last - first, 0.0) / max(samples - 1, 1)
        setup = max(first - each, 0.0)
        figures |= {
            f"render_{clock}s": last,
            f"render_setup_{clock}s": setup,
            f"render_sample_{clock}s": each,
            f"render_{SAMPLES}_{clock}s": setup + SAMPLES * each,
        }
    return figures | {"peak_render_mb": watch.most}


def _render_seconds(scene: bpy.types.Scene, path: Path, samples: int) -> tuple[float, float]:
    """Seconds of a render by the clock, and of all processors."""
    processor = time.process_time()
    seconds = timed_render(scene, path, samples)
    return seconds, time.process_time() - processor


def build_instances(scene: bpy.types.Scene, of_each: int = 0, own: bool = False, away: float = 0.0) -> dict[str, float]:
    """Put variants at the places of all plants of a scene; seconds, and polygons of the variants.

    So many of each species, or `VARIANTS` in all, each at random; ``own``: that of the plant's own seed, which must be
    below their number. Plants nearer to the camera than ``away`` meters are left out.
    """
    start = time.perf_counter()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seeds = read_scene(scene, depsgraph).seeds
    variants = bpy.data.collections.new(_NAME)  # of no scene: only the instances are rendered
    polygons, each = 0, of_each or -(-VARIANTS // len(seeds.identifiers))
    for number, kind in enumerate(seeds.identifiers):
        flora = in_year(scene, compile_for((kind,), scene, depsgraph))
        for one in range(each):
            # Geometry nodes sort the members of a collection by their names.
            name = f"{_NAME} {number:03d} {one:03d}"
            mesh = plant_mesh(scene, name, flora.species[0], plant_parts(flora, single_seed(kind, one)))
            variants.objects.link(bpy.data.objects.new(name, mesh))
            polygons += len(mesh.polygons)
    far = np.linalg.norm(seeds.position - np.array(scene.camera.matrix_world.translation), axis=1) >= away
    wood = bpy.data.objects.new("Wood", _places(seeds.take(far), each, own))
    scene.collection.objects.link(wood)
    wood.modifiers.new("Instances", 'NODES').node_group = _variant_nodes(variants)
    bpy.context.view_layer.update()
    seconds = time.perf_counter() - start
    return {"instances": len(seeds), "build_s": seconds, "variant_polygons": polygons, "peak_mb": peak_mb()}


def _places(seeds: Seeds, each: int, own: bool) -> bpy.types.Mesh:
    """A vertex for each plant, with its rotation, scale and variant, out of so many of its species."""
    if own and len(seeds) and not 0 <= seeds.seed.min() <= seeds.seed.max() < each:
        raise ValueError(f"Seeds from {seeds.seed.min()} to {seeds.seed.max()} are none of {each} variants")
    mesh = bpy.data.meshes.new("Wood")
    mesh.vertices.add(len(seeds))
    frame = seeds.frame
    angles = np.stack(
        [
            np.arctan2(frame[:, 2, 1], frame[:, 2, 2]),
            -np.arcsin(np.clip(frame[:, 2, 0], -1.0, 1.0)),
            np.arctan2(frame[:, 1, 0], frame[:, 0, 0]),
        ],
        axis=1,
    )
    chosen = seeds.seed if own else np.random.default_rng(1).integers(0, each, len(seeds))
    variant = seeds.species * each + chosen
    mesh.attributes["position"].data.foreach_set("vector", seeds.position.astype(np.float32).ravel())
    for name, kind, key, values in (
        ("turned", 'FLOAT_VECTOR', "vector", angles.astype(np.float32)),
        ("size", 'FLOAT', "value", seeds.scale.astype(np.float32)),
        ("variant", 'INT', "value", variant.astype(np.int32)),
    ):
        mesh.attributes.new(name, kind, 'POINT').data.foreach_set(key, values.ravel())
    return mesh


def _variant_nodes(variants: bpy.types.Collection) -> bpy.types.GeometryNodeTree:
    """Vertices in, instances of the members of a collection out."""
    tree, given, placed, made = stage.instancing("Instances", variants)
    new, link = tree.nodes.new, tree.links.new
    link(given.outputs[0], placed.inputs["Points"])
    for name, kind, socket in _SOCKETS:
        stored = new("GeometryNodeInputNamedAttribute")
        stored.data_type = kind
        stored.inputs["Name"].default_value = name
        link(next(s for s in stored.outputs if s.enabled), placed.inputs[socket])
    link(placed.outputs[0], made.inputs[0])
    return tree


def sums(records: Mapping[tuple[str, str], dict]) -> dict[str, float]:
    """Extremes over all cases, then figures of each.

    Parameters
    ----------
    records : mapping
        By case and what was measured: ``refine``, ``instances`` or ``limit_`` with gigabytes.
    """
    woods = {case: one for (case, what), one in records.items() if what == "refine" and case != "million"}
    species = [one for case, one in woods.items() if case not in ("mix", "eye")]
    over = {case: ratios(one, records[case, "instances"]) for case, one in woods.items()}
    limits = {int(what.removeprefix("limit_")): one for (_, what), one in records.items() if what.startswith("limit_")}
    figures = {
        "refine_emit_s_max": max(one["refine_emit_s"] for one in species),
        "peak_mb_max": max(one["peak_mb"] for one in woods.values()),
        "polygons_max": max(one["polygons"] for one in woods.values()),
        **{f"{case}_s": woods[case]["refine_emit_s"] for case in ("mix", "eye") if case in woods},
        "longest_step_s": max(one["longest_step_s"] for one in woods.values()),
        **{f"{key}_max": max(one[key] for one in over.values()) for key in next(iter(over.values()))},
        "hidden_open_ratio_max": max(one["hidden_open"] for one in woods.values()),
    }
    if limits:
        used = {f"limit_{n}_gb": one["peak_render_mb"] / (n * 1e3) for n, one in limits.items()}
        figures |= {"limit_ratio_max": max(used.values()), **used}
    if ("million", "refine") in records:
        one = records["million", "refine"]
        figures |= {"million_s": one["refine_emit_s"], "million_mb": one["peak_mb"], "million_plants": one["plants"]}
    for case, one in woods.items():
        figures |= {f"{key}_{case}": one[key] for key in _OURS if key in one}
        figures |= {f"instances_{key}_{case}": records[case, "instances"][key] for key in _THEIRS}
        figures |= {f"{key}_{case}": value for key, value in over[case].items()}
    return figures


def ratios(ours: dict, theirs: dict) -> dict[str, float]:
    """Ours over instances: render, everything until an image with `SAMPLES` samples, and memory."""
    whole, processor = f"render_{SAMPLES}_s", f"render_{SAMPLES}_cpu_s"
    return {
        "render_ratio": ours[whole] / theirs[whole],
        "render_cpu_ratio": ours[processor] / theirs[processor],
        "total_ratio": (ours["refine_emit_s"] + ours[whole]) / (theirs["build_s"] + theirs[whole]),
        "memory_ratio": ours["peak_render_mb"] / theirs["peak_render_mb"],
    }
