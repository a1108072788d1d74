# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants as objects of a scene: making, finding and removing the empties and fields that stand for them."""

from collections.abc import Iterable, Sequence
from functools import lru_cache

import bpy
import numpy as np
from mathutils import Matrix

from ..errors import SceneError
from .migration import VERSION
from .placement import Placement, new_seeds
from .plant_fields import fields_of, quaternions, read_field, stored_size, upright, write_field
from .plant_kinds import form_of, species_of
from .scene_reader import single_plants
from .species_items import catalogue, display_height
from .transforms import world_matrix

COLLECTION = "TetFlora plants"
FIELD = "Field of plants"
_FIELD_MARK = "tetflora_field"  # on the objects of fields that TetFlora made and may remove
_MARK = "tetflora_plants"  # on the collection, so that it may be renamed


def plants_of(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those of the objects that are plants, each by itself; fields are told by `fields_of`."""
    return [o for o in objects if o.tetflora.is_plant]


def plant_collections(scene: bpy.types.Scene) -> list[bpy.types.Collection]:
    """The scene's collections for plants that are there."""
    return [c for c in scene.collection.children_recursive if c.get(_MARK) and c.library is None]


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
    angles = np.zeros((len(placement), 3))
    angles[:, 2] = placement.azimuth
    rows = (placement.position, angles, placement.scale, placement.species, placement.seed)
    return _empties(scene, rows, species, [None] * len(species))


def _empties(
    scene: bpy.types.Scene,
    rows: Sequence[np.ndarray],
    species: Sequence[str],
    forms: Sequence[bpy.types.Object | None],
) -> list[bpy.types.Object]:
    """One empty for each row of places, XYZ Euler angles, scales, numbers of kinds and seeds."""
    known = catalogue()
    names = [known[s].name if s in known else s for s in species]
    heights = [display_height(s) for s in species]
    link = plant_collection(scene).objects.link
    new = bpy.data.objects.new
    made = []
    for position, angles, scale, kind, seed in zip(*(row.tolist() for row in rows), strict=True):
        obj = new(names[kind], None)
        obj.empty_display_type = 'SINGLE_ARROW'
        obj.empty_display_size = heights[kind]
        obj.location = position
        obj.rotation_euler = angles
        obj.scale = (scale, scale, scale)
        group = obj.tetflora
        group.version, group.is_plant, group.species, group.seed = VERSION, True, species[kind], seed
        if forms[kind] is not None:
            group.form = forms[kind]
        link(obj)
        made.append(obj)
    prepare_scene(scene)
    return made


def add_field(scene: bpy.types.Scene, placement: Placement, species: Sequence[str]) -> bpy.types.Object:
    """Make one field of the plants of a placement, upright, in the scene's collection for plants.

    Parameters
    ----------
    placement : Placement
    species : sequence of str
        Identifiers that ``placement.species`` counts through.
    """
    turned = upright(placement.azimuth)
    rows = (placement.position, turned, placement.scale, placement.species, placement.seed)
    return _link_field(scene, write_field(FIELD, *rows, species))


def field_from_plants(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, plants: Iterable[bpy.types.Object]
) -> bpy.types.Object:
    """Put a field in place of plants that are objects; the same individuals stand at the same places.

    Raises
    ------
    SceneError
        A plant cannot be read; nothing is changed.
    """
    plants = sorted(plants, key=lambda o: o.name_full)
    read = single_plants(plants, depsgraph)
    species, forms = [species_of(kind) for kind in read.kinds], [form_of(kind) for kind in read.kinds]
    rows = (read.position, quaternions(read.frame), read.scale, read.species, read.seed)
    made = _link_field(scene, write_field(FIELD, *rows, species, forms))
    remove_plants(plants)
    return made


def plants_from_field(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, field: bpy.types.Object, most: int
) -> list[bpy.types.Object]:
    """Put empties in place of a field; the same individuals stand at the same places.

    Parameters
    ----------
    most : int
        Objects that may be made.

    Raises
    ------
    SceneError
        The field has no points, too many, or cannot be read; nothing is changed.
    """
    read = read_field(field, depsgraph, world_matrix(field, depsgraph)[None])
    if not 0 < len(read) <= most:
        raise SceneError(
            f'"{field.name}" has {len(read):,} plants; '
            + (f"at most {most:,} can become objects, so split the mesh first" if len(read) else "nothing to make")
        )
    angles = np.array([Matrix(frame).to_euler() for frame in read.frame])
    species, forms = [species_of(kind) for kind in read.kinds], [form_of(kind) for kind in read.kinds]
    made = _empties(scene, (read.position, angles, read.scale, read.species, read.seed), species, forms)
    remove_fields([field])
    return made


def remove_fields(objects: Iterable[bpy.types.Object]) -> int:
    """Delete fields that TetFlora made; others keep their object and lose the mark. How many plants they stored."""
    fields = [o for o in fields_of(objects) if o.library is None]
    number = sum(stored_size(field) for field in fields)
    for field in fields:
        field.tetflora.is_field = False
    ours = [field for field in fields if field.get(_FIELD_MARK)]
    meshes = {field.data for field in ours}
    bpy.data.batch_remove(ours)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])
    _remove_empty_collections()
    return number


def trunks(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> np.ndarray:
    """Where plants of a scene stand on the map, (n, 2) float64: those that are objects, and those of fields."""
    single = np.array([o.matrix_world.translation[:2] for o in plants_of(scene.objects)]).reshape(-1, 2)
    fields = [read_field(o, depsgraph, world_matrix(o, depsgraph)[None]) for o in fields_of(scene.objects)]
    return np.concatenate([single, *(field.position[:, :2] for field in fields)])


def _link_field(scene: bpy.types.Scene, field: bpy.types.Object) -> bpy.types.Object:
    field.tetflora.version, field[_FIELD_MARK] = VERSION, True
    plant_collection(scene).objects.link(field)
    prepare_scene(scene)
    return field


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
    _remove_empty_collections()
    return len(plants)


def _remove_empty_collections() -> None:
    for collection in [c for c in bpy.data.collections if c.get(_MARK) and c.library is None]:
        if not collection.all_objects and not collection.children:
            bpy.data.collections.remove(collection)
