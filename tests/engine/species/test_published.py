# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species against published figures: tables of Weber and Penn, measured leaf inclinations, leaf area densities.

``tests/data/published.json`` holds the figures with their sources, and for each species of the catalogue which of them
exist. What a table asks for is worked out here from the rules of the paper, not from the engine.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.engine import support
from tetflora_addon.growth.growth import leaf_counts
from tetflora_addon.species.leaf_models import LEAF_MODELS, LeafModel

PUBLISHED: dict[str, Any] = json.loads(
    (Path(__file__).resolve().parents[2] / "data" / "published.json").read_text(encoding="utf-8")
)
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
    """Means that a table asks for: number, length and base radius (metres) of branches by level, and all leaves."""

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
    number, metres, radius = 1.0, trunk, trunk * table["Ratio"]
    for level in range(1, int(table["Levels"])):
        length, ratio, full = children(table, level)
        each = table[f"{level}Branches"]
        counts.append(number * each)
        lengths.append(metres / number * length.mean())
        radii.append(radius / number * ratio.mean())
        number *= each * full.mean()
        metres *= each * (length * full).mean()
        radius *= each * (ratio * full).mean()
    return Expected(counts, lengths, radii, number * table["Leaves"])


def index_of(name: str) -> int:
    return support.SPECIES.index(name)


def leaf_model_of(name: str) -> LeafModel:
    """The built-in leaf that a species file names."""
    return LEAF_MODELS[support.shipped(name)["leaf"]["model"]]


def leaf_faces(name: str, seeds: list[int]) -> tuple[NDArray, NDArray]:
    """Area vectors (f, 3) of the faces of all leaves of some plants, and the vertices (v, 3), metres."""
    flora = support.described()
    _, pieces = support.grown(flora, support.plants(seeds, index_of(name)))
    leaves = support.meshes(flora, pieces)[1]
    return (
        np.concatenate([support.face_vectors(mesh) for mesh in leaves]),
        np.concatenate([mesh.positions.astype(float) for mesh in leaves]),
    )


def mean_inclination(sets: list[list[float]]) -> float:
    """Mean over all leaves that were measured, degrees."""
    means, numbers = np.array(sets, float).T
    return float(means @ numbers / numbers.sum())


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


def test_the_willow_has_the_leaf_area_of_its_table_on_fewer_leaves() -> None:
    """Both without what the envelope cuts off the hanging branches: in proportion to their length."""
    flora, full, ours = support.described(), TABLES["willow"]["table"], table_of("willow")
    model = leaf_model_of("willow")
    one = full["LeafScale"] ** 2 * full["LeafScaleX"] * model.area / model.width
    # The table's own number of hanging branches: those by splits are as long as what they split from.
    wanted = expected(full).leaves * one * ours["2Length"] / full["2Length"]
    trunk = support.trunks(flora.rows, support.plants([0], index_of("willow")))
    assert flora.leaf_areas(trunk)[0] == pytest.approx(wanted, rel=0.05)


def test_each_species_says_which_figures_there_are() -> None:
    assert sorted(FIGURES) == sorted(support.SPECIES), "add the species to tests/data/published.json"
    for name, one in FIGURES.items():
        assert one["inclination"] is None or one["inclination"] in PUBLISHED["leaf_inclination"]["species"]
        assert one["density"] is None or one["density"] in PUBLISHED["leaf_area_density"]["genera"]
        assert one["note"] or (one["inclination"] and one["density"]), f"{name}: say why there is no figure"
    assert set(TABLES) <= set(FIGURES)


@pytest.mark.parametrize("name", [n for n, one in FIGURES.items() if one["inclination"]])
def test_leaves_are_inclined_as_measured(name: str) -> None:
    """Mean angle from the horizontal, by area, within 5 degrees."""
    vectors, _ = leaf_faces(name, [0, 1, 2])
    area = np.linalg.norm(vectors, axis=1)
    inclination = np.degrees(np.arccos(np.clip(np.abs(vectors[:, 2]) / np.maximum(area, 1e-30), 0, 1)))
    measured = mean_inclination(PUBLISHED["leaf_inclination"]["species"][FIGURES[name]["inclination"]])
    assert np.average(inclination, weights=area) == pytest.approx(measured, abs=5)


@pytest.mark.parametrize("name", [n for n, one in FIGURES.items() if one["density"]])
def test_crowns_are_as_dense_as_measured(name: str) -> None:
    """Leaf area over the volume of an ellipsoid as wide and deep as the crown, as the figures were worked out."""
    density = []
    for seed in range(3):
        vectors, vertices = leaf_faces(name, [seed])
        extent = np.ptp(vertices, axis=0)
        volume = np.pi / 6 * extent[:2].mean() ** 2 * extent[2]
        density.append(np.linalg.norm(vectors, axis=1).sum() / volume)
    published = PUBLISHED["leaf_area_density"]
    low, _, high = published["genera"][FIGURES[name]["density"]]["p10_p50_p90"]
    assert low / published["widened"] <= np.mean(density) <= high * published["widened"]
