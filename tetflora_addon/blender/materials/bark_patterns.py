# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Patterns of bark: what grows, cracks, peels and heals on a cylinder of radius 1.

Each gives factors of the colour, whose mean `bark` measures and takes out, and a height in widths of a feature.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tau
from typing import Any

#: `nodes.Graph`, and a socket of it or a value: patterns know only their methods.
Graph = Socket = Any
Tones = tuple[tuple[float, tuple[float, float, float]], ...]


@dataclass(frozen=True)
class Place:
    """Where on a branch a point lies, as sockets.

    Attributes
    ----------
    round : Vector
        On the cylinder of radius 1, moved by the branch's colour.
    cells : Vector
        The same in features: their widths around the branch, their lengths along it.
    turn, along : Float
        Turns around the branch, and radii along it from its base.
    scale, stretch : Float
        Features to a radius, and their length over their width.
    """

    round: Socket
    cells: Socket
    turn: Socket
    along: Socket
    scale: Socket
    stretch: Socket


def _times(graph: Graph, place: Socket, x: float, z: float) -> Socket:
    return graph.vector('MULTIPLY', place, (x, x, z))


def _bent(graph: Graph, place: Socket, noise: Socket, amount: float, along: float = 1.0) -> Socket:
    """Places moved by three numbers around .5."""
    return graph.vector('ADD', place, graph.vector('MULTIPLY', noise, (amount, amount, amount * along)))


def _edges(graph: Graph, place: Socket) -> Socket:
    """Distance to the nearest border between cells."""
    inputs = {"Vector": place, "Scale": 1.0, "Randomness": 1.0}
    return graph.node("ShaderNodeTexVoronoi", inputs, feature='DISTANCE_TO_EDGE').outputs["Distance"]


def _cells(graph: Graph, place: Socket, metric: str = 'EUCLIDEAN') -> tuple[Socket, Socket]:
    """Distance to the middle of the nearest cell, and three random numbers of that cell."""
    inputs = {"Vector": place, "Scale": 1.0, "Randomness": 1.0}
    outputs = graph.node("ShaderNodeTexVoronoi", inputs, feature='F1', distance=metric).outputs
    return outputs["Distance"], outputs["Color"]


def _tones(graph: Graph, value: Socket, tones: Tones) -> Socket:
    """Colours between stops."""
    node = graph.node("ShaderNodeValToRGB", {"Fac": value})
    ramp = node.color_ramp.elements
    while len(ramp) < len(tones):
        ramp.new(0.5)
    for element, (position, colour) in zip(ramp, tones, strict=True):
        element.position, element.color = position, (*colour, 1.0)
    return node.outputs["Color"]


def _lens(graph: Graph, place: Place, x: float, z: float, low: float, high: float, noise: Socket) -> Socket:
    """1 in lenses that lie across: balls around points, cut by the cylinder, of all sizes."""
    where = _bent(graph, _times(graph, place.round, x, z), noise, 0.35)
    return graph.step(_cells(graph, where)[0], high, low)


def _scars(graph: Graph, place: Place, noise: Socket, scale: float, size: float) -> Socket:
    """From 0 to 1 in diamonds where branches were: sections of octahedra, wider than high."""
    where = _bent(graph, _times(graph, place.round, scale, 1.7 * scale), noise, 0.3)
    return graph.step(_cells(graph, where, 'MANHATTAN')[0], size, 0.55 * size)


def ridged(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Ridges that part and meet, deep fissures between them, and cracks across."""
    wave = graph.noise(_times(graph, place.cells, 0.45, 0.9), 1.0, 0.5)[1]
    bent = _bent(graph, place.cells, wave, 2.2, 0.6)
    grain = graph.noise(_times(graph, bent, 1.6, 5.0), 3.0, 0.68)[0]
    distance = graph.math('MULTIPLY_ADD', grain, 0.16, _edges(graph, bent))
    ridge = graph.step(distance, 0.09, 0.36)
    across = _edges(graph, _bent(graph, _times(graph, bent, 0.8, 2.6), wave, 1.0))
    across = graph.step(graph.math('MULTIPLY_ADD', grain, 0.2, across), 0.08, 0.2)
    # Cracks across are in the color alone: nodes of the height are worked out three times.
    height = graph.math('MULTIPLY_ADD', grain, 0.75, graph.math('MULTIPLY_ADD', ridge, 0.95, -0.05))
    cracked = graph.math('MULTIPLY', ridge, graph.math('MULTIPLY_ADD', across, 0.6, 0.4))
    tone = graph.math('MULTIPLY_ADD', grain, 0.75, graph.math('MULTIPLY_ADD', cracked, 0.95, -0.05))
    tones = (0.2, (0.1, 0.085, 0.07)), (0.55, (0.4, 0.35, 0.29)), (0.9, (0.66, 0.62, 0.55)), (1.0, (0.8, 0.79, 0.74))
    return _tones(graph, graph.math('MULTIPLY', tone, 0.75), tones), height


def plated(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Plates of flakes that lie in layers, each its own red-brown or grey, with dark fissures between."""
    noise, wave = graph.noise(_times(graph, place.cells, 1.1, 1.4), 4.0, 0.6)
    bent = _bent(graph, place.cells, wave, 0.75, 0.8)
    shade = graph.node("ShaderNodeSeparateXYZ", {"Vector": _cells(graph, bent)[1]}).outputs
    plate = graph.step(graph.math('MULTIPLY_ADD', noise, 0.22, _edges(graph, bent)), 0.1, 0.23)
    # Flakes end along lines of equal height of a noise: steps, worn a little.
    layer = graph.math('MULTIPLY', graph.math('ADD', noise, shade["X"]), 7.0)
    part = graph.math('FRACT', layer)
    stair = graph.math('ADD', graph.math('FLOOR', layer), graph.step(part, 0.0, 0.15))
    fine = graph.noise(_times(graph, bent, 3.0, 6.0), 3.0, 0.7)[0]
    height = graph.math('MULTIPLY_ADD', stair, 0.13, graph.math('MULTIPLY_ADD', fine, 0.25, plate))
    lit = graph.math('MULTIPLY_ADD', fine, 0.55, graph.math('MULTIPLY_ADD', shade["Y"], 0.55, part))
    tones = (0.1, (0.16, 0.1, 0.08)), (0.5, (0.44, 0.28, 0.21)), (0.8, (0.72, 0.44, 0.31)), (1.0, (1.0, 0.55, 0.32))
    colour = _tones(graph, graph.math('MULTIPLY', lit, 0.58), tones)
    grey = _tones(graph, graph.math('MULTIPLY', lit, 0.58), ((0.1, (0.2, 0.16, 0.15)), (0.9, (0.72, 0.62, 0.56))))
    colour = graph.mixed(graph.step(shade["Z"], 0.55, 0.95), colour, grey)
    return graph.mixed(plate, (0.07, 0.045, 0.04), colour), height


def scaly(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Small round scales that lift at their borders and lie over each other."""
    noise, wave = graph.noise(_times(graph, place.cells, 0.8, 0.8), 5.0, 0.68)
    bent = _bent(graph, place.cells, wave, 1.1)
    middle, random = _cells(graph, bent)
    shade = graph.node("ShaderNodeSeparateXYZ", {"Vector": random}).outputs
    scale = graph.step(graph.math('MULTIPLY_ADD', noise, 0.16, _edges(graph, bent)), 0.055, 0.14)
    height = graph.math('MULTIPLY_ADD', shade["X"], 1.2, graph.math('MULTIPLY_ADD', middle, 0.9, scale))
    height = graph.math('MULTIPLY_ADD', noise, 0.9, height)
    tone = graph.math('MULTIPLY_ADD', shade["Y"], 0.4, graph.math('MULTIPLY_ADD', middle, 0.25, noise))
    tone = graph.math('MULTIPLY', tone, graph.math('MULTIPLY_ADD', scale, 0.55, 0.45))
    tones = (0.2, (0.18, 0.14, 0.125)), (0.6, (0.5, 0.41, 0.36)), (0.85, (0.72, 0.64, 0.57)), (1.0, (0.95, 0.9, 0.85))
    return _tones(graph, tone, tones), height


def netted(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """A net of strips: two families of waves run up around the branch, and fissures lie in their diamonds."""
    wave = graph.noise(_times(graph, place.cells, 0.5, 0.9), 2.0, 0.5)[1]
    around = graph.math('ROUND', graph.math('MULTIPLY', place.scale, 0.62 * tau))
    slope = graph.math(
        'DIVIDE', graph.math('MULTIPLY', place.scale, 0.62 * tau), graph.math('MULTIPLY', place.stretch, tau)
    )
    bend = graph.node("ShaderNodeSeparateXYZ", {"Vector": wave}).outputs
    strips = []
    for sign, name in ((1.0, "X"), (-1.0, "Y")):
        phase = graph.math('MULTIPLY', graph.math('MULTIPLY', place.along, slope), sign)
        phase = graph.math('MULTIPLY_ADD', place.turn, around, phase)
        phase = graph.math('MULTIPLY_ADD', bend[name], 4.5, phase)
        strips.append(graph.math('ABSOLUTE', graph.math('SINE', graph.math('MULTIPLY', phase, tau / 2))))
    net = graph.math('MINIMUM', *strips)
    grain = graph.noise(_times(graph, _bent(graph, place.cells, wave, 1.5), 3.0, 4.0), 4.0, 0.7)[0]
    strip = graph.step(graph.math('MULTIPLY_ADD', grain, 0.5, net), 0.28, 0.95)
    height = graph.math('MULTIPLY_ADD', grain, 0.6, strip)
    tones = (0.15, (0.12, 0.095, 0.08)), (0.5, (0.42, 0.35, 0.28)), (0.8, (0.7, 0.62, 0.52)), (1.0, (0.95, 0.9, 0.82))
    return _tones(graph, graph.math('MULTIPLY', height, 0.72), tones), height


def smooth(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Grey skin with pale and dark blotches, faint lines across, small warts, and eyes where branches were."""
    noise, wave = graph.noise(_times(graph, place.round, 1.3, 1.1), 5.0, 0.65)
    lines = graph.noise(graph.vector('MULTIPLY', place.cells, (0.5, 0.5, 1.6)), 4.0, 0.75)[0]
    warts = graph.step(_cells(graph, _times(graph, place.round, 13.0, 30.0))[0], 0.26, 0.1)
    eye = _lens(graph, place, 0.8, 1.5, 0.14, 0.36, wave)
    lid = graph.math('SINE', graph.math('MULTIPLY', eye, 9.0))
    lid = graph.math('MULTIPLY', lid, graph.step(eye, 0.0, 0.15))
    tone = graph.math('MULTIPLY_ADD', lines, 0.4, graph.math('MULTIPLY', noise, 0.9))
    tone = graph.math('MULTIPLY_ADD', warts, -0.05, tone)
    tone = graph.math('MULTIPLY_ADD', eye, -0.13, graph.math('MULTIPLY_ADD', lid, -0.05, tone))
    height = graph.math('MULTIPLY_ADD', lines, 1.3, graph.math('MULTIPLY', warts, 0.25))
    height = graph.math('MULTIPLY_ADD', lid, -0.22, graph.math('MULTIPLY_ADD', noise, 0.9, height))
    tones = (0.25, (0.14, 0.135, 0.12)), (0.5, (0.42, 0.42, 0.39)), (0.68, (0.56, 0.57, 0.54)), (0.9, (0.9, 0.93, 0.88))
    return _tones(graph, tone, tones), height


def banded(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Satin skin with lenticels in rings, like a cherry's, and curls of skin between."""
    noise, wave = graph.noise(_times(graph, place.cells, 0.4, 0.35), 4.0, 0.6)
    row = graph.step(graph.noise(_times(graph, place.cells, 0.08, 0.45), 2.0, 0.5)[0], 0.45, 0.6)
    size = graph.math('MULTIPLY_ADD', row, 0.42, 0.06)
    where = _bent(graph, place.cells, wave, 0.4)
    ray = graph.step(_cells(graph, where)[0], size, graph.math('MULTIPLY', size, 0.6))
    skin = graph.noise(_times(graph, place.cells, 0.5, 3.0), 3.0, 0.6)[0]
    height = graph.math('MULTIPLY_ADD', ray, 0.8, graph.math('MULTIPLY', skin, 0.5))
    tone = graph.math('MULTIPLY_ADD', skin, 0.4, graph.math('MULTIPLY', noise, 0.8))
    tones = (0.3, (0.36, 0.33, 0.32)), (0.6, (0.66, 0.64, 0.62)), (0.85, (0.95, 0.95, 0.95))
    return graph.mixed(ray, _tones(graph, tone, tones), (0.26, 0.2, 0.15)), height


def peeling(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """White skin with fine lenticels and dark dashes, torn in sheets across, and black diamonds where branches were."""
    noise, wave = graph.noise(_times(graph, place.cells, 0.22, 0.5), 5.0, 0.6)
    sheet = graph.noise(_times(graph, place.round, 0.55, 2.2), 5.0, 0.62)[0]
    torn = graph.step(sheet, 0.585, 0.6)
    edge = graph.math('MULTIPLY', torn, graph.step(sheet, 0.625, 0.6))
    dots = graph.step(_cells(graph, _bent(graph, place.cells, wave, 0.3))[0], 0.3, 0.2)
    dashes = _lens(graph, place, 1.5, 9.0, 0.24, 0.36, wave)
    scar = graph.math('MAXIMUM', _scars(graph, place, wave, 0.75, 0.42), graph.math('MULTIPLY', dashes, 0.85))
    # The foot of an old stem is black and furrowed, higher up in some places than in others.
    foot = graph.math('MULTIPLY_ADD', sheet, 14.0, graph.math('MULTIPLY', place.along, -1.0))
    scar = graph.math('MAXIMUM', scar, graph.step(foot, 2.5, 5.5))
    skin = graph.math('MULTIPLY_ADD', noise, 0.5, 0.45)
    skin = graph.math('MULTIPLY_ADD', dots, -0.3, skin)
    white = _tones(graph, skin, ((0.1, (0.32, 0.3, 0.28)), (0.6, (0.86, 0.85, 0.83)), (0.85, (1.0, 1.0, 1.0))))
    under = _tones(graph, skin, ((0.1, (0.3, 0.25, 0.22)), (0.6, (0.7, 0.66, 0.62)), (0.85, (0.85, 0.79, 0.73))))
    colour = graph.mixed(graph.math('MULTIPLY', edge, 0.6), graph.mixed(torn, white, under), (0.2, 0.17, 0.15))
    rough = graph.noise(_times(graph, place.round, 9.0, 4.0), 4.0, 0.7)[0]
    black = _tones(graph, rough, ((0.35, (0.03, 0.03, 0.028)), (0.7, (0.2, 0.18, 0.155))))
    height = graph.math('MULTIPLY_ADD', scar, graph.math('MULTIPLY', rough, 2.4), graph.math('MULTIPLY', skin, 0.35))
    height = graph.math('MULTIPLY_ADD', torn, -0.35, height)
    return graph.mixed(scar, colour, black), height


def _greys(graph: Graph, tone: Socket) -> Socket:
    """The same factor for all three colours."""
    return graph.node("ShaderNodeCombineXYZ", dict.fromkeys("XYZ", tone)).outputs[0]


def ringed(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Scars of fallen fronds: rings that hang unevenly, each standing out over the next, with fibres between."""
    noise = graph.noise(place.cells, 4.0, 0.6)[0]
    along = graph.node("ShaderNodeSeparateXYZ", {"Vector": place.round}).outputs["Z"]
    turn = graph.math('FRACT', graph.math('MULTIPLY_ADD', noise, 1.2, graph.math('MULTIPLY', along, 3.6)))
    scar = graph.math('MULTIPLY', graph.step(turn, 0.0, 0.2), graph.step(turn, 1.0, 0.5))
    tone = graph.math('MULTIPLY', scar, graph.math('MULTIPLY_ADD', noise, 1.6, 0.0))
    return _greys(graph, tone), graph.math('MULTIPLY_ADD', noise, 0.3, scar)


def jointed(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Culms with three joints to four perimeters, and wax under each."""
    noise = graph.noise(place.cells, 2.0, 0.6)[0]
    along = graph.node("ShaderNodeSeparateXYZ", {"Vector": place.round}).outputs["Z"]
    part = graph.math('FRACT', graph.math('MULTIPLY', along, 0.75 / tau))
    joint = graph.math('MULTIPLY', graph.step(part, 0.0, 0.025), graph.step(part, 1.0, 0.995))
    wax = graph.step(part, 0.9, 1.0)
    skin = graph.math('ADD', graph.math('MULTIPLY', noise, 0.8), wax)
    return _greys(graph, graph.math('MULTIPLY', joint, skin)), joint


def fibrous(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Long strips that peel."""
    noise, wave = graph.noise(_times(graph, place.cells, 0.5, 0.8), 2.0, 0.6)
    strip = graph.noise(_bent(graph, place.cells, wave, 1.6), 5.0, 0.7)[0]
    raised = graph.step(strip, 0.38, 0.6)
    tone = graph.math('MULTIPLY_ADD', noise, 0.5, graph.math('MULTIPLY', raised, 0.6))
    tones = (0.2, (0.16, 0.12, 0.1)), (0.55, (0.5, 0.42, 0.36)), (0.85, (0.85, 0.8, 0.74))
    return _tones(graph, tone, tones), graph.math('MULTIPLY_ADD', strip, 1.2, raised)
