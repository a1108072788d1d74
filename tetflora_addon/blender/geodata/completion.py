# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights of trees of which an inventory has only the trunk or the crown: those that their species has with these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...compiled.crowns import crown_of
from ...compiled.flora import compile_species
from ...errors import SpeciesError
from ...growth.axes import profile
from ...growth.growth import trunks
from ...growth.seeds import Seeds
from ...species.ages import ages_of
from ...species.species import Species

_AGES, _BREAST, _PLANTS = 96, 1.3, 16
_TALLER = 1.6  # at most, than what the curves of a species come to
_SLENDER = 60.0  # height above breast height over the diameter there, of the thinnest trunks, at most a meter in all


@dataclass(frozen=True)
class Curves:
    """Sizes of a species by age, each (a,) float64, ascending; meters."""

    height: NDArray[np.float64]
    diameter: NDArray[np.float64]
    width: NDArray[np.float64]


@lru_cache(maxsize=64)
def curves_of(species: Species) -> Curves:
    """Sizes of a species at ages from a seedling to the oldest in good health.

    Limbs grow as a power of the trunk's diameter, within limits that its height sets, as in `species.ages`.
    """
    ages, crown = ages_of(species), crown_of(species)
    years = np.geomspace(0.5, ages.full if ages.scaled else ages.decline * ages.lifespan, _AGES).tolist()
    height = np.array([ages.heights(year) for year in years])
    diameter = height if ages.scaled else np.array([ages.diameters(year) for year in years])
    width = height if ages.scaled else np.clip(diameter**ages.spread, 0.45 * height, 1.4 * height**0.8)
    rows = compile_species([species]).rows
    trunk = trunks(rows, Seeds.upright(_PLANTS))
    at = np.minimum(_BREAST / trunk.length, 0.5)
    full = float(2.0 * (trunk.radius * profile(rows, trunk.row, trunk.key, at)).mean())
    return Curves(crown.height * height, full * diameter, 2.0 * crown.radius * width)


def complete(
    sizes: dict[str, NDArray[np.float32]],
    kinds: NDArray[np.int32],
    identifiers: list[str],
    find: Callable[[str], Species],
) -> tuple[NDArray[np.float32], int]:
    """Heights (n,) with those that follow from the trunk, or else from the crown; and how many these are.

    Species that are assets, or cannot be found, have none.
    """
    height = sizes["height"].copy()
    for number, identifier in enumerate(identifiers):
        own = (kinds == number) & (height == 0.0)
        for name in ("diameter", "width"):
            known = sizes["diameter" if name == "diameter" else "crown_width"]
            some = np.flatnonzero(own & (known > 0.0) & (height == 0.0))
            if not len(some):
                continue
            try:
                curves = curves_of(find(identifier))
            except SpeciesError:
                break
            by = getattr(curves, name)
            found = np.interp(np.log(known[some]), np.log(by), np.log(curves.height))
            beyond = np.clip(known[some] / by[-1], 1.0, None) ** 0.5
            height[some] = np.exp(found) * np.minimum(beyond, _TALLER)
            if name == "diameter":  # it is measured at that height
                height[some] = np.maximum(height[some], _BREAST + np.minimum(_SLENDER * known[some], 1.0))
    return height, int((height != sizes["height"]).sum())
