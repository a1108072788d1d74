# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results in the scene: a collection of objects that refinement makes, replaces and clears, and nothing else.

Objects whose polygons are refined are hidden as long as the results are shown in their place. How visible they were is
stored with them in custom properties, so that it outlives a file, a rename, and results that somebody deleted by hand;
whatever removes results gives it back. An object may be hidden for several scenes: it is shown when the last of them
has no results any more.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy

from ..buffers import MeshBuffers, PointBuffers
from ..plants.species import Species
from .meshes import write_mesh
from .node_tools import is_own, tag, untag
from .output import KIND, PARENT, dress, dress_collection, keep_materials, mark_runtime, parent_of
from .point_clouds import point_object

#: Custom property of a result collection: 'VIEW' for what the artist keeps, 'RENDER' for what lives while rendering.
PURPOSE = "tetflora_purpose"
#: Bytes of a name that Blender 4.5 takes (5.0 takes more), but for those with which it tells the same names apart.
_LONGEST = 59
#: And on those that are being made.
UNFINISHED = "tetflora_unfinished"
NAMES = {'VIEW': "TetFlora", 'RENDER': "TetFlora render"}
#: Custom properties of objects that results stand for, as JSON: hide_render and hide_viewport as they were before
#: ("flags"), and the names of the scenes whose results they are ("scenes"). Results of a render come last and go first.
HIDDEN = {'VIEW': "tetflora_hidden", 'RENDER': "tetflora_hidden_for_render"}
#: Custom property of scenes in files: marks of library overrides, which Blender does not store with them.
OVERRIDES = "tetflora_hidden_overrides"


class Results:
    """A result collection under construction.

    It is linked to the scene at once, so that an object reaches the render as soon as it is made; `discard` takes
    everything back.

    Parameters
    ----------
    scene : bpy.types.Scene
    purpose : {'VIEW', 'RENDER'}
    mark : str
        Comes after the names of all that is made, where results of several cameras are there at the same time.
    """

    def __init__(self, scene: bpy.types.Scene, purpose: str, mark: str = "") -> None:
        self.scene = scene
        self.purpose = purpose
        self.mark = f" {mark}" if mark else ""
        self.collection: bpy.types.Collection | None = None

    def open(self) -> None:
        """Make the collection and link it to the scene."""
        self.collection = bpy.data.collections.new(NAMES[self.purpose] + self.mark)
        self.collection[PURPOSE] = self.purpose
        self.collection[UNFINISHED] = True
        tag(self.collection)
        self.scene.collection.children.link(self.collection)

    def add(
        self,
        name: str,
        kind: str,
        buffers: MeshBuffers,
        materials: list[bpy.types.Material],
        species: Species | None = None,
    ) -> bpy.types.Object:
        """Write one mesh as an object of the collection; of one species, or of None."""
        name = self._name(name)
        return self._link(bpy.data.objects.new(name, write_mesh(name, buffers, materials)), kind, species)

    def add_points(
        self,
        name: str,
        kind: str,
        buffers: PointBuffers,
        materials: list[bpy.types.Material],
        species: Species | None = None,
    ) -> bpy.types.Object:
        """Write one cloud of points, which has one material, as an object of the collection."""
        return self._link(point_object(self._name(name), buffers, *materials), kind, species)

    def _name(self, name: str) -> str:
        """A name that ends in a number, with the mark; Blender must not cut it off where names are too long."""
        if not self.mark:
            return name
        stem, _, number = name.rpartition(" ")
        end = f" {number}{self.mark}"
        return stem.encode()[: _LONGEST - len(end)].decode(errors="ignore") + end

    def _link(self, made: bpy.types.Object, kind: str, species: Species | None) -> bpy.types.Object:
        tag(made.data)
        if species is not None:
            made.parent = parent_of(self.collection, species.identifier, species.name)
        made[KIND] = kind
        made.hide_select = True  # millions of polygons under the cursor; the plants are what is edited
        tag(made)
        dress(self.scene, made, "" if species is None else species.identifier)
        self.collection.objects.link(made)
        return made

    def finish(self) -> None:
        """All is made: results of a render are no part of files, those of the artist are what the scene says."""
        if self.collection is not None:
            del self.collection[UNFINISHED]
        if self.collection is not None and self.purpose == 'VIEW':
            dress_collection(self.scene, self.collection)
        elif self.collection is not None:
            mark_runtime(self.collection, True)

    def discard(self) -> None:
        """Remove all that was made."""
        if self.collection is not None:
            remove_collection(self.scene, self.collection)
            self.collection = None


def hide_originals(scene: bpy.types.Scene, purpose: str, originals: Sequence[bpy.types.Object]) -> None:
    """Hide objects whose place results take, in viewports too unless they are made for a render alone."""
    for original in originals:
        # Hidden for another scene already: how it looks now is not how the artist left it.
        flags, scenes = _marker(original, purpose) or ([original.hide_render, original.hide_viewport], [])
        if scene.name in scenes and original.hide_render:
            continue  # writing the same again would make Blender evaluate it again
        _mark(original, purpose, flags, sorted({*scenes, scene.name}))
        original.hide_render = True
        original.hide_viewport = original.hide_viewport or purpose == 'VIEW'


def result_collections(scene: bpy.types.Scene, purpose: str | None = None) -> list[bpy.types.Collection]:
    """Result collections of a scene, of one purpose or of all; those that are linked from other files are none."""
    made = [c for c in scene.collection.children if is_own(c) and PURPOSE in c]
    return [c for c in made if purpose is None or c[PURPOSE] == purpose]


def dress_results(scene: bpy.types.Scene) -> None:
    """Bring the artist's results of a scene in step with its output settings."""
    for collection in result_collections(scene, 'VIEW'):
        dress_collection(scene, collection)


def keep_results(scene: bpy.types.Scene) -> int:
    """Make the artist's results of a scene the artist's own; of how many objects.

    Explicit objects in whose place they are stay hidden.
    """
    for original in _marked('VIEW'):
        if _concerns(scene, original, 'VIEW') and not _others(scene, original, 'VIEW'):
            del original[HIDDEN['VIEW']]
    kept = 0
    for collection in result_collections(scene, 'VIEW'):
        mark_runtime(collection, False)
        for obj in collection.objects:
            if is_own(obj):
                kept += obj.get(KIND) != PARENT
                obj.hide_select = False
                for datablock in (obj, obj.data):
                    if datablock is not None:
                        untag(datablock)
        del collection[PURPOSE]
        untag(collection)
        collection.name = "TetFlora kept"
    return kept


def has_results(scene: bpy.types.Scene) -> bool:
    """Whether the scene holds meshes or proxies that the artist made by Refine."""
    return bool(result_collections(scene, 'VIEW'))


def remove_results(
    scene: bpy.types.Scene, purpose: str | None = None, keep: Sequence[bpy.types.Collection] = ()
) -> int:
    """Remove result collections with what was made for them; returns the number of datablocks removed.

    What was hidden for their sake is shown again as it was.
    """
    for which in ('RENDER', 'VIEW'):
        if purpose in {None, which}:
            show_originals(scene, which)
    return sum(remove_collection(scene, c) for c in result_collections(scene, purpose) if c not in keep)


def hidden_originals(scene: bpy.types.Scene, purpose: str | None = None) -> list[bpy.types.Object]:
    """Objects that Clear would show, or release, in a scene: hidden for its results, or for results that are no more.

    Wherever they are: somebody may have unlinked them from the scene meanwhile.
    """
    purposes = HIDDEN if purpose is None else [purpose]
    return [o for which in purposes for o in _marked(which) if _concerns(scene, o, which)]


def show_originals(scene: bpy.types.Scene, purpose: str) -> None:
    """Show what is hidden for a scene's results of one purpose as it was."""
    for original in hidden_originals(scene, purpose):
        flags, _ = _marker(original, purpose)
        others = _others(scene, original, purpose)
        if others:
            _mark(original, purpose, flags, others)
        else:
            _show(original, purpose)


def _show(original: bpy.types.Object, purpose: str) -> None:
    original.hide_render, original.hide_viewport = _marker(original, purpose)[0]
    del original[HIDDEN[purpose]]


def _marked(purpose: str) -> list[bpy.types.Object]:
    """Objects of this file that are hidden; a library's own marks are the business of its file."""
    return [o for o in bpy.data.objects if HIDDEN[purpose] in o and o.library is None]


def _marker(original: bpy.types.Object, purpose: str) -> tuple[list[bool], list[str]] | None:
    """Flags before it was hidden, and names of scenes; None if it is not hidden."""
    stored = original.get(HIDDEN[purpose])
    if stored is None:
        return None
    if not isinstance(stored, str):  # flags alone, as early versions stored them
        return [bool(flag) for flag in stored], []
    marker = json.loads(stored)
    return marker["flags"], marker["scenes"]


def _mark(original: bpy.types.Object, purpose: str, flags: list[bool], scenes: list[str]) -> None:
    original[HIDDEN[purpose]] = json.dumps({"flags": flags, "scenes": scenes})


def _concerns(scene: bpy.types.Scene, original: bpy.types.Object, purpose: str) -> bool:
    return scene.name in _marker(original, purpose)[1] or not _others(scene, original, purpose)


def _others(scene: bpy.types.Scene, original: bpy.types.Object, purpose: str) -> list[str]:
    """Names of other scenes with results in the place of an object."""
    names = _marker(original, purpose)[1]
    renamed = any(name not in bpy.data.scenes for name in names)
    return [
        other.name
        for other in bpy.data.scenes
        if other != scene
        and result_collections(other, purpose)
        and (other.name in names or (renamed and other.objects.get(original.name) == original))
    ]


def lift_marks() -> dict[tuple[str, str], str]:
    """Show everything that is hidden for results that files do not hold: of renders, and of the artist unless asked.

    Returns
    -------
    dict
        The marks by purpose and name of the object, for `restore_marks`.
    """
    saving = {scene.name for scene in bpy.data.scenes if scene.tetflora.output.save_results}
    lifted = {}
    for purpose in ('RENDER', 'VIEW'):
        for original in _marked(purpose):
            if purpose == 'RENDER' or not saving.intersection(_marker(original, purpose)[1]):
                lifted[purpose, original.name] = original[HIDDEN[purpose]]
                _show(original, purpose)
    return lifted


def restore_marks(lifted: dict[tuple[str, str], str]) -> None:
    """Hide again what `lift_marks` showed."""
    for (purpose, name), mark in reversed(lifted.items()):
        original = bpy.data.objects.get((name, None))
        if original is not None:
            original[HIDDEN[purpose]] = mark
            original.hide_render = True
            original.hide_viewport = original.hide_viewport or purpose == 'VIEW'


def show_left_over() -> None:
    """Show what is hidden for results that are not there: a file was read, which does not hold them."""
    for original in _marked('RENDER'):
        _show(original, 'RENDER')
    for original in _marked('VIEW'):
        names = _marker(original, 'VIEW')[1]
        homes = [s for s in bpy.data.scenes if s.name in names or s.objects.get(original.name) == original]
        if not any(result_collections(scene, 'VIEW') for scene in homes):
            _show(original, 'VIEW')


def leave_out_of_file() -> None:
    """Before a file is written: results that it shall not hold are marked as such, and their materials kept.

    Here and not only when they are made, because undo brings datablocks back without the mark.
    """
    for scene in bpy.data.scenes:
        saved = scene.tetflora.output.save_results
        for collection in result_collections(scene) if scene.library is None else ():
            # Of a refinement that goes on, the file has what there was before it.
            runtime = collection[PURPOSE] == 'RENDER' or not saved or UNFINISHED in collection
            mark_runtime(collection, runtime)
            if runtime and collection[PURPOSE] == 'VIEW':
                keep_materials(collection)


def pack_override_marks() -> None:
    """Put marks of library overrides where a file keeps them: of overrides Blender stores flags, but no new property.

    While a file is written and no longer: what a scene refers to by a property could not be deleted.
    """
    packed = [{"object": o, "mark": o[HIDDEN['VIEW']]} for o in _marked('VIEW') if o.override_library is not None]
    home = next((scene for scene in bpy.data.scenes if scene.library is None), None)
    if packed and home is not None:
        home[OVERRIDES] = packed


def unpack_override_marks() -> None:
    """Give library overrides back what `pack_override_marks` kept."""
    for scene in bpy.data.scenes:
        if scene.library is not None or OVERRIDES not in scene:
            continue
        for entry in scene[OVERRIDES]:
            original = entry["object"]
            if original is not None and original.library is None:
                original[HIDDEN['VIEW']] = entry["mark"]
        del scene[OVERRIDES]


@contextmanager
def originals_shown(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> Iterator[None]:
    """While the scene is read, objects that results hide, be it those of another scene, are as the artist left them.

    None for the dependency graph will do where nothing that is evaluated is read.
    """
    marked = {purpose: _marked(purpose) for purpose in ('RENDER', 'VIEW')}
    before = {o: (o.hide_render, o.hide_viewport) for every in marked.values() for o in every}
    for purpose, every in marked.items():
        for o in every:
            o.hide_render, o.hide_viewport = _marker(o, purpose)[0]
    try:
        if before and depsgraph is not None:
            depsgraph.update()
        yield
    finally:
        for o, flags in before.items():
            o.hide_render, o.hide_viewport = flags


def remove_collection(scene: bpy.types.Scene, collection: bpy.types.Collection) -> int:
    """Remove results, be they linked to the scene or not; returns the number of datablocks removed."""
    data, objects, groups = [], [], set()
    for held in list(collection.objects):
        if is_own(held) and held.get(KIND) == PARENT and len(held.users_collection) > 1:
            continue  # other results have it too
        if is_own(held):
            objects.append(held)
            if held.data is not None and is_own(held.data):
                data.append(held.data)
            groups |= {m.node_group for m in held.modifiers if m.type == 'NODES' and m.node_group is not None}
        elif held.name not in scene.collection.objects:
            scene.collection.objects.link(held)  # the artist put it here; it stays in the scene
    for child in list(collection.children):
        if child.name not in scene.collection.children:
            scene.collection.children.link(child)
    materials = {m for d in data for m in d.materials if m is not None and is_own(m)}
    removed = [*objects, *(d for d in data if d.users <= 1), collection]
    bpy.data.batch_remove(removed)
    return len(removed) + _remove_unused(materials, groups)


def _remove_unused(materials: set[bpy.types.Material], groups: set[bpy.types.NodeTree]) -> int:
    """Remove groups and materials of ours that nothing uses any more, and the node groups of these."""
    removed = _remove_groups(groups)  # first: groups of geometry nodes use materials
    unused = [m for m in materials if m.users == 0]
    groups = {n.node_tree for m in unused for n in m.node_tree.nodes if n.type == 'GROUP' and n.node_tree is not None}
    bpy.data.batch_remove(unused)
    return removed + len(unused) + _remove_groups(groups)


def _remove_groups(groups: set[bpy.types.NodeTree]) -> int:
    removed = 0
    while True:
        empty = [g for g in groups if g.users == 0 and is_own(g)]
        if not empty:
            return removed
        inner = {n.node_tree for g in empty for n in g.nodes if n.type == 'GROUP' and n.node_tree is not None}
        groups = (groups - set(empty)) | inner
        bpy.data.batch_remove(empty)
        removed += len(empty)
