# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A click on a picture chooses what it shows, see gallery_steps.py."""

from __future__ import annotations

import pytest

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "gallery_steps", "gallery", 120


@pytest.mark.parametrize("gallery", ["species"])
def test_two_pictures_choose_two_things(seen: dict, gallery: str) -> None:
    (one, shown), (other, shown_then) = seen[gallery]
    assert (shown, shown_then) == (one, other)
    assert one != "" != other != one
