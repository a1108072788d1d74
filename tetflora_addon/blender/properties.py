# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What TetFlora stores in a file: ``Object.tetflora`` on plants, fields and occluders, ``Scene.tetflora`` otherwise."""

from functools import partial

import bpy

from ..parameters import within
from . import settings
from .biomes import library
from .declare import FIXED, HIDDEN, boolean, choice, integer, list_of, pointer_to, real, string
from .geodata import trees
from .placing import properties
from .placing.plant_objects import show_age
from .results import collection
from .results.proxy_kinds import proxy_kind_property
from .runtime import Listeners, classes_in
from .scene import objects
from .scene.fields import stored_now
from .scene.skeletons import SKELETON_TYPES
from .settings import RefinementProperties
from .species import asset_species, editor, edits
from .species.catalog import SpeciesChoice, gallery_of
from .stands import properties as stand_properties
from .viewport import state

#: Notified with a scene when Refine Automatically is switched on or off there.
auto_refine_switched = Listeners()

_SKELETON = partial(
    pointer_to,
    bpy.types.Object,
    "Skeleton",
    "Curve, hair curves or edge mesh that defines this plant's trunk, and optionally its limbs; the species grows "
    "the rest on them. Without one, the species grows the whole plant",
    poll=lambda _group, candidate: candidate.type in SKELETON_TYPES,
)

_AUTO_REFINE = {**FIXED, "update": lambda self, _context: auto_refine_switched.notify(self.id_data)}
#: What overrides of linked objects may change; otherwise Blender forgets the change when the file is opened again.
_OVERRIDES = {'LIBRARY_OVERRIDABLE'}
_MARK = {**FIXED, "override": _OVERRIDES}


def _on_age(self: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    show_age(self.id_data)
    state.listeners.notify()


def _on_year(self: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    last = self.id_data.tetflora.stand.last_year
    if 0.0 < last < self.stand_year:  # all plants are gone after their last records
        self.stand_year = last
    if self.stand.is_grown:
        self.stand.plants = len(stored_now(self.id_data))
    self.id_data.update_tag()
    state.listeners.notify()


class TetFloraFieldEntry(bpy.types.PropertyGroup, SpeciesChoice):
    """One kind of plant of a field; the attribute ``species`` of its points is an index into these."""

    skeleton: _SKELETON()


class TetFloraObject(bpy.types.PropertyGroup, SpeciesChoice):
    """A plant is a species, a transform and a seed (paper, section 5); a field is an object whose points are plants."""

    version: integer("Version", "Layout of these properties", **HIDDEN)
    is_plant: boolean(
        "Plant", "This object is a plant: its species and seed define how it grows, its transform where", **HIDDEN
    )
    seed: integer(
        "Seed",
        "Each seed is another individual of the species; the same seed gives the same plant",
        override=_OVERRIDES,
    )
    enabled: boolean("Enabled", "Include the plant in refinement and renders", True, override=_OVERRIDES)
    skeleton: _SKELETON(override=_OVERRIDES)
    age: properties.AGE(override=_OVERRIDES, update=_on_age)
    is_field: boolean(
        "Field of Plants",
        "Each point of this mesh or point cloud is a plant, defined by the attributes species, seed, rotation, "
        "scale and age of the points. The attribute species is an index into the list of species",
        **HIDDEN,
    )
    field_species: list_of(
        TetFloraFieldEntry, "Field Species", "Species that the attribute species of the points refers to, starting at 0"
    )
    field_species_index: integer("Active Field Species", options={'HIDDEN', 'SKIP_SAVE'})
    add_species: gallery_of("field_species", TetFloraFieldEntry)
    stand_year: real(
        "Stand Year",
        "Year of the stand's growth that is shown. Animate it to let the stand grow",
        100.0,
        **within(0.0, 200.0, 10_000.0),
        step=100,
        precision=1,
        override=_OVERRIDES,
        update=_on_year,
    )
    stand_smooth: boolean(
        "Smooth Growth",
        "Let plants grow without jumps from frame to frame, for animations. Each frame then takes longer to prepare. "
        "Off, each plant has the form that is nearest to its size, which is best for stills",
        **HIDDEN,
        override=_OVERRIDES,
        update=_on_year,
    )
    stand: pointer_to(stand_properties.TetFloraStand)
    is_occluder: boolean(
        "Occluder",
        "Plants behind this mesh count as hidden and cost next to nothing. Use it for terrain and buildings, not "
        "for transparent or very thin objects",
        **_MARK,
    )
    is_explicit: boolean(
        "Refine This Mesh",
        "Refine the object's own polygons with the plants: kept where they are near, drawn as proxies where they are "
        "far or hidden. Use it for trees from other sources, rocks and scans, and for objects that instance them",
        **_MARK,
    )
    is_scatter: boolean(
        "Refine Scatter",
        "Refine what the object's modifiers or particles scatter: instances stay as they are where they are near, and "
        "become proxies where they are far or hidden. The object goes on scattering by its own rules, and its own "
        "surface stays as it is",
        **_MARK,
    )
    population: string("Population", "Identity of the population that created this", **HIDDEN)
    population_number: integer("Number in the Population", "Copies made by hand share it", **HIDDEN)


class TetFloraLeafObject(bpy.types.PropertyGroup, SpeciesChoice):
    """A mesh of the user's that replaces the leaf of a species."""

    takes_assets = False  # they have no leaves of their own

    leaf: pointer_to(
        bpy.types.Object,
        "Leaf",
        "Mesh object used as the leaf of the species: one unit long, stalk at the origin, along +Y, upper side "
        "toward +Z. Every leaf has all its polygons, so keep it simple",
        poll=lambda _group, candidate: candidate.type == 'MESH',
    )


class TetFloraScene(RefinementProperties, library.BiomeChoice, bpy.types.PropertyGroup):
    """Settings of a scene."""

    version: integer("Version", "Layout of these properties", **HIDDEN)

    proxy_kind: proxy_kind_property()
    baked_light: choice(
        "Lighting",
        "How plants are lit in renders. Baked lighting is computed during Refine. It is noise-free and fast to "
        "render, but fixed: refine again after moving a light or changing the world",
        (
            ('OFF', "Scene", "The renderer lights everything", 'LIGHT_SUN', 0),
            (
                'PROXIES',
                "Baked Proxies",
                "Proxies show baked lighting; real leaves and bark are lit by the renderer",
                'LIGHT_SUN',
                1,
            ),
            (
                'ALL',
                "Baked Proxies and Leaves",
                "All parts of plants show baked lighting. Your changes to leaf and bark materials do not show; your "
                "own refined meshes are lit by the renderer",
                'RENDER_STILL',
                2,
            ),
        ),
    )
    refine_at_render: boolean(
        "Refine at Render",
        "Refine for the camera of every rendered frame, also in background renders, and remove the result "
        "afterward. Meshes made by Refine are left out of these renders. Blender's interface is locked while "
        "rendering (Render > Lock Interface), which TetFlora enables when plants are added",
        True,
    )
    auto_refine: boolean(
        "Refine Automatically",
        "Refine shortly after the camera, plants or settings change, without blocking Blender. A further change "
        "restarts the work. While a viewport has Rendered shading, on by itself for what that shows",
        **_AUTO_REFINE,
    )
    follow_viewport: boolean(
        "Follow Viewport",
        "Refine for what the 3D viewport shows instead of the scene camera: for the viewport with Rendered shading "
        "if there is one, else the largest. A viewport that looks through the camera shows what the camera sees",
        **_AUTO_REFINE,
    )
    asset_detail: choice(
        "Asset Detail",
        "When instances of assets are refined",
        (
            (
                'AUTO',
                "Automatic",
                "Refine instances only where that costs the renderer less: Cycles shows plain instances as long as all "
                "of their objects fit into memory, EEVEE draws every triangle of each",
            ),
            ('REFINE', "Always Refine", "Refine instances whatever they cost"),
        ),
    )
    expand_everything: boolean("Expand Everything", settings.EVERYTHING, options={'HIDDEN', 'ANIMATABLE'})

    populate: pointer_to(properties.TetFloraLayer)
    layers: list_of(
        properties.TetFloraLayer, "Layers", "What grows on the scene's grounds, each with the rules to grow it again"
    )
    layers_index: integer("Active Layer", options={'HIDDEN', 'SKIP_SAVE'})
    stand: pointer_to(stand_properties.TetFloraStand)
    output: pointer_to(collection.TetFloraOutput)
    brush: pointer_to(properties.TetFloraBrush)
    wind: pointer_to(settings.TetFloraWind)
    year: pointer_to(settings.TetFloraYear)
    preview: pointer_to(state.TetFloraPreview)
    leaf_objects: list_of(TetFloraLeafObject, "Leaf Objects", "Your own meshes in place of a species' leaf")
    leaf_objects_index: integer("Active Leaf Object", options={'HIDDEN', 'SKIP_SAVE'})
    add_species: gallery_of("leaf_objects", TetFloraLeafObject)
    species_edits: list_of(
        edits.TetFloraSpeciesEdit,
        "Species Edits",
        "Species edited in this file, as JSON; they replace those of the catalog",
        **HIDDEN,
    )
    asset_species: list_of(
        asset_species.TetFloraAssetSpecies, "Asset Species", "Objects and collections that are species", **HIDDEN
    )
    linked_scatters: list_of(
        objects.TetFloraLinkedScatter, "Linked Scatterers", "Linked objects whose scatter is refined", **HIDDEN
    )
    species_editor: pointer_to(editor.TetFloraSpeciesEditor, "Species Editor", **HIDDEN)
    statistics: string("Statistics", "Statistics of the last refinement, as JSON", **HIDDEN)


_MODULES = (
    *(properties, stand_properties, collection, state),
    *(editor, edits, asset_species, objects, settings, trees),
)
CLASSES = (
    *classes_in(_MODULES, bpy.types.PropertyGroup),
    *(TetFloraFieldEntry, TetFloraLeafObject, TetFloraObject, TetFloraScene),
)

_register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    """Register the property groups and add them to Blender's types."""
    # Forms may have come while it was not registered.
    TetFloraScene.__annotations__["proxy_kind"] = proxy_kind_property()
    _register()
    bpy.types.Object.tetflora = pointer_to(TetFloraObject, override=_OVERRIDES)
    bpy.types.Scene.tetflora = pointer_to(TetFloraScene)
    bpy.types.Collection.tetflora_assets = list_of(asset_species.TetFloraAssetSpecies, "Asset Species", **HIDDEN)


def unregister() -> None:
    """Remove them; what is stored in the file stays there."""
    del bpy.types.Collection.tetflora_assets
    del bpy.types.Scene.tetflora
    del bpy.types.Object.tetflora
    _unregister()
