# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures from frames of the fidelity bench: over all of the default form, and by form and engine."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan

import numpy as np

from .fidelity_frames import Frame


def sums(frames: Sequence[Frame], default: str) -> dict[str, float]:
    """Means and worst of frames.

    Parameters
    ----------
    frames : sequence of Frame
        All that were measured.
    default : str
        The form whose figures have no suffix; those of a form and engine end in ``_shells_cycles`` and the like.

    Returns
    -------
    dict of str to float
        ``engine_gap`` is of the worst image: FLIP between both engines of proxies less that of the expanded plants,
        mean over its species. It is missing where no image was rendered in both.
    """
    figures = _sums([f for f in frames if f.form == default], "")
    for form, engine in dict.fromkeys((f.form, f.engine) for f in frames):
        chosen = [f for f in frames if (f.form, f.engine) == (form, engine)]
        figures |= _sums(chosen, f"_{form.lower()}_{engine}")
    return figures


def _sums(frames: Sequence[Frame], suffix: str) -> dict[str, float]:
    if not frames:
        return {}
    noise = [f.noise for f in frames if not isnan(f.noise)]
    figures = {
        "flip_mean": np.mean([f.flip for f in frames]),
        "flip_max": max(f.flip for f in frames),
        "flip_noise": np.mean(noise) if noise else None,
        "dT_max": max(abs(f.dT) for f in frames),
        "color_error_mean": np.mean([f.color for f in frames]),
        "brightness_mean": np.mean([f.brightness for f in frames]),
        "engine_gap": max(_gaps(frames), default=None),
        "frame_time_ratio_max": max(f.seconds / f.expanded_seconds for f in frames),
        "frame_memory_ratio_mean": np.mean([f.memory_mb / f.expanded_mb for f in frames]),
    }
    return {f"{name}{suffix}": float(value) for name, value in figures.items() if value is not None}


def _gaps(frames: Sequence[Frame]) -> list[float]:
    """By image that is there in both engines."""
    pictures: dict[tuple[int, int, str], list[float]] = {}
    for f in frames:
        if not isnan(f.gap):
            pictures.setdefault((f.pixels, f.each, f.light), []).append(f.gap - f.gap_expanded)
    return [float(np.mean(gaps)) for gaps in pictures.values()]
