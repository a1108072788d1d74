# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong with a scene before anybody renders it, and what mends it: light, camera, ground, scales, settings.

Looked for a moment after a change, never while panels are drawn; the larger the scene, the less often.
"""

from array import array
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from math import isclose
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...arrays import Floats
from ...jobs import run_to_end
from ...species.kinds import species_of
from ..job.forecast import stored
from ..job.render import render_errors
from ..placing.plant_objects import positions
from ..placing.rules import grounds_of
from ..results.proxy_kinds import few_bounces
from ..runtime import Outlook
from ..scene.crowns import crown_to_draw
from ..scene.fields import field_kinds
from ..scene.objects import in_parts
from ..settings import rules_of

#: Wider ground is large enough for trees, meters.
_SMALL = 10.0
_SIDE = 100.0  # of ground that was too small, meters
#: Light of a world from all around that shows plants; a new file's gray is 0.05.
_DARK = 0.1
_NEAR = 20.0  # meters around the camera where crowns are looked at
_TREE, _BEFORE = 4.0, 5.0  # height from which on a plant has a trunk, and how far one is that hides the view, meters
_CLOSED = 0.6  # of the sky there; half of a picture is nearly black from two thirds on, and well lit at one half
_MANY, _EYE = 300_000, 1.7  # faces of ground to look for the camera below; meters
_OVERHEAD = 3.0  # meters above the camera, where crowns shade it


@dataclass(frozen=True)
class Warned:
    """Something that is wrong."""

    key: str  # names it for `mend`
    #: short, text: In a few letters beside a button, and at length
    short: str
    text: str
    button: str = ""  # what a click does, empty where none can; where ``mend`` is missing, an operator does it
    mend: Callable[[bpy.types.Scene], object] | None = None  # does that to a scene


class _Standing(NamedTuple):
    """What renders of a scene."""

    feet: Floats  # (n, 3): of plants that are objects
    plants: list[bpy.types.Object]
    fields: list[tuple[bpy.types.Object, Floats]]  # with the places (m, 3) of their points
    lamps: list[bpy.types.Object]

    @property
    def place(self) -> Floats:
        """Where all plants stand in the world, (n, 3)."""
        return np.concatenate([self.feet, *(places for _, places in self.fields)])


def warned(context: bpy.types.Context) -> list[Warned]:
    """What was found last in a scene."""
    return _outlook.of(context.scene, context.view_layer) or []


def mend(scene: bpy.types.Scene, key: str) -> bool:
    """Mend one of them; whether it was still there."""
    scene.view_layers[0].update()
    one = next((one for one in run_to_end(_steps(scene)) if one.key == key and one.mend is not None), None)
    if one is not None:
        one.mend(scene)
        _outlook.ask()
    return one is not None


def _steps(scene: bpy.types.Scene, layer: bpy.types.ViewLayer | None = None) -> Generator[None, None, list[Warned]]:
    layer = layer or scene.view_layers[0]
    return list(_look(scene, layer, (yield from _standing(layer))))


def _look(scene: bpy.types.Scene, layer: bpy.types.ViewLayer, standing: _Standing) -> Iterator[Warned]:
    grounds = list(dict.fromkeys(obj for one in scene.tetflora.layers for obj in grounds_of(scene, rules_of(one))))
    settings, camera, place = scene.tetflora, scene.camera, standing.place
    for error in render_errors()[-1:]:
        yield Warned("render", "Render failed", error)
    small, stretched = _grounds(grounds)
    yield from small
    if camera is None and len(place):
        text = "The scene has no camera. Turn the view to where you want to look from; Add puts one there at eye height"
        yield Warned("camera", "No camera", text, "Add")
    elif len(place):
        yield from _camera(scene, standing, _buried(layer, grounds, scene.camera.matrix_world.translation))
    if len(place) and is_dark(scene, standing.lamps):
        text = "There is no sun, lamp or bright sky: shade renders black. Daylight adds a sun and a sky"
        yield Warned("light", "Too dark", text, "Daylight")
    units = scene.unit_settings
    if units.system != 'NONE' and not isclose(units.scale_length, 1.0, rel_tol=1e-3):
        tall = bpy.utils.units.to_string(units.system, 'LENGTH', 20.0 * units.scale_length, precision=2)
        text = f"One unit is 1 m for plants, whatever Unit Scale says: a tree of 20 m shows as {tall}"
        yield Warned("units", "Unit Scale", text, "Set to 1", _setter("unit_settings.scale_length", 1.0))
    if len(place) and settings.refine_at_render and not scene.render.use_lock_interface:
        text = "Lock Interface is off: the window stands still while frames are refined"
        yield Warned("lock", "Lock is off", text, "Turn On", _setter("render.use_lock_interface", True))
    for layer in scene.tetflora.layers:
        if layer.message and not layer.made:
            yield Warned(f"layer {layer.uid}", "No plants", f'"{layer.name}": {layer.message}')
    yield from stretched
    if text := few_bounces(scene):
        yield Warned("bounces", "Few bounces", text, "Raise", _setter("cycles.transparent_max_bounces", 128))


def _setter(path: str, value: object) -> Callable[[bpy.types.Scene], None]:
    """What sets a property of a scene."""
    owner, _, name = path.rpartition(".")
    return lambda scene: setattr(scene.path_resolve(owner), name, value)


def is_dark(scene: bpy.types.Scene, lamps: Iterable[bpy.types.Object]) -> bool:
    """Whether a scene is lit neither by lamps nor by its world."""
    if any(lamp.data.energy > 0.0 and lamp.data.type != 'POINT' for lamp in lamps):  # a point lights no forest
        return False
    world = scene.world
    tree = None if world is None else world.node_tree
    if tree is None:
        return world is None or max(world.color) <= _DARK
    for node in tree.nodes:
        if node.type == 'BACKGROUND':
            color = node.inputs["Color"]
            if color.is_linked or max(color.default_value[:3]) * node.inputs["Strength"].default_value > _DARK:
                return False
    return all(node.type in {'BACKGROUND', 'OUTPUT_WORLD'} for node in tree.nodes)


def _grounds(grounds: list[bpy.types.Object]) -> tuple[list[Warned], list[Warned]]:
    """Grounds of layers that are too small, and those whose scale is not applied."""
    small, stretched = [], []
    for obj in grounds:
        wide = max(obj.dimensions[:2])
        if 0.0 < wide < _SMALL:
            text = f'"{obj.name}" is {wide:.3g} m wide; trees are tens of meters tall. Enlarge makes it 100 m'
            small.append(Warned(f"small {obj.name}", "Small ground", text, "Enlarge", partial(_enlarge, obj)))
        elif obj.parent is None and obj.data.users == 1 and not np.allclose(obj.scale, 1.0, rtol=1e-3):
            text = f'The scale of "{obj.name}" is not applied: textures on it are stretched. Apply makes it 1'
            stretched.append(Warned(f"scale {obj.name}", "Ground scale", text, "Apply", partial(_apply, obj)))
    return small, stretched


def _enlarge(obj: bpy.types.Object, scene: bpy.types.Scene) -> None:
    factor = _SIDE / max(obj.dimensions[:2])
    obj.scale = [factor * value for value in obj.scale]
    if obj.parent is None and obj.data.users == 1:
        _apply(obj, scene)


def _apply(obj: bpy.types.Object, _scene: bpy.types.Scene) -> None:
    obj.data.transform(Matrix.Diagonal((*obj.scale, 1.0)))
    obj.scale = (1.0, 1.0, 1.0)


def _standing(layer: bpy.types.ViewLayer) -> Generator[None, None, _Standing]:
    feet, plants, fields, lamps = array("d"), [], [], []
    for obj in in_parts(layer.objects):
        yield
        group = obj.tetflora
        if obj.hide_render or ((group.is_plant or group.is_field) and not group.enabled):
            continue
        if group.is_plant:
            feet.extend(obj.matrix_world.translation)
            plants.append(obj)
        elif group.is_field and obj.type == 'MESH' and len(obj.data.vertices):
            fields.append((obj, positions(obj)))
        elif obj.type == 'LIGHT':
            lamps.append(obj)
    return _Standing(np.array(feet, np.float64).reshape(-1, 3), plants, fields, lamps)


def _crowns(scene: bpy.types.Scene, standing: _Standing, eye: Floats) -> tuple[Floats, Floats]:
    """Feet (n, 3), and radii and heights (n, 2), of plants near a place, meters; sizes are 0 of unknown crowns."""
    plants: list[tuple] = []  # feet, species, which of these each is, and scales
    for number in np.flatnonzero(np.linalg.norm(standing.feet[:, :2] - eye[:2], axis=1) < _NEAR).tolist():
        obj = standing.plants[number]
        plants.append((standing.feet[[number]], [obj.tetflora.species], [0], obj.matrix_world.median_scale))
    for field, places in standing.fields:
        near = np.flatnonzero(np.linalg.norm(places[:, :2] - eye[:2], axis=1) < _NEAR)
        if len(names := [species_of(kind) for kind in field_kinds(field)]) and len(near):
            which, scale = (stored(field.data, name, near) for name in ("species", "scale"))
            which = np.clip(np.zeros(len(near)) if which is None else which, 0, len(names) - 1).astype(np.int64)
            plants.append((places[near], names, which, 1.0 if scale is None else scale))
    crowns = {name: crown_to_draw(scene, name) for name in {name for _, names, *_ in plants for name in names}}
    size = {name: (0.0, 0.0) if crown is None else (crown.radius, crown.height) for name, crown in crowns.items()}
    feet, sizes = [np.zeros((0, 3))], [np.zeros((0, 2))]
    for foot, names, which, scale in plants:
        feet.append(foot)
        sizes.append(np.array([size[name] for name in names])[which] * np.reshape(scale, (-1, 1)))
    return np.concatenate(feet), np.concatenate(sizes)


def _buried(layer: bpy.types.ViewLayer, grounds: list[bpy.types.Object], eye: Vector) -> float:
    """Meters from a place up to the uppermost ground, where there is none below it; else 0."""
    heights: list[float] = []
    for obj in (one for one in grounds if one.visible_get(view_layer=layer) and len(one.data.polygons) < _MANY):
        if obj.mode == 'OBJECT' and obj.evaluated_get(layer.depsgraph).is_evaluated:
            inverse = obj.matrix_world.inverted_safe()
            for up in (1.0, -1.0):
                along = (inverse.to_3x3() @ Vector((0.0, 0.0, up))).normalized()
                hit, place, *_ = obj.ray_cast(inverse @ eye, along, depsgraph=layer.depsgraph)
                heights += [(obj.matrix_world @ place).z - eye.z] if hit else []
    return max(heights) if min(heights, default=0.0) > 0.0 else 0.0


def _camera(scene: bpy.types.Scene, standing: _Standing, buried: float) -> Iterator[Warned]:
    camera = scene.camera
    eye = np.array(camera.matrix_world.translation)
    feet, sizes = _crowns(scene, standing, eye)
    if buried:
        text = f'"{camera.name}" is below the ground, which hides all. Move lifts it to eye height'
        yield Warned("below", "Too low", text, "Move", partial(_lift, buried + _EYE))
    elif _within(eye, feet, sizes):
        text = f'"{camera.name}" is inside a crown: leaves fill the picture. Move takes it to the nearest open place'
        yield Warned("crown", "In a crown", text, "Move", _step_out)
    above = (sizes[:, 0] ** 2).sum(where=feet[:, 2] + sizes[:, 1] > eye[2] + _OVERHEAD)
    if not buried and above > _CLOSED * _NEAR**2 and scene.view_settings.exposure == 0.0:
        text = "The camera is in a closed wood, which is dark inside. Brighten raises Exposure in Color Management"
        yield Warned("shade", "Dark wood", text, "Brighten", _setter("view_settings.exposure", 2.5))
    text, most = cut_off(scene, standing)
    if text:
        yield Warned("clip", "Clip End", text, "Raise", _setter("camera.data.clip_end", 1.2 * most))


def cut_off(scene: bpy.types.Scene, standing: _Standing | None = None) -> tuple[str, float]:
    """A warning if the camera's range ends before some plants, else an empty text; and how far the last is, meters.

    A new file's camera ends at 100 m: a forest then renders as nothing, and nobody sees why.
    """
    place, camera = (standing or run_to_end(_standing(scene.view_layers[0]))).place, scene.camera
    if camera is None or not len(place):
        return "", 0.0
    to_camera = np.array(camera.matrix_world.normalized().inverted_safe())
    depth, end = -(place @ to_camera[2, :3] + to_camera[2, 3]), getattr(camera.data, "clip_end", np.inf)
    beyond, all_of_them = int((depth > end).sum()), f"{len(place):,} plant{'s' if len(place) > 1 else ''}"
    text = (
        f"{beyond:,} of {all_of_them} are beyond the camera range and invisible; raise the Clip End of "
        f'"{camera.name}", which is {end:g} m'
    )
    return text if beyond else "", float(depth.max())


def _within(eye: Floats, feet: Floats, sizes: Floats) -> bool:
    """Whether a place is within a crown, as far as eyes mind: not at its rim, and not under it beside the trunk."""
    (radius, height), up = sizes.T, eye[2] - feet[:, 2]
    away = np.linalg.norm(eye[:2] - feet[:, :2], axis=1)
    reach = np.where((up > 0.25 * height) | (height < 4.0), 0.6, 0.08) * radius
    return bool(((up >= 0.0) & (up <= height) & (away < reach)).any())


def open_place(scene: bpy.types.Scene, eye: Floats, ahead: Floats) -> Floats:
    """The place (3,) nearest to one (3,), in meters, in no crown and with no trunk close ahead in a direction (3,)."""
    feet, sizes = _crowns(scene, run_to_end(_standing(scene.view_layers[0])), eye)
    trunks, ahead = feet[sizes[:, 1] > _TREE, :2], ahead[:2] / max(np.linalg.norm(ahead[:2]), 1e-6)
    for away in np.arange(0.0, _NEAR, 0.5):
        for angle in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
            place = eye + away * np.array([np.cos(angle), np.sin(angle), 0.0])
            way = trunks - place[:2]
            away_ahead = np.linalg.norm(way, axis=1)
            if not (_within(place, feet, sizes) or ((away_ahead < _BEFORE) & (way @ ahead > 0.9 * away_ahead)).any()):
                return place
    return eye


def _step_out(scene: bpy.types.Scene) -> None:
    eye = scene.camera.matrix_world
    eye.translation = open_place(scene, np.array(eye.translation), -np.array(eye.col[2]))


def _lift(meters: float, scene: bpy.types.Scene) -> None:
    scene.camera.matrix_world.translation.z += meters


_outlook = Outlook(_steps)
register, unregister = _outlook.register, _outlook.unregister
