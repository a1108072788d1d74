# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Proxies of a refinement as objects, in the form and with the light that the scene asks for."""

from __future__ import annotations

from collections.abc import Generator, Mapping

import bpy

from ..buffers import PointBuffers
from ..emission_forms import Refined
from ..refinement.statistics import Statistics
from .baking import Baking
from .emit import Results
from .node_tools import find_socket, is_ours
from .output import KIND
from .proxy_forms import ProxyForm, form_of


def write_proxies(
    results: Results, form: ProxyForm, refined: Refined, statistics: Statistics, baking: Baking | None = None
) -> Generator[float, None, None]:
    """Make the proxies of a refined scene.

    Parameters
    ----------
    results : Results
    form : ProxyForm
    refined : Refined
    statistics : Statistics
        Gets the number of faces or points, and their memory.
    baking : Baking, optional
        With the light that proxies show. Their facets must be the last that were added to it.

    Yields
    ------
    float
        Estimated fraction that is done.
    """
    scene, emission = results.scene, form.emission
    baked = baking is not None and emission.baked_blocks is not None
    blocks = emission.baked_blocks(refined, baking.light, baking.first_facet) if baked else emission.blocks(refined)
    statistics.facet_pixels = refined.facet_pixels or 0.0
    for number, buffers in enumerate(blocks):
        points = isinstance(buffers, PointBuffers)
        material = form.baked_material if baked else form.point_material if points else form.material
        made = material()
        if not baked:
            set_sockets(made, scene, form.sockets)
        species = None if buffers.species is None else refined.flora.species[buffers.species]
        name = f"{'TetFlora' if species is None else species.name} proxies {number:03d}"
        add = results.add_points if points else results.add
        add(name, "proxy", buffers, [made], species)
        statistics.polygons_proxy += buffers.polygons
        statistics.memory_mb += buffers.nbytes / 1e6
        yield 1 - 0.9**number


def set_sockets(material: bpy.types.Material, scene: bpy.types.Scene, sockets: Mapping[str, str]) -> None:
    """Set sockets of a material's group to the scene's settings, see `ProxyForm`; the artist's own changes stay."""
    if not sockets or not is_ours(material) or material.node_tree is None:
        return
    for node in material.node_tree.nodes:
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and is_ours(node.node_tree):
            for name, identifier in sockets.items():
                value = getattr(scene.tetflora, identifier)
                if name in node.inputs and find_socket(node.inputs, name).default_value != value:
                    find_socket(node.inputs, name).default_value = value


def shade_again(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """`set_sockets` for results that come back: their material is that of later ones too."""
    sockets = form_of(scene).sockets
    if not sockets or scene.tetflora.baked_light != 'OFF':
        return
    proxies = [obj for obj in collection.objects if obj.get(KIND) == "proxy"]
    for material in {material for obj in proxies for material in obj.data.materials if material is not None}:
        set_sockets(material, scene, sockets)
