# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine Automatically: in the window, shortly after the camera, plants or settings change, in slices between redraws.

A change stops the work, which starts again after `QUIET` seconds without changes. Where the digest of everything that
refinement depends on is the same as last time, nothing is done. Earlier results stay until there are new ones, but not
through undo. What removes datablocks stops the work. Blender tells nobody when a viewport is turned or shaded
otherwise: while one shows plants in *Rendered* shading it is on by itself.

What was not seen is coarse, which shows from another side. So results go as soon as the view is no longer `alike`, and
simple shapes stand for them until there is a first look; else they stay until all is sharp, without a first look.
"""

import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import blake2b
from math import cos, radians

import bpy
import numpy as np

from ...arrays import unit
from ...camera.camera import Camera
from ...errors import TetFloraError
from ...jobs import Job, Pace
from ...refinement.loop import Statistics
from ..job import refine
from ..job.frame_cache import choices, scene_digest
from ..job.stored_contents import stored_contents, stored_contents_steps
from ..main_thread import in_main_thread
from ..materials.nodes import is_ours, is_own
from ..placing.plant_objects import prepare_scene
from ..properties import auto_refine_switched
from ..results.collection import has_results
from ..results.hiding import remove_results
from ..results.leaf_objects import leaf_objects
from ..results.output import PURPOSE, remove_collection, result_collections
from ..runtime import GoneError, Outlook, Part, call_off, call_soon, handlers, in_order, listening, redraw, with_uid
from ..scene.camera import is_rendered, view_camera, viewport_of, viewports
from ..scene.fields import stand_years
from ..settings import season_of, wind_of, years_of
from .state import camera_now, find

#: Seconds without a change before it begins, and seconds of work between two redraws.
QUIET, SLICE = 0.6, 0.02
_MADE_FOR = "tetflora_made_for"  # on result collections, see `results_made_for`
_BUSY = 0.5  # seconds until it looks again whether Blender has time
_LOOK = 0.1  # seconds between two looks at the viewport
#: How much farther than its image a view may show what results were made for, in parts of its width, and from where.
_BEYOND, _TURNED = 0.04, radians(2.0)
_CHANGING = (bpy.types.Object, bpy.types.Camera, bpy.types.Light, bpy.types.Mesh, bpy.types.PointCloud, bpy.types.Curve)


@dataclass
class _State:
    """The job of the session; the scene by its `session_uid`, because datablocks do not outlive a load."""

    scene: int = 0
    steps: Job[Statistics] | None = None
    digest: str = ""  # of the job
    made_for: dict[str, str] = field(default_factory=dict)
    pace: Pace = field(default_factory=lambda: Pace(SLICE, SLICE))
    due: float = 0.0
    message: str = ""
    working: bool = False  # in here right now: what changes is our own doing
    paused: int = 0  # others that refine
    view: tuple[int, str] = (0, "")  # a scene, and that of the viewport when it was looked at last
    camera: Camera | None = None  # of the job
    ours: set[int] = field(default_factory=set)  # scenes where Rendered shading has switched it on
    refused: set[int] = field(default_factory=set)  # where the artist does not want it there


_state = _State()
_done: dict[int, str] = {}  # digest of the results that a scene has, by its `session_uid`
_seen: dict[int, Camera | None] = {}  # the view that these are for
_sharp: set[int] = set()  # scenes of which at most the view has changed since all was refined


def message() -> str:
    """Text for the panel; empty where there is nothing to report."""
    return _state.message


def _switched(scene: bpy.types.Scene) -> None:
    """It was switched on or off in a scene, by the artist unless we are at work."""
    if not _state.working:
        _state.ours.discard(scene.session_uid)
        if is_rendered(scene):
            _state.refused.add(scene.session_uid)
        _begin_anew(scene)


def _begin_anew(scene: bpy.types.Scene) -> None:
    stop()
    _state.message, _state.view = "", (0, "")
    if scene is not None and scene.tetflora.auto_refine:
        schedule(scene)
    watch()


def _follows_viewport(scene: bpy.types.Scene) -> bool:
    return scene.tetflora.follow_viewport or scene.session_uid in _state.ours


def watch() -> float | None:
    """Follow how the viewport of the scene in the window is turned and shaded; seconds until the next look."""
    scene = bpy.context.scene
    if scene is not None:
        _follow_shading(scene)
    follows = scene is not None and scene.tetflora.auto_refine and _follows_viewport(scene)
    now = view_camera(scene) if follows else None
    if follows and (view := (scene.session_uid, repr(now or camera_now(scene)))) != _state.view:
        (other, before), _state.view = _state.view, view
        if before:
            schedule(scene, by_view=True)
        if before and other == scene.session_uid and not (_is_busy() or _still_good(scene, now)):
            remove_results(scene, 'VIEW')
    if not bpy.app.background:
        call_soon(watch, _LOOK)
    return _LOOK if follows or not bpy.app.background else None


def _follow_shading(scene: bpy.types.Scene) -> None:
    """Switch it on where a viewport shows plants in Rendered shading, and off again where none does."""
    on, uid, rendered, preview = scene.tetflora.auto_refine, scene.session_uid, is_rendered(scene), find(scene)
    if not rendered:
        _state.refused.discard(uid)
    has_plants = preview is not None and preview.shapes is not None
    if not on and uid not in _state.refused and has_plants if rendered else on and uid in _state.ours:
        _state.ours.add(uid)
        _state.working = True
        scene.tetflora.auto_refine, _state.working = rendered, False
        _begin_anew(scene)
        redraw()


def alike(before: Camera | None, now: Camera | None, away: float) -> bool:
    """Whether results for one view do for another, until there are new ones.

    All that it shows so many meters away is in their image then, and it is seen from nearly the same side.
    """
    if before is None or now is None or not before.kind == now.kind == "PERSP":
        return False
    rim = np.array([(x, y, -1.0) for x in now.window[:2] for y in now.window[2:]]) * away
    points = now.position + rim @ now.frame.T
    then, now_along = unit(points.mean(axis=0) - np.stack([before.position, now.position]))
    inside = before.widened(_BEYOND).distance_to_view(points).max() <= 0.0
    return bool(inside and then @ now_along > cos(_TURNED))


def _still_good(scene: bpy.types.Scene, now: Camera | None) -> bool:
    """Whether results are better than simple shapes, or these would not be seen."""
    rendered = [space for space, _ in viewports(scene) if space.shading.type == 'RENDERED']
    if scene.tetflora.preview.plants == 'NONE' or not all(space.overlay.show_overlays for space in rendered):
        return True
    return alike(_seen.get(scene.session_uid), now, _away(scene))


def _away(scene: bpy.types.Scene) -> float:
    """Meters to what a viewport turns around."""
    return viewport[0].region_3d.view_distance if (viewport := viewport_of(scene)) else 1.0


def schedule(scene: bpy.types.Scene, by_view: bool = False) -> None:
    """Refine a scene when it has been quiet for a moment; stops what was begun before."""
    stop()
    if not by_view:
        _sharp.discard(scene.session_uid)
    _state.scene, _state.due = scene.session_uid, time.monotonic() + QUIET
    if not bpy.app.background:
        call_soon(tick, QUIET)


def stop() -> None:
    """Stop, and take away what is half made."""
    if _state.steps is not None:
        _state.working = True
        try:
            _state.steps.close()
        finally:
            _state.steps, _state.working, _state.message = None, False, ""


@contextmanager
def paused() -> Iterator[None]:
    """Stop, and wait while somebody else refines: each would take away what the other has half made."""
    stop()
    _state.paused += 1
    try:
        yield
    finally:
        _state.paused -= 1


def refined(scene: bpy.types.Scene) -> None:
    """Somebody else has refined a scene as it is now: what that made need not be made again."""
    if scene.tetflora.auto_refine:
        layer = _view_layer(scene)
        layer.update()
        _done[scene.session_uid] = scene_digest(scene, layer.depsgraph)  # for the scene's camera


def _is_busy() -> bool:
    """Whether others work with results, or the artist with something else."""
    return _state.paused > 0 or bpy.app.is_job_running('RENDER') or bpy.context.mode != 'OBJECT'


def tick() -> float | None:
    """Do a slice of what there is to do; seconds until the next, or None if nothing is left."""
    scene = with_uid(bpy.data.scenes, _state.scene)
    if scene is None or not scene.tetflora.auto_refine:
        stop()
        return None
    wait = _state.due - time.monotonic()
    if _state.steps is None and wait > 0.0:
        return wait
    if _is_busy():
        _state.message = "Waits for Object Mode" if bpy.context.mode != 'OBJECT' else ""
        return _BUSY
    _state.working = True
    try:
        more = _begin(scene) if _state.steps is None else _slice(scene)
    except GoneError:  # deleted by somebody of whom Blender has told nothing: what is left is refined anew
        _state.steps, _state.message, more = None, "", True
        _state.due = time.monotonic() + QUIET
    except Exception as error:
        expected = isinstance(error, TetFloraError)
        _state.steps, more = None, False
        said = str(error).partition("; ")[0]  # the panel has a line
        _state.message = said if expected else f"unexpected error, please report it as a bug: {error!r}"
        redraw()
        if not expected:
            raise
    finally:
        _state.working = False
    return 0.001 if more else None


def _begin(scene: bpy.types.Scene) -> bool:
    """Start the job if what it depends on has changed."""
    layer = _view_layer(scene)
    layer.update()
    camera = view_camera(scene) if _follows_viewport(scene) else None
    digest = scene_digest(scene, layer.depsgraph, camera)
    if _done.get(scene.session_uid) == digest and has_results(scene):
        note_results(scene, results_made_for(scene))
        _sharp.add(scene.session_uid)
        _state.message = ""
        redraw()
        return False
    _state.digest, _state.made_for, _state.pace = digest, results_made_for(scene), Pace(SLICE, SLICE)
    seen = scene.session_uid in _sharp and has_results(scene)
    coarse = not (seen and alike(_seen.get(scene.session_uid), camera, _away(scene)))
    _state.camera, _state.steps = camera, refine.refine_steps(scene, layer.depsgraph, camera=camera, first_look=coarse)
    if coarse:
        _seen[scene.session_uid] = camera
        _sharp.discard(scene.session_uid)
    return True


def _slice(scene: bpy.types.Scene) -> bool:
    _state.pace.begin()
    try:
        progress = next(_state.steps)
        while _state.pace.goes_on(progress):
            progress = next(_state.steps)
    except StopIteration as stop:
        _state.steps, _state.message = None, stop.value.unknown
        _done[scene.session_uid], _seen[scene.session_uid] = _state.digest, _state.camera
        _sharp.add(scene.session_uid)
        note_results(scene, _state.made_for)
        prepare_scene(scene)
        redraw()
        return False
    text = f"{progress.fraction:.0%}  {progress.message}"
    if text != _state.message and _state.pace.tells():
        _state.message = text
        redraw('UI')  # the view itself may take longer than the slice
    return True


def _view_layer(scene: bpy.types.Scene) -> bpy.types.ViewLayer:
    shown = next((window.view_layer for window in bpy.context.window_manager.windows if window.scene == scene), None)
    return shown or scene.view_layers[0]


def _contents_steps(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> Generator[None, None, dict[str, str]]:
    """What takes part, where there are results; refined where theirs was another: of H, nothing else tells."""
    now = (yield from stored_contents_steps(scene, layer)) if has_results(scene) else {}
    if scene.tetflora.auto_refine and _state.steps is None and changed_since(scene, now):
        schedule(scene)
    return now


_outlook = Outlook(_contents_steps)


def results_made_for(scene: bpy.types.Scene, ask: Callable = stored_contents) -> dict[str, str]:
    """What decides on results and is cheap to ask, as texts that differ, by what to call it; some may not be known."""
    *settings, wind, season, years, disc = choices(scene)
    grown = [one.field.tetflora.stand_year for one in scene.tetflora.layers if one.field]
    parts = {
        "the camera": camera_now(scene),
        "the day or year": (season, years, grown),
        "the wind": wind,
        "settings": (settings, disc),
        "the layers": [(one.uid, one.made, one.placed_by, one.shown) for one in scene.tetflora.layers],
        "the species": [(one.identifier, one.text) for one in scene.tetflora.species_edits],
    }
    texts = {name: blake2b(repr(part).encode(), digest_size=8).hexdigest() for name, part in parts.items()}
    return texts | (ask(scene, _view_layer(scene)) or {})


def note_results(scene: bpy.types.Scene, made_for: dict[str, str]) -> None:
    """Mark new results of a scene with what they were made for."""
    for collection in result_collections(scene, 'VIEW'):
        collection[_MADE_FOR] = made_for


def changed_since(scene: bpy.types.Scene, now: Mapping[str, str] | None = None) -> list[str]:
    """What has changed since the results of a scene were made; nothing where these do not say for what."""
    before = next((c[_MADE_FOR].to_dict() for c in result_collections(scene, 'VIEW') if _MADE_FOR in c), {})
    now = results_made_for(scene, _outlook.of) if before and now is None else now or {}
    return [name for name, text in now.items() if before.get(name, text) != text]


_known: dict[int, str] = {}  # settings of scenes as they were at the last change


def on_change(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Something in a scene changed: is it anything of what refinement depends on?"""
    if _state.working or not scene.tetflora.auto_refine:
        return
    settings = f"{choices(scene)}{camera_now(scene)}{leaf_objects(scene)}"
    other = _known.get(scene.session_uid) != settings
    _known[scene.session_uid] = settings
    changed = [one for one in depsgraph.updates if isinstance(one.id.original, _CHANGING)]
    concerns = [one for one in changed if not is_ours(one.id.original)]
    # Objects that have neither moved nor another form nor other settings may have been hidden.
    formed = [one for one in concerns if one.is_updated_transform or one.is_updated_geometry]
    flags = not formed and all(isinstance(one.id.original, bpy.types.Object) for one in concerns)
    # Results that are linked have the flags of all other objects updated, and that when we are no longer at work: the
    # job would stop itself for ever. Whoever hid an object meanwhile is seen when it is done.
    if other or (concerns and not (flags and _state.steps is not None and scene.session_uid == _state.scene)):
        schedule(scene)


def on_frame(scene: bpy.types.Scene, _depsgraph: object = None) -> None:
    """Another frame: in the wind all plants have moved, and it may be another day or year."""
    if _state.working or not scene.tetflora.auto_refine:
        return
    if wind_of(scene) is not None or season_of(scene) is not None or years_of(scene) > 0.0 or stand_years(scene):
        schedule(scene)


def on_interruption(*_arguments: object) -> None:
    """Undo, load or render: datablocks that the job holds may go."""
    scene = with_uid(bpy.data.scenes, _state.scene) if _state.steps is not None else None
    stop()
    if scene is not None:
        schedule(scene)


def before_undo(*_arguments: object) -> None:
    """Take away what comes back by itself: it was made without a step of undo.

    Undo keeps datablocks that are equal in two steps, such as the scene, with their pointers. Those to results that
    neither step knows would lead to freed memory, and Blender would crash.
    """
    on_interruption()
    for scene in bpy.data.scenes:
        if scene.library is None and scene.tetflora.auto_refine and has_results(scene):
            refine.clear(scene, for_render=False)


def after_undo(*_arguments: object) -> None:
    """Refine again; results that the step knew are gone from a scene that was kept."""
    for collection in [c for c in bpy.data.collections if PURPOSE in c and is_own(c) and not c.users]:
        remove_collection(None, collection)
    scene = bpy.context.scene
    if scene is not None and scene.tetflora.auto_refine:
        schedule(scene)


def on_load(*_arguments: object) -> None:
    """Another file: its results are none of ours."""
    stop()
    for of_scenes in (_done, _seen, _known, _sharp, _state.ours, _state.refused):
        of_scenes.clear()
    _state.message, _state.view = "", (0, "")
    call_off(tick)
    call_off(watch)


def before_save(*_arguments: object) -> None:
    """Blender opens files in Solid shading: there, what Rendered shading has switched on is off."""
    _state.working = True
    for scene in (scene for scene in bpy.data.scenes if scene.session_uid in _state.ours):
        scene.tetflora.auto_refine = False
    _state.working = False


_HANDLERS = handlers(
    depsgraph_update_post=on_change,
    frame_change_post=(on_frame, lambda *_: _outlook.ask()),
    undo_pre=before_undo,
    redo_pre=before_undo,
    undo_post=after_undo,
    redo_post=after_undo,
    render_init=lambda *_: in_main_thread(on_interruption),
    load_pre=(on_interruption, on_load),
    load_post=lambda *_: _begin_anew(bpy.context.scene),
    save_pre=before_save,
)
_FIRST = Part(lambda: call_soon(watch, _LOOK) if not bpy.app.background else None, lambda: None)
register, unregister = in_order(listening(_switched, auto_refine_switched), _HANDLERS, _outlook, _FIRST, end=on_load)
