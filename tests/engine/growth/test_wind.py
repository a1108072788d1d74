# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants in the wind: they bend and stay what they are, within their bounds, and all repeats where it shall."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.compiled.test_bounds import LEANS, SHAPES, any_species, outside
from tests.engine.growth.test_drawn import flora as drawn_flora
from tetflora_addon.arrays import spread
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.errors import TetFloraError
from tetflora_addon.growth.axes import axes
from tetflora_addon.growth.foliage import leaf_keys, leaf_places, place_leaves, settled
from tetflora_addon.growth.growth import WholeBranches, leaf_counts
from tetflora_addon.growth.rows import ROW_DTYPE
from tetflora_addon.growth.wind import Wind, gusts, leaned, sway, widest_sway
from tetflora_addon.proxies.facet_weights import facet_weights
from tetflora_addon.proxies.microsurfaces import FacetRules, Facets, piece_facets, subplant_facets
from tetflora_addon.proxies.primitives import joined, shape_buffers, spheres_of
from tetflora_addon.subplants.pieces import expand, open_subplants

_FLOAT32 = 1e-6
WINDS = st.builds(
    Wind,
    speed=st.floats(0.5, 60),
    direction=st.floats(-7, 7),
    gusts=st.floats(0, 1),
    time=st.floats(0, 1000),
    loop=st.sampled_from([0.0, 0.5, 4.0]),
)
ALL = [support.RICH, support.small(), support.shipped("birch")]


def vertices(flora: Flora, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """All vertices of the wood and of the leaves of a plant."""
    tubes, leaves = support.meshes(flora, support.grown(flora, support.plants(seed))[1])
    return tuple(np.concatenate([m.positions for m in some]).astype(np.float64) for some in (tubes, leaves))


def whole_branches_of(flora: Flora, seed: int = 1) -> list[WholeBranches]:
    return list(expand(flora, support.trunks(flora.rows, support.plants(seed))))


def test_without_wind_nothing_is_added() -> None:
    flora = support.small_flora()
    assert flora.in_wind(Wind(0.0)) is flora
    assert flora.in_wind(Wind(5.0)).in_wind(Wind(0.0)) is flora
    assert flora.rows.dtype == ROW_DTYPE


@given(SHAPES, SHAPES, st.lists(LEANS, min_size=2, max_size=2), st.integers(0, 10**6), WINDS)
@settings(deadline=None, max_examples=8)
def test_every_vertex_is_inside_its_bound_in_any_wind(
    first: dict, second: dict, leans: list[dict], seed: int, wind: Wind
) -> None:
    flora = any_species(first, second, leans).in_wind(wind)
    trunk = support.trunks(flora.rows, support.plants(seed, scale=1.7, position=(1, 2, 3)))
    limbs, *_ = open_subplants(flora, trunk)
    for some in (trunk, limbs.take(np.s_[:: max(1, len(limbs) // 3)])):
        assert outside(flora, some) < _FLOAT32


@pytest.mark.parametrize("species", ("grass", "birch", "bamboo", "palm", "scots_pine"))
def test_shipped_species_keep_within_their_bounds_in_a_storm(species: str) -> None:
    number = support.SPECIES.index(species)
    for time in (0.0, 3.7):
        flora = support.lean().in_wind(Wind(30.0, 1.0, 1.0, time))
        trunk = support.trunks(flora.rows, support.plants([1, 2], number))
        assert outside(flora, trunk) < _FLOAT32


@given(WINDS, st.integers(0, 100))
@settings(deadline=None, max_examples=10)
def test_a_plant_drawn_by_hand_holds_together_within_its_bound(wind: Wind, seed: int) -> None:
    flora = drawn_flora().in_wind(wind)
    trunk = support.trunks(flora.rows, support.plants(seed, scale=1.3, position=(5, -3, 1)))
    assert outside(flora, trunk) < _FLOAT32
    still, moved = (
        support.expanded(one, support.trunks(one.rows, support.plants(seed))) for one in (flora.at_rest, flora)
    )
    # What touched before touches still: ends of pieces that were at one place are.
    ends, bent = (np.concatenate([p.start, p.end]) for p in (still, moved))
    _, first, group = np.unique(ends.round(6), axis=0, return_index=True, return_inverse=True)
    assert np.abs(bent - bent[first[group.reshape(-1)]]).max() < 1e-6
    assert len(first) < len(ends)


@pytest.mark.parametrize("data", ALL, ids=("rich", "small", "birch"))
def test_branches_keep_their_lengths_and_leaves_their_areas(data: dict) -> None:
    flora = support.compiled(data)
    windy = flora.in_wind(Wind(15.0, 0.3, 0.5, 12.0))
    for still, moved in zip(whole_branches_of(flora), whole_branches_of(windy), strict=True):
        one, other = (np.linalg.norm(np.diff(s.lines.knots, axis=1), axis=2) for s in (still, moved))
        np.testing.assert_allclose(one, other, atol=1e-12)
    areas = [
        np.sort(np.concatenate([support.face_areas(m) for m in support.meshes(one, support.grown(one, seeds)[1])[1]]))
        for one in (flora, windy)
        for seeds in [support.plants(1)]
    ]
    np.testing.assert_allclose(areas[1], areas[0], rtol=2e-3, atol=1e-7)


@pytest.mark.parametrize("data", ALL, ids=("rich", "small", "birch"))
def test_what_grows_on_a_branch_stays_on_it(data: dict) -> None:
    """Where children begin lies on the axis of some branch of the level before."""
    flora = support.compiled(data).in_wind(Wind(20.0, 2.0, 1.0, 5.0))
    levels = whole_branches_of(flora)
    for parents, grown in pairwise(levels):
        some = grown.branches.position[:: max(1, len(grown) // 40)]
        start, step = parents.lines.knots[:, :-1].reshape(-1, 3), np.diff(parents.lines.knots, axis=1).reshape(-1, 3)
        for place in some:
            share = np.clip(((place - start) * step).sum(1) / np.maximum((step**2).sum(1), 1e-300), 0, 1)
            assert np.linalg.norm(start + share[:, None] * step - place, axis=1).min() < 1e-9


@given(st.sampled_from([0.5, 2.0, 4.0, 10.0]), st.integers(0, 640), st.floats(0.5, 30), st.integers(0, 1000))
@settings(deadline=None, max_examples=20)
def test_a_loop_repeats_to_the_bit(loop: float, step: int, speed: float, seed: int) -> None:
    flora, time = support.small_flora(), step / 64
    first, second = (vertices(flora.in_wind(Wind(speed, 1.0, 0.5, t, loop)), seed) for t in (time, time + 3 * loop))
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


def test_within_a_loop_nothing_stands_still() -> None:
    flora = support.small_flora()
    first, second = (vertices(flora.in_wind(Wind(8.0, 0.0, 0.5, t, 4.0))) for t in (0.0, 1.3))
    for one, other in zip(first, second, strict=True):
        assert np.abs(one - other).max() > 0.01


@given(st.floats(0, 100), st.floats(1, 25), st.sampled_from([0.0, 3.0]))
@settings(deadline=None, max_examples=20)
def test_movement_is_continuous(time: float, speed: float, loop: float) -> None:
    """In a thousandth of a second nothing moves by more than a tip at ten meters a second would."""
    flora = support.small_flora()
    first, second = (vertices(flora.in_wind(Wind(speed, 0.5, 1.0, t, loop))) for t in (time, time + 1e-3))
    for one, other in zip(first, second, strict=True):
        assert 0 < np.abs(one - other).max() < 0.01


@pytest.mark.parametrize("species", support.SPECIES)
def test_nothing_jumps(species: str) -> None:
    """Leaves that turn to the light and boughs that lie level turn with their branch, not over in an instant."""
    number = support.SPECIES.index(species)
    flora = support.lean().in_wind(Wind(8.0, 0.3, 0.5, 4.3, 0.0, moving=True))
    tubes, leaves = support.meshes(flora, support.grown(flora, support.plants(3, number))[1])
    for mesh in (*tubes, *leaves):
        assert np.linalg.norm(mesh.attributes["velocity"][1], axis=1).max() < 10.0


@pytest.mark.parametrize(
    "data", [*ALL, {**support.shipped("beech"), "quality": 0.05}], ids=("rich", "small", "birch", "beech")
)
def test_wind_turns_and_changes_nothing_else(data: dict) -> None:
    """Branches and leaves stand to where up has gone with them as they stand to the sky at rest."""
    flora = support.compiled(data)
    windy = flora.in_wind(Wind(20.0, 2.0, 1.0, 5.0))
    for still, moved in zip(whole_branches_of(flora), whole_branches_of(windy), strict=True):
        stands = np.einsum("nij,ni->nj", moved.branches.frame, moved.branches.sky)
        np.testing.assert_allclose(stands, still.branches.frame[:, 2], atol=1e-9)
        along = np.einsum("nsij,nsi->nsj", moved.lines.frames, moved.lines.skies)
        np.testing.assert_allclose(along, still.lines.frames[:, :, 2], atol=1e-9)
        np.testing.assert_array_equal(moved.branches.length, still.branches.length)
        counts = leaf_counts(flora.rows, still.branches)
        owner, index = spread(counts)
        key = leaf_keys(still.branches, owner, index)
        placed = []
        for one, some in ((flora, still), (windy, moved)):
            t = leaf_places(one.rows, some.branches, owner, index, counts, key)
            leaves = place_leaves(one.rows, some.branches, some.lines, owner, index, key, t)
            frame = settled(one.rows, some.branches.row[owner], leaves.frame, leaves.light, leaves.sky)
            placed.append(np.einsum("nij,ni->nj", frame, np.broadcast_to(leaves.sky, leaves.position.shape)))
        error = np.abs(placed[1] - placed[0]).max(axis=1, initial=0.0)
        assert np.count_nonzero(error > 1e-3) <= 0.001 * len(error)  # half-way leaves, to single precision


def test_it_leans_to_leeward_and_sways_about_that() -> None:
    """Over a loop tips are to leeward on the mean, and neither to the left nor to the right."""
    flora, seeds = support.small_flora(), support.plants(np.arange(40))
    still = axes(flora.rows, support.trunks(flora.rows, seeds)).knots[:, -1]
    moved = []
    for time in np.arange(0, 8, 0.125):
        one = flora.in_wind(Wind(10.0, np.pi / 2, 0.5, time, 8.0))
        moved.append(axes(one.rows, support.trunks(one.rows, seeds)).knots[:, -1] - still)
    across, along, up = np.mean(moved, axis=(0, 1))
    assert along > 0.02
    assert abs(across) < 0.1 * along
    assert -along < up < 0
    assert np.std(moved, axis=0)[:, :2].min() > 0.003


def test_a_trunk_bends_and_does_not_tilt() -> None:
    """Its foot hardly turns, and each segment more than that below."""
    flora = support.compiled(support.small(order0={"segments": 8, "curvature": [0, 0], "angle": [0, 0]}))
    one = flora.in_wind(Wind(15.0, 0.0, 0.0))
    lines = axes(one.rows, support.trunks(one.rows, support.plants(1)))
    turn = np.arccos(lines.frames[0, :, 2, 2].clip(-1, 1))
    assert (np.diff(turn) > 0).all()
    assert turn[0] < turn[-1] / 7
    np.testing.assert_allclose(lines.knots[0, 0], 0, atol=1e-12)


def test_each_plant_and_branch_moves_by_itself() -> None:
    """Plants of other seeds at one place, and limbs of one plant, are not in step."""
    flora = support.small_flora().in_wind(Wind(6.0, 0.0, 0.3, 7.0))
    trunks = support.trunks(flora.rows, support.plants(np.arange(200)))
    upright = replace(trunks, frame=np.tile(np.eye(3), (200, 1, 1)), length=np.full(200, 3.0))
    turn = sway(flora.rows, upright)
    assert np.std(turn[:, 0]) > 0.2 * np.mean(turn[:, 1])
    assert len(np.unique(turn.round(9), axis=0)) == 200


def test_gusts_travel_with_the_wind() -> None:
    """What blows here now blows a second's way farther a second later, and in no place leaves its range."""
    flora, rng = support.small_flora(), np.random.default_rng(1)
    places = rng.uniform(-200, 200, (500, 3))
    direction = 0.7
    way = 9.0 * np.array([np.cos(direction), np.sin(direction), 0])
    now, later = (flora.in_wind(Wind(9.0, direction, 0.6, t)).rows for t in (3.0, 4.0))
    strength = gusts(now, places)
    np.testing.assert_allclose(gusts(later, places + way), strength, atol=1e-9)
    assert strength.min() > 0.4 - 1e-12
    assert strength.max() < 1.6 + 1e-12
    assert np.std(strength) > 0.15


@given(WINDS, st.integers(0, 10**6))
@settings(deadline=None, max_examples=10)
def test_no_branch_turns_by_more_than_is_said(wind: Wind, seed: int) -> None:
    flora = support.lean().in_wind(wind)
    trunks = support.trunks(flora.rows, support.plants(seed + np.arange(100), np.arange(100) % len(support.SPECIES)))
    turn = np.linalg.norm(sway(flora.rows, trunks), axis=1)
    assert (turn <= widest_sway(flora.rows)[trunks.row] * (1 + 1e-12)).all()


def test_one_compile_serves_all_times_and_proxies_keep_their_mean() -> None:
    flora = support.small_flora()
    first, second = (flora.in_wind(Wind(7.0, 0.0, 0.5, time)) for time in (1.0, 2.0))
    for name in ("bound", "widest", "leaf_reach", "area_nodes"):
        assert getattr(first, name) is getattr(second, name)
    assert first.samples is flora.samples
    assert first.orientation is second.orientation is flora.orientation
    assert facet_weights(first) is facet_weights(flora)
    assert first.rows["air"]["time"][0] != second.rows["air"]["time"][0]


def meshes_at(flora: Flora, time: float, moving: bool = False) -> list[MeshBuffers]:
    """Wood and leaves of a plant that stands off the origin."""
    one = flora.in_wind(Wind(9.0, 0.4, 0.5, time, 0.0, moving))
    _, pieces = support.grown(one, support.plants(3, position=(12, -5, 1)))
    return [m for some in support.meshes(one, pieces) for m in some]


@pytest.mark.parametrize("kind", ["rich", "birch", "drawn"])
def test_velocities_are_those_of_the_vertices(kind: str) -> None:
    """The way from a little before to a little after, of wood and leaves; the ways themselves are none else."""
    flora = {
        "rich": lambda: support.compiled(support.RICH),
        "birch": lambda: support.compiled(support.shipped("birch")),
        "drawn": drawn_flora,
    }[kind]()
    step = 4e-3
    moving, before, after = (
        meshes_at(flora, time, asked) for time, asked in ((5.0, True), (5.0 - step, False), (5.0 + step, False))
    )
    for now, still, low, high in zip(moving, meshes_at(flora, 5.0), before, after, strict=True):
        np.testing.assert_array_equal(now.positions, still.positions)
        assert "velocity" not in still.attributes
        domain, velocity = now.attributes["velocity"]
        assert domain == "POINT"
        way = (high.positions - low.positions) / (2 * step)
        assert np.abs(velocity).max() > 0.1
        error = np.linalg.norm(velocity - way, axis=1)
        assert error.mean() < 0.02 * np.linalg.norm(way, axis=1).mean()
        assert np.quantile(error, 0.999) < 0.05 * np.abs(way).max()


@pytest.mark.parametrize("kind", ["small", "birch"])
def test_facets_move_with_what_bears_them(kind: str) -> None:
    """Facets of sub-plants go with their bases, those of pieces with the branch; so do the spheres in their place."""
    flora, step = support.compiled(support.SMALL if kind == "small" else support.shipped("birch")), 2e-3

    def facets(time: float, moving: bool = False) -> list[Facets]:
        one = flora.in_wind(Wind(9.0, 0.4, 0.5, time, 0.0, moving))
        limbs, _, pieces, _ = open_subplants(one, support.trunks(one.rows, support.plants(3, position=(12, -5, 1))))
        twigs, _, more, _ = open_subplants(one, limbs)
        side = [np.full(len(some), 0.05) for some in (limbs, twigs, pieces, more)]
        make = (subplant_facets, subplant_facets, piece_facets, piece_facets)
        rules = map(FacetRules, side)
        return [f(one, some, how) for f, some, how in zip(make, (limbs, twigs, pieces, more), rules, strict=True)]

    for now, low, high in zip(facets(5.0, True), facets(5.0 - step), facets(5.0 + step), strict=True):
        assert low.velocity is None
        way = (high.center - low.center) / (2 * step)
        error = np.linalg.norm(now.velocity - way, axis=1)
        # Leaves turn to the light as well while their branches turn, by little; many are facets of wood.
        for some in (now.transmission > 0.0, now.transmission == 0.0):
            assert not some.any() or np.median(error[some]) < 0.03 * np.linalg.norm(way, axis=1).max()
        assert np.linalg.norm(now.velocity, axis=1).max() > 0.01
        mesh = support.facet_mesh(now)
        np.testing.assert_array_equal(mesh.attributes["velocity"][1][::3], now.velocity.astype(np.float32))
        points = shape_buffers(spheres_of(now, None))
        np.testing.assert_array_equal(points.attributes["velocity"], now.velocity.astype(np.float32))
        both = joined([low, now])
        np.testing.assert_array_equal(both.velocity, np.concatenate([0 * now.velocity[: len(low)], now.velocity]))


@pytest.mark.parametrize("height", [0.0, 2.0, 9.0])
def test_an_upright_line_leans_to_an_arc_of_its_length(height: float) -> None:
    line = np.linspace(0, height, 400)[:, None] * [0.0, 0.0, 1.0]
    arc = leaned(line[None], np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.1, 0.0]]))[0]
    assert np.linalg.norm(np.diff(arc, axis=0), axis=1).sum() == pytest.approx(height, rel=1e-5)
    assert arc[-1, 0] == pytest.approx((1 - np.cos(0.1 * height)) / 0.1)  # to +x, about +y


@pytest.mark.parametrize(
    "wrong", [{"speed": -1.0}, {"speed": np.nan}, {"gusts": 1.5}, {"gusts": -0.1}, {"loop": -1.0}, {"time": np.inf}]
)
def test_what_is_no_wind_is_refused(wrong: dict) -> None:
    with pytest.raises(TetFloraError, match="Wind"):
        Wind(**{"speed": 1.0, **wrong})


def test_a_gust_is_where_it_is_in_the_world_wherever_coordinates_begin() -> None:
    """Also of plants drawn by hand, whose phases are those of their places."""
    near, origin = Wind(9.0, 0.7, 0.8, 12.5), (2048.0, -1024.0, 0.0)
    moved = replace(near, origin=origin)
    for flora in (support.small_flora(), drawn_flora()):
        trunk = support.trunks(flora.rows, support.plants([1, 2, 3], position=(2050.0, -1020.0, 1.0)))
        there = replace(trunk, position=trunk.position - origin)
        rows, rows_moved = flora.in_wind(near).rows, flora.in_wind(moved).rows
        np.testing.assert_allclose(gusts(rows_moved, there.position), gusts(rows, trunk.position), atol=1e-9)
        np.testing.assert_allclose(sway(rows_moved, there), sway(rows, trunk), atol=1e-9)
        assert np.abs(sway(rows, there) - sway(rows, trunk)).max() > 1e-3
