# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does first takes few clicks in the window of a full Blender."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

STEPS = "click_steps", "clicks", 240


@pytest.mark.parametrize(("task", "most"), [("autumn", 2), ("own_tree", 4)])
def test_clicks_are_few(seen: dict, pictures: Path, colors: Callable[[Path], int], task: str, most: int) -> None:
    assert 1 <= seen[task]["clicks"] <= most
    assert colors(pictures / "clicks" / f"{task}.png") > 200


def test_it_is_autumn(seen: dict) -> None:
    assert seen["autumn"]["season"] == ['AUTUMN', True]


def test_a_tree_of_ones_own_is_a_species(seen: dict) -> None:
    assert seen["own_tree"]["species"] == 1
