# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""RAMI's canopies, whose reflectance is published, as TetFlora shows them: a referee that nobody here tuned for.

    python -m benchmarks rami [--quick]                                                  # everything, with targets
    python -m benchmarks rami --scene HET01 --form MICROSURFACES --pixels 8 --views 20   # one case
    python -m benchmarks rami --draw                                                     # docs/images/rami.png
    python -m benchmarks rami --table                                                    # what was measured

Reflectance factors are measured view by view, in every way that TetFlora shows plants, and beside them how much of the
ground RAMI-V's abstract canopies cover from above; there sizes are pixels for each meter, which is also a crown. What
was measured stays in ``out/rami`` and is not measured again without ``--again``, so that a run goes on where another
was stopped.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from itertools import pairwise, product
from math import ceil, nan
from pathlib import Path
from statistics import median

import bpy
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from devtools import session
from examples import rami, rami_species
from examples.rami_discs import COVERS, CURVES, Canopy, canopy, data, published

from .pictures import timed_refine
from .report import ROOT, Targets, commit, forget_peak, peak_mb

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
#: Pixels of a crown, and of a meter where cover is measured, with rays of each image.
SIZES, COVER_SIZES, _COVER_RAYS = (2, 8, 32), (1, 2, 8, 32), 600_000
#: Crowns of HET06 are so small beside its side that larger ones make images of twenty million pixels.
LARGEST = {"HET06": 8, "HET04": 8}
COLORS = {
    POLYGONS: "black",
    EXPANDED: "tab:gray",
    'MICROSURFACES': "tab:blue",
    'MICROSPHERES': "tab:green",
    'SHELLS': "tab:orange",
    'AUTOMATIC': "tab:red",
}
LABELS = {POLYGONS: "polygons", EXPANDED: "plants, expanded"}

TARGETS: Targets = {
    "rms_expanded": {"max": 0.01},
    "rms_microsurfaces": {"max": 0.03},
    "rms_microspheres": {"max": 0.03},
    "rms_shells": {"max": 0.03},
    "rms_automatic": {"max": 0.02},
    "hotspot_error": {"max": 0.05},
    "cover_error": {"max": 0.004},
}
QUICK_TARGETS: Targets = {"rms_expanded": {"max": 0.015}}


def options(parser: argparse.ArgumentParser) -> None:
    """What may be asked for beside everything."""
    add = parser.add_argument
    add("--scene", choices=CURVES, nargs="+", help="only these")
    add("--form", choices=(POLYGONS, EXPANDED, *FORMS), nargs="+", default=FORMS)
    add("--pixels", type=int, nargs="+", default=[8], help="width of a crown in the image; of --draw by scene")
    add("--views", type=int, default=20, help="how many of the 76 view zeniths")
    add("--zenith", type=float, nargs="+", help="these view zeniths instead")
    add("--bounces", type=int, default=-1, help="0 for light that is scattered once, 1 for twice, ...")
    add("--again", action="store_true", help="measure what is known, too")
    add("--draw", type=Path, nargs="?", const=ROOT / "docs" / "images" / "rami.png", metavar="PATH")
    add("--table", action="store_true", help="print a table of what is known")


def run(given: argparse.Namespace) -> dict[str, float] | None:
    """The worst over scenes and sizes; ``_own`` compares with TetFlora's own expanded plants instead."""
    if given.draw or given.table or given.scene:
        _part(given)
        return None
    quick = given.quick
    figures: dict[str, float] = {}
    for name in ("HET01",) if quick else CURVES:
        expanded = measure(name, POLYGONS, 0, views(name, 7 if quick else 76)).curve(POLYGONS)
        _note(figures, name, "expanded", 0, errors(name, *expanded))
        number = 5 if quick else 20
        own = measure(name, EXPANDED, 0, views(name, number)).curve(EXPANDED)
        for form in FORMS:
            for pixels in (8,) if quick else [p for p in SIZES if p <= LARGEST.get(name, 32)]:
                curve = measure(name, form, pixels, views(name, number)).curve(form, pixels)
                _note(figures, name, form.lower(), pixels, errors(name, *curve))
                figures[f"own_rms_{form.lower()}_{name}_{pixels}"] = errors(name, *curve, own)["rms"]
    return {key: figures.pop(key) for key in TARGETS if key in figures} | covers(quick) | figures


def _note(figures: dict[str, float], name: str, form: str, pixels: int, found: dict) -> None:
    figures[f"rms_{form}_{name}_{pixels}"] = found["rms"]
    figures[f"mean_{form}_{name}_{pixels}"] = found["mean"]
    figures[f"rms_{form}"] = max(figures.get(f"rms_{form}", 0.0), found["rms"])
    figures["hotspot_error"] = max(figures.get("hotspot_error", 0.0), found["hotspot"])


def _part(given: argparse.Namespace) -> None:
    """Draw, print, or measure some cases."""
    if given.table:
        print(table())
    elif given.draw:
        pixels = given.pixels if len(given.pixels) == len(CURVES) else [8, 8, 2]
        draw(given.draw, dict(zip(CURVES, pixels, strict=True)))
    else:
        for name, form in product(given.scene, given.form):
            angles = views(name, given.views).tolist() if given.zenith is None else given.zenith
            for pixels in given.pixels if form in FORMS else [0]:
                found = measure(name, form, pixels, angles, given.bounces, given.again)
                _tell(found, name, form, pixels, given.bounces)


def _tell(found: Measured, name: str, form: str, pixels: int, bounces: int) -> None:
    """One line with errors against the published curve and against TetFlora's own expanded plants."""
    curve, own = found.curve(form, pixels, bounces), found.curve(EXPANDED, 0, bounces)
    shown = {}
    if bounces < 0:
        shown["published"] = errors(name, *curve)
    if len(own[0]):
        shown["expanded"] = errors(name, *curve, own)
    for against, error in shown.items():
        print(
            f"{name} {form} {pixels} px against {against}: rms {error['rms']:.4f}, mean {error['mean']:+.4f}, "
            f"hotspot {error['hotspot']:.4f} ({len(curve[0])} views)",
            flush=True,
        )


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


def covers(quick: bool) -> dict[str, float]:
    """The worst difference of a form from expanded plants, and all covers."""
    figures: dict[str, float] = {"cover_error": 0.0}
    for name in COVERS[:2] if quick else COVERS:
        truth = cover(name, EXPANDED, 0)
        figures[f"cover_{name}"] = truth
        figures[f"cover_expected_{name}"] = canopy(name).expected_cover
        figures[f"cover_published_{name}"] = published_cover(name)
        for form in FORMS:
            for size in COVER_SIZES[1:2] if quick else COVER_SIZES:
                found = cover(name, form, size)
                figures[f"cover_{form.lower()}_{name}_{size}"] = found
                figures["cover_error"] = max(figures["cover_error"], abs(found - truth))
    return figures


def published_cover(name: str) -> float:
    """RAMI-V's own."""
    return next(value for key, value in data()["cover_nadir"].items() if key.startswith(name))


def cover(name: str, form: str, size: int) -> float:
    """Share of the ground that is covered at nadir.

    Parameters
    ----------
    name : str
        One of `COVERS`.
    form : str
        `EXPANDED` or one of `FORMS`.
    size : int
        Pixels a meter; does not count for expanded plants.
    """
    found = Measured(name)
    row = found.get(form, size, 0.0, 0)
    if row is None:
        row = {"cover": _covered(canopy(name), form, size)}
        found.put(form, size, 0.0, 0, row)
    return row["cover"]


def _covered(stand: Canopy, form: str, size: int) -> float:
    session.clean_file()
    scene = bpy.context.scene
    rami.build(scene, stand, plants=False)
    scene.tetflora.refine_at_render = False
    rami.set_view(scene, stand, 0.0, round(stand.side * (size or COVER_SIZES[-1])))
    if form == EXPANDED:
        rami.place(scene, stand, {kind: expanded(scene, stand, kind) for kind in stand.solids})
    else:
        rami_species.add_plants(scene, stand)
        bpy.context.view_layer.update()
        timed_refine(scene, expand_everything=False, proxy_kind=form)
    scene.render.film_transparent = True
    rami.set_bounces(scene, 0)
    rays = scene.render.resolution_x * scene.render.resolution_y
    FOLDER.mkdir(parents=True, exist_ok=True)
    alpha = rami.radiance(scene, FOLDER / "cover.exr", ceil(_COVER_RAYS / rays))[:, :, 3]
    return round(float(alpha.mean(dtype=np.float64)), 5)


def draw(path: Path, pixels: dict[str, int]) -> None:
    """Factors above, differences from the published curve below, a column for each scene; missing curves are left out.

    Parameters
    ----------
    path : Path
    pixels : dict of str to int
        Width of a crown for each scene.
    """
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(
        2, len(CURVES), figsize=(13.5, 6.5), sharex=True, height_ratios=(3, 2), layout="constrained"
    )
    for column, name in enumerate(CURVES):
        angles, known = published(name)
        found = Measured(name)
        above, below = axes[:, column]
        above.plot(angles, known, color="0.75", linewidth=6, label="published (Eradiate)", zorder=0)
        for form in (POLYGONS, EXPANDED, *FORMS):
            at, factors = found.curve(form, pixels[name])
            if not len(at):
                continue
            style = {"color": COLORS[form], "linewidth": 1.1, "marker": "." if form != POLYGONS else "", "ms": 4}
            label = LABELS.get(form, form.lower())
            above.plot(at, factors, label=label, **style)
            below.plot(at, 100 * (factors / np.interp(at, angles, known) - 1), **style)
        below.axhline(0, color="0.75", linewidth=3, zorder=0)
        below.axhspan(-3, 3, color="0.93", zorder=-1)
        below.set_ylim(-12, 12)
        below.set_xlabel("view zenith, degrees (negative: sun's side)")
        above.set_title(f"{name}, {pixels[name]} pixels a crown, sun at {canopy(name).sun_zenith:g}°")
        above.set_ylim(bottom=0)
    axes[0, 0].set_ylabel("bidirectional reflectance factor")
    axes[1, 0].set_ylabel("difference from published, %")
    axes[0, 0].legend(fontsize=8, loc="lower left")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def table() -> str:
    """RMS error, its mean, the worst beside the hotspot (%), seconds and memory of each case, in Markdown."""
    lines = [
        "| scene | as | pixels a crown | views | RMS, % | mean, % | hotspot, % | against our own, RMS % | refine, s "
        "| render, s | process, MB |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name in CURVES:
        found = Measured(name)
        own = found.curve(EXPANDED)
        for form in (POLYGONS, EXPANDED, *FORMS):
            sizes = {int(key.split()[1]) for key in found.rows if key.split()[0] == form and not key.endswith("b0")}
            for size in sorted(sizes):
                at, factors = found.curve(form, size)
                if not len(at):  # only at other zeniths than the published ones
                    continue
                rows = [found.get(form, size, angle, -1) for angle in at.tolist()]
                error, beside = errors(name, at, factors), "–"
                if len(own[0]) and form != EXPANDED:
                    beside = f"{100 * errors(name, at, factors, own)['rms']:.1f}"
                refine, render = (
                    f"{median(row[key] for row in rows):.1f}" if key in rows[0] else "–"
                    for key in ("refine_s", "render_s")
                )
                lines.append(
                    f"| {name} | {LABELS.get(form, form.lower())} | {size or '–'} | {len(at)} "
                    f"| {100 * error['rms']:.1f} | {100 * error['mean']:+.1f} | {100 * error['hotspot']:.1f} "
                    f"| {beside} | {refine} | {render} | {median(row['peak_mb'] for row in rows):,.0f} |"
                )
    return "\n".join(lines)
