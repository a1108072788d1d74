# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes that somebody recorded, and what plants measure to be fitted to them."""

from __future__ import annotations

import pytest

from tetflora_addon.compiled.recorded_sizes import _classes, _grown, _still, ages_of_heights
from tetflora_addon.species.catalog import load_species


def test_in_an_animation_plants_measure_what_they_do_in_stills() -> None:
    """At an age that was measured exactly so; between two, between their sizes."""
    species = load_species("birch")
    low, high = ages_of_heights(species, _classes(species, 1))[-4:-2].tolist()
    for crowded in (False, True):
        same, one = _grown(species, high, crowded), _still(species, high, crowded)
        assert (same.height, same.width) == pytest.approx((one.height, one.width), rel=1e-6)
        between = _grown(species, (low + high) / 2.0, crowded)
        assert _still(species, low, crowded).height < between.height < one.height
