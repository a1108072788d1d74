# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One oak at six ages, from left to right, on a meadow; a woman of 1.70 m and a pole of 4 m tell how large it is.

    python -m examples.ages            # docs/images/ages.jpg
    python -m examples.ages --out out/ages.jpg --width 800 --samples 16

All six have the same seed: it is the same individual throughout.
"""

from __future__ import annotations

import sys
import tempfile
from itertools import pairwise
from math import radians, tan
from pathlib import Path

import bpy
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from devtools import session

from . import stage
from .close_ups import render
from .seasons import LOOKS, sky

ROOT = Path(__file__).resolve().parent.parent
SPECIES, SEED = "oak", 1
AGES = (8.0, 18.0, 35.0, 80.0, 300.0, 545.0)
SIZE, SAMPLES = (1600, 540), 96
#: Room between crowns, and before the first and behind the last, meters; sides of the meadow and of its nearer part.
_BETWEEN, _BESIDE = 1.2, 1.6
_SIDE, _VIEW, _EYE = 560.0, radians(26.0), 2.2
#: Trees that close the view: species, how far away, and how many.
_BEHIND, _AWAY, _MANY = ("beech", "birch", "hornbeam", "spruce", "maple"), (270.0, 330.0), 240
_GRAY = 0.47
_FIGURE = 1.7
#: Joints of the figure, in its heights: x, y, z and radius, of the spine, and of a leg and an arm; and what it wears.
_SPINE = (
    (0.0, 0.0, 0.53, 0.085),
    (0.0, -0.005, 0.64, 0.072),
    (0.0, 0.0, 0.79, 0.088),
    (0.0, 0.0, 0.86, 0.034),
    (0.0, -0.01, 0.90, 0.052),
    (0.0, -0.005, 0.955, 0.05),
)
_LIMBS = (
    ((0.052, 0.0, 0.53, 0.058), (0.056, 0.0, 0.29, 0.042), (0.058, 0.008, 0.045, 0.026), (0.066, -0.07, 0.015, 0.02)),
    ((0.10, 0.0, 0.815, 0.04), (0.135, 0.012, 0.64, 0.03), (0.145, -0.02, 0.49, 0.022), (0.145, -0.03, 0.44, 0.018)),
)
_CLOTHES = (
    (0.0, (0.03, 0.025, 0.02)),
    (0.05, (0.05, 0.06, 0.10)),
    (0.5, (0.30, 0.05, 0.035)),
    (0.85, (0.45, 0.26, 0.18)),
    (0.93, (0.07, 0.04, 0.02)),
)


def build(scene: bpy.types.Scene, size: tuple[int, int]) -> list[tuple[float, str]]:
    """Fill an empty scene; where in the image trees stand, 0 to 1, and what to write under each."""
    from tetflora_addon.compiled.sizes import crown_of
    from tetflora_addon.species import ages, catalog

    from .haze import add_haze

    species = catalog.load_species(SPECIES)
    crowns = [crown_of(ages.with_age(species, age)) for age in AGES]
    radius = np.array([max(crown.radius, 1.3) for crown in crowns])
    middle = np.cumsum(np.concatenate([[_BESIDE + radius[0] + 2.6], radius[:-1] + radius[1:] + _BETWEEN]))
    width = middle[-1] + radius[-1] + _BESIDE
    for age, x in zip(AGES, (middle - width / 2).tolist(), strict=True):
        stage.plant(scene, SPECIES, SEED, (x, 0.0, 0.0), age=age)
    first, second = (middle[:2] - width / 2).tolist()
    scene.collection.objects.link(_figure((first - 1.7 - float(radius[0]), -0.6)))
    _pole((second - 1.1 - float(radius[1]), -0.3))
    _close_view(scene)
    distance = width / 2 / tan(_VIEW / 2)
    _meadow(scene, distance)
    camera = stage.camera(scene, (0.0, -distance, _EYE), (0.0, 0.0, _EYE), view=_VIEW, far=2000.0)
    # The trees' feet are a fifth above the lower edge.
    camera.data.shift_y = 0.3 * size[1] / size[0] - _EYE / width
    stage.sun(scene, 44.0, 50.0)
    scene.world = sky(LOOKS["summer"])
    ground = next(o for o in scene.objects if o.type == 'MESH' and o.name.startswith("Grid"))
    ground.name = "Ground"
    add_haze(scene, 0.00025, LOOKS["summer"].haze[1])
    heights = [crown.height for crown in crowns]
    return [
        (float(x / width), f"{age:g} years\n{height:.1f} m")
        for x, age, height in zip(middle, AGES, heights, strict=True)
    ]


def _close_view(scene: bpy.types.Scene) -> None:
    """Trees behind the meadow, as a loose front that becomes denser."""
    u, v = np.mod(0.5 + np.arange(1, _MANY + 1)[:, None] * [0.7548776662, 0.5698402910], 1.0).T
    y = _AWAY[0] + (_AWAY[1] - _AWAY[0]) * np.sqrt(u)
    x = (v - 0.5) * 1.15 * _SIDE
    for i in range(_MANY):
        place = float(x[i]), float(y[i] + 8.0 * np.sin(0.06 * x[i])), 0.0
        stage.plant(scene, _BEHIND[i % len(_BEHIND)], i, place)


def _meadow(scene: bpy.types.Scene, distance: float) -> None:
    from tetflora_addon.blender.placing.cover import cover_steps
    from tetflora_addon.blender.worker import run_to_end

    bpy.ops.mesh.primitive_grid_add(x_subdivisions=90, y_subdivisions=90, size=1.2 * _SIDE)
    ground = bpy.context.object
    ground.location.y = 0.6 * _SIDE - distance + 30.0
    bpy.context.view_layer.update()
    steps = cover_steps(scene, bpy.context.evaluated_depsgraph_get(), scene.tetflora.populate, grounds=[ground])
    run_to_end(steps)


def _figure(place: tuple[float, float]) -> bpy.types.Object:
    """A standing figure as a skeleton with a skin."""
    points, edges = list(_SPINE), [(i, i + 1) for i in range(len(_SPINE) - 1)]
    for side in (-1.0, 1.0):
        for row, joint in zip(_LIMBS, (0, 2), strict=True):
            numbers = range(len(points), len(points) + len(row))
            points += [(side * x, y, z, r) for x, y, z, r in row]
            edges += [(joint, numbers[0]), *pairwise(numbers)]
    mesh = bpy.data.meshes.new("Figure")
    mesh.from_pydata([tuple(_FIGURE * c for c in p[:3]) for p in points], edges, [])
    figure = bpy.data.objects.new("Figure", mesh)
    skin = figure.modifiers.new("Skin", 'SKIN')
    skin.branch_smoothing = 0.6
    for vertex, point in zip(mesh.skin_vertices[0].data, points, strict=True):
        vertex.radius = (_FIGURE * point[3],) * 2
    mesh.skin_vertices[0].data[0].use_root = True
    figure.modifiers.new("Smooth", 'SUBSURF').render_levels = 2
    figure.location, figure.rotation_euler.z = (*place, 0.0), 0.5
    mesh.materials.append(_bands("Clothes", _CLOTHES))
    return figure


def _pole(place: tuple[float, float]) -> None:
    """A ranging pole of 4 m, red and white by the meter."""
    for meter in range(4):
        bpy.ops.mesh.primitive_cylinder_add(radius=0.045, depth=1.0, location=(*place, meter + 0.5))
        color = (0.60, 0.02, 0.02) if meter % 2 == 0 else (0.8, 0.8, 0.8)
        bpy.context.object.data.materials.append(_bands("Pole", ((0.0, color),)))


def _bands(name: str, stops: tuple[tuple[float, tuple[float, float, float]], ...]) -> bpy.types.Material:
    """Colors by the height in the object, without steps between."""
    from tetflora_addon.blender.compat import shader_tree

    material = bpy.data.materials.new(name)
    tree = shader_tree(material)
    tree.nodes.clear()
    new, link = tree.nodes.new, tree.links.new
    place, split, ramp = new("ShaderNodeTexCoord"), new("ShaderNodeSeparateXYZ"), new("ShaderNodeValToRGB")
    ramp.color_ramp.interpolation = 'CONSTANT'
    elements = ramp.color_ramp.elements
    elements.remove(elements[1])
    elements[0].position, elements[0].color = stops[0][0], (*stops[0][1], 1.0)
    for position, color in stops[1:]:
        elements.new(position).color = (*color, 1.0)
    surface, output = new("ShaderNodeBsdfDiffuse"), new("ShaderNodeOutputMaterial")
    link(place.outputs["Generated"], split.inputs[0])
    link(split.outputs["Z"], ramp.inputs[0])
    link(ramp.outputs["Color"], surface.inputs["Color"])
    link(surface.outputs[0], output.inputs["Surface"])
    return material


def labeled(picture: Image.Image, labels: list[tuple[float, str]]) -> Image.Image:
    """The picture with words at its lower edge."""
    picture = picture.convert("RGB")
    font = ImageFont.load_default(max(11.0, picture.width / 72))
    draw = ImageDraw.Draw(picture)
    for x, text in labels:
        at = x * picture.width, picture.height - 0.6 * font.size
        draw.multiline_text(
            at, text, fill="white", font=font, anchor="md", align="center", stroke_width=2, stroke_fill=(20, 25, 15)
        )
    return picture


def render_ages(path: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES) -> None:
    """The oaks as a JPEG; in an empty scene."""
    from .paper.pictures import save_jpeg

    labels = build(bpy.context.scene, size)
    with tempfile.TemporaryDirectory() as folder:
        render(Path(folder) / "ages.png", size, samples, gray=_GRAY)
        save_jpeg(labeled(Image.open(Path(folder) / "ages.png"), labels), path)


def main() -> int:
    """Render the picture of the documentation, or a smaller one."""
    given = stage.words(__doc__, ROOT / "docs" / "images" / "ages.jpg", SIZE, SAMPLES).parse_args()
    session.start()
    session.clean_file()
    render_ages(given.out, stage.size_of(given, SIZE), given.samples)
    return 0


if __name__ == "__main__":
    sys.exit(main())
