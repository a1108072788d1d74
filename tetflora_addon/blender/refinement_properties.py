# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of refinement as properties of a scene: a mirror of `RefinementSettings`, field by field."""

from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ..refinement.settings import RefinementSettings
from .qualities import quality_number, set_quality

_SETTINGS = RefinementSettings()


class RefinementProperties:
    """Part of the settings of a scene."""

    cutoff: FloatProperty(
        name="Cutoff",
        description=(
            "Side in pixels of the final picture under which space is divided no further. "
            "Smaller is finer and slower; 1 to 4 pixels are hard to tell apart"
        ),
        subtype='PIXEL',
        default=_SETTINGS.cutoff,
        min=0.25,
        soft_min=0.5,
        soft_max=16.0,
        max=1000.0,
    )
    leaf_limit: FloatProperty(
        name="Leaf Limit",
        description=(
            "Leaves that look narrower than this are drawn as proxies; from here to 2.5 times as wide a growing share "
            "of them is real. Larger saves polygons; above about half a pixel the loss shows"
        ),
        subtype='PIXEL',
        default=_SETTINGS.leaf_limit,
        min=0.05,
        soft_max=4.0,
        max=1000.0,
    )
    block: FloatProperty(
        name="Block",
        description=(
            "Side in pixels from which on visible space is divided even where all of it becomes polygons, "
            "so that hidden parts are found. Smaller finds more of them and takes longer"
        ),
        subtype='PIXEL',
        default=_SETTINGS.block,
        min=1.0,
        soft_max=256.0,
        max=10_000.0,
    )
    few_polygons: IntProperty(
        name="Few Polygons",
        description="Space that holds fewer polygons than this is divided no further",
        default=_SETTINGS.few_polygons,
        min=0,
        soft_max=5_000,
    )
    hidden: FloatProperty(
        name="Hidden Below",
        description="Space counts as hidden if less than this share of it is seen. Larger saves polygons in thickets",
        subtype='FACTOR',
        default=_SETTINGS.hidden,
        min=0.0,
        max=1.0,
    )
    visibility_resolution: IntProperty(
        name="Visibility",
        description=(
            "Longer side, in pixels, of the small picture that tells what hides what. "
            "Larger tells it more exactly; time grows with its square"
        ),
        subtype='PIXEL',
        default=_SETTINGS.visibility_resolution,
        min=16,
        soft_min=64,
        soft_max=1024,
        max=4096,
    )
    max_tetrahedra: IntProperty(
        name="Most Tetrahedra",
        description="Refinement stops before it makes more pieces of space than this. It bounds time and memory",
        default=_SETTINGS.max_tetrahedra,
        min=100,
        soft_min=10_000,
        soft_max=2_000_000,
    )
    max_levels: IntProperty(
        name="Most Levels",
        description="How often a piece of space may be halved at most",
        default=_SETTINGS.max_levels,
        min=1,
        max=200,
    )

    shadow_cutoff: FloatProperty(
        name="Shadow Cutoff",
        description=(
            "Side in pixels under which shadows of hidden plants are refined no further; 0 leaves them coarse. "
            "About 4 pixels makes shadows of trees behind the camera sharp, for a quarter more polygons or so"
        ),
        subtype='PIXEL',
        default=_SETTINGS.shadow_cutoff,
        min=0.0,
        soft_max=16.0,
        max=1000.0,
    )
    max_passes: IntProperty(
        name="Stop After",
        description=(
            "Passes of refinement after which it stops, to look at the state in between; 0 goes on to the end. "
            "What would be divided further becomes polygons or proxies as it is"
        ),
        default=_SETTINGS.max_passes,
        min=0,
        soft_max=40,
    )
    facet: FloatProperty(
        name="Facets",
        description="Side in pixels of the small facets that proxies are drawn with. Larger is fewer and coarser",
        subtype='PIXEL',
        default=_SETTINGS.facet,
        min=0.1,
        soft_max=4.0,
        max=100.0,
    )
    max_polygons: IntProperty(
        name="Most Polygons",
        description=(
            "Polygons that may be made in all, those of proxies included; 0 for no limit. Where more would be needed, "
            "those that are seen best are made first, and the rest becomes coarser proxies"
        ),
        default=_SETTINGS.max_polygons,
        min=0,
        soft_max=100_000_000,
        step=100_000,
    )
    max_memory: FloatProperty(
        name="Most Memory",
        description="Gigabytes that the result may take in Blender and while it renders, about; 0 for no limit",
        default=_SETTINGS.max_memory,
        min=0.0,
        soft_max=256.0,
        precision=1,
    )
    anchored: BoolProperty(
        name="Anchored",
        description=(
            "Divide space alike in all frames of a film, whatever the camera does, so that less changes from frame to "
            "frame. Somewhat more is made than where space is divided from the camera. Panoramas always are"
        ),
        default=_SETTINGS.anchored,
    )
    quality: EnumProperty(
        name="Quality",
        description="How fine the result is; sets the cutoff, the limit for leaves, the facets and the visibility",
        items=(
            ('DRAFT', "Draft", "For setting up a scene: quick and coarse"),
            ('PREVIEW', "Preview", "For judging light and composition"),
            ('FINAL', "Final", "For the picture: what is drawn as proxies cannot be told from the plants"),
            ('CUSTOM', "Custom", "Values of your own"),
        ),
        get=quality_number,
        set=set_quality,
    )
    # How shells look: the user's values of the paper's shading (section 7).
    shell_diffuse: FloatProperty(
        name="Diffuse (p)",
        description="Share of the light that shells scatter evenly: the paper's p. Less is darker",
        subtype='FACTOR',
        default=1.0,
        min=0.0,
        max=1.0,
    )
    shell_gloss: FloatProperty(
        name="Gloss (s)",
        description="Share of the light that shells of leaves in one plane mirror: the paper's s",
        subtype='FACTOR',
        default=0.04,
        min=0.0,
        max=1.0,
    )
    shell_spear: FloatProperty(
        name="Sharpness (spear)",
        description="Exponent of that highlight: the paper's spear. Larger is smaller and brighter",
        default=7.5,
        min=0.0,
        soft_max=100.0,
        max=1000.0,
    )
    shell_roundness: FloatProperty(
        name="Roundness",
        description="1: what shells hold is shaded as spheres; 0: as discs that face the camera, which is flatter",
        subtype='FACTOR',
        default=1.0,
        min=0.0,
        max=1.0,
    )
    shell_variation: FloatProperty(
        name="Variation",
        description="By how much single shells are lighter or darker than their plants, as a share",
        subtype='FACTOR',
        default=0.05,
        min=0.0,
        max=1.0,
    )
