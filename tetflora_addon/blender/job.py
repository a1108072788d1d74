# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole way from a scene of plants and meshes to results, as steps that can be shown, stopped and undone."""

from __future__ import annotations

import json
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from .. import emission, explicit_emission
from ..baked_emission import Sources
from ..budget import BYTES_PER_POLYGON, BYTES_PER_SPHERE, afford
from ..plants.catalogue import list_species, load_species
from ..plants.compiled import Flora, compile_species
from ..plants.growth import trunks
from ..plants.seeds import Seeds
from ..refinement.camera import Camera
from ..refinement.decisions import Decision
from ..refinement.lights import Light
from ..refinement.loop import Refinement
from ..refinement.loop import refine as refine_loop
from ..refinement.polygons import Polygons
from ..refinement.settings import RefinementSettings
from ..refinement.statistics import Statistics, Stopwatch
from ..refinement.steps import step_of
from ..refinement.transition import Transition
from ..shading.facet_shares import facet_shares
from .baked_material import baked_material
from .baking import Baking, read_sources
from .camera_reader import read_camera
from .emit import Results, has_results, hide_originals, originals_shown, remove_results, result_collections
from .explicit_objects import Explicit, read_explicit
from .leaf_forms import materials_of, resolved_species
from .light_reader import read_lights
from .output import adopt_materials, release_materials
from .properties import settings_from
from .proxies import tell_facets, write_proxies
from .scene_reader import NoPlantsError, read_occluders, read_plants
from .wind_properties import wind_of

__all__ = ["Progress", "clear", "compile_for", "estimate", "has_results", "partition", "refine", "refine_steps"]

#: Shells fill their tetrahedra, so that even hidden ones must not be larger than this many pixels.
SHELL_BLOCK = 16.0
#: And those that are seen no larger than this many: an even fog has no shape but that of its tetrahedron.
SEEN_SHELL_BLOCK = 4.0
#: Share of the progress bar that the loop takes; the rest is for writing meshes.
_LOOP_SHARE = 0.6


@dataclass(frozen=True)
class Progress:
    """One step of a job.

    Attributes
    ----------
    fraction : float
        0 to 1, an estimate.
    message : str
        What is being done, for the status bar.
    """

    fraction: float
    message: str


def compile_for(identifiers: tuple[str, ...], scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Flora:
    """Load and compile species, leaf objects of the scene included.

    Without any, for meshes alone, it is a shipped one, of which nothing grows: files and edits of the artist's that the
    scene has no use for must not cost time, or be wrong.

    Raises
    ------
    SpeciesError
        Unknown or broken species, or a leaf object that is missing or not a mesh with faces.
    """
    if not identifiers:
        return compile_species([load_species(min(list_species()))])
    return compile_species([resolved_species(scene, identifier, depsgraph) for identifier in identifiers])


def blown(scene: bpy.types.Scene, flora: Flora) -> Flora:
    """A flora in the scene's wind at its frame."""
    wind = wind_of(scene)
    return flora if wind is None else flora.in_wind(wind)


def estimate(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Statistics:
    """What the scene would be if it were expanded, without growing anything.

    Raises
    ------
    TetFloraError
        As `refine`.
    """
    given = read_scene(scene, depsgraph, depsgraph.view_layer)
    flora = compile_for(given.species, scene, depsgraph)
    return Statistics(plants=len(given.seeds), polygons_full=_polygons_full(flora, given))


@dataclass(frozen=True)
class Given:
    """What a scene holds; ``explicit`` is None where no mesh takes part, ``sources`` where no light is baked."""

    seeds: Seeds
    explicit: Explicit | None
    occluders: np.ndarray
    lights: tuple[Light, ...]
    sources: Sources | None = None

    @property
    def species(self) -> tuple[str, ...]:
        """Species of its plants."""
        return self.seeds.identifiers

    @property
    def polygons(self) -> Polygons | None:
        """All explicit polygons."""
        return None if self.explicit is None else Polygons.everything(self.explicit.meshes)


def read_scene(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, view_layer: bpy.types.ViewLayer) -> Given:
    """All that takes part in refinement but the camera.

    Raises
    ------
    TetFloraError
        As `refine_steps`.
    """
    with originals_shown(scene, depsgraph):
        explicit = read_explicit(depsgraph, view_layer)
        try:
            seeds = read_plants(scene, depsgraph, view_layer)
        except NoPlantsError:
            if explicit is None:
                raise
            none = np.zeros(0)
            frames = none.reshape(0, 3), none.reshape(0, 3, 3)
            seeds = Seeds((), none.astype(np.int32), none.astype(np.int64), *frames, none)
        lights = read_lights(depsgraph, view_layer) if scene.tetflora.shadow_cutoff > 0.0 else ()
        baked = scene.tetflora.baked_light != 'OFF' and not scene.tetflora.expand_everything
        sources = read_sources(scene, depsgraph, view_layer) if baked else None
        return Given(seeds, explicit, read_occluders(scene, depsgraph, view_layer), lights, sources)


def _polygons_full(flora: Flora, given: Given) -> int:
    plants = round(flora.polygons[trunks(flora.rows, given.seeds).row].sum())
    return plants + (given.explicit.meshes.faces if given.explicit else 0)


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
) -> Generator[Progress, bool | None, Statistics]:
    """Refine a scene step by step.

    Closing the generator, or an error, leaves the scene as it was. Earlier results are replaced when all is done.
    Sending it True while it refines makes it go on with what there is; the statistics say that it is not complete.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph
        Evaluated for the frame that is wanted.
    view_layer : bpy.types.ViewLayer, optional
        Whose plants count; by default the dependency graph's.
    for_render : bool
        Results live beside those of the artist, in a collection of their own, and are refined for the render region.
    beside : sequence of bpy.types.Collection
        Earlier results that stay: those of other view layers.
    camera : Camera, optional
        In place of the scene's as it stands.
    given : Given, optional
        What `read_scene` has said of it.
    mark : str
        Comes after the names of results.

    Raises
    ------
    TetFloraError
        No camera, nothing to refine, unknown species, unusable plants or meshes; the message says which.
    """
    clock = Stopwatch()
    yield Progress(0.0, "Reading the scene")
    if camera is None:
        camera = read_camera(scene, depsgraph, region_only=for_render)
    if given is None:
        given = read_scene(scene, depsgraph, view_layer or depsgraph.view_layer)
    settings = refinement_settings(scene)
    clock.lap("read")
    yield Progress(0.02, "Compiling species")
    flora = blown(scene, compile_for(given.species, scene, depsgraph))
    clock.lap("compile")
    full = _polygons_full(flora, given)
    statistics = Statistics(plants=len(given.seeds), polygons_full=full, seconds=clock.seconds)
    originals = []
    results = Results(scene, 'RENDER' if for_render else 'VIEW', mark)
    for earlier in result_collections(scene, 'VIEW'):
        adopt_materials(scene, earlier)
    try:
        if scene.tetflora.expand_everything:
            results.open()
            # Explicit objects are what they are; they stay in view by themselves.
            yield from _write_blocks(results, flora, emission.expanded_blocks(flora, given.seeds), statistics, 0.05)
        else:
            refinement = yield from _run_loop(flora, given, camera, settings, statistics)
            facets = scene.tetflora.proxy_form != 'SHELLS'
            facet_bytes = BYTES_PER_SPHERE if scene.tetflora.proxy_form == 'MICROSPHERES' else BYTES_PER_POLYGON
            refinement, side = afford(flora, refinement, camera, settings, facets, facet_bytes)
            clock.lap("refine")
            _count(statistics, refinement)
            if facets:
                yield Progress(_LOOP_SHARE, "Looking at how leaves cluster")
                facet_shares(flora)
            results.open()
            baking = None
            if given.sources is not None:
                baking = Baking(given.sources, leaves=scene.tetflora.baked_light == 'ALL')
            transition = Transition(flora, camera, settings.leaf_limit) if facets else None
            blocks = emission.explicit_blocks(flora, refinement, transition)
            yield from _write_blocks(results, flora, blocks, statistics, _LOOP_SHARE, baking)
            if given.explicit is not None:
                originals = given.explicit.originals
                kept = explicit_emission.polygon_blocks(refinement, camera, side if facets else None)
                yield from _write_polygons(results, given.explicit, kept, statistics, baking)
            if baking is not None:
                clock.lap("emit")
                yield from _bake(baking, flora, refinement, camera, side if facets else None, transition)
                clock.lap("light")
            yield Progress(0.95, "Making proxies")
            for done in write_proxies(results, flora, refinement, camera, statistics, side, transition, baking):
                yield Progress(0.95 + 0.05 * done, f"Making proxies: {statistics.polygons_proxy:,}")
        clock.lap("emit")
    except BaseException:  # an error, Esc (GeneratorExit) or Ctrl+C: nothing of ours may stay behind
        results.discard()
        raise
    remove_results(scene, results.purpose, keep=(results.collection, *beside))
    release_materials()
    hide_originals(scene, results.purpose, originals)
    results.finish()
    statistics.seconds = dict(clock.seconds)
    scene.tetflora.statistics = json.dumps(statistics.as_dict())
    return statistics


def refine(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, **options: object) -> Statistics:
    """Refine a scene at once; options and errors as for `refine_steps`."""
    steps = refine_steps(scene, depsgraph, **options)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def partition(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[Camera, Refinement]:
    """Camera and state of space after refinement, without making anything; for pictures of the partition.

    Raises
    ------
    TetFloraError
        As `refine_steps`.
    """
    camera, given = read_camera(scene, depsgraph), read_scene(scene, depsgraph, depsgraph.view_layer)
    flora = blown(scene, compile_for(given.species, scene, depsgraph))
    loop = _run_loop(flora, given, camera, refinement_settings(scene), Statistics())
    while True:
        try:
            next(loop)
        except StopIteration as stop:
            return camera, stop.value


def clear(scene: bpy.types.Scene, for_render: bool | None = None) -> int:
    """Remove what refinement made for a scene, and nothing else.

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


def refinement_settings(scene: bpy.types.Scene) -> RefinementSettings:
    """The scene's settings, as fine as its form of proxies needs them."""
    settings = settings_from(scene)
    if scene.tetflora.proxy_form != 'SHELLS':
        return settings
    return replace(settings, hidden_block=SHELL_BLOCK, proxy_block=SEEN_SHELL_BLOCK)


def _run_loop(
    flora: Flora, given: Given, camera: Camera, settings: RefinementSettings, statistics: Statistics
) -> Generator[Progress, bool | None, Refinement]:
    """Refine; the statistics get a step for each pass."""
    loop = refine_loop(flora, given.seeds, camera, settings, given.occluders, given.polygons, given.lights)
    fraction, enough = 0.05, None
    while True:
        try:
            state, last = loop.send(enough), False
        except StopIteration as stop:
            state, last = stop.value, True
        statistics.steps.append(step_of(state))
        if last:
            return state
        waiting = int((state.decision == Decision.SPLIT).sum())
        fraction += 0.15 * (_LOOP_SHARE - fraction)  # nobody knows how many passes will follow
        enough = yield Progress(
            fraction, f"Refining, pass {state.passes}: {state.tree.tetrahedra_made:,} tetrahedra, {waiting:,} to divide"
        )


def _count(statistics: Statistics, refinement: Refinement) -> None:
    statistics.tetrahedra_made = int(refinement.tree.tetrahedra_made)
    statistics.tetrahedra_terminal = len(refinement.tree.terminals())
    statistics.tetrahedra_proxy = int(np.isin(refinement.decision, (Decision.PROXY, Decision.HIDDEN)).sum())
    statistics.levels = refinement.passes
    statistics.complete = refinement.complete


def _write_blocks(
    results: Results, flora: Flora, blocks: object, statistics: Statistics, start: float, baking: Baking | None = None
) -> Generator[Progress, None, None]:
    materials: dict[tuple[int, str, int], list[bpy.types.Material]] = {}
    for block in blocks:
        species, what = flora.species[block.species], (block.species, block.kind, block.form)
        if what not in materials:
            baked = baking is not None and baking.leaves
            made = [baked_material()] if baked else materials_of(results.scene, species, block.kind, block.form)
            materials[what] = made
        name = f"{species.name} {block.kind} {block.number:03d}"
        obj = results.add(name, block.kind, block.buffers, materials[what], species)
        if baking is not None:
            baking.add(obj, block.buffers, lit=True)
        statistics.polygons_meshed += block.buffers.polygons
        statistics.memory_mb += block.buffers.nbytes / 1e6
        yield Progress(start + (0.95 - start) * block.fraction, f"Making polygons: {statistics.polygons_meshed:,}")


def _write_polygons(
    results: Results, explicit: Explicit, blocks: object, statistics: Statistics, baking: Baking | None = None
) -> Generator[Progress, None, None]:
    for block in blocks:
        name = explicit.meshes.surfaces[block.surface].name
        materials = explicit.materials[block.surface]
        obj = results.add(f"{name} {block.number:03d}", "explicit", block.buffers, materials)
        if baking is not None:
            baking.add(obj, block.buffers, lit=False)
        statistics.polygons_meshed += block.buffers.polygons
        statistics.memory_mb += block.buffers.nbytes / 1e6
        yield Progress(0.95, f"Keeping polygons: {statistics.polygons_meshed:,}")


def _bake(
    baking: Baking,
    flora: Flora,
    refinement: Refinement,
    camera: Camera,
    facet_pixels: float | None,
    transition: Transition | None,
) -> Generator[Progress, None, None]:
    """Find the light of all that is drawn, and give it to meshes; facets of so many pixels, none for shells."""
    if facet_pixels is not None:
        for count in tell_facets(baking, flora, refinement, camera, facet_pixels, transition):
            yield Progress(0.9, f"Baking light: {count:,} facets")
    for done in baking.look(flora, refinement, camera, facet_pixels is not None):
        yield Progress(0.9 + 0.03 * done, f"Baking light: {done:.0%} of the shadows")
    for done in baking.light_meshes():
        yield Progress(0.93 + 0.02 * done, f"Baking light: {done:.0%} of the leaves")
