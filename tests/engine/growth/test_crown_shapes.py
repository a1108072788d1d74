# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Crown shapes: limbs as long as their form says, none below the crown's base, and all else as without."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.engine.support import RICH, compiled, plants
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.growth.axes import axes
from tetflora_addon.growth.growth import children, leaf_counts, trunks
from tetflora_addon.growth.rows import DEAD_ORDER
from tetflora_addon.growth.seeds import Branches, crown_shapes
from tetflora_addon.growth.wind import Wind
from tetflora_addon.species.ages import with_age
from tetflora_addon.species.catalog import load_species

N = 64
#: One stem, full-grown and not; stems that fork, full-grown and not; everything at once.
KINDS = ("birch", "spruce 35", "beech", "oak 50", "rich")


@cache
def flora_of(kind: str) -> Flora:
    if kind == "rich":
        return compiled(RICH)
    name, _, years = kind.partition(" ")
    species = load_species(name)
    return compile_species([with_age(species, float(years)) if years else species])


def stems_and_limbs(flora: Flora, **form: float) -> tuple[Branches, Branches, Branches]:
    """Trunks with their stems, their limbs, and their dead branches, of N plants."""
    seeds = replace(plants(np.arange(N)), crown=crown_shapes(N, **form) if form else None)
    grown, stems = trunks(flora.rows, seeds), []
    stems.append(grown)
    others = []
    while len(grown):
        born, _ = children(flora.rows, grown, axes(flora.rows, grown))
        more = flora.rows["order"][born.row] == 0
        others.append(born.take(np.flatnonzero(~more)))
        grown = born.take(np.flatnonzero(more))
        stems.append(grown)
    other = Branches.concatenate(others)
    order = flora.rows["order"][other.row]
    return (
        Branches.concatenate([some for some in stems if len(some)]),
        other.take(np.flatnonzero(order == 1)),
        other.take(np.flatnonzero(order == DEAD_ORDER)),
    )


@pytest.mark.parametrize("kind", KINDS)
def test_plain_forms_change_nothing(kind: str) -> None:
    for plain, shaped in zip(stems_and_limbs(flora_of(kind)), stems_and_limbs(flora_of(kind), width=1.0), strict=True):
        for name, own in vars(plain).items():
            if own is not None:
                assert_array_equal(own, getattr(shaped, name), name)


@pytest.mark.parametrize("kind", KINDS)
def test_limbs_are_as_long_as_the_form_says(kind: str) -> None:
    flora = flora_of(kind)
    stems, limbs, _ = stems_and_limbs(flora)
    wide_stems, wide, _ = stems_and_limbs(flora, width=1.7, thickness=1.4)
    assert_allclose(wide.length, 1.7 * limbs.length, rtol=1e-6)
    assert_allclose(wide.vigor, 1.7 * limbs.vigor, rtol=1e-6)
    assert_allclose(wide_stems.radius, 1.4 * stems.radius)
    assert_array_equal(wide.position, limbs.position)  # forks lean no more where crowns are wider


@pytest.mark.parametrize("kind", KINDS)
def test_limbs_are_longer_to_the_light(kind: str) -> None:
    flora = flora_of(kind)
    _, limbs, _ = stems_and_limbs(flora)
    _, leaning, _ = stems_and_limbs(flora, east=0.3, north=-0.4)
    way = leaning.frame[:, :2, 2] / np.linalg.norm(leaning.frame[:, :2, 2], axis=1, keepdims=True)
    longer = leaning.length / np.maximum(limbs.length, 1e-12) - (limbs.length > 0)
    assert (np.abs(longer) < 0.5 + 1e-6).all()
    # Trunks bend and stems lean, which counts little.
    assert np.corrcoef(longer, way @ [0.3, -0.4])[0, 1] > 0.75


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("base", [0.35, 0.7])
def test_nothing_lives_below_the_base_of_a_crown(kind: str, base: float) -> None:
    flora = flora_of(kind)
    stems, limbs, dead = stems_and_limbs(flora)
    _, high, higher_dead = stems_and_limbs(flora, base=base)
    whole = stems.length[:N] / flora.rows["part"][0, 1]
    bare = base * whole  # along the trunk, which bends and may lean
    assert (high.position[:, 2] > 0.85 * bare[high.plant]).all()
    assert (high.position[:, 2] < 1.2 * bare[high.plant]).any()
    assert len(high) < len(limbs)
    if len(dead):
        assert len(higher_dead) >= len(dead)
        assert higher_dead.position[:, 2].max() > max(0.8 * bare.mean(), dead.position[:, 2].max() - 1.0)


@pytest.mark.parametrize("kind", ["birch", "beech"])
def test_as_many_limbs_are_left_as_the_bare_part_leaves_room_for(kind: str) -> None:
    flora = flora_of(kind)
    _, limbs, _ = stems_and_limbs(flora)
    _, high, _ = stems_and_limbs(flora, base=0.6)
    start = {"birch": 0.16, "beech": 0.12}[kind]
    assert_allclose(len(high) / len(limbs), 0.4 / (1 - start), rtol={"birch": 0.02, "beech": 0.3}[kind])


def test_forks_move_up_with_the_base_and_trunks_stay_as_long() -> None:
    flora = flora_of("beech")
    stems, _, _ = stems_and_limbs(flora)
    high, _, _ = stems_and_limbs(flora, base=0.7)
    first, low = flora.rows["part"][0, 1], ~flora.rows["continues"][stems.row]
    assert_allclose(high.length[low], stems.length[low] * 0.7 / first)
    assert_allclose(high.length[~low], stems.length[~low] * 0.3 / (1 - first))


def test_stems_of_shrubs_lean_as_the_form_says_and_stay_as_long() -> None:
    flora = flora_of("hazel")
    _, stems, _ = stems_and_limbs(flora)
    _, narrow, _ = stems_and_limbs(flora, width=0.5, base=0.4)
    assert_array_equal(narrow.length, stems.length)
    angle, steep = (np.arccos(some.frame[:, 2, 2]) for some in (stems, narrow))
    assert steep.mean() < 0.7 * angle.mean()


@pytest.mark.parametrize("kind", ["beech", "spruce 35"])
def test_what_is_left_of_the_leaves_is_half_in_twigs_and_half_in_leaves_on_each(kind: str) -> None:
    """A crown with few dense twigs would let the light through between them."""
    flora, counted = flora_of(kind), []
    for left in (1.0, 0.25):
        limbs = stems_and_limbs(flora, leaves=left)[1]
        limbs = limbs.take(np.flatnonzero(limbs.vigor > 0.3))
        twigs, _ = children(flora.rows, limbs, axes(flora.rows, limbs))
        twigs = twigs.take(np.flatnonzero(flora.rows["order"][twigs.row] == 2))
        leaves = leaf_counts(flora.rows, twigs).mean()
        counted.append((len(twigs), leaves, flora.leaf_areas(limbs).sum(), flora.leaf_areas(twigs).sum()))
    twigs, leaves, of_limbs, of_twigs = np.array(counted[1]) / counted[0]
    assert_allclose((twigs, leaves), 0.5, rtol=0.1)
    assert_allclose(of_limbs, 0.25, rtol=1e-6)
    assert_allclose(of_twigs, 0.25, rtol=0.1)


@pytest.mark.parametrize("kind", ["birch", "beech"])
def test_wind_changes_no_length(kind: str) -> None:
    form = {"width": 0.8, "east": 0.5, "base": 0.3}
    calm = flora_of(kind)
    windy = calm.in_wind(Wind(speed=18.0, time=3.0))
    for still, bent in zip(stems_and_limbs(calm, **form), stems_and_limbs(windy, **form), strict=True):
        assert_allclose(bent.length, still.length, rtol=1e-9)


def test_forms_end_at_their_limits() -> None:
    """A crown is a fifth to three times as wide as described, and no limb is more than four fifths shorter."""
    least, most = crown_shapes(2, *np.array([[-9.0, 9.0]] * 6))
    assert_array_equal(least, [0.2, 0.0, -0.8, -0.8, 0.2, 0.01])
    assert_array_equal(most, [3.0, 0.95, 0.8, 0.8, 5.0, 6.0])
