# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""RAMI's canopies, whose reflectance is published, as TetFlora shows them: a referee that nobody here tuned for.

``python -m benchmarks.rami --scene HET01 --form MICROSURFACES --pixels 8 --views 20`` measures one case. What was
measured stays in ``out/rami`` and is not measured again without ``--again``.
"""

# ruff: noqa: E402  (run as a program, it starts Blender before it imports what needs Blender)
from __future__ import annotations

import argparse
import sys

from devtools import session

session.start()

from examples.rami_discs import CURVES

from .rami_measure import EXPANDED, FORMS, POLYGONS, Measured, errors, measure, views
from .report import Targets

SIZES = (2, 8, 32)
#: Crowns of HET06 are so small beside its side that larger ones make images of twenty million pixels.
LARGEST = {"HET06": 8, "HET04": 8}
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


def run(quick: bool) -> dict[str, float]:
    """The worst over scenes and sizes; ``_own`` compares with TetFlora's own expanded plants instead."""
    from . import rami_cover

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
    return {key: figures.pop(key) for key in TARGETS if key in figures} | rami_cover.run(quick) | figures


def _note(figures: dict[str, float], name: str, form: str, pixels: int, found: dict) -> None:
    figures[f"rms_{form}_{name}_{pixels}"] = found["rms"]
    figures[f"mean_{form}_{name}_{pixels}"] = found["mean"]
    figures[f"rms_{form}"] = max(figures.get(f"rms_{form}", 0.0), found["rms"])
    figures["hotspot_error"] = max(figures.get("hotspot_error", 0.0), found["hotspot"])


def main() -> int:
    """Measure one case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", choices=CURVES, nargs="+", default=CURVES)
    parser.add_argument("--form", choices=(POLYGONS, EXPANDED, *FORMS), nargs="+", default=FORMS)
    parser.add_argument("--pixels", type=int, nargs="+", default=[8], help="width of a crown in the image")
    parser.add_argument("--views", type=int, default=20, help="how many of the 76 view zeniths")
    parser.add_argument("--zenith", type=float, nargs="+", help="these view zeniths instead")
    parser.add_argument("--bounces", type=int, default=-1, help="0 for light that is scattered once, 1 for twice, ...")
    parser.add_argument("--single", action="store_true", help="as --bounces 0")
    parser.add_argument("--again", action="store_true", help="measure what is known, too")
    given = parser.parse_args()
    bounces = 0 if given.single else given.bounces
    for name in given.scene:
        angles = views(name, given.views).tolist() if given.zenith is None else given.zenith
        for form in given.form:
            for pixels in given.pixels if form in FORMS else [0]:
                found = measure(name, form, pixels, angles, bounces, given.again)
                _tell(found, name, form, pixels, bounces)
    session.stop()
    return 0


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


if __name__ == "__main__":
    sys.exit(main())
