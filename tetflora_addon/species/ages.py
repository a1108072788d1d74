# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Age: the same species as a seedling, a sapling, old, dying or dead.

A young tree is no small old one. Its trunk is slender and its limbs set out near the ground; twigs and leaves are
nearly as large as they will be, there are fewer of them, and what is no longer than a twig bears leaves itself. Limbs
stay where they are while the trunk grows above them, until they die at the crown's base. In old age twigs go from the
ends of branches inwards; a dead tree loses them from the thinnest to the thickest.

Habit is the same species as it grows free, or between neighbors that take its light. Between neighbors a tree loses its
lower limbs, keeps the others short, and has a thinner trunk for its height. Limbs bear twigs of the same size, as
densely; so leaf area falls with the crown's projection, and with the crown's volume the number of limbs and twigs. What
asks for light, as birches do, has fewer leaves on its twigs as well.
"""

from dataclasses import replace
from functools import lru_cache
from math import prod
from typing import Any

import numpy as np

from ..parameters import altered
from .catalog import LENGTH_HIGH, ORDER_KEYS
from .members import bisected, expected_leaf_area
from .skeletons import Skeleton
from .species import Ages, Color, Dead, NodeLaw, Nodes, Order, PartGrown, Range, Species, rounded_least

#: What full habit does. Norway spruces in Swiss stands (Burger 1953, 153 trees) have, against one that stands free,
#: half of the stem bare, crowns of less than half the width, and 2.2 times the height for their diameter.
BARE = 0.5
NARROWER = 0.52
SLIMMER = 0.57
_LIMBS = 0.75  # limbs, being shorter too, lose so much of that, as a power
_MORE_DEAD = 4.0  # dead branches of a stand over those of a free tree at most: the lowest have fallen


def with_habit(species: Species, habit: float) -> Species:
    """A species between its description and what becomes of it in a dense stand.

    Parameters
    ----------
    species : Species
        As described: a plant that stands free.
    habit : float
        0 returns the species itself, 1 gives the trees of a dense stand.

    Returns
    -------
    Species
        Of the first orders, bare lengths, lengths, thicknesses and numbers differ, within the limits of the schema. A
        species whose form is drawn by hand, and one of a single order, keep what they have.
    """
    if habit == 0 or species.skeleton is not None or len(species.orders) < 2:
        return species
    trunk, limb, *rest = species.orders
    bare, shorter = habit * BARE, 1 - habit * NARROWER
    starts = {name: _raised(getattr(trunk, name), bare, name) for name in ("branch_start", "spur_start")}
    before = trunk
    left = (1 - starts["branch_start"].mean) / (1 - trunk.branch_start.mean)
    trunk = replace(
        trunk,
        thickness=trunk.thickness.scaled(trunk.thickness.allowed(1 - habit * SLIMMER, ORDER_KEYS["thickness"])),
        branches=trunk.branches.scaled(left),
        spurs=trunk.spurs.scaled((1 - starts["spur_start"].mean) / (1 - trunk.spur_start.mean)),
        fork_at=min(trunk.fork_at + bare * (1 - trunk.fork_at), ORDER_KEYS["fork_at"].high),
        **starts,
    )
    dead = species.dead
    if dead is not None:  # as close together on a bole that is bare for longer
        longer = starts["branch_start"].mean / max(before.branch_start.mean, 1e-6)
        dead = replace(dead, number=dead.number.scaled(min(longer, _MORE_DEAD)))
    # As many branches, leaves and short shoots on a meter.
    fewer = {name: getattr(limb, name).scaled(shorter) for name in ("branches", "leaves", "spurs")}
    limb = replace(limb, length=limb.length.scaled(limb.length.allowed(shorter, ORDER_KEYS["length"])), **fewer)
    # Limbs are as slim as the trunk; what they bear is not.
    rest[:1] = [_same_size(order, 1 / shorter, (1 - habit * SLIMMER) ** -_LIMBS) for order in rest[:1]]
    leafy = 1 - habit * (1 - species.stand_leaves)
    orders = (trunk, limb, *rest)
    if leafy < 1:
        orders = tuple(replace(order, leaves=order.leaves.scaled(leafy)) for order in orders)
    return replace(species, orders=orders, dead=dead)


def _same_size(order: Order, longer: float, thicker: float) -> Order:
    """Branches as long and as thick in meters as before, of parents whose length and width are divided by factors."""
    length = min(longer, LENGTH_HIGH / order.length.high)
    thickness = max(min(thicker, ORDER_KEYS["thickness"].high / order.thickness.high), 1.0)
    return replace(order, length=order.length.scaled(length), thickness=order.thickness.scaled(thickness))


def _raised(start: Range, bare: float, key: str) -> Range:
    """A bare part, with a fraction of what followed it bare as well."""
    variation = start.variation * (1 - bare)
    return Range(min(start.mean + bare * (1 - start.mean), ORDER_KEYS[key].high - variation), variation)


STAGES = ("seedling", "sapling", "mature", "old", "dying", "dead")
#: Below a crown, nodes grow as one of these powers of the height; with forks, there are so many more of them.
_POWERS, _MORE = (1.0, 0.4), 1.5
_ROSETTE = 0.9  # a bare part longer than this is the stem of a palm, whose crown is as long at any age
_TWIGS = 0.25  # power by which twigs follow the limbs; branches of a plant with one order of them do so too
_LONGEST = 0.6  # longest branches in lengths of their parents, where the description has shorter ones
#: Girth of branches follows length as this power, that of stools the stems'; radius of the thinnest tips, meters.
_STOUT, _STOOL, _TIP = 1.15, 0.7, 0.0012
#: In a small plant, the shoots of this year are bare of branches, and trunks even cones.
_LEADER, _EVEN = 0.75, 1.3
_FULLER = 1.5, 2.0  # leaves on twigs of young and of old trees over those when full-grown, at most
#: Branches that live for a while, for each of the others, at most; and ages over that when full-grown, at the barest
#: of which they are on all of the crown; and steps in which numbers are found.
_EXTRA, _BAREST, _STEPS = 3.0, (0.1, 0.2, 0.3, 0.45), 14
_SMALL = 3.0  # meters of height up to which crowns have not closed
_LEAFY = 4.0  # of the length of a leafy twig: what is longer than so many bears no leaves itself
#: A leaf is at most this fraction of the plant's height, and a seedling has so many.
_LEAF, _FIRST = 1 / 3, 4.0
#: Nodes over which branches grow, and within which change of length those of full-grown plants come to be.
_RAMP, _NEAR = 1.5, 0.1
#: What is left of twigs and boughs at death, and years until they have fallen: twigs, boughs, limbs.
_LEFT, _FALLEN = (0.3, 0.6, 1.0), (4.0, 12.0, 45.0)
#: Color of bare wood, years after death from which on all is gray, and bark that comes off in strips.
_GRAY, _GRAYING, _STRIPS = (0.14, 0.122, 0.102), 4.0, "fibrous"


def ages_of(species: Species) -> Ages:
    """How a species grows; without a description, as plants of its size do."""
    if species.ages is not None:
        return species.ages
    height = float(np.prod([order.length.mean for order in species.orders[: _stem(species) + 1]]))
    if height < 1.5 or len(species.orders) < 3 or species.skeleton is not None:
        full = 1.0 if height < 3 else 3.0 * height
        return Ages(full, (3.0 / full, 1.3), scaled=True)
    full = 10.0 + 2.0 * height
    rate = 1.6 / full
    return Ages(full, (rate, 1.3), (0.7 * rate, 1.5), lifespan=6.0 * full, flowers=0.3 * full)


def stage(species: Species, years: float) -> str:
    """One of `STAGES`; 0 years stand for a plant as described."""
    ages = ages_of(species)
    if years <= 0:
        return "mature"
    declined = ages.declined(years)
    if declined > 0:
        return "dead" if declined >= 1 else "dying" if declined > 0.5 else "old"
    height = ages.heights(years)
    return "seedling" if height < 0.06 else "sapling" if height < 0.55 else "mature"


@lru_cache(maxsize=256)
def with_age(species: Species, years: float) -> Species:
    """A species as its plants are at an age.

    Parameters
    ----------
    species : Species
        As described; its habit is applied.
    years : float
        0, or the age at which it is as described, returns the species itself.

    Returns
    -------
    Species
        Of orders, short shoots and dead branches, lengths, thicknesses and numbers differ, and where they are.
    """
    ages = ages_of(species)
    if years <= 0 or years == ages.full or (ages.scaled and years >= ages.full):
        return species
    species = replace(with_habit(species, species.habit), habit=0.0)
    if ages.scaled or species.skeleton is not None:
        other = _scaled(species, min(ages.heights(years), 1.0))
    else:
        other = _Aged(species, years, _crowding(species)[0]).species()
    return replace(other, aged=(species, years))


@lru_cache(maxsize=256)
def _crowding(species: Species) -> tuple[float, float]:
    """How crowded branches of young plants are, 0 to 1, and how many live for a while where all of a crown has them."""
    ages = [part * ages_of(species).full for part in _BAREST]
    crowded = max(round(_Aged(species, years).solve_for("crowded", 1.0), 2) for years in ages)
    return crowded, max(_Aged(species, years, crowded, 1.0, _FULLER[0]).solve_for("extra", _EXTRA) for years in ages)


def _scaled(species: Species, factor: float) -> Species:
    """A species of another size and the same form."""
    trunk, *rest = (replace(order, leaf_size=order.leaf_size.scaled(factor)) for order in species.orders)
    orders = (replace(trunk, length=trunk.length.scaled(factor)), *rest)
    spur, bud, form = species.spur, species.bud, species.skeleton
    if spur is not None:
        spur = replace(spur, length=spur.length.scaled(factor), leaf_size=spur.leaf_size.scaled(factor))
    if bud is not None:
        bud = replace(bud, length=factor * bud.length)
    if form is not None:
        form = Skeleton(factor * form.points, factor * form.radius, form.parent, form.line)
    return replace(species, orders=orders, spur=spur, bud=bud, skeleton=form)


def _stem(species: Species) -> int:
    """Number of the order that stands upright: 1 for shrubs, whose stems grow from a stool."""
    first, *rest = species.orders
    return int(bool(rest) and first.length.mean < 1.0 and rest[0].length.mean > 2.0)


class _Aged:
    """One species at one age, which is not that of its description.

    ``stem`` and ``last`` are the order of the stem, and of the twigs. By order, ``whole`` are typical lengths when
    full-grown, meters; ``now`` and ``before`` lengths over those, now and a year ago; ``stout`` radii over those when
    full-grown. ``crowded`` and ``extra`` are as of `_crowding`, ``fresh`` is the fraction of branches with ``extra``
    more that live a while, ``thin`` a factor on leaf numbers.
    """

    def __init__(
        self, species: Species, years: float, crowded: float = 0.0, fresh: float = 0.0, thin: float = 1.0
    ) -> None:
        self.one, self.ages, self.years = species, (ages := ages_of(species)), years
        self.stem, self.last = _stem(species), len(species.orders) - 1
        self.whole = np.cumprod([order.length.mean for order in species.orders]).tolist()
        self.rosette = species.orders[self.stem].branch_start.mean > _ROSETTE
        self.now, self.before = (self._lengths(max(year, 1e-3)) for year in (years, years - 1))
        diameter = ages.diameters(years)
        powers = [_STOOL if o < self.stem else 1.0 for o in range(self.stem + 1)]
        self.stout = [diameter**power for power in powers] + [now**_STOUT for now in self.now[self.stem + 1 :]]
        self.youth = min(max((1 - self.now[self.stem]) / 0.5, 0.0), 1.0)
        self.declined = ages.declined(years)
        self.dead = max(years - ages.lifespan, 1e-6) if years >= ages.lifespan else 0.0
        self.crowded, self.extra, self.fresh, self.thin = crowded, 0.0, fresh, thin

    def _lengths(self, years: float) -> list[float]:
        """Lengths by order over those when full-grown."""
        height, limbs = self.ages.heights(years), self.ages.diameters(years) ** self.ages.spread
        limbs = min(max(limbs, 0.45 * height), 1.4 * height**0.8)
        out = [height**0.5] * self.stem + [height]
        for o in range(self.stem + 1, self.last + 1):
            steps = self.last - self.stem - 1
            power = 1 - (1 - _TWIGS) * (o - self.stem - 1) / steps if steps else _TWIGS
            ratio = self.one.orders[o].length.mean
            longest = 1e9 if self.rosette else max(_LONGEST, 1.15 * ratio)
            out.append(rounded_least(limbs**power, longest / ratio * out[o - 1], longest / ratio))
        return out

    def species(self) -> Species:
        """The species at that age."""
        out = self._build()
        if self.stem + 1 >= self.last or self.dead:
            return out
        self.thin = min(self.wanted / max(expected_leaf_area(out), 1e-9), _FULLER[self.now[self.stem] >= 1])
        if self.thin == _FULLER[0]:
            self.extra = _crowding(self.one)[1]
            self.fresh = self.solve_for("fresh", 1.0)
        return self._build()

    @property
    def wanted(self) -> float:
        """Leaf area, as `expected_leaf_area` has it."""
        # Leaves follow the trunk that supplies them (leaf areas of McPherson, van Doorn and Peper, 2016): young trees
        # have more branches on a meter than will stay where limbs bear less, and fewer leaves where these bear more.
        leaves = self.ages.diameters(self.years) ** self.ages.leaves * self.leafless / self.thin
        closed = max(self.height / _SMALL, self.ages.heights(self.years))  # low shrubs' crowns at their full height
        return expected_leaf_area(self.one) * leaves * min(closed, 1.0)

    def solve_for(self, name: str, most: float) -> float:
        """The value of a number with which leaves are as wanted, or the most that it may be."""

        def area(value: float) -> float:
            setattr(self, name, value)
            return expected_leaf_area(self._build())

        return bisected(area, self.wanted, most, _STEPS)

    def _build(self) -> Species:
        one = self.one
        orders = tuple(self._order(o) for o in range(len(one.orders)))
        spur, dead = one.spur, one.dead
        if spur is not None:
            size = min(1.0, _LEAF * self.height / max(spur.length.high, 1e-9))
            spur = self._barked(altered(spur, length=spur.length.scaled(size), leaf_size=self._leaf(spur)))
        if dead is not None:
            number, on_limbs = (self._dead_nodes(o)[0] for o in range(2))
            dead = altered(self._dead(), number=dead.number.scaled(number), on_limbs=dead.on_limbs.scaled(on_limbs))
        bud, bark = (None if self.dead else one.bud), _STRIPS if self.dead > _GRAYING else one.bark
        return altered(one, orders=orders, spur=spur, dead=dead, bud=bud, bark=bark)

    @property
    def height(self) -> float:
        """Meters; of a palm with its fronds."""
        top = self.now[self.stem + 1] * self.whole[self.stem + 1] if self.rosette else 0.0
        return self.now[self.stem] * self.whole[self.stem] + top

    @property
    def leafless(self) -> float:
        """Factor on the number of leaves."""
        ages = self.ages
        dying = min(max((ages.lifespan - self.years) / (0.03 * ages.lifespan), 0.0), 1.0)
        return (1 - 0.4 * self.declined) * dying * self.thin

    def _order(self, o: int) -> Order:
        order, now = self.one.orders[o], self.now[o]
        stool, size = o < self.stem, 1.0 if o < self.stem else now
        numbers, nodes = zip(*self._sorts(o), strict=True)
        ramp = min(_RAMP / max(order.branches.mean * numbers[0], 1e-9), 0.35) * min(abs(size - 1) / _NEAR, 1)
        settled = 1.0 if o <= self.stem else min(max(1 - abs(now - 1) / _NEAR, 0.0), 1.0)
        changes: dict[str, Any] = {
            "length": order.length.scaled(now if o == 0 else now / self.now[o - 1]),
            "thickness": self._thickness(o),
            "growing": PartGrown(size, settled, *nodes, (ramp, ramp)),
            "branches": order.branches.scaled(numbers[0]),
            "spurs": order.spurs.scaled(numbers[1]),
        }
        for name in ("branch_start", "spur_start"):
            start = getattr(order, name)
            mean = min(self._bare(o, start.mean) / size, 0.99)
            variation = start.variation * mean / start.mean if start.mean > 0 else 0.0
            changes[name] = Range(mean, min(variation, mean, 0.99 - mean))
        if not stool:
            changes |= self._leaves(o)
            thick = (one.thickness.mean for one in self.one.orders[: o + 1])
            radius = prod((self.whole[0], *thick, self.stout[o]))  # typical one at the base, meters
            mean = max(order.taper.mean, min(0.5, _TIP / max(radius, 1e-9)))
            changes["taper"] = Range(mean, min(order.taper.variation, mean, 1 - mean))
            changes["flare"] = order.flare * min(self.stout[o], 1.0) ** 0.5
        if o == self.stem and order.pipe > _EVEN:
            changes["pipe"] = order.pipe - self.youth * (order.pipe - _EVEN)
        if o > self.stem:
            old = min(now, 1.0)
            lean = 0.7 + 0.3 * old
            mean = order.angle_tip + (order.angle.mean - order.angle_tip) * lean
            changes["angle"] = Range(mean, order.angle.variation)
            if order.attraction.mean < 0:
                changes["attraction"] = order.attraction.scaled(0.2 + 0.8 * old)
        return self._barked(altered(order, **changes))

    def _bare(self, o: int, start: float) -> float:
        """Where the crown of an axis begins, in lengths of the full-grown one."""
        now = self.now[o]
        if o < self.stem:
            return start
        if o > self.stem:
            return start * now
        if start > _ROSETTE:
            return max(now - (1 - start) * now**0.2, 0.2 * start * now)
        if now > 1:  # not above the top, however long the bare part was before
            return now * (1 - (1 - start) ** (now ** (self.ages.base - 1)))
        return start * now**self.ages.base

    def _sorts(self, o: int) -> list[tuple[float, Nodes]]:
        """Laterals, short shoots and dead branches of an order: factor on their number, and where they are."""
        order, now = self.one.orders[o], self.now[o]
        # Branches grow from the shoots of the years before.
        until = 1 - self._leader(o) * self.youth if o >= self.stem else 0.3 + 0.7 * min(now, 1.0)
        more = _MORE if o == self.stem and order.forks.high > 0 else 1.0
        flowers = min(max((self.years / max(self.ages.flowers, 1e-9) - 0.7) / 0.6, 0.0), 1.0)
        if self.one.spur is not None and self.one.spur.leaf_kind == "leaf":
            flowers = 1.0
        tier = o - self.stem
        extra = self.extra if 0 <= tier < 2 and order.branch_start.mean < _ROSETTE else 0.0
        laterals = self._nodes(o, order.branch_start.mean, more, until, self._kept(o), extra)
        number, spurs = self._nodes(o, order.spur_start.mean)
        return [laterals, (0.0 if self.dead else flowers * number, spurs), self._dead_nodes(o)]

    def _leader(self, o: int) -> float:
        """Fraction of an axis, from its tip down, that is bare of branches in a small plant."""
        new = 1 - self.before[o] / self.now[o]
        return new * (_LEADER + (1 - _LEADER) * new)

    def _nodes(
        self, o: int, start: float, more: float = 1.0, until: float = 1.0, kept: float = 1.0, extra: float | None = None
    ) -> tuple[float, Nodes]:
        """Factor on a number of children, and their nodes; with so many more of them below the crown.

        For each of the fresh ones ``extra`` more live for a while; None for sorts that have no such children.
        """
        start, now = min(start, 0.99), 1.0 if o < self.stem else self.now[o]
        power = 1.0 if start > _ROSETTE else _POWERS[0] + (_POWERS[1] - _POWERS[0]) * self.crowded
        law = NodeLaw(start, 1.0, power, 1.0, more * start / ((1 - start) * power))
        first, top = (law.number_at(place) for place in (self._bare(o, start), until * now))
        extra, fresh = (0.0, 0.0) if extra is None else (extra, self.fresh)
        number = kept * (top - first) * (1 + extra * fresh)
        if number <= 0:
            return 0.0, Nodes(0.0, 0.0, start)
        return number, Nodes(1 / number, law.below / number, start, 1.0, power, until, kept, extra, fresh)

    def _kept(self, o: int) -> float:
        """Fraction of the laterals of an order that age has left."""
        tier = min(self.last - 1 - o, 2)
        if tier < 0 or (tier < 2 and o <= self.stem and not self.dead):
            return 1.0
        if o <= self.stem:
            tier = 2
        return (1 - self.declined * (1 - _LEFT[tier])) * max(1 - self.dead / _FALLEN[tier], 0.0)

    def _thickness(self, o: int) -> Range:
        order = self.one.orders[o]
        if o == 0:
            factor = self.stout[0] / self.now[0]
        else:
            before = self.one.orders[o - 1]
            factor = self.stout[o] / self.stout[o - 1]
            if before.pipe > 0:
                factor *= max(self._sorts(o - 1)[0][0], 1e-3) ** (1 / max(before.pipe, 1.0))
        return order.thickness.scaled(min(factor, 0.95 / order.thickness.high))

    def _leaf(self, order: Order) -> Range:
        largest = order.leaf_size.high * max(order.leaf_size_tip, 1.0) * max(order.leaf_size_young, 1.0)
        return order.leaf_size.scaled(min(1.0, _LEAF * self.height / largest))

    def _leaves(self, o: int) -> dict[str, Any]:
        """Leaves of an order: as many on a meter; on what is as short as a twig, as many as on twigs."""
        order, now = self.one.orders[o], self.now[o]
        borne = order.leaves.mean * now * self.leafless
        changes = {"leaves": order.leaves.scaled(now * self.leafless), "leaf_size": self._leaf(order)}
        bearers = [p for p in range(o + 1, self.last + 1) if self.one.orders[p].leaves.high > 0]
        twig = self.one.orders[bearers[-1]] if bearers else order
        if not bearers or twig.leaf_envelope != "none":
            return changes
        long = self.whole[bearers[-1]]
        ratios = np.array([now, 1.0]) * self.whole[o] / long
        fade, full = np.clip(1 - np.log(np.maximum(ratios, 1e-9)) / np.log(_LEAFY), 0, 1).tolist()
        start = twig.leaf_start.mean
        if o == self.stem:  # of a trunk the shoot of this year
            start, fade = max(start, 1 - self._leader(o)), max(fade, self.youth)
        number = twig.leaves.mean * self.whole[o] * now / long * (1 - start) * max(fade - full, 0.0)
        number = self.leafless * max(number, _FIRST * fade * (o == self.stem))
        if number <= borne:
            return changes
        taken = {name: getattr(twig, name) for name in vars(order) if name.startswith("leaf")}
        leaves = Range(number, number * twig.leaves.variation / twig.leaves.mean)
        return taken | {"leaves": leaves, "leaf_start": Range(min(start, 0.98)), "leaf_size": self._leaf(twig)}

    def _barked(self, order: Order) -> Order:
        """Gray in death, and without flowers."""
        if not self.dead:
            return order
        gray = min(self.dead / _GRAYING, 1.0)
        mean, variation = order.branch_color
        mixed = tuple((1 - gray) * c + gray * g for c, g in zip(mean, _GRAY, strict=True))
        return altered(order, branch_color=Color(mixed, variation), leaves=Range(0.0))

    def _dead_nodes(self, o: int) -> tuple[float, Nodes]:
        dead = self.one.dead
        if dead is None or o > 1:
            return 0.0, Nodes(0.0, 0.0, 0.0)
        start, now = self.one.orders[o].branch_start.mean, 1.0 if o < self.stem else self.now[o]
        begin, end = dead.part(start)
        law = NodeLaw(begin, end, 1.0, 1.0, begin / (end - begin))
        ends = np.array(self._dead().part(min(self._bare(o, start) / now, 0.99))) * now
        number = float(np.diff(law.number_at(ends))[0])
        return number, Nodes(1 / number, law.below / number, begin, end)

    def _dead(self) -> Dead:
        """Dead branches, which reach farther up, and farther out on limbs, as the plant declines."""
        dead = self.one.dead
        return altered(dead, high=dead.high + self.declined * max(0.9 - dead.high, 0.0))
