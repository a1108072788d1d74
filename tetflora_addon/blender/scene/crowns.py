# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mean crowns of the species of a scene: at once for what is made of them, in the background for panels.

A species is compiled for its crown once in a session, in up to a tenth of a second. A panel must not wait for that.
"""

from collections.abc import Callable, Iterable
from contextlib import suppress

import bpy

from ...compiled.sizes import Crown, crown_of, known_crown, prepare
from ...errors import SpeciesError
from ...jobs import Job, Progress
from ...species.kinds import species_of
from ...species.species import Species
from ..runtime import call_soon, redraw
from ..species.asset_species import find_asset
from ..species.edits import display_height, species_for
from ..worker import call_in_thread
from .ages import kind_species

#: Of a species that cannot be compiled: radius and base over height; leaf area over radius³, and polygons.
_RADIUS, _BASE, _AREA, _POLYGONS = 0.2, 0.3, 0.5, 50_000.0
_SOON = 0.05  # seconds between two looks at crowns that are being found

_wanted: list[Species] = []
_finding: list[Job] = []  # at most one
_without: set[Species] = set()  # an object for a leaf
_prepared: set[Species] = set()


def crown_for(scene: bpy.types.Scene, kind: str) -> Crown:
    """The mean crown of a species at the age of a kind; a guess where it cannot be compiled."""
    species = _species_or_crown(scene, kind)
    try:
        return crown_of(species) if isinstance(species, Species) else species
    except SpeciesError:  # with an object for a leaf
        return _guess(species_of(kind))


def crown_to_draw(scene: bpy.types.Scene, kind: str, prepared: bool = False) -> Crown | None:
    """The same for a panel, without waiting: None where it is only being looked for; the window is then drawn again.

    prepared: how finely its leaves may be drawn has to be known as well.
    """
    species = _species_or_crown(scene, kind)
    if _in_background() or isinstance(species, Crown):
        return crown_for(scene, kind)
    if species in _without:
        return _guess(species_of(kind))
    known = None if prepared and species not in _prepared else known_crown(species)
    if known is None:
        if species not in _wanted:
            _wanted.append(species)
        call_soon(_find, _SOON)
    return known


def crown_steps(progress: Progress, scene: bpy.types.Scene, kinds: Iterable[str]) -> Job[None]:
    """Find the crowns of kinds in the background, so that nobody has to wait for them later."""
    species = []
    for kind in sorted(kinds):
        with suppress(SpeciesError):
            species.append(_grown(scene, kind))
    yield from call_in_thread(progress, _find_all, species, crown_of)


def _grown(scene: bpy.types.Scene, kind: str) -> Species:
    return kind_species(species_for(scene, species_of(kind)), kind)


def _in_background() -> bool:
    return bpy.app.background


def _find() -> float | None:
    """Of a timer: look for what panels have asked for."""
    if not _finding:
        if not _wanted:
            return None
        _finding.append(call_in_thread(Progress(0.0, "Compiling species"), _find_all, tuple(_wanted), prepare))
        _wanted.clear()
    try:
        next(_finding[0])
    except StopIteration:
        _finding.clear()
        redraw('UI')
        return _SOON if _wanted else None
    return _SOON


def _find_all(species: Iterable[Species], find: Callable[[Species], object]) -> None:
    for one in species:
        try:
            find(one)
            if find is prepare:
                _prepared.add(one)
        except SpeciesError:
            _without.add(one)


def _species_or_crown(scene: bpy.types.Scene, kind: str) -> Species | Crown:
    """A species at the age of a kind; the crown itself of what is an asset, missing or broken."""
    asset = find_asset(scene, species_of(kind))
    if asset is not None:
        return Crown(asset.radius, asset.height, asset.polygons, asset.base, asset.leaves, 0.0, tuple(asset.color))
    try:
        return _grown(scene, kind)
    except SpeciesError:
        return _guess(species_of(kind))


def _guess(identifier: str) -> Crown:
    height = display_height(identifier)
    radius = _RADIUS * height
    return Crown(radius, height, _POLYGONS, _BASE * height, _AREA * radius**3)
