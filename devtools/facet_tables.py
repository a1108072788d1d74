# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the table of facet weights of the shipped species: ``python -m devtools.facet_tables [--anew]``.

A fit takes up to a minute a species; those that have not changed since are kept.
"""

from __future__ import annotations

import argparse
import json

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.proxies import facet_weights
from tetflora_addon.refinement.statistics import at_once
from tetflora_addon.species.catalogue import list_species, load_species


def main(anew: bool) -> None:
    """Fit the species that the table does not have as they are now, or all anew; it is written after each of them."""
    facet_weights.TABLE.parent.mkdir(exist_ok=True)
    before = {} if anew else facet_weights.shipped()
    floras = {name: compile_species([load_species(name)]) for name in sorted(list_species())}
    digests = {name: facet_weights.digest(flora, 0) for name, flora in floras.items()}
    table = {digest: before[digest] for digest in digests.values() if digest in before}
    for identifier, flora in floras.items():
        if digests[identifier] in table:
            continue
        whole, own = at_once(facet_weights.fitting(flora, 0))
        table[digests[identifier]] = {
            "species": identifier,
            "whole": whole.round(3).tolist(),
            "own": own.round(3).tolist(),
        }
        _write(table)
        print(identifier, flush=True)
    _write(table)


def _write(table: dict[str, dict]) -> None:
    """In the order of the catalogue, a line for each species."""
    ordered = dict(sorted(table.items(), key=lambda item: item[1]["species"]))
    facet_weights.TABLE.write_text(json.dumps(ordered, separators=(",", ":")).replace('},"', '},\n"') + "\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--anew", action="store_true", help="fit all, as after a change of facets themselves")
    main(parser.parse_args().anew)
