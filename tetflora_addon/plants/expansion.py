# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening sub-plants into their branches, one order at a time or all the way."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .axes import axes
from .branches import Branches
from .compiled import Flora
from .growth import children, drawn_children
from .pieces import Pieces, whole_pieces
from .stems import Stems


def open_subplants(flora: Flora, subplants: Branches) -> tuple[Branches, NDArray[np.int64], Pieces, NDArray[np.int64]]:
    """Open sub-plants into the sub-plants of the next order and the pieces of their own branch.

    Returns
    -------
    Branches, (m,) int64, Pieces, (k,) int64
        Children with the index of the sub-plant that each comes from, and pieces with theirs.
    """
    stems, body, grown, owner = _opened(flora, subplants)
    pieces, piece_owner = whole_pieces(flora.rows, stems)
    return grown, body[owner], pieces, body[piece_owner]


def expand(flora: Flora, subplants: Branches) -> Iterator[Stems]:
    """All branches of sub-plants, to the last twig, order by order.

    Notes
    -----
    Memory grows with the number of branches; split the sub-plants with `chunks` where there are many.
    """
    while len(subplants):
        stems, _, subplants, _ = _opened(flora, subplants)
        yield stems


def _opened(flora: Flora, subplants: Branches) -> tuple[Stems, NDArray[np.int64], Branches, NDArray[np.int64]]:
    """Branches of sub-plants with the index of the sub-plant of each, and their children with that of their parent."""
    rows = flora.rows
    phantom = rows["phantom"][subplants.row]
    if phantom.any():  # a form drawn by hand: its branches are known, and opened with the plant
        plants, rest = np.flatnonzero(phantom), np.flatnonzero(~phantom)
        drawn, plant = drawn_children(rows, subplants.take(plants))
        bodies, body = Branches.concatenate([subplants.take(rest), drawn]), np.concatenate([rest, plants[plant]])
    else:
        bodies, body = subplants, np.arange(len(subplants))
    lines = axes(rows, bodies)
    return Stems(bodies, lines), body, *children(rows, bodies, lines)


def chunks(polygons: NDArray[np.float64], limit: float) -> Iterator[slice]:
    """Runs of things whose expected polygons (n,) sum up to about a limit each."""
    block = (np.cumsum(polygons) / limit).astype(np.int64)
    edges = np.flatnonzero(np.diff(block)) + 1
    for start, stop in zip([0, *edges], [*edges, len(polygons)], strict=True):
        if stop > start:
            yield slice(int(start), int(stop))
