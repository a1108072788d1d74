# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where to look from and in what light: the camera from the view, sun and sky, and what mends what is wrong."""

from math import cos, exp, radians, sin

import bpy
import numpy as np
from bpy.types import Context, Object, Operator, Scene, SpaceView3D, World
from mathutils import Matrix, Vector

from ..tetflora_addon.blender.declare import choice, real, string
from ..tetflora_addon.blender.placing.first_forest import EYE_HEIGHT, sky
from ..tetflora_addon.blender.placing.ground import Ground
from ..tetflora_addon.blender.viewport import state
from ..tetflora_addon.blender.viewport.warnings import mend, open_place
from ..tetflora_addon.camera.camera import Camera
from ..tetflora_addon.parameters import FACTOR, within
from .base import NO_CAMERA, Reporting, in_object_mode

#: Extent of a viewport's longer side at distance 1, times its focal length in millimeters.
_VIEWPORT = 72.0
_OURS = "tetflora_daylight"  # on the sun and the world that Daylight made
_STARTUP_LAMP = 4.07625, 1.00545, 5.90386  # where Blender's startup file has its lamp
_LENS = 28.0  # millimeters, of a camera that is made
_TILT = radians(32.0)  # from above
_AHEAD = 60.0  # meters of ground ahead of a camera at eye height, where there is so much
_SUMMER = 196.0  # day of the year without seasons


class TETFLORA_OT_look(Reporting, Operator, label="Look from Here", needs=(in_object_mode,)):
    """Put the camera where this view looks: at eye height on the ground, over it, or as the view is.

    A camera is made if there is none; one that is animated stays, and a new one becomes active.
    """

    where: choice(
        "Where",
        "Where the camera goes",
        (
            ('EYE', "At Eye Height", "On the ground, 1.7 m above it, in the direction of the view"),
            ('ABOVE', "Over the Ground", "Above all ground, which fills the picture"),
            ('VIEW', "As the View Is", "Exactly where the view is"),
            ('BACK', "Through the Camera", "Leave it there, and look through it or from where it was frozen"),
        ),
    )

    def run(self, context: Context) -> set[str]:
        space, scene = _view(context), context.scene
        frozen = getattr(state.find(scene), "frozen", None)
        if self.where == 'BACK':
            if scene.camera is None and frozen is None:
                return self.failed(NO_CAMERA)
            if space is not None and frozen is not None:
                look_from(space, frozen)
            elif space is not None:
                space.region_3d.view_perspective = 'CAMERA'
            return {'FINISHED'}
        view = space.region_3d.view_matrix.inverted() if space is not None else Matrix.Rotation(_TILT, 4, 'X')
        ground = Ground(context.evaluated_depsgraph_get())
        if self.where != 'VIEW' and not len(ground):
            return self.failed("No mesh is visible to stand on; add a ground mesh, or show it")
        camera = _camera(scene)
        matrix = view
        if self.where == 'EYE':
            matrix = _at_eye_height(scene, ground, view)
        elif self.where == 'ABOVE':
            matrix = _above(ground, view, camera.data)
        camera.matrix_world = matrix
        far = max((matrix.translation - corner).length for corner in _corners(ground)) if len(ground) else 0.0
        camera.data.clip_end = max(camera.data.clip_end, 1.5 * far)
        if space is not None:
            space.region_3d.view_perspective = 'CAMERA'
        return self.done(f'"{camera.name}" looks from here')


def _view(context: Context) -> SpaceView3D | None:
    """The 3D view that was clicked in, else the largest of the window; None in the background."""
    if context.space_data is not None and context.space_data.type == 'VIEW_3D':
        return context.space_data
    areas = [area for area in context.screen.areas if area.type == 'VIEW_3D'] if context.screen else []
    largest = max(areas, key=lambda area: area.width * area.height, default=None)
    return None if largest is None or bpy.app.background else largest.spaces.active


def _camera(scene: Scene) -> Object:
    """The scene's camera, or a new one where there is none that may be moved."""
    camera = scene.camera
    if camera is None or camera.type != 'CAMERA' or camera.animation_data is not None or camera.library is not None:
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        camera.data.lens = _LENS
        scene.collection.objects.link(camera)
        scene.camera = camera
    return camera


def _corners(ground: Ground) -> list[Vector]:
    return [obj.matrix_world @ Vector(corner) for obj in ground.objects for corner in obj.bound_box]


def _at_eye_height(scene: Scene, ground: Ground, view: Matrix) -> Matrix:
    """Upright on the ground under the middle of the view or, if that is in the sky, under the viewer."""
    ahead = view.to_3x3() @ Vector((0.0, 0.0, -1.0))
    flat = Vector((ahead.x, ahead.y, 0.0))
    flat = flat.normalized() if flat.length > 1e-3 else (view.to_3x3() @ Vector((0.0, 1.0, 0.0))).normalized()
    hit = ground.cast(view.translation, ahead)
    corners = np.array(_corners(ground))
    middle = Vector(corners.mean(axis=0))
    below = _on_ground(ground, view.translation)
    near = below != view.translation and view.translation.z - below.z < 10.0
    stand = view.translation if near else (Vector(hit[0]) if hit is not None else middle)
    if not near and (middle - stand).xy.length > 0.2 * (corners.max(axis=0) - corners.min(axis=0))[:2].max():
        flat = Vector(((middle - stand).x, (middle - stand).y, 0.0)).normalized()  # not out over the edge of the ground
    up = Vector((0.0, 0.0, EYE_HEIGHT))
    if not near:  # a small ground lies ahead as a whole
        along = corners @ np.array(flat)
        back = max(float(min(_AHEAD, 0.85 * np.ptp(along)) - along.max()) + stand.dot(flat), 0.0)
        places = (stand + up - part * back * flat for part in (1.0, 0.75, 0.5, 0.25))
        stand = next((place for place in places if _on_ground(ground, place) != place), stand)
    place = Vector(open_place(scene, np.array(_on_ground(ground, stand) + up), np.array(flat)))
    eye = _on_ground(ground, place - up) + up
    turn = (flat + Vector((0.0, 0.0, 0.06))).to_track_quat('-Z', 'Y')
    return Matrix.Translation(eye) @ turn.to_matrix().to_4x4()


def _on_ground(ground: Ground, place: Vector) -> Vector:
    """The ground under or over a place, or the place itself where there is none."""
    hit = ground.cast(Vector((place.x, place.y, place.z + 1e4)), Vector((0.0, 0.0, -1.0)))
    return place.copy() if hit is None else Vector(hit[0])


def _above(ground: Ground, view: Matrix, camera: bpy.types.Camera) -> Matrix:
    """So far and high that all ground is in the picture."""
    corners = np.array(_corners(ground))
    middle, radius = Vector(corners.mean(axis=0)), float(np.linalg.norm(corners - corners.mean(axis=0), axis=1).max())
    ahead = view.to_3x3() @ Vector((0.0, 0.0, -1.0))
    flat = Vector((ahead.x, ahead.y, 0.0))
    flat = flat.normalized() if flat.length > 1e-3 else Vector((0.0, 1.0, 0.0))
    ahead = flat * cos(_TILT) - Vector((0.0, 0.0, sin(_TILT)))
    away = 0.95 * radius / np.tan(camera.angle / 2.0)
    turn = ahead.to_track_quat('-Z', 'Y')
    return Matrix.Translation(middle - ahead * float(away)) @ turn.to_matrix().to_4x4()


def look_from(space: SpaceView3D, camera: Camera) -> None:
    """Turn a viewport to where a camera looks; the image is as wide as the viewport."""
    region = space.region_3d
    region.view_perspective = 'ORTHO' if camera.kind == "ORTHO" else 'PERSP'
    matrix = Matrix(camera.frame.tolist()).to_4x4()
    matrix.translation = (camera.position + camera.origin).tolist()
    left, right, bottom, top = camera.window
    if camera.kind == "PERSP":
        space.lens = min(max(_VIEWPORT / max(right - left, top - bottom), 1.0), 250.0)
    region.view_matrix = matrix.inverted()


class TETFLORA_OT_daylight(Reporting, Operator, label="Daylight"):
    """Add a sun and a sky for an hour of the day, by the latitude and the day of the scene; use again to change them.

    A sun, lamp or world of your own stays as it is.
    """

    hour: real("Hour", "Hour of the day by the sun, which is in the south at 12", 15.0, **within(0.0, high=24.0))
    clouds: real("Clouds", "How much of the sky is covered: at 1 there are no shadows", **FACTOR)
    haze: real("Haze", "How milky the air is", 0.2, **FACTOR)

    def run(self, context: Context) -> set[str]:
        scene = context.scene
        ahead, height = sun_direction(scene, self.hour)
        kept = []
        suns = [o for o in scene.objects if o.type == 'LIGHT' and o.data.type == 'SUN' and not o.hide_render]
        sun = next((o for o in suns if _OURS in o), None)
        if suns and sun is None:
            kept.append(f'the sun "{suns[0].name}"')
        else:
            _shine(scene, sun, ahead, height, self.clouds, self.haze)
        if scene.world is None or _OURS in scene.world or _is_plain(scene.world):
            _cover(scene, height, self.clouds, self.haze)
        else:
            kept.append(f'the world "{scene.world.name}"')
        stay = "stay as they are" if len(kept) > 1 else "stays as it is"
        rest = f"; {' and '.join(kept)} {stay}" if kept else ""
        lamp = scene.objects.get("Light")
        if lamp is not None and not lamp.hide_render and _is_startup_lamp(lamp):
            lamp.hide_viewport = lamp.hide_render = True
            rest += "; the default light is hidden"
        return self.done(f"The sun stands {np.degrees(height):.0f}° high{rest}")


def _is_startup_lamp(obj: Object) -> bool:
    """Whether it is the lamp that Blender starts with, as it was."""
    if obj.type != 'LIGHT' or obj.data.type != 'POINT' or obj.animation_data or obj.data.animation_data:
        return False
    return obj.data.energy == 1000.0 and (obj.matrix_basis.translation - Vector(_STARTUP_LAMP)).length < 1e-3


def sun_direction(scene: Scene, hour: float) -> tuple[Vector, float]:
    """Where the sun is at an hour of the scene's day, from the ground, and its height in radians; +Y is north."""
    year = scene.tetflora.year
    tilt = -radians(23.44) * cos(2.0 * np.pi * ((year.day if year.enabled else _SUMMER) + 10.0) / 365.0)
    turn, latitude = radians(15.0 * (hour - 12.0)), radians(year.latitude)
    up = sin(latitude) * sin(tilt) + cos(latitude) * cos(tilt) * cos(turn)
    east = -cos(tilt) * sin(turn)
    north = cos(latitude) * sin(tilt) - sin(latitude) * cos(tilt) * cos(turn)
    up = max(up, 0.03)  # at night it stands on the horizon
    direction = Vector((east, north, up)).normalized()
    return direction, float(np.arcsin(direction.z))


def _shine(scene: Scene, sun: Object | None, ahead: Vector, height: float, clouds: float, haze: float) -> None:
    """A sun of that height: weaker and redder near the horizon, soft behind clouds."""
    if sun is None:
        sun = bpy.data.objects.new("Daylight sun", bpy.data.lights.new("Daylight sun", 'SUN'))
        sun[_OURS] = True
        scene.collection.objects.link(sun)
    air = (0.1 + 0.25 * haze) * (1.0 / max(sin(height), 0.05) - 1.0)
    sun.data.energy = 5.0 * exp(-air) * (1.0 - clouds) ** 1.5
    sun.data.color = [exp(-air * part) for part in (0.0, 0.35, 0.9)]
    sun.data.angle = radians(0.53 + 12.0 * clouds + 3.0 * haze)
    sun.rotation_mode = 'QUATERNION'
    sun.rotation_quaternion = ahead.to_track_quat('Z', 'Y')
    sun.location = 40.0 * ahead


def _cover(scene: Scene, height: float, clouds: float, haze: float) -> None:
    """A sky: blue above, pale below; gray with clouds, whiter with haze, dim where the sun is low."""
    world = scene.world if scene.world is not None and _OURS in scene.world else sky("Daylight sky")
    if world is not scene.world:
        if scene.world is not None:
            scene.world.use_fake_user = True  # still the artist's: saved although no scene uses it
        world[_OURS] = True
        scene.world = world
    nodes = world.node_tree.nodes
    low, high = (Vector(color) for color in ((0.75, 0.84, 0.93), (0.2, 0.3, 0.51)))
    white = Vector((0.8, 0.82, 0.85))
    ramp = next(node for node in nodes if node.type == 'VALTORGB').color_ramp
    for element, color, milky in zip(ramp.elements, (low, high), (0.5 * haze, 0.6 * haze), strict=True):
        element.color = (*color.lerp(white, milky).lerp(0.75 * white, clouds), 1.0)
    light = min(1.0, 0.25 + 1.3 * sin(height))
    next(node for node in nodes if node.type == 'BACKGROUND').inputs["Strength"].default_value = 0.7 * light


def _is_plain(world: World) -> bool:
    """Whether a world is as in new files: one color, and gray."""
    if world.node_tree is None:
        return max(world.color) - min(world.color) < 1e-4
    nodes = [node for node in world.node_tree.nodes if node.type != 'OUTPUT_WORLD']
    if len(nodes) != 1 or nodes[0].type != 'BACKGROUND' or nodes[0].inputs["Color"].is_linked:
        return False
    color = nodes[0].inputs["Color"].default_value[:3]
    return max(color) - min(color) < 1e-4 and max(color) < 0.06


class TETFLORA_OT_mend(Reporting, Operator, label="Mend", options={'REGISTER', 'UNDO', 'INTERNAL'}):
    """Mend what the panel warns of."""

    what: string("What", "What to mend, as the panel names it")

    def run(self, context: Context) -> set[str]:
        if self.what == "light":
            return bpy.ops.tetflora.daylight()
        if self.what == "camera":
            return bpy.ops.tetflora.look(where='EYE')
        return {'FINISHED'} if mend(context.scene, self.what) else self.refused("It is no longer there")
