# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What all imports share: their settings, the job that they are, and where on a map the scene's origin is.

The first import of a scene finds that place, and all later ones lie where they are in relation to it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from ...arrays import Floats, Mask
from ...errors import SceneError
from ...geodata.projection import MapOrigin, System, between, place_about, system_of
from ...jobs import Job
from ..runtime import JobData, guarded

#: Custom property of the scene.
KEY = "tetflora_place"
_STORED = ("epsg", "longitude", "latitude", "east", "north")
#: On objects that are imported ground.
TERRAIN = "tetflora_terrain"
#: What an import may be cropped to: nothing, a box around its middle, or what the scene has there already.
WHOLE, MIDDLE, EXISTING = 'WHOLE', 'MIDDLE', 'EXISTING'


def origin_of(scene: bpy.types.Scene) -> MapOrigin | None:
    """The place of a scene; None before its first import.

    Raises
    ------
    SceneError
        What is stored cannot be a place.
    """
    stored = scene.get(KEY)
    if stored is None:
        return None
    try:
        epsg, *numbers = (float(stored[name]) for name in _STORED)
        if not np.isfinite(numbers).all() or np.abs(numbers).max() > 1e9:
            raise ValueError
        system = System(int(epsg), *numbers[:2])
        if epsg > 0:
            system_of(int(epsg))
    except (KeyError, TypeError, ValueError, IndexError, SceneError):
        raise SceneError(
            f'The custom property "{KEY}" of the scene "{scene.name}" is no place; remove it in the Scene properties'
        ) from None
    return MapOrigin(system, *numbers[2:])


@dataclass(frozen=True)
class Box:
    """What a file is cropped to: corners in meters from a place, and the system that counts for the file."""

    place: MapOrigin
    low: Floats
    high: Floats
    system: System

    def holds(self, points: Floats) -> Mask:
        """Which points (n, 2) of the file lie within it."""
        local = self.place.offsets(points, self.system, "")
        return ((local >= self.low) & (local <= self.high)).all(axis=1)

    @property
    def corners(self) -> Floats:
        """Its four corners in the file's coordinates, (4, 2)."""
        (west, south), (east, north) = self.low, self.high
        local = np.array([[west, south], [east, south], [east, north], [west, north]])
        return between(local + [self.place.east, self.place.north], self.place.system, self.system)


@dataclass(frozen=True)
class Import:
    """What is imported, and where it goes."""

    scene: bpy.types.Scene
    depsgraph: bpy.types.Depsgraph
    path: Path
    epsg: int = 0  # EPSG code of the coordinates, `PLAIN`, or 0 where the file tells
    new: bool = False  # let its middle be the scene's origin, whatever was imported before
    selected: tuple[bpy.types.Object, ...] = ()  # meshes to lie or stand on; imported ground if empty
    crop: str = WHOLE  # `WHOLE`, `MIDDLE` or `EXISTING`
    side: float = 0.0  # of the box around the middle, meters
    #: scale, offset: Of rasters: meters of a value, and what is added
    scale: float = 1.0
    offset: float = 0.0
    tiles: tuple[Path, ...] = ()  # of rasters: other files of the same grid

    @property
    def what(self) -> str:
        """Begins messages."""
        return f"{self.path.name}: "

    @property
    def grounds(self) -> list[bpy.types.Object]:
        """Meshes to put things on: those that are selected, else what was imported as ground."""
        return list(self.selected) or [obj for obj in self.scene.objects if obj.type == 'MESH' and obj.get(TERRAIN)]

    def box(self, points: Floats, system: System) -> Box | None:
        """What the file with some points (n, 2) is cropped to; None for all of it."""
        if self.crop == WHOLE:
            place_about(system, points.min(axis=0), points.max(axis=0), self.what)
            return None
        middle = np.median(points, axis=0)
        low, high = np.full(2, -self.side / 2.0), np.full(2, self.side / 2.0)
        place = origin_of(self.scene) if self.crop == EXISTING else place_about(system, middle, middle, self.what)
        if self.crop == EXISTING:
            objects = self.grounds or self.scene.objects
            corners = [obj.matrix_world @ Vector(corner) for obj in objects for corner in obj.bound_box]
            if place is None or not corners:
                raise SceneError(f"{self.what}nothing was imported yet; choose a box around its middle as Crop")
            low, high = np.min(corners, axis=0)[:2] - 1.0, np.max(corners, axis=0)[:2] + 1.0
        known = self.known(place, system)
        place.offsets(points, known, self.what)  # or nobody can tell where they lie
        return Box(place, low, high, known)

    def nothing_left(self) -> SceneError:
        """The error of a crop that leaves nothing."""
        return SceneError(f"{self.what}nothing of it lies within the Crop; choose another one")

    def origin(self, points: Floats, system: System) -> MapOrigin:
        """The scene's place, or one in the middle of points (n, 2), if it has none or another is asked for.

        Plain meters are taken for those of the scene, if it has a map of meters; whether they are near is asked later.
        """
        place = None if self.new else origin_of(self.scene)
        return place or place_about(system, points.min(axis=0), points.max(axis=0), self.what)

    def local(self, place: MapOrigin, points: Floats, system: System) -> Floats:
        """Meters from the scene's origin, (n, 2), of points of the file. Errors are those of `MapOrigin.local`."""
        return place.local(points, self.known(place, system), self.what)

    @staticmethod
    def known(place: MapOrigin, system: System) -> System:
        """The system of the file, of which plain coordinates are taken for those of the scene's map."""
        return replace(place.system, unit=system.unit) if system.epsg == 0 and place.system.epsg > 0 else system

    def remember(self, place: MapOrigin) -> None:
        """Store the place of the scene."""
        self.scene[KEY] = {name: getattr(place, name, getattr(place.system, name, 0)) for name in _STORED}


@dataclass
class Imported:
    """What an import made: the object if it is one, parts of the report, and whether that is a warning."""

    object: bpy.types.Object | None
    told: list[str]
    warning: bool = False


#: Of an import.
Steps = Job[Imported]


def importing(steps: Callable[..., Steps]) -> Callable[..., Steps]:
    """Make a guarded job of the steps of an `Import`: what they work on may be deleted between two of them.

    They yield progress; closing them leaves all as it was.

    Raises
    ------
    SceneError
        The file cannot be read, is broken, or cannot lie in this scene.
    """

    def read(order: Import, *others: Any, **named: Any) -> Steps:
        try:
            return (yield from steps(order, *others, **named))
        except OSError as error:
            name = Path(error.filename).name if isinstance(error.filename, str) else order.path.name
            raise SceneError(f"{name}: cannot read the file: {error.strerror or error}") from None

    @wraps(steps)
    def job(order: Import, *others: Any, **named: Any) -> Steps:
        data = JobData("Importing", order.scene, order.depsgraph)
        data.add_objects(list(order.selected))
        return guarded(data, read(order, *others, **named))

    return job
