# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes as JSON files: a name, a ground, limits, and layers of plants from the tallest to what lies on the ground.

A layer is a population, with the keys of population files, or a stand that grows. Everything unknown is refused, with
the name of the file and of the key. What grows on a ground is saved as one, with a picture, into the user's folder.
"""

import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy.types import Object, PropertyGroup, Scene

from ...errors import SceneError, SpeciesError, quoted
from ...files import IDENTIFIER_RULE, is_identifier, parse_json, read_whole
from ...formats import FORMATS, newest
from ...planting.site import Limits
from ...species.catalog import species_from_dict
from ..file_library import MAX_FILE_BYTES, as_text
from ..placing import population_data as stored
from ..placing.properties import TetFloraLayer
from ..placing.rules import MASK, active_population, biome_of, grounds_of, limits_of_zone
from ..settings import BIOME, SCATTER, active_in
from ..species.edits import find_edit, new_identifier, species_data
from ..stands.growing import is_stand
from ..stands.properties import TetFloraStand, TetFloraStandEntry
from . import library
from .library import GROUND, data_of

FORMAT = "TetFlora biome"
#: What a layer is: plants that keep their distance from others and shade the ground; what grows and lies under them,
#: and does neither; a stand that grows.
KINDS = ("population", "cover", "stand")
#: When a biome is as its picture shows it.
SEASON = {"day": (1.0, 365.0), "latitude": (-66.0, 66.0)}
_KEYS = {"format", "version", "name", "layers"}
_MORE = {"description", "species", "limits", "mask", "gives_way", "ground", "season"}
#: Settings of a species of a stand.
STAND_ENTRY = ("species", "planted", "incoming_seeds")


@dataclass(frozen=True)
class Biome:
    """A biome as its file has it, checked."""

    identifier: str
    name: str
    layers: list[dict[str, Any]]  # each with ``kind`` and the keys of that
    description: str = ""
    #: Species of its own by identifier: whole pages, or what differs from one ``of`` the catalog, and what differs in
    #: ``every_order`` of that
    species: dict[str, dict[str, Any]] = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)
    mask: dict[str, Any] = field(default_factory=dict)  # an image by its name
    gives_way: bool = True
    ground: dict[str, Any] = field(default_factory=dict)
    season: dict[str, float] = field(default_factory=dict)


def stand_settings() -> list[str]:
    """Names of settings of stands that mean something in any file."""
    numbers = [p.identifier for p in TetFloraStand.bl_rna.properties if p.type in {'INT', 'FLOAT', 'BOOLEAN'}]
    of_a_file = {"is_grown", "last_year", "plants", "species_index", "path_distance", "limits_shown"}
    return [name for name in numbers if name not in of_a_file]


def read_biome(path: Path) -> Biome:
    """Read and check a file.

    Raises
    ------
    SceneError
        It cannot be read, or breaks a rule of the format; names file and key.
    """
    return _read(path)[0]


def _read(path: Path) -> tuple[Biome, bytes]:
    """A biome that was checked, and the content of its file."""
    try:
        content = read_whole(path, MAX_FILE_BYTES)
        return _checked(parse_json(content, stored.refuse_constant), path.stem), content
    except OSError as error:
        raise SceneError(f"{path.name}: cannot read the file: {error.strerror}") from None
    except (ValueError, SpeciesError) as error:
        raise SceneError(f"{path.name}: {error}") from None


def _checked(data: Any, identifier: str) -> Biome:
    """A decoded file; errors name the key of what is not as it must be."""
    if isinstance(data, dict) and {"format", "version"} <= data.keys():  # keys are checked next
        if data["format"] != FORMAT:
            raise ValueError(f'"format" is {quoted(data["format"])}; files of biomes have "{FORMAT}"')
        try:
            data = newest("biome", data, data["version"])
        except ValueError as error:
            raise ValueError(f'"version" {error}') from None
    stored.check_keys("the file", data, _KEYS, _KEYS | _MORE)
    for key in ("name", "description"):
        stored.check_text(f'"{key}"', data.get(key, ""))
    if not data["name"].strip():
        raise ValueError('"name" is empty')
    for key, known in (("limits", {one.name for one in fields(Limits)}), ("mask", set(MASK))):
        stored.check_keys(f'"{key}"', data.get(key, {}), set(), known)
        stored.check_settings(f'"{key}"', data.get(key, {}), TetFloraLayer, known)
    stored.check_value('"gives_way"', TetFloraLayer.bl_rna.properties["gives_way"], data.get("gives_way", True))
    ground = data.get("ground", {})
    stored.check_keys('"ground"', ground, set(), set(GROUND))
    for key, value in ground.items():
        default, *limits = GROUND[key]
        parts = [value] if isinstance(default, float) else value
        if not isinstance(parts, list) or len(parts) != np.size(default):
            raise ValueError(f'"ground": "{key}" is {quoted(value)}; it must be three numbers')
        for part in parts:
            _check_number(f'"ground": "{key}"', part, *limits)
    season = data.get("season", {})
    stored.check_keys('"season"', season, set(), set(SEASON))
    for key, value in season.items():
        _check_number(f'"season": "{key}"', value, *SEASON[key])
    _check_species(data.get("species", {}))
    layers = stored.list_of("layers", data["layers"])
    if not layers:
        raise ValueError('"layers" is empty')
    for number, layer in enumerate(layers, 1):
        _check_layer(f"layer {number}", layer)
    return Biome(identifier, **{key: data[key] for key in ("name", "layers", *sorted(_MORE)) if key in data})


def biome_data(
    scene: Scene, populations: Iterable[PropertyGroup], biome: PropertyGroup | None, name: str, description: str
) -> dict[str, Any]:
    """Populations as the layers of a file, with the limits of their biome and species that only this file has."""
    data: dict[str, Any] = {"format": FORMAT, "version": FORMATS["biome"], "name": name, "description": description}
    begun = data_of(biome) if biome is not None else {}
    data |= {key: value for key, value in begun.items() if key in ("ground", "season") and value}
    layers = [{"kind": "cover" if one.covers else "population", **stored.population_data(one)} for one in populations]
    stands = [] if biome is None else [_stand_data(field) for field in stands_of(scene, biome.uid)]
    parts = [part for layer in (*stands, *layers) for part in layer["species"]]
    names = {part.get("shed_by", "") for part in parts} - {""}  # what they shed is made from them
    names |= {part["species"] for part in parts if not part["species"].startswith(part.get("shed_by", "?") + "_")}
    edited = [name for name in sorted(names) if find_edit(scene, name) is not None]
    more: dict[str, Any] = {"species": {name: dict(species_data(scene, name)) for name in edited}}
    if biome is not None:
        limits = limits_of_zone(biome)
        changed = {
            one.name: stored.value_for(TetFloraLayer.bl_rna.properties[one.name], getattr(limits, one.name))
            for one in fields(Limits)
            if getattr(limits, one.name) not in (one.default, np.float32(one.metadata.get("default", one.default)))
        }
        more |= {"limits": changed, "mask": stored.settings_data(biome, MASK), "gives_way": biome.gives_way}
    data |= {key: value for key, value in more.items() if value not in ({}, True)}  # what no file need say
    return data | {"layers": [*stands, *layers]}


def _stand_data(stand: Object) -> dict[str, Any]:
    """What differs from a new stand."""
    group = stand.tetflora.stand
    layer = {"kind": "stand", "name": stand.name, **stored.settings_data(group, stand_settings())}
    return layer | {"species": [stored.settings_data(entry, STAND_ENTRY, STAND_ENTRY) for entry in group.species]}


def active_biome(scene: Scene) -> PropertyGroup | None:
    """The biome that is the active layer, or that this belongs to; None where there is none."""
    active = active_in(scene.tetflora, "layers")
    return active if active is None or active.kind == BIOME else biome_of(scene, active)


def layers_of(scene: Scene, uid: str) -> list[PropertyGroup]:
    """Populations of a biome, in their order."""
    return [layer for layer in scene.tetflora.layers if layer.biome == uid and layer.kind == SCATTER]


def stands_of(scene: Scene, uid: str) -> list[Object]:
    """Fields of a biome that are stands."""
    return [obj for obj in scene.objects if is_stand(obj) and obj.tetflora.stand.biome == uid]


def _check_number(where: str, value: Any, low: float, high: float) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ValueError(f"{where} is {quoted(value)}; it must be a number from {low:g} to {high:g}")


def _check_species(species: Any) -> None:
    stored.check_keys('"species"', species, set(), set(species) if isinstance(species, Mapping) else set())
    for identifier, page in species.items():
        where = f'species "{identifier}"'
        if not is_identifier(identifier):
            raise ValueError(f"{quoted(identifier)} cannot name a species; use only {IDENTIFIER_RULE}")
        if not isinstance(page, dict):
            raise ValueError(f"{where} is {type(page).__name__}; it must be an object with keys")
        if "of" not in page:
            species_from_dict(page, identifier, where)
        elif not isinstance(page["of"], str) or not is_identifier(page["of"]):
            raise ValueError(f'{where}: "of" is {quoted(page["of"])}; use only {IDENTIFIER_RULE}')
        elif not isinstance(page.get("every_order", {}), dict):
            raise ValueError(f'{where}: "every_order" is {quoted(page["every_order"])}; it must be an object with keys')


def _check_layer(where: str, layer: Any) -> None:
    if not isinstance(layer, dict):
        raise ValueError(f"{where} is {type(layer).__name__}; it must be an object with keys")
    kind = layer.get("kind")
    if kind not in KINDS:
        raise ValueError(f'{where}: "kind" is {quoted(kind)}; it must be one of {", ".join(KINDS)}')
    if kind == "stand":
        stored.check_keys(where, layer, {"kind", "name", "species"}, {"kind", "name", "species", *stand_settings()})
        stored.check_text(f'{where}: "name"', layer["name"])
        stored.check_settings(where, layer, TetFloraStand, stand_settings())
        stored.check_species(where, layer["species"], TetFloraStandEntry, STAND_ENTRY)
    else:
        stored.check_population(where, layer)
        if not layer.get("species"):
            raise ValueError(f'{where} has no "species"')


def pages_of(scene: Scene, biome: Biome) -> dict[str, dict[str, Any]]:
    """Pages of the species of a biome's own, complete.

    Raises
    ------
    SceneError, SpeciesError
        One is made from a species that the catalog does not have, or is broken.
    """
    pages: dict[str, dict[str, Any]] = {}
    for identifier, given in biome.species.items():
        page = dict(given)
        if "of" in page:
            of = page.pop("of")
            each = page.pop("every_order", {})
            page = {**(pages[of] if of in pages else species_data(scene, of)), **page}
            if each and isinstance(orders := page.get("orders"), list):
                # Where an order has the key already: what bears no leaves has no color of leaves.
                page["orders"] = [
                    {k: each.get(k, v) for k, v in one.items()} if isinstance(one, dict) else one for one in orders
                ]
            species_from_dict(page, identifier, f'{biome.name}: species "{identifier}"')
        pages[identifier] = page
    return pages


#: Pixels of a picture, and its quality as a JPEG.
_SIDES, _QUALITY = (320, 200), 82


def saved_populations(scene: Scene) -> list[PropertyGroup]:
    """What would be saved: layers of the active biome, or without one populations on the ground of the active."""
    biome = active_biome(scene)
    if biome is not None:
        return layers_of(scene, biome.uid)
    active = active_population(scene)
    if active is None:
        return []
    grounds = set(grounds_of(scene, active))
    return [p for p in scene.tetflora.layers if p.uid == active.uid or grounds & set(grounds_of(scene, p))]


def save_biome(scene: Scene, name: str, description: str, picture: bool, replace: bool) -> Path:
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
        _checked(data, identifier)  # what is saved can be read
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
    library.OWN_FILES.store(path.stem, _read(path)[1], replace, library.picture_file(path))
    return path.stem


def _last_render(scene: Scene, folder: Path) -> Path:
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
        picture = folder / "picture.jpg"
        image.save(filepath=str(picture), quality=_QUALITY)
    finally:
        bpy.data.images.remove(image)
    return picture
