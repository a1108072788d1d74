# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What falls from a species is a species: a page that can be read and grown, lying on the ground."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.crowns import crown_of
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.catalogue import builtin_folder, load_species
from tetflora_addon.species.litter import FALLEN
from tetflora_addon.species.members import expected_polygons
from tetflora_addon.species.schema import species_from_dict

TREES = ("beech", "oak", "birch", "spruce", "scots_pine", "willow")


def _page(name: str, kind: str) -> dict | None:
    page = json.loads((builtin_folder() / f"{name}.json").read_text("utf-8"))
    made = FALLEN[kind](load_species(name), page)
    return None if made is None else json.loads(json.dumps(made))


def _species(name: str, kind: str):
    return species_from_dict(_page(name, kind), f"{name}_{kind}", f"{name}_{kind}")


def _points(name: str, kind: str, seed: int) -> np.ndarray:
    flora = compile_species([_species(name, kind)])
    one = Seeds((name,), np.zeros(1, np.int32), np.array([seed]), np.zeros((1, 3)), np.eye(3)[None], np.ones(1))
    return np.concatenate([block.buffers.positions for block in expanded_blocks(flora, one)])


@pytest.mark.parametrize("name", support.SPECIES)
@pytest.mark.parametrize("kind", FALLEN)
def test_pages_are_sound_species_of_few_polygons(name, kind):
    page = _page(name, kind)
    if page is not None:
        species = species_from_dict(page, f"{name}_{kind}", "page")
        assert 20 < expected_polygons(species) < 3000
        assert len(json.dumps(page)) < 120_000
        assert crown_of(species).seen > 0.0


@pytest.mark.parametrize("name", TREES)
@pytest.mark.parametrize("kind", FALLEN)
def test_trees_shed_all_kinds_and_what_they_shed_lies_on_the_ground(name, kind):
    for seed in range(3):
        x, y, z = _points(name, kind, seed).T
        wide = max(np.ptp(x), np.ptp(y))
        assert wide > 0.2
        # Half of a log is in the ground; twigs of a branch and leaves on edge stand up a little.
        assert np.quantile(z, 0.9) < 0.45 * wide
        assert np.abs(np.median(z)) < 0.2


def test_litter_has_the_leaf_and_bark_of_its_species_and_is_brown():
    living, fallen = load_species("beech"), _species("beech", "litter")
    # The blade of the living leaf, dried in several ways.
    outline = {"fold": 0.0, "curl": 0.0, "wave": 0.0}
    assert {replace(form.shape, **outline) for form in fallen.leaf} == {replace(living.leaf[0].shape, **outline)}
    assert len({form.shape for form in fallen.leaf}) == len(fallen.leaf) >= 2
    assert fallen.bark == living.bark
    red, green, blue = fallen.orders[1].leaf_colour.mean
    assert red > 1.5 * green > 1.5 * blue
    assert fallen.orders[1].leaf_size.mean == pytest.approx(
        0.95 * max(o.leaf_size.mean for o in living.orders if o.leaves.mean), rel=0.01
    )


def test_cones_lie_among_needles_only():
    with_cones = {name for name in (*TREES, "larch", "holm_oak") if "blossom" in _page(name, "litter")}
    assert with_cones == {"larch", "scots_pine", "spruce"}


def test_dead_wood_has_no_leaves():
    for name in TREES:
        for kind in ("branch", "log"):
            bearing = [o for o in _species(name, kind).orders if o.leaves.high]
            # The cut end of a log is a disc.
            assert [o.leaf_kind for o in bearing] == (["blossom"] if kind == "log" else [])
            assert _species(name, kind).bark == load_species(name).bark


def test_what_has_no_leaves_or_is_low_sheds_none():
    assert _page("dead_tree", "litter") is None
    assert _page("dead_tree", "branch") is not None
    assert _page("grass", "branch") is None
    assert _page("bush", "log") is None


def test_a_leaf_that_is_an_object_stays_one():
    page = json.loads((builtin_folder() / "beech.json").read_text("utf-8")) | {"leaf": {"object": "My leaf"}}
    made = FALLEN["litter"](replace(load_species("beech"), leaf=("My leaf",)), page)
    assert made["leaf"] == [{"object": "My leaf"}]
    species_from_dict(made, "beech_litter", "page")
