# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the brush has taken plants from populations: these places stay bare when a population is placed anew.

Stored in the population as JSON text: a list for each stroke, of a radius and the x and y of the circles' middles.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ..planting.ground import Path

_DIGITS = 4  # tenths of a millimetre


def note_erased(population: bpy.types.PropertyGroup, middles: NDArray[np.float64] | Sequence, radius: float) -> None:
    """Let circles on the map, with middles (n, 2) or more columns, stay bare; metres."""
    flat = np.round(np.asarray(middles, dtype=np.float64)[:, :2], _DIGITS).ravel().tolist()
    strokes = [*_strokes(population), [round(radius, _DIGITS), *flat]]
    population.erased = json.dumps(strokes, separators=(",", ":"))


def erased_places(population: bpy.types.PropertyGroup) -> tuple[Path, ...]:
    """What stays bare, as lines of one point."""
    return tuple(
        Path(middle[None], stroke[0])
        for stroke in _strokes(population)
        for middle in np.array(stroke[1:], dtype=np.float64).reshape(-1, 2)
    )


def _strokes(population: bpy.types.PropertyGroup) -> list[list[float]]:
    return json.loads(population.erased) if population.erased else []
