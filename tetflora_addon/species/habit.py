# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Habit: the same species as it grows free, or between neighbors that take its light.

Between neighbors a tree loses its lower limbs, keeps the others short, and has a thinner trunk for its height. Limbs
bear twigs of the same size, as densely; so leaf area falls with the crown's projection, and with the crown's volume
the number of limbs and twigs. What asks for light, as birches do, has fewer leaves on its twigs as well.
"""

from __future__ import annotations

from dataclasses import replace

from .schema import LENGTH_HIGH, ORDER_KEYS
from .species import Order, Range, Species

#: What full habit does. Norway spruces in Swiss stands (Burger 1953, 153 trees) have, against one that stands free,
#: half of the stem bare, crowns of less than half the width, and 2.2 times the height for their diameter.
BARE = 0.5
NARROWER = 0.52
SLIMMER = 0.57
#: Limbs, being shorter too, lose so much of that, as a power.
_LIMBS = 0.75
#: Dead branches of a stand over those of a free tree at most: the lowest have fallen.
_MORE_DEAD = 4.0


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
