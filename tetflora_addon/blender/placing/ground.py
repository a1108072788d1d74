# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground under brush, cursor and plants: rays against visible meshes.

`Scene.ray_cast` would stop at the leaves of a refined forest, and cannot leave objects out.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from bpy.types import Depsgraph, Object, ViewLayer
from mathutils import Vector

from ...arrays import Floats
from ...errors import SceneError
from ...jobs import Job, Progress, mapped
from ..attributes import read, write
from ..materials.nodes import is_ours
from ..runtime import JobData, job
from ..species.asset_species import asset_of
from .plant_objects import own_mesh, positions

_FEW = 8  # objects of which all are asked; of more only those whose boxes the ray meets
_ABOVE = 1e-3  # meters above a plant's foot from which it falls, so that rounding does not let it through the ground
_BATCH = 200  # places between two looks at the keyboard

Hit = tuple[Vector, Vector]


class Ground:
    """Visible meshes to stand on.

    Holds references to objects: good until the next undo, or until objects are removed.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Decides about modifiers and places; what is visible in its view layer is looked at.
    """

    def __init__(self, depsgraph: Depsgraph) -> None:
        self.depsgraph = depsgraph
        meshes = [o for o in depsgraph.view_layer.objects if o.type == 'MESH' and is_ground(o)]
        self.objects = [o for o in meshes if len(o.evaluated_get(depsgraph).data.polygons)]
        places = [np.array(o.evaluated_get(depsgraph).matrix_world, dtype=np.float64) for o in self.objects]
        boxes = [np.array(o.evaluated_get(depsgraph).bound_box, dtype=np.float64) for o in self.objects]
        corners = [b @ m[:3, :3].T + m[:3, 3] for b, m in zip(boxes, places, strict=True)]
        self._low = np.array([c.min(axis=0) for c in corners]).reshape(-1, 3)
        self._high = np.array([c.max(axis=0) for c in corners]).reshape(-1, 3)

    def __len__(self) -> int:
        return len(self.objects)

    def cast(self, origin: Vector, direction: Vector, distance: float = inf) -> Hit | None:
        """First place, and its normal toward the ray's origin, that a ray meets; world space, None without any."""
        direction = direction.normalized()
        nearest, closest = distance, None
        for obj in self._candidates(origin, direction):
            matrix = obj.evaluated_get(self.depsgraph).matrix_world
            inverse = matrix.inverted_safe()
            start, along = inverse @ origin, inverse.to_3x3() @ direction
            # Lengths in the object's space are other ones; None of the arguments may be infinite there.
            reach = min(nearest * along.length, 1e30)
            hit, place, normal, _ = obj.ray_cast(start, along.normalized(), distance=reach, depsgraph=self.depsgraph)
            if not hit:
                continue
            world = matrix @ place
            gap = (world - origin).length
            if gap <= nearest:
                turned = (inverse.to_3x3().transposed() @ normal).normalized()
                nearest, closest = gap, (world, -turned if turned.dot(direction) > 0.0 else turned)
        return closest

    def heights(self, places: Floats, above: float | Floats, below: float | Floats) -> Floats:
        """Height of the uppermost ground at places on the map.

        Parameters
        ----------
        places : (n, 2) float64
        above, below : float or (n,) float64
            World z between which ground is looked for.

        Returns
        -------
        (n,) float64
            NaN where there is none.
        """
        top, bottom = (np.broadcast_to(np.asarray(z, float), len(places)) for z in (above, below))
        down = Vector((0.0, 0.0, -1.0))
        out = np.full(len(places), np.nan)
        for i, ((x, y), z, end) in enumerate(zip(places.tolist(), top.tolist(), bottom.tolist(), strict=True)):
            hit = self.cast(Vector((x, y, z)), down, z - end)
            if hit is not None:
                out[i] = hit[0].z
        return out

    def nearest_heights(self, places: Floats) -> Generator[float, object, Floats]:
        """Find the height of the ground that is nearest along z, below or above, for places (n, 3).

        Yields the fraction that is done, and returns (n,) float64, NaN where there is no ground.
        """
        down, up = Vector((0.0, 0.0, -1.0)), Vector((0.0, 0.0, 1.0))
        out = np.full(len(places), np.nan)
        for i, (x, y, z) in enumerate(places.tolist()):
            if i % _BATCH == 0:
                yield i / len(places)
            low = self.cast(Vector((x, y, z + _ABOVE)), down)
            hit = self.cast(Vector((x, y, z)), up, abs(z - low[0].z) if low else inf) or low
            if hit is not None:
                out[i] = hit[0].z
        return out

    def _candidates(self, origin: Vector, direction: Vector) -> list[Object]:
        if len(self.objects) <= _FEW:
            return self.objects
        start, along = np.array(origin), np.array(direction)
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (self._low - start) / along, (self._high - start) / along
        # A ray along a face of a box has no entry or exit there, and passes.
        enter = np.nan_to_num(np.minimum(a, b), nan=-inf).max(axis=1)
        leave = np.nan_to_num(np.maximum(a, b), nan=inf).min(axis=1)
        return [self.objects[i] for i in np.flatnonzero((enter <= leave) & (leave >= 0.0)).tolist()]


def is_ground(obj: Object) -> bool:
    """Whether plants can stand on an object: visible, and neither a plant or its model, nor a result, nor refined."""
    group = obj.tetflora
    if group.is_plant or group.is_field or group.is_explicit or is_ours(obj):
        return False
    return obj.visible_get() and asset_of(obj) is None


_STAYS = 1e-6  # meters: a smaller gap counts as standing on the ground
_LOOKING = "Looking for the ground"


@dataclass(frozen=True)
class DropResult:
    """How many plants moved, and how many have no ground below or above."""

    moved: int
    missed: int


@job("Dropping plants")
def drop_steps(data: JobData, plants: Sequence[Object], fields: Sequence[Object]) -> Job[DropResult]:
    """Move plants vertically to the nearest ground; children move with their parents before they fall themselves.

    What is visible in the view layer is ground.

    Parameters
    ----------
    fields : sequence of bpy.types.Object
        Whose points are plants, all `plant_objects.editable`.

    Raises
    ------
    SceneError
        Nothing is visible to stand on, or something was deleted meanwhile.
    """
    data.add_objects([*plants, *fields])
    yield Progress(0.0, _LOOKING)
    view_layer = data.depsgraph.view_layer
    view_layer.update()
    ground = Ground(data.depsgraph)
    if not len(ground):
        raise SceneError("No mesh is visible below or above the plants; add a ground mesh, or show it")
    data.add_objects(ground.objects)
    groups = [np.array([o.matrix_world.translation for o in plants], dtype=np.float64).reshape(-1, 3)]
    groups += [positions(field) for field in fields]
    ends = np.cumsum([len(part) for part in groups])
    every = np.concatenate(groups)
    heights = yield from mapped(ground.nearest_heights(every), lambda fraction: Progress(fraction, _LOOKING))
    of_plants, *of_fields = np.split(heights, ends[:-1])
    moved = _drop_plants(view_layer, plants, of_plants)
    moved += sum(_drop_field(field, part) for field, part in zip(fields, of_fields, strict=True))
    return DropResult(moved, int(np.isnan(heights).sum()))


def _drop_plants(view_layer: ViewLayer, plants: Sequence[Object], heights: Floats) -> int:
    """Move plants that are objects to heights (n,); how many moved."""
    now = np.array([o.matrix_world.translation.z for o in plants], dtype=np.float64)
    fall = np.flatnonzero(np.abs(heights - now) > _STAYS)
    chosen = set(plants)
    for i in sorted(fall.tolist(), key=lambda i: _depth(plants[i])):
        plant = plants[i]
        placed = plant.matrix_world.copy()
        placed.translation.z = heights[i]
        plant.matrix_world = placed
        if any(child in chosen for child in plant.children):
            view_layer.update()
    return len(fall)


def _depth(obj: Object) -> int:
    return 0 if obj.parent is None else 1 + _depth(obj.parent)


def _drop_field(field: Object, heights: Floats) -> int:
    """Move the points of an editable field to heights (n,); how many moved."""
    stored, places = read(field.data, "position"), positions(field)
    world = np.array(field.matrix_world, dtype=np.float64)
    # Positions are stored in single precision.
    fall = np.abs(heights - places[:, 2]) > np.maximum(_STAYS, 1e-6 * np.abs(places).max(axis=1, initial=0.0))
    if fall.any():
        places[fall, 2] = heights[fall]
        inverse = np.linalg.inv(world)
        stored[fall] = places[fall] @ inverse[:3, :3].T + inverse[:3, 3]
        mesh = own_mesh(field)
        write(mesh, "position", stored)
        mesh.update()
    return int(fall.sum())
