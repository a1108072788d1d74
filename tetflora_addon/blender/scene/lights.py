# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of a scene: its lights, its world, and the ground that reflects them.

World node trees can be arbitrary. Only the background that leads to the output is read, and the first image or sky that
feeds its color. Blender's skies cannot be evaluated outside of a render; a few measured numbers describe them.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from ...arrays import Floats
from ...files import beside
from ...light.illumination import Sources
from ...light.sources import World
from ...refinement.lights import Light
from ..attributes import image_pixels, linear_rgb, world_matrix
from ..compat import sky_model, tree_in_use
from ..materials.face_looks import Looks
from ..materials.nodes import active_output, upstream
from .objects import read_occluders, renderable_objects

#: What a scene without a world shows.
BLACK = World.plain((0.0, 0.0, 0.0))
#: Rows of an image that are looked at, about.
_ROWS = 256
# Sun's elevations, degrees, of the rows below.
_ELEVATIONS = (2.0, 10.0, 30.0, 60.0, 90.0)
# Radiance above the horizon M + B (z − ½) + C f, with z up and f toward the sun's azimuth; mean radiance D below it;
# irradiance of the sun's disc. RGB each, measured in Cycles 5.2 (128 × 64 pixels) with the node's own defaults, such
# that mean, irradiance of level ground and of what stands toward the sun are kept. 4.5 has the same within 2 %.
_SKIES: dict[str, list[list[float]]] = beside(__file__, "skies.json")


def read_lights(depsgraph: bpy.types.Depsgraph) -> tuple[Light, ...]:
    """Lights that render and shine, by name.

    Instances of lights and lights with an invalid transform are left out. Light linking, textures and the spread of
    areas do not count; of nodes, strength and color of the emission do where they are plain numbers.

    Notes
    -----
    Energies are as Cycles takes them, measured on a white plane within .1 %: a sun's is its irradiance; a point or spot
    of Φ watts sends Φ / 4π W/sr each way, an area Φ / π W/sr ahead.
    """
    lights = []
    for obj in sorted(renderable_objects(depsgraph.view_layer), key=lambda o: o.name_full):
        if obj.type != 'LIGHT':
            continue
        data = obj.evaluated_get(depsgraph).data
        matrix = world_matrix(obj, depsgraph).astype(np.float64)
        length = float(np.linalg.norm(matrix[:3, 2]))
        color = _color(data)
        if not color.any() or not np.isfinite(matrix).all() or length < 1e-9:
            continue
        given = {"position": matrix[:3, 3], "direction": -matrix[:3, 2] / length, "shadow": bool(data.use_shadow)}
        if data.type == 'SUN':
            lights.append(Light('SUN', width=float(data.angle), color=color, **given))
        elif data.type == 'AREA':
            lights.append(_area(data, matrix, color, given))
        else:
            # Without "normalize" the energy is that of a unit surface.
            radius = data.shadow_soft_size
            surface = 1.0 if data.normalize else np.pi * radius**2
            spot = {"angle": data.spot_size / 2.0, "blend": data.spot_blend} if data.type == 'SPOT' else {}
            color = color * surface / (4.0 * np.pi)
            lights.append(Light(data.type, width=2.0 * radius, color=color, **given, **spot))
    return tuple(lights)


def _area(data: bpy.types.AreaLight, matrix: Floats, color: Floats, given: dict) -> Light:
    ellipse = data.shape in {'DISK', 'ELLIPSE'}
    sides = np.array([data.size, data.size_y if data.shape in {'RECTANGLE', 'ELLIPSE'} else data.size])
    span = matrix[:3, :2].T * sides[:, None] / 2.0
    if not data.normalize:
        color = color * np.linalg.norm(np.cross(*span)) * (np.pi if ellipse else 4.0)
    width = 2.0 * float(np.linalg.norm(span, axis=1).max())
    return Light('AREA', width=width, color=color / np.pi, span=span, ellipse=ellipse, **given)


def _color(data: bpy.types.Light) -> Floats:
    """Linear RGB times energy, nodes and exposure included."""
    color = np.array(data.color[:]) * data.energy * 2.0 ** getattr(data, "exposure", 0.0)
    if getattr(data, "use_temperature", False):
        color = color * np.array(data.temperature_color[:])
    output = active_output(tree_in_use(data), 'OUTPUT_LIGHT')
    emission = next(upstream(output.inputs["Surface"]), None) if output is not None else None
    if emission is not None and emission.type == 'EMISSION':
        tint, strength = emission.inputs["Color"], emission.inputs["Strength"]
        color = color * (1.0 if tint.is_linked else np.array(tint.default_value[:3]))
        color = color * (1.0 if strength.is_linked else strength.default_value)
    return np.maximum(color.astype(np.float64), 0.0)


@dataclass(frozen=True)
class WorldLight:
    """Light of the world."""

    world: World
    suns: tuple[Light, ...] = ()  # the sun's disc of a sky
    note: str = ""  # what is not supported and how it counts instead; empty if nothing


def read_world(scene: bpy.types.Scene) -> WorldLight:
    """Light of a scene's world; black without one.

    Notes
    -----
    Of a mapping the turn about the vertical counts. Air, dust and turbidity of skies count as their defaults.
    """
    world = scene.world
    if world is None:
        return WorldLight(BLACK)
    tree = tree_in_use(world)
    if tree is None:
        return WorldLight(World.plain(world.color[:]))
    output = active_output(tree, 'OUTPUT_WORLD')
    nodes = list(upstream(output.inputs["Surface"])) if output else []
    background = next((n for n in nodes if n.type == 'BACKGROUND'), None)
    if background is None:
        return WorldLight(BLACK, note="the world has no Background node and is treated as black" if nodes else "")
    strength, notes = background.inputs["Strength"], []
    factor = 1.0 if strength.is_linked else float(strength.default_value)
    if strength.is_linked:
        notes.append("the Background strength is linked to nodes and is treated as 1")
    if sum(n.type == 'BACKGROUND' for n in nodes) > 1:
        notes.append("the world has several Background nodes; only the one closest to the output is used")
    return WorldLight(*_surroundings(background.inputs["Color"], factor, notes), note="; ".join(notes))


def sky_suns(scene: bpy.types.Scene) -> tuple[Light, ...]:
    """Suns of a scene's world, where that is a sky; images of skies are not searched for any."""
    tree = None if scene.world is None else tree_in_use(scene.world)
    kinds = set() if tree is None else {node.type for node in tree.nodes}
    return read_world(scene).suns if "TEX_SKY" in kinds and "TEX_ENVIRONMENT" not in kinds else ()


def _surroundings(socket: bpy.types.NodeSocket, factor: float, notes: list[str]) -> tuple[World, tuple[Light, ...]]:
    """Sky and suns of what feeds a background's color."""
    if not socket.is_linked:
        return World.plain(np.array(socket.default_value[:3]) * factor), ()
    above = list(upstream(socket))
    turns = (node.inputs.get("Rotation") for node in above if node.type == 'MAPPING')
    turn = sum(float(turn.default_value[2]) for turn in turns if turn is not None and not turn.is_linked)
    for node in above:
        if node.type == 'TEX_ENVIRONMENT' and node.image is not None and all(node.image.size):
            if node.projection != 'EQUIRECTANGULAR':
                notes.append("the world image is a mirror ball and is replaced with its mean color")
            return _image(node, factor, turn), ()
        if node.type == 'TEX_SKY':
            return _sky(node, factor, turn, notes)
        if node.type == 'RGB':
            return World.plain(np.array(node.outputs[0].default_value[:3]) * factor), ()
    notes.append("the world nodes are not supported; a uniform gray of 0.5 is used")
    return World.plain(np.full(3, 0.5) * factor), ()


def _image(node: bpy.types.Node, factor: float, turn: float) -> World:
    image = node.image
    pixels = linear_rgb(image, image_pixels(image))
    if node.projection != 'EQUIRECTANGULAR':
        return World.plain(pixels.mean(axis=(0, 1)) * factor)
    # Means of blocks, so that a small sun is not passed over.
    step = max(1, len(pixels) // _ROWS)
    rows, columns = len(pixels) // step, pixels.shape[1] // step
    pixels = pixels[: rows * step, : columns * step].reshape(rows, step, columns, step, 3).mean(axis=(1, 3))

    def radiance(toward: Floats) -> Floats:
        # As Cycles: u = ½ − φ / 2π, v = ½ + latitude / π, with row 0 lowest.
        longitude = np.arctan2(toward[:, 1], toward[:, 0]) + turn
        column = (0.5 - longitude / (2.0 * np.pi)) % 1.0 * columns
        row = (0.5 + np.arcsin(np.clip(toward[:, 2], -1.0, 1.0)) / np.pi) * rows
        texels = np.minimum(row.astype(int), rows - 1), np.minimum(column.astype(int), columns - 1)
        return pixels[texels].astype(np.float64) * factor

    return World.of(radiance)


def _sky(node: bpy.types.Node, factor: float, turn: float, notes: list[str]) -> tuple[World, tuple[Light, ...]]:
    kind = sky_model(node)
    if kind not in _SKIES:
        notes.append(f"the sky type {node.sky_type} is not supported; SINGLE_SCATTERING is used")
        kind = 'SINGLE_SCATTERING'
    if kind in {'PREETHAM', 'HOSEK_WILKIE'}:
        toward = np.array(node.sun_direction[:], np.float64)
        toward /= max(np.linalg.norm(toward), 1e-9)
    else:
        up, around = node.sun_elevation, node.sun_rotation
        # Turned clockwise, as seen from above, from +Y.
        toward = np.array([np.cos(up) * np.sin(around), np.cos(up) * np.cos(around), np.sin(up)])
    c, s = np.cos(turn), np.sin(turn)
    toward = np.array([c * toward[0] + s * toward[1], c * toward[1] - s * toward[0], toward[2]])
    elevation = np.degrees(np.arcsin(np.clip(toward[2], -1.0, 1.0)))
    row = np.array([np.interp(elevation, _ELEVATIONS, column) for column in zip(*_SKIES[kind], strict=True)])
    mean, rise, ahead, below, disc = row.reshape(5, 3) * factor
    level = toward * [1.0, 1.0, 0.0]
    level /= max(np.linalg.norm(level), 1e-9)

    def radiance(places: Floats) -> Floats:
        height = places[:, 2:]
        above = mean + rise * (height - 0.5) + ahead * (places @ level)[:, None]
        return np.where(height > 0.0, np.maximum(above, 0.0), below)

    suns: tuple[Light, ...] = ()
    if getattr(node, "sun_disc", False) and disc.any() and elevation > 0.0:
        suns = (Light('SUN', np.zeros(3), -toward, float(node.sun_size), color=disc * node.sun_intensity),)
    return World.of(radiance), suns


def read_sources(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Sources:
    """Lights, world, and occluders, which cast shadows and reflect light upward."""
    world = read_world(scene)
    grounds, looks = (o for o in renderable_objects(depsgraph.view_layer) if o.tetflora.is_occluder), Looks()
    colors = [looks.of(ground.active_material, {}).color for ground in grounds]
    ground = np.mean(colors, axis=0) if colors else np.zeros(3)
    return Sources((*read_lights(depsgraph), *world.suns), world.world, read_occluders(depsgraph), ground)
