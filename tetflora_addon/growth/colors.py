# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Colors of leaves and branches, as the day of the year has them."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Integers, Keys, Table, gathered
from .hashing import Draw, signed
from .seasons import Stages, autumn_colors, in_season

#: How much brighter or darker than the mean leaves that have turned or died are at most, as a fraction.
_UNEVEN = 0.25


def leaf_colors(
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
    deviation = signed(key, Draw.LEAF_COLOR)
    if outward is None:
        colors = _colors(rows["leaf_color"][row], deviation)
    else:
        mean = mean_leaf_colors(rows, row, outward, young)
        colors = np.clip(mean + rows["leaf_color"][row, 1] * deviation[:, None], 0, 1)
    return colors if stages is None else leaf_colors_at(rows, row, colors, stages, hue, deviation)


def leaf_colors_at(
    rows: Table, row: Integers, summer: Floats, stages: Stages, hue: Floats, deviation: Floats | float = 0.0
) -> Floats:
    """Linear RGB (n, 3) of leaves at their stages, from those in summer (n, 3) and hues of their plants (n,).

    ``deviation`` (n,) is how bright leaves are that have turned or died, −1 to 1.
    """
    year = rows["year"][row]
    uneven = 1.0 + _UNEVEN * np.reshape(deviation, (-1, 1))
    autumn = autumn_colors(year, hue, stages.tint) * uneven
    colors = in_season(summer, year["fresh"], stages, autumn, year["dry"] * uneven)
    return np.clip(colors, 0, 1, out=colors)


def mean_leaf_colors(rows: Table, row: Integers, outward: Floats, young: Floats) -> Floats:
    """Mean linear RGB (n, 3) of leaves of rows (n,) at places between inside (0) and outside (1) of the crown.

    ``young`` (n,) is their `youth`.
    """
    inside, tip, new = (
        gathered(colors, row) for colors in (rows["leaf_color"][:, 0], rows["leaf_color_tip"], rows["leaf_color_young"])
    )
    mean = inside + (tip - inside) * outward[:, None]
    if (new != inside).any():
        mean += (new - inside) * young[:, None]
    return mean


def branch_colors(rows: Table, row: Integers, key: Keys) -> Floats:
    """Linear RGB (n, 3) of branches of the rows (n,), or all of one row (1,)."""
    return _colors(rows["branch_color"][row], signed(key, Draw.BRANCH_COLOR))


def _colors(color: Floats, draw: Floats) -> Floats:
    mean, variation = color.transpose(1, 2, 0)
    out = variation * draw
    out += mean
    return np.clip(out, 0, 1, out=out).T
