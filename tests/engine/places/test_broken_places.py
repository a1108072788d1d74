# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files with anything wrong in them are read, or refused with a text; nothing else ever happens."""

from __future__ import annotations

import random

import pytest

from benchmarks import places_files as files
from tetflora_addon.errors import SceneError
from tetflora_addon.jobs import at_once
from tetflora_addon.places.geotiff import read_head
from tetflora_addon.places.inventories import read_inventory
from tetflora_addon.places.outlines import read_outlines
from tetflora_addon.places.rasters import read_ascii

_READERS = {
    "grid": lambda path: at_once(read_ascii(path)),
    "tiff": read_head,
    "tiff_16": read_head,
    "big_tiff": read_head,
    "csv": read_inventory,
    "points": read_inventory,
    "outlines": read_outlines,
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", _READERS)
def test_mutated_files(tmp_path, kind):
    usual, refused = files.FILES[kind][2], 0
    _READERS[kind](files.write(tmp_path, kind)[1])  # it is sound
    for seed in range(100):
        _, path = files.write(tmp_path, kind, files.mutated(random.Random(seed), usual))
        try:
            _READERS[kind](path)
        except SceneError as error:
            assert str(error).startswith(f"{path.name}: ")
            refused += 1
    assert refused > 20
