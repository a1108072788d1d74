# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a scene of plants and meshes to results, in steps that can be shown, stopped and undone.

The engine works in a thread beside Blender's (`worker`); only reading and writing datablocks happens here.
"""

from __future__ import annotations

import json
from collections.abc import Generator, Sequence
from dataclasses import replace
from functools import partial

import bpy
import numpy as np

from ... import memory
from ...camera.camera import Camera, origin_near
from ...compiled.flora import Flora, compile_species
from ...emission.asset_plan import PlacedClusters
from ...emission.budget import afford
from ...emission.drawing import drawing
from ...emission.forms import EmissionForm, Refined
from ...emission.plants import Transition, expanded_blocks
from ...jobs import Progress, mapped
from ...processes import pool
from ...proxies.facet_weights import facet_weights, measuring, unmeasured
from ...refinement import loop
from ...refinement.decisions import Decision
from ...refinement.loop import Refinement, step_of
from ...refinement.settings import FIRST_LOOK, RefinementSettings
from ...refinement.statistics import Statistics, Stopwatch
from ..compat import drawn_disc
from ..main_thread import in_main_thread
from ..results.collection import Results
from ..results.forms import form_of
from ..results.hiding import hide_originals, remove_results
from ..results.leaf_objects import leaf_objects
from ..results.output import adopt_materials, release_materials, result_collections
from ..results.proxies import Baking, write_proxies
from ..runtime import JobData, guarded
from ..scene.camera import read_camera
from ..scene.objects import taking_part
from ..scene.skeletons import look_of
from ..worker import at_once, call_in_thread, nobody_waits, steps_in_thread
from .asset_writing import bake_light, write_assets, write_blocks, write_plain, write_polygons
from .assets import Bound, asset_warnings, bind_steps, is_plain
from .contents import Given, compile_for, in_wind, load_for, memory_left, read_scene, refinement_settings
from .limits import check_expanded, use_machine

#: Fraction of the progress bar that the loop takes; the rest is for writing meshes.
_LOOP_FRACTION = 0.6

#: Polygons, were all plants expanded, from which on other processes are started at once.
_MANY = 1e6


def refine_steps(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    *,
    view_layer: bpy.types.ViewLayer | None = None,
    for_render: bool = False,
    beside: Sequence[bpy.types.Collection] = (),
    camera: Camera | None = None,
    given: Given | None = None,
    mark: str = "",
    first_look: bool = False,
) -> Generator[Progress, bool | None, Statistics]:
    """Refine a scene step by step.

    Closing the generator, or an error, leaves the scene as it was. Earlier results are replaced at the end. Send True
    while it refines to go on to meshes with the current state; the statistics are then not complete.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph
        Evaluated for the frame.
    view_layer : bpy.types.ViewLayer, optional
        By default the dependency graph's.
    for_render : bool
        Results get a collection of their own beside the artist's, and are refined for the render region.
    beside : sequence of bpy.types.Collection
        Earlier results that stay: those of other view layers.
    camera : Camera, optional
        Instead of the scene's current one.
    given : Given, optional
        From `read_scene` for the scene.
    mark : str
        Suffix of the names of results.
    first_look : bool
        Show a coarse result within a second or so, while the job goes on, where somebody looks and it takes longer.
        That one replaces earlier results already, and stays when the job is closed.

    Raises
    ------
    TetFloraError
        No camera, nothing to refine, unknown species, unusable plants or meshes; the message says which.
    """
    layer = view_layer or depsgraph.view_layer
    data = JobData("Refine", scene, layer)
    if camera is None and scene.camera is not None:
        data.add_objects([scene.camera])
    data.add_objects(taking_part(scene))
    data.add_objects(leaf_objects(scene).values())
    results = Results(scene, 'RENDER' if for_render else 'VIEW', mark, data)
    return guarded(data, _refine_steps(data, results, depsgraph, layer, beside, camera, given, first_look))


def _refine_steps(
    data: JobData,
    results: Results,
    depsgraph: bpy.types.Depsgraph,
    layer: bpy.types.ViewLayer,
    beside: Sequence[bpy.types.Collection],
    camera: Camera | None,
    given: Given | None,
    first_look: bool,
) -> Generator[Progress, bool | None, Statistics]:
    clock, scene = Stopwatch(), results.scene
    use_machine(scene)
    yield Progress(0.0, "Reading the scene")
    if camera is None or given is None:
        depsgraph.update()  # reading what was deleted since the last step would crash Blender
    if camera is None:
        camera = read_camera(scene, depsgraph, region_only=results.purpose == 'RENDER')
    if given is None:
        given = read_scene(scene, depsgraph, layer)
    camera = camera.local()
    if scene.tetflora.expand_everything:  # for no camera: exports, and others' renderers
        camera = camera.counted_from(origin_near(given.seeds.position))
    given = given.counted_from(camera.origin)
    results.origin, results.owners = camera.origin, given.looks
    results.looks = [look_of(kind) for kind in given.species]
    clock.lap("read")
    progress = Progress(0.02, "Compiling species")
    yield progress
    flora = yield from call_in_thread(progress, compile_species, load_for(given.species, scene, depsgraph))
    flora = in_wind(scene, flora, camera, given.seeds.motion is not None)
    clock.lap("compile")
    full = yield from call_in_thread(progress, given.polygons_full, flora)
    if full > _MANY:
        pool.start()
    statistics = Statistics(plants=len(given.seeds), polygons_full=full, seconds=clock.seconds, unknown=given.unknown)
    refined = not scene.tetflora.expand_everything
    statistics.instances = sum(len(one) for one in given.places)
    asset_warnings.clear()
    bound, left = None, memory_left(scene, camera)
    if not refined:
        yield from call_in_thread(progress, check_expanded, flora, given.seeds, camera, left)
    plain = not refined or is_plain(scene, given.places, depsgraph, left)
    if not plain:
        bound = yield from bind_steps(scene, given.places, depsgraph, camera, left)
        clock.lap("compile")
    if bound is not None:
        statistics.polygons_full += bound.faces
        full += bound.faces
    # Explicit objects stay visible themselves where everything is expanded.
    originals = given.explicit.originals if given.explicit is not None and refined else []
    for earlier in result_collections(scene, 'VIEW'):
        adopt_materials(scene, earlier)
    if first_look and refined and full > _MANY and not nobody_waits():
        yield from _first_look(data, results, flora, given, bound, depsgraph, camera, beside, originals)
        clock.lap("first look")
    try:
        if not refined:
            in_main_thread(results.open)
            yield from write_blocks(results, flora, expanded_blocks(flora, given.seeds, camera), statistics, 0.05)
        elif plain and not given.others:
            in_main_thread(results.open)  # instances alone, best left as they are
        else:
            settings = refinement_settings(scene)
            work = _write_refined(results, flora, given, bound, depsgraph, camera, statistics, clock, settings)
            originals = [*originals, *(yield from work)]
        if plain:
            in_main_thread(partial(write_plain, results, given.places, statistics))
        clock.lap("emit")
        data.check()
    except BaseException:  # an error, Esc (GeneratorExit) or Ctrl+C
        in_main_thread(results.discard)
        raise
    in_main_thread(partial(_replace, results, beside, originals))
    memory.give_back()
    statistics.seconds = dict(clock.seconds)
    scene.tetflora.statistics = json.dumps(statistics.as_dict())
    return statistics


def _first_look(
    data: JobData,
    results: Results,
    flora: Flora,
    given: Given,
    bound: Bound | None,
    depsgraph: bpy.types.Depsgraph,
    camera: Camera,
    beside: Sequence[bpy.types.Collection],
    originals: Sequence[bpy.types.Object],
) -> Generator[Progress, bool | None, None]:
    """A coarse result in place of earlier ones, without baked light."""
    first = Results(results.scene, results.purpose, "", data)
    first.origin, first.owners, first.looks = results.origin, results.owners, results.looks
    given = replace(given, sources=None)
    settings, camera = refinement_settings(results.scene).first_look(), camera.smaller(FIRST_LOOK)
    try:
        work = _write_refined(first, flora, given, bound, depsgraph, camera, Statistics(), Stopwatch(), settings)
        more = yield from mapped(work, lambda p: Progress(0.02 + 0.03 * p.fraction, "First look", p.waiting))
        originals = [*originals, *more]
        data.check()
    except BaseException:
        in_main_thread(first.discard)
        raise
    in_main_thread(partial(_replace, first, beside, originals))
    data.forget(first.collection)


def _replace(results: Results, beside: Sequence[bpy.types.Collection], originals: Sequence[bpy.types.Object]) -> None:
    """Let new results take the place of earlier ones and of what they show."""
    remove_results(results.scene, results.purpose, keep=(results.collection, *beside))
    release_materials()
    hide_originals(results.scene, results.purpose, originals)
    results.finish()


def refine(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, **options: object) -> Statistics:
    """Refine a scene at once; options and errors as for `refine_steps`."""
    return at_once(refine_steps(scene, depsgraph, **options))


def partition(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[Camera, Refinement]:
    """Camera and tetrahedra after refinement, without making anything; for images of the partition.

    Both count from the camera's `origin`.

    Raises
    ------
    TetFloraError
        As `refine_steps`.
    """
    camera = read_camera(scene, depsgraph).local()
    given = read_scene(scene, depsgraph, depsgraph.view_layer).counted_from(camera.origin)
    flora = in_wind(scene, compile_for(given.species, scene, depsgraph), camera)
    bound = at_once(bind_steps(scene, given.places, depsgraph, camera, memory_left(scene, camera)))
    return camera, at_once(_run_loop(flora, given, bound, camera, refinement_settings(scene), Statistics()))


def clear(scene: bpy.types.Scene, for_render: bool | None = None) -> int:
    """Remove only what refinement made for a scene.

    Parameters
    ----------
    for_render : bool, optional
        Only what was made for a render (True), only what the artist made (False), or both (None).

    Returns
    -------
    int
        Number of datablocks removed.
    """
    removed = remove_results(scene, {None: None, True: 'RENDER', False: 'VIEW'}[for_render])
    if not for_render:
        scene.tetflora.statistics = ""
    return removed


def _run_loop(
    flora: Flora,
    given: Given,
    bound: Bound | None,
    camera: Camera,
    settings: RefinementSettings,
    statistics: Statistics,
) -> Generator[Progress, bool | None, Refinement]:
    """Refine; the statistics get a step for each pass."""
    placed = None if bound is None else bound.placed
    passes = loop.refine(flora, given.seeds, camera, settings, given.occluders, given.polygons, given.lights, placed)
    fraction, enough = 0.05, None
    while True:
        try:
            state, last = passes.send(enough), False
        except StopIteration as stop:
            state, last = stop.value, True
        statistics.steps.append(step_of(state))
        if last:
            return state
        waiting = int((state.decision == Decision.SPLIT).sum())
        fraction += 0.15 * (_LOOP_FRACTION - fraction)  # the number of passes is unknown
        enough = yield Progress(
            fraction, f"Refining, pass {state.passes}: {state.tree.tetrahedra_made:,} tetrahedra, {waiting:,} to split"
        )


def _refined(
    flora: Flora,
    given: Given,
    bound: Bound | None,
    camera: Camera,
    settings: RefinementSettings,
    form: EmissionForm,
    disc: float,
    baked: bool,
    statistics: Statistics,
    clock: Stopwatch,
) -> Generator[Progress, bool | None, Refined]:
    """Refine, and find out what the proxies depend on."""
    refinement = yield from _run_loop(flora, given, bound, camera, settings, statistics)
    yield Progress(_LOOP_FRACTION, "Choosing polygons and proxies")
    if form.facets and unmeasured(flora):
        yield Progress(_LOOP_FRACTION, "Analyzing leaf clustering")
        for name, done in measuring(flora, range(len(flora.species))):
            yield Progress(_LOOP_FRACTION, f'Analyzing leaf clustering of "{name}": {done:.0%}')
        yield Progress(_LOOP_FRACTION, "Choosing polygons and proxies")
    detail = afford(refinement, camera, settings, form.faces)
    clock.lap("refine")
    _count(statistics, detail.refinement)
    statistics.strays = given.named(refinement.strays)
    refinement, keeping = detail.refinement, None if bound is None else bound.keeping
    if not form.facets:
        return Refined(flora, refinement, camera, tolerance=detail.tolerance, keeping=keeping)
    clusters = None
    if bound is not None:
        looks = np.array([given.looks.get(owner, "") for owner in bound.owners])[bound.owner]
        how = bound.keeping, detail.asset_limit, looks, detail.asset_larger
        clusters = PlacedClusters(refinement.assets.placed, camera, *how)
    # Light is baked for facets, whatever is made of them then.
    becomes = None if baked else form.form(camera, disc)
    with_all = drawing(
        flora,
        refinement,
        camera,
        Transition(flora, camera, detail.leaf_limit, detail.tolerance),
        detail.facet,
        facet_weights(flora),
        detail.coarser,
        given.occluders,
        becomes,
        detail.most,
        settings.shadow_cutoff,
        clusters,
    )
    return Refined(flora, refinement, camera, with_all, detail.tolerance, keeping, disc)


def _write_refined(
    results: Results,
    flora: Flora,
    given: Given,
    bound: Bound | None,
    depsgraph: bpy.types.Depsgraph,
    camera: Camera,
    statistics: Statistics,
    clock: Stopwatch,
    settings: RefinementSettings,
) -> Generator[Progress, bool | None, list[bpy.types.Object]]:
    """Refine, and make meshes, instances and proxies; returns objects that scatter what has taken part."""
    scene, form = results.scene, form_of(results.scene)
    left = memory_left(scene, camera)
    # What the process holds already and what the image takes count too.
    settings = replace(settings, max_memory=left / 1e9 if np.isfinite(left) else 0.0)
    disc = drawn_disc(scene.render.engine)
    baked = given.sources is not None
    work = _refined(flora, given, bound, camera, settings, form.emission, disc, baked, statistics, clock)
    refined = yield from steps_in_thread(work, Progress(0.05, "Refining, pass 1"))
    in_main_thread(results.open)
    baking = None
    if given.sources is not None:
        baking = Baking(given.sources, leaves=scene.tetflora.baked_light == 'ALL')
    yield from write_blocks(results, flora, refined.mesh_blocks(), statistics, _LOOP_FRACTION, baking)
    if given.explicit is not None:
        yield from write_polygons(results, given.explicit, refined.polygon_blocks(), statistics, baking)
    hidden = []
    if bound is not None:
        hidden = yield from write_assets(results, form, bound, refined.asset_plan(), depsgraph, statistics)
    if baking is not None:
        clock.lap("emit")
        yield from bake_light(baking, refined)
        clock.lap("light")
    yield from write_proxies(results, form, refined, statistics, baking)
    return hidden


def _count(statistics: Statistics, refinement: Refinement) -> None:
    statistics.tetrahedra_made = int(refinement.tree.tetrahedra_made)
    statistics.tetrahedra_terminal = len(refinement.tree.terminals())
    statistics.tetrahedra_proxy = int(np.isin(refinement.decision, (Decision.PROXY, Decision.HIDDEN)).sum())
    statistics.passes = refinement.passes
    statistics.complete = refinement.complete
