# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw previews over 3D viewports: plants, tetrahedra, the frozen camera, figures. Nothing is drawn without a window.

Batches that do not depend on the view are kept. Translucent tetrahedra are as many as the last view drew in time.
"""

import sys
import time
import traceback
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import blf
import bpy
import gpu
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Floats32
from ...camera.camera import Camera
from ...preview.levels import FORMS, THICK, Level, Levels, as_shown, colors_of, drawable, project
from ...preview.light_plants import CrownPoints, Shapes, nearest
from ...refinement.decisions import Decision
from ...tetrahedra.geometry import EDGES
from ..results.collection import result_collections
from . import state
from .state import Preview, TetFloraPreview

#: Tetrahedra whose edges are drawn; of more, those that change most pixels.
MOST_WIRES = 60_000
_WIRE_ALPHA = 0.7
#: Opacity under which a translucent tetrahedron is left out: less than a screen tells apart.
_FAINT = 0.004
#: Seconds that making translucent tetrahedra of a view may take, and how many they are at least and at most.
_MOMENT = 0.03
_LEAST, _MOST = 500, 20_000
_FROZEN = (1.0, 0.75, 0.2, 1.0)
_TEXT, _COMPLAINT = (0.95, 0.95, 0.95, 1.0), (1.0, 0.7, 0.3, 1.0)
_SOURCES = Path(__file__).parent
_handles: list[object] = []


def batch(kind: str, positions: NDArray, colors: NDArray, indices: NDArray) -> gpu.types.GPUBatch:
    """A batch of 'LINES' or 'TRIS' with a color (v, 4) for each corner (v, 3)."""
    corners = _buffer(pos=positions.astype(np.float32), color=np.rint(255.0 * colors).astype(np.uint8))
    elements = gpu.types.GPUIndexBuf(type=kind, seq=np.ascontiguousarray(indices, np.int32))
    return gpu.types.GPUBatch(type=kind, buf=corners, elem=elements)


def _buffer(**columns: NDArray) -> gpu.types.GPUVertBuf:
    """Columns (v, k) of corners or points by their names: float32, or uint8 from 0 to 1."""
    layout = gpu.types.GPUVertFormat()
    for name, values in columns.items():
        kind, mode = ('U8', 'INT_TO_FLOAT_UNIT') if values.dtype == np.uint8 else ('F32', 'FLOAT')
        layout.attr_add(id=name, comp_type=kind, len=values.shape[1], fetch_mode=mode)
    buffer = gpu.types.GPUVertBuf(layout, len(values))
    for name, values in columns.items():
        buffer.attr_fill(name, np.ascontiguousarray(values))
    return buffer


def chosen_by_worth(level: Level, forms: set[str], most: int) -> NDArray[np.intp]:
    """Places (k,) in a level of tetrahedra of some forms, at most so many, those that change most pixels first."""
    wanted = np.flatnonzero(np.isin(level.decision, [Decision[name] for name in forms]))
    if len(wanted) <= most:
        return wanted
    return wanted[np.argsort(-level.contribution[wanted], kind="stable")[:most]]


def wires(levels: Levels, level: Level, color: str, forms: set[str]) -> gpu.types.GPUBatch | None:
    """Edges of a level's tetrahedra; None where there are none."""
    tetrahedra = chosen_by_worth(level, forms, MOST_WIRES)
    if len(tetrahedra) == 0:
        return None
    vertices = levels.vertices(level, tetrahedra)
    shown = colors_of(level, color, int(levels.levels[-1].depth.max()))[tetrahedra]
    colors = np.repeat(_opaque(shown, _WIRE_ALPHA), 4, axis=0)
    indices = EDGES[None] + 4 * np.arange(len(tetrahedra))[:, None, None]
    return batch('LINES', vertices.reshape(-1, 3), colors, indices.reshape(-1, 2))


def translucent(
    levels: Levels, level: Level, forms: set[str], camera: Camera, most: int
) -> tuple[gpu.types.GPUBatch | None, int]:
    """Projected tetrahedra of a level as a camera sees them, farthest first, and how many they are."""
    tetrahedra = chosen_by_worth(level, forms, most)
    tetrahedra = tetrahedra[drawable(levels.vertices(level, tetrahedra), camera)]
    if len(tetrahedra) == 0:
        return None, 0
    tetrahedra = levels.back_to_front(level, camera, tetrahedra)
    projected = project(levels.vertices(level, tetrahedra).astype(np.float64), level.extinction[tetrahedra], camera)
    colors = np.zeros((len(tetrahedra), 5, 4), np.float32)
    colors[:, :, :3] = as_shown(level.color[tetrahedra])[:, None]
    colors[:, THICK, 3] = projected.opacity
    triangles = projected.triangles[projected.opacity[projected.triangles[:, 0] // 5] > _FAINT]
    if len(triangles) == 0:
        return None, 0
    return batch('TRIS', projected.corners.reshape(-1, 3), colors.reshape(-1, 4), triangles), len(tetrahedra)


def plants(shapes: Shapes) -> gpu.types.GPUBatch | None:
    """All plants that are a mesh; None where there are none."""
    if len(shapes.positions) == 0:
        return None
    kind = 'TRIS' if shapes.indices.shape[1] == 3 else 'LINES'
    return batch(kind, shapes.positions, _opaque(shapes.colors, 1.0), shapes.indices)


def points(preview: Preview) -> gpu.types.GPUBatch:
    """All plants as points with the form and color of their crowns; on another day only colors go to the card."""
    crowns = preview.shapes.crowns
    # What is kept holds the array too: another one cannot come to lie at its address.
    _, standing = _kept(preview, "standing", (id(crowns.positions),), lambda: (crowns.positions, _standing(crowns)))
    shown = np.column_stack([as_shown(crowns.looks[:, :3]), crowns.looks[:, 3]])
    overlay = gpu.types.GPUBatch(type='POINTS', buf=standing)
    overlay.vertbuf_add(_buffer(look=np.rint(255.0 * np.clip(shown, 0.0, 1.0)).astype(np.uint8)[crowns.kinds]))
    return overlay


def _standing(crowns: CrownPoints) -> gpu.types.GPUVertBuf:
    forms = crowns.forms.copy()
    forms[:, :2] *= np.abs(crowns.axes[:, 2:])  # what lies is not high
    return _buffer(pos=crowns.positions, form=forms)


@cache
def _crown_shader() -> gpu.types.GPUShader:
    """A point as high as its plant, with the outline of trunk and crown as in `light_plants`, or rounder from above."""
    passed = gpu.types.GPUStageInterfaceInfo("crown_interface")
    for kind, name in (('VEC3', "color"), ('VEC4', "shape"), ('FLOAT', "low"), ('FLOAT', "pixels")):
        passed.flat(kind, name)
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant('VEC4', "view")  # pixels of a meter at a depth of 1, how far one looks down, 0 to 1
    info.push_constant('VEC4', "eye")  # whence, and from which height over the distance on, plants have faces
    return _shader("crown", info, passed, {"pos": 'VEC3', "form": 'VEC4', "look": 'VEC4'})


@cache
def _faces_shader() -> gpu.types.GPUShader:
    """Opaque faces; Blender's own shader encodes colors again for each pixel."""
    passed = gpu.types.GPUStageInterfaceInfo("faces_interface")
    passed.smooth('VEC3', "linear")
    return _shader("faces", gpu.types.GPUShaderCreateInfo(), passed, {"pos": 'VEC3', "color": 'VEC4'})


def _shader(
    name: str, info: gpu.types.GPUShaderCreateInfo, passed: gpu.types.GPUStageInterfaceInfo, columns: dict[str, str]
) -> gpu.types.GPUShader:
    """That of the files of a name, from columns of corners or points and their ``matrix`` to clip space."""
    info.push_constant('MAT4', "matrix")
    for number, (column, kind) in enumerate(columns.items()):
        info.vertex_in(number, kind, column)
    info.vertex_out(passed)
    info.fragment_out(0, 'VEC4', "fragColor")
    info.vertex_source(_SOURCES.joinpath(f"{name}.vert").read_text(encoding="utf-8"))
    info.fragment_source(_SOURCES.joinpath(f"{name}.frag").read_text(encoding="utf-8"))
    return gpu.shader.create_from_info(info)


def _draw_points(overlay: gpu.types.GPUBatch, origin: Floats, eye: Floats, least: float) -> None:
    region, height, shader = bpy.context.region_data, bpy.context.region.height, _crown_shader()
    shader.uniform_float("view", (0.5 * height * region.window_matrix[1][1], abs(region.view_matrix[2][2]), 0.0, 0.0))
    shader.uniform_float("eye", (*(eye - origin).tolist(), least))
    gpu.state.program_point_size_set(True)
    _draw(overlay, origin, shader)
    gpu.state.program_point_size_set(False)


def pyramid(camera: Camera, far: float, color: tuple[float, float, float, float]) -> gpu.types.GPUBatch:
    """Edges of what a camera sees between its near plane and a distance; its place and directions for a panorama."""
    if camera.kind == "PANO":
        axes = np.concatenate([camera.frame.T, -camera.frame.T]) * far / 10.0 + camera.position
        ends = np.concatenate([axes, camera.position[None]])
        return batch('LINES', ends, np.tile(color, (7, 1)), np.array([(6, i) for i in range(6)]))
    left, right, bottom, top = camera.window
    rim = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    parts = []
    for depth in (camera.near, max(far, 2.0 * camera.near)):
        wide = rim * depth if camera.kind == "PERSP" else rim
        parts.append(np.concatenate([wide, np.full((4, 1), -depth)], axis=1) @ camera.frame.T + camera.position)
    ring = [(i, (i + 1) % 4) for i in range(4)]
    edges = [*ring, *((a + 4, b + 4) for a, b in ring), *((i, i + 4) for i in range(4))]
    return batch('LINES', np.concatenate(parts), np.tile(color, (8, 1)), np.array(edges))


def _opaque(colors: Floats32, alpha: float) -> Floats32:
    out = np.full((len(colors), 4), alpha, np.float32)
    out[:, :3] = colors
    return out


def view_camera(region: bpy.types.RegionView3D, near: float, origin: Floats) -> Camera:
    """A viewport's view as the engine takes it, counted from a place (3,); the size of its image does not matter."""
    matrix = np.array(region.view_matrix.inverted(), np.float64)
    kind = "PERSP" if region.is_perspective else "ORTHO"
    # From an orthographic view everything is in front: its eye is as far back as one likes.
    near = near if kind == "PERSP" else -np.inf
    return Camera(kind, matrix[:3, 3], matrix[:3, :3], (-1.0, 1.0, -1.0, 1.0), near, np.inf, 1, 1).counted_from(origin)


def _kept(preview: Preview, name: str, key: tuple, make: Callable[[], object]) -> object:
    """What was made for a key, or made now if it has changed."""
    if preview.cache.get(name, (None,))[0] != key:
        preview.cache[name] = (key, make())
    return preview.cache[name][1]


def _draw(overlay: gpu.types.GPUBatch | None, origin: Floats, shader: gpu.types.GPUShader | None = None) -> None:
    """Draw what counts from a place (3,) in the world, by Blender's own shader or one of ours."""
    if overlay is None:
        return
    with gpu.matrix.push_pop():
        gpu.matrix.translate(origin.tolist())
        if shader is not None:
            shader.uniform_float("matrix", gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix())
        overlay.draw(shader or gpu.shader.from_builtin('SMOOTH_COLOR'))


def _draw_plants(preview: Preview) -> None:
    shapes = preview.shapes
    mesh, near = _kept(preview, "plants", (preview.changes,), lambda: plants(shapes)), None
    if shapes.crowns is not None:
        region = bpy.context.region_data
        place = region.view_matrix.inverted().translation if region.is_perspective else region.view_location
        key = preview.changes, *(round(part) for part in place)  # another meter shows others
        name = f"near {bpy.context.space_data.as_pointer()}"
        closest, least, eye = _kept(preview, name, key, lambda: (*nearest(shapes, np.array(place)), np.array(place)))
        near = _kept(preview, f"{name} faces", key, lambda: plants(closest))
    gpu.state.depth_test_set('LESS_EQUAL')
    gpu.state.depth_mask_set(True)
    gpu.state.face_culling_set('BACK')  # crowns and trunks are closed
    for one in (mesh, near):
        _draw(one, shapes.origin, _faces_shader())
    gpu.state.face_culling_set('NONE')
    if shapes.crowns is not None:
        _draw_points(_kept(preview, "points", (preview.changes,), lambda: points(preview)), shapes.origin, eye, least)
    gpu.state.depth_mask_set(False)


def _draw_levels(preview: Preview, settings: TetFloraPreview, space: bpy.types.SpaceView3D) -> None:
    levels, level = preview.levels, preview.levels.at(settings.level)
    forms = frozenset(settings.forms)
    shown = (preview.changes, level.number, forms)
    origin = levels.camera.origin
    gpu.state.blend_set('ALPHA')
    gpu.state.depth_test_set('LESS_EQUAL')
    gpu.state.depth_mask_set(False)  # clouds hide nothing
    if settings.projected:
        region, name = space.region_3d, f"projected {space.as_pointer()}"
        key = (*shown, *np.array(region.view_matrix).ravel().round(7), region.is_perspective)
        camera = partial(view_camera, region, space.clip_start, origin)  # asked for where the view has changed
        _draw(_kept(preview, name, key, lambda: _made_in_time(preview, level, forms, camera())), origin)
    if settings.wires:
        overlay = _kept(preview, "wires", (*shown, settings.color), lambda: wires(levels, level, settings.color, forms))
        _draw(overlay, origin)
    gpu.state.blend_set('NONE')


def _made_in_time(preview: Preview, level: Level, forms: frozenset[str], camera: Camera) -> gpu.types.GPUBatch | None:
    """Translucent tetrahedra of a view; how long it takes decides how many the next view has."""
    most = preview.cache.get("most", _MOST)
    begin = time.perf_counter()
    overlay, number = translucent(preview.levels, level, forms, camera, most)
    seconds = max(time.perf_counter() - begin, 1e-4)
    if number >= most // 2:
        most = int(most * np.clip(_MOMENT / seconds, 0.5, 2.0))
        preview.cache["most"] = int(np.clip(most, _LEAST, _MOST))
    return overlay


def _reach(preview: Preview, camera: Camera) -> float:
    """How far a frozen camera's pyramid is drawn: to the farthest that it sees of plants, meters."""
    if preview.levels is None:
        return min(camera.far, 100.0)

    def farthest() -> float:
        level = preview.levels.levels[-1]
        middles = preview.levels.vertices(level).mean(axis=1)[level.visibility > 0.0]
        depth = camera.counted_from(preview.levels.camera.origin).to_camera_space(middles)[:, 2]
        return float(min(max(depth.max(initial=1.0), 1.0), camera.far))

    return _kept(preview, "reach", (preview.changes, *_place(camera)), farthest)


def _place(camera: Camera) -> tuple[float, ...]:
    return (*camera.position.tolist(), *camera.frame.ravel().tolist(), *camera.window)


def lines_of(scene: bpy.types.Scene, preview: Preview) -> list[tuple[str, tuple[float, float, float, float]]]:
    """Lines of the figures in the corner of a viewport, from top to bottom, and their colors."""
    settings, lines = scene.tetflora.preview, []
    if preview.levels is not None:
        level = preview.levels.at(settings.level)
        figures, last = level.figures, preview.levels.levels[-1].number
        lines.append((f"Level {level.number} of {last}   {len(level):,} tetrahedra with plants", _TEXT))
        for name, text in {"explicit": "explicit", "proxy": "proxies", "hidden": "hidden", "split": "to split"}.items():
            color = (*FORMS[Decision[name.upper()]], 1.0) if settings.color == 'FORM' else _TEXT
            lines.append((f"    {getattr(figures, name):,} {text}", color))
        lines.append((f"    {figures.polygons:,} explicit polygons", _TEXT))
        if settings.color != 'FORM' and settings.wires:
            lines.append(("    dark: low    bright: high", _TEXT))
    if preview.shapes is not None:
        shapes = preview.shapes
        of = f" of {shapes.of:,}" if shapes.of > shapes.plants else ""
        lines.append((f"{shapes.plants:,}{of} plants shown", _TEXT))
    if preview.frozen is not None:
        lines.append(("Camera frozen", _FROZEN))
    elif state.is_outdated(scene):
        lines.append(("The camera has changed; compute the levels again, or freeze the camera", _COMPLAINT))
    return lines


def _draw_figures(context: bpy.types.Context, preview: Preview) -> None:
    if not context.scene.tetflora.preview.statistics:
        return
    lines, scale = lines_of(context.scene, preview), context.preferences.system.ui_scale
    left = next((r.width for r in context.area.regions if r.type == 'TOOLS' and r.alignment == 'LEFT'), 0)
    step = 18.0 * scale
    blf.size(0, 12.0 * scale)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.9)
    for n, (text, color) in enumerate(reversed(lines)):
        blf.color(0, *color)
        blf.position(0, left + 16.0 * scale, 16.0 * scale + n * step, 0.0)
        blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def _guarded(draw: Callable[[bpy.types.Context, Preview], None]) -> None:
    """Draw what a viewport shows; an error is printed once and not at every redraw."""
    context = bpy.context
    preview = state.find(context.scene)
    if preview is None or not context.space_data.overlay.show_overlays:
        return
    if preview.cache.get("broken") == preview.changes:
        return
    try:
        draw(context, preview)
    except Exception:
        preview.cache["broken"] = preview.changes
        print("TetFlora: cannot draw the preview; please report this as a bug:", file=sys.stderr)
        traceback.print_exc()
    finally:
        gpu.state.blend_set('NONE')
        gpu.state.face_culling_set('NONE')
        gpu.state.depth_mask_set(False)
        gpu.state.depth_test_set('NONE')


def _in_space(context: bpy.types.Context, preview: Preview) -> None:
    # Simple plants stand in place of refined ones, where viewports show none.
    done = result_collections(context.scene, 'VIEW')
    seen = (obj.visible_get(view_layer=context.view_layer) for collection in done for obj in collection.objects)
    if preview.shapes is not None and not any(seen):
        _draw_plants(preview)
    if preview.levels is not None:
        _draw_levels(preview, context.scene.tetflora.preview, context.space_data)
    if preview.frozen is not None:
        camera = preview.frozen.local()
        far = _reach(preview, camera)
        gpu.state.depth_test_set('LESS_EQUAL')
        _draw(_kept(preview, "frozen", (*_place(camera), far), lambda: pyramid(camera, far, _FROZEN)), camera.origin)


def register() -> None:
    """Draw over all 3D viewports from now on; in the background there are none."""
    if bpy.app.background:
        return
    for draw, kind in ((_in_space, 'POST_VIEW'), (_draw_figures, 'POST_PIXEL')):
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_guarded, (draw,), 'WINDOW', kind))


def unregister() -> None:
    """Draw no more."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), 'WINDOW')
