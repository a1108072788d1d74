# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which blade the leaves of a species have: from their outline and from what light they let through."""

from __future__ import annotations

from math import tau

import bpy
import numpy as np
from numpy.typing import NDArray

from ...leaves.compounds import Compound
from ...leaves.models import LeafModel
from ...leaves.needles import Needles
from ...leaves.outlines import Blade
from ...species.species import LEAF_KINDS, Species
from ..materials.materials import leaf_material

#: Transmission under which leaves are needles, scales or succulent.
_THICK = 0.2
#: Width over length: under the first, veins are parallel; under the second, leaves are narrow; over the third, palmate.
_PARALLEL, _NARROW, _PALMATE = 0.15, 0.3, 0.95
#: Area over that of the convex hull, under which a leaf is lobed.
_LOBED = 0.86
#: Parallel veins across a blade.
_ACROSS = 11.0
#: Most teeth of one side in which veins end.
_FEW = 10
_DIRECTIONS = tau * np.arange(48) / 48


def species_leaf_material(species: Species, kind: str) -> bpy.types.Material:
    """TetFlora's own material for the leaves or blossoms of a species.

    Parameters
    ----------
    species : Species
        Resolved or not.
    kind : str
        One of `LEAF_KINDS`.
    """
    forms = species.forms(LEAF_KINDS.index(kind))
    model = forms[0] if isinstance(forms[0], LeafModel) else None
    through = species.leaf_transmission if kind == "leaf" else species.blossom_transmission
    leaflet = model.shape.length if model is not None and isinstance(model.shape, Compound) else 1.0
    looks = {"leaf_length": leaflet * _length(species, kind)}
    blade = "pinnate" if model is None else blade_kind(model, through, kind)
    if model is not None and (veins := _number(model, blade)):
        looks["veins"] = veins
    return leaf_material(species.name if kind == "leaf" else f"{species.name} {kind}", blade, **looks)


def blade_kind(model: LeafModel, transmission: float, kind: str = "leaf") -> str:
    """One of `blade.BLADES` for a leaf model, by its outline, else by its UV map: the pattern lies in that.

    Parameters
    ----------
    model : LeafModel
    transmission : float
        Fraction of light that is scattered through the leaf.
    kind : str
        One of `LEAF_KINDS`.
    """
    if transmission < _THICK or isinstance(model.shape, Needles):
        return "needle" if kind == "leaf" else "plain"
    if kind != "leaf":
        return "petal"
    outline = _outline(model)
    if outline is not None and not outline.palmate:
        return _simple(outline.width, outline.lobes > 0)
    if outline is not None:
        return "palmate"
    width, length = _extent(model)
    if _leaflets(model, length):
        return "plain"
    ratio = width / max(length, 1e-6)
    return "palmate" if ratio > _PALMATE else _simple(ratio, _filled(model) < _LOBED)


def _simple(ratio: float, lobed: bool) -> str:
    """Blade of a leaf with one midrib, by width over length."""
    if ratio < _NARROW:
        return "parallel" if ratio < _PARALLEL else "narrow"
    return "lobed" if lobed else "pinnate"


def _outline(model: LeafModel) -> Blade | None:
    """Outline of the leaf or of its leaflets, each of which has the whole UV map."""
    shape = model.shape.leaflet if isinstance(model.shape, Compound) else model.shape
    return shape if isinstance(shape, Blade) else None


def _number(model: LeafModel, blade: str) -> float | None:
    """Veins to a leaf's length where the outline tells: they end in lobes, and in teeth if these are few."""
    outline = _outline(model)
    if blade == "parallel":
        return _ACROSS / max(_extent(model)[0] if outline is None else outline.width, 1e-3)
    if outline is None or blade not in ("lobed", "pinnate"):
        return None
    ends = outline.lobes if blade == "lobed" else outline.teeth
    return 1.15 * (ends + 0.5) if 3 <= ends <= _FEW else None


def _extent(model: LeafModel) -> NDArray[np.floating]:
    """Width and length (2,) in the UV map."""
    return np.ptp(model.uv, axis=0)


def _leaflets(model: LeafModel, length: float) -> bool:
    """Whether most faces are much shorter than the leaf and there are many, as of compound leaves and fronds."""
    along = model.uv[:, 1]
    starts = model.face_offsets[:-1]
    spans = np.maximum.reduceat(along, starts) - np.minimum.reduceat(along, starts)
    return len(spans) >= 8 and _parts(model) >= 4 and bool(np.median(spans) < 0.4 * length)


def _parts(model: LeafModel) -> int:
    """Number of parts of the mesh that share no vertex."""
    label, edges = np.arange(len(model.positions)), model.edges[0]
    while True:
        lower = label.copy()
        np.minimum.at(lower, edges[:, 0], label[edges[:, 1]])
        np.minimum.at(lower, edges[:, 1], label[edges[:, 0]])
        if (lower == label).all():
            return len(np.unique(label))
        label = lower[lower]


def _filled(model: LeafModel) -> float:
    """Area in the UV map over that of its convex hull."""
    u, v = model.uv.T.astype(np.float64)
    area = abs(np.add.reduceat(u * v[model.next_corner] - v * u[model.next_corner], model.face_offsets[:-1])).sum() / 2
    ends = (model.uv @ np.stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])).argmax(axis=0)
    x, y = u[ends], v[ends]
    hull = abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2
    return float(area / max(hull, 1e-12))


def _length(species: Species, kind: str) -> float:
    """Mean length of leaves of a kind, metres."""
    every = [*species.orders, *([] if species.spur is None else [species.spur])]
    bearing = [order for order in every if order.leaf_kind == kind and order.leaves.mean > 0]
    sizes = [order.leaf_size.mean * (1.0 + order.leaf_size_tip) / 2.0 for order in bearing]
    return float(np.mean(sizes)) if sizes else 0.1
