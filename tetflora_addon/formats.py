# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Formats of what TetFlora writes: the number that each has, and the place for steps from one to the next."""

from collections.abc import Callable
from typing import Any

from .errors import quoted

#: Files of species and of biomes, and properties in .blend files. Raise one when its keys change.
FORMATS = {"species": 1, "biome": 1, "properties": 1}
#: What makes data of the next format of data of one: by what it is, and the number before. There is none yet.
STEPS: dict[tuple[str, int], Callable[[dict[str, Any]], dict[str, Any]]] = {}


def newest(what: str, data: dict[str, Any], number: object) -> dict[str, Any]:
    """Data of an item of `FORMATS` in its newest format, from that of a number.

    Raises
    ------
    ValueError
        It has a number that this version of TetFlora does not know.
    """
    last = FORMATS[what]
    if isinstance(number, bool) or number not in range(1, last + 1):
        known = f"from 1 to {last}" if last > 1 else "1"
        raise ValueError(f"must be {known} for this version of TetFlora, not {quoted(number)}; update the extension")
    for step in range(int(number), last):  # type: ignore[call-overload]
        data = STEPS[what, step](data)
    return data
