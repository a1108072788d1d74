# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a population of plants stores: the rules by which it was placed, so that it can be placed anew.

The same group holds the settings for new populations (``Scene.tetflora.populate``). `populations` acts on it.
"""

from math import pi, radians

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .runtime import Listeners
from .species_choice import SpeciesChoice
from .species_items import items_for, number_of

#: Most plants that Populate places at once, and most that it makes as objects.
MOST_PLANTS = 10_000_000
MOST_EMPTIES = 100_000
#: Up to this many become empties if nobody says otherwise; beyond, Blender becomes slow.
EMPTIES_UNASKED = 10_000
STORAGE_ITEMS = (
    ('AUTOMATIC', "Automatic", f"Empties up to {EMPTIES_UNASKED:,} plants, a field for more", 0),
    ('EMPTIES', "Empties", "An object for each plant: each can be moved by itself, many make Blender slow", 1),
    ('FIELD', "Field", "One object whose vertices are the plants: room for millions", 2),
)
NOBODY = ("NONE", "None", "These plants do not care for others", 'NONE', 0)

#: Called after each change of a setting, without arguments; the preview of points listens.
listeners = Listeners()
_kept_items: dict[int, list] = {}  # Blender keeps no copy of the strings of dynamic items


def _tell(_group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    listeners.notify()


def _take_old_limit(group: "TetFloraPopulation", _context: bpy.types.Context | None) -> None:
    group.slope_max = group.slope_limit


_LIVE = {"options": set(), "update": _tell}
_LENGTH = {"subtype": 'DISTANCE', "unit": 'LENGTH', **_LIVE}
_ANGLE = {"subtype": 'ANGLE', **_LIVE}
_SHARE = {"subtype": 'FACTOR', **_LIVE}
_HIDDEN = {"options": {'HIDDEN'}}


def _companion_items(entry: "TetFloraMixEntry", _context: bpy.types.Context | None) -> list:
    items = items_for(entry.companion)
    return _kept_items.setdefault(id(items), [NOBODY, *items])


def _choose_companion(entry: "TetFloraMixEntry", number: int) -> None:
    found = [item[0] for item in _companion_items(entry, None) if item[4] == number]
    entry.companion = found[0] if found and number else ""


class TetFloraMixEntry(bpy.types.PropertyGroup, SpeciesChoice):
    """One species of a mixture to populate with, and how it stands to another."""

    weight: FloatProperty(
        name="Share",
        description="Share of this species among the plants, relative to the other shares",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        **_LIVE,
    )
    companion: StringProperty(
        name="Companion",
        description="Identifier of the species that this one seeks or avoids; empty for none",
        **_LIVE,
    )
    companion_choice: EnumProperty(
        name="Companion",
        description="Species that this one seeks or avoids, of this population or planted before it",
        items=_companion_items,
        get=lambda self: number_of(self.companion) if self.companion else 0,
        set=_choose_companion,
        options={'SKIP_SAVE'},
    )
    companion_strength: FloatProperty(
        name="Attraction",
        description=(
            "-1: never within the distance of the companion; 0: does not care; 1: nowhere else. "
            "Strong wishes leave room for fewer plants"
        ),
        min=-1.0,
        max=1.0,
        default=-1.0,
        **_SHARE,
    )
    companion_distance: FloatProperty(
        name="Reach",
        description="How far a companion's influence reaches, measured on the map",
        default=5.0,
        min=0.0,
        soft_max=100.0,
        **_LENGTH,
    )


class TetFloraGround(bpy.types.PropertyGroup):
    """One mesh that a population grows on."""

    object: PointerProperty(
        name="Ground",
        description="Mesh that the plants grow on, with its modifiers",
        type=bpy.types.Object,
        poll=lambda _group, candidate: candidate.type == 'MESH' and not candidate.tetflora.is_field,
        update=_tell,
    )


class TetFloraPopulation(bpy.types.PropertyGroup):
    """How plants are placed together."""

    # What it is, and what became of it. The plants know it by ``uid``, never by its name or place in the list.
    name: StringProperty(name="Name", description="Name of the population, and of the collection of its plants")
    uid: StringProperty(name="Identity", **_HIDDEN)
    frozen: BoolProperty(name="Frozen", **_HIDDEN)
    collection: PointerProperty(name="Collection", type=bpy.types.Collection, **_HIDDEN)
    made: IntProperty(name="Plants Made", **_HIDDEN)
    message: StringProperty(name="Message", **_HIDDEN)
    placed_by: StringProperty(name="Placed By", **_HIDDEN)  # `population_rules.fingerprint` of when it was placed
    erased: StringProperty(name="Erased Places", **_HIDDEN)  # as `erased_places` writes it
    slope_limit: FloatProperty(  # of files and scripts before version 2
        name="Slope Limit", default=radians(40.0), update=_take_old_limit, **_HIDDEN
    )

    grounds: CollectionProperty(name="Grounds", description="Meshes to grow on", type=TetFloraGround)
    ground_collection: PointerProperty(
        name="Ground Collection",
        description="All meshes of this collection are ground too, those that you add to it later included",
        type=bpy.types.Collection,
        **_LIVE,
    )
    by_density: BoolProperty(
        name="By Density",
        description="Ask for so many plants on each hectare of ground, instead of a number in all",
        **_LIVE,
    )
    count: IntProperty(
        name="Plants",
        description="Plants to place. Fewer are placed where no more fit, and the report says so",
        default=100,
        min=1,
        soft_max=10_000,
        max=MOST_PLANTS,
        **_LIVE,
    )
    density: FloatProperty(
        name="Plants per Hectare",
        description=(
            "Plants on each hectare (10,000 m², a square of 100 m) of the map that suits them wholly, and fewer where "
            "it suits in part. Old forest: 200 to 500 trees, young forest 2,000; shrubs 3,000; ferns 20,000 (2 a m²)"
        ),
        default=200.0,
        min=0.0,
        soft_max=100_000.0,
        precision=1,
        **_LIVE,
    )
    as_field: EnumProperty(
        name="Make",
        description="What the plants are made as",
        items=STORAGE_ITEMS,
        default='AUTOMATIC',
        **_LIVE,
    )
    seed: IntProperty(name="Seed", description="Another seed is another arrangement and other plants", **_LIVE)

    mix: CollectionProperty(
        name="Species",
        description="Species to choose from; without any, the first of the catalogue is taken",
        type=TetFloraMixEntry,
    )
    mix_index: IntProperty(name="Active Species", options={'HIDDEN', 'SKIP_SAVE'})

    min_distance: FloatProperty(
        name="Distance",
        description="Least distance between two trunks, measured on the map; plants that are there already count",
        default=2.0,
        min=0.0,
        soft_max=50.0,
        **_LENGTH,
    )
    clumping: FloatProperty(
        name="Clumping",
        description="0: evenly; 1: in clumps, with bare ground between. The number of plants stays while there is room",
        min=0.0,
        max=1.0,
        **_SHARE,
    )
    clump_size: FloatProperty(
        name="Clump Size",
        description="About the distance from one clump to the next",
        default=20.0,
        min=0.1,
        soft_max=500.0,
        **_LENGTH,
    )

    slope_min: FloatProperty(
        name="Slope From",
        description="Ground flatter than this stays bare",
        min=0.0,
        max=pi / 2,
        **_ANGLE,
    )
    slope_max: FloatProperty(
        name="Slope To",
        description="Ground steeper than this stays bare",
        default=radians(40.0),
        min=0.0,
        max=pi / 2,
        **_ANGLE,
    )
    use_altitude: BoolProperty(
        name="Altitude",
        description="Grow only between two heights above the scene's origin",
        **_LIVE,
    )
    altitude_min: FloatProperty(
        name="Altitude From",
        description="Ground lower than this stays bare",
        soft_min=-1000.0,
        soft_max=5000.0,
        **_LENGTH,
    )
    altitude_max: FloatProperty(
        name="Altitude To",
        description="Ground higher than this stays bare: the tree line",
        default=100.0,
        soft_min=-1000.0,
        soft_max=5000.0,
        **_LENGTH,
    )
    altitude_falloff: FloatProperty(
        name="Altitude Falloff",
        description="Plants become rarer within so many metres of both heights. 0: a sharp line",
        min=0.0,
        soft_max=500.0,
        **_LENGTH,
    )
    aspect: FloatProperty(
        name="Facing",
        description="Direction that slopes should face: 0° north (+Y), 90° east (+X). Level ground faces everywhere",
        **_ANGLE,
    )
    aspect_spread: FloatProperty(
        name="Facing Spread",
        description="How far from that direction slopes may face. 180°: anywhere",
        default=pi,
        min=0.0,
        max=pi,
        **_ANGLE,
    )
    edge_falloff: FloatProperty(
        name="Edge Falloff",
        description="Plants become rarer within so many metres of the ground's border. 0: up to the border",
        min=0.0,
        soft_max=100.0,
        **_LENGTH,
    )
    vertex_group: StringProperty(
        name="Vertex Group",
        description="Plants are as dense as the weights of this vertex group of the ground: 0 bare, 1 full",
        **_LIVE,
    )
    invert_group: BoolProperty(name="Invert Vertex Group", description="Weight 1 is bare, and 0 full", **_LIVE)
    image: PointerProperty(
        name="Image",
        description="Plants are as dense as this image is bright: black bare, white full",
        type=bpy.types.Image,
        **_LIVE,
    )
    invert_image: BoolProperty(name="Invert Image", description="White is bare, and black full", **_LIVE)
    uv_layer: StringProperty(
        name="UV Map",
        description="UV map of the ground by which the image lies on it; the active one if empty",
        **_LIVE,
    )
    areas: PointerProperty(
        name="Areas",
        description="Collection of closed curves; plants grow only within them, as seen from above",
        type=bpy.types.Collection,
        **_LIVE,
    )
    paths: PointerProperty(
        name="Paths",
        description="Collection of curves along which the ground stays bare, as seen from above",
        type=bpy.types.Collection,
        **_LIVE,
    )
    path_distance: FloatProperty(
        name="Path Distance",
        description="Trunks keep so far from the middle of the paths; half the width of a road, and room for branches",
        default=2.0,
        min=0.0,
        soft_max=50.0,
        **_LENGTH,
    )

    scale_min: FloatProperty(
        name="Scale From",
        description="Size of the smallest plants; 1 is the size that the species file gives",
        default=0.8,
        min=0.01,
        soft_max=4.0,
        **_LIVE,
    )
    scale_max: FloatProperty(
        name="To",
        description="Size of the largest plants; 1 is the size that the species file gives",
        default=1.2,
        min=0.01,
        soft_max=4.0,
        **_LIVE,
    )
    scale_at_top: FloatProperty(
        name="Scale at Top",
        description="By what plants are larger or smaller at the highest ground, relative to the lowest. 1: no change",
        default=1.0,
        min=0.01,
        soft_max=4.0,
        **_LIVE,
    )
    tilt: FloatProperty(
        name="Follow Ground",
        description="0: upright, as trees grow; 1: square to the ground, as moss and grass",
        min=0.0,
        max=1.0,
        **_SHARE,
    )


CLASSES = (TetFloraMixEntry, TetFloraGround, TetFloraPopulation)
