# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounds of sub-plants against plants that are grown: no vertex of any seed is outside, and little else is inside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.compiled.bounds import _ring_stretch, unit_bounds, widest_radii
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.refinement.contents import bounding_capsules
from tetflora_addon.species.species import LEAF_ENVELOPES, LEAF_INCLINATIONS
from tetflora_addon.subplants.leaf_meshes import leaf_meshes
from tetflora_addon.subplants.pieces import expand, open_subplants
from tetflora_addon.subplants.rings import Pixels
from tetflora_addon.subplants.tubes import tube_buffers

_FLOAT32 = 1e-6  # relative rounding of vertices


def vertices(flora: Flora, subplant: Branches) -> np.ndarray:
    """All vertices (v, 3) of one sub-plant, and those that its wood has where it is near."""
    branches = list(expand(flora, subplant))
    pixel = subplant.radius[0] / 40.0
    tubes = [
        tube_buffers(flora, branches),
        tube_buffers(flora, branches, Pixels(lambda points, _: np.full(len(points), pixel))),
    ]
    leaves = [leaf.buffers for leaf in leaf_meshes(flora, int(flora.species_of(subplant.row)[0]), branches)]
    meshes = (mesh for mesh in (*tubes, *leaves) if mesh is not None)
    return np.concatenate([mesh.positions for mesh in meshes]).astype(np.float64)


def outside(flora: Flora, subplants: Branches) -> float:
    """How far the farthest vertex of any sub-plant lies outside its body, as a fraction of the body's size."""
    worst = -1.0
    bodies = bounding_capsules(flora, subplants)
    for i, (*_, radius, half, pad) in enumerate(bodies.T):
        center, axis = bodies[:3, i], bodies[3:6, i]
        points = vertices(flora, subplants.take(np.array([i]))) - center
        along = points @ axis
        across = np.linalg.norm(points - along[:, None] * axis, axis=1)
        beyond = np.hypot(np.maximum(np.abs(along) - half, 0), np.maximum(across - radius, 0)) - pad
        worst = max(worst, beyond.max() / (radius + half + pad + np.abs(center).max()))
    return worst


@pytest.mark.parametrize("species", range(len(support.SPECIES)), ids=support.SPECIES)
def test_every_vertex_of_many_plants_is_inside_the_bound(species: int) -> None:
    """As many as some thousand polygons make, at most two: other tests draw species at random."""
    flora = support.lean()
    number = int(np.clip(support.FEW_POLYGONS / flora.polygons[flora.first_row[species]], 1, 2))
    trunk = support.trunks(flora.rows, support.plants(np.arange(number), species))
    assert outside(flora, trunk) < _FLOAT32


@pytest.mark.parametrize("species", range(len(support.SPECIES)), ids=support.SPECIES)
def test_subplants_of_all_orders(species: int) -> None:
    """Every vertex is inside their bounds."""
    flora = support.lean()
    level = support.trunks(flora.rows, support.plants(1, species))
    while len(level):
        level, *_ = open_subplants(flora, level.take(np.s_[:: max(1, len(level) // 8)]))
        some = level.take(np.s_[:: max(1, len(level) // 2)])
        assert outside(flora, some) < _FLOAT32


def ranges(low: float, high: float, most: float) -> st.SearchStrategy[list[float]]:
    """Mean and variation, both within limits."""
    return st.floats(0, most).flatmap(lambda v: st.tuples(st.floats(low + v, high - v), st.just(v))).map(list)


SHAPES = st.fixed_dictionaries(
    {
        "curvature": ranges(-360, 360, 60),
        "curvature_tip": st.floats(-300, 300),
        "attraction": st.one_of(st.just([0, 0]), ranges(-300, 300, 90)),
        "segments": st.integers(1, 12),
        "taper": st.floats(0, 1),
        "flare": st.sampled_from([0.0, 0.0, 1.0, 4.0]),
        "pipe": st.sampled_from([0.0, 1.5, 2.0, 3.0]),
        "branch_start": ranges(0, 0.99, 0.2),
        "crown": st.sampled_from(["conical", "flame", "inverse conical", "tend flame", "spherical", "receding"]),
        "count_by_length": st.floats(0, 1),
        "forks": st.sampled_from([[0, 0], [0, 0], [2, 1], [3, 0]]),
        "fork_at": st.floats(0.05, 0.95),
        "fork_angle": ranges(0, 120, 40),
        "fork_levels": st.integers(1, 2),
        "spurs": st.sampled_from([[0, 0], [3, 2]]),
        "leaf_droop": st.sampled_from([0.0, 0.6, 1.0]),
        "leaf_spray": st.sampled_from([0.0, 1.0]),
        "leaf_size_tip": st.sampled_from([1.0, 0.3, 3.0]),
        "leaf_size_young": st.sampled_from([1.0, 1.0, 0.3, 2.0]),
        "leaf_whorl": st.integers(1, 3),
        "leaf_start": ranges(0, 0.99, 0.2),
        "leaf_envelope": st.sampled_from(["none", *LEAF_ENVELOPES]),
        "leaf_envelope_radius": st.floats(0.01, 2),
        "leaf_inclination": st.sampled_from(["branch", *LEAF_INCLINATIONS]),
    }
)
LEANS = st.fixed_dictionaries(
    {"angle": ranges(0, 180, 40), "angle_tip": st.floats(0, 180), "spray": st.sampled_from([0.0, 1.0])}
)
SPUR: dict[str, Any] = {
    "length": [0.3, 0.2], "thickness": [0.05, 0.02], "flare": 2.0, "segments": 3, "curvature": [90, 60],
    "angle": [60, 40], "leaves": [4, 2], "leaf_size": [0.15, 0.05], "leaf_droop": 0.5,
}  # fmt: skip
DEAD = {"number": [3, 1], "from": 0.0, "into": 0.9, "on_limbs": [2, 1]}


def any_species(first: dict, second: dict, leans: list[dict]) -> Flora:
    """Branches that curl, fork, hang, flare and lean back: the extremes of the keys, not of the shipped species."""
    data = support.small(order0=first, order1={**second, **leans[0]}, order2=leans[1], spur=SPUR, dead=DEAD)
    keys = (
        "curvature",
        "curvature_tip",
        "attraction",
        "segments",
        "leaf_droop",
        "leaf_size_tip",
        "leaf_size_young",
        "leaf_whorl",
        "flare",
        "leaf_envelope",
        "leaf_envelope_radius",
    )
    data["orders"][2].update({key: first[key] for key in keys})
    # Forks multiply: three times three stems and what they bear would be slow to grow, not harder to bound.
    data["orders"][1]["fork_levels"] = 1
    for order in data["orders"]:
        order["branches"] = [min(order.get("branches", [0])[0], 3), 0]
        if order.get("forks", [0])[0] > 0:
            order["leaf_envelope"] = "none"
    return support.compiled(data)


@given(SHAPES, SHAPES, st.lists(LEANS, min_size=2, max_size=2), st.integers(0, 10**6))
@settings(deadline=None, max_examples=8)
def test_bounds_hold_for_any_species(first: dict, second: dict, leans: list[dict], seed: int) -> None:
    """Attraction, forks, short shoots, flares, the pipe model, leaves that hang; trunks, limbs and twigs."""
    flora = any_species(first, second, leans)
    trunk = support.trunks(flora.rows, support.plants(seed, scale=1.7, position=(1, 2, 3)))
    limbs, *_ = open_subplants(flora, trunk)
    twigs, *_ = open_subplants(flora, limbs.take(np.s_[:4]))
    for some in (trunk, limbs.take(np.s_[:: max(1, len(limbs) // 3)]), twigs.take(np.s_[:3])):
        assert outside(flora, some) < _FLOAT32


@pytest.mark.parametrize("variation", [0.0, 0.3])
@pytest.mark.parametrize(("angle", "tip"), [(10, 90), (90, 10), (150, 20)])
def test_limbs_whose_first_is_not_known_where_it_is_are_inside_the_bound(
    variation: float, angle: float, tip: float
) -> None:
    """The bare part of a trunk varies: at the same height one bears its first limb, another one of its last."""
    flora = support.compiled(
        support.small(
            order0={
                "branches": [20, 0],
                "branch_start": [0.35, variation],
                "crown": "cylindrical",
                "curvature": [0, 0],
            },
            order1={"length": [0.8, 0], "angle": [angle, 0], "angle_tip": tip, "branches": [0, 0], "leaves": [0, 0]},
        )
    )
    assert outside(flora, support.trunks(flora.rows, support.plants(np.arange(4)))) < _FLOAT32


@pytest.mark.parametrize("angle", [0, 45, 90, 135])
def test_bounds_of_straight_limbs_are_as_large_as_the_plant(angle: float) -> None:
    """Without curves and variation there is nothing to allow for: a bound a twentieth smaller would cut them."""
    straight = {"curvature": [0, 0], "curvature_tip": 0, "attraction": [0, 0]}
    trunk_order = {**straight, "length": [1, 0], "branches": [20, 0], "branch_start": [0.2, 0], "crown": "cylindrical"}
    limb_order = {**straight, "length": [0.8, 0], "angle": [angle, 0], "angle_tip": angle, "branches": [0, 0]}
    flora = support.compiled(support.small(order0=trunk_order, order1={**limb_order, "leaves": [0, 0]}))
    trunk = support.trunks(flora.rows, support.plants(np.arange(1)))
    assert outside(flora, trunk) < _FLOAT32
    (*_, radius, half, pad), *_ = (bodies := bounding_capsules(flora, trunk)).T
    from_center = vertices(flora, trunk) - bodies[:3, 0]
    along = from_center @ bodies[3:6, 0]
    across = np.linalg.norm(from_center - along[:, None] * bodies[3:6, 0], axis=1)
    assert across.max() > 0.95 * (radius + pad)
    assert np.ptp(along) > 0.95 * 2.0 * (half + pad)


@pytest.mark.parametrize("whorl", [2, 3])
def test_whorls_are_inside_the_bound(whorl: int) -> None:
    """Branches and leaves that share their places."""
    change = {"whorl": whorl, "leaf_whorl": whorl, "branches": [6, 0], "leaves": [6, 0]}
    flora = support.compiled(
        support.small(order0={"branches": [6, 0]}, order1=change, order2={**change, "branches": [0, 0]})
    )
    trunk = support.trunks(flora.rows, support.plants(np.arange(3)))
    limbs, *_ = open_subplants(flora, trunk)
    assert outside(flora, trunk) < _FLOAT32
    assert outside(flora, limbs.take(np.s_[:6])) < _FLOAT32


@given(ranges(-360, 360, 180), st.floats(-360, 360), st.integers(1, 6), st.integers(0, 10**6))
@settings(deadline=None, max_examples=30)
def test_rings_at_joints_are_no_wider_than_said(curvature: list, tip: float, segments: int, seed: int) -> None:
    bare = {"curvature": curvature, "curvature_tip": tip, "segments": segments, "taper": 1, "sides": 32}
    data = support.small(order0={**bare, "branches": [0, 0]})
    flora = support.compiled({**data, "orders": data["orders"][:1]})
    trunk, pieces = support.grown(flora, support.plants(seed))
    [tube], _ = support.meshes(flora, pieces)
    rings = tube.positions.reshape(segments + 1, 32, 3).astype(float)
    widest = np.linalg.norm(rings - rings.mean(axis=1, keepdims=True), axis=2).max()
    assert widest <= trunk.radius[0] * _ring_stretch(flora.rows)[0] * (1 + 1e-5)


def test_a_right_angle_makes_wide_rings() -> None:
    """Two frames a right angle apart, turned about the diagonal between their axes: the worst that is said."""
    cosine = 0.0
    diagonal = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    cross = np.cross(np.eye(3), diagonal)
    turned = cosine * np.eye(3) - cross + (1 - cosine) * np.outer(diagonal, diagonal)
    x, y = (v / np.linalg.norm(v) for v in (np.eye(3)[:, :2] + turned[:, :2]).T)
    rows = support.compiled(support.small(order0={"segments": 2, "curvature": [0, 0], "curvature_tip": 180})).rows
    assert np.sqrt(1 + abs(x @ y)) == pytest.approx(_ring_stretch(rows)[0])
    assert _ring_stretch(rows)[0] == pytest.approx(2 / np.sqrt(3))


def test_a_flare_of_children_widens_their_parents() -> None:
    flora = support.compiled(support.small(order1={"thickness": [0.9, 0.1], "flare": 4.0}))
    assert widest_radii(flora.rows)[0] == pytest.approx(5.0)
    assert outside(flora, support.trunks(flora.rows, support.plants(np.arange(20)))) < _FLOAT32


def test_what_is_longer_has_the_larger_bound() -> None:
    short, long = (
        unit_bounds(support.compiled(support.small(order1={"length": [length, 0.05]})).rows)[0] for length in (0.3, 0.6)
    )
    assert (np.abs(long) >= np.abs(short)).all()
    assert long[0] > 1.5 * short[0]


@pytest.mark.parametrize("species", range(len(support.SPECIES)), ids=support.SPECIES)
def test_samples_are_inside_the_bound(species: int) -> None:
    """And inside the tighter bound that says how large sub-plants look: points on sub-plants of all orders."""
    flora = support.lean()
    level = support.trunks(flora.rows, support.plants([1, 2, 3], species))
    while len(level):
        some = level.take(np.s_[:: max(1, len(level) // 40)])
        tight, body = flora.sampled_bound[some.row], bounding_capsules(flora, some)
        for points in (flora.samples.leaves, flora.samples.wood):
            first, number = points.runs(some)
            for i in np.flatnonzero(number):
                local = points.position[first[i] : first[i] + number[i]].astype(float)
                radius, low, high = tight[i, :3] + np.array([1, -1, 1]) * 1e-6 * (1.0 + np.abs(tight[i, :3]))
                assert np.hypot(local[:, 0], local[:, 1]).max() <= radius
                assert local[:, 2].min() >= low
                assert local[:, 2].max() <= high
                offset = some.position[i] + some.length[i] * local @ some.frame[i].T - body[:3, i]
                along = offset @ body[3:6, i]
                across = np.linalg.norm(offset - along[:, None] * body[3:6, i], axis=1)
                beyond = np.hypot(np.maximum(np.abs(along) - body[7, i], 0), np.maximum(across - body[6, i], 0))
                assert beyond.max() <= body[8, i] * (1 + 1e-5)
        level, *_ = open_subplants(flora, level.take(np.s_[:: max(1, len(level) // 12)]))
