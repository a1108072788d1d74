# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The year of a species: when its leaves appear, grow, turn and fall, in dates that are published, and their colors.

Dates are days of the year, 1 to 365, at a latitude that the species names. How far they move with the latitude is
measured in Europe; Hopkins' law of four days a degree ("Periodical events and natural law as guides to agricultural
research and practice", 1918) is that of eastern North America.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

DAYS = 365.0
"""Length of the year; a date beyond it is one of the next year."""
MAX_AUTUMN = 4
"""Autumn colours of a kind of leaf at most."""
#: Days by which spring comes later for each degree towards the pole (birch's bud burst in Europe from 44° to 68° N in
#: 2010, first leaves of others 1.6 to 2.7: results of the BEAGLE project), and by which autumn comes earlier: leaves
#: turn by .5 to 3 days a degree (Menzel, Estrella and Fabian, "Spatial and temporal variability of the phenological
#: seasons in Germany", 2001, and others).
_SPRING_DAYS, _AUTUMN_DAYS = 2.2, 2.0
_MIDSUMMER, _MIDWINTER = 190.0, 10.0
#: No leaf is farther from the mean than so many standard deviations.
_FARTHEST = 2.8
LEAF_YEAR_KEYS = (
    "appear", "appear_spread", "growth", "fresh", "turn", "turn_spread", "turning", "autumn", "fall", "fall_spread",
    "dry", "kept", "turnover",
)  # fmt: skip
YEAR_KEYS = ("latitude", "spring", "autumn", "leaf", "blossom", "fallen", "source")
#: Of dead leaves that hang on, linear RGB.
_DRY = (0.21, 0.115, 0.052)

Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class LeafYear:
    """The year of one kind of leaves; those of a plant differ by what their keys say.

    Attributes
    ----------
    appear, turn, fall : float
        Days on which half of the leaves have appeared, changed their colour, and fallen; each later than the one before
        by less than a year. The latter two may lie in the next year.
    appear_spread, turn_spread, fall_spread : float
        Standard deviations among the leaves of a plant, days; of the fall, beyond that of the change of colour.
    growth, turning : float
        Days in which a leaf grows to its full size, and in which it changes its colour.
    fresh : tuple of float, optional
        Linear RGB of a leaf that has just appeared; as in summer where it is None.
    autumn : tuple of tuple of float
        Linear RGB of leaves that have turned, at most `MAX_AUTUMN` of them; none for leaves that fall as they are.
    dry : tuple of float
        Linear RGB of dead leaves that hang on.
    kept : float
        Fraction of the leaves that hang on, dry, until the next ones appear.
    turnover : float
        Fraction of the leaves that all this happens to each year; others stay as they are.
    """

    appear: float
    turn: float
    fall: float
    appear_spread: float = 4.0
    growth: float = 25.0
    fresh: Rgb | None = None
    turn_spread: float = 8.0
    turning: float = 14.0
    autumn: tuple[Rgb, ...] = ()
    fall_spread: float = 5.0
    dry: Rgb = _DRY
    kept: float = 0.0
    turnover: float = 1.0

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
    """The year of a species.

    Attributes
    ----------
    latitude : float
        Degrees north at which its dates hold.
    spring, autumn : float
        Days by which plants of one place are earlier or later than the mean, at most.
    leaf, blossom : LeafYear, optional
        Without one, leaves or blossoms are there all year.
    fallen : bool
        Nothing but leaves that have fallen: its plants are gone while there are none, and in a summer without days.
    source : str
        Where the dates are from.
    """

    latitude: float = 50.0
    spring: float = 5.0
    autumn: float = 7.0
    leaf: LeafYear | None = None
    blossom: LeafYear | None = None
    fallen: bool = False
    source: str = ""

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


def read_year(reader: Any, data: Any) -> Year | None:
    """The key ``year`` of a species; None where there is none.

    Raises
    ------
    SpeciesError
        Names the field and what it may be.
    """
    if data is None:
        return None
    reader.keys(data, "year", YEAR_KEYS)
    kinds = {k: _read_leaf_year(reader, data[k], f"year.{k}") for k in ("leaf", "blossom") if k in data}
    return Year(
        latitude=reader.number(data.get("latitude", 50.0), "year.latitude", 0, 70),
        spring=reader.number(data.get("spring", 5.0), "year.spring", 0, 40),
        autumn=reader.number(data.get("autumn", 7.0), "year.autumn", 0, 40),
        fallen=reader.truth(data.get("fallen", False), "year.fallen"),
        source=reader.text(data.get("source", ""), "year.source", least=0),
        **kinds,
    )


def _read_leaf_year(reader: Any, data: Any, name: str) -> LeafYear:
    reader.keys(data, name, LEAF_YEAR_KEYS)
    for key in ("appear", "turn", "fall"):
        if key not in data:
            raise reader.fail(f"{name}.{key}", "missing; add this key")

    def number(key: str, low: float, high: float) -> float:
        return reader.number(data.get(key, getattr(LeafYear, key, None)), f"{name}.{key}", low, high)

    appear = number("appear", 1, DAYS)
    turn = number("turn", appear, appear + DAYS)
    fall = number("fall", turn, appear + DAYS)
    autumn = data.get("autumn", [])
    if not isinstance(autumn, list) or len(autumn) > MAX_AUTUMN:
        raise reader.fail(f"{name}.autumn", f"must be a list of up to {MAX_AUTUMN} colors [r, g, b]")
    return LeafYear(
        appear=appear,
        turn=turn,
        fall=fall,
        appear_spread=number("appear_spread", 0, 60),
        growth=number("growth", 0, 120),
        fresh=reader.rgb(data["fresh"], f"{name}.fresh") if "fresh" in data else None,
        turn_spread=number("turn_spread", 0, 60),
        turning=number("turning", 0, 90),
        autumn=tuple(reader.rgb(one, f"{name}.autumn[{i}]") for i, one in enumerate(autumn)),
        fall_spread=number("fall_spread", 0, 60),
        dry=reader.rgb(data.get("dry", list(_DRY)), f"{name}.dry"),
        kept=number("kept", 0, 1),
        turnover=number("turnover", 0, 1),
    )
