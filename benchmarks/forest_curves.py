# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the cost of a wood follows: pixels, plants, plants a hectare, height of the camera.

    python -m benchmarks curves                # processor seconds and memory, with targets
    python -m benchmarks.forest_curves --plot  # docs/images/forest_curves.png, of what the last run left

Each point is the wood of `forest`, of birches at full HD, with one thing changed, in a process of its own. A slope is
that of a line through a curve on logarithmic axes: 1 where cost grows as what is changed.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from .forest import ROOT, measured

#: What the processes have measured.
FOLDER = ROOT / "out" / "forest-curves"
QUICK_FOLDER = ROOT / "out" / "forest-curves-quick"
PICTURE = ROOT / "docs" / "images" / "forest_curves.png"
SPECIES = "birch"
#: Pixels of images of 16 : 9, from those of 128 × 128 to 4K.
PIXELS = (128**2, 256**2, 512**2, 1024**2, 1920 * 1080, 3840 * 2160)
PLANTS = (10, 100, 1_000, 10_000, 100_000, 1_000_000)
HECTARE = (100, 200, 400, 800, 1_600, 4_000)
HEIGHTS = (0.5, 1.7, 5.0, 10.0, 30.0, 100.0)
CURVES = {"pixels": PIXELS, "plants": PLANTS, "hectare": HECTARE, "height": HEIGHTS}
LABELS = {"pixels": "pixels", "plants": "plants", "hectare": "plants a hectare", "height": "height of the camera, m"}
#: A wood in which 14,891 plants have room on 9 hectares, meters and hectares.
_SIDE, _HECTARES, _DENSITY = 300.0, 9.0, 14_891 / 9.0
#: Processor seconds: other programs hardly change them.
_FIGURES = {"s": "refine_emit_cpu_s", "mb": "peak_mb"}

#: None is steeper than the number of pixels.
TARGETS: dict[str, dict[str, float]] = {f"slope_{unit}_{curve}": {"max": 1.0} for curve in CURVES for unit in _FIGURES}
QUICK_TARGETS: dict[str, dict[str, float]] = {}


def run(quick: bool) -> dict[str, float]:
    """Measure all curves anew; quick: three points of each, in small images."""
    for path in (QUICK_FOLDER if quick else FOLDER).glob("*.json"):
        path.unlink()
    return measure(quick)


def measure(quick: bool) -> dict[str, float]:
    """Figures of all curves; what an earlier run has left is not measured again."""
    figures: dict[str, float] = {}
    points: dict[str, float] = {}
    for curve, values in CURVES.items():
        chosen = values[:3] if quick else values
        made = [measured(QUICK_FOLDER if quick else FOLDER, *words(curve, value, quick)) for value in chosen]
        for value, one in zip(chosen, made, strict=True):
            points |= {f"{unit}_{curve}_{value:g}": one[key] for unit, key in _FIGURES.items()}
            points[f"polygons_{curve}_{value:g}"] = one["polygons"]
        for unit, key in _FIGURES.items():
            cost = [one[key] for one in made]
            figures[f"slope_{unit}_{curve}"] = slope(chosen, cost)
            figures[f"steepest_{unit}_{curve}"] = float((np.diff(np.log(cost)) / np.diff(np.log(chosen))).max())
    return figures | points


def words(curve: str, value: float, quick: bool = False) -> tuple[str, ...]:
    """Words of the command that measures a point of a curve."""
    # For fewer pixels, land and plants stay; for plants, land grows on all sides and behind.
    side = _SIDE
    asked, distance = _HECTARES * _DENSITY, 1.4
    size, more = PIXELS[0 if quick else 4], ()
    if quick:
        side, asked = side / 6.0, asked / 36.0
    if curve == "pixels":
        size = value
    elif curve == "plants":
        asked, side, more = value, 100.0 * math.sqrt(value / _DENSITY), ("--away", f"{_SIDE / 2:g}")
    elif curve == "hectare":
        asked *= value / _DENSITY
        distance *= math.sqrt(_DENSITY / value)
    else:
        more = ("--eye", f"{value:g}")
    width = round(math.sqrt(size * 16 / 9))
    wood = ("--plants", f"{asked:.0f}", "--side", f"{side:g}", "--distance", f"{distance:.2f}", *more)
    return (SPECIES, "--no-render", "--at-once", "--size", f"{width}x{round(size / width)}", *wood)


def slope(values: Iterable[float], cost: Iterable[float]) -> float:
    """Slope of the line through a curve on logarithmic axes."""
    return float(np.polyfit(np.log(list(values)), np.log(list(cost)), 1)[0])


def plot(path: Path, figures: dict[str, float]) -> None:
    """Draw seconds and memory of each curve."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(CURVES), figsize=(13.2, 3.4), constrained_layout=True, sharey=True)
    for axis, (curve, values) in zip(axes, CURVES.items(), strict=True):
        seconds, memory = ([figures[f"{unit}_{curve}_{v:g}"] for v in values] for unit in _FIGURES)
        axis.loglog(values, seconds, "o-", color="#2a7f3f", label="refine and emit, processor seconds")
        axis.loglog(values, [m / 1000 for m in memory], "s-", color="#b5651d", label="peak, gigabytes")
        axis.set_xlabel(LABELS[curve])
        axis.grid(True, which="both", alpha=0.25)
    axes[0].legend(fontsize=8)
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def main() -> int:
    """Measure what an earlier run has not left, and draw."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.forest_curves", description=__doc__)
    parser.add_argument("--plot", type=Path, nargs="?", const=PICTURE, metavar="PATH")
    arguments = parser.parse_args()
    figures = measure(quick=False)
    for name, value in figures.items():
        print(f"  {name:32s} {value:,.4g}")
    if arguments.plot:
        plot(arguments.plot, figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
