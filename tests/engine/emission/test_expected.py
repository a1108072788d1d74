# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a refinement is expected to be drawn with is about what is drawn, before a sample corrects it."""

from __future__ import annotations

import pytest

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tetflora_addon.emission.expected import Expected
from tetflora_addon.emission.plants import Transition, explicit_blocks

LIMIT = 0.4


@pytest.mark.parametrize("species", ["dead_tree", "birch"])
@pytest.mark.parametrize("away", [60.0, 250.0])
def test_what_is_expected_is_about_what_is_made(species: str, away: float) -> None:
    """Also of trees without leaves: their twigs are far too thin in the image to be tubes, as thick as they are at
    the base.
    """
    flora = support.compiled(support.shipped(species))
    camera = support.camera((0.0, -away, 5.0), (0.0, 0.0, 5.0), pixels=400)
    _, result = run(flora, support.grove(9, 6.0), camera)
    transition = Transition(flora, camera, LIMIT)
    made = sum(block.buffers.polygons for block in explicit_blocks(flora, result, camera, transition))
    expected = Expected(flora, result, camera).seen(1.0, LIMIT, 0.0)
    assert expected == pytest.approx(made, rel=0.3, abs=500.0)
