# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What falls from a species is a species: a page that can be read and grown, lying on the ground."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.sizes import crown_of
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seasons import Season
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.catalog import builtin_folder, load_species, species_from_dict
from tetflora_addon.species.litter import FALLEN, leaves_page, shed_share
from tetflora_addon.species.members import expected_polygons
from tetflora_addon.subplants.pieces import expand

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
        assert name not in TREES or crown_of(species).seen > 0.0  # of what is sound all can be compiled


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
    red, green, blue = fallen.orders[1].leaf_color.mean
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


@pytest.mark.parametrize("name", TREES)
def test_logs_are_a_little_bent_and_thinner_at_their_ends(name):
    flora, bent = compile_species([_species(name, "log")]), []
    for seed in range(8):
        one = Seeds((name,), np.zeros(1, np.int32), np.array([seed]), np.zeros((1, 3)), np.eye(3)[None], np.ones(1))
        _, log, *_ = expand(flora, trunks(flora.rows, one))
        knots = log.lines.knots[0, : log.lines.segments[0] + 1]
        along = knots[-1] - knots[0]
        away = np.linalg.norm(np.cross(knots - knots[0], along), axis=1) / np.linalg.norm(along)
        bent.append(away.max() / np.linalg.norm(along))
    assert 0.01 < np.mean(bent) < 0.05 and max(bent) < 0.1
    assert 0.5 < _species(name, "log").orders[1].taper.mean < 0.7


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


def _leaves(name: str):
    page = leaves_page(load_species(name), json.loads((builtin_folder() / f"{name}.json").read_text("utf-8")))
    return None if page is None else species_from_dict(json.loads(json.dumps(page)), f"{name}_leaves", "page")


def _on_day(species, day: float) -> tuple[float, np.ndarray]:
    """Mean area of the leaves of plants on a day, m², and their mean color."""
    flora, many = compile_species([species]).in_year(Season(day)), 300
    frames = np.repeat(np.eye(3)[None], many, axis=0)
    seeds = Seeds(("one",), np.zeros(many, np.int32), np.arange(many), np.zeros((many, 3)), frames, np.ones(many))
    plants = trunks(flora.rows, seeds)
    areas = flora.leaf_areas(plants)
    return float(areas.mean()), np.average(flora.leaf_colors(plants), axis=0, weights=areas + 1e-12)


@pytest.mark.parametrize("name", support.SPECIES)
def test_leaves_fall_from_what_is_bare_in_winter(name):
    living, fallen = load_species(name), _leaves(name)
    assert (fallen is None) == (shed_share(living) == 0.0)
    if fallen is not None:
        assert 20 < expected_polygons(fallen) < 3000
        assert living.year.leaf.turnover >= 0.9


@pytest.mark.parametrize("name", ["oak", "birch", "maple", "larch", "beech"])
@pytest.mark.parametrize("day", [270, 290, 300, 310, 330, 360])
def test_what_is_no_longer_on_the_trees_is_on_the_ground(name, day):
    living, fallen = load_species(name), _leaves(name)
    summer = _on_day(living, 196)[0]
    patches = summer * shed_share(living) / crown_of(fallen).leaves
    assert _on_day(living, day)[0] + patches * _on_day(fallen, day)[0] == pytest.approx(summer, rel=0.03)


def test_what_has_rotted_is_brown_of_one_hue():
    """Lighter and darker, but none redder or bluer than the others."""
    browns = np.array(_leaves("beech").year.leaf.autumn)
    assert (np.diff(browns, axis=1) < 0).all()
    np.testing.assert_allclose(browns / browns[:, :1], np.tile(browns[0] / browns[0, 0], (len(browns), 1)), rtol=0.03)
    assert 0.05 < browns.mean() < 0.15


@pytest.mark.parametrize("name", ["oak", "birch", "maple", "larch", "beech"])
def test_fallen_leaves_have_the_colors_of_autumn_and_turn_brown_and_are_gone_before_summer(name):
    living, fallen = load_species(name), _leaves(name)
    colors = np.array(living.year.leaf.autumn)
    first, late = (_on_day(fallen, day)[1] for day in (living.year.leaf.fall - 5, living.year.leaf.fall + 90))
    assert (first > 0.5 * colors.min(axis=0)).all() and (first < colors.max(axis=0)).all()
    litter = np.array(_species(name, "litter").orders[1].leaf_color.mean)
    if name != "larch":  # whose needles are darker than leaves
        np.testing.assert_allclose(late, litter, atol=0.02)
    for day in (152, 196, 250):
        assert _on_day(fallen, day)[0] == 0.0
