# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What was measured of RAMI's scenes, drawn over the published curves and as a table.

``python -m benchmarks.rami_figure`` draws, ``python -m benchmarks.rami_figure --table`` prints.
"""

# ruff: noqa: E402  (run as a program, it starts Blender before it imports what needs Blender)
from __future__ import annotations

import argparse
import sys
from pathlib import Path
from statistics import median

from devtools import session

session.start()

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from numpy import interp

from examples.rami_discs import CURVES, canopy, published

from .rami_measure import EXPANDED, FORMS, POLYGONS, Measured, errors
from .report import ROOT

COLORS = {
    POLYGONS: "black",
    EXPANDED: "tab:gray",
    'MICROSURFACES': "tab:blue",
    'MICROSPHERES': "tab:green",
    'SHELLS': "tab:orange",
    'AUTOMATIC': "tab:red",
}
LABELS = {POLYGONS: "polygons", EXPANDED: "plants, expanded"}


def draw(path: Path, pixels: dict[str, int]) -> None:
    """Factors above, differences from the published curve below, a column for each scene; missing curves are left out.

    Parameters
    ----------
    path : Path
    pixels : dict of str to int
        Width of a crown for each scene.
    """
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
            below.plot(at, 100 * (factors / interp(at, angles, known) - 1), **style)
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


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pixels", type=int, nargs=len(CURVES), default=[8, 8, 2], help="a crown, by scene")
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "images" / "rami.png")
    parser.add_argument("--table", action="store_true", help="print a table instead")
    given = parser.parse_args()
    if given.table:
        print(table())
        session.stop()
        return 0
    draw(given.output, dict(zip(CURVES, given.pixels, strict=True)))
    session.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
