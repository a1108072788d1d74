# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where assets stand: what marked objects scatter, and plants whose species is an asset.

An object's nodes, particles or collection are followed to the first level of what they instance: that are the assets.
A group of instances without anything of its own is opened, so that what is a tree counts as the asset; one of very
many parts is taken for a tree itself. All places of an asset are computed at once, as arrays.
"""

from dataclasses import dataclass, replace
from typing import Self

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Keys, Mask
from ...errors import SceneError
from ...growth.hashing import child_key, key_of_seed, uniform
from ..attributes import world_matrix
from ..scene.objects import (
    DEEPEST,
    SURFACE_TYPES,
    Reference,
    geometry_of,
    has_nodes,
    instanced,
    is_listed,
    is_scatter,
    listed_instances,
    name_keys,
    renderable_objects,
)
from ..scene.plants import AssetPlants, read_asset_plants
from ..species.asset_species import TetFloraAssetSpecies, asset_species
from .parts import Target

#: Instances up to which something that has nothing else is a group of assets; what has more is an asset of many parts.
MOST_IN_GROUP = 256
_VARIANT = 0x7F4A  # child of a plant's key that draws its variant
_TINY = 1e-9  # of an axis over the longest: such instances are flat or have no size, as under masks of scatter tools


@dataclass(frozen=True)
class Places:
    """Places of one asset."""

    target: Target  # what stands there
    matrices: Floats  # (n, 4, 4): from the asset's space to world space
    keys: Keys  # (n,): tell individuals apart, through animations as well
    #: The original object that shows it: the instancer, the plant or the field; n of them where each place has its own
    owners: tuple[bpy.types.Object, ...]

    @property
    def owner(self) -> bpy.types.Object:
        """The first one."""
        return self.owners[0]

    def __len__(self) -> int:
        """Number of places."""
        return len(self.keys)

    def counted_from(self, origin: Floats) -> Self:
        """The same in coordinates that begin at a place (3,) of the present ones."""
        if not origin.any():
            return self
        matrices = self.matrices.copy()
        matrices[:, :3, 3] -= origin
        return replace(self, matrices=matrices)


def read_places(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[Places]:
    """Places of all assets of a view layer that render: first of plants, then of objects that scatter, by name.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        In which originals are shown, as `results.hiding.originals_shown` does.

    Raises
    ------
    SceneError
        A transform that is not a number, a species whose collection has no object with faces, or a marked object of a
        kind that cannot be read; the message names the object.
    """
    found = plant_places(scene, depsgraph)
    marked = sorted((o for o in renderable_objects(depsgraph.view_layer) if is_scatter(o)), key=lambda o: o.name_full)
    for scatter in read_scatters(marked, depsgraph).values():
        found += scatter.places
    return found


def plant_places(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[Places]:
    """Places of plants whose species is an asset, by the variants of each.

    An object stands as it is turned and scaled in the scene, at the place of the plant instead of its own.
    Errors are those of `read_places`.
    """
    read = read_asset_plants(scene, depsgraph)
    if not read:
        return []
    species = asset_species(scene)
    variants = {one: variants_of(species[one], depsgraph) for one in {plants.species for plants in read}}
    found = []
    for plants in read:
        found += _by_variant(plants, variants[plants.species])
    return found


Variant = tuple[Target, Floats]


def variants_of(entry: TetFloraAssetSpecies, depsgraph: bpy.types.Depsgraph) -> list[Variant]:
    """What plants of a species look like: each target with the matrix (4, 4) from its space to that of the plant.

    Raises
    ------
    SceneError
        Nothing of it has faces.
    """
    if entry.object is not None:
        return [_as_it_stands(entry.object, depsgraph)]
    if not entry.variants:
        return [(_target(entry.collection), np.eye(4))]
    objects = sorted(entry.collection.objects, key=lambda o: o.name_full)
    # Hiding some leaves them out. But where all are hidden, it is so that they show as plants only.
    objects = [o for o in objects if not o.hide_render] or objects
    found = [_as_it_stands(o, depsgraph) for o in objects]
    children = sorted(entry.collection.children, key=lambda c: c.name_full)
    found += [(_target(child), np.eye(4)) for child in children if not child.hide_render]
    found = [variant for variant in found if shows_faces(variant[0], depsgraph)]
    if not found:
        raise SceneError(
            f'The collection "{entry.collection.name}", which is used as a species, has no object with faces; add some'
        )
    return found


def _as_it_stands(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Variant:
    turned = np.eye(4)
    turned[:3, :3] = world_matrix(obj, depsgraph)[:3, :3]
    return _target(obj), turned


def _by_variant(plants: AssetPlants, variants: list[Variant]) -> list[Places]:
    keys = key_of_seed(plants.seed)
    chosen = np.zeros(len(keys), np.int64)
    if len(variants) > 1:
        chosen[:] = uniform(child_key(keys, _VARIANT), 0) * len(variants)
    found = []
    for number, (target, turned) in enumerate(variants):
        own = np.flatnonzero(chosen == number)
        matrices = (plants.matrices[own].reshape(-1, 4) @ turned).reshape(-1, 4, 4)
        whole = _sizeable(matrices)
        if whole.any():
            own, matrices = own[whole], matrices[whole]
            owners = plants.owners if len(plants.owners) == 1 else tuple(plants.owners[i] for i in own.tolist())
            found.append(Places(target, matrices, keys[own], owners))
    return found


def read_scatters(objects: list[bpy.types.Object], depsgraph: bpy.types.Depsgraph) -> "dict[bpy.types.Object, Scatter]":
    """What each of some original objects scatters.

    Raises
    ------
    SceneError
        A transform that is not a number; the message names the object.
    """
    found, slow = {}, []
    for obj in objects:
        walk = found[obj] = Scatter(obj, depsgraph)
        if is_listed(obj):
            slow.append(obj)
        else:
            walk.shown(obj, world_matrix(obj, depsgraph)[None].astype(np.float64), name_keys([obj]))
    if slow:
        _one_by_one({obj: found[obj] for obj in slow}, depsgraph)
    for walk in found.values():
        walk.finish()
    return found


def shows_faces(target: Target, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether a target has any face.

    Raises
    ------
    SceneError
        It instances itself; the message names what does.
    """
    return any(True for _ in target.meshes(depsgraph))


def _target(datablock: bpy.types.Object | bpy.types.Collection) -> Target:
    return Target(datablock=datablock, geometry=None, owner=None, name=datablock.name)


class Scatter:
    """What one object scatters: what it instances is followed to its assets, with all places at once."""

    def __init__(self, owner: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
        self.owner, self.depsgraph = owner, depsgraph
        self.places: list[Places] = []  # each target once, when all has been followed
        #: Instances that are no assets, by name and number: empties, lights, cameras and volumes
        self.left: dict[str, int] = {}
        self._parts: dict[Target, list[tuple[NDArray, NDArray]]] = {}
        self._faces: dict[Target, bool] = {}

    def finish(self) -> None:
        """Gather the places of each target."""
        for target, parts in self._parts.items():
            matrices, keys = (
                column[0] if len(parts) == 1 else np.concatenate(column) for column in zip(*parts, strict=True)
            )
            bad = int((~np.isfinite(matrices).all(axis=(1, 2))).sum())
            if bad:
                raise SceneError(
                    f'"{self.owner.name}": {bad:,} of {len(keys):,} instances of "{target.name}" have an invalid '
                    "position, rotation or scale; correct its modifiers, or turn off Refine Scatter in the TetFlora "
                    "tab of the sidebar"
                )
            whole = _sizeable(matrices)
            if not whole.all():
                matrices, keys = matrices[whole], keys[whole]
            if len(keys):
                self.places.append(Places(target, matrices, keys, (self.owner,)))

    def shown(self, obj: bpy.types.Object, places: Floats, keys: NDArray, depth: int = 0) -> None:
        """Take what an object instances."""
        if obj.instance_type == 'COLLECTION' and obj.instance_collection is not None:
            self.take(obj.instance_collection, places, keys, depth + 1)
        if has_nodes(obj) and (geometry := geometry_of(obj, self.depsgraph)) is not None:
            self._instances(geometry, places, keys, depth + 1)

    def take(self, shown: Reference, places: Floats, keys: NDArray, depth: int) -> None:
        """Take an asset, or what a group of them holds."""
        if depth <= DEEPEST and self._is_group(shown):
            if isinstance(shown, bpy.types.Object):
                self.shown(shown, places, keys, depth)
            else:
                self._instances(shown, places, keys, depth)
        elif isinstance(shown, bpy.types.GeometrySet):
            name = shown.name or self.owner.name
            self.add(Target(datablock=None, geometry=shown, owner=self.owner, name=name), places, keys)
        else:
            self.add(_target(shown), places, keys)

    def add(self, target: Target, places: Floats, keys: Keys) -> None:
        """Note places of an asset; of what has no faces only how many there are."""
        if target not in self._faces:
            self._faces[target] = shows_faces(target, self.depsgraph)
        if self._faces[target]:
            self._parts.setdefault(target, []).append((places, keys))
        else:
            self.left[target.name] = self.left.get(target.name, 0) + len(keys)

    def _instances(self, geometry: bpy.types.GeometrySet, places: NDArray, keys: NDArray, depth: int) -> None:
        for one in instanced(geometry, places, keys):
            self.take(*one, depth)

    def _is_group(self, shown: Reference) -> bool:
        """Whether something has no surface of its own, and instances a few others."""
        if isinstance(shown, bpy.types.Collection):
            return False
        if isinstance(shown, bpy.types.Object):
            if shown.type not in SURFACE_TYPES:
                return shown.instance_type == 'COLLECTION' and shown.instance_collection is not None
            if not has_nodes(shown) or shown.type != 'MESH' or (geometry := geometry_of(shown, self.depsgraph)) is None:
                return False
            shown = geometry
        points = shown.instances_pointcloud()
        bare = shown.mesh is None or not len(shown.mesh.polygons)
        return bare and points is not None and 0 < len(points.points) <= MOST_IN_GROUP


def _one_by_one(walks: dict[bpy.types.Object, Scatter], depsgraph: bpy.types.Depsgraph) -> None:
    """Instances of particles and on vertices and faces, which only Blender's own list has."""
    listed: dict[tuple[bpy.types.Object, bpy.types.Object], tuple[list, list]] = {}
    for owner, instance in listed_instances(depsgraph, walks):
        obj = instance.object
        original = obj.original
        if obj.type == original.type:  # parts of another type come once more
            matrices, numbers = listed.setdefault((owner, original), ([], []))
            matrices.append(instance.matrix_world.copy())
            numbers.append(instance.random_id)
    for (owner, original), (matrices, numbers) in listed.items():
        keys = child_key(name_keys([owner]), np.array(numbers, np.int64))
        walks[owner].add(_target(original), np.array(matrices, np.float64), keys)


def _sizeable(matrices: Floats) -> Mask:
    """Whether each of some places (n, 4, 4) has a size along three axes."""
    x, y, z = (matrices[:, :3, i] for i in range(3))
    longest = np.sqrt(np.maximum.reduce([np.einsum("ni,ni->n", axis, axis) for axis in (x, y, z)]))
    volume = np.abs(np.einsum("ni,ni->n", x, np.cross(y, z)))
    return volume > _TINY * longest**3
