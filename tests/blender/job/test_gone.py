# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs whose data goes away in their middle: each ends with a message that says why, and leaves nothing it made.

Each job is stopped at several places between two steps, and each removal happens at each of them, as by the artist in
another window, a script, or another add-on.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator

import bpy
import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, depsgraph
from tetflora_addon.blender import runtime
from tetflora_addon.blender.job import plant_mesh, refine
from tetflora_addon.blender.results.output import PURPOSE
from tetflora_addon.blender.species import edits
from tetflora_addon.blender.viewport import levels, state
from tetflora_addon.errors import SceneError

Steps = Generator[object, object, object]


@pytest.fixture
def scene(clean_file) -> bpy.types.Scene:
    """Two plants and a mesh that takes part before a small camera, in a scene that is not the only one."""
    bpy.data.scenes.new("another")
    made = bpy.context.scene
    ground = add_mesh("ground", size=8.0)
    ground.tetflora.is_explicit = True
    add_camera(location=(0.0, -14.0, 3.0), rotation=(1.4, 0.0, 0.0))
    made.render.resolution_x = made.render.resolution_y = 48
    settings = made.tetflora  # a coarse result takes the same steps
    settings.leaf_limit, settings.cutoff, settings.visibility_resolution = 1.0, 6.0, 64
    for number in range(2):
        add_plant(f"bush {number}", "bush", seed=number, location=(3.0 * number - 1.5, 0.0, 0.0))
    leaf = add_mesh("leaf", size=0.05)
    entry = made.tetflora.leaf_objects.add()
    entry.species, entry.leaf = "bush", leaf
    made.view_layers.new("other")
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Begin")
    return made


def refining(scene: bpy.types.Scene) -> Steps:
    return refine.refine_steps(scene, depsgraph())


def baking(scene: bpy.types.Scene) -> Steps:
    scene.tetflora.baked_light = 'ALL'
    return refine.refine_steps(scene, depsgraph())


def expanding(scene: bpy.types.Scene) -> Steps:
    scene.tetflora.expand_everything = True
    return refine.refine_steps(scene, depsgraph())


_ever_other = itertools.count(1)


def measuring(scene: bpy.types.Scene) -> Steps:
    """An edited species whose facets nobody has measured yet."""

    def edit(data: dict) -> None:
        data["orders"][0]["length"] = 1.0 + 0.001 * next(_ever_other)

    edits.change_species(scene, "bush", edit)
    return refine.refine_steps(scene, depsgraph())


def converting(scene: bpy.types.Scene) -> Steps:
    return plant_mesh.make_plant_mesh_steps(scene, depsgraph(), [bpy.data.objects[f"bush {n}"] for n in range(2)])


def computing_levels(scene: bpy.types.Scene) -> Steps:
    return levels.level_steps(scene, depsgraph())


def message_begins(text: str) -> Callable[[Steps], None]:
    """Go on until a step says so."""

    def advance(steps: Steps) -> None:
        while not next(steps).message.startswith(text):
            pass

    return advance


def under_way() -> list[bpy.types.Collection]:
    """Results, in a scene or not yet."""
    return [c for c in bpy.data.collections if PURPOSE in c]


def first_result(steps: Steps) -> None:
    """Go on until there is an object of the result."""
    while not any(c.objects for c in under_way()):
        next(steps)


#: Jobs, and where they are when something goes.
PLACES = {
    "refine, before reading": (refining, next),
    "refine, read": (refining, message_begins("Compiling")),
    "refine, in the loop": (refining, message_begins("Refining")),
    "refine, measuring shares": (measuring, message_begins("Analyzing leaf clustering of")),
    "refine, meshes begun": (refining, first_result),
    "refine, proxies": (refining, message_begins("Making proxies")),
    "refine, baking": (baking, message_begins("Baking light")),
    "refine, leaves baked": (baking, message_begins("Making proxies")),
    "expand": (expanding, first_result),
    "convert, first plant": (converting, next),
    "convert, second plant": (converting, message_begins("mesh 2")),
    "levels, before reading": (computing_levels, next),
    "levels, under way": (computing_levels, message_begins("Level")),
}


def remove(name: str) -> Callable[[], None]:
    return lambda: bpy.data.objects.remove(bpy.data.objects[name])


def remove_scene() -> None:
    bpy.data.scenes.remove(bpy.context.scene)


def remove_view_layer() -> None:
    bpy.context.scene.view_layers.remove(bpy.context.scene.view_layers["ViewLayer"])


def remove_results() -> None:
    for collection in under_way():
        bpy.data.collections.remove(collection)


def remove_result_objects() -> None:
    for collection in under_way():
        bpy.data.batch_remove(list(collection.objects))


def remove_everything() -> None:
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.cameras])


def clear() -> None:
    """The button needs results; what it does does not."""
    if bpy.ops.tetflora.clear.poll():
        bpy.ops.tetflora.clear()
    else:
        runtime.stop_jobs("its results were cleared")


def keep() -> None:
    """The button needs results that are done; what it does does not."""
    assert not bpy.ops.tetflora.keep_results.poll()
    runtime.stop_jobs("the results were kept as meshes")


REMOVALS = {
    "undo": lambda: bpy.ops.ed.undo(),
    "load": lambda: session.clean_file(),
    "clear": clear,
    "keep": keep,
    "scene": remove_scene,
    "view layer": remove_view_layer,
    "camera": remove("camera"),
    "plant": remove("bush 1"),
    "mesh": remove("ground"),
    "leaf": remove("leaf"),
    "results": remove_results,
    "result objects": remove_result_objects,
    "everything": remove_everything,
}
#: What a job does not need: it goes on without.
SPARED = {
    *((place, removal) for place in PLACES if place.startswith("convert") for removal in ("camera", "mesh")),
    *((place, "leaf") for place in PLACES if place.startswith("levels")),
    *(
        (place, removal)
        for place in ("refine, before reading", "refine, read", "refine, in the loop", "refine, measuring shares")
        for removal in ("results", "result objects")
        if removal == "result objects" or place in ("refine, before reading", "refine, read")
    ),
    *((p, r) for p in PLACES if p[0] in "cl" for r in ("results", "result objects")),
}


def own() -> dict[str, list[str]]:
    """Everything in the file but what the artist has made."""
    found = datablocks()
    mine = {"camera", "ground", "leaf", "bush 0", "bush 1"}
    return {kind: [name for name in names if name not in mine] for kind, names in found.items()}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("removal", REMOVALS)
def test_a_job_whose_data_goes_says_so_and_leaves_nothing(scene, place, removal):
    bpy.ops.ed.undo_push(message="Before")
    before = own()
    begin, advance = PLACES[place]
    steps = begin(scene)
    advance(steps)
    REMOVALS[removal]()
    if (place, removal) in SPARED:
        for _ in steps:
            pass
        return
    with pytest.raises(SceneError, match=r"was stopped because .*; start it again"):
        for _ in steps:
            pass
    assert own() == before
    assert not runtime._running
    assert state.find(bpy.context.scene) is None or state.find(bpy.context.scene).levels is None


@pytest.mark.parametrize("name", ["camera", "bush 1", "ground", "leaf"])
def test_what_was_deleted_is_named(scene, name):
    steps = refining(scene)
    next(steps)
    bpy.data.objects.remove(bpy.data.objects[name])
    with pytest.raises(SceneError, match=f'Refine was stopped because "{name}" was deleted; start it again'):
        list(steps)
