# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The active camera: its window, its lens, its movement while the shutter is open, and the other eyes of stereo."""

import math
from dataclasses import replace

import bpy
import numpy as np
from bpy.types import Area, Depsgraph, Region, RenderSettings, Scene, SpaceView3D

from ...arrays import Floats
from ...camera.camera import Camera
from ...errors import SceneError
from ..attributes import frames_of, moves, world_matrix
from .motion import at_moments, exposure

_NARROW = 1e-9  # of windows that single precision turns into nothing
#: Half of the angle of view below which a fisheye is no whole sphere, radians.
_NARROW_FISHEYE = math.pi / 4.0
#: Radians from the axis that such a part of the sphere has at least.
_LEAST_HALF = 0.1


def read_camera(scene: Scene, depsgraph: Depsgraph, region_only: bool = False, blurred: bool = True) -> Camera:
    """The active camera as it is evaluated now.

    ``camera.view_frame`` already knows about lens shift, sensor fit and pixel aspect. A scaled or sheared camera is
    taken without scale and shear, as renderers do. Panoramas other than equirectangular ones count as images of the
    whole sphere with the same number of pixels per angle, or narrow fisheyes as a part of it. Stereo counts as
    movement: the view is as wide as both eyes need.

    Parameters
    ----------
    region_only : bool
        Of the render region, if there is one, instead of the whole image. Panoramas are always whole.
    blurred : bool
        With its movement while the shutter is open, for which a scene is made for a moment.

    Raises
    ------
    SceneError
        No camera, not a camera, an unknown type, no depth between the clip planes, or an invalid transform.
    """
    if scene.camera is None:
        raise SceneError(
            f'The scene "{scene.name}" has no active camera; add one (Add > Camera) '
            "or choose one in the Scene properties"
        )
    name, data = scene.camera.name, scene.camera.evaluated_get(depsgraph).data
    if scene.camera.type != 'CAMERA':
        raise SceneError(f'The active camera "{name}" is not a camera object; choose a camera in the Scene properties')
    if data.type not in {'PERSP', 'ORTHO', 'PANO'}:
        raise SceneError(
            f'The camera "{name}" is not perspective, orthographic or panoramic; '
            "change its Lens Type in the camera properties"
        )
    if not 0.0 < data.clip_start < data.clip_end:
        raise SceneError(f'The camera "{name}" sees nothing; raise its Clip End above its Clip Start')
    size = scene.render.resolution_percentage / 100.0
    width = max(int(scene.render.resolution_x * size), 1)
    height = max(int(scene.render.resolution_y * size), 1)
    if data.type == 'PANO':
        window, width, height = _panorama(data, width, height)
    else:
        corners = np.array(data.view_frame(scene=scene))  # (4, 3), camera space
        plane = corners[:, :2] / -corners[:, 2:] if data.type == 'PERSP' else corners[:, :2]
        (left, bottom), (right, top) = plane.min(axis=0).tolist(), plane.max(axis=0).tolist()
        window = (left, right, bottom, top)
    if not (window[1] - window[0] > _NARROW and window[3] - window[2] > _NARROW):  # false for nan as well
        what = {'ORTHO': "Orthographic Scale", 'PANO': "Field of View or Lens"}.get(data.type, "Sensor Size")
        raise SceneError(f'The camera "{name}" sees nothing; raise its {what} above 0')
    if region_only and scene.render.use_border and data.type != 'PANO':
        window, width, height = _region(scene.render, window, width, height)
    matrix = world_matrix(scene.camera, depsgraph).astype(np.float64)  # some versions give single precision
    clip, lens = (float(data.clip_start), float(data.clip_end)), _lens(data, matrix, depsgraph)
    camera = _placed(Camera(data.type, np.zeros(3), np.eye(3), window, *clip, width, height, *lens), matrix)
    if camera is None:
        raise SceneError(
            f'The camera "{name}" has zero scale, a scale above 100,000, or an invalid position; '
            "clear them with Alt S and Alt G"
        )
    moved = _while_open(scene, depsgraph, camera, window) if blurred else ()
    return replace(camera, shutter=(*moved, *_stereo_views(scene, camera, depsgraph)))


def _region(
    render: RenderSettings, window: tuple[float, float, float, float], width: int, height: int
) -> tuple[tuple[float, float, float, float], int, int]:
    """The window of the render region, in whole pixels, and its size."""
    first_x, last_x = math.floor(render.border_min_x * width), math.ceil(render.border_max_x * width)
    first_y, last_y = math.floor(render.border_min_y * height), math.ceil(render.border_max_y * height)
    if not (0 <= first_x < last_x <= width and 0 <= first_y < last_y <= height):
        return window, width, height  # Blender renders all of it then
    left, right, bottom, top = window
    step_x, step_y = (right - left) / width, (top - bottom) / height
    across = left + first_x * step_x, left + last_x * step_x
    up = bottom + first_y * step_y, bottom + last_y * step_y
    return (*across, *up), last_x - first_x, last_y - first_y


def _placed(camera: Camera, matrix: Floats, window: tuple[float, float, float, float] | None = None) -> Camera | None:
    """The camera at the place of a matrix; None if that is invalid."""
    frame, _, sound = frames_of(matrix[None, :3, :3])
    if not (sound[0] and np.isfinite(matrix).all()):
        return None
    left, right, bottom, top = window or camera.window
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        # A mirrored camera sees the same pyramid from the other side.
        left, right = -right, -left
    return replace(camera, position=matrix[:3, 3].copy(), frame=frame[0], window=(left, right, bottom, top))


def _panorama(data: bpy.types.Camera, width: int, height: int) -> tuple[tuple[float, float, float, float], int, int]:
    """Window in radians of longitude and latitude, of no extent where the lens is no number; and size of the image."""
    if data.panorama_type == 'EQUIRECTANGULAR':
        left, right = sorted((data.longitude_min, data.longitude_max))
        bottom, top = sorted((data.latitude_min, data.latitude_max))
        right = min(max(right, left + 1e-3), left + 2.0 * math.pi)
        bottom, top = max(bottom, -math.pi / 2.0), min(max(top, bottom + 1e-3), math.pi / 2.0)
        return (left, right, bottom, top), width, height
    half = data.fisheye_fov / 2.0  # between the axis and what is farthest from it in the image
    if data.panorama_type == 'FISHEYE_EQUIDISTANT':
        angle = data.fisheye_fov / max(min(width, height), 1)
    elif data.panorama_type == 'FISHEYE_EQUISOLID':
        # r = 2 f sin(θ / 2): in the middle a pixel spans its size on the sensor over the focal length.
        angle = data.sensor_width / max(width, height) / max(data.fisheye_lens, 1e-3)
        half = min(half, 2.0 * math.asin(min(angle * math.hypot(width, height) / 4.0, 1.0)))
    else:
        half, angle = math.pi, 2.0 * math.pi / max(width, 2 * height)
    if not (angle > 0.0 and half > 0.0):  # nan as well
        return (0.0, 0.0, 0.0, 0.0), width, height
    if half < _NARROW_FISHEYE:  # the whole sphere would have as many more pixels as the view is narrow
        # The first buffer of the loop has 32 pixels for each 90°: some have to be in the view.
        pixels = max(math.ceil(2.0 * max(half, _LEAST_HALF) / angle), 1)
        half = pixels * angle / 2.0
        return (-half, half, -half, half), pixels, pixels
    pixels = max(round(math.pi / angle), 1)
    return (-math.pi, math.pi, -math.pi / 2.0, math.pi / 2.0), 2 * pixels, pixels


def _lens(data: bpy.types.Camera, matrix: Floats, depsgraph: Depsgraph) -> tuple[float, float]:
    """Radius of the aperture and distance of focus, meters; a radius of 0 without depth of field.

    The lens's diameter is its focal length over the f-stop; for Cycles, that of an orthographic camera is 1 m.
    """
    dof = data.dof
    if not dof.use_dof or dof.aperture_fstop <= 0.0:
        return 0.0, math.inf
    length = 1.0 if data.type == 'ORTHO' else data.lens * 1e-3
    focus = dof.focus_distance
    if dof.focus_object is not None:
        toward = world_matrix(dof.focus_object, depsgraph)[:3, 3] - matrix[:3, 3]
        back = matrix[:3, 2] / max(np.linalg.norm(matrix[:3, 2]), 1e-12)
        focus = float(abs(toward @ back))
    return length / (2.0 * dof.aperture_fstop), max(float(focus), 1e-3)


def _while_open(
    scene: Scene, depsgraph: Depsgraph, camera: Camera, window: tuple[float, float, float, float]
) -> tuple[Camera, ...]:
    """The camera when the shutter opens and closes, if motion blur is on and it is animated; see `motion`."""
    if not scene.render.use_motion_blur or not moves(scene.camera):
        return ()
    frames = [f for f in exposure(scene) if not math.isclose(f, scene.frame_current_final, abs_tol=1e-6)]

    def look() -> Camera | None:
        return _placed(camera, world_matrix(scene.camera, depsgraph).astype(np.float64), window)

    cameras = [other for other in at_moments(depsgraph, [scene.camera], frames, look) if other is not None]
    near = (np.allclose(o.position, camera.position, atol=1e-6) for o in cameras)
    alike = (np.allclose(o.frame, camera.frame, atol=1e-7) for o in cameras)
    return () if all(near) and all(alike) else tuple(cameras)


def _stereo_views(scene: Scene, camera: Camera, depsgraph: Depsgraph) -> tuple[Camera, ...]:
    """Cameras that a scene renders beside its active one; none without stereoscopy.

    *Stereo 3D* moves the camera by half of the distance of the eyes to either side (or all of it, by the pivot), and
    lets the views meet at the distance of convergence: by shifting the window, by turning the camera, or not at all.
    *Multi-View* has a camera for each suffix of a name.
    """
    render = scene.render
    if not render.use_multiview or camera.kind == "PANO":
        return ()
    if render.views_format == 'MULTIVIEW':
        return _by_suffix(scene, camera, depsgraph)
    stereo = scene.camera.data.stereo
    eyes = {'CENTER': (-0.5, 0.5), 'LEFT': (0.0, 1.0), 'RIGHT': (-1.0, 0.0)}[stereo.pivot]
    cameras = []
    for side in (eye * stereo.interocular_distance for eye in eyes):
        if side == 0.0:
            continue
        moved = replace(camera, position=camera.position + side * camera.frame[:, 0])
        away = max(stereo.convergence_distance, 1e-3)
        if stereo.convergence_mode == 'OFFAXIS':
            left, right, bottom, top = camera.window
            shift = -side / away if camera.kind == "PERSP" else 0.0
            moved = replace(moved, window=(left + shift, right + shift, bottom, top))
        elif stereo.convergence_mode == 'TOE':
            angle = math.atan2(side, away)
            c, s = math.cos(angle), math.sin(angle)
            moved = replace(moved, frame=camera.frame @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]))
        cameras.append(moved)
    return tuple(cameras)


def _by_suffix(scene: Scene, camera: Camera, depsgraph: Depsgraph) -> tuple[Camera, ...]:
    """Cameras whose names differ from the active one's by the suffixes of the scene's views."""
    suffixes = [view.camera_suffix for view in scene.render.views if view.use and view.camera_suffix]
    name = scene.camera.name
    base = next((name.removesuffix(s) for s in suffixes if name.endswith(s)), None)
    if base is None:
        return ()
    cameras = []
    for other in (scene.objects.get(base + suffix) for suffix in suffixes):
        if other is None or other.type != 'CAMERA' or other == scene.camera:
            continue
        if (placed := _placed(camera, world_matrix(other, depsgraph).astype(np.float64))) is not None:
            cameras.append(replace(placed, window=camera.window))
    return tuple(cameras)


#: Depths, of the far clipping depth, from which on an orthographic view shows things.
_NEAREST = 1e-6


def timeline_moves() -> bool:
    """Whether an animation is played, or a frame is dragged, in any window."""
    manager = bpy.context.window_manager
    screens = [window.screen for window in ([] if manager is None else manager.windows)]
    return any(screen.is_animation_playing or screen.is_scrubbing for screen in screens)


def viewports(scene: Scene) -> list[tuple[SpaceView3D, Area]]:
    """Viewports that show a scene, in all windows."""
    manager = bpy.context.window_manager
    windows = [window for window in ([] if manager is None else manager.windows) if window.scene == scene]
    areas = [area for window in windows for area in window.screen.areas if area.type == 'VIEW_3D']
    return [(area.spaces.active, area) for area in areas]


def views_of(scene: Scene) -> list[Floats]:
    """Matrices (4, 4) from the world to clip space of all viewports that show a scene, as they were last drawn."""
    views = [view for space, _ in viewports(scene) for view in (space.region_quadviews or [space.region_3d])]
    return [np.array(view.perspective_matrix, np.float64) for view in views]


def is_rendered(scene: Scene) -> bool:
    """Whether a viewport shows a scene in *Rendered* shading."""
    return any(space.shading.type == 'RENDERED' for space, _ in viewports(scene))


def viewport_of(scene: Scene) -> tuple[SpaceView3D, Region] | None:
    """The viewport to refine a scene for: with rendered shading if there is one, with a view of its own, the largest.

    None where that one looks through the camera, or where there is no window.
    """
    candidates = []
    for space, area in viewports(scene):
        region = next((r for r in area.regions if r.type == 'WINDOW'), None)
        if region is not None and min(region.width, region.height) > 1:
            free = space.region_3d.view_perspective != 'CAMERA'
            candidates.append(((space.shading.type == 'RENDERED', free, region.width * region.height), space, region))
    best = max(candidates, key=lambda one: one[0], default=None)
    return None if best is None or not best[0][1] else best[1:]


def view_camera(scene: Scene) -> Camera | None:
    """The view of the viewport that `viewport_of` finds; None where there is none."""
    viewport = viewport_of(scene)
    if viewport is None:
        return None
    space, region = viewport
    view, projection = (np.array(m, np.float64) for m in (space.region_3d.view_matrix, space.region_3d.window_matrix))
    return _camera_of(view, projection, (space.clip_start, space.clip_end), (region.width, region.height))


def _camera_of(view: Floats, projection: Floats, clip: tuple[float, float], size: tuple[int, int]) -> Camera:
    """The camera of the matrices (4, 4) that OpenGL draws with, to camera space and on to the cube that is drawn.

    Orthographic views show as far behind them as before them.
    """
    to_world = np.linalg.inv(view)
    frame = to_world[:3, :3] / np.linalg.norm(to_world[:3, :3], axis=0)
    position, (near, far) = to_world[:3, 3], clip
    ortho = abs(projection[3, 3] - 1.0) < 1e-6
    middle = -projection[:2, 3] if ortho else projection[:2, 2]
    scale = np.array([projection[0, 0], projection[1, 1]])
    (left, bottom), (right, top) = ((end + middle) / scale for end in (-1.0, 1.0))
    if ortho:
        position, far = position + far * frame[:, 2], 2.0 * far
        near = _NEAREST * far
    kind = "ORTHO" if ortho else "PERSP"
    window = float(left), float(right), float(bottom), float(top)
    return Camera(kind, position, frame, window, float(near), float(far), *size)
