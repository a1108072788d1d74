# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The forest of forest_steps.py in the real window: Populate, Refine, Esc, undo and F12, judged by numbers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "forest_steps", "forest", 240


def faces(state: dict) -> dict[str, int]:
    return dict(state["objects"])


def test_populate_places_plants_and_changes_nothing_else(seen: dict) -> None:
    bare, populated = faces(seen["bare"]), faces(seen["populated"])
    planted = {name for name, _, _ in seen["populated"]["plants"]}
    assert seen["bare"]["plants"] == []
    assert len(planted) == 14
    assert set(populated) - set(bare) == planted
    assert {species for _, species, _ in seen["populated"]["plants"]} == {"broadleaf_tree", "conifer", "bush"}
    assert seen["populated"]["materials"] == seen["bare"]["materials"]
    assert seen["locked"]


def test_refine_is_on_top_of_the_tab_whatever_is_open_below(seen: dict) -> None:
    assert seen["below_top"]["tetflora.refine"] < 80  # pixels


def test_refine_makes_what_it_says(seen: dict) -> None:
    figures = json.loads(seen["statistics"])
    made = set(faces(seen["refined"])) - set(faces(seen["populated"]))
    polygons = sum(faces(seen["refined"])[name] for name in made)
    assert figures["plants"] == 14
    assert figures["polygons_meshed"] > 10_000
    assert polygons == figures["polygons_meshed"] + figures["polygons_proxy"]
    assert seen["refined"]["plants"] == seen["populated"]["plants"]
    assert not seen["running_after"]


def test_escape_leaves_the_scene_as_it_was(seen: dict) -> None:
    assert seen["running_before_esc"], "the job was over before Esc came"
    assert seen["escaped"] == seen["refined"]


def test_undo_restores_the_scene(seen: dict) -> None:
    for undone, before in (("refine_undone", "populated"), ("populate_undone", "bare")):
        # Undo keeps datablocks that nobody uses; the scene holds what it held.
        for key in ("plants", "objects", "collections", "statistics"):
            assert seen[undone][key] == seen[before][key], (undone, key)
    assert seen["populate_redone"]["plants"] == seen["populated"]["plants"]


def test_render_shows_the_forest_and_leaves_no_meshes(seen: dict) -> None:
    assert seen["green"] > 0.1
    assert seen["green_without"] == 0.0
    assert seen["after_render"]["objects"] == seen["populate_redone"]["objects"]


def test_search_finds_populate(seen: dict) -> None:
    assert 0 < seen["planted_by_search"] <= 14  # fewer where the first ones stand in the way


def test_populate_can_be_adjusted_afterwards(seen: dict) -> None:
    assert [species for _, species, _ in seen["adjusted"]] == ["bush"] * 5


@pytest.mark.parametrize(
    "name", ["populated", "progress", "refined", "escaped", "rendered", "nothing_refined", "search"]
)
def test_the_window_was_drawn(seen: dict, pictures: Path, colors: Callable[[Path], int], name: str) -> None:
    assert colors(pictures / "forest" / f"{name}.png") > 200
