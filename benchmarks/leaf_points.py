# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves of the benchmark `leaf_instances`: where those of trees are, and meshes or instances of them there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import pi

import bpy
import numpy as np
from numpy.typing import NDArray

from examples.daylight import add_daylight
from tetflora_addon.blender.job.plant_mesh import single_seed
from tetflora_addon.blender.materials.materials import leaf_material
from tetflora_addon.blender.results.meshes import write_mesh
from tetflora_addon.blender.scene.fields import quaternions
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.leaves.kites import KITE, leaf_kites
from tetflora_addon.leaves.levels import leaf_levels
from tetflora_addon.leaves.models import LeafModel, leaf_model
from tetflora_addon.species import catalog
from tetflora_addon.subplants.leaf_meshes import LeafCopies

from .forest_instances import placing_nodes

SPECIES = "broadleaf_tree"
#: Has a leaf so coarse that the species has none of as few polygons.
COARSE = "beech"
#: Trees of each view, and how far the camera is from their middle, meters.
TREES = {"crown": 1, "stand": 6}
AWAY = {"crown": 9.0, "stand": 90.0}
_APART = 9.0
#: Kites of a twig.
TWIG = 20
TRANSMISSION = 0.4


@dataclass(frozen=True)
class Leaves:
    """Places of leaves: arguments of `LeafCopies.add`."""

    key: NDArray[np.uint64]
    position: NDArray[np.float64]
    frame: NDArray[np.float32]
    size: NDArray[np.float64]
    color: NDArray[np.float64]

    def every(self, step: int) -> Leaves:
        """Every so many-th of them."""
        return Leaves(*(array[::step] for array in self.arrays()))

    def arrays(self) -> tuple[NDArray, ...]:
        """All fields."""
        return self.key, self.position, self.frame, self.size, self.color


def leaves_of(view: str) -> Leaves:
    """All leaves of the trees of a view."""
    flora = compile_species([catalog.load_species(SPECIES)])
    parts = []
    for tree in range(TREES[view]):
        with _noted() as noted:
            for _ in expanded_blocks(flora, single_seed(SPECIES, tree + 1)):
                pass
        key, position, *rest = (np.concatenate(some) for some in zip(*noted, strict=True))
        aside = _APART * (tree - (TREES[view] - 1) / 2)
        parts.append((key, position + [aside, 0.0, 0.0], *rest))
    return Leaves(*(np.concatenate(some) for some in zip(*parts, strict=True)))


@contextmanager
def _noted() -> Iterator[list[tuple[NDArray, ...]]]:
    """What leaves are made of, while the context lasts."""
    noted: list[tuple[NDArray, ...]] = []
    add = LeafCopies.add

    def noting(self: LeafCopies, *given: NDArray) -> None:
        noted.append(given[:5])
        add(self, *given)

    LeafCopies.add = noting
    try:
        yield noted
    finally:
        LeafCopies.add = add


def add_view(scene: bpy.types.Scene, view: str, leaves: Leaves, size: tuple[int, int]) -> None:
    """Camera, sun and sky before leaves."""
    middle = leaves.position.mean(axis=0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = middle - [0.0, AWAY[view], 0.0]
    camera.rotation_euler = (pi / 2, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    add_daylight(scene, elevation=38.0, azimuth=30.0)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    scene.tetflora.refine_at_render = False


def add_leaves(scene: bpy.types.Scene, leaves: Leaves, unit: str, way: str) -> None:
    """The leaves in a scene: as polygons, or as instances of one mesh on points."""
    model, material = model_of(unit, leaves), leaf_material(SPECIES)
    if unit == "twig":
        leaves = leaves.every(TWIG)
    if way == "polygons":
        made = bpy.data.objects.new("Leaves", write_mesh("Leaves", _copies(model, leaves, unit), [material]))
    else:
        one = Leaves(
            np.zeros(1, np.uint64), np.zeros((1, 3)), np.eye(3, dtype=np.float32)[None], np.ones(1), leaves.color[:1]
        )
        mesh = write_mesh("Leaf", _copies(model, one, unit), [_of_instances(material)])
        source = bpy.data.objects.new("Leaf", mesh)  # of no scene: only its instances are rendered
        made = bpy.data.objects.new("Leaves", _points(leaves))
        made.modifiers.new("Instances", 'NODES').node_group = _nodes(source)
    scene.collection.objects.link(made)


def model_of(unit: str, leaves: Leaves) -> LeafModel:
    """A leaf of so many polygons, or a twig of kites."""
    (own,) = catalog.load_species(SPECIES).leaf
    if unit == "twig":
        return _twig(leaves)
    if unit == "1":
        return replace(KITE, positions=leaf_kites(own).positions[0])
    (coarse,) = catalog.load_species(COARSE).leaf
    levels = *leaf_levels(own), *leaf_levels(coarse)
    level = next(level for level in levels if level.model.polygons == int(unit))
    return replace(level.model, positions=level.shapes[0])


def _twig(leaves: Leaves) -> LeafModel:
    """Of all runs of leaves the one that takes least room, as kites, in the space of its first leaf."""
    places = leaves.position
    starts = np.arange(0, len(places) - TWIG, TWIG)
    runs = places[starts[:, None] + np.arange(TWIG)]
    start = int(starts[np.argmin(np.ptp(runs, axis=1).max(axis=1))])
    kite = model_of("1", leaves).positions
    run = slice(start, start + TWIG)
    points = np.einsum("nij,kj->nki", leaves.frame[run] * leaves.size[run, None, None], kite)
    points = (points + places[run, None] - places[start]) @ leaves.frame[start] / leaves.size[start]
    corners = np.arange(len(kite))
    faces = [(corners + number * len(kite)).tolist() for number in range(TWIG)]
    return leaf_model(points.reshape(-1, 3), faces)


def _copies(model: LeafModel, leaves: Leaves, unit: str) -> object:
    copies = LeafCopies(model, len(leaves.size), TRANSMISSION)
    copies.add(*leaves.arrays())
    return replace(copies.buffers(), smooth=unit not in {"1", "twig"})


def _of_instances(material: bpy.types.Material) -> bpy.types.Material:
    """The material of leaves, which reads the color and transmission of instances."""
    own = material.copy()
    for node in own.node_tree.nodes:
        if node.type == 'ATTRIBUTE' and node.attribute_name.startswith("tf_"):
            node.attribute_type = 'INSTANCER'
    return own


def _points(leaves: Leaves) -> bpy.types.Mesh:
    """A vertex for each leaf, with what its instance needs."""
    mesh = bpy.data.meshes.new("Leaves")
    mesh.vertices.add(len(leaves.size))
    mesh.attributes["position"].data.foreach_set("vector", leaves.position.astype(np.float32).ravel())
    turn = quaternions(leaves.frame.astype(np.float64))
    for name, kind, key, values in (
        ("turn", 'QUATERNION', "value", turn),
        ("size", 'FLOAT', "value", leaves.size),
        ("tf_color", 'FLOAT_VECTOR', "vector", leaves.color),
        ("tf_transmission", 'FLOAT', "value", np.full(len(leaves.size), TRANSMISSION)),
    ):
        mesh.attributes.new(name, kind, 'POINT').data.foreach_set(key, values.astype(np.float32).ravel())
    return mesh


def _nodes(source: bpy.types.Object) -> bpy.types.GeometryNodeTree:
    """Vertices in, instances of an object out."""
    tree, leaf, _ = placing_nodes(
        "GeometryNodeObjectInfo", (("turn", 'QUATERNION', "Rotation"), ("size", 'FLOAT', "Scale"))
    )
    leaf.inputs["Object"].default_value = source
    leaf.inputs["As Instance"].default_value = True
    return tree
