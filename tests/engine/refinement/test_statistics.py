# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics say what an artist has to know."""

from __future__ import annotations

import pytest

from tetflora_addon.refinement.loop import Statistics


@pytest.mark.parametrize(
    ("pixels", "asked", "told"), [(1.2, 1.2, False), (1.7, 1.2, False), (2.4, 1.2, True), (0.0, 0.0, False)]
)
def test_facets_that_are_coarser_than_set_are_told(pixels: float, asked: float, told: bool) -> None:
    text = Statistics(facet_pixels=pixels, facet_asked=asked).coarser
    assert bool(text) == told
    assert not told or ("2.4" in text and "1.2" in text and "Max Memory" in text)
