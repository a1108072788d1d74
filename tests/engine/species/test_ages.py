# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ages of species: from the seedling to the dead tree, as published, and as described at the full age."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devtools import sizes
from tests.engine import support
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.errors import SpeciesError
from tetflora_addon.growth.growth import children, trunks
from tetflora_addon.growth.rows import DEAD_ORDER
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.ages import STAGES, ages_of, stage, with_age
from tetflora_addon.species.catalog import load_species, species_from_dict
from tetflora_addon.species.members import expected_leaf_area, expected_members, expected_polygons
from tetflora_addon.species.skeletons import Skeleton
from tetflora_addon.species.species import Bud, grown

TREES = [name for name in support.SPECIES if not ages_of(load_species(name)).scaled]
#: Fractions of the full age, then ages in lifespans.
TIMES = [0.02, 0.12, 0.5, 1.3]


def at_age(name: str, years: float) -> Flora:
    return compile_species([with_age(load_species(name), years)])


def trunk_row(flora: Flora) -> int:
    return int(flora.first_row[0])


@pytest.mark.parametrize("name", support.SPECIES)
def test_at_the_full_age_it_is_the_species_itself(name: str) -> None:
    species = load_species(name)
    assert with_age(species, 0.0) is species
    assert with_age(species, ages_of(species).full) is species


@pytest.mark.parametrize("name", [name for name in support.SPECIES if load_species(name).spur is not None])
def test_just_before_the_full_age_short_shoots_are_as_many(name: str) -> None:
    species = load_species(name)
    before = expected_members(with_age(species, 0.999 * ages_of(species).full))
    assert before.spurs == pytest.approx(expected_members(species).spurs, rel=0.01)


@pytest.mark.parametrize("name", [name for name in TREES if expected_leaf_area(load_species(name)) > 0])
def test_around_the_full_age_leaves_are_as_many(name: str) -> None:
    """Low shrubs as well, whose crowns are full before they are as high as a sapling."""
    species = load_species(name)
    around = [expected_leaf_area(with_age(species, times * ages_of(species).full)) for times in (0.999, 1.001)]
    assert around == pytest.approx([expected_leaf_area(species)] * 2, rel=0.02)


@pytest.mark.parametrize("name", support.SPECIES)
def test_every_species_has_every_age(name: str) -> None:
    """Nothing is infinite or negative, and what does not die has leaves or wood."""
    species = load_species(name)
    end = ages_of(species).lifespan
    for years in (1.0, 20.0, 0.97 * end, 2.0 * end):
        flora = at_age(name, years)
        for key, value in vars(flora).items():
            if isinstance(value, np.ndarray) and value.dtype.kind == "f":
                assert np.isfinite(value).all(), (years, key)
        assert flora.polygons[0] > 0 and (flora.rows["count"] >= 0).all()
        assert flora.species[0].orders[0].length.mean > 0


@pytest.mark.parametrize("name", sorted(sizes.published()["species"]))
def test_heights_and_trunks_are_as_published(name: str) -> None:
    for size in sizes.compared(name):
        assert size.low <= size.measured <= size.high, size


@pytest.mark.parametrize("name", TREES)
def test_leaves_become_more_until_it_declines(name: str) -> None:
    """Then fewer; a dead tree has none, and loses its twigs and boughs from one decade to the next."""
    ages = ages_of(load_species(name))
    young = [part * ages.full for part in TIMES if part * ages.full < ages.decline * ages.lifespan]
    areas = [float(flora.area_nodes[trunk_row(flora), 0]) for flora in (at_age(name, years) for years in young)]
    assert (np.diff(areas) > -0.02 * np.array(areas[1:])).all()
    declining = ages.lifespan * np.array([ages.decline, 0.5 * (1 + ages.decline), 0.999])
    old = [at_age(name, years) for years in declining]
    assert (np.diff([flora.area_nodes[trunk_row(flora), 0] for flora in old]) < 0).all()
    faces = []
    for years in (0.1, 10.0, 60.0):
        flora = at_age(name, ages.lifespan + years)
        assert flora.leaf_count[trunk_row(flora)] == 0
        faces.append(flora.polygons[trunk_row(flora)])
    assert faces == sorted(faces, reverse=True)


@pytest.mark.parametrize("name", TREES)
def test_a_young_tree_is_no_small_old_one(name: str) -> None:
    """Its leaves are as large, its trunk is more slender or as slender, and its crown begins lower."""
    species, old = load_species(name), load_species(name).orders
    young = with_age(species, 0.25 * ages_of(species).full).orders
    stem = 1 if old[0].length.mean < 1.0 and len(old) > 1 and old[1].length.mean > 2.0 else 0
    assert young[-1].leaf_size.mean == pytest.approx(old[-1].leaf_size.mean)
    if stem == 0 and name != "palm":  # whose trunk does not grow thicker
        assert young[0].length.mean < 0.6 * old[0].length.mean
        assert young[0].thickness.mean < 1.2 * old[0].thickness.mean
        assert young[0].branch_start.mean <= old[0].branch_start.mean + 1e-9


@pytest.mark.parametrize("name", ["spruce", "larch"])
@pytest.mark.parametrize("part", [0.2, 0.4])
def test_young_conifers_are_cones(name: str, part: float) -> None:
    """Limbs in the middle are over half as long as at the foot, and the top is no more crowded than half-way to it."""
    flora = at_age(name, part * ages_of(load_species(name)).full)
    plants = trunks(flora.rows, Seeds.upright(12))
    limbs, owner = children(flora.rows, plants)
    high, long = limbs.position[:, 2] / plants.length[owner], limbs.length / plants.length[owner]
    foot, middle, top = ((low < high) & (high < low + 0.2) & ~flora.rows["dead"][limbs.row] for low in (0.0, 0.4, 0.8))
    foot_long, middle_long = (float((long[part] ** 2).sum() / long[part].sum()) for part in (foot, middle))
    assert middle_long > 0.55 * foot_long
    assert top.sum() < 1.1 * middle.sum()


@pytest.mark.parametrize("name", ["scots_pine", "rowan"])
def test_twigs_of_young_trees_are_leafy(name: str) -> None:
    """What leaves a small tree has are on fewer twigs, and not a few on each of many."""
    species = load_species(name)
    on_twigs = []
    for one in (with_age(species, 0.2 * ages_of(species).full), species):
        members = expected_members(one)
        long = float(np.prod([order.length.mean for order in one.orders]))
        on_twigs.append(members.leaves[-1] / members.branches[-1] / long)
    assert on_twigs[0] > 0.3 * on_twigs[1]


def test_stages_follow_one_another() -> None:
    for name in TREES:
        species = load_species(name)
        times = np.geomspace(0.5, 1.2 * ages_of(species).lifespan, 80)
        found = [STAGES.index(stage(species, float(years))) for years in times]
        assert found == sorted(found) and found[-1] == STAGES.index("dead"), name
        assert stage(species, 0.0) == "mature"


@given(
    full=st.floats(1, 200), rate=st.floats(0.001, 1), power=st.floats(0.3, 4), a=st.floats(0.1, 1), b=st.floats(1, 3)
)
def test_curves_rise_through_the_full_age(full: float, rate: float, power: float, a: float, b: float) -> None:
    assert grown(full, full, rate, power) == pytest.approx(1)
    assert 0 <= grown(a * full, full, rate, power) <= 1 + 1e-12 <= grown(b * full, full, rate, power) + 2e-12


@pytest.mark.parametrize("name", ["oak", "birch", "spruce", "hazel", "palm"])
def test_numbers_are_known_before_anything_is_compiled(name: str) -> None:
    """Polygons and leaves as expected from the description are those of the compiled species."""
    full = ages_of(load_species(name)).full
    for part in (0.1, 0.4, 0.9):
        species = with_age(load_species(name), part * full)
        flora = compile_species([species])
        leaves = expected_members(species)
        row = trunk_row(flora)
        expected = sum(leaves.leaves) + leaves.spur_leaves
        assert expected == pytest.approx(flora.leaf_count[row], rel=0.12)
        assert expected_polygons(species) == pytest.approx(flora.polygons[row], rel=0.15)


def test_bark_comes_off_dead_trees_once_their_wood_is_gray() -> None:
    one = load_species("spruce")
    fresh, old = (with_age(one, ages_of(one).lifespan + years) for years in (1.0, 6.0))
    assert (fresh.bark, old.bark) == (one.bark, "fibrous") and one.bark != "fibrous"
    assert old.orders[0].branch_color.mean != fresh.orders[0].branch_color.mean


def test_dead_branches_spread_as_it_declines() -> None:
    ages = ages_of(load_species("oak"))
    numbers = []
    for years in (0.7 * ages.lifespan, 0.95 * ages.lifespan):
        flora = at_age("oak", years)
        dead = flora.rows["order"] == DEAD_ORDER
        numbers.append(float((flora.averages.fixed_faces + flora.averages.full_faces)[0][dead].sum()))
    assert numbers[1] > 1.5 * numbers[0]


def test_what_has_no_wood_only_grows_in_size() -> None:
    species = load_species("fern")
    half = with_age(species, 0.3)
    ratio = half.orders[0].length.mean / species.orders[0].length.mean
    assert 0.1 < ratio < 1
    assert half.orders[1].leaf_size.mean == pytest.approx(ratio * species.orders[1].leaf_size.mean)
    assert half.orders[1].leaves == species.orders[1].leaves
    assert with_age(species, 40.0) is species
    budded = replace(species, bud=Bud())
    assert with_age(budded, 0.3).bud.length == pytest.approx(ratio * budded.bud.length)


def test_what_was_drawn_only_grows_in_size() -> None:
    drawn = Skeleton(
        np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 6.0], [1.0, 0.0, 8.0]]), np.ones(3) / 4, np.array([-1, 0, 1])
    )
    species = replace(load_species("birch"), skeleton=drawn)
    half = with_age(species, 10.0).skeleton
    ratio = half.radius[0] / drawn.radius[0]
    assert 0.1 < ratio < 1
    assert half.points == pytest.approx(ratio * drawn.points)


@pytest.mark.parametrize(
    ("age", "named"),
    [
        ({}, "age.full"),
        ({"full": 0}, "age.full"),
        ({"full": 40, "height": 3}, "age.height"),
        ({"full": 40, "diameter": [1, 2, 3]}, "age.diameter"),
        ({"full": 40, "lifespan": "long"}, "age.lifespan"),
        ({"full": 40, "years": 3}, "years"),
    ],
)
def test_mistakes_are_named(age: dict[str, Any], named: str) -> None:
    with pytest.raises(SpeciesError, match=named):
        species_from_dict(support.small(age=age), "grower", "grower.json")


def test_without_a_description_woody_plants_grow_as_those_of_their_size_do() -> None:
    species = species_from_dict(support.small(), "grower", "grower.json")
    ages = ages_of(species)
    assert species.ages is None and not ages.scaled
    assert 10 < ages.full < 30 and ages.lifespan > ages.full
