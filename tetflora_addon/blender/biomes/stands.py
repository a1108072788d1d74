# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of biomes that are stands: trees that grew together instead of being placed."""

from __future__ import annotations

from typing import Any

from ...errors import shown
from ..placing.population_files import check_keys, check_text


def check_stand(where: str, layer: dict[str, Any]) -> None:
    """Refuse what cannot be a stand.

    Raises
    ------
    ValueError
        Something is not as it must be; names the key.
    """
    check_keys(where, layer, {"kind", "name"}, {"kind", "name"})
    check_text(f'{where}: "name"', layer["name"])
    raise ValueError(f'{where}: "kind" is {shown(layer["kind"])}, which this version of TetFlora does not read')
