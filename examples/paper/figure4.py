# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 4: the catalog, one plant of each species, with the polygons that it expands to."""

from __future__ import annotations

from pathlib import Path

from tetflora_addon.species import catalog

from ..species_sheet import render_sheet


def make(out: Path, images: Path, small: bool) -> dict[str, float]:
    """Make ``species.jpg``; returns the number of species and the polygons of the smallest and the largest plant."""
    known = list(catalog.list_species())
    polygons = render_sheet(images / "species.jpg", *((1, known[:2]) if small else ()))
    return {"species": len(polygons), "polygons_min": min(polygons.values()), "polygons_max": max(polygons.values())}
