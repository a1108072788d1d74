# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants whose trunk and lower orders are drawn by hand: the drawing is kept, the rest grows as the species says."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.errors import SpeciesError
from tetflora_addon.growth.rows import MAX_DRAWN, MAX_SEGMENTS, drawn_lines
from tetflora_addon.refinement.contents import subplant_totals
from tetflora_addon.species.catalog import species_from_dict
from tetflora_addon.species.skeletons import Skeleton, drawn_branches, skeleton_from_edges
from tetflora_addon.subplants.pieces import open_subplants, wood_areas

#: A crooked trunk with three limbs, one of which bears a branch of its own.
POINTS = np.array(
    [
        [0, 0, 0], [0.2, 0, 1.5], [-0.1, 0.2, 3], [0.1, 0.1, 4.2],
        [1.2, 0.1, 2.2], [2.2, 0.3, 2.6], [-1.4, 0.4, 3.8], [-2.1, 0.9, 4.4], [1.5, 1.1, 3.0], [0.1, -1.5, 3.4],
    ], dtype=float,
)  # fmt: skip
EDGES = np.array([[0, 1], [1, 2], [2, 3], [1, 4], [4, 5], [2, 6], [6, 7], [4, 8], [2, 9]])
RADIUS = np.array([0.22, 0.18, 0.13, 0.03, 0.09, 0.03, 0.08, 0.02, 0.03, 0.02])


def form() -> Skeleton:
    return skeleton_from_edges(POINTS, RADIUS, EDGES, "a crooked tree")


def flora(**changes: object) -> Flora:
    species = species_from_dict(support.small(order1={"branches": [6, 1]}, order2={"branches": [0, 0]}), "s", "s.json")
    return compile_species([replace(species, **{"skeleton": form(), **changes})])


def test_drawn_branches_are_where_they_were_drawn() -> None:
    """Every drawn point lies on a piece of the plant, in the plant's own place, size and rotation."""
    one = flora()
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    seeds = replace(support.plants([4], position=(10, 20, 1), scale=2.0), frame=turn[None])
    pieces = support.expanded(one, support.trunks(one.rows, seeds))
    own = pieces.take(one.rows["drawn"][pieces.branches.row])
    places = (2 * POINTS) @ turn.T + [10, 20, 1]
    step = own.end - own.start
    for place in places:
        share = np.clip(((place - own.start) * step).sum(1) / np.maximum((step**2).sum(1), 1e-12), 0, 1)
        assert np.linalg.norm(own.start + share[:, None] * step - place, axis=1).min() < 2 * 0.06
    drawn = np.linalg.norm(POINTS[EDGES[:, 0]] - POINTS[EDGES[:, 1]], axis=1).sum()
    assert np.linalg.norm(step, axis=1).sum() == pytest.approx(2 * drawn, rel=0.02)


def test_only_orders_above_the_drawing_are_grown() -> None:
    """The drawing reaches order 2: what grows on it is of order 3, which this species does not have, and leaves."""
    one = flora()
    assert int(one.rows["order"][one.rows["drawn"]].max()) == 2
    trunk = support.trunks(one.rows, support.plants([1]))
    grown, _, pieces, _ = open_subplants(one, trunk)
    assert len(grown) == 0
    assert one.rows["drawn"][pieces.branches.row].all()
    assert one.leaf_count[0] > 0


def test_the_computer_fills_in_what_is_not_drawn() -> None:
    """A trunk alone: its limbs are those of the species, and differ from seed to seed; the trunk does not."""
    line = skeleton_from_edges(POINTS[:4], RADIUS[:4], EDGES[:3], "a pole")
    species = species_from_dict(support.small(), "s", "s.json")
    one = compile_species([replace(species, skeleton=line)])
    trunk = support.trunks(one.rows, support.plants([1, 2]))
    grown, owner, pieces, plant = open_subplants(one, trunk)
    number = np.bincount(owner)
    assert (number >= 5).all()
    first, second = (pieces.take(plant == i) for i in (0, 1))
    np.testing.assert_allclose(first.start, second.start, atol=1e-12)
    limbs = [grown.take(owner == i).position for i in (0, 1)]
    assert len(limbs[0]) != len(limbs[1]) or np.abs(limbs[0] - limbs[1]).max() > 0.01


def test_compiled_totals_are_those_of_grown_plants() -> None:
    one = flora()
    trunk, pieces = support.grown(one, support.plants(np.arange(400)))
    tubes, leaves = support.meshes(one, pieces)
    totals = subplant_totals(one, trunk)
    assert wood_areas(one, pieces).sum() == pytest.approx(totals.wood_area.sum(), rel=0.02)
    assert sum(support.face_areas(m).sum() for m in leaves) == pytest.approx(totals.leaf_area.sum(), rel=0.03)
    assert sum(m.polygons for m in (*tubes, *leaves)) == pytest.approx(totals.polygons.sum(), rel=0.03)


@pytest.mark.parametrize("drawn", [4, len(POINTS)])
def test_everything_is_inside_the_bound(drawn: int) -> None:
    """The whole drawing, and its trunk alone, on which much grows."""
    edges = EDGES[: drawn - 1]
    line = skeleton_from_edges(POINTS[:drawn], RADIUS[:drawn], edges, "a tree")
    one = flora(skeleton=line)
    trunk = support.trunks(one.rows, support.plants(np.arange(20), scale=1.5))
    center, radius, half = support.bounding_cylinders(one, trunk)
    for i in range(20):
        pieces = support.expanded(one, trunk.take(np.array([i])))
        axis = trunk.frame[i, :, 2]
        for mesh in chain(*support.meshes(one, pieces)):
            way = mesh.positions - center[i]
            along = way @ axis
            assert np.abs(along).max() <= half[i] * (1 + 1e-5)
            assert np.linalg.norm(way - along[:, None] * axis, axis=1).max() <= radius[i] * (1 + 1e-5)


def test_tubes_follow_the_drawn_radii() -> None:
    one = flora()
    _, pieces = support.grown(one, support.plants([1]))
    tubes, _ = support.meshes(one, pieces.take(one.rows["order"][pieces.branches.row] == 0))
    base = tubes[0].positions[tubes[0].positions[:, 2] < 0.05]
    reach = np.linalg.norm(base[:, :2], axis=1)
    assert reach.max() == pytest.approx(0.22, rel=0.05)


def test_an_exact_species_gives_the_same_plant_for_every_seed() -> None:
    one = flora(exact=True)
    a, b = (support.expanded(one, support.trunks(one.rows, support.plants([s]))) for s in (1, 99))
    np.testing.assert_array_equal(a.start, b.start)
    meshes = [support.meshes(one, p)[1][0].positions for p in (a, b)]
    np.testing.assert_array_equal(*meshes)


def test_lines_are_even_and_their_frames_are_rotations() -> None:
    lines = drawn_lines(drawn_branches(form()))
    for b in range(len(lines.order)):
        n = lines.segments[b]
        assert 1 <= n <= MAX_SEGMENTS
        frames = lines.frames[b]
        np.testing.assert_allclose(
            frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (len(frames), 1, 1)), atol=1e-9
        )
        assert (np.linalg.det(frames) > 0).all()
        step = np.diff(lines.knots[b, : n + 1], axis=0)
        np.testing.assert_allclose(step / np.linalg.norm(step, axis=1, keepdims=True), frames[:n, :, 2], atol=1e-9)
        assert (lines.radii[b] > 0).all()


def test_too_many_drawn_branches_are_refused() -> None:
    n = MAX_DRAWN + 1
    points = np.array([[0, 0, 0], *([0, 0, i / n] for i in range(1, n + 1)), *([1, i, i / n] for i in range(1, n + 1))])
    line = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    sides = np.stack([np.arange(1, n + 1), np.arange(n + 1, 2 * n + 1)], axis=1)
    radius = np.concatenate([np.linspace(1, 0.5, n + 1), np.full(n, 0.1)])
    with pytest.raises(SpeciesError, match="1,000"):
        drawn_lines(drawn_branches(skeleton_from_edges(points, radius, np.concatenate([line, sides]), "a brush")))
