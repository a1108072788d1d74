# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights of species that are not shipped: quick, in steps, and those of all rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.jobs import run_to_end
from tetflora_addon.proxies import facet_weights as subject
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.species import Range, Species

#: What the quick weights may differ by from those of all rays, as a fraction of the area.
MOST = 0.02


def edited(identifier: str, **factors: float) -> Species:
    """A shipped species of which some ranges of all orders are multiplied."""
    species = load_species(identifier)

    def times(value: Range, factor: float) -> Range:
        return Range(value.mean * factor, value.variation * factor)

    orders = [
        replace(order, **{key: times(getattr(order, key), factor) for key, factor in factors.items()})
        for order in species.orders
    ]
    return replace(species, identifier="edited", orders=tuple(orders))


@pytest.mark.parametrize("identifier", ["birch", "fern"])
def test_quick_weights_of_shipped_species_are_those_of_the_tables(identifier: str) -> None:
    flora = compile_species([load_species(identifier)])
    known = subject.shipped()[subject.digest(flora, 0)]
    whole, own = run_to_end(subject.fitting(flora, 0, subject.RAYS))
    np.testing.assert_allclose([whole, own], known, atol=MOST)


def test_quick_weights_of_an_edited_species_are_those_of_all_rays() -> None:
    flora = compile_species([edited("grass", leaves=1.6, length=1.2)])
    quick, full = (run_to_end(subject.fitting(flora, 0, rays)) for rays in (subject.RAYS, np.inf))
    np.testing.assert_allclose(quick, full, atol=MOST)


def test_weights_are_measured_in_steps_and_what_is_stopped_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subject, "_measured", {})
    monkeypatch.setattr(subject, "RAYS", 600.0)
    flora = compile_species([edited("grass", leaves=1.3)])
    fractions = list(subject.fitting(flora, 0, subject.RAYS))
    assert len(fractions) > 4 * len(flora.rows)
    assert fractions == sorted(fractions)
    assert 0.0 < fractions[0] < fractions[-1] <= 1.0
    steps = subject.measuring(flora, [0])
    assert next(steps)[0] == flora.species[0].name
    steps.close()
    assert subject.unmeasured(flora) == [0]
    run_to_end(subject.measuring(flora, [0]))
    assert subject.unmeasured(flora) == []
    assert list(subject.measuring(flora, [0])) == []
