# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Variants are plants of the forest, and all others are shown by those that are like them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.export.variants import choose_variants
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seeds import Seeds, crown_shapes
from tetflora_addon.species.catalog import load_species

FLORA = compile_species([load_species("bush"), load_species("fern")])


def plants(number: int = 400) -> Seeds:
    rng = np.random.default_rng(1)
    seeds = replace(Seeds.upright(number), identifiers=("bush", "fern"), scale=rng.uniform(0.3, 2.0, number))
    return replace(seeds, species=rng.integers(0, 2, number).astype(np.int32))


def test_plants_are_shown_in_their_own_size_by_variants_of_their_kind():
    seeds = plants()
    found = choose_variants(FLORA, seeds, 5)
    assert len(found.plants) <= 10
    chosen = found.plants[found.variant]
    np.testing.assert_array_equal(seeds.species[chosen], seeds.species)
    length = trunks(FLORA.rows, seeds).length
    np.testing.assert_allclose(found.scale * length[chosen] / seeds.scale[chosen], length, rtol=1e-12)
    # A variant shows itself as it is.
    np.testing.assert_allclose(found.scale[found.plants], seeds.scale[found.plants])
    np.testing.assert_array_equal(found.plants[found.variant[found.plants]], found.plants)


def test_few_plants_are_all_different():
    seeds = plants(12)
    found = choose_variants(FLORA, seeds, 12)
    assert sorted(found.plants.tolist()) == list(range(12))
    np.testing.assert_array_equal(found.plants[found.variant], np.arange(12))
    np.testing.assert_allclose(found.scale, seeds.scale)


def test_crown_shapes_tell_plants_apart():
    seeds = replace(plants(200), species=np.zeros(200, np.int32), scale=np.ones(200))
    wide = np.arange(200) % 2 == 0
    shaped = replace(seeds, crown=crown_shapes(200, width=np.where(wide, 2.5, 0.4)))
    found = choose_variants(FLORA, shaped, 8)
    np.testing.assert_array_equal(wide[found.plants[found.variant]], wide)


def test_more_variants_are_more_alike():
    seeds, length = plants(), trunks(FLORA.rows, plants()).length
    found = [choose_variants(FLORA, seeds, number) for number in (1, 4, 16)]
    off = [np.abs(np.log(length / length[one.plants[one.variant]])).mean() for one in found]
    assert off[0] > off[1] > off[2]
