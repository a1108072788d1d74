# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of stands: of new ones (``Scene.tetflora.stand``) and of each that was grown (``Object.tetflora.stand``)."""

import bpy

from ...parameters import within
from ...planting.rules import Rules
from ...stands.grow import StandSettings
from ..declare import FIXED, HIDDEN, boolean, integer, list_of, real, string
from ..placing.properties import AroundPaths, TetFloraGround
from ..settings import properties_of, settings_in
from ..species.catalog import SpeciesChoice, gallery_of

_RULES = properties_of(Rules, options=set())
_FACTOR = {"min": 0.0, "max": 1.0, "subtype": 'FACTOR', "options": set()}
_AMONG = "Share of this species among the {}, relative to the others"
_SHARE = {**within(0.0, 10.0, 1e6), **FIXED}
_WARMTH = {**within(0.0, 6000.0, 12_000.0), "step": 10_000, "precision": 0, **FIXED}
_COLD = {"min": -80.0, "soft_min": -30.0, "soft_max": 20.0, "max": 40.0, "step": 100, "precision": 1, **FIXED}


class TetFloraStandEntry(bpy.types.PropertyGroup, SpeciesChoice):
    """One species of a stand."""

    takes_assets = False  # they do not grow

    planted: real("Planted", _AMONG.format("plants that are planted at the beginning"), 1.0, **_SHARE)
    incoming_seeds: real("Share of Seeds", _AMONG.format("seeds that arrive from outside"), 1.0, **_SHARE)


class TetFloraStand(bpy.types.PropertyGroup, settings_in(StandSettings, options=set()), AroundPaths):
    """What a stand grows from."""

    is_grown: boolean("Stand", "This field was grown as a stand", **HIDDEN)
    last_year: real("Last Year", "Year of the stand's last record", **HIDDEN)
    plants: integer("Plants in Its Year", **HIDDEN)
    grown_by: string("Grown By", **HIDDEN)  # `growing.stand_settings_now` of when it was grown
    stood_on: string("Stood On", **HIDDEN)  # `rules.forms_of` its grounds then
    biome: string("Biome", **HIDDEN)  # ``uid`` of the biome of which it is a layer
    grounds: list_of(TetFloraGround, "Grounds", "Meshes that the stand grows on")
    species: list_of(TetFloraStandEntry, "Species", "Species of the stand; if empty, a mixed forest of central Europe")
    species_index: integer("Active Species", options={'HIDDEN', 'SKIP_SAVE'})
    add_species: gallery_of("species", TetFloraStandEntry)

    years: properties_of(StandSettings, options=set(), default=100).years
    # Woods of a scene end where their ground does.
    open_edges: properties_of(StandSettings, options=set(), default=True).open_edges

    degree_days: real(
        "Degree Days",
        "Sum of the daily mean temperatures above 5 °C in a year, where altitude is 0; it is colder above. About "
        "900 in Lapland, 1,700 in central Europe, 3,500 on the Mediterranean",
        1700.0,
        **_WARMTH,
    )
    coldest_month: real(
        "Coldest Month", "Mean temperature of the coldest month, in °C, where altitude is 0", -1.0, **_COLD
    )
    moisture: real("Moisture", "Moisture of level soil: 0 is dry, 0.5 fresh, 1 wet", 0.5, **_FACTOR)
    relief: real(
        "By Relief", "How much drier ridges are, and how much wetter valleys, by the ground's shape", 0.5, **_FACTOR
    )
    fertility: real("Fertility", "Soil: 0 is poor, 1 is rich", 0.7, **_FACTOR)
    slope_max: _RULES.slope_max
    vertex_group: string(
        "Vertex Group", "Vertex group of the ground whose weights say where plants can stand: 0 is bare", **FIXED
    )
