# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the brush that paints plants: ``Scene.tetflora.brush``."""

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from .species_choice import SpeciesChoice

#: Painted plants become empties as long as the scene has no more plants than this that are objects.
MOST_PAINTED_EMPTIES = 2_000
MODES = (
    ('PAINT', "Paint", "Set plants where fewer stand than the density says", 'BRUSH_DATA', 0),
    ('ERASE', "Erase", "Remove plants under the brush, of every species", 'TRASH', 1),
    (
        'THIN',
        "Thin",
        "Remove plants where more stand than the density says, or closer than the distance",
        'PARTICLES',
        2,
    ),
)


class TetFloraBrush(bpy.types.PropertyGroup, SpeciesChoice):
    """How the brush paints."""

    mode: EnumProperty(
        name="Mode", description="What dragging the mouse does; Shift erases while held", items=MODES, options=set()
    )
    radius: FloatProperty(
        name="Radius",
        description="Radius of the brush on the map. While painting: F, or [ and ], or Ctrl and the wheel",
        subtype='DISTANCE',
        unit='LENGTH',
        default=5.0,
        min=0.05,
        soft_max=50.0,
        max=10_000.0,
        options=set(),
    )
    density: FloatProperty(
        name="Density",
        description=(
            "Plants for each 100 m² of the map. Paint adds until there are as many, Thin removes until there are no "
            "more; going over a place again then changes nothing"
        ),
        default=4.0,
        min=0.001,
        soft_max=100.0,
        max=100_000.0,
        options=set(),
    )
    strength: FloatProperty(
        name="Strength",
        description="Share of what is missing, or too much, that one dab sets or removes; a pen's pressure lowers it",
        subtype='FACTOR',
        default=1.0,
        min=0.01,
        max=1.0,
        options=set(),
    )
    min_distance: FloatProperty(
        name="Least Distance",
        description=(
            "Least distance between two trunks, measured on the map; plants that are there already count, those of "
            "fields too. Fewer plants than the density says fit where it is large"
        ),
        subtype='DISTANCE',
        unit='LENGTH',
        default=1.0,
        min=0.0,
        soft_max=50.0,
        options=set(),
    )
    source: EnumProperty(
        name="Species",
        description="What is painted",
        items=(
            ('MIX', "As in Populate", "The mixture of species of the Populate panel, by its shares", 0),
            ('ONE', "One Species", "The species below", 1),
        ),
        options=set(),
    )
    scale_min: FloatProperty(
        name="Scale From",
        description="Size of the smallest plants; 1 is the size that the species file gives",
        default=0.8,
        min=0.01,
        soft_max=4.0,
        options=set(),
    )
    scale_max: FloatProperty(
        name="To",
        description="Size of the largest plants; 1 is the size that the species file gives",
        default=1.2,
        min=0.01,
        soft_max=4.0,
        options=set(),
    )
    store: EnumProperty(
        name="Make",
        description="What painted plants are made as. Erase and Thin reach both kinds",
        items=(
            (
                'AUTOMATIC',
                "Automatic",
                f"Empties until the scene has {MOST_PAINTED_EMPTIES:,}, then the field of painted plants",
                0,
            ),
            ('EMPTIES', "Empties", "An object for each plant: each can be moved by itself, many make Blender slow", 1),
            ('FIELD', "Field", 'One object, "Painted plants", whose vertices are the plants: room for millions', 2),
        ),
        options=set(),
    )
    seed: IntProperty(name="Seed", description="Another seed paints other plants at other places", options=set())
    strokes: IntProperty(
        name="Strokes", description="Strokes painted so far; each has a chance of its own", min=0, options={'HIDDEN'}
    )


CLASSES = (TetFloraBrush,)
