# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The key ``year`` of a species file: what is read, what is refused and how it is told, and how dates move."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.errors import SpeciesError
from tetflora_addon.species.catalog import species_from_dict
from tetflora_addon.species.species import DAYS, LeafYear, Year

LEAF: dict[str, Any] = {"appear": 115, "turn": 282, "fall": 296}


def read(**year: Any) -> Year | None:
    data = support.small()
    data["year"] = year
    return species_from_dict(data, "small", "small.json").year


def test_a_species_without_the_key_has_no_year() -> None:
    assert species_from_dict(support.small(), "small", "small.json").year is None


def test_what_is_not_written_has_its_default() -> None:
    year = read(leaf=LEAF)
    assert year == Year(leaf=LeafYear(**LEAF))
    assert year.of_kind(0) is year.leaf
    assert year.of_kind(1) is None


def test_all_that_is_written_is_read() -> None:
    numbers = {
        "appear_spread": 7.5,
        "growth": 20,
        "turn_spread": 3,
        "turning": 10,
        "fall_spread": 2,
        "kept": 0.1,
        "turnover": 0.5,
    }
    colors = {"fresh": [0.2, 0.3, 0.1], "dry": [0.3, 0.2, 0.1], "autumn": [[0.5, 0.3, 0.1]] * 4}
    year = read(
        latitude=41, spring=3, autumn=4, leaf={**LEAF, **numbers, **colors}, blossom=LEAF, source="Somebody 1999"
    )
    assert (year.latitude, year.spring, year.autumn, year.source) == (41, 3, 4, "Somebody 1999")
    autumn = ((0.5, 0.3, 0.1),) * 4
    assert year.leaf == LeafYear(**LEAF, **numbers, fresh=(0.2, 0.3, 0.1), dry=(0.3, 0.2, 0.1), autumn=autumn)
    assert year.blossom == LeafYear(**LEAF)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"leaf": {**LEAF, "leaves": 1}}, "year.leaf"),
        ({"winter": 1}, "winter"),
        ({"latitude": 95}, "year.latitude"),
        ({"leaf": {"appear": 100, "turn": 280}}, "year.leaf.fall"),
        ({"leaf": {**LEAF, "turn": 100}}, "year.leaf.turn"),
        ({"leaf": {**LEAF, "fall": 270}}, "year.leaf.fall"),
        ({"leaf": {**LEAF, "fall": 481}}, "year.leaf.fall"),
        ({"leaf": {**LEAF, "autumn": [[0.1, 0.2, 0.3]] * 5}}, "year.leaf.autumn"),
        ({"leaf": {**LEAF, "autumn": [[0.1, 0.2]]}}, "year.leaf.autumn"),
        ({"leaf": {**LEAF, "fresh": [2, 0, 0]}}, "year.leaf.fresh"),
        ({"blossom": {**LEAF, "kept": 2}}, "year.blossom.kept"),
        ({"leaf": {**LEAF, "growth": "long"}}, "year.leaf.growth"),
        ({"leaf": [1]}, "year.leaf"),
        ({"source": 3}, "year.source"),
    ],
)
def test_mistakes_are_told_with_the_key(wrong: dict[str, Any], told: str) -> None:
    with pytest.raises(SpeciesError, match=told.replace(".", r"\.")):
        read(**wrong)


@given(
    st.builds(
        LeafYear,
        appear=st.floats(60, 150),
        turn=st.floats(200, 300),
        fall=st.floats(301, 400),
        appear_spread=st.floats(0, 10),
        growth=st.floats(0, 40),
        turn_spread=st.floats(0, 10),
        fall_spread=st.floats(0, 10),
    ),
    st.floats(0, 70),
    st.floats(0, 70),
)
def test_wherever_it_is_leaves_appear_grow_turn_and_fall_within_a_year(
    leaf: LeafYear, home: float, there: float
) -> None:
    moved = Year(latitude=home, leaf=leaf).at_latitude(there).leaf
    assert moved.appear <= moved.turn <= moved.fall
    assert moved.fall - moved.appear <= DAYS
    assert moved.turn - moved.appear >= min(leaf.growth, leaf.turn - leaf.appear) - 1e-9
