# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files with anything wrong in them are read, or refused with a text; nothing else ever happens."""

from __future__ import annotations

import random

import pytest

from tests import places_files as files
from tetflora_addon.errors import SceneError
from tetflora_addon.geodata.grids import read_grid
from tetflora_addon.geodata.inventories import read_inventory
from tetflora_addon.geodata.outlines import read_outlines
from tetflora_addon.jobs import run_to_end

_OPERATORS = {
    "import_terrain": lambda path: run_to_end(read_grid(path)),
    "import_canopy": lambda path: run_to_end(read_grid(path)),
    "import_inventory": read_inventory,
    "import_outlines": read_outlines,
}
_READERS = {kind: _OPERATORS[operator] for kind, (operator, *_) in files.FILES.items() if kind != "png"}


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
