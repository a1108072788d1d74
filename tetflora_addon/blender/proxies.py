# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Proxies of a refinement as objects, in the form and with the light that the scene asks for."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace

import bpy
import numpy as np

from .. import facet_emission, shell_emission
from ..buffers import MeshBuffers, PointBuffers
from ..plants.compiled import Flora
from ..refinement.camera import Camera
from ..refinement.loop import Refinement
from ..refinement.statistics import Statistics
from ..refinement.transition import Transition
from ..shading.microspheres import spheres
from ..shading.microsurfaces import concatenate_facets, facet_mesh
from .baked_material import baked_attributes, baked_material
from .baking import Baking
from .compat import drawn_disc
from .emit import Results
from .materials import proxy_material, sphere_material
from .node_tools import find_socket, is_ours
from .output import KIND
from .shell_material import baked_shell_material, shell_material

#: Properties of the scene that the sockets of shells follow, by name of the socket.
SHADING = {
    "p": "shell_diffuse",
    "s": "shell_gloss",
    "spear": "shell_spear",
    "Roundness": "shell_roundness",
    "Variation": "shell_variation",
}


def write_proxies(
    results: Results,
    flora: Flora,
    refinement: Refinement,
    camera: Camera,
    statistics: Statistics,
    facet_pixels: float,
    transition: Transition | None,
    baking: Baking | None = None,
) -> Generator[float, None, None]:
    """Proxies in the form that the scene asks for; yields the share that is done, about.

    Parameters
    ----------
    results : Results
    flora : Flora
    refinement : Refinement
    camera : Camera
    statistics : Statistics
        Gets the number of faces or points, and their memory.
    facet_pixels : float
        Side of facets and spheres, pixels.
    transition : Transition or None
        As for `emission.explicit_blocks`.
    baking : Baking, optional
        Told of all that is drawn; its light is what proxies show. Of them it has been told last, by `tell_facets`.
    """
    scene = results.scene
    form = scene.tetflora.proxy_form
    baked = baking is not None
    if form == 'SHELLS':
        shells = shell_emission.proxy_shells(flora, refinement, baking.light if baked else None)
        blocks, facet_pixels = iter([] if shells is None else [shells]), 0.0
        material = baked_shell_material if baked else shell_material
    elif baked:
        blocks = _baked_blocks(results, flora, refinement, camera, facet_pixels, transition, baking)
        material = baked_material
    elif form == 'MICROSURFACES':
        blocks = facet_emission.facet_blocks(flora, refinement, camera, facet_pixels, transition)
        material = proxy_material
    else:
        disc = drawn_disc(scene.render.engine)
        blocks_of = facet_emission.sphere_blocks if form == 'MICROSPHERES' else facet_emission.mixed_blocks
        blocks, material = blocks_of(flora, refinement, camera, facet_pixels, disc, transition), proxy_material
    statistics.facet_pixels = facet_pixels
    for number, buffers in enumerate(blocks):
        points = isinstance(buffers, PointBuffers)
        made = sphere_material() if points and not baked else material()
        add = results.add_points if points else results.add
        if form == 'SHELLS' and not baked:
            shade_shells(made, scene)
        species = None if buffers.species is None else flora.species[buffers.species]
        name = f"{'TetFlora' if species is None else species.name} proxies {number:03d}"
        add(name, "proxy", buffers, [made], species)
        statistics.polygons_proxy += buffers.polygons
        statistics.memory_mb += buffers.nbytes / 1e6
        yield 1 - 0.9**number


def tell_facets(
    baking: Baking,
    flora: Flora,
    refinement: Refinement,
    camera: Camera,
    facet_pixels: float,
    transition: Transition | None,
) -> Iterator[int]:
    """Tell of the facets that `write_proxies` is going to make; yields how many there are so far.

    They are made twice, and not kept: all of them at once may be more than memory holds.
    """
    count = 0
    for parts in facet_emission.facet_parts(flora, refinement, camera, facet_pixels, transition):
        for facets, _ in parts:
            baking.sheets.add_facets(facets)
            count += len(facets)
        yield count


def shade_shells(material: bpy.types.Material, scene: bpy.types.Scene) -> None:
    """Set the sockets of the shells' group to the scene's settings; what an artist made of the material stays."""
    if not is_ours(material) or material.node_tree is None:
        return
    for node in material.node_tree.nodes:
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and is_ours(node.node_tree):
            for name, identifier in SHADING.items():
                value = getattr(scene.tetflora, identifier)
                if name in node.inputs and find_socket(node.inputs, name).default_value != value:
                    find_socket(node.inputs, name).default_value = value


def shade_again(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """`shade_shells` for results that come back: their material is that of later ones too."""
    if scene.tetflora.proxy_form != 'SHELLS' or scene.tetflora.baked_light != 'OFF':
        return
    shells = [obj for obj in collection.objects if obj.get(KIND) == "proxy"]
    for material in {material for obj in shells for material in obj.data.materials if material is not None}:
        shade_shells(material, scene)


def _baked_blocks(
    results: Results,
    flora: Flora,
    refinement: Refinement,
    camera: Camera,
    facet_pixels: float,
    transition: Transition | None,
    baking: Baking,
) -> Iterator[MeshBuffers | PointBuffers]:
    """Facets or spheres with their light; they are the last of the sheets."""
    points = results.scene.tetflora.proxy_form == 'MICROSPHERES'
    disc = drawn_disc(results.scene.render.engine)
    first = baking.first_facet
    for parts in facet_emission.facet_parts(flora, refinement, camera, facet_pixels, transition):
        facets = concatenate_facets([some for some, _ in parts])
        sheets = np.arange(first, first + len(facets))
        first += len(facets)
        if points:
            made, light = spheres(parts, camera, disc), (baking.light.of_spheres(facets, sheets), None)
            domain = 'POINT'
        else:
            made, light, domain = facet_mesh(facets), baking.light.of_facets(facets, sheets), 'FACE'
        values = baked_attributes(domain, *light)
        if points:
            values = {name: array for name, (_, array) in values.items()}
        yield replace(made, attributes={**made.attributes, **values}, species=parts.species)
