# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where on a map the origin of a scene is: found by the first import, and shared by all later ones."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ...errors import SceneError
from ...places.projection import MOST_AWAY, MapOrigin, System, between, place_about, system_of

#: Custom property of the scene.
KEY = "tetflora_place"
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
        code, *numbers = (float(stored[name]) for name in ("code", "longitude", "latitude", "east", "north"))
        if not np.isfinite(numbers).all() or np.abs(numbers).max() > 1e9:
            raise ValueError
        system = System(int(code), *numbers[:2])
        if code > 0:
            system_of(int(code))
    except (KeyError, TypeError, ValueError, IndexError, SceneError):
        raise SceneError(
            f'The custom property "{KEY}" of the scene "{scene.name}" is no place; remove it in the Scene properties'
        ) from None
    return MapOrigin(system, *numbers[2:])


def origin_for(scene: bpy.types.Scene, system: System, points: NDArray[np.float64], new: bool, what: str) -> MapOrigin:
    """The scene's place, or one in the middle of some points (n, 2), if the scene has none or another is asked for.

    Raises
    ------
    SceneError
        It has one that cannot be read, or the points lie nowhere; ``what`` begins the message.
    """
    place = None if new else origin_of(scene)
    if place is None:
        return place_about(system, points.min(axis=0), points.max(axis=0), what)
    # Plain metres are taken for those of the scene, if it has a map of metres; whether they are near is asked later.
    return place


def cropped(
    scene: bpy.types.Scene,
    grounds: list[bpy.types.Object],
    points: NDArray[np.float64],
    system: System,
    crop: tuple[str, float],
    what: str,
) -> NDArray[np.bool_]:
    """Which points (n, 2) of a file lie within what it is cropped to.

    Parameters
    ----------
    grounds : list of objects
        What is there already; all of the scene if empty.
    crop : tuple
        `WHOLE`, `MIDDLE` or `EXISTING`, and the side of the box around the middle in metres.

    Raises
    ------
    SceneError
        They lie over too large an area, or nothing lies there; ``what`` begins the message.
    """
    how, side = crop
    place = origin_of(scene) if how == EXISTING else None
    middle = np.median(points, axis=0)
    own = place or place_about(system, middle, middle, what)
    known = system if system.code or own.system.code == -1 else own.system
    local = between(points, known, own.system) - [own.east, own.north]
    low, high = np.full(2, -side / 2.0), np.full(2, side / 2.0)
    if how == EXISTING:
        corners = [obj.matrix_world @ Vector(c) for obj in grounds or scene.objects for c in obj.bound_box]
        if place is None or not corners:
            raise SceneError(f"{what}nothing was imported yet; choose a box around its middle as Crop")
        low, high = np.min(corners, axis=0)[:2] - 1.0, np.max(corners, axis=0)[:2] + 1.0
    elif how == WHOLE:
        width, depth = np.ptp(local, axis=0) / 1000.0
        if not max(width, depth) < 2.0 * MOST_AWAY / 1000.0:
            raise SceneError(f"{what}it lies over an area of {width:,.0f} by {depth:,.0f} km; choose a Crop")
        return np.ones(len(points), bool)
    inside = ((local >= low) & (local <= high)).all(axis=1)
    if not inside.any():
        raise SceneError(f"{what}nothing of it lies within the Crop; choose another one")
    return inside


def in_scene(place: MapOrigin, points: NDArray[np.float64], system: System, what: str) -> NDArray[np.float64]:
    """Metres from the scene's origin, (n, 2), of points of a file.

    Raises
    ------
    SceneError
        As `MapOrigin.local`; ``what`` begins the message.
    """
    if system.code == 0 and place.system.code > 0:
        system = place.system
    return place.local(points, system, what)


def remember(scene: bpy.types.Scene, place: MapOrigin) -> None:
    """Store the place of a scene."""
    scene[KEY] = {
        "code": place.system.code,
        "longitude": place.system.longitude,
        "latitude": place.system.latitude,
        "east": place.east,
        "north": place.north,
    }
