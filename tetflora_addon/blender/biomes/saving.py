# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Save what grows on a ground as a biome, with a picture, into the user's folder; take files of others into it."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy

from ...errors import SceneError
from ...files import read_whole
from ..file_library import MAX_FILE_BYTES, as_text
from ..placing.rules import active_population, grounds_of
from ..species.edits import new_identifier
from . import library
from .files import active_biome, biome_data, checked, layers_of, read_biome

#: Pixels of a picture, and its quality as a JPEG.
_SIDES, _QUALITY = (320, 200), 82


def saved_populations(scene: bpy.types.Scene) -> list[bpy.types.PropertyGroup]:
    """What would be saved: the layers of the active biome or, without one, the populations on the ground of the active
    population.
    """
    biome = active_biome(scene)
    if biome is not None:
        return layers_of(scene, biome.uid)
    active = active_population(scene)
    if active is None:
        return []
    own = set(grounds_of(scene, active))
    return [p for p in scene.tetflora.populations if p.uid == active.uid or own & set(grounds_of(scene, p))]


def save_biome(scene: bpy.types.Scene, name: str, description: str, picture: bool, replace: bool) -> Path:
    """Save what grows on a ground as a file of the user's folder.

    Parameters
    ----------
    picture : bool
        Whether the last render becomes the biome's picture.
    replace : bool
        Whether an own file of the same name gives way.

    Raises
    ------
    SceneError
        There is nothing to save, no render, or no place for the file.
    """
    populations = saved_populations(scene)
    if not populations:
        raise SceneError("No population grows here; add a biome or populate the ground first")
    if not name.strip():
        raise SceneError("A biome needs a name")
    identifier = new_identifier(name, lambda one: False)
    data = biome_data(scene, populations, active_biome(scene), name.strip(), description.strip())
    try:
        checked(data, identifier)  # what is saved can be read
    except ValueError as error:
        raise SceneError(f'"{name}" cannot be saved: {error}') from None
    with tempfile.TemporaryDirectory() as folder:
        image = _last_render(scene, Path(folder)) if picture else None
        return library.OWN_FILES.store(identifier, as_text(data), replace, image)


def import_biome(path: Path, replace: bool) -> str:
    """Take a file into the user's folder, with the picture beside it; returns the identifier.

    Raises
    ------
    SceneError
        The file breaks a rule of the format, or another one of its name is there.
    """
    read_biome(path)
    try:
        content = read_whole(path, MAX_FILE_BYTES)
    except OSError as error:
        raise SceneError(f"{path.name}: cannot read the file: {error.strerror}") from None
    library.OWN_FILES.store(path.stem, content, replace, library.picture_file(path))
    return path.stem


def _last_render(scene: bpy.types.Scene, folder: Path) -> Path:
    """The last render as a small JPEG."""
    result = next((image for image in bpy.data.images if image.type == 'RENDER_RESULT'), None)
    path = folder / "render.png"
    try:
        if result is None:
            raise RuntimeError
        result.save_render(str(path), scene=scene)
        image = bpy.data.images.load(str(path))
    except RuntimeError:
        raise SceneError("There is no render to take as picture; press F12 first, or turn off Last Render") from None
    try:
        image.scale(*_SIDES)
        image.file_format = 'JPEG'
        made = folder / "picture.jpg"
        image.save(filepath=str(made), quality=_QUALITY)
    finally:
        bpy.data.images.remove(image)
    return made
