# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species against published figures: tables of Weber and Penn, and forms as foresters and botanists measure them.

``tests/data/published.json`` holds the figures with their sources, and for each species of the catalog which of them
exist. What a table asks for is worked out here from the rules of the paper, not from the engine; what plants measure,
``devtools.forms`` works out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from devtools import forms, species_docs
from tests.engine import support
from tetflora_addon.growth.growth import leaf_counts
from tetflora_addon.leaves.models import LeafModel

PUBLISHED: dict[str, Any] = forms.published()
TABLES = PUBLISHED["weber_penn"]["species"]
FIGURES = PUBLISHED["species"]

#: Shape ratios that the four tables use, by their number in the paper; r is 1 at the lowest branch, 0 at the tip.
SHAPE_RATIO: dict[int, Callable[[NDArray], NDArray]] = {
    2: lambda r: 0.2 + 0.8 * np.sin(0.5 * np.pi * r),
    3: np.ones_like,
    4: lambda r: 0.5 + 0.5 * r,
    7: lambda r: np.where(r <= 0.7, 0.5 + 0.5 * r / 0.7, 0.5 + 0.5 * (1 - r) / 0.3),
}


@dataclass(frozen=True)
class Expected:
    """Means that a table asks for: number, length and base radius (meters) of branches by level, and all leaves."""

    counts: list[float]
    lengths: list[float]
    radii: list[float]
    leaves: float


def table_of(name: str) -> dict[str, float]:
    """A published table, with what the species has instead of some of its rows."""
    one = TABLES[name]
    return {**one["table"], **{key: value for key, (value, _) in one["instead"].items()}}


def children(table: dict[str, float], level: int) -> tuple[NDArray, NDArray, NDArray]:
    """Length and radius in those of the parent, and the factor on the own numbers, of evenly spread branches."""
    fraction = (np.arange(4096) + 0.5) / 4096
    if level == 1:
        offset = table["BaseSize"] + (1 - table["BaseSize"]) * fraction
        ratio = SHAPE_RATIO[int(table["Shape"])](1 - fraction)
        length, full = table["1Length"] * ratio, 0.2 + 0.8 * ratio
    else:
        offset = fraction
        length, full = table[f"{level}Length"] * (1 - 0.6 * fraction), 1 - 0.5 * fraction
    there = 1 - min(table[f"{level - 1}Taper"], 1.0) * offset
    return length, np.minimum(length ** table["RatioPower"], there), full


def expected(table: dict[str, float]) -> Expected:
    """What the rules of Weber and Penn make of a table, without splits."""
    trunk = table["Scale"] * table["0Length"]
    counts, lengths, radii = [1.0], [trunk], [trunk * table["Ratio"]]
    # Sums over the branches of a level, each weighted with the factor on its own number of children.
    number, meters, radius = 1.0, trunk, trunk * table["Ratio"]
    for level in range(1, int(table["Levels"])):
        length, ratio, full = children(table, level)
        each = table[f"{level}Branches"]
        counts.append(number * each)
        lengths.append(meters / number * length.mean())
        radii.append(radius / number * ratio.mean())
        number *= each * full.mean()
        meters *= each * (length * full).mean()
        radius *= each * (ratio * full).mean()
    return Expected(counts, lengths, radii, number * table["Leaves"])


def index_of(name: str) -> int:
    return support.SPECIES.index(name)


def leaf_model_of(name: str) -> LeafModel:
    """The only leaf of a species."""
    (model,) = support.described().forms[index_of(name)][0]
    return model


@pytest.mark.parametrize("name", TABLES)
def test_a_species_is_written_as_its_table_is(name: str) -> None:
    table, trunk = table_of(name), support.shipped(name)["orders"][0]
    assert trunk["length"] == [table["Scale"] * table["0Length"], table["ScaleV"] * table["0Length"]]
    assert trunk["thickness"][0] == table["Ratio"]
    assert trunk["branch_start"] == table["BaseSize"]
    for level, order in enumerate(support.shipped(name)["orders"][1:], 1):
        assert order["length"][0] == table[f"{level}Length"]


@pytest.mark.parametrize("name", TABLES)
def test_counts_that_are_compiled_are_those_of_the_table(name: str) -> None:
    flora, wanted = support.described(), expected(table_of(name))
    row = support.trunks(flora.rows, support.plants([0], index_of(name))).row[0]
    assert flora.leaf_count[row] == pytest.approx(wanted.leaves, rel=0.005)
    orders = flora.species[index_of(name)].orders
    assert len(orders) == len(wanted.counts)
    tubes = sum(n * o.sides * o.segments for n, o in zip(wanted.counts, orders, strict=True))
    polygons = tubes + wanted.leaves * leaf_model_of(name).polygons
    assert flora.polygons[row] == pytest.approx(polygons, rel=0.005)
    assert polygons <= 500_000


@pytest.mark.parametrize("name", TABLES)
def test_plants_have_the_counts_and_proportions_of_the_table(name: str) -> None:
    """Numbers by order, and lengths and radii in those of the trunk, of five plants."""
    flora, wanted, number = support.described(), expected(table_of(name)), 5
    trunk, pieces = support.grown(flora, support.plants(np.arange(number), index_of(name)))
    branches = pieces.take(pieces.t0 == 0).branches
    order = flora.rows["order"][branches.row]
    counts = np.bincount(order) / number
    np.testing.assert_allclose(counts, wanted.counts, rtol=0.02)
    assert leaf_counts(flora.rows, branches).sum() / number == pytest.approx(wanted.leaves, rel=0.02)
    for grown, own, means in (
        (branches.length, trunk.length, wanted.lengths),
        (branches.radius, trunk.radius, wanted.radii),
    ):
        fractions = np.bincount(order, grown / own[branches.plant]) / np.bincount(order)
        np.testing.assert_allclose(fractions, np.array(means) / means[0], rtol=0.03)


#: Leaves on each twig of the willow with which it would have the leaf area of its table.
WILLOW_LEAVES = 38


def test_the_willow_has_the_leaf_area_of_its_table_on_fewer_twigs() -> None:
    """Both without what the envelope cuts off the hanging branches: in proportion to their length.

    What it has is less in the measure in which its twigs have fewer leaves, which is that of measured trees.
    """
    flora, full, ours = support.described(), TABLES["willow"]["table"], table_of("willow")
    model = leaf_model_of("willow")
    one = full["LeafScale"] ** 2 * full["LeafScaleX"] * model.area / model.width
    # The table's own number of hanging branches: those by splits are as long as what they split from.
    wanted = expected(full).leaves * one * ours["2Length"] / full["2Length"] * ours["Leaves"] / WILLOW_LEAVES
    trunk = support.trunks(flora.rows, support.plants([0], index_of("willow")))
    assert flora.leaf_areas(trunk)[0] == pytest.approx(wanted, rel=0.05)


def test_each_species_says_which_figures_there_are() -> None:
    assert sorted(FIGURES) == sorted(support.SPECIES), "add the species to tests/data/published.json"
    for name, one in FIGURES.items():
        assert one["inclination"] is None or one["inclination"] in PUBLISHED["leaf_inclination"]["species"]
        assert one["density"] is None or one["density"] in PUBLISHED["leaf_area_density"]["genera"]
        assert one["note"] or (one["inclination"] and one["density"]), f"{name}: say why there is no figure"
    assert set(TABLES) <= set(FIGURES)


@pytest.mark.parametrize("name", forms.species())
def test_plants_are_as_published(name: str) -> None:
    """Height, trunk, crown, leaves: `devtools.forms.SEEDS` plants in the ranges that were published."""
    out = [f"{one.figure} {one.value:.4g}, not {one.low:.4g} to {one.high:.4g}" for one in forms.compared(name)]
    assert [text for text, one in zip(out, forms.compared(name), strict=True) if not one.within] == []


def test_figures_name_what_is_measured_and_where_it_is_published() -> None:
    kept = PUBLISHED["forms"]
    of_species = [kept["species"], kept["stands"]["species"]]
    assert set().union(*of_species) <= set(support.SPECIES)
    for name in forms.species():
        for figure, low, high, source in [*forms.ranges(name), *forms.ranges(name, 1.0)]:
            assert figure in forms.FIGURES
            assert low < high, (name, figure)
            assert len(source) > 40
    used = {row[2] for some in of_species for one in some.values() for row in one.values()}
    used |= {kept["open_grown"]["source"]}
    assert used == set(kept["sources"])


def test_a_figure_out_of_its_range_is_seen() -> None:
    """The maple with leaves of twice the size: too long, and more of them than its crown can have."""
    species = support.shipped("maple")
    for order in species["orders"][2:]:
        order["leaf_size"] = [2 * value for value in order["leaf_size"]]
    flora, limits = support.compiled(species), {row[0]: row[1:3] for row in forms.ranges("maple")}
    values = forms.measures(flora, 0)
    assert values["leaf_length"] > limits["leaf_length"][1]
    assert values["leaf_area_index"] > limits["leaf_area_index"][1]
    assert values["height"] < limits["height"][1]


def test_the_table_of_the_documentation_is_current() -> None:
    text = species_docs.PAGE.read_text(encoding="utf-8")
    assert species_docs.with_forms(text) == text
