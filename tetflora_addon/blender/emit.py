# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results in the scene: a collection of objects that refinement makes, replaces and clears, and nothing else.

Objects whose polygons are refined are hidden as long as the results are shown in their place. How visible they were is
stored with them in custom properties, so that it outlives a file, a rename, and results that somebody deleted by hand;
whatever removes results gives it back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy

from ..buffers import MeshBuffers
from .meshes import write_mesh
from .node_tools import is_ours, tag

#: Custom property of a result collection: 'VIEW' for what the artist keeps, 'RENDER' for what lives while rendering.
PURPOSE = "tetflora_purpose"
NAMES = {'VIEW': "TetFlora", 'RENDER': "TetFlora render"}
#: Custom property of a result object: 'leaf', 'blossom', 'bark', 'explicit' or 'proxy'.
KIND = "tetflora_kind"
#: Custom properties of objects that results stand for: hide_render and hide_viewport as they were before.
#: Results of a render come last and go first.
HIDDEN = {'VIEW': "tetflora_hidden", 'RENDER': "tetflora_hidden_for_render"}


class Results:
    """A result collection under construction.

    It is linked to the scene at once, so that an object reaches the render as soon as it is made; `discard` takes
    everything back.

    Parameters
    ----------
    scene : bpy.types.Scene
    purpose : {'VIEW', 'RENDER'}
    """

    def __init__(self, scene: bpy.types.Scene, purpose: str) -> None:
        self.scene = scene
        self.purpose = purpose
        self.collection: bpy.types.Collection | None = None

    def open(self) -> None:
        """Make the collection and link it to the scene."""
        self.collection = bpy.data.collections.new(NAMES[self.purpose])
        self.collection[PURPOSE] = self.purpose
        tag(self.collection)
        self.scene.collection.children.link(self.collection)

    def add(self, name: str, kind: str, buffers: MeshBuffers, materials: list[bpy.types.Material]) -> bpy.types.Object:
        """Write one mesh as an object of the collection."""
        mesh = write_mesh(name, buffers, materials)
        tag(mesh)
        made = bpy.data.objects.new(name, mesh)
        made[KIND] = kind
        made.hide_select = True  # millions of polygons under the cursor; the plants are what is edited
        tag(made)
        self.collection.objects.link(made)
        return made

    def hide(self, originals: Sequence[bpy.types.Object]) -> None:
        """Hide objects whose place the results take, in viewports too unless they are made for a render alone."""
        for original in originals:
            original[HIDDEN[self.purpose]] = [original.hide_render, original.hide_viewport]
            original.hide_render = True
            original.hide_viewport = original.hide_viewport or self.purpose == 'VIEW'

    def discard(self) -> None:
        """Remove all that was made."""
        if self.collection is not None:
            _remove_collection(self.scene, self.collection)
            self.collection = None


def result_collections(scene: bpy.types.Scene, purpose: str | None = None) -> list[bpy.types.Collection]:
    """Result collections of a scene, of one purpose or of all."""
    made = [c for c in scene.collection.children if is_ours(c) and PURPOSE in c]
    return [c for c in made if purpose is None or c[PURPOSE] == purpose]


def has_results(scene: bpy.types.Scene) -> bool:
    """Whether the scene holds meshes or proxies that the artist made by Refine."""
    return bool(result_collections(scene, 'VIEW'))


def remove_results(scene: bpy.types.Scene, purpose: str | None = None, keep: bpy.types.Collection | None = None) -> int:
    """Remove result collections with what was made for them; returns the number of datablocks removed.

    What was hidden for their sake is shown again as it was.
    """
    for which in ('RENDER', 'VIEW'):
        if purpose in {None, which}:
            _show_originals(scene, which)
    return sum(_remove_collection(scene, c) for c in result_collections(scene, purpose) if c != keep)


def _show_originals(scene: bpy.types.Scene, purpose: str) -> None:
    for original in _hidden(scene, purpose):
        original.hide_render, original.hide_viewport = map(bool, original[HIDDEN[purpose]])
        del original[HIDDEN[purpose]]


def _hidden(scene: bpy.types.Scene, purpose: str) -> list[bpy.types.Object]:
    return [o for o in scene.objects if HIDDEN[purpose] in o]


@contextmanager
def originals_shown(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Iterator[None]:
    """While the scene is read, objects that results hide are as visible as the artist left them."""
    before = {o: (o.hide_render, o.hide_viewport) for purpose in HIDDEN for o in _hidden(scene, purpose)}
    for purpose in ('RENDER', 'VIEW'):
        for o in _hidden(scene, purpose):
            o.hide_render, o.hide_viewport = map(bool, o[HIDDEN[purpose]])
    try:
        if before:
            depsgraph.update()
        yield
    finally:
        for o, flags in before.items():
            o.hide_render, o.hide_viewport = flags


def _remove_collection(scene: bpy.types.Scene, collection: bpy.types.Collection) -> int:
    meshes, objects = [], []
    for held in list(collection.objects):
        if is_ours(held):
            objects.append(held)
            if held.data is not None and is_ours(held.data):
                meshes.append(held.data)
        elif held.name not in scene.collection.objects:
            scene.collection.objects.link(held)  # the artist put it here; it stays in the scene
    for child in list(collection.children):
        if child.name not in scene.collection.children:
            scene.collection.children.link(child)
    materials = {m for mesh in meshes for m in mesh.materials if m is not None and is_ours(m)}
    removed = [*objects, *(m for m in meshes if m.users <= 1), collection]
    bpy.data.batch_remove(removed)
    return len(removed) + _remove_unused(materials)


def _remove_unused(materials: set[bpy.types.Material]) -> int:
    """Remove materials of ours that nothing uses any more, and their node groups."""
    groups = set()
    unused = [m for m in materials if m.users == 0]
    for material in unused:
        groups |= {n.node_tree for n in material.node_tree.nodes if n.type == 'GROUP' and n.node_tree is not None}
    bpy.data.batch_remove(unused)
    removed = len(unused)
    while True:
        empty = [g for g in groups if g.users == 0 and is_ours(g)]
        if not empty:
            return removed
        inner = {n.node_tree for g in empty for n in g.nodes if n.type == 'GROUP' and n.node_tree is not None}
        groups = (groups - set(empty)) | inner
        bpy.data.batch_remove(empty)
        removed += len(empty)
