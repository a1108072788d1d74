# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Result collections: what refinement adds to a scene, replaces and clears, and nothing else."""

import time
from collections.abc import Callable, Generator, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self, TypeVar

import bpy

from ...buffers import MeshBuffers, PointBuffers
from ...jobs import SPACED
from ...parameters import within
from ...species.species import Species
from ..declare import FIXED, boolean, integer, list_of, pointer_to, string
from ..materials import snow
from ..materials.nodes import is_own, tag
from ..materials.soil import is_soil
from ..runtime import JobData, is_there
from ..scene.looks import LIKE
from ..settings import switches
from ..species.catalog import SpeciesChoice, gallery_of
from . import output
from .hiding import adopt_copies
from .meshes import mesh_steps, point_object
from .output import result_collections

#: Bytes of a name in Blender 4.5 (5.0 takes more), less those of the number that it appends to equal names.
_LONGEST = 59
NAMES = {'VIEW': "TetFlora", 'RENDER': "TetFlora render"}

_Made = TypeVar("_Made", bound=bpy.types.ID)


@dataclass(eq=False)
class Results:
    """A result collection under construction, which is in no scene until it is finished.

    So nobody sees anything twice. A first look gives way tile by tile. `discard` removes all that has no place yet.
    """

    scene: bpy.types.Scene
    purpose: str  # {'VIEW', 'RENDER'}
    mark: str = ""  # suffix of all names, where there are results of several cameras at the same time
    data: JobData | None = None  # of the job, which ends when somebody deletes its results
    first: Self | None = None  # the first look
    by_tile: bool = True  # whether that has the same tiles
    tile: int | None = None  # of what is made now; what has none takes its place when all is made
    #: Objects by their tiles, as long as they are not yet replaced
    tiles: dict[int | None, list[bpy.types.Object]] = field(default_factory=dict)
    #: (3,): Where in the world positions in buffers are counted from, meters: objects are placed there
    origin: Sequence[float] = (0.0, 0.0, 0.0)
    #: Looks of objects that show instances, where more than they themselves say counts
    owners: Mapping[bpy.types.Object | None, str] = field(default_factory=dict)
    looks: Sequence[str] = ()  # of plants of each kind, see `scene.looks`; empty where there are none
    collection: bpy.types.Collection | None = None

    def __post_init__(self) -> None:
        self._datablocks: list[bpy.types.ID] = []
        self._names: list[tuple[bpy.types.ID, str]] = []
        self._held: list[bpy.types.ID] = []
        self._shared: dict[Hashable, bpy.types.ID] = {}
        self._waiting: list[tuple[bpy.types.Object, Species | None]] = []
        self._complete, self._next = [], 0.0  # tiles that are not shown yet, and when they will be

    def open(self) -> None:
        """Make the collection."""
        earlier = result_collections(self.scene, 'VIEW') if self.purpose == 'VIEW' else []
        # The artist may have renamed it.
        name = earlier[0].name if earlier else f"{NAMES[self.purpose]} {self.mark}".strip()
        snow.fit(filter(is_soil, bpy.data.materials))
        self.collection = bpy.data.collections.new(name)
        self._names += [(self.collection, name)] if self.first is None else []
        self.collection[output.PURPOSE] = self.purpose
        tag(self.collection)
        if self.data is not None:
            self.data.add("the result", self.collection)
        self.collection.is_runtime_data = True

    @property
    def shown(self) -> bpy.types.Collection:
        """Where it takes its place."""
        return self.collection if self.first is None else self.first.collection

    def begin(self, tile: int | None) -> Iterator[bool]:
        """What follows is of a tile, or of none. Complete ones are shown as seldom as drawing is slow: true, if now."""
        now, before, self.tile = time.monotonic(), self.tile, tile
        if self.first is not None and self.by_tile and before is not None:
            self._complete.append(before)
            if now >= self._next:
                while self._complete:
                    self._replace(self._complete.pop())
                yield True
                self._next = time.monotonic() + SPACED * (time.monotonic() - now)

    def _replace(self, tile: int | None) -> None:
        """Show what was made of a tile, in place of what the first look has of it."""
        ways = (self.tiles, self.collection, self.shown), (self.first.tiles, self.shown, self.collection)
        for tiles, before, after in ways:
            for obj in filter(is_there, tiles.pop(tile, ())):
                after.objects.link(obj)
                before.objects.unlink(obj)

    def add(
        self,
        name: str,
        kind: str,
        buffers: MeshBuffers | PointBuffers,
        materials: list[bpy.types.Material],
        species: Species | None = None,
        look: str = "",
    ) -> Generator[None, None, bpy.types.Object]:
        """Write a mesh, or points of one material, as an object of a species or None, and of a look, step by step."""
        self.use(materials)
        name = self.name_for(name)
        if isinstance(buffers, PointBuffers):
            obj = point_object(name, buffers, *materials)
        else:
            mesh = yield from mesh_steps(name, buffers, materials)
            self._datablocks.append(mesh)
            obj = bpy.data.objects.new(name, mesh)
        return self.add_object(name, obj, kind, None, species, look)

    def name_for(self, name: str) -> str:
        """A name that ends in a number, with the mark; shortened so that Blender does not cut off the end."""
        if not self.mark:
            return name
        stem, _, number = name.rpartition(" ")
        end = f" {number} {self.mark}"
        return stem.encode()[: _LONGEST - len(end)].decode(errors="ignore") + end

    def look_of(self, number: int | None) -> str:
        """Look of plants of a kind, by its number; empty for others."""
        return self.looks[number] if number is not None and 0 <= number < len(self.looks) else ""

    def hold(self, orphan: bpy.types.ID, name: str = "") -> None:
        """Take over a datablock that is in no scene, with an object's data: it goes with the results that show it."""
        for datablock in (orphan, getattr(orphan, "data", None)):
            if datablock is not None:
                self._held.append(datablock)
                self._names += [(datablock, name)] if name else []
                tag(datablock)

    def use(self, materials: Sequence[bpy.types.Material]) -> None:
        """Let TetFlora's materials go with what is made, if it is discarded and nothing else uses them."""
        self._datablocks += materials
        snow.fit(materials)

    def shared(self, key: Hashable, make: Callable[[], _Made]) -> _Made:
        """What was made for a key, made only once for these results."""
        return self._shared.get(key) or self._shared.setdefault(key, make())

    def add_object(
        self,
        name: str,
        obj: bpy.types.Object,
        kind: str,
        source: bpy.types.ID | None,
        species: Species | None = None,
        look: str = "",
        placed: bool = False,
    ) -> bpy.types.Object:
        """Add an object that was made elsewhere, under a name by `name_for`.

        Parameters
        ----------
        kind : str
            See `output.KIND`.
        source : bpy.types.ID, optional
            What it shows instances of. If TetFlora made that, it goes with the last object that shows it.
        placed : bool
            It has a transform and data of its own, which stay; otherwise it counts from the origin.
        """
        datablocks = [obj] if placed else [obj, obj.data]
        self._datablocks += datablocks
        self._names += [(datablock, name) for datablock in datablocks]
        if self.data is not None:
            self.data.add("a part of the result", *datablocks)
        if not placed:
            obj.location = self.origin
        shows = source if source is not None and is_own(source) else None
        for key, value in ((output.KIND, kind), (LIKE, look), (output.SOURCE, shows)):
            if value:
                obj[key] = value
        for datablock in datablocks:
            tag(datablock)
            datablock.is_runtime_data = True
        if self.purpose == 'VIEW':
            self._place(obj, species)
        else:
            self._waiting.append((obj, species))
        return obj

    def _place(self, obj: bpy.types.Object, species: Species | None) -> None:
        """Add an object to the collection, as the settings have it; Blender then lists all objects anew."""
        if species is not None:
            obj.parent = output.parent_of(self.shown, species.identifier, species.name)
            self._datablocks.append(obj.parent)
        obj.hide_select = True  # artists select and edit plants, not millions of polygons
        output.dress(self.scene, obj, "" if species is None else species.identifier)
        self.collection.objects.link(obj)
        self.tiles.setdefault(self.tile, []).append(obj)

    def finish(self) -> None:
        """Everything is made and earlier results are gone, whose names these take; output settings now count."""
        for obj, species in self._waiting:
            self._place(obj, species)
        self._waiting.clear()
        if self.first is None:
            self.scene.collection.children.link(self.collection)
        else:
            for tile in {**self.tiles, **self.first.tiles}:
                self._replace(tile)
            output.remove_collection(None, self.collection)
            self.collection = self.first.collection
        for obj, name in self._names:
            if obj.name != name and is_own(obj):
                obj.name = name
                tag(obj)
        if self.purpose == 'VIEW':
            output.dress_collection(self.scene, self.collection)
        else:
            output.mark_runtime(self.collection, True)
        output.remove_unused(self._held)  # that nothing shows

    def discard(self) -> None:
        """Remove everything made so far, whatever of it or of the scene somebody else has removed."""
        if self.collection is not None and is_there(self.collection):
            output.remove_collection(self.scene if is_there(self.scene) else None, self.collection)
        self.collection = None
        output.remove_made([*self._datablocks, *self._held])
        self._held = []
        self._datablocks, self._waiting, self._shared = [], [], {}


def dress_results(scene: bpy.types.Scene) -> None:
    """Apply the output settings of a scene to the artist's results."""
    adopt_copies()
    for collection in result_collections(scene, 'VIEW'):
        output.dress_collection(scene, collection)


def has_results(scene: bpy.types.Scene) -> bool:
    """Whether the scene holds meshes or proxies that the artist made by Refine."""
    return bool(result_collections(scene, 'VIEW'))


def leave_out_of_file() -> None:
    """Before a file is written, mark results that it must not hold, and let it hold their materials.

    Not only when they are made, because undo brings datablocks back without the mark.
    """
    adopt_copies()
    for scene in bpy.data.scenes:
        saved = scene.tetflora.output.save_results
        for collection in result_collections(scene) if scene.library is None else ():
            runtime = collection[output.PURPOSE] == 'RENDER' or not saved
            output.mark_runtime(collection, runtime)
            if runtime and collection[output.PURPOSE] == 'VIEW':
                output.keep_materials(collection)


_COMMON = {"update": lambda self, _context: dress_results(self.id_data), **FIXED}


def _replaced(kind: str) -> Any:
    return pointer_to(
        bpy.types.Material,
        f"{kind} Material",
        f"Your material for the {kind.lower()} of this species, used instead of TetFlora's and kept when refining. "
        "Proxies keep the colors of the species",
    )


class TetFloraSpeciesOutput(bpy.types.PropertyGroup, SpeciesChoice):
    """Output settings of one species."""

    pass_index: integer(
        "Pass Index", "Index of this species' results, for compositing masks", 1, **within(0, high=32767), **_COMMON
    )
    light_group: string(
        "Light Group", "Light group of this species' meshes and proxies; if empty, that of all results", **_COMMON
    )
    leaf: _replaced("Leaf")
    blossom: _replaced("Blossom")
    bark: _replaced("Bark")


_PLACES = {
    "show_viewport": boolean(
        "Viewports", "Show results in viewports. Hide them to work with plants alone at full speed", True, **_COMMON
    ),
    "show_render": boolean("Renders", "Show meshes and proxies in renders", True, **_COMMON),
    "save_results": boolean(
        "File",
        "Save the meshes made by Refine in the file. Otherwise files stay as small as their plants, and Refine "
        "makes the same meshes again",
        **_COMMON,
    ),
}
_RAYS = {name: boolean(**given, **_COMMON) for name, given in output.SWITCHES.items()}


class TetFloraOutput(
    bpy.types.PropertyGroup,
    switches("results_in", "Where the meshes and proxies that Refine makes are", _PLACES),
    switches("ray_visibility", "Rays that see the meshes and proxies", _RAYS),
):
    """Output settings of all results."""

    pass_index: integer(
        "Pass Index", "Object index of results, except for species with their own", **within(0, high=32767), **_COMMON
    )
    light_group: string(
        "Light Group", "Light group of all results; matters where they emit light, as with baked lighting", **_COMMON
    )
    species: list_of(TetFloraSpeciesOutput, "Species", "Species with their own pass index, light group or materials")
    species_index: integer("Active Species", options={'HIDDEN', 'SKIP_SAVE'})
    add_species: gallery_of("species", TetFloraSpeciesOutput)
