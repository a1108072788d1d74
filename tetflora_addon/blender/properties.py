# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What TetFlora stores in a file: ``Object.tetflora`` on plants, fields and occluders, ``Scene.tetflora`` otherwise."""

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

from . import settings
from .biomes import library
from .geodata import columns
from .placing import properties
from .placing.plant_objects import show_age
from .results import collection
from .results.proxy_kinds import proxy_kind_property
from .runtime import Listeners
from .scene import objects
from .scene.explicit import EXPLICIT_PROPERTY
from .scene.field_sizes import STAND_SMOOTH, STAND_YEAR, stored_now
from .scene.own_ages import AGE_PROPERTY
from .scene.skeletons import SKELETON_TYPES
from .settings import AnimationProperties, RefinementProperties
from .species import asset_species, editor, edits
from .species.catalog import SpeciesChoice
from .stands import properties as stand_properties
from .viewport import state

#: Notified with a scene when Refine Automatically is switched on or off there.
auto_refine_switched = Listeners()

_SKELETON = {
    "name": "Skeleton",
    "description": (
        "Curve, hair curves or edge mesh that defines this plant's trunk, and optionally its limbs; the species grows "
        "the rest on them. Without one, the species grows the whole plant"
    ),
    "type": bpy.types.Object,
    "poll": lambda _group, candidate: candidate.type in SKELETON_TYPES,
}

#: What overrides of linked objects may change; otherwise Blender forgets the change when the file is opened again.
_OVERRIDES = {'LIBRARY_OVERRIDABLE'}


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

    skeleton: PointerProperty(**_SKELETON)


class TetFloraObject(bpy.types.PropertyGroup, SpeciesChoice):
    """A plant is a species, a transform and a seed; nothing else is stored (paper, section 5).

    A field is an object whose points are plants.
    """

    version: IntProperty(name="Version", description="Layout of these properties", options={'HIDDEN'})
    is_plant: BoolProperty(
        name="Plant",
        description="This object is a plant: its species and seed define how it grows, its transform where",
        options={'HIDDEN'},
    )
    seed: IntProperty(
        name="Seed",
        description="Each seed is a different individual of the species; the same seed always gives the same plant",
        override=_OVERRIDES,
    )
    enabled: BoolProperty(
        name="Enabled",
        description="Include the plant in refinement and renders",
        default=True,
        override=_OVERRIDES,
    )
    skeleton: PointerProperty(**_SKELETON, override=_OVERRIDES)
    age: FloatProperty(**AGE_PROPERTY, override=_OVERRIDES, update=_on_age)
    is_field: BoolProperty(
        name="Field of Plants",
        description=(
            "Each point of this mesh or point cloud is a plant, defined by the attributes species, seed, rotation, "
            "scale and age of the points. The attribute species is an index into the list of species"
        ),
        options={'HIDDEN'},
    )
    field_species: CollectionProperty(
        name="Field Species",
        description="Species that the attribute species of a field's points refers to, starting at 0",
        type=TetFloraFieldEntry,
    )
    field_species_index: IntProperty(name="Active Field Species", options={'HIDDEN', 'SKIP_SAVE'})
    stand_year: FloatProperty(**STAND_YEAR, override=_OVERRIDES, update=_on_year)
    stand_smooth: BoolProperty(**STAND_SMOOTH, override=_OVERRIDES, update=_on_year)
    stand: PointerProperty(type=stand_properties.TetFloraStand)
    is_occluder: BoolProperty(
        name="Occluder",
        description=(
            "Plants behind this mesh count as hidden and cost next to nothing. Use it for terrain and buildings, not "
            "for transparent or very thin objects"
        ),
        options=set(),
        override=_OVERRIDES,
    )
    is_explicit: BoolProperty(**EXPLICIT_PROPERTY, override=_OVERRIDES)
    is_scatter: BoolProperty(**objects.SCATTER_PROPERTY, override=_OVERRIDES)
    population: StringProperty(
        name="Population", description="Identity of the population that created this", options={'HIDDEN'}
    )
    population_number: IntProperty(
        name="Number in the Population", description="Copies made by hand share it", options={'HIDDEN'}
    )


class TetFloraLeafObject(bpy.types.PropertyGroup, SpeciesChoice):
    """A mesh of the user's that replaces the leaf of a species."""

    takes_assets = False  # they have no leaves of their own

    leaf: PointerProperty(
        name="Leaf",
        description=(
            "Mesh object used as the leaf of the species: one unit long, stalk at the origin, along +Y, upper side "
            "toward +Z. Every leaf has all its polygons, so keep it simple"
        ),
        type=bpy.types.Object,
        poll=lambda _group, candidate: candidate.type == 'MESH',
    )


def _notify_auto_refine(self: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    auto_refine_switched.notify(self.id_data)


class TetFloraScene(RefinementProperties, AnimationProperties, library.BiomeChoice, bpy.types.PropertyGroup):
    """Settings of a scene."""

    version: IntProperty(name="Version", description="Layout of these properties", options={'HIDDEN'})

    proxy_kind: proxy_kind_property()
    baked_light: EnumProperty(
        name="Lighting",
        description=(
            "How plants are lit in renders. Baked lighting is computed during Refine. It is noise-free and fast to "
            "render, but fixed: refine again after moving a light or changing the world"
        ),
        items=(
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
        default='OFF',
    )
    refine_at_render: BoolProperty(
        name="Refine at Render",
        description=(
            "Refine for the camera of every rendered frame, also in background renders, and remove the result "
            "afterward. Meshes made by Refine are left out of these renders. Blender's interface is locked while "
            "rendering (Render > Lock Interface), which TetFlora enables when plants are added"
        ),
        default=True,
    )
    auto_refine: BoolProperty(
        name="Refine Automatically",
        description=(
            "Refine shortly after the camera, plants or settings change, without blocking Blender. A further change "
            "restarts the work. Large forests keep the processor busy"
        ),
        default=False,
        update=_notify_auto_refine,
        options=set(),
    )
    follow_viewport: BoolProperty(
        name="Follow Viewport",
        description=(
            "Refine for what the 3D viewport shows instead of the scene camera: for the viewport with Rendered shading "
            "if there is one, else the largest. A viewport that looks through the camera shows what the camera sees"
        ),
        default=False,
        update=_notify_auto_refine,
        options=set(),
    )
    asset_detail: EnumProperty(
        name="Asset Detail",
        description="When instances of assets are refined",
        items=(
            (
                'AUTO',
                "Automatic",
                "Refine instances only where that costs the renderer less: Cycles shows plain instances as long as all "
                "of their objects fit into memory, EEVEE draws every triangle of each",
            ),
            ('REFINE', "Always Refine", "Refine instances whatever they cost"),
        ),
        default='AUTO',
    )
    expand_everything: BoolProperty(
        name="Expand Everything",
        description=(
            "Create every polygon of every plant, for comparison. Eighty trees have about 4 million polygons; a forest "
            "does not fit into memory"
        ),
        options={'HIDDEN', 'ANIMATABLE'},
    )

    populate: PointerProperty(type=properties.TetFloraLayer)
    layers: CollectionProperty(
        name="Layers",
        description="What grows on the grounds of the scene, each with the rules to grow it again",
        type=properties.TetFloraLayer,
    )
    layers_index: IntProperty(name="Active Layer", options={'HIDDEN', 'SKIP_SAVE'})
    stand: PointerProperty(type=stand_properties.TetFloraStand)
    output: PointerProperty(type=collection.TetFloraOutput)
    brush: PointerProperty(type=properties.TetFloraBrush)
    wind: PointerProperty(type=settings.TetFloraWind)
    year: PointerProperty(type=settings.TetFloraYear)
    preview: PointerProperty(type=state.TetFloraPreview)
    leaf_objects: CollectionProperty(
        name="Leaf Objects",
        description="Your own meshes in place of a species' leaf",
        type=TetFloraLeafObject,
    )
    leaf_objects_index: IntProperty(name="Active Leaf Object", options={'HIDDEN', 'SKIP_SAVE'})
    species_edits: CollectionProperty(
        name="Species Edits",
        description="Species edited in this file, as JSON; they replace those of the catalog",
        type=edits.TetFloraSpeciesEdit,
        options={'HIDDEN'},
    )
    asset_species: CollectionProperty(
        name="Asset Species",
        description="Objects and collections of this file that are species",
        type=asset_species.TetFloraAssetSpecies,
        options={'HIDDEN'},
    )
    linked_scatters: CollectionProperty(
        name="Linked Scatterers",
        description="Linked objects whose scatter is refined",
        type=objects.TetFloraLinkedScatter,
        options={'HIDDEN'},
    )
    species_editor: PointerProperty(name="Species Editor", type=editor.TetFloraSpeciesEditor, options={'HIDDEN'})
    statistics: StringProperty(
        name="Statistics",
        description="Statistics of the last refinement, as JSON",
        options={'HIDDEN'},
    )


_MODULES = (
    *(properties, stand_properties, collection, state),
    *(editor, edits, asset_species, objects, settings, columns),
)
CLASSES = (
    *(cls for module in _MODULES for cls in module.CLASSES),
    TetFloraFieldEntry,
    TetFloraLeafObject,
    TetFloraObject,
    TetFloraScene,
)

_register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    """Register the property groups and add them to Blender's types."""
    TetFloraScene.__annotations__["proxy_kind"] = (
        proxy_kind_property()
    )  # forms may have come while it was not registered
    _register()
    bpy.types.Object.tetflora = PointerProperty(type=TetFloraObject, override=_OVERRIDES)
    bpy.types.Scene.tetflora = PointerProperty(type=TetFloraScene)


def unregister() -> None:
    """Remove them; what is stored in the file stays there."""
    del bpy.types.Scene.tetflora
    del bpy.types.Object.tetflora
    _unregister()
