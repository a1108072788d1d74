# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The brush in a scene: which plants stand where, and strokes that add and remove them.

`planting.strokes` decides, in arrays; here the scene is read before a stroke and changed during it.
"""

from collections.abc import Sequence

import bpy
import numpy as np

from ...arrays import Floats, Keys, Mask
from ...errors import SceneError
from ...planting import strokes
from ...planting.places import Placement
from ...planting.strokes import Brush
from ..assets.marks import measure_all
from ..attributes import world_matrix
from ..runtime import JobData
from ..scene.fields import fields_of, read_field
from ..settings import check_limits
from ..species.edits import catalog, unknown_text
from ..worker import run_to_end
from . import canopy, distances, plant_objects, populations, properties, rules
from .ground import Ground

PAINTED = "Painted plants"
_OBJECTS = -1  # where single plants are, in place of the number of a field
_REACH = 2.0  # radii above and below the brush within which ground counts
_LEAST_REACH = 10.0  # meters
_STRONG = 0.5  # strength from which on Erase clears the ground, and not only the plants that it meets
_SAME = 0.1  # radii within which a dab that removes nothing adds nothing to the one before
_PLACE = 0.05  # meters around a plant that was removed, where no other stands


def _brush_of(scene: bpy.types.Scene, pressure: float = 1.0) -> tuple[Brush, tuple[str, ...]]:
    """The scene's brush as the engine takes it, and the species that its weights refer to; checked."""
    settings = scene.tetflora.brush
    check_limits(settings, "Brush")
    mix = distances.painted_weights(scene)
    if not sum(mix.values()) > 0.0:
        raise SceneError("No species has a weight above 0; raise a weight in the list of species under Layers")
    density, strength = settings.density / distances.SQUARE, max(0.01, settings.strength * pressure)
    sizes = {"scale_min": settings.scale_min, "scale_max": settings.scale_max}
    apart = distances.distance_of(settings)
    brush = Brush(settings.radius, density, strength, min_distance=apart, weights=tuple(mix.values()), **sizes)
    if strokes.too_many(brush):
        raise SceneError(
            f"A brush with a radius of {settings.radius:g} m and {settings.density:g} plants per 100 m² is too large; "
            "lower Radius or Density, or use Scatter"
        )
    return brush, tuple(mix)


class Standing:
    """Plants of a scene that stand by themselves or in fields, as arrays."""

    def __init__(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, covers: bool) -> None:
        """Read a scene, with or without what covers the ground."""
        objects = scene.objects if covers else canopy.not_of_covers(scene)
        self.objects = plant_objects.plants_of(objects)
        self.fields = fields_of(objects)
        places = [np.array([o.matrix_world.translation for o in self.objects], np.float64).reshape(-1, 3)]
        source, number = [np.full(len(self.objects), _OBJECTS)], [np.arange(len(self.objects))]
        free = [o.library is None and o.override_library is None and o.visible_get() for o in self.objects]
        removable = [np.array(free, bool)]
        for index, field in enumerate(self.fields):
            editable = plant_objects.editable(field)
            if editable:
                points = plant_objects.positions(field)
            else:
                points = read_field(field, depsgraph, world_matrix(field, depsgraph)[None]).position
            places.append(points)
            source.append(np.full(len(points), index))
            number.append(np.arange(len(points)))
            removable.append(np.full(len(points), editable and field.visible_get()))
        self.places = np.concatenate(places)  # (n, 3): world space
        #: number: (n,): Index into ``objects``, or point of the field
        #: source: (n,): Index into ``fields``, or -1 for ``objects``
        self.source, self.number = np.concatenate(source).astype(np.int32), np.concatenate(number).astype(np.int64)
        self.removable = np.concatenate(removable)  # (n,)

    def add(self, places: Floats, source: int, first: int) -> None:
        """Note new plants: at the end of the list of objects or of a field, from number ``first`` on."""
        self.places = np.concatenate([self.places, places])
        self.source = np.concatenate([self.source, np.full(len(places), source, np.int32)])
        self.number = np.concatenate([self.number, first + np.arange(len(places))])
        self.removable = np.concatenate([self.removable, np.ones(len(places), bool)])

    def by_population(self, gone: Mask) -> dict[str, Floats]:
        """Places of plants, (n,) bool, by the identity of their population; without those of none."""
        by_uid: dict[str, list[Floats]] = {}
        for source in np.unique(self.source[gone]).tolist():
            plants = np.flatnonzero(gone & (self.source == source))
            if source != _OBJECTS:
                by_uid.setdefault(self.fields[source].tetflora.population, []).append(self.places[plants])
                continue
            uids = np.array([self.objects[i].tetflora.population for i in self.number[plants].tolist()])
            for uid in np.unique(uids).tolist():
                by_uid.setdefault(uid, []).append(self.places[plants[uids == uid]])
        return {uid: np.concatenate(places) for uid, places in by_uid.items() if uid}

    def remove(self, gone: Mask) -> None:
        """Take plants, (n,) bool, out of the scene and out of the arrays."""
        single = gone & (self.source == _OBJECTS)
        if single.any():
            dead = set(self.number[single].tolist())
            bpy.data.batch_remove([self.objects[i] for i in dead])
            self.objects = [o for i, o in enumerate(self.objects) if i not in dead]
        for source in np.unique(self.source[gone]).tolist():
            of_source = self.source == source
            keep = np.ones(int(of_source.sum()), bool)
            keep[self.number[gone & of_source]] = False
            if source != _OBJECTS:
                plant_objects.take_points(self.fields[source], keep)
            self.number[of_source] = (np.cumsum(keep) - 1)[self.number[of_source]]
        self.places, self.source = self.places[~gone], self.source[~gone]
        self.number, self.removable = self.number[~gone], self.removable[~gone]


class Stroke:
    """One stroke: made when the button goes down, dabbed while the mouse moves, flushed to show what was done.

    Parameters
    ----------
    scene, depsgraph
        As they are now. References to objects are kept until the stroke ends.
    mode : {'PAINT', 'ERASE', 'THIN'}
    """

    def __init__(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, mode: str) -> None:
        settings = scene.tetflora.brush
        self.scene, self.mode = scene, mode
        self.changed = False  # whether a flush has changed the scene
        self._data = JobData("Paint Plants", scene, depsgraph)
        _, painted = _brush_of(scene)  # reports wrong settings before anything changes
        if mode == 'PAINT' and (unknown := set(painted) - set(catalog())):
            raise SceneError(unknown_text(min(unknown)))
        measure_all(scene, depsgraph, painted)
        # Moss neither counts for the density of trees nor keeps them away.
        self.standing = Standing(scene, depsgraph, covers=mode == 'ERASE')
        self.ground = Ground(depsgraph)
        self._data.add_objects(self.ground.objects)
        self.key = strokes.stroke_key(settings.seed, settings.strokes)
        settings.strokes += 1
        self.dabs = self.added = self.removed = 0
        self._new: list[tuple[Floats, Keys]] = []
        self._gone = np.zeros(len(self.standing.places), bool)
        self._cleared: list[tuple[float, float]] = []  # middles of dabs that clear the ground
        self._weak = False  # whether there were others
        self._taken: dict[str, list[Floats]] = {}  # places of plants by their population

    def dab(self, center: Sequence[float], pressure: float = 1.0) -> int:
        """Do what the brush does at a place on the ground (3 floats); how many plants that adds or removes."""
        with self._data.watched():
            brush, _ = _brush_of(self.scene, pressure)
            dab, self.dabs = self.dabs, self.dabs + 1
            if self.mode == 'PAINT':
                return self._paint(brush, center, dab)
            # Those that cannot be removed count for Thin: they are denser all the same.
            decide = strokes.erase if self.mode == 'ERASE' else strokes.thin
            alive = np.flatnonzero(~self._gone)
            chosen = alive[decide(brush, center, self.standing.places[alive], self.key, dab)]
            chosen = chosen[self.standing.removable[chosen]]
            self._gone[chosen] = True
            self.removed += len(chosen)
            if self.mode == 'THIN' or brush.strength < _STRONG:
                self._weak = True
            else:
                last = np.subtract(self._cleared[-1], center[:2]) if self._cleared else np.inf
                if len(chosen) or np.linalg.norm(last) > _SAME * brush.radius:
                    self._cleared.append((center[0], center[1]))
            return len(chosen)

    def _paint(self, brush: Brush, center: Sequence[float], dab: int) -> int:
        # Of a million plants only those nearby are copied.
        near = self.standing.places[strokes.within(self.standing.places, center, strokes.reach_of(brush))]
        standing = np.concatenate([near, *(places for places, _ in self._new)])
        places, keys = strokes.paint(brush, center, standing, self.key, dab)
        reach = max(_REACH * brush.radius, _LEAST_REACH)
        height = self.ground.heights(places, center[2] + reach, center[2] - reach)
        on_ground = np.isfinite(height)
        self._new.append((np.column_stack([places, height])[on_ground], keys[on_ground]))
        self.added += int(on_ground.sum())
        return int(on_ground.sum())

    @property
    def pending(self) -> int:
        """Plants that were added or removed since the last flush."""
        return sum(len(keys) for _, keys in self._new) + int(self._gone.sum())

    def flush(self) -> None:
        """Change the scene by what the dabs since the last flush decided."""
        with self._data.watched():
            changes = self.pending > 0
            if self._gone.any():
                for uid, places in self.standing.by_population(self._gone).items():
                    self._taken.setdefault(uid, []).append(places)
                self.standing.remove(self._gone)
            if any(len(keys) for _, keys in self._new):
                self._make(*(np.concatenate(part) for part in zip(*self._new, strict=True)))
            self._new, self._gone = [], np.zeros(len(self.standing.places), bool)
            self.changed = self.changed or changes

    def finish(self) -> None:
        """Flush, and store in populations which plants the stroke removed."""
        with self._data.watched():
            self.flush()
            for population in self.scene.tetflora.layers:
                taken = self._taken.get(population.uid)
                if taken is None:
                    continue
                population.made = populations.own_number(populations.own_objects(self.scene, population))
                if self._weak:
                    rules.note_erased(population, np.concatenate(taken), _PLACE)
                if self._cleared:
                    rules.note_erased(population, self._cleared, self.scene.tetflora.brush.radius)
            self._taken, self._cleared, self._weak = {}, [], False

    def _make(self, places: Floats, keys: Keys) -> None:
        brush, species = _brush_of(self.scene)
        placement = Placement(position=places, wanted=len(keys), **strokes.individuals(brush, keys))
        standing = self.standing
        store, number = self.scene.tetflora.brush.store, len(standing.objects) + len(keys)
        if not (store == 'FIELD' or (store == 'AUTOMATIC' and number > properties.MOST_PAINTED_EMPTIES)):
            first = len(standing.objects)
            standing.objects += run_to_end(plant_objects.add_plants_steps(self.scene, placement, species))
            standing.add(places, _OBJECTS, first)
            return
        painted = (o for o in standing.fields if o.get(plant_objects.PAINTED_MARK) and o.visible_get())
        number = next((standing.fields.index(o) for o in painted if plant_objects.editable(o)), None)
        if number is None:
            number, first = len(standing.fields), 0
            field = plant_objects.add_field(self.scene, placement, species)
            field.name = field.data.name = PAINTED
            field[plant_objects.PAINTED_MARK] = True
            standing.fields.append(field)
        else:
            field = standing.fields[number]
            first = len(field.data.vertices)
            plant_objects.add_points(field, placement, species)
        standing.add(places, number, first)


def draped_circle(ground: Ground, center: Sequence[float], normal: Sequence[float], radius: float) -> Floats:
    """The brush's circle on the map laid on the ground, (49, 3) with the first corner twice.

    Where there is no ground, it goes on in the plane through the center.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    x, y = center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)
    reach = max(_REACH * radius, _LEAST_REACH)
    z = ground.heights(np.stack([x, y], axis=1), center[2] + reach, center[2] - reach)
    plane = center[2] - ((x - center[0]) * normal[0] + (y - center[1]) * normal[1]) / max(abs(normal[2]), 0.2)
    return np.stack([x, y, np.where(np.isfinite(z), z, plane)], axis=1)
