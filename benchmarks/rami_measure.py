# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflectance factors of RAMI's scenes, view by view, in every way that TetFlora shows plants; kept as they come.

What was measured is looked up in a file for each scene, so that a run goes on where another was stopped.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from itertools import pairwise
from math import ceil, nan
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session
from examples import rami, rami_species
from examples.rami_discs import Canopy, canopy, published

from .report import ROOT, commit, forget_peak, peak_mb
from .row80 import timed_refine

FOLDER = ROOT / "out" / "rami"
#: Explicit discs, which are not TetFlora's, and TetFlora's plants fully expanded; then its forms of proxies.
POLYGONS, EXPANDED = "POLYGONS", "EXPANDED"
FORMS = ('MICROSURFACES', 'MICROSPHERES', 'SHELLS', 'AUTOMATIC')
#: Rays from the camera for each view: noise of some thousandths.
_RAYS = 100_000
#: Width of images of what does not depend on it.
_WIDTH = 160
#: Copies on each side in which plants are refined: what lies further out reaches the target by several scatterings.
_RINGS = 2
#: Gigabytes that plants and renderer may take.
_MEMORY = 3.0


def views(name: str, number: int) -> NDArray[np.float64]:
    """So many of the published view zeniths: both beside the hotspot, the ends, and denser near the hotspot."""
    angles, _ = published(name)
    if number >= len(angles):
        return angles
    away = np.abs(angles + canopy(name).sun_zenith)
    near = np.argsort(away, kind="stable")[:2]
    chosen = {0, len(angles) - 1, *near.tolist()}
    share = np.cumsum(1 / (6 + away))
    while len(chosen) < number:
        # In the middle of the widest gap.
        taken = sorted(chosen)
        low, high = max(pairwise(taken), key=lambda pair: (pair[1] - pair[0] > 1) * (share[pair[1]] - share[pair[0]]))
        chosen.add(low + 1 + int(np.argmin(np.abs(share[low + 1 : high] - (share[low] + share[high]) / 2))))
    return angles[sorted(chosen)]


class Measured:
    """What is known of a scene, as a file."""

    def __init__(self, name: str, folder: Path = FOLDER) -> None:
        self.path = folder / f"{name}.json"
        self.rows: dict[str, dict] = json.loads(self.path.read_text()) if self.path.exists() else {}

    def get(self, form: str, pixels: int, zenith: float, bounces: int) -> dict | None:
        """What a view gave."""
        return self.rows.get(_key(form, pixels, zenith, bounces))

    def put(self, form: str, pixels: int, zenith: float, bounces: int, row: dict) -> None:
        """Keep what a view gave, at once."""
        # Another process may have measured another form meanwhile.
        if self.path.exists():
            self.rows |= json.loads(self.path.read_text())
        self.rows[_key(form, pixels, zenith, bounces)] = row
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(json.dumps(self.rows, indent=0, sort_keys=True) + "\n")

    def curve(self, form: str, pixels: int = 0, bounces: int = -1) -> tuple[NDArray, NDArray]:
        """View zeniths (v,) that are known, rising, and their factors (v,)."""
        angles, _ = published(self.path.stem)
        rows = [(angle, self.get(form, pixels, angle, bounces)) for angle in angles.tolist()]
        known = [(angle, row["brf"]) for angle, row in rows if row]
        return tuple(np.array(known, np.float64).reshape(-1, 2).T)


def _key(form: str, pixels: int, zenith: float, bounces: int) -> str:
    return f"{form} {0 if form in (POLYGONS, EXPANDED) else pixels} {zenith:g}" + (
        f" b{bounces}" if bounces >= 0 else ""
    )


def errors(name: str, angles: NDArray, factors: NDArray, reference: tuple[NDArray, NDArray] | None = None) -> dict:
    """RMS of relative errors over all published angles, the largest beside the hotspot, and their mean.

    Between the angles that were measured errors are linear, so that it does not matter where these are dense. Of
    another reference than the published one, which need not have all angles, only common ones count.
    """
    at, known = reference or published(name)
    common = np.isin(angles, at)
    if not common.any():
        return dict.fromkeys(("rms", "hotspot", "mean"), nan)
    angles, factors = angles[common], factors[common]
    relative = factors / np.interp(angles, at, known) - 1
    everywhere, _ = published(name)
    inside = everywhere[(everywhere >= angles[0]) & (everywhere <= angles[-1])]
    even = np.interp(inside, angles, relative)
    near = np.argsort(np.abs(angles + canopy(name).sun_zenith), kind="stable")[:2]
    return {
        "rms": float(np.sqrt((even**2).mean())),
        "hotspot": float(np.abs(relative[near]).max()),
        "mean": float(even.mean()),
    }


def measure(
    name: str, form: str, pixels: int, angles: Sequence[float], bounces: int = -1, again: bool = False
) -> Measured:
    """Measure a form at some view zeniths, and keep what each gives.

    Parameters
    ----------
    name : str
        Scene, one of `CURVES`.
    form : str
        `POLYGONS`, `EXPANDED` or one of `FORMS`.
    pixels : int
        Width of the widest crown in the image; polygons do not depend on it.
    angles : sequence of float
        Published view zeniths, degrees.
    bounces : int, optional
        0 for light that is scattered once; by default all.
    again : bool
        Measure what is known already, too.
    """
    found = Measured(name)
    missing = [a for a in angles if again or found.get(form, pixels, a, bounces) is None]
    if not missing:
        return found
    stand = canopy(name)
    scene = _scene(stand, form)
    if bounces >= 0:
        rami.set_bounces(scene, bounces)
    FOLDER.mkdir(parents=True, exist_ok=True)
    for angle in missing:
        row = _view(scene, stand, form, pixels, angle)
        found.put(form, pixels, angle, bounces, row)
        at, known = published(name)
        relative = row["brf"] / np.interp(angle, at, known) - 1
        print(f"  {name} {form} {pixels} px {angle:5.0f}: {row['brf']:.4f} {relative:+.4f}  {row}", flush=True)
    return found


def _scene(stand: Canopy, form: str) -> bpy.types.Scene:
    session.clean_file()
    scene = bpy.context.scene
    rami.build(scene, stand, plants=form == POLYGONS)
    scene.tetflora.refine_at_render = False
    scene.tetflora.max_memory = _MEMORY
    scene.render.use_persistent_data = form in (POLYGONS, EXPANDED)
    if form == EXPANDED:
        rami.place(scene, stand, {kind: expanded(scene, stand, kind) for kind in stand.solids})
    elif form != POLYGONS:
        rami_species.add_plants(scene, stand, min(stand.padding, _RINGS))
    return scene


def expanded(scene: bpy.types.Scene, stand: Canopy, kind: str) -> list[list[bpy.types.Mesh]]:
    """Some of TetFlora's plants of a kind as polygons: of each the meshes."""
    rami.set_view(scene, stand, 0.0, _WIDTH)
    before, individuals = set(scene.objects), []
    for seed in range(rami.VARIANTS):
        plant = rami_species.add_one(scene, stand, kind, seed)
        bpy.context.view_layer.update()
        timed_refine(scene, expand_everything=True)
        rami_species.make_lambertian()
        individuals.append([o.data.copy() for o in scene.objects if o not in before and o.type == 'MESH'])
        bpy.data.objects.remove(plant)
    for one in set(scene.objects) - before:
        bpy.data.objects.remove(one)
    return individuals


def _view(scene: bpy.types.Scene, stand: Canopy, form: str, pixels: int, angle: float) -> dict:
    refined = form in FORMS
    across = max(solid.across for solid in stand.solids.values())
    width = round(stand.side / across * pixels) if refined else _WIDTH
    rami.set_view(scene, stand, angle, width)
    row: dict = {}
    if refined:
        forget_peak()
        bpy.context.view_layer.update()
        statistics, seconds = timed_refine(scene, expand_everything=False, proxy_kind=form)
        rami_species.make_lambertian()
        row |= {"refine_s": round(seconds, 2), "facets": statistics.polygons_proxy, "real": statistics.polygons_meshed}
    samples = ceil(_RAYS / (scene.render.resolution_x * scene.render.resolution_y))
    start = time.perf_counter()
    pixels_of = rami.radiance(scene, FOLDER / "view.exr", samples)
    row |= {"render_s": round(time.perf_counter() - start, 2), "peak_mb": round(peak_mb())}
    return {"brf": round(rami.reflectance_factor(pixels_of, stand), 5), **row, "commit": commit()}
