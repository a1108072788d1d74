# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stands of plants, refined against fully expanded, image by image: what `fidelity` sums up.

A frame is one species in one image. Its pixels are those of its columns in which the expanded plants cover more than
a twentieth. Coverage does not depend on light, so it is measured once for each height, engine and form.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session
from examples import stands
from tetflora_addon.blender import compat

from .compare import color_error, coverage, flip_map, linear_light, read_picture, render
from .row80 import timed_refine

COVERAGE_SAMPLES = 64
#: Pixels that plants cover by less are not compared.
LEAST_COVERAGE = 0.05
#: From this height on the noise of expanded plants is measured in the first light only, which saves minutes.
LARGE = 200
#: Where forms that are only compared with the default one are rendered in fewer lights.
BRIEF, BRIEF_LIGHTS = 50, ("side", "overcast")
EXPANDED, AGAIN = "EXPANDED", "AGAIN"


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
