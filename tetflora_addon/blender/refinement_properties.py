# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of refinement as properties of a scene: those of the engine, quality, and the look of shells."""

from bpy.props import EnumProperty, FloatProperty

from ..refinement.settings import RefinementSettings
from .generated import properties_of
from .qualities import quality_number, set_quality


class EngineSettings:
    """The engine's settings, field by field."""

    __annotations__ = vars(properties_of(RefinementSettings))


class RefinementProperties(EngineSettings):
    """Part of the settings of a scene."""

    quality: EnumProperty(
        name="Quality",
        description="How fine the result is; sets Cutoff, Leaf Limit, Facet Size and Visibility Resolution",
        items=(
            ('DRAFT', "Draft", "Quick and coarse, for setting up a scene"),
            ('PREVIEW', "Preview", "For judging light and composition"),
            ('FINAL', "Final", "For final renders: proxies are indistinguishable from real plants"),
            ('CUSTOM', "Custom", "Your own values"),
        ),
        get=quality_number,
        set=set_quality,
    )
    # How shells look: the user's values of the paper's shading (section 7).
    shell_diffuse: FloatProperty(
        name="Diffuse (p)",
        description="Fraction of light that shells scatter evenly (p in the paper). Smaller values are darker",
        subtype='FACTOR',
        default=1.0,
        min=0.0,
        max=1.0,
    )
    shell_gloss: FloatProperty(
        name="Gloss (s)",
        description="Fraction of light that shells of coplanar leaves reflect as a highlight (s in the paper)",
        subtype='FACTOR',
        default=0.04,
        min=0.0,
        max=1.0,
    )
    shell_spear: FloatProperty(
        name="Sharpness (spear)",
        description="Exponent of the highlight (spear in the paper). Larger values make it smaller and brighter",
        default=7.5,
        min=0.0,
        soft_max=100.0,
        max=1000.0,
    )
    shell_roundness: FloatProperty(
        name="Roundness",
        description="How round the contents of shells are shaded: 1 as spheres, 0 as flat discs facing the camera",
        subtype='FACTOR',
        default=1.0,
        min=0.0,
        max=1.0,
    )
    shell_variation: FloatProperty(
        name="Variation",
        description="Random variation of brightness between shells",
        subtype='FACTOR',
        default=0.05,
        min=0.0,
        max=1.0,
    )
