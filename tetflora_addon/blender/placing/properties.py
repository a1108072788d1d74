# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of populations, of new ones (``Scene.tetflora.populate``), and of the brush (``Scene.tetflora.brush``)."""

from functools import partial
from math import pi

from bpy.types import Collection, Context, Image, Object, Property, PropertyGroup

from ...parameters import FACTOR, LENGTH, within
from ...planting.rules import Companion, Rules
from ...planting.site import Limits
from ...planting.strokes import Brush
from ...species.kinds import MOST_YEARS
from ..declare import FIXED, HIDDEN, boolean, choice, integer, list_of, once, pointer_to, real, string
from ..runtime import Listeners
from ..settings import BIOME, FIELD, SCATTER, properties_of, settings_in
from ..species.catalog import SpeciesChoice, gallery_of, items_for, number_of
from .distances import SOURCES, choose, follows_species
from .plant_objects import EMPTIES_UNASKED

#: Most plants that Populate creates as objects.
MOST_EMPTIES = 100_000
STORAGE_ITEMS = (
    ('AUTOMATIC', "Automatic", f"Empties up to {EMPTIES_UNASKED:,} plants, a field for more", 0),
    ('EMPTIES', "Empties", "One object per plant. Each can be moved on its own; many slow Blender down", 1),
    ('FIELD', "Field", "One object whose vertices are the plants. Room for millions", 2),
)
CREATE_AS = partial(choice, "Create As", "What the plants are created as", STORAGE_ITEMS)
#: Painted plants become empties as long as the scene has no more plants than this that are objects.
MOST_PAINTED_EMPTIES = 2_000
HABITATS = (
    ('ANYWHERE', "Anywhere", "In light and shade alike", 0),
    ('LIGHT', "In Light", "In gaps and at edges, where the sky is seen", 1),
    ('HALF_SHADE', "In Half Shade", "Between dense crowns and open ground", 2),
    ('SHADE', "In Shade", "Under dense crowns", 3),
    ('LITTER', "Where Leaves Fall", "Under the crowns that shed it", 4),
    ('DEAD_WOOD', "Where Wood Falls", "Under the crowns that shed it, and around them", 5),
    ('FALLEN', "As Leaves Fall", "In autumn under the crowns that shed it, as much as they shed", 6),
)
NOBODY = ("NONE", "None", "No companion", 'NONE', 0)

#: Called without arguments after each change of a setting; the preview of points listens.
listeners = Listeners()
_kept_items: dict[int, list] = {}  # Blender keeps no copy of the strings of dynamic items


def _on_distance(settings: PropertyGroup, _context: Context) -> None:
    settings.distance_from = 'OWN'
    listeners.notify()


def _choose_distance(settings: PropertyGroup, by_species: bool) -> None:
    choose(settings, by_species)
    listeners.notify()


#: Options of settings that the preview follows.
LIVE = {**FIXED, "update": lambda _group, _context: listeners.notify()}
_FACTOR, _STORED = {**FACTOR, **LIVE}, {**LIVE, **HIDDEN}
_COMPANION = properties_of(Companion, **LIVE)
_DISTANCE = {**FIXED, "update": _on_distance}
_BY_SPECIES = partial(
    once.boolean,
    "By Species",
    "Keep plants as far apart as the crowns of their species need, or closer where the density asks for it. Turn "
    "off to set the distance yourself",
    get=follows_species,
    set=_choose_distance,
)
#: The age of a plant.
_YEARS = {**within(0.0, 200.0, MOST_YEARS), "step": 100, "precision": 1}
_GROWN = "0 is full-grown, as the species describes it"
AGE = partial(real, "Age", f"Age in years; {_GROWN}. Species that are assets have none", **_YEARS)
_SOURCE = partial(choice, "Distance From", "", SOURCES, default='SPECIES', **HIDDEN)


def _companion_items(entry: "TetFloraMixEntry", _context: Context | None) -> list:
    items = items_for(entry.companion)
    return _kept_items.setdefault(id(items), [NOBODY, *items])


def _choose_companion(entry: "TetFloraMixEntry", number: int) -> None:
    chosen = [item[0] for item in _companion_items(entry, None) if item[4] == number]
    entry.companion = chosen[0] if chosen and number else ""


class TetFloraMixEntry(PropertyGroup, SpeciesChoice):
    """One species of a mixture to populate with, and its companion."""

    weight: real("Weight", "Relative frequency of this species among the plants", 1.0, **within(0.0, 10.0), **LIVE)
    companion: string("Companion", "Species that this one seeks or avoids; empty for none", **_STORED)
    companion_choice: once.choice(
        "Companion",
        "Species that this one seeks or avoids, in this population or planted earlier",
        _companion_items,
        get=lambda self: number_of(self.companion) if self.companion else 0,
        set=_choose_companion,
    )
    companion_strength: _COMPANION.strength
    companion_distance: _COMPANION.distance
    habitat: choice("Grows", "Where under the other plants this species is found", HABITATS, default='ANYWHERE', **LIVE)
    shed_by: string("Shed By", "Species that sheds what lies there; any if empty", **_STORED)


class TetFloraGround(PropertyGroup):
    """One mesh that a population grows on."""

    object: pointer_to(
        Object,
        "Ground",
        "Mesh that the plants grow on, including its modifiers",
        poll=lambda _group, candidate: candidate.type == 'MESH' and not candidate.tetflora.is_field,
        **_STORED,
    )


#: What can limit where something grows: settings that decide, by what menus call it, with an icon.
LIMITS = {
    'GROUP': ("Vertex Group", 'GROUP_VERTEX', ("vertex_group", "invert_group")),
    'IMAGE': ("Image", 'IMAGE_DATA', ("image", "invert_image", "uv_layer")),
    'SLOPE': ("Slope", 'IPO_LINEAR', ("slope_min", "slope_max")),
    'ALTITUDE': ("Altitude", 'SORT_DESC', ("use_altitude",)),
    'WETNESS': ("Wetness", 'MATFLUID', ("wetness_min", "wetness_max")),
    'FACING': ("Facing", 'ORIENTATION_NORMAL', ("aspect_spread", "aspect")),
    'EDGE': ("Edge", 'MOD_EDGESPLIT', ("edge_falloff",)),
    'AREAS': ("Areas", 'MESH_CIRCLE', ("areas",)),
    'PATHS': ("Paths", 'CURVE_PATH', ("paths",)),
}
_OPEN = {"slope_max": pi / 2}  # values that leave everything open, where defaults do not


def _limit_items(owner: PropertyGroup, _context: Context | None) -> list:
    known = owner.bl_rna.properties
    others = ('FACING', 'EDGE', 'AREAS') if getattr(owner, "kind", "") == 'BIOME' else ()
    limits = [
        (key, name, f"Limit where this grows by {name.lower()}", icon, 1 << number)
        for number, (key, (name, icon, names)) in enumerate(LIMITS.items())
        if names[0] in known and key not in others
    ]
    return _kept_items.setdefault(len(limits), limits)


def limits_in_use(owner: PropertyGroup) -> int:
    """Bits of `LIMITS` that are switched on, or of which something is set."""
    known, bits = owner.bl_rna.properties, owner.limits_shown
    for number, (_, _, names) in enumerate(LIMITS.values()):
        if any(name in known and _differs(getattr(owner, name), _open_value(known[name])) for name in names):
            bits |= 1 << number
    return bits


def _open_value(prop: Property) -> object:
    """Value of a setting that limits nothing."""
    return _OPEN.get(prop.identifier, getattr(prop, "default", None))


def _differs(value: object, other: object) -> bool:
    return abs(value - other) > 1e-6 if isinstance(other, float) else value != other


def _set_limits(owner: PropertyGroup, bits: int) -> None:
    known, before = owner.bl_rna.properties, limits_in_use(owner)
    owner.limits_shown = bits
    for number, (_, _, names) in enumerate(LIMITS.values()):
        bit = 1 << number
        for name in names if (before ^ bits) & bit else ():
            if name == "use_altitude":
                owner.use_altitude = bool(bits & bit)
            elif name in known and not bits & bit:
                setattr(owner, name, _open_value(known[name]))
    listeners.notify()


_SWITCHES = {"options": {'ENUM_FLAG', 'SKIP_SAVE'}, "get": limits_in_use, "set": _set_limits}


class GroundMask:
    """Mix-in: where on its grounds something grows, by a vertex group and an image, and whether altitudes count."""

    use_altitude: boolean("Altitude", "Grow only between two heights above the scene's origin", **_STORED)

    vertex_group: string("Vertex Group", "Weights that say where plants grow: 0 is bare, 1 is full", **LIVE)
    invert_group: boolean("Invert Vertex Group", "Weight 1 is bare, 0 is full", **LIVE)
    image: pointer_to(
        Image, "Image", "Image whose brightness says where plants grow: black is bare, white is full", **LIVE
    )
    invert_image: boolean("Invert Image", "White is bare, black is full", **LIVE)
    uv_layer: string("UV Map", "UV map of the ground for the image; the active one if empty", **LIVE)


class AroundPaths:
    """Mix-in: which limits of where something grows panels show; inside which areas, and how far from which paths."""

    limits: choice("Limits", "What limits where this grows; switched off, it no longer does", _limit_items, **_SWITCHES)
    limits_shown: integer("Limits That Are Shown", **HIDDEN)
    areas: pointer_to(
        Collection, "Areas", "Collection of closed curves; plants grow only inside them, as seen from above", **LIVE
    )
    paths: pointer_to(
        Collection, "Paths", "Collection of curves along which the ground stays bare, as seen from above", **LIVE
    )
    path_distance: real(
        "Path Distance",
        "Minimum distance from trunks to the path's centerline: half the width of the road, plus room for branches",
        2.0,
        **within(0.0, 50.0),
        **LENGTH,
        **LIVE,
    )


def _holders(layer: "TetFloraLayer") -> list[Collection | Object]:
    """What the plants of a layer are in: its collection or object, or those of the layers of a biome."""
    holders = [one for one in (layer.collection, layer.field) if one is not None]
    if layer.kind == BIOME:
        parts = (part for part in layer.id_data.tetflora.layers if part.biome == layer.uid and part.kind != BIOME)
        holders += [one for part in parts for one in _holders(part)]
    return holders


def _is_shown(layer: "TetFloraLayer") -> bool:
    holders = _holders(layer)
    return not holders or not all(one.hide_render and one.hide_viewport for one in holders)


def _show(layer: "TetFloraLayer", on: bool) -> None:
    for one in _holders(layer):
        one.hide_render = one.hide_viewport = not on


class TetFloraLayer(PropertyGroup, settings_in(Limits, Rules, **LIVE), GroundMask, AroundPaths):
    """Something that grows on a ground, and how it is placed there."""

    # Identity and state. Plants refer to ``uid``, never to the name or the place in the list.
    name: string("Name", "Name of the layer, and of the collection of its plants")
    uid: string("Identity", **HIDDEN)
    kind: choice("Kind", "", [(k, k.title(), "") for k in (SCATTER, BIOME, FIELD)], **HIDDEN)
    frozen: boolean("Freeze", "Keep the plants of this layer: updates and removal leave them alone", **FIXED)
    shown: once.boolean("Show", "Show the layer in viewports, results and renders", get=_is_shown, set=_show)
    field: pointer_to(Object, "Field", **HIDDEN)
    source: string("Source", **HIDDEN)  # identifier of the file that a biome was made from
    data: string("Data", **HIDDEN)  # of that file: what is not in layers, as JSON
    collection: pointer_to(Collection, "Collection", **HIDDEN)
    made: integer("Plants Made", **HIDDEN)
    message: string("Message", **HIDDEN)
    placed_by: string("Placed By", **HIDDEN)  # `rules.fingerprint` of when it was placed
    stood_on: string("Stood On", **HIDDEN)  # `rules.forms_of` its grounds when it was placed
    erased: string("Erased Places", **HIDDEN)  # as `rules.note_erased` writes it
    covers: string("Covers", **HIDDEN)  # ``uid`` of the population whose ground it covers

    grounds: list_of(TetFloraGround, "Grounds", "Meshes that the plants grow on")
    ground_collection: pointer_to(
        Collection, "Ground Collection", "All meshes in this collection are ground, even those added later", **LIVE
    )
    density: real(
        "Plants per Hectare",
        "Plants per hectare (10,000 m², a square of 100 m) of fully suitable ground; fewer where it is partly "
        "suitable. Old forest: 200 to 500 trees; young forest: 2,000; shrubs: 3,000; ferns: 20,000 (2 per m²)",
        200.0,
        **within(0.0, 100_000.0),
        precision=1,
        **LIVE,
    )
    as_field: CREATE_AS(**LIVE)

    mix: list_of(TetFloraMixEntry, "Species", "Species to choose from; if empty, the first one of the catalog")
    mix_index: integer("Active Species", options={'HIDDEN', 'SKIP_SAVE'})
    add_species: gallery_of("mix", TetFloraMixEntry)

    min_distance: properties_of(Rules, **_DISTANCE).min_distance

    distance_from: _SOURCE()
    distance_by_species: _BY_SPECIES()

    age: real("Age", f"Age of the plants in years, half of them younger and half older; {_GROWN}", **_YEARS, **LIVE)
    age_spread: real(
        "Age Spread",
        "How much the ages of plants differ: about two in three are within this fraction of Age, and as many "
        "younger as older. 0 for plants of one age",
        **_FACTOR,
    )

    biome: string("Biome", **HIDDEN)  # ``uid`` of the biome of which it is a layer
    folded: boolean("Fold", "Hide the layers of this biome in the list", **HIDDEN)
    gives_way: boolean(
        "Give Way",
        "Leave the ground that other biomes take by their mask and limits to these: to those above this one in the "
        "list or, if this one has no limits, to all. Where their edge is soft, the biomes blend",
        True,
        **LIVE,
    )


MODES = (
    ('PAINT', "Paint", "Add plants where there are fewer than the density", 'BRUSH_DATA', 0),
    ('ERASE', "Erase", "Remove plants of every species under the brush", 'TRASH', 1),
    ('THIN', "Thin", "Remove plants above the density, or closer than the minimum distance", 'PARTICLES', 2),
)
_BRUSH = properties_of(Brush, **FIXED)
_PAINTED = (
    ('MIX', "Active Layer", "The species of the active layer, by weight", 0),
    ('ONE', "One Species", "The species below", 1),
)
_PAINTED_AS = (
    ('AUTOMATIC', "Automatic", f"Empties up to {MOST_PAINTED_EMPTIES:,}, then a field of painted plants", 0),
    STORAGE_ITEMS[1],
    ('FIELD', "Field", 'One object, "Painted plants", whose vertices are the plants. Room for millions', 2),
)


class TetFloraBrush(PropertyGroup, settings_in(Rules, only=("scale_min", "scale_max"), **FIXED), SpeciesChoice):
    """How the brush paints."""

    mode: choice("Mode", "What dragging does; hold Shift to erase", MODES, **FIXED)
    radius: _BRUSH.radius
    density: real(
        "Density",
        "Plants per 100 m² of the map. Paint adds plants up to this density, Thin removes those above it; painting "
        "over a place again changes nothing",
        4.0,
        **within(0.001, 100.0, 100_000.0),
        **FIXED,
    )
    strength: _BRUSH.strength
    min_distance: properties_of(Brush, **_DISTANCE).min_distance
    distance_from: _SOURCE()
    distance_by_species: _BY_SPECIES()
    source: choice("Species", "What to paint", _PAINTED, **FIXED)
    store: choice(
        "Create As", "What painted plants are created as. Erase and Thin affect both kinds", _PAINTED_AS, **FIXED
    )
    seed: integer("Seed", **HIDDEN)
    strokes: integer("Strokes", "Strokes painted so far; each draws its own random numbers", min=0, **HIDDEN)
