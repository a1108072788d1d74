# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The year of a species: when its leaves appear, grow, turn and fall, in dates that are published, and their colors.

Dates are days of the year, 1 to 365, at a latitude that the species names. How far they move with the latitude is
measured in Europe; Hopkins' law of four days a degree ("Periodical events and natural law as guides to agricultural
research and practice", 1918) is that of eastern North America.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..parameters import Rgb, described, limited

DAYS = 365.0
"""Length of the year; a date beyond it is one of the next year."""
MAX_AUTUMN = 4
"""Autumn colors of a kind of leaf at most."""
#: Days by which spring comes later for each degree toward the pole (birch's bud burst in Europe from 44° to 68° N in
#: 2010, first leaves of others 1.6 to 2.7: results of the BEAGLE project), and by which autumn comes earlier: leaves
#: turn by .5 to 3 days a degree (Menzel, Estrella and Fabian, "Spatial and temporal variability of the phenological
#: seasons in Germany", 2001, and others).
_SPRING_DAYS, _AUTUMN_DAYS = 2.2, 2.0
_MIDSUMMER, _MIDWINTER = 190.0, 10.0
#: No leaf is farther from the mean than so many standard deviations.
_FARTHEST = 2.8


@dataclass(frozen=True)
class LeafYear:
    """The year of one kind of leaves; those of a plant differ by what their keys say.

    Days on which half of the leaves have done a thing come each later than the one before by less than a year; those
    beyond `DAYS` lie in the next year. Spreads are standard deviations among the leaves of a plant.
    """

    appear: float = limited(..., 1, DAYS, "day on which half of the leaves have appeared")
    turn: float = limited(..., 1, 2 * DAYS, "day on which half of them have changed their color")
    fall: float = limited(..., 1, 2 * DAYS, "day on which half of them have fallen")
    appear_spread: float = limited(4.0, 0, 60, "spread of the day on which they appear", "days")
    growth: float = limited(25.0, 0, 120, "time in which a leaf grows to its full size", "days")
    fresh: Rgb | None = described(None, "color of a leaf that has just appeared; as in summer without", "linear RGB")
    turn_spread: float = limited(8.0, 0, 60, "spread of the day on which they turn", "days")
    turning: float = limited(14.0, 0, 90, "time in which a leaf changes its color", "days")
    #: Linear RGB of leaves that have turned, at most `MAX_AUTUMN` of them; none for leaves that fall as they are.
    autumn: tuple[Rgb, ...] = ()
    fall_spread: float = limited(5.0, 0, 60, "spread of the day on which they fall beyond that of turning", "days")
    dry: Rgb = described((0.21, 0.115, 0.052), "color of dead leaves that hang on", "linear RGB")
    kept: float = limited(0.0, 0, 1, "fraction of the leaves that hang on, dry, until the next ones appear")
    turnover: float = limited(1.0, 0, 1, "fraction of the leaves that all this happens to each year; others stay")

    @property
    def middle(self) -> float:
        """Day in the middle of the leaves' life."""
        return (self.appear + self.fall) / 2

    @property
    def origin(self) -> float:
        """Day half a year before that, from which tables and the days of leaves are counted."""
        return self.middle - DAYS / 2


@dataclass(frozen=True)
class Year:
    """The year of a species; where it has none for leaves or blossoms, these are there all year."""

    latitude: float = limited(50.0, 0, 70, "latitude at which its dates hold", "degrees north")
    spring: float = limited(5.0, 0, 40, "time by which plants of one place are earlier or later at most", "days")
    autumn: float = limited(7.0, 0, 40, "the same in autumn", "days")
    leaf: LeafYear | None = None
    blossom: LeafYear | None = None
    #: Plants are gone while there are none, and in a summer without days.
    fallen: bool = described(False, "whether it is nothing but leaves that have fallen")
    source: str = described("", "where the dates are from")

    def of_kind(self, kind: int) -> LeafYear | None:
        """That of a kind of leaves, by its index in `species.LEAF_KINDS`."""
        return (self.leaf, self.blossom)[kind]

    def at_latitude(self, latitude: float) -> Year:
        """The same at another latitude of the northern hemisphere, degrees."""
        north = latitude - self.latitude
        if north == 0.0:
            return self
        leaf, blossom = (None if one is None else _moved(one, north) for one in (self.leaf, self.blossom))
        return replace(self, latitude=latitude, leaf=leaf, blossom=blossom)


def _moved(one: LeafYear, north: float) -> LeafYear:
    """Dates so many degrees farther north: those before midsummer later, those after it earlier, and never swapped.

    Where the year of the leaves would close, far in the south, the first and the last of them stay apart.
    """
    appear, turn, fall = (day + _days_north(day) * north for day in (one.appear, one.turn, one.fall))
    farthest = DAYS - _FARTHEST * (one.appear_spread + one.turn_spread + one.fall_spread)
    longest = max(farthest, one.fall - one.appear)
    over = max(0.0, fall - appear - longest) / 2
    appear, turn, fall = appear + over, turn - over, fall - over
    turn = max(turn, appear + one.growth)
    fall = min(max(fall, turn + one.turning / 2), appear + longest)
    return replace(one, appear=appear, turn=min(turn, fall), fall=fall)


def _days_north(day: float) -> float:
    """Days by which a date moves for a degree; nothing at midsummer and midwinter, between which it goes smoothly."""
    day = (day - _MIDWINTER) % DAYS
    half = _MIDSUMMER - _MIDWINTER
    spring = day < half
    place = day / half if spring else (day - half) / (DAYS - half)
    near = min(1.0, 4.0 * min(place, 1.0 - place))
    return near * (_SPRING_DAYS if spring else -_AUTUMN_DAYS)
