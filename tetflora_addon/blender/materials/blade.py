# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf blades by nodes: veins, mottling, wear, two sides and light through the blade, from the UV map and the color.

The pattern lies in the UV map of leaf models, in leaf lengths: the midrib at u = .5, from v = 0 at the base to 1
at the tip. Numbers of each leaf are digits of its color, which varies from leaf to leaf; no mesh carries more for
it. Over a leaf and both of its sides the mean of what is reflected, and of what goes through, is that of proxies: light
lines lie in darker surroundings and the other way round.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, tan
from typing import Any

import bpy

from ...light.scattering import GLOSS, THROUGH_TINT
from .nodes import LEAF_GREEN, Graph, find_socket, shader_group, smooth_step

# Raise this when nodes or numbers change; `blade_version` then makes new materials as well.
_VERSION = 2

UNIT = (0.0, 1.0)
#: How much more than the mean of both sides a leaf's underside reflects diffusely, and the upper side less: fewer
#: pigments lie under its surface, hence most in blue. A third of what three species show (docs/species.md), because
#: spheres and shells have no sides: where leaves become proxies, light must not jump.
PALER = (0.16, 0.12, 0.3)
#: How much more than the mean of both sides the upper side mirrors: its wax is smooth, the underside hairy.
GLOSSIER = 0.1
#: How much rougher the gloss of the underside is, and the upper side's where no blade says otherwise.
HAIRY, WAXY = 0.2, 0.5
#: What of `GLOSS` is mirrored at all angles, and how much is added at a grazing one: g (a + b (1 - cos)^5), whose mean
#: over all directions is g, as the cosine-weighted mean of (1 - cos)^5 is 1/21.
_FACING, _GRAZING = 0.85, 0.15 * 21.0
#: What veins add to red, green and blue in reflected light, and when the sun is behind: they hold less chlorophyll.
_VEIN_HUE = (1.15, 1.0, 1.0)
_THROUGH_HUE = (1.3, 1.0, 0.4)
#: A step from .1 down to .02 covers .06 of the half period of veins, which is .5.
_VEIN_MEAN = 0.06 / 0.5
#: How fast veins of second order bend towards the tip, per leaf length.
_BEND = 0.9
#: Half widths at the base of the midrib and of what is darker beside it: all, and none; leaf lengths.
_RIB, _HALO = (0.003, 0.009), (0.009, 0.03)
#: Angle between the main veins of palmate blades of five lobes, degrees.
_PALM = 44.0
#: Cells of the net to a vein of second order, and the mean of its lines, measured.
_NET, _NET_MEAN = 4.5, 0.257
#: Height of the blade's undulation, leaf lengths.
_SWELL = 0.05
#: Reflected and transmitted color of dead tissue.
_DEAD, _DEAD_THROUGH = (0.12, 0.062, 0.022, 1.0), (0.07, 0.028, 0.006, 1.0)
#: Digits of a leaf's color: far enough apart for leaves of nearly the same color, and robust against rounding.
_DIGITS = (1187.0, 2039.0, 3121.0)

Socket = Any  # or None, where there is nothing


@dataclass(frozen=True)
class BladeLook:
    """How leaves of a kind look.

    Attributes
    ----------
    veins : float
        Veins of second order to a leaf's length, on either side of the midrib; 0 for none. Of parallel ones, to the
        length as well.
    angle : float
        Between them and the midrib, degrees.
    midrib, lines : float
        How much lighter midrib and veins are in reflected light.
    dark : float
        How much darker they are against the sun; negative for lighter.
    relief : float
        Height of the blade between veins, over their distance.
    mottling : float
        How uneven the colour is.
    rough : float
        Roughness of the upper side's gloss.
    wear : float
        Fraction of leaves with brown tips and spots.
    palmate : bool
        Main veins radiate from the base, each with veins of its own.
    net : bool
        Veins of third order.
    """

    veins: float
    angle: float
    midrib: float = 0.55
    lines: float = 0.3
    dark: float = 0.3
    relief: float = 0.025
    mottling: float = 0.3
    rough: float = 0.5
    wear: float = 0.05
    palmate: bool = False
    net: bool = False


BLADES: dict[str, BladeLook] = {
    "pinnate": BladeLook(veins=9.0, angle=48.0, net=True),
    "lobed": BladeLook(veins=6.0, angle=52.0, net=True),
    "palmate": BladeLook(veins=6.0, angle=48.0, palmate=True, net=True),
    "narrow": BladeLook(veins=12.0, angle=35.0, midrib=0.6, lines=0.1),
    "parallel": BladeLook(veins=60.0, angle=0.0, midrib=0.3, lines=0.12, dark=0.2, relief=0.03, wear=0.1),
    "plain": BladeLook(veins=0.0, angle=0.0),
    "needle": BladeLook(veins=0.0, angle=0.0, rough=0.4, wear=0.03),
    "petal": BladeLook(veins=14.0, angle=12.0, midrib=0.0, lines=0.06, dark=0.15, relief=0.02, rough=0.7, wear=0.0),
}
"""Kinds of blades by name; their order is part of the version of materials."""


def blade_group(kind: str) -> bpy.types.NodeTree:
    """The group "TetFlora <Kind> Leaf Blade".

    Parameters
    ----------
    kind : str
        One of `BLADES`.

    Returns
    -------
    bpy.types.NodeTree
        Inputs Colour, Leaf Length, Veins, Midrib, Vein Lines, Dark Against Light, Relief, Mottling, Wear, Paler
        Underside, Gloss, Roughness. Outputs Reflected and Through, the colors of reflected and of passing light; Gloss;
        Roughness; Normal.
    """
    blade = BLADES[kind]
    inputs = (
        ("Colour", 'Color', LEAF_GREEN, None, "Mean color"),
        ("Leaf Length", 'Float', 0.1, (0.0, 100.0), "Length of a leaf, for the relief (m)"),
        ("Veins", 'Float', blade.veins, (0.0, 5000.0), "Number of veins per leaf length"),
        ("Midrib", 'Float', blade.midrib, (0.0, 2.0), "How much lighter the midrib is"),
        ("Vein Lines", 'Float', blade.lines, UNIT, "How much lighter the veins are"),
        ("Dark Against Light", 'Float', blade.dark, (-1.0, 1.0), "How much darker veins are with light behind them"),
        ("Relief", 'Float', blade.relief, UNIT, "Height of the blade between veins, per distance of veins"),
        ("Mottling", 'Float', blade.mottling, UNIT, "Uneven color of the blade"),
        ("Wear", 'Float', blade.wear, UNIT, "Fraction of leaves with brown tips and spots"),
        ("Paler Underside", 'Float', 1.0, (0.0, 4.0)),
        ("Gloss", 'Float', GLOSS, UNIT, "Fraction of light that is reflected, mean of sides and directions"),
        ("Roughness", 'Float', blade.rough, UNIT, "Roughness of the upper side's gloss"),
    )
    outputs = (("Reflected", 'Color'), ("Through", 'Color'), ("Gloss", 'Float'), ("Roughness", 'Float'))
    outputs = (*outputs, ("Normal", 'Vector'))
    name = f"TetFlora {kind.capitalize()} Leaf Blade"
    return shader_group(name, _VERSION, inputs, outputs, lambda graph, given: _built(graph, given, blade))


def blade_version(kind: str) -> int:
    """Version of a material with that blade: another kind is another version, and the old one stays beside it."""
    return 100 * _VERSION + list(BLADES).index(kind)


def _built(graph: Graph, given: Any, blade: BladeLook) -> dict[str, Any]:
    """What the group's outputs are linked to, by name."""
    place = graph.attribute("UVMap", "Vector")
    own = graph.math('FRACT', graph.vector('DOT_PRODUCT', graph.attribute("tf_colour", "Vector"), _DIGITS))
    moved = graph.vector('ADD', place, graph.vector('SCALE', (17.0, 29.0, 0.0), own))
    geometry = graph.node("ShaderNodeNewGeometry").outputs
    side = graph.math('MULTIPLY_ADD', geometry["Backfacing"], 2.0, -1.0)  # -1 above, 1 below
    noise = _noise(graph, moved, 7.0, 2.0)
    mottled = graph.math('MULTIPLY_ADD', graph.math('SUBTRACT', noise, 0.5), given["Mottling"], 1.0)
    tone, glow, height = _venation(graph, given, blade, place)

    back, through = (_varied(graph, mottled, *line) for line in ((tone, _VEIN_HUE), (glow, _THROUGH_HUE)))
    back = graph.vector('MULTIPLY', back, paler(graph, graph.math('MULTIPLY', side, given["Paler Underside"])))
    through = graph.vector('MULTIPLY', through, tuple(THROUGH_TINT.tolist()))
    back, through = (graph.tinted(given["Colour"], colour) for colour in (back, through))
    if blade.wear:
        dead = _dead(graph, given, place, own, noise)
        back, through = (_mixed(graph, dead, *pair) for pair in ((back, _DEAD), (through, _DEAD_THROUGH)))

    return {
        "Reflected": back,
        "Through": through,
        "Gloss": sheen(graph, side, given["Gloss"]),
        "Roughness": graph.math('MULTIPLY_ADD', geometry["Backfacing"], HAIRY, given["Roughness"]),
        "Normal": _relief(graph, given, moved, height, side) if blade.relief else geometry["Normal"],
    }


def paler(graph: Graph, side: Socket) -> Socket:
    """Factors on what a side of leaves reflects: -1 is the upper one, 1 the underside, 0 the mean of both."""
    return graph.vector('ADD', graph.vector('SCALE', PALER, side), (1.0, 1.0, 1.0))


def sheen(graph: Graph, side: Socket, gloss: Any) -> Socket:
    """What a side of leaves mirrors as they are seen, from what leaves mirror on the mean."""
    facing = graph.node("ShaderNodeLayerWeight", {"Blend": 0.5}).outputs["Facing"]
    grazing = graph.math('MULTIPLY_ADD', graph.math('POWER', facing, 5.0), _GRAZING, _FACING)
    of_side = graph.math('MULTIPLY', graph.math('MULTIPLY_ADD', side, -GLOSSIER, 1.0), gloss)
    return graph.math('MULTIPLY', of_side, grazing)


def _venation(
    graph: Graph, given: Any, blade: BladeLook, place: Socket
) -> tuple[Socket | None, Socket | None, Socket | None]:
    """Tone of the lines in reflected and in passing light, 0 on average, and the height of the blade, from 0 to 1.

    None where the blade has no veins.
    """
    if not blade.veins:
        return None, None, None
    uv = graph.node("ShaderNodeSeparateXYZ", {"Vector": place}).outputs
    across, along = graph.math('SUBTRACT', uv["X"], 0.5), uv["Y"]
    aside = graph.math('ABSOLUTE', across)
    if not blade.angle:
        wave = graph.math('PINGPONG', graph.math('MULTIPLY', aside, given["Veins"]), 0.5)
        start = aside
    else:
        if blade.palmate:
            aside, along = _nearest_rib(graph, aside, along)
        # Veins leave at an angle, bend towards the tip, and alternate from left to right.
        slope = graph.math('MULTIPLY_ADD', aside, -_BEND, -1.0 / tan(radians(blade.angle)))
        start = graph.math('MULTIPLY_ADD', aside, slope, along)
        turn = graph.math('MULTIPLY', graph.math('GREATER_THAN', across, 0.0), 0.5)
        wave = graph.math('PINGPONG', graph.math('MULTIPLY_ADD', start, given["Veins"], turn), 0.5)
    vein = graph.math('SUBTRACT', smooth_step(graph, wave, 0.1, 0.02), _VEIN_MEAN)
    lines = graph.math('MULTIPLY', vein, given["Vein Lines"])
    glow = graph.math('MULTIPLY', vein, given["Dark Against Light"])
    # 4 w (1 - w) is a dome between two veins, of height 1.
    dome = graph.math('MULTIPLY', wave, graph.math('MULTIPLY_ADD', wave, -4.0, 4.0))
    if blade.midrib:
        taper = graph.math('DIVIDE', aside, graph.math('MAXIMUM', graph.math('SUBTRACT', 1.15, along), 0.15))
        rib = smooth_step(graph, taper, _RIB[1], _RIB[0])
        # The halo is wider than the rib and as much less dark as that is light, so that the mean stays.
        halo = smooth_step(graph, taper, _HALO[1], _HALO[0])
        rib = graph.math('MULTIPLY_ADD', halo, -sum(_RIB) / sum(_HALO), rib)
        lines = graph.math('MULTIPLY_ADD', rib, given["Midrib"], lines)
        glow = graph.math('MULTIPLY_ADD', graph.math('MULTIPLY', rib, 1.5), given["Dark Against Light"], glow)
    glow = graph.math('MULTIPLY', glow, -1.0)
    if blade.net:
        cells = {"Vector": place, "Scale": graph.math('MULTIPLY', given["Veins"], _NET), "Randomness": 0.9}
        edge = graph.node("ShaderNodeTexVoronoi", cells, feature='DISTANCE_TO_EDGE', voronoi_dimensions='2D')
        net = graph.math('SUBTRACT', smooth_step(graph, edge.outputs["Distance"], 0.12, 0.02), _NET_MEAN)
        net = graph.math('MULTIPLY', net, given["Vein Lines"])
        lines, glow = (graph.math('MULTIPLY_ADD', net, by, tone) for by, tone in ((0.35, lines), (0.5, glow)))
    blade_only = graph.math('GREATER_THAN', uv["Y"], 0.0)  # petioles lie below 0 in the UV map
    lines, glow = (graph.math('MULTIPLY', tone, blade_only) for tone in (lines, glow))
    return lines, glow, dome


def _nearest_rib(graph: Graph, aside: Socket, along: Socket) -> tuple[Socket, Socket]:
    """Places across and along the nearest of five main veins that leave the base at angles of 0, 44 and 88 degrees."""
    place = graph.node("ShaderNodeCombineXYZ", {"X": aside, "Y": along}).outputs["Vector"]
    half = radians(_PALM / 2)
    # Mirrored at the line halfway between two ribs, as often as there are others: no angles, which cost twice as much.
    across = (cos(half), -sin(half), 0.0)
    for last in (False, True):
        beyond = graph.math('MAXIMUM', graph.vector('DOT_PRODUCT', place, across), 0.0)
        away = graph.vector('SCALE', tuple(-2.0 * value for value in across), beyond)
        place = graph.vector('ADD', place, away)
        if not last:
            place = graph.vector('ABSOLUTE', place)
    folded = graph.node("ShaderNodeSeparateXYZ", {"Vector": place}).outputs
    return graph.math('ABSOLUTE', folded["X"]), folded["Y"]


def _varied(graph: Graph, mottled: Socket, tone: Socket, hue: tuple[float, float, float]) -> Socket:
    """Factors on colours: mottling, and a tone times a hue."""
    grey = graph.node("ShaderNodeCombineXYZ", {"X": mottled, "Y": mottled, "Z": mottled})
    return grey if tone is None else graph.vector('ADD', grey, graph.vector('SCALE', hue, tone))


def _dead(graph: Graph, given: Any, place: Socket, own: Socket, noise: Socket) -> Socket:
    """Share of dead tissue: none on most leaves; on a few the tip, the ends of lobes, and spots."""
    worn = graph.math('SUBTRACT', own, graph.math('SUBTRACT', 1.0, given["Wear"]))
    worn = graph.math('DIVIDE', worn, graph.math('MAXIMUM', given["Wear"], 1e-3))
    away = graph.vector('DISTANCE', place, (0.5, 0.4, 0.0))
    field = graph.math('MULTIPLY_ADD', noise, 0.7, away)
    rim = graph.math('MULTIPLY_ADD', worn, 0.18, field)
    spot = graph.math('MULTIPLY_ADD', noise, 1.6, -0.2)
    edge = smooth_step(graph, graph.math('MAXIMUM', rim, spot), 0.93, 1.0)
    return graph.math('MULTIPLY', edge, smooth_step(graph, worn, 0.0, 0.05))


def _mixed(graph: Graph, factor: Socket, first: Socket, second: Any) -> Socket:
    """Mix two colours."""
    inputs = {"Factor_Float": factor, "A_Color": first, "B_Color": second}
    return find_socket(graph.node("ShaderNodeMix", inputs, data_type='RGBA').outputs, "Result_Color")


def _relief(graph: Graph, given: Any, place: Socket, dome: Socket, side: Socket) -> Socket:
    """Normal of a blade that swells between its veins and undulates; a groove above is a ridge below."""
    swell = _noise(graph, place, 2.2, 0.0)
    height = graph.math('MULTIPLY', swell, _SWELL)
    if dome is not None:
        deep = graph.math('DIVIDE', given["Relief"], graph.math('MAXIMUM', given["Veins"], 1.0))
        height = graph.math('MULTIPLY_ADD', dome, deep, height)
    height = graph.math('MULTIPLY', height, graph.math('MULTIPLY', side, -1.0))
    return graph.node("ShaderNodeBump", {"Strength": 1.0, "Distance": given["Leaf Length"], "Height": height})


def _noise(graph: Graph, place: Socket, scale: float, detail: float) -> Socket:
    """Noise over the leaf from 0 to 1, .5 on average."""
    inputs = {"Vector": place, "Scale": scale, "Detail": detail, "Roughness": 0.6}
    return find_socket(graph.node("ShaderNodeTexNoise", inputs, noise_dimensions='2D').outputs, "Fac")
