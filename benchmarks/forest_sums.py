# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of the benchmark `forest` from what its processes measured."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .forest_case import SAMPLES

#: Figures of single cases that go into the record as they are.
_OURS = (
    "plants",
    "refine_emit_s",
    "peak_mb",
    "polygons_meshed",
    "polygons_proxy",
    "longest_step_s",
    "hidden_open",
    "render_s",
    "peak_render_mb",
)
_THEIRS = ("build_s", "render_s", "peak_render_mb")
_PART = ("flip", "flip_noise", "color_error", "part_plants")
#: Bytes of a megabyte of `report.peak_mb`, which counts thousands of kibibytes.
_MEGABYTE = 1024e3


def sums(records: Mapping[tuple[str, str], dict]) -> dict[str, float]:
    """Extremes over all cases, then figures of each.

    Parameters
    ----------
    records : mapping
        By case and what was measured: ``refine``, ``instances``, ``part``, ``light`` or ``limit_`` with gigabytes.
    """
    woods = {case: one for (case, what), one in records.items() if what == "refine" and case != "million"}
    species = [one for case, one in woods.items() if case not in ("mix", "eye")]
    over = {case: ratios(one, records[case, "instances"]) for case, one in woods.items()}
    parts = {case: one for (case, what), one in records.items() if what == "part"}
    limits = {int(what.removeprefix("limit_")): one for (_, what), one in records.items() if what.startswith("limit_")}
    figures = {
        "refine_emit_s_max": max(one["refine_emit_s"] for one in species),
        "peak_mb_max": max(one["peak_mb"] for one in woods.values()),
        "polygons_max": max(one["polygons"] for one in woods.values()),
        **{f"{case}_s": woods[case]["refine_emit_s"] for case in ("mix", "eye") if case in woods},
        "longest_step_s": max(one["longest_step_s"] for one in woods.values()),
        **{f"{key}_max": max(one[key] for one in over.values()) for key in next(iter(over.values()))},
        "hidden_open_ratio_max": max(one["hidden_open"] for one in woods.values()),
        "flip_mean": float(np.mean([one["flip"] for one in parts.values()])),
        "flip_max": max(one["flip"] for one in parts.values()),
    }
    if limits:
        used = {f"limit_{n}_gb": one["peak_render_mb"] * _MEGABYTE / (n * 1e9) for n, one in limits.items()}
        figures |= {"limit_ratio_max": max(used.values()), **used}
    if ("light", "light") in records:
        figures |= records["light", "light"]
    if ("million", "refine") in records:
        one = records["million", "refine"]
        figures |= {"million_s": one["refine_emit_s"], "million_mb": one["peak_mb"], "million_plants": one["plants"]}
    for case, one in woods.items():
        figures |= {f"{key}_{case}": one[key] for key in _OURS if key in one}
        figures |= {f"instances_{key}_{case}": records[case, "instances"][key] for key in _THEIRS}
        figures |= {f"{key}_{case}": value for key, value in over[case].items()}
        figures |= {f"{key}_{case}": parts[case][key] for key in _PART if key in parts[case]}
    return figures


def ratios(ours: dict, theirs: dict) -> dict[str, float]:
    """Ours over instances: render, everything until an image with `SAMPLES` samples, and memory."""
    whole, processor = f"render_{SAMPLES}_s", f"render_{SAMPLES}_cpu_s"
    return {
        "render_ratio": ours[whole] / theirs[whole],
        "render_cpu_ratio": ours[processor] / theirs[processor],
        "total_ratio": (ours["refine_emit_s"] + ours[whole]) / (theirs["build_s"] + theirs[whole]),
        "memory_ratio": ours["peak_render_mb"] / theirs["peak_render_mb"],
    }
