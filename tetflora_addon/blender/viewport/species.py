# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One plant of the species in the editor, live in the viewport: rebuilt after each change, never rendered or saved.

The preview belongs to the session, not to the file: what is shown is remembered here by names, and its datablocks are
runtime data. They change without steps of undo, and undo keeps what is equal in two steps with its pointers, into
datablocks that it frees: Blender would crash. So they are taken away before each undo and made anew after it.
"""

import time
from dataclasses import dataclass, replace

import bpy

from ...compiled.flora import Flora, compile_species
from ...errors import TetFloraError
from ...growth.seeds import Seeds
from ...species.species import Range
from ..declare import once
from ..job.contents import expected_polygons, in_year
from ..job.plant_mesh import plant_mesh, plant_parts, single_seed
from ..materials.nodes import is_ours, tag
from ..results.leaf_objects import resolved_species
from ..runtime import Handlers, call_off, call_soon, redraw, with_uid
from ..species import edits
from ..species.editor import present_species

NAME = "TetFlora preview"
#: Polygons that a preview has at most, about: what is rebuilt while a slider moves.
MOST_POLYGONS = 150_000
_SOON = 0.05  # seconds from a change to the rebuilding


@dataclass
class _State:
    """The scene whose editor shows a preview, and how the last rebuilding went."""

    scene: int | None = None  # its `session_uid`
    message: str = ""
    failed: bool = False
    seconds: float = 0.0


_state = _State()


def shown_in(scene: bpy.types.Scene) -> bool:
    """Whether the preview is switched on in a scene."""
    return _state.scene == scene.session_uid


def message() -> tuple[str, bool]:
    """Text for the panel, and whether it is an error."""
    return _state.message, _state.failed


def show(scene: bpy.types.Scene, on: bool) -> None:
    """Switch the preview of a scene on or off; in the window it appears a moment later."""
    _remove()
    _state.scene, _state.message, _state.failed = (scene.session_uid, "", False) if on else (None, "", False)
    if on:
        schedule()


def schedule() -> None:
    """Rebuild the preview soon; many changes in a row are one rebuilding."""
    if _state.scene is not None:
        _call_soon()


def _call_soon() -> None:
    # A large plant must not keep the window busy while a slider is dragged.
    call_soon(refresh, max(_SOON, _state.seconds))


def refresh() -> None:
    """Build the preview anew, now; take it away if it is switched off."""
    scene = with_uid(bpy.data.scenes, _state.scene)
    if scene is None:
        _state.scene = None
        _remove()
        return
    begin = time.perf_counter()
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
        _state.message, _state.failed = str(error), True
        return  # the last plant that could be grown stays
    _place(scene, mesh)
    _state.seconds = time.perf_counter() - begin
    cut = f" in the first {orders} orders; the others are omitted to keep the preview interactive" if orders else ""
    _state.message, _state.failed = f"{len(mesh.polygons):,} polygons{cut}", False
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
    found = _objects()
    if not found or found[0].name not in scene.objects:
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
        obj = found[0]
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


def _before_undo(_scene: bpy.types.Scene, _other: object = None) -> None:
    if _objects() or _collections():
        _remove()
        _call_soon()


def _on_undo(_scene: bpy.types.Scene, _other: object = None) -> None:
    # Undo may also bring back a preview that was switched off since.
    if _state.scene is not None or _objects():
        _call_soon()


def _on_load_pre(_path: object, _other: object = None) -> None:
    _state.scene = None
    call_off(refresh)


_HANDLERS = Handlers(
    undo_pre=_before_undo, redo_pre=_before_undo, undo_post=_on_undo, redo_post=_on_undo, load_pre=_on_load_pre
)


def register() -> None:
    """Listen to changes of species, undo and loading."""
    bpy.types.WindowManager.tetflora_species = once.boolean(
        "Preview",
        "Show one plant of the species in the editor at the 3D cursor, updated with every change. It is never "
        "rendered or saved",
        get=lambda _: bpy.context.scene is not None and shown_in(bpy.context.scene),
        set=lambda _, on: show(bpy.context.scene, on),
    )
    edits.listeners.append(schedule)
    _HANDLERS.register()


def unregister() -> None:
    """Take the preview and all that listens away."""
    del bpy.types.WindowManager.tetflora_species
    _remove()
    _state.scene = None
    call_off(refresh)
    _HANDLERS.unregister()
    edits.listeners.remove(schedule)
