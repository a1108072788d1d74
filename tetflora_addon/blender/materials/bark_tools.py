# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What patterns of bark are made of: places, cells with their borders, knots, and tones.

Nodes that feed a height are worked out three times by the bump that follows, so one search for cells gives all that a
pattern wants to know: how far the border is, how it runs, which cell it is, and where its middle lies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

#: `nodes.Graph`, and a socket of it or a value: patterns know only their methods.
Graph = Socket = Any
Tones = tuple[tuple[float, tuple[float, float, float]], ...]

# Knots: how far apart, in radii; the fraction of them that there is; how far ridges give way, in sizes of the eye.
_KNOTS_APART, _NO_KNOT, _AROUND = 1.25, 0.3, 2.4


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
    girth : Float
        Length around the branch at its base, metres.
    """

    round: Socket
    cells: Socket
    turn: Socket
    along: Socket
    scale: Socket
    stretch: Socket
    girth: Socket


@dataclass(frozen=True)
class Cell:
    """The cell of a scatter of points in which a place lies, as sockets.

    Attributes
    ----------
    border : Float
        Distance to the plane halfway to the next point.
    across : Float
        How steeply that border crosses the branch: 0 where it runs along, 1 where around.
    random : Float x 3
        Numbers of this cell.
    off : Vector
        Place, from the middle of the cell.
    """

    border: Socket
    across: Socket
    random: tuple[Socket, Socket, Socket]
    off: Socket


@dataclass(frozen=True)
class Knot:
    """The nearest scar of a shed branch, as sockets.

    Attributes
    ----------
    off : Vector
        Place from its middle, in sizes of its eye.
    far : Float
        Length of that; large where there is none.
    """

    off: Socket
    far: Socket


def times(graph: Graph, place: Socket, x: float, z: float) -> Socket:
    """A place with other features around the branch and along it."""
    return graph.vector('MULTIPLY', place, (x, x, z))


def bent(graph: Graph, place: Socket, noise: Socket, amount: float, along: float = 1.0) -> Socket:
    """Places moved by three numbers around .5."""
    return graph.vector('ADD', place, graph.vector('MULTIPLY', noise, (amount, amount, amount * along)))


def parts(graph: Graph, vector: Socket) -> tuple[Socket, Socket, Socket]:
    """Three numbers of a vector or a colour."""
    outputs = graph.node("ShaderNodeSeparateXYZ", {"Vector": vector}).outputs
    return outputs["X"], outputs["Y"], outputs["Z"]


def points(graph: Graph, place: Socket, metric: str = 'EUCLIDEAN', feature: str = 'F1') -> Any:
    """Outputs Distance, Color and Position of the nearest point, or with 'F2' of the second nearest."""
    inputs = {"Vector": place, "Scale": 1.0, "Randomness": 1.0}
    return graph.node("ShaderNodeTexVoronoi", inputs, feature=feature, distance=metric).outputs


def cell(graph: Graph, place: Socket) -> Cell:
    """The cell of a place: no more work than the distance to its border alone."""
    first, second = points(graph, place), points(graph, place, feature='F2')
    middle = graph.vector('SCALE', graph.vector('ADD', first["Position"], second["Position"]), 0.5)
    normal = graph.vector('NORMALIZE', graph.vector('SUBTRACT', first["Position"], second["Position"]))
    border = graph.vector('DOT_PRODUCT', graph.vector('SUBTRACT', place, middle), normal)
    across = graph.math('ABSOLUTE', parts(graph, normal)[2])
    return Cell(border, across, parts(graph, first["Color"]), graph.vector('SUBTRACT', place, first["Position"]))


def knot(graph: Graph, place: Place, size: float, noise: Socket, apart: float = 1.0) -> Knot:
    """Scars of shed branches: sparse, and the larger the thicker the branch.

    Parameters
    ----------
    size : float
        Of the largest eye, in radii of the branch.
    noise : Vector
        Around .5; what makes their outline uneven.
    apart : float
        More than 1: fewer of them.
    """
    spacing = _KNOTS_APART * apart
    where = bent(graph, graph.vector('SCALE', place.round, 1.0 / spacing), noise, 0.35 * size / spacing)
    found = points(graph, where)
    there, how_large, _ = parts(graph, found["Color"])
    # Those that are none are so small that nothing is within reach.
    share = graph.math('MULTIPLY', graph.math('GREATER_THAN', there, _NO_KNOT), spacing / size)
    share = graph.math('DIVIDE', share, graph.math('MULTIPLY_ADD', how_large, 0.6, 0.4))
    off = graph.vector('SCALE', graph.vector('SUBTRACT', where, found["Position"]), share)
    none = graph.math('MULTIPLY', graph.math('LESS_THAN', there, _NO_KNOT), 100.0)
    return Knot(off, graph.math('ADD', graph.vector('LENGTH', off), none))


def around(graph: Graph, place: Place, eye: Knot, size: float) -> Socket:
    """Features that give way to a knot to both sides, as a stream does to a stone."""
    return graph.vector('ADD', place.cells, graph.vector('SCALE', aside(graph, eye, size), place.scale))


def aside(graph: Graph, eye: Knot, size: float) -> Socket:
    """How far what grows past a knot is moved, in radii of the branch."""
    near = graph.step(eye.far, _AROUND, 0.5)
    return graph.vector('SCALE', graph.vector('MULTIPLY', eye.off, (-size, -size, 0.0)), near)


def lips(graph: Graph, eye: Knot) -> tuple[Socket, Socket]:
    """The swollen ring around a knot and its dark middle, from 0 to 1."""
    hollow = graph.step(eye.far, 0.62, 0.3)
    ring = graph.math('MULTIPLY', graph.step(eye.far, 1.5, 0.75), graph.step(eye.far, 0.35, 0.75))
    return ring, hollow


def tones(graph: Graph, value: Socket, stops: Tones) -> Socket:
    """Colours between stops."""
    node = graph.node("ShaderNodeValToRGB", {"Fac": value})
    ramp = node.color_ramp.elements
    while len(ramp) < len(stops):
        ramp.new(0.5)
    for element, (position, colour) in zip(ramp, stops, strict=True):
        element.position, element.color = position, (*colour, 1.0)
    return node.outputs["Color"]


def greys(graph: Graph, tone: Socket) -> Socket:
    """The same factor for all three colours."""
    return graph.node("ShaderNodeCombineXYZ", dict.fromkeys("XYZ", tone)).outputs[0]
