# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where plants go: on ground that suits them, at a distance from each other, near what they seek.

Arrays only; `blender.placing` makes objects of them. Chance comes from the same hash as in the plants themselves, so a
seed gives the same arrangement in every version of Blender. Species that others seek come first.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Keys, Mask
from ..errors import SceneError
from ..growth.hashing import child_key, key_of_seed, uniform
from .cover import Suits
from .plane import NO_DISTANCE, Neighbors, Path, Spacing, Terrain
from .rules import MOST_PLANTS, Companion, Rules, check_rules, species_by_weight
from .site import REMEDIES, Sample, Site, SiteDraw, Zone, lines_of_paths

_FOUNDERS = 0.1  # of the plants that seek each other
#: Part of the places of a density down to which nobody is told that some had no room: distances thin all that is drawn.
_TOLD = 0.5


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

    def lonely(self, points: Floats, species: Integers32, keys: Keys, older: Self) -> Mask:
        """Plants that have not what they seek near, (n,), when those that these need in turn are gone as well."""
        gone = np.zeros(len(points), bool)
        seeking = [(n, r) for n, r in self.rules if r.strength > 0.0]
        changed = bool(seeking)
        while changed:
            changed = False
            for number, rule in seeking:
                asked = np.flatnonzero(~gone & (species == rule.species) & _follows(keys, number, rule))
                others = points[~gone & (species == rule.other)]
                alone = ~Neighbors(older._standing(rule.other), rule.distance).near(points[asked])
                # Among their own kind they meet themselves as well.
                least = 2 if rule.other == rule.species else 1
                alone[alone] = ~Neighbors(others, rule.distance).near(points[asked[alone]], least)
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


_ROUNDS = 24
_SMALLEST_ROUND = 512
_LARGEST_ROUND = 2_000_000
_MOST_DRAWN = 16_000_000  # and a few dozen for each plant; what is rarer than that takes too long
_RAREST = 1.0 / 256.0  # minimum fraction of suitable places that a round expects
_HOPELESS = 1_000_000  # places without a suitable one
_FULL = 5_000  # suitable places of which not one can be taken: the ground is full
_SPECIES = 2**32  # keys of species that are placed one after the other, away from those of plants


@dataclass(frozen=True)
class Placement(Arrays):
    """Plants to make."""

    position: Floats  # (n, 3): meters, world space
    azimuth: Floats  # (n,): rotation about the vertical, radians; comes before the tilt
    scale: Floats  # (n,)
    species: Integers32  # (n,): index into the weights of the rules
    seed: Integers32  # (n,): zero or positive
    wanted: int  # how many were asked for, by number or by density
    reason: str = ""  # why there are fewer, and what to do; empty if there are not
    up: Floats | None = None  # (n, 3): unit vectors along the trunks; upright if not given
    erased: int = 0  # how many were left out by `without`

    def __post_init__(self) -> None:
        """Plants that nobody tilted are upright."""
        if self.up is None:
            object.__setattr__(self, "up", np.tile([0.0, 0.0, 1.0], (len(self.seed), 1)))

    @property
    def rotation(self) -> Floats:
        """Unit quaternions (n, 4), w first: the turn about the vertical, then the shortest one to ``up``."""
        cos, sin = np.cos(0.5 * self.azimuth), np.sin(0.5 * self.azimuth)
        x, y, z = self.up.T
        # The shortest turn from (0, 0, 1) to (x, y, z) is (1 + z, -y, x, 0), normalized; trunks never point down.
        length = np.sqrt(np.maximum(2.0 * (1.0 + z), 1e-12))
        w, i, j = (1.0 + z) / length, -y / length, x / length
        return np.stack([w * cos, i * cos + j * sin, j * cos - i * sin, w * sin], axis=1)


def place(
    ground: Terrain,
    rules: Rules,
    older: Floats | None = None,
    older_species: Integers32 | None = None,
    suits: Mapping[int, Suits] | None = None,
    zones: Sequence[Zone] = (),
) -> Placement:
    """Scatter plants over the ground as the rules ask, evenly as seen on a map.

    Parameters
    ----------
    older : (m, 2) or (m, 3) float64, optional
        Places of plants that stand already, meters; new ones keep their distance from them, and may seek or shun them.
    older_species : (m,) int32, optional
        Their species as index into the weights of the rules; -1 for others, which all are if not given.
    suits : mapping of int to callable, optional
        How suitable the ground is for a species (index into the weights), besides what the rules say of all.
    zones : sequence of Zone
        Of the ground's triangles; how suitable the ground is, besides, is the product of their shares.

    Raises
    ------
    SceneError
        No ground is suitable, or the rules contradict themselves; names the setting and what to do.

    Notes
    -----
    Places are drawn by hashes of the seed and of their number, and kept as often as they are suitable (rejection
    sampling); those that are kept first come first (dart throwing: R. Cook, "Stochastic sampling in computer graphics",
    1986). By density, as many places are drawn as would stand on wholly suitable ground. By count, more are drawn, in a
    bounded number of rounds, until there are enough. Where species seek or shun each other, or some ground suits one
    better than another, they are placed one after the other, each with its fraction of the count.
    """
    check_rules(rules)
    older = np.zeros((0, 2)) if older is None else np.asarray(older, dtype=np.float64)[:, :2]
    if older_species is None:
        older_species = np.full(len(older), -1, np.int32)
    site = Site(ground, rules, zones)
    key = key_of_seed(rules.seed)
    company = Company(rules, older, older_species)
    sowing = _Sowing(site, rules, Spacing(rules.min_distance, older), company, suits or {})
    if not company.rules and not suits:
        sowing.sow(key, None, 1.0)
    else:
        weights = np.maximum(rules.weights, 0.0)
        for species in company.order(np.flatnonzero(weights > 0.0).tolist()):
            sowing.sow(child_key(key, _SPECIES + species), species, _part(weights, species, rules))
    position, up, keys, species = sowing.result()
    if company.rules:
        stay = ~company.lonely(position[:, :2], species, keys, Company(rules, older, older_species))
        sowing.refused["companions"] += int((~stay).sum())
        position, up, keys, species = position[stay], up[stay], keys[stay], species[stay]
    reason = sowing.reason(len(position))
    azimuth, scale = 2.0 * np.pi * uniform(keys, SiteDraw.AZIMUTH), _scales(position[:, 2], keys, site, rules)
    up = _tilted(up, rules.tilt)
    return Placement(position, azimuth, scale, species, _positive(keys), sowing.wanted, reason, up)


def without(placement: Placement, bare: Sequence[Path]) -> Placement:
    """A placement less the plants within the reach of lines that stay bare; all others are as they were.

    Paths of the ground let others grow elsewhere instead; this does not.
    """
    lines = lines_of_paths(bare)
    if lines is None or not len(placement):
        return placement
    stay = lines.nearness(placement.position[:, :2]) >= 1.0
    return replace(placement.take(stay), erased=placement.erased + int((~stay).sum()))


def new_seeds(seeds: Integers, roll: int = 0) -> Integers32:
    """Other seeds for plants with the given ones, (n,), zero or positive; another ``roll`` gives yet others."""
    return _positive(child_key(key_of_seed(seeds), roll & 0xFFFFFFFF))


class _Sowing:
    """Plants so far, and what became of the places that were drawn."""

    def __init__(
        self, site: Site, rules: Rules, spacing: Spacing, company: Company, suits: Mapping[int, Suits]
    ) -> None:
        self.site, self.rules, self.spacing, self.company, self.suits = site, rules, spacing, company, suits
        self.wanted = self.drawn = self.suitable = 0
        self.lost = dict.fromkeys(REMEDIES, 0)
        self.refused = {"companions": 0, "distance": 0}
        self._parts: list[tuple[NDArray, ...]] = []

    def sow(self, key: Keys, species: int | None, part: float) -> None:
        """Place plants of one species, or of all by their weights, and ``part`` of the number asked for."""
        suits = self.suits.get(species)
        if self.rules.by_density:
            expected = self.rules.density * self.site.area * part
            if expected > MOST_PLANTS:
                raise SceneError(
                    f"A density of {self.rules.density:.3g} plants per m² makes {expected:,.0f} plants on this ground; "
                    f"the limit is {MOST_PLANTS:,}. Lower the density"
                )
            # What is left of a whole plant comes by chance.
            places = int(expected + uniform(key, SiteDraw.SUITABLE))
            for first in range(0, places, _LARGEST_ROUND):
                sample = self.site.draw(key, first, min(places - first, _LARGEST_ROUND), suits=suits)
                self.wanted += len(sample.key)
                self._admit(sample, species, len(sample.key))
            return
        wanted = round(self.rules.count * part) if species is None else int(part)
        self.wanted += wanted
        kept = drawn = beside = suitable = 0
        free = self.spacing.free and not self.company.rules
        for _ in range(_ROUNDS):
            missing = wanted - kept
            # Twice as many as are missing, for distances take some; where little is suitable, just more than needed.
            rate = max(beside / drawn, _RAREST) if drawn else 1.0
            batch = min(max(2 * missing, int(1.1 * missing / rate), _SMALLEST_ROUND), _LARGEST_ROUND)
            sample = self.site.draw(key, drawn, batch, missing if free else None, suits)
            drawn += sample.drawn
            suitable += len(sample.key)
            came, stayed = self._admit(sample, species, missing)
            beside += came
            kept += stayed
            full = len(sample.key) >= _FULL and stayed * _FULL < len(sample.key)
            hopeless = not suitable and drawn >= _HOPELESS
            if kept >= wanted or full or hopeless or drawn > _MOST_DRAWN + 48 * wanted:
                break

    def _admit(self, sample: Sample, species: int | None, most: int) -> tuple[int, int]:
        """Keep what has company and distance; how many had company, and how many stay."""
        self.drawn += sample.drawn
        self.suitable += len(sample.key)
        for name, number in sample.lost.items():
            self.lost[name] += number
        position, up, keys = sample.position, sample.up, sample.key
        if species is None:
            kinds = species_by_weight(self.rules.weights, uniform(keys, SiteDraw.SPECIES))
        else:
            kinds = np.full(len(keys), species, np.int32)
            fine = self.company.admit(species, position[:, :2], keys)
            self.refused["companions"] += int((~fine).sum())
            position, up, keys, kinds = position[fine], up[fine], keys[fine], kinds[fine]
        chosen = self.spacing.admit(position[:, :2], most)
        if len(chosen) < most:
            self.refused["distance"] += len(keys) - len(chosen)
        self._parts.append((position[chosen], up[chosen], keys[chosen], kinds[chosen]))
        if species is not None:
            self.company.add(species, position[chosen, :2])
        return len(keys), len(chosen)

    def result(self) -> tuple[NDArray, NDArray, Keys, Integers32]:
        """Places, normals, keys and species of all plants."""
        none = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.uint64), np.zeros(0, np.int32)
        return tuple(np.concatenate(column) for column in zip(none, *self._parts, strict=True))

    def reason(self, kept: int) -> str:
        """Why there are fewer plants than wanted; a `SceneError` if no place was suitable, and many were tried."""
        rules = self.rules
        if not self.drawn:
            return (
                f"a density of {rules.density:.3g} plants per m² makes less than one plant on {self.site.area:.3g} m²; "
                "raise the density or use a larger surface"
            )
        if kept and kept >= (_TOLD if rules.by_density else 1.0) * self.wanted:
            return ""
        worst = max(self.lost, key=self.lost.__getitem__)
        if not self.suitable and self.drawn > 10_000:
            raise SceneError(f"No plants could be placed: {REMEDIES[worst]}")
        passed = {
            "suitable": self.suitable / self.drawn,
            "companions": 1.0 - self.refused["companions"] / max(self.suitable, 1),
            "distance": 1.0 - self.refused["distance"] / max(self.suitable - self.refused["companions"], 1),
        }
        if rules.by_density and self.suitable:
            del passed["suitable"]  # these were never wanted
        least = min(passed, key=passed.__getitem__)
        if least == "distance" and not kept:
            return (
                f"what stands there leaves no room at a Min Distance of {rules.min_distance:.3g} m; "
                "lower Min Distance, or let fewer of the other plants grow"
            )
        if least == "distance" and rules.by_density:  # places are drawn once, so that there may be room between them
            return (
                f"the others would stand closer than the Min Distance of {rules.min_distance:.3g} m to a plant; "
                "lower Min Distance, or raise the density where there is room"
            )
        if least == "distance":
            return (
                f"no room for more plants at a Min Distance of {rules.min_distance:.3g} m; "
                "lower Min Distance or use a larger surface"
            )
        if least == "companions":
            return (
                "companion rules leave no room for more plants; bring Attraction closer to 0, or change Reach: "
                "raise it where species attract each other, lower it where they repel"
            )
        return REMEDIES[worst]


def _part(weights: Floats, species: int, rules: Rules) -> float:
    """Fraction of a species by density; by count its number of plants, the rest going to the largest remainders."""
    fractions = weights / weights.sum()
    if rules.by_density:
        return float(fractions[species])
    exact = fractions * rules.count
    whole = np.floor(exact)
    whole[np.argsort(-(exact - whole), kind="stable")[: round(rules.count - whole.sum())]] += 1.0
    return float(whole[species])


def _scales(z: Floats, keys: Keys, site: Site, rules: Rules) -> Floats:
    low, high = sorted((rules.scale_min, rules.scale_max))
    scale = low + (high - low) * uniform(keys, SiteDraw.SCALE)
    if rules.scale_at_top != 1.0 and site.highest > site.lowest:
        height = np.clip((z - site.lowest) / (site.highest - site.lowest), 0.0, 1.0)
        scale *= 1.0 + (rules.scale_at_top - 1.0) * height
    return scale


def _tilted(normal: Floats, tilt: float) -> Floats | None:
    if not tilt:
        return None
    up = tilt * normal
    up[:, 2] += 1.0 - tilt
    return up / np.linalg.norm(up, axis=1, keepdims=True)


def _positive(keys: Keys) -> Integers32:
    return (uniform(keys, SiteDraw.SEED) * 2**31).astype(np.int32)


_DRAWS = range(1 << 20, (1 << 20) + 12)  # beyond those of branches and leaves


def plant_ages(seed: ArrayLike, age: float, spread: float) -> Floats32:
    """Ages (n,) of plants with seeds (n,), years, in single precision as Blender stores them.

    They are log-normal, as sizes in uneven-aged stands are: the median is ``age``, and a standard deviation is a factor
    of 1 + ``spread``. The sum of twelve even numbers stands for a normal one, so that none is beyond six deviations.
    """
    if spread == 0.0:
        return np.full(np.shape(seed), age, np.float32)
    key = key_of_seed(seed)
    normal = np.clip(sum(uniform(key, draw) for draw in _DRAWS) - 6.0, -2.5, 2.5)
    return (age * np.exp(np.log1p(spread) * normal)).astype(np.float32)
