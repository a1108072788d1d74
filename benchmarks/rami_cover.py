# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of the ground RAMI-V's abstract canopies cover from above: proxies, discrete leaves, formula, published.

``python -m benchmarks.rami_cover`` prints a row for each canopy, form and size; sizes are pixels for each meter, which
is also a crown. What was measured stays in ``out/rami``.
"""

# ruff: noqa: E402  (run as a program, it starts Blender before it imports what needs Blender)
from __future__ import annotations

import argparse
import sys
from math import ceil

from devtools import session

session.start()

import bpy
import numpy as np

from examples import rami, rami_species
from examples.rami_discs import COVERS, Canopy, canopy, data

from .rami_measure import EXPANDED, FOLDER, FORMS, Measured, expanded
from .row80 import timed_refine

SIZES = (1, 2, 8, 32)
_RAYS = 600_000


def run(quick: bool) -> dict[str, float]:
    """The worst difference of a form from expanded plants, and all covers."""
    figures: dict[str, float] = {"cover_error": 0.0}
    for name in COVERS[:2] if quick else COVERS:
        truth = cover(name, EXPANDED, 0)
        figures[f"cover_{name}"] = truth
        figures[f"cover_expected_{name}"] = canopy(name).expected_cover
        figures[f"cover_published_{name}"] = published_cover(name)
        for form in FORMS:
            for size in SIZES[1:2] if quick else SIZES:
                found = cover(name, form, size)
                figures[f"cover_{form.lower()}_{name}_{size}"] = found
                figures["cover_error"] = max(figures["cover_error"], abs(found - truth))
    return figures


def published_cover(name: str) -> float:
    """RAMI-V's own."""
    return next(value for key, value in data()["cover_nadir"].items() if key.startswith(name))


def cover(name: str, form: str, size: int, again: bool = False) -> float:
    """Share of the ground that is covered at nadir.

    Parameters
    ----------
    name : str
        One of `COVERS`.
    form : str
        `EXPANDED` or one of `FORMS`.
    size : int
        Pixels a meter; does not count for expanded plants.
    again : bool
        Measure what is known already.
    """
    found = Measured(name)
    row = found.get(form, size, 0.0, 0)
    if row is None or again:
        row = {"cover": _measured(canopy(name), form, size)}
        found.put(form, size, 0.0, 0, row)
    return row["cover"]


def _measured(stand: Canopy, form: str, size: int) -> float:
    session.clean_file()
    scene = bpy.context.scene
    rami.build(scene, stand, plants=False)
    scene.tetflora.refine_at_render = False
    rami.set_view(scene, stand, 0.0, round(stand.side * (size or SIZES[-1])))
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
    alpha = rami.radiance(scene, FOLDER / "cover.exr", ceil(_RAYS / rays))[:, :, 3]
    return round(float(alpha.mean(dtype=np.float64)), 5)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", choices=COVERS, nargs="+", default=COVERS)
    parser.add_argument("--form", choices=FORMS, nargs="+", default=FORMS)
    parser.add_argument("--pixels", type=int, nargs="+", default=SIZES, help="pixels a meter")
    parser.add_argument("--again", action="store_true", help="measure what is known, too")
    given = parser.parse_args()
    for name in given.scene:
        truth = cover(name, EXPANDED, 0, given.again)
        print(
            f"{name} expanded {truth:.4f}, formula {canopy(name).expected_cover:.4f}, "
            f"published {published_cover(name):.3f}",
            flush=True,
        )
        for form in given.form:
            for size in given.pixels:
                found = cover(name, form, size, given.again)
                print(f"{name} {form} {size} px: {found:.4f} {found - truth:+.4f}", flush=True)
    session.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
