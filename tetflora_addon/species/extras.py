# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading what a species file says besides orders and leaves: buds, dead branches, and growth."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .growing import Ages
from .species import Bud, Dead, Order

BUD_KEYS = ("length", "width", "lateral", "colour")
DEAD_KEYS = ("number", "from", "into", "on_limbs", "orders")
AGE_KEYS = ("full", "height", "girth", "lifespan", "decline", "base", "spread", "flowers", "scaled", "source")
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


def read_bud(reader: Any, data: Any) -> Bud | None:
    """The key ``bud`` of a species; None where there is none.

    Raises
    ------
    SpeciesError
        Names the field and what it may be.
    """
    if data is None:
        return None
    reader.keys(data, "bud", BUD_KEYS)
    return Bud(
        length=reader.number(data.get("length", 0.005), "bud.length", 0.0005, 0.1),
        width=reader.number(data.get("width", 0.5), "bud.width", 0.05, 1.5),
        lateral=reader.number(data.get("lateral", 1.0), "bud.lateral", 0, 1),
        colour=reader.rgb(data.get("colour", [0.11, 0.06, 0.035]), "bud.colour"),
    )


def read_dead(reader: Any, data: Any, read_order: Callable[[Any, str, bool], Order]) -> Dead | None:
    """The key ``dead`` of a species; None where there is none.

    Parameters
    ----------
    reader
        Of numbers and ranges, which names the file in its complaints.
    data : object
    read_order : callable
        Makes an order from its data, its name, and whether it is the last.

    Raises
    ------
    SpeciesError
        Names the field and what it may be.
    """
    if data is None:
        return None
    reader.keys(data, "dead", DEAD_KEYS)
    orders = data.get("orders", list(DEFAULT_DEAD))
    if not isinstance(orders, list) or not 1 <= len(orders) <= 2:
        raise reader.fail("dead.orders", "must be a list of 1 or 2 orders: dead branches, and twigs on them")
    read = tuple(read_order(one, f"dead.orders[{i}]", i == len(orders) - 1) for i, one in enumerate(orders))
    for i, order in enumerate(read):
        for key in ("leaves", "spurs", "forks", "flare", "pipe"):
            value = getattr(order, key)
            if (value if isinstance(value, float) else value.high) > 0:
                raise reader.fail(f"dead.orders[{i}].{key}", "must be 0: dead branches are bare and do not grow")
    low = reader.number(data.get("from", 0.25), "dead.from", 0, 0.95)
    high = reader.number(data.get("into", 0.12), "dead.into", 0.01, 0.95)
    on_limbs = reader.range(data.get("on_limbs", [0, 0]), "dead.on_limbs", 0, 1000)
    return Dead(reader.range(data.get("number", [10, 4]), "dead.number", 0, 1000), low, high, on_limbs, read)


def dead_part(dead: Dead, start: float) -> tuple[float, float]:
    """From where to where dead branches are, fractions of an axis that is bare up to a fraction of it."""
    return dead.low * start, start + dead.high * (1 - start)


def read_ages(reader: Any, data: Any) -> Ages | None:
    """The key ``age`` of a species; None where there is none.

    Raises
    ------
    SpeciesError
        Names the field and what it may be.
    """
    if data is None:
        return None
    reader.keys(data, "age", AGE_KEYS)
    if "full" not in data:
        raise reader.fail("age.full", "missing; add this key")

    def number(key: str, low: float, high: float) -> float:
        return reader.number(data.get(key, getattr(Ages, key, None)), f"age.{key}", low, high)

    def curve(key: str) -> tuple[float, float]:
        value = data.get(key, list(getattr(Ages, key)))
        if not isinstance(value, list) or len(value) != 2:
            raise reader.fail(f"age.{key}", "must be [rate, power]")
        return reader.number(value[0], f"age.{key}[0]", 0.0001, 10), reader.number(value[1], f"age.{key}[1]", 0.2, 5)

    return Ages(
        full=number("full", 0.1, 5000),
        height=curve("height"),
        girth=curve("girth"),
        lifespan=number("lifespan", 0.2, 20000),
        decline=number("decline", 0.05, 0.99),
        base=number("base", 1, 10),
        spread=number("spread", 0.2, 2),
        flowers=number("flowers", 0, 5000),
        scaled=reader.truth(data.get("scaled", False), "age.scaled"),
        source=reader.text(data.get("source", ""), "age.source", least=0),
    )
