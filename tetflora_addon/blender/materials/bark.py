# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bark by nodes: patterns that follow each branch by its UV map, fade on thin twigs, and keep the mean color.

A pattern lives on a cylinder of radius 1, of which the branch is an unrolled image: (cos 2πu, sin 2πu, 2πv). It
therefore closes without a seam at u = 0 and is as wide as it is high. How many features there are to a radius follows
from the branch's girth at its base, one number for each branch. How thick the branch is where it is seen follows from
the slope of u along the surface, which Bump nodes know.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import tau
from typing import Any

import bpy

from ...errors import SpeciesError
from .nodes import Graph, Term, node_group

PLACE = "TetFlora Bark Place"

# Raise this when nodes of a group change; `bark_version` then makes new materials as well.
_VERSION = 5

# A perimeter of this length tilts the Bump node's normal by 45 degrees: the middle of the range that matters, meters.
_REFERENCE = 0.25
# Longest perimeter that counts, meters; that of a trunk of 2 m.
_THICKEST = 6.0
# How far the pattern of a branch is moved per unit of its color, in radii: branches differ in color, so in pattern.
_SHIFT = 10.0
# Perimeter of the branch on which there are `Bark.scale` features to a radius, meters; also of one that does not say.
_USUAL = 1.57
# Light that relief costs in Cycles over what tilted normals explain.
_STEEPER = 1.15
# Moss grows up to this height above the base of a branch, on branches of these perimeters, meters.
_MOSSY, _MOSS_GIRTH = 3.0, (0.3, 0.9)
# Patches of moss and lichen to a meter.
_PATCHES = 5.0
# Where light and rain come from: moss faces north and up.
_SHADY = (0.0, 0.76, 0.65)
# What lies so many radii below the base of a branch is an old root.
_ROOTS = -0.1
# Up to this height rain splashes from the ground, meters.
_SPLASH = 0.7
# Colors of moss, algae and lichen over the lightness of the bark under them.
_MOSS, _ALGAE, _LICHEN = (0.78, 0.9, 0.36), (0.93, 1.05, 0.68), (1.15, 1.2, 1.0)
# Knots: how far apart, in radii; the fraction of them that there is; how far ridges give way, in sizes of the eye.
_KNOTS_APART, _NO_KNOT, _AROUND = 1.25, 0.3, 2.4
# How large the eye of a knot may be, in radii of the branch, by what it is in.
_EYE, _TWIG, _SCAR = 0.24, 0.15, 0.17

Tones = tuple[tuple[float, tuple[float, float, float]], ...]
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
_SPRUCE: Tones = (
    (0.2, (0.17, 0.125, 0.105)), (0.55, (0.48, 0.39, 0.34)), (0.8, (0.68, 0.59, 0.53)), (1.0, (0.92, 0.86, 0.81)),
)  # fmt: skip
_BEECH: Tones = (
    (0.2, (0.13, 0.125, 0.11)), (0.45, (0.38, 0.38, 0.355)), (0.62, (0.54, 0.55, 0.52)), (0.85, (0.86, 0.89, 0.85)),
)  # fmt: skip
_WILLOW: Tones = (
    (0.1, (0.13, 0.1, 0.08)), (0.45, (0.42, 0.35, 0.29)), (0.75, (0.66, 0.59, 0.52)), (1.0, (0.92, 0.86, 0.79)),
)  # fmt: skip


@dataclass(frozen=True)
class Bark:
    """One character of bark."""

    #: (graph, place) → (factors of the color, height in widths of a feature): terms
    pattern: "Callable[[Graph, Place], tuple[Term, Term]]"
    scale: float  # features to a radius, on a branch of .25 m radius; 2π times as many around it
    stretch: float  # how much longer along the branch than around it features are
    mean: tuple[float, float, float]  # (3,): mean of the pattern's factors over the surface, measured
    contrast: float  # 1: factors as the pattern has them
    depth: float  # of the relief, in widths of a feature
    #: smooth, full: Perimeters under which there is no pattern, and over which it is complete, meters
    smooth: float
    full: float
    #: moss, lichen: How much of it there is
    moss: float = 0.0
    lichen: float = 0.0
    power: float = 0.5  # features to a radius go by this power of the radius: at 1 they are as wide on all branches


@dataclass(frozen=True)
class Place:
    """Where on a branch a point lies, as terms."""

    round: Term  # on the cylinder of radius 1, moved by the branch's color
    cells: Term  # the same in features: their widths around the branch, their lengths along it
    #: turn, along: Turns around the branch, and radii along it from its base
    turn: Term
    along: Term
    #: scale, stretch: Features to a radius, and their length over their width
    scale: Term
    stretch: Term
    girth: Term  # length around the branch at its base, meters


@dataclass(frozen=True)
class Cell:
    """The cell of a scatter of points in which a place lies, as terms."""

    border: Term  # distance to the plane halfway to the next point
    across: Term  # how steeply that border crosses the branch: 0 where it runs along, 1 where around
    random: tuple[Term, Term, Term]  # of this cell
    off: Term  # place, from the middle of the cell


@dataclass(frozen=True)
class Knot:
    """The nearest scar of a shed branch, as terms."""

    off: Term  # place from its middle, in sizes of its eye
    far: Term  # length of that; large where there is none


def _place_group() -> bpy.types.NodeTree:
    """The group "TetFlora Bark Place": where on a branch a point lies.

    Outputs Place, on the cylinder of radius 1 (in radii, moved by the branch's color), Turn, Along (radii), and
    Perimeter, meters. The perimeter P is that of the branch where it is seen: a relief of height u times D tilts
    the normal by θ with tan θ = D |∇u| = D / P (Mikkelsen 2010, "Bump mapping unparametrized surfaces on the GPU").
    """

    def build(graph: Graph, _given: Any) -> dict[str, Any]:
        u, v, _ = graph.parts(graph.attribute("UVMap", "Vector"))
        along = v * tau
        cylinder = graph.xyz(graph.math('COSINE', u * tau), graph.math('SINE', u * tau), along)
        bump = graph.node("ShaderNodeBump", {"Strength": 1.0, "Distance": _REFERENCE, "Height": u})
        cosine = graph.vector('DOT_PRODUCT', bump, graph.outputs("ShaderNodeNewGeometry")["Normal"])
        cotangent = cosine / graph.math('MAXIMUM', graph.math('SQRT', 1.0 - cosine * cosine), 1e-3)
        return {
            "Place": cylinder + graph.attribute("tf_color", "Vector") * _SHIFT,
            "Turn": u,
            "Along": along,
            "Perimeter": graph.math('MINIMUM', cotangent * _REFERENCE, _THICKEST),
        }

    outputs = (("Place", 'Vector'), *((name, 'Float') for name in ("Turn", "Along", "Perimeter")))
    return node_group(PLACE, _VERSION, (), outputs, build)


def bark_group(character: str) -> bpy.types.NodeTree:
    """The group "TetFlora <Character> Bark".

    Returns
    -------
    bpy.types.NodeTree
        Inputs Color, Scale, Stretch, Contrast, Depth, Smooth Under, Full Over, Moss, Lichen; outputs Color, whose
        mean over the surface is the color that went in, Normal, Gain, and Shown, which is 0 where both are those of
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
        ("Color", 'Color', (0.16, 0.11, 0.07, 1.0), None, "Mean color"),
        ("Scale", 'Float', bark.scale, (0.0, 1000.0), "Number of features per radius of a branch of 0.25 m"),
        ("Stretch", 'Float', bark.stretch, (0.01, 100.0), "Length to width of the features"),
        ("Contrast", 'Float', bark.contrast, (0.0, 4.0), "Contrast around the mean color"),
        ("Depth", 'Float', bark.depth, (0.0, 4.0), "Depth of the relief, in widths of a feature"),
        ("Smooth Under", 'Float', bark.smooth, (0.0, 10.0), "Perimeter of a young branch (m)"),
        ("Full Over", 'Float', bark.full, (0.0, 10.0), "Perimeter of an old branch (m)"),
        ("Moss", 'Float', bark.moss, (0.0, 2.0), "Moss low on thick wood that faces north or up"),
        ("Lichen", 'Float', bark.lichen, (0.0, 2.0), "Pale patches of lichen"),
    )

    def build(graph: Graph, given: dict[str, Term]) -> dict[str, Any]:
        where = graph.outputs("ShaderNodeGroup", node_tree=_place_group())
        girth = graph.attribute("tf_girth", "Fac")
        girth = (girth < 1e-6) * _USUAL + girth
        scale = given["Scale"] * (girth / _USUAL) ** bark.power
        cells = where["Place"] * graph.xyz(scale, scale, scale / given["Stretch"])
        place = Place(where["Place"], cells, where["Turn"], where["Along"], scale, given["Stretch"], girth)
        pattern = pattern_part(graph, character, place)
        tone, height = pattern["Tone"], pattern["Height"]
        age = graph.step(where["Perimeter"], given["Smooth Under"], given["Full Over"])
        # Roots, below the base, are thin but as old as the trunk.
        age = graph.math('MAXIMUM', age, graph.step(where["Along"], 0.0, _ROOTS))
        change = (tone / bark.mean - (1.0, 1.0, 1.0)) * (given["Contrast"] * age) + (1.0, 1.0, 1.0)
        color = graph.tinted(given["Color"], change)
        if bark.moss or bark.lichen:
            asked = {"Color": color, "Round": place.round, "Along": place.along, "Girth": place.girth, "Age": age}
            asked |= {name: given[name] for name in ("Moss", "Lichen")}
            color = graph.part("TetFlora Bark Growth", _VERSION, asked, (("Color", 'Color'),), _grown)["Color"]
        # Thickness must not be part of the height, whose slope alone is wanted.
        depth = where["Perimeter"] / (scale * tau) * given["Depth"] * age
        bump = graph.node("ShaderNodeBump", {"Strength": 1.0, "Distance": depth, "Height": height})
        # Only trunks flare, and these are thick.
        shown = graph.math('MAXIMUM', girth > given["Smooth Under"], where["Along"] < 0.0)
        tilt = graph.vector('DOT_PRODUCT', bump, graph.outputs("ShaderNodeNewGeometry")["Normal"])
        # Tilted normals explain most of the loss; the rest is measured.
        gain = 2.0 / (1.0 + graph.math('MAXIMUM', tilt, 0.0)) * _STEEPER + (1.0 - _STEEPER)
        return {"Color": color, "Normal": bump, "Gain": gain, "Shown": shown}

    outputs = ("Color", 'Color'), ("Normal", 'Vector'), ("Gain", 'Float'), ("Shown", 'Float')
    return node_group(f"TetFlora {character.capitalize()} Bark", _VERSION, inputs, outputs, build)


def pattern_part(graph: Graph, character: str, place: Place) -> dict[str, Term]:
    """Group "TetFlora <Character> Bark Pattern": Tone, factors of the color, and Height, in widths of a feature."""

    def build(inner: Graph, terms: dict[str, Term]) -> dict[str, Any]:
        tone, height = _bark(character).pattern(inner, Place(**{name: terms[name.title()] for name in vars(place)}))
        return {"Tone": tone, "Height": height}

    name = f"TetFlora {character.capitalize()} Bark Pattern"
    inputs = {name.title(): term for name, term in vars(place).items()}
    return graph.part(name, _VERSION, inputs, (("Tone", 'Color'), ("Height", 'Float')), build)


def _grown(graph: Graph, given: dict[str, Term]) -> dict[str, Term]:
    """Group "TetFlora Bark Growth": moss where damp, lichen where a noise is low, both as light as the bark beneath."""
    age, color = given["Age"], given["Color"]
    radii = given["Girth"] / tau
    noise = graph.noise(given["Round"] * (radii * _PATCHES), 4.0, 0.65)[0]
    damp = graph.step(graph.vector('DOT_PRODUCT', graph.outputs("ShaderNodeNewGeometry")["Normal"], _SHADY), -0.3, 0.9)
    height = given["Along"] * radii
    # The foot is damp all around.
    damp = graph.step(height, _SPLASH, 0.0) * 0.6 + damp * graph.step(height, _MOSSY, 0.0)
    # What does not say how thick it is may be no wood.
    damp = damp * graph.step(graph.attribute("tf_girth", "Fac"), *_MOSS_GIRTH)
    # Moss settles in what lies deep first.
    growth = damp * given["Moss"] * 0.45 + noise
    moss = graph.step(growth, 0.72, 0.92) * age
    algae = graph.step(damp, 0.0, 0.8) * (given["Moss"] * age)
    algae = graph.step(growth, 0.45, 0.85) * (algae * 0.6)
    lichen = graph.step(noise, 0.37, 0.34) * (given["Lichen"] * age)
    light = graph.outputs("ShaderNodeRGBToBW", {"Color": color})["Val"]
    for tint, amount in ((_LICHEN, lichen), (_ALGAE, algae), (_MOSS, moss)):
        color = graph.mixed(amount, color, tint * light)
    return {"Color": color}


def bark_version(character: str) -> int:
    """Version of a material with that bark: another character is another version, and the old one stays beside it."""
    _bark(character)
    return 100 * _VERSION + BARKS.index(character)


def _bark(character: str) -> Bark:
    if character not in _CHARACTERS:
        raise SpeciesError(f'Unknown bark "{character}"; choose one of {", ".join(BARKS)}')
    return _CHARACTERS[character]


# What patterns are made of. Nodes that feed a height are worked out three times by the bump that follows, so one search
# for cells gives all that a pattern wants to know: how far the border is, how it runs, which cell it is, its middle.


def times(place: Term, x: float, z: float) -> Term:
    """A place with other features around the branch and along it."""
    return place * (x, x, z)


def bent(place: Term, noise: Term, amount: float, along: float = 1.0) -> Term:
    """Places moved by three numbers around .5."""
    return place + noise * (amount, amount, amount * along)


def points(graph: Graph, place: Term, metric: str = 'EUCLIDEAN', feature: str = 'F1') -> dict[str, Term]:
    """Outputs Distance, Color and Position of the nearest point, or with 'F2' of the second nearest."""
    inputs = {"Vector": place, "Scale": 1.0, "Randomness": 1.0}
    return graph.outputs("ShaderNodeTexVoronoi", inputs, feature=feature, distance=metric)


def cell(graph: Graph, place: Term) -> Cell:
    """The cell of a place: no more work than the distance to its border alone."""
    first, second = points(graph, place), points(graph, place, feature='F2')
    middle = (first["Position"] + second["Position"]) * 0.5
    normal = graph.vector('NORMALIZE', first["Position"] - second["Position"])
    border = graph.vector('DOT_PRODUCT', place - middle, normal)
    return Cell(border, abs(graph.parts(normal)[2]), graph.parts(first["Color"]), place - first["Position"])


def _knot(graph: Graph, place: Place, size: float, noise: Term, apart: float = 1.0) -> Knot:
    """Scars of shed branches, sparse and the larger the thicker the branch: the largest eye has so many of its radii.

    A noise around .5 makes their outlines uneven. Those that are farther apart are fewer.
    """
    spacing = _KNOTS_APART * apart
    where = bent(place.round * (1.0 / spacing), noise, 0.35 * size / spacing)
    nearest = points(graph, where)
    chance, how_large, _ = graph.parts(nearest["Color"])
    # Those that are none are so small that nothing is within reach.
    share = (chance > _NO_KNOT) * (spacing / size) / (how_large * 0.6 + 0.4)
    off = (where - nearest["Position"]) * share
    return Knot(off, graph.vector('LENGTH', off) + (chance < _NO_KNOT) * 100.0)


def around(graph: Graph, place: Place, eye: Knot, size: float) -> Term:
    """Features that give way to a knot to both sides, as a stream does to a stone."""
    return place.cells + aside(graph, eye, size) * place.scale


def aside(graph: Graph, eye: Knot, size: float) -> Term:
    """How far what grows past a knot is moved, in radii of the branch."""
    return eye.off * (-size, -size, 0.0) * graph.step(eye.far, _AROUND, 0.5)


def lips(graph: Graph, eye: Knot) -> tuple[Term, Term]:
    """The swollen ring around a knot and its dark middle, from 0 to 1."""
    hollow = graph.step(eye.far, 0.62, 0.3)
    return graph.step(eye.far, 1.5, 0.75) * graph.step(eye.far, 0.35, 0.75), hollow


def tones(graph: Graph, value: Term, stops: Tones) -> Term:
    """Colors between stops."""
    node = graph.node("ShaderNodeValToRGB", {"Fac": value})
    ramp = node.color_ramp.elements
    while len(ramp) < len(stops):
        ramp.new(0.5)
    for element, (position, color) in zip(ramp, stops, strict=True):
        element.position, element.color = position, (*color, 1.0)
    return Term(graph, node.outputs["Color"])


# Patterns: factors of the color, whose mean is measured and taken out, and a height in widths of a feature.


def ridged(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Ridges that part and meet, broken by cracks across every width or three, with deep fissures between them."""
    wave = graph.noise(times(place.cells, 0.35, 0.9), 1.0)[1]
    eye = _knot(graph, place, _EYE, wave)
    where = bent(around(graph, place, eye, _EYE), wave, 2.0, 0.45)
    strip = cell(graph, where)
    grain = graph.noise(times(bent(place.cells, wave, 1.2), 2.6, 9.0), 3.0, 0.7)[0]
    waves = graph.parts(wave)
    # Fissures are wide in some places and close in others.
    ridge = graph.step(grain * 0.2 + (waves[2] * 0.22 + strip.border), 0.22, 0.45)
    # Cracks across: every strip has its own, some deep and some hardly there.
    turn = graph.parts(where)[2] * 3.4 + strip.random[0] * 9.0
    turn = waves[0] * 2.2 + (grain * 0.7 + turn)
    crack = graph.step(abs(graph.math('FRACT', turn) - 0.5), 0.14, 0.03)
    deep = graph.math('FRACT', graph.math('FLOOR', turn) * 0.618 + strip.random[1])
    crack = crack * graph.step(deep, 0.15, 0.6)
    ridge = ridge * (crack * -0.6 + 1.0)
    ring, hollow = lips(graph, eye)
    height = ring * 1.6 + (hollow * -2.0 + (grain * 0.9 + ridge))
    tone = strip.random[2] * 0.12 + (ridge * 0.45 + (grain * 0.9 + -0.16))
    return graph.mixed(hollow, tones(graph, tone, _OAK), _BLACK), height


def interlaced(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Short narrow strips that lie over each other like laths, with thin cracks between."""
    wave = graph.noise(times(place.cells, 0.45, 1.2), 1.0)[1]
    eye = _knot(graph, place, _EYE, wave)
    strip = cell(graph, bent(around(graph, place, eye, _EYE), wave, 2.2, 0.4))
    grain = graph.noise(times(bent(place.cells, wave, 1.2), 1.9, 6.0), 3.0, 0.7)[0]
    lath = graph.step(grain * 0.22 + strip.border, 0.1, 0.22)
    ring, hollow = lips(graph, eye)
    height = lath * 0.6 + (strip.random[0] * 0.75 + grain * 0.9)
    height = ring * 1.8 + (hollow * -2.0 + height)
    tone = (strip.random[0] * 0.34 + (grain * 0.95 + -0.08)) * (lath * 0.65 + 0.35)
    return graph.mixed(hollow, tones(graph, tone, _WILLOW), _BLACK), height


def netted(graph: Graph, place: Place) -> tuple[Term, Term]:
    """A net of ridges: two families of them run up around the branch, and fissures lie in its diamonds."""
    wave = graph.noise(times(place.cells, 0.5, 0.9), 2.0)[1]
    count = place.scale * (0.55 * tau)
    slope = count / (place.stretch * tau)
    bend = graph.parts(wave)
    eye = _knot(graph, place, _EYE, wave)
    angle = place.turn * tau
    tangent = graph.xyz(-graph.math('SINE', angle), graph.math('COSINE', angle))
    turn = place.turn + graph.vector('DOT_PRODUCT', aside(graph, eye, _EYE / tau), tangent)
    waves = []
    for sign, part in ((1.0, bend[0]), (-1.0, bend[1])):
        phase = part * 2.2 + (turn * graph.math('ROUND', count) + place.along * slope * sign)
        waves.append(abs(graph.math('SINE', phase * (tau / 2))))
    grain = graph.noise(times(bent(place.cells, wave, 1.2), 2.6, 7.0), 3.0, 0.7)[0]
    net = grain * -0.55 + graph.math('MINIMUM', *waves)
    ridge = graph.step(net, 0.5, 0.05)
    ring, hollow = lips(graph, eye)
    height = net * -0.5 + (grain * 0.6 + ridge)
    height = ring * 1.6 + (hollow * -2.0 + height)
    tone = ridge * 0.6 + (grain * 0.85 + -0.24)
    return graph.mixed(hollow, tones(graph, tone, _ASH), _BLACK), height


def papery(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Plates low on the trunk; on limbs and high up thin orange skin that curls off in flakes."""
    color, height, part, fine = _plates(graph, place)
    up = graph.step(place.along, 20.0, 38.0)
    high = graph.math('MAXIMUM', up, graph.step(place.girth, 0.75, 0.45))
    tone = fine * 1.7 + (part * -0.5 + -0.115)
    skin = tones(graph, tone, ((0.2, _PAPER[0]), (0.5, _PAPER[1]), (0.85, _PAPER[2])))
    color = graph.mixed(high, color, skin) * graph.mixed(up, (1.0, 1.0, 1.0), _ORANGE)
    return color, height * (high * -0.6 + 1.0)


def _plates(graph: Graph, place: Place) -> tuple[Term, Term, Term, Term]:
    """Long plates of flakes, dark fissures between: color, height, part of a flake from its rim, and a fine noise."""
    noise, wave = graph.noise(times(place.cells, 0.9, 1.5), 3.0, 0.62)
    where = bent(place.cells, wave, 1.0, 0.6)
    plate = cell(graph, where)
    fine = graph.noise(times(where, 3.2, 6.5), 3.0, 0.7)[0]
    # Borders across are narrow: plates lie over the next like shingles.
    solid = graph.step(plate.across * 0.07 + (noise * 0.2 + plate.border), 0.1, 0.2)
    # Flakes end along lines of equal height of a noise and of the distance from the border: steps, worn a little.
    layer = plate.border * 2.2 + (fine * 0.45 + (noise * 5.0 + plate.random[0] * 3.0))
    part = graph.math('FRACT', layer)
    stair = graph.math('FLOOR', layer) + graph.step(part, 0.0, 0.12)
    height = stair * 0.17 + (fine * 0.5 + graph.parts(plate.off)[2] * -0.35)
    height = solid * 0.8 + height
    lit = graph.step(part, 0.22, 0.05) * 0.14 + (part * -0.08 + (fine * 0.65 + plate.random[1] * 0.28))
    red = tones(graph, lit, _RED)
    gray = tones(graph, lit, ((0.15, (0.15, 0.12, 0.105)), (0.5, (0.4, 0.33, 0.29)), (0.9, (0.76, 0.68, 0.62))))
    color = graph.mixed(graph.step(noise * 0.6 + plate.random[2], 0.45, 1.15), red, gray)
    return graph.mixed(solid, (0.09, 0.062, 0.052), color), height, part, fine


def scaly(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Small round scales that lift at their borders and lie over each other."""
    noise, wave = graph.noise(times(place.cells, 0.6, 0.6), 4.0, 0.7)
    eye = _knot(graph, place, _TWIG, wave)
    scale = cell(graph, bent(around(graph, place, eye, _TWIG), wave, 1.5))
    border = noise * 0.3 + scale.border
    solid, lifted = graph.step(border, 0.13, 0.24), graph.step(border, 0.42, 0.2)
    height = scale.random[0] * 0.9 + (lifted * 0.3 + graph.parts(scale.off)[2] * -0.5)
    height = noise * 1.2 + (solid * 0.6 + height)
    ring, hollow = lips(graph, eye)
    height = ring * 1.6 + (hollow * -2.0 + height)
    tone = (scale.random[1] * 0.3 + (lifted * 0.1 + noise)) * (solid * 0.45 + 0.55)
    return graph.mixed(hollow, tones(graph, tone, _SPRUCE), _BLACK), height


def fibrous(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Long strips that peel."""
    noise, wave = graph.noise(times(place.cells, 0.5, 0.8), 2.0, 0.6)
    strip = graph.noise(bent(place.cells, wave, 1.6), 5.0, 0.7)[0]
    raised = graph.step(strip, 0.38, 0.6)
    stops = (0.2, (0.16, 0.12, 0.1)), (0.55, (0.5, 0.42, 0.36)), (0.85, (0.85, 0.8, 0.74))
    return tones(graph, noise * 0.5 + raised * 0.6, stops), strip * 1.2 + raised


def _brows(graph: Graph, eye: Knot) -> Term:
    """1 in the two lines that sink to both sides of a scar as the trunk grows thicker."""
    side = graph.vector('LENGTH', eye.off * (1.0, 1.0, 0.0))
    return graph.step(abs(side * 0.75 + graph.parts(eye.off)[2] - 0.8), 0.34, 0.04) * graph.step(side, 2.7, 1.0)


def smooth(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Silver skin with pale and dark blotches, faint wrinkles across, and eyes with brows where branches were."""
    noise, wave = graph.noise(times(place.round, 1.6, 1.1), 5.0, 0.62)
    lines = graph.noise(times(place.cells, 0.35, 0.8), 3.0, 0.6)[0]
    wrinkle = graph.step(lines, 0.57, 0.66) * graph.step(noise, 0.62, 0.42)
    eye = _knot(graph, place, _SCAR, wave, apart=0.9)
    ring, hollow = lips(graph, eye)
    brow = _brows(graph, eye)
    marks = graph.math('MAXIMUM', brow * 0.7, hollow)
    tone = lines * 0.12 + (noise * 0.5 + 0.2)
    # Crusts of lichen have sharp outlines: pale ones, and dark ones that are fewer.
    tone = graph.step(noise, 0.4, 0.375) * -0.06 + (graph.step(noise, 0.56, 0.6) * 0.08 + tone)
    tone = wrinkle * -0.08 + (marks * -0.3 + tone)
    height = wrinkle * -0.5 + (noise * 1.4 + lines * 0.4)
    height = hollow * -4.0 + (ring * 4.0 + (brow * -2.5 + height))
    return tones(graph, tone, _BEECH), height


def pitted(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Pale skin with dark diamonds of cork in rows, eyes where branches were, and a dark, furrowed foot."""
    noise, wave = graph.noise(times(place.round, 1.4, 1.6), 5.0, 0.62)
    row = graph.step(graph.noise(times(place.round, 0.9, 3.2), 1.0)[0], 0.4, 0.62)
    spots = points(graph, bent(times(place.cells, 1.0, 1.0), wave, 0.5), 'MANHATTAN')
    size = (row * 0.36 + 0.17) * (graph.parts(spots["Color"])[0] * 0.9 + 0.5)
    pit = graph.step(spots["Distance"], size, size * 0.55)
    eye = _knot(graph, place, _SCAR, wave)
    ring, hollow = lips(graph, eye)
    rough = furrows(graph, place, 7.0, 2.4)
    cork = graph.math('MAXIMUM', pit, graph.math('MAXIMUM', hollow, _brows(graph, eye) * 0.8))
    cork = graph.math('MAXIMUM', cork, foot(graph, place, noise, 16.0, 4.5))
    stops = (0.3, (0.42, 0.46, 0.35)), (0.5, (0.68, 0.7, 0.62)), (0.66, (0.96, 0.94, 0.88))
    dark = tones(graph, rough, ((0.3, (0.05, 0.048, 0.042)), (0.75, (0.34, 0.325, 0.285))))
    height = cork * (rough * 1.3) + noise * 0.8
    height = ring * 1.2 + (hollow * -1.5 + height)
    return graph.mixed(cork, tones(graph, ring * -0.05 + noise, stops), dark), height


def furrows(graph: Graph, place: Place, x: float, z: float) -> Term:
    """Cork that has cracked along the branch, from 0 in its furrows to 1; `x` and `z` of them to a radius."""
    rough = graph.noise(times(place.round, x, z), 4.0, 0.7)[0]
    return graph.step(abs(rough - 0.5), 0.0, 0.12) * 0.55 + rough * 0.6


def foot(graph: Graph, place: Place, noise: Term, uneven: float, start: float) -> Term:
    """1 at the foot of an old stem, higher up in some places than in others; `uneven` and `start` in radii."""
    return graph.step(noise * uneven + -place.along, start, start + 1.0)


def banded(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Satin skin with lenticels in rings, like a cherry's, and curls of skin between."""
    noise, wave = graph.noise(times(place.cells, 0.4, 0.35), 4.0, 0.6)
    size = graph.step(graph.noise(times(place.cells, 0.08, 0.45), 2.0)[0], 0.45, 0.6) * 0.42 + 0.06
    ray = graph.step(points(graph, bent(place.cells, wave, 0.4))["Distance"], size, size * 0.6)
    skin = graph.noise(times(place.cells, 0.5, 3.0), 3.0, 0.6)[0]
    stops = (0.3, (0.36, 0.33, 0.32)), (0.6, (0.66, 0.64, 0.62)), (0.85, (0.95, 0.95, 0.95))
    tone = tones(graph, skin * 0.4 + noise * 0.8, stops)
    return graph.mixed(ray, tone, (0.26, 0.2, 0.15)), ray * 0.8 + skin * 0.5


def peeling(graph: Graph, place: Place) -> tuple[Term, Term]:
    """White skin with fine lenticels and dark dashes, torn in sheets across, and black diamonds where branches were."""
    noise, wave = graph.noise(times(place.cells, 0.22, 0.5), 5.0, 0.66)
    sheet = graph.noise(times(place.round, 0.55, 2.2), 5.0, 0.62)[0]
    torn = graph.step(sheet, 0.585, 0.6)
    edge = torn * graph.step(sheet, 0.625, 0.6)
    dots = graph.step(points(graph, bent(place.cells, wave, 0.3))["Distance"], 0.3, 0.2)
    # Thin dark lines across, some long and many short.
    spots = points(graph, bent(times(place.round, 1.3, 8.0), wave, 0.4))
    size = graph.parts(spots["Color"])[0] ** 2.0 * 0.36 + 0.1
    dashes = graph.step(noise * 0.4 + (spots["Distance"] - 0.2), size, size * 0.75)
    eye = _knot(graph, place, _SCAR, wave, apart=0.85)
    # A scar is a black diamond, wider than high, and its brows hang from it.
    flat = graph.vector('DOT_PRODUCT', abs(eye.off), (0.45, 0.45, 1.5))
    scar = graph.step(flat + (eye.far > 50.0) + noise * 0.9, 1.35, 0.85)
    for other in (_brows(graph, eye) * 0.6, dashes * 0.85, foot(graph, place, sheet, 14.0, 2.5)):
        scar = graph.math('MAXIMUM', scar, other)
    skin = dots * -0.3 + (noise * 0.5 + 0.45)
    white = tones(graph, skin, ((0.1, (0.32, 0.3, 0.28)), (0.6, (0.86, 0.85, 0.83)), (0.85, (1.0, 1.0, 1.0))))
    under = tones(graph, skin, ((0.1, (0.3, 0.25, 0.22)), (0.6, (0.7, 0.66, 0.62)), (0.85, (0.85, 0.79, 0.73))))
    color = graph.mixed(edge * 0.6, graph.mixed(torn, white, under), (0.2, 0.17, 0.15))
    rough = furrows(graph, place, 8.0, 3.4)
    black = tones(graph, rough, ((0.3, (0.026, 0.026, 0.024)), (0.9, (0.15, 0.135, 0.115))))
    height = torn * -0.35 + (scar * (rough * 2.4) + skin * 0.35)
    return graph.mixed(scar, color, black), height


def ringed(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Scars of fallen fronds: rings that hang unevenly, each standing out over the next, with fibers between."""
    noise = graph.noise(place.cells, 4.0, 0.6)[0]
    turn = graph.math('FRACT', noise * 1.2 + graph.parts(place.round)[2] * 3.6)
    scar = graph.step(turn, 0.0, 0.2) * graph.step(turn, 1.0, 0.5)
    tone = scar * (noise * 1.6 + 0.0)
    return graph.xyz(tone, tone, tone), noise * 0.3 + scar


def jointed(graph: Graph, place: Place) -> tuple[Term, Term]:
    """Culms with three joints to four perimeters, and wax under each."""
    noise = graph.noise(place.cells, 2.0, 0.6)[0]
    part = graph.math('FRACT', graph.parts(place.round)[2] * (0.75 / tau))
    joint = graph.step(part, 0.0, 0.025) * graph.step(part, 1.0, 0.995)
    tone = joint * (noise * 0.8 + graph.step(part, 0.9, 1.0))
    return graph.xyz(tone, tone, tone), joint


_CHARACTERS: dict[str, Bark] = {
    "ridged": Bark(ridged, 11.0, 6.0, (0.427, 0.394, 0.335), 0.95, 0.3, 0.22, 0.8, 1.0, 0.6),
    "plated": Bark(lambda *args: _plates(*args)[:2], 6.0, 2.8, (0.33, 0.245, 0.203), 1.0, 0.18, 0.25, 0.8, 0.3, 0.4),
    "smooth": Bark(smooth, 6.0, 0.3, (0.445, 0.449, 0.422), 1.0, 0.02, 0.12, 0.4, 0.8, 0.9),
    "banded": Bark(banded, 7.0, 0.2, (0.636, 0.614, 0.595), 1.0, 0.05, 0.1, 0.3, 0.4, 0.5),
    "ringed": Bark(ringed, 2.2, 1.2, (0.519, 0.519, 0.519), 0.7, 0.07, 0.2, 0.6, power=0.0),
    "fibrous": Bark(fibrous, 9.0, 14.0, (0.543, 0.481, 0.429), 1.0, 0.3, 0.16, 0.5, 0.5, 0.3),
    "jointed": Bark(jointed, 3.0, 8.0, (0.443, 0.443, 0.443), 0.32, 0.03, 0.02, 0.08, power=0.0),
    "netted": Bark(netted, 12.5, 5.5, (0.438, 0.413, 0.361), 0.62, 0.3, 0.22, 0.8, 0.7, 0.6),
    "peeling": Bark(peeling, 14.0, 0.22, (0.835, 0.826, 0.811), 1.0, 0.1, 0.12, 0.4, 0.4, 0.3),
    "scaly": Bark(scaly, 18.0, 1.2, (0.563, 0.477, 0.425), 1.0, 0.18, 0.2, 0.6, 0.4, 0.5),
    "interlaced": Bark(interlaced, 17.0, 6.0, (0.439, 0.376, 0.32), 0.8, 0.2, 0.22, 0.8, 0.5, 0.5),
    "pitted": Bark(pitted, 9.0, 0.8, (0.666, 0.681, 0.602), 1.0, 0.1, 0.12, 0.4, 0.4, 0.6),
    "papery": Bark(papery, 6.0, 2.8, (0.331, 0.247, 0.206), 1.0, 0.18, 0.25, 0.8, 0.3, 0.4),
}

#: Characters of bark, as species name them.
BARKS = tuple(_CHARACTERS)
