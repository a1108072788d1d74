# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the brush that paints plants: ``Scene.tetflora.brush``."""

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ..planting.rules import Rules
from ..planting.strokes import Brush
from .generated import properties_of
from .species_choice import SpeciesChoice

#: Painted plants become empties as long as the scene has no more plants than this that are objects.
MOST_PAINTED_EMPTIES = 2_000
MODES = (
    ('PAINT', "Paint", "Add plants where there are fewer than the density", 'BRUSH_DATA', 0),
    ('ERASE', "Erase", "Remove plants of every species under the brush", 'TRASH', 1),
    (
        'THIN',
        "Thin",
        "Remove plants above the density, or closer than the minimum distance",
        'PARTICLES',
        2,
    ),
)
_BRUSH = properties_of(Brush, options=set())
_SIZES = properties_of(Rules, options=set())


class TetFloraBrush(bpy.types.PropertyGroup, SpeciesChoice):
    """How the brush paints."""

    mode: EnumProperty(name="Mode", description="What dragging does; hold Shift to erase", items=MODES, options=set())
    radius: _BRUSH.radius
    density: FloatProperty(
        name="Density",
        description=(
            "Plants per 100 m² of the map. Paint adds plants up to this density, Thin removes those above it; painting "
            "over a place again changes nothing"
        ),
        default=4.0,
        min=0.001,
        soft_max=100.0,
        max=100_000.0,
        options=set(),
    )
    strength: _BRUSH.strength
    min_distance: _BRUSH.min_distance
    source: EnumProperty(
        name="Species",
        description="What to paint",
        items=(
            ('MIX', "As in Populate", "The species of the Populate panel, by weight", 0),
            ('ONE', "One Species", "The species below", 1),
        ),
        options=set(),
    )
    scale_min: _SIZES.scale_min
    scale_max: _SIZES.scale_max
    store: EnumProperty(
        name="Create As",
        description="What painted plants are created as. Erase and Thin affect both kinds",
        items=(
            (
                'AUTOMATIC',
                "Automatic",
                f"Empties until the scene has {MOST_PAINTED_EMPTIES:,}, then the field of painted plants",
                0,
            ),
            ('EMPTIES', "Empties", "One object per plant. Each can be moved on its own; many slow Blender down", 1),
            ('FIELD', "Field", 'One object, "Painted plants", whose vertices are the plants. Room for millions', 2),
        ),
        options=set(),
    )
    seed: IntProperty(
        name="Seed", description="A different seed paints different plants in different places", options=set()
    )
    strokes: IntProperty(
        name="Strokes",
        description="Strokes painted so far; each draws its own random numbers",
        min=0,
        options={'HIDDEN'},
    )


CLASSES = (TetFloraBrush,)
