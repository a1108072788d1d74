# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assets of a job: which of their places are refined, and the compiled assets that stand there.

Blender's meshes are read here, one asset at a time; the engine compiles each in its thread. What was compiled before is
found by its digest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np

from ...arrays import Floats, Integers32
from ...assets import asset_cache
from ...assets.asset import Asset, AssetSource, AssetTable, Instances
from ...assets.compiled import compile_steps
from ...camera.camera import Camera
from ...emission.asset_plan import AssetCosts, OriginalPolicy
from ...errors import SceneError, TetFloraError
from ...jobs import Job, Progress, mapped, run_to_end
from ...refinement.shared_parts import PlacedAssets
from ..assets.parts import Target, digest_of, read_source_steps
from ..assets.places import Places
from ..results.hiding import hidden_originals, originals_shown
from ..worker import steps_in_thread

#: Part of the progress bar that compiling takes.
_START, _END = 0.02, 0.05

#: What the artist should know of the assets that were read last, see `SceneAssets`; nothing of those known before.
asset_warnings: list[str] = []


@dataclass(frozen=True)
class SceneAssets:
    """Assets of a scene that take part in refinement, and where they are."""

    targets: tuple[Target, ...]  # what each asset is of
    placed: PlacedAssets  # instances, in the coordinates of the job
    matrices: Floats  # (n, 4, 4): the same, as Blender takes them
    #: Objects that show instances; None for those that are plants of many objects
    owners: tuple[bpy.types.Object | None, ...]
    owner: Integers32  # (n,): index into these
    originals: OriginalPolicy  # which are always drawn as the originals
    warnings: tuple[str, ...] = field(default=())

    @property
    def faces(self) -> int:
        """Faces of all instances."""
        each = np.array([asset.faces for asset in self.placed.assets.every], np.int64)
        return int(each[self.placed.instances.asset].sum())


def is_plain(scene: bpy.types.Scene, places: Sequence[Places], depsgraph: bpy.types.Depsgraph, left: float) -> bool:
    """Whether instances are best left as they are: the renderer draws them at less cost than anything else."""
    if not places or scene.tetflora.asset_detail == 'REFINE':
        return not places
    targets, costs = _costs(places, depsgraph)
    return not targets or costs.plain(_in_cycles(scene), left)


def bind_steps(
    scene: bpy.types.Scene, places: Sequence[Places], depsgraph: bpy.types.Depsgraph, camera: Camera, left: float
) -> Job[SceneAssets | None]:
    """Compile the assets of places, which count from the camera's origin; None where there are none.

    Raises
    ------
    TetFloraError
        An asset that cannot be compiled; the message names it.
    """
    asset_warnings.clear()
    if not places:
        return None
    targets = list(dict.fromkeys(one.target for one in places))
    assets, warnings = [], []
    for number, target in enumerate(targets):
        progress = Progress(_START + (_END - _START) * number / len(targets), f'Reading "{target.name}"')
        yield progress
        asset = yield from _compiled(scene, target, depsgraph, progress, warnings)
        assets.append(asset)
    index = {target: i for i, target in enumerate(targets)}
    owners = list(dict.fromkeys(_owner(one) for one in places))
    matrices = np.concatenate([one.matrices for one in places])
    number = [len(one) for one in places]
    instances = Instances(
        np.repeat([index[one.target] for one in places], number).astype(np.int32),
        np.ascontiguousarray(matrices[:, :3, :3]),
        np.ascontiguousarray(matrices[:, :3, 3]),
        np.concatenate([one.keys for one in places]),
    )
    placed = PlacedAssets(AssetTable.of(assets), instances)
    owner = np.repeat([owners.index(_owner(one)) for one in places], number).astype(np.int32)
    _, costs = _costs(places, depsgraph, _covered(placed, camera))
    originals = costs.originals(_in_cycles(scene), left, always=scene.tetflora.asset_detail == 'AUTO')
    asset_warnings.extend(dict.fromkeys(warnings))
    return SceneAssets(tuple(targets), placed, matrices, tuple(owners), owner, originals, tuple(asset_warnings))


def _owner(places: Places) -> bpy.types.Object | None:
    return places.owner if len(places.owners) == 1 else None


def _in_cycles(scene: bpy.types.Scene) -> bool:
    return scene.render.engine == 'CYCLES'


def _costs(
    places: Sequence[Places], depsgraph: bpy.types.Depsgraph, pixels: Floats | None = None
) -> tuple[list[Target], AssetCosts]:
    numbers: dict[Target, int] = {}
    for one in places:
        numbers[one.target] = numbers.get(one.target, 0) + len(one)
    targets = list(numbers)
    triangles = np.array([triangles_of(target, depsgraph) for target in targets], np.int64)
    pixels = np.full(len(targets), np.inf) if pixels is None else pixels
    return targets, AssetCosts(triangles, np.array(list(numbers.values()), np.int64), pixels)


def triangles_of(target: Target, depsgraph: bpy.types.Depsgraph) -> int:
    """Triangles of an asset, without reading any."""
    return sum((len(m.loops) - 2 * len(m.polygons)) * len(part.matrices) for part, m, _ in target.meshes(depsgraph))


def _covered(placed: PlacedAssets, camera: Camera) -> Floats:
    """Pixels (a,) that instances of each asset would cover if nothing hid them."""
    wholes = placed.wholes()
    seen = camera.distance_to_view(wholes.center) < wholes.reach
    pixels = np.minimum(wholes.extent / camera.extent_around(wholes.center), max(camera.width, camera.height)) ** 2
    return np.bincount(placed.instances.asset, seen * pixels, len(placed.assets.every))


def _compiled(
    scene: bpy.types.Scene, target: Target, depsgraph: bpy.types.Depsgraph, progress: Progress, warnings: list[str]
) -> Job[Asset]:
    """The compiled asset of a target, known already or made now."""
    hidden = bool(hidden_originals(scene))
    source: AssetSource | None = None
    with originals_shown(scene, depsgraph):
        digest = digest_of(target, depsgraph)
        asset = asset_cache.find(digest)
        if asset is None and hidden:
            # While results hide what shows the asset, it is evaluated in here only.
            source, told = run_to_end(read_source_steps(target, depsgraph))
            warnings += told
    if asset is not None:
        return asset
    if source is None:
        steps = read_source_steps(target, depsgraph)
        while True:
            try:
                done = next(steps)
            except StopIteration as stop:
                source, told = stop.value
                warnings += told
                break
            yield Progress(progress.fraction, f'Reading "{target.name}": {done:.0%}')
            depsgraph.update()  # reading what was deleted since the last step would crash Blender
    fraction = progress.fraction
    compiling = mapped(compile_steps(source), lambda done: Progress(fraction, f'Compiling "{source.name}": {done:.0%}'))
    try:
        asset = yield from steps_in_thread(compiling, progress)
    except TetFloraError as error:
        raise SceneError(str(error)) from None
    asset_cache.keep(asset)
    return asset
