# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A wood beside its truth: refined against the same plants expanded, in the same light, with the same samples.

    python -m benchmarks exact [--quick]           # everything, with targets
    python -m benchmarks.exact --cases edge --species birch,spruce --size 960x540 --samples 16
    python -m benchmarks.exact --cases eye --seasons summer bare snow --set max_memory=2
    python -m benchmarks.exact --cases edge --size 1920x1080 --window 640x360

Plants have one of `SEEDS` seeds a species, by their places, so that the truth is so many expanded meshes a species as
instances. Each picture is made in a process of its own, so that the largest memory is its own. Truths are kept in
``out/exact/truth`` by a digest of all that they follow from. Nothing is denoised. Needles are many: the truth of eight
spruces takes some 12 GB, that of two (``--seeds 2``) 3.7 GB; facets of equal plants may differ in size (`equal_seeds`).

Beside the figures, ``out/exact`` gets ``sheet.png`` (truth, refined, FLIP) and ``blobs.png`` (refined; blobs that are
too bright in orange and too dark in blue) for each case.

- ``flip_over_noise``: mean FLIP over the pixels of plants, less that of the truth to itself with another noise seed.
- ``color``: difference of the mean linear colors of plants, relative to the truth's.
- ``blobs``: pixels of a million of plants' pixels, of which the mean luma of 3 × 3 is off by more than `OFF`.
- ``facet_px``: mean side (root of the area) in pixels of the faces that the middles of pixels see: of proxies, and of
  twigs that are triangles. Leaves, blossoms and tubes have figures of their own (`sums_of_sides`).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devtools import session

from . import forest
from .report import ROOT, Targets

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
    "benchmarks/exact_scene.py",
    "benchmarks/forest_scene.py",
    "benchmarks/forest_instances.py",
)
#: Woods that are timed at full HD, as in `forest`, and qualities from fine to coarse.
TIMED = ("birch", "spruce", "bamboo", "mix")
QUALITIES = ("FINAL", "PREVIEW", "DRAFT")
_LONGEST = 3600  # seconds of one process

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
    """What a process of its own prints."""
    asked = asdict(spec) | {"what": what, "folder": str(folder), "kept": str(kept), "set": list(settings)}
    asked |= {"compare": compare, "render": render, "quality": quality}
    command = [sys.executable, "-m", "benchmarks.exact", "--one", json.dumps(asked)]
    own = os.environ | ({"TETFLORA_THREADS": str(threads)} if threads else {})
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=_LONGEST, check=False, env=own)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not lines:
        raise RuntimeError(f"{what} of {spec.name} failed with {done.returncode}:\n{done.stderr[-3000:]}")
    return json.loads(lines[-1])


def run(quick: bool) -> dict[str, float]:
    """Measure everything; quick: the edge in summer and in winter, in a small image, with two seeds."""
    if quick:
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
    from . import forest_sums  # imports Blender

    figures: dict[str, float] = {}
    ours, theirs = {}, {}
    for name in TIMED:
        ours[name], theirs[name] = (
            forest.measured(FOLDER / "forest", name, "--what", what, "--samples", str(forest.SAMPLES))
            for what in ("refine", "instances")
        )
        ratios = forest_sums.ratios(ours[name], theirs[name])
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
    for path in sorted((ROOT / "tetflora_addon" / "biomes").glob("*.json")):
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


def _pair(text: str) -> tuple[int, int]:
    width, height = text.lower().split("x")
    return int(width), int(height)


def _species(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


def _setting(text: str) -> tuple[str, str]:
    name, value = text.split("=")
    return name, value


def main() -> int:
    """Measure the cases that are asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.exact", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--one", metavar="JSON", help=argparse.SUPPRESS)
    add("--cases", nargs="+", choices=CASES, default=["edge"])
    add("--seasons", nargs="+", choices=SEASONS, default=["summer"])
    add("--species", nargs="+", type=_species, default=[SPECIES[0]], metavar="NAME,NAME", help="woods of these species")
    add("--size", type=_pair, default=SIZE, metavar="WxH")
    add("--window", type=_pair, default=(), metavar="WxH", help="compare only so much in the middle of the image")
    add("--samples", type=int, default=SAMPLES)
    add("--seeds", type=int, default=SEEDS, help="different plants of each species; 0: all, without a truth")
    add("--distance", type=float, default=Spec.distance, help="between the plants of eye, meters")
    add("--set", type=_setting, nargs="+", default=[], metavar="NAME=VALUE", help="settings of the scene")
    add("--threads", type=int, default=0)
    add("--keep-truth", action=argparse.BooleanOptionalAction, default=True, help="use what an earlier run has left")
    add("--no-render", action="store_true", help="refine and count only")
    add("--out", type=Path, default=FOLDER, metavar="FOLDER", help="for pictures")
    arguments = parser.parse_args()
    if arguments.one:
        session.start()
        from .exact_scene import measure  # after the session has prepared Blender

        print(json.dumps(measure(json.loads(arguments.one))), flush=True)
        return 0
    for spec in _specs(arguments):
        out, settings, threads = arguments.out.resolve(), arguments.set, arguments.threads
        found = measured(
            spec, out, settings, render=not arguments.no_render, keep=arguments.keep_truth, threads=threads
        )
        print(line(found), flush=True)
    return 0


def _specs(arguments: argparse.Namespace) -> Iterator[Spec]:
    for case in arguments.cases:
        for species in arguments.species:
            for season in arguments.seasons:
                yield Spec(
                    case,
                    species,
                    season,
                    arguments.size,
                    arguments.window,
                    arguments.samples,
                    arguments.seeds,
                    arguments.distance,
                )


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
