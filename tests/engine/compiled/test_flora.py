# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of plants before they are grown, against plants that are: averages over many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.arrays import chunks
from tetflora_addon.compiled.orientation import leaf_moments, wood_moments
from tetflora_addon.compiled.samples import Points
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.refinement.contents import subplant_totals
from tetflora_addon.subplants.pieces import open_subplants, wood_areas


def samples_of_plants(species: int, count: int) -> dict[str, np.ndarray]:
    """By plant: leaves, leaf area, wood area over that of its compiled mean, polygons."""
    flora = support.lean()
    trunk = support.trunks(flora.rows, support.plants(np.arange(count) + 1000, species))
    out: dict[str, list] = {"leaf_count": [], "leaf_area": [], "polygons": [], "wood": [], "wood_expected": []}
    for run in chunks(flora.polygons[trunk.row], 400_000):
        branches = trunk.take(run)
        pieces = support.expanded(flora, branches)
        number = len(branches)
        plant = pieces.branches.plant - branches.plant[0]
        wood = np.bincount(plant, wood_areas(flora, pieces), number)
        faces = np.bincount(plant, flora.rows["sides"][pieces.branches.row], number)
        tips = pieces.take(pieces.t1 == 1)
        owner, _, size = support.leaves_of(flora, tips.branches)
        of_plant, row = tips.branches.plant[owner] - branches.plant[0], tips.branches.row[owner]
        out["leaf_count"].append(np.bincount(of_plant, minlength=number))
        out["leaf_area"].append(np.bincount(of_plant, size**2 * flora.leaf.area[row], number))
        out["polygons"].append(faces + np.bincount(of_plant, flora.leaf.polygons[row], number))
        out["wood"].append(wood)
        out["wood_expected"].append(subplant_totals(flora, branches).wood_area)
    return {name: np.concatenate(values).astype(float) for name, values in out.items()}


@pytest.mark.parametrize("species", range(len(support.SPECIES)), ids=support.SPECIES)
def test_averages_are_those_of_grown_plants(species: int) -> None:
    """Within four standard errors; the wood as a ratio, for it depends on the trunk's size."""
    flora = support.lean()
    found = samples_of_plants(species, min(60, int(2e5 / flora.polygons[flora.first_row[species]])))
    row = flora.first_row[species]
    for name in ("leaf_count", "leaf_area", "polygons"):
        expected, values = flora.area_nodes[row, 0] if name == "leaf_area" else getattr(flora, name)[row], found[name]
        error = values.std() / np.sqrt(len(values))
        assert abs(values.mean() - expected) < 4 * error + 1e-9, name
    ratio = found["wood"] / found["wood_expected"]
    assert abs(ratio.mean() - 1) < 4 * ratio.std() / np.sqrt(len(ratio)) + 0.005


@pytest.mark.parametrize(("follow", "whorl"), [(0.6, 1), (1.0, 3)])
def test_averages_hold_where_counts_follow_the_length(follow: float, whorl: int) -> None:
    change = {"count_by_length": follow, "whorl": whorl}
    data = support.small(order0={"crown": "conical"}, order1={**change, "crown": "flame"}, order2=change)
    flora = support.compiled(data)
    assert flora.leaf_count[0] < 0.8 * support.small_flora().leaf_count[0]
    trunk, pieces = support.grown(flora, support.plants(np.arange(1500)))
    tubes, leaves = support.meshes(flora, pieces)
    assert sum(m.polygons for m in leaves) == pytest.approx(1500 * flora.leaf_count[0], rel=0.02)
    assert sum(m.polygons for m in (*tubes, *leaves)) == pytest.approx(1500 * flora.polygons[0], rel=0.02)
    totals = subplant_totals(flora, trunk)
    assert wood_areas(flora, pieces).sum() == pytest.approx(totals.wood_area.sum(), rel=0.02)
    children, *_ = open_subplants(flora, trunk)
    assert subplant_totals(flora, children).leaf_area.sum() == pytest.approx(totals.leaf_area.sum(), rel=0.02)


def test_a_species_without_variation_is_known_exactly() -> None:
    """Counts to the last leaf; areas but for where branches sit on their parents."""
    data = support.small()
    for order in data["orders"]:
        for key in ("length", "thickness", "branches", "leaves", "leaf_size"):
            if key in order:
                order[key] = [order[key][0], 0]
    flora = support.compiled(data)
    trunk, pieces = support.grown(flora, support.plants(np.arange(40)))
    tubes, leaves = support.meshes(flora, pieces)
    polygons = sum(m.polygons for m in (*tubes, *leaves))
    assert polygons == pytest.approx(40 * flora.polygons[0])
    assert sum(m.polygons for m in leaves) == pytest.approx(40 * flora.leaf_count[0])
    expected = 40 * flora.area_nodes[0, 0]
    assert sum(support.face_areas(m).sum() for m in leaves) == pytest.approx(expected, rel=1e-5)
    assert wood_areas(flora, pieces).sum() == pytest.approx(subplant_totals(flora, trunk).wood_area.sum(), rel=0.01)


def test_colors_are_means_weighted_by_area() -> None:
    """Large pale leaves on order 1, small dark ones on order 2: the faces' colors, weighted, are the compiled one."""
    data = support.small(
        order1={"leaves": [4, 0], "leaf_size": [0.3, 0], "leaf_color": [[0.8, 0.7, 0.2], [0.1, 0.1, 0.1]]},
        order2={"leaf_color": [[0.1, 0.2, 0.1], [0.05, 0.05, 0.05]], "branch_color": [[0.5, 0.4, 0.3], [0, 0, 0]]},
    )
    flora = support.compiled(data)
    trunk, pieces = support.grown(flora, support.plants(np.arange(80)))
    tubes, leaves = support.meshes(flora, pieces)
    for meshes, expected in ((leaves, flora.leaf_colors(trunk)[0]), (tubes, flora.wood_color[0])):
        areas = np.concatenate([support.face_areas(m) for m in meshes])
        colors = np.concatenate([m.attributes["tf_color"][1] for m in meshes])
        np.testing.assert_allclose(areas @ colors / areas.sum(), expected, rtol=0.03)


@pytest.mark.parametrize("name", support.DENSE)
def test_orientation_of_whole_plants(name: str) -> None:
    flora = support.alone(name, support.FEW_POLYGONS)
    # A hundred thousand polygons or two settle the mean: of what has as many branches as that, six plants.
    number = int(np.clip(1.5e5 / flora.polygons[0], 6, 12))
    trunk, pieces = support.grown(flora, support.plants(np.arange(number)))
    tubes, leaves = support.meshes(flora, pieces)
    expected = leaf_moments(flora.orientation, trunk).mean(axis=0)
    assert np.trace(expected) == pytest.approx(1)
    np.testing.assert_allclose(support.moment(*leaves), expected, atol=0.02)
    np.testing.assert_allclose(support.moment(tubes[0]), wood_moments(flora.orientation, trunk).mean(axis=0), atol=0.03)


@pytest.mark.parametrize("name", support.DENSE)
def test_orientation_of_subplants_at_any_tilt(name: str) -> None:
    """Boughs of many plants, sorted by how steeply they stand, each group against what their axes foretell."""
    flora = support.alone(name, support.FEW_POLYGONS)
    trunk = support.trunks(flora.rows, support.plants(np.arange(8)))
    boughs, *_ = open_subplants(flora, trunk)
    steepness = np.argsort(boughs.frame[:, 2, 2])
    for group in np.array_split(steepness, 3):
        some = boughs.take(group[:40])
        _, leaves = support.meshes(flora, support.expanded(flora, some))
        weight = subplant_totals(flora, some).leaf_area
        expected = np.einsum("n,nij->ij", weight, leaf_moments(flora.orientation, some))
        np.testing.assert_allclose(support.moment(*leaves), expected / weight.sum(), atol=0.05)


@pytest.mark.parametrize("name", ["fern", "palm", "ash", "willow"])
def test_orientation_of_standing_plants_to_a_hundredth(name: str) -> None:
    """Level sprays, hanging leaves, leaves turned to the sky: boughs as they stand, all together.

    None bears fruit, of which less shows than its faces have.
    """
    flora = support.alone(name)
    number = int(np.clip(5e5 / flora.polygons[0], 4, 60))
    boughs, *_ = open_subplants(flora, support.trunks(flora.rows, support.plants(np.arange(number))))
    _, leaves = support.meshes(flora, support.expanded(flora, boughs))
    weight = subplant_totals(flora, boughs).leaf_area
    expected = np.einsum("n,nij->ij", weight, leaf_moments(flora.orientation, boughs)) / weight.sum()
    # How far they face up; which way to the side is the chance of a few plants.
    assert support.moment(*leaves)[2, 2] == pytest.approx(expected[2, 2], abs=0.01)


@pytest.mark.parametrize("name", ["beech", "birch", "bush", "fern", "palm", "willow"])
def test_orientation_of_branches_turned_any_way(name: str) -> None:
    """Leafy branches turned as no plant of the species has them, sorted by how steeply they stand then."""
    flora = support.alone(name)
    some = support.trunks(flora.rows, support.plants(np.arange(100 if name in ("fern", "palm") else 4)))
    while flora.leaf_count[some.row].mean() > 200:
        some, *_ = open_subplants(flora, some)
    random = np.random.default_rng(5)
    some = some.take(random.permutation(np.flatnonzero(flora.leaf_areas(some) > 0))[:900])
    turn, _ = np.linalg.qr(random.normal(size=(len(some), 3, 3)))
    turn *= np.sign(np.linalg.det(turn))[:, None, None]
    some = replace(some, frame=turn)
    for group in np.array_split(np.argsort(turn[:, 2, 2]), 3):
        part = some.take(group)
        _, leaves = support.meshes(flora, support.expanded(flora, part))
        weight = subplant_totals(flora, part).leaf_area
        expected = np.einsum("n,nij->ij", weight, leaf_moments(flora.orientation, part)) / weight.sum()
        np.testing.assert_allclose(support.moment(*leaves), expected, atol=0.02)


def sample_positions(points: Points, subplants: Branches) -> np.ndarray:
    """Positions of the samples that stand for the first of sub-plants."""
    first, number = points.runs(subplants)
    return points.position[first[0] : first[0] + number[0]]


@pytest.mark.parametrize("name", support.DENSE)
def test_sample_points_lie_where_leaves_and_wood_are(name: str) -> None:
    """Mean and spread of height and distance from the trunk, in units of its length."""
    flora = support.alone(name, support.FEW_POLYGONS)
    trunk, pieces = support.grown(flora, support.plants(np.arange(int(5e5 / flora.polygons[0]))))
    tips = pieces.take(pieces.t1 == 1)
    owner, position, size = support.leaves_of(flora, tips.branches)
    middle = (pieces.start + pieces.end) / 2
    for points, plant, weight, samples in (
        (position, tips.branches.plant[owner], size**2, sample_positions(flora.samples.leaves, trunk)),
        (middle, pieces.branches.plant, wood_areas(flora, pieces), sample_positions(flora.samples.wood, trunk)),
    ):
        local = np.einsum("ni,nij->nj", points, trunk.frame[plant]) / trunk.length[plant, None]
        for measure in (lambda p: p[:, 2], lambda p: np.hypot(p[:, 0], p[:, 1])):
            grown, sampled = measure(local), measure(samples.astype(float))
            mean = np.average(grown, weights=weight)
            spread = np.sqrt(np.average((grown - mean) ** 2, weights=weight))
            tolerance = 0.06 * max(1.0, mean)  # of a thousand points

            assert sampled.mean() == pytest.approx(mean, abs=tolerance)
            assert sampled.std() == pytest.approx(spread, abs=tolerance)


def test_compiling_does_not_depend_on_neighbors() -> None:
    """A species compiled alone and among others: the same numbers, with rows moved."""
    alone, among = support.small_flora(), support.compiled(support.shipped("bush"), support.SMALL)
    first = among.first_row[1]
    for name in ("bound", "leaf_count", "area_nodes", "full_wood", "polygons", "wood_color"):
        assert (getattr(alone, name) == getattr(among, name)[first:]).all(), name
    assert (alone.averages.leaf_color == among.averages.leaf_color[first:]).all()
    for name in ("leaves", "own_leaves", "wood"):
        assert (getattr(alone.orientation, name) == getattr(among.orientation, name)[first:]).all(), name
    for mine, theirs in ((alone.samples.leaves, among.samples.leaves), (alone.samples.wood, among.samples.wood)):
        for name in ("position", "frame", "outward", "light"):
            ours = getattr(mine, name)
            assert (ours == getattr(theirs, name)[-len(ours) :]).all(), name
        assert (theirs.row[-len(mine.row) :] == mine.row + first).all()
