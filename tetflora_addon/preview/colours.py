# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours in which a preview shows tetrahedra; all are RGB as a screen shows them (sRGB), 0 to 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..refinement.decisions import Decision
from .levels import Level

#: By what was decided; the overlay's text has the same colours. Blue and orange, so that few eyes mix them up.
FORMS: dict[Decision, tuple[float, float, float]] = {
    Decision.SPLIT: (0.95, 0.95, 0.95),
    Decision.EXPLICIT: (0.35, 0.85, 0.25),
    Decision.PROXY: (1.0, 0.6, 0.1),
    Decision.HIDDEN: (0.4, 0.6, 1.0),
}
#: From little to much, evenly apart in lightness.
_RAMP = np.array([(0.25, 0.1, 0.45), (0.2, 0.35, 0.75), (0.1, 0.65, 0.65), (0.5, 0.85, 0.35), (1.0, 0.92, 0.3)])
#: Contributions are shown by their logarithm between these, pixels.
_LEAST, _MOST = 0.25, 1_024.0


def ramp(share: NDArray[np.floating]) -> NDArray[np.float32]:
    """Colours (n, 3) for shares (n,), dark violet at 0 over green to bright yellow at 1."""
    at = np.clip(share, 0.0, 1.0) * (len(_RAMP) - 1)
    low = np.minimum(at.astype(np.intp), len(_RAMP) - 2)
    return (_RAMP[low] + (_RAMP[low + 1] - _RAMP[low]) * (at - low)[:, None]).astype(np.float32)


def colours_of(level: Level, mode: str, deepest: int) -> NDArray[np.float32]:
    """Colours (t, 3) of a level's tetrahedra.

    Parameters
    ----------
    level : Level
    mode : {'LEVEL', 'VISIBILITY', 'FORM', 'CONTRIBUTION'}
        By how often space was divided, by the share that is seen, by what was decided, or by the logarithm of the
        pixels that are changed.
    deepest : int
        Depth that is brightest, so that colours stay while one steps through levels.

    Raises
    ------
    ValueError
        If there is no such mode.
    """
    if mode == "LEVEL":
        return ramp(level.depth / max(deepest, 1))
    if mode == "VISIBILITY":
        return ramp(level.visibility)
    if mode == "CONTRIBUTION":
        pixels = np.maximum(level.contribution, _LEAST)
        return ramp(np.log(pixels / _LEAST) / np.log(_MOST / _LEAST))
    if mode == "FORM":
        table = np.zeros((len(Decision), 3), np.float32)
        for decision, colour in FORMS.items():
            table[decision] = colour
        return table[level.decision]
    raise ValueError(f'unknown color mode "{mode}"; use LEVEL, VISIBILITY, FORM or CONTRIBUTION')


def as_shown(linear: NDArray[np.floating]) -> NDArray[np.float32]:
    """Linear colours (..., 3) as a screen shows them (IEC 61966-2-1)."""
    value = np.clip(linear, 0.0, 1.0)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055).astype(np.float32)
