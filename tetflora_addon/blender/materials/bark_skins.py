# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Patterns of smooth bark: skins with lenticels, wrinkles and scars, on a cylinder of radius 1.

Each gives factors of the colour, whose mean `bark` measures and takes out, and a height in widths of a feature.
"""

from __future__ import annotations

from math import tau

from .bark_tools import (
    Graph,
    Knot,
    Place,
    Socket,
    bent,
    greys,
    knot,
    lips,
    parts,
    points,
    times,
    tones,
)

# How large the eye of a scar may be, in radii of the branch.
_EYE = 0.17


def _brows(graph: Graph, eye: Knot) -> Socket:
    """1 in the two lines that sink to both sides of a scar as the trunk grows thicker."""
    side = graph.vector('LENGTH', graph.vector('MULTIPLY', eye.off, (1.0, 1.0, 0.0)))
    line = graph.math('MULTIPLY_ADD', side, 0.75, parts(graph, eye.off)[2])
    line = graph.step(graph.math('ABSOLUTE', graph.math('SUBTRACT', line, 0.8)), 0.34, 0.04)
    return graph.math('MULTIPLY', line, graph.step(side, 2.7, 1.0))


def smooth(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Silver skin with pale and dark blotches, faint wrinkles across, and eyes with brows where branches were."""
    noise, wave = graph.noise(times(graph, place.round, 1.6, 1.1), 5.0, 0.62)
    lines = graph.noise(graph.vector('MULTIPLY', place.cells, (0.35, 0.35, 0.8)), 3.0, 0.6)[0]
    wrinkle = graph.math('MULTIPLY', graph.step(lines, 0.57, 0.66), graph.step(noise, 0.62, 0.42))
    eye = knot(graph, place, _EYE, wave, apart=0.9)
    ring, hollow = lips(graph, eye)
    brow = _brows(graph, eye)
    marks = graph.math('MAXIMUM', graph.math('MULTIPLY', brow, 0.7), hollow)
    tone = graph.math('MULTIPLY_ADD', lines, 0.12, graph.math('MULTIPLY_ADD', noise, 0.5, 0.2))
    # Crusts of lichen have sharp outlines: pale ones, and dark ones that are fewer.
    tone = graph.math('MULTIPLY_ADD', graph.step(noise, 0.56, 0.6), 0.08, tone)
    tone = graph.math('MULTIPLY_ADD', graph.step(noise, 0.4, 0.375), -0.06, tone)
    tone = graph.math('MULTIPLY_ADD', wrinkle, -0.08, graph.math('MULTIPLY_ADD', marks, -0.3, tone))
    height = graph.math(
        'MULTIPLY_ADD', wrinkle, -0.5, graph.math('MULTIPLY_ADD', noise, 1.4, graph.math('MULTIPLY', lines, 0.4))
    )
    height = graph.math('MULTIPLY_ADD', ring, 4.0, graph.math('MULTIPLY_ADD', brow, -2.5, height))
    height = graph.math('MULTIPLY_ADD', hollow, -4.0, height)
    stops = (
        (0.2, (0.13, 0.125, 0.11)),
        (0.45, (0.38, 0.38, 0.355)),
        (0.62, (0.54, 0.55, 0.52)),
        (0.85, (0.86, 0.89, 0.85)),
    )
    return tones(graph, tone, stops), height


def pitted(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Pale skin with dark diamonds of cork in rows, eyes where branches were, and a dark, furrowed foot."""
    noise, wave = graph.noise(times(graph, place.round, 1.4, 1.6), 5.0, 0.62)
    row = graph.step(graph.noise(times(graph, place.round, 0.9, 3.2), 1.0, 0.5)[0], 0.4, 0.62)
    size = graph.math('MULTIPLY_ADD', row, 0.36, 0.17)
    spots = points(graph, bent(graph, times(graph, place.cells, 1.0, 1.0), wave, 0.5), 'MANHATTAN')
    size = graph.math('MULTIPLY', size, graph.math('MULTIPLY_ADD', parts(graph, spots["Color"])[0], 0.9, 0.5))
    pit = graph.step(spots["Distance"], size, graph.math('MULTIPLY', size, 0.55))
    eye = knot(graph, place, _EYE, wave)
    ring, hollow = lips(graph, eye)
    brow = _brows(graph, eye)
    rough = furrows(graph, place, 7.0, 2.4)
    cork = graph.math('MAXIMUM', pit, graph.math('MAXIMUM', hollow, graph.math('MULTIPLY', brow, 0.8)))
    cork = graph.math('MAXIMUM', cork, foot(graph, place, noise, 16.0, 4.5))
    tone = graph.math('MULTIPLY_ADD', ring, -0.05, noise)
    stops = (0.3, (0.42, 0.46, 0.35)), (0.5, (0.68, 0.7, 0.62)), (0.66, (0.96, 0.94, 0.88))
    dark = tones(graph, rough, ((0.3, (0.05, 0.048, 0.042)), (0.75, (0.34, 0.325, 0.285))))
    height = graph.math('MULTIPLY_ADD', cork, graph.math('MULTIPLY', rough, 1.3), graph.math('MULTIPLY', noise, 0.8))
    height = graph.math('MULTIPLY_ADD', ring, 1.2, graph.math('MULTIPLY_ADD', hollow, -1.5, height))
    return graph.mixed(cork, tones(graph, tone, stops), dark), height


def furrows(graph: Graph, place: Place, x: float, z: float) -> Socket:
    """Cork that has cracked along the branch, from 0 in its furrows to 1; `x` and `z` of them to a radius."""
    rough = graph.noise(times(graph, place.round, x, z), 4.0, 0.7)[0]
    crack = graph.math('ABSOLUTE', graph.math('SUBTRACT', rough, 0.5))
    return graph.math('MULTIPLY_ADD', graph.step(crack, 0.0, 0.12), 0.55, graph.math('MULTIPLY', rough, 0.6))


def foot(graph: Graph, place: Place, noise: Socket, uneven: float, start: float) -> Socket:
    """1 at the foot of an old stem, higher up in some places than in others; `uneven` and `start` in radii."""
    low = graph.math('MULTIPLY_ADD', noise, uneven, graph.math('MULTIPLY', place.along, -1.0))
    return graph.step(low, start, start + 1.0)


def _dashes(graph: Graph, place: Place, noise: Socket, wave: Socket) -> Socket:
    """1 in thin dark lines across, some long and many short."""
    spots = points(graph, bent(graph, times(graph, place.round, 1.3, 8.0), wave, 0.4))
    size = graph.math('MULTIPLY_ADD', graph.math('POWER', parts(graph, spots["Color"])[0], 2.0), 0.36, 0.1)
    far = graph.math('MULTIPLY_ADD', noise, 0.4, graph.math('SUBTRACT', spots["Distance"], 0.2))
    return graph.step(far, size, graph.math('MULTIPLY', size, 0.75))


def banded(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Satin skin with lenticels in rings, like a cherry's, and curls of skin between."""
    noise, wave = graph.noise(times(graph, place.cells, 0.4, 0.35), 4.0, 0.6)
    row = graph.step(graph.noise(times(graph, place.cells, 0.08, 0.45), 2.0, 0.5)[0], 0.45, 0.6)
    size = graph.math('MULTIPLY_ADD', row, 0.42, 0.06)
    where = bent(graph, place.cells, wave, 0.4)
    ray = graph.step(points(graph, where)["Distance"], size, graph.math('MULTIPLY', size, 0.6))
    skin = graph.noise(times(graph, place.cells, 0.5, 3.0), 3.0, 0.6)[0]
    height = graph.math('MULTIPLY_ADD', ray, 0.8, graph.math('MULTIPLY', skin, 0.5))
    tone = graph.math('MULTIPLY_ADD', skin, 0.4, graph.math('MULTIPLY', noise, 0.8))
    stops = (0.3, (0.36, 0.33, 0.32)), (0.6, (0.66, 0.64, 0.62)), (0.85, (0.95, 0.95, 0.95))
    return graph.mixed(ray, tones(graph, tone, stops), (0.26, 0.2, 0.15)), height


def peeling(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """White skin with fine lenticels and dark dashes, torn in sheets across, and black diamonds where branches were."""
    noise, wave = graph.noise(times(graph, place.cells, 0.22, 0.5), 5.0, 0.66)
    sheet = graph.noise(times(graph, place.round, 0.55, 2.2), 5.0, 0.62)[0]
    torn = graph.step(sheet, 0.585, 0.6)
    edge = graph.math('MULTIPLY', torn, graph.step(sheet, 0.625, 0.6))
    dots = points(graph, bent(graph, place.cells, wave, 0.3))["Distance"]
    dots = graph.step(dots, 0.3, 0.2)
    dashes = _dashes(graph, place, noise, wave)
    eye = knot(graph, place, _EYE, wave, apart=0.85)
    # A scar is a black diamond, wider than high, and its brows hang from it.
    flat = graph.vector('DOT_PRODUCT', graph.vector('ABSOLUTE', eye.off), (0.45, 0.45, 1.5))
    none = graph.math('GREATER_THAN', eye.far, 50.0)
    scar = graph.step(graph.math('ADD', graph.math('ADD', flat, none), graph.math('MULTIPLY', noise, 0.9)), 1.35, 0.85)
    scar = graph.math('MAXIMUM', scar, graph.math('MULTIPLY', _brows(graph, eye), 0.6))
    scar = graph.math('MAXIMUM', scar, graph.math('MULTIPLY', dashes, 0.85))
    scar = graph.math('MAXIMUM', scar, foot(graph, place, sheet, 14.0, 2.5))
    skin = graph.math('MULTIPLY_ADD', noise, 0.5, 0.45)
    skin = graph.math('MULTIPLY_ADD', dots, -0.3, skin)
    white = tones(graph, skin, ((0.1, (0.32, 0.3, 0.28)), (0.6, (0.86, 0.85, 0.83)), (0.85, (1.0, 1.0, 1.0))))
    under = tones(graph, skin, ((0.1, (0.3, 0.25, 0.22)), (0.6, (0.7, 0.66, 0.62)), (0.85, (0.85, 0.79, 0.73))))
    colour = graph.mixed(graph.math('MULTIPLY', edge, 0.6), graph.mixed(torn, white, under), (0.2, 0.17, 0.15))
    rough = furrows(graph, place, 8.0, 3.4)
    black = tones(graph, rough, ((0.3, (0.026, 0.026, 0.024)), (0.9, (0.15, 0.135, 0.115))))
    height = graph.math('MULTIPLY_ADD', scar, graph.math('MULTIPLY', rough, 2.4), graph.math('MULTIPLY', skin, 0.35))
    height = graph.math('MULTIPLY_ADD', torn, -0.35, height)
    return graph.mixed(scar, colour, black), height


def ringed(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Scars of fallen fronds: rings that hang unevenly, each standing out over the next, with fibres between."""
    noise = graph.noise(place.cells, 4.0, 0.6)[0]
    along = parts(graph, place.round)[2]
    turn = graph.math('FRACT', graph.math('MULTIPLY_ADD', noise, 1.2, graph.math('MULTIPLY', along, 3.6)))
    scar = graph.math('MULTIPLY', graph.step(turn, 0.0, 0.2), graph.step(turn, 1.0, 0.5))
    tone = graph.math('MULTIPLY', scar, graph.math('MULTIPLY_ADD', noise, 1.6, 0.0))
    return greys(graph, tone), graph.math('MULTIPLY_ADD', noise, 0.3, scar)


def jointed(graph: Graph, place: Place) -> tuple[Socket, Socket]:
    """Culms with three joints to four perimeters, and wax under each."""
    noise = graph.noise(place.cells, 2.0, 0.6)[0]
    along = parts(graph, place.round)[2]
    part = graph.math('FRACT', graph.math('MULTIPLY', along, 0.75 / tau))
    joint = graph.math('MULTIPLY', graph.step(part, 0.0, 0.025), graph.step(part, 1.0, 0.995))
    wax = graph.step(part, 0.9, 1.0)
    skin = graph.math('ADD', graph.math('MULTIPLY', noise, 0.8), wax)
    return greys(graph, graph.math('MULTIPLY', joint, skin)), joint
