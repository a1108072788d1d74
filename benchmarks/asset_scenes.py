# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of the benchmark `assets`: trees scattered by geometry nodes, seen from eye height, in two lights."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, radians, sqrt
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

from examples.daylight import add_daylight
from tetflora_addon.blender import compat

from . import asset_trees

#: Meters between trees, and of the eye above the ground.
SPACING, EYE = 7.0, 1.7
#: Meters from the eye to the edge of the wood.
DISTANCES = {"near": 5.0, "middle": 50.0, "far": 250.0}
#: Elevation of the sun and where its light goes, degrees; the camera looks to 0.
LIGHTS = {"front": (42.0, 35.0), "back": (28.0, 160.0)}
SIZE, PICTURE = (1920, 1080), (320, 180)
#: Holes behind holes that rays go through; Blender's default of 8 makes crowns of cards black.
_TRANSPARENT = 64
#: One tree is seen from so far, in an image so wide, meters.
_ALONE, _WIDE = 200.0, 18.0


@dataclass(frozen=True)
class Scatter:
    """A wood.

    Attributes
    ----------
    kind : str
        Out of `asset_trees.KINDS`.
    instances : int
    distance, light : str
        Out of `DISTANCES` and `LIGHTS`.
    warped : bool
        Instances are stretched, and every other one is mirrored.
    size : tuple of int
        Of the image, pixels.
    quick : bool
        With trees of fewer triangles.
    """

    kind: str = "leaves"
    instances: int = 20
    distance: str = "near"
    light: str = "front"
    warped: bool = False
    size: tuple[int, int] = SIZE
    quick: bool = False


def build(scene: bpy.types.Scene, wanted: Scatter) -> bpy.types.Object:
    """Fill an empty scene with a wood of one asset; its instancer."""
    return furnish(scene, [asset_trees.make(wanted.kind, wanted.quick)], wanted)


def furnish(scene: bpy.types.Scene, trees: list[bpy.types.Object], wanted: Scatter) -> bpy.types.Object:
    """A wood of assets, with meadow, camera, sun and sky; its instancer."""
    assets = bpy.data.collections.new("Assets")
    for tree in trees:
        assets.objects.link(tree)
    scene.collection.children.link(assets)
    bpy.context.view_layer.layer_collection.children[assets.name].exclude = True
    instancer = scatter(scene, assets, wanted.instances, wanted.warped)
    add_meadow(scene, wanted.instances)
    add_camera(scene, DISTANCES[wanted.distance], wanted.size)
    add_daylight(scene, *LIGHTS[wanted.light])
    prepare(scene)
    return instancer


def scatter(
    scene: bpy.types.Scene, assets: bpy.types.Collection, instances: int, warped: bool = False, seed: int = 1
) -> bpy.types.Object:
    """An object whose nodes put so many instances of members of a collection on a jittered grid, turned and scaled.

    The grid begins at y = 0 and is as wide as deep; its object is a patch of ground, which stays in what nodes give.
    """
    side = ceil(sqrt(instances))
    bpy.ops.mesh.primitive_grid_add(size=1.0, x_subdivisions=2, y_subdivisions=2)
    ground = bpy.context.object
    ground.name, ground.data.name = "Scatter", "Scatter"
    wide = side * SPACING
    ground.data.transform(Matrix.Translation((0.0, wide / 2, 0.01)) @ Matrix.Diagonal((wide, wide, 1.0, 1.0)))
    ground.data.materials.append(_plain("Forest floor", (0.09, 0.075, 0.045)))
    ground.modifiers.new("Scatter", 'NODES').node_group = _scatter_nodes(assets, side, instances, warped, seed)
    bpy.context.view_layer.update()
    return ground


def _scatter_nodes(
    assets: bpy.types.Collection, side: int, instances: int, warped: bool, seed: int
) -> bpy.types.GeometryNodeTree:
    tree = bpy.data.node_groups.new("Scatter", 'GeometryNodeTree')
    tree.interface.new_socket("Geometry", in_out='INPUT', socket_type='NodeSocketGeometry')
    tree.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
    new, link = tree.nodes.new, tree.links.new
    given, made, both = new("NodeGroupInput"), new("NodeGroupOutput"), new("GeometryNodeJoinGeometry")
    grid, moved, placed = (
        new("GeometryNodeMeshGrid"),
        new("GeometryNodeSetPosition"),
        new("GeometryNodeInstanceOnPoints"),
    )
    members = new("GeometryNodeCollectionInfo")
    wide = (side - 1) * SPACING
    for name, value in (("Size X", wide), ("Size Y", wide), ("Vertices X", max(side, 2)), ("Vertices Y", max(side, 2))):
        grid.inputs[name].default_value = value
    members.inputs["Collection"].default_value = assets
    members.inputs["Separate Children"].default_value = members.inputs["Reset Children"].default_value = True
    placed.inputs["Pick Instance"].default_value = True
    jitter = 0.3 * SPACING
    middle = wide / 2 + SPACING / 2
    offset = _random(tree, 'FLOAT_VECTOR', (-jitter, middle - jitter, 0.0), (jitter, middle + jitter, 0.0), seed)
    turn = _random(tree, 'FLOAT_VECTOR', (0.0, 0.0, 0.0), (0.0, 0.0, 6.2831853), seed + 1)
    scale = _random(tree, 'FLOAT', 0.7, 1.3, seed + 2)
    link(grid.outputs["Mesh"], moved.inputs["Geometry"])
    link(offset, moved.inputs["Offset"])
    link(moved.outputs[0], placed.inputs["Points"])
    link(members.outputs[0], placed.inputs["Instance"])
    link(turn, placed.inputs["Rotation"])
    link(_random(tree, 'INT', 0, 10_000, seed + 3), placed.inputs["Instance Index"])
    if warped:
        stretch = _random(tree, 'FLOAT_VECTOR', (0.8, 0.8, 0.7), (1.2, 1.2, 1.4), seed + 4)
        mirror = _random(tree, 'INT', 0, 1, seed + 5)
        sign, sized, mirrored = (new("ShaderNodeMath") for _ in range(3))
        sized, mirrored, sides = new("ShaderNodeVectorMath"), new("ShaderNodeVectorMath"), new("ShaderNodeCombineXYZ")
        sign.operation, sign.inputs[1].default_value, sign.inputs[2].default_value = 'MULTIPLY_ADD', -2.0, 1.0
        sized.operation, mirrored.operation = 'SCALE', 'MULTIPLY'
        sides.inputs[1].default_value = sides.inputs[2].default_value = 1.0
        link(mirror, sign.inputs[0])
        link(sign.outputs[0], sides.inputs[0])
        link(stretch, sized.inputs[0])
        link(scale, sized.inputs["Scale"])
        link(sized.outputs[0], mirrored.inputs[0])
        link(sides.outputs[0], mirrored.inputs[1])
        scale = mirrored.outputs[0]
    link(scale, placed.inputs["Scale"])
    # The grid has more points where their number is no square.
    index, fewer = new("GeometryNodeInputIndex"), new("FunctionNodeCompare")
    fewer.data_type, fewer.operation = 'INT', 'LESS_THAN'
    ends = [socket for socket in fewer.inputs if socket.enabled]
    link(index.outputs[0], ends[0])
    ends[1].default_value = instances
    link(fewer.outputs[0], placed.inputs["Selection"])
    link(given.outputs[0], both.inputs[0])
    link(placed.outputs[0], both.inputs[0])
    link(both.outputs[0], made.inputs[0])
    return tree


def _random(
    tree: bpy.types.GeometryNodeTree, kind: str, least: object, most: object, seed: int
) -> bpy.types.NodeSocket:
    node = tree.nodes.new("FunctionNodeRandomValue")
    node.data_type = kind
    sockets = {socket.name: socket for socket in node.inputs if socket.enabled}
    sockets["Min"].default_value, sockets["Max"].default_value, sockets["Seed"].default_value = least, most, seed
    return next(socket for socket in node.outputs if socket.enabled)


def add_meadow(scene: bpy.types.Scene, instances: int) -> None:
    """Ground that reaches beyond the wood."""
    bpy.ops.mesh.primitive_plane_add(size=2.0 * (1000.0 + SPACING * sqrt(instances)))
    bpy.context.object.name = "Meadow"
    bpy.context.object.data.materials.append(_plain("Meadow", (0.12, 0.16, 0.06)))


def add_camera(scene: bpy.types.Scene, distance: float, size: tuple[int, int]) -> None:
    """At eye height, so far before the wood."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens, camera.data.clip_end = 35.0, 10_000.0
    scene.collection.objects.link(camera)
    scene.camera = camera
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    aim(scene, distance)


def aim(scene: bpy.types.Scene, distance: float) -> None:
    """Put the camera so far before the wood, looking at the middle of the first crowns."""
    eye = Vector((0.0, -distance, EYE))
    scene.camera.location = eye
    scene.camera.rotation_euler = (Vector((0.0, SPACING, 5.0)) - eye).to_track_quat('-Z', 'Y').to_euler()


def set_sun(scene: bpy.types.Scene, light: str) -> None:
    """Turn the sun."""
    elevation, azimuth = LIGHTS[light]
    sun = next(obj for obj in scene.objects if obj.type == 'LIGHT')
    sun.rotation_euler = (radians(90.0 - elevation), 0.0, radians(-azimuth))


def prepare(scene: bpy.types.Scene) -> None:
    """What an artist sets for such trees; refinement is called by the benchmark."""
    scene.cycles.transparent_max_bounces = _TRANSPARENT
    scene.view_settings.exposure = 0.6
    scene.tetflora.refine_at_render = False
    bpy.context.view_layer.update()


def alone(scene: bpy.types.Scene, kind: str, quick: bool = False) -> bpy.types.Object:
    """One tree under an even sky, in parallel rays, so far that none of it is near; its instancer."""
    tree = asset_trees.make(kind, quick)
    instancer = furnish(scene, [tree], Scatter(kind, 1))
    for obj in [obj for obj in scene.objects if obj.type == 'LIGHT']:
        bpy.data.objects.remove(obj)
    background = next(node for node in scene.world.node_tree.nodes if node.type == 'BACKGROUND')
    for link in list(background.inputs["Color"].links):
        scene.world.node_tree.links.remove(link)
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (1.0, 1.0, 1.0, 1.0), 0.7
    camera = scene.camera
    camera.data.type = 'ORTHO'
    camera.location, camera.rotation_euler = (0.0, -_ALONE, _WIDE / 2 - 1.0), (radians(90.0), 0.0, 0.0)
    return instancer


def frame(scene: bpy.types.Scene, pixel: float) -> None:
    """Let a pixel of the view of one tree be so large, meters."""
    scene.camera.data.ortho_scale = _WIDE
    scene.render.resolution_x = scene.render.resolution_y = round(_WIDE / pixel)
    bpy.context.view_layer.update()


def store(path: Path, wanted: Scatter) -> None:
    """Save the file that an artist would have."""
    build(bpy.context.scene, wanted)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)


def store_many(path: Path, libraries: list[Path], linked: bool, instances: int) -> None:
    """Save a wood of the trees of library files, linked or with all of them in the file."""
    trees = []
    for library in libraries:
        with bpy.data.libraries.load(str(library), link=linked) as (there, here):
            here.objects = list(there.objects)
        trees += here.objects
    store_trees(path, trees, instances)


def store_trees(path: Path, trees: list[bpy.types.Object], instances: int, unseen: bool = False) -> None:
    """Save a wood of different trees from the middle distance; unseen: it is disabled in viewports."""
    furnish(bpy.context.scene, trees, Scatter(instances=instances, distance="middle")).hide_viewport = unseen
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)


def _plain(name: str, color: tuple[float, float, float]) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    principled = next(node for node in compat.shader_tree(material).nodes if node.type == 'BSDF_PRINCIPLED')
    principled.inputs["Base Color"].default_value = (*color, 1.0)
    principled.inputs["Roughness"].default_value = 1.0
    principled.inputs["Specular IOR Level"].default_value = 0.0
    return material
