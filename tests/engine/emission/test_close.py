# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Within arm's reach of the camera there are leaves, also where they are thought hidden or beside the view."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine.emission.test_leaf_detail import near
from tests.engine.refinement.test_loop import run
from tetflora_addon.emission import portions
from tetflora_addon.emission.facets import facet_parts
from tetflora_addon.emission.plants import Transition
from tetflora_addon.proxies.facet_sizes import FacetPixels


def largest_facet(away: float) -> float:
    """Side in pixels of the largest facet whose middle is within the view, where a camera is so far from a leaf."""
    flora, camera, seeds, _ = near(away)
    _, result = run(flora, seeds, camera)
    largest = 0.0
    for parts in facet_parts(flora, result, camera, FacetPixels(0.5), Transition(flora, camera, 0.5)):
        for facets, _ in parts:
            within = camera.clearance(facets.centre) < 0.0
            pixels = facets.side[within] / camera.extent_around(facets.centre[within])
            largest = max(largest, pixels.max(initial=0.0))
    return largest


@pytest.mark.parametrize("away", [0.4, 1.5])
def test_no_facet_within_the_view_is_as_large_as_a_near_leaf(away: float) -> None:
    assert largest_facet(away) < 2.5 * portions.CLOSE


def test_it_would_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same camera, if what is near were treated as what is far."""
    monkeypatch.setattr(portions, "CLOSE", np.inf)
    assert largest_facet(0.4) > 15.0
