# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Means over leaves on a day of the year."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.growth.seasons import Season
from tetflora_addon.species.catalog import load_species


@pytest.mark.parametrize("kind", [0, 1])
def test_leaves_and_blossoms_have_the_colors_of_their_own_kind(kind: int) -> None:
    flora = compile_species([load_species("cherry_blossom")]).in_year(Season(285.0))
    plants, owner, summer = support.trunks(flora.rows, support.plants(np.arange(3))), np.array([2, 0, 1]), np.eye(3)
    one, other = (flora.day.own_colors(plants, np.full(3, of), summer[owner])[owner] for of in (kind, 1 - kind))
    found = flora.day.own_colors(plants, np.full(3, kind), summer[owner][owner], owner)
    np.testing.assert_allclose(found, one)
    assert np.abs(found - other).max() > 0.01
