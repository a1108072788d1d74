# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine at Render: handlers before and after each rendered frame, on load and on save.

Their order has these reasons (tried on 4.5 and 5.2):

- ``render_pre`` comes before Blender goes to the frame: in animations the camera is still that of the frame before, so
  the handler goes to the frame itself. Objects made there are in the image of that frame.
- 5.2 crashes if objects that were rendered are deleted in ``render_post`` or ``render_write``, while the renderer still
  holds them. They are deleted in the next ``render_pre``, and in ``render_complete`` or ``render_cancel`` at the end.
- Results of a render are marked as runtime data, which Blender never writes into a file.
- With a window, handlers run in the render's thread: what links, hides or removes goes to the main thread, and without
  *Lock Interface* everything.
"""

import sys
import time
import traceback
from dataclasses import dataclass, field
from functools import partial

import bpy

from ...errors import TetFloraError
from ...jobs import Progress
from ..main_thread import in_main_thread, later, restore_in_main_thread, window_draws
from ..results import hiding
from ..results.collection import has_results, leave_out_of_file, result_collections
from ..results.output import KIND, adopt_materials, release_materials
from ..results.proxy_kinds import raise_settings
from ..runtime import Listeners, complain, failed_frames, handlers, is_there, redraw, remember, show_status, with_uid
from ..saved_files import clear_unreadable, migrate
from ..scene.objects import has_contents, has_plants, show_in, view_layer_groups
from ..scene.plants import NoPlantsError
from ..species.edits import looked_at_once
from . import frame_cache, refine
from .contents import asset_warnings, read_scene
from .forecast import forecast, learn

_OFTEN = 0.2  # seconds between two texts about plants that are prepared


@dataclass
class _Rendering:
    """What to undo when a render ends; each `session_uid`, because references are invalid after a file is loaded."""

    busy: bool = False
    hidden: list[int] = field(default_factory=list)
    lifted: dict[tuple[str, str], str] = field(default_factory=dict)  # marks of originals, while a file is written
    raised: dict[int, dict[tuple[str, str], int]] = field(default_factory=dict)  # as they were, by scene
    outer: int = 0  # scene that is rendered; those that its sequencer shows begin and end renders of their own
    scenes: list[int] = field(default_factory=list)  # all of these
    warnings: list[str] = field(default_factory=list)
    told: float = 0.0  # when it was said last how far plants are; 0 where nothing is shown
    took: float = 0.0  # seconds of the last refinement


_rendering = _Rendering()
#: Notified when a render shows no plants because nothing is refined.
nothing_refined = Listeners()


def render_errors() -> list[str]:
    """Messages of the frames of the last render that were rendered without their plants."""
    return list(failed_frames)


def on_render_init(scene: bpy.types.Scene, _depsgraph: object = None) -> None:
    """When a render starts: clear earlier errors, unless it is part of another render."""
    if _rendering.outer not in {0, scene.session_uid}:
        return
    failed_frames.clear()
    _rendering.warnings.clear()


def on_render_pre(scene: bpy.types.Scene, _depsgraph: object = None) -> None:
    """Before a frame: refine for its camera, unless the frame cache has its results."""
    if _rendering.busy:
        return
    _rendering.busy = True
    _rendering.outer = _rendering.outer or scene.session_uid
    if scene.session_uid not in _rendering.scenes:
        _rendering.scenes.append(scene.session_uid)
    refined = False
    try:
        wanted = scene.tetflora.refine_at_render and scene.tetflora.output.show_render
        # What is hidden may be in no collection meanwhile.
        if wanted and (has_contents(scene) or hiding.hidden_originals(scene)):
            make = partial(_make, scene)
            with looked_at_once():
                if window_draws():
                    name = (with_uid(bpy.data.scenes, _rendering.outer) or scene).name
                    about = "is off, so the window stands still while frames are refined"
                    _warn(f'Lock Interface of the scene "{name}" {about}', "lock")
                    in_main_thread(make)
                else:
                    make()
            refined = True
        elif not scene.tetflora.refine_at_render and has_plants(scene):
            nothing = all(KIND not in obj for obj in scene.objects)
            if nothing and _warn("nothing is refined and Refine at Render is off, so the render shows no plants", ""):
                nothing_refined.notify()
    except NoPlantsError:
        pass  # the artist has disabled or hidden all of them
    except TetFloraError as error:
        _complain(scene, f"without plants: {error}")
    except Exception as error:
        # Blender would only print it and go on.
        traceback.print_exc()
        text = f"unexpected error, please report it as a bug: {error!r}"
        _complain(scene, f"without plants: {text}")
        remember(text, error)
    finally:
        if not refined:
            restore_in_main_thread(partial(_take_back, scene))
            if has_results(scene):
                _rendering.raised.setdefault(scene.session_uid, {}).update(raise_settings(scene))
        if _rendering.told:
            _rendering.told = 0.0
            later(show_status)
        _rendering.busy = False


def on_render_end(scene: bpy.types.Scene, _depsgraph: object = None) -> None:
    """After the last frame, or when the render was cancelled: leave all scenes as they were.

    Not yet after a scene of a sequencer: Blender 5.2 crashes if its objects are gone before the outer render ends.
    """
    if _rendering.busy or _rendering.outer not in {0, scene.session_uid}:
        return
    _rendering.busy = True
    rendered = {*_rendering.scenes, scene.session_uid}
    try:
        for other in bpy.data.scenes:
            if other.session_uid in rendered and other.library is None:
                restore_in_main_thread(partial(_take_back, other))
        if _rendering.took:
            restore_in_main_thread(partial(_learn, scene))
    finally:
        _rendering.busy, _rendering.outer = False, 0
        _rendering.scenes.clear()


def on_save_pre(_path: object, _other: object = None) -> None:
    """Before a file is written: undo what is hidden or raised for a render."""
    _show_hidden()
    for uid in _rendering.raised:
        _lower(uid)
    leave_out_of_file()
    _rendering.lifted = hiding.lift_marks()
    hiding.pack_override_marks()


def on_save_post(_path: object, _other: object = None) -> None:
    """After a file was written: hide and raise it again for a render that goes on."""
    for collection in _existing(_rendering.hidden):
        collection.hide_render = True
    for uid in _rendering.raised:
        if (scene := with_uid(bpy.data.scenes, uid)) is not None:
            raise_settings(scene)
    hiding.unpack_override_marks()
    hiding.restore_marks(_rendering.lifted)
    _rendering.lifted.clear()
    release_materials()


def on_load_post(_path: object, _other: object = None) -> None:
    """After a file was read: forget earlier renders, show objects whose results it lacks, migrate properties."""
    global _rendering
    clear_unreadable()
    _rendering = _Rendering()
    failed_frames.clear()
    frame_cache.reset()
    hiding.unpack_override_marks()
    hiding.show_left_over()
    for scene in bpy.data.scenes:
        if scene.library is None and scene.tetflora.statistics and not has_results(scene):
            scene.tetflora.statistics = ""
    migrate()


def _make(scene: bpy.types.Scene) -> None:
    """Make results for the frame to be rendered, and hide the artist's own results."""
    _tell(Progress(0.0, "Reading the scene"))
    in_main_thread()  # before the view layers are evaluated here
    # Also where nothing is animated: the renderer does so next, and only this gives a depsgraph of the frame.
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
    wanted = []
    for layers in in_main_thread(partial(_layers_of, scene)):
        layers[0].update()  # going to the frame updates only the active layer's depsgraph
        depsgraph = layers[0].depsgraph
        given = read_scene(scene, depsgraph)
        read = frame_cache.shared_camera(scene, depsgraph, given), given
        wanted.append((frame_cache.key_of(scene, depsgraph, layers, *read), layers, read))
    in_main_thread(partial(frame_cache.stow, scene, [key for key, *_ in wanted]))
    for key, layers, (camera, given) in wanted:
        layer, cached = layers[0], in_main_thread(partial(frame_cache.recall, scene, key))
        new = [] if cached is None else [cached]
        if cached is None:
            options = {"for_render": True, "camera": camera, "given": given, "mark": key[:8], "tell": _tell}
            before = result_collections(scene, 'RENDER')
            statistics = refine.refine(scene, layer.depsgraph, beside=before, **options)
            _rendering.took = sum(statistics.seconds.values())
            if statistics.unknown:
                _complain(scene, f"without some plants: {statistics.unknown}")
            elif statistics.left_out:
                _warn(statistics.left_out, " ".join(sorted(statistics.outliers)))
            for text in asset_warnings:
                _warn(text, text)
            new = [c for c in result_collections(scene, 'RENDER') if c not in before]
            for collection in new:
                in_main_thread(partial(frame_cache.store, scene, key, collection, camera))
        in_main_thread(partial(show_in, scene, new, layers))
    in_main_thread(partial(_hide, scene, [key for key, *_ in wanted]))
    if len(scene.view_layers) > 1 or _rendering.outer != scene.session_uid:
        # Otherwise Blender crashes when it renders new objects in a layer that is not the window's, or for a sequencer.
        for layer in scene.view_layers:
            layer.update()
    _rendering.raised.setdefault(scene.session_uid, {}).update(raise_settings(scene))


def _tell(progress: Progress) -> None:
    """Say in the window how far plants are: Blender itself says "Rendering" and 0 % meanwhile."""
    if (now := time.monotonic()) - _rendering.told > _OFTEN:
        _rendering.told = now
        text = f"TetFlora {progress.fraction:4.0%}   {progress.message}"
        later(partial(show_status, f"{text}   |   The window is locked until the render ends"))


def _learn(scene: bpy.types.Scene) -> None:
    """What a refinement took is what panels expect of the next one, whoever began it."""
    if is_there(scene) and not scene.render.use_border:
        learn(forecast(scene, scene.view_layers[0]), _rendering.took)
    _rendering.took = 0.0
    redraw()


def _layers_of(scene: bpy.types.Scene) -> list[list[bpy.types.ViewLayer]]:
    """View layers with the same plants, at the scene's frame."""
    for earlier in result_collections(scene, 'VIEW'):
        adopt_materials(scene, earlier)  # before all else, or the next frame would count as changed
    with hiding.originals_shown(scene):  # the previous frame has hidden some
        return view_layer_groups(scene)


def _hide(scene: bpy.types.Scene, keys: list[str]) -> None:
    """Hide what results of a render replace, and the artist's own: not before they are made, or there might be none."""
    frame_cache.hide_for(scene, keys)
    _rendering.hidden += [c.session_uid for c in result_collections(scene, 'VIEW') if not c.hide_render]
    for collection in _existing(_rendering.hidden):
        collection.hide_render = True


def _take_back(scene: bpy.types.Scene) -> None:
    if not is_there(scene):  # undo, for which the main thread has waited
        return
    _show_hidden()
    _rendering.hidden.clear()
    _lower(scene.session_uid)
    _rendering.raised.pop(scene.session_uid, None)
    frame_cache.clear(scene)
    refine.clear(scene, for_render=True)


def _lower(scene: int) -> None:
    datablock = with_uid(bpy.data.scenes, scene)  # a script may delete it between two frames
    for (engine, name), value in _rendering.raised.get(scene, {}).items() if datablock is not None else ():
        setattr(getattr(datablock, engine), name, value)


def _show_hidden() -> None:
    for collection in _existing(_rendering.hidden):
        collection.hide_render = False


def _existing(uids: list[int]) -> list[bpy.types.Collection]:
    return [collection for uid in uids if (collection := with_uid(bpy.data.collections, uid)) is not None]


def _warn(text: str, about: str) -> bool:
    """Warn in the terminal, once in a render of many frames; whether that was now."""
    if about in _rendering.warnings:
        return False
    _rendering.warnings.append(about)
    print(f"TetFlora: warning: {text}", file=sys.stderr, flush=True)
    return True


def _complain(scene: bpy.types.Scene, message: str) -> None:
    text = f"frame {scene.frame_current} was rendered {message}"
    failed_frames.append(text)
    complain(text)


_END = dict.fromkeys(("render_complete", "render_cancel"), on_render_end)
_SAVED = dict.fromkeys(("save_post", "save_post_fail"), on_save_post)
register, unregister = handlers(
    render_init=on_render_init, render_pre=on_render_pre, save_pre=on_save_pre, load_post=on_load_post, **_END, **_SAVED
)
