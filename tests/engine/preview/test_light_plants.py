# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Very many plants as points, and those near as crowns with faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.growth.seasons import Season
from tetflora_addon.growth.seeds import crown_shapes
from tetflora_addon.preview import light_plants
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.species import Range

#: Species, and how far to the east.
KINDS = ("birch", 0.0), ("bush", 40.0)


@pytest.mark.parametrize("formed", [False, True])
def test_points_have_the_form_and_color_of_the_crowns_with_faces(formed: bool) -> None:
    """As high and as wide in the same places; those with faces are those that look largest from where one stands."""
    flora, rng = support.flora(), np.random.default_rng(5)
    species = rng.permutation(np.repeat([support.SPECIES.index("birch"), support.SPECIES.index("bush")], 20))
    seeds = support.plants(np.arange(40), 0, rng.uniform(-30.0, 30.0, (40, 3)), rng.uniform(0.5, 1.0, 40))
    seeds = replace(seeds, species=species.astype(np.int32))
    if formed:
        seeds = replace(seeds, crown=crown_shapes(40, rng.uniform(0.5, 1.5, 40), rng.uniform(0.0, 0.6, 40)))
    expected, points = light_plants.light_plants(flora, seeds), light_plants.light_plants(flora, seeds, most=10)
    eye, forms = np.array([30.0, 0.0, 5.0]), points.crowns.forms
    angle = forms[:, 1] / np.linalg.norm(seeds.position - eye, axis=1)
    order = np.argsort(-angle)
    near, _ = light_plants.nearest(points, eye, 40)

    def heights_and_radii(shapes: light_plants.Shapes, order: np.ndarray) -> np.ndarray:
        corners = shapes.positions.reshape(40, -1, 3) + shapes.origin - seeds.position[order, None]
        rings = (corners[:, first : first + 4] for first in (1, 5))
        radii = [np.linalg.norm(ring - ring.mean(axis=1)[:, None], axis=2).mean(axis=1) for ring in rings]
        return np.column_stack([corners[:, 0, 2], corners[:, 9, 2], *radii])

    np.testing.assert_allclose(heights_and_radii(near, order), forms[order], rtol=1e-3)  # the largest come first
    np.testing.assert_allclose(heights_and_radii(expected, np.arange(40)), forms, rtol=0.05)  # its trunks lean
    top, usual = (shapes.colors.reshape(40, -1, 3)[:, 9] for shapes in (near, expected))  # of the highest corner
    np.testing.assert_allclose(top, usual[order], atol=0.06)
    some, least = light_plants.nearest(points, eye, 5)
    feet = (some.positions.reshape(5, -1, 3)[:, 10:14].mean(axis=1) + some.origin)[:, None] - seeds.position
    assert set(np.linalg.norm(feet, axis=2).argmin(axis=1)) == set(np.argsort(angle)[-5:])
    assert least == pytest.approx(np.sort(angle)[-5], rel=1e-4)


def test_fallen_branches_lie_on_the_ground_among_very_many_plants() -> None:
    """Their trunk lies, whatever the frame of the plant says, also where they are points and have faces near."""
    upright = support.flora().species[support.SPECIES.index("bush")]
    orders = (replace(upright.orders[0], angle=Range(88.5, 1.0)), *upright.orders[1:])
    flora = compile_species([replace(upright, orders=orders)])
    points = light_plants.light_plants(flora, support.plants(np.arange(30), 0, np.zeros((30, 3)), 1.0), most=10)
    near, _ = light_plants.nearest(points, np.array([30.0, 0.0, 5.0]), 30)
    length, top = points.crowns.forms[:, 1], near.positions.reshape(30, -1, 3)[:, 9]
    assert (np.abs(top[:, 2]) < 0.1 * length).all()
    np.testing.assert_allclose(np.linalg.norm(top, axis=1), np.sort(length)[::-1], rtol=1e-3)


def test_what_is_seen_through_is_narrower_and_covers_as_much_as_it_does() -> None:
    flora = support.flora()
    for name, least, most in (("birch", 0.9, 1.0), ("flower", 0.4, 0.6)):  # with leaves of 6 and of 1.3 times its side
        number = support.SPECIES.index(name)
        whole = light_plants._profile(flora, int(flora.first_row[number]))
        shown = light_plants._profiles(flora)[number]
        assert np.array_equal(shown[:2], whole[:2])
        assert (least < shown[2:] / whole[2:]).all()
        assert (shown[2:] / whole[2:] < most).all()


def test_points_of_two_kinds_are_joined_with_their_looks() -> None:
    flora, places = support.flora(), np.random.default_rng(6).uniform(-9.0, 9.0, (30, 3))
    seeds = [support.plants(np.arange(30), support.SPECIES.index(name), places + x, 1.0) for name, x in KINDS]
    parts = [light_plants.light_plants(flora, one, most=10) for one in seeds]
    whole = light_plants.joined(parts)
    looks = [part.crowns.looks[part.crowns.kinds] for part in parts]
    assert np.array_equal(whole.crowns.looks[whole.crowns.kinds], np.concatenate(looks))
    feet = np.concatenate([one.position for one in seeds])
    np.testing.assert_allclose(whole.crowns.positions + whole.origin, feet, atol=1e-3)
    assert whole.plants == 60


def test_faces_of_two_kinds_are_joined_with_their_own_corners() -> None:
    flora, places = support.flora(), np.random.default_rng(6).uniform(-9.0, 9.0, (4, 3))
    seeds = [support.plants(np.arange(4), support.SPECIES.index(name), places + x, 1.0) for name, x in KINDS]
    parts = [light_plants.light_plants(flora, one) for one in seeds]
    assert all(part.crowns is None for part in parts)
    whole = light_plants.joined(parts)
    corners = [part.positions[part.indices] + part.origin for part in parts]
    np.testing.assert_allclose(whole.positions[whole.indices] + whole.origin, np.concatenate(corners), atol=1e-4)
    assert np.array_equal(light_plants.joined(parts[1:]).positions, parts[1].positions)


def test_crowns_are_never_larger_than_in_summer_and_smallest_without_leaves() -> None:
    flora = compile_species([load_species("birch")])
    summer = light_plants.crown_areas(flora)
    areas = [light_plants.crown_areas(flora.in_year(Season(day))) / summer for day in (15.0, 120.0, 200.0, 290.0)]
    assert max(areas) <= 1.0 + 1e-9
    assert areas[0] == pytest.approx(light_plants._BARE, abs=0.02)
    assert areas[2] > 0.95
