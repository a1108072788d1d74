# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where on a map the origin of a scene is: found by the first import, and shared by all later ones."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError
from ...places.projection import MapOrigin, System, place_about, system_of

#: Custom property of the scene.
KEY = "tetflora_place"


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
