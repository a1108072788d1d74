# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Output settings of a scene and of single species: how results appear in files, renders and compositing."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, PointerProperty, StringProperty

from ..species.catalogue import SpeciesChoice
from .collection import dress_results
from .output import SWITCHES


def _changed(self: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    dress_results(self.id_data)


_COMMON = {"update": _changed, "options": set()}


def _replaced(kind: str) -> dict:
    return {
        "name": f"{kind} Material",
        "description": (
            f"Your material for the {kind.lower()} of this species, used instead of TetFlora's and kept when refining. "
            "Proxies keep the colors of the species"
        ),
        "type": bpy.types.Material,
    }


class TetFloraSpeciesOutput(bpy.types.PropertyGroup, SpeciesChoice):
    """Output settings of one species."""

    pass_index: IntProperty(
        name="Pass Index",
        description="Object index of this species' meshes and proxies, for compositing masks",
        default=1,
        min=0,
        max=32767,
        **_COMMON,
    )
    light_group: StringProperty(
        name="Light Group",
        description="Light group of this species' meshes and proxies; if empty, that of all results",
        **_COMMON,
    )
    leaf: PointerProperty(**_replaced("Leaf"))
    blossom: PointerProperty(**_replaced("Blossom"))
    bark: PointerProperty(**_replaced("Bark"))


class TetFloraOutput(bpy.types.PropertyGroup):
    """Output settings of all results."""

    save_results: BoolProperty(
        name="Save Results in File",
        description=(
            "Save the meshes made by Refine in the file. Otherwise files stay as small as their plants, and Refine "
            "makes the same meshes again"
        ),
        default=False,
        **_COMMON,
    )
    show_viewport: BoolProperty(
        name="Show Results in Viewports",
        description="Show meshes and proxies in 3D viewports. Hide them to work with the plants alone at full speed",
        default=True,
        **_COMMON,
    )
    show_render: BoolProperty(
        name="Show Results in Renders",
        description="Show meshes and proxies in renders",
        default=True,
        **_COMMON,
    )
    camera: BoolProperty(**SWITCHES["camera"], **_COMMON)
    diffuse: BoolProperty(**SWITCHES["diffuse"], **_COMMON)
    glossy: BoolProperty(**SWITCHES["glossy"], **_COMMON)
    transmission: BoolProperty(**SWITCHES["transmission"], **_COMMON)
    volume_scatter: BoolProperty(**SWITCHES["volume_scatter"], **_COMMON)
    shadow: BoolProperty(**SWITCHES["shadow"], **_COMMON)
    pass_index: IntProperty(
        name="Pass Index",
        description="Object index of all meshes and proxies, except for species with their own",
        default=0,
        min=0,
        max=32767,
        **_COMMON,
    )
    light_group: StringProperty(
        name="Light Group",
        description="Light group of all meshes and proxies; matters where they emit light, as with baked lighting",
        **_COMMON,
    )
    species: CollectionProperty(
        name="Species",
        description="Species with their own pass index, light group or materials",
        type=TetFloraSpeciesOutput,
    )
    species_index: IntProperty(name="Active Species", options={'HIDDEN', 'SKIP_SAVE'})


CLASSES = (TetFloraSpeciesOutput, TetFloraOutput)
