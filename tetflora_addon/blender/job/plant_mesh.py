# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Single plants as ordinary meshes with branches and leaves: for the species preview and for Convert to Meshes."""

from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np
from mathutils import Matrix

from ...arrays import Floats
from ...buffers import MeshBuffers, concatenate_buffers
from ...compiled.flora import Flora
from ...emission.budget import coarse_faces
from ...emission.plants import expanded_blocks
from ...errors import SceneError
from ...growth.seeds import Seeds
from ...jobs import Job, Progress
from ...species.species import Species
from ..attributes import write
from ..results.hiding import artists_flags
from ..results.leaf_objects import leaf_objects, materials_of
from ..results.meshes import write_mesh
from ..results.output import remove_made
from ..runtime import JobData, is_there, job
from ..scene.ages import classed
from ..scene.fields import stored_ages
from ..scene.looks import LIKE, look_like
from ..scene.plants import single_plants
from ..scene.skeletons import kind_of
from ..worker import call_in_thread
from .contents import check_fits, compile_for, in_year, memory_left

_UPRIGHT = np.eye(3)


def single_seed(identifier: str, seed: int, frame: Floats = _UPRIGHT) -> Seeds:
    """One plant at the origin, of scale 1; its frame (3, 3) matters because leaves turn to the sky."""
    fields = {"seed": np.array([seed], dtype=np.int64), "frame": np.array(frame)[None]}
    return replace(Seeds.upright(1), identifiers=(identifier,), **fields)


#: Polygons of a plant with the same materials: ``'bark'``, ``'leaf'`` or ``'blossom'``; form of leaf; buffers.
Part = tuple[str, int, MeshBuffers]


def plant_parts(flora: Flora, seeds: Seeds) -> list[Part]:
    """All polygons of one plant at the origin, in its own space."""
    frame = seeds.frame[0].astype(np.float32)
    pieces: dict[tuple[str, int], list[MeshBuffers]] = {}
    for block in expanded_blocks(flora, seeds):
        pieces.setdefault((block.kind, block.form), []).append(block.buffers)
    joined = [(*what, concatenate_buffers(buffers)) for what, buffers in sorted(pieces.items())]
    # Row vectors times the frame are rotated back.
    return [(kind, form, replace(b, positions=b.positions @ frame)) for kind, form, b in joined if b is not None]


def plant_mesh(scene: bpy.types.Scene, name: str, species: Species, parts: list[Part]) -> bpy.types.Mesh:
    """One mesh of the parts of a plant (`plant_parts`) with the materials of Refine; wood is smooth, leaves flat."""
    numbered, materials = [], []
    for kind, form, buffers in parts:
        _, index = buffers.attributes.get("material_index", ("", np.zeros(buffers.polygons, dtype=np.int32)))
        attributes = {**buffers.attributes, "material_index": ("FACE", index + np.int32(len(materials)))}
        numbered.append(replace(buffers, attributes=attributes, smooth=True))
        materials += materials_of(scene, species, kind, form)
    whole = concatenate_buffers(numbered)
    if whole is None:
        raise SceneError(f'A plant of "{species.name}" has no branches or leaves; edit the species')
    mesh = write_mesh(name, whole, materials)
    sharp = np.repeat([not b.smooth for *_, b in parts], [b.polygons for *_, b in parts])
    if sharp.any():
        write(mesh, "sharp_face", sharp, 'FACE')
    return mesh


@job("Convert Plants to Meshes")
def make_plant_mesh_steps(data: JobData, plants: Iterable[bpy.types.Object]) -> Job[list[bpy.types.Object]]:
    """Make a mesh object of each plant, in their order, places and collections; they are disabled, not deleted.

    A step for each plant; closing the generator early removes what was made.

    Raises
    ------
    TetFloraError
        An invalid species or transform, or too many polygons; nothing is made.
    """
    scene, depsgraph, plants = data.scene, data.depsgraph, list(plants)
    data.add_objects([*plants, *leaf_objects(scene).values()])
    placed, ages = single_plants(plants, depsgraph), stored_ages(plants)
    seeds = [single_seed(kind_of(p), p.tetflora.seed, f) for p, f in zip(plants, placed.frame, strict=True)]
    each = [None] * len(plants) if ages is None else ages.reshape(-1, 1)
    seeds = [aged for _, aged in classed(scene, [("", s, age, None) for s, age in zip(seeds, each, strict=True)])]
    kinds = dict.fromkeys(s.identifiers[0] for s in seeds)
    floras = {kind: in_year(scene, compile_for((kind,), scene, depsgraph)) for kind in kinds}
    faces = sum(coarse_faces(floras[s.identifiers[0]], s) for s in seeds)
    what = "A mesh of a plant" if len(plants) == 1 else f"Meshes of {len(plants):,} plants"
    check_fits(what, faces, memory_left(scene), "or select fewer plants")
    objects, data_made, switched = [], [], []
    whole = False
    try:
        for number, (plant, seed) in enumerate(zip(plants, seeds, strict=True)):
            progress = Progress(number / len(plants), f"mesh {number + 1:,} of {len(plants):,}")
            yield progress
            flora = floras[seed.identifiers[0]]
            parts = yield from call_in_thread(progress, plant_parts, flora, replace(seed, scale=np.ones(1)))
            data.check()  # it may have waited for the thread meanwhile
            mesh = plant_mesh(scene, f"{plant.name} mesh", flora.species[0], parts)
            data_made += [mesh, *mesh.materials]
            size = placed.scale[number] * seed.scale[0]
            objects.append(_placed(mesh, plant, placed.frame[number] * size, placed.position[number]))
            data.add("a mesh that it made", objects[-1], mesh)
            if plant.tetflora.enabled:
                plant.tetflora.enabled = False
                switched.append(plant)
        whole = True
    finally:
        if not whole:
            bpy.data.batch_remove([obj for obj in objects if is_there(obj)])
            remove_made(data_made)
            for plant in filter(is_there, switched):
                plant.tetflora.enabled = True
    return objects


def _placed(mesh: bpy.types.Mesh, plant: bpy.types.Object, frame: Floats, position: Floats) -> bpy.types.Object:
    """An object of a plant's mesh with the plant's look and collections, at its place (3,) with its axes (3, 3)."""
    obj = bpy.data.objects.new(mesh.name, mesh)
    for collection in plant.users_collection:
        collection.objects.link(obj)
    if plant.parent is not None:
        obj.parent = plant.parent
        obj.parent_type, obj.parent_bone = plant.parent_type, plant.parent_bone
        obj.matrix_parent_inverse = plant.matrix_parent_inverse
    place = Matrix(frame.tolist()).to_4x4()
    place.translation = position.tolist()
    obj.matrix_world = place
    look_like(obj, plant)
    del obj[LIKE]  # it is the artist's
    obj.hide_render, obj.hide_viewport = artists_flags(plant)
    return obj
