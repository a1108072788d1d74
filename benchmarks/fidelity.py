# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How far proxies are from the plants: species × height × light × engine × form, refined against fully expanded.

    python -m benchmarks fidelity [--quick]                   # everything, with targets
    python -m benchmarks fidelity --heights 50 --lights side --engines cycles --forms MICROSURFACES
    python -m benchmarks fidelity --keep --heights 200        # beside what earlier runs left, figures of all together
    python -m benchmarks fidelity --sheet                     # docs/images/fidelity.jpg of the last run

Images, ``frames.json`` (written as it goes) and ``figures.json`` are left in ``out/fidelity``. Nothing is denoised.
Targets are those of the form that the extension takes by itself; figures of all forms stand beside them. A frame is one
species in one image. Its pixels are those of its columns in which the expanded plants cover more than a twentieth.
Coverage does not depend on light, so it is measured once for each height, engine and form.

Reduced, since EEVEE on a processor takes seconds for each sample of expanded plants: EEVEE is compared in one light
(two at 50 pixels), one plant of each species, with `EEVEE_SAMPLES`; Cycles renders the same stands for the gap between
both. At 200 pixels Cycles takes 96 samples, where a pixel holds few leaves and is less noisy. From 50 pixels on, other
forms than the default are rendered in two lights; name a form alone to see it in all.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from math import isnan
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from devtools import session
from examples import stands
from examples.paper.pictures import save_sheet
from tetflora_addon.blender import compat

from .pictures import color_error, coverage, flip_map, linear_light, read_picture, render, timed_refine
from .report import ROOT, Targets

#: Left by a run: images and records.
FOLDER = ROOT / "out" / "fidelity"
EEVEE_SAMPLES = 16
#: Plants of each species and samples in Cycles by height.
CYCLES = {12: (4, 256), 50: (1, 384), 200: (1, 96)}
LIGHTS = ("front", "side", "back", "overcast")
EEVEE_LIGHTS = {12: ("side",), 50: ("side", "overcast"), 200: ("side",)}
COVERAGE_SAMPLES = 64
#: Pixels that plants cover by less are not compared.
LEAST_COVERAGE = 0.05
#: From this height on the noise of expanded plants is measured in the first light only, which saves minutes.
LARGE = 200
#: Where forms that are only compared with the default one are rendered in fewer lights.
BRIEF, BRIEF_LIGHTS = 50, ("side", "overcast")
EXPANDED, AGAIN = "EXPANDED", "AGAIN"
#: Width of an image on the sheet, pixels; small images are enlarged by a whole number without smoothing.
SHEET_WIDTH = 340
#: Which rows there are, of those that were rendered: height, light and engine.
SHEET_ROWS = (
    (12, "side", "cycles"),
    (12, "side", "eevee"),
    (50, "side", "cycles"),
    (50, "side", "eevee"),
    (50, "back", "cycles"),
    (50, "overcast", "cycles"),
    (50, "overcast", "eevee"),
    (200, "front", "cycles"),
    (200, "side", "cycles"),
    (200, "side", "eevee"),
)

TARGETS: Targets = {
    "flip_mean": {"max": 0.05},
    "flip_max": {"max": 0.075},
    "dT_max": {"max": 0.01},
    "color_error_mean": {"max": 0.03},
    "engine_gap": {"max": 0.02},
    "frame_time_ratio_max": {"max": 2.0},
}
QUICK_TARGETS: Targets = {
    "flip_mean": {"max": 0.09},
    "flip_max": {"max": 0.14},
    "dT_max": {"max": 0.03},
    "color_error_mean": {"max": 0.06},
}


def options(parser: argparse.ArgumentParser) -> None:
    """What may be asked for beside everything."""
    add = parser.add_argument
    add("--sheet", action="store_true", help="make the contact sheet from pictures that are there")
    add("--keep", action="store_true", help="add to what earlier runs left instead of beginning anew")
    add("--heights", nargs="+", type=int, choices=sorted(CYCLES), default=sorted(CYCLES))
    add("--lights", nargs="+", choices=LIGHTS, default=LIGHTS)
    add("--engines", nargs="+", choices=("cycles", "eevee"), default=("cycles", "eevee"))
    add("--forms", nargs="+", metavar="FORM", help="by default all that the extension has")
    add("--species", nargs="+", metavar="NAME", default=stands.SPECIES, help="by default oak, birch, spruce and aspen")


def run(given: argparse.Namespace) -> dict[str, float] | None:
    """Measure; quick: two species, two heights, side light, Cycles, the default form."""
    if given.sheet:
        make_sheet(FOLDER, ROOT / "docs" / "images" / "fidelity.jpg")
        return None
    every, default = forms()
    if given.quick:
        series = (Series(50, 1, "cycles", 64, ("side",)), Series(12, 2, "cycles", 64, ("side",)))
        return measure(series, (default,), ("oak", "birch"), default)
    series = series_of(given.heights, given.lights, given.engines)
    return measure(series, tuple(given.forms or every), tuple(given.species), default, given.keep)


def series_of(heights: Sequence[int], lights: Sequence[str], engines: Sequence[str]) -> tuple[Series, ...]:
    """Series of images of the full bench, of these heights, lights and engines."""
    series = []
    for pixels in heights:
        each, samples = CYCLES[pixels]
        few = tuple(light for light in EEVEE_LIGHTS[pixels] if light in lights)
        if "cycles" in engines:
            series.append(Series(pixels, each, "cycles", samples, tuple(lights)))
        if "eevee" in engines and few:
            series.append(Series(pixels, 1, "eevee", EEVEE_SAMPLES, few))
            if "cycles" in engines and each != 1:
                series.append(Series(pixels, 1, "cycles", samples, few))
    return tuple(series)


def measure(
    series: tuple[Series, ...], chosen: tuple[str, ...], species: tuple[str, ...], default: str, keep: bool = False
) -> dict[str, float]:
    """Figures of all frames; keep: together with those that earlier runs left."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    written = FOLDER / "frames.json"
    left = json.loads(written.read_text()) if keep and written.exists() else []
    done = {_key(frame): frame for frame in (Frame(**one) for one in left)}
    brief = tuple(form for form in chosen if form != default and len(chosen) > 1)
    for frame in frames(series, chosen, species, FOLDER, brief):
        done[_key(frame)] = frame
        print(line(frame), flush=True)
        written.write_text(json.dumps([asdict(f) for f in done.values()], indent=1) + "\n")
    figures = sums(tuple(done.values()), default)
    (FOLDER / "figures.json").write_text(json.dumps(figures, indent=1) + "\n")
    return figures


def _key(frame: Frame) -> tuple:
    return frame.pixels, frame.each, frame.light, frame.engine, frame.form, frame.species


def line(frame: Frame) -> str:
    """A frame in a line."""
    return (
        f"{frame.pixels:4d} px {frame.light:9s}{frame.engine:7s}{frame.form:14s}{frame.species:8s}"
        f"FLIP {frame.flip:.3f} (noise {frame.noise:.3f})  dT {frame.dT:+.4f}  color {frame.color:.3f} "
        f"({frame.brightness:+.3f})  gap {frame.gap:.3f} ({frame.gap_expanded:.3f})  "
        f"{frame.seconds:.1f} of {frame.expanded_seconds:.1f} s  {frame.memory_mb:.0f} of {frame.expanded_mb:.0f} MB"
    )


@dataclass(frozen=True)
class Series:
    """Images of one stand in one engine.

    Attributes
    ----------
    pixels : int
        Height of the plants in the image.
    each : int
        Plants of each species.
    engine : str
        ``cycles`` or ``eevee``.
    samples : int
    lights : tuple of str
        Out of `stands.LIGHTS`.
    """

    pixels: int
    each: int
    engine: str
    samples: int
    lights: tuple[str, ...]


@dataclass(frozen=True)
class Frame:
    """One species in one image, proxies in one form against plants fully expanded.

    Attributes
    ----------
    pixels, each, light, engine, form, species
        Which frame this is.
    flip, noise : float
        Mean FLIP of the form, and of the expanded plants with another seed; NaN where that was not rendered (EEVEE has
        no seeds).
    dT : float
        Mean difference of transmittance, form less expanded.
    color, brightness : float
        Difference of the mean colors relative to the expanded plants' mean, and of luminance with its sign.
    gap, gap_expanded : float
        FLIP between this image and that of the other engine, and between those of the expanded plants; NaN where
        the other engine has none.
    seconds, expanded_seconds : float
        Rendering of the whole image, synchronisation included.
    memory_mb, expanded_mb : float
        Megabytes of the meshes of the whole image (`Statistics.memory_mb`).
    """

    pixels: int
    each: int
    light: str
    engine: str
    form: str
    species: str
    flip: float
    noise: float
    dT: float  # noqa: N815  (the figure's name)
    color: float
    brightness: float
    gap: float
    gap_expanded: float
    seconds: float
    expanded_seconds: float
    memory_mb: float
    expanded_mb: float


def forms() -> tuple[tuple[str, ...], str]:
    """All forms of proxies that the extension has, and the one that it takes by itself."""
    choice = bpy.context.scene.tetflora.bl_rna.properties["proxy_kind"]
    return tuple(choice.enum_items.keys()), choice.default


def picture_path(folder: Path, pixels: int, each: int, light: str, engine: str, form: str) -> Path:
    """Where `frames` leaves an image."""
    return folder / f"{pixels}px-{each}-{light}-{engine}-{form.lower()}.png"


def frames(
    series: tuple[Series, ...],
    chosen: tuple[str, ...],
    species: tuple[str, ...],
    folder: Path,
    brief: tuple[str, ...] = (),
) -> Iterator[Frame]:
    """Render and compare, stand by stand; what was compared comes at once.

    Parameters
    ----------
    series : tuple of Series
        Those of the same height and number share a stand.
    chosen : tuple of str
        Forms of proxies.
    species : tuple of str
    folder : Path
        Images are left here.
    brief : tuple of str
        Forms that are rendered in the `BRIEF_LIGHTS` only, from `BRIEF` pixels on.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for pixels, each in dict.fromkeys((s.pixels, s.each) for s in series):
        yield from _Stand(pixels, each, species, folder).compare(
            [s for s in series if (s.pixels, s.each) == (pixels, each)], chosen, brief
        )


class _Stand:
    """A scene of one height and number of plants, and what is known of its expanded plants."""

    def __init__(self, pixels: int, each: int, species: tuple[str, ...], folder: Path) -> None:
        session.clean_file()
        built = stands.build(bpy.context.scene, pixels, "overcast", each, species)
        self.scene, self.columns = built.scene, built.columns
        self.pixels, self.each, self.folder = pixels, each, folder
        self.scene.cycles.transparent_max_bounces = 256  # two hits a shell
        self.seconds: dict[tuple[str, str, str], float] = {}

    def compare(self, series: list[Series], chosen: tuple[str, ...], brief: tuple[str, ...]) -> Iterator[Frame]:
        """All frames of the stand; the expanded plants are there only until their images are."""
        statistics, _ = timed_refine(self.scene, expand_everything=True)
        self.expanded_mb, self.memory_mb = statistics.memory_mb, {}
        covered = coverage(self.scene, self.folder / "coverage.png", COVERAGE_SAMPLES)
        self.mask = covered > LEAST_COVERAGE
        for one in series:
            for number, light in enumerate(one.lights):
                self._render(one, light, EXPANDED, 0)
                if one.engine == "cycles" and (number == 0 or self.pixels < LARGE):
                    self._render(one, light, AGAIN, 1)
        few = brief if self.pixels >= BRIEF else ()
        lights = {
            (one, form): [light for light in one.lights if form not in few or light in BRIEF_LIGHTS]
            for one in series
            for form in chosen
        }
        for form in chosen:
            bare: dict[str, NDArray] = {}
            for number, one in enumerate(series):
                # What size spheres have depends on the engine; all other forms are the same in both.
                if number == 0 or form == 'MICROSPHERES':
                    self.scene.render.engine = _identifier(one.engine)
                    statistics, _ = timed_refine(self.scene, expand_everything=False, proxy_kind=form)
                    self.memory_mb[form] = statistics.memory_mb
                samples = min(one.samples, COVERAGE_SAMPLES) if one.engine == "eevee" else COVERAGE_SAMPLES
                alpha = coverage(self.scene, self.folder / "coverage.png", samples, _identifier(one.engine))
                bare[one.engine] = covered - alpha
                for light in lights[one, form]:
                    self._render(one, light, form, 2)
            for one in series:
                for light in lights[one, form]:
                    yield from self._frames(one, light, form, bare[one.engine])

    def _path(self, light: str, engine: str, form: str) -> Path:
        return picture_path(self.folder, self.pixels, self.each, light, engine, form)

    def _render(self, series: Series, light: str, form: str, seed: int) -> None:
        stands.set_light(self.scene, light)
        path = self._path(light, series.engine, form)
        start = time.perf_counter()
        render(self.scene, path, series.samples, seed, _identifier(series.engine))
        self.seconds[light, series.engine, form] = seconds = time.perf_counter() - start
        print(f"  rendered {path.stem}: {seconds:.1f} s", flush=True)

    def _frames(self, series: Series, light: str, form: str, bare: NDArray) -> Iterator[Frame]:
        engine, other = series.engine, "eevee" if series.engine == "cycles" else "cycles"
        pictures = {
            (e, f): read_picture(self._path(light, e, f))[:, :, :3]
            for e in (engine, other)
            for f in (EXPANDED, AGAIN, form)
            if (light, e, f) in self.seconds
        }
        maps = {
            name: flip_map(pictures[a], pictures[b]) if a in pictures and b in pictures else None
            for name, a, b in (
                ("flip", (engine, EXPANDED), (engine, form)),
                ("noise", (engine, EXPANDED), (engine, AGAIN)),
                ("gap", ("cycles", form), ("eevee", form)),
                ("gap_expanded", ("cycles", EXPANDED), ("eevee", EXPANDED)),
            )
        }
        for species, columns in self.columns.items():
            mask = np.zeros_like(self.mask)
            mask[:, columns] = self.mask[:, columns]
            means = {name: float("nan") if error is None else float(error[mask].mean()) for name, error in maps.items()}
            expanded, proxies = pictures[engine, EXPANDED], pictures[engine, form]
            light_of = [linear_light(p[mask]).mean(axis=0) @ [0.2126, 0.7152, 0.0722] for p in (expanded, proxies)]
            yield Frame(
                self.pixels,
                self.each,
                light,
                engine,
                form,
                species,
                dT=float(bare[mask].mean()),
                color=color_error(expanded, proxies, mask),
                brightness=float(light_of[1] / light_of[0] - 1.0),
                seconds=self.seconds[light, engine, form],
                expanded_seconds=self.seconds[light, engine, EXPANDED],
                memory_mb=self.memory_mb[form],
                expanded_mb=self.expanded_mb,
                **means,
            )


def _identifier(engine: str) -> str:
    return 'CYCLES' if engine == "cycles" else compat.eevee_engine()


def sums(frames: Sequence[Frame], default: str) -> dict[str, float]:
    """Means and worst of frames.

    Parameters
    ----------
    frames : sequence of Frame
        All that were measured.
    default : str
        The form whose figures have no suffix; those of a form and engine end in ``_shells_cycles`` and the like.

    Returns
    -------
    dict of str to float
        ``engine_gap`` is of the worst image: FLIP between both engines of proxies less that of the expanded plants,
        mean over its species. It is missing where no image was rendered in both.
    """
    figures = _sums([f for f in frames if f.form == default], "")
    for form, engine in dict.fromkeys((f.form, f.engine) for f in frames):
        chosen = [f for f in frames if (f.form, f.engine) == (form, engine)]
        figures |= _sums(chosen, f"_{form.lower()}_{engine}")
    return figures


def _sums(frames: Sequence[Frame], suffix: str) -> dict[str, float]:
    if not frames:
        return {}
    noise = [f.noise for f in frames if not isnan(f.noise)]
    figures = {
        "flip_mean": np.mean([f.flip for f in frames]),
        "flip_max": max(f.flip for f in frames),
        "flip_noise": np.mean(noise) if noise else None,
        "dT_max": max(abs(f.dT) for f in frames),
        "color_error_mean": np.mean([f.color for f in frames]),
        "brightness_mean": np.mean([f.brightness for f in frames]),
        "engine_gap": max(_gaps(frames), default=None),
        "frame_time_ratio_max": max(f.seconds / f.expanded_seconds for f in frames),
        "frame_memory_ratio_mean": np.mean([f.memory_mb / f.expanded_mb for f in frames]),
    }
    return {f"{name}{suffix}": float(value) for name, value in figures.items() if value is not None}


def _gaps(frames: Sequence[Frame]) -> list[float]:
    """By image that is there in both engines."""
    pictures: dict[tuple[int, int, str], list[float]] = {}
    for f in frames:
        if not isnan(f.gap):
            pictures.setdefault((f.pixels, f.each, f.light), []).append(f.gap - f.gap_expanded)
    return [float(np.mean(gaps)) for gaps in pictures.values()]


def make_sheet(folder: Path, target: Path) -> None:
    """Write the sheet as a JPEG of at most half a megabyte.

    Parameters
    ----------
    folder : Path
        Of ``frames.json`` and the images that it names.
    target : Path

    Raises
    ------
    FileNotFoundError
        Nothing was rendered yet.
    """
    record = folder / "frames.json"
    if not record.exists():
        raise FileNotFoundError(f"{record} is missing: run python -m benchmarks fidelity first")
    frames = json.loads(record.read_text())
    columns, cells = [EXPANDED, *dict.fromkeys(f["form"] for f in frames)], []
    for pixels, light, engine in SHEET_ROWS:
        here = [f for f in frames if (f["pixels"], f["light"], f["engine"]) == (pixels, light, engine)]
        each = min((f["each"] for f in here), default=0)  # one plant of each species where that was rendered
        name = {"cycles": "Cycles", "eevee": "EEVEE"}[engine]
        for form in columns if here else ():
            flips = [f["flip"] for f in here if (f["form"], f["each"]) == (form, each)]
            label = form.replace("_", " ").capitalize() + (f": FLIP {np.mean(flips):.3f}" if flips else "")
            path = picture_path(folder, pixels, each, light, engine, form)
            picture = _scaled(Image.open(path).convert("RGB")) if path.exists() else None
            first = f"{name}, {pixels} pixels high, {light}: expanded"
            cells.append((picture, first if form == EXPANDED else label))
    target.parent.mkdir(parents=True, exist_ok=True)
    save_sheet(cells, len(columns), target)


def _scaled(picture: Image.Image) -> Image.Image:
    """An image of about `SHEET_WIDTH`: every pixel as a square where it is enlarged, means where it is made smaller."""
    factor = SHEET_WIDTH // picture.width
    if factor >= 1:
        return picture.resize((picture.width * factor, picture.height * factor), Image.Resampling.NEAREST)
    return picture.resize((SHEET_WIDTH, round(picture.height * SHEET_WIDTH / picture.width)), Image.Resampling.BOX)
