# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves on the ground are there from the first that falls to the last that rots, and in no summer."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.growth.seasons import Season, is_gone
from tetflora_addon.species.catalog import builtin_folder, load_species, species_from_dict
from tetflora_addon.species.litter import leaves_page

OAK = species_from_dict(
    json.loads(
        json.dumps(leaves_page(load_species("oak"), json.loads((builtin_folder() / "oak.json").read_text("utf-8"))))
    ),
    "oak_leaves",
    "page",
)


@pytest.mark.parametrize("name", support.SPECIES)
def test_no_living_species_is_taken_for_fallen_leaves(name):
    assert not is_gone(load_species(name), None)


def test_without_seasons_it_is_summer():
    assert is_gone(OAK, None)


@given(st.floats(0, 364))
def test_leaves_of_winter_only_make_no_fallen_leaves_of_a_living_plant(day):
    """Arum and some orchids are green from autumn to spring, and stand without leaves in summer."""
    winter = support.small(year={"leaf": {"appear": 300, "turn": 470, "fall": 485, "growth": 0}})
    species = species_from_dict(winter, "arum", "arum.json")
    assert not is_gone(species, None)
    assert not is_gone(species, Season(day, 50.0))


@given(st.floats(0, 364), st.floats(30, 60), st.floats(0, 2))
def test_the_south_is_half_a_year_apart(day, latitude, spread):
    assert is_gone(OAK, Season(day, latitude, spread)) == is_gone(OAK, Season((day + 182.5) % 365, -latitude, spread))


@given(st.floats(0, 364), st.floats(45, 55))
def test_they_are_gone_in_summer_and_there_after_the_fall(day, latitude):
    if 170 <= day <= 240:
        assert is_gone(OAK, Season(day, latitude))
    if day >= 320 or day <= 60:
        assert not is_gone(OAK, Season(day, latitude))


@given(st.floats(0, 364), st.floats(0, 1), st.floats(0, 1))
def test_plants_that_differ_more_are_there_for_longer(day, less, more):
    less, more = sorted((less, more))
    assert is_gone(OAK, Season(day, 50.0, less)) >= is_gone(OAK, Season(day, 50.0, more))
