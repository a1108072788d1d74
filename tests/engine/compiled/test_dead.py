# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Dead branches: as many as described, bare, below what lives, which they do not change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.clumping import fingerprint
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.errors import SpeciesError
from tetflora_addon.growth.growth import WholeBranches
from tetflora_addon.growth.rows import DEAD_ORDER
from tetflora_addon.species.ages import with_habit
from tetflora_addon.species.catalog import species_from_dict
from tetflora_addon.species.members import expected_members, expected_polygons
from tetflora_addon.species.quality import with_quality
from tetflora_addon.subplants.pieces import expand, wood_areas

_DEAD = {"number": [6, 2], "from": 0.3, "into": 0.2, "on_limbs": [1.5, 1]}


def file(**changes: Any) -> dict[str, Any]:
    return support.small(order0={"branch_start": 0.4}, dead=_DEAD, **changes)


def grown(flora: Flora, number: int) -> list[WholeBranches]:
    return list(expand(flora, support.trunks(flora.rows, support.plants(np.arange(number)))))


@pytest.mark.parametrize("forks", [0.0, 2.0])
def test_they_are_as_many_and_as_large_as_expected(forks: float) -> None:
    """Numbers against the description, wood against the compiled species, over 300 plants."""
    data = file()
    data["orders"][0].update(forks=[forks, 0], fork_at=0.45)
    flora = support.compiled(data)
    trunk, pieces = support.grown(flora, support.plants(np.arange(300)))
    dead = flora.rows["dead"][pieces.branches.row]
    own = pieces.take(np.flatnonzero(dead))
    orders = flora.rows["order"][own.branches.row]
    found = [len(np.unique(own.branches.key[orders == DEAD_ORDER + k])) / 300 for k in range(2)]
    assert found == pytest.approx(expected_members(flora.species[0]).dead, rel=0.04)
    totals = flora.averages
    expected = (totals.fixed_wood + totals.full_wood)[0][flora.rows["dead"]].sum()
    measured = wood_areas(flora, own).sum() / (trunk.length * trunk.radius).sum()
    assert measured == pytest.approx(expected, rel=0.06)


def test_nothing_that_lives_changes() -> None:
    """A species with dead branches is the one without them, to the bit, and they bear no leaves."""
    live = {key: value for key, value in file().items() if key != "dead"}
    some, others = (support.compiled(data) for data in (file(), live))
    alive = [w.take(np.flatnonzero(~some.rows["dead"][w.branches.row])) for w in grown(some, 5)]
    keys = [np.concatenate([w.branches.key for w in whole]) for whole in (alive, grown(others, 5))]
    places = [np.concatenate([w.branches.position for w in whole]) for whole in (alive, grown(others, 5))]
    order = [np.argsort(key) for key in keys]
    np.testing.assert_array_equal(keys[0][order[0]], keys[1][order[1]])
    np.testing.assert_array_equal(places[0][order[0]], places[1][order[1]])
    assert some.area_nodes[0] == pytest.approx(others.area_nodes[0], rel=1e-12)
    assert (some.rows["leaves"][some.rows["dead"]] == 0).all()


def test_they_are_where_the_trunk_is_bare() -> None:
    flora = support.compiled(file())
    trunk, whole = support.trunks(flora.rows, support.plants(np.arange(30))), grown(flora, 30)
    own = [w.branches.take(np.flatnonzero(flora.rows["order"][w.branches.row] == DEAD_ORDER)) for w in whole]
    on_trunk = own[1]
    height = (on_trunk.position[:, 2] - trunk.position[on_trunk.plant, 2]) / trunk.length[on_trunk.plant]
    assert height.max() < 0.4 + 0.2 * 0.6 + 1e-9
    assert 0.1 < height.min() < 0.25
    # Little is left of the lowest.
    low = height < np.median(height)
    length = on_trunk.length / trunk.length[on_trunk.plant]
    assert length[low].mean() < 0.9 * length[~low].mean()


def test_without_them_tables_are_kept() -> None:
    """What was found out about a species before there were dead branches is found again."""
    flora = support.small_flora()
    rows = flora.rows[[name for name in flora.rows.dtype.names if name != "dead"]]
    assert fingerprint(flora.rows, flora.forms[0], 1) == fingerprint(rows, flora.forms[0], 1)
    other = support.compiled(file())
    assert fingerprint(flora.rows, flora.forms[0], 1) != fingerprint(other.rows, other.forms[0], 1)


def test_dense_stands_and_lower_qualities() -> None:
    """More of them on a longer bole; fewer with fewer polygons, of which there are as many as asked for."""
    species = species_from_dict(file(), "s", "s.json")
    assert with_habit(species, 1.0).dead.number.mean > 1.5 * species.dead.number.mean
    half = with_quality(species, 0.5)
    assert half.dead.number.mean == pytest.approx(0.5 * species.dead.number.mean)
    assert expected_polygons(half) == pytest.approx(0.5 * expected_polygons(species), rel=0.1)


@pytest.mark.parametrize(
    ("key", "value", "name"),
    [
        ("dead", {"numbers": 3}, "dead.numbers"),
        ("dead", {"number": [3, 5]}, "dead.number"),
        ("dead", {"into": 2}, "dead.into"),
        ("dead", {"orders": []}, "dead.orders"),
        ("dead", {"orders": [{"length": 0.1, "thickness": 0.1, "leaves": [3, 0]}]}, "dead.orders[0].leaves"),
        ("bud", {"size": 1}, "bud.size"),
        ("bud", {"length": 3}, "bud.length"),
        ("bud", {"color": [2, 0, 0]}, "bud.color"),
    ],
)
def test_mistakes_are_named(key: str, value: Any, name: str) -> None:
    with pytest.raises(SpeciesError) as error:
        species_from_dict({**support.small(), key: value}, "s", "s.json")
    assert name in str(error.value)
