# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A tree out of view whose shadow falls into it has its trunk where it is, without gaps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.crowns import crown_of
from tetflora_addon.emission.facets import facet_parts
from tetflora_addon.jobs import at_once
from tetflora_addon.proxies.facet_sizes import FacetPixels
from tetflora_addon.refinement.lights import Light
from tetflora_addon.refinement.loop import refine
from tetflora_addon.refinement.settings import RefinementSettings

#: Looks north; the tree stands behind it, and beside it another one that is seen.
CAMERA = support.camera([0.0, 0.0, 1.7], [0.0, 10.0, 1.7])


@pytest.mark.parametrize("species", ["maple", "birch"])
def test_trunks_that_throw_shadows_have_no_gaps(species: str) -> None:
    flora = support.compiled(support.shipped(species))
    base = min(crown_of(flora.species[0]).base, 2.0)
    seeds = support.plants([3, 4], position=[[0.0, -16.0, 0.0], [0.0, 30.0, 0.0]])
    direction = np.array([0.0, 1.0, -0.6]) / np.hypot(1.0, 0.6)
    lights = (Light("SUN", np.zeros(3), direction, 0.01),)
    result = at_once(refine(flora, seeds, CAMERA, RefinementSettings(), lights=lights))
    found = [f for block in facet_parts(flora, result, CAMERA, FacetPixels(0.33)) for f, _ in block]
    centre, side = (np.concatenate([getattr(f, name) for f in found]) for name in ("centre", "side"))
    near = np.hypot(centre[:, 0], centre[:, 1] + 16.0) < 0.35
    low = near & (centre[:, 2] < base)
    order = np.argsort(centre[low, 2])
    height, reach = centre[low, 2][order], side[low][order]
    assert len(height) > 5
    assert (np.diff(height) < 1.5 * np.maximum(reach[1:], reach[:-1])).all()
