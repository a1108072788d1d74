# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of the loop after a pass in figures, as statistics keep them."""

from __future__ import annotations

import numpy as np

from .decisions import Decision
from .loop import Refinement
from .statistics import Step


def step_of(state: Refinement) -> Step:
    """Figures of a state; has to be asked for before the loop goes on."""
    numbers = np.bincount(state.decision, minlength=len(Decision))
    explicit = state.decision == Decision.EXPLICIT
    subplants, pieces, polygons = state.holdings.sizes
    return Step(
        tetrahedra_made=int(state.tree.tetrahedra_made),
        levels=int(state.tree.levels),
        split=int(numbers[Decision.SPLIT]),
        proxy=int(numbers[Decision.PROXY]),
        hidden=int(numbers[Decision.HIDDEN]),
        explicit=int(numbers[Decision.EXPLICIT]),
        subplants=subplants,
        pieces=pieces,
        foreign=polygons,
        polygons=round(float(state.amounts.polygons[explicit].sum())),
        seconds=sum(state.seconds.values()),
        memory_mb=(state.tree.nbytes + state.holdings.nbytes) / 1e6,
    )
