# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How wide and how tall plants of a species are, on average: for distances to plant at, and for estimates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..growth.growth import trunks
from ..growth.seeds import Seeds
from ..leaves.levels import chosen_polygons
from ..leaves.models import LeafModel
from ..species.members import expected_polygons
from ..species.species import Species
from .flora import compile_species

_WITHIN = 0.9  # of the leaves are in what counts as the crown; single shoots beyond it take no room
_TALLEST = 0.98  # of the leaves are lower than the plant is tall
_LEAF_LEANS = 0.25  # of the length of leaves, which makes the crown of grass: its axes are next to nothing
LEVEL = 0.7  # of the area of leaves is seen from above, between those that stand in all directions and those that lie
_LOWEST = 0.03  # of the leaves are lower than the crown's base
_PLANTS = 16  # over which the length of trunks is averaged
_MOST = 256  # crowns that are kept

_known: dict[Species, Crown] = {}


@dataclass(frozen=True)
class Crown:
    """Of a plant of scale 1.

    Attributes
    ----------
    radius, height : float
        Meters.
    polygons : float
        Expected number of the whole plant.
    base : float
        Meters below which there are next to no leaves.
    leaves, wood : float
        Expected one-sided area of the leaves and surface of the branches, m².
    color : tuple of float
        Mean linear RGB of both, weighted by how much of them is seen from above.
    leaf : float
        Mean width of a leaf, or of a trunk without leaves, meters.
    form : LeafModel or None
        One of its leaves, where these are known.
    """

    radius: float
    height: float
    polygons: float
    base: float = 0.0
    leaves: float = 0.0
    wood: float = 0.0
    color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    leaf: float = 0.02
    form: LeafModel | None = None

    @property
    def seen(self) -> float:
        """Area that leaves and wood hide from above, counted singly, m²."""
        return LEVEL * self.leaves + self.wood / np.pi

    def leaf_polygons(self, widths: NDArray[np.float64]) -> NDArray[np.float64]:
        """Polygons (n,) of leaves that are so many times as wide in the image as their margins may be off."""
        return np.ones(len(widths)) if self.form is None else chosen_polygons(self.form, widths / self.form.width)


def known_crown(species: Species) -> Crown | None:
    """What `crown_of` has found already, at once; None where it has not been asked."""
    return _known.get(species)


def crown_of(species: Species) -> Crown:
    """The mean crown of a species; its samples are drawn at the first time, which takes some hundredths of a second.

    Raises
    ------
    SpeciesError
        A leaf is still the name of a Blender object.
    """
    found = _known.get(species)
    if found is None:
        while len(_known) >= _MOST:
            _known.pop(next(iter(_known)), None)
        found = _known[species] = _crown_of(species)
    return found


def _crown_of(species: Species) -> Crown:
    flora = compile_species([species])
    trunk = trunks(flora.rows, Seeds.upright(_PLANTS))
    row, length = int(trunk.row[0]), float(trunk.length.mean())
    points = flora.samples.leaves if flora.leaf_count[row] > 0 else flora.samples.wood
    first, samples = int(points.first[row, -1]), int(points.number[row, -1])
    place = length * points.position[first : first + samples].astype(np.float64)
    reach = _LEAF_LEANS * float(flora.leaf_reach[row])
    radius = float(np.quantile(np.hypot(place[:, 0], place[:, 1]), _WITHIN)) + reach
    height = max(float(np.quantile(place[:, 2], _TALLEST)), radius)
    base = max(float(np.quantile(place[:, 2], _LOWEST)), 0.0) if flora.leaf_count[row] > 0 else 0.0
    leaves, wood = flora.leaf_areas(trunk), flora.wood_areas(trunk)
    areas = np.array([LEVEL * leaves.mean(), wood.mean() / np.pi])
    colors = np.stack([flora.leaf_colors(trunk).mean(axis=0), flora.wood_color[row]])
    color = tuple((areas @ colors / areas.sum()).tolist())
    polygons = expected_polygons(flora.species[0])
    leaf = float(flora.leaf_width[row]) if flora.leaf_count[row] > 0 else 2.0 * float(trunk.radius.mean())
    form = next((form for forms in flora.forms[0] for form in forms), None) if flora.leaf_count[row] > 0 else None
    return Crown(radius, height, polygons, base, float(leaves.mean()), float(wood.mean()), color, leaf, form)
