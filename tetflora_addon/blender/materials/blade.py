# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf blades by nodes: veins, mottling, wear, two sides and light through the blade, from the UV map and the color.

The pattern lies in the UV map of leaf models, in leaf lengths: the midrib at u = .5, from v = 0 at the base to 1
at the tip. Numbers of each leaf are digits of its color, which varies from leaf to leaf; no mesh carries more for
it. Over a leaf and both of its sides the mean of what is reflected, and of what goes through, is that of proxies: light
lines lie in darker surroundings and the other way round.
"""

from dataclasses import dataclass
from math import cos, radians, sin, tan
from typing import Any

import bpy

from ...optics import FACING, GLOSS, HAIRY, PALER, THROUGH_TINT
from .nodes import LEAF_GREEN, Graph, Term, node_group

# Raise this when nodes or numbers change; `blade_version` then makes new materials as well.
_VERSION = 4

UNIT = (0.0, 1.0)
#: How much more than the mean of both sides the upper side mirrors: its wax is smooth, the underside hairy.
GLOSSIER = 0.1
#: Roughness of the upper side's gloss where no blade says otherwise.
WAXY = 0.5
#: How much of `GLOSS` is added at a grazing angle: g (a + b (1 - cos)^5), whose mean over all directions is g, as the
#: cosine-weighted mean of (1 - cos)^5 is 1/21.
_GRAZING = (1.0 - FACING) * 21.0
#: What veins add to red, green and blue in reflected light, and when the sun is behind: they hold less chlorophyll.
_VEIN_HUE = (1.15, 1.0, 1.0)
_THROUGH_HUE = (1.3, 1.0, 0.4)
#: A step from .1 down to .02 covers .06 of the half period of veins, which is .5.
_VEIN_MEAN = 0.06 / 0.5
#: How fast veins of second order bend toward the tip, per leaf length.
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


@dataclass(frozen=True)
class BladeLook:
    """How leaves of a kind look."""

    #: Veins of second order to a leaf's length, on either side of the midrib, or parallel ones; 0 for none.
    veins: float
    angle: float  # between them and the midrib, degrees
    #: midrib, lines: How much lighter midrib and veins are in reflected light
    midrib: float = 0.55
    lines: float = 0.3
    dark: float = 0.3  # how much darker they are against the sun; negative for lighter
    relief: float = 0.025  # height of the blade between veins, over their distance
    mottling: float = 0.3  # how uneven the color is
    rough: float = 0.5  # roughness of the upper side's gloss
    wear: float = 0.05  # fraction of leaves with brown tips and spots
    palmate: bool = False  # main veins radiate from the base, each with veins of its own
    net: bool = False  # veins of third order


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

    Returns
    -------
    bpy.types.NodeTree
        Inputs Color, Leaf Length, Veins, Midrib, Vein Lines, Dark Against Light, Relief, Mottling, Wear, Paler
        Underside, Gloss, Roughness. Outputs Reflected and Through, colors of light; Gloss; Roughness; Normal.
    """
    blade = BLADES[kind]
    inputs = (
        ("Color", 'Color', LEAF_GREEN, None, "Mean color"),
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
    return node_group(name, _VERSION, inputs, outputs, lambda graph, given: _built(graph, given, name, blade))


def blade_version(kind: str) -> int:
    """Version of a material with that blade: another kind is another version, and the old one stays beside it."""
    return 100 * _VERSION + list(BLADES).index(kind)


def _built(graph: Graph, given: dict[str, Term], name: str, blade: BladeLook) -> dict[str, Any]:
    """What the group's outputs are linked to, by name."""
    place = graph.attribute("UVMap", "Vector")
    chance = graph.math('FRACT', graph.vector('DOT_PRODUCT', graph.attribute("tf_color", "Vector"), _DIGITS))
    moved = place + (17.0, 29.0, 0.0) * chance
    geometry = graph.outputs("ShaderNodeNewGeometry")
    side = geometry["Backfacing"] * 2.0 + -1.0  # -1 above, 1 below
    noise = _noise(graph, moved, 7.0, 2.0)
    mottled = (noise - 0.5) * given["Mottling"] + 1.0
    tone = glow = height = None
    if blade.veins:
        asked = {"Place": place} | {key: given[key] for key in ("Veins", "Midrib", "Vein Lines", "Dark Against Light")}
        outputs = [(output, 'Float') for output in ("Tone", "Glow", "Height")]
        veins = graph.part(f"{name} Veins", _VERSION, asked, outputs, lambda *group: _venation(*group, blade))
        tone, glow, height = (veins[output] for output, _ in outputs)

    back, through = (_varied(graph, mottled, *line) for line in ((tone, _VEIN_HUE), (glow, _THROUGH_HUE)))
    back = back * paler(side * given["Paler Underside"])
    back, through = (graph.tinted(given["Color"], color) for color in (back, through * tuple(THROUGH_TINT.tolist())))
    if blade.wear:
        dead = _dead(graph, given, place, chance, noise)
        back, through = (graph.mixed(dead, *pair) for pair in ((back, _DEAD), (through, _DEAD_THROUGH)))

    return {
        "Reflected": back,
        "Through": through,
        "Gloss": sheen(graph, side, given["Gloss"]),
        "Roughness": geometry["Backfacing"] * HAIRY + given["Roughness"],
        "Normal": _relief(graph, given, moved, height, side) if blade.relief else geometry["Normal"],
    }


def paler(side: Term) -> Term:
    """Factors on what a side of leaves reflects: -1 is the upper one, 1 the underside, 0 the mean of both."""
    return PALER * side + (1.0, 1.0, 1.0)


def sheen(graph: Graph, side: Term, gloss: Term) -> Term:
    """What a side of leaves mirrors as they are seen, from what leaves mirror on the mean."""
    facing = graph.outputs("ShaderNodeLayerWeight", {"Blend": 0.5})["Facing"]
    return (side * -GLOSSIER + 1.0) * gloss * (facing**5.0 * _GRAZING + FACING)


def _venation(graph: Graph, given: dict[str, Term], blade: BladeLook) -> dict[str, Term]:
    """Tone of the lines in reflected and in passing light, 0 on average, and the height of the blade, from 0 to 1."""
    place = given["Place"]
    u, v, _ = graph.parts(place)
    across, along = u - 0.5, v
    aside = abs(across)
    if not blade.angle:
        wave = graph.math('PINGPONG', aside * given["Veins"], 0.5)
    else:
        if blade.palmate:
            aside, along = _nearest_rib(graph, aside, along)
        # Veins leave at an angle, bend toward the tip, and alternate from left to right.
        start = aside * (aside * -_BEND + -1.0 / tan(radians(blade.angle))) + along
        wave = graph.math('PINGPONG', start * given["Veins"] + (across > 0.0) * 0.5, 0.5)
    vein = graph.step(wave, 0.1, 0.02) - _VEIN_MEAN
    lines, glow = vein * given["Vein Lines"], vein * given["Dark Against Light"]
    # 4 w (1 - w) is a dome between two veins, of height 1.
    dome = wave * (wave * -4.0 + 4.0)
    if blade.midrib:
        taper = aside / graph.math('MAXIMUM', 1.15 - along, 0.15)
        # The halo is wider than the rib and as much less dark as that is light, so that the mean stays.
        halo = graph.step(taper, _HALO[1], _HALO[0])
        rib = halo * (-sum(_RIB) / sum(_HALO)) + graph.step(taper, _RIB[1], _RIB[0])
        lines = rib * given["Midrib"] + lines
        glow = rib * 1.5 * given["Dark Against Light"] + glow
    glow = -glow
    if blade.net:
        cells = {"Vector": place, "Scale": given["Veins"] * _NET, "Randomness": 0.9}
        edge = graph.outputs("ShaderNodeTexVoronoi", cells, feature='DISTANCE_TO_EDGE', voronoi_dimensions='2D')
        net = (graph.step(edge["Distance"], 0.12, 0.02) - _NET_MEAN) * given["Vein Lines"]
        lines, glow = net * 0.35 + lines, net * 0.5 + glow
    blade_only = v > 0.0  # petioles lie below 0 in the UV map
    return {"Tone": lines * blade_only, "Glow": glow * blade_only, "Height": dome}


def _nearest_rib(graph: Graph, aside: Term, along: Term) -> tuple[Term, Term]:
    """Places across and along the nearest of five main veins that leave the base at angles of 0, 44 and 88 degrees."""
    place = graph.xyz(aside, along)
    half = radians(_PALM / 2)
    # Mirrored at the line halfway between two ribs, as often as there are others: no angles, which cost twice as much.
    across = (cos(half), -sin(half), 0.0)
    for last in (False, True):
        beyond = graph.math('MAXIMUM', graph.vector('DOT_PRODUCT', place, across), 0.0)
        place = place + tuple(-2.0 * value for value in across) * beyond
        place = place if last else abs(place)
    u, v, _ = graph.parts(place)
    return abs(u), v


def _varied(graph: Graph, mottled: Term, tone: Term | None, hue: tuple[float, float, float]) -> Term:
    """Factors on colors: mottling, and a tone times a hue."""
    gray = graph.xyz(mottled, mottled, mottled)
    return gray if tone is None else gray + hue * tone


def _dead(graph: Graph, given: dict[str, Term], place: Term, chance: Term, noise: Term) -> Term:
    """Share of dead tissue: none on most leaves; on a few the tip, the ends of lobes, and spots."""
    worn = (chance - (1.0 - given["Wear"])) / graph.math('MAXIMUM', given["Wear"], 1e-3)
    rim = worn * 0.18 + (noise * 0.7 + graph.vector('DISTANCE', place, (0.5, 0.4, 0.0)))
    return graph.step(graph.math('MAXIMUM', rim, noise * 1.6 + -0.2), 0.93, 1.0) * graph.step(worn, 0.0, 0.05)


def _relief(graph: Graph, given: dict[str, Term], place: Term, dome: Term | None, side: Term) -> bpy.types.Node:
    """Normal of a blade that swells between its veins and undulates; a groove above is a ridge below."""
    height = _noise(graph, place, 2.2, 0.0) * _SWELL
    if dome is not None:
        height = dome * (given["Relief"] / graph.math('MAXIMUM', given["Veins"], 1.0)) + height
    return graph.node("ShaderNodeBump", {"Strength": 1.0, "Distance": given["Leaf Length"], "Height": height * -side})


def _noise(graph: Graph, place: Term, scale: float, detail: float) -> Term:
    return graph.noise(place, detail, 0.6, scale, noise_dimensions='2D')[0]
