# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species that go with plants into other files.

Blender links and appends collections without the scene that has the species. So whenever a file is written, collections
get a page of each species of their plants that is not shipped: edited, made here, litter, or of the user's own folder.
Pages of linked collections are read where they are (`edits`); those of appended ones become edits of the scene.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import suppress

import bpy

from ...errors import SpeciesError
from ...species.catalogue import builtin_folder
from ..runtime import Handlers
from .edits import PAGES, edits_of_scenes, listed, pages_of, species_data, store_species


def pack(_path: object = None, _other: object = None) -> None:
    """Before a file is written: bring the pages of its collections up to date."""
    shipped = builtin_folder()
    own = {name for name, info in listed().items() if info.path.parent != shipped}
    own |= {edit.identifier for edit in edits_of_scenes(None)}
    for collection in bpy.data.collections:
        if collection.library is not None or not (own or PAGES in collection):
            continue
        needed = set(_species_in(collection))
        # What came by another way, such as Make Local, goes on.
        pages = {page.identifier: page.text for page in pages_of(collection) if page.identifier in needed}
        for name in sorted(own & needed):
            with suppress(SpeciesError):  # broken, which is told elsewhere
                pages[name] = json.dumps(species_data(None, name), ensure_ascii=False)
        text = json.dumps(pages, ensure_ascii=False)
        if collection.get(PAGES, "{}") != text:
            collection[PAGES] = text


def _species_in(collection: bpy.types.Collection) -> Iterator[str]:
    for group in (obj.tetflora for obj in collection.objects):
        if group.is_plant or group.is_field:
            yield group.species
            yield from (entry.species for entry in group.field_species)


def _on_import(context: bpy.types.BlendImportContext, _other: object = None) -> None:
    """After Append: what its plants are becomes this file's, unless the scene has something of that name."""
    scene = bpy.context.scene
    for item in context.import_items:
        if isinstance(item.id, bpy.types.Collection) and item.id.library is None:
            for page in pages_of(item.id):
                if all(page.identifier != edit.identifier for edit in edits_of_scenes(scene)):
                    with suppress(ValueError, SpeciesError):
                        store_species(scene, page.identifier, json.loads(page.text))


_HANDLERS = Handlers(save_pre=pack, blend_import_post=_on_import)
register: Callable[[], None] = _HANDLERS.register
unregister: Callable[[], None] = _HANDLERS.unregister
