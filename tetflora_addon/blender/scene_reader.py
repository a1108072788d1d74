# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read from a scene what refinement needs: camera, plants and what hides them.

Only here does TetFlora loop over objects; what comes out are plain arrays.
"""

from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..plants.hashing import child_key, key_of_seed
from ..plants.seeds import Seeds
from ..refinement.camera import Camera
from .plant_kinds import kind_of, species_of
from .species_items import catalogue
from .surfaces import mesh_triangles
from .transforms import frames_of, world_matrix

_OCCLUDER_REMEDY = (
    "it is marked as hiding plants: make it a mesh with faces, or take the mark away in the sidebar's TetFlora tab"
)
_NAMED = 3  # objects that a message names before it only counts


class NoPlantsError(SceneError):
    """There is nothing to refine; a renderer may pass over it in silence."""


def read_camera(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Camera:
    """The active camera as it is evaluated now.

    ``camera.view_frame`` already knows about lens shift, sensor fit and pixel aspect. A scaled or sheared camera is
    taken without scale and shear, as renderers do.

    Raises
    ------
    SceneError
        No camera, not a camera, panoramic, no extent in depth, or a transform that is not a number.
    """
    if scene.camera is None:
        raise SceneError(
            f'The scene "{scene.name}" has no active camera; add one (Add > Camera) '
            "or choose one in the scene's properties"
        )
    evaluated = scene.camera.evaluated_get(depsgraph)
    name, data = scene.camera.name, evaluated.data
    if scene.camera.type != 'CAMERA':
        raise SceneError(
            f'"{name}" is the scene\'s active camera but not a camera; choose one in the scene\'s properties'
        )
    if data.type not in {'PERSP', 'ORTHO'}:
        raise SceneError(
            f'The camera "{name}" is neither perspective nor orthographic; change its type under Lens in its properties'
        )
    if not 0.0 < data.clip_start < data.clip_end:
        raise SceneError(f'The camera "{name}" sees nothing: make its Clip End larger than its Clip Start')
    corners = np.array(data.view_frame(scene=scene))  # (4, 3), camera space
    picture = corners[:, :2] / -corners[:, 2:] if data.type == 'PERSP' else corners[:, :2]
    (left, bottom), (right, top) = picture.min(axis=0), picture.max(axis=0)
    matrix = world_matrix(scene.camera, depsgraph)
    frame, _, sound = frames_of(matrix[None, :3, :3])
    if not (sound[0] and np.isfinite(matrix).all()):
        raise SceneError(f'The camera "{name}" has scale 0 or no valid position; press Alt S and Alt G on it')
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        # A mirrored camera sees the same pyramid from the other side.
        left, right = -right, -left
    share = scene.render.resolution_percentage / 100.0
    return Camera(
        kind=data.type,
        position=matrix[:3, 3].copy(),
        frame=frame[0],
        window=(float(left), float(right), float(bottom), float(top)),
        near=float(data.clip_start),
        far=float(data.clip_end),
        width=max(int(scene.render.resolution_x * share), 1),
        height=max(int(scene.render.resolution_y * share), 1),
    )


def read_plants(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, view_layer: bpy.types.ViewLayer) -> Seeds:
    """Enabled plants of a view layer that render, sorted by name.

    Plants in instanced collections take part; each instance becomes an individual of its own. Of a plant's transform
    the direction of its z axis and the azimuth of its x axis are kept, and the mean of the absolute scales: plants are
    neither stretched nor mirrored.

    Raises
    ------
    NoPlantsError
        No plant is left; the message says how to get some.
    SceneError
        A species that the catalogue does not have, a scale of 0, or a transform that is not a number; the message names
        the objects.
    """
    names: list[str] = []
    identifiers: list[str] = []
    seeds: list[int] = []
    matrices: list[NDArray[np.float64]] = []
    found_any = False
    for obj in sorted(renderable_objects(view_layer), key=lambda o: o.name_full):
        group = obj.tetflora
        if group.is_plant:
            found_any = True
            if group.enabled:
                names.append(obj.name)
                identifiers.append(kind_of(obj))
                seeds.append(group.seed)
                matrices.append(world_matrix(obj, depsgraph))
    if any(o.is_instancer for o in view_layer.objects):
        for obj, seed, matrix in _instances(depsgraph):
            names.append(obj.name)
            identifiers.append(kind_of(obj))
            seeds.append(seed)
            matrices.append(matrix)
    if not names:
        raise NoPlantsError(
            "All plants of the scene are switched off; enable some in the sidebar's TetFlora tab"
            if found_any
            else "No plants are there to render; add some with Add > TetFlora Plant or with Populate "
            "in the sidebar's TetFlora tab"
        )
    _check_species(names, identifiers)
    transforms = np.array(matrices)
    frame, scale, sound = frames_of(transforms[:, :3, :3])
    sound &= np.isfinite(transforms).all(axis=(1, 2))
    if not sound.all():
        bad = [names[i] for i in np.flatnonzero(~sound)]
        raise SceneError(f"{_listed(bad)}: scale 0 or no valid position; give a scale above 0 (Alt S resets it)")
    kinds, species = np.unique(np.array(identifiers), return_inverse=True)
    return Seeds(
        identifiers=tuple(str(kind) for kind in kinds),
        species=species.astype(np.int32).reshape(-1),
        seed=np.array(seeds, dtype=np.int64),
        position=transforms[:, :3, 3].copy(),
        frame=frame,
        scale=scale,
    )


def read_occluders(
    _scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, view_layer: bpy.types.ViewLayer | None = None
) -> NDArray[np.float64]:
    """Triangles of all meshes of a view layer that are marked as hiding plants and render.

    Parameters
    ----------
    view_layer : bpy.types.ViewLayer or None
        None takes the one that the depsgraph was made for.

    Returns
    -------
    (t, 3, 3) float64
        Corners in world space, metres; ``(0, 3, 3)`` if there are none.

    Raises
    ------
    SceneError
        One of them has no faces or is no longer a mesh.
    """
    marked = [o for o in renderable_objects(view_layer or depsgraph.view_layer) if o.tetflora.is_occluder]
    marked.sort(key=lambda o: o.name_full)
    return np.concatenate([np.zeros((0, 3, 3)), *(mesh_triangles(o, depsgraph, _OCCLUDER_REMEDY) for o in marked)])


def renderable_objects(view_layer: bpy.types.ViewLayer) -> Iterator[bpy.types.Object]:
    """Objects of a view layer that render: neither they nor all of their collections are hidden in renders."""
    seen: set[int] = set()
    open_layers = [view_layer.layer_collection]
    while open_layers:
        layer = open_layers.pop()
        if layer.exclude or layer.collection.hide_render:
            # Children of an excluded collection can be included again, those of a hidden one cannot be shown.
            open_layers += [] if layer.collection.hide_render else list(layer.children)
            continue
        open_layers += list(layer.children)
        for obj in layer.collection.objects:
            if not obj.hide_render and (pointer := obj.as_pointer()) not in seen:
                seen.add(pointer)
                yield obj


def has_plants(scene: bpy.types.Scene) -> bool:
    """Whether a scene may hold plants; cheap, and never wrong where there are some."""
    return any(o.tetflora.is_plant or o.is_instancer for o in scene.objects)


def _instances(depsgraph: bpy.types.Depsgraph) -> Iterator[tuple[bpy.types.Object, int, NDArray[np.float64]]]:
    for instance in depsgraph.object_instances:
        if instance.is_instance and instance.show_self:
            obj = instance.object
            group = obj.tetflora
            if group.is_plant and group.enabled and not obj.hide_render:
                # Copies of a plant shall not be the same individual: the instance's own number joins the seed.
                key = child_key(key_of_seed(group.seed), instance.random_id & 0xFFFFFFFF)
                yield obj.original, int(key.view(np.int64)), np.array(instance.matrix_world)


def _check_species(names: list[str], identifiers: list[str]) -> None:
    known = catalogue()
    bad = [i for i, identifier in enumerate(identifiers) if species_of(identifier) not in known]
    if bad:
        species = species_of(identifiers[bad[0]])
        same = [names[i] for i in bad if species_of(identifiers[i]) == species]
        raise SceneError(
            f'{_listed(same)}: unknown species "{species}"; choose another in the sidebar\'s TetFlora tab, or put '
            f"{species or 'its file'}{'.json' if species else ''} into the species folder named in the preferences"
        )


def _listed(names: list[str]) -> str:
    text = ", ".join(f'"{name}"' for name in names[:_NAMED])
    return text if len(names) <= _NAMED else f"{text} and {len(names) - _NAMED} more"
