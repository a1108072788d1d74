# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A click on a picture chooses what it shows, see gallery_steps.py."""

from __future__ import annotations

from pathlib import Path

import pytest

from devtools import window

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def seen(full_blender: str, resources: Path, pictures: Path) -> dict:
    result = window.run_in_window(full_blender, HERE / "gallery_steps.py", pictures / "gallery", 120, resources)
    assert result["ok"], result["error"]
    return result["values"]


@pytest.mark.parametrize("gallery", ["biomes", "species"])
def test_two_pictures_choose_two_things(seen: dict, gallery: str) -> None:
    (one, shown), (other, shown_then) = seen[gallery]
    assert (shown, shown_then) == (one, other)
    assert one != "" != other != one
