# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assets: what each consists of, and where it stands.

An asset is an object, a collection, or geometry that nodes instance without an object of its own. What it instances by
collections, nodes and particles is followed down to meshes, each with all of its places in the asset. Its digest, of
meshes, materials and images, tells whether what it shows has changed since it was compiled.

Assets stand where marked objects scatter them, and where plants do whose species is an asset: the first level of what
nodes, particles or a collection instance. A group without anything of its own is opened, so that what is a tree counts;
one of very many parts is taken for a tree. All places of an asset are computed at once, as arrays.
"""

import hashlib
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Self

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Keys, Mask
from ...assets.asset import AssetSource, AssetSurface
from ...errors import SceneError
from ...growth.hashing import child_key, key_of_seed, uniform
from ...jobs import mapped
from ..attributes import KINDS, image_pixels, members, mesh_of, read, values_of, world_matrix
from ..compat import stored_inputs, tree_in_use
from ..materials.face_looks import FaceReader
from ..materials.node_values import settings_of
from ..materials.nodes import is_ours
from ..scene.objects import (
    DEEPEST,
    SURFACE_TYPES,
    Reference,
    geometry_of,
    has_nodes,
    instanced_by,
    is_listed,
    is_scatter,
    listed_instances,
    materials_of,
    name_keys,
    objects_within,
    renderable_objects,
)
from ..scene.plants import AssetPlants, read_asset_plants
from ..species.asset_species import TetFloraAssetSpecies, asset_species

#: What all nodes have: where they stand in the editor and how they look there; and what only refers to others.
_IDLE = {one.identifier for one in bpy.types.Node.bl_rna.properties} - {"type", "mute"}
_IDLE |= {"image_user", "texture_mapping", "color_mapping"}
# Content of packed images by identity and length: they are read once.
_packed: dict[tuple[int, int], str] = {}


def attributes_of(material: bpy.types.Material | None) -> Iterator[str]:
    """Names of attributes that a material asks for, groups included."""
    waiting = [] if material is None or (tree := tree_in_use(material)) is None else [tree]
    while waiting:
        for node in waiting.pop().nodes:
            if node.type == 'ATTRIBUTE':
                yield node.attribute_name
            elif node.type == 'VERTEX_COLOR':
                yield node.layer_name
            elif node.type == 'GROUP' and node.node_tree is not None:
                waiting.append(node.node_tree)


def _tree(tree: bpy.types.NodeTree) -> object:
    number = {node.as_pointer(): i for i, node in enumerate(tree.nodes)}
    nodes = [
        (
            node.bl_idname,
            [(name, _plain(getattr(node, name))) for name in _settings(type(node))],
            [_value(s) for s in node.inputs if not s.is_linked and hasattr(s, "default_value")],
            [_value(s) for s in node.outputs if node.type in {'RGB', 'VALUE'}],
        )
        for node in tree.nodes
        if node.type not in {'FRAME', 'REROUTE'}
    ]
    links = [
        [(number[n.as_pointer()], s.identifier) for n, s in ((k.from_node, k.from_socket), (k.to_node, k.to_socket))]
        for k in tree.links
    ]
    return nodes, links, [link.is_muted for link in tree.links]


def _value(socket: bpy.types.NodeSocket) -> tuple[str, object]:
    return socket.identifier, _plain(socket.default_value)


@cache
def _settings(kind: type[bpy.types.Node]) -> list[str]:
    """Properties of a kind of nodes that count."""
    return [p.identifier for p in kind.bl_rna.properties if p.identifier not in _IDLE and p.type != 'COLLECTION']


def _plain(value: Any) -> object:
    if isinstance(value, bpy.types.Image):
        return image_digest(value)
    if isinstance(value, bpy.types.NodeTree):
        return _tree(value)
    if isinstance(value, bpy.types.ColorRamp | bpy.types.CurveMapping):
        return settings_of(value)
    if isinstance(value, bpy.types.ID):
        return value.name_full
    if isinstance(value, bpy.types.bpy_struct):
        return None
    value = sorted(value) if isinstance(value, set) else value
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def image_digest(image: bpy.types.Image) -> str:
    """Digest of an image: of its pixels if only this file has them, else of the file that it is in."""
    how = f"{tuple(image.size)} {image.source} {image.alpha_mode} {image.colorspace_settings.name} "
    if image.is_dirty and image.size[0]:
        return how + hashlib.sha256(np.ascontiguousarray(image_pixels(image))).hexdigest()
    packed = image.packed_file
    if packed is not None:
        key = image.session_uid, packed.size
        if key not in _packed:
            _packed[key] = hashlib.sha256(packed.data).hexdigest()
        return how + _packed[key]
    if image.source == 'GENERATED':
        return how + f"{image.generated_type} {tuple(image.generated_color)}"
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    try:
        stat = path.stat()
    except OSError:
        return how + f"{path}"
    return how + f"{path} {stat.st_size} {stat.st_mtime_ns}"


#: What all datablocks and all modifiers have, but for whether these render; and what makes objects take part.
_EVERY = bpy.types.ID.bl_rna.properties.keys() + bpy.types.Modifier.bl_rna.properties.keys()
_COMMON = {*_EVERY, "animation_data"} - {"show_render"}
_ROLE = ("is_plant", "is_field", "is_explicit", "is_occluder", "is_scatter", "enabled", "species", "seed", "age")


def _settings_in(owner: bpy.types.bpy_struct, deepest: int = 4) -> list[tuple[str, object]]:
    names = [p.identifier for p in owner.bl_rna.properties if p.identifier not in _COMMON and p.type != 'COLLECTION']
    settings = {name: getattr(owner, name) for name in names}
    inner = {n: v for n, v in settings.items() if deepest and isinstance(v, bpy.types.bpy_struct) and _plain(v) is None}
    return [(n, _settings_in(v, deepest - 1) if n in inner else _plain(v)) for n, v in settings.items()]


def form_steps(obj: bpy.types.Object, deepest: int = DEEPEST) -> Generator[None, None, str]:
    """Digest of what an object shows, as it is stored, with modifiers and what its collection holds, unevaluated."""
    data = obj.data
    said: list[object] = [(m.type, _settings_in(m), stored_inputs(m)) for m in obj.modifiers]
    said += [[getattr(obj.tetflora, name) for name in _ROLE], *(_look_of(slot.material) for slot in obj.material_slots)]
    if data is not None and not hasattr(data, "attributes"):
        splines = getattr(data, "splines", ())
        said += [_settings_in(data), [[p.co[:] for p in (*s.points, *s.bezier_points)] for s in splines]]
    content = hashlib.sha256(repr((obj.type, said)).encode())
    for name in [*getattr(data, "attributes", {}).keys()]:
        attribute = data.attributes.get(name)  # with others, its own place changes
        if attribute and attribute.data_type in KINDS and (name == ".corner_vert" or not name.startswith(".")):
            content.update(f"{name} {attribute.domain}".encode())
            content.update(values_of(attribute))
            yield
    for inner in objects_within(obj.instance_collection) if obj.instance_collection and deepest else ():
        content.update(repr((inner.matrix_world[:], (yield from form_steps(inner, deepest - 1)))).encode())
    return content.hexdigest()


def _look_of(material: bpy.types.Material | None) -> object:
    return material and (tuple(material.diffuse_color), (tree := tree_in_use(material)) and _tree(tree))


Slots = list[bpy.types.Material | None]


@dataclass
class AssetPart:
    """A mesh of an asset."""

    name: str  # of the object, for messages
    shown: bpy.types.Object | bpy.types.GeometrySet  # the original object whose mesh it is, or the geometry
    places: list[Floats] = field(default_factory=list)  # from its space to that of the asset

    @property
    def matrices(self) -> Floats:
        """All places (n, 4, 4)."""
        return np.concatenate(self.places)

    @contextmanager
    def opened(self, depsgraph: bpy.types.Depsgraph) -> Iterator[tuple[bpy.types.Mesh, Slots] | None]:
        """The mesh as it is evaluated, and its materials, while the context lasts; None if it has no faces."""
        bare = isinstance(self.shown, bpy.types.GeometrySet)
        obj = None if bare else _evaluated(self.shown, depsgraph)
        with nullcontext(self.shown.mesh) if bare else mesh_of(obj) as mesh:
            yield (mesh, materials_of(obj, mesh)) if mesh is not None and len(mesh.polygons) else None


def _evaluated(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bpy.types.Object:
    """The evaluated object; the original where it is not evaluated, which has no modifiers then."""
    evaluated = obj.evaluated_get(depsgraph)
    return evaluated if evaluated.is_evaluated else obj


Trail = tuple[bpy.types.ID, ...]
Place = tuple[tuple[float, ...], ...]  # of a matrix (4, 4), which can be compared


class _Parts:
    """Follows references down to meshes, with all places at once; a path are the datablocks that it is in."""

    def __init__(self, name: str, depsgraph: bpy.types.Depsgraph) -> None:
        self._name, self._depsgraph = name, depsgraph
        self.parts: dict[object, AssetPart] = {}
        self.warnings: list[str] = []

    def take(self, shown: Reference, matrices: Floats, path: Trail = ()) -> None:
        """Take something with what it instances."""
        geometry = None
        if isinstance(shown, bpy.types.GeometrySet):
            if shown.mesh is not None:
                name = shown.name or (path[-1].name if path else self._name)
                self._add(shown, AssetPart(name, shown), matrices)
        else:
            self._refuse_cycle(shown, path)
            path = (*path, shown)
        if isinstance(shown, bpy.types.Object):
            if not shown.is_instancer or shown.show_instancer_for_render or shown.instance_type == 'COLLECTION':
                self._take_surface(shown, matrices)
            if is_listed(shown):
                self._one_by_one(shown, matrices)
                return
            if shown.type == 'CURVES' and has_nodes(shown):
                geometry = geometry_of(shown, self._depsgraph)
        keys = np.zeros(len(matrices), np.uint64)
        for target, places, _ in instanced_by(shown, matrices, keys, self._depsgraph):
            self.take(target, places, path)
        if geometry is not None and geometry.mesh is not None:
            self._add(shown, AssetPart(shown.name, geometry), matrices)

    @staticmethod
    def _refuse_cycle(shown: bpy.types.Object | bpy.types.Collection, path: Trail) -> None:
        if shown in path:
            what = f'"{shown.name}" instances itself, by way of "{path[-1].name}"; '
            if isinstance(shown, bpy.types.Object):
                raise SceneError(f"{what}change what one of the two instances")
            raise SceneError(
                f"The collection {what}take that object out of the collection, or let it instance another one"
            )

    def _one_by_one(self, obj: bpy.types.Object, matrices: Floats) -> None:
        """Instances on vertices and faces, and of particles, which only Blender's own list has."""
        back = np.linalg.pinv(world_matrix(obj, self._depsgraph).astype(np.float64))
        instances: dict[bpy.types.Object, list[Floats]] = {}
        for _, instance in listed_instances(self._depsgraph, (obj,)):
            if instance.object.original != obj:
                place = back @ np.array(instance.matrix_world, dtype=np.float64)
                instances.setdefault(instance.object.original, []).append(place)
        if not instances:
            self.warnings.append(
                f'What "{obj.name}" instances on vertices, faces or particles is left out of "{self._name}", because '
                "it is not in the scene; link it to the scene, or make its instances real"
            )
        for shown, places in instances.items():
            self._take_surface(shown, (matrices[:, None] @ np.array(places)).reshape(-1, 4, 4))

    def _take_surface(self, obj: bpy.types.Object, matrices: Floats) -> None:
        """Take the surface of an object itself."""
        if obj.type not in SURFACE_TYPES or is_ours(obj):
            return
        if obj.type == 'CURVES':
            if not has_nodes(obj):
                self.warnings.append(f'The hair of "{obj.name}" is left out of "{self._name}"; give it faces by nodes')
            return
        evaluated = _evaluated(obj, self._depsgraph)
        if obj.type == 'MESH':
            # Objects that share a mesh and its materials are one.
            materials = tuple(s.material for s in obj.material_slots if s.link == 'OBJECT')
            self._add((evaluated.data.as_pointer(), materials), AssetPart(obj.name, obj), matrices)
        else:
            self._add(obj, AssetPart(obj.name, obj), matrices)

    def _add(self, key: object, part: AssetPart, matrices: Floats) -> None:
        self.parts.setdefault(key, part).places.append(matrices)


#: Changes what a digest is of; raise it when what is read of an asset changes.
_VERSION = 3
_COLORS = {'FLOAT_COLOR', 'BYTE_COLOR'}
_TYPES = {'FLOAT', 'INT', 'BOOLEAN', 'FLOAT2', 'FLOAT_VECTOR', *_COLORS}


@dataclass(frozen=True)
class Target:
    """What is instanced; equal where it is the same datablock, or the same geometry."""

    #: An original. An object's space is its own, without its place in the scene; that of a collection is where
    #: instances of it show it: its objects as they stand, from its offset.
    datablock: bpy.types.Object | bpy.types.Collection | None
    geometry: bpy.types.GeometrySet | None  # without a datablock: what nodes instance
    owner: bpy.types.Object | None  # whose nodes, or the root of a family
    name: str  # for messages
    family: tuple[tuple[bpy.types.Object, Place], ...] = ()  # instead of both: originals, and places from their root

    @property
    def shown(self) -> bpy.types.Object | bpy.types.Collection | bpy.types.GeometrySet:
        """The datablock or the geometry."""
        return self.geometry if self.datablock is None else self.datablock

    def parts(self, depsgraph: bpy.types.Depsgraph) -> tuple[list[AssetPart], list[str]]:
        """What it consists of, and warnings of what is left out.

        Raises
        ------
        SceneError
            Something instances itself; the message names it.
        """
        walk = _Parts(self.name, depsgraph)
        for shown, place in self.family or ((self.shown, np.eye(4)),):
            walk.take(shown, np.array([place]))
        return list(walk.parts.values()), walk.warnings

    def meshes(self, depsgraph: bpy.types.Depsgraph) -> Iterator[tuple[AssetPart, bpy.types.Mesh, Slots]]:
        """Its parts with faces one after the other, each with its mesh and materials while it is looked at."""
        for part in self.parts(depsgraph)[0]:
            with part.opened(depsgraph) as opened:
                if opened is not None:
                    yield part, *opened


def digest_of(target: Target, depsgraph: bpy.types.Depsgraph, parts: list[AssetPart] | None = None) -> str:
    """Hexadecimal digest of all that a target shows: meshes, their attributes, materials and images, and places.

    Names of objects do not count, and of images in files only which file it is, how long and how old.
    Errors are those of `Target.parts`.
    """
    content = hashlib.sha256(str(_VERSION).encode())
    for part in target.parts(depsgraph)[0] if parts is None else parts:
        with part.opened(depsgraph) as opened:
            if opened is not None:
                content.update(np.ascontiguousarray(part.matrices))
                _add_mesh(content, *opened)
    return content.hexdigest()


def _add_mesh(content: "hashlib._Hash", mesh: bpy.types.Mesh, slots: Slots) -> None:
    content.update(repr([*map(_look_of, slots)]).encode())
    content.update(f"{len(mesh.vertices)} {len(mesh.polygons)} {len(mesh.loops)}".encode())
    content.update(read(mesh, "position"))
    content.update(read(mesh, ".corner_vert"))
    if len(mesh.loops) != 3 * len(mesh.polygons):  # else all are triangles, one after the other
        content.update(members(mesh.polygons, "loop_start", dtype=np.int32))
    wanted = {"material_index", *(name for material in slots for name in attributes_of(material))}
    for attribute in mesh.attributes:
        kind = attribute.data_type
        if kind in _TYPES and (attribute.name in wanted or kind == 'FLOAT2'):
            content.update(f"{attribute.name} {attribute.domain} {kind}".encode())
            content.update(values_of(attribute, "color" if kind in _COLORS else ""))
    content.update(next((layer.name for layer in mesh.uv_layers if layer.active_render), "").encode())


#: Triangles whose corners become vertices at once.
_TRIANGLES = 1 << 18


def read_source_steps(
    target: Target, depsgraph: bpy.types.Depsgraph
) -> Generator[float, None, tuple[AssetSource, tuple[str, ...]]]:
    """Read all surfaces of an asset; yields the fraction that is done.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Between two steps it may be evaluated again, but must be there.

    Returns
    -------
    AssetSource
    tuple of str
        Warnings for the artist: images that are missing, materials without shaders, and what is left out.

    Raises
    ------
    SceneError
        The asset has no faces, has vertices that are not finite numbers, or instances itself; the message names it.
    """
    parts, left = target.parts(depsgraph)
    reader = FaceReader()
    reader.warn(left)
    digest = digest_of(target, depsgraph, parts)
    surfaces: list[AssetSurface] = []
    shown: list[AssetPart] = []
    for number, part in enumerate(parts):
        steps = _surface_steps(part, depsgraph, reader)
        surface = yield from mapped(steps, lambda done, before=number: (before + done) / len(parts))
        if surface is not None:
            surfaces.append(surface)
            shown.append(part)
    if not surfaces:
        raise SceneError(
            f'"{target.name}" has no faces, so there is nothing to refine as an asset; add faces, or choose another '
            "object or collection"
        )
    counts = [len(part.matrices) for part in shown]
    source = AssetSource(
        name=target.name,
        surfaces=tuple(surfaces),
        surface=np.repeat(np.arange(len(surfaces)), counts).astype(np.int32),
        matrices=np.concatenate([part.matrices for part in shown]),
        digest=digest,
    )
    if not np.isfinite(source.matrices).all():
        raise SceneError(
            f'"{target.name}" shows instances whose place is not a finite number; correct the nodes or particles that '
            "make them"
        )
    return source, tuple(reader.warnings)


def _surface_steps(
    part: AssetPart, depsgraph: bpy.types.Depsgraph, reader: FaceReader
) -> Generator[float, None, AssetSurface | None]:
    """Read one mesh; None if it has no faces. Between two steps nothing of Blender's meshes is held."""
    with part.opened(depsgraph) as opened:
        if opened is None:
            return None
        mesh, slots = opened
        positions = read(mesh, "position")
        if not np.isfinite(positions).all():
            raise SceneError(f'"{part.name}" has vertices that are not finite numbers; delete them')
        mesh.calc_loop_triangles()
        faces = len(mesh.polygons)
        loops = members(mesh.loop_triangles, "loops", 3, np.int32)
        face = members(mesh.loop_triangle_polygons, "value", dtype=np.int32)
        corner_verts = read(mesh, ".corner_vert")
        looks = reader.prepare(mesh, slots)
    yield 0.0
    face_looks = yield from looks.steps(faces, positions, loops, corner_verts, face)
    # Vertices of triangles from their corners, in the same array.
    for start in range(0, len(loops), _TRIANGLES):
        piece = loops[start : start + _TRIANGLES]
        piece[:] = np.take(corner_verts, piece)
    return AssetSurface(name=part.name, positions=positions, triangles=loops, face=face, **face_looks)


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
    places = _plant_places(scene, depsgraph)
    marked = sorted((o for o in renderable_objects(depsgraph.view_layer) if is_scatter(o)), key=lambda o: o.name_full)
    for scatter in read_scatters(marked, depsgraph).values():
        places += scatter.places
    return places


def _plant_places(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[Places]:
    """Places of plants whose species is an asset, by its variants: objects as they are turned, where plants are."""
    read = read_asset_plants(scene, depsgraph)
    species = asset_species(scene)
    variants = {one: variants_of(species[one], depsgraph) for one in {plants.species for plants in read}}
    places = []
    for plants in read:
        places += _by_variant(plants, variants[plants.species])
    return places


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
    held, foot = set(objects), np.eye(4)
    roots = [o for o in objects if o.parent not in held]
    if len(roots) == 1 < len(objects) and roots[0].type in SURFACE_TYPES and not objects[0].hide_render:
        foot[:3, 3] = np.array(entry.collection.instance_offset) - world_matrix(roots[0], depsgraph)[:3, 3]
        return [(_target(entry.collection), foot)]  # a trunk with its leaves, which stands where the trunk does
    if len(roots) == 1 and roots[0].type not in SURFACE_TYPES:
        held -= {*roots}  # an empty that holds all trees
    trees: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    for top in objects:
        part = top
        while top.parent in held:
            top = top.parent
        trees.setdefault(top, []).append(part)
    variants = [_as_it_stands(trunk, depsgraph, parts) for trunk, parts in trees.items()]
    children = sorted(entry.collection.children, key=lambda c: c.name_full)
    variants += [(_target(child), np.eye(4)) for child in children if not child.hide_render]
    variants = [variant for variant in variants if any(variant[0].meshes(depsgraph))]
    if not variants:
        raise SceneError(
            f'The collection "{entry.collection.name}", which is used as a species, has no object with faces; add some'
        )
    return variants


def _as_it_stands(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, parts: Sequence = ()) -> Variant:
    """An object, with all parts that hang on it where there are some."""
    here, turned = world_matrix(obj, depsgraph).astype(np.float64), np.eye(4)
    turned[:3, :3] = here[:3, :3]
    if len(parts) < 2:
        return _target(obj), turned
    back = np.linalg.pinv(here)
    family = tuple((one, tuple(map(tuple, (back @ world_matrix(one, depsgraph)).tolist()))) for one in parts)
    return Target(None, None, obj, obj.name, family), turned


def _by_variant(plants: AssetPlants, variants: list[Variant]) -> list[Places]:
    keys = key_of_seed(plants.seed)
    chosen = np.zeros(len(keys), np.int64)
    if len(variants) > 1:
        chosen[:] = uniform(child_key(keys, _VARIANT), 0) * len(variants)
    places = []
    for number, (target, turned) in enumerate(variants):
        rows = np.flatnonzero(chosen == number)
        matrices = (plants.matrices[rows].reshape(-1, 4) @ turned).reshape(-1, 4, 4)
        whole = _sizeable(matrices)
        if whole.any():
            rows, matrices = rows[whole], matrices[whole]
            owners = plants.owners if len(plants.owners) == 1 else tuple(plants.owners[i] for i in rows.tolist())
            places.append(Places(target, matrices, keys[rows], owners))
    return places


def read_scatters(objects: list[bpy.types.Object], depsgraph: bpy.types.Depsgraph) -> "dict[bpy.types.Object, Scatter]":
    """What each of some original objects scatters.

    Raises
    ------
    SceneError
        A transform that is not a number; the message names the object.
    """
    scatters, slow = {}, []
    for obj in objects:
        walk = scatters[obj] = Scatter(obj, depsgraph)
        if is_listed(obj):
            slow.append(obj)
        else:
            walk.within(obj, world_matrix(obj, depsgraph)[None].astype(np.float64), name_keys([obj]))
    if slow:
        _one_by_one({obj: scatters[obj] for obj in slow}, depsgraph)
    for walk in scatters.values():
        walk.finish()
    return scatters


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
            columns = zip(*parts, strict=True)
            matrices, keys = (arrays[0] if len(arrays) == 1 else np.concatenate(arrays) for arrays in columns)
            bad = int((~np.isfinite(matrices).all(axis=(1, 2))).sum())
            if bad:
                raise SceneError(
                    f'"{self.owner.name}": {bad:,} of {len(keys):,} instances of "{target.name}" have an invalid '
                    "position, rotation or scale; fix its modifiers or turn off Refine Scatter in Properties > Object"
                )
            whole = _sizeable(matrices)
            if not whole.all():
                matrices, keys = matrices[whole], keys[whole]
            if len(keys):
                self.places.append(Places(target, matrices, keys, (self.owner,)))

    def within(self, shown: Reference, places: Floats, keys: NDArray, depth: int = 0) -> None:
        """Take what something instances; a group within a group of objects is deeper."""
        for one in instanced_by(shown, places, keys, self.depsgraph):
            self.take(*one, depth + isinstance(shown, bpy.types.Object))

    def take(self, shown: Reference, places: Floats, keys: NDArray, depth: int) -> None:
        """Take an asset, or what a group of them holds."""
        if depth <= DEEPEST and self._is_group(shown):
            self.within(shown, places, keys, depth)
        elif isinstance(shown, bpy.types.GeometrySet):
            name = shown.name or self.owner.name
            self.add(Target(datablock=None, geometry=shown, owner=self.owner, name=name), places, keys)
        else:
            self.add(_target(shown), places, keys)

    def add(self, target: Target, places: Floats, keys: Keys) -> None:
        """Note places of an asset; of what has no faces only how many there are."""
        if target not in self._faces:
            self._faces[target] = any(target.meshes(self.depsgraph))
        if self._faces[target]:
            self._parts.setdefault(target, []).append((places, keys))
        else:
            self.left[target.name] = self.left.get(target.name, 0) + len(keys)

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
    return np.abs(np.einsum("ni,ni->n", x, np.cross(y, z))) > _TINY * longest**3
