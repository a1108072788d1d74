# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Patterns of rough bark: what cracks, flakes and peels on a cylinder of radius 1.

Each gives factors of the colour, whose mean `bark` measures and takes out, and a height in widths of a feature.
"""

from __future__ import annotations

from math import tau

from .bark_tools import Graph, Place, Socket, Tones, around, aside, bent, cell, knot, lips, parts, times, tones

# How large the eye of a knot may be, in radii of the branch.
_EYE, _TWIG = 0.24, 0.15
# Tones of thin skin, on average those of plates; what makes it orange, as light as it was.
_PAPER = (0.2, 0.15, 0.125), (0.32, 0.24, 0.2), (0.52, 0.385, 0.32)
_ORANGE = (1.42, 0.93, 0.55)
_RED: Tones = (
    (0.15, (0.13, 0.085, 0.07)), (0.45, (0.36, 0.235, 0.18)), (0.7, (0.58, 0.39, 0.29)), (0.95, (0.9, 0.6, 0.42)),
)  # fmt: skip
_BLACK = (0.05, 0.04, 0.035)
_OAK: Tones = (
    (0.1, (0.06, 0.053, 0.043)), (0.45, (0.33, 0.295, 0.24)), (0.75, (0.6, 0.56, 0.48)), (1.0, (0.86, 0.84, 0.77)),
)  # fmt: skip
_ASH: Tones = (
    (0.1, (0.085, 0.075, 0.06)), (0.45, (0.33, 0.3, 0.25)), (0.75, (0.6, 0.57, 0.5)), (1.0, (0.86, 0.84, 0.77)),
)  # fmt: skip
_WILLOW: Tones = (
    (0.1, (0.13, 0.1, 0.08)), (0.45, (0.42, 0.35, 0.29)), (0.75, (0.66, 0.59, 0.52)), (1.0, (0.92, 0.86, 0.79)),
)  # fmt: skip


def ridged(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Ridges that part and meet, broken by cracks across every width or three, with deep fissures between them."""
    wave = graph.noise(times(graph, place.cells, 0.35, 0.9), 1.0, 0.5)[1]
    eye = knot(graph, place, _EYE, wave)
    where = bent(graph, around(graph, place, eye, _EYE), wave, 2.0, 0.45)
    strip = cell(graph, where)
    grain = graph.noise(times(graph, bent(graph, place.cells, wave, 1.2), 2.6, 9.0), 3.0, 0.7)[0]
    # Fissures are wide in some places and close in others.
    distance = graph.math('MULTIPLY_ADD', parts(graph, wave)[2], 0.22, strip.border)
    distance = graph.math('MULTIPLY_ADD', grain, 0.2, distance)
    ridge = graph.step(distance, 0.22, 0.45)
    # Cracks across: every strip has its own, some deep and some hardly there.
    turn = graph.math('MULTIPLY_ADD', parts(graph, where)[2], 3.4, graph.math('MULTIPLY', strip.random[0], 9.0))
    turn = graph.math('MULTIPLY_ADD', parts(graph, wave)[0], 2.2, graph.math('MULTIPLY_ADD', grain, 0.7, turn))
    crack = graph.math('ABSOLUTE', graph.math('SUBTRACT', graph.math('FRACT', turn), 0.5))
    deep = graph.math('FRACT', graph.math('MULTIPLY_ADD', graph.math('FLOOR', turn), 0.618, strip.random[1]))
    crack = graph.math('MULTIPLY', graph.step(crack, 0.14, 0.03), graph.step(deep, 0.15, 0.6))
    ridge = graph.math('MULTIPLY', ridge, graph.math('MULTIPLY_ADD', crack, -0.6, 1.0))
    ring, hollow = lips(graph, eye)
    height = graph.math('MULTIPLY_ADD', grain, 0.9, ridge)
    height = graph.math('MULTIPLY_ADD', ring, 1.6, graph.math('MULTIPLY_ADD', hollow, -2.0, height))
    tone = graph.math('MULTIPLY_ADD', ridge, 0.45, graph.math('MULTIPLY_ADD', grain, 0.9, -0.16))
    tone = graph.math('MULTIPLY_ADD', strip.random[2], 0.12, tone)
    return graph.mixed(hollow, tones(graph, tone, _OAK), _BLACK), height


def interlaced(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Short narrow strips that lie over each other like laths, with thin cracks between."""
    wave = graph.noise(times(graph, place.cells, 0.45, 1.2), 1.0, 0.5)[1]
    eye = knot(graph, place, _EYE, wave)
    where = bent(graph, around(graph, place, eye, _EYE), wave, 2.2, 0.4)
    strip = cell(graph, where)
    grain = graph.noise(times(graph, bent(graph, place.cells, wave, 1.2), 1.9, 6.0), 3.0, 0.7)[0]
    distance = graph.math('MULTIPLY_ADD', grain, 0.22, strip.border)
    lath = graph.step(distance, 0.1, 0.22)
    ring, hollow = lips(graph, eye)
    level = graph.math('MULTIPLY_ADD', strip.random[0], 0.75, graph.math('MULTIPLY', grain, 0.9))
    height = graph.math('MULTIPLY_ADD', lath, 0.6, level)
    height = graph.math('MULTIPLY_ADD', ring, 1.8, graph.math('MULTIPLY_ADD', hollow, -2.0, height))
    tone = graph.math('MULTIPLY_ADD', strip.random[0], 0.34, graph.math('MULTIPLY_ADD', grain, 0.95, -0.08))
    tone = graph.math('MULTIPLY', tone, graph.math('MULTIPLY_ADD', lath, 0.65, 0.35))
    return graph.mixed(hollow, tones(graph, tone, _WILLOW), _BLACK), height


def netted(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """A net of ridges: two families of them run up around the branch, and fissures lie in its diamonds."""
    wave = graph.noise(times(graph, place.cells, 0.5, 0.9), 2.0, 0.5)[1]
    count = graph.math('MULTIPLY', place.scale, 0.55 * tau)
    turns = graph.math('ROUND', count)
    slope = graph.math('DIVIDE', count, graph.math('MULTIPLY', place.stretch, tau))
    bend = parts(graph, wave)
    eye = knot(graph, place, _EYE, wave)
    angle = graph.math('MULTIPLY', place.turn, tau)
    tangent = {"X": graph.math('MULTIPLY', graph.math('SINE', angle), -1.0), "Y": graph.math('COSINE', angle)}
    tangent = graph.node("ShaderNodeCombineXYZ", tangent).outputs[0]
    moved = graph.vector('DOT_PRODUCT', aside(graph, eye, _EYE / tau), tangent)
    turn = graph.math('ADD', place.turn, moved)
    waves = []
    for sign, part in ((1.0, bend[0]), (-1.0, bend[1])):
        phase = graph.math('MULTIPLY', graph.math('MULTIPLY', place.along, slope), sign)
        phase = graph.math('MULTIPLY_ADD', turn, turns, phase)
        phase = graph.math('MULTIPLY_ADD', part, 2.2, phase)
        waves.append(graph.math('ABSOLUTE', graph.math('SINE', graph.math('MULTIPLY', phase, tau / 2))))
    where = bent(graph, place.cells, wave, 1.2)
    grain = graph.noise(times(graph, where, 2.6, 7.0), 3.0, 0.7)[0]
    net = graph.math('MULTIPLY_ADD', grain, -0.55, graph.math('MINIMUM', *waves))
    ridge = graph.step(net, 0.5, 0.05)
    ring, hollow = lips(graph, eye)
    height = graph.math('MULTIPLY_ADD', net, -0.5, graph.math('MULTIPLY_ADD', grain, 0.6, ridge))
    height = graph.math('MULTIPLY_ADD', ring, 1.6, graph.math('MULTIPLY_ADD', hollow, -2.0, height))
    tone = graph.math('MULTIPLY_ADD', ridge, 0.6, graph.math('MULTIPLY_ADD', grain, 0.85, -0.24))
    return graph.mixed(hollow, tones(graph, tone, _ASH), _BLACK), height


def plated(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Long plates of flakes that lie in layers, each its own red-brown or grey, with dark fissures between."""
    return _plates(graph, place)[:2]


def papery(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Plates low on the trunk; on limbs and high up thin orange skin that curls off in flakes."""
    colour, height, part, fine = _plates(graph, place)
    up = graph.step(place.along, 20.0, 38.0)
    high = graph.math('MAXIMUM', up, graph.step(place.girth, 0.75, 0.45))
    tone = graph.math('MULTIPLY_ADD', fine, 1.7, graph.math('MULTIPLY_ADD', part, -0.5, -0.115))
    skin = tones(graph, tone, ((0.2, _PAPER[0]), (0.5, _PAPER[1]), (0.85, _PAPER[2])))
    colour = graph.vector('MULTIPLY', graph.mixed(high, colour, skin), graph.mixed(up, (1.0, 1.0, 1.0), _ORANGE))
    return colour, graph.math('MULTIPLY', height, graph.math('MULTIPLY_ADD', high, -0.6, 1.0))


def _plates(graph: Graph, place: Place) -> tuple[Socket, Socket, Socket, Socket]:
    """Colour, height, part of a flake from its rim, and a fine noise."""
    noise, wave = graph.noise(times(graph, place.cells, 0.9, 1.5), 3.0, 0.62)
    where = bent(graph, place.cells, wave, 1.0, 0.6)
    plate = cell(graph, where)
    fine = graph.noise(times(graph, where, 3.2, 6.5), 3.0, 0.7)[0]
    # Borders across are narrow: plates lie over the next like shingles.
    gap = graph.math('MULTIPLY_ADD', plate.across, 0.07, graph.math('MULTIPLY_ADD', noise, 0.2, plate.border))
    solid = graph.step(gap, 0.1, 0.2)
    # Flakes end along lines of equal height of a noise and of the distance from the border: steps, worn a little.
    layer = graph.math('MULTIPLY_ADD', noise, 5.0, graph.math('MULTIPLY', plate.random[0], 3.0))
    layer = graph.math('MULTIPLY_ADD', plate.border, 2.2, graph.math('MULTIPLY_ADD', fine, 0.45, layer))
    part = graph.math('FRACT', layer)
    stair = graph.math('ADD', graph.math('FLOOR', layer), graph.step(part, 0.0, 0.12))
    tilt = graph.math('MULTIPLY', parts(graph, plate.off)[2], -0.35)
    height = graph.math('MULTIPLY_ADD', stair, 0.17, graph.math('MULTIPLY_ADD', fine, 0.5, tilt))
    height = graph.math('MULTIPLY_ADD', solid, 0.8, height)
    rim = graph.step(part, 0.22, 0.05)
    lit = graph.math('MULTIPLY_ADD', fine, 0.65, graph.math('MULTIPLY', plate.random[1], 0.28))
    lit = graph.math('MULTIPLY_ADD', rim, 0.14, graph.math('MULTIPLY_ADD', part, -0.08, lit))
    red = tones(graph, lit, _RED)
    grey = tones(graph, lit, ((0.15, (0.15, 0.12, 0.105)), (0.5, (0.4, 0.33, 0.29)), (0.9, (0.76, 0.68, 0.62))))
    colour = graph.mixed(graph.step(graph.math('MULTIPLY_ADD', noise, 0.6, plate.random[2]), 0.45, 1.15), red, grey)
    return graph.mixed(solid, (0.09, 0.062, 0.052), colour), height, part, fine


def scaly(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Small round scales that lift at their borders and lie over each other."""
    noise, wave = graph.noise(times(graph, place.cells, 0.6, 0.6), 4.0, 0.7)
    eye = knot(graph, place, _TWIG, wave)
    where = bent(graph, around(graph, place, eye, _TWIG), wave, 1.5)
    scale = cell(graph, where)
    solid = graph.step(graph.math('MULTIPLY_ADD', noise, 0.3, scale.border), 0.13, 0.24)
    lifted = graph.step(graph.math('MULTIPLY_ADD', noise, 0.3, scale.border), 0.42, 0.2)
    tilt = graph.math('MULTIPLY', parts(graph, scale.off)[2], -0.5)
    height = graph.math('MULTIPLY_ADD', scale.random[0], 0.9, graph.math('MULTIPLY_ADD', lifted, 0.3, tilt))
    height = graph.math('MULTIPLY_ADD', noise, 1.2, graph.math('MULTIPLY_ADD', solid, 0.6, height))
    ring, hollow = lips(graph, eye)
    height = graph.math('MULTIPLY_ADD', ring, 1.6, graph.math('MULTIPLY_ADD', hollow, -2.0, height))
    tone = graph.math('MULTIPLY_ADD', scale.random[1], 0.3, graph.math('MULTIPLY_ADD', lifted, 0.1, noise))
    tone = graph.math('MULTIPLY', tone, graph.math('MULTIPLY_ADD', solid, 0.45, 0.55))
    stops = (
        (0.2, (0.17, 0.125, 0.105)),
        (0.55, (0.48, 0.39, 0.34)),
        (0.8, (0.68, 0.59, 0.53)),
        (1.0, (0.92, 0.86, 0.81)),
    )
    return graph.mixed(hollow, tones(graph, tone, stops), _BLACK), height


def fibrous(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Long strips that peel."""
    noise, wave = graph.noise(times(graph, place.cells, 0.5, 0.8), 2.0, 0.6)
    strip = graph.noise(bent(graph, place.cells, wave, 1.6), 5.0, 0.7)[0]
    raised = graph.step(strip, 0.38, 0.6)
    tone = graph.math('MULTIPLY_ADD', noise, 0.5, graph.math('MULTIPLY', raised, 0.6))
    stops = (0.2, (0.16, 0.12, 0.1)), (0.55, (0.5, 0.42, 0.36)), (0.85, (0.85, 0.8, 0.74))
    return tones(graph, tone, stops), graph.math('MULTIPLY_ADD', strip, 1.2, raised)
