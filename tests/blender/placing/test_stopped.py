# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Placing plants that Esc or somebody else stops: the scene is as it was."""

from __future__ import annotations

import itertools

import bpy
import pytest

from tests.blender.scenes import add_mesh, datablocks, depsgraph, select
from tetflora_addon.blender.placing import populations
from tetflora_addon.blender.runtime import GoneError
from tetflora_addon.blender.worker import run_to_end

pytestmark = pytest.mark.usefixtures("clean_file")


def populated(count: int, store: str):
    """A population without plants."""
    scene = bpy.context.scene
    select(add_mesh("ground", size=200.0))
    population = populations.add_population(scene, [bpy.data.objects["ground"]])
    population.count, population.as_field, population.min_distance = count, store, 0.0
    population.distance_by_species = False
    return scene, population


def stop_after(steps, number: int) -> bool:
    """Close some steps; whether they had not ended before."""
    done = len(list(itertools.islice(steps, number)))
    steps.close()
    return done == number


@pytest.mark.parametrize("store", ['EMPTIES', 'FIELD'])
@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_plants_that_were_not_there_before_are_not_there_after(store: str, number: int) -> None:
    scene, population = populated(900, store)
    before = datablocks(), population.made, population.placed_by
    if stop_after(populations.make_plants_steps(scene, depsgraph(), population), number):
        assert (datablocks(), population.made, population.placed_by) == before


def test_all_steps_together_are_what_is_made_at_once() -> None:
    scene, population = populated(900, 'EMPTIES')
    steps = list(populations.make_plants_steps(scene, depsgraph(), population))
    assert len(steps) >= 5
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions)
    assert population.made == 900


@pytest.mark.parametrize("number", [1, 2])
def test_plants_that_were_there_stay(number: int) -> None:
    scene, population = populated(40, 'EMPTIES')
    run_to_end(populations.make_plants_steps(scene, depsgraph(), population))
    population.count = 70
    before, places = datablocks(), [tuple(o.location) for o in populations.own_objects(scene, population)]
    assert stop_after(populations.make_plants_steps(scene, depsgraph(), population), number)
    assert datablocks() == before
    assert [tuple(o.location) for o in populations.own_objects(scene, population)] == places


def test_another_arrangement_that_is_stopped_keeps_the_seed() -> None:
    scene, population = populated(40, 'EMPTIES')
    population.seed = 4
    assert stop_after(populations.reroll_steps(scene, depsgraph(), population), 2)
    assert population.seed == 4


def test_a_population_that_was_deleted_meanwhile_is_named() -> None:
    scene, population = populated(40, 'EMPTIES')
    steps = populations.make_plants_steps(scene, depsgraph(), population)
    next(steps), next(steps)
    scene.tetflora.layers.clear()
    with pytest.raises(GoneError, match="Placing plants was stopped because its population was deleted"):
        list(steps)
    assert not [o for o in scene.objects if o.tetflora.is_plant]
