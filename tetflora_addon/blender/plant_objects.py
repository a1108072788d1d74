# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants as objects of a scene: making, finding and removing the empties that stand for them."""

from collections.abc import Iterable, Sequence
from functools import lru_cache

import bpy
import numpy as np

from .migration import VERSION
from .placement import Placement, new_seeds
from .species_items import catalogue, display_height

COLLECTION = "TetFlora plants"
_MARK = "tetflora_plants"  # on the collection, so that it may be renamed


def plants_of(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those of the objects that are plants."""
    return [o for o in objects if o.tetflora.is_plant]


def plant_collection(scene: bpy.types.Scene) -> bpy.types.Collection:
    """The scene's collection for plants; made if there is none."""
    for collection in scene.collection.children_recursive:
        if collection.get(_MARK) and collection.library is None:
            return collection
    collection = bpy.data.collections.new(COLLECTION)
    collection[_MARK] = True
    scene.collection.children.link(collection)
    return collection


def add_plants(scene: bpy.types.Scene, placement: Placement, species: Sequence[str]) -> list[bpy.types.Object]:
    """Make the empties of a placement, upright, in the scene's collection for plants.

    Parameters
    ----------
    placement : Placement
    species : sequence of str
        Identifiers that ``placement.species`` counts through.

    Returns
    -------
    list of bpy.types.Object
        In the placement's order.
    """
    known = catalogue()
    names = [known[s].name if s in known else s for s in species]
    heights = [display_height(s) for s in species]
    link = plant_collection(scene).objects.link
    new = bpy.data.objects.new
    made = []
    rows = (placement.position, placement.azimuth, placement.scale, placement.species, placement.seed)
    for position, azimuth, scale, kind, seed in zip(*(row.tolist() for row in rows), strict=True):
        obj = new(names[kind], None)
        obj.empty_display_type = 'SINGLE_ARROW'
        obj.empty_display_size = heights[kind]
        obj.location = position
        obj.rotation_euler = (0.0, 0.0, azimuth)
        obj.scale = (scale, scale, scale)
        group = obj.tetflora
        group.version, group.is_plant, group.species, group.seed = VERSION, True, species[kind], seed
        link(obj)
        made.append(obj)
    prepare_scene(scene)
    return made


def prepare_scene(scene: bpy.types.Scene) -> None:
    """Settings that a scene with plants needs.

    Refinement changes the scene while it renders; with Blender's interface unlocked, the window would draw the same
    data at that time and could crash.
    """
    scene.render.use_lock_interface = True
    scene.tetflora.version = VERSION


def assign_species(objects: Iterable[bpy.types.Object], identifier: str) -> int:
    """Make plants belong to a species; how many were changed. Their seeds stay."""

    @lru_cache(maxsize=1)
    def height() -> float:
        return display_height(identifier)

    changed = [o for o in plants_of(objects) if o.tetflora.species != identifier]
    for obj in changed:
        obj.tetflora.species = identifier
        if obj.type == 'EMPTY':
            obj.empty_display_size = height()
    return len(changed)


def reseed(objects: Iterable[bpy.types.Object], roll: int = 0) -> int:
    """Give plants other seeds; how many there were. The same roll of the same plants gives the same seeds."""
    plants = sorted(plants_of(objects), key=lambda o: o.name_full)
    # Copies made by duplicating have equal seeds and shall part, so the place among the plants takes part.
    old = np.array([o.tetflora.seed for o in plants], dtype=np.int64) + (np.arange(len(plants)) << 32)
    for obj, seed in zip(plants, new_seeds(old, roll).tolist(), strict=True):
        obj.tetflora.seed = seed
    return len(plants)


def remove_plants(objects: Iterable[bpy.types.Object]) -> int:
    """Delete plants from the file, and the collection for plants if that leaves it empty; how many there were."""
    plants = [o for o in plants_of(objects) if o.library is None]
    bpy.data.batch_remove(plants)
    for collection in [c for c in bpy.data.collections if c.get(_MARK) and c.library is None]:
        if not collection.all_objects and not collection.children:
            bpy.data.collections.remove(collection)
    return len(plants)
