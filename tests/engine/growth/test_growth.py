# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Growth from seeds: the same plant whatever is grown beside it, before it, or of it.

``tests/data/plants.json`` holds plants as they were grown once; every version of Python and numpy has to meet them.
After a change that is meant to change plants, write it anew with ``python -m tests.engine.test_growth``.
"""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.arrays import chunks, spread
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.growth.axes import axes
from tetflora_addon.growth.foliage import _face_light, leaf_keys, leaf_places, place_leaves
from tetflora_addon.growth.growth import branch_counts, children, chosen_children, leaf_counts, radius_at, trunks
from tetflora_addon.growth.rows import DEAD, FORK, SPUR
from tetflora_addon.growth.seeds import Branches, Seeds
from tetflora_addon.species.ages import with_age
from tetflora_addon.species.catalog import load_species
from tetflora_addon.subplants.pieces import Pieces, open_subplants

TABLE = Path(__file__).resolve().parents[2] / "data" / "plants.json"
seeds_ = st.integers(-(2**63), 2**63 - 1)


def by_key(pieces: Pieces) -> Pieces:
    return pieces.take(np.lexsort([pieces.t0, pieces.branches.key, pieces.branches.plant]))


def same(a: Any, b: Any) -> bool:
    """Bit for bit, but for the number of the plant."""
    if a is None:
        return b is None
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and a.tobytes() == b.tobytes()
    return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.name != "plant")


def leaves_of(flora: Flora, branches: Branches) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Keys, bases and sizes of all leaves on branches' own axes."""
    counts = leaf_counts(flora.rows, branches)
    owner, index = spread(counts)
    key = leaf_keys(branches, owner, index)
    t = leaf_places(flora.rows, branches, owner, index, counts, key)
    leaves = place_leaves(flora.rows, branches, axes(flora.rows, branches), owner, index, key, t)
    return key, leaves.position, leaves.size


@pytest.mark.parametrize("species", range(len(support.SPECIES)), ids=support.SPECIES)
@given(seed=seeds_, pick=st.integers(0, 10**6))
@settings(deadline=None, max_examples=3)
def test_a_subplant_alone_is_the_same_as_inside_the_whole(species: int, seed: int, pick: int) -> None:
    """One child by its index, one of its children, and so on; then all that grows on it, against the whole plant."""
    flora = support.lean()
    trunk, whole = support.grown(flora, support.plants(seed, species))
    one = trunk
    for order in range(2):
        counts = branch_counts(flora.rows, one)
        if counts[0] == 0:
            break
        index = np.array([(pick >> (8 * order)) % counts[0]])
        lines = axes(flora.rows, one)
        one_child = chosen_children(flora.rows, one, lines, np.zeros(1, np.int64), index, counts)
        assert same(one_child, children(flora.rows, one)[0].take(index))
        one = one_child
    alone = by_key(support.expanded(flora, one))
    inside = by_key(whole.take(np.isin(whole.branches.key, alone.branches.key)))
    assert same(alone, inside)


@given(st.lists(seeds_, min_size=2, max_size=6, unique=True), st.randoms(use_true_random=False))
@settings(deadline=None, max_examples=10)
def test_order_of_plants_does_not_matter(seeds: list[int], random: Any) -> None:
    flora = support.lean()
    kinds = np.array([random.randrange(len(support.SPECIES)) for _ in seeds])
    places = np.arange(3.0 * len(seeds)).reshape(-1, 3)
    order = np.array(random.sample(range(len(seeds)), len(seeds)))
    trunk, _ = support.grown(flora, support.plants(seeds, kinds, places))
    first, _, pieces, _ = open_subplants(flora, trunk)
    other, _, other_pieces, _ = open_subplants(flora, trunk.take(order))
    for plant in range(len(seeds)):
        assert same(first.take(first.plant == plant), other.take(other.plant == plant))
        mine, theirs = (p.take(p.branches.plant == plant) for p in (pieces, other_pieces))
        assert same(mine, theirs)


def test_forwards_is_backwards_and_whole_is_in_chunks() -> None:
    flora = support.small_flora()
    trunk, whole = support.grown(flora, support.plants(np.arange(9)))
    level, _ = children(flora.rows, trunk)
    backwards, _ = children(flora.rows, level.take(np.s_[::-1]))
    forwards, _ = children(flora.rows, level)
    order = [np.lexsort([b.key, b.plant]) for b in (forwards, backwards)]
    assert same(forwards.take(order[0]), backwards.take(order[1]))
    parts = [support.expanded(flora, trunk.take(run)) for run in chunks(flora.polygons[trunk.row], 500)]
    assert len(parts) > 3
    assert same(by_key(Pieces.concatenate(parts)), by_key(whole))


@given(st.lists(st.floats(0, 5000), max_size=30), st.floats(1, 3000))
@settings(deadline=None)
def test_chunks_cover_everything_once(sizes: list[float], limit: float) -> None:
    runs = list(chunks(np.array(sizes), limit))
    assert [i for run in runs for i in range(run.start, run.stop)] == list(range(len(sizes)))
    for run in runs:
        assert sum(sizes[run.start + 1 : run.stop]) <= limit * (1 + 1e-9)


def test_same_seed_twice_and_different_seeds() -> None:
    flora = support.small_flora()
    trunk, pieces = support.grown(flora, support.plants([7, 7, 8]))
    first, second, third = (by_key(pieces.take(pieces.branches.plant == p)) for p in range(3))
    assert same(first, second)
    assert not np.isin(third.branches.key, first.branches.key).any()
    assert trunk.length[2] != trunk.length[0]


def test_no_branch_of_many_plants_is_born_twice() -> None:
    """Seeds in a row, as a user has them: no two plants share a sub-plant."""
    flora = support.small_flora()
    _, pieces = support.grown(flora, support.plants(np.arange(-20, 60)))
    starts = pieces.take(pieces.t0 == 0).branches
    assert len(np.unique(starts.key)) == len(starts)


@given(seeds_, st.sampled_from([0.125, 0.5, 4.0]), st.floats(0.01, 50))
@settings(deadline=None, max_examples=20)
def test_scaling_a_plant_scales_all_of_it(seed: int, power: float, factor: float) -> None:
    """Leaves too; exactly for powers of two, within rounding for others."""
    flora = support.small_flora()
    _, plain = support.grown(flora, support.plants(seed))
    leaves = leaves_of(flora, plain.branches)
    for scale, tolerance in ((power, 0.0), (factor, 1e-12 * factor)):
        _, scaled = support.grown(flora, support.plants(seed, scale=scale))
        assert (scaled.branches.key == plain.branches.key).all()
        np.testing.assert_allclose(scaled.end, plain.end * scale, rtol=0, atol=3 * tolerance)
        np.testing.assert_allclose(scaled.branches.radius, plain.branches.radius * scale, rtol=0, atol=tolerance)
        key, position, size = leaves_of(flora, scaled.branches)
        assert (key == leaves[0]).all()
        np.testing.assert_allclose(position, leaves[1] * scale, rtol=0, atol=3 * tolerance)
        np.testing.assert_allclose(size, leaves[2] * scale, rtol=0, atol=tolerance)


@given(seeds_, st.floats(-np.pi, np.pi))
@settings(deadline=None, max_examples=20)
def test_turning_a_plant_about_the_vertical_turns_all_of_it(seed: int, angle: float) -> None:
    """About the vertical only, for leaves look for the sky."""
    flora = support.small_flora()
    plain = support.plants(seed)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    turned = Seeds(plain.identifiers, plain.species, plain.seed, plain.position, turn @ plain.frame, plain.scale)
    for mine, theirs in zip(*(support.meshes(flora, support.grown(flora, s)[1]) for s in (plain, turned)), strict=True):
        for a, b in zip(mine, theirs, strict=True):
            assert (a.corner_verts == b.corner_verts).all()
            np.testing.assert_allclose(a.positions @ turn.T, b.positions, atol=1e-5)


def test_moving_a_plant_moves_it() -> None:
    flora = support.small_flora()
    _, here = support.grown(flora, support.plants(3))
    _, there = support.grown(flora, support.plants(3, position=(10, -5, 2)))
    np.testing.assert_allclose(here.end + (10, -5, 2), there.end, atol=1e-12)


@pytest.mark.parametrize("years", [0.0, 80.0, 300.0])
def test_stems_cover_the_rim_of_the_trunk_that_forks(years: float) -> None:
    """Where a stem comes out of the end of its trunk, on the side to which it leans, it is as far out as the rim."""
    rows = compile_species([with_age(load_species("oak"), years)]).rows
    own = trunks(rows, Seeds.upright(24))
    counts = branch_counts(rows, own, FORK)
    owner, index = spread(counts)
    stems = chosen_children(rows, own, axes(rows, own), owner, index, counts, FORK)
    rim = radius_at(rows, own, np.ones(len(own)))[owner]
    top = axes(rows, own).at(owner, np.ones(len(owner)))[1][:, :, 2]
    lean = np.arccos(np.clip(np.einsum("ni,ni->n", stems.frame[:, :, 2], top), -1.0, 1.0))
    way = np.linspace(0.0, 2.0, 200)[:, None] * rim
    radius = np.array([radius_at(rows, stems, t) for t in np.minimum(way / stems.length, 1.0)])
    out = np.argmax(way * np.cos(lean) >= radius * np.sin(lean), axis=0)
    assert (radius[out, np.arange(len(stems))] / np.cos(lean) > 0.9 * rim).all()


def test_frames_stay_rotations_and_branches_keep_their_length() -> None:
    flora = support.lean()
    _, pieces = support.grown(flora, support.plants(np.arange(6), np.arange(6) % len(support.SPECIES)))
    lines = axes(flora.rows, pieces.branches)
    for frames in (pieces.branches.frame, lines.frames[:, 0]):
        np.testing.assert_allclose(
            frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (len(frames), 1, 1)), atol=1e-12
        )
        assert (np.linalg.det(frames) > 0).all()
    length = np.linalg.norm(pieces.end - pieces.start, axis=1)
    np.testing.assert_allclose(length, pieces.branches.length * (pieces.t1 - pieces.t0), rtol=1e-9)


def test_children_sit_on_their_parents() -> None:
    """At the axis, between the bare part and the tip, no thicker than the parent is there."""
    flora = support.lean()
    trunk = trunks(flora.rows, support.plants(np.arange(30), np.arange(30) % len(support.SPECIES)))
    lines = axes(flora.rows, trunk)
    grown, owner = children(flora.rows, trunk, lines)
    counts = branch_counts(flora.rows, trunk)
    others = sum(branch_counts(flora.rows, trunk, sort) for sort in (FORK, SPUR, DEAD))
    assert (np.bincount(owner, minlength=len(trunk)) == counts + others).all()
    whorl = np.maximum(flora.rows["whorl"][flora.rows["next"][trunk.row, 0]], 1)
    most = flora.rows["count"][trunk.row, 0].sum(axis=1) + whorl
    least = flora.rows["count"][trunk.row, 0] @ [1, -1] - whorl
    assert ((counts < most) & (counts > least)).all()
    a, b = lines.knots[owner, :-1], lines.knots[owner, 1:]
    along = np.clip(((grown.position[:, None] - a) * (b - a)).sum(2) / np.maximum(((b - a) ** 2).sum(2), 1e-30), 0, 1)
    gap = np.linalg.norm(a + along[..., None] * (b - a) - grown.position[:, None], axis=2).min(axis=1)
    assert gap.max() < 1e-9
    assert (grown.radius <= trunk.radius[owner] * (1 + flora.rows["flare"][trunk.row[owner]])).all()
    assert (flora.rows["next"][trunk.row[owner]] == grown.row[:, None]).any(axis=1).all()


@given(st.floats(0, 1), st.floats(0, np.pi), st.floats(0, 2 * np.pi), st.floats(0, np.pi))
@settings(deadline=None)
def test_leaves_turn_to_the_light(light: float, tilt: float, azimuth: float, roll: float) -> None:
    """A right-handed frame, never farther from the sky than before, level at 1 and untouched at 0."""
    up = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    side = np.cross(up, [0, 0, 1.0] if abs(up[2]) < 0.9 else [1.0, 0, 0])
    side /= np.linalg.norm(side)
    along = np.cos(roll) * side + np.sin(roll) * np.cross(up, side)
    frame = np.stack([np.cross(along, up), along, up], axis=1)[None]
    for share in (light, 0.0, 1.0, 0.5):
        lit = _face_light(frame, np.array([share]), np.array([0.0, 0.0, 1.0]))[0]
        np.testing.assert_allclose(lit @ lit.T, np.eye(3), atol=1e-7)
        assert np.linalg.det(lit) > 0
        assert lit[2, 2] >= up[2] - 1e-6
    np.testing.assert_allclose(_face_light(frame, np.zeros(1), np.array([0, 0, 1.0]))[0], frame[0], atol=1e-7)


def table() -> dict[str, Any]:
    """Plants of fixed seeds in numbers: every fifth branch's end, and integers that stand for the whole topology."""
    files = {
        "small": support.small(),
        "flame": support.small(order0={"crown": "flame"}, order1={"crown": "inverse conical"}),
        "tend": support.small(order0={"crown": "tend flame", "curvature": [90, 60]}, order1={"crown": "conical"}),
    }
    out = {}
    for name, data in files.items():
        flora = support.compiled(data)
        trunk, pieces = support.grown(flora, support.plants([0, 1, -5, 2**62]))
        pieces = by_key(pieces)
        tips = pieces.take(pieces.t1 == 1)
        key, leaf_position, size = leaves_of(flora, tips.branches)
        tubes, leaves = support.meshes(flora, pieces)
        out[name] = {
            "height": float(trunk.length.max()),
            "branches": [int(n) for n in np.bincount(tips.branches.row)],
            "pieces": len(pieces),
            "keys": f"{int(np.bitwise_xor.reduce(tips.branches.key)):016x}",
            "leaves": len(key),
            "leaf_keys": f"{int(np.bitwise_xor.reduce(key)):016x}",
            "corners": [int(m.corner_verts.astype(np.int64).sum()) for m in (*tubes, *leaves)],
            "tips": np.round(tips.end[::5], 9).tolist(),
            "leaf_bases": np.round(leaf_position[::40], 9).tolist(),
            "leaf_sizes": np.round(size[::40], 9).tolist(),
        }
    return out


def test_every_version_of_numpy_grows_the_same_plants() -> None:
    """Topology identical, positions within 1e-6 of the plant's height."""
    stored = json.loads(TABLE.read_text(encoding="utf-8"))
    now = table()
    assert now.keys() == stored.keys()
    for name, plant in stored.items():
        for key, value in plant.items():
            if key in ("tips", "leaf_bases", "leaf_sizes", "height"):
                np.testing.assert_allclose(now[name][key], value, rtol=0, atol=1e-6 * plant["height"])
            else:
                assert now[name][key] == value, f"{name}: {key}"


@pytest.mark.parametrize("seeds", [[], [4]])
def test_no_plants_and_one_plant(seeds: list[int]) -> None:
    trunk, pieces = support.grown(support.small_flora(), support.plants(seeds))
    assert len(trunk) == len(seeds)
    assert bool(len(pieces)) == bool(seeds)


if __name__ == "__main__":
    TABLE.parent.mkdir(exist_ok=True)
    TABLE.write_text(json.dumps(table(), separators=(",", ":")) + "\n", encoding="utf-8")


def test_whorls_share_their_place_and_stand_evenly_around() -> None:
    flora = support.compiled(support.small(order1={"whorl": 4, "azimuth": [30, 0]}, order0={"branches": [12, 0]}))
    trunk = support.trunks(flora.rows, support.plants([3]))
    grown, _ = children(flora.rows, trunk)
    assert len(grown) == 12
    places = grown.position.reshape(3, 4, 3)
    assert np.ptp(places, axis=1).max() < 1e-12
    assert (np.diff(places[:, 0, 2]) > 0.1).all()
    up = trunk.frame[0, :, 2]
    for whorl in grown.frame.reshape(3, 4, 3, 3)[:1]:  # on the first segment, which sets out along the trunk
        out = whorl[:, :, 2] - (whorl[:, :, 2] @ up)[:, None] * up
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        np.testing.assert_allclose(np.sort(np.round(out @ out[0], 6)), [-1, 0, 0, 1], atol=1e-6)


def test_the_outer_half_bends_by_itself() -> None:
    """Bent back by 40° and forth by 40°, a branch ends as it set out but stands aside."""
    bend = {"curvature": [40, 0], "curvature_tip": -40, "segments": 5}  # two joints in each half
    flora = support.compiled(support.small(order0=bend))
    lines = axes(flora.rows, support.trunks(flora.rows, support.plants([1])))
    first, middle, last = lines.frames[0, 0], lines.frames[0, 2], lines.frames[0, 4]
    np.testing.assert_allclose(first, last, atol=1e-9)
    assert np.degrees(np.arccos(first[:, 2] @ middle[:, 2])) == pytest.approx(16)
