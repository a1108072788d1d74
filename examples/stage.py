# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What scenes of examples and benchmarks stand on: plants, ground, camera, sun and sky, and words of their commands."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from math import radians
from pathlib import Path

import bpy
from mathutils import Vector

from devtools import session

Place = Sequence[float]
SUNLIGHT = (1.0, 0.94, 0.85)


def plant(
    scene: bpy.types.Scene,
    species: str,
    seed: int,
    place: Place,
    turn: float = 0.0,
    scale: float = 1.0,
    age: float = 0.0,
    name: str = "",
) -> bpy.types.Object:
    """Plant something at a place (3,), turned about its vertical, radians; an age of 0 is full-grown."""
    made = bpy.data.objects.new(name or f"{species} {seed}", None)
    made.location, made.rotation_euler.z, made.scale = place, turn, (scale,) * 3
    made.tetflora.is_plant, made.tetflora.species, made.tetflora.seed = True, species, seed
    made.tetflora.age = age
    scene.collection.objects.link(made)
    return made


def ground(side: float, color: tuple[float, float, float] = (0.16, 0.14, 0.10)) -> bpy.types.Object:
    """A dull square about the origin, of a side in meters."""
    bpy.ops.mesh.primitive_plane_add(size=side)
    made = bpy.context.object
    made.name = "Ground"
    made.data.materials.append(dull("Ground", color))
    return made


def dull(name: str, color: tuple[float, float, float]) -> bpy.types.Material:
    """A new material that scatters light alike to all sides."""
    made = bpy.data.materials.new(name)
    made.diffuse_color = (*color, 1.0)
    nodes, links = cleared(made)
    surface, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    surface.inputs["Color"].default_value = (*color, 1.0)
    links.new(surface.outputs[0], output.inputs["Surface"])
    return made


def cleared(owner: bpy.types.Material | bpy.types.World) -> tuple[bpy.types.Nodes, bpy.types.NodeLinks]:
    """Nodes of a material or world, of which none is left, and their links."""
    tree = _tree(owner)
    tree.nodes.clear()
    return tree.nodes, tree.links


def _tree(owner: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree:
    if owner.node_tree is None:  # before Blender 5.0 new datablocks have no nodes
        owner.use_nodes = True
    return owner.node_tree


def camera(
    scene: bpy.types.Scene,
    eye: Place,
    ahead: Place,
    size: tuple[int, int] | None = None,
    lens: float = 35.0,
    view: float | None = None,
    near: float = 0.1,
    far: float = 3000.0,
    across: float | None = None,
) -> bpy.types.Object:
    """The scene's camera, which looks from one place (3,) to another.

    size: of the image, pixels; view: across the image, radians, instead of a lens; near, far: of what it sees, meters;
    across: meters along the longer side of the image of a view without perspective.
    """
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    made.data.lens, made.data.clip_start, made.data.clip_end = lens, near, far
    if view is not None:
        made.data.sensor_fit, made.data.angle = 'HORIZONTAL', view
    if across is not None:
        made.data.type, made.data.ortho_scale = 'ORTHO', across
    scene.collection.objects.link(made)
    scene.camera = made
    look(scene, eye, ahead)
    if size:
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *size, 100
    return made


def look(scene: bpy.types.Scene, eye: Place, ahead: Place) -> None:
    """Let the camera look from one place (3,) to another."""
    scene.camera.location = eye
    scene.camera.rotation_euler = (Vector(ahead) - Vector(eye)).to_track_quat('-Z', 'Y').to_euler()


def sun(
    scene: bpy.types.Scene,
    elevation: float,
    azimuth: float,
    energy: float = 5.0,
    color: tuple[float, float, float] = SUNLIGHT,
    angle: float = 0.6,
) -> bpy.types.Object:
    """The sun, whose light goes to an azimuth; angles in degrees, its own as well."""
    made = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    made.data.energy, made.data.angle, made.data.color = energy, radians(angle), color
    made.rotation_euler = (radians(90 - elevation), 0, radians(-azimuth))
    scene.collection.objects.link(made)
    return made


def daylight(scene: bpy.types.Scene, elevation: float, azimuth: float) -> None:
    """Sun as of `sun`, and a sky that is blue above and pale at the horizon."""
    sun(scene, elevation, azimuth)
    background = even_sky(scene, strength=0.55)
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    place, split, ramp = (nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "ValToRGB"))
    stops = ramp.color_ramp.elements
    stops[0].position, stops[0].color = 0.0, (0.62, 0.76, 0.92, 1)
    stops[1].position, stops[1].color = 0.5, (0.08, 0.24, 0.70, 1)
    links.new(place.outputs["Generated"], split.inputs[0])
    links.new(split.outputs["Z"], ramp.inputs[0])
    links.new(ramp.outputs["Color"], background.inputs["Color"])


def even_sky(
    scene: bpy.types.Scene, color: tuple[float, float, float] = (1.0, 1.0, 1.0), strength: float = 1.0
) -> bpy.types.ShaderNode:
    """A sky of one color in place of what the scene has; the node that it is."""
    scene.world = bpy.data.worlds.new("Sky")
    background = next(node for node in _tree(scene.world).nodes if node.type == 'BACKGROUND')
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (*color, 1.0), strength
    return background


def instancing(
    name: str, members: bpy.types.Collection
) -> tuple[bpy.types.NodeTree, bpy.types.Node, bpy.types.Node, bpy.types.Node]:
    """Nodes that put members of a collection on points: the tree, what goes in, what places them, what comes out."""
    tree = bpy.data.node_groups.new(name, 'GeometryNodeTree')
    for way in ('INPUT', 'OUTPUT'):
        tree.interface.new_socket("Geometry", in_out=way, socket_type='NodeSocketGeometry')
    kinds = "NodeGroupInput", "GeometryNodeInstanceOnPoints", "NodeGroupOutput", "GeometryNodeCollectionInfo"
    given, placed, made, source = (tree.nodes.new(kind) for kind in kinds)
    source.inputs["Collection"].default_value = members
    source.inputs["Separate Children"].default_value = source.inputs["Reset Children"].default_value = True
    placed.inputs["Pick Instance"].default_value = True
    tree.links.new(source.outputs[0], placed.inputs["Instance"])
    return tree, given, placed, made


def film(scene: bpy.types.Scene, exposure: float = 0.8) -> None:
    """As cameras show what is outdoors."""
    scene.view_settings.exposure, scene.view_settings.look = exposure, 'AgX - Medium High Contrast'


def words(doc: str, out: Path | None, size: tuple[int, int], samples: int) -> argparse.ArgumentParser:
    """A command's line with the words that all pictures have: where to, how wide, and of how many samples."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--out", type=Path, default=out)
    parser.add_argument("--width", type=int, default=size[0], help="of each picture, pixels")
    parser.add_argument("--samples", type=int, default=samples)
    return parser


def size_of(given: argparse.Namespace, size: tuple[int, int]) -> tuple[int, int]:
    """Pixels of a picture that is as wide as was asked for, in the proportions of a size."""
    return given.width, round(given.width * size[1] / size[0])


def make_picture(
    doc: str, name: str, size: tuple[int, int], samples: int, render: Callable[[Path, tuple[int, int], int], None]
) -> None:
    """A command whose function renders one picture of the documentation in an empty scene, or where its words say."""
    given = words(doc, session.ROOT / "docs" / "images" / name, size, samples).parse_args()
    session.start()
    session.clean_file()
    render(given.out, size_of(given, size), given.samples)
