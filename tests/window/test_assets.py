# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalog as an asset library, in the real window: a plant is dragged from the asset browser into the scene."""

from __future__ import annotations

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "asset_steps", "assets", 180


def test_the_library_is_known_to_blender(seen: dict) -> None:
    assert "TetFlora" in seen["libraries"]


def test_a_plant_that_is_dropped_is_a_plant(seen: dict) -> None:
    """One object of this file, of a species of the catalog, in a scene that is ready for it."""
    assert len(seen["plants"]) == 1
    _, is_plant, species, own = seen["plants"][0]
    assert is_plant
    assert species
    assert own
    assert seen["marks"] == []
    assert seen["locked"]
