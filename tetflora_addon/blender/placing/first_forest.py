# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The first forest: rolling ground, some ninety plants, a camera, the sun and a sky, with plain node trees.

An empty scene, or one as Blender starts with, is used and nothing in it is removed. Else the forest gets a new scene.
"""

from dataclasses import dataclass
from math import radians

import bpy
import numpy as np
from mathutils import Vector

from ...arrays import Floats
from ...growth.hashing import child_key, key_of_seed, uniform
from ...planting.places import Placement
from ...planting.plane import Spacing
from ..attributes import write
from ..compat import shader_tree
from ..materials.bark import tones
from ..materials.nodes import Graph, find_socket
from ..species.catalog import default_species
from ..species.edits import catalog
from ..worker import run_to_end
from .cover import cover_steps
from .plant_objects import add_plants_steps
from .terrain import grid_mesh

NAME = "First forest"
EYE_HEIGHT = 1.7  # meters
SAMPLES = 24
#: Attribute of the ground that is 0 on the path and 1 beside it.
OFF_PATH = "off_path"
FIRST_FOREST = "tetflora_first_forest"  # on the collection, so that it may be renamed
_STARTUP = {"Cube": 'MESH', "Camera": 'CAMERA', "Light": 'LIGHT'}
_WEST, _EAST, _SOUTH, _NORTH = -48.0, 48.0, -14.0, 112.0  # of the ground, meters; the camera looks north
_STEP = 2.0  # meters between the ground's vertices
_CANDIDATES = 4000
_PATH = 2.2  # meters from the middle of the path to its edge


def tread(material: bpy.types.Material) -> None:
    """Trodden earth on a soil where the attribute ``aside`` (meters from the middle of the path) is small."""
    graph = Graph(shader_tree(material), fresh=False)
    color = next(node for node in graph.tree.nodes if node.type == 'BSDF_PRINCIPLED').inputs["Base Color"]
    floor = color.links[0].from_socket
    place = find_socket(graph.node("ShaderNodeTexCoord").outputs, "Object")
    coarse, fine = (
        graph.node("ShaderNodeTexNoise", {"Vector": place, "Scale": scale, "Detail": detail})
        for scale, detail in ((1.2, 5.0), (9.0, 6.0))
    )
    earth = tones(graph, fine, ((0.35, (0.085, 0.06, 0.038)), (0.65, (0.19, 0.14, 0.09))))
    ragged = graph.math('MULTIPLY_ADD', coarse, 1.8, graph.attribute("aside", "Fac"))
    graph.feed(color, graph.mixed(graph.step(ragged, 1.3, 2.6), earth, floor))


def sky(name: str) -> bpy.types.World:
    """Blue above, pale at the horizon.

    What it sheds on the ground has the color of a clear sky, 15,000 K, and a quarter of the sun's strength.
    """
    world = bpy.data.worlds.new(name)
    graph = Graph(shader_tree(world))
    place = find_socket(graph.node("ShaderNodeTexCoord").outputs, "Generated")
    height = graph.node("ShaderNodeSeparateXYZ", {"Vector": place}).outputs["Z"]
    color = tones(graph, height, ((0.0, (0.75, 0.84, 0.93)), (0.45, (0.2, 0.3, 0.51))))
    background = graph.node("ShaderNodeBackground", {"Color": color, "Strength": 0.7})
    graph.node("ShaderNodeOutputWorld", {"Surface": background})
    return world


@dataclass(frozen=True)
class Layer:
    """Plants of one species, placed after the layers before; lengths in meters, ``smallest`` and ``largest`` scale."""

    species: str
    number: int
    spacing: float  # minimum distance to plants of this layer and of those before
    near: float  # distances from the camera
    far: float
    verge: float  # distance from the edge of the path
    smallest: float
    largest: float


LAYERS = (
    Layer("birch", 24, 3.2, 8.0, 62.0, 1.2, 0.8, 1.15),
    Layer("spruce", 22, 3.6, 20.0, 104.0, 3.2, 0.65, 1.15),
    Layer("rowan", 8, 2.2, 7.0, 32.0, 0.9, 0.55, 0.9),
    Layer("fern", 42, 0.7, 2.6, 16.0, 0.1, 0.8, 1.5),
)


def build(context: bpy.types.Context, seed: int) -> tuple[bpy.types.Scene, str]:
    """Make the forest.

    Parameters
    ----------
    seed : int
        Another seed is another forest on the same ground.

    Returns
    -------
    scene : bpy.types.Scene
        The forest's scene, which the window shows.
    note : str
        What happened to earlier objects; empty if there were none.

    Raises
    ------
    SpeciesError
        The catalog is empty.
    """
    default_species()
    scene, note = _scene_for(context)
    collection = bpy.data.collections.new(NAME)
    collection[FIRST_FOREST] = True
    scene.collection.children.link(collection)
    ground = _ground()
    collection.objects.link(ground)
    _plant(scene, seed)
    _cover(scene, ground)
    camera = _camera()
    collection.objects.link(camera)
    scene.camera = camera
    sun = bpy.data.objects.new("Forest sun", bpy.data.lights.new("Forest sun", 'SUN'))
    sun.data.energy, sun.data.angle, sun.data.color = 5.0, radians(0.6), (1.0, 0.93, 0.82)
    sun.location = (-20.0, 10.0, 30.0)  # where it can be seen and grasped; its light comes from everywhere alike
    sun.rotation_euler = (radians(52.0), 0.0, radians(-68.0))
    collection.objects.link(sun)
    if scene.world is not None:
        scene.world.use_fake_user = True  # still the artist's: saved although no scene uses it
    scene.world = sky("First forest sky")
    _settings(scene)
    return scene, note


def height(x: Floats, y: Floats) -> Floats:
    """The ground's height at places on the map, meters; the path lies in a shallow hollow and the land rises beyond."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    waves = 0.5 * np.sin(0.11 * x + 0.6) * np.cos(0.083 * y) + 0.22 * np.sin(0.29 * x - 0.17 * y + 1.0)
    aside = np.abs(x - path(y))
    banks = 0.9 * (1.0 - np.exp(-((aside / 9.0) ** 2)))
    return waves * np.clip(aside / 4.0, 0.25, 1.0) + banks + 5.0 * np.clip((y - 20.0) / 90.0, 0.0, 1.0) ** 2


def path(y: Floats) -> Floats:
    """Where the middle of the path is, x by y, meters."""
    return 5.0 * np.sin(np.asarray(y, float) / 21.0)


def is_startup(scene: bpy.types.Scene) -> bool:
    """Whether a scene holds exactly what Blender starts with, and nobody has touched the cube."""
    if {o.name: o.type for o in scene.objects} != _STARTUP:
        return False
    cube = scene.objects["Cube"]
    corners = {tuple(round(c, 4) for c in v.co) for v in cube.data.vertices}
    plain = {(a, b, c) for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)}
    rest = bool(np.allclose(np.array(cube.matrix_basis), np.eye(4), atol=1e-6))
    return corners == plain and rest and not cube.modifiers and cube.animation_data is None and not cube.children


def _scene_for(context: bpy.types.Context) -> tuple[bpy.types.Scene, str]:
    scene = context.scene
    if not scene.objects:
        return scene, ""
    if is_startup(scene):
        for name in ("Cube", "Light"):
            scene.objects[name].hide_viewport = scene.objects[name].hide_render = True
        return scene, "the default cube and light are hidden, the camera is kept"
    new_scene = bpy.data.scenes.new(NAME)
    if context.window is not None:
        context.window.scene = new_scene
    return new_scene, f'in a new scene; "{scene.name}" is unchanged'


def _ground() -> bpy.types.Object:
    xs, ys = np.arange(_WEST, _EAST + 0.1, _STEP), np.arange(_SOUTH, _NORTH + 0.1, _STEP)
    x, y = np.meshgrid(xs, ys)
    mesh = grid_mesh("Forest ground", np.stack([x, y, height(x, y)], axis=2))
    aside = np.abs(x - path(y)).astype(np.float32).ravel()
    write(mesh, "aside", aside)
    write(mesh, OFF_PATH, np.clip((aside - 1.2) / 2.0, 0.0, 1.0))
    ground = bpy.data.objects.new("Forest ground", mesh)
    ground.tetflora.is_occluder = True
    return ground


def places(seed: int) -> list[Floats]:
    """Places on the map of the plants of each layer, (n, 2) each."""
    standing, out = np.zeros((0, 2)), []
    for number, layer in enumerate(LAYERS):
        keys = child_key(child_key(key_of_seed(seed), number), np.arange(_CANDIDATES))
        # In the camera's view, with more near than far: as many in each meter of depth.
        y = layer.near + (layer.far - layer.near) * uniform(keys, 1)
        x = (2.0 * uniform(keys, 2) - 1.0) * (0.75 * (y + 6.0))
        x = x + path(y) * np.clip(1.0 - y / 60.0, 0.0, 1.0)
        fits = (np.abs(x - path(y)) > _PATH + layer.verge) & (x > _WEST + 2.0) & (x < _EAST - 2.0)
        candidates = np.stack([x, y], axis=1)[fits]
        chosen = candidates[Spacing(layer.spacing, standing).admit(candidates, layer.number)]
        standing = np.concatenate([standing, chosen])
        out.append(chosen)
    return out


def _plant(scene: bpy.types.Scene, seed: int) -> None:
    known = catalog()
    for number, (layer, place) in enumerate(zip(LAYERS, places(seed), strict=True)):
        keys = child_key(child_key(key_of_seed(seed), 100 + number), np.arange(len(place)))
        scale = layer.smallest + (layer.largest - layer.smallest) * uniform(keys, 1)
        position, azimuth = np.column_stack([place, height(*place.T)]), 2.0 * np.pi * uniform(keys, 2)
        species, seeds = np.zeros(len(place), np.int32), (uniform(keys, 3) * 2**31).astype(np.int32)
        placement = Placement(position, azimuth, scale, species, seeds, layer.number)
        run_to_end(add_plants_steps(scene, placement, [layer.species if layer.species in known else default_species()]))


def _cover(scene: bpy.types.Scene, ground: bpy.types.Object) -> None:
    """Cover the ground beside the path; the population of the cover is not the active one."""
    layer = scene.view_layers[0]
    layer.update()
    masks = {"vertex_group": OFF_PATH}
    run_to_end(cover_steps(scene, layer.depsgraph, scene.tetflora.populate, grounds=[ground], masks=masks))
    tread(ground.material_slots[0].material)
    scene.tetflora.layers_index = -1  # Populate begins with settings for a new one


def _camera() -> bpy.types.Object:
    camera = bpy.data.objects.new("Forest camera", bpy.data.cameras.new("Forest camera"))
    eye = Vector((float(path(-2.0)), -2.0, float(height(path(-2.0), -2.0)) + EYE_HEIGHT))
    target = Vector((1.5, 20.0, float(height(path(20.0), 20.0)) + 4.2))
    camera.location = eye
    camera.rotation_euler = (target - eye).to_track_quat('-Z', 'Y').to_euler()
    camera.data.lens, camera.data.clip_end = 28.0, 1000.0
    return camera


def _settings(scene: bpy.types.Scene) -> None:
    """Quick settings for Refine and renders, and the species of the forest for new layers and the brush."""
    scene.tetflora.quality = 'DRAFT'
    mix, known_species = scene.tetflora.populate.mix, catalog()
    for layer in LAYERS if not mix else ():
        if layer.species in known_species:
            entry = mix.add()
            entry.species, entry.weight = layer.species, 0.1 * layer.number
    # Only what is as in new scenes: all else is the artist's choice.
    new = bpy.data.scenes.new("")
    wanted = {"render": {"resolution_x": 1280, "resolution_y": 720, "resolution_percentage": 50}}
    wanted["view_settings"] = {"exposure": 0.9}
    if hasattr(scene, "cycles"):
        wanted["render"]["engine"] = 'CYCLES'
        wanted["cycles"] = {"samples": SAMPLES, "use_denoising": True, "use_adaptive_sampling": True}
        wanted["cycles"] |= {"adaptive_threshold": 0.1, "max_bounces": 4}
    for group, values in wanted.items():
        current, fresh = getattr(scene, group), getattr(new, group)
        for name, value in values.items():
            if getattr(current, name) == getattr(fresh, name):
                setattr(current, name, value)
    bpy.data.scenes.remove(new)
