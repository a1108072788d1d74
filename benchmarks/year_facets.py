# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mean color and opacity of proxies against fully expanded plants, at ten days and five ages.

Plants of one species stand in a row, some of each age, all as high in the image, before nothing: the film is
transparent. They are expanded once a day, and refined at each height in pixels. The opacity's error is the difference
of what both cover, over the area of the silhouette; the color's is the largest difference of a channel between mean
radiances of what is covered, in linear light of which a white sheet that faces the sun has about 1.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import pi, radians, tan
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session
from examples import stands
from tetflora_addon.compiled.crowns import crown_of
from tetflora_addon.species import ages, catalog

from .compare import read_picture, render
from .fidelity_frames import LEAST_COVERAGE
from .row80 import timed_refine
from .year_scene import add_plant, set_day

SPECIES = ("birch", "oak", "spruce")
DAYS = (20.0, 110.0, 118.0, 126.0, 140.0, 196.0, 268.0, 285.0, 298.0, 315.0)
#: 0 is full-grown.
AGES = (4.0, 9.0, 16.0, 25.0, 0.0)
HEIGHTS = (12, 50, 200)
#: Plants of each age, and samples for a height of 50 pixels; as many for each area of the image.
EACH, SAMPLES = 2, 48
_COMPARED = 50
_VIEW = radians(30.0)
_HEIGHT = 12.0


@dataclass(frozen=True)
class Compared:
    """Plants of a species of one age, on a day, at a height in pixels.

    Attributes
    ----------
    species, day, age, pixels
        Which plants.
    opacity, expanded_opacity : float
        What refined and expanded plants cover, over the area of the silhouette.
    color, expanded_color : tuple of float
        Mean linear radiance of what is covered.
    """

    species: str
    day: float
    age: float
    pixels: int
    opacity: float
    expanded_opacity: float
    color: tuple[float, float, float]
    expanded_color: tuple[float, float, float]

    @property
    def opacity_error(self) -> float:
        """With its sign: refined less expanded."""
        return self.opacity - self.expanded_opacity

    @property
    def color_error(self) -> float:
        """The largest of the channels."""
        return float(np.abs(np.subtract(self.color, self.expanded_color)).max())


def run(
    folder: Path,
    species: tuple[str, ...] = SPECIES,
    days: tuple[float, ...] = DAYS,
    heights: tuple[int, ...] = HEIGHTS,
    samples: int = SAMPLES,
    until: float = float("inf"),
) -> dict[str, float] | None:
    """Compare and sum up; what the record in the folder has already is not made again. None as in `year_frames.run`."""
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "facets.json"
    found = [Compared(**one) for one in json.loads(record.read_text())] if record.exists() else []
    for name in species:
        missing = [day for day in days if not any((one.species, one.day) == (name, day) for one in found)]
        if not missing:
            continue
        session.clean_file()
        row(bpy.context.scene, name)
        for day in missing:
            if time.monotonic() > until:
                return None
            found += compare(bpy.context.scene, folder, name, day, heights, samples)
            record.write_text(json.dumps([asdict(one) for one in found], indent=1) + "\n")
    return figures(found)


def row(scene: bpy.types.Scene, species: str) -> None:
    """Fill an empty scene with plants of all ages side by side, each as high as the others."""
    loaded = catalog.load_species(species)
    crowns = [crown_of(ages.with_age(loaded, age) if age else loaded) for age in AGES]
    slot = _HEIGHT * max(0.85, max(2.3 * crown.radius / crown.height for crown in crowns))
    width = slot * EACH * len(AGES)
    for a, (age, crown) in enumerate(zip(AGES, crowns, strict=True)):
        for i in range(EACH):
            x = (a * EACH + i + 0.5) * slot - width / 2
            add_plant(scene, species, 100 * a + i, (x, 0.0, 0.0), _HEIGHT / crown.height, age)
    stands.set_light(scene, "side")
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    distance = width / 2 / tan(_VIEW / 2)
    camera.data.angle, camera.data.clip_end = _VIEW, 10.0 * distance
    camera.location, camera.rotation_euler = (0.0, -distance, 0.5 * _HEIGHT), (pi / 2, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene["width"] = width
    scene.view_settings.view_transform = 'Standard'
    scene.render.film_transparent = True
    scene.render.image_settings.color_mode = 'RGBA'
    scene.cycles.transparent_max_bounces = 256
    scene.tetflora.refine_at_render = False


def compare(
    scene: bpy.types.Scene, folder: Path, species: str, day: float, heights: tuple[int, ...], samples: int
) -> Iterator[Compared]:
    """The plants of all ages on a day, at each height."""
    set_day(scene, day)
    _frame(scene, _COMPARED)
    timed_refine(scene, expand_everything=True)
    whole = _columns(_picture(scene, folder, samples))
    silhouette = [float((one[:, :, 3] > LEAST_COVERAGE).mean()) for one in whole]
    for pixels in heights:
        _frame(scene, pixels)
        timed_refine(scene, expand_everything=False)
        drawn = _columns(_picture(scene, folder, max(2, round(samples * (_COMPARED / pixels) ** 2))))
        for age, a, b, area in zip(AGES, drawn, whole, silhouette, strict=True):
            both = [_means(one, area) for one in (a, b)]
            one = Compared(species, day, age, pixels, both[0][0], both[1][0], both[0][1], both[1][1])
            print(
                f"  {species} day {day:g} age {age:g} {pixels} px: opacity {one.expanded_opacity:.3f} "
                f"{one.opacity_error:+.4f} color {np.round(one.expanded_color, 3)} "
                f"{np.round(np.subtract(one.color, one.expanded_color), 4)}",
                flush=True,
            )
            yield one


def figures(found: list[Compared]) -> dict[str, float]:
    """Worst and means of all, by height, by age and by day."""
    out: dict[str, float] = {"facets_compared": len(found)} | _sums(found, "")
    for field, unit in (("pixels", "px"), ("age", "years"), ("day", "day"), ("species", "")):
        for value in dict.fromkeys(getattr(one, field) for one in found):
            own = [one for one in found if getattr(one, field) == value]
            shown = f"{value:g}" if isinstance(value, int | float) else value
            out |= _sums(own, f"_{unit}_{shown}" if unit else f"_{shown}")
    return out


def _sums(found: list[Compared], suffix: str) -> dict[str, float]:
    opacity, color = [abs(one.opacity_error) for one in found], [one.color_error for one in found]
    return {
        f"opacity_error_max{suffix}": max(opacity),
        f"opacity_error_mean{suffix}": float(np.mean(opacity)),
        f"opacity_bias{suffix}": float(np.mean([one.opacity_error for one in found])),
        f"color_error_max{suffix}": max(color),
        f"color_error_mean{suffix}": float(np.mean(color)),
    }


def _frame(scene: bpy.types.Scene, pixels: int) -> None:
    scale = pixels / _HEIGHT
    scene.render.resolution_x = round(scene["width"] * scale / len(AGES)) * len(AGES)
    scene.render.resolution_y = round(1.5 * _HEIGHT * scale)
    scene.render.resolution_percentage = 100


def _picture(scene: bpy.types.Scene, folder: Path, samples: int) -> NDArray[np.float32]:
    path = folder / "facets.exr"
    render(scene, path, samples, form='OPEN_EXR')
    return read_picture(path)


def _columns(picture: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    return np.split(picture, len(AGES), axis=1)


def _means(picture: NDArray[np.float32], area: float) -> tuple[float, tuple[float, float, float]]:
    """What plants cover over the area of the silhouette, and their mean color; colors come premultiplied."""
    covered = picture[:, :, 3].mean(dtype=float)
    color = picture[:, :, :3].mean(axis=(0, 1), dtype=float) / max(covered, 1e-9)
    return float(covered / max(area, 1e-9)), tuple(color.tolist())
