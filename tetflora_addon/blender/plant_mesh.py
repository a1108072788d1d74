# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Single plants as ordinary meshes, wood and leaves in one: for the species preview, and for artists to keep."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from .. import emission
from ..buffers import MeshBuffers
from ..errors import SceneError
from ..plants.compiled import Flora
from ..plants.growth import trunks
from ..plants.meshing import concatenate_buffers
from ..plants.seeds import Seeds
from . import job
from .materials import bark_material, leaf_material
from .meshes import write_mesh
from .transforms import frames_of, world_matrix

#: Polygons that are made at once at most; more would fill the memory of most computers.
MOST_POLYGONS = 30_000_000

_UPRIGHT = np.eye(3)


def single_seed(identifier: str, seed: int, frame: NDArray[np.float64] = _UPRIGHT) -> Seeds:
    """One plant at the origin, of scale 1; its leaves turn to the sky, so that its tilt (3, 3) matters."""
    return Seeds(
        identifiers=(identifier,),
        species=np.zeros(1, np.int32),
        seed=np.array([seed], dtype=np.int64),
        position=np.zeros((1, 3)),
        frame=np.array(frame)[None],
        scale=np.ones(1),
    )


def expected_polygons(flora: Flora, seeds: Seeds) -> float:
    """Faces that plants will have, about."""
    return float(flora.polygons[trunks(flora.rows, seeds).row].sum())


def plant_buffers(flora: Flora, seeds: Seeds) -> list[tuple[str, MeshBuffers]]:
    """All polygons of one plant at the origin, in its own space, by kind: ``'bark'``, ``'leaf'``."""
    frame = seeds.frame[0].astype(np.float32)
    parts: dict[str, list[MeshBuffers]] = {}
    for block in emission.expanded_blocks(flora, seeds):
        parts.setdefault(block.kind, []).append(block.buffers)
    joined = [(kind, concatenate_buffers(buffers)) for kind, buffers in sorted(parts.items())]
    # Row vectors times the frame are turned back by it.
    return [(kind, replace(b, positions=b.positions @ frame)) for kind, b in joined if b is not None]


def plant_mesh(name: str, species_name: str, parts: list[tuple[str, MeshBuffers]]) -> bpy.types.Mesh:
    """One mesh of the parts of a plant, with a material for each kind.

    Parameters
    ----------
    name : str
        Of the datablock.
    species_name : str
        Materials are the species' own, as Refine makes them.
    parts : list of (kind, MeshBuffers)
        What `plant_buffers` gives.

    Returns
    -------
    bpy.types.Mesh
        In the space of the plant. Wood is shaded smooth, leaves flat.
    """
    numbered = []
    for slot, (_, buffers) in enumerate(parts):
        index = np.full(buffers.polygons, slot, dtype=np.int32)
        attributes = {**buffers.attributes, "material_index": ("FACE", index)}
        numbered.append(replace(buffers, attributes=attributes, smooth=True))
    whole = concatenate_buffers(numbered)
    if whole is None:
        raise SceneError(f'A plant of "{species_name}" has neither branches nor leaves')
    materials = [(leaf_material if kind == "leaf" else bark_material)(species_name) for kind, _ in parts]
    mesh = write_mesh(name, whole, materials)
    sharp = np.repeat([not buffers.smooth for _, buffers in parts], [buffers.polygons for _, buffers in parts])
    if sharp.any():
        mesh.attributes.new("sharp_face", 'BOOLEAN', 'FACE').data.foreach_set("value", sharp)
    return mesh


def make_plant_meshes(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, plants: Iterable[bpy.types.Object]
) -> list[bpy.types.Object]:
    """Make ordinary mesh objects of plants, in their places and collections; the plants are disabled, not deleted.

    Parameters
    ----------
    scene : bpy.types.Scene
        Whose edited species and leaf objects count.
    depsgraph : bpy.types.Depsgraph
        Says where the plants are.
    plants : iterable of bpy.types.Object
        Plants; each gives an object of its own, whose mesh nobody shares.

    Raises
    ------
    TetFloraError
        A species or place that cannot be used, or too many polygons; nothing is made then.
    """
    plants = list(plants)
    frame, scale, sound = frames_of(np.array([world_matrix(p, depsgraph)[:3, :3] for p in plants]).reshape(-1, 3, 3))
    for plant, good in zip(plants, sound, strict=True):
        if not good:
            raise SceneError(f'"{plant.name}": scale 0 or no valid position; give a scale above 0 (Alt S resets it)')
    floras = {p.tetflora.species: job.compile_for((p.tetflora.species,), scene, depsgraph) for p in plants}
    seeds = [single_seed(p.tetflora.species, p.tetflora.seed, f) for p, f in zip(plants, frame, strict=True)]
    polygons = sum(expected_polygons(floras[s.identifiers[0]], s) for s in seeds)
    if polygons > MOST_POLYGONS:
        raise SceneError(
            f"{len(plants):,} plants have some {polygons:,.0f} polygons, more than {MOST_POLYGONS:,}; select fewer"
        )
    made = []
    for number, (plant, seed) in enumerate(zip(plants, seeds, strict=True)):
        flora = floras[plant.tetflora.species]
        mesh = plant_mesh(f"{plant.name} mesh", flora.species[0].name, plant_buffers(flora, seed))
        obj = bpy.data.objects.new(mesh.name, mesh)
        for collection in plant.users_collection:
            collection.objects.link(obj)
        place = Matrix((frame[number] * scale[number]).tolist()).to_4x4()
        place.translation = world_matrix(plant, depsgraph)[:3, 3].tolist()
        if plant.parent is not None:  # what carries the plant carries its mesh
            obj.parent = plant.parent
            obj.parent_type, obj.parent_bone = plant.parent_type, plant.parent_bone
            obj.matrix_parent_inverse = plant.matrix_parent_inverse
        obj.matrix_world = place
        plant.tetflora.enabled = False
        made.append(obj)
    return made
