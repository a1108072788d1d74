# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does first takes few clicks in the window of a full Blender."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

STEPS = "click_steps", "clicks", 1500


@pytest.mark.parametrize(
    ("task", "most"), [("first_forest", 3), ("own_ground", 12), ("biome", 5), ("autumn", 2), ("own_tree", 4)]
)
def test_clicks_are_few(seen: dict, pictures: Path, colors: Callable[[Path], int], task: str, most: int) -> None:
    assert 1 <= seen[task]["clicks"] <= most
    assert colors(pictures / "clicks" / f"{task}.png") > 200


def test_a_first_forest_is_refined_and_rendered(seen: dict) -> None:
    found = seen["first_forest"]
    assert 60 <= found["plants"] <= 100
    assert found["shown"] > found["plants"]  # and its ground cover
    assert found["through_camera"]
    assert found["startup"] == ["Camera", "Cube", "Light"]
    assert found["refined"]
    assert found["green"] > 0.1


def test_a_mixed_wood_with_cover_grows_on_ones_own_ground_and_is_rendered(seen: dict) -> None:
    found = seen["own_ground"]
    assert len(set(found["species"])) == 3  # two pictures have added two others
    assert len(found["plants"]) == 2
    assert all(found["plants"])
    assert found["green"] > 0.1


def test_a_biome_grows_on_the_hill(seen: dict) -> None:
    assert seen["biome"]["layers"] > 1
    assert seen["biome"]["grounds"] == ["Hill"]


def test_it_is_autumn(seen: dict) -> None:
    assert seen["autumn"]["season"] == ['AUTUMN', True]


def test_a_tree_of_ones_own_is_a_species(seen: dict) -> None:
    assert seen["own_tree"]["species"] == 1
