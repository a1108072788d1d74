# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of leaf models: each is the model, turned, scaled and moved; single precision is enough for their frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.growth.foliage import _face_light
from tetflora_addon.leaves.levels import leaf_kites, leaf_levels
from tetflora_addon.leaves.models import LEAF_MODELS
from tetflora_addon.subplants.leaf_meshes import LeafCopies


def frames(number: int, seed: int = 0) -> np.ndarray:
    """Random rotations (n, 3, 3)."""
    turned, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(number, 3, 3)))
    return turned * np.sign(np.linalg.det(turned))[:, None, None]


@pytest.mark.parametrize("name", LEAF_MODELS)
@pytest.mark.parametrize("parts", [[1], [3, 1], [5000, 4001]])
def test_each_copy_is_the_model(name: str, parts: list[int]) -> None:
    """However many are placed at a time."""
    model, number = LEAF_MODELS[name], sum(parts)
    rng = np.random.default_rng(1)
    frame, size = frames(number), rng.uniform(0.01, 0.3, number)
    position, color = rng.normal(size=(number, 3)) * 10, rng.random((number, 3))
    copies = LeafCopies(model, number, 0.25)
    for part in np.split(np.arange(number), np.cumsum(parts)[:-1]):
        copies.add(part.astype(np.uint64), position[part], frame[part].astype(np.float32), size[part], color[part])
    mesh = copies.buffers()

    expected = np.einsum("nij,vj->nvi", frame * size[:, None, None], model.positions) + position[:, None]
    np.testing.assert_allclose(mesh.positions.reshape(expected.shape), expected, atol=1e-5)
    copy = np.arange(number)[:, None]
    edges, edge_of_corner = model.edges
    vertices, corners = len(model.positions), len(model.corner_verts)
    assert (mesh.corner_verts.reshape(number, -1) == model.corner_verts + copy * vertices).all()
    assert (mesh.corner_edges.reshape(number, -1) == edge_of_corner + copy * len(edges)).all()
    assert (mesh.edge_verts.reshape(number, -1) == edges.reshape(-1) + copy * vertices).all()
    assert (mesh.face_offsets[:-1].reshape(number, -1) == model.face_offsets[:-1] + copy * corners).all()
    assert mesh.face_offsets[-1] == number * corners
    assert (mesh.attributes["UVMap"][1].reshape(number, -1) == model.uv.reshape(-1)).all()
    by_copy = mesh.attributes["tf_color"][1].reshape(number, -1, 3)
    np.testing.assert_allclose(by_copy, np.broadcast_to(color[:, None], by_copy.shape), atol=1e-7)
    assert (mesh.attributes["tf_transmission"][1] == np.float32(0.25)).all()


def test_kites_lie_where_their_keys_say() -> None:
    """However many are placed at a time, a copy is one of the model's kites, turned, scaled and moved."""
    kites, number = leaf_kites(LEAF_MODELS["needles"]), 4000
    rng = np.random.default_rng(2)
    frame, size, position = frames(number), rng.uniform(0.01, 0.3, number), rng.normal(size=(number, 3))
    key, color = rng.integers(0, 2**63, number).astype(np.uint64), rng.random((number, 3))
    meshes = []
    for parts in ([number], [1500, 2500]):
        copies = LeafCopies(kites, number, 0.25)
        for part in np.split(np.arange(number), np.cumsum(parts)[:-1]):
            copies.add(key[part], position[part], frame[part].astype(np.float32), size[part], color[part])
        meshes.append(copies.buffers())
    assert (meshes[0].positions == meshes[1].positions).all()
    placed = np.einsum("nij,kvj->nkvi", frame * size[:, None, None], kites.positions) + position[:, None, None]
    off = np.abs(meshes[0].positions.reshape(number, 1, 4, 3) - placed).max(axis=(2, 3))
    assert off.min(axis=1).max() < 1e-5
    taken = np.bincount(off.argmin(axis=1), minlength=len(kites.share)) / number
    np.testing.assert_allclose(taken, np.diff(kites.share, prepend=0.0), atol=0.04)


@given(st.integers(0, 2**31), st.floats(0, 1), st.sampled_from([0.0, 1e-7, 1e-5, 1e-3, 0.1, 2.0]))
@settings(deadline=None, max_examples=60)
def test_single_precision_turns_leaves_to_the_light(seed: int, light: float, tilt: float) -> None:
    """Right-handed frames even where the midrib points at the sky, and where it does not, those of double precision."""
    rng = np.random.default_rng(seed)
    turn, roll = rng.uniform(-np.pi, np.pi, (2, 50))
    zero, one = np.zeros(50), np.ones(50)
    # Midribs that lean from the vertical by the tilt.
    along = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt) * one], axis=1)
    side = np.stack([-np.sin(turn), np.cos(turn), zero], axis=1)
    up = np.cos(roll)[:, None] * side + np.sin(roll)[:, None] * np.cross(along, side)
    frame = np.stack([np.cross(along, up), along, up], axis=2)
    share, sky = np.array([light]), np.array([0.0, 0.0, 1.0])
    exact, single = _face_light(frame, share, sky), _face_light(frame.astype(np.float32), share, sky)
    assert exact.dtype == np.float64
    assert single.dtype == np.float32
    for made in (exact, single):
        np.testing.assert_allclose(made @ made.transpose(0, 2, 1), np.tile(np.eye(3), (50, 1, 1)), atol=2e-4)
        assert (np.linalg.det(made) > 0.99).all()
    np.testing.assert_allclose(single[:, :, 2], exact[:, :, 2], atol=1e-4 / max(1e-2, 1 - light))
    if tilt >= 0.1:
        plain = np.linalg.norm((1 - light) * up + light * sky, axis=1) > 0.1
        blade = along - (along * exact[:, :, 2]).sum(1, keepdims=True) * exact[:, :, 2]
        plain &= np.linalg.norm(blade, axis=1) > 0.1
        np.testing.assert_allclose(single[plain], exact[plain], atol=1e-5)


def test_no_copies_are_a_mesh_without_faces() -> None:
    """Of several forms of leaf, a chunk may have none of one."""
    copies = LeafCopies(LEAF_MODELS["ovate"], 0, 0.4)
    copies.add(np.zeros(0, np.uint64), np.zeros((0, 3)), np.zeros((0, 3, 3), np.float32), np.zeros(0), np.zeros((0, 3)))
    assert copies.buffers().polygons == 0


@given(st.floats(0.01, 0.9), st.floats(0.05, 0.9))
def test_solid_needles_send_on_as_much_light_as_sheets(color: float, transmission: float) -> None:
    """Light that enters a prism meets faces from within until it comes out."""
    level = next(level for level in leaf_levels(LEAF_MODELS["needles"], 4) if level.solid)
    plain = replace(level, again=np.zeros_like(level.again))
    copies = LeafCopies(plain, 1, transmission)
    copies.color[:], copies.done = color, 1
    made = copies.buffers().attributes
    needles = level.again > 0.0
    face = made["tf_color"][1][needles].astype(np.float64)
    through = made["tf_transmission"][1][needles].astype(np.float64)[:, None]
    reflected, entering = (1.0 - through) * face, through * face
    np.testing.assert_allclose(reflected + entering**2 / (1.0 - reflected), color, rtol=1e-3)
    assert (face <= 1.0).all() and (through < 1.0).all()
