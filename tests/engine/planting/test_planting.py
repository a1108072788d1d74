# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants go where the rules allow, as often as they ask."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.errors import SceneError
from tetflora_addon.growth.hashing import key_of_seed
from tetflora_addon.planting import plane, site
from tetflora_addon.planting.places import Placement, new_seeds, place
from tetflora_addon.planting.plane import Path, Terrain, sampled
from tetflora_addon.planting.rules import Companion, Rules

SIZE = 20.0
SQUARE = np.array([[[0, 0, 0], [10, 0, 0], [10, 10, 0]], [[0, 0, 0], [10, 10, 0], [0, 10, 0]]], dtype=float)


def _hills(seed: int, n: int = 12) -> np.ndarray:
    """Triangles of a bumpy square; some are steep."""
    heights = np.random.default_rng(seed).uniform(0.0, 2.5, (n + 1, n + 1))
    x, y = np.meshgrid(np.linspace(0, SIZE, n + 1), np.linspace(0, SIZE, n + 1), indexing="ij")
    p = np.stack([x, y, heights], axis=-1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return np.concatenate([np.stack(t, axis=-2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


def _gaps(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None, :2] - others[None, :, :2], axis=-1)


def _least_gap(points: np.ndarray) -> float:
    gaps = _gaps(points, points)
    return gaps[np.triu_indices(len(points), 1)].min() if len(points) > 1 else np.inf


def _triangle_under(ground: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The triangle on which each point stands; fails if there is none."""
    a, b, c = np.moveaxis(ground[:, :, None, :], 1, 0)
    p = points[None]

    def area(u, v, w):
        return (v - u)[..., 0] * (w - u)[..., 1] - (v - u)[..., 1] * (w - u)[..., 0]

    weights = np.stack([area(p, b, c), area(a, p, c), area(a, b, p)]) / area(a, b, c)
    height = weights[0] * a[..., 2] + weights[1] * b[..., 2] + weights[2] * c[..., 2]
    on = (weights > -1e-9).all(axis=0) & (np.abs(height - p[..., 2]) < 1e-9)
    assert on.any(axis=0).all()
    return on.argmax(axis=0)


def _polygon(rng: np.random.Generator) -> np.ndarray:
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9))
    radius = rng.uniform(4.0, 9.0, 9)
    return SIZE / 2.0 + np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _inside(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Winding by summed angles: another way than the engine's."""
    rays = polygon[None] - points[:, None, :2]
    angle = np.arctan2(rays[..., 1], rays[..., 0])
    turn = (np.roll(angle, -1, axis=1) - angle + np.pi) % (2.0 * np.pi) - np.pi
    return np.abs(turn.sum(axis=1)) > np.pi


def _line_gap(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance from points to a line by dense sampling of it; a little too large at most."""
    dense = np.concatenate([a + (b - a) * np.linspace(0, 1, 400)[:, None] for a, b in pairwise(line)])
    return _gaps(points, dense).min(axis=1)


COMPANIONS = st.lists(
    st.builds(
        Companion, st.integers(0, 2), st.integers(0, 2), st.sampled_from([-1.0, -0.5, 0.5, 1.0]), st.floats(0.3, 3.0)
    ),
    max_size=3,
)
RULES = st.builds(
    Rules,
    count=st.integers(1, 150),
    by_density=st.booleans(),
    density=st.floats(0.05, 1.0),
    seed=st.integers(-(2**31), 2**31 - 1),
    min_distance=st.one_of(st.just(0.0), st.floats(0.0, 2.0)),
    slope_min=st.floats(0.0, 0.3),
    slope_max=st.floats(0.5, np.pi / 2),
    altitude_min=st.one_of(st.just(-np.inf), st.floats(-1.0, 1.0)),
    altitude_max=st.one_of(st.just(np.inf), st.floats(1.3, 4.0)),
    altitude_falloff=st.floats(0.0, 0.5),
    aspect=st.floats(-4.0, 8.0),
    aspect_spread=st.floats(1.0, np.pi),
    edge_falloff=st.one_of(st.just(0.0), st.floats(0.1, 8.0)),
    clumping=st.floats(0.0, 0.9),
    clump_size=st.floats(1.0, 30.0),
    scale_min=st.floats(0.2, 1.0),
    scale_max=st.floats(1.0, 2.0),
    scale_at_top=st.floats(0.3, 2.0),
    tilt=st.floats(0.0, 1.0),
    weights=st.just((2.0, 1.0, 1.0)),
    companions=COMPANIONS.map(tuple),
)


@settings(max_examples=30, deadline=None)
@given(rules=RULES, with_areas=st.booleans(), with_paths=st.booleans(), with_older=st.booleans())
def test_every_plant_satisfies_every_hard_rule(rules, with_areas, with_paths, with_older):
    rng = np.random.default_rng(rules.seed % 1000)
    triangles = _hills(rules.seed % 7)
    polygons = tuple(_polygon(rng) for _ in range(2)) if with_areas else ()
    line = rng.uniform(0.0, SIZE, (4, 2))
    weight = np.repeat((rng.random(len(triangles)) < 0.7).astype(float)[:, None], 3, axis=1)
    older = rng.uniform(0.0, SIZE, (12, 3)) if with_older else np.zeros((0, 3))
    older_species = rng.integers(-1, 3, len(older))
    ground = Terrain(triangles, weight, areas=polygons, paths=(Path(line, 0.8),) if with_paths else ())
    placed = place(ground, rules, older, older_species)
    enough = (0.5 if rules.by_density else 1.0) * placed.wanted
    assert bool(placed.reason) == (len(placed) < enough or not len(placed))
    assert rules.by_density or placed.wanted == rules.count
    assert len(placed) <= placed.wanted
    points, kinds = placed.position, placed.species
    # Slope, aspect and mask.
    under = _triangle_under(triangles, points)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[under]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    slope = np.arccos(np.clip(normal[:, 2], -1.0, 1.0))
    assert ((slope >= rules.slope_min - 1e-3) & (slope <= rules.slope_max + 1e-3)).all()
    away = np.angle(np.exp(1j * (np.arctan2(normal[:, 0], normal[:, 1]) - rules.aspect)))
    assert (np.abs(away) <= rules.aspect_spread + 1e-5).all()
    assert (weight[under, 0] > 0.0).all()
    assert ((points[:, 2] >= rules.altitude_min) & (points[:, 2] <= rules.altitude_max)).all()
    # Regions of the map.
    if polygons:
        assert (_inside(points, polygons[0]) | _inside(points, polygons[1])).all()
    if with_paths:
        assert (_line_gap(points, line) >= 0.8 - 1e-9).all()
    # Distances.
    if rules.min_distance > 1e-4:
        assert _least_gap(points) >= rules.min_distance
        assert (_gaps(points, older) >= rules.min_distance).all()
    for rule in rules.companions:
        everyone = np.concatenate([points, older])
        everyones = np.concatenate([kinds, older_species])
        gaps = _gaps(points, everyone)
        np.fill_diagonal(gaps, np.inf)
        if rule.strength == -1.0:
            assert (gaps[kinds == rule.species][:, everyones == rule.other] >= rule.distance).all()
            assert (gaps[kinds == rule.other][:, everyones == rule.species] >= rule.distance).all()
        elif rule.strength == 1.0 and (kinds == rule.species).any():
            near = gaps[kinds == rule.species][:, everyones == rule.other] < rule.distance
            assert near.any(axis=1).all()
    # What the plants are like.
    top = max(rules.scale_at_top, 1.0)
    assert (placed.scale >= rules.scale_min * min(rules.scale_at_top, 1.0) - 1e-12).all()
    assert (placed.scale <= rules.scale_max * top + 1e-12).all()
    assert np.allclose(np.linalg.norm(placed.up, axis=1), 1.0)
    assert np.allclose(placed.up, _tilted(normal, rules.tilt))
    assert (placed.seed >= 0).all()


def _tilted(normal, tilt):
    up = tilt * normal + (1.0 - tilt) * np.array([0.0, 0.0, 1.0])
    return up / np.linalg.norm(up, axis=1, keepdims=True)


def _same(first: Placement, second: Placement) -> bool:
    return all(np.array_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(Placement))


RICH = Rules(
    count=300,
    seed=5,
    min_distance=0.3,
    clumping=0.7,
    clump_size=6.0,
    edge_falloff=2.0,
    tilt=0.5,
    weights=(2.0, 1.0),
    companions=(Companion(1, 0, 1.0, 1.0),),
)


@pytest.mark.parametrize("rules", [RICH, replace(RICH, by_density=True, density=3.0), replace(RICH, companions=())])
def test_the_same_rules_are_the_same_plants_whatever_fits_into_memory(rules, monkeypatch):
    ground = Terrain(_hills(1))
    first = place(ground, rules)
    assert _same(first, place(ground, rules))
    for chunk in (64, 1000):
        monkeypatch.setattr(site, "CHUNK", chunk)
        assert _same(first, place(ground, rules))
    assert not _same(first, place(ground, replace(rules, seed=6)))


def test_arrangements_stay_what_they_were():
    """Pinned by the first version of Populate: seed 1 on a square."""
    placed = place(Terrain(SQUARE), Rules(count=50, seed=1, slope_max=1.0, scale_min=0.5, scale_max=2.0))
    assert placed.seed[:3].tolist() == [912118617, 1016292999, 1840525004]
    assert np.allclose(placed.position[0], [8.421445755925212, 2.7810532970046866, 0.0], atol=1e-9)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), density=st.floats(5.0, 40.0), gray=st.floats(0.1, 1.0))
def test_density_is_plants_for_each_suitable_square_meter(seed, density, gray):
    ground = Terrain(SQUARE, weight=np.full((2, 3), gray))
    placed = place(ground, Rules(by_density=True, density=density, seed=seed))
    expected = density * 100.0 * gray
    assert abs(len(placed) - expected) < 5.0 * np.sqrt(expected) + 1.0
    assert placed.wanted == len(placed)


def test_masks_thin_by_their_gray():
    weight = SQUARE[..., 0] / 10.0
    by_weight = place(Terrain(SQUARE, weight=weight), Rules(count=20_000)).position
    image = np.linspace(0.0, 1.0, 257, dtype=np.float32)[None]
    by_image = place(Terrain(SQUARE, uv=SQUARE[..., :2] / 10.0, image=image), Rules(count=20_000)).position
    for points in (by_weight, by_image):
        # The density grows with x: P(x < 5) = 1/4; five standard deviations.
        assert (points[:, 0] < 5.0).mean() == pytest.approx(0.25, abs=0.016)
        assert (points[:, 1] < 5.0).mean() == pytest.approx(0.5, abs=0.018)


def test_black_masks_hold_no_plant():
    image = np.zeros((8, 8), np.float32)
    image[:, :4] = 1.0
    placed = place(Terrain(SQUARE, uv=SQUARE[..., :2] / 10.0, image=image), Rules(count=2000)).position
    assert placed[:, 0].max() <= 10.0 * 4.5 / 8.0
    assert placed[:, 0].max() > 5.0  # linear from texel to texel


def test_images_repeat_and_their_borders_do_not_mix():
    image = np.array([[0.0, 1.0], [2.0, 3.0]], np.float32)
    places = np.array([[0.25, 0.25], [0.5, 0.25], [0.5, 0.5], [0.99, 0.25], [1.25, -0.75], [0.01, 0.99]])
    assert np.allclose(sampled(image, places), [0.0, 0.5, 1.5, 1.0, 0.0, 2.0])


def test_plants_become_rarer_toward_the_border_and_the_limits():
    placed = place(Terrain(SQUARE), Rules(count=20_000, edge_falloff=4.0)).position
    gap = np.minimum(placed[:, :2], 10.0 - placed[:, :2]).min(axis=1)
    # ∫ of gap / 4 over the frame 4 m wide is 40·4/2 − 8·16/3 = 37.33, inside lie 4 m².
    assert (gap > 4.0).mean() == pytest.approx(4.0 / (4.0 + 112.0 / 3.0), abs=0.02)
    ramp = SQUARE * [1.0, 1.0, 0.0]
    ramp[..., 2] = ramp[..., 0]
    rules = Rules(count=20_000, altitude_min=2.0, altitude_max=8.0, altitude_falloff=2.0)
    z = place(Terrain(ramp), rules).position[:, 2]
    assert ((z > 4.0) & (z < 6.0)).mean() == pytest.approx(0.5, abs=0.02)


def test_clumps_raise_the_variance_and_leave_bare_ground():
    far = Terrain(SQUARE * 20.0)
    cells = [
        np.histogram2d(*place(far, Rules(count=8000, clumping=c, clump_size=25.0)).position[:, :2].T, bins=40)[0]
        for c in (0.0, 0.5, 1.0)
    ]
    even, some, all_ = (c.var() / c.mean() for c in cells)
    assert even < 1.15 < some < 2.0 < all_  # without clumps the counts are Poisson's: the ratio is 1
    assert (cells[2] == 0).mean() > 0.25


def test_clumps_stand_as_far_apart_as_asked():
    n, size = 400, 10.0
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    points = np.stack([x, y], axis=-1).reshape(-1, 2).astype(float)
    value = plane.gradient_noise(points / (plane.CELL * size), key_of_seed(3)).reshape(n, n)
    assert np.abs(value).max() <= 1.0 and abs(value.mean()) < 0.05
    middle = value[1:-1, 1:-1]
    around = [value[1 + i : n - 1 + i, 1 + j : n - 1 + j] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    peaks = ((middle > np.max(around, axis=0)) & (middle > 0.0)).sum()
    assert np.sqrt(n * n / peaks) == pytest.approx(size, rel=0.1)


def test_plants_are_smaller_higher_up():
    triangles = _hills(2)
    placed = place(Terrain(triangles), Rules(count=500, scale_at_top=0.25))
    order = np.argsort(placed.position[:, 2])
    assert (np.diff(placed.scale[order]) <= 0.0).all()
    low, high = triangles[..., 2].min(), triangles[..., 2].max()
    expected = 1.0 - 0.75 * (placed.position[:, 2] - low) / (high - low)
    assert np.allclose(placed.scale, expected)


def test_rotation_turns_about_the_vertical_and_then_tilts():
    placed = place(Terrain(_hills(3)), Rules(count=50, tilt=0.8))
    w, x, y, z = placed.rotation.T
    assert np.allclose(np.linalg.norm(placed.rotation, axis=1), 1.0)
    up = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    assert np.allclose(up, placed.up)
    level = place(Terrain(SQUARE), Rules(count=50))
    assert np.allclose(level.rotation[:, [0, 3]].T, [np.cos(level.azimuth / 2), np.sin(level.azimuth / 2)])


def test_companions_in_part_thin_and_shares_hold():
    rules = Rules(count=3000, weights=(1.0, 1.0), companions=(Companion(1, 0, -0.5, 0.1),))
    placed = place(Terrain(SQUARE), rules)
    assert np.bincount(placed.species).tolist() == [1500, 1500]
    hosts, others = placed.position[placed.species == 0], placed.position[placed.species == 1]
    near = (_gaps(others, hosts) < 0.1).any(axis=1).mean()
    covered = 1.0 - np.exp(-15.0 * np.pi * 0.01)  # of the ground, by hosts strewn by chance
    assert near == pytest.approx(0.5 * covered / (1.0 - 0.5 * covered), abs=0.05)


def test_species_that_seek_each_other_find_each_other():
    circle = (Companion(0, 1, 1.0, 0.5), Companion(1, 0, 1.0, 0.5), Companion(2, 2, 1.0, 0.5))
    placed = place(Terrain(SQUARE), Rules(count=600, weights=(1.0, 1.0, 1.0), companions=circle))
    assert (np.bincount(placed.species, minlength=3) > 100).all()


def test_small_areas_on_large_ground_are_filled():
    square = np.array([[3000.0, 3000.0], [3002.0, 3000.0], [3002.0, 3002.0], [3000.0, 3002.0]])
    ground = Terrain(SQUARE * 1000.0, areas=(square,))
    placed = place(ground, Rules(count=500))
    assert len(placed) == 500
    counts, *_ = np.histogram2d(*placed.position[:, :2].T, bins=2, range=((3000, 3002), (3000, 3002)))
    assert ((counts - 125.0) ** 2 / 125.0).sum() < 25.0  # χ² with 3 degrees of freedom
    dense = place(ground, Rules(by_density=True, density=100.0))
    assert abs(len(dense) - 400) < 100


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (dict(weights=(0.0, -1.0)), "weight above 0"),
        (dict(slope_min=0.8, slope_max=0.2), "Min Slope .* is greater"),
        (dict(altitude_min=3.0, altitude_max=1.0), "Min Altitude .3 m. is greater"),
        (dict(altitude_min=30.0), "altitudes 30 and inf m; the ground extends from"),
        (dict(slope_max=0.0), r"flatter than Max Slope \(0°\)"),
        (dict(slope_min=1.55), "slope between 89° and 90°"),
        (dict(aspect_spread=0.0, aspect=0.123), "No slope faces within 0° of 7°"),
        (dict(count=0), "Count must be at least 1, not 0"),
        (dict(by_density=True, density=0.0), "Density must be greater than 0"),
        (dict(min_distance=float("nan")), "Min Distance must be 0 or greater, not nan"),
        (dict(by_density=True, density=1e9), "Lower the density"),
        (dict(clumping=1.0, clump_size=0.0), "Clump Size must be greater than 0, not 0 m"),
        (dict(companions=(Companion(0, 7, 1.0, 1.0),)), "refers to species 1 and 8, but the list has 1"),
        (dict(scale_min=0.0), "Scale must be greater than 0"),
    ],
)
def test_rules_that_cannot_be_are_refused_by_name(changes, says):
    with pytest.raises(SceneError, match=says):
        place(Terrain(_hills(0)), Rules(**changes))


def test_ground_that_cannot_be_is_refused_by_name():
    broken = SQUARE.copy()
    broken[0, 0, 2] = np.nan
    with pytest.raises(SceneError, match="1 of 2 triangles"):
        Terrain(broken)
    with pytest.raises(SceneError, match="no faces"):
        Terrain(SQUARE[:0])
    with pytest.raises(SceneError, match="vertex group has no weight"):
        place(Terrain(SQUARE, weight=np.zeros((2, 3))), Rules())
    with pytest.raises(SceneError, match="inside the Areas curves"):
        place(Terrain(SQUARE, areas=(SQUARE[0, :, :2] + 50.0,)), Rules())
    with pytest.raises(SceneError, match="image is black"):
        place(Terrain(SQUARE, uv=SQUARE[..., :2], image=np.zeros((4, 4), np.float32)), Rules())
    with pytest.raises(SceneError, match="Paths curves leave almost no ground"):
        place(Terrain(SQUARE, paths=(Path(np.array([[5.0, 5.0]]), 50.0),)), Rules())


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (dict(count=1000, min_distance=1.0), "at a Min Distance of 1 m"),
        (dict(by_density=True, density=20.0, min_distance=1.0), "closer than the Min Distance of 1 m"),
        (dict(by_density=True, density=1e-4), "less than one"),
        (dict(count=5000, weights=(1.0, 1.0), companions=(Companion(0, 0, -1.0, 1.0),)), "companion rules leave"),
        (dict(weights=(1.0, 0.0), companions=(Companion(0, 1, 1.0, 1.0),)), "companion rules leave"),
    ],
)
def test_fewer_plants_come_with_a_reason(changes, says):
    placed = place(Terrain(SQUARE), Rules(**changes))
    assert says in placed.reason
    assert len(placed) < max(placed.wanted, 1)


def test_nothing_is_wrong_where_distances_thin_what_a_density_draws():
    """All of its places are drawn before they are compared; nobody who asks for both wants as many plants."""
    rules = Rules(by_density=True, density=1.0, min_distance=0.5)
    placed = place(Terrain(SQUARE), rules)
    assert (0.5 * placed.wanted < len(placed) < placed.wanted, placed.reason) == (True, "")


@pytest.mark.parametrize("many", [dict(count=20), *(dict(by_density=True, density=plants / 100) for plants in (1, 20))])
def test_what_fills_the_ground_already_is_named(many):
    full = place(Terrain(SQUARE), Rules(count=1000, min_distance=0.5))
    placed = place(Terrain(SQUARE), Rules(min_distance=2.0, **many), older=full.position)
    assert len(placed) == 0
    assert "what stands there leaves no room" in placed.reason and "the other plants" in placed.reason


def test_other_seeds_are_positive_and_others_for_each_roll() -> None:
    seeds = np.arange(-50, 50)
    first, second = new_seeds(seeds), new_seeds(seeds, 1)
    np.testing.assert_array_equal(first, new_seeds(seeds, 0))
    assert (first >= 0).all() and (second >= 0).all()
    assert len(np.unique(np.concatenate([first, second]))) == 200
