# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shipped leaves against measured ones, of their species or a relative: linear RGB fractions of light."""

import json
from pathlib import Path

import numpy as np
import pytest

from tetflora_addon.light.scattering import scattered_fractions
from tetflora_addon.species import catalog

ROOT = Path(__file__).resolve().parents[3]
MEASURED = json.loads((ROOT / "tests/data/leaf_optics.json").read_text())["leaves"]
PAIRS = [(leaf, one) for leaf in MEASURED for one in MEASURED[leaf]["shipped"] if one not in ("maple", "flower")]
#: Polygons of the conifer stand for bundles of needles, see docs/species.md.
SINGLE = [pair for pair in PAIRS if pair[1] != "conifer"]


def shipped(identifier):
    """Reflected and transmitted fractions (3,), (3,) of leaves half way between inside and outside of the crown."""
    species = catalog.load_species(identifier)
    order = [o for o in species.orders if o.leaf_kind == "leaf" and o.leaves.mean > 0][-1]
    color = (np.array(order.leaf_color.mean) + order.leaf_color_tip) / 2
    back, through, gloss = scattered_fractions(color[None], np.array([species.leaf_transmission]))
    return back[0] + gloss[0], through[0]


def measured(leaf):
    one = MEASURED[leaf]
    return np.mean([one["upper"], one["lower"] or one["upper"]], axis=0), np.array(one["through"])


def test_at_least_eight_leaves_have_a_source():
    assert len(MEASURED) >= 8
    assert all(one["source"] and len(one["upper"]) == len(one["through"]) == 3 for one in MEASURED.values())


@pytest.mark.parametrize(("leaf", "identifier"), PAIRS)
def test_reflectance_is_as_measured(leaf, identifier):
    np.testing.assert_allclose(shipped(identifier)[0], measured(leaf)[0], atol=0.045)


@pytest.mark.parametrize(("leaf", "identifier"), SINGLE)
def test_light_through_leaves_is_as_measured(leaf, identifier):
    np.testing.assert_allclose(shipped(identifier)[1], measured(leaf)[1], atol=0.035)


def test_less_blue_goes_through_than_is_reflected_and_undersides_are_paler():
    """What the material's tint and its sides stand for."""
    for one in MEASURED.values():
        assert one["through"][2] < 0.7 * one["upper"][2]
    pale = [one["lower"][1] / one["upper"][1] for one in MEASURED.values() if one["lower"]]
    assert np.mean(pale) > 1.3
