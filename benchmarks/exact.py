# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A wood beside its truth: refined against the same plants expanded, in the same light, with the same samples.

    python -m benchmarks exact [--quick]           # everything, with targets
    python -m benchmarks exact --cases edge --species birch,spruce --size 960x540 --samples 16
    python -m benchmarks exact --cases eye --seasons summer bare snow --set max_memory=2
    python -m benchmarks exact --cases edge --size 1920x1080 --window 640x360
    python -m benchmarks exact --sheet             # docs/images/exact.jpg of the windows that are there

Plants have one of `SEEDS` seeds a species, by their places, so that the truth is so many expanded meshes a species as
instances. Those have leaves as they are seen from afar: at eye height plants around the eye are expanded one by one, as
finely as they are seen. Each picture is made in a process of its own, so that the largest memory is its own. Truths are
kept in ``out/exact/truth`` by a digest of all that they follow from. Nothing is denoised. Needles are many: the truth
of eight spruces takes some 12 GB, that of two (``--seeds 2``) 3.7 GB; facets of equal plants may differ in size
(`equal_seeds`).

Beside the figures, ``out/exact`` gets ``sheet.png`` (truth, refined, FLIP) and ``blobs.png`` (refined; blobs that are
too bright in orange and too dark in blue) for each case.

- ``flip_over_noise``: mean FLIP over the pixels of plants, less that of the truth to itself with another noise seed.
- ``color``: difference of the mean linear colors of plants, relative to the truth's.
- ``blobs``: pixels of a million of plants' pixels, of which the mean luma of 3 × 3 is off by more than `OFF`.
- ``peak_mb``: what all processes together hold at one time, at most.
- ``facet_px``: mean side (root of the area) in pixels of the faces that the middles of pixels see: of proxies, and of
  twigs that are triangles. Leaves, blossoms and tubes have figures of their own (`sums_of_sides`).
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools.formats import set_format
from examples import biomes, stage
from tetflora_addon.blender.biomes import adding
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.job.contents import compile_for, in_year, read_scene
from tetflora_addon.blender.materials import snow
from tetflora_addon.blender.results.leaf_objects import materials_of
from tetflora_addon.blender.results.meshes import write_mesh
from tetflora_addon.blender.results.output import KIND, result_collections
from tetflora_addon.blender.scene.camera import read_camera
from tetflora_addon.blender.scene.fields import fields_of
from tetflora_addon.blender.viewport import warnings
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.growth.hashing import child_key, key_of_seed

from . import forest
from .pictures import changed, color_error, coverage, flip_map, read_picture, render, save_picture, timed_render
from .report import ROOT, Targets, Watch, apart, cpu_s, forget_peak, peak_mb, setting, size_of

FOLDER = ROOT / "out" / "exact"
CASES = ("edge", "ridge", "eye", "low")
SEASONS = ("summer", "bare", "snow")
SPECIES = (("birch", "spruce"), ("beech", "oak"), ("scots_pine", "hazel"))
#: Different plants of each species.
SEEDS = 8
SIZE, SAMPLES = (960, 540), 16
#: Pixels of full HD that are compared, in the middle.
FULL, WINDOW = (1920, 1080), (640, 360)
#: Luma of 3 × 3 pixels that makes a blob, of 1.
OFF = 0.12
#: Kinds of faces by number; 0 is no plant. ``triangle``: wood that is no tube.
KINDS = ("", "proxy", "leaf", "blossom", "triangle", "bark")
#: Those that stand for something else. Leaves are as large as they are, blossoms as well.
_FACETS = ("proxy", "triangle")
#: What a truth follows from, besides its numbers: folders and files of this repository.
_SOURCES = (
    *(f"tetflora_addon/{room}" for room in ("catalog", "species", "growth", "leaves", "subplants", "planting")),
    "tetflora_addon/blender/materials",
    "tetflora_addon/emission/plants.py",
    "benchmarks/exact.py",
    "benchmarks/forest.py",
)
#: Woods that are timed at full HD, as in `forest`, and qualities from fine to coarse.
TIMED = ("birch", "spruce", "bamboo", "mix")
QUALITIES = ("FINAL", "PREVIEW", "DRAFT")
#: Pixels that plants cover by less are not compared.
COVERED, COVERAGE_SAMPLES = 0.05, 8
#: Attributes of faces: the root of the area in meters, and which of `KINDS`.
_SIDE, _KIND = "exact_side", "exact_kind"
_DAY = 20.0
#: Plants that a truth expands one by one are nearer than this at eye height, meters.
_AROUND = 17.0
#: Exposure inside the wood, stops.
_INSIDE = 3.0
#: Height of the eye in biomes, meters.
_EYE = 1.7
#: Ground of a few plants, meters.
_PATCH = 8.0
_LOW_SUN = np.radians(12.0)

TARGETS: Targets = {
    "flip_over_noise_max": {"max": 0.05},
    "color_max": {"max": 0.03},
    "blobs_max": {"max": 300.0},
    "facet_px_max": {"max": 1.2},
    "primitives_a_pixel_max": {"max": 6.0},
    "blobs_2gb": {"max": 1500.0},
    "refine_emit_s_max": {"max": 25.0},
    "peak_mb_max": {"max": 4000.0},
    "total_ratio_max": {"max": 0.6},
    "memory_ratio_max": {"max": 0.7},
    "speedup_2": {"min": 1.7},
    "winter_ratio": {"max": 1.5},
    "biome_facet_ratio_max": {"max": 1.5},
    "presets_ordered": {"min": 1.0},
    "equal_seeds": {"min": 0.95, "max": 1.05},
}
_OF_CASES = ("flip_over_noise", "color", "blobs", "facet_px", "primitives_a_pixel")
QUICK_TARGETS: Targets = {f"{name}_max": TARGETS[f"{name}_max"] for name in _OF_CASES}


@dataclass(frozen=True)
class Spec:
    """A wood, and how it is seen.

    Attributes
    ----------
    case : str
        One of `CASES`.
    species : tuple of str
    season : str
        One of `SEASONS`.
    size : tuple of int
        Of the image, pixels.
    window : tuple of int
        Of the part in the middle that is rendered, pixels; empty for all.
    samples : int
    seeds : int
        Different plants of each species; 0: all as Populate makes them, which have no truth.
    distance : float
        Minimum distance between the plants of ``eye``, meters.
    few : int
        Plants of a patch; 0: the whole wood.
    """

    case: str
    species: tuple[str, ...]
    season: str = "summer"
    size: tuple[int, int] = SIZE
    window: tuple[int, ...] = ()
    samples: int = SAMPLES
    seeds: int = SEEDS
    distance: float = 5.0
    few: int = 0

    @property
    def name(self) -> str:
        """For files and figures."""
        size = "x".join(str(side) for side in self.window or self.size)
        return f"{self.case}-{'+'.join(self.species)}-{self.season}-{'window-' if self.window else ''}{size}"

    @property
    def digest(self) -> str:
        """Of all that the truth follows from."""
        content = hashlib.sha256(json.dumps(asdict(self)).encode())
        for source in _SOURCES:
            path = ROOT / source
            for file in [path] if path.is_file() else sorted(path.rglob("*")):
                if file.suffix in (".py", ".json"):
                    content.update(file.relative_to(ROOT).as_posix().encode() + file.read_bytes())
        return content.hexdigest()[:16]


def blobs(
    exact: NDArray[np.floating], found: NDArray[np.floating], mask: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Pixels (height, width) of a mask where the mean of 3 × 3 is too bright, and where it is too dark.

    Parameters
    ----------
    exact, found : (height, width) float
        Luma, 0 to 1.
    mask : (height, width) bool
    """
    padded = np.pad(np.asarray(found, np.float64) - exact, 1, mode="edge")
    height, width = exact.shape
    off = sum(padded[y : y + height, x : x + width] for y in range(3) for x in range(3)) / 9.0
    return mask & (off > OFF), mask & (off < -OFF)


def luma(stored: NDArray[np.floating]) -> NDArray[np.floating]:
    """Luma (height, width) of an image (height, width, 3) as it is stored."""
    return stored @ np.array([0.2126, 0.7152, 0.0722])


def polygon_areas(
    position: NDArray[np.floating], corners: NDArray[np.int32], starts: NDArray[np.int32], totals: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Areas (n,) of polygons, m²: half of the sum of the crosses of their edges from the first corner.

    Parameters
    ----------
    position : (v, 3) float
    corners : (c,) int
        Vertices.
    starts, totals : (n,) int
        First corner of each polygon, and how many it has.
    """
    twice = np.zeros((len(totals), 3))
    first = position[corners[starts]].astype(np.float64) if len(totals) else twice
    for step in range(1, int(totals.max(initial=0)) - 1):
        at = np.flatnonzero(totals > step + 1)
        a, b = (position[corners[starts[at] + step + n]] - first[at] for n in (0, 1))
        twice[at] += np.cross(a, b)
    return 0.5 * np.linalg.norm(twice, axis=1)


def sums_of_sides(side: NDArray[np.floating], kind: NDArray[np.integer]) -> dict[str, float]:
    """Means, 95th percentiles and largest of sides, pixels, and what of all plants each kind covers.

    Parameters
    ----------
    side : (height, width) float
        Of the face that the middle of each pixel sees.
    kind : (height, width) int
        Index into `KINDS`.
    """
    facet = np.isin(kind, [KINDS.index(name) for name in _FACETS])
    figures = _sums("facet", side[facet])
    seen = max(int((kind > 0).sum()), 1)
    for number, name in enumerate(KINDS):
        if number and (kind == number).any():
            figures |= _sums(name, side[kind == number]) | {f"{name}_share": float((kind == number).sum() / seen)}
    return figures


def _sums(name: str, side: NDArray[np.floating]) -> dict[str, float]:
    if not len(side):
        return {f"{name}_px": 0.0}
    return {
        f"{name}_px": float(side.mean()),
        f"{name}_px_95": float(np.percentile(side, 95)),
        f"{name}_px_largest": float(side.max()),
    }


def measured(
    spec: Spec,
    folder: Path = FOLDER,
    settings: Iterable[tuple[str, str]] = (),
    compare: bool = True,
    render: bool = True,
    keep: bool = True,
    threads: int = 0,
) -> dict:
    """Figures of a wood, refined with some settings of the scene; of its truth, where they are compared, as well."""
    if spec.window:
        spec = replace(spec, window=tuple(min(pair) for pair in zip(spec.window, spec.size, strict=True)))
    kept = FOLDER / "truth" / spec.digest
    written = kept / "figures.json"
    compare = compare and render and spec.seeds > 0
    figures = {"name": spec.name}
    if compare:
        if not keep or not written.exists():
            kept.mkdir(parents=True, exist_ok=True)
            found = _apart(spec, "truth", folder, kept)
            written.write_text(json.dumps(found | {"name": spec.name}, indent=1) + "\n")
        figures |= json.loads(written.read_text())
    own = folder / "-".join([spec.name, *(f"{name}-{value}" for name, value in settings)])
    figures |= _apart(spec, "refined", own, kept, settings, compare, render, threads)
    (own / "figures.json").write_text(json.dumps(figures, indent=1) + "\n")
    return figures


def _apart(
    spec: Spec,
    what: str,
    folder: Path,
    kept: Path,
    settings: Iterable[tuple[str, str]] = (),
    compare: bool = False,
    render: bool = False,
    threads: int = 0,
    quality: str = "FINAL",
) -> dict:
    """What a process of its own measures."""
    own = {"TETFLORA_THREADS": str(threads)} if threads else {}
    folders = str(folder), str(kept)
    return apart(measure, asdict(spec), what, *folders, list(settings), compare, render, quality, **own)


def run(given: argparse.Namespace) -> dict[str, float] | None:
    """Measure everything, or some; quick: the edge in summer and in winter, in a small image, with two seeds."""
    if given.sheet:
        _show(given.out.resolve(), ROOT / "docs" / "images" / "exact.jpg")
        return None
    if given.cases:
        for spec in _specs(given):
            found = measured(spec, given.out.resolve(), given.set, True, not given.no_render, given.keep, given.threads)
            print(line(found), flush=True)
        return None
    if given.quick:
        small = {"size": (480, 270), "samples": 8, "seeds": 2}
        specs = [Spec("edge", SPECIES[0], season, **small) for season in ("summer", "bare")]
        return _of_cases([measured(spec) for spec in specs])
    woods = [Spec(case, species, season) for species in SPECIES for case in CASES for season in SEASONS]
    # Windows in summer only: what seasons change does not depend on the size of the image.
    woods += [replace(spec, size=FULL, window=WINDOW) for spec in woods if spec.season == "summer"]
    records = []
    for spec in woods:
        records.append(measured(spec))
        print(line(records[-1]), flush=True)
    figures = _of_cases(records)
    edge = woods[0]
    figures["blobs_2gb"] = measured(edge, settings=[("max_memory", "2")])["blobs"]
    different = measured(replace(edge, seeds=0), render=False)
    few = next(found for found in records if found["name"] == edge.name)
    figures["equal_seeds"] = few["facet_px"] / different["facet_px"]
    figures |= _speed(edge) | _biomes()
    checks = {f"check_{season}": check(SPECIES[0], season)["flip_over_noise"] for season in ("summer", "snow")}
    return figures | checks


def _of_cases(records: list[dict]) -> dict[str, float]:
    """The largest figures of all woods, then those of each."""
    figures = {f"{name}_max": max(found[name] for found in records) for name in _OF_CASES}
    for found in records:
        numbers = {name: value for name, value in found.items() if isinstance(value, int | float)}
        figures |= {f"{found['name']}: {name}": value for name, value in numbers.items()}
    return figures


def _speed(edge: Spec) -> dict[str, float]:
    """Seconds and memory of whole woods at full HD beside instances, and what workers and winter change."""
    figures: dict[str, float] = {}
    ours, theirs = {}, {}
    for name in TIMED:
        ours[name], theirs[name] = (
            forest.measured(FOLDER / "forest", name, "--what", what) for what in ("refine", "instances")
        )
        ratios = forest.ratios(ours[name], theirs[name])
        figures |= {f"{key}_{name}": ratios[key] for key in ("total_ratio", "memory_ratio")}
        figures |= {f"{key}_{name}": ours[name][key] for key in ("refine_emit_s", "peak_mb")}
    for key in ("refine_emit_s", "peak_mb", "total_ratio", "memory_ratio"):
        figures[f"{key}_max"] = max(figures[f"{key}_{name}"] for name in TIMED)
    large = replace(edge, size=FULL)
    alone, two = (measured(large, render=False, threads=threads)["refine_emit_s"] for threads in (1, 2))
    bare = measured(replace(large, season="bare"), render=False, threads=2)["refine_emit_s"]
    return figures | {"speedup_2": alone / two, "winter_ratio": bare / two}


def _biomes() -> dict[str, float]:
    """Sides of facets in each shipped biome, over what is set in *Final*, and whether qualities are in order."""
    ratios, ordered, figures = [], True, {}
    for path in sorted(biomes.SHIPPED.glob("*.json")):
        spec = Spec(path.stem, (), size=FULL, seeds=0)
        found = [_apart(spec, "biome", FOLDER / f"biome-{path.stem}", FOLDER, quality=name) for name in QUALITIES]
        sides = [one["facet_px"] for one in found]
        figures |= {f"biome_{path.stem}_{n.lower()}_px": side for n, side in zip(QUALITIES, sides, strict=True)}
        ratios.append(sides[0] / found[0]["facet_set"])
        ordered &= sides == sorted(sides)
    return {"biome_facet_ratio_max": max(ratios), "presets_ordered": float(ordered), **figures}


def check(species: tuple[str, ...], season: str) -> dict:
    """Figures of a few plants as instances beside the same expanded one by one: FLIP is that of noise."""
    spec = Spec("low" if season == "summer" else "edge", species, season, (480, 270), (), 64, 2, few=5)
    folder = FOLDER / f"check-{spec.name}"
    return _apart(spec, "check", folder, folder)


def line(found: dict) -> str:
    """The main figures of a wood in a few lines."""
    get = found.get
    out = [found["name"]]
    if "flip" in found:
        noise = f"noise {found['blobs_noise']:,.0f}"
        out.append(
            f"  FLIP {found['flip']:.3f} (noise {found['noise']:.3f})  color {100 * found['color']:.1f} % "
            f"(noise {100 * found['color_noise']:.1f})  plants on {100 * found['covered']:.0f} %"
        )
        out.append(f"  blobs {found['blobs_bright']:,.0f} bright + {found['blobs_dark']:,.0f} dark ({noise})")
    sides = "  ".join(
        f"{name} {found[f'{name}_px']:.2f} ({100 * get(f'{name}_share', 1.0):.0f} %, "
        f"95th {get(f'{name}_px_95', 0.0):.1f}, max {get(f'{name}_px_largest', 0.0):.0f})"
        for name in ("facet", *KINDS[1:])
        if f"{name}_px" in found
    )
    out.append(f"  sides in pixels: {sides}")
    out.append(
        f"  {found['primitives']:,} primitives, {found['primitives_a_pixel']:.2f} a pixel; refine and emit "
        f"{found['refine_emit_s']:.1f} s, {found['peak_mb']:,.0f} MB; render {get('render_s', 0.0):.1f} s, "
        f"{get('peak_render_mb', 0.0):,.0f} MB"
    )
    if "instances_render_s" in found:
        out.append(
            f"  instances: build {found['instances_build_s']:.1f} s, render {found['instances_render_s']:.1f} s, "
            f"{found['instances_peak_mb']:,.0f} MB"
        )
    return "\n".join(out)


def options(parser: argparse.ArgumentParser) -> None:
    """What may be asked for beside everything."""
    add = parser.add_argument
    add("--cases", nargs="+", choices=CASES, help="only these")
    add("--seasons", nargs="+", choices=SEASONS, default=["summer"])
    add("--species", nargs="+", type=_species, default=[SPECIES[0]], metavar="NAME,NAME", help="woods of these species")
    add("--size", type=size_of, default=SIZE, metavar="WxH")
    add("--window", type=size_of, default=(), metavar="WxH", help="compare only so much in the middle of the image")
    add("--samples", type=int, default=SAMPLES)
    add("--seeds", type=int, default=SEEDS, help="different plants of each species; 0: all, without a truth")
    add("--distance", type=float, default=Spec.distance, help="between the plants of eye, meters")
    add("--set", type=setting, nargs="+", default=[], metavar="NAME=VALUE", help="settings of the scene")
    add("--threads", type=int, default=0)
    add("--keep", action=argparse.BooleanOptionalAction, default=True, help="use truths that an earlier run has left")
    add("--sheet", action="store_true", help="truth beside refined, of the windows that are there")
    add("--no-render", action="store_true", help="refine and count only")
    add("--out", type=Path, default=FOLDER, metavar="FOLDER", help="for pictures")


def _species(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


def _specs(given: argparse.Namespace) -> Iterator[Spec]:
    for case, species, season in itertools.product(given.cases, given.species, given.seasons):
        yield Spec(case, species, season, given.size, given.window, given.samples, given.seeds, given.distance)


def build(scene: bpy.types.Scene, spec: Spec) -> int:
    """The wood of a case, its camera and light, on its day; how many plants there are."""
    kind = spec.case
    case = forest.Case(tuple(spec.species), **({"side": _PATCH, "asked": spec.few} if spec.few else {}))
    if kind == "ridge":
        case = replace(case, away=600.0, eye=60.0)
    elif kind == "eye":
        case = replace(case, eye=1.7, inside=True, distance=spec.distance)
    planted = forest.build(scene, case, tuple(spec.size))
    if kind == "ridge":
        scene.camera.data.lens = 110.0
        scene.camera.data.clip_end = 5000.0
    if kind == "eye":
        scene.camera.location[:2] = _clearing(scene)
        scene.view_settings.exposure = _INSIDE
    if kind == "low":
        sun = next(o for o in scene.objects if o.type == 'LIGHT')
        sun.rotation_euler = _LOW_SUN - np.pi / 2.0, 0.0, 0.0
    year = scene.tetflora.year
    year.enabled = spec.season != "summer"
    if year.enabled:
        year.day, year.snow = _DAY, 1.0 if spec.season == "snow" else 0.0
    if spec.window:
        _crop(scene.render, spec.window, spec.size)
    if spec.seeds:
        few_seeds(scene, spec.seeds)
    bpy.context.view_layer.update()
    return planted


def _clearing(scene: bpy.types.Scene) -> NDArray[np.float64]:
    """The place (2,) near the middle of a wood that is farthest from all plants."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    plants = read_scene(scene, depsgraph).seeds.position[:, :2]
    along = np.arange(-20.0, 20.0, 0.5)
    places = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    near = plants[(np.abs(plants) < 40.0).all(axis=1)]
    away = np.linalg.norm(places[:, None] - near, axis=2).min(axis=1)
    return places[np.argmax(away)]


def _crop(render: bpy.types.RenderSettings, window: list[int], size: list[int]) -> None:
    """Only a window in the middle of the image is rendered, pixels."""
    render.use_border = render.use_crop_to_border = True
    low, high = ([0.5 + side * w / s / 2.0 for w, s in zip(window, size, strict=True)] for side in (-1.0, 1.0))
    render.border_min_x, render.border_min_y = low
    render.border_max_x, render.border_max_y = high


def few_seeds(scene: bpy.types.Scene, number: int) -> None:
    """Give all plants of a scene one of so many seeds, by a hash of their places."""
    for obj in scene.objects:
        if obj.tetflora.is_plant:
            obj.tetflora.seed = int(_few(np.array([obj.location]), number)[0])
    for obj in fields_of(scene.objects):
        mesh = obj.data
        place = np.zeros((len(mesh.vertices), 3), np.float32)
        mesh.attributes["position"].data.foreach_get("vector", place.ravel())
        place += np.array(obj.matrix_world.translation, np.float32)
        mesh.attributes["seed"].data.foreach_set("value", _few(place, number))
        mesh.update()


def _few(place: NDArray, number: int) -> NDArray[np.int32]:
    """One of so many seeds (n,) for each place (n, 3), meters; the same in fields and empties."""
    east, north = np.round(place[:, :2].astype(np.float64) * 1e3).astype(np.int64).T
    return (child_key(key_of_seed(east), north) % np.uint64(number)).astype(np.int32)


def truth(scene: bpy.types.Scene, spec: Spec, folder: Path) -> dict[str, float]:
    """Instances in place of all plants, rendered with two seeds of noise; seconds and memory."""
    forget_peak()
    around = _AROUND if spec.case == "eye" else 0.0
    built = forest.build_instances(scene, spec.seeds, own=True, away=around)
    figures = {f"instances_{name}": value for name, value in built.items()}
    for obj in [scene.objects["Wood"], *_expand(scene, around)]:
        obj[KIND] = "truth"  # not one of those that are holes where plants are not
    snow.fit(bpy.data.materials)
    figures["instances_render_s"] = timed_render(scene, folder / "truth.png", spec.samples, 0)
    figures["instances_peak_mb"] = peak_mb()
    timed_render(scene, folder / "again.png", spec.samples, 1)
    _save_mask(folder / "covered.npy", coverage(scene, folder / "coverage.png", COVERAGE_SAMPLES))
    return figures


def _expand(scene: bpy.types.Scene, around: float) -> Iterator[bpy.types.Object]:
    """All polygons of the plants so near to the camera, meters, as finely as it sees them."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    camera, seeds = read_camera(scene, depsgraph), read_scene(scene, depsgraph).seeds
    seeds = seeds.take(np.linalg.norm(seeds.position - camera.position, axis=1) < around)
    flora = in_year(scene, compile_for(seeds.identifiers, scene, depsgraph))
    for block in expanded_blocks(flora, seeds, camera):
        materials = materials_of(scene, flora.species[block.species], block.kind, block.form)
        made = bpy.data.objects.new("Near", write_mesh("Near", block.buffers, materials))
        scene.collection.objects.link(made)
        yield made


def refined(
    scene: bpy.types.Scene, spec: Spec, folder: Path, kept: Path, compare: bool, render: bool
) -> dict[str, float]:
    """What Refine makes, rendered, and how far it is from the truth in a folder."""
    figures = _refined(scene, spec)
    if render:
        watch = Watch()
        figures["render_s"] = timed_render(scene, folder / "refined.png", spec.samples, 2)
        figures["peak_render_mb"] = max(watch.most, figures["peak_mb"])
        if compare:
            figures |= compared(folder, kept, coverage(scene, folder / "coverage.png", COVERAGE_SAMPLES))
    return figures | _sides(scene, folder)


def _refined(scene: bpy.types.Scene, spec: Spec) -> dict[str, Any]:
    """Refine as renders do; seconds, memory of all processes, and what was made."""
    watch, begun, processor = Watch(), time.perf_counter(), cpu_s()
    statistics = refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    return {
        "refine_emit_s": time.perf_counter() - begun,
        "refine_emit_cpu_s": cpu_s() - processor,
        "peak_mb": watch.most,
        "stages": {name: round(value, 2) for name, value in statistics.seconds.items()},
        "facet_pixels_said": statistics.facet_pixels,
        **counted(_made(scene), spec.size),
    }


def _made(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [o for c in result_collections(scene) for o in c.all_objects if o.data is not None]


def biome(scene: bpy.types.Scene, spec: Spec, folder: Path, quality: str) -> dict[str, Any]:
    """A shipped biome on a hectare, seen at the height of the eye from the edge, in one of the qualities."""
    chosen = biomes.read(spec.case)
    land = adding.make_land(scene, chosen.ground)
    biomes.add(scene, chosen, land)
    forest.add_light(scene)
    side = land.dimensions.y
    forest.add_camera(scene, forest.Case((), eye=_EYE, side=side))
    eye = np.array([0.0, -0.49 * side, 0.0])
    for _ in range(2):  # on the ground, and again where no trunk fills the picture
        hit, place, *_ = land.ray_cast((*eye[:2], 1e3), (0.0, 0.0, -1.0))
        eye[2] = _EYE + (place.z if hit else 0.0)
        eye[:2] = warnings.open_place(scene, eye, np.array([0.0, 1.0, 0.0]))[:2]
    scene.camera.location = eye
    scene.camera.rotation_euler = np.pi / 2.0, 0.0, 0.0
    scene.render.resolution_x, scene.render.resolution_y = spec.size
    scene.render.resolution_percentage = 100
    scene.tetflora.refine_at_render, scene.tetflora.quality = False, quality
    bpy.context.view_layer.update()
    return {"facet_set": scene.tetflora.facet} | _refined(scene, spec) | _sides(scene, folder)


def checked(scene: bpy.types.Scene, spec: Spec, folder: Path) -> dict[str, float]:
    """Whether instances are the plants: a few of them as instances, beside the same expanded one by one."""
    scene.tetflora.expand_everything = True
    refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    for name, seed in (("truth", 0), ("again", 1)):
        timed_render(scene, folder / f"{name}.png", spec.samples, seed)
    _save_mask(folder / "covered.npy", covered := coverage(scene, folder / "coverage.png", COVERAGE_SAMPLES))
    refine.clear(scene)
    forest.build_instances(scene, spec.seeds, own=True)
    snow.fit(bpy.data.materials)
    timed_render(scene, folder / "refined.png", spec.samples, 2)
    return compared(folder, folder, covered)


def _save_mask(path: Path, covered: NDArray[np.float32]) -> None:
    np.save(path, covered.astype(np.float16))


def counted(made: list[bpy.types.Object], size: list[int]) -> dict[str, float]:
    """Polygons and points of results, by kind and together."""
    found: dict[str, int] = {}
    for obj in made:
        data = obj.data
        number = len(data.points) if obj.type == 'POINTCLOUD' else len(getattr(data, "polygons", ()))
        kind = f"primitives_{obj.get(KIND, 'other')}"
        found[kind] = found.get(kind, 0) + (number or len(getattr(data, "vertices", ())))
    whole = sum(found.values())
    return {"primitives": whole, "primitives_a_pixel": whole / (size[0] * size[1]), **found}


def compared(folder: Path, kept: Path, covered: NDArray[np.float32]) -> dict[str, float]:
    """How far the refined picture is from the truth; a sheet of truth, refined and FLIP, and one of blobs."""
    exact, again, found = (
        read_picture(path)[:, :, :3] for path in (kept / "truth.png", kept / "again.png", folder / "refined.png")
    )
    mask = (np.load(kept / "covered.npy") > COVERED) | (covered > COVERED)
    error, noise = flip_map(exact, found), flip_map(exact, again)
    bright, dark = blobs(luma(exact), luma(found), mask)
    noisy = blobs(luma(exact), luma(again), mask)
    megapixels = mask.sum() / 1e6
    shown = np.repeat(np.minimum(error, 1.0)[:, :, None], 3, axis=2)
    marks = 0.35 * np.repeat(luma(exact)[:, :, None], 3, axis=2)
    marks[bright], marks[dark] = (1.0, 0.3, 0.1), (0.1, 0.4, 1.0)
    save_picture(folder / "sheet.png", np.concatenate([exact, found, shown], axis=1))
    save_picture(folder / "blobs.png", np.concatenate([found, marks], axis=1))
    flip, flip_noise = float(error[mask].mean()), float(noise[mask].mean())
    return {
        "flip": flip,
        "noise": flip_noise,
        "flip_over_noise": flip - flip_noise,
        "color": color_error(exact, found, mask),
        "color_noise": color_error(exact, again, mask),
        "blobs": float((bright.sum() + dark.sum()) / megapixels),
        "blobs_bright": float(bright.sum() / megapixels),
        "blobs_dark": float(dark.sum() / megapixels),
        "blobs_noise": float(sum(one.sum() for one in noisy) / megapixels),
        "covered": float(mask.mean()),
    }


def _show(folder: Path, path: Path) -> None:
    """Truth and refined of all windows of full HD, one below the other."""
    rows = []
    for found in sorted(folder.glob("*-window-*/sheet.png")):
        picture = read_picture(found)[:, :, :3]
        rows.append(picture[:, : picture.shape[1] * 2 // 3])
    if not rows:
        raise SystemExit("No windows there: run exact with --size 1920x1080 --window 640x360 first")
    save_picture(path, np.concatenate(rows))


def _sides(scene: bpy.types.Scene, folder: Path) -> dict[str, float]:
    """Sides in pixels of the faces of results that the centers of pixels see; `sums_of_sides`.

    Cycles draws each face in its own root of area, with one ray through the middle of each pixel. Independent of the
    engine: nothing but the meshes counts.
    """
    for obj in _made(scene):
        if obj.type == 'MESH' and len(obj.data.polygons):
            _mark(obj.data, str(obj.get(KIND, "")))
    seen = _seen(scene, folder / "sides.exr", _side_material())
    side, kind, depth = seen[:, :, 0], np.round(seen[:, :, 1]).astype(int), np.maximum(seen[:, :, 2], 1e-6)
    corners = np.array(scene.camera.data.view_frame(scene=scene))
    across = np.ptp(corners[:, 0] / -corners[:, 2]) / scene.render.resolution_x
    return sums_of_sides(side / (depth * across), kind)


def _mark(mesh: bpy.types.Mesh, kind: str) -> None:
    """Write the roots of the areas of a mesh's faces and their kinds as its attributes."""
    position = np.zeros((len(mesh.vertices), 3), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", position.ravel())
    corners, starts, totals = (np.zeros(n, np.int32) for n in (len(mesh.loops), len(mesh.polygons), len(mesh.polygons)))
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("loop_total", totals)
    kinds = np.full(len(totals), KINDS.index(kind) if kind in KINDS else 0, np.float32)
    if kind == "bark":
        kinds[totals == 3] = KINDS.index("triangle")
    for name, values in ((_SIDE, np.sqrt(polygon_areas(position, corners, starts, totals))), (_KIND, kinds)):
        mesh.attributes.new(name, 'FLOAT', 'FACE').data.foreach_set("value", values.astype(np.float32))
    mesh.update()


def _side_material() -> bpy.types.Material:
    """Emits side, kind and depth, meters."""
    material = bpy.data.materials.new("Sides")
    stage.cleared(material)
    tree = material.node_tree
    new, link = tree.nodes.new, tree.links.new
    packed, emitted, out = new("ShaderNodeCombineXYZ"), new("ShaderNodeEmission"), new("ShaderNodeOutputMaterial")
    for name, socket in ((_SIDE, "X"), (_KIND, "Y")):
        link(_attribute(tree, name), packed.inputs[socket])
    link(new("ShaderNodeCameraData").outputs["View Z Depth"], packed.inputs["Z"])
    link(packed.outputs[0], emitted.inputs["Color"])
    link(emitted.outputs[0], out.inputs["Surface"])
    return material


def _attribute(tree: bpy.types.NodeTree, name: str) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = name
    return node.outputs["Fac"]


def _seen(scene: bpy.types.Scene, path: Path, material: bpy.types.Material) -> NDArray[np.float32]:
    """What is emitted to the center of each pixel (height, width, 3), if everything were of a material."""
    layer, settings = bpy.context.view_layer, scene.render
    with changed(
        (layer, "material_override", material),
        (settings, "film_transparent", True),
        (scene.cycles, "pixel_filter_type", 'BOX'),
        (scene.cycles, "filter_width", 0.01),
        (scene.cycles, "max_bounces", 0),
    ):
        set_format(settings.image_settings, 'OPEN_EXR')
        settings.image_settings.color_depth = '32'
        render(scene, path, 1, form='OPEN_EXR')
    return read_picture(path)[:, :, :3]


def measure(
    wood: dict, what: str, folder: str, kept: str, settings: list, compare: bool, render: bool, quality: str
) -> dict[str, Any]:
    """Make the picture that is asked for in an empty file; its figures."""
    spec, scene, own = Spec(**wood), bpy.context.scene, Path(folder)
    own.mkdir(parents=True, exist_ok=True)
    if what == "biome":
        return biome(scene, spec, own, quality)
    figures: dict[str, Any] = {"planted": build(scene, spec)}
    for name, value in settings:
        forest.set_named(scene.tetflora, name, value)
    bpy.context.view_layer.update()
    if what == "truth":
        return figures | truth(scene, spec, Path(kept))
    if what == "check":
        return figures | checked(scene, spec, own)
    return figures | refined(scene, spec, own, Path(kept), compare, render)
