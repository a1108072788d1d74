# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees and woods of the benchmark `assets` are what they say."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
import pytest

from benchmarks import asset_trees, assets
from devtools import session


@pytest.fixture(autouse=True)
def clean() -> Iterator[None]:
    session.clean_file()
    yield
    session.clean_file()


def _positions(mesh: bpy.types.Mesh) -> np.ndarray:
    found = np.zeros((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", found.ravel())
    return found


@pytest.mark.parametrize("kind", asset_trees.KINDS)
def test_tree_is_valid_and_about_twelve_meters_high(kind: str) -> None:
    mesh = asset_trees.make(kind, quick=True).data
    assert not mesh.validate()
    low, high = _positions(mesh).min(axis=0), _positions(mesh).max(axis=0)
    assert 11.0 < high[2] < 13.0 and -0.2 < low[2] < 0.0
    assert np.all(high[:2] - low[:2] < 12.0)
    assert len(mesh.uv_layers) == 1 and all(mesh.materials)


def test_leafy_tree_has_as_many_triangles_as_asked_for() -> None:
    mesh = asset_trees.leafy("Tree", 200_000).data
    assert 0 <= 200_000 - len(mesh.polygons) < 16
    assert len(mesh.loops) == 3 * len(mesh.polygons)


def test_closed_leaves_are_closed() -> None:
    rng = np.random.default_rng(1)
    twigs = asset_trees.branches(asset_trees.ORDERS[:2], rng)[-1]
    places = asset_trees.stalks(twigs, 50, rng)
    made = asset_trees.closed_leaves(places, np.tile([0.1, 0.06], (50, 1)))
    assert len(made.triangles) == 50 * 16
    edges = np.concatenate([made.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    ahead = {tuple(edge) for edge in edges.tolist()}
    # Each edge once in each direction: closed, and all triangles turn the same way.
    assert len(ahead) == len(edges) and ahead == {(b, a) for a, b in ahead}
    a, b, c = (made.positions[made.triangles[:, i]] for i in range(3))
    assert (np.cross(a, b) * c).sum() / 6 > 0  # the volume: outward


def test_cards_are_quads_with_holes_in_a_texture_whose_color_varies() -> None:
    tree = asset_trees.make("cards")
    mesh = tree.data
    sides = np.zeros(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", sides)
    assert (sides == 4).sum() == asset_trees.CARDS and mesh.polygons[-1].material_index == 1
    areas = np.zeros(len(sides), np.float32)
    mesh.polygons.foreach_get("area", areas)
    assert np.sqrt(areas[sides == 4]).min() > 0.25 and np.sqrt(areas[sides == 4]).max() < 0.55
    image = bpy.data.images["Sprigs"]
    assert tuple(image.size) == (1024, 1024)
    pixels = np.zeros(1024 * 1024 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    tiles = pixels.reshape(2, 512, 2, 512, 4).swapaxes(1, 2).reshape(4, -1, 4)
    assert np.all((tiles[:, :, 3].mean(axis=1) > 0.15) & (tiles[:, :, 3].mean(axis=1) < 0.7))
    means = np.array([tile[tile[:, 3] > 0.5, :3].mean(axis=0) for tile in tiles])
    assert np.all(np.diff(means[:, 0]) > 0.03)


@pytest.mark.parametrize("instances", [1, 10, 400])
def test_scatter_shows_exactly_so_many(instances: int) -> None:
    scene = bpy.context.scene
    wanted = assets.Scatter(instances=instances, quick=True)
    instancer = assets.build(scene, wanted)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = np.array([np.array(i.matrix_world) for i in depsgraph.object_instances if i.is_instance])
    assert len(found) == instances
    assert len(instancer.evaluated_get(depsgraph).data.polygons) == len(instancer.data.polygons)  # the ground stays
    assert found[:, 1, 3].min() > 0.0
    scale = np.linalg.norm(found[:, :3, :3], axis=1)
    assert (np.linalg.det(found[:, :3, :3]) > 0).all() and np.allclose(scale, scale[:, :1], rtol=1e-5)
    assert scale.min() > 0.69 and scale.max() < 1.31
