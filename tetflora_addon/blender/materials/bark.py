# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bark by nodes: patterns that follow each branch by its UV map, fade on thin twigs, and keep the mean colour.

A pattern lives on a cylinder of radius 1, of which the branch is an unrolled image: (cos 2πu, sin 2πu, 2πv). It
therefore closes without a seam at u = 0 and is as wide as it is high. How many features there are to a radius follows
from the branch's girth at its base, one number for each branch. How thick the branch is where it is seen follows from
the slope of u along the surface, which Bump nodes know.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import tau
from typing import Any

import bpy

from ...errors import SpeciesError
from . import bark_patterns as patterns
from . import bark_skins as skins
from .bark_tools import Place, Socket
from .nodes import Graph, shader_group, smooth_step

PLACE = "TetFlora Bark Place"

# Raise this when nodes of a group change; `bark_version` then makes new materials as well.
_VERSION = 5

# A perimeter of this length tilts the Bump node's normal by 45 degrees: the middle of the range that matters, metres.
_REFERENCE = 0.25
# Longest perimeter that counts, metres; that of a trunk of 2 m.
_THICKEST = 6.0
# How far the pattern of a branch is moved per unit of its colour, in radii: branches differ in colour, so in pattern.
_SHIFT = 10.0
# Perimeter of the branch on which there are `Bark.scale` features to a radius, metres; also of one that does not say.
_USUAL = 1.57
# Light that relief costs in Cycles over what tilted normals explain.
_STEEPER = 1.15
# Moss grows up to this height above the base of a branch, on branches of these perimeters, metres.
_MOSSY, _MOSS_GIRTH = 3.0, (0.3, 0.9)
# Patches of moss and lichen to a meter.
_PATCHES = 5.0
# Where light and rain come from: moss faces north and up.
_SHADY = (0.0, 0.76, 0.65)
# What lies so many radii below the base of a branch is an old root.
_ROOTS = -0.1
# Up to this height rain splashes from the ground, metres.
_SPLASH = 0.7
# Colours of moss, algae and lichen over the lightness of the bark under them.
_MOSS, _ALGAE, _LICHEN = (0.78, 0.9, 0.36), (0.93, 1.05, 0.68), (1.15, 1.2, 1.0)


@dataclass(frozen=True)
class Bark:
    """One character of bark.

    Attributes
    ----------
    pattern : callable
        (graph, place) → (factors of the colour, height in widths of a feature): sockets.
    scale : float
        Features to a radius, on a branch of .25 m radius; 2π times as many around it.
    stretch : float
        How much longer along the branch than around it features are.
    mean : (3,) float
        Mean of the pattern's factors over the surface, measured.
    contrast : float
        1: factors as the pattern has them.
    depth : float
        Of the relief, in widths of a feature.
    smooth, full : float
        Perimeters under which there is no pattern, and over which it is complete, metres.
    moss, lichen : float
        How much of it there is.
    power : float
        Features to a radius go by this power of the radius: at 1 they are as wide on all branches.
    """

    pattern: Callable[[Graph, Place], tuple[Socket, Socket]]
    scale: float
    stretch: float
    mean: tuple[float, float, float]
    contrast: float
    depth: float
    smooth: float
    full: float
    moss: float = 0.0
    lichen: float = 0.0
    power: float = 0.5


def place_group() -> bpy.types.NodeTree:
    """The group "TetFlora Bark Place": where on a branch a point lies.

    Returns
    -------
    bpy.types.NodeTree
        Outputs Place, on the cylinder of radius 1 (in radii, moved by the branch's colour), Turn, Along (radii), and
        Perimeter, metres. The perimeter P is that of the branch where it is seen: a relief of height u times D tilts
        the normal by θ with tan θ = D |∇u| = D / P (Mikkelsen 2010, "Bump mapping unparametrized surfaces on the GPU").
    """

    def build(graph: Graph, _given: Any) -> dict[str, Any]:
        uv = graph.node("ShaderNodeSeparateXYZ", {"Vector": graph.attribute("UVMap", "Vector")}).outputs
        angle = graph.math('MULTIPLY', uv["X"], tau)
        x, y, z = graph.math('COSINE', angle), graph.math('SINE', angle), graph.math('MULTIPLY', uv["Y"], tau)
        cylinder = graph.node("ShaderNodeCombineXYZ", {"X": x, "Y": y, "Z": z})
        shift = graph.vector('SCALE', graph.attribute("tf_colour", "Vector"), _SHIFT)
        place = graph.vector('ADD', cylinder, shift)

        bump = graph.node("ShaderNodeBump", {"Strength": 1.0, "Distance": _REFERENCE, "Height": uv["X"]})
        normal = graph.node("ShaderNodeNewGeometry").outputs["Normal"]
        cosine = graph.vector('DOT_PRODUCT', bump, normal)
        sine = graph.math('SQRT', graph.math('SUBTRACT', 1.0, graph.math('MULTIPLY', cosine, cosine)))
        cotangent = graph.math('DIVIDE', cosine, graph.math('MAXIMUM', sine, 1e-3))
        perimeter = graph.math('MINIMUM', graph.math('MULTIPLY', cotangent, _REFERENCE), _THICKEST)
        return {"Place": place, "Turn": uv["X"], "Along": z, "Perimeter": perimeter}

    outputs = (("Place", 'Vector'), *((name, 'Float') for name in ("Turn", "Along", "Perimeter")))
    return shader_group(PLACE, _VERSION, (), outputs, build)


def bark_group(character: str) -> bpy.types.NodeTree:
    """The group "TetFlora <Character> Bark".

    Parameters
    ----------
    character : str
        One of `BARKS`.

    Returns
    -------
    bpy.types.NodeTree
        Inputs Colour, Scale, Stretch, Contrast, Depth, Smooth Under, Full Over, Moss, Lichen; outputs Colour, whose
        mean over the surface is the colour that went in, Normal, Gain, and Shown, which is 0 where both are those of
        a smooth twig: Cycles then passes over all nodes of the pattern, which is most of the wood in a crown. Gain is
        what Cycles loses at a normal that is tilted by θ, and EEVEE does not: of the light that comes evenly from the
        normal's half space the fraction (1 + cos θ) / 2 lies above the surface itself.

    Raises
    ------
    SpeciesError
        There is no such bark.
    """
    bark = _bark(character)
    inputs = (
        ("Colour", 'Color', (0.16, 0.11, 0.07, 1.0), None, "Mean color"),
        ("Scale", 'Float', bark.scale, (0.0, 1000.0), "Number of features per radius of a branch of 0.25 m"),
        ("Stretch", 'Float', bark.stretch, (0.01, 100.0), "Length to width of the features"),
        ("Contrast", 'Float', bark.contrast, (0.0, 4.0), "Contrast around the mean color"),
        ("Depth", 'Float', bark.depth, (0.0, 4.0), "Depth of the relief, in widths of a feature"),
        ("Smooth Under", 'Float', bark.smooth, (0.0, 10.0), "Perimeter of a young branch (m)"),
        ("Full Over", 'Float', bark.full, (0.0, 10.0), "Perimeter of an old branch (m)"),
        ("Moss", 'Float', bark.moss, (0.0, 2.0), "Moss low on thick wood that faces north or up"),
        ("Lichen", 'Float', bark.lichen, (0.0, 2.0), "Pale patches of lichen"),
    )

    def build(graph: Graph, given: Any) -> dict[str, Any]:
        where = graph.node("ShaderNodeGroup", node_tree=place_group()).outputs
        girth = base_girth(graph)
        share = graph.math('POWER', graph.math('DIVIDE', girth, _USUAL), bark.power)
        scale = graph.math('MULTIPLY', given["Scale"], share)
        along = graph.math('DIVIDE', scale, given["Stretch"])
        by = graph.node("ShaderNodeCombineXYZ", {"X": scale, "Y": scale, "Z": along})
        cells = graph.vector('MULTIPLY', where["Place"], by)
        place = Place(where["Place"], cells, where["Turn"], where["Along"], scale, given["Stretch"], girth)
        tone, height = bark.pattern(graph, place)
        age = smooth_step(graph, where["Perimeter"], given["Smooth Under"], given["Full Over"])
        # Roots, below the base, are thin but as old as the trunk.
        age = graph.math('MAXIMUM', age, smooth_step(graph, where["Along"], 0.0, _ROOTS))
        around_one = graph.vector('SUBTRACT', graph.vector('DIVIDE', tone, bark.mean), (1.0, 1.0, 1.0))
        change = graph.vector('SCALE', around_one, graph.math('MULTIPLY', given["Contrast"], age))
        colour = graph.tinted(given["Colour"], graph.vector('ADD', change, (1.0, 1.0, 1.0)))
        if bark.moss or bark.lichen:
            colour = _overgrown(graph, given, (place, girth, age), colour)
        # Thickness must not be part of the height, whose slope alone is wanted.
        width = graph.math('DIVIDE', where["Perimeter"], graph.math('MULTIPLY', scale, tau))
        depth = graph.math('MULTIPLY', graph.math('MULTIPLY', width, given["Depth"]), age)
        bump = graph.node("ShaderNodeBump", {"Strength": 1.0, "Distance": depth, "Height": height})
        # Only trunks flare, and these are thick.
        shown = graph.math('GREATER_THAN', girth, given["Smooth Under"])
        shown = graph.math('MAXIMUM', shown, graph.math('LESS_THAN', where["Along"], 0.0))
        tilt = graph.vector('DOT_PRODUCT', bump, graph.node("ShaderNodeNewGeometry").outputs["Normal"])
        gain = graph.math('DIVIDE', 2.0, graph.math('ADD', 1.0, graph.math('MAXIMUM', tilt, 0.0)))
        # Tilted normals explain most of the loss; the rest is measured.
        gain = graph.math('MULTIPLY_ADD', gain, _STEEPER, 1.0 - _STEEPER)
        return {"Colour": colour, "Normal": bump, "Gain": gain, "Shown": shown}

    outputs = ("Colour", 'Color'), ("Normal", 'Vector'), ("Gain", 'Float'), ("Shown", 'Float')
    return shader_group(f"TetFlora {character.capitalize()} Bark", _VERSION, inputs, outputs, build)


def base_girth(graph: Graph) -> Socket:
    """Length around the branch at its base, metres; a usual one where the mesh does not say."""
    girth = graph.attribute("tf_girth", "Fac")
    return graph.math('MULTIPLY_ADD', graph.math('LESS_THAN', girth, 1e-6), _USUAL, girth)


def _overgrown(graph: Graph, given: Any, at: tuple[Place, Socket, Socket], colour: Socket) -> Socket:
    """Moss where it is damp, lichen where a noise is low: as light as the bark beneath, so that the mean stays."""
    place, girth, age = at
    radii = graph.math('DIVIDE', girth, tau)
    metres = graph.vector('SCALE', place.round, graph.math('MULTIPLY', radii, _PATCHES))
    noise = graph.noise(metres, 4.0, 0.65)[0]
    normal = graph.node("ShaderNodeNewGeometry").outputs["Normal"]
    damp = smooth_step(graph, graph.vector('DOT_PRODUCT', normal, _SHADY), -0.3, 0.9)
    height = graph.math('MULTIPLY', place.along, radii)
    low = smooth_step(graph, height, _MOSSY, 0.0)
    # What does not say how thick it is may be no wood.
    thick = smooth_step(graph, graph.attribute("tf_girth", "Fac"), *_MOSS_GIRTH)
    # The foot is damp all around.
    damp = graph.math('MULTIPLY_ADD', smooth_step(graph, height, _SPLASH, 0.0), 0.6, graph.math('MULTIPLY', damp, low))
    damp = graph.math('MULTIPLY', damp, thick)
    # Moss settles in what lies deep first.
    there = graph.math('MULTIPLY_ADD', graph.math('MULTIPLY', damp, given["Moss"]), 0.45, noise)
    moss = graph.math('MULTIPLY', smooth_step(graph, there, 0.72, 0.92), age)
    algae = graph.math('MULTIPLY', smooth_step(graph, damp, 0.0, 0.8), graph.math('MULTIPLY', given["Moss"], age))
    algae = graph.math('MULTIPLY', smooth_step(graph, there, 0.45, 0.85), graph.math('MULTIPLY', algae, 0.6))
    lichen = graph.math('MULTIPLY', smooth_step(graph, noise, 0.37, 0.34), graph.math('MULTIPLY', given["Lichen"], age))
    light = graph.node("ShaderNodeRGBToBW", {"Color": colour}).outputs[0]
    for tint, amount in ((_LICHEN, lichen), (_ALGAE, algae), (_MOSS, moss)):
        colour = graph.mixed(amount, colour, graph.vector('SCALE', tint, light))
    return colour


def bark_version(character: str) -> int:
    """Version of a material with that bark: another character is another version, and the old one stays beside it."""
    _bark(character)
    return 100 * _VERSION + BARKS.index(character)


def _bark(character: str) -> Bark:
    if character not in _CHARACTERS:
        raise SpeciesError(f'Unknown bark "{character}"; choose one of {", ".join(BARKS)}')
    return _CHARACTERS[character]


_CHARACTERS: dict[str, Bark] = {
    "ridged": Bark(patterns.ridged, 11.0, 6.0, (0.427, 0.394, 0.335), 0.95, 0.3, 0.22, 0.8, 1.0, 0.6),
    "plated": Bark(patterns.plated, 6.0, 2.8, (0.33, 0.245, 0.203), 1.0, 0.18, 0.25, 0.8, 0.3, 0.4),
    "smooth": Bark(skins.smooth, 6.0, 0.3, (0.445, 0.449, 0.422), 1.0, 0.02, 0.12, 0.4, 0.8, 0.9),
    "banded": Bark(skins.banded, 7.0, 0.2, (0.636, 0.614, 0.595), 1.0, 0.05, 0.1, 0.3, 0.4, 0.5),
    "ringed": Bark(skins.ringed, 2.2, 1.2, (0.519, 0.519, 0.519), 0.7, 0.07, 0.2, 0.6, power=0.0),
    "fibrous": Bark(patterns.fibrous, 9.0, 14.0, (0.543, 0.481, 0.429), 1.0, 0.3, 0.16, 0.5, 0.5, 0.3),
    "jointed": Bark(skins.jointed, 3.0, 8.0, (0.443, 0.443, 0.443), 0.32, 0.03, 0.02, 0.08, power=0.0),
    "netted": Bark(patterns.netted, 12.5, 5.5, (0.438, 0.413, 0.361), 0.62, 0.3, 0.22, 0.8, 0.7, 0.6),
    "peeling": Bark(skins.peeling, 14.0, 0.22, (0.835, 0.826, 0.811), 1.0, 0.1, 0.12, 0.4, 0.4, 0.3),
    "scaly": Bark(patterns.scaly, 18.0, 1.2, (0.563, 0.477, 0.425), 1.0, 0.18, 0.2, 0.6, 0.4, 0.5),
    "interlaced": Bark(patterns.interlaced, 17.0, 6.0, (0.439, 0.376, 0.32), 0.8, 0.2, 0.22, 0.8, 0.5, 0.5),
    "pitted": Bark(skins.pitted, 9.0, 0.8, (0.666, 0.681, 0.602), 1.0, 0.1, 0.12, 0.4, 0.4, 0.6),
    "papery": Bark(patterns.papery, 6.0, 2.8, (0.331, 0.247, 0.206), 1.0, 0.18, 0.25, 0.8, 0.3, 0.4),
}

#: Characters of bark, as species name them.
BARKS = tuple(_CHARACTERS)
