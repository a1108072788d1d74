# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of plants: consistent topology, outward faces, areas as the model says, nothing lost where parts meet."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.buffers import MeshBuffers, concatenate_buffers
from tetflora_addon.growth.growth import radius_at
from tetflora_addon.leaves.models import LEAF_MODELS
from tetflora_addon.subplants.leaf_meshes import LeafCopies, LeafMesh, leaf_meshes
from tetflora_addon.subplants.pieces import Pieces, expand, whole_pieces, wood_areas
from tetflora_addon.subplants.tubes import tube_buffers, twig_buffers


def check_topology(mesh: MeshBuffers) -> None:
    """Everything that Blender's validation looks at, and no vertex or edge without a face."""
    v, e, c = len(mesh.positions), len(mesh.edge_verts), len(mesh.corner_verts)
    assert mesh.face_offsets[0] == 0
    assert mesh.face_offsets[-1] == c == len(mesh.corner_edges)
    assert (np.diff(mesh.face_offsets) >= 3).all()
    for used, number in ((mesh.corner_verts, v), (mesh.corner_edges, e)):
        uses = np.bincount(used)
        assert len(uses) == number
        assert uses.all()
    following = np.arange(1, c + 1)
    following[mesh.face_offsets[1:] - 1] = mesh.face_offsets[:-1]
    joined = np.stack([mesh.corner_verts, mesh.corner_verts[following]], axis=1)
    assert (np.sort(joined, axis=1) == np.sort(mesh.edge_verts[mesh.corner_edges], axis=1)).all()
    assert (mesh.edge_verts[:, 0] != mesh.edge_verts[:, 1]).all()
    ends = np.sort(mesh.edge_verts.astype(np.int64), axis=1)
    assert (np.diff(np.sort(ends @ [v, 1])) > 0).all()  # no edge is there twice
    assert np.bincount(mesh.corner_edges, minlength=e).max() <= 2
    assert np.isfinite(mesh.positions).all()
    sizes = {"POINT": v, "FACE": mesh.polygons, "CORNER": c}
    for domain, values in mesh.attributes.values():
        assert len(values) == sizes[domain]
        assert values.dtype == np.float32
        assert np.isfinite(values).all()
    for array in (mesh.edge_verts, mesh.corner_verts, mesh.corner_edges, mesh.face_offsets):
        assert array.dtype == np.int32
    assert mesh.positions.dtype == np.float32


def check_attributes(mesh: MeshBuffers) -> None:
    assert set(mesh.attributes) - {"tf_girth", "tf_dull"} == {"UVMap", "tf_color", "tf_transmission"}
    assert mesh.attributes["UVMap"][0] == "CORNER"
    assert mesh.attributes["UVMap"][1].shape[1] == 2
    for name in ("tf_color", "tf_transmission"):
        domain, values = mesh.attributes[name]
        assert domain == "FACE"
        assert values.min() >= 0
        assert values.max() <= 1


@pytest.mark.parametrize("species", range(len(support.SPECIES)), ids=support.SPECIES)
def test_meshes_of_shipped_species(species: int) -> None:
    flora = support.lean()
    _, pieces = support.grown(flora, support.plants([3, 4], species))
    tubes, leaves = support.meshes(flora, pieces)
    assert (not leaves) == (flora.leaf_count[flora.first_row[species]] == 0)
    for mesh in (*tubes, *leaves):
        check_topology(mesh)
        check_attributes(mesh)


def test_tubes_are_open_pipes_that_face_outwards() -> None:
    """Euler number 0 for each; every edge between rings has two faces, rims have one; normals lead from the axis."""
    flora = support.small_flora()
    _, pieces = support.grown(flora, support.plants([1, 2, 3]))
    tubes = support.tube_mesh(flora, pieces)
    branches = int((pieces.t0 == 0).sum())
    assert len(tubes.positions) - len(tubes.edge_verts) + tubes.polygons == 0
    uses = np.bincount(tubes.corner_edges)
    rims = flora.rows["sides"][pieces.branches.row[pieces.t0 == 0]].sum() * 2
    assert (uses == 1).sum() == rims
    assert branches > 50
    assert tubes.smooth
    assert tubes.polygons == flora.rows["sides"][pieces.branches.row].sum()
    for key in pieces.branches.key[pieces.t0 == 0][::3]:
        own = pieces.take(pieces.branches.key == key)
        mesh = support.tube_mesh(flora, own)
        center, normal = support.face_centers(mesh), support.face_vectors(mesh)
        axis = own.end - own.start
        along = np.clip(np.einsum("fni,ni->fn", center[:, None] - own.start, axis) / (axis**2).sum(1), 0, 1)
        apart = center[:, None] - own.start - along[..., None] * axis
        nearest = np.linalg.norm(apart, axis=2).argmin(axis=1)
        assert (np.einsum("fi,fi->f", apart[np.arange(len(center)), nearest], normal) > 0).all()


def test_a_straight_tube_is_a_frustum() -> None:
    """Positive volume, the radii of its ends, the area of its trapezoids."""
    flora = support.compiled({**support.small(order0={"curvature": [0, 0], "angle": [0, 0], "branches": [0, 0]})})
    trunk, pieces = support.grown(flora, support.plants(5))
    mesh = support.tube_mesh(flora, pieces)
    sides, taper = int(flora.rows["sides"][0]), float(flora.rows["taper"][0, 0])
    rings = mesh.positions.reshape(-1, sides, 3)
    radii = np.linalg.norm(rings[..., :2], axis=2)
    heights = rings[..., 2].mean(axis=1)
    for ring in (0, -1):
        expected = trunk.radius[0] * (1 - (1 - taper) * heights[ring] / trunk.length[0])
        np.testing.assert_allclose(radii[ring], expected, rtol=1e-5)
        assert radius_at(flora.rows, trunk, np.array([heights[ring] / trunk.length[0]])) == pytest.approx(expected)
    center, vectors = support.face_centers(mesh), support.face_vectors(mesh)
    lateral = np.einsum("fi,fi->f", center * [1, 1, 0], vectors)
    assert (lateral > 0).all()
    assert support.face_areas(mesh).sum() == pytest.approx(wood_areas(flora, pieces).sum(), rel=1e-3)


def test_area_of_tubes_is_the_area_of_the_wood() -> None:
    """Mitred joints take and give a little, and the curve of a flare is straight between rings."""
    flora = support.described()
    for species in range(len(support.SPECIES)):
        # Of twigs there are too many; stems and limbs are what bends and flares.
        orders = list(islice(expand(flora, support.trunks(flora.rows, support.plants([1, 2], species))), 3))
        area = support.face_areas(tube_buffers(flora, orders)).sum()
        pieces = Pieces.concatenate([whole_pieces(flora.rows, some)[0] for some in orders])
        assert area == pytest.approx(wood_areas(flora, pieces).sum(), rel=0.03)


def test_area_of_leaves_is_that_of_the_model_times_size_squared() -> None:
    flora = support.lean()
    for species in range(len(support.SPECIES)):
        _, pieces = support.grown(flora, support.plants([1], species))
        tips = pieces.take(pieces.t1 == 1)
        owner, _, size = support.leaves_of(flora, tips.branches)
        number, area, single = 0, 0.0, True
        for leaf in support.leaf_forms_of(flora, pieces, species):
            model = flora.forms[species][leaf.kind][leaf.form]
            copies = leaf.buffers.polygons // model.polygons
            assert len(leaf.buffers.positions) == copies * len(model.positions)
            number, area = number + copies, area + support.face_areas(leaf.buffers).sum()
            single &= len(flora.forms[species][leaf.kind]) == 1
        assert number == len(size)
        kind = flora.rows["leaf_kind"][tips.branches.row[owner]]
        every = [np.mean([m.area for m in models]) if models else 0.0 for models in flora.forms[species]]
        expected = (size**2 * np.array(every)[kind]).sum()
        assert area == pytest.approx(expected, rel=1e-4 if single else 0.03)  # forms are drawn by chance


def test_uv_of_leaves_and_bark() -> None:
    flora = support.small_flora()
    _, pieces = support.grown(flora, support.plants(1))
    leaves, tubes = support.leaf_mesh(flora, pieces, 0), support.tube_mesh(flora, pieces)
    number = leaves.polygons // flora.forms[0][0][0].polygons
    assert (leaves.attributes["UVMap"][1] == np.tile(flora.forms[0][0][0].uv, (number, 1))).all()
    quads = tubes.attributes["UVMap"][1].reshape(-1, 4, 2)
    assert (quads[:, [0, 3], 0] < quads[:, [1, 2], 0]).all()  # no face spans the seam backwards
    assert (quads[:, 0, 1] < quads[:, 3, 1]).all()
    assert quads[..., 0].max() == 1


def test_bark_begins_at_the_ground_but_on_stems_beyond_a_fork() -> None:
    """Where materials have moss: v counts girths from the foot, and from 4 m up where a trunk goes on as stems."""
    flora = support.compiled(support.small(order0={"forks": [2, 0], "fork_at": 0.5}))
    _, pieces = support.grown(flora, support.plants(1))
    stems = flora.rows["continues"][pieces.branches.row]
    assert 0 < stems.sum() < len(stems)
    for chosen, meters in ((~stems, 0.0), (stems, 4.0)):
        for branch in np.flatnonzero(chosen)[:8]:
            v = support.tube_mesh(flora, pieces.take(pieces.branches.key == pieces.branches.key[branch]))
            lowest = v.attributes["UVMap"][1][:, 1].min()
            assert lowest * 2.0 * np.pi * pieces.branches.radius[branch] == pytest.approx(meters, abs=1e-3)


def test_one_color_a_branch_and_a_leaf() -> None:
    flora = support.small_flora()
    _, pieces = support.grown(flora, support.plants(1))
    own = pieces.take(pieces.branches.row == 0)
    colors = support.tube_mesh(flora, own).attributes["tf_color"][1]
    assert len(np.unique(colors, axis=0)) == 1
    leaves = support.leaf_mesh(flora, pieces, 0).attributes["tf_color"][1]
    assert len(np.unique(leaves, axis=0)) > 0.9 * len(leaves) / flora.forms[0][0][0].polygons
    low, high = (flora.rows["leaf_color"][1, 0] + s * flora.rows["leaf_color"][1, 1] for s in (-1, 1))
    assert ((leaves >= low - 1e-6) & (leaves <= high + 1e-6)).all()


def test_copies_of_a_seed_are_plants_of_their_own() -> None:
    """Two plants of one seed at different places: twice the mesh of one, each around its own trunk."""
    flora = support.small_flora()
    one, _ = support.meshes(flora, support.grown(flora, support.plants(9))[1])
    both, both_leaves = support.meshes(
        flora, support.grown(flora, support.plants([9, 9], position=[(0, 0, 0), (50, 0, 0)]))[1]
    )
    assert both[0].polygons == 2 * one[0].polygons
    for mesh in (both[0], both_leaves[0]):
        second = mesh.positions[:, 0] > 25
        assert second.sum() * 2 == len(second)
        np.testing.assert_allclose(
            np.sort(mesh.positions[~second, 2]), np.sort(mesh.positions[second, 2]), rtol=0, atol=1e-5
        )


def test_species_of_one_seed_are_plants_of_their_own() -> None:
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    pieces = support.grown(flora, support.plants([9, 9], [0, 1]))[1]
    together = support.tube_mesh(flora, pieces).polygons
    apart = [support.tube_mesh(flora, pieces.take(flora.species_of(pieces.branches.row) == s)).polygons for s in (0, 1)]
    assert together == sum(apart)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("species", ["maple", "cherry_blossom", "scots_pine"])
def test_kites_in_the_place_of_leaves(species: str, share: float) -> None:
    """Each leaf is made once, as it is or in kites of the same area; the more are kites, the same ones."""
    flora = support.compiled({**support.shipped(species), "quality": 0.3})
    whole = support.whole_of(flora, support.grown(flora, support.plants(3, scale=0.5))[1])

    def made(*fractions: float) -> list[LeafMesh]:
        return list(leaf_meshes(flora, 0, [whole], lambda own: (np.full(len(own), f) for f in fractions)))

    def area(meshes: list[LeafMesh]) -> float:
        return sum(halves(mesh.buffers) for mesh in meshes)

    def halves(mesh: MeshBuffers) -> float:
        quads = np.flatnonzero(np.diff(mesh.face_offsets) == 4)  # folded
        a, b, c, d = mesh.positions[mesh.corner_verts[mesh.face_offsets[quads][:, None] + np.arange(4)]].swapaxes(0, 1)
        whole = support.face_areas(mesh).sum() - support.face_areas(mesh)[quads].sum()
        return whole + sum(np.linalg.norm(np.cross(x - a, c - a), axis=1).sum() / 2 for x in (b, d))

    every, some, planes = made(1.0, 0.0, 0.0), made(1.0, share, share), made(1.0, share / 2, share)
    for mesh in (*some, *planes):
        check_topology(mesh.buffers)
    if share == 1.0:
        leaves = sum(m.buffers.polygons // flora.forms[0][m.kind][m.form].polygons for m in every)
        assert sum(m.buffers.polygons for m in some) == leaves
    for kites in (some, planes):
        np.testing.assert_allclose(area(kites), area(every), rtol=0.025)  # faces of models are not flat


def test_twigs_show_what_their_tubes_show() -> None:
    """A triangle has half of the surface, from base to tip; over many, as much is seen from everywhere."""
    flora = support.compiled(support.shipped("birch"))
    pieces = support.grown(flora, support.plants(3, scale=0.3))[1]
    whole = support.whole_of(flora, pieces.take(pieces.branches.row == pieces.branches.row.max()))
    one = np.ones(len(whole), int)
    twigs, tubes = twig_buffers(flora, whole, one, one), tube_buffers(flora, [whole])
    check_topology(twigs)
    check_attributes(twigs)
    assert twigs.polygons == len(whole)
    assert support.face_areas(twigs).sum() == pytest.approx(support.face_areas(tubes).sum() / 2, rel=0.02)
    a, b, c = twigs.positions[twigs.corner_verts].reshape(-1, 3, 3).transpose(1, 0, 2)
    np.testing.assert_allclose((a + b) / 2, whole.branches.position, atol=1e-5)
    uv = twigs.attributes["UVMap"][1].reshape(-1, 3, 2)  # bark runs around the base, and up to the tip
    np.testing.assert_array_equal(uv[:, :, 0], np.tile([0.0, 1.0, 0.5], (len(uv), 1)))
    assert (uv[:, :2, 1] == 0.0).all() and (uv[:, 2, 1] > 0.0).all()
    corners = tubes.positions[tubes.corner_verts].reshape(-1, 4, 3)
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) / 2
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    ours = np.abs(directions @ (np.cross(b - a, c - a) / 2).T).sum(axis=1)
    theirs = np.abs(directions @ across.T).sum(axis=1) / 2
    assert ours.mean() == pytest.approx(theirs.mean(), rel=0.03)
    np.testing.assert_allclose(ours, theirs, rtol=0.15)  # tubes are bent
    assert twig_buffers(flora, whole.take(one[:0]), one[:0], one[:0]) is None


def test_ribbons_follow_twigs_that_bend() -> None:
    """As much area as tubes show, every face near the axis, and no hole between the parts."""
    flora = support.compiled(support.shipped("birch"))
    pieces = support.grown(flora, support.plants(3, scale=0.3))[1]
    whole = support.whole_of(flora, pieces.take(pieces.branches.row == pieces.branches.row.max() - 1))
    parts = np.clip(np.arange(len(whole)) % 5, 1, whole.lines.segments)
    ribbons, tubes = twig_buffers(flora, whole, np.ones(len(whole)), parts), tube_buffers(flora, [whole])
    check_topology(ribbons)
    check_attributes(ribbons)
    assert ribbons.polygons == parts.sum()
    area = support.face_areas(ribbons)
    assert area.sum() == pytest.approx(support.face_areas(tubes).sum() / 2, rel=0.05)
    bent, ends = parts > 1, np.concatenate([whole.lines.knots[:, 0], whole.lines.knots[:, -1]])
    middles = (ribbons.positions[-2 * (parts + 1)[bent].sum() :].reshape(-1, 2, 3)).mean(axis=1)
    away = np.linalg.norm(ends[np.tile(bent, 2)][:, None] - middles[None], axis=2).min(axis=1)
    np.testing.assert_allclose(away, 0.0, atol=1e-5)
    # Bark runs as far up as on a triangle, as fast everywhere.
    alone = twig_buffers(flora, whole.take(bent), *np.ones((2, bent.sum()), int))
    alone = alone.attributes["UVMap"][1].reshape(-1, 3, 2)[:, 2, 1]
    up = ribbons.attributes["UVMap"][1][-4 * parts[bent].sum() :].reshape(-1, 4, 2)[:, :, 1]
    part = np.concatenate([np.arange(number) for number in parts[bent]])
    expected = np.stack([part, part, part + 1, part + 1], axis=1) * np.repeat(alone / parts[bent], parts[bent])[:, None]
    np.testing.assert_allclose(up, expected, rtol=1e-5)


def test_wood_says_how_thick_it_is_at_its_base() -> None:
    """What v counts, on tubes as on twigs: one number for each branch."""
    flora = support.small_flora()
    whole = support.whole_of(flora, support.grown(flora, support.plants(5))[1])
    girth = 2 * np.pi * whole.branches.radius
    rows = flora.rows[whole.branches.row]
    faces_of = rows["sides"] * (rows["segments"] + rows["rings"])
    for mesh, faces in (
        (tube_buffers(flora, [whole]), faces_of),
        (twig_buffers(flora, whole, *np.ones((2, len(girth)), int)), np.ones(len(girth), int)),
    ):
        domain, values = mesh.attributes["tf_girth"]
        assert domain == "FACE"
        np.testing.assert_allclose(np.sort(values), np.sort(np.repeat(girth, faces)), rtol=1e-6)


def test_concatenation() -> None:
    """Parts keep their shape, numbers are offset by what stands before; nothing is made of nothing."""
    flora = support.small_flora()
    _, pieces = support.grown(flora, support.plants(2))
    parts = [support.tube_mesh(flora, pieces.take(pieces.branches.row == row)) for row in range(3)]
    mesh = concatenate_buffers(parts)
    check_topology(mesh)
    assert mesh.smooth
    assert mesh.polygons == sum(p.polygons for p in parts)
    assert mesh.nbytes == sum(p.nbytes for p in parts) - 8  # of the offsets, two ends fewer
    np.testing.assert_array_equal(support.face_areas(mesh), np.concatenate([support.face_areas(p) for p in parts]))
    assert concatenate_buffers([]) is None
    assert concatenate_buffers(parts[:1]) is parts[0]


def test_no_mesh_without_contents() -> None:
    flora = support.small_flora()
    _, pieces = support.grown(flora, support.plants(2))
    assert support.tube_mesh(flora, Pieces.empty()) is None
    assert support.leaf_mesh(flora, Pieces.empty(), 0) is None
    assert support.leaf_mesh(flora, pieces.take(pieces.branches.row == 0), 0) is None
    tubes, leaves = support.meshes(flora, Pieces.empty())
    assert tubes == leaves == []


def test_closed_bodies_are_shaded_smooth_and_meshes_of_the_artist_as_they_are() -> None:
    """Fruit and fleshy leaves are round; blades are flat from afar, and an object keeps its edges."""
    fruit, blade = support.described().forms[support.SPECIES.index("agave")][0][0], LEAF_MODELS["ovate"]
    assert fruit.closed and not blade.closed
    shaded = [LeafCopies(model, 2, 0.0).buffers().smooth for model in (fruit, blade, replace(fruit, textured=True))]
    assert shaded == [True, False, False]
