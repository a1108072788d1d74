# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Output settings applied to result objects: visibility, pass indices, light groups, materials; removing results.

All objects of a species have one parent, an empty with the species' name, which is the asset of Cryptomatte's third
layer. Results of a render and the artist's results share it, so that its name, and thus the matte, is the same in both.
"""

from collections.abc import Iterable
from itertools import chain
from typing import Any

import bpy

from ..declare import PURPOSE
from ..materials.nodes import MADE, is_ours, is_own, tag, untag
from ..runtime import is_there
from ..scene.looks import wear

#: Custom property of a result object: 'leaf', 'blossom', 'bark', 'explicit' or 'proxy', or the parent of a species.
KIND = "tetflora_kind"
#: Custom properties of result objects: the identifier of their species, and the name of the material that they have.
SPECIES = "tetflora_species"
MATERIAL = "tetflora_material"
PARENT = "species"
#: Kind of a result that is a copy of what the artist's own object shows besides instances: no plants.
STAND_IN = "stand-in"
#: Custom property of a result object: the object or collection that TetFlora made for it to show instances of.
SOURCE = "tetflora_source"
#: Megabytes that the objects of a result collection take in Blender.
MEGABYTES = "tetflora_megabytes"
_KEPT = "tetflora_kept"  # on materials that a file holds although it does not hold the results that use them
#: Kinds of which a species' materials can be replaced.
REPLACED = ("leaf", "blossom", "bark")

_RAYS = {
    "camera": "Visible to camera rays. Otherwise plants only cast shadows and appear in reflections",
    "diffuse": "Visible to diffuse rays, which light matte surfaces",
    "glossy": "Visible to glossy rays, as in reflections",
    "transmission": "Visible to transmission rays, as through glass",
    "volume_scatter": "Visible to volume scatter rays, which light fog and clouds",
    "shadow": "Plants cast shadows",
}
#: Properties by the end of Blender's own names, which begin with ``visible_``.
SWITCHES = {
    ray: {"name": ray.replace("_", " ").title(), "description": about, "default": True} for ray, about in _RAYS.items()
}


def entry_of(scene: bpy.types.Scene, identifier: str) -> Any | None:
    """Output settings of a species in a scene; None without any."""
    return next((entry for entry in scene.tetflora.output.species if entry.species == identifier), None)


def replaced_material(scene: bpy.types.Scene, identifier: str, kind: str) -> bpy.types.Material | None:
    """The artist's material for ``'leaf'``, ``'blossom'`` or ``'bark'`` of a species; None without one."""
    entry = entry_of(scene, identifier)
    return getattr(entry, kind) if entry is not None and kind in REPLACED else None


def dress(scene: bpy.types.Scene, obj: bpy.types.Object, identifier: str) -> None:
    """Apply a scene's output settings to a result object; ``identifier`` is empty where species are mixed."""
    if obj.get(KIND) == STAND_IN:
        return
    output, entry, look = scene.tetflora.output, entry_of(scene, identifier), wear(obj)
    for name in SWITCHES:
        shown = getattr(output, name) and name not in look.get("off", ())
        if getattr(obj, f"visible_{name}") != shown:  # after each, Blender lists all objects anew
            setattr(obj, f"visible_{name}", shown)
    settings = output if entry is None else entry
    if "pass_index" not in look:
        obj.pass_index = settings.pass_index
    if "lightgroup" not in look:
        obj.lightgroup = settings.light_group or output.light_group
    obj[SPECIES] = identifier
    first = obj.material_slots[0].material if obj.material_slots else None
    obj[MATERIAL] = first.name if first is not None else ""


def parent_of(collection: bpy.types.Collection, identifier: str, name: str) -> bpy.types.Object:
    """The parent of a species' results, in a result collection; one for all of the file."""
    # Search all objects of the file only once for a collection: there may be hundreds of thousands.
    every = chain(collection.objects, bpy.data.objects)
    parent = next((o for o in every if o.get(KIND) == PARENT and o.get(SPECIES) == identifier and is_own(o)), None)
    if parent is None:
        parent = bpy.data.objects.new(f"{name} (TetFlora)", None)
        parent.empty_display_size = 0.0
        parent.hide_select = True
        parent[KIND], parent[SPECIES] = PARENT, identifier
        tag(parent)
        parent.is_runtime_data = True
    if parent.name not in collection.objects:
        collection.objects.link(parent)
    return parent


def dress_collection(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """Apply a scene's output settings to a result collection."""
    output = scene.tetflora.output
    collection.hide_viewport, collection.hide_render = not output.show_viewport, not output.show_render
    mark_runtime(collection, not output.save_results)
    for obj in collection.objects:
        if is_own(obj) and obj.get(KIND) != PARENT:
            dress(scene, obj, obj.get(SPECIES, ""))


def mark_runtime(collection: bpy.types.Collection, runtime: bool) -> None:
    """Keep a result collection out of files, or not; objects in other collections too, and shared meshes, stay in."""
    collection.is_runtime_data = runtime
    for obj in collection.objects:
        if is_own(obj) and (len(obj.users_collection) == 1 or not runtime):
            obj.is_runtime_data = runtime
            if obj.data is not None and is_own(obj.data):
                obj.data.is_runtime_data = runtime
    for source in sources_of(collection.objects):
        source.is_runtime_data = runtime


def _reached(datablocks: Iterable[bpy.types.ID | None]) -> list[bpy.types.ID]:
    """Those of some datablocks that TetFlora made in this file, and of what they use, each once."""
    reached: dict[bpy.types.ID, None] = {}
    waiting = list(datablocks)
    while waiting:
        one = waiting.pop()
        if one is None or one in reached or not is_own(one):
            continue
        reached[one] = None
        waiting += getattr(one, "materials", ())
        if isinstance(one, bpy.types.Object):
            waiting += [one.data, one.get(SOURCE), *(m.node_group for m in one.modifiers if m.type == 'NODES')]
        elif isinstance(one, bpy.types.Collection):
            waiting += one.objects
        tree = one if isinstance(one, bpy.types.NodeTree) else getattr(one, "node_tree", None)
        waiting += [node.node_tree for node in tree.nodes if node.type == 'GROUP'] if tree is not None else ()
    return list(reached)


def sources_of(objects: Iterable[bpy.types.Object]) -> list[bpy.types.ID]:
    """What TetFlora made for result objects to show instances of: collections, objects and their data, each once."""
    looks = bpy.types.Material | bpy.types.NodeTree
    return [one for one in _reached({obj.get(SOURCE) for obj in objects}) if not isinstance(one, looks)]


def adopt_materials(scene: bpy.types.Scene, collection: bpy.types.Collection) -> list[str]:
    """Store materials that the artist put on results in the output settings; returns their parts for a report."""
    adopted = []
    for obj in collection.objects:
        part, identifier = obj.get(KIND), obj.get(SPECIES, "")
        if part not in REPLACED or not identifier or not obj.material_slots:
            continue
        given = obj.material_slots[0].material
        if given is None or given.name == obj.get(MATERIAL) or is_ours(given):
            continue
        entry = entry_of(scene, identifier)
        if entry is None:
            entry = scene.tetflora.output.species.add()
            entry.species, entry.pass_index = identifier, scene.tetflora.output.pass_index
        if getattr(entry, part) != given:
            setattr(entry, part, given)
            adopted.append(f"{identifier} {part}")
    return adopted


def keep_materials(collection: bpy.types.Collection) -> None:
    """Let a file hold the materials of results that it does not hold: the artist may have edited them."""
    for obj in collection.objects:
        for material in obj.data.materials if obj.data is not None else ():
            if material is not None and is_own(material) and not material.use_fake_user:
                material.use_fake_user, material[_KEPT] = True, True


def release_materials() -> None:
    """Undo `keep_materials`: from now on results use the materials, or nothing does."""
    for material in bpy.data.materials:
        if material.library is None and material.get(_KEPT):
            material.use_fake_user = False
            del material[_KEPT]


def result_collections(scene: bpy.types.Scene, purpose: str | None = None) -> list[bpy.types.Collection]:
    """Result collections of a scene and this file, of one purpose or of all, wherever the artist has moved them.

    One that was renamed still is: it is a copy only where another of the scene has its first name, or shares objects.
    """
    inside = scene.collection.children_recursive

    def copied(one: bpy.types.Collection) -> bool:
        other = bpy.data.collections.get((one[MADE], None))
        return other not in {None, one} and (other in inside or not {*one.objects}.isdisjoint(other.objects))

    marked = [c for c in inside if PURPOSE in c and MADE in c and c.library is None and c.override_library is None]
    return [c for c in marked if purpose in {None, c[PURPOSE]} and not copied(c)]


def megabytes_held(purpose: str, scene: bpy.types.Scene | None = None) -> float:
    """Megabytes of all results of a purpose that are in this file, or in a scene or wait for later frames."""
    every = [c for c in bpy.data.collections if c.get(PURPOSE) == purpose and c.library is None]
    inside = every if scene is None else scene.collection.children_recursive
    return sum(c.get(MEGABYTES, 0.0) for c in every if c in inside or not c.users)


def release_copies(collection: bpy.types.Collection) -> None:
    """Hand copies of a result collection over to the artist, before it is gone and they count as the renamed one."""
    for other in bpy.data.collections:
        if other != collection and other.library is None and other.get(MADE) == collection.get(MADE):
            untag(other)


def remove_collection(scene: bpy.types.Scene | None, collection: bpy.types.Collection) -> int:
    """Remove a result collection, but leave the artist's objects in the scene, if given; how many datablocks went."""
    objects = list(collection.objects)
    ours = [o for o in objects if is_own(o) and not (o.get(KIND) == PARENT and len(o.users_collection) > 1)]
    if scene is not None:
        for theirs in objects:
            if not is_own(theirs) and theirs.name not in scene.collection.objects:
                scene.collection.objects.link(theirs)
        for child in list(collection.children):
            if child.name not in scene.collection.children:
                scene.collection.children.link(child)
    used = _reached(ours)
    release_copies(collection)
    bpy.data.batch_remove([*ours, collection])
    return len(ours) + 1 + remove_unused(used)


def remove_unused(datablocks: Iterable[bpy.types.ID]) -> int:
    """Remove what results could use, and nothing uses any more; returns the number removed."""
    left, removed = [one for one in datablocks if is_there(one) and is_own(one)], 0
    while unused := [one for one in left if not one.users]:
        left = [one for one in left if one.users]
        bpy.data.batch_remove(unused)
        removed += len(unused)
    return removed


def remove_made(datablocks: Iterable[bpy.types.ID]) -> None:
    """Remove objects that are in no collection, and what of TetFlora's nothing uses then; and meshes without a mark."""
    existing = [datablock for datablock in dict.fromkeys(datablocks) if is_there(datablock)]
    used = _reached(existing)
    bpy.data.batch_remove([d for d in used if isinstance(d, bpy.types.Object) and not d.users_collection])
    data = [d for d in existing if is_there(d) and isinstance(d, bpy.types.Mesh | bpy.types.PointCloud) and not d.users]
    bpy.data.batch_remove(data)
    remove_unused(used)
