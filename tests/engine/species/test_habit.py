# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The habit of a species: from standing free to a dense stand.

That full habit gives trees as foresters measure them is in ``test_published``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from devtools import forms
from tests.engine import support
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.errors import SpeciesError
from tetflora_addon.species.ages import with_habit
from tetflora_addon.species.catalog import ORDER_KEYS, load_species, species_from_dict
from tetflora_addon.species.species import Range


def test_no_habit_is_the_species_itself() -> None:
    species = load_species("beech")
    assert species.habit == 0
    assert with_habit(species, 0.0) is species


@pytest.mark.parametrize("habit", [0.25, 1.0])
@pytest.mark.parametrize("name", support.SPECIES)
def test_parameters_stay_within_the_limits_of_files(name: str, habit: float) -> None:
    for order in with_habit(load_species(name), habit).orders:
        for key, limits in ORDER_KEYS.items():
            value = getattr(order, key)
            if isinstance(value, Range):
                assert limits.low - 1e-9 <= value.low and value.high <= limits.high + 1e-9, (name, key)
            elif isinstance(value, int | float):
                assert limits.low <= value <= limits.high, (name, key)


def test_each_step_into_the_stand_is_barer_slimmer_and_narrower() -> None:
    species = load_species("oak")
    steps = []
    for habit in (0.0, 0.5, 1.0):
        flora = compile_species([replace(species, habit=habit)])
        plants = [forms.measures(flora, seed) for seed in range(3)]
        keys = ("crown_base", "slenderness", "crown_spread", "leaf_length")
        steps.append([np.mean([one[key] for one in plants]) for key in keys])
    base, slenderness, spread, leaf = np.array(steps).T
    assert (np.diff(base) > 0.05).all()
    assert (np.diff(slenderness) > 3).all()
    assert (np.diff(spread) < -0.1).all()
    assert leaf == pytest.approx(leaf[0], rel=0.02)


def test_twigs_keep_their_size_and_density() -> None:
    """Lengths in meters of branches of the second order, and their number on a meter of limb."""
    free = load_species("oak")
    stand = with_habit(free, 1.0)
    shorter = stand.orders[1].length.mean / free.orders[1].length.mean
    assert shorter < 0.6
    assert stand.orders[2].length.mean * shorter == pytest.approx(free.orders[2].length.mean)
    assert stand.orders[1].branches.mean == pytest.approx(free.orders[1].branches.mean * shorter)
    fewer = free.orders[3].leaves.scaled(free.stand_leaves)
    assert stand.orders[3] == replace(free.orders[3], leaves=fewer)


def test_a_habit_in_a_file_is_applied_when_it_is_compiled() -> None:
    data = support.shipped("spruce")
    free, stand = support.compiled(data), support.compiled(data | {"habit": 1})
    assert stand.leaf_count[0] < 0.5 * free.leaf_count[0]
    assert stand.rows["length"][0] == pytest.approx(free.rows["length"][0])


@pytest.mark.parametrize("habit", [-0.1, 1.1, "wide"])
def test_a_habit_out_of_range_is_named(habit: object) -> None:
    with pytest.raises(SpeciesError, match=r"oak\.json: habit: must be .*0 to 1"):
        species_from_dict(support.small(habit=habit), "oak", "oak.json")


def test_what_asks_for_light_has_fewer_leaves_in_a_stand() -> None:
    data = support.shipped("birch")
    stand = support.compiled(data | {"habit": 1})
    dense = support.compiled(data | {"habit": 1, "stand_leaves": 1})
    assert stand.leaf_count[0] == pytest.approx(data["stand_leaves"] * dense.leaf_count[0], rel=0.05)
    assert support.compiled(data).leaf_count[0] == support.compiled(data | {"stand_leaves": 1}).leaf_count[0]
    with pytest.raises(SpeciesError, match=r"oak\.json: stand_leaves: must be .*0\.05 to 1"):
        species_from_dict(support.small(stand_leaves=0), "oak", "oak.json")
