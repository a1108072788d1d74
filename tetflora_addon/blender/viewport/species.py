# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One plant of the species in the editor, live in the viewport: rebuilt after each change, never rendered or saved.

The preview belongs to the session, not to the file: what is shown is remembered here by names, and its datablocks are
runtime data. They change without steps of undo, and undo keeps what is equal in two steps with its pointers, into
datablocks that it frees: Blender would crash. So they are taken away before each undo and made anew after it.
"""

from dataclasses import replace

import bpy

from ...compiled.flora import Flora, compile_species
from ...errors import TetFloraError
from ...growth.seeds import Seeds
from ...species.species import Range
from ..job.contents import expected_polygons, in_year
from ..job.plant_mesh import plant_mesh, plant_parts, single_seed
from ..materials.nodes import is_ours, tag
from ..results.leaf_objects import resolved_species
from ..runtime import SceneSwitch, handlers, in_order, listening, redraw
from ..species import edits
from ..species.editor import present_species

NAME = "TetFlora preview"
#: Polygons that a preview has at most, about: what is rebuilt while a slider moves.
MOST_POLYGONS = 150_000
_SOON = 0.05  # seconds from a change to the rebuilding


_message: tuple[str, bool] = "", False


def message() -> tuple[str, bool]:
    """Text for the panel, and whether it is an error; of the scene that shows a preview."""
    return _message if switch.scene is not None else ("", False)


def _build(scene: bpy.types.Scene | None) -> None:
    """Build the preview anew, now; take it away if it is switched off."""
    global _message
    if scene is None:
        switch.forget()
        return
    editor = scene.tetflora.species_editor
    identifier = present_species(editor)
    try:
        depsgraph = scene.view_layers[0].depsgraph or bpy.context.evaluated_depsgraph_get()
        seeds = single_seed(identifier, editor.preview_seed)
        # Full-grown whatever years have passed: that is what is edited.
        flora, orders = _limited(compile_species([resolved_species(scene, identifier, depsgraph)]), seeds)
        flora = in_year(scene, flora)
        mesh = plant_mesh(scene, NAME, flora.species[0], plant_parts(flora, seeds))
    except TetFloraError as error:
        _message = str(error), True
        return  # the last plant that could be grown stays
    _place(scene, mesh)
    cut = f" in the first {orders} orders; the others are omitted to keep the preview interactive" if orders else ""
    _message = f"{len(mesh.polygons):,} polygons{cut}", False
    redraw()


def _limited(flora: Flora, seeds: Seeds) -> tuple[Flora, int]:
    """The species, cut off after as many orders as the preview can show; and how many, 0 for all."""
    species = flora.species[0]
    number = len(species.orders)
    while number > 1 and expected_polygons(flora, seeds) > MOST_POLYGONS:
        number -= 1
        kept = species.orders[: number - 1] + (replace(species.orders[number - 1], branches=Range(0.0)),)
        flora = compile_species([replace(species, orders=kept)])
    return flora, 0 if number == len(species.orders) else number


def _place(scene: bpy.types.Scene, mesh: bpy.types.Mesh) -> None:
    """Show a mesh at the scene's 3D cursor, in place of the one before."""
    tag(mesh)
    objects = _objects()
    if not objects or objects[0].name not in scene.objects:
        _remove()
        collection = bpy.data.collections.new(NAME)
        scene.collection.children.link(collection)
        obj = bpy.data.objects.new(NAME, mesh)
        collection.objects.link(obj)
        obj.hide_render = obj.hide_select = True
        collection.hide_render = True
        tag(collection)
        tag(obj)
    else:
        obj = objects[0]
        old, obj.data = obj.data, mesh
        bpy.data.meshes.remove(old)
    for datablock in (obj, mesh, *_collections()):
        datablock.is_runtime_data = True  # each time: undo brings datablocks back without it
    obj.location = scene.cursor.location


def _objects() -> list[bpy.types.Object]:
    # By mark and not by name: an artist's object may be called like ours.
    return [o for o in bpy.data.objects if o.name.startswith(NAME) and is_ours(o) and o.type == 'MESH']


def _collections() -> list[bpy.types.Collection]:
    return [c for c in bpy.data.collections if c.name.startswith(NAME) and is_ours(c)]


def _remove() -> None:
    objects = _objects()
    # Materials stay for Refine to use; Blender does not save them while nobody does.
    bpy.data.batch_remove([*objects, *{o.data for o in objects if is_ours(o.data)}, *_collections()])


def _before(*_: object) -> None:
    if _objects() or _collections():
        _remove()
        switch.look()


def _on_undo(*_: object) -> None:
    # Undo may also bring back a preview that was switched off since.
    if switch.scene is not None or _objects():
        switch.look()


_TOOLTIP = (
    "Show one plant of the species in the editor at the 3D cursor, updated with every change. It is never "
    "rendered or saved"
)
switch = SceneSwitch("tetflora_species", "Preview", _TOOLTIP, _build, _remove, _SOON, drawn=False)
_HANDLERS = handlers(
    undo_pre=_before, redo_pre=_before, undo_post=_on_undo, redo_post=_on_undo, load_pre=lambda *_: switch.forget()
)
register, unregister = in_order(switch, listening(switch.schedule, edits.listeners), _HANDLERS)
