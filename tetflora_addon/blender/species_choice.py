# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a species is stored and chosen: as text, with an enumeration over it for panels."""

from bpy.props import EnumProperty, StringProperty

from .species_edits import tell_listeners
from .species_items import items_for, number_of


class SpeciesChoice:
    """A stored identifier, and an enumeration over it for panels.

    The identifier is a string, so that a species whose file is missing survives; the enumeration only reads and
    writes it.
    """

    species: StringProperty(
        name="Species",
        description="File name of the species in the catalog, without extension",
        override={'LIBRARY_OVERRIDABLE'},
    )
    species_choice: EnumProperty(
        name="Species",
        description="Species from the catalog",
        items=lambda self, _context: items_for(self.species),
        get=lambda self: number_of(self.species) if self.species else items_for()[0][4],
        set=lambda self, number: _choose(self, number),
        options={'SKIP_SAVE'},
    )


def _choose(group: SpeciesChoice, number: int) -> None:
    for identifier, *_, item_number in items_for(group.species):
        if item_number == number and number:
            group.species = identifier
            tell_listeners()
