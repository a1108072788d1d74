# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute what viewports preview: levels of refinement on request, simple plants whenever plants change.

Without a window, plants are read only on request, and the only handlers are those for loading.
"""

import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from itertools import count

import bpy
import numpy as np
from bpy.types import Collection, Depsgraph, Object, Scene
from numpy.typing import NDArray

from ...compiled.flora import Flora, compile_species
from ...compiled.recorded_sizes import measure_of
from ...errors import TetFloraError
from ...growth.seeds import Seeds
from ...jobs import Progress, mapped
from ...preview.levels import Levels, gather
from ...preview.light_plants import (
    MOST_FACES,
    Shapes,
    bounds_of_plants,
    crown_areas,
    crowns_of,
    joined,
    light_plants,
    simple_crowns,
    thinned,
    with_faces,
)
from ...preview.running import InView, in_view, shown
from ...refinement.loop import refine as refine_loop
from ...species.kinds import Kind
from ..job.contents import bind_steps, compile_for, in_year, load_for, memory_left, read_scene, refinement_settings
from ..main_thread import on_main_thread
from ..runtime import JobData, call_off, call_soon, handlers, in_order, job, listening, redraw
from ..scene.ages import crown_kinds, plainly_aged
from ..scene.camera import read_camera, timeline_moves, views_of
from ..scene.crowns import crown_for
from ..scene.fields import stand_years
from ..scene.looks import shown_objects
from ..scene.objects import has_contents, is_drop, taking_part
from ..scene.plants import NoPlantsError, gone_species, read_asset_plants, read_plants
from ..settings import season_of, years_of
from ..species import edits
from ..species.asset_species import find_asset, wood_color
from ..worker import call_in_thread, steps_in_thread
from . import state
from .state import Preview, Running, camera_now, find, of

_MANY_KINDS = 12  # more are compiled one by one, and kept
_SOON = 0.2  # seconds from a change of plants to reading them again
_QUICK = 0.3  # seconds that reading may take for plants to follow the timeline frame by frame


@job("Compute Levels")
def level_steps(data: JobData) -> Generator[Progress, None, Levels]:
    """Refine a scene and make only levels for viewports; closing it changes nothing. Errors are `refine_steps`'."""
    scene, depsgraph = data.scene, data.depsgraph
    data.add_objects([*taking_part(scene), *([] if scene.camera is None else [scene.camera])])
    yield Progress(0.0, "Reading the scene")
    depsgraph.update()  # reading what was deleted since the last step would crash Blender
    looked = camera_now(scene)
    before = find(scene)
    camera = before.frozen if before is not None and before.frozen is not None else read_camera(scene, depsgraph)
    camera = camera.local()
    given = read_scene(scene, depsgraph).counted_from(camera.origin)
    progress = Progress(0.02, "Compiling species")
    yield progress
    flora = yield from call_in_thread(progress, compile_species, load_for(given.species, scene, depsgraph))
    flora = in_year(scene, flora)
    settings = refinement_settings(scene)
    bound = yield from bind_steps(scene, given.places, depsgraph, camera, memory_left(scene, camera))
    others = given.occluders, given.polygons, given.lights, None if bound is None else bound.placed
    states = refine_loop(flora, given.seeds, camera, settings, *others)
    # Nobody knows how many passes will follow.
    fractions = (1.0 - 0.95 * 0.85**number for number in count(1))
    steps = gather(states, flora, camera)
    told = mapped(steps, lambda one: Progress(next(fractions), f"Level {one.number}: {len(one):,} tetrahedra"))
    levels = yield from steps_in_thread(told, Progress(0.05, "Level 0"))
    data.check()
    preview = of(scene)
    preview.levels, preview.looked = levels, looked
    preview.changes += 1
    if scene.tetflora.preview.freeze:
        preview.frozen = camera
    redraw()
    return levels


def read_shapes(scene: Scene, depsgraph: Depsgraph) -> Shapes | None:
    """Make the plants of a scene anew in the form that its settings say; None where they are not to be shown.

    What is wrong with a plant is reported by `Preview.message`, for the panel, and the earlier plants stay.
    """
    begin, preview, form = time.thread_time(), of(scene), scene.tetflora.preview.plants
    preview.message, preview.objects, preview.moment = "", len(shown_objects(depsgraph.view_layer)), _moment(scene)
    try:
        make = light_plants if form == 'LIGHT' else bounds_of_plants
        preview.shapes = None if form == 'NONE' else _shapes_of(scene, depsgraph, make)
    except NoPlantsError as error:
        preview.shapes, preview.message = None, str(error)
    except TetFloraError as error:
        preview.message = str(error)
    preview.changes, preview.running = preview.changes + 1, None
    preview.seconds = time.thread_time() - begin
    redraw()
    return preview.shapes


def _shapes_of(scene: Scene, depsgraph: Depsgraph, make: Callable[[Flora, Seeds], Shapes]) -> Shapes:
    """Plants that grow in the form of ``make``, and those that are assets as simple crowns."""
    crowns = _asset_crowns(scene, depsgraph, boxes=make is bounds_of_plants)
    try:
        seeds, of(scene).message = _plants_of(scene, depsgraph)
    except NoPlantsError:
        if not crowns:
            raise
        return joined(crowns)
    grown = _grown(scene, depsgraph, make, seeds)
    return joined([*grown, *crowns]) if crowns or len(grown) > 1 else grown[0]


def _plants_of(scene: Scene, depsgraph: Depsgraph) -> tuple[Seeds, str]:
    """Plants that grow and are not hidden in viewports, and which are left out."""
    seeds, _, message = read_plants(scene, depsgraph)
    seen = np.array(["hide_viewport" not in Kind.read(kind).look for kind in seeds.identifiers])
    if not seen.any():
        raise NoPlantsError("All plants are hidden in viewports; show them or their collections in the Outliner")
    return seeds.take(seen[seeds.species]), message


def _asset_crowns(scene: Scene, depsgraph: Depsgraph, boxes: bool) -> list[Shapes]:
    crowns = []
    for plants in read_asset_plants(scene, depsgraph):
        crown, layer = crown_for(scene, plants.species), depsgraph.view_layer
        seen = plants.matrices[[owner.visible_get(view_layer=layer) for owner in plants.owners]]
        if len(seen):
            colors = crown.color, wood_color(find_asset(scene, plants.species))
            crowns.append(simple_crowns(seen, (crown.radius, crown.base, crown.height), colors, boxes))
    return crowns


def _grown(
    scene: Scene, depsgraph: Depsgraph, make: Callable[[Flora, Seeds], Shapes], seeds: Seeds, seen: InView | None = None
) -> list[Shapes]:
    """Plants that grow in the form of ``make``; many kinds of them one by one, which are known from other years.

    As years pass they have the forms of classes of ages, and their own heights: no year has to wait for its species.
    Of those that are ``seen``, which are ``seeds`` then, `running.shown` has chosen.
    """
    years = years_of(scene)
    if years > 0.0:
        seeds, ages = plainly_aged(scene, seeds, None, None)
        kinds, number, taller = crown_kinds(scene, seeds.identifiers, seeds.species, ages)
        seeds = replace(seeds, identifiers=kinds, species=number, scale=seeds.scale * taller)
    kinds = seeds.identifiers
    if years == 0.0 and len(kinds) <= _MANY_KINDS:
        flora = in_year(scene, compile_for(kinds, scene, depsgraph))
        if seen is not None:
            areas = crown_areas(flora)[seeds.species] * seeds.scale**2
            seeds = shown(replace(seen, seeds=seeds), areas)
        return [make(flora, seeds)]
    loaded, out = load_for(kinds, scene, depsgraph, 0.0), []
    if seen is not None:
        areas = np.concatenate([crown_areas(in_year(scene, measure_of(species).flora)) for species in loaded])
        seeds = shown(replace(seen, seeds=seeds), areas[seeds.species] * seeds.scale**2)
    if make is light_plants and len(seeds) > MOST_FACES:
        make, kept = crowns_of, seeds
    else:
        kept = thinned(seeds, np.array([species.orders[0].length.mean for species in loaded]))
    for number, species in enumerate(loaded):
        plants = kept.take(np.flatnonzero(kept.species == number))
        if len(plants):
            one = replace(plants, identifiers=(kinds[number],), species=np.zeros(len(plants), np.int32))
            out.append(make(in_year(scene, measure_of(species).flora), one))
    left = len(seeds) - len(kept)
    return [replace(one, of=one.of + left * (one is out[0])) for one in out]


def schedule() -> None:
    """Read the plants of what is open soon; many changes in a row are one reading."""
    if not bpy.app.background:
        # A forest of many plants must not keep the window busy while one of them is moved.
        call_soon(_on_timer, max([_SOON, *(preview.seconds for preview in state.previews.values())]))


def _on_timer() -> float | None:
    if timeline_moves():
        return _SOON  # all plants are read when it rests
    for window in bpy.context.window_manager.windows:
        scene = window.scene
        # Reading a large scene without plants takes seconds; one that had some has to lose their shapes.
        if scene.tetflora.preview.plants != 'NONE' and (find(scene) is not None or has_contents(scene)):
            depsgraph = window.view_layer.depsgraph
            if depsgraph is not None:
                read_shapes(scene, depsgraph)
    return None


def _on_update(scene: Scene, depsgraph: Depsgraph) -> None:
    if scene.tetflora.preview.plants == 'NONE' or not on_main_thread():  # what a render changes is not the artist's
        return
    preview = find(scene)
    for update in depsgraph.updates:
        datablock = update.id
        if isinstance(datablock, Object):
            group, placed = datablock.original.tetflora, update.is_updated_transform or update.is_updated_geometry
            changed = placed and (group.is_plant or group.is_field or is_drop(datablock.original))
        else:  # objects that are deleted or hidden are reported only as updates of what they are in
            known = preview is not None and isinstance(datablock, Scene | Collection)
            now = (len(shown_objects(depsgraph.view_layer)), _moment(scene)) if known and not timeline_moves() else None
            changed = now is not None and now != (preview.objects, preview.moment)
        if changed:
            schedule()
            return


def _on_frame(scene: Scene, depsgraph: Depsgraph | None = None) -> None:
    preview = find(scene)
    if scene.tetflora.preview.plants == 'NONE' or preview is None or preview.moment == _moment(scene):
        return
    watched = depsgraph is not None and depsgraph.mode == 'VIEWPORT'  # frames of a render are not the artist's
    if not watched or not on_main_thread():
        schedule()
    elif timeline_moves() and scene.tetflora.preview.plants == 'LIGHT':
        _follow(scene, depsgraph, preview, views_of(scene))
        schedule()
    elif preview.seconds >= _QUICK:
        schedule()
    else:
        read_shapes(scene, depsgraph)


def _moved(depsgraph: Depsgraph) -> bool:
    """Whether anything but a camera or a light is elsewhere than in the frame before."""
    changed = (u.id for u in depsgraph.updates if u.is_updated_transform or u.is_updated_geometry)
    return any(not (isinstance(one, Object) and one.type in {'CAMERA', 'LIGHT'}) for one in changed)


def _follow(scene: Scene, depsgraph: Depsgraph, preview: Preview, views: Sequence[NDArray[np.float64]]) -> None:
    """Show some of the plants in views (4, 4), on the scene's day and in its year; they are read at first only."""
    try:
        running, known = preview.running, (stand_years(scene), gone_species(scene))
        if running is None or running.known != known or _moved(depsgraph):
            others, (seeds, _) = _asset_crowns(scene, depsgraph, False), _plants_of(scene, depsgraph)
            running = preview.running = Running(seeds, others, known)
        if running.seen is None or not np.array_equal(running.views, views):
            running.seen, running.views = in_view(running.seeds, views), views
        seen, others = running.seen, running.others
        # Of very many, plants are as those are that look largest among them.
        make = light_plants if len(running.seeds) <= MOST_FACES else lambda *given: with_faces(crowns_of(*given))
        parts = [*_grown(scene, depsgraph, make, seen.seeds, seen), *others]
    except TetFloraError:  # which is told when all are read
        return
    of_all = len(running.seeds) + sum(one.of for one in others)
    preview.shapes = replace(joined(parts) if parts[1:] else parts[0], of=of_all) if parts else None
    preview.moment = _moment(scene)
    preview.changes += 1
    redraw('WINDOW')


def _moment(scene: Scene) -> tuple:
    return season_of(scene), years_of(scene), stand_years(scene)


def _on_load_pre(*_: object) -> None:
    state.previews.clear()
    call_off(_on_timer)


def _on_load_post(_path: object, _other: object = None) -> None:
    for scene in bpy.data.scenes:
        settings = scene.tetflora.preview
        if settings.freeze:  # the camera that was frozen is gone
            settings.freeze = False
        if settings.plants != 'NONE':
            schedule()


_HANDLERS = handlers(load_pre=_on_load_pre, load_post=_on_load_post)
_IN_WINDOW = handlers(
    depsgraph_update_post=_on_update, frame_change_post=_on_frame, undo_post=state.on_undo, redo_post=state.on_undo
)


register, unregister = in_order(
    _HANDLERS,
    *([] if bpy.app.background else [_IN_WINDOW]),
    listening(schedule, edits.listeners, state.listeners),
    end=_on_load_pre,
)
