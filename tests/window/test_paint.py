# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What paint_steps.py did in the real window: the brush, plants set by clicking."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "paint_steps", "paint", 240


def test_the_brush_paints_where_the_mouse_goes(seen: dict) -> None:
    assert seen["painting"]
    painted = seen["painted"]
    assert len(painted) > 10
    assert all(abs(y) <= 5.0 + 0.3 and abs(z) < 1e-3 for _, y, z in painted)
    assert max(x for x, _, _ in painted) - min(x for x, _, _ in painted) > 8.0


def test_shift_erases_and_each_stroke_is_an_undo_step(seen: dict) -> None:
    assert 0 < len(seen["erased"]) < len(seen["painted"])
    assert all(place in seen["painted"] for place in seen["erased"])
    assert seen["undone"] == seen["painted"]
    assert seen["redone"] == seen["erased"]


def test_keys_change_the_brush_and_escape_keeps_what_was_painted(seen: dict) -> None:
    assert seen["wider"] == pytest.approx(5.5)
    assert seen["widest"] != pytest.approx(5.5)
    assert seen["mode"] == 'THIN'
    assert 0 < len(seen["thinned"]) < len(seen["painted"])
    assert not seen["painting_after"]
    assert seen["kept"] == seen["thinned"]
    assert seen["undone_outside"] == seen["painted"]


def test_a_click_places_a_plant(seen: dict) -> None:
    assert seen["placed"] == 1
    species, azimuth, scale, height = seen["new"]
    assert species == "conifer"
    assert azimuth == pytest.approx(30.0, abs=0.1)
    assert scale == pytest.approx(1.1, abs=0.01)
    assert height == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("name", ["painted", "erased", "thinned", "placing", "pie"])
def test_the_window_was_drawn(seen: dict, pictures: Path, colors: Callable[[Path], int], name: str) -> None:
    assert colors(pictures / "paint" / f"{name}.png") > 200
