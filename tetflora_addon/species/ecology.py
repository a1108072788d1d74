# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a species needs, where its file does not say so, and how many leaves the crown of a plant has.

Stands take light by the leaf area that is told here, and plants of recorded sizes are drawn with it: one truth.
"""

from functools import lru_cache

import numpy as np

from ..arrays import Floats
from ..leaves.levels import needle_ratio
from ..leaves.models import LeafModel
from .ages import ages_of
from .species import Ecology, Species

_FULL = 0.75  # crowns as long as this fraction of the height have all leaves of a free one


def crown_leaves(leaves: Floats | float, height: Floats, base: Floats, radius: Floats) -> Floats:
    """One-sided leaf area (n,) of crowns, m².

    Parameters
    ----------
    leaves : (n,) float64 or float
        `Ecology.leaves` of their species.
    height, base, radius : (n,) float64
        Of plants and their crowns, meters.
    """
    return np.pi * radius**2 * np.minimum((height - base) / (_FULL * height), 1.0) * leaves


def one_sided(species: Species) -> float:
    """One-sided area of the leaves of a species over that of the flat leaves that are drawn for them from afar."""
    ratios = [needle_ratio(form) for form in species.leaf if isinstance(form, LeafModel)]
    return float(np.mean(ratios)) if ratios else 1.0


@lru_cache(maxsize=256)
def ecology_of(species: Species) -> Ecology:
    """What a species needs; without a description, as plants of its size are.

    Heights and basal diameters follow from its orders, which are taken to be three quarters as tall as the largest.
    """
    if species.ecology is not None:
        return species.ecology
    lengths = np.cumprod([order.length.mean for order in species.orders])
    first = species.orders[0]
    # Stems of a stool are longer than it; leaves stand up beyond stems that are next to nothing.
    stool = len(lengths) > 1 and lengths[1] > lengths[0]
    leaf = max((order.leaf_size.mean for order in species.orders if order.leaves.high > 0), default=0.0)
    height = 1.33 * max(float(lengths[0] + (lengths[1] if stool else 0.0)), leaf)
    if height < 3.0:
        # Herbs and low shrubs: the crown is as wide as two thirds of the height, whatever the diameter is.
        thick = 0.01 * height
        return Ecology(
            shade=3.0, fecundity=200.0, dispersal=5.0, height=height, diameter=thick, height_curve=(2.0 / thick, 1.0),
            crown_width=(0.35 * height, 0.35 * height / thick), crown_conicity=0.0, leaves=2.5,
            wood_density=300.0, light_use_efficiency=0.3,
            diameter_increment=thick / 3.0, source="Not published: as plants of this size are",
        )  # fmt: skip
    thick = 2.0 * first.thickness.mean * lengths[0] if not stool else 0.02 * height
    largest = float(np.clip(2.2 * thick, 0.01 * height, 0.06 * height))
    shrub = height < 9.0
    return Ecology(
        height=height,
        diameter=largest,
        height_curve=(2.2 / (0.5 * largest), 0.9),
        crown_width=(0.3 + 0.02 * height, min(20.0, 0.8 * height / largest)),
        diameter_increment=min(largest / (0.35 * ages_of(species).lifespan), 0.02),
        light_use_efficiency=0.5 if shrub else 0.9,
        leaves=4.0 if shrub else 6.0,
        source="Not published: as plants of this size are",
    )
