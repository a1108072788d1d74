# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says that refining will take, beside what it takes: twelve small scenes, as drafts and in full.

Each is measured by `forest` in a process of its own. Polygons and facets, and memory with the image, are compared as
they are; seconds are the processor's, as others may use the machine, over those of the scene that is in the middle, as
the panel learns how fast a machine is.
"""

from __future__ import annotations

import statistics

from .forest import FOLDER, measured
from .report import Targets

_SMALL = ("--side", "60")
#: Words for `forest` of each scene.
SCENES = {
    "birches": ("birch", *_SMALL),
    "spruces": ("spruce", *_SMALL),
    "oaks": ("oak", *_SMALL),
    "bushes": ("bush", "--side", "20", "--eye", "3"),
    "mixed": ("mix", *_SMALL),
    "inside": ("eye", *_SMALL),
    "covered": ("eye", "--side", "30", "--cover"),
    "single": ("beech", "--asked", "1", "--side", "20", "--eye", "1.7", "--away", "12"),
    "far": ("mix", *_SMALL, "--away", "600", "--eye", "60"),
    "many": ("mix", "--side", "250", "--distance", "3"),
    "winter": ("eye", *_SMALL, "--set", "year.season=WINTER"),
    "young": ("mix", *_SMALL, "--set", "year.years=12"),
}
QUALITIES = "DRAFT", "FINAL"

TARGETS: Targets = {"estimate_ratio_max": {"max": 1.5}}


def run(quick: bool) -> dict[str, float]:
    """Measure; quick: the first four scenes."""
    scenes = list(SCENES.items())[: 4 if quick else None]
    found, seconds = {}, {}
    for name, words in scenes:
        for quality in QUALITIES:
            last = (f"quality={quality}",) if "--set" in words else ("--set", f"quality={quality}")
            one = measured(FOLDER / "estimates", words[0], "--size", "480x270", "--samples", "1", *words[1:], *last)
            expected, key = one["expected"], f"{name}_{quality.lower()}"
            found[f"polygons_{key}"] = expected["primitives"] / one["polygons"]
            found[f"memory_{key}"] = expected["memory_mb"] / one["peak_render_mb"]
            seconds[f"seconds_{key}"] = expected["seconds"] / one["refine_emit_all_cpu_s"]
    middle = statistics.median(seconds.values())
    found |= {key: value / middle for key, value in seconds.items()}
    return {"estimate_ratio_max": max(max(value, 1.0 / value) for value in found.values()), **found}
