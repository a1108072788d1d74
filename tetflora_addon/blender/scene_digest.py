# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A number for all that a refinement depends on: where two are equal, refining again would make the same."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import bpy
import numpy as np

from ..plants.species import Species
from ..refinement.camera import Camera
from .camera_reader import read_camera
from .compat import drawn_disc
from .leaf_forms import brought_materials, resolved_species
from .output import REPLACED
from .scene_contents import Given, read_scene, settings_from
from .wind_properties import wind_of

#: Digests of species by number of the object, which is held so that no other gets its number.
_of_species: dict[int, tuple[Species, str]] = {}
_MOST_SPECIES = 64
_CHOICES = ("proxy_form", "baked_light", "expand_everything")


def scene_digest(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    view_layer: bpy.types.ViewLayer,
    camera: Camera | None = None,
    given: Given | None = None,
) -> str:
    """Digest of camera, plants, meshes that take part or hide plants, lamps, settings, species, materials and wind.

    In the wind it is another at each frame.

    Parameters
    ----------
    camera : Camera, optional
        Which one counts, if it is not the scene's as it stands.
    given : Given, optional
        What `read_scene` returned for the scene.

    Raises
    ------
    TetFloraError
        The scene cannot be refined as it is.
    """
    if given is None:
        given = read_scene(scene, depsgraph, view_layer)
    content = hashlib.sha256()
    explicit = ()
    if given.explicit is not None:
        meshes = given.explicit.meshes
        worn = [[getattr(material, "name_full", "") for material in slots] for slots in given.explicit.materials]
        explicit = meshes.surfaces, meshes.surface, meshes.linear, meshes.origin, worn
    species = [resolved_species(scene, identifier, depsgraph) for identifier in given.species]
    for part in (
        camera or read_camera(scene, depsgraph),
        given.seeds,
        given.occluders,
        given.lights,
        given.sources,
        explicit,
        choices(scene),
        [_digest_of_species(one) for one in species],
        [brought_materials(scene, identifier) for identifier in given.species],
    ):
        digest_of(content, part)
    return content.hexdigest()


def choices(scene: bpy.types.Scene) -> list:
    """What of it a scene's own settings say, without a look at objects; cheap enough for every change."""
    group = scene.tetflora
    materials = [(e.species, *(getattr(getattr(e, k), "name", "") for k in REPLACED)) for e in group.output.species]
    chosen = [getattr(group, name) for name in _CHOICES]
    return [settings_from(scene), chosen, materials, wind_of(scene), drawn_disc(scene.render.engine)]


def _digest_of_species(species: Species) -> str:
    """Digest of a species; species never change, so it is computed once."""
    if id(species) not in _of_species:
        content = hashlib.sha256()
        digest_of(content, species)
        if len(_of_species) >= _MOST_SPECIES:
            _of_species.clear()
        _of_species[id(species)] = species, content.hexdigest()
    return _of_species[id(species)][1]


def digest_of(content: hashlib._Hash, value: object) -> None:
    """Add a value of numbers, texts, arrays, or of sequences, mappings or dataclasses of these."""
    if isinstance(value, np.ndarray):
        content.update(f"{value.dtype}{value.shape}".encode())
        content.update(np.ascontiguousarray(value) if value.dtype != object else repr(value.tolist()).encode())
    elif is_dataclass(value):
        for field in fields(value):
            content.update(field.name.encode())
            digest_of(content, getattr(value, field.name))
    elif isinstance(value, list | tuple):
        content.update(f"{len(value)}:".encode())
        for item in value:
            digest_of(content, item)
    elif isinstance(value, Mapping):
        digest_of(content, [part for item in value.items() for part in item])
    else:
        content.update(f"{value!r};".encode())  # or 1, 11 would be 11, 1
