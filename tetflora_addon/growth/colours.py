# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of leaves and branches, as the day of the year has them."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Integers, Keys, Table, gathered
from .hashing import Draw, signed
from .seasons import Stages, autumn_colours, in_season

#: How much brighter or darker than the mean leaves that have turned or died are at most, as a fraction.
_UNEVEN = 0.25


def leaf_colours(
    rows: Table,
    row: Integers,
    key: Keys,
    outward: Floats | None = None,
    young: Floats | None = None,
    stages: Stages | None = None,
    hue: Floats | None = None,
) -> Floats:
    """Linear RGB (n, 3) of leaves of the rows (n,), or all of one row (1,).

    ``outward`` (n,) is 0 inside the crown, ``young`` (n,) is `foliage.youth`; both or neither are given. ``stages`` are
    the leaves' own, and ``hue`` (n,) is that of their plants, where they may not be as in summer.
    """
    deviation = signed(key, Draw.LEAF_COLOUR)
    if outward is None:
        colours = _colours(rows["leaf_colour"][row], deviation)
    else:
        mean = mean_leaf_colours(rows, row, outward, young)
        colours = np.clip(mean + rows["leaf_colour"][row, 1] * deviation[:, None], 0, 1)
    return colours if stages is None else leaf_colours_at(rows, row, colours, stages, hue, deviation)


def leaf_colours_at(
    rows: Table, row: Integers, summer: Floats, stages: Stages, hue: Floats, deviation: Floats | float = 0.0
) -> Floats:
    """Linear RGB (n, 3) of leaves at their stages, from those in summer (n, 3) and hues of their plants (n,).

    ``deviation`` (n,) is how bright leaves are that have turned or died, −1 to 1.
    """
    year = rows["year"][row]
    uneven = 1.0 + _UNEVEN * np.reshape(deviation, (-1, 1))
    autumn = autumn_colours(year, hue, stages.tint) * uneven
    colours = in_season(summer, year["fresh"], stages, autumn, year["dry"] * uneven)
    return np.clip(colours, 0, 1, out=colours)


def mean_leaf_colours(rows: Table, row: Integers, outward: Floats, young: Floats) -> Floats:
    """Mean linear RGB (n, 3) of leaves of rows (n,) at places between inside (0) and outside (1) of the crown.

    ``young`` (n,) is their `youth`.
    """
    inside, tip, new = (
        gathered(colours, row)
        for colours in (rows["leaf_colour"][:, 0], rows["leaf_colour_tip"], rows["leaf_colour_young"])
    )
    mean = inside + (tip - inside) * outward[:, None]
    if (new != inside).any():
        mean += (new - inside) * young[:, None]
    return mean


def branch_colours(rows: Table, row: Integers, key: Keys) -> Floats:
    """Linear RGB (n, 3) of branches of the rows (n,), or all of one row (1,)."""
    return _colours(rows["branch_colour"][row], signed(key, Draw.BRANCH_COLOUR))


def _colours(colour: Floats, draw: Floats) -> Floats:
    mean, variation = colour.transpose(1, 2, 0)
    out = variation * draw
    out += mean
    return np.clip(out, 0, 1, out=out).T
