# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Time and memory of growing a stand for 100 years: ``python -m benchmarks.stands_time PLANTS...`` prints a line each.

A mixed stand, 5,000 planted on a hectare, into which others come from seed.
"""

from __future__ import annotations

import json
import sys
import time

from devtools import session

YEARS, DENSITY = 100, 5000.0
SPECIES = ("beech", "oak", "birch", "scots_pine")


def measured(plants: int) -> dict[str, float]:
    """One stand; ``alive`` is the sum over all years of those that were there."""
    import numpy as np

    from tetflora_addon.species.catalog import load_species
    from tetflora_addon.stands.grow import StandSettings, begun
    from tetflora_addon.stands.site import StandSite
    from tetflora_addon.stands.traits import StandSpecies

    from .report import forget_peak, peak_mb

    forget_peak()
    side = 100.0 * (plants / DENSITY) ** 0.5
    cells = max(round(side / 5.0), 1)
    site = StandSite(0.0, 0.0, side / cells, np.zeros((cells, cells)))
    members = [StandSpecies(load_species(name)) for name in SPECIES]
    start, alive = time.perf_counter(), 0
    stand = begun(site, members, StandSettings(density=DENSITY, years=YEARS, interval=20))
    for year in range(YEARS):
        stand.step(year)
        alive += len(stand.plants)
    records = stand.finished()
    return {
        "plants": plants,
        "hectares": round(site.area / 1e4, 2),
        "s": round(time.perf_counter() - start, 2),
        "alive": alive,
        "records": len(records),
        "peak_mb": round(peak_mb()),
    }


if __name__ == "__main__":
    session.start()
    for number in map(int, sys.argv[1:]):
        print(json.dumps(measured(number)), flush=True)
    session.stop()
