# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tetrahedra hold: sub-plants, pieces of branches, explicit polygons, and how much they are (paper, section 6.5).

A plant is held as a sub-plant while it lies on one side of every plane. Where it crosses one it is opened into the
sub-plants of the next order and the pieces of its own branch, see `descent`. Polygons come from meshes that were
modelled elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..plants.branches import Branches
from ..plants.compiled import Flora
from ..plants.growth import trunks
from ..plants.pieces import Pieces
from ..plants.seeds import Seeds
from ..plants.sides import bounding_bodies
from .amounts import Amounts, piece_amounts, polygon_amounts, subplant_amounts, sums
from .camera import Camera
from .polygons import Polygons

#: Side in pixels from which on a polygon is large: more than facets have, even where nobody looks.
LARGE = 2.0
_NONE = np.zeros(0, np.int32)
_KINDS = ("subplant", "piece", "polygon")


@dataclass(frozen=True)
class Contents:
    """Sub-plants, pieces of branches and explicit polygons, each in one terminal tetrahedron.

    Attributes
    ----------
    subplants : Branches of n
    subplant_cell : (n,) int32
        Node of the tree that holds each.
    subplant_amounts : Amounts of n
    pieces : Pieces of m
    piece_cell : (m,) int32
    piece_amounts : Amounts of m
    polygons : Polygons of k
    polygon_cell : (k,) int32
    polygon_amounts : Amounts of k
    """

    subplants: Branches
    subplant_cell: NDArray[np.int32]
    subplant_amounts: Amounts
    pieces: Pieces
    piece_cell: NDArray[np.int32]
    piece_amounts: Amounts
    polygons: Polygons = field(default_factory=Polygons.empty)
    polygon_cell: NDArray[np.int32] = field(default_factory=_NONE.copy)
    polygon_amounts: Amounts = field(default_factory=Amounts.empty)

    @classmethod
    def of(
        cls, flora: Flora, subplants: Branches, subplant_cell: NDArray, pieces: Pieces, piece_cell: NDArray
    ) -> Contents:
        """Parts of plants in cells, with their amounts."""
        amounts = subplant_amounts(flora, subplants), piece_amounts(flora, pieces)
        return cls(subplants, subplant_cell, amounts[0], pieces, piece_cell, amounts[1])

    @classmethod
    def of_plants(cls, flora: Flora, seeds: Seeds) -> Contents:
        """Whole plants, all in the root."""
        return cls.of(flora, trunks(flora.rows, seeds), np.zeros(len(seeds), np.int32), Pieces.empty(), _NONE)

    @classmethod
    def of_polygons(cls, polygons: Polygons, large: NDArray[np.bool_] | None = None) -> Contents:
        """Polygons, all in the root; large ones (k,) are drawn as they are whatever is decided about their cells."""
        amounts = polygon_amounts(polygons)
        if large is not None:
            amounts = replace(amounts, width=np.where(large, np.inf, amounts.width))
        return replace(
            cls.empty(), polygons=polygons, polygon_cell=np.zeros(len(polygons), np.int32), polygon_amounts=amounts
        )

    @classmethod
    def empty(cls) -> Contents:
        """Nothing."""
        return cls(Branches.empty(), _NONE, Amounts.empty(), Pieces.empty(), _NONE, Amounts.empty())

    @property
    def cells(self) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
        """Nodes of sub-plants, of pieces and of polygons."""
        return self.subplant_cell, self.piece_cell, self.polygon_cell

    @cached_property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return _nbytes(self)

    def within(self, chosen: NDArray[np.bool_]) -> Contents:
        """The part that lies in chosen nodes; ``chosen`` is (nodes,) bool."""
        return self.take(*(chosen[c] for c in self.cells))

    def take(self, subplants: NDArray[np.bool_], pieces: NDArray[np.bool_], polygons: NDArray[np.bool_]) -> Contents:
        """Selection by masks (n,), (m,) and (k,)."""
        s, p, q = (np.flatnonzero(mask) for mask in (subplants, pieces, polygons))
        return Contents(
            self.subplants.take(s),
            self.subplant_cell[s],
            self.subplant_amounts.take(s),
            self.pieces.take(p),
            self.piece_cell[p],
            self.piece_amounts.take(p),
            self.polygons.take(q),
            self.polygon_cell[q],
            self.polygon_amounts.take(q),
        )

    @classmethod
    def joined(cls, parts: Sequence[Contents]) -> Contents:
        """All of several together."""
        if len(parts) < 2:
            return parts[0] if parts else cls.empty()
        return cls(
            Branches.concatenate([p.subplants for p in parts]),
            np.concatenate([p.subplant_cell for p in parts]),
            Amounts.concatenate([p.subplant_amounts for p in parts]),
            Pieces.concatenate([p.pieces for p in parts]),
            np.concatenate([p.piece_cell for p in parts]),
            Amounts.concatenate([p.piece_amounts for p in parts]),
            Polygons.concatenate([p.polygons for p in parts]),
            np.concatenate([p.polygon_cell for p in parts]),
            Amounts.concatenate([p.polygon_amounts for p in parts]),
        )

    def sums(self, nodes: int) -> Amounts:
        """What each of a number of nodes holds."""
        amounts = [getattr(self, f"{kind}_amounts") for kind in _KINDS]
        return sums(Amounts.concatenate(amounts), np.concatenate(self.cells), nodes)

    def bounding_box(self, flora: Flora) -> NDArray[np.float64]:
        """Axis-aligned box (2, 3) of all that is there, metres."""
        boxes = [bounding_box(flora, self.subplants)] if len(self.subplants) else []
        boxes += [self.polygons.bounding_box()] if len(self.polygons) else []
        return np.stack([np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)])


class Holdings:
    """Contents of a tree that is being divided: what lies in divided nodes is taken out, the rest is never copied.

    Parameters
    ----------
    contents : Contents
        Of all terminal nodes.
    """

    def __init__(self, contents: Contents) -> None:
        self._parts = [contents]

    @property
    def contents(self) -> Contents:
        """All together; copies them into one, which is then kept until something changes."""
        self._parts = [Contents.joined([_living(p) for p in self._parts])]
        return self._parts[0]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of sub-plants, pieces and polygons."""
        return tuple(int(sum((part.cells[kind] >= 0).sum() for part in self._parts)) for kind in range(len(_KINDS)))

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays, of what has been taken out but not yet left behind as well."""
        return sum(part.nbytes for part in self._parts)

    def put(self, contents: Contents) -> None:
        """Add contents."""
        self._parts.append(contents)

    def take_out(self, chosen: NDArray[np.bool_]) -> Contents:
        """Remove and return what lies in chosen nodes; ``chosen`` is (nodes,) bool."""
        out, kept = [], []
        for part in self._parts:
            masks = [chosen[np.maximum(c, 0)] & (c >= 0) for c in part.cells]
            if not any(m.any() for m in masks):
                kept.append(part)
                continue
            out.append(part.take(*masks))
            # What is taken is only marked here; copying what stays would cost more than all else that moves.
            cells = [np.where(m, np.int32(-1), c) for m, c in zip(masks, part.cells, strict=True)]
            part = replace(part, **{f"{kind}_cell": c for kind, c in zip(_KINDS, cells, strict=True)})
            if 2 * sum((c < 0).sum() for c in cells) > sum(map(len, cells)):
                part = _living(part)
            kept.append(part)
        self._parts = kept
        return Contents.joined(out)


def _nbytes(thing: object) -> int:
    if isinstance(thing, np.ndarray):
        return thing.nbytes
    return sum(_nbytes(getattr(thing, f.name)) for f in fields(thing)) if is_dataclass(thing) else 0


def _living(part: Contents) -> Contents:
    """Without what has been taken out."""
    masks = [c >= 0 for c in part.cells]
    return part if all(m.all() for m in masks) else part.take(*masks)


def large_polygons(polygons: Polygons, camera: Camera) -> NDArray[np.bool_]:
    """Polygons (n,) for which no facet could stand, other than leaves, which several may be drawn as one."""
    meshes, face = polygons.meshes, polygons.face
    optical = polygons.areas() * np.where(meshes.solid[face], 0.5, 1.0)
    return ~meshes.leaf[face] & (optical >= (LARGE * camera.extent_around(polygons.centre)) ** 2)


def bounding_cylinders(flora: Flora, subplants: Branches) -> tuple[NDArray, NDArray, NDArray]:
    """Cylinders about the sub-plants' branches that hold all of their vertices, whatever the seed.

    Returns
    -------
    centre : (n, 3) float64
        Metres, world space.
    radius, half_height : (n,) float64
        Across and along the branch's axis, metres.
    """
    bodies = bounding_bodies(flora, subplants)
    return bodies[:3].T, bodies[6] + bodies[8], bodies[7] + bodies[8]


def bounding_box(flora: Flora, subplants: Branches) -> NDArray[np.float64]:
    """Axis-aligned box (2, 3) of all sub-plants' bounds, metres."""
    bodies = bounding_bodies(flora, subplants)
    axis = np.abs(bodies[3:6])
    reach = bodies[7] * axis + bodies[6] * np.sqrt(np.maximum(1 - axis**2, 0)) + bodies[8]
    return np.stack([(bodies[:3] - reach).min(axis=1), (bodies[:3] + reach).max(axis=1)])
