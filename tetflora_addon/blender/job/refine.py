# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a scene of plants and meshes to results, in steps that can be shown, stopped and undone.

The engine works in a thread beside Blender's (`worker`); only reading and writing datablocks happens here.

While Blender takes one block over, the engine makes the next. Instances of assets are originals or meshes of clusters.
"""

import json
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from typing import Any

import bpy
import numpy as np

from ... import memory
from ...arrays import Integers, Integers32, Keys
from ...assets.measures import kite_mesh
from ...buffers import MeshBuffers, concatenate_buffers
from ...camera.camera import Camera, origin_near
from ...compiled.flora import Flora, compile_species
from ...emission.asset_plan import AssetPlan, PlacedClusters
from ...emission.budget import fit_to_budget
from ...emission.drawing import drawing, tiles_of
from ...emission.emitters import Buffers, EmissionInput
from ...emission.plants import Block, Transition, expanded_blocks
from ...emission.polygons import PolygonBlock
from ...errors import SceneError
from ...jobs import Job, Progress, mapped
from ...processes import pool
from ...proxies.facet_weights import facet_weights, measuring, unmeasured
from ...refinement import loop
from ...refinement.decisions import Decision
from ...refinement.lights import sun_of
from ...refinement.loop import Refinement, Statistics, Stopwatch, step_of
from ...refinement.settings import FIRST_LOOK, RefinementSettings
from ...species.kinds import Kind
from ..assets.places import Places, Target
from ..compat import drawn_disc
from ..main_thread import in_main_thread, restore_in_main_thread
from ..materials.materials import baked_material
from ..results.collection import Results
from ..results.hiding import hide_originals, originals_shown, remove_results
from ..results.instances import add_cluster, add_cluster_instances, add_instances, add_stand_in, carrier_of
from ..results.leaf_objects import leaf_objects, materials_of
from ..results.meshes import AssetMeshes, cluster_mesh_steps, mesh_steps, read_mesh
from ..results.output import MEGABYTES, adopt_materials, release_materials, result_collections
from ..results.proxies import Baking, ProxyWriter, proxy_writer
from ..results.proxy_kinds import ProxyKind, proxy_kind_of
from ..runtime import JobData, guarded
from ..scene.camera import read_camera
from ..scene.objects import taking_part
from ..worker import call_in_thread, nobody_waits, run_to_end, steps_in_thread, written
from . import contents

#: Clusters of which meshes are made between two looks at the window.
_BATCH = 16
#: Fraction of the progress bar that the loop takes; the rest is for writing meshes.
_LOOP_FRACTION = 0.6
#: Of a first look: sides of what nobody sees over those that are asked for, and pixels down to which shadows go.
_UNSEEN = 4.0, 64.0
#: Polygons, were all plants expanded, from which on other processes are started at once.
_MANY = 1e6


@dataclass
class _Run:
    """One refinement: what it reads, what it has made of that, and where results go.

    Camera and contents are None until read; ``beside`` are earlier results that stay, ``originals`` what they replace.
    """

    depsgraph: bpy.types.Depsgraph
    camera: Camera | None = None
    given: contents.SceneContents | None = None
    data: JobData | None = None
    results: Results | None = None
    beside: Sequence[bpy.types.Collection] = ()
    flora: Flora | None = None
    bound: contents.SceneAssets | None = None
    settings: RefinementSettings | None = None
    originals: list[bpy.types.Object] = field(default_factory=list)
    statistics: Statistics = field(default_factory=Statistics)
    clock: Stopwatch = field(default_factory=Stopwatch)
    form: ProxyKind | None = None
    baking: Baking | None = None
    tiles: int = 0  # into which a first look and what replaces it are divided
    whole: tuple[Camera, RefinementSettings] | None = None  # of what a first look stands for


def _scatters(owner: bpy.types.Object | None) -> bool:
    """Whether an object shows its instances itself; plants do not."""
    return owner is not None and not owner.tetflora.is_plant and not owner.tetflora.is_field


def _write_plain(run: _Run) -> None:
    """Write instances of plants as originals; objects that scatter go on showing theirs themselves."""
    shown: dict[tuple[Target, bpy.types.Object | None], list[Places]] = {}
    for one in run.given.places:
        run.statistics.instances_whole += len(one)
        if not _scatters(one.owner):
            shown.setdefault((one.target, one.owner if run.given.looks[one.owner] else None), []).append(one)
    for number, ((target, like), every) in enumerate(shown.items()):
        matrices, keys = (np.concatenate([getattr(one, name) for one in every]) for name in ("matrices", "keys"))
        source = target.datablock or carrier_of(run.results, target)
        add_instances(run.results, f"{target.name} {number:03d}", source, matrices, _ids(keys), like)


def _ids(keys: Keys) -> Integers32:
    return (keys >> np.uint64(33)).astype(np.int32)


def write_assets(run: _Run, plan: AssetPlan) -> Job[None]:
    """Write what a plan draws as instances."""
    results, bound, statistics = run.results, run.bound, run.statistics
    asset, owner = bound.placed.instances.asset, bound.owner
    # Objects of which every instance is the original go on showing them themselves.
    changed = np.ones(len(bound.placed), bool)
    changed[plan.originals] = False
    alone = np.bincount(owner, changed, len(bound.owners)) == 0
    alone &= np.array([_scatters(one) for one in bound.owners], bool)
    ids = _ids(bound.placed.instances.key)
    progress = Progress(0.94, "Placing instances")
    yield progress
    whole = plan.originals[~alone[owner[plan.originals]]]
    for number, (target, shown, rows) in enumerate(_groups(bound, asset[whole], owner[whole])):
        group = whole[rows]
        source = target.datablock or carrier_of(results, target)
        add_instances(results, f"{target.name} {number:03d}", source, bound.matrices[group], ids[group], shown)
        yield progress
    statistics.instances_whole = len(whole) + int(alone[owner[plan.originals]].sum())
    for parts, maker in ((plan.meshes, _clusters), (plan.kites, _kites)):
        for target in range(len(bound.targets)):
            rows = np.flatnonzero(asset[parts.instance] == target)
            if len(rows):
                cluster = parts.cluster[rows] - bound.placed.assets.root[target]
                yield from _write_clusters(run, target, cluster, parts.instance[rows], ids, maker)
    for number, shown in enumerate(bound.owners):
        if _scatters(shown) and not alone[number]:
            run.originals.append(shown)
            with originals_shown(results.scene, run.depsgraph):
                add_stand_in(results, f"{shown.name} {number:03d}", shown, run.depsgraph)


def _groups(
    bound: contents.SceneAssets, asset: Integers32, owner: Integers32
) -> Iterator[tuple[Target, bpy.types.Object | None, Integers]]:
    """Rows (k,) of the same asset and the same owner each."""
    for pair in np.unique(asset.astype(np.int64) * len(bound.owners) + owner).tolist():
        target, shown = divmod(pair, len(bound.owners))
        yield bound.targets[target], bound.owners[shown], np.flatnonzero((asset == target) & (owner == shown))


Maker = Callable[[int, str], Generator[None, None, tuple[bpy.types.Mesh, int]]]


def _clusters(run: _Run, target: int) -> Maker:
    """What makes meshes of clusters of their own faces, with the number of these."""
    surfaces, numbers, matrices = [], [], []  # numbered as those of its `AssetSource`
    with originals_shown(run.results.scene, run.depsgraph):
        for part, *one in run.bound.targets[target].meshes(run.depsgraph):
            numbers += [len(surfaces)] * len(part.matrices)
            surfaces.append(read_mesh(*one))
            matrices.append(part.matrices)
    meshes = AssetMeshes(surfaces, np.array(numbers, np.int32), np.concatenate(matrices))
    asset = run.bound.placed.assets.every[target]

    def make(cluster: int, name: str) -> Generator[None, None, tuple[bpy.types.Mesh, int]]:
        part, face = asset.faces_of(cluster)
        return (yield from cluster_mesh_steps(meshes, name, part, face)), len(face)

    return make


def _kites(run: _Run, target: int) -> Maker:
    """What makes meshes of kites for the leaves of clusters."""
    material = run.form.asset_material()
    run.results.use([material])
    asset = run.bound.placed.assets.every[target]

    def make(cluster: int, name: str) -> Generator[None, None, tuple[bpy.types.Mesh, int]]:
        buffers = kite_mesh(asset.leaves_of(cluster))
        return (yield from mesh_steps(name, buffers, [material])), buffers.polygons

    return make


def _write_clusters(
    run: _Run, target: int, cluster: Integers, instance: Integers, ids: Integers32, maker: Callable[[_Run, int], Maker]
) -> Job[None]:
    """Meshes of the clusters of one asset, each once, and instances of them."""
    results, bound, make, kites = run.results, run.bound, maker(run, target), maker is _kites
    name = bound.targets[target].name + (" kites" if kites else "")
    progress = Progress(0.94, f'Making clusters of "{name}"')
    yield progress
    like = bound.targets[target].datablock
    like = like if isinstance(like, bpy.types.Object) else None
    used, pick = np.unique(cluster, return_inverse=True)
    objects = []
    for number, one in enumerate(used.tolist()):
        mesh, faces = yield from progress.during(make(one, f"{name} {number:06d}"))
        objects.append(add_cluster(results, name, number, mesh, like))
        if kites:
            run.statistics.polygons_proxy += faces
        else:
            run.statistics.polygons_meshed += faces
        if number % _BATCH == 0:
            yield progress
    shown = bound.owner[instance]
    for number, who in enumerate(np.unique(shown).tolist()):
        rows = np.flatnonzero(shown == who)
        group = instance[rows]
        places = pick[rows].astype(np.int32), bound.matrices[group], ids[group]
        add_cluster_instances(results, f"{name} clusters {number:03d}", objects, *places, bound.owners[who])
    run.statistics.instances_clusters += len(cluster)


def _write_blocks(
    run: _Run, blocks: Iterator[int | Block | Buffers], start: float, write_proxy: ProxyWriter | None = None
) -> Job[None]:
    """Write blocks of plants, of a tile after its number; progress goes from a fraction to .95, statistics count."""
    materials: dict[tuple[int, str, int], list[bpy.types.Material]] = {}
    progress = Progress(start, "Making polygons")

    def write(block: int | Block | Buffers) -> Generator[None, None, Progress]:
        nonlocal progress
        if isinstance(block, int):
            yield from run.results.begin(block)
        elif isinstance(block, Block):
            progress = yield from write_mesh(block)
        else:
            progress = replace((yield from write_proxy(block)), fraction=progress.fraction)
        return progress

    def write_mesh(block: Block) -> Generator[None, None, Progress]:
        species, what = run.flora.species[block.species], (block.species, block.kind, block.form)
        if what not in materials:
            if run.baking is not None and run.baking.leaves:
                materials[what] = [baked_material()]
            else:
                materials[what] = materials_of(run.results.scene, species, block.kind, block.form)
            run.results.use(materials[what])  # from now on, as Esc may come before its first object
        name = f"{species.name} {block.kind} {block.number:03d}"
        yield
        look = run.results.look_of(block.species)
        obj = yield from run.results.add(name, block.kind, block.buffers, materials[what], species, look)
        _record_mesh(run, obj, block.buffers, lit=True)
        text = f"Making polygons: {run.statistics.polygons_meshed:,}"
        return Progress(start + (0.95 - start) * block.fraction, text)

    yield from written(_of_all_ages(run, blocks), write, progress)
    yield from progress.during(run.results.begin(None))


def _of_all_ages(run: _Run, blocks: Iterator[int | Block | Buffers]) -> Iterator[int | Block | Buffers]:
    """Blocks of which those of one species, look and bark at several ages are one mesh: objects cost renderers time."""
    first: dict[tuple[str, str, str], int] = {}
    named = [(one.identifier, run.results.look_of(n), one.bark) for n, one in enumerate(run.flora.species)]
    same = [first.setdefault(named[n], n) if one.skeleton is None else n for n, one in enumerate(run.flora.species)]
    if same == list(range(len(same))):
        yield from blocks
        return
    for of_plants, run_of in groupby(blocks, key=lambda block: isinstance(block, Block) and (block.number,)):
        if not of_plants:
            yield from run_of
            continue
        parts: dict[tuple[int, str, int], list[Block]] = {}
        for block in run_of:
            parts.setdefault((same[block.species], block.kind, block.form), []).append(block)
        for alike in parts.values():
            yield replace(alike[-1], buffers=concatenate_buffers([block.buffers for block in alike]))


def _write_polygons(run: _Run, blocks: Iterator[PolygonBlock]) -> Job[None]:
    """Write polygons of meshes that take part, with their own materials; the statistics count."""
    explicit = run.given.explicit

    def write(block: PolygonBlock) -> Generator[None, None, Progress]:
        surface, materials = explicit.meshes.surfaces[block.surface], explicit.materials[block.surface]
        name = f"{surface.name} {block.number:03d}"
        obj = yield from run.results.add(name, "explicit", block.buffers, materials, look=surface.look)
        _record_mesh(run, obj, block.buffers, lit=False)
        return Progress(0.95, f"Keeping polygons: {run.statistics.polygons_meshed:,}")

    yield from written(blocks, write, Progress(0.95, "Keeping polygons"))


def _record_mesh(run: _Run, obj: bpy.types.Object, buffers: MeshBuffers, lit: bool) -> None:
    if run.baking is not None:
        run.baking.add(obj, buffers, lit)
    run.statistics.polygons_meshed += buffers.polygons
    run.statistics.memory_mb += buffers.nbytes / 1e6


def _bake_light(baking: Baking, refined: EmissionInput) -> Job[None]:
    """Compute the light of everything, and write that of meshes."""
    if refined.facet_pixels is not None:
        facets = (Progress(0.9, f"Baking light: {count:,} facets") for count in baking.add_facets(refined))
        yield from steps_in_thread(facets, Progress(0.9, "Baking light"))
    shadows = (Progress(0.9 + 0.03 * done, f"Baking light: {done:.0%} of the shadows") for done in baking.look(refined))
    yield from steps_in_thread(shadows, Progress(0.9, "Baking light"))
    progress = Progress(0.93, "Baking light")
    for done in baking.light_meshes():
        if done is not None:
            progress = Progress(0.93 + 0.02 * done, f"Baking light: {done:.0%} of the leaves")
        yield progress.repeated if done is None else progress


def refine_steps(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    *,
    for_render: bool = False,
    beside: Sequence[bpy.types.Collection] = (),
    camera: Camera | None = None,
    given: contents.SceneContents | None = None,
    mark: str = "",
    first_look: bool = False,
) -> Job[Statistics]:
    """Refine a scene step by step.

    Closing the generator, or an error, leaves the scene as it was. Earlier results are replaced at the end. Send True
    while it refines to go on to meshes with the current state; the statistics are then not complete.

    Parameters
    ----------
    for_render : bool
        Results get a collection of their own beside the artist's, and are refined for the render region.
    beside : sequence of bpy.types.Collection
        Earlier results that stay: those of other view layers.
    camera : Camera, optional
        Instead of the scene's current one.
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
    data = JobData("Refine", scene, depsgraph)
    if camera is None and scene.camera is not None:
        data.add_objects([scene.camera])
    data.add_objects(taking_part(scene))
    data.add_objects(leaf_objects(scene).values())
    results = Results(scene, 'RENDER' if for_render else 'VIEW', mark, data)
    return guarded(data, _refine_steps(_Run(depsgraph, camera, given, data, results, beside), first_look))


def _refine_steps(run: _Run, first_look: bool) -> Job[Statistics]:
    results, depsgraph, clock, statistics = run.results, run.depsgraph, run.clock, run.statistics
    scene = results.scene
    if scene.library is not None:
        raise SceneError(f'The scene "{scene.name}" is linked from another file; open that file, or append the scene')
    contents.use_machine(scene)
    yield Progress(0.0, "Reading the scene")
    if run.camera is None or run.given is None:
        depsgraph.update()  # reading what was deleted since the last step would crash Blender
    camera = run.camera or read_camera(scene, depsgraph, region_only=results.purpose == 'RENDER')
    given = run.given or contents.read_scene(scene, depsgraph)
    camera = camera.local()
    if scene.tetflora.expand_everything:  # for no camera: exports, and others' renderers
        camera = camera.counted_from(origin_near(given.seeds.position))
    run.camera, run.given = camera, given.counted_from(camera.origin)
    given = run.given
    results.origin, results.owners = camera.origin, given.looks
    results.looks = [Kind.read(kind).look for kind in given.species]
    clock.lap("read")
    yield (progress := Progress(0.02, "Compiling species"))
    flora = yield from call_in_thread(progress, compile_species, contents.load_for(given.species, scene, depsgraph))
    flora = run.flora = contents.in_wind(scene, flora, camera, given.seeds.motion is not None)
    clock.lap("compile")
    full = yield from call_in_thread(progress, given.polygons_full, flora)
    if full > _MANY:
        pool.start()
    statistics.plants, statistics.polygons_full, statistics.unknown = len(given.seeds), full, given.unknown
    statistics.instances = sum(len(one) for one in given.places)
    refined = not scene.tetflora.expand_everything
    contents.asset_warnings.clear()
    left = contents.memory_left(scene, camera)
    if not refined:
        yield from call_in_thread(progress, contents.check_expanded, flora, given.seeds, camera, left)
    plain = not refined or contents.is_plain(scene, given.places, depsgraph, left)
    if not plain:
        run.bound = yield from contents.bind_steps(scene, given.places, depsgraph, camera, left)
        clock.lap("compile")
    if run.bound is not None:
        statistics.polygons_full += run.bound.faces
    # Explicit objects stay visible themselves where everything is expanded.
    run.originals = [*given.explicit.originals] if given.explicit is not None and refined else []
    for earlier in result_collections(scene, 'VIEW'):
        adopt_materials(scene, earlier)
    large = max(camera.width, camera.height) > 2 * FIRST_LOOK  # or a first look takes half as long as all
    if first_look and refined and large and statistics.polygons_full > _MANY and not nobody_waits():
        results.first = yield from _first_look(run)
        clock.lap("first look")
    try:
        in_main_thread(results.open)
        if not refined:
            yield from _write_blocks(run, expanded_blocks(flora, given.seeds, camera), 0.05)
        elif given.others or not plain:  # instances alone may be best left as they are
            run.settings = contents.refinement_settings(scene)
            yield from _write_refined(run)
        if plain:
            in_main_thread(partial(_write_plain, run))
        clock.lap("emit")
        run.data.check()
    except BaseException:  # an error, Esc (GeneratorExit) or Ctrl+C
        restore_in_main_thread(results.discard)
        raise
    in_main_thread(partial(_replace, run))
    memory.give_back()
    statistics.seconds = dict(clock.seconds)
    scene.tetflora.statistics = json.dumps(statistics.as_dict())
    return statistics


def _first_look(run: _Run) -> Job[Results]:
    """A coarse result in place of earlier ones, without baked light."""
    whole = run.results
    results = Results(whole.scene, whole.purpose, "", run.data)
    results.origin, results.owners, results.looks = whole.origin, whole.owners, whole.looks
    settings, camera = contents.refinement_settings(whole.scene).first_look(), run.camera.smaller(FIRST_LOOK)
    first = replace(run, results=results, given=replace(run.given, sources=None), settings=settings, camera=camera)
    first.whole = run.camera, contents.refinement_settings(whole.scene)
    first.originals, first.statistics, first.clock = [*run.originals], Statistics(), Stopwatch()
    try:
        in_main_thread(results.open)
        yield from mapped(_write_refined(first), lambda p: Progress(0.02 + 0.03 * p.fraction, "First look", p.waiting))
        run.data.check()
    except BaseException:
        restore_in_main_thread(results.discard)
        raise
    in_main_thread(partial(_replace, first))
    run.tiles = first.tiles
    return results


def _replace(run: _Run) -> None:
    """Let new results take the place of earlier ones and of what they show."""
    results = run.results
    remove_results(results.scene, results.purpose, keep=(results.shown, *run.beside))
    release_materials()
    hide_originals(results.scene, results.purpose, run.originals)
    results.shown[MEGABYTES] = run.statistics.memory_mb
    results.finish()


def refine(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, **options: Any) -> Statistics:
    """Refine a scene at once; ``tell`` gets the progress of each step, other options and errors are `refine_steps`'."""
    tell = options.pop("tell", lambda _: None)
    return run_to_end(mapped(refine_steps(scene, depsgraph, **options), tell))


def clear(scene: bpy.types.Scene, for_render: bool | None = None) -> int:
    """Remove only what was made for a render (True), by the artist (False) or both (None); how many datablocks."""
    removed = remove_results(scene, {None: None, True: 'RENDER', False: 'VIEW'}[for_render])
    if not for_render:
        scene.tetflora.statistics = ""
    return removed


def _run_loop(run: _Run) -> Job[Refinement]:
    """Refine; the statistics get a step for each pass."""
    given, placed = run.given, None if run.bound is None else run.bound.placed
    others = given.occluders, given.polygons, given.lights, placed
    fraction = 0.05

    def told(state: Refinement) -> Progress:
        nonlocal fraction
        run.statistics.steps.append(step_of(state))
        waiting = int((state.decision == Decision.SPLIT).sum())
        fraction += 0.15 * (_LOOP_FRACTION - fraction)  # the number of passes is unknown
        return Progress(
            fraction, f"Refining, pass {state.passes}: {state.tree.tetrahedra_made:,} tetrahedra, {waiting:,} to split"
        )

    state = yield from mapped(loop.refine(run.flora, given.seeds, run.camera, run.settings, *others), told)
    run.statistics.steps.append(step_of(state))
    return state


def _refined(run: _Run, disc: float) -> Job[EmissionInput]:
    """Refine, and find out what the proxies depend on."""
    flora, given, bound, camera, statistics = run.flora, run.given, run.bound, run.camera, run.statistics
    form = run.form.emission
    refinement = yield from _run_loop(run)
    yield Progress(_LOOP_FRACTION, "Choosing polygons and proxies")
    if form.facets and unmeasured(flora):
        yield Progress(_LOOP_FRACTION, "Analyzing leaf clustering")
        for name, done in measuring(flora, range(len(flora.species))):
            yield Progress(_LOOP_FRACTION, f'Analyzing leaf clustering of "{name}": {done:.0%}')
        yield Progress(_LOOP_FRACTION, "Choosing polygons and proxies")
    detail = fit_to_budget(refinement, camera, run.settings, form.faces)
    run.clock.lap("refine")
    _count(statistics, detail.refinement)
    statistics.outliers = given.named(refinement.outliers)
    refinement, originals = detail.refinement, None if bound is None else bound.originals
    if not form.facets:
        return EmissionInput(flora, refinement, camera, tolerance=detail.tolerance, originals=originals)
    clusters = None
    if bound is not None:
        looks = np.array([given.looks.get(owner, "") for owner in bound.owners])[bound.owner]
        how = bound.originals, detail.asset_limit, looks, detail.asset_larger
        clusters = PlacedClusters(refinement.assets.placed, detail.camera, *how)
    # Light is baked for facets, whatever is made of them then.
    becomes = None if run.baking is not None else form.form(camera, disc, sun_of(refinement.lights))
    view = detail.camera
    how = Transition(flora, view, detail.leaf_limit, detail.tolerance), facet_weights(flora), clusters, given.occluders
    larger, shadow = (1.0, run.settings.shadow_cutoff) if run.whole is None else _UNSEEN
    options = {"facet": detail.facet, "hidden": larger * detail.coarser, "most": detail.most, "finest": detail.finest}
    with_all = drawing(flora, refinement, *how, form=becomes, shadow=shadow, **options)
    if run.whole is not None:  # as many as that is expected to have
        pixels = run.whole[0].width * run.whole[0].height / (camera.width * camera.height)
        run.tiles = tiles_of(fit_to_budget(refinement, *run.whole, times=pixels).camera)
    if run.whole is not None or run.tiles == tiles_of(view):
        with_all = replace(with_all, tiles=run.tiles)
    return EmissionInput(flora, refinement, camera, with_all, detail.tolerance, originals, disc)


def _write_refined(run: _Run) -> Job[None]:
    """Refine, and make meshes, instances and proxies; objects that scatter what has taken part are replaced as well."""
    scene, given = run.results.scene, run.given
    run.form, left = proxy_kind_of(scene), contents.steady_memory_left(scene, run.camera, run.results.purpose)
    run.settings = replace(run.settings, max_memory=left / 1e9 if np.isfinite(left) else 0.0)
    if given.sources is not None:
        run.baking = Baking(given.sources, leaves=scene.tetflora.baked_light == 'ALL')
    work = _refined(run, drawn_disc(scene.render.engine))
    refined = yield from steps_in_thread(work, Progress(0.05, "Refining, pass 1"))
    emission, baking = run.form.emission, run.baking
    baked = baking is not None and emission.baked_blocks is not None
    write = proxy_writer(run.results, run.form, refined, run.statistics, baked)
    by_tile = refined.drawing is not None and baking is None
    run.results.by_tile = by_tile and refined.drawing.tiles > 0
    blocks = refined.tiles(emission.blocks) if by_tile else refined.mesh_blocks()
    yield from _write_blocks(run, blocks, _LOOP_FRACTION, write)
    if given.explicit is not None:
        yield from _write_polygons(run, refined.polygon_blocks())
    if run.bound is not None:
        yield from write_assets(run, refined.asset_plan())
    if baking is not None:
        run.clock.lap("emit")
        yield from _bake_light(baking, refined)
        run.clock.lap("light")
    if not by_tile:
        light = (baking.light, baking.first_facet) if baked else ()
        proxies = (emission.baked_blocks if baked else emission.blocks)(refined, *light)
        yield from written(proxies, write, Progress(0.95, "Making proxies"))
    run.statistics.facet_pixels = float(refined.facet_pixels or 0.0)
    run.statistics.facet_asked = scene.tetflora.facet if refined.facet_pixels else 0.0


def _count(statistics: Statistics, refinement: Refinement) -> None:
    statistics.tetrahedra_made = int(refinement.tree.tetrahedra_made)
    statistics.tetrahedra_terminal = len(refinement.tree.terminals())
    statistics.tetrahedra_proxy = int(np.isin(refinement.decision, (Decision.PROXY, Decision.HIDDEN)).sum())
    statistics.passes = refinement.passes
    statistics.complete = refinement.complete
