# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the table of facet weights of the shipped species: ``python -m devtools.facet_tables [--anew]``.

Each species is measured as described, with fewer leaves, and at other ages (`proxies.facet_weights`). A fit takes up
to a minute; those that have not changed since are kept, and what is done is written all the time.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any

import numpy as np

from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.compiled.recorded_sizes import crowds, of_dense_stand
from tetflora_addon.jobs import run_to_end
from tetflora_addon.proxies import facet_weights
from tetflora_addon.proxies.facet_weights import SHARES, ages_measured, compiled_at_age, with_leaves
from tetflora_addon.species.ages import ages_of
from tetflora_addon.species.catalog import list_species, load_species
from tetflora_addon.species.species import Species

#: Blocked rays from which weights of variants follow; those of species as described follow from all.
_RAYS = 40_000.0
_WRITTEN = 20.0  # seconds from one writing to the next


def main(anew: bool) -> None:
    """Fit what the table does not have as it is now, or all anew."""
    facet_weights.TABLE.parent.mkdir(exist_ok=True)
    before = {} if anew else _written()
    table, missing = {}, []
    for name in sorted(list_species()):
        for number, (label, flora) in enumerate(variants(load_species(name))):
            digest = facet_weights.digest(flora, 0)
            if digest in before:
                table[digest] = {**before[digest], "species": label}
            else:
                missing.append((name, number))
    print(f"{len(table)} known, {len(missing)} to do", flush=True)
    last = time.monotonic()
    with ProcessPoolExecutor() as pool:
        for done in as_completed([pool.submit(_fitted, *one) for one in missing]):
            digest, weights = done.result()
            table[digest] = weights
            print(weights["species"], flush=True)
            if time.monotonic() - last > _WRITTEN:
                _write({**before, **table})
                last = time.monotonic()
    _write(table)


def variants(species: Species) -> Iterator[tuple[str, Flora]]:
    """All variants of a species of which weights are needed on any day and at any age, each with a name."""
    plain = compile_species([species])
    shares = SHARES if species.year is not None else SHARES[:2]
    for share in shares:
        yield f"{species.identifier} {share:g}", with_leaves(plain.species[0], share)
    every = [(species, "", ages_measured(species))]
    if len(every[0][2]) > 1 and crowds(species):
        dense, dies = of_dense_stand(species), ages_of(species).lifespan
        yield from ((f"{species.identifier} dense {s:g}", with_leaves(dense, s)) for s in shares)
        every.append((dense, " dense", [age for age in ages_measured(dense) if age < dies]))
    for one, kind, ages in every:
        for years in ages:
            if years != 0.0:
                yield f"{species.identifier}{kind} {years:g} years", compiled_at_age(one, years)


def _written() -> dict[str, Any]:
    try:
        return json.loads(facet_weights.TABLE.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}


def _fitted(identifier: str, number: int) -> tuple[str, dict]:
    """The line of one variant of a species, with its digest."""
    label, flora = list(variants(load_species(identifier)))[number]
    return facet_weights.digest(flora, 0), {"species": label, **_weights(flora, number == 0)}


def _weights(flora: Flora, described: bool) -> dict[str, Any]:
    whole, own = run_to_end(facet_weights.fitting(flora, 0, np.inf if described else _RAYS))
    digits = 3 if described else 2
    return {"whole": whole.round(digits).tolist(), "own": own.round(digits).tolist()}


def _write(table: dict[str, dict]) -> None:
    """In the order of the catalog, a line for each variant."""
    ordered = dict(sorted(table.items(), key=lambda item: (item[1]["species"].split()[0], item[1]["species"])))
    facet_weights.TABLE.write_text(json.dumps(ordered, separators=(",", ":")).replace('},"', '},\n"') + "\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--anew", action="store_true", help="fit all, as after a change of facets themselves")
    main(parser.parse_args().anew)
