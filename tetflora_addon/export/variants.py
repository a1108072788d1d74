# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Variants: a few real plants of each kind that stand for all others.

Plants differ in size, slenderness and crown shape. Those of a kind are clustered by these (Lloyd, "Least squares
quantization in PCM", 1982), begun with plants that are as different as possible (Gonzalez, "Clustering to minimize the
maximum intercluster distance", 1985), and the plant nearest to the middle of a cluster is its variant. A plant is shown
by its nearest variant, scaled to its own height.
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Arrays, Floats, Integers, Integers32, column
from ..compiled.flora import Flora
from ..growth.growth import trunks
from ..growth.hashing import child_key, key_of_seed
from ..growth.seeds import BASE, EAST, LEAVES, NORTH, THICKNESS, WIDTH, Seeds

#: Plants of a kind that are clustered, and that are worked on at a time; how often clusters are moved at most.
_SAMPLE, _CHUNK, _ROUNDS = 20_000, 100_000, 12
_SPREAD = 1e-6  # of a feature, below which all plants are alike in it
_SIZE = 0.5  # weight of the size beside form: plants are scaled, so that only their leaves are of another size
_DRAW = 1


@dataclass(frozen=True)
class Variants(Arrays):
    """What shows each of some plants (n)."""

    variant: Integers32 = column(dtype=np.int32)  # (n,): index into ``plants``
    scale: Floats  # (n,): scale with which the variant, made with a scale of 1, is as tall as the plant
    plants: Integers = column(dtype=np.int64)  # (v,): the plants that are variants, kind by kind


def choose_variants(flora: Flora, seeds: Seeds, most: int) -> Variants:
    """Choose variants for plants.

    Parameters
    ----------
    flora : Flora
        Whose species are the kinds of the seeds.
    seeds : Seeds of n
    most : int
        Variants of each kind. Where there are no more plants than that, each is its own.
    """
    variant, scale = np.zeros(len(seeds), np.int32), np.ones(len(seeds))
    plants: list[Integers] = []
    first = 0
    for kind in np.flatnonzero(np.bincount(seeds.species)).tolist():
        alike = np.flatnonzero(seeds.species == kind)
        length, features = _features(flora, seeds, alike)
        if len(alike) <= most:
            chosen, nearest = np.arange(len(alike)), np.arange(len(alike))
        else:
            sample = _sample(seeds.seed[alike])
            chosen = sample[_medoids(features[sample], most)]
            nearest = _nearest(features, features[chosen])
        plants.append(alike[chosen])
        variant[alike] = first + nearest
        scale[alike] = length / (length[chosen] / seeds.scale[alike[chosen]])[nearest]
        first += len(chosen)
    return Variants(variant, scale, np.concatenate([np.zeros(0, np.int64), *plants]))


def _features(flora: Flora, seeds: Seeds, plants: Integers) -> tuple[Floats, Floats]:
    """Lengths (m,) of trunks of some plants (m,), and what else they differ in (m, f), each with the same spread."""
    length, rows = np.zeros(len(plants)), []
    for begin in range(0, len(plants), _CHUNK):
        chunk = seeds.take(plants[begin : begin + _CHUNK])
        trunk = trunks(flora.rows, chunk)
        length[begin : begin + _CHUNK] = trunk.length
        columns = [np.log(np.maximum(trunk.length, 1e-9)), np.log(np.maximum(trunk.radius / trunk.length, 1e-9))]
        if chunk.crown is not None:
            columns += [np.log(chunk.crown[:, each]) for each in (WIDTH, THICKNESS, LEAVES)]
            columns += [chunk.crown[:, BASE], np.hypot(chunk.crown[:, EAST], chunk.crown[:, NORTH])]
        rows.append(np.stack(columns, axis=1))
    features = np.concatenate(rows)
    spread = features.std(axis=0)
    features /= np.where(spread > _SPREAD, spread, np.inf)
    features[:, 0] *= _SIZE
    return length, features


def _sample(seed: Integers) -> Integers:
    """Plants (k,) that are clustered, chosen by hashes of their seeds (m,)."""
    if len(seed) <= _SAMPLE:
        return np.arange(len(seed))
    return np.sort(np.argsort(child_key(key_of_seed(seed), np.full(len(seed), _DRAW)), kind="stable")[:_SAMPLE])


def _medoids(features: Floats, number: int) -> Integers:
    """The plants (v,) nearest to the middles of clusters of plants (k, f); fewer where many are alike."""
    chosen = [int(((features - features.mean(axis=0)) ** 2).sum(axis=1).argmin())]
    away = ((features - features[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < number and away.max() > 0.0:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, ((features - features[chosen[-1]]) ** 2).sum(axis=1))
    middles = features[chosen]
    for _ in range(_ROUNDS):
        of = _nearest(features, middles)
        count = np.maximum(np.bincount(of, minlength=len(middles)), 1)[:, None]
        sums = [np.bincount(of, column, len(middles)) for column in features.T]
        moved = np.where(np.bincount(of, minlength=len(middles))[:, None] > 0, np.stack(sums, axis=1) / count, middles)
        if np.allclose(moved, middles, atol=1e-3):
            break
        middles = moved
    return np.unique(_nearest(middles, features))


def _nearest(features: Floats, middles: Floats) -> Integers:
    """Index (n,) of the middle (v, f) that is nearest to each plant (n, f)."""
    chunks = [features[begin : begin + _CHUNK] for begin in range(0, len(features), _CHUNK)]
    square = (middles**2).sum(axis=1)
    return np.concatenate([(square - 2.0 * chunk @ middles.T).argmin(axis=1) for chunk in chunks])
