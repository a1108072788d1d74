# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bark by nodes: patterns that follow each branch by its UV map, fade on thin twigs, and keep the mean colour.

A pattern lives on a cylinder of radius 1, of which the branch is an unrolled image: (cos 2πu, sin 2πu, 2πv). It
therefore closes without a seam at u = 0, is as wide as it is high, and grows with the branch. How thick the branch is
where it is seen follows from the slope of u along the surface, which Bump nodes know: no mesh carries it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import tau
from typing import Any

import bpy

from ...errors import SpeciesError
from .nodes import Graph, find_socket, shader_group, smooth_step

GIRTH = "TetFlora Bark Place"

# Raise this when nodes of a group change; `bark_version` then makes new materials as well.
_VERSION = 2

# A perimeter of this length tilts the Bump node's normal by 45 degrees: the middle of the range that matters, metres.
_REFERENCE = 0.25
# Longest perimeter that counts, metres; that of a trunk of 2 m.
_THICKEST = 6.0
# How far the pattern of a branch is moved per unit of its colour, in radii: branches differ in colour, so in pattern.
_SHIFT = 10.0

Socket = Any


@dataclass(frozen=True)
class Bark:
    """One character of bark.

    Attributes
    ----------
    pattern : callable
        (graph, place, scale, stretch) → (tone, height): both sockets of numbers from 0 to 1.
    scale : float
        Features to a radius of the branch; 2π times as many around it.
    stretch : float
        How much longer along the branch than around it features are.
    mean : float
        Mean of the pattern's tone over the surface, measured; a little less where the relief costs light in Cycles
        (rays of a tilted normal's half space that end inside the branch, up to 4 %), none of which EEVEE sees: half
        the loss is made up for, so that neither is off by more than 3 %.
    contrast : float
        Change of the colour's factor from tone 0 to tone 1.
    hue : (3,) float
        Factor of the contrast in red, green and blue.
    depth : float
        Of the relief, in perimeters of the branch.
    smooth, full : float
        Perimeters under which there is no pattern, and over which it is complete, metres.
    """

    pattern: Callable[[Graph, Socket, Socket, Socket], tuple[Socket, Socket]]
    scale: float
    stretch: float
    mean: float
    contrast: float
    hue: tuple[float, float, float]
    depth: float
    smooth: float
    full: float


def place_group() -> bpy.types.NodeTree:
    """The group "TetFlora Bark Place": where on a branch a point lies.

    Returns
    -------
    bpy.types.NodeTree
        Outputs Place, on the cylinder of radius 1 (in radii, moved by the branch's colour), and Perimeter, metres.
        The perimeter P is that of the branch where it is seen: a relief of height u times D tilts the normal by θ with
        tan θ = D |∇u| = D / P (Mikkelsen 2010, "Bump mapping unparametrized surfaces on the GPU").
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
        return {"Place": place, "Perimeter": perimeter}

    return shader_group(GIRTH, _VERSION, (), (("Place", 'Vector'), ("Perimeter", 'Float')), build)


def bark_group(character: str) -> bpy.types.NodeTree:
    """The group "TetFlora <Character> Bark".

    Parameters
    ----------
    character : str
        One of `BARKS`.

    Returns
    -------
    bpy.types.NodeTree
        Inputs Colour, Scale, Stretch, Contrast, Depth, Smooth Under, Full Over; outputs Colour, whose mean over the
        surface is the colour that went in, and Normal.

    Raises
    ------
    SpeciesError
        There is no such bark.
    """
    bark = _bark(character)
    inputs = (
        ("Colour", 'Color', (0.16, 0.11, 0.07, 1.0), None, "Mean color"),
        ("Scale", 'Float', bark.scale, (0.0, 1000.0), "Number of features per branch radius"),
        ("Stretch", 'Float', bark.stretch, (0.01, 100.0), "Length to width of the features"),
        ("Contrast", 'Float', bark.contrast, (0.0, 4.0), "Contrast around the mean color"),
        ("Depth", 'Float', bark.depth, (0.0, 1.0), "Depth of the relief, in perimeters"),
        ("Smooth Under", 'Float', bark.smooth, (0.0, 10.0), "Perimeter of a young branch (m)"),
        ("Full Over", 'Float', bark.full, (0.0, 10.0), "Perimeter of an old branch (m)"),
    )

    def build(graph: Graph, given: Any) -> dict[str, Any]:
        where = graph.node("ShaderNodeGroup", node_tree=place_group()).outputs
        tone, height = bark.pattern(graph, where["Place"], given["Scale"], given["Stretch"])
        age = smooth_step(graph, where["Perimeter"], given["Smooth Under"], given["Full Over"])
        around_zero = graph.math('SUBTRACT', tone, bark.mean)
        change = graph.math('MULTIPLY', around_zero, graph.math('MULTIPLY', given["Contrast"], age))
        factor = graph.vector('ADD', graph.vector('SCALE', bark.hue, change), (1.0, 1.0, 1.0))
        # Thickness must not be part of the height, whose slope alone is wanted.
        depth = graph.math('MULTIPLY', where["Perimeter"], given["Depth"])
        depth = graph.math('MULTIPLY', depth, age)
        bump = graph.node("ShaderNodeBump", {"Strength": 1.0, "Distance": depth, "Height": height})
        return {"Colour": graph.tinted(given["Colour"], factor), "Normal": bump}

    name = f"TetFlora {character.capitalize()} Bark"
    return shader_group(name, _VERSION, inputs, (("Colour", 'Color'), ("Normal", 'Vector')), build)


def bark_version(character: str) -> int:
    """Version of a material with that bark: another character is another version, and the old one stays beside it."""
    _bark(character)
    return 100 * _VERSION + BARKS.index(character)


def _bark(character: str) -> Bark:
    if character not in _CHARACTERS:
        raise SpeciesError(f'Unknown bark "{character}"; choose one of {", ".join(BARKS)}')
    return _CHARACTERS[character]


def _stretched(graph: Graph, place: Socket, scale: Socket, stretch: Socket) -> Socket:
    """Place in features: `scale` to a radius, `stretch` times longer along the branch."""
    along = graph.math('DIVIDE', scale, stretch)
    by = graph.node("ShaderNodeCombineXYZ", {"X": scale, "Y": scale, "Z": along})
    return graph.vector('MULTIPLY', place, by)


def _noise(graph: Graph, place: Socket, detail: float, roughness: float, distortion: float = 0.0) -> Socket:
    """Fractal noise from 0 to 1, .5 on average."""
    inputs = {"Vector": place, "Scale": 1.0, "Detail": detail, "Roughness": roughness, "Distortion": distortion}
    return find_socket(graph.node("ShaderNodeTexNoise", inputs).outputs, "Fac")


def _cracked(graph: Graph, bent: Socket, width: float) -> Socket:
    """Cells from 1 down to 0 in the cracks between them."""
    inputs = {"Vector": bent, "Scale": 1.0, "Randomness": 1.0}
    cells = graph.node("ShaderNodeTexVoronoi", inputs, feature='DISTANCE_TO_EDGE')
    return smooth_step(graph, cells.outputs["Distance"], 0.0, width)


def _bent(graph: Graph, place: Socket, noise: Socket, amount: float) -> Socket:
    """Places moved by a noise, along the diagonal."""
    return graph.vector('ADD', place, graph.vector('SCALE', (amount, amount, amount), noise))


def _ridged(graph: Graph, place: Socket, scale: Socket, stretch: Socket) -> tuple[Socket, Socket]:
    """Long ridges that part and meet again, with furrows between them and cracks across."""
    cells = _stretched(graph, place, scale, stretch)
    noise = _noise(graph, graph.vector('MULTIPLY', cells, (1.0, 1.0, 2.5)), 4.0, 0.65)
    ridge = _cracked(graph, _bent(graph, cells, noise, 1.3), 0.34)
    tone = graph.math('MULTIPLY', ridge, graph.math('MULTIPLY_ADD', noise, 2.0, -0.15))
    return tone, graph.math('MULTIPLY_ADD', noise, 0.8, ridge)


def _plated(graph: Graph, place: Socket, scale: Socket, stretch: Socket) -> tuple[Socket, Socket]:
    """Plates with cracks between them, in thin layers."""
    cells = _stretched(graph, place, scale, stretch)
    noise = _noise(graph, graph.vector('SCALE', cells, 2.0), 4.0, 0.6)
    plate = _cracked(graph, _bent(graph, cells, noise, 0.6), 0.16)
    layers = graph.math('MULTIPLY_ADD', noise, 1.8, -0.2)
    return graph.math('MULTIPLY', plate, layers), graph.math('MULTIPLY_ADD', noise, 0.5, plate)


def _smooth(graph: Graph, place: Socket, scale: Socket, stretch: Socket) -> tuple[Socket, Socket]:
    """Skin with soft blotches and faint wrinkles across."""
    noise = _noise(graph, _stretched(graph, place, scale, stretch), 5.0, 0.65)
    return noise, noise


def _banded(graph: Graph, place: Socket, scale: Socket, stretch: Socket) -> tuple[Socket, Socket]:
    """Pale skin with dark lenses across: balls around points, cut by the cylinder, are lenses of all sizes."""
    cells = _stretched(graph, place, scale, stretch)
    noise = _noise(graph, graph.vector('SCALE', cells, 0.3), 4.0, 0.65)
    spots = graph.node("ShaderNodeTexVoronoi", {"Vector": cells, "Scale": 1.0, "Randomness": 1.0}).outputs["Distance"]
    away = graph.math('SUBTRACT', spots, graph.math('MULTIPLY', noise, 1.3))
    clear = smooth_step(graph, away, -0.5, -0.36)
    return graph.math('MULTIPLY', clear, graph.math('MULTIPLY_ADD', noise, 0.5, 0.6)), clear


def _ringed(graph: Graph, place: Socket, scale: Socket, stretch: Socket) -> tuple[Socket, Socket]:
    """Scars of fallen fronds: rings that hang unevenly, each standing out over the next, with fibres between."""
    noise = _noise(graph, _stretched(graph, place, scale, stretch), 4.0, 0.6)
    along = graph.node("ShaderNodeSeparateXYZ", {"Vector": place}).outputs["Z"]
    turn = graph.math('FRACT', graph.math('MULTIPLY_ADD', noise, 1.2, graph.math('MULTIPLY', along, 3.6)))
    scar = graph.math('MULTIPLY', smooth_step(graph, turn, 0.0, 0.2), smooth_step(graph, turn, 1.0, 0.5))
    tone = graph.math('MULTIPLY', scar, graph.math('MULTIPLY_ADD', noise, 1.6, 0.0))
    return tone, graph.math('MULTIPLY_ADD', noise, 0.3, scar)


def _jointed(graph: Graph, place: Socket, scale: Socket, stretch: Socket) -> tuple[Socket, Socket]:
    """Culms with three joints to four perimeters, and wax under each."""
    noise = _noise(graph, _stretched(graph, place, scale, stretch), 2.0, 0.6)
    along = graph.node("ShaderNodeSeparateXYZ", {"Vector": place}).outputs["Z"]
    part = graph.math('FRACT', graph.math('MULTIPLY', along, 0.75 / tau))
    joint = graph.math('MULTIPLY', smooth_step(graph, part, 0.0, 0.025), smooth_step(graph, part, 1.0, 0.995))
    wax = smooth_step(graph, part, 0.9, 1.0)
    skin = graph.math('ADD', graph.math('MULTIPLY', noise, 0.8), wax)
    return graph.math('MULTIPLY', joint, skin), joint


def _fibrous(graph: Graph, place: Socket, scale: Socket, stretch: Socket) -> tuple[Socket, Socket]:
    """Long strips that peel."""
    noise = _noise(graph, _stretched(graph, place, scale, stretch), 4.0, 0.7)
    strip = smooth_step(graph, noise, 0.3, 0.7)
    return strip, strip


_CHARACTERS: dict[str, Bark] = {
    "ridged": Bark(_ridged, 4.6, 5.5, 0.283, 1.7, (1.0, 1.0, 1.0), 0.005, 0.12, 0.7),
    "plated": Bark(_plated, 2.8, 2.5, 0.414, 1.5, (0.9, 1.05, 1.05), 0.0065, 0.2, 0.8),
    "smooth": Bark(_smooth, 3.0, 0.5, 0.5, 1.5, (1.0, 1.0, 1.0), 0.003, 0.05, 0.3),
    "banded": Bark(_banded, 4.5, 0.16, 0.787, 1.0, (1.0, 1.0, 1.0), 0.002, 0.1, 0.3),
    "ringed": Bark(_ringed, 2.2, 1.2, 0.511, 1.4, (1.0, 1.0, 1.0), 0.005, 0.2, 0.6),
    "fibrous": Bark(_fibrous, 8.0, 16.0, 0.485, 1.3, (1.0, 1.0, 1.0), 0.0045, 0.1, 0.5),
    "jointed": Bark(_jointed, 3.0, 8.0, 0.458, 0.7, (1.0, 1.0, 1.0), 0.01, 0.02, 0.08),
}

#: Characters of bark, as species name them.
BARKS = tuple(_CHARACTERS)
