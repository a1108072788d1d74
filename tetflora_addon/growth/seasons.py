# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Seasons: what stage each leaf is in on a day, as a function of its key, its plant and its species' year.

Every leaf appears, grows, turns and falls on days of its own, which follow from its key, and every plant is early or
late, and has autumn colors of its own, by its key. What that comes to on average for a plant on a day is a table of
days for each kind of leaves, made once from the same functions, so that whatever is not grown agrees with what is.

Rows of a flora on a day have the column of `YEAR_COLUMN` besides; others have not, and nothing here costs them
anything. Branches of such a flora have a ``year``: the day that it is for their plant, and where the plant stands
among the autumn colors of its species. Colors of leaves and branches are as the day has them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..arrays import Arrays, Floats, Integers, Keys, Mask, Table, gathered, smoothstep
from ..errors import TetFloraError
from ..parameters import FACTOR, setting
from ..species.species import DAYS, LEAF_KINDS, MAX_AUTUMN, LeafYear, Species
from .hashing import Draw, mix_draw, signed, uniform
from .rows import with_columns

#: Bits of a leaf's number for its days, for its color, and for whether it follows the year at all.
_BITS, _TINT_BITS = 13, 12
#: Quantiles of deviations from a mean day in standard deviations: logistic, as courses of bud burst and leaf fall are,
#: without the last hundredth at either end.
_EVEN = 0.01 + 0.98 * (np.arange(1 << _BITS) + 0.5) / (1 << _BITS)
_DEVIATIONS = np.sqrt(3) / np.pi * np.log(_EVEN / (1 - _EVEN))
_DEVIATIONS /= _DEVIATIONS.std()
#: Size of a leaf that has just appeared; what it takes to lose its fresh color, in times of growth.
_FIRST_SIZE, _FRESH = 0.12, 1.6
#: How far the colors of a plant's leaves follow the plant rather than each leaf by itself.
_OF_PLANT = 0.5
_STEP = 0.5  # days between two entries of tables, and nodes of the integrals from which they are made
_NODES = 64
PRESENT, SIZE, AREA, FRESH, AUTUMN, DRY = range(6)
"""Rows of tables: expected number of leaves there are, sum of their sizes and of the squares of these, all over what
it is in summer; and the parts of the last that have the fresh color, those of autumn, and that of dead leaves."""


@dataclass(frozen=True)
class Season:
    """A day of the year at a place. Fields with a label are properties of a scene, and documented by their tooltips.

    Raises
    ------
    TetFloraError
        A number that is none or is out of its limits.
    """

    day: float = setting(
        196.0,
        "Day of Year",
        "Day of the year, 1 to 365: 15 is mid January, 105 mid April, 196 mid July, 288 mid October. Animate it to go "
        "through the year; beyond 365 the next year begins",
        soft_min=1.0,
        soft_max=365.0,
        min=0.0,
        max=100_000.0,
        precision=1,
    )
    latitude: float = setting(
        50.0,
        "Latitude",
        "Degrees north. Toward the pole spring comes later and autumn earlier; negative ones are south of the equator, "
        "where seasons are half a year apart",
        min=-70.0,
        max=70.0,
        precision=1,
    )
    spread: float = setting(
        1.0,
        "Spread",
        "How far plants are ahead of or behind each other: 1 as much as their species says, 0 all on the same day",
        subtype='FACTOR',
        min=0.0,
        max=2.0,
    )
    snow: float = setting(
        0.0, "Snow", "Snow on leaves, branches and ground: 0 none, 1 on all that faces the sky", **FACTOR
    )

    def __post_init__(self) -> None:
        if not np.isfinite([self.day, self.latitude, self.spread, self.snow]).all():
            raise TetFloraError("Seasons: Day of Year, Latitude, Spread and Snow must be finite numbers")
        if abs(self.latitude) > 90 or self.spread < 0 or not 0 <= self.snow <= 1:
            raise TetFloraError("Seasons: Latitude must be within 90°, Spread 0 or greater, and Snow between 0 and 1")

    @property
    def northern_day(self) -> float:
        """The day at this place as in the north: south of the equator seasons are half a year apart."""
        return (self.day + (DAYS / 2 if self.latitude < 0 else 0.0)) % DAYS


_LEAF_DTYPE = np.dtype(
    [(name, np.float64) for name in ("appear", "turn", "fall", "origin", "growth", "turning", "kept", "turnover")]
    + [(name, np.float64) for name in ("appear_spread", "turn_spread", "fall_spread")]
    + [("any_fresh", np.bool_), ("colors", np.int64), ("fresh", np.float64, (3,)), ("dry", np.float64, (3,))]
    + [("autumn", np.float64, (MAX_AUTUMN, 3))]
)
YEAR_COLUMN = [("year", _LEAF_DTYPE), ("follows", np.bool_)]
YEAR_COLUMN += [(name, np.float64) for name in ("day", "middle", "spring", "autumn")]
"""``year`` are the days of the leaves that the row bears, counted from ``origin``, half a year before the middle of
their life, and of the fall those after the change of color; ``follows`` whether there are any; ``day`` is the scene's,
``middle`` that in the middle of the leaves' life, ``spring`` and ``autumn`` days by which plants differ."""


def seasonal_rows(rows: Table, species: Sequence[Species], season: Season) -> Table:
    """Rows (r,), which count through some species, on a day of the year: with `YEAR_COLUMN` besides."""
    out = with_columns(rows, YEAR_COLUMN)
    out["day"] = season.northern_day
    out["year"]["turnover"] = 0.0
    for number, one in enumerate(species):
        chosen = rows["species"] == number
        if one.year is None:
            continue
        year = one.year.at_latitude(abs(season.latitude))
        first = year.leaf or year.blossom
        out["middle"][chosen] = first.middle % DAYS if first is not None else 0.0
        out["spring"][chosen], out["autumn"][chosen] = season.spread * year.spring, season.spread * year.autumn
        for kind in range(len(LEAF_KINDS)):
            leaf = year.of_kind(kind)
            if leaf is not None:
                out["year"][chosen & (rows["leaf_kind"] == kind)] = _numbers(leaf)
                out["follows"][chosen & (rows["leaf_kind"] == kind)] = True
    return out


def is_seasonal(rows: Table) -> bool:
    """Whether rows are those of a flora on a day of the year."""
    return "year" in rows.dtype.names


def _numbers(leaf: LeafYear) -> np.void:
    """The days of a kind of leaves, counted from half a year before the middle of their life."""
    out = np.zeros((), _LEAF_DTYPE)
    for name in ("growth", "turning", "kept", "turnover", "appear_spread", "turn_spread", "fall_spread", "dry"):
        out[name] = getattr(leaf, name)
    out["origin"] = leaf.origin
    out["appear"], out["turn"] = leaf.appear - leaf.origin, leaf.turn - leaf.origin
    out["fall"] = leaf.fall - leaf.turn
    out["any_fresh"], out["colors"] = leaf.fresh is not None, len(leaf.autumn)
    out["fresh"] = leaf.fresh or 0.0
    out["autumn"][: len(leaf.autumn)] = np.reshape(leaf.autumn, (-1, 3))
    return out


def plant_years(rows: Table, row: Integers, key: Keys) -> Floats | None:
    """The day that it is for plants (n, 2), and where they stand among autumn colors, 0 to 1; None without seasons.

    Parameters
    ----------
    row, key : (n,) int and (n,) uint64
        Of their trunks.
    """
    if not is_seasonal(rows):
        return None
    # Column by column: whole rows of a million plants are gigabytes.
    day, middle, spring_spread, autumn_spread = (rows[name][row] for name in ("day", "middle", "spring", "autumn"))
    # Spring's order passes into that of autumn where nothing happens, in the weeks around midsummer and midwinter.
    spring = np.clip(0.5 - 2.0 * np.sin(2 * np.pi * (day - middle) / DAYS), 0.0, 1.0)
    early, late = (2.0 * uniform(key, draw) - 1.0 for draw in (Draw.SPRING, Draw.AUTUMN))
    ahead = spring * spring_spread * early + (1.0 - spring) * autumn_spread * late
    return np.stack([day - ahead, uniform(key, Draw.AUTUMN_HUE)], axis=1)


def may_change(rows: Table, row: Integers, year: Floats) -> bool:
    """Whether some leaves on rows (n,) or (1,), of plants with years (n, 2), may not be as in summer."""
    leaf = rows["year"][row]
    day = (year[:, 0] - leaf["origin"]) % DAYS
    most = _DEVIATIONS[-1]
    growing = np.where(leaf["any_fresh"], _FRESH, 1.0) * leaf["growth"]
    new = day < leaf["appear"] + most * leaf["appear_spread"] + growing
    old = day > leaf["turn"] - most * leaf["turn_spread"] - np.maximum(leaf["turning"] / 2, -leaf["fall"])
    return bool((rows["follows"][row] & (new | old)).any())


@dataclass(frozen=True)
class Stages(Arrays):
    """Stages of leaves (n,)."""

    present: Mask  # (n,): not yet to come and not fallen
    size: Floats  # (n,): over that in summer
    #: fresh, turned and dead, (n,): how far each has the fresh color, that of autumn, and that of dead leaves.
    fresh: Floats
    turned: Floats
    dead: Floats
    tint: Floats  # (n,): its place among the autumn colors but for what is the plant's, 0 to 1


def leaf_stages(rows: Table, row: Integers, key: Keys, day: Floats) -> Stages:
    """Stages of leaves on rows (n,) or (1,), with keys (n,), on days (n,) of their plants."""
    bits = mix_draw(key, Draw.LEAF_YEAR)
    mask = np.uint64((1 << _BITS) - 1)
    place = [((bits >> np.uint64(64 - _BITS * (i + 1))) & mask).astype(np.int64) for i in range(4)]
    tint = (bits & np.uint64((1 << _TINT_BITS) - 1)).astype(np.float64) / (1 << _TINT_BITS)
    year = rows["year"][row]
    day = np.broadcast_to((day - year["origin"]) % DAYS, len(key))
    first, turns, falls = (_DEVIATIONS[p] for p in place[:3])
    arrived, size, fresh = _springtime(year, day, first)
    hangs, turned = _autumntime(year, day, turns, falls)
    chance = (place[3] + 0.5) / (1 << _BITS)
    follows = chance < year["turnover"]
    alive = arrived & hangs
    present = alive | ~follows | (chance < year["turnover"] * year["kept"])
    live = alive & follows
    size, fresh, turned = (np.where(live, of, other) for of, other in ((size, 1.0), (fresh, 0.0), (turned, 0.0)))
    return Stages(present, size, fresh, turned, (follows & ~alive).astype(np.float64), tint)


def _springtime(year: np.void | Table, day: Floats, deviation: Floats) -> tuple[Mask, Floats, Floats]:
    """Whether leaves have appeared, their sizes, and how fresh they are; (...) as days and deviations together."""
    age = day - year["appear"] - year["appear_spread"] * deviation
    growth = np.maximum(year["growth"], 1e-6)
    size = _FIRST_SIZE + (1.0 - _FIRST_SIZE) * smoothstep(age / growth)
    return age >= 0.0, size, np.where(year["any_fresh"], 1.0 - smoothstep(age / (_FRESH * growth)), 0.0)


def _autumntime(year: np.void | Table, day: Floats, turns: Floats, falls: Floats) -> tuple[Mask, Floats]:
    """Whether leaves still hang, and how far they have turned; likewise."""
    since = day - year["turn"] - year["turn_spread"] * turns
    turned = np.where(year["colors"] > 0, smoothstep(since / np.maximum(year["turning"], 1e-6) + 0.5), 0.0)
    return since < year["fall"] + year["fall_spread"] * falls, turned


@lru_cache(maxsize=256)
def leaf_table(leaf: LeafYear | None) -> Floats:
    """What to expect of leaves (6, t) every half day from half a year before the middle of their life; see `PRESENT`.

    All stages of spring are independent of those of autumn, so that expectations of their products are products.
    """
    days = np.arange(round(DAYS / _STEP) + 1) * _STEP
    if leaf is None:
        return np.repeat([[1.0], [1.0], [1.0], [0.0], [0.0], [0.0]], len(days), axis=1)
    year = _numbers(leaf)
    deviations = _DEVIATIONS.reshape(_NODES, -1).mean(axis=1)
    arrived, size, fresh = _springtime(year, days[:, None], _DEVIATIONS.reshape(8 * _NODES, -1).mean(axis=1))
    hangs, turned = _autumntime(year, days[:, None, None], deviations[:, None], deviations)
    number, lengths, area, young = ((arrived * v).mean(axis=1) for v in (1.0, size, size**2, size**2 * fresh))
    held, colored = hangs.mean(axis=(1, 2)), (hangs * turned).mean(axis=(1, 2))
    gone = leaf.kept * (1.0 - number * held)  # and hangs on
    sums = (number * held + gone, lengths * held + gone, area * held + gone)
    out = np.stack([*sums, young * (held - colored), area * colored, gone])
    out *= leaf.turnover
    out[:3] += 1.0 - leaf.turnover
    return out


def expected(
    tables: Floats, origin: Floats, which: Integers, day: Floats, columns: Sequence[int] = range(6)
) -> list[Floats]:
    """What to expect of leaves, some columns (n,) each, on days (n,), from some (n,) of tables (k, 6, t).

    ``origin`` (k,) are the days on which the tables begin.
    """
    days = tables.shape[2]
    place = ((day - origin[which]) % DAYS) / _STEP
    low = np.minimum(place.astype(np.int64), days - 2)
    place -= low
    low += which * (6 * days)
    flat, out = tables.reshape(-1), []
    for column in columns:
        before = np.take(flat, low + column * days)
        out.append(before + place * (np.take(flat, low + (column * days + 1)) - before))
    return out


def plant_days(day: float, most: float) -> Floats:
    """Days (n,) that it may be for plants that are early or late by at most so many, no more than half a day apart."""
    return day + np.linspace(-most, most, 4 * int(np.ceil(most)) + 1)


def expected_of(leaf: LeafYear | None, days: Floats, column: int) -> Floats:
    """What to expect of leaves with a year, one column (n,), on days (n,)."""
    origin = np.array([0.0 if leaf is None else leaf.origin])
    return expected(leaf_table(leaf)[None], origin, np.zeros(len(days), np.int64), days, [column])[0]


def autumn_colors(year: Table, hue: Floats, tint: Floats) -> Floats:
    """Autumn colors (n, 3) of leaves, from their years (n,) or (1,), the hues (n,) of plants and their own tints."""
    number = np.maximum(year["colors"], 1)
    place = (1.0 - _OF_PLANT) * tint + _OF_PLANT * hue
    which = np.minimum((place * number).astype(np.int64), number - 1)
    autumn = year["autumn"]
    return autumn[0][which] if len(autumn) == 1 else autumn[np.arange(len(which)), which]


def mean_autumn_colors(year: Table, hue: Floats) -> Floats:
    """Means (n, 3) of the same over the leaves of plants with hues (n,)."""
    number = np.maximum(year["colors"], 1)[:, None]
    first = (_OF_PLANT * hue)[:, None]
    inside = np.clip(np.arange(MAX_AUTUMN + 1) / number, first, first + 1.0 - _OF_PLANT)
    return np.einsum("nk,nkc->nc", np.diff(inside, axis=1) / (1.0 - _OF_PLANT), year["autumn"])


def is_gone(species: Species, season: Season | None) -> bool:
    """Whether no plant of a species is there in a season, because its leaves have not fallen yet or are rotten.

    Without seasons it is summer, when there are none.
    """
    if species.year is None or species.year.leaf is None or not species.year.fallen:
        return False
    if season is None:
        return True
    year = species.year.at_latitude(abs(season.latitude))
    days = plant_days(season.northern_day, season.spread * max(year.spring, year.autumn))
    return not expected_of(year.leaf, days, PRESENT).any()


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
    colors = summer + stages.fresh[:, None] * (year["fresh"] - summer)
    colors += stages.turned[:, None] * (autumn - colors)
    colors += stages.dead[:, None] * ((year["dry"] * uneven) - colors)
    return np.clip(colors, 0, 1, out=colors)


def mean_leaf_colors(rows: Table, row: Integers, outward: Floats, young: Floats) -> Floats:
    """Mean linear RGB (n, 3) of leaves of rows (n,) at places between inside (0) and outside (1) of the crown.

    ``young`` (n,) is their `youth`.
    """
    colors = rows["leaf_color"][:, 0], rows["leaf_color_tip"], rows["leaf_color_young"]
    inside, tip, new = (gathered(of, row) for of in colors)
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
