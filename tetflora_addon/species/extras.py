# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading dead branches of a species file, and which they are where it only says how many."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..parameters import FileReader
from .species import Dead, Order

#: Of the wood that has lost its bark, and of bark without life.
_GREY = [[0.14, 0.122, 0.102], [0.03, 0.027, 0.023]]
#: Dead branches of a species that only says how many: broken off or bare, with bare twigs.
DEFAULT_DEAD = (
    {
        "length": [0.06, 0.045], "thickness": [0.085, 0.025], "taper": [0.45, 0.2], "segments": 4, "sides": 4,
        "curvature": [0, 60], "angle": [88, 14], "angle_tip": 70, "azimuth": [137.5, 60], "branches": [6, 3],
        "branch_start": 0.2, "branch_colour": _GREY,
    },
    {
        "length": [0.4, 0.26], "thickness": [0.32, 0.08], "taper": 0.4, "segments": 3, "sides": 3,
        "curvature": [0, 80], "angle": [58, 18], "azimuth": [137.5, 40], "branch_colour": _GREY,
    },
)  # fmt: skip


def read_dead(reader: FileReader, data: Any, name: str, read_order: Callable[[Any, str, bool], Order]) -> Dead:
    """The key ``dead`` of a species.

    Parameters
    ----------
    reader : FileReader
    data : object
    name : str
        Of the key.
    read_order : callable
        Makes an order from its data, its name, and whether it is the last.

    Raises
    ------
    SpeciesError
        Names the field and what it may be.
    """

    def read_orders(value: Any, name: str) -> tuple[Order, ...]:
        if not isinstance(value, list) or not 1 <= len(value) <= 2:
            raise reader.fail(name, "must be a list of 1 or 2 orders: dead branches, and twigs on them")
        return tuple(read_order(one, f"{name}[{i}]", i == len(value) - 1) for i, one in enumerate(value))

    whole = {"orders": list(DEFAULT_DEAD), **data} if isinstance(data, dict) else data
    dead = reader.read(Dead, whole, name, {"orders": read_orders})
    for i, order in enumerate(dead.orders):
        for key in ("leaves", "spurs", "forks", "flare", "pipe"):
            value = getattr(order, key)
            if (value if isinstance(value, float) else value.high) > 0:
                raise reader.fail(f"{name}.orders[{i}].{key}", "must be 0: dead branches are bare and do not grow")
    return dead


def dead_part(dead: Dead, start: float) -> tuple[float, float]:
    """From where to where dead branches are, fractions of an axis that is bare up to a fraction of it."""
    return dead.low * start, start + dead.high * (1 - start)
