# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of sub-plants before any is grown: bounds, mean areas, colours and orientation (paper, section 5).

Areas, counts and colours are expectations in closed form. Orientation and the places of leaves and wood within a
sub-plant are kept as a few hundred sample points, drawn by following random paths from the branch outwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..errors import SpeciesError
from .bounds import unit_bounds
from .crown_shapes import crown_ratio
from .growth import Branches
from .leaf_models import LeafModel
from .rows import build_rows
from .samples import Samples, draw_samples
from .species import MAX_ORDERS, Species


@dataclass(frozen=True)
class Flora:
    """The compiled species of a scene; arrays have one entry for each row (species and order).

    Amounts are those of a sub-plant where the crown's branches are longest (vigour 1); of what follows the length, a
    shorter one has the share that `growth.fullness` says.

    Attributes
    ----------
    species : tuple of Species
    leaf_models : tuple of LeafModel
        By species.
    rows : (r,) structured array
        Parameters, see `rows.ROW_DTYPE`.
    bound : (r, 3) float64
        Radius, lowest and highest z of the sub-plant's axes for a branch of length 1, see `bounds.unit_bounds`.
    leaf_reach : (r,) float64
        How far leaves of the sub-plant stick out beyond its axes at plant scale 1, metres.
    leaf_width : (r,) float64
        Mean width of its leaves at plant scale 1, metres; 0 without leaves.
    leaf_count, leaf_area : (r,) float64
        Expected number and one-sided area (m², at plant scale 1) of the leaves of the sub-plant.
    wood_area : (r,) float64
        Expected surface of the branches of the sub-plant divided by length × radius of its own branch.
    own_wood : (r,) float64
        The part of it that is the own branch's.
    polygons, own_faces : (r,) float64
        Expected number of faces of the sub-plant, leaves and branches; and those of its own branch's tube.
    leaf_colour, wood_colour : (r, 3) float64
        Area-weighted mean colours.
    transmission : (r,) float64
        Share of scattered light that goes through leaves.
    samples : Samples
        Points on the leaves and wood of sub-plants.
    """

    species: tuple[Species, ...]
    leaf_models: tuple[LeafModel, ...]
    rows: NDArray[np.void]
    bound: NDArray[np.float64]
    leaf_reach: NDArray[np.float64]
    leaf_width: NDArray[np.float64]
    leaf_count: NDArray[np.float64]
    leaf_area: NDArray[np.float64]
    wood_area: NDArray[np.float64]
    own_wood: NDArray[np.float64]
    polygons: NDArray[np.float64]
    own_faces: NDArray[np.float64]
    leaf_colour: NDArray[np.float64]
    wood_colour: NDArray[np.float64]
    transmission: NDArray[np.float64]
    samples: Samples

    @staticmethod
    def species_of(row: NDArray[np.integer]) -> NDArray[np.integer]:
        """Index (n,) of the species that rows (n,) belong to."""
        return row // MAX_ORDERS

    def one_leaf_area(self, branches: Branches) -> NDArray[np.float64]:
        """Mean one-sided area (n,) of a single leaf of sub-plants, m²; 0 where they have none."""
        row = branches.row
        return self.leaf_area[row] / np.maximum(self.leaf_count[row], 1e-300) * branches.scale**2


def tube_perimeter(sides: NDArray[np.integer]) -> NDArray[np.float64]:
    """Perimeter of a branch's cross-section, a regular polygon, divided by its radius."""
    return 2 * sides * np.sin(np.pi / sides)


def _children(rows: NDArray[np.void], index: int) -> tuple[float, float, float, float]:
    """Expected sums over the children of a branch, at its place in the crown where branches are longest.

    Returns
    -------
    number, fullness : float
        Of the children: how many, and the sum of the factors on their own numbers (see `growth.fullness`).
    wood, full_wood : float
        Sums of length × radius relative to the parent's, without and with that factor.
    """
    row, child = rows[index], rows[index + 1]
    share = (np.arange(256) + 0.5) / 256
    t = row["branch_start"] + (1 - row["branch_start"]) * share
    vigour = crown_ratio(np.full(share.shape, row["crown"]), 1 - share)
    full = 1 - child["count_by_length"] * (1 - vigour)
    size = vigour * (1 - (1 - row["taper"]) * t) * child["length"][0] * child["thickness"][0]
    return tuple(float(row["branches"][0] * m.mean()) for m in (np.ones_like(t), full, size, size * full))


def compile_species(species: Sequence[Species]) -> Flora:
    """Compile the species of a scene; the last few results are kept, by content.

    Raises
    ------
    SpeciesError
        A species whose leaf is still the name of a Blender object (the bridge to Blender has to replace it first).
    """
    return _compiled(tuple(species))


@lru_cache(maxsize=8)
def _compiled(species: tuple[Species, ...]) -> Flora:
    for one in species:
        if not isinstance(one.leaf, LeafModel):
            raise SpeciesError(f"{one.identifier}: the leaf object \"{one.leaf}\" has not been resolved to a mesh")
    rows = build_rows(species)
    models = tuple(one.leaf for one in species)
    total = len(rows)
    by_species = np.repeat(np.arange(len(species)), MAX_ORDERS)
    model_area, model_polygons, model_reach, model_width = (
        np.array([getattr(m, name) for m in models])[by_species] for name in ("area", "polygons", "reach", "width")
    )
    size, spread_ = rows["leaf_size"].T
    own_leaves = rows["leaves"][:, 0]
    own_area = own_leaves * (size**2 + spread_**2 / 3) * model_area  # E[s²] of a uniform range
    own_reach = np.where(rows["leaves"].sum(1) > 0, (size + spread_) * model_reach, 0.0)
    own_wood = tube_perimeter(np.maximum(rows["sides"], 1)) * (1 + rows["taper"]) / 2 * rows["used"]
    own_faces = (rows["sides"] * rows["segments"]).astype(float)

    leaf_count, leaf_area = own_leaves.copy(), own_area.copy()
    wood_area, polygons = own_wood.copy(), own_faces + own_leaves * model_polygons
    leaf_reach, leaf_width = own_reach.copy(), own_leaves * size * model_width
    leaf_colour = own_area[:, None] * rows["leaf_colour"][:, 0]
    wood_colour = own_wood[:, None] * rows["branch_colour"][:, 0]
    wood_share = np.zeros((total, MAX_ORDERS))  # of the sub-plant's wood, by relative order
    wood_share[:, 0] = own_wood
    leaf_share = np.zeros((total, MAX_ORDERS))
    leaf_share[:, 0] = own_area
    for order in range(MAX_ORDERS - 2, -1, -1):
        for i in range(order, total, MAX_ORDERS):
            if rows["branches"][i, 0] <= 0:
                continue
            number, full, wood, full_wood = _children(rows, i)
            for array in (leaf_count, leaf_area, leaf_width, leaf_colour):
                array[i] += full * array[i + 1]
            leaf_share[i, 1:] = full * leaf_share[i + 1, :-1]
            polygons[i] += number * own_faces[i + 1] + full * (polygons[i + 1] - own_faces[i + 1])
            own_colour = own_wood[i + 1] * rows["branch_colour"][i + 1, 0]
            wood_area[i] += wood * own_wood[i + 1] + full_wood * (wood_area[i + 1] - own_wood[i + 1])
            wood_colour[i] += wood * own_colour + full_wood * (wood_colour[i + 1] - own_colour)
            wood_share[i, 1] = wood * own_wood[i + 1]
            wood_share[i, 2:] = full_wood * wood_share[i + 1, 1:-1]
            leaf_reach[i] = max(leaf_reach[i], leaf_reach[i + 1])
    return Flora(
        species=tuple(species),
        leaf_models=models,
        rows=rows,
        bound=unit_bounds(rows),
        leaf_reach=leaf_reach,
        leaf_width=leaf_width / np.maximum(leaf_count, 1e-300),
        leaf_count=leaf_count,
        leaf_area=leaf_area,
        wood_area=wood_area,
        own_wood=own_wood,
        polygons=polygons,
        own_faces=own_faces,
        leaf_colour=leaf_colour / np.maximum(leaf_area, 1e-300)[:, None],
        wood_colour=wood_colour / np.maximum(wood_area, 1e-300)[:, None],
        transmission=np.array([one.leaf_transmission for one in species])[by_species],
        samples=draw_samples(rows, [m.moment for m in models], leaf_share, wood_share),
    )
