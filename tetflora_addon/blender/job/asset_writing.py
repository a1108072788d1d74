# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances of assets as results: originals where they are whole, meshes of clusters where some of them are near.

Blocks of polygons as they are made, into objects of a result; and the light that is baked into them.

While Blender takes one block over, the engine makes the next in its thread.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import groupby
from typing import TypeVar

import bpy
import numpy as np
from numpy.typing import NDArray

from ...assets.kites import kite_mesh
from ...buffers import MeshBuffers, concatenate_buffers
from ...compiled.flora import Flora
from ...emission.asset_plan import AssetPlan
from ...emission.forms import Refined
from ...emission.plants import Block
from ...emission.polygons import PolygonBlock
from ...jobs import Progress
from ...refinement.statistics import Statistics
from ..assets.parts import Target
from ..assets.places import Places
from ..materials.materials import baked_material
from ..results.cluster_meshes import AssetMeshes, cluster_mesh_steps, read_mesh
from ..results.collection import Results
from ..results.forms import ProxyForm
from ..results.hiding import originals_shown
from ..results.instances import add_cluster, add_cluster_instances, add_instances, carrier_of
from ..results.leaf_objects import material_steps
from ..results.meshes import mesh_steps
from ..results.proxies import Baking
from ..results.stand_ins import add_stand_in
from ..scene.explicit import Explicit
from ..worker import in_thread, steps_in_thread
from .assets import Bound

#: Clusters of which meshes are made between two looks at the window.
_AT_ONCE = 16


def left_alone(bound: Bound, plan: AssetPlan) -> NDArray[np.bool_]:
    """Owners (k,) of which every instance is the original: they go on showing them themselves."""
    whole = np.zeros(len(bound.placed), bool)
    whole[plan.whole] = True
    number = np.bincount(bound.owner, ~whole, len(bound.owners))
    return (number == 0) & np.array([_scatters(owner) for owner in bound.owners], bool)


def _scatters(owner: bpy.types.Object | None) -> bool:
    """Whether an object shows its instances itself; plants do not."""
    return owner is not None and not owner.tetflora.is_plant and not owner.tetflora.is_field


def write_plain(results: Results, places: Sequence[Places], statistics: Statistics) -> None:
    """Write instances of plants as originals; objects that scatter go on showing theirs themselves."""
    shown: dict[Target, list[Places]] = {}
    for one in places:
        statistics.instances_whole += len(one)
        if not _scatters(one.owner):
            shown.setdefault(one.target, []).append(one)
    for number, (target, every) in enumerate(shown.items()):
        matrices, keys = (np.concatenate([getattr(one, name) for one in every]) for name in ("matrices", "keys"))
        source = target.datablock or carrier_of(results, target)
        add_instances(results, f"{target.name} {number:03d}", source, matrices, _ids(keys))


def _ids(keys: NDArray[np.uint64]) -> NDArray[np.int32]:
    return (keys >> np.uint64(33)).astype(np.int32)


def write_assets(
    results: Results,
    form: ProxyForm,
    bound: Bound,
    plan: AssetPlan,
    depsgraph: bpy.types.Depsgraph,
    statistics: Statistics,
) -> Generator[Progress, None, list[bpy.types.Object]]:
    """Write what a plan draws as instances; returns the objects whose place results take."""
    alone = left_alone(bound, plan)
    asset, owner = bound.placed.instances.asset, bound.owner
    ids = _ids(bound.placed.instances.key)
    progress = Progress(0.94, "Placing instances")
    yield progress
    whole = plan.whole[~alone[owner[plan.whole]]]
    for number, (target, shown, rows) in enumerate(_groups(bound, asset[whole], owner[whole])):
        at = whole[rows]
        source = target.datablock or carrier_of(results, target)
        add_instances(results, f"{target.name} {number:03d}", source, bound.matrices[at], ids[at], shown)
        yield progress
    statistics.instances_whole = len(whole) + int(alone[owner[plan.whole]].sum())
    for own, kites in ((plan.meshes, False), (plan.kites, True)):
        for target in range(len(bound.targets)):
            rows = np.flatnonzero(asset[own.instance] == target)
            if len(rows):
                given = own.cluster[rows] - bound.placed.assets.root[target], own.instance[rows]
                make = _kites(results, form, bound, target) if kites else _clusters(results, bound, target, depsgraph)
                yield from _write_clusters(results, bound, target, *given, ids, make, kites, statistics)
    hidden = []
    for number, shown in enumerate(bound.owners):
        if _scatters(shown) and not alone[number]:
            hidden.append(shown)
            with originals_shown(results.scene, depsgraph):
                add_stand_in(results, f"{shown.name} {number:03d}", shown, depsgraph)
    return hidden


def _groups(
    bound: Bound, asset: NDArray[np.int32], owner: NDArray[np.int32]
) -> Iterator[tuple[Target, bpy.types.Object | None, NDArray[np.int64]]]:
    """Rows (k,) of the same asset and the same owner each."""
    for pair in np.unique(asset.astype(np.int64) * len(bound.owners) + owner).tolist():
        target, shown = divmod(pair, len(bound.owners))
        yield bound.targets[target], bound.owners[shown], np.flatnonzero((asset == target) & (owner == shown))


Maker = Callable[[int, str], Generator[None, None, tuple[bpy.types.Mesh, int]]]


def _clusters(results: Results, bound: Bound, target: int, depsgraph: bpy.types.Depsgraph) -> Maker:
    """What makes meshes of clusters of their own faces, with the number of these."""
    with originals_shown(results.scene, depsgraph):
        meshes = read_meshes(bound.targets[target], depsgraph)
    asset = bound.placed.assets.every[target]

    def make(cluster: int, name: str) -> Generator[None, None, tuple[bpy.types.Mesh, int]]:
        part, face = asset.faces_of(cluster)
        return (yield from cluster_mesh_steps(meshes, name, part, face)), len(face)

    return make


def _kites(results: Results, form: ProxyForm, bound: Bound, target: int) -> Maker:
    """What makes meshes of kites for the leaves of clusters."""
    material = form.asset_material()
    results.use([material])
    asset = bound.placed.assets.every[target]

    def make(cluster: int, name: str) -> Generator[None, None, tuple[bpy.types.Mesh, int]]:
        buffers = kite_mesh(asset.leaves_of(cluster))
        return (yield from mesh_steps(name, buffers, [material])), buffers.polygons

    return make


def _write_clusters(
    results: Results,
    bound: Bound,
    target: int,
    cluster: NDArray[np.int64],
    instance: NDArray[np.int32],
    ids: NDArray[np.int32],
    make: Maker,
    kites: bool,
    statistics: Statistics,
) -> Generator[Progress, None, None]:
    """Meshes of the clusters of one asset, each once, and instances of them."""
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
            statistics.polygons_proxy += faces
        else:
            statistics.polygons_meshed += faces
        if number % _AT_ONCE == 0:
            yield progress
    shown = bound.owner[instance]
    for number, who in enumerate(np.unique(shown).tolist()):
        rows = np.flatnonzero(shown == who)
        at = instance[rows]
        places = pick[rows].astype(np.int32), bound.matrices[at], ids[at]
        add_cluster_instances(results, f"{name} clusters {number:03d}", objects, *places, bound.owners[who])
    statistics.instances_clusters += len(cluster)


def read_meshes(target: Target, depsgraph: bpy.types.Depsgraph) -> AssetMeshes:
    """All surfaces of an asset, numbered as those of its `AssetSource`."""
    surfaces, numbers, matrices = [], [], []
    for part in target.parts(depsgraph)[0]:
        with part.opened(depsgraph) as opened:
            if opened is not None:
                numbers += [len(surfaces)] * len(part.matrices)
                surfaces.append(read_mesh(*opened))
                matrices.append(part.matrices)
    return AssetMeshes(surfaces, np.array(numbers, np.int32), np.concatenate(matrices))


_Block = TypeVar("_Block")


def write_blocks(
    results: Results,
    flora: Flora,
    blocks: Iterator[Block],
    statistics: Statistics,
    start: float,
    baking: Baking | None = None,
) -> Generator[Progress, None, None]:
    """Write blocks of plants; progress goes from a given fraction to .95, and the statistics count."""
    materials: dict[tuple[int, str, int], list[bpy.types.Material]] = {}

    def write(block: Block) -> Generator[None, None, Progress]:
        species, what = flora.species[block.species], (block.species, block.kind, block.form)
        if what not in materials:
            if baking is not None and baking.leaves:
                materials[what] = [baked_material()]
            else:
                materials[what] = yield from material_steps(results.scene, species, block.kind, block.form)
        name = f"{species.name} {block.kind} {block.number:03d}"
        yield
        look = results.look_of(block.species)
        obj = yield from results.add(name, block.kind, block.buffers, materials[what], species, look)
        _made(obj, block.buffers, statistics, baking, lit=True)
        return Progress(start + (0.95 - start) * block.fraction, f"Making polygons: {statistics.polygons_meshed:,}")

    yield from _written(_of_all_ages(results, flora, blocks), write, Progress(start, "Making polygons"))


def _of_all_ages(results: Results, flora: Flora, blocks: Iterator[Block]) -> Iterator[Block]:
    """Blocks of which those of one species and look at several ages are one mesh: each object costs a renderer time."""
    first: dict[tuple[str, str], int] = {}
    named = [(one.identifier, results.look_of(n)) for n, one in enumerate(flora.species)]
    same = [first.setdefault(named[n], n) if one.form is None else n for n, one in enumerate(flora.species)]
    if same == list(range(len(same))):
        yield from blocks
        return
    for _, run in groupby(blocks, key=lambda block: block.number):
        parts: dict[tuple[int, str, int], list[Block]] = {}
        for block in run:
            parts.setdefault((same[block.species], block.kind, block.form), []).append(block)
        for some in parts.values():
            yield replace(some[-1], buffers=concatenate_buffers([block.buffers for block in some]))


def write_polygons(
    results: Results,
    explicit: Explicit,
    blocks: Iterator[PolygonBlock],
    statistics: Statistics,
    baking: Baking | None = None,
) -> Generator[Progress, None, None]:
    """Write polygons of meshes that take part, with their own materials; the statistics count."""

    def write(block: PolygonBlock) -> Generator[None, None, Progress]:
        name = explicit.meshes.surfaces[block.surface].name
        materials = explicit.materials[block.surface]
        look = explicit.meshes.surfaces[block.surface].look
        name = f"{name} {block.number:03d}"
        obj = yield from results.add(name, "explicit", block.buffers, materials, look=look)
        _made(obj, block.buffers, statistics, baking, lit=False)
        return Progress(0.95, f"Keeping polygons: {statistics.polygons_meshed:,}")

    yield from _written(blocks, write, Progress(0.95, "Keeping polygons"))


def _written(
    blocks: Iterator[_Block], write: Callable[[_Block], Generator[None, None, Progress]], progress: Progress
) -> Generator[Progress, None, None]:
    """Write blocks one by one, while the next is computed."""
    with closing(in_thread(blocks, ahead=1)) as made:
        for block in made:
            if block is not None:
                progress = yield from progress.during(write(block))
            yield progress.again if block is None else progress


def _made(
    obj: bpy.types.Object, buffers: MeshBuffers, statistics: Statistics, baking: Baking | None, lit: bool
) -> None:
    if baking is not None:
        baking.add(obj, buffers, lit)
    statistics.polygons_meshed += buffers.polygons
    statistics.memory_mb += buffers.nbytes / 1e6


def bake_light(baking: Baking, refined: Refined) -> Generator[Progress, None, None]:
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
        yield progress.again if done is None else progress
