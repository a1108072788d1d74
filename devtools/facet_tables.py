# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the table of facet weights of the shipped species: ``python -m devtools.facet_tables``."""

from __future__ import annotations

import json

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.proxies import facet_weights
from tetflora_addon.refinement.statistics import at_once
from tetflora_addon.species.catalogue import list_species, load_species


def main() -> None:
    """Fit all species and write them in the order of the catalogue."""
    facet_weights.TABLE.parent.mkdir(exist_ok=True)
    facet_weights.TABLE.unlink(missing_ok=True)
    table = {}
    for identifier in sorted(list_species()):
        flora = compile_species([load_species(identifier)])
        whole, own = at_once(facet_weights.fitting(flora, 0))
        table[facet_weights.digest(flora, 0)] = {
            "species": identifier,
            "whole": whole.round(3).tolist(),
            "own": own.round(3).tolist(),
        }
        print(identifier, flush=True)
    facet_weights.TABLE.write_text(json.dumps(table, separators=(",", ":")).replace('},"', '},\n"') + "\n")


if __name__ == "__main__":
    main()
