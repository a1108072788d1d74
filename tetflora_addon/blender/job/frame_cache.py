# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame cache: results of a render that later frames use again, found by a digest of all that they depend on.

A frame with an earlier digest gets its results back; the least recently used go first. The camera counts by its cell.
"""

import hashlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace

import bpy
import numpy as np
from bpy.types import Depsgraph, PropertyGroup, Scene, ViewLayer

from ...camera.camera import Camera
from ...camera.view_cells import Around, ViewCells, cell_camera
from ...growth.seeds import farthest
from ...species.kinds import species_of
from ..assets.marks import reach_of
from ..assets.places import digest_of
from ..attributes import is_animated
from ..compat import drawn_disc
from ..materials.snow import has_snow
from ..preferences import preferences
from ..results.hiding import hidden_originals, hide_originals, name_of, object_named, show_originals
from ..results.leaf_objects import brought_materials
from ..results.output import MEGABYTES, REPLACED, megabytes_held, remove_collection, result_collections
from ..results.proxies import shade_again
from ..scene.ages import kind_species
from ..scene.camera import read_camera
from ..settings import season_of, wind_of, years_of
from ..species.asset_species import asset_species
from ..species.edits import species_for
from .contents import SceneContents, load_for, memory_left, read_scene, settings_from

_CHOICES = ("proxy_kind", "baked_light", "expand_everything", "asset_detail")
#: Settings of a scene that results do not depend on.
_IGNORED = {"statistics", "share_frames", "cell_length", "cell_turn"}
_IGNORED |= {"refine_at_render", "auto_refine", "follow_viewport"}
#: Memory that a renderer takes of results, over what these take in Blender (`budget.BYTES_PER_POLYGON`).
_RENDERED = 4.5


@dataclass
class _Entry:
    """Results of one digest; names, because references are invalid after a file is loaded."""

    scene: int  # its number in this session: scenes of a sequencer are rendered while another one is
    collection: str
    originals: list[tuple[str, str]]
    statistics: str


#: By digest, least recently used first.
_entries: dict[str, _Entry] = {}


def scene_digest(
    scene: Scene, depsgraph: Depsgraph, camera: Camera | None = None, given: SceneContents | None = None
) -> str:
    """Digest of camera, plants, meshes, assets, occluders, lights, settings, species, materials, day and wind.

    In the wind it changes with each frame. The camera is the scene's, and the contents are read, if none are given.

    Raises
    ------
    TetFloraError
        The scene cannot be refined as it is.
    """
    if given is None:
        given = read_scene(scene, depsgraph)
    content = hashlib.sha256()
    explicit = ()
    if given.explicit is not None:
        meshes = given.explicit.meshes
        slots = [[getattr(material, "name_full", "") for material in slots] for slots in given.explicit.materials]
        explicit = meshes.surfaces, meshes.surface, meshes.linear, meshes.origin, slots
    species = load_for(given.species, scene, depsgraph) if given.species else []
    targets = {target: digest_of(target, depsgraph) for target in dict.fromkeys(one.target for one in given.places)}
    places = [
        (targets[p.target], [o.name_full for o in p.owners], p.matrices, p.keys, given.looks[p.owner])
        for p in given.places
    ]
    parts = camera or read_camera(scene, depsgraph), given.seeds, given.occluders, given.lights, given.sources, explicit
    brought = [brought_materials(scene, identifier) for identifier in given.species]
    for part in (*parts, places, choices(scene), species, brought):
        add_to_digest(content, part)
    return content.hexdigest()


def choices(scene: Scene) -> list:
    """Settings of a scene in its digest, without any object; cheap enough for every change."""
    group = scene.tetflora
    materials = [(e.species, *(getattr(getattr(e, k), "name", "") for k in REPLACED)) for e in group.output.species]
    chosen = [getattr(group, name) for name in _CHOICES]
    assets = [(k, (a.object or a.collection).name_full, a.variants) for k, a in asset_species(scene).items()]
    # Snow follows its number by itself, once it is there.
    season = season_of(scene)
    moment = wind_of(scene), season and replace(season, snow=float(has_snow(scene))), years_of(scene)
    return [settings_from(scene), chosen, materials, assets, *moment, drawn_disc(scene.render.engine)]


def add_to_digest(content: "hashlib._Hash", value: object) -> None:
    """Add a number, text or array to a digest, or a sequence, mapping or dataclass of these."""
    if isinstance(value, np.ndarray):
        content.update(f"{value.dtype}{value.shape}".encode())
        content.update(np.ascontiguousarray(value) if value.dtype != object else repr(value.tolist()).encode())
    elif is_dataclass(value):
        for field in fields(value):
            content.update(field.name.encode())
            add_to_digest(content, getattr(value, field.name))
    elif isinstance(value, list | tuple):
        content.update(f"{len(value)}:".encode())
        for item in value:
            add_to_digest(content, item)
    elif isinstance(value, Mapping):
        add_to_digest(content, [part for item in value.items() for part in item])
    else:
        content.update(f"{value!r};".encode())  # or 1, 11 would be 11, 1


def shared_camera(scene: Scene, depsgraph: Depsgraph, given: SceneContents | None = None) -> Camera:
    """The active camera, or the one of its cell if it moves and the scene shares results between frames.

    Cells are larger where the contents given are far from them. Errors are those of `scene.camera.read_camera`.
    """
    camera, settings = read_camera(scene, depsgraph, region_only=True), scene.tetflora
    if not (settings.share_frames and camera_moves(scene)) or wind_of(scene) is not None:
        return camera  # in the wind, no two frames are equal
    around = None if given is None else _around(scene, depsgraph, given)
    return cell_camera(camera, ViewCells(settings.cell_length, settings.cell_turn), around) or camera


def _around(scene: Scene, depsgraph: Depsgraph, given: SceneContents) -> Around:
    """Spheres around meshes and assets, and around plants with all branches on the way to the last twig."""
    seeds, meshes = given.seeds, None if given.explicit is None else given.explicit.meshes
    # Lengths are in meters for trunks, and in those of their parents for all others.
    grown = [kind_species(species_for(scene, species_of(kind)), kind, years_of(scene)) for kind in seeds.identifiers]
    orders = [species.orders for species in grown]
    heights = np.array([np.cumprod([order.length.mean for order in generations]).sum() for generations in orders])
    centers, radii = [seeds.position], [heights[seeds.species] * seeds.scale * farthest(seeds.crown)]
    if meshes is not None:
        reach = [np.linalg.norm(surface.positions, axis=1).max() for surface in meshes.surfaces]
        centers.append(meshes.origin)
        radii.append(np.array(reach)[meshes.surface] * meshes.largest)
    reaches = {target: reach_of(target, depsgraph) for target in dict.fromkeys(one.target for one in given.places)}
    for one in given.places:
        centers.append(one.matrices[:, :3, 3])
        radii.append(reaches[one.target] * np.linalg.norm(one.matrices[:, :3, :3], axis=1).max(axis=1))
    return Around(np.concatenate(centers), np.concatenate(radii))


def camera_moves(scene: Scene) -> bool:
    """Whether anything in the file, whichever frames are rendered, may move a scene's camera or change its lens."""
    carrier = scene.camera
    if carrier is not None and is_animated(carrier.data):
        return True
    while carrier is not None:
        if is_animated(carrier) or any(not constraint.mute for constraint in carrier.constraints):
            return True
        carrier = carrier.parent
    return False


def key_of(
    scene: Scene, depsgraph: Depsgraph, layers: Sequence[ViewLayer], camera: Camera, contents: SceneContents
) -> str:
    """Digest of all that results for view layers, a camera and contents depend on; errors as of `scene_digest`."""
    content = hashlib.sha256(scene_digest(scene, depsgraph, camera, contents).encode())
    add_to_digest(content, [scene.name, *(layer.name for layer in layers)])
    for group in (scene.tetflora, scene.tetflora.output, *scene.tetflora.output.species):
        add_to_digest(content, _values(group))
    return content.hexdigest()


def _values(group: PropertyGroup) -> list[object]:
    """Values of a scene's settings, except groups: `scene_digest` has those that matter."""
    values: list[object] = []
    for prop in group.bl_rna.properties:
        name = prop.identifier
        shows_others = prop.type == 'ENUM' and prop.is_enum_flag
        if name not in _IGNORED and prop.type not in {'POINTER', 'COLLECTION'} and not shows_others:
            value = getattr(group, name)
            values.append((name, list(value) if getattr(prop, "is_array", False) else value))
    return values


def stow(scene: Scene, wanted: Collection[str]) -> None:
    """Unlink results of a render from a scene unless they are wanted for its frame."""
    stay = {_entries[key].collection for key in wanted if key in _entries}
    away = [c for c in result_collections(scene, 'RENDER') if c.name not in stay]
    if away or len(result_collections(scene, 'RENDER')) < len(wanted):
        show_originals(scene, 'RENDER')
    known = {entry.collection for entry in _entries.values()}
    for collection in away:
        if collection.name in known:
            scene.collection.children.unlink(collection)
        else:
            remove_collection(scene, collection)


def recall(scene: Scene, key: str) -> bpy.types.Collection | None:
    """Link results of a digest to a scene again; None if there are none."""
    entry = _entries.pop(key, None)
    collection = bpy.data.collections.get((entry.collection, None)) if entry is not None else None
    if collection is None:
        return None
    _entries[key] = entry  # most recently used
    if collection.name not in scene.collection.children:
        scene.collection.children.link(collection)
    shade_again(scene, collection)
    if scene.tetflora.statistics != entry.statistics:  # or the scene would count as changed
        scene.tetflora.statistics = entry.statistics
    return collection


def store(scene: Scene, key: str, collection: bpy.types.Collection, camera: Camera) -> None:
    """Add new results of a scene, and remove the least recently used ones beyond the limit.

    Where the renderer of a camera's picture needs their memory, these are all that are not shown.
    """
    originals = [name_of(o) for o in hidden_originals(scene, 'RENDER')]
    _entries[key] = _Entry(scene.session_uid, collection.name, originals, scene.tetflora.statistics)
    wind = wind_of(scene)
    # In a wind without a loop no frame returns.
    prefs = preferences()
    kept = prefs.kept_memory if prefs is not None else 1.0
    limit = kept * 1e3 if wind is None or wind.loop > 0.0 else 0.0
    left = memory_left(scene, camera) / 1e6 - _RENDERED * collection.get(MEGABYTES, 0.0)
    limit = min(limit, megabytes_held('RENDER') + left)
    for other in _stowed(scene):
        if megabytes_held('RENDER') <= limit:
            break
        _forget(scene, other)


def hide_for(scene: Scene, keys: Sequence[str]) -> None:
    """Hide objects that results of some digests replace."""
    names = dict.fromkeys(name for key in keys if key in _entries for name in _entries[key].originals)
    hide_originals(scene, 'RENDER', [o for name in names if (o := object_named(name)) is not None])


def clear(scene: Scene) -> None:
    """Remove a scene's cached results except those in it, which are left to `refine.clear`."""
    for key in _stowed(scene):
        _forget(scene, key)
    for key in [k for k, entry in _entries.items() if entry.scene == scene.session_uid]:
        del _entries[key]


def reset() -> None:
    """Forget all entries, whose datablocks are gone, after another file was loaded."""
    _entries.clear()


def _stowed(scene: Scene) -> list[str]:
    """Digests of a scene's results that are not in it, least recently used first."""
    shown = {c.name for c in result_collections(scene, 'RENDER')}
    keys = [key for key, entry in _entries.items() if entry.scene == scene.session_uid]
    return [key for key in keys if _entries[key].collection not in shown]


def _forget(scene: Scene, key: str) -> None:
    collection = bpy.data.collections.get((_entries.pop(key).collection, None))
    if collection is not None:
        remove_collection(scene, collection)
