# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Contents of tetrahedra: however space is divided, each branch and leaf is somewhere, once, on the right side."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.refinement.contents import Contents, Holdings, bounding_box, piece_totals, subplant_totals
from tetflora_addon.refinement.descent import Slack, push_down
from tetflora_addon.subplants.pieces import Pieces, wood_areas
from tetflora_addon.tetrahedra.geometry import volume
from tetflora_addon.tetrahedra.roots import view_root
from tetflora_addon.tetrahedra.tree import TetrahedralTree

views = st.tuples(st.integers(0, 2**31), st.sampled_from(["PERSP", "ORTHO"]))


def divided(
    flora: Flora, seeds: Seeds, seed: int, kind: str, rounds: int = 4, slack: Slack | None = None
) -> tuple[TetrahedralTree, Contents]:
    """Plants in a tree that a random camera roots and random choices divide, handed on after every round."""
    rng = np.random.default_rng(seed)
    eye = rng.uniform(-12, 12, 3) * [1, 1, 0.3] + [0, 0, 2]  # beside, among, above and below the plants
    camera = support.camera(eye, rng.uniform(-3, 3, 3), kind=kind, view=0.8 if kind == "PERSP" else 6.0)
    contents = Contents.of_plants(flora, seeds)
    tree = view_root(camera, bounding_box(flora, contents.subplants.items))
    contents = push_down(flora, tree, contents, slack)
    for _ in range(rounds):
        every = contents.sums(len(tree))
        nodes = np.flatnonzero(every.leaf_area + every.wood_area > 0)
        nodes = nodes[rng.random(len(nodes)) < 0.7]
        for _ in range(2):
            nodes = tree.split(nodes).ravel()
        contents = push_down(flora, tree, contents, slack)
    return tree, contents


def expanded(flora: Flora, contents: Contents) -> Pieces:
    return Pieces.concatenate([contents.pieces.items, support.expanded(flora, contents.subplants.items)])


def measures(flora: Flora, pieces: Pieces) -> tuple[float, float, int, int]:
    """Leaf area of the mesh, wood area, leaf faces, and faces of tubes if no branch were cut."""
    _, leaves = support.meshes(flora, pieces)
    segments = np.rint((pieces.t1 - pieces.t0) @ (flora.rows["segments"] * flora.rows["sides"])[pieces.branches.row])
    return (
        sum(float(support.face_areas(m).sum()) for m in leaves),
        float(wood_areas(flora, pieces).sum()),
        sum(m.polygons for m in leaves),
        int(segments),
    )


@given(views)
@settings(deadline=None, max_examples=12)
def test_nothing_is_lost_or_held_twice(view: tuple[int, str]) -> None:
    """Leaves exactly, wood within 1e-6, over all terminals against plants grown whole; every piece's ends meet."""
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    seeds = support.grove(6, 2.0, [0, 1, 0, 0, 1, 0])
    tree, contents = divided(flora, seeds, *view)
    assert len(tree) > 50
    assert (tree.children[contents.subplants.cell, 0] < 0).all()
    assert (tree.children[contents.pieces.cell, 0] < 0).all()
    parts = expanded(flora, contents)
    _, whole = support.grown(flora, seeds)
    leaf_area, wood_area, leaf_faces, tube_faces = measures(flora, parts)
    expected = measures(flora, whole)
    assert leaf_area == pytest.approx(expected[0], rel=1e-6)
    assert wood_area == pytest.approx(expected[1], rel=1e-6)
    assert (leaf_faces, tube_faces) == expected[2:]
    assert len(parts) >= len(whole)
    # Along each branch the pieces follow each other without a gap, from 0 to 1.
    order = np.lexsort([parts.t1, parts.t0, parts.branches.key, parts.branches.plant])
    parts = parts.take(order)
    starts = parts.t0 == 0
    ends = np.append(starts[1:], True)
    assert (parts.t1[ends] == 1).all()
    assert (parts.t1[~ends] == parts.t0[1:][~starts[1:]]).all()
    assert starts.sum() == (whole.t0 == 0).sum()


@given(views)
@settings(deadline=None, max_examples=12)
def test_everything_is_on_the_right_side(view: tuple[int, str]) -> None:
    """Ends of pieces and vertices of sub-plants, against every plane from their terminal up to the root."""
    flora = support.small_flora()
    tree, contents = divided(flora, support.grove(5, 2.5), *view)
    scale = np.abs(bounding_box(flora, contents.subplants.items)).max()

    def walk(cells: np.ndarray, signed: object) -> None:
        node = cells.astype(np.intp)
        while True:
            parent = tree.parent[node]
            up = parent >= 0
            if not up.any():
                return
            planes = tree.planes(np.maximum(parent, 0))
            side = np.where(tree.children[np.maximum(parent, 0), 1] == node, 1.0, -1.0)
            assert (signed(planes, side)[up] > -1e-9 * scale).all()
            node = np.where(up, parent, node)

    def of_pieces(planes: np.ndarray, side: np.ndarray) -> np.ndarray:
        ends = (
            np.einsum("ni,ni->n", planes[:, :3], p) for p in (contents.pieces.items.start, contents.pieces.items.end)
        )
        return np.minimum(*(side * (d + planes[:, 3]) for d in ends))

    walk(contents.pieces.cell, of_pieces)
    some = np.random.default_rng(0).permutation(len(contents.subplants))[:40]
    for one in some:
        tubes, leaves = support.meshes(flora, support.expanded(flora, contents.subplants.items.take(one[None])))
        points = np.concatenate([mesh.positions for mesh in (*tubes, *leaves)]).astype(np.float64)

        def of_vertices(planes: np.ndarray, side: np.ndarray, points: np.ndarray = points) -> np.ndarray:
            return side * (np.einsum("ni,ni->n", planes[:, :3], points) + planes[:, 3]) + 1e-6 * scale  # float32

        walk(np.full(len(points), contents.subplants.cell[one]), of_vertices)


@given(views)
@settings(deadline=None, max_examples=20)
def test_terminals_fill_the_root(view: tuple[int, str]) -> None:
    """Volumes before and after division agree to 1e-12, and no terminal is flat or turned inside out."""
    flora = support.small_flora()
    rng = np.random.default_rng(view[0])
    camera = support.camera(rng.uniform(-9, 9, 3), rng.uniform(-2, 2, 3), kind=view[1], view=2.0)
    contents = Contents.of_plants(flora, support.grove(3, 2.0))
    tree = view_root(camera, bounding_box(flora, contents.subplants.items))
    before = volume(tree.vertices(tree.terminals())).sum()
    divided_at = tree.terminals()
    for _ in range(6):
        divided_at = tree.split(divided_at[rng.random(len(divided_at)) < 0.7]).ravel()
    after = volume(tree.vertices(tree.terminals()))
    assert (after > 0).all()
    assert after.sum() == pytest.approx(before, rel=1e-12)


def test_expected_totals_do_not_depend_on_how_contents_are_cut() -> None:
    """Sums over nodes are sums over things; opening sub-plants moves them only by chance, over many plants."""
    flora = support.small_flora()
    seeds = support.grove(300, 1.5)
    whole = subplant_totals(flora, Contents.of_plants(flora, seeds).subplants.items)
    tree, contents = divided(flora, seeds, 3, "PERSP", rounds=3)
    every = contents.sums(len(tree))
    things = [subplant_totals(flora, contents.subplants.items), piece_totals(flora, contents.pieces.items)]
    for name in ("leaf_area", "wood_area", "polygons"):
        total = getattr(every, name).sum()
        assert total == pytest.approx(sum(getattr(t, name).sum() for t in things))
        if name != "polygons":  # cuts add rings
            assert total == pytest.approx(getattr(whole, name).sum(), rel=0.03)
    filled = every.leaf_area > 0
    assert every.width[filled].max() <= max(t.width.max() for t in things) + 1e-12
    assert (every.width[filled] > 0).all()


def test_totals_of_a_piece_add_up_to_its_branch() -> None:
    flora = support.small_flora()
    trunk, pieces = support.grown(flora, support.plants([1]))
    own = piece_totals(flora, pieces)
    branches = pieces.t0 == 0
    size, spread = flora.rows["leaf_size"][pieces.branches.row].T
    leaves = flora.rows["leaves"][pieces.branches.row, 0]
    expected = leaves * (size**2 + spread**2 / 3) * flora.leaf.area[0] * pieces.branches.scale**2
    assert own.leaf_area.sum() == pytest.approx(expected[branches].sum())
    assert own.wood_area.sum() == pytest.approx(wood_areas(flora, pieces).sum())
    assert (own.wood_area > 0).all()
    assert subplant_totals(flora, trunk).leaf_area[0] == pytest.approx(flora.area_nodes[0, 0])


def test_selection_and_joining() -> None:
    flora = support.small_flora()
    tree, contents = divided(flora, support.grove(4, 2.0), 1, "PERSP")
    chosen = np.random.default_rng(0).random(len(tree)) < 0.5
    a, b = contents.within(chosen), contents.within(~chosen)
    both = Contents.joined([a, b])
    assert len(both.pieces.items) == len(contents.pieces)
    assert sorted(both.subplants.items.key) == sorted(contents.subplants.items.key)
    assert chosen[a.pieces.cell].all()
    assert not chosen[b.subplants.cell].any()
    assert len(Contents.joined([]).pieces) == 0


@given(st.integers(0, 2**31))
@settings(deadline=None, max_examples=20)
def test_holdings_give_and_take(seed: int) -> None:
    """Whatever is taken out and put back, in whatever order, everything is there once, with its own totals."""
    flora = support.small_flora()
    tree, contents = divided(flora, support.grove(4, 2.0), 1, "PERSP")
    rng = np.random.default_rng(seed)
    held = Holdings(contents)
    for _ in range(5):
        chosen = rng.random(len(tree)) < rng.choice([0.05, 0.5, 0.95])
        out = held.take_out(chosen)
        assert chosen[out.subplants.cell].all()
        assert chosen[out.pieces.cell].all()
        left = held.contents
        assert not chosen[left.subplants.cell].any()
        assert not chosen[left.pieces.cell].any()
        held.put(out)
    for name in ("subplants", "pieces"):
        whole, found = ((k.items, k.totals) for k in (getattr(c, name) for c in (contents, held.contents)))
        key = [(c[0] if name == "subplants" else c[0].branches).key for c in (whole, found)]
        order = [np.lexsort([c[1].polygons, c[1].wood_area, k]) for c, k in zip((whole, found), key, strict=True)]
        assert (key[0][order[0]] == key[1][order[1]]).all()
        for value in ("leaf_area", "wood_area", "polygons", "width"):
            a, b = (getattr(c[1], value)[o] for c, o in zip((whole, found), order, strict=True))
            assert (a == b).all()


@given(views, st.floats(0.01, 0.5))
@settings(deadline=None, max_examples=8)
def test_what_reaches_a_little_beyond_a_plane_stays_whole(view: tuple[int, str], far: float) -> None:
    """Nothing is lost or doubled, and hardly anything lies further beyond than allowed."""
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    seeds = support.grove(6, 2.0, [0, 1, 0, 0, 1, 0])
    exact, loose = (
        divided(flora, seeds, *view, slack=slack) for slack in (None, lambda points: np.full(len(points), far))
    )
    parts = [measures(flora, expanded(flora, contents)) for _, contents in (exact, loose)]
    assert parts[1] == pytest.approx(parts[0], rel=1e-6)
    tree, contents = loose
    vertices = tree.vertices(contents.pieces.cell)
    middle = (contents.pieces.items.start + contents.pieces.items.end) / 2
    outside = (support.face_planes(vertices)[..., :3] * middle[:, None]).sum(-1) + support.face_planes(vertices)[..., 3]
    # A piece goes where most of it is; what is left of it beyond is within the slack at each of few planes.
    assert (outside.max(axis=1, initial=-1) <= 3 * far).all()
    for one in np.random.default_rng(view[0]).permutation(len(contents.subplants))[:20]:
        meshes = support.meshes(flora, support.expanded(flora, contents.subplants.items.take(one[None])))
        points = np.concatenate([m.positions for group in meshes for m in group]).astype(np.float64)
        planes = support.face_planes(tree.vertices(contents.subplants.cell[one][None]))[0]
        beyond = (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        assert np.quantile(beyond, 0.9) <= 3 * far


def test_bounding_box_holds_all_bounds() -> None:
    flora = support.flora()
    seeds = support.plants(np.arange(6), np.arange(6) % len(support.SPECIES), np.arange(18.0).reshape(6, 3))
    trunk, pieces = support.grown(flora, seeds)
    low, high = bounding_box(flora, trunk)
    for tubes_and_leaves in support.meshes(flora, pieces):
        for mesh in tubes_and_leaves:
            assert (mesh.positions >= low - 1e-5).all()
            assert (mesh.positions <= high + 1e-5).all()


def test_less_is_opened_and_cut_where_a_little_beyond_a_plane_is_allowed() -> None:
    """In one and the same tree, the fewer pieces the more is allowed; from nothing on, which is close to exact."""
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    seeds = support.grove(6, 2.0, [0, 1, 0, 0, 1, 0])
    tree, exact = divided(flora, seeds, 4, "PERSP")
    plants = Contents.of_plants(flora, seeds)
    numbers = [
        len(push_down(flora, tree, plants, lambda points, far=far: np.full(len(points), far)).pieces)
        for far in (0.05, 0.15, 0.45)
    ]
    assert numbers == sorted(numbers, reverse=True)
    assert numbers[-1] < 0.7 * len(exact.pieces.items)
