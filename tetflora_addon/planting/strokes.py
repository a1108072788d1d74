# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a dab of the brush adds and takes: a circle on the map, plants that stand there, and a key in; places out.

The map is divided into square cells, each as large as one plant has at the density that is asked for. Paint plants the
cells that are empty, Thin leaves one plant in each, so that going over a place again changes nothing, and that what a
stroke does hardly depends on how fast the mouse was. A cell is planted whole or not at all: a dab decides about the
cells whose candidate falls into the circle.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Keys, Mask
from ..growth.hashing import child_key, key_of_seed, uniform
from ..parameters import FACTOR, meters, setting
from .plane import NO_DISTANCE, Spacing, cells_of, packed
from .rules import species_by_weight

#: Cells that one dab looks at; a wider circle, or a higher density, is refused by `paint`.
MOST_CELLS = 200_000
_TRIES = 6  # places in a cell that are tried before it stays empty
_TINY, _MOST_DABS = 1e-9, 64


class _Draw(IntEnum):
    X, Y, CHANCE, AZIMUTH, SCALE, SPECIES, SEED, RANK = range(1, 9)


@dataclass(frozen=True)
class Brush:
    """What the brush is like. Fields with a label are properties of a scene, and documented by their tooltips."""

    radius: float = setting(
        5.0,
        "Radius",
        "Radius of the brush on the map. While painting, use F, [ and ], or Ctrl and the mouse wheel",
        **meters(0.05, 50.0, 10_000.0),
    )
    density: float = 0.04  # plants for each square meter of the map
    strength: float = setting(
        1.0,
        "Strength",
        "Fraction of missing or surplus plants that one dab adds or removes; lower pen pressure reduces it",
        **FACTOR | {"min": 0.01},
    )
    min_distance: float = setting(
        0.0,
        "Min Distance",
        "Minimum distance between two trunks, measured on the map; existing plants count, including those of fields. "
        "Large values limit the density",
        default=1.0,
        **meters(0.0, 50.0),
    )
    scale_min: float = 1.0
    scale_max: float = 1.0
    weights: tuple[float, ...] = (1.0,)  # relative frequency of each species


def stroke_key(seed: int, stroke: int) -> Keys:
    """Key of the n-th stroke with a seed, () uint64."""
    return child_key(key_of_seed(seed), stroke)


def within(places: Floats, center: Sequence[float], radius: float) -> Mask:
    """Which places, (n, 2) or more columns, lie in a circle on the map."""
    gap = places[:, :2] - np.asarray(center, float)[:2]
    return np.einsum("ij,ij->i", gap, gap) <= radius * radius


def cell_size(density: float) -> float:
    """Side in meters of the square that one plant has at a density in plants per square meter."""
    return 1.0 / sqrt(density)


def too_many(brush: Brush) -> bool:
    """Whether a dab of this brush would have to look at more than `MOST_CELLS` cells."""
    return (2.0 * brush.radius / cell_size(brush.density) + 1.0) ** 2 > MOST_CELLS


def reach_of(brush: Brush) -> float:
    """Radius around the middle of the circle within which plants that stand have a say in a dab, meters."""
    return brush.radius + max(brush.min_distance, cell_size(brush.density) * sqrt(2.0))


def paint(brush: Brush, center: Sequence[float], standing: Floats, key: Keys, dab: int) -> tuple[Floats, Keys]:
    """Where one dab sets new plants.

    Parameters
    ----------
    center : sequence of float
        Middle of the circle; what is beyond x and y does not count.
    standing : (m, 2) or (m, 3) float64
        Plants that are there, those that the same stroke has set among them. Those far away may be left out.
    key : () uint64
        Of the stroke, see `stroke_key`.
    dab : int
        Number of the dab in its stroke.

    Returns
    -------
    places : (n, 2) float64
    keys : (n,) uint64
        One for each place; `individuals` makes plants of them.

    Raises
    ------
    ValueError
        `too_many` cells.
    """
    if too_many(brush):
        raise ValueError(f"the brush covers more than {MOST_CELLS:,} cells; lower its radius")
    side = cell_size(brush.density)
    middle = np.asarray(center, float)[:2]
    first, last = (np.floor((middle + sign * brush.radius) / side).astype(np.int64) for sign in (-1.0, 1.0))
    grid = np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(first, last, strict=True)), indexing="ij")
    cells = np.stack(grid, axis=-1).reshape(-1, 2)
    standing = standing[within(standing, middle, reach_of(brush)), :2]
    cells = cells[~np.isin(packed(cells), cells_of(standing, side))]
    cell_keys = child_key(child_key(key, cells[:, 0]), cells[:, 1])
    if brush.strength < 1.0:
        lucky = uniform(child_key(cell_keys, dab), _Draw.CHANCE) < brush.strength
        cells, cell_keys = cells[lucky], cell_keys[lucky]
    planted, keys = [np.zeros((0, 2))], [np.zeros(0, np.uint64)]
    for attempt in range(_TRIES):
        tried = child_key(cell_keys, attempt)
        places = (cells + np.stack([uniform(tried, _Draw.X), uniform(tried, _Draw.Y)], axis=1)) * side
        # A first choice outside of the circle is the business of the dab that comes there.
        inside = within(places, middle, brush.radius)
        if attempt == 0:
            cells, cell_keys, tried, places = cells[inside], cell_keys[inside], tried[inside], places[inside]
            inside = inside[inside]
        chosen = np.flatnonzero(inside)
        spacing = Spacing(brush.min_distance, np.concatenate([standing, *planted]))
        chosen = chosen[spacing.admit(places[chosen], len(chosen))]
        planted.append(places[chosen])
        keys.append(tried[chosen])
        left = np.ones(len(cells), bool)
        left[chosen] = False
        cells, cell_keys = cells[left], cell_keys[left]
        if brush.min_distance < NO_DISTANCE or not len(cells):
            break
    return np.concatenate(planted), np.concatenate(keys)


def erase(brush: Brush, center: Sequence[float], standing: Floats, key: Keys, dab: int) -> Integers:
    """Which plants, as numbers of places (m, 2) or (m, 3), one dab removes: a fraction of all in the circle."""
    inside = np.flatnonzero(within(standing, center, brush.radius))
    return inside[_drawn(brush, inside, key, dab)]


def thin(brush: Brush, center: Sequence[float], standing: Floats, key: Keys, dab: int) -> Integers:
    """Which plants one dab removes where they are denser than the brush, as numbers of places (m, 2) or (m, 3).

    Of each cell one plant stays, and of two that are closer than the minimum distance one. Which one depends on a hash
    of its place: so plants outside of the circle can stay too, and doing it again changes nothing.
    """
    near = np.flatnonzero(within(standing, center, reach_of(brush)))
    # Numbers in [0, 1) that places (n, 2) have by themselves, in the precision in which Blender stores them.
    bits = np.ascontiguousarray(standing[near, :2], np.float32).view(np.uint32)
    near = near[np.argsort(uniform(child_key(key_of_seed(bits[:, 0]), bits[:, 1]), _Draw.RANK), kind="stable")]
    _, first = np.unique(cells_of(standing[near, :2], cell_size(brush.density)), return_index=True)
    winners = near[np.sort(first)]
    winners = winners[Spacing(brush.min_distance, np.zeros((0, 2))).admit(standing[winners, :2], len(winners))]
    gone = np.sort(near[~np.isin(near, winners)])
    gone = gone[within(standing[gone], center, brush.radius)]
    return gone[_drawn(brush, gone, key, dab)]


def individuals(brush: Brush, keys: Keys) -> dict[str, NDArray]:
    """Azimuth (radians), scale, species (index of a weight) and seed (0 or more) of plants with keys, (n,) each."""
    low, high = sorted((brush.scale_min, brush.scale_max))
    return {
        "azimuth": 2.0 * np.pi * uniform(keys, _Draw.AZIMUTH),
        "scale": low + (high - low) * uniform(keys, _Draw.SCALE),
        "species": species_by_weight(brush.weights, uniform(keys, _Draw.SPECIES)),
        "seed": (uniform(keys, _Draw.SEED) * 2**31).astype(np.int32),
    }


def dabs_along(last: Sequence[float], to: Sequence[float], spacing: float) -> Floats:
    """Places of dabs from one to another place of the mouse, the first left out and the last kept, (n, 3).

    They are about ``spacing`` meters apart, or farther where there would be more than `_MOST_DABS`.
    """
    a, b = np.asarray(last, float), np.asarray(to, float)
    number = int(np.clip(np.ceil(np.linalg.norm(b - a) / max(spacing, _TINY)), 1, _MOST_DABS))
    return a + (b - a) * (np.arange(1, number + 1) / number)[:, None]


def _drawn(brush: Brush, numbers: Integers, key: Keys, dab: int) -> Mask:
    """Which of some plants a dab of this strength reaches."""
    if brush.strength >= 1.0:
        return np.ones(len(numbers), bool)
    return uniform(child_key(child_key(key, dab), numbers), _Draw.CHANCE) < brush.strength
