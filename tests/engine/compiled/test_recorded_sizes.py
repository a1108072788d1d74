# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes that somebody recorded, and what plants measure to be fitted to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.recorded_sizes import (
    Lives,
    Sizes,
    _classes,
    _grown,
    _still,
    ages_of_heights,
    at_age,
    sized,
)
from tetflora_addon.growth.growth import trunks
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.kinds import Kind


def test_in_an_animation_plants_measure_what_they_do_in_stills() -> None:
    """At an age that was measured exactly so; between two, between their sizes."""
    species = load_species("birch")
    low, high = ages_of_heights(species, _classes(species, 1))[-4:-2].tolist()
    for crowded in (False, True):
        same, one = _grown(species, high, crowded), _still(species, high, crowded)
        assert (same.height, same.width) == pytest.approx((one.height, one.width), rel=1e-6)
        between = _grown(species, (low + high) / 2.0, crowded)
        assert _still(species, low, crowded).height < between.height < one.height


def test_what_grows_in_an_animation_does_not_flicker() -> None:
    """What is measured differs from one age to the next: a birch grew a third as much as in the year before."""
    birch, none, length = load_species("birch"), np.zeros(2), []
    for now in np.arange(21.0, 39.0, 1.5).tolist():
        history = np.array([20.0, 40.0]), np.array([8.0, 12.0]), none, none, none
        lives = Lives(now, *history, first=np.zeros(2, np.int64), species=np.zeros(2, np.int64))
        height = np.interp([now], *history[:2])
        sizes = Sizes(height, *np.zeros((4, 1)), np.zeros((1, 2)), np.ones((1, 2)), np.zeros(1, np.int64), lives)
        made, _ = sized(replace(support.plants(1), identifiers=("birch",)), None, sizes, load_species)
        own = at_age(birch, Kind.read(made.identifiers[made.species[0]]).age)
        length.append(trunks(compile_species([own]).rows, replace(made, species=np.zeros(1, np.int32))).length[0])
    steps = np.diff(np.log(length))
    assert steps.min() > 0.0
    assert np.abs(np.diff(steps)).max() < 0.003
