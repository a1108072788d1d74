# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Suggested distances suit the crowns of the species, and leave room for as many plants as are asked for."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.sizes import crown_of
from tetflora_addon.planting.places import place
from tetflora_addon.planting.plane import Terrain
from tetflora_addon.planting.rules import CROWN_RADII, Rules, suggested_distance
from tetflora_addon.species.catalog import load_species


def _distance(identifier: str) -> float:
    return suggested_distance([crown_of(load_species(identifier)).radius], [1.0])


def test_a_birch_wood_stands_at_three_to_four_meters_and_grass_at_centimeters():
    assert 3.0 <= _distance("birch") <= 4.0
    assert 5.0 <= _distance("beech") <= 8.0
    assert 0.1 <= _distance("grass") <= 0.4
    assert _distance("grass") < _distance("fern") < _distance("bush") < _distance("birch") < _distance("oak")


@pytest.mark.parametrize("identifier", support.SPECIES)
def test_every_species_has_a_distance(identifier):
    crown = crown_of(load_species(identifier))
    assert 0.05 < crown.radius <= crown.height
    assert 0.1 <= _distance(identifier) <= 10.0
    assert crown.polygons > 100.0


def test_mixtures_are_weighted_by_area():
    assert suggested_distance([2.0], [5.0]) == pytest.approx(2.0 * CROWN_RADII)
    assert suggested_distance([2.0], [1.0], scale=1.5) == pytest.approx(3.0 * CROWN_RADII)
    assert suggested_distance([2.0, 9.0], [1.0, 0.0]) == pytest.approx(2.0 * CROWN_RADII)
    assert suggested_distance([2.0, 9.0], [1.0, -3.0]) == pytest.approx(2.0 * CROWN_RADII)
    assert suggested_distance([3.0, 4.0], [1.0, 1.0]) == pytest.approx(CROWN_RADII * 12.5**0.5, rel=0.05)
    assert suggested_distance([1.0], [0.0]) == 0.0
    assert suggested_distance([], []) == 0.0


def test_distances_are_short_numbers():
    for radius in np.random.default_rng(1).uniform(0.05, 9.0, 50):
        text = f"{suggested_distance([radius], [1.0]):g}"
        assert len(text.replace(".", "").lstrip("0")) <= 2


@pytest.mark.parametrize("per_hectare", [50.0, 300.0, 2_000.0, 20_000.0])
def test_a_density_that_is_asked_for_fits(per_hectare):
    density = per_hectare / 10_000.0
    distance = suggested_distance([6.0], [1.0], density=density)
    assert distance <= 6.0 * CROWN_RADII + 0.05
    side = 30.0 / density**0.5  # about 900 plants
    corners = np.array([[0.0, 0.0, 0.0], [side, 0.0, 0.0], [side, side, 0.0], [0.0, side, 0.0]])
    placed = place(
        Terrain(corners[[[0, 1, 2], [0, 2, 3]]]), Rules(by_density=True, density=density, min_distance=distance)
    )
    assert len(placed) > 0.9 * placed.wanted
