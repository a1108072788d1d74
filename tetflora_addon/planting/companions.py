# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species that seek or shun each other: in which order they are placed, and where each may stand."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Integers32, Keys, Mask
from ..growth.hashing import uniform
from .plane import NO_DISTANCE, Neighbors, Spacing
from .rules import Companion, Rules
from .site import SiteDraw

_FOUNDERS = 0.1  # of the plants that seek each other


class Company:
    """What stands already, by species, and who may join.

    The strength of a rule without its sign is the fraction of plants that follow it, chosen by their hashes.
    Where plants shun others, it does not matter who came first: an oak that shuns birches keeps new birches away too.
    """

    def __init__(self, rules: Rules, position: Floats, species: Integers32) -> None:
        """Begin with older plants: places on the map (m, 2), and indices into the weights or -1 (m,)."""
        self.rules = [(n, r) for n, r in enumerate(rules.companions) if r.strength and r.distance >= NO_DISTANCE]
        self.place = {s: [position[species == s]] for s in range(len(rules.weights))}

    def order(self, wanted: list[int]) -> list[int]:
        """Species in the order in which they are placed: those that are sought before those that seek them."""
        order, rest = [], list(wanted)
        seeks = {(rule.species, rule.other) for _, rule in self.rules if rule.strength > 0.0}
        while rest:
            free = [s for s in rest if not any((s, other) in seeks for other in rest if other != s)]
            # In a circle of species that seek each other, the first of the list begins.
            order.append(free[0] if free else rest[0])
            rest.remove(order[-1])
        return order

    def admit(self, species: int, points: Floats, keys: Keys) -> Mask:
        """Which places, (n, 2), candidates of a species may take beside what stands, and beside each other, (n,)."""
        fine = np.ones(len(points), bool)
        for number, rule in self.rules:
            if species not in (rule.species, rule.other):
                continue
            asks = fine & _follows(keys, number, rule)
            if rule.strength < 0.0 and rule.species == rule.other:
                asked = np.flatnonzero(asks)
                fine[asked] = False
                fine[asked[Spacing(rule.distance, self._standing(species)).admit(points[asked], len(asked))]] = True
            elif rule.strength < 0.0:
                others = self._standing(rule.other if species == rule.species else rule.species)
                fine[asks] = ~Neighbors(others, rule.distance).near(points[asks])
            elif species == rule.species:
                # Who seeks its own kind, or what comes later, needs founders; those left alone go in the end.
                others = self._standing(rule.other)
                founds = np.zeros(len(points), bool)
                # Where both seek each other, the others come later; `lonely` then decides in the end.
                if self._reaches(rule.other, rule.species, set()):
                    founds = asks & (uniform(keys, SiteDraw.FOUNDER) < _FOUNDERS)
                    others = np.concatenate([others, points[founds]]) if rule.other == species else others
                fine[asks] = founds[asks] | Neighbors(others, rule.distance).near(points[asks])
        return fine

    def add(self, species: int, points: Floats) -> None:
        """Plants of a species stand now at places (n, 2)."""
        self.place.setdefault(species, []).append(points)

    def lonely(self, points: Floats, species: Integers32, keys: Keys, older: Company) -> Mask:
        """Plants that have not what they seek near, (n,), when those that these need in turn are gone as well."""
        gone = np.zeros(len(points), bool)
        seeking = [(n, r) for n, r in self.rules if r.strength > 0.0]
        changed = bool(seeking)
        while changed:
            changed = False
            for number, rule in seeking:
                asked = np.flatnonzero(~gone & (species == rule.species) & _follows(keys, number, rule))
                there = points[~gone & (species == rule.other)]
                alone = ~Neighbors(older._standing(rule.other), rule.distance).near(points[asked])
                # Among their own kind they meet themselves as well.
                least = 2 if rule.other == rule.species else 1
                alone[alone] = ~Neighbors(there, rule.distance).near(points[asked[alone]], least)
                gone[asked[alone]] = True
                changed |= bool(alone.any())
        return gone

    def _standing(self, species: int) -> Floats:
        return np.concatenate(self.place[species])

    def _reaches(self, start: int, goal: int, seen: set[int]) -> bool:
        if start == goal:
            return True
        seen.add(start)
        ahead = {r.other for _, r in self.rules if r.species == start and r.strength > 0.0} - seen
        return any(self._reaches(s, goal, seen) for s in sorted(ahead))


def _follows(keys: Keys, number: int, rule: Companion) -> Mask:
    return uniform(keys, SiteDraw.COMPANION + number) < abs(rule.strength)
