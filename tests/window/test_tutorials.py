# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's tutorials lead to what they promise, see tutorial_steps.py."""

from __future__ import annotations

from pathlib import Path

import pytest

from devtools import tutorials


@pytest.fixture(scope="module")
def seen(full_blender: str, resources: Path, pictures: Path) -> dict:
    """What the steps have seen, with files of a place to import."""
    result = tutorials.run(full_blender, pictures / "tutorials", resources, 3000.0)
    assert result["ok"], result["error"]
    return result["values"]


def test_three_species_with_cover_grow_on_own_ground(seen: dict) -> None:
    found = seen["own_ground"]
    assert len(set(found["species"])) == 3
    assert all(found["plants"])
    assert found["green"] > 0.1


def test_a_biome_gets_fewer_birches_no_junipers_and_autumn(seen: dict) -> None:
    found = seen["biome"]
    before, after = found["birches"]
    assert found["active"] == "Birches" and after < 0.7 * before
    assert not found["shown"]
    assert found["season"] == 'AUTUMN'
    assert found["green"][0] > 0.1


def test_a_stand_has_years_and_keys(seen: dict) -> None:
    found = seen["grown_forest"]
    assert found["last"] == found["year"] == 100
    assert min(found["green"]) > 0.1
    assert found["animated"]


def test_a_place_has_ground_outlines_and_trees(seen: dict) -> None:
    found = seen["real_place"]
    assert {"Woods", "Water", "Roads", "Buildings"} <= set(found["collections"])
    assert len(found["fields"]) == 2
    assert found["green"] > 0.1


def test_own_trees_are_planted_and_one_follows_a_drawing(seen: dict) -> None:
    found = seen["own_trees"]
    assert len(found["mix"]) == 1 and found["mix"][0] != "beech"
    assert found["plants"] > 10 and found["drawn"] == 1


def test_a_year_goes_by_evenly(seen: dict) -> None:
    found = seen["film"]
    assert found["enabled"]
    (keys,) = found["keys"]
    assert [key[:2] for key in keys] == [[1.0, 1.0], [73.0, 361.0]]
    assert {key[2] for key in keys} == {'LINEAR'}
    winter, _, summer, _ = found["green"]
    assert summer > winter
