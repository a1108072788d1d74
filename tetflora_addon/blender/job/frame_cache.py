# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results that a render keeps from frame to frame: what is there already is not refined again.

Results are known by a digest of all that they depend on. A frame whose digest is that of an earlier one gets its
results back, and what nobody has seen for longest goes first when the memory for them is full. The camera counts by the
cell that it is in (`refinement.view_cells`), so that neighbouring frames have the same digest.

A number for all that a refinement depends on: where two are equal, refining again would make the same.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass

import bpy
import numpy as np

from ...camera.camera import Camera
from ...camera.view_cells import Around, ViewCells, cell_camera
from ...species.species import Species
from ..compat import drawn_disc
from ..results.hiding import hidden_originals, hide_originals, show_originals
from ..results.leaf_objects import brought_materials, resolved_species
from ..results.output import REPLACED, remove_collection, result_collections
from ..results.proxies import shade_again
from ..scene.camera import read_camera
from ..scene.skeletons import species_of
from ..settings import wind_of
from ..species.edits import species_for
from .contents import Given, read_scene, settings_from

#: Digests of species by number of the object, which is held so that no other gets its number.
_of_species: dict[int, tuple[Species, str]] = {}
_MOST_SPECIES = 64
_CHOICES = ("proxy_form", "baked_light", "expand_everything")


def scene_digest(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    view_layer: bpy.types.ViewLayer,
    camera: Camera | None = None,
    given: Given | None = None,
) -> str:
    """Digest of camera, plants, meshes that take part or hide plants, lamps, settings, species, materials and wind.

    In the wind it is another at each frame.

    Parameters
    ----------
    camera : Camera, optional
        Which one counts, if it is not the scene's as it stands.
    given : Given, optional
        What `read_scene` returned for the scene.

    Raises
    ------
    TetFloraError
        The scene cannot be refined as it is.
    """
    if given is None:
        given = read_scene(scene, depsgraph, view_layer)
    content = hashlib.sha256()
    explicit = ()
    if given.explicit is not None:
        meshes = given.explicit.meshes
        worn = [[getattr(material, "name_full", "") for material in slots] for slots in given.explicit.materials]
        explicit = meshes.surfaces, meshes.surface, meshes.linear, meshes.origin, worn
    species = [resolved_species(scene, identifier, depsgraph) for identifier in given.species]
    for part in (
        camera or read_camera(scene, depsgraph),
        given.seeds,
        given.occluders,
        given.lights,
        given.sources,
        explicit,
        choices(scene),
        [_digest_of_species(one) for one in species],
        [brought_materials(scene, identifier) for identifier in given.species],
    ):
        digest_of(content, part)
    return content.hexdigest()


def choices(scene: bpy.types.Scene) -> list:
    """What of it a scene's own settings say, without a look at objects; cheap enough for every change."""
    group = scene.tetflora
    materials = [(e.species, *(getattr(getattr(e, k), "name", "") for k in REPLACED)) for e in group.output.species]
    chosen = [getattr(group, name) for name in _CHOICES]
    return [settings_from(scene), chosen, materials, wind_of(scene), drawn_disc(scene.render.engine)]


def _digest_of_species(species: Species) -> str:
    """Digest of a species; species never change, so it is computed once."""
    if id(species) not in _of_species:
        content = hashlib.sha256()
        digest_of(content, species)
        if len(_of_species) >= _MOST_SPECIES:
            _of_species.clear()
        _of_species[id(species)] = species, content.hexdigest()
    return _of_species[id(species)][1]


def digest_of(content: hashlib._Hash, value: object) -> None:
    """Add a value of numbers, texts, arrays, or of sequences, mappings or dataclasses of these."""
    if isinstance(value, np.ndarray):
        content.update(f"{value.dtype}{value.shape}".encode())
        content.update(np.ascontiguousarray(value) if value.dtype != object else repr(value.tolist()).encode())
    elif is_dataclass(value):
        for field in fields(value):
            content.update(field.name.encode())
            digest_of(content, getattr(value, field.name))
    elif isinstance(value, list | tuple):
        content.update(f"{len(value)}:".encode())
        for item in value:
            digest_of(content, item)
    elif isinstance(value, Mapping):
        digest_of(content, [part for item in value.items() for part in item])
    else:
        content.update(f"{value!r};".encode())  # or 1, 11 would be 11, 1


#: What a scene's settings say that results do not depend on.
_ASIDE = {"statistics", "share_frames", "cell_length", "cell_turn", "kept_memory", "refine_at_render", "auto_refine"}


@dataclass
class _Kept:
    """Results of one digest; names, because references do not outlive a load."""

    scene: int  # its number in this session: scenes of a sequencer are rendered while another one is
    collection: str
    originals: list[str]
    megabytes: float
    statistics: str


#: By digest, least recently seen first.
_kept: dict[str, _Kept] = {}


def shared_camera(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, given: Given | None = None) -> Camera:
    """The active camera, or the one that stands for all that are nearly alike if it moves and the scene asks for it.

    More cameras are alike where what is given is far from them.

    Raises
    ------
    SceneError
        As `camera_reader.read_camera`.
    """
    camera, settings = read_camera(scene, depsgraph, region_only=True), scene.tetflora
    if not (settings.share_frames and camera_moves(scene)) or wind_of(scene) is not None:
        return camera  # in the wind, no two frames are alike
    around = None if given is None else _around(scene, given)
    return cell_camera(camera, ViewCells(settings.cell_length, settings.cell_turn), around) or camera


def _around(scene: bpy.types.Scene, given: Given) -> Around:
    """Spheres about the feet of plants, as large as branches are long on the way to the last twig, and about meshes."""
    seeds, meshes = given.seeds, None if given.explicit is None else given.explicit.meshes
    # Lengths are in metres for trunks, and in those of their parents for all others.
    orders = [species_for(scene, species_of(kind)).orders for kind in seeds.identifiers]
    heights = np.array([np.cumprod([order.length.mean for order in own]).sum() for own in orders])
    centres, radii = [seeds.position], [heights[seeds.species] * seeds.scale]
    if meshes is not None:
        reach = [np.linalg.norm(surface.positions, axis=1).max() for surface in meshes.surfaces]
        centres.append(meshes.origin)
        radii.append(np.array(reach)[meshes.surface] * meshes.largest)
    return Around(np.concatenate(centres), np.concatenate(radii))


def camera_moves(scene: bpy.types.Scene) -> bool:
    """Whether anything may move a scene's camera or change its lens from frame to frame.

    It depends on the file alone, so that all frames of a film, and each of them alone, are refined in the same way.
    """
    carrier = scene.camera
    if carrier is not None and _is_animated(carrier.data):
        return True
    while carrier is not None:
        if _is_animated(carrier) or any(not constraint.mute for constraint in carrier.constraints):
            return True
        carrier = carrier.parent
    return False


def _is_animated(datablock: bpy.types.ID | None) -> bool:
    animation = getattr(datablock, "animation_data", None)
    return animation is not None and bool(animation.action or animation.drivers or animation.nla_tracks)


def key_of(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    layers: Sequence[bpy.types.ViewLayer],
    camera: Camera,
    given: Given,
) -> str:
    """Digest of all that results for view layers depend on; camera and what is given are theirs.

    Raises
    ------
    TetFloraError
        As `scene_digest.scene_digest`.
    """
    content = hashlib.sha256(scene_digest(scene, depsgraph, layers[0], camera, given).encode())
    digest_of(content, [scene.name, *(layer.name for layer in layers)])
    for group in (scene.tetflora, scene.tetflora.output, *scene.tetflora.output.species):
        digest_of(content, _values(group))
    return content.hexdigest()


def _values(group: bpy.types.PropertyGroup) -> list[object]:
    """Values of a scene's settings; those in groups are told by others or say nothing of results."""
    found: list[object] = []
    for prop in group.bl_rna.properties:
        name = prop.identifier
        if name not in _ASIDE and prop.type not in {'POINTER', 'COLLECTION'}:
            value = getattr(group, name)
            found.append((name, list(value) if getattr(prop, "is_array", False) else value))
    return found


def stow(scene: bpy.types.Scene, wanted: Collection[str]) -> None:
    """Take results of a render out of a scene unless they are wanted for its frame."""
    stay = {_kept[key].collection for key in wanted if key in _kept}
    away = [c for c in result_collections(scene, 'RENDER') if c.name not in stay]
    if away or len(result_collections(scene, 'RENDER')) < len(wanted):
        show_originals(scene, 'RENDER')
    known = {entry.collection for entry in _kept.values()}
    for collection in away:
        if collection.name in known:
            scene.collection.children.unlink(collection)
        else:
            remove_collection(scene, collection)


def recall(scene: bpy.types.Scene, key: str) -> bpy.types.Collection | None:
    """Put results of a digest into a scene again; None if there are none."""
    entry = _kept.pop(key, None)
    collection = bpy.data.collections.get((entry.collection, None)) if entry is not None else None
    if collection is None:
        return None
    _kept[key] = entry  # most recently seen
    if collection.name not in scene.collection.children:
        scene.collection.children.link(collection)
    shade_again(scene, collection)
    if scene.tetflora.statistics != entry.statistics:  # or the scene would count as changed
        scene.tetflora.statistics = entry.statistics
    return collection


def keep(scene: bpy.types.Scene, key: str, collection: bpy.types.Collection, megabytes: float) -> None:
    """Remember new results of a scene, and let older ones go for which there is no memory."""
    originals = [o.name for o in hidden_originals(scene, 'RENDER')]
    _kept[key] = _Kept(scene.session_uid, collection.name, originals, megabytes, scene.tetflora.statistics)
    wind = wind_of(scene)
    # In a wind without a loop nothing comes back.
    limit = scene.tetflora.kept_memory * 1e3 if wind is None or wind.loop > 0.0 else 0.0
    for other in _stowed(scene):
        if sum(entry.megabytes for entry in _kept.values()) <= limit:
            break
        _forget(scene, other)


def hide_for(scene: bpy.types.Scene, keys: Sequence[str]) -> None:
    """Hide objects in whose place results of some digests are."""
    names = dict.fromkeys(name for key in keys if key in _kept for name in _kept[key].originals)
    hide_originals(scene, 'RENDER', [o for name in names if (o := bpy.data.objects.get((name, None))) is not None])


def forget_all(scene: bpy.types.Scene) -> None:
    """Remove all that was kept for a scene and is not shown in it; what is shown is `job.clear`'s business."""
    for key in _stowed(scene):
        _forget(scene, key)
    for key in [k for k, entry in _kept.items() if entry.scene == scene.session_uid]:
        del _kept[key]


def forget_names() -> None:
    """Another file is open: nothing of what was kept is there any more."""
    _kept.clear()


def _stowed(scene: bpy.types.Scene) -> list[str]:
    """Digests of results that a scene has but does not show, least recently seen first."""
    shown = {c.name for c in result_collections(scene, 'RENDER')}
    own = [key for key, entry in _kept.items() if entry.scene == scene.session_uid]
    return [key for key in own if _kept[key].collection not in shown]


def _forget(scene: bpy.types.Scene, key: str) -> None:
    collection = bpy.data.collections.get((_kept.pop(key).collection, None))
    if collection is not None:
        remove_collection(scene, collection)
