# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the plant model promises beyond plain orders: forks, short shoots, the pipe model, flare, attraction, sprays,
whorled and hanging leaves, blossoms, several forms, gradients from the inside of the crown to the outside."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.arrays import spread
from tetflora_addon.compiled.averages import quadratic
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.compiled.orientation import leaf_moments, wood_moments
from tetflora_addon.growth.axes import axes
from tetflora_addon.growth.foliage import leaf_keys, leaf_places, outwardness, place_leaves, settled
from tetflora_addon.growth.growth import branch_counts, children, leaf_counts, radius_at
from tetflora_addon.growth.rows import DEAD, FORK, LATERAL, SPUR, SPUR_ORDER, without_variation
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.refinement.contents import piece_totals, subplant_totals
from tetflora_addon.species.members import expected_members, expected_polygons
from tetflora_addon.subplants.pieces import Pieces, open_subplants, wood_areas

_UP = np.array([0.0, 0.0, 1.0])


def rich(**changes: Any) -> Flora:
    return support.compiled({**support.RICH, **changes})


def leaves(flora: Flora, branches: Branches) -> tuple[np.ndarray, Any, np.ndarray]:
    """Branch, leaves and settled frames of all leaves on branches' own axes."""
    counts = leaf_counts(flora.rows, branches)
    owner, index = spread(counts)
    key = leaf_keys(branches, owner, index)
    t = leaf_places(flora.rows, branches, owner, index, counts, key)
    found = place_leaves(flora.rows, branches, axes(flora.rows, branches), owner, index, key, t)
    return owner, found, settled(flora.rows, branches.row[owner], found.frame, found.light, _UP)


def trunk_of(seeds: Any, **order0: Any) -> tuple[Flora, Branches]:
    flora = support.compiled(support.small(order0=order0))
    return flora, support.trunks(flora.rows, support.plants(seeds))


def test_averages_of_everything_at_once() -> None:
    """Leaves, their area and color, wood, faces: compiled against 300 plants grown to the last leaf."""
    flora = rich()
    trunk, pieces = support.grown(flora, support.plants(np.arange(300)))
    tubes, blades = support.meshes(flora, pieces)
    areas = [support.face_areas(m) for m in blades]
    assert sum(m.polygons for m in (*tubes, *blades)) == pytest.approx(300 * flora.polygons[0], rel=0.025)
    totals = subplant_totals(flora, trunk)
    assert sum(a.sum() for a in areas) == pytest.approx(totals.leaf_area.sum(), rel=0.03)
    assert wood_areas(flora, pieces).sum() == pytest.approx(totals.wood_area.sum(), rel=0.03)
    color = sum(a @ m.attributes["tf_color"][1] for a, m in zip(areas, blades, strict=True))
    expected = flora.leaf_colors(trunk)[0]
    np.testing.assert_allclose(color / sum(a.sum() for a in areas), expected, rtol=0.02)


@pytest.mark.parametrize("level", [1, 2, 3])
def test_totals_are_kept_when_subplants_are_opened(level: int) -> None:
    """What a sub-plant is expected to hold is what its children and its own branch are expected to, on average."""
    flora = rich()
    subplants = support.trunks(flora.rows, support.plants(np.arange(4000)))
    for _ in range(level - 1):
        subplants, *_ = open_subplants(flora, subplants)
        subplants = subplants.take(np.s_[:: max(len(subplants) // 4000, 1)])
    grown, _, pieces, _ = open_subplants(flora, subplants)
    whole, own, parts = subplant_totals(flora, subplants), piece_totals(flora, pieces), subplant_totals(flora, grown)
    for name, tolerance in (("leaf_area", 0.02), ("wood_area", 0.03), ("polygons", 0.02)):
        opened = getattr(own, name).sum() + getattr(parts, name).sum()
        assert opened == pytest.approx(getattr(whole, name).sum(), rel=tolerance), name


@given(st.integers(0, 10**6), st.lists(st.floats(0.01, 0.99), min_size=1, max_size=5))
@settings(deadline=None, max_examples=15)
def test_totals_of_pieces_add_up_exactly(seed: int, cuts: list[float]) -> None:
    flora = rich()
    _, pieces = support.grown(flora, support.plants(seed))
    parts = pieces
    for cut in cuts:
        middle = parts.t0 + cut * (parts.t1 - parts.t0)
        parts = Pieces.concatenate([replace(parts, t1=middle), replace(parts, t0=middle)])
    for name in ("leaf_area", "wood_area"):
        before, after = (getattr(piece_totals(flora, p), name).sum() for p in (pieces, parts))
        assert after == pytest.approx(before, rel=1e-9), name


def test_moments_of_what_depends_on_the_sky() -> None:
    """Boughs at all tilts that bend to the sky, with level sprays and hanging leaves, against what is tabulated."""
    flora = rich()
    boughs, *_ = open_subplants(flora, support.trunks(flora.rows, support.plants(np.arange(200))))
    boughs = boughs.take(flora.rows["order"][boughs.row] == 1)
    for group in np.array_split(np.argsort(boughs.frame[:, 2, 2]), 4):
        some = boughs.take(group[:250])
        tubes, blades = support.meshes(flora, support.expanded(flora, some))
        totals = subplant_totals(flora, some)
        weight = totals.leaf_area
        expected = np.einsum("n,nij->ij", weight, leaf_moments(flora.orientation, some)) / weight.sum()
        areas = [support.face_areas(m).sum() for m in blades]
        found = sum(a * support.moment(m) for a, m in zip(areas, blades, strict=True)) / sum(areas)
        np.testing.assert_allclose(found, expected, atol=0.04)
        expected = np.einsum("n,nij->ij", totals.wood_area, wood_moments(flora.orientation, some))
        np.testing.assert_allclose(support.moment(tubes[0]), expected / totals.wood_area.sum(), atol=0.05)


def test_samples_lie_where_attracted_boughs_have_their_leaves() -> None:
    """Mean place of leaves in the world, over boughs of each quarter of tilts, against the samples of their stand."""
    flora = rich()
    boughs, *_ = open_subplants(flora, support.trunks(flora.rows, support.plants(np.arange(150))))
    boughs = boughs.take(flora.rows["order"][boughs.row] == 1)
    points = flora.samples.leaves
    for group in np.array_split(np.argsort(boughs.frame[:, 2, 2]), 4):
        some = boughs.take(group[:200])
        pieces = support.expanded(flora, some)
        tips = pieces.take(pieces.t1 == 1)
        owner, found, _ = leaves(flora, tips.branches)
        area = found.size**2 * flora.leaf.area[tips.branches.row[owner]]
        height = np.average(found.position[:, 2], weights=area)
        first, number = points.runs(some)
        weight, total, sampled = subplant_totals(flora, some).leaf_area, 0.0, 0.0
        for i in range(len(some)):
            run = points.position[first[i] : first[i] + number[i]].astype(float)
            z = some.position[i, 2] + some.length[i] * (run @ some.frame[i, 2])
            total, sampled = total + weight[i], sampled + weight[i] * z.mean()
        assert sampled / total == pytest.approx(height, abs=0.09 * some.length.mean())


def test_forks_keep_the_cross_section_and_the_length() -> None:
    """Leonardo's rule at each fork; from the ground to every tip the trunk is as long as its order says."""
    flora, trunk = trunk_of(
        np.arange(40), forks=[3, 0], fork_at=0.3, fork_levels=2, length=[4, 0], taper=0.25, branches=[0, 0]
    )
    counts = branch_counts(flora.rows, trunk, FORK)
    assert (counts == 3).all()
    stems, owner = children(flora.rows, trunk)
    tip = radius_at(flora.rows, trunk, np.ones(len(trunk)))
    np.testing.assert_allclose(np.bincount(owner, stems.radius**2), tip**2)
    tips, of_stem = children(flora.rows, stems)
    assert len(tips) == 40 * 9
    length = trunk.length[owner][of_stem] + stems.length[of_stem] + tips.length
    np.testing.assert_allclose(length, 4)
    end = radius_at(flora.rows, tips, np.ones(len(tips)))
    np.testing.assert_allclose(end**2 * 9, (0.25 * trunk.radius[owner][of_stem]) ** 2)
    np.testing.assert_allclose(stems.position, axes(flora.rows, trunk).knots[owner, -1], atol=1e-12)


def test_a_fork_of_one_stem_goes_straight_on() -> None:
    """Nothing but the joints tells such a branch from one that does not divide."""
    straight = {"curvature": [0, 0], "angle": [0, 0], "length": [4, 0], "branches": [0, 0]}
    flora, trunk = trunk_of([7], forks=[1, 0], fork_at=0.5, **straight)
    tips, _ = children(flora.rows, trunk)
    plain, whole = trunk_of([7], **straight)
    np.testing.assert_allclose(axes(flora.rows, tips).knots[0, -1], axes(plain.rows, whole).knots[0, -1], atol=1e-9)
    end, other = (radius_at(f.rows, b, np.ones(1)) for f, b in ((flora, tips), (plain, whole)))
    np.testing.assert_allclose(end, other)


def test_laterals_of_a_forked_branch_are_as_many_to_a_length() -> None:
    flora, trunk = trunk_of(np.arange(400), forks=[2, 0], fork_at=0.5, branches=[12, 2], branch_start=0.0)
    pieces = support.expanded(flora, trunk)
    orders = flora.rows["order"][pieces.branches.row]
    laterals = (pieces.t0 == 0) & (orders == 1)
    assert laterals.sum() / 400 == pytest.approx(12 * (0.5 + 2 * 0.5), rel=0.02)
    members = expected_members(flora.species[0])
    assert members.branches[1] == pytest.approx(18)
    stems = ((pieces.t0 == 0) & (orders == 0)).sum() / 400
    assert stems == 3
    assert members.segments[0] == pytest.approx(stems * flora.rows["segments"][0])


@pytest.mark.parametrize("power", [2.0, 2.5, 3.0])
def test_the_pipe_model_conserves_radii_to_a_power(power: float) -> None:
    """Sum of r^p over the laterals and the tip is that of the base, for a species without variation."""
    flora = support.compiled(
        support.small(
            order0={"pipe": power, "branches": [9, 0], "taper": 0.35, "thickness": [0.02, 0]},
            order1={"thickness": [1, 0], "whorl": 1},
        )
    )
    trunk = support.trunks(flora.rows, support.plants(np.arange(200)))
    laterals, owner = children(flora.rows, trunk)
    tip = radius_at(flora.rows, trunk, np.ones(len(trunk)))
    total = np.bincount(owner, laterals.radius**power) + tip**power
    assert (total / trunk.radius**power).mean() == pytest.approx(1, rel=0.01)
    t = np.linspace(0, 1, 50)
    radius = radius_at(flora.rows, trunk.take(np.zeros(50, int)), t)
    assert (np.diff(radius) <= 1e-12).all()


def test_a_flared_base_is_as_wide_as_asked_and_gone_after_an_eighth() -> None:
    flora, trunk = trunk_of([3], flare=1.5, taper=0.5)
    thick = radius_at(flora.rows, trunk.take(np.zeros(3, int)), np.array([0, 1 / 8, 0.5])) / trunk.radius[0]
    np.testing.assert_allclose(thick, [1 + 1.5 * 0.99, 1 - 0.5 / 8, 0.75], atol=1e-9)
    _, pieces = support.grown(flora, support.plants([3]))
    own = pieces.take(pieces.branches.row == 0)
    assert len(own) == flora.rows["segments"][0] + 3
    assert (own.t0[1:] == own.t1[:-1]).all()
    lengths = np.linalg.norm(own.end - own.start, axis=1)
    np.testing.assert_allclose(lengths, (own.t1 - own.t0) * trunk.length[0])


@pytest.mark.parametrize("pull", [-90.0, -30.0, 45.0, 120.0])
def test_attraction_turns_to_the_sky_or_the_ground(pull: float) -> None:
    flora = support.compiled(support.small(order1={"attraction": [pull, 0], "curvature": [0, 0], "segments": 6}))
    boughs, _ = children(flora.rows, support.trunks(flora.rows, support.plants(np.arange(30))))
    lines = axes(flora.rows, boughs)
    rise = lines.frames[:, -1, 2, 2] - lines.frames[:, 0, 2, 2]
    level = np.hypot(*lines.frames[:, 0, :2, 2].T) > 0.2
    assert (np.sign(rise[level]) == np.sign(pull)).all()
    turn = np.arccos(np.clip(np.einsum("nij,nij->nj", lines.frames[:, 0], lines.frames[:, -1])[:, 2], -1, 1))
    assert turn.max() <= np.radians(abs(pull)) * 5 / 6 + 1e-6
    # About the level axis: whoever sets out north stays north.
    heading = [lines.frames[:, i, :2, 2] / np.hypot(*lines.frames[:, i, :2, 2].T)[:, None] for i in (0, 1)]
    assert np.einsum("ni,ni->n", *heading)[level].min() > 0.999


def test_a_spray_is_level() -> None:
    """Laterals of a lying branch leave it to the sides, those of the same species without spray all around."""
    rise = {}
    for spray in (0.0, 1.0):
        data = support.small(
            order1={"angle": [90, 0], "angle_tip": 90, "curvature": [0, 0]},
            order2={"spray": spray, "azimuth": [180, 0], "angle": [50, 0], "angle_tip": 50},
        )
        flora = support.compiled(data)
        boughs, _ = children(flora.rows, support.trunks(flora.rows, support.plants(np.arange(40))))
        twigs, owner = children(flora.rows, boughs)
        rise[spray] = np.abs(twigs.frame[:, 2, 2] - np.cos(np.radians(50)) * boughs.frame[owner, 2, 2])
    assert rise[1.0].max() < 1e-9
    assert rise[0.0].mean() > 0.2


def test_leaf_whorls_share_their_place_and_stand_evenly_around() -> None:
    flora = support.compiled(
        support.small(order2={"leaves": [10, 0], "leaf_whorl": 5, "leaf_azimuth": [20, 0], "leaf_light": 0})
    )
    pieces = support.grown(flora, support.plants([2]))[1]
    twigs = pieces.take(flora.rows["order"][pieces.branches.row] == 2).branches
    counts = leaf_counts(flora.rows, twigs)
    assert (counts % 5 == 0).all()
    assert counts.mean() == pytest.approx(10)
    _, found, frame = leaves(flora, twigs)
    places = found.position.reshape(-1, 5, 3)
    assert np.ptp(places, axis=1).max() < 1e-12
    axis = np.repeat(twigs.frame[:, :, 2], counts, axis=0)
    across = frame[:, :, 1] - (frame[:, :, 1] * axis).sum(axis=1, keepdims=True) * axis
    assert np.abs(across.reshape(-1, 5, 3).sum(axis=1)).max() < 0.4  # of five vectors of about .7


def test_leaves_hang_as_far_as_asked() -> None:
    down = {}
    for droop in (0.0, 0.5, 1.0):
        flora = support.compiled(support.small(order2={"leaf_droop": droop}))
        pieces = support.grown(flora, support.plants([1]))[1]
        twigs = pieces.take(flora.rows["order"][pieces.branches.row] == 2).branches
        _, _, frame = leaves(flora, twigs)
        np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), np.broadcast_to(np.eye(3), frame.shape), atol=1e-4)
        down[droop] = -frame[:, 2, 1]
    assert (down[0.5] >= down[0.0] - 1e-4).all()
    np.testing.assert_allclose(down[1.0], 1, atol=1e-3)


def test_spurs_and_blossoms_are_as_many_as_described() -> None:
    flora = rich()
    trunk = support.trunks(flora.rows, support.plants(np.arange(300)))
    pieces = support.expanded(flora, trunk)
    forms: dict[tuple[int, int], int] = {}
    for leaf in support.leaf_forms_of(flora, pieces):
        forms[leaf.kind, leaf.form] = leaf.buffers.polygons // flora.forms[0][leaf.kind][leaf.form].polygons
    assert {kind for kind, _ in forms} == {0, 1}
    members = expected_members(flora.species[0])
    assert forms[1, 0] / 300 == pytest.approx(members.spur_leaves, rel=0.02)
    green = np.array([forms[0, f] for f in range(3)])
    assert green.sum() / 300 == pytest.approx(sum(members.leaves), rel=0.02)
    np.testing.assert_allclose(green / green.sum(), 1 / 3, atol=0.02)  # forms are drawn evenly
    assert expected_polygons(flora.species[0]) == pytest.approx(flora.polygons[0], rel=0.05)  # but for rings of flares


def test_spurs_do_not_depend_on_the_length_of_their_branch() -> None:
    flora = rich()
    pieces = support.grown(flora, support.plants(np.arange(5)))[1]
    spurs = pieces.take((flora.rows["order"][pieces.branches.row] == SPUR_ORDER) & (pieces.t0 == 0)).branches
    assert len(spurs) > 50
    assert spurs.length.min() >= 0.08
    assert spurs.length.max() <= 0.16


def test_color_and_size_go_from_the_inside_to_the_outside() -> None:
    """Leaves near the ends of limbs have the outer color; the gradient follows the limb, not the twig."""
    flora = rich()
    pieces = support.grown(flora, support.plants(np.arange(60)))[1]
    twigs = pieces.take((flora.rows["order"][pieces.branches.row] == 2) & (pieces.t0 == 0)).branches
    owner, found, _ = leaves(flora, twigs)
    outward = outwardness(flora.rows, twigs, owner, np.zeros(len(owner)))
    assert outward.min() >= 0
    assert outward.max() <= 1
    inside, outside = outward < 0.4, outward > 0.8
    assert found.size[outside].mean() / found.size[inside].mean() > 1.25


def test_quadratic_weights_are_exact_for_quadratics() -> None:
    o = np.linspace(0, 1, 21)
    np.testing.assert_allclose(quadratic(o) @ np.array([2.0, 2.75, 4.0]), 2 + o + o * o, atol=1e-12)


def test_an_exact_plant_is_the_mean_of_its_ranges() -> None:
    exact = without_variation(rich().species[0])
    for order in (*exact.orders, exact.spur):
        assert order.length.variation == order.branches.variation == order.taper.variation == 0
    assert exact.orders[1].attraction.mean == 60
    assert exact.dead.number.variation == exact.dead.orders[0].length.variation == 0


def test_children_of_each_sort_have_keys_of_their_own() -> None:
    flora = rich()
    trunk = support.trunks(flora.rows, support.plants(np.arange(50)))
    grown, owner = children(flora.rows, trunk)
    assert len(np.unique(grown.key)) == len(grown)
    number = sum(branch_counts(flora.rows, trunk, sort) for sort in (LATERAL, FORK, SPUR, DEAD))
    assert (np.bincount(owner, minlength=50) == number).all()


def test_limbs_that_fork_are_as_long_as_those_that_do_not() -> None:
    """All vigors: a limb's stems go on with what is left of its own length, which follows the crown already."""
    forked = support.compiled(support.small(order1={"forks": [1, 0], "fork_at": 0.5, "length": [0.4, 0]}))
    plain = support.compiled(support.small(order1={"length": [0.4, 0]}))
    seeds = support.plants(np.arange(30))
    length = []
    for flora in (forked, plain):
        pieces = support.expanded(flora, support.trunks(flora.rows, seeds))
        limbs = pieces.take(flora.rows["order"][pieces.branches.row] == 1)
        length.append(np.linalg.norm(limbs.end - limbs.start, axis=1).sum())
    assert length[0] == pytest.approx(length[1], rel=1e-6)
    trunk, pieces = support.grown(forked, seeds)
    assert wood_areas(forked, pieces).sum() == pytest.approx(subplant_totals(forked, trunk).wood_area.sum(), rel=0.05)
