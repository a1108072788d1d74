# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files at the limits of what is read: refused or read in a time that grows with their size."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from tests.engine import support
from tests.engine.species.test_species import refusal
from tetflora_addon.errors import SpeciesError
from tetflora_addon.leaves.models import MAX_FACE_CORNERS, leaf_model
from tetflora_addon.species.catalog import read_species


def test_a_key_twice_among_very_many_is_found_at_once(tmp_path: Path) -> None:
    """Each key was looked for among all: minutes for a file of the largest size."""
    path = tmp_path / "twice.json"
    path.write_text("{" + ",".join(f'"{n}": 0' for n in [*range(150_000), 149_999]) + "}", encoding="utf-8")
    begun = time.process_time()
    with pytest.raises(SpeciesError, match=r"twice\.json: 149999: duplicate key"):
        read_species(path)
    assert time.process_time() - begun < 5


def test_faces_of_leaves_have_few_corners() -> None:
    """Blocks and limits count polygons, so a face of thousands of corners would slip through all of them."""
    turn = np.arange(MAX_FACE_CORNERS + 1) * 2 * np.pi / (MAX_FACE_CORNERS + 1)
    disc = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    assert leaf_model(disc, [list(range(MAX_FACE_CORNERS))]).polygons == 1
    leaf = {"vertices": disc.tolist(), "faces": [list(range(MAX_FACE_CORNERS + 1))]}
    assert "triangulate" in refusal(support.small(leaf=leaf))
