# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of stands: of new ones (``Scene.tetflora.stand``) and of each that was grown (``Object.tetflora.stand``)."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, FloatProperty, IntProperty, StringProperty

from ...planting.rules import Rules
from ...stands.grow import StandSettings
from ..placing.properties import AroundPaths, TetFloraGround
from ..settings import properties_of, settings_in
from ..species.catalog import SpeciesChoice

_RULES = properties_of(Rules, options=set())
_FACTOR = {"min": 0.0, "max": 1.0, "subtype": 'FACTOR', "options": set()}


class TetFloraStandEntry(bpy.types.PropertyGroup, SpeciesChoice):
    """One species of a stand."""

    takes_assets = False  # they do not grow

    planted: FloatProperty(
        name="Planted",
        description="Share of this species among the plants that are planted at the beginning, relative to the others",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        max=1e6,
        options=set(),
    )
    incoming_seeds: FloatProperty(
        name="Share of Seeds",
        description="Share of this species among the seeds that arrive from outside, relative to the others",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        max=1e6,
        options=set(),
    )


class TetFloraStand(bpy.types.PropertyGroup, settings_in(StandSettings, options=set()), AroundPaths):
    """What a stand grows from."""

    is_grown: BoolProperty(name="Stand", description="This field was grown as a stand", options={'HIDDEN'})
    last_year: FloatProperty(name="Last Year", description="Year of the stand's last record", options={'HIDDEN'})
    plants: IntProperty(name="Plants in Its Year", options={'HIDDEN'})
    grown_by: StringProperty(name="Grown By", options={'HIDDEN'})  # `layers.stand_settings_now` of when it was grown
    biome: StringProperty(name="Biome", options={'HIDDEN'})  # ``uid`` of the biome of which it is a layer
    grounds: CollectionProperty(name="Grounds", description="Meshes that the stand grows on", type=TetFloraGround)
    species: CollectionProperty(
        name="Species",
        description="Species of the stand; if empty, a mixed forest of central Europe",
        type=TetFloraStandEntry,
    )
    species_index: IntProperty(name="Active Species", options={'HIDDEN', 'SKIP_SAVE'})

    years: properties_of(StandSettings, options=set(), default=100).years
    # Woods of a scene end where their ground does.
    open_edges: properties_of(StandSettings, options=set(), default=True).open_edges

    degree_days: FloatProperty(
        name="Degree Days",
        description=(
            "Sum of the daily mean temperatures above 5 °C in a year, where altitude is 0; it is colder above. About "
            "900 in Lapland, 1,700 in central Europe, 3,500 on the Mediterranean"
        ),
        default=1700.0,
        min=0.0,
        soft_max=6000.0,
        max=12_000.0,
        step=10_000,
        precision=0,
        options=set(),
    )
    coldest_month: FloatProperty(
        name="Coldest Month",
        description="Mean temperature of the coldest month, in °C, where altitude is 0",
        default=-1.0,
        min=-80.0,
        soft_min=-30.0,
        soft_max=20.0,
        max=40.0,
        step=100,
        precision=1,
        options=set(),
    )
    moisture: FloatProperty(
        name="Moisture", description="Moisture of level soil: 0 is dry, 0.5 fresh, 1 wet", default=0.5, **_FACTOR
    )
    relief: FloatProperty(
        name="By Relief",
        description="How much drier ridges are, and how much wetter valleys, by the shape of the ground",
        default=0.5,
        **_FACTOR,
    )
    fertility: FloatProperty(name="Fertility", description="Soil: 0 is poor, 1 is rich", default=0.7, **_FACTOR)
    slope_max: _RULES.slope_max
    vertex_group: StringProperty(
        name="Vertex Group",
        description="Vertex group of the ground whose weights say where plants can stand: 0 is bare",
        options=set(),
    )


CLASSES = (TetFloraStandEntry, TetFloraStand)
