# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Input of refinement from a scene: plants, meshes, lights, compiled species and assets, and settings.

Meshes of assets are read here, one asset at a time; the engine compiles each in its thread, and keeps it by a digest.
"""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Self

import bpy
import numpy as np

from ... import memory, parallel
from ...arrays import Floats, Integers32
from ...assets import asset_cache
from ...assets.asset import Asset, AssetSource, AssetTable, Instances
from ...assets.compiled import compile_steps
from ...assets.costs import AssetCosts, OriginalPolicy
from ...camera.camera import Camera
from ...compiled.flora import Flora, compile_species
from ...emission.budget import BYTES_PER_TRIANGLE, expanded_faces
from ...errors import SceneError, TetFloraError
from ...growth.growth import trunks
from ...growth.seeds import Seeds
from ...growth.wind import Wind
from ...jobs import Job, Progress, mapped, run_to_end
from ...light.illumination import Sources
from ...processes import pool
from ...refinement.lights import Light
from ...refinement.loop import Outliers, Statistics
from ...refinement.polygons import Polygons
from ...refinement.settings import RefinementSettings
from ...refinement.shared_parts import PlacedAssets
from ...species.catalog import list_species, load_species
from ...species.kinds import Kind
from ...species.species import Species
from ..assets.places import Places, Target, digest_of, read_places, read_source_steps
from ..preferences import preferences
from ..results.hiding import hidden_originals, originals_shown
from ..results.leaf_objects import resolved_species
from ..results.output import megabytes_held
from ..results.proxy_kinds import proxy_kind_of
from ..scene.ages import kind_species
from ..scene.explicit import Explicit, read_explicit
from ..scene.lights import read_lights, read_sources, sky_suns
from ..scene.looks import LayerLooks
from ..scene.objects import read_occluders
from ..scene.plants import NoPlantsError, read_plants
from ..settings import check_limits, most_memory, season_of, wind_of, years_of
from ..worker import steps_in_thread

#: Memory that is left over what was left, from which on it counts as another: results take less than two thirds of it.
_STEADY = 1.5
_left: dict[tuple[int, float, int], float] = {}


@dataclass(frozen=True)
class SceneContents:
    """Contents of a scene; ``explicit`` is None where no mesh takes part, ``sources`` where no light is baked.

    ``owners`` are the objects of the plants in their order, each with the number of its own; ``places`` are those of
    assets, ``looks`` those of the objects that show these; ``unknown`` tells of plants without a known species.
    """

    seeds: Seeds
    explicit: Explicit | None
    occluders: np.ndarray
    lights: tuple[Light, ...]
    sources: Sources | None = None
    owners: tuple[tuple[str, int], ...] = ()
    places: tuple[Places, ...] = ()
    looks: Mapping[bpy.types.Object, str] = field(default_factory=dict)
    unknown: str = ""

    @property
    def species(self) -> tuple[str, ...]:
        """Species of its plants."""
        return self.seeds.identifiers

    @property
    def others(self) -> bool:
        """Whether there is anything but assets."""
        return len(self.seeds) > 0 or self.explicit is not None

    @property
    def polygons(self) -> Polygons | None:
        """All explicit polygons."""
        return None if self.explicit is None else Polygons.everything(self.explicit.meshes)

    def counted_from(self, origin: np.ndarray) -> Self:
        """The same in coordinates that begin at a place (3,) in the world, as those of the camera (`Camera.local`)."""
        if not origin.any():
            return self
        explicit, sources = self.explicit, self.sources
        return replace(
            self,
            seeds=self.seeds.counted_from(origin),
            explicit=None if explicit is None else replace(explicit, meshes=explicit.meshes.counted_from(origin)),
            occluders=self.occluders - origin,
            lights=tuple(light.counted_from(origin) for light in self.lights),
            sources=None if sources is None else sources.counted_from(origin),
            places=tuple(one.counted_from(origin) for one in self.places),
        )

    def named(self, outliers: Outliers) -> dict[str, float]:
        """Objects that outliers belong to, and the least of their distances, meters."""
        ends = np.cumsum([number for _, number in self.owners])
        names = [self.owners[i][0] for i in np.searchsorted(ends, outliers.plants, side="right").tolist()]
        ends = np.cumsum([len(one) for one in self.places])
        names += [self.places[i].owner.name for i in np.searchsorted(ends, outliers.assets, side="right").tolist()]
        meshes = self.explicit.meshes if self.explicit is not None else None
        names += [meshes.surfaces[meshes.surface[i]].name for i in outliers.instances.tolist()]
        distances: dict[str, float] = {}
        for name, away in zip(names, outliers.away.tolist(), strict=True):
            distances[name] = min(away, distances.get(name, np.inf))
        return distances

    def polygons_full(self, flora: Flora) -> int:
        """Polygons of everything, expanded: expected ones of plants, and those of meshes."""
        return round(expected_polygons(flora, self.seeds)) + (self.explicit.meshes.faces if self.explicit else 0)


def expected_polygons(flora: Flora, seeds: Seeds) -> float:
    """Approximate number of faces of plants."""
    if flora.day is not None or seeds.crown is not None:
        return float(flora.face_counts(trunks(flora.rows, seeds)).sum())
    return float(flora.polygons[trunks(flora.rows, seeds).row].sum())


def read_scene(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> SceneContents:
    """Read everything that takes part in refinement except the camera.

    Raises
    ------
    TetFloraError
        Nothing to refine, or unusable plants or meshes; the message says which.
    """
    check_settings(scene)
    with originals_shown(scene, depsgraph):
        explicit = read_explicit(depsgraph)
        places = tuple(read_places(scene, depsgraph))
        try:
            seeds, owners, unknown = read_plants(scene, depsgraph)
        except NoPlantsError:
            if explicit is None and not places:
                raise
            seeds, owners, unknown = replace(Seeds.upright(0), identifiers=()), (), ""
        lights = (*read_lights(depsgraph), *sky_suns(scene))
        baked = scene.tetflora.baked_light != 'OFF' and not scene.tetflora.expand_everything
        sources = read_sources(scene, depsgraph) if baked else None
        looks = LayerLooks(depsgraph.view_layer)
        worn = {owner: looks.of(owner, model=True) for owner in dict.fromkeys(one.owner for one in places)}
        occluders = read_occluders(depsgraph)
        return SceneContents(seeds, explicit, occluders, lights, sources, owners, places, worn, unknown)


def compile_for(identifiers: tuple[str, ...], scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Flora:
    """Load and compile species, leaf objects of the scene included.

    Without any, it is a shipped one of which nothing grows: files and edits that are not used must not raise errors.

    Raises
    ------
    SpeciesError
        Unknown or broken species, or a leaf object that is missing or not a mesh with faces.
    """
    return compile_species(load_for(identifiers, scene, depsgraph))


def load_for(
    identifiers: tuple[str, ...], scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, years: float | None = None
) -> list[Species]:
    """The species that `compile_for` compiles, after the scene's years or so many; it alone needs the scene."""
    years = years_of(scene) if years is None else years
    if not identifiers:
        return [load_species(min(list_species()))]
    # Each species is looked up once, of however many ages there are plants.
    plain = {kind: str(Kind.read(kind).plain) for kind in identifiers}
    species = {kind: resolved_species(scene, kind, depsgraph) for kind in set(plain.values())}
    return [kind_species(species[plain[kind]], kind, years) for kind in identifiers]


def in_year(scene: bpy.types.Scene, flora: Flora) -> Flora:
    """A flora on the scene's day of the year."""
    season = season_of(scene)
    return flora if season is None else flora.in_year(season)


def in_wind(scene: bpy.types.Scene, flora: Flora, camera: Camera, moving: bool = False) -> Flora:
    """A flora on the scene's day, in its wind at its frame, in the coordinates of a camera; its plants may move."""
    flora, wind = in_year(scene, flora), wind_of(scene) or (Wind(0.0, moving=True) if moving else None)
    return flora if wind is None else flora.in_wind(replace(wind, origin=tuple(camera.origin.tolist())))


def estimate(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Statistics:
    """Count plants, expanded polygons and instances, growing none; errors are `read_scene`'s and `compile_for`'s."""
    given = read_scene(scene, depsgraph)
    if given.unknown:  # who counts in advance wants to know it
        raise SceneError(given.unknown)
    flora = in_year(scene, compile_for(given.species, scene, depsgraph))
    instances = sum(len(one) for one in given.places)
    return Statistics(plants=len(given.seeds), polygons_full=given.polygons_full(flora), instances=instances)


def check_settings(scene: bpy.types.Scene) -> None:
    """Refuse settings of a scene that are beyond their limits.

    Raises
    ------
    SceneError
        Names the setting, its value and the limits.
    """
    for group in (scene.tetflora, scene.tetflora.wind, scene.tetflora.year, scene.tetflora.output):
        check_limits(group, f'Scene "{scene.name}"')


def settings_from(scene: bpy.types.Scene) -> RefinementSettings:
    """The scene's settings for the engine."""
    group = scene.tetflora
    # A field without a property keeps the engine's value.
    names = [f.name for f in fields(RefinementSettings) if f.name in group.bl_rna.properties]
    given = {name: getattr(group, name) for name in names}
    return RefinementSettings(**(given | {"max_memory": most_memory(scene)}))


def picture_bytes(scene: bpy.types.Scene, camera: Camera) -> int:
    """Bytes that the renderer will need for the picture of a camera, whatever is in it."""
    cycles = scene.render.engine == 'CYCLES' and getattr(scene, "cycles", None)
    return memory.picture_bytes(camera.width * camera.height, bool(cycles and cycles.use_denoising))


def memory_left(scene: bpy.types.Scene, camera: Camera | None = None) -> float:
    """Bytes that the scene's limit of memory leaves for results beside other processes; infinite without a limit."""
    most = most_memory(scene)
    picture = 0 if camera is None else picture_bytes(scene, camera)
    return memory.allowance(most, picture + pool.share(memory.limit(most)))


def steady_memory_left(scene: bpy.types.Scene, camera: Camera, purpose: str) -> float:
    """`memory_left` for results that take the place of all earlier ones of their purpose.

    In bytes. It stays what it was for the first results of a scene as long as it changes by less than `_STEADY`: a
    frame of a film is to be that frame alone, although caches and what the process does not give back grow.
    """
    left = memory_left(scene, camera) + 1e6 * megabytes_held(purpose, scene)
    known = scene.session_uid, most_memory(scene), picture_bytes(scene, camera)
    if not 1.0 / _STEADY < left / _left.setdefault(known, left) < _STEADY:
        _left[known] = left
    return _left[known]


def refinement_settings(scene: bpy.types.Scene) -> RefinementSettings:
    """The scene's settings, with the block sizes of its proxy kind."""
    emission = proxy_kind_of(scene).emission
    # Proxies that fill their tetrahedra are divided as long as they show; facets need no more than their visibility.
    proxy_block = emission.proxy_block if emission.facets else min(emission.proxy_block, 1e9)
    return replace(settings_from(scene), hidden_block=emission.hidden_block, proxy_block=proxy_block)


def use_machine(scene: bpy.types.Scene) -> None:
    """Let what follows work with as many threads, and processes with as much memory, as the artist wants."""
    prefs = preferences()
    fixed = scene.render.threads if scene.render.threads_mode == 'FIXED' else 0  # of all cores
    parallel.set_threads(prefs.threads if prefs is not None and prefs.threads else fixed)
    pool.set_memory_limit(memory.limit(most_memory(scene)))


def check_fits(what: str, faces: Floats, left: float, remedy: str) -> None:
    """Refuse what would make too many polygons.

    Parameters
    ----------
    what : str
        Begins the message.
    faces : (2,) float64
        Polygons, at least, and the triangles that they consist of.
    left : float
        Bytes, see `memory_left`.
    remedy : str
        What to do, beside raising the limit.

    Raises
    ------
    SceneError
        Has the numbers, and says what to do.
    """
    if (needed := faces[1] * BYTES_PER_TRIANGLE) > left:
        raise SceneError(
            f"{what} would make more than {faces[0] / 1e6:,.1f} million polygons, which take "
            f"{needed / memory.GIGABYTE:,.1f} GB with rendering; Max Memory leaves {left / memory.GIGABYTE:,.1f} GB. "
            f"Raise Max Memory, {remedy}"
        )


def check_expanded(flora: Flora, seeds: Seeds, camera: Camera, left: float) -> None:
    """Refuse to expand plants that would not fit, near a camera as finely as it sees them; as `check_fits`."""
    for faces in expanded_faces(flora, seeds, camera):
        remedy = "turn Expand Everything off, use fewer plants, or move the camera away from them"
        check_fits("Expand Everything", faces, left, remedy)


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
    return not targets or costs.plain(scene.render.engine == 'CYCLES', left)


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
    targets, assets = list(dict.fromkeys(one.target for one in places)), []
    for number, target in enumerate(targets):
        progress = Progress(_START + (_END - _START) * number / len(targets), f'Reading "{target.name}"')
        yield progress
        assets.append((yield from _compiled(scene, target, depsgraph, progress)))
    index = {target: i for i, target in enumerate(targets)}
    shown = [one.owner if len(one.owners) == 1 else None for one in places]
    owners = list(dict.fromkeys(shown))
    matrices = np.concatenate([one.matrices for one in places])
    number = [len(one) for one in places]
    instances = Instances(
        np.repeat([index[one.target] for one in places], number).astype(np.int32),
        np.ascontiguousarray(matrices[:, :3, :3]),
        np.ascontiguousarray(matrices[:, :3, 3]),
        np.concatenate([one.keys for one in places]),
    )
    placed = PlacedAssets(AssetTable.of(assets), instances)
    owner = np.repeat([owners.index(one) for one in shown], number).astype(np.int32)
    _, costs = _costs(places, depsgraph, _covered(placed, camera))
    in_cycles, always = scene.render.engine == 'CYCLES', scene.tetflora.asset_detail == 'AUTO'
    originals = costs.originals(in_cycles, left, always=always)
    return SceneAssets(tuple(targets), placed, matrices, tuple(owners), owner, originals)


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


def _compiled(scene: bpy.types.Scene, target: Target, depsgraph: bpy.types.Depsgraph, progress: Progress) -> Job[Asset]:
    """The compiled asset of a target, known already or made now."""
    read: list[tuple[AssetSource, tuple[str, ...]]] = []

    def reading() -> Generator[float, None, None]:
        read.append((yield from read_source_steps(target, depsgraph)))

    hidden = bool(hidden_originals(scene))
    with originals_shown(scene, depsgraph):
        asset = asset_cache.find(digest_of(target, depsgraph))
        if asset is None and hidden:  # while results hide what shows the asset, it is evaluated in here only
            run_to_end(reading())
    if asset is not None:
        return asset
    for done in () if read else reading():
        yield Progress(progress.fraction, f'Reading "{target.name}": {done:.0%}')
        depsgraph.update()  # reading what was deleted since the last step would crash Blender
    (source, told), fraction = read[0], progress.fraction
    asset_warnings.extend(text for text in told if text not in asset_warnings)
    compiling = mapped(compile_steps(source), lambda done: Progress(fraction, f'Compiling "{source.name}": {done:.0%}'))
    try:
        asset = yield from steps_in_thread(compiling, progress)
    except TetFloraError as error:
        raise SceneError(str(error)) from None
    asset_cache.keep(asset)
    return asset
