# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants as objects of a scene: making, finding, changing and removing the empties and fields that stand for them.

Points of fields are taken out and put in as whole arrays, with all that is stored with them. A field whose points come
from nodes, or that has edges and faces, belongs to somebody else's modeling and is left alone.
"""

import uuid
from collections.abc import Generator, Iterable, Sequence

import bpy
import numpy as np
from bpy.types import Collection, Depsgraph, Mesh, Object, Scene
from mathutils import Matrix, Quaternion
from numpy.typing import NDArray

from ...arrays import Floats, Mask, quaternions
from ...errors import SceneError
from ...jobs import run_to_end
from ...planting.places import Placement, new_seeds
from ...species.kinds import species_of
from .. import settings
from ..attributes import KINDS, read, values_of, world_matrix, write
from ..saved_files import VERSION
from ..scene import fields
from ..scene.ages import plainly_aged, relative_heights
from ..scene.plants import single_plants
from ..scene.skeletons import kind_of_choice, skeleton_object_of
from ..species.edits import catalog, display_height

COLLECTION = "TetFlora plants"
FIELD = "Field of plants"
#: Up to this many become empties by default; with more, Blender becomes slow.
EMPTIES_UNASKED = 10_000
POPULATION_MARK = "tetflora_population"  # on the collection of a population's plants
PAINTED_MARK = "tetflora_painted"  # on the field that painted plants go to
_MARK = "tetflora_plants"  # on the collection, so that it may be renamed
_BATCH = 300  # empties of one step, ten milliseconds
_FEW = 1000  # plants that may get their names the way Blender does it
#: Where plants go; None for the scene's collection for plants.
Home = Collection | None


def plants_of(objects: Iterable[Object]) -> list[Object]:
    """Those of the objects that are single plants; `fields_of` finds fields."""
    return [o for o in objects if o.tetflora.is_plant]


def plant_collections(scene: Scene) -> list[Collection]:
    """The scene's collections for plants that are there."""
    return [c for c in scene.collection.children_recursive if c.get(_MARK) and not (c.library or c.override_library)]


def plant_collection(scene: Scene) -> Collection:
    """The scene's collection for plants; made if there is none."""
    if collections := plant_collections(scene):
        return collections[0]
    collection = bpy.data.collections.new(COLLECTION)
    collection[_MARK] = True
    settings.begin(scene)
    scene.collection.children.link(collection)
    return collection


def next_seed(scene: Scene) -> int:
    """Seed of the next plant added to a scene: another one each time, but the same when a script runs again."""
    return int(new_seeds(np.array([len(plants_of(scene.objects))]))[0])


def add_plant(
    scene: Scene, position: Sequence[float], azimuth: float, scale: float, seed: int, species: str
) -> list[Object]:
    """Make the empty of one plant, with its trunk's base at a position in world space; a list of it."""
    place = np.array([position], dtype=np.float64), np.array([azimuth])
    placement = Placement(*place, np.array([scale]), np.zeros(1, np.int32), np.array([seed]), wanted=1)
    return run_to_end(add_plants_steps(scene, placement, [species]))


def add_plants_steps(
    scene: Scene, placement: Placement, species: Sequence[str], home: Home = None, ages: Floats | None = None
) -> Generator[list[Object], object, list[Object]]:
    """Make the empties of a placement.

    Parameters
    ----------
    species : sequence of str
        Identifiers that ``placement.species`` refers to.
    ages : (n,) float, optional
        Years; all are full-grown if not given.

    Yields
    ------
    list of bpy.types.Object
        Those that are made so far, which the caller removes if it goes no further.

    Returns
    -------
    list of bpy.types.Object
        In the placement's order.
    """
    # XYZ Euler angles, (n, 3); upright plants turn about the vertical only.
    angles = np.zeros((len(placement), 3))
    angles[:, 2] = placement.azimuth
    tilted = np.flatnonzero(placement.up[:, 2] < 1.0)
    if len(tilted):
        angles[tilted] = [Quaternion(q).to_euler() for q in placement.rotation[tilted].tolist()]
    rows = (placement.position, angles, placement.scale, placement.species, placement.seed)
    return _empties_steps(scene, rows, species, [None] * len(species), home, ages)


def _empties_steps(
    scene: Scene,
    rows: Sequence[np.ndarray],
    species: Sequence[str],
    forms: Sequence[Object | None],
    home: Home = None,
    ages: Floats | None = None,
) -> Generator[list[Object], object, list[Object]]:
    """One empty for each row of places, XYZ Euler angles, scales, numbers of kinds and seeds."""
    known = catalog()
    names = _numbered([known[s].name if s in known else s for s in species], rows[3])
    target = (home or plant_collection(scene)).objects
    new = bpy.data.objects.new
    empties: list = [None] * len(names)
    kinds, seeds = rows[3].tolist(), rows[4].tolist()
    # Blender keeps objects sorted by name, and is fast where one comes after the one before.
    for count, number in enumerate(sorted(range(len(names)), key=names.__getitem__), 1):
        empties[number] = obj = new(names[number], None)
        kind, group = kinds[number], obj.tetflora
        group.version, group.is_plant, group.species, group.seed = VERSION, True, species[kind], seeds[number]
        if forms[kind] is not None:
            group.skeleton = forms[kind]
        if ages is not None and ages[number] != 0.0:
            group.age = ages[number]
        target.link(obj)
        if not count % _BATCH:
            yield [obj for obj in empties if obj is not None]
    heights = np.array([display_height(s) for s in species], dtype=np.float32)[rows[3]]
    for kind in range(len(species)) if ages is not None else ():
        of_kind = rows[3] == kind
        heights[of_kind] *= relative_heights(species[kind], ages[of_kind])
    _set_at_once(empties, rows, heights)
    prepare_scene(scene)
    return empties


def _set_at_once(objects: Sequence[Object], rows: Sequence[np.ndarray], heights: np.ndarray) -> None:
    """Give new empties their places and looks.

    What is set object by object makes Blender slow when it deletes them later: 10,000 take several times as long as
    with ``foreach_set``, which needs a collection that holds these and nothing else.
    """
    position, angles, scale, *_ = rows
    arrow = Object.bl_rna.properties["empty_display_type"].enum_items['SINGLE_ARROW'].value
    within = bpy.data.collections.new(COLLECTION)
    for obj in objects:
        within.objects.link(obj)
    names = ("location", "rotation_euler", "scale", "empty_display_size")
    for name, values in zip(names, (position, angles, np.repeat(scale, 3), heights), strict=True):
        within.objects.foreach_set(name, np.ascontiguousarray(values, dtype=np.float32).reshape(-1))
    within.objects.foreach_set("empty_display_type", np.full(len(objects), arrow, np.int32))
    bpy.data.collections.remove(within)


def _numbered(names: Sequence[str], kinds: np.ndarray) -> list[str]:
    """Name of each new plant, by its kind.

    Blender finds numbers for equal names by itself, and is slow at it: 30,000 plants of one name take twice as long.
    """
    if len(kinds) < _FEW:
        return [names[kind] for kind in kinds.tolist()]
    used = [int(end) for _, dot, end in (o.name.rpartition(".") for o in bpy.data.objects) if dot and end.isdecimal()]
    first = max(used, default=0) + 1
    width = max(3, len(str(first + len(kinds))))
    return [f"{names[kind]}.{number:0{width}d}" for number, kind in enumerate(kinds.tolist(), first)]


def add_field(
    scene: Scene, placement: Placement, species: Sequence[str], home: Home = None, ages: Floats | None = None
) -> Object:
    """Make one field of the plants of a placement.

    Parameters
    ----------
    species : sequence of str
        Identifiers that ``placement.species`` refers to.
    ages : (n,) float, optional
        Years; all are full-grown if not given.
    """
    rows = (placement.position, placement.rotation, placement.scale, placement.species, placement.seed)
    return link_field(scene, fields.write_field(FIELD, *rows, species, ages=ages), home)


def field_from_plants(scene: Scene, depsgraph: Depsgraph, plants: Iterable[Object], home: Home = None) -> Object:
    """Put a field in place of plants that are objects; the same individuals stand at the same places.

    Raises
    ------
    SceneError
        A plant cannot be read; nothing is changed.
    """
    plants = sorted(plants, key=lambda o: o.name_full)
    read = single_plants(plants, depsgraph)
    species = [species_of(kind) for kind in read.identifiers]
    forms = [skeleton_object_of(kind) for kind in read.identifiers]
    rows = (read.position, quaternions(read.frame), read.scale, read.species, read.seed)
    field = link_field(scene, fields.write_field(FIELD, *rows, species, forms, fields.stored_ages(plants)), home)
    remove_plants(plants)
    return field


def plants_from_field(scene: Scene, depsgraph: Depsgraph, field: Object, most: int, home: Home = None) -> list[Object]:
    """Put empties in place of a field; the same individuals stand at the same places.

    Recorded sizes become ages and scales; empties have no crown shapes.

    Parameters
    ----------
    most : int
        Objects that may be made.

    Raises
    ------
    SceneError
        The field has no points, too many, or cannot be read; nothing is changed.
    """
    given = fields.read_aged_field(field, depsgraph, world_matrix(field, depsgraph)[None])
    read, ages = plainly_aged(scene, *given, depsgraph)
    if not 0 < len(read) <= most:
        raise SceneError(
            f'"{field.name}" has {len(read):,} plants; '
            + (f"the limit for objects is {most:,}. Split the field first" if len(read) else "add points first")
        )
    angles = np.array([Matrix(frame).to_euler() for frame in read.frame])
    species = [species_of(kind) for kind in read.identifiers]
    forms = [skeleton_object_of(kind) for kind in read.identifiers]
    rows = (read.position, angles, read.scale, read.species, read.seed)
    empties = run_to_end(_empties_steps(scene, rows, species, forms, home, ages))
    remove_fields([field])
    return empties


def remove_fields(objects: Iterable[Object], tidy: bool = True) -> int:
    """Delete fields that TetFlora made; others keep their object and lose the mark. How many plants they stored.

    Parameters
    ----------
    tidy : bool
        Remove collections that this leaves empty.
    """
    gone = [o for o in fields.fields_of(objects) if o.library is None]
    number = sum(fields.stored_size(field) for field in gone)
    for field in gone:
        field.tetflora.is_field = False
    ours = [field for field in gone if field.get(FIELD_MARK)]
    meshes = {field.data for field in ours}
    bpy.data.batch_remove(ours)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])
    if tidy:
        remove_empty_collections()
    return number


def link_field(scene: Scene, field: Object, home: Home = None) -> Object:
    """Put a field that TetFlora made into a collection; the scene's for plants if not given."""
    field.tetflora.version, field[FIELD_MARK] = VERSION, True
    (home or plant_collection(scene)).objects.link(field)
    if home is None:
        note_field(scene, field)
    prepare_scene(scene)
    return field


def note_field(scene: Scene, field: Object) -> None:
    """Let a field be a layer of its scene, below the others; it becomes the active one."""
    layers = scene.tetflora.layers
    if all(layer.field != field for layer in layers):
        layer = layers.add()
        layer.kind, layer.uid, layer.name = 'FIELD', uuid.uuid4().hex, field.name
        layer.field, layer.biome = field, field.tetflora.stand.biome
        scene.tetflora.layers_index = len(layers) - 1


def prepare_scene(scene: Scene) -> None:
    """Settings that a scene with plants needs.

    Refinement changes the scene while it renders; a window that is not locked would draw that data and could crash.
    """
    scene.render.use_lock_interface = True
    scene.tetflora.version = VERSION


def show_age(plant: Object) -> None:
    """Let the arrow of a plant be as tall as its age makes it."""
    group = plant.tetflora
    if group.is_plant and plant.type == 'EMPTY' and plant.library is None:
        ratio = relative_heights(group.species, np.array([group.age]))[0]
        plant.empty_display_size = display_height(group.species) * ratio


def assign_species(objects: Iterable[Object], identifier: str) -> int:
    """Make plants belong to a species; how many were changed. Their seeds stay."""
    changed, height = [o for o in plants_of(objects) if o.tetflora.species != identifier], display_height(identifier)
    for obj in changed:
        obj.tetflora.species = identifier
        if obj.tetflora.age > 0.0:
            show_age(obj)
        elif obj.type == 'EMPTY':
            obj.empty_display_size = height
    return len(changed)


def reseed(objects: Iterable[Object], roll: int = 0) -> int:
    """Give plants other seeds; how many there were. The same roll of the same plants gives the same seeds."""
    plants = sorted(plants_of(objects), key=lambda o: o.name_full)
    # Copies made by duplicating have equal seeds and shall part, so the place among the plants takes part.
    old = np.array([o.tetflora.seed for o in plants], dtype=np.int64) + (np.arange(len(plants)) << 32)
    for obj, seed in zip(plants, new_seeds(old, roll).tolist(), strict=True):
        obj.tetflora.seed = seed
    return len(plants)


def remove_plants(objects: Iterable[Object]) -> int:
    """Delete plants from the file, and the collection for plants if that leaves it empty; how many there were."""
    plants = [o for o in plants_of(objects) if o.library is None]
    bpy.data.batch_remove(plants)
    remove_empty_collections()
    return len(plants)


def remove_empty_collections() -> None:
    """Remove collections for plants and for populations that hold nothing."""
    for mark in (POPULATION_MARK, _MARK):  # populations lie within
        for collection in [c for c in bpy.data.collections if c.get(mark) and c.library is None]:
            if not collection.objects and not collection.children:
                bpy.data.collections.remove(collection)


FIELD_MARK = "tetflora_field"  # on the objects of fields that TetFlora made and may remove

Points = dict[str, tuple[str, NDArray]]


def editable(obj: Object) -> bool:
    """Whether points of a field can be taken and added: it is of TetFlora's making, and still as simple."""
    if not obj.get(FIELD_MARK) or obj.type != 'MESH' or obj.mode != 'OBJECT' or fields.has_history(obj):
        return False
    mesh = obj.data
    if obj.library or mesh.library or obj.override_library or mesh.shape_keys:
        return False
    if any(map(len, (obj.modifiers, obj.vertex_groups, mesh.edges, mesh.polygons))):
        return False
    known = all(a.data_type in KINDS for a in mesh.attributes if not a.is_internal)
    return known and all(a.data_type == fields.FIELD_ATTRIBUTES.get(a.name, a.data_type) for a in mesh.attributes)


def positions(obj: Object) -> Floats:
    """Where the points of an editable field are in world space, (n, 3), without reading what grows there."""
    world = np.array(obj.matrix_world, dtype=np.float64)
    return read(obj.data, "position") @ world[:3, :3].T + world[:3, 3]


def take_points(obj: Object, keep: Mask) -> None:
    """Keep some of a field's points, (n,) bool, with all their attributes."""
    points = {name: (kind, values[keep]) for name, (kind, values) in _points(obj.data).items()}
    write_points(own_mesh(obj), points)


def add_points(obj: Object, placement: Placement, species: Sequence[str]) -> None:
    """Add upright plants to a field, at the end; other attributes of theirs are zero.

    Parameters
    ----------
    obj : bpy.types.Object
        `editable`.
    placement : Placement
        In world space; its species are an index into ``species``.
    species : sequence of str
        Identifiers; those that the field's list lacks are added to it.
    """
    kinds_there = list(fields.field_kinds(obj)) if obj.tetflora.field_species else []
    for identifier in species:
        if identifier not in kinds_there:
            obj.tetflora.field_species.add().species = identifier
            kinds_there.append(identifier)
    numbers = np.array([kinds_there.index(identifier) for identifier in species], np.int32)
    world = np.array(obj.matrix_world, dtype=np.float64)
    size = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    turn = np.array(obj.matrix_world.to_3x3().normalized(), dtype=np.float64)
    c, s, none = np.cos(placement.azimuth), np.sin(placement.azimuth), np.zeros(len(placement))
    frame = np.stack([c, -s, none, s, c, none, none, none, none + 1.0], axis=1).reshape(-1, 3, 3)
    added = {"rotation": quaternions(turn.T @ frame), "scale": placement.scale / size, "seed": placement.seed}
    added["position"] = (placement.position - world[:3, 3]) @ np.linalg.inv(world[:3, :3]).T
    added["species"] = numbers[placement.species]
    points, before = _points(obj.data), len(obj.data.vertices)
    for name, kind in {"position": 'FLOAT_VECTOR', **fields.FIELD_ATTRIBUTES}.items():
        if name not in points:  # of a mesh that never had any point, not even that
            points[name] = (kind, np.full((before, *added[name].shape[1:]), name == "scale", KINDS[kind].dtype))
    for name, (kind, values) in points.items():
        new = added.get(name, np.zeros((len(placement), *values.shape[1:])))
        points[name] = (kind, np.concatenate([values, new.astype(values.dtype)]))
    write_points(own_mesh(obj), points)


def assign_field_species(obj: Object, identifier: str) -> bool:
    """Make all plants of a field belong to a species; whether that changed anything. Forms and seeds stay."""
    group = obj.tetflora
    if obj.library is not None:
        return False
    entries = list(group.field_species) or [group]
    changed = [entry for entry in entries if entry.species != identifier]
    for entry in changed:
        entry.species = identifier
    if changed and editable(obj) and obj.data.attributes.get("species"):
        _join_equal_kinds(obj)
    return bool(changed)


def reseed_field(obj: Object, place: int, roll: int) -> None:
    """Make other individuals of all plants of a field, by the number that joins all of their seeds."""
    group = obj.tetflora
    group.seed = int(new_seeds(np.array([group.seed + (place << 32)], np.int64), roll)[0]) or 1


def own_mesh(obj: Object) -> Mesh:
    """The mesh of a field, to be changed: a copy of its own where a linked duplicate shares it."""
    if obj.data.users > 1:
        obj.data = obj.data.copy()
    return obj.data


def _join_equal_kinds(obj: Object) -> None:
    """Let a field's list name each kind once."""
    entries = obj.tetflora.field_species
    kinds = [kind_of_choice(entry) for entry in entries]
    unique = list(dict.fromkeys(kinds))
    if len(unique) == len(kinds):
        return
    to = np.array([unique.index(kind) for kind in kinds], np.int32)
    values = values_of(own_mesh(obj).attributes["species"])
    # Numbers that the list does not have stay wrong: reading the field tells of them.
    known = (values >= 0) & (values < len(to))
    values[known] = to[values[known]]
    values[~known] += np.int32(len(kinds))
    write(obj.data, "species", values)
    for index in range(len(kinds) - 1, -1, -1):
        if kinds.index(kinds[index]) != index:
            entries.remove(index)
    obj.data.update()


def _points(mesh: Mesh) -> Points:
    attributes = (one for one in mesh.attributes if one.domain == 'POINT' and not one.is_internal)
    return {one.name: (one.data_type, values_of(one)) for one in attributes}


def write_points(mesh: Mesh, points: Points) -> None:
    """Give a mesh points alone, by the types and values (n) of their attributes."""
    mesh.clear_geometry()
    mesh.vertices.add(len(points["position"][1]))
    for name, (kind, values) in points.items():
        write(mesh, name, values, data_type=kind)
    mesh.update()
