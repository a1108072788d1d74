# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine the scene or only the levels of viewports, clear or keep results, convert plants, and clear the cache."""

from bpy.types import Context, Event, Object, Operator, Scene

from ..tetflora_addon.blender.declare import once
from ..tetflora_addon.blender.job import refine
from ..tetflora_addon.blender.job.contents import asset_warnings
from ..tetflora_addon.blender.job.forecast import forecast, learn, seconds_here
from ..tetflora_addon.blender.job.plant_mesh import make_plant_mesh_steps
from ..tetflora_addon.blender.placing.plant_objects import prepare_scene
from ..tetflora_addon.blender.results import hiding
from ..tetflora_addon.blender.results.collection import has_results
from ..tetflora_addon.blender.results.hiding import keep_results
from ..tetflora_addon.blender.results.proxy_kinds import few_bounces
from ..tetflora_addon.blender.runtime import failed_frames, is_there, redraw, stop_jobs
from ..tetflora_addon.blender.scene.lights import read_world
from ..tetflora_addon.blender.viewport import auto, state
from ..tetflora_addon.blender.viewport.levels import level_steps
from ..tetflora_addon.blender.viewport.warnings import cut_off
from ..tetflora_addon.jobs import Job
from ..tetflora_addon.preview.levels import Levels
from ..tetflora_addon.refinement.loop import Statistics
from . import base

_WARNINGS = 4  # about assets, that are told one by one


_has_camera = base.need(lambda context: context.scene.camera is not None, base.NO_CAMERA)


class TETFLORA_OT_refine(base.ModalJob, Operator, label="Refine", needs=(base.in_object_mode, _has_camera)):
    """Create meshes of plants near the scene camera and proxies of the others, replacing earlier results.

    Esc cancels without changes; Return stops refining and creates what has been decided so far.
    """

    keys = "Esc: Cancel   |   Return: Finish Early"

    def steps(self, context: Context) -> Job[Statistics]:
        scene, nothing = context.scene, not has_results(context.scene)
        made_for, expected = auto.results_made_for(scene), forecast(scene, context.view_layer)
        self.expected = seconds_here(expected) if expected else 0.0
        with auto.paused():
            job = refine.refine_steps(scene, context.evaluated_depsgraph_get(), first_look=nothing)
            try:
                statistics = yield from job
                auto.note_results(scene, made_for)
                # At first crowns may not have been known.
                learn(expected or forecast(scene, context.view_layer), sum(statistics.seconds.values()))
                return statistics
            except BaseException:
                job.close()
                if nothing and is_there(scene):
                    refine.clear(scene, for_render=False)
                raise

    def finish(self, context: Context, statistics: Statistics) -> set[str]:
        scene = context.scene
        prepare_scene(scene)
        if statistics.complete:
            auto.refined(scene)
        failed_frames.clear()
        redraw()
        self.report({'INFO'}, _outcome(scene, statistics))
        if not statistics.complete and statistics.passes:
            self.report({'INFO'}, "Stopped early; click Refine again to complete the result")
        outside = cut_off(scene)[0] or _unseen(scene, statistics)
        # The first warnings, and how many more there are.
        more = len(asset_warnings) - _WARNINGS
        told = [*asset_warnings[:_WARNINGS], f"{more:,} more warnings about assets"] if more > 1 else asset_warnings
        others = statistics.left_out, statistics.coarser, outside, few_bounces(scene), _unread_world(scene)
        for warning in filter(None, (*told, *others)):
            self.report({'WARNING'}, warning)
        return {'FINISHED'}


def _outcome(scene: Scene, statistics: Statistics) -> str:
    """What was refined, and what of it was made."""
    instances = base.counted(statistics.instances, "instance")
    if not (statistics.passes or statistics.plants) and statistics.instances_whole == statistics.instances > 0:
        why = "" if scene.tetflora.expand_everything else ", as the renderer draws these at the least cost"
        return f"{instances} of assets stay the originals{why}"
    what = [base.counted(statistics.plants, "plant")] if statistics.plants or not statistics.instances else []
    what += [f"{instances} of assets"] if statistics.instances else []
    polygons = statistics.polygons_meshed + statistics.polygons_proxy  # as the panel and Max Polygons count
    geometry = f"{polygons:,} polygons"
    if statistics.instances:
        whole, clusters = statistics.instances_whole, statistics.instances_clusters
        geometry = f"{base.counted(whole, 'original')}, {base.counted(clusters, 'cluster')}, {geometry}"
    elif polygons < statistics.polygons_full:
        geometry += f" instead of {statistics.polygons_full:,}"
    return f"{' and '.join(what)}: {geometry} in {sum(statistics.seconds.values()):.1f} s"


def _unread_world(scene: Scene) -> str:
    """Parts of the world that baked lighting could not read, else an empty text."""
    if scene.tetflora.baked_light == 'OFF' or scene.tetflora.expand_everything:
        return ""
    note = read_world(scene).note
    return f"Baked lighting: {note}" if note else ""


def _unseen(scene: Scene, statistics: Statistics) -> str:
    """A warning if the camera sees no plant at all, so that nothing was divided after the first look; else empty."""
    near = statistics.polygons_meshed or statistics.instances_whole or statistics.instances_clusters
    if scene.camera is None or statistics.passes != 1 or near or scene.tetflora.max_passes:
        return ""
    return (
        f'The camera "{scene.camera.name}" sees no plants. Press Numpad 0 to look through it, and check that it '
        "points at the plants and is not inside an object"
    )


# Meshes stay hidden where results were deleted by hand. Only then are all objects looked through: panels ask often.
_clearable = base.need(
    lambda context: (
        has_results(context.scene) or (context.scene.tetflora.statistics and hiding.hidden_originals(context.scene))
    ),
    "No results to clear",
)


class TETFLORA_OT_clear(base.Reporting, Operator, label="Clear", needs=(base.in_object_mode, _clearable)):
    """Remove all meshes, materials and proxies that Refine created, and nothing else.

    Plants remain, and hidden meshes are shown again.
    """

    def run(self, context: Context) -> set[str]:
        auto.stop()
        stop_jobs("its results were cleared")
        hidden = hiding.hidden_originals(context.scene, 'VIEW')
        removed = f"{base.counted(refine.clear(context.scene), 'datablock')} removed"
        shown = sum(hiding.HIDDEN['VIEW'] not in original for original in hidden)
        return self.done(f"{removed}, {base.counted(shown, 'object')} shown again" if shown else removed)


_has_results = base.need(
    lambda context: has_results(context.scene), "No results to keep; click Refine, or wait until it is done"
)


class TETFLORA_OT_keep_results(
    base.Reporting, Operator, label="Keep Results as Meshes", needs=(base.in_object_mode, _has_results)
):
    """Turn the results into ordinary meshes that are saved in the file and can be edited.

    Refine and Clear no longer change them. Turns off Refine at Render, to avoid rendering the plants twice.
    """

    def run(self, context: Context) -> set[str]:
        scene = context.scene
        auto.stop()
        stop_jobs("the results were kept as meshes")
        kept = keep_results(scene)
        scene.tetflora.refine_at_render = False
        scene.tetflora.statistics = ""
        return self.done(f"{base.counted(kept, 'object')} kept as meshes; Refine at Render is off")


class TETFLORA_OT_make_plant_mesh(
    base.ModalJob, Operator, label="Convert Plants to Meshes", needs=(base.in_object_mode, base.plants_selected)
):
    """Create an ordinary mesh object of each selected plant, with every branch and leaf, to edit, export or animate.

    The plant remains, but disabled; Clear does not remove the mesh. Esc cancels without changes.
    """

    def steps(self, context: Context) -> Job[list[Object]]:
        return make_plant_mesh_steps(context.scene, context.evaluated_depsgraph_get(), base.selected_plants(context))

    def finish(self, context: Context, objects: list[Object]) -> set[str]:
        context.view_layer.update()
        base.select_only(context, objects)
        polygons = sum(len(obj.data.polygons) for obj in objects)
        return self.done(f"{base.counted(len(objects), 'mesh object')} of {polygons:,} polygons made")


_camera_found = base.need(
    lambda context: context.scene.camera is not None or getattr(state.find(context.scene), "frozen", None) is not None,
    base.NO_CAMERA,
)


class TETFLORA_OT_preview_levels(base.ModalJob, Operator, label="Compute Levels", needs=(_camera_found,)):
    """Refine for the scene camera, or the frozen one, without creating meshes, and keep every level to step through in
    viewports.

    Takes as long as the first part of Refine; Esc cancels and keeps the previous levels.
    """

    bl_options = {'REGISTER'}  # nothing in the file changes but the level that is shown
    cancelled = "Cancelled; the levels are unchanged"
    clear: once.boolean("Clear Levels", "Remove the levels from viewports and memory instead. The file does not change")

    def invoke(self, context: Context, event: Event) -> set[str]:
        return self.execute(context) if self.clear else super().invoke(context, event)

    def run(self, context: Context) -> set[str]:
        if not self.clear:
            return super().run(context)
        if getattr(state.find(context.scene), "levels", None) is None:
            return self.refused("No levels to clear; click Compute Levels first")
        state.forget(context.scene)
        return {'FINISHED'}

    def steps(self, context: Context) -> Job[Levels]:
        return level_steps(context.scene, context.evaluated_depsgraph_get())

    def finish(self, context: Context, levels: Levels) -> set[str]:
        last = levels.levels[-1]
        context.scene.tetflora.preview.level = last.number
        return self.done(
            f"{base.counted(len(levels), 'level')}, {len(last):,} tetrahedra with plants, {levels.nbytes / 1e6:.0f} MB"
        )
