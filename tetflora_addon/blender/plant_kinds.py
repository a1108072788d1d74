# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What kind of plant an object is: its species, and its form where that is modelled by hand.

Plants of one species and form are compiled once. A kind is told by a text, as the engine's seeds want it.
"""

from __future__ import annotations

import bpy

# Neither identifiers of species nor names that anyone types hold a line break.
_BREAK = "\n"


def kind_of(plant: bpy.types.Object) -> str:
    """Kind of a plant."""
    return kind_of_choice(plant.tetflora)


def kind_of_choice(group: bpy.types.PropertyGroup) -> str:
    """Kind that a group of properties with a species and a form says."""
    return group.species if group.form is None else f"{group.species}{_BREAK}{group.form.name_full}"


def species_of(kind: str) -> str:
    """Identifier of the species of a kind of plant."""
    return kind.partition(_BREAK)[0]


def form_of(kind: str) -> bpy.types.Object | None:
    """Object that has the form of a kind of plant, or None where it is grown."""
    name = kind.partition(_BREAK)[2]
    return next((o for o in bpy.data.objects if o.name_full == name), None) if name else None
