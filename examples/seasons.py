# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The same place in four seasons: a meadow with lone trees before a wooded hill, and nothing but the day changes.

    python -m examples.seasons            # docs/images/seasons.jpg
    python -m examples.seasons --out out/seasons --only winter --width 640 --samples 16

The sun stands as high as it does in each of the seasons, early or late in the day, and to the left.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from devtools import session

from . import stage
from .close_ups import render
from .haze import add_haze
from .paper.pictures import save_sheet
from .wood import add_wood, cover_all, land, seen_less

ROOT = Path(__file__).resolve().parent.parent
SIZE, SAMPLES = (750, 422), 96
Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """A season's day, its snow, and its light.

    Attributes
    ----------
    day : float
    snow : float
    sun : tuple of float
        Height over the horizon and azimuth where the light comes from, from north to the east; degrees.
    energy : float
    tint : Rgb
        Of sunlight.
    sky : tuple of Rgb
        At the horizon, above it, and at the zenith.
    strength : float
        Of the sky.
    clouds : float
        Fraction of the sky.
    haze : tuple of float and Rgb
        Extinction, 1/m, and airlight.
    gray : float
        Mean that the exposure aims at.
    """

    day: float
    snow: float
    sun: tuple[float, float]
    energy: float
    tint: Rgb
    sky: tuple[Rgb, Rgb, Rgb]
    strength: float
    clouds: float
    haze: tuple[float, Rgb]
    gray: float


LOOKS = {
    "winter": Look(
        18.0, 1.0, (13.0, 296.0), 4.6, (1.0, 0.78, 0.56),
        ((0.92, 0.86, 0.82), (0.44, 0.58, 0.82), (0.10, 0.22, 0.48)), 0.8, 0.45, (0.0008, (0.66, 0.72, 0.82)), 0.50,
    ),
    "spring": Look(
        114.0, 0.0, (30.0, 294.0), 5.0, (1.0, 0.94, 0.84),
        ((0.76, 0.86, 0.96), (0.26, 0.48, 0.86), (0.05, 0.17, 0.50)), 0.85, 0.6, (0.0005, (0.50, 0.64, 0.82)), 0.45,
    ),
    "summer": Look(
        200.0, 0.0, (38.0, 292.0), 5.2, (1.0, 0.95, 0.86),
        ((0.72, 0.84, 0.96), (0.22, 0.44, 0.86), (0.04, 0.15, 0.48)), 0.85, 0.5, (0.0005, (0.50, 0.64, 0.82)), 0.43,
    ),
    "autumn": Look(
        292.0, 0.0, (18.0, 298.0), 5.0, (1.0, 0.86, 0.66),
        ((0.88, 0.86, 0.84), (0.36, 0.53, 0.82), (0.08, 0.22, 0.50)), 0.8, 0.5, (0.0009, (0.66, 0.68, 0.72)), 0.44,
    ),
}  # fmt: skip
#: Sides of the land, meters, and of its part around the eye, of which every blade is planted.
_LAND, _NEAR = 640.0, 130.0
#: Where the eye is and what it looks at, above the land, meters, and its lens.
EYE, AHEAD, LENS = (-9.0, -33.0, 2.0), (2.5, 12.0, 5.6), 31.0
#: Trees of the hill and along its edge, with relative numbers; trees by themselves: species, seed, place, size, age.
_HILL = {"beech": 0.30, "oak": 0.16, "birch": 0.16, "maple": 0.12, "larch": 0.10, "spruce": 0.16}
_EDGE = {"hazel": 0.45, "rowan": 0.25, "birch": 0.15, "bush": 0.15}
_LONE = (
    ("oak", 1, (8.0, 10.0), 1.0, 95.0),
    ("birch", 3, (-13.5, 1.5), 0.95, 0.0),
    ("birch", 8, (-17.0, 5.0), 1.05, 0.0),
    ("birch", 12, (-12.0, 8.5), 0.8, 0.0),
    ("cherry_blossom", 5, (-3.5, 15.0), 1.2, 0.0),
    ("maple", 4, (27.0, 22.0), 0.9, 0.0),
    ("spruce", 2, (-25.0, 22.0), 0.9, 0.0),
    ("spruce", 6, (-29.0, 27.0), 0.7, 0.0),
    ("larch", 7, (-34.0, 30.0), 0.85, 0.0),
)
_WOOD, _MARGIN = "wood", "edge"
#: How much trees of the hill have grown as between others.
_HABIT = 0.35


def height(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the land, meters: a meadow in a shallow dip, and a hill behind it."""
    waves = 0.8 * np.sin(0.024 * x + 0.5) * np.cos(0.03 * y) + 0.12 * np.sin(0.14 * x - 0.11 * y)
    far = np.clip((y - 35.0 + 0.12 * x) / 300.0, 0.0, 1.0)
    return waves + 58.0 * far**1.35 * (1.0 + 0.28 * np.sin(0.011 * x + 0.6)) + 0.0008 * np.maximum(-y, 0.0) ** 2


def wooded(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Meters behind the edge of the wood, which waves."""
    return y - (44.0 + 9.0 * np.sin(0.035 * x + 2.2) + 4.0 * np.sin(0.1 * x) - 0.10 * x)


def build(scene: bpy.types.Scene) -> None:
    """Fill an empty scene with land, trees and what covers the ground; `dress` gives it a season."""
    for species, seed, (x, y), scale, age in _LONE:
        stage.plant(scene, species, seed, (x, y, float(height(np.float64(x), np.float64(y)))), 2.4 * seed, scale, age)
    masks = {_WOOD: lambda x, y: np.clip(wooded(x, y) / 4.0, 0.0, 1.0)}
    masks[_MARGIN] = lambda x, y: np.clip(1.0 - np.abs(wooded(x, y) - 1.0) / 4.5, 0.0, 1.0)
    for name, side, step, hole in (("Near", _NEAR, 2.0, 0.0), ("Far", _LAND, 5.0, _NEAR)):
        ground = land(scene, name, side, step, hole, height, masks, nearest=-60.0)
        add_wood(scene, ground, _WOOD, _HILL, 3.2, 480.0, (0.6, 1.15), _HABIT)
        cover_all(scene, add_wood(scene, ground, _MARGIN, _EDGE, 1.5, 700.0, (0.45, 0.95), 0.0))
    eye, ahead = (Vector((x, y, z + float(height(np.float64(x), np.float64(y))))) for x, y, z in (EYE, AHEAD))
    stage.camera(scene, eye, ahead, lens=LENS, near=0.05)
    scene.tetflora.refine_at_render = False


def dress(scene: bpy.types.Scene, look: Look) -> None:
    """Give the place a season; the one that it had goes."""
    year = scene.tetflora.year
    year.enabled, year.day, year.snow = True, look.day, look.snow
    for old in [o for o in scene.objects if o.type == 'LIGHT' or o.name.startswith("Haze")]:
        bpy.data.objects.remove(old)
    stage.sun(scene, look.sun[0], look.sun[1] - 180.0, look.energy, look.tint, 0.8)
    scene.world = sky(look)
    add_haze(scene, *look.haze, land="Far")


def sky(look: Look) -> bpy.types.World:
    """Three colors from the horizon to the zenith, with clouds; seen less bright than its light, as on film."""
    world = bpy.data.worlds.new("Sky")
    stage.cleared(world)
    tree = world.node_tree
    new, link = tree.nodes.new, tree.links.new
    place, split, ramp = new("ShaderNodeTexCoord"), new("ShaderNodeSeparateXYZ"), new("ShaderNodeValToRGB")
    stops = ramp.color_ramp.elements
    stops.new(0.5)
    for element, position, color in zip(stops, (0.0, 0.16, 0.75), look.sky, strict=True):
        element.position, element.color = position, (*color, 1.0)
    link(place.outputs["Generated"], split.inputs[0])
    link(split.outputs["Z"], ramp.inputs[0])
    background, output = new("ShaderNodeBackground"), new("ShaderNodeOutputWorld")
    seen_less(tree, background, look.strength, 0.85)
    link(_clouds(tree, place, split, ramp.outputs["Color"], look.clouds), background.inputs["Color"])
    link(background.outputs[0], output.inputs["Surface"])
    return world


def _clouds(
    tree: bpy.types.NodeTree,
    place: bpy.types.ShaderNode,
    split: bpy.types.ShaderNode,
    sky: bpy.types.NodeSocket,
    cover: float,
) -> bpy.types.NodeSocket:
    """Clouds on a plane overhead, which come together at the horizon."""
    new, link = tree.nodes.new, tree.links.new
    above, flat, noise = new("ShaderNodeMath"), new("ShaderNodeVectorMath"), new("ShaderNodeTexNoise")
    above.operation, above.inputs[1].default_value = 'ADD', 0.14
    link(split.outputs["Z"], above.inputs[0])
    flat.operation = 'DIVIDE'
    link(place.outputs["Generated"], flat.inputs[0])
    link(above.outputs[0], flat.inputs[1])
    link(flat.outputs[0], noise.inputs["Vector"])
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = 0.9, 9.0
    noise.inputs["Roughness"].default_value = 0.58
    dense = new("ShaderNodeMapRange")
    dense.interpolation_type = 'SMOOTHSTEP'
    for socket, value in (("From Min", 0.68 - 0.4 * cover), ("From Max", 0.95 - 0.4 * cover), ("To Max", 0.8)):
        dense.inputs[socket].default_value = value
    link(noise.outputs[0], dense.inputs["Value"])
    mix = new("ShaderNodeMix")
    mix.data_type = 'RGBA'
    weight = next(s for s in mix.inputs if s.type == 'VALUE' and s.name == "Factor")
    first, second = (s for s in mix.inputs if s.type == 'RGBA')
    link(dense.outputs[0], weight)
    link(sky, first)
    second.default_value = (1.15, 1.13, 1.1, 1.0)
    return next(s for s in mix.outputs if s.type == 'RGBA')


def render_seasons(
    folder: Path, only: tuple[str, ...] = tuple(LOOKS), size: tuple[int, int] = SIZE, samples: int = SAMPLES
) -> list[Path]:
    """Render the place, which the scene holds, in some seasons; the pictures."""
    made = []
    for name in only:
        dress(bpy.context.scene, LOOKS[name])
        made.append(folder / f"{name}.png")
        render(made[-1], size, samples, gray=LOOKS[name].gray)
    return made


def render_sheet(path: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES) -> None:
    """The place in all four seasons, as one picture; in an empty scene."""
    build(bpy.context.scene)
    with tempfile.TemporaryDirectory() as folder:
        made = render_seasons(Path(folder), tuple(LOOKS), size, samples)
        save_sheet([(one, one.stem.capitalize()) for one in made], 2, path)


def main() -> int:
    """Render the sheet of the documentation, or single pictures."""
    parser = stage.words(__doc__, None, SIZE, SAMPLES)
    parser.add_argument("--only", nargs="+", choices=tuple(LOOKS), default=tuple(LOOKS), help="with --out: these alone")
    arguments = parser.parse_args()
    session.start()
    session.clean_file()
    given = stage.size_of(arguments, SIZE), arguments.samples
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        build(bpy.context.scene)
        render_seasons(arguments.out, tuple(arguments.only), *given)
    else:
        render_sheet(ROOT / "docs" / "images" / "seasons.jpg", *given)
    return 0


if __name__ == "__main__":
    sys.exit(main())
