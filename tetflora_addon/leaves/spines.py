# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What spines of fleshy leaves, as of cacti, are described by; `areoles` makes them."""

from __future__ import annotations

from dataclasses import dataclass

from .outlines import limited


@dataclass(frozen=True)
class Spines:
    """Spines on a closed body; lengths are fractions of the leaf's."""

    distance: float = limited(0.1, 0.03, 1, "distance of areoles, from which spines grow")
    number: int = limited(2, 1, 12, "spines of an areole")
    length: float = limited(0.07, 0.005, 1, "length of a spine")
    thickness: float = limited(0.003, 0.0005, 0.05, "thickness of a spine at its base")
    lean: float = limited(35.0, 0, 85, "angle between a spine and what is perpendicular to the leaf, degrees")
