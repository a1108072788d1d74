# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How results appear in the file, in renders and in compositing: settings of a scene, and of single species."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, PointerProperty, StringProperty

from .emit import dress_results
from .output import SWITCHES
from .species_choice import SpeciesChoice


def _changed(self: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    dress_results(self.id_data)


def _replaced(kind: str) -> dict:
    return {
        "name": f"{kind} Material",
        "description": (
            f"Material of yours for the {kind.lower()} of this species, in place of TetFlora's. It is kept through "
            "every refinement. Proxies keep the colours of the species"
        ),
        "type": bpy.types.Material,
    }


class TetFloraSpeciesOutput(bpy.types.PropertyGroup, SpeciesChoice):
    """What is special about one species in renders."""

    pass_index: IntProperty(
        name="Pass Index",
        description="Object index of this species' meshes and proxies, for masks in compositing",
        default=1,
        min=0,
        max=32767,
        update=_changed,
        options=set(),
    )
    light_group: StringProperty(
        name="Light Group",
        description="Light group of this species' meshes and proxies; empty for that of all results",
        update=_changed,
        options=set(),
    )
    leaf: PointerProperty(**_replaced("Leaf"))
    blossom: PointerProperty(**_replaced("Blossom"))
    bark: PointerProperty(**_replaced("Bark"))


class TetFloraOutput(bpy.types.PropertyGroup):
    """How results appear."""

    save_results: BoolProperty(
        name="Save Results in File",
        description=(
            "Write the meshes that Refine made into the file. Without, files stay as small as their plants, and Refine "
            "makes the same meshes again"
        ),
        default=False,
        update=_changed,
        options=set(),
    )
    show_viewport: BoolProperty(
        name="Show Results in Viewports",
        description="Show meshes and proxies in 3D views. Hide them to work with the plants alone, at full speed",
        default=True,
        update=_changed,
        options=set(),
    )
    show_render: BoolProperty(
        name="Show Results in Renders",
        description="Meshes and proxies appear in renders",
        default=True,
        update=_changed,
        options=set(),
    )
    camera: BoolProperty(**SWITCHES["camera"], update=_changed, options=set())
    diffuse: BoolProperty(**SWITCHES["diffuse"], update=_changed, options=set())
    glossy: BoolProperty(**SWITCHES["glossy"], update=_changed, options=set())
    transmission: BoolProperty(**SWITCHES["transmission"], update=_changed, options=set())
    volume_scatter: BoolProperty(**SWITCHES["volume_scatter"], update=_changed, options=set())
    shadow: BoolProperty(**SWITCHES["shadow"], update=_changed, options=set())
    pass_index: IntProperty(
        name="Pass Index",
        description="Object index of all meshes and proxies but those of species with one of their own",
        default=0,
        min=0,
        max=32767,
        update=_changed,
        options=set(),
    )
    light_group: StringProperty(
        name="Light Group",
        description="Light group of all meshes and proxies; matters where they emit light, as baked light does",
        update=_changed,
        options=set(),
    )
    species: CollectionProperty(
        name="Species",
        description="Species with a pass index, light group or materials of their own",
        type=TetFloraSpeciesOutput,
    )
    species_index: IntProperty(name="Active Species", options={'HIDDEN', 'SKIP_SAVE'})


CLASSES = (TetFloraSpeciesOutput, TetFloraOutput)
