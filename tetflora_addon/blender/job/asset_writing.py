# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances of assets as results: originals where they are whole, meshes of clusters where some of them are near."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ...assets.kites import kite_mesh
from ...emission.asset_plan import AssetPlan
from ...jobs import Progress
from ...refinement.statistics import Statistics
from ..assets.places import Places
from ..assets.target import Target
from ..results.cluster_meshes import AssetMeshes, cluster_mesh_steps
from ..results.collection import Results
from ..results.forms import ProxyForm
from ..results.hiding import originals_shown
from ..results.instances import add_cluster, add_cluster_instances, add_instances, carrier_of
from ..results.meshes import mesh_steps
from ..results.stand_ins import add_stand_in
from ..results.surface_arrays import read_mesh
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
