# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the table of facet weights of the shipped species: ``python -m devtools.facet_tables [--anew]``.

A fit takes up to a minute a species; those that have not changed since are kept.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor, as_completed

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.jobs import at_once
from tetflora_addon.proxies import facet_weights
from tetflora_addon.species.catalogue import list_species, load_species


def main(anew: bool) -> None:
    """Fit the species that the table does not have as they are now, or all anew; it is written after each of them."""
    facet_weights.TABLE.parent.mkdir(exist_ok=True)
    before = {} if anew else facet_weights.shipped()
    digests = {name: facet_weights.digest(compile_species([load_species(name)]), 0) for name in sorted(list_species())}
    table = {digest: before[digest] for digest in digests.values() if digest in before}
    missing = [name for name, digest in digests.items() if digest not in table]
    with ProcessPoolExecutor() as pool:
        for done in as_completed([pool.submit(_fitted, name) for name in missing]):
            digest, weights = done.result()
            table[digest] = weights
            _write(table)
            print(weights["species"], flush=True)
    _write(table)


def _fitted(identifier: str) -> tuple[str, dict]:
    """The line of one species, with its digest."""
    flora = compile_species([load_species(identifier)])
    whole, own = at_once(facet_weights.fitting(flora, 0))
    return facet_weights.digest(flora, 0), {
        "species": identifier,
        "whole": whole.round(3).tolist(),
        "own": own.round(3).tolist(),
    }


def _write(table: dict[str, dict]) -> None:
    """In the order of the catalogue, a line for each species."""
    ordered = dict(sorted(table.items(), key=lambda item: item[1]["species"]))
    facet_weights.TABLE.write_text(json.dumps(ordered, separators=(",", ":")).replace('},"', '},\n"') + "\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--anew", action="store_true", help="fit all, as after a change of facets themselves")
    main(parser.parse_args().anew)
