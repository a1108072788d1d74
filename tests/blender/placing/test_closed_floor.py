# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What grows low closes over the ground, seen from straight above, with all of its polygons.

The grass of Ground Cover does as that of hay meadows: "a dense and continuous carpet of herbs" (Info Flora, Habitats of
Switzerland, TypoCH, 4.5.1, hay meadows of low altitude). That of a wood of birches and pines leaves less than a third
of the ground to what the trees shed.
"""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest
from mathutils.bvhtree import BVHTree

from tests.blender.scenes import add_mesh, add_plant, depsgraph
from tetflora_addon.blender.biomes import library
from tetflora_addon.blender.biomes.adding import add_biome_steps
from tetflora_addon.blender.biomes.files import read_biome
from tetflora_addon.blender.job.plant_mesh import plant_parts, single_seed
from tetflora_addon.blender.placing import populations
from tetflora_addon.blender.placing.cover import cover_steps
from tetflora_addon.blender.scene import fields
from tetflora_addon.blender.species.edits import species_for
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.compiled.flora import compile_species

pytestmark = pytest.mark.usefixtures("clean_file")

#: Side of what is looked at, and how far around it plants may reach into it, meters; rays along the side.
_SEEN, _AROUND, _RAYS = 2.4, 0.7, 60


def _triangles(part: MeshBuffers) -> np.ndarray:
    """Indices (n, 3) of corners, faces cut into fans."""
    first, number = part.face_offsets[:-1], np.diff(part.face_offsets)
    fans = []
    for k in range(1, int(number.max()) - 1):
        some = first[number > k + 1]
        fans.append(part.corner_verts[np.stack([some, some + k, some + k + 1], axis=1)])
    return np.concatenate(fans)


def _tree(read: fields.Seeds, near: np.ndarray) -> BVHTree:
    """Every polygon of some plants of a cover, in three variants of each species."""
    variants = {}
    for kind in np.unique(read.species[near]).tolist():
        name = read.identifiers[kind]
        flora = compile_species([species_for(bpy.context.scene, name)])
        made = ([b for *_, b in plant_parts(flora, single_seed(name, seed))] for seed in range(3))
        variants[kind] = [[(part.positions, _triangles(part)) for part in parts] for parts in made]
    points, polygons, count = [], [], 0
    for plant in near.tolist():
        for positions, triangles in variants[int(read.species[plant])][plant % 3]:
            points.append(positions @ read.frame[plant].T * read.scale[plant] + read.position[plant])
            polygons.append(triangles + count)
            count += len(positions)
    return BVHTree.FromPolygons(np.concatenate(points).tolist(), np.concatenate(polygons).tolist(), all_triangles=True)


def _hidden() -> float:
    """The part of the ground that plants hide from above."""
    bpy.context.view_layer.update()
    (field,) = [o for o in bpy.context.scene.objects if o.tetflora.is_field]
    read = fields.read_field(field, depsgraph(), np.eye(4)[None])
    near = np.flatnonzero((np.abs(read.position[:, :2]) < _SEEN / 2 + _AROUND).all(axis=1))
    tree = _tree(read, near)
    side = (np.arange(_RAYS) + 0.5) / _RAYS * _SEEN - _SEEN / 2
    # Blades that lie below the ground hide nothing.
    hidden = [tree.ray_cast((x, y, 3.0), (0.0, 0.0, -1.0), 3.0)[0] is not None for x in side for y in side]
    return float(np.mean(hidden))


def test_grass_hides_most_of_open_ground() -> None:
    """From 80 to 100 % of it."""
    ground = add_mesh("ground", size=5.0)
    add_plant("far", "birch", 1, (100.0, 0.0, 0.0))
    scene = bpy.context.scene
    cover = populations.add_population(scene, [ground], name="open")
    run_to_end(cover_steps(scene, depsgraph(), cover, grounds=[ground]))
    assert 0.8 <= _hidden() <= 1.0


def test_grass_and_moss_hide_the_floor_of_a_light_wood() -> None:
    """Where the trees leave light; without the trees, so that nothing else hides it."""
    biome = read_biome(library.builtin_folder() / "birch_pine.json")
    (low,) = [layer for layer in biome.layers if layer["kind"] == "cover"]
    ground = add_mesh("ground", size=5.0)
    run_to_end(add_biome_steps(bpy.context.scene, depsgraph(), replace(biome, layers=[low]), [ground]))
    assert _hidden() >= 0.7
