# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground under plants: how much light reaches it, where leaves fall, and what lies or grows there because of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.jobs import run_to_end
from tetflora_addon.planting.cover import (
    CLUSTERED,
    DIRECTIONS,
    FACING,
    FULL,
    Canopy,
    Floor,
    Habitat,
    Sheet,
    Stratum,
    covered,
    fallen_on,
    light_on,
    mapping,
    tinted,
)
from tetflora_addon.planting.places import place
from tetflora_addon.planting.plane import Path, Terrain
from tetflora_addon.planting.rules import Rules

SIDE = 40.0
SQUARE = SIDE * np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=float)
SHEET = Sheet.over(SQUARE.reshape(-1, 3))


def _middles(sheet: Sheet) -> np.ndarray:
    """Middles of all cells, (rows · columns, 2), row by row."""
    row, column = np.divmod(np.arange(sheet.rows * sheet.columns), sheet.columns)
    return sheet.low + (np.stack([column, row], axis=1) + 0.5) * sheet.cell


def _canopy(places, radius=3.0, base=3.0, top=11.0, area=90.0, species=0) -> Canopy:
    places = np.asarray(places, dtype=float).reshape(-1, 2)
    n = len(places)
    columns = [np.broadcast_to(np.asarray(v, dtype=float), n).copy() for v in (radius, base, top, area)]
    kinds = np.broadcast_to(np.asarray(species, np.int32), n).copy()
    return Canopy(np.column_stack([places, np.zeros(n)]), *columns, kinds)


def _wood(seed: int = 1, kinds: int = 2) -> Canopy:
    """Trees in the southern half."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, SIDE, (60, 2)) * (1.0, 0.5)
    return _canopy(places, area=rng.uniform(60.0, 140.0, 60), species=rng.integers(0, kinds, 60))


def _floor(canopy: Canopy, kinds: int = 2) -> Floor:
    return run_to_end(mapping(SHEET, canopy, kinds))


@pytest.mark.parametrize(
    ("radius", "base", "top", "area"), [(3.0, 3.0, 11.0, 90.0), (9.0, 1.0, 5.0, 400.0)], ids=["slender", "broad"]
)
def test_light_in_the_middle_under_one_crown_is_that_of_beer_and_lambert(radius, base, top, area):
    """Rays from aside cross most of a broad crown, and little of a slender one."""
    half, height = (top - base) / 2, (top + base) / 2
    light = run_to_end(light_on(SHEET, _canopy([SIDE / 2, SIDE / 2], radius, base, top, area)))
    thick = FACING * CLUSTERED * area / (4 / 3 * np.pi * radius**2 * half)
    expected = 0.0
    for degrees, number, weight in DIRECTIONS:
        for turn in 2 * np.pi * np.arange(number) / number:
            # Steps along the ray, instead of its two places on the ellipsoid.
            t = np.linspace(0.0, 60.0, 60_001)
            tilt = np.radians(degrees)
            x, y, z = (t * v for v in (np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)))
            inside = (x**2 + y**2) / radius**2 + (z - height) ** 2 / half**2 < 1
            expected += weight / number * np.exp(-thick * inside.sum() * (t[1] - t[0]))
    # The middle of the crown is a corner of four cells.
    middle = SHEET.at(light, np.array([[SIDE / 2, SIDE / 2]]))[0]
    assert middle == pytest.approx(expected, rel=0.03)
    assert light.max() == pytest.approx(1.0)


def test_more_leaves_leave_less_light_and_open_ground_has_all():
    sparse, dense = (run_to_end(light_on(SHEET, _canopy([20, 20], area=a))) for a in (30.0, 120.0))
    assert (dense <= sparse + 1e-12).all()
    assert dense.min() < sparse.min() < 1.0
    assert run_to_end(light_on(SHEET, _canopy([]))) == pytest.approx(1.0)


def test_all_leaves_fall_somewhere_and_most_near_the_trunk():
    canopy = _canopy([[15, 20], [25, 20]], area=[80.0, 120.0], species=[0, 1])
    fallen = run_to_end(fallen_on(SHEET, canopy, 2))
    assert fallen.sum(axis=1) * SHEET.cell**2 == pytest.approx([80.0, 120.0], rel=0.02)
    far = np.hypot(*(_middles(SHEET) - (15, 20)).T)
    assert fallen[0, far < 1.0].min() > fallen[0, (far > 3.0) & (far < 3.5)].max() > 0.0
    assert fallen[0, far > 6.0].max() == 0.0


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_order_of_plants_does_not_matter(seed):
    canopy = _wood(seed)
    order = np.random.default_rng(seed).permutation(len(canopy))
    one, other = _floor(canopy), _floor(canopy.take(order))
    assert (one.light == other.light).all()
    assert (one.fallen == other.fallen).all()


def test_a_sheet_reads_between_cells_and_has_not_too_many():
    sheet = Sheet.over(np.array([[0.0, 0.0], [3.0, 2.0]]), cell=1.0)
    assert (sheet.columns, sheet.rows) == (3, 2)
    values = _middles(sheet) @ (1.0, 10.0)
    points = np.array([[0.5, 0.5], [1.25, 1.0], [2.5, 1.5], [-9.0, 9.0]])
    assert sheet.at(values, points) == pytest.approx([5.5, 11.25, 17.5, 15.5])
    large = Sheet.over(np.array([[0.0, 0.0], [90_000.0, 40_000.0]]))
    assert large.columns * large.rows <= 601_000
    line = Sheet.over(np.array([[0.0, 0.0], [5_000_000.0, 0.0]]))
    assert line.columns * line.rows <= 601_000


def test_a_map_is_made_once_however_many_places_ask(monkeypatch):
    made, floor = [], _floor(_wood())
    monkeypatch.setattr(Floor, "map_of", lambda own, *kind: made.append(kind) or own.light)
    suits = floor.suits(Habitat.SHADE, None, 1)
    for _ in range(3):
        suits(_middles(SHEET))
    assert made == [(Habitat.SHADE, None)]


def _covered(floor: Floor, seed: int = 3, ground: Terrain | None = None) -> tuple:
    """Plants of five kinds, and which are which."""
    kinds = [
        (Habitat.LIGHT, None),
        (Habitat.HALF_SHADE, None),
        (Habitat.SHADE, None),
        (Habitat.LITTER, 0),
        (Habitat.LITTER, 1),
        (Habitat.DEAD_WOOD, None),
    ]
    suits = {n: floor.suits(*kind, seed + n) for n, kind in enumerate(kinds)}
    rules = Rules(by_density=True, density=24.0, weights=(4.0,) * 6, seed=seed)
    found = place(ground or Terrain(SQUARE), rules, suits=suits)
    return found, [found.position[found.species == n, :2] for n in range(6)]


def test_grass_is_denser_in_light_moss_in_shade_and_litter_under_its_own_species():
    floor = _floor(_wood())
    _, (grass, herbs, moss, first, second, wood) = _covered(floor)
    light = floor.light.mean()
    assert SHEET.at(floor.light, grass).mean() > light + 0.05
    assert SHEET.at(floor.light, moss).mean() < light - 0.05
    assert 0.1 < SHEET.at(floor.light, herbs).mean() < 0.9
    for n, places in enumerate((first, second)):
        assert SHEET.at(floor.fallen[n], places).mean() > 1.3 * floor.fallen[n].mean()
    # The northern half has no trees: from 8 m beyond the last one nothing falls.
    assert all((places[:, 1] < SIDE / 2 + 8.0).all() for places in (first, second, wood))
    assert (grass[:, 1] > SIDE / 2).mean() > 0.6
    assert len(grass) > 1000


def test_nothing_covers_what_masks_forbid():
    floor = _floor(_wood())
    path = Path(np.array([[0.0, 10.0], [SIDE, 10.0]]), 1.5)
    area = np.array([[5.0, 2.0], [35.0, 2.0], [35.0, 18.0], [5.0, 18.0]])
    weight = np.ones((2, 3))
    found, _ = _covered(floor, ground=Terrain(SQUARE, weight=weight, areas=(area,), paths=(path,)))
    x, y, _ = found.position.T
    assert len(found) > 500
    assert (np.abs(y - 10.0) >= 1.5).all()
    assert ((x >= 5.0) & (x <= 35.0) & (y >= 2.0) & (y <= 18.0)).all()


def test_the_same_seed_covers_the_same_ground_and_another_one_another():
    floor = _floor(_wood())
    (one, _), (again, _), (other, _) = _covered(floor), _covered(_floor(_wood())), _covered(floor, seed=4)
    assert (one.position == again.position).all()
    assert (one.seed == again.seed).all()
    assert len(other) != len(one) or (other.position != one.position).any()


def test_what_nobody_sheds_lies_nowhere():
    floor = _floor(_wood())
    assert (floor.map_of(Habitat.LITTER, -1) == 0.0).all()
    assert (floor.map_of(Habitat.LITTER, None) >= floor.map_of(Habitat.LITTER, 0)).all()


@pytest.mark.parametrize("species", [0, 1])
def test_leaves_lie_where_they_fall_in_the_same_amount(species):
    canopy = _wood()
    floor = _floor(canopy)
    suits = floor.map_of(Habitat.FALLEN, species)
    np.testing.assert_allclose(FULL * suits, floor.fallen[species], rtol=1e-12)
    # No patches: places suit as the map says.
    points = np.random.default_rng(2).uniform(0.0, SIDE, (500, 2))
    np.testing.assert_array_equal(floor.suits(Habitat.FALLEN, species, 5)(points), SHEET.at(suits, points))
    assert not floor.map_of(Habitat.FALLEN, -1).any()


def test_habitats_keep_the_patches_that_they_had():
    """Their numbers are part of the keys of patches: a new one goes to the end."""
    names = ["ANYWHERE", "LIGHT", "HALF_SHADE", "SHADE", "LITTER", "DEAD_WOOD", "FALLEN"]
    assert [habitat.name for habitat in Habitat] == names


def test_soil_takes_the_colors_of_what_hides_it():
    soil, brown, gray = np.array([0.04, 0.03, 0.02]), np.array([0.2, 0.1, 0.05]), np.array([0.1, 0.1, 0.1])
    suits = np.array([0.0, 1.0, 1.0])
    layers = [Stratum(suits, 5.0, 0.2, brown), Stratum(suits * [0, 0, 1], 5.0, 0.2, gray)]
    color = tinted(layers, soil, 3)
    hidden = covered(layers, 3)
    assert hidden == pytest.approx(1.0 - np.exp([0.0, -1.0, -2.0]))
    assert color[0] == pytest.approx(soil)
    assert color[1] == pytest.approx(hidden[1] * brown + (1 - hidden[1]) * soil)
    assert color[2] == pytest.approx(hidden[2] * (brown + gray) / 2 + (1 - hidden[2]) * soil)
    assert (tinted([], soil, 2) == soil).all()
