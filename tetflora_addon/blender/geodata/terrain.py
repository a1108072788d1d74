# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What maps show: rasters from files, ground from those of elevations, and curves from outlines on it.

Ground is a smooth mesh with UV and soil. The engine reads all but pixels of PNG. Those are Blender's, which divides
whole numbers by the largest of their type, as long as the image's color space is Non-Color.

Each kind of outlines has a collection: areas and paths of populations, and things to see. Woods and meadows are closed
curves on the ground. Water is flat, buildings stand on their lowest corner, roads are ribbons.
"""

import struct
import zlib
from contextlib import suppress
from dataclasses import replace
from math import pi
from pathlib import Path

import bpy
import numpy as np
from bpy.types import Collection, Image, Material, Object, Scene
from numpy.typing import NDArray

from ...arrays import Floats, Integers
from ...errors import SceneError
from ...files import read_whole
from ...geodata.geotiff import place_of_image, use_zstandard
from ...geodata.grids import ENDINGS, mosaic, read_grid
from ...geodata.outlines import BUILDING, KINDS, WATER, MapFeature, denser, one_ring, read_outlines
from ...geodata.projection import System, between, chosen_system
from ...geodata.rasters import MAX_CELLS, Raster, checked_size, in_degrees
from ...jobs import Job, Progress
from ...planting.wetness import HeightGrid, cell_for, height_grid
from ..attributes import image_pixels, members, write
from ..compat import shader_tree
from ..materials.nodes import Graph, surface_material
from ..materials.soil import soil_material
from ..placing.terrain import HALF_WIDTH, read_ground
from ..worker import call_in_thread, steps_in_thread
from .origin import TERRAIN, Import, Imported, Steps, importing

with suppress(ImportError):
    import zstandard

    use_zstandard(zstandard)
#: For windows that choose files.
PATTERN = ";".join(f"*{ending}" for ending in (*ENDINGS, ".png"))
_PNG_HEAD = struct.Struct(">8s4x4sIIBB")  # signature, length and name of the first chunk, size, bits, colors
_MOST_FILE = 4_000_000_000
_VOIDS = (-32768.0, -32767.0, -99999.0)  # what stands for nothing where no file says so
_MOST = 100_000.0  # meters above the sea or below it
#: Colors of soil and of what grows on it, linear RGB, and the fraction that is green.
_SOIL, _GREEN, _COVERED = (0.06, 0.043, 0.028), (0.05, 0.075, 0.018), 0.8
_FINEST, _MOST_CELLS = 0.5, 4_000_000  # of the grid that heights are read from: meters


def read_raster(order: Import, path: Path | None = None) -> Job[Raster]:
    """Read the raster of an import, its tiles as one; yields progress.

    Parameters
    ----------
    path : Path, optional
        Another file, which is read whole, in its place.

    Raises
    ------
    OSError, SceneError
        One cannot be read, is broken, or lacks a place.
    """
    tiles, paths, code = [], [order.path, *order.tiles] if path is None else [path], order.epsg
    for path in paths:
        progress = Progress(0.0, f"Reading {path.name}")
        yield progress
        if path.suffix.lower() in ENDINGS:
            raster = yield from steps_in_thread(read_grid(path), progress)
        elif path.suffix.lower() == ".png":
            raster = _png(path)
        else:
            raise SceneError(f"{path.name}: use a GeoTIFF (.tif), an ASCII grid (.asc), or one of {PATTERN}")
        what = f"{path.name}: "
        raster = replace(raster, system=chosen_system(code, raster.system, what))
        raster = raster if code else in_degrees(raster, what)
        raster.values[np.isin(raster.values, _VOIDS)] = np.nan
        if not np.isfinite(raster.values).any():
            raise SceneError(f"{what}none of its cells has a value")
        tiles.append(raster)
        if sum(tile.values.size for tile in tiles) > 2 * MAX_CELLS:
            raise SceneError(f"{what}with the {len(tiles) - 1:,} before it, over {MAX_CELLS:,} cells; import fewer")
    raster = yield from call_in_thread(Progress(0.5, "Joining tiles"), mosaic, tiles, [path.name for path in paths])
    if paths[0] == order.path and (box := order.box(raster.outline, raster.system)) is not None:
        raster = raster.part(raster.cells(box.corners))
        if min(raster.values.shape) < 2 or not np.isfinite(raster.values).any():
            raise order.nothing_left()
    if (order.scale, order.offset) != (1.0, 0.0):
        raster = replace(raster, values=raster.values * np.float32(order.scale) + np.float32(order.offset))
    low, high = (float(f(raster.values[np.isfinite(raster.values)])) for f in (np.min, np.max))
    if not -_MOST < low <= high < _MOST:
        raise SceneError(
            f"{paths[0].name}: its values are from {low:,.0f} to {high:,.0f} m, which nothing on Earth is; it is "
            "damaged, or in another unit: set Meters per Value"
        )
    return raster


def _png(path: Path) -> Raster:
    """The raster of a gray PNG with a world file."""
    content = read_whole(path, _MOST_FILE)
    if len(content) < _PNG_HEAD.size or content[:8] != b"\x89PNG\r\n\x1a\n" or content[12:16] != b"IHDR":
        raise SceneError(f"{path.name}: this is no PNG file")
    *_, width, height, bits, colors = _PNG_HEAD.unpack(content[: _PNG_HEAD.size])
    checked_size(width, height, f"{path.name}: ")
    if colors not in (0, 2) or bits not in (8, 16):
        raise SceneError(f"{path.name}: chunk IHDR: it must be gray, of 16 bits, without a palette and alpha")
    byte, name = 8, b""
    while name != b"IEND":  # Blender would make flat ground of what is damaged
        size, name = struct.unpack(">I4s", content[byte : byte + 8].ljust(8, b"\0"))
        end = byte + 12 + size
        if end > len(content) or zlib.crc32(content[byte + 4 : end - 4]) != int.from_bytes(content[end - 4 : end]):
            raise SceneError(f"{path.name}: byte {byte:,}: it is damaged or was not copied whole")
        byte = end
    image = _loaded(path, "Blender cannot read its pixels; it is damaged")
    try:
        image.colorspace_settings.name = "Non-Color"
        if tuple(image.size) != (width, height) or not image.channels:
            raise SceneError(f"{path.name}: Blender cannot read its pixels; it is damaged")
        values = np.rint(image_pixels(image)[::-1, :, 0] * np.float32(2**bits - 1))
    finally:
        bpy.data.images.remove(image)
    return replace(place_of_image(path), values=values)


def _loaded(path: Path, unreadable: str) -> Image:
    try:
        return bpy.data.images.load(str(path), check_existing=False)
    except RuntimeError:
        raise SceneError(f"{path.name}: {unreadable}") from None


@importing
def terrain_steps(order: Import, most: int, image: Path | None = None) -> Steps:
    """Make ground; see `importing`.

    Parameters
    ----------
    most : int
        Faces.
    image : Path, optional
        An orthophoto, which becomes its color.
    """
    raster = yield from read_raster(order)
    photo = None if image is None else _photo_place(image, raster.system)
    place = order.origin(raster.outline, raster.system)
    coarse = yield from call_in_thread(Progress(0.7, "Making the ground"), raster.coarser, most)
    h, w = coarse.values.shape
    column, row = np.tile(np.arange(w), h), np.repeat(np.arange(h), w)
    points = np.column_stack([order.local(place, coarse.places(column, row), coarse.system), coarse.values.ravel()])
    yield Progress(0.8, "Making the ground")
    faces = _faces(coarse)
    if not len(faces):
        raise SceneError(f"{order.what}no four neighboring cells have values")
    used = np.unique(faces)
    number = np.zeros(h * w, np.int64)
    number[used] = np.arange(len(used))
    uv = np.column_stack([column / (w - 1), 1.0 - row / (h - 1)])[used]
    material, notes = None, [*raster.notes, f"coordinates: {raster.system.name}"]
    if photo is not None:
        cells = photo.cells(between(coarse.places(column, row)[used], coarse.system, photo.system)) + 0.5
        material, uv, beside = _photo_material(image, cells)
        notes += [f"{beside:,} of {len(uv):,} vertices lie beside the image"] * (beside > 0)
    obj = _mesh(order.path.stem, points[used], number[faces], uv, material)
    order.scene.collection.objects.link(obj)
    order.remember(place)
    step = float(np.linalg.norm(points[faces[:, 0], :2] - points[faces[:, 1], :2], axis=1).mean())
    finer = "; the file is finer, see Max Faces" * (coarse is not raster)
    return Imported(obj, [f'Ground "{obj.name}" of {len(faces):,} faces, one every {step:.2f} m{finer}', *notes])


def _faces(raster: Raster) -> Integers:
    """Cells at the corners of quads, (f, 4), counter-clockwise from above, between cells that have values."""
    known = np.isfinite(raster.values)
    whole = known[:-1, :-1] & known[1:, :-1] & known[1:, 1:] & known[:-1, 1:]
    w = raster.values.shape[1]
    first = (np.arange(whole.shape[0])[:, None] * w + np.arange(w - 1))[whole]
    quads = np.stack([first, first + w, first + w + 1, first + 1], axis=1)
    down_then_along = raster.down[0] * raster.along[1] - raster.down[1] * raster.along[0]
    return quads if down_then_along > 0.0 else quads[:, ::-1]


def _photo_place(path: Path, ground: System) -> Raster:
    """Where an orthophoto lies; in the system of the ground if it has none of its own."""
    place = place_of_image(path)
    place = replace(place, system=chosen_system(0, place.system, f"{path.name}: ")) if place.system.epsg else place
    if place.system.epsg and not ground.epsg:
        raise SceneError(
            f"{path.name}: the image lies on Earth, and nothing tells where the terrain does; set Coordinate System"
        )
    return place if place.system.epsg else replace(place, system=ground)


def _photo_material(path: Path, cells: Floats) -> tuple[Material, Floats, int]:
    """A material of an image, UV (n, 2) of places in its pixels (n, 2), and how many of these lie beside it."""
    unreadable = "Blender cannot read this image; write it as JPEG, PNG or 8-bit TIFF"
    image = _loaded(path, unreadable)
    size = np.array(image.size, np.float64)
    inside = ((cells >= 0.0) & (cells <= size)).all(axis=1)
    if not size.all() or not inside.any():
        bpy.data.images.remove(image)
        why = "the image lies elsewhere; choose one of this place" if size.all() else unreadable
        raise SceneError(f"{path.name}: {why}")
    material = bpy.data.materials.new(path.stem)
    graph = Graph(shader_tree(material))
    texture = graph.node("ShaderNodeTexImage", extension='EXTEND')
    texture.image = image
    surface = graph.node("ShaderNodeBsdfPrincipled", {"Base Color": texture.outputs["Color"], "Roughness": 0.95})
    graph.node("ShaderNodeOutputMaterial", {"Surface": surface})
    graph.arrange()
    return material, np.stack([cells[:, 0], size[1] - cells[:, 1]], axis=1) / size, int((~inside).sum())


def _mesh(name: str, points: NDArray, faces: NDArray, uv: NDArray, material: Material | None) -> Object:
    """A smooth mesh with UV; soil if it has no material."""
    middle = np.round((points.min(axis=0) + points.max(axis=0)) / 2.0)
    middle[2] = 0.0
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(points))
    mesh.loops.add(faces.size)
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 4, dtype=np.int32))
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(faces.ravel(), np.int32))
    write(mesh, "position", points - middle)
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    write(mesh, mesh.uv_layers.new(name="UVMap").name, uv[faces.ravel()])
    if material is None:
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        colors, green = np.broadcast_to(_SOIL, (2, 2, 3)), np.full((2, 2), _COVERED)
        material = soil_material(f"{name} soil", colors, green, np.array(_GREEN), low, high - low)
    mesh.materials.append(material)
    obj = bpy.data.objects.new(name, mesh)
    obj.location = middle
    obj[TERRAIN] = True
    obj.tetflora.is_occluder = True
    return obj


def heights_steps(order: Import, progress: Progress) -> Job[HeightGrid | None]:
    """Heights of the ground that an import lies on; None where there is none."""
    if not order.grounds:
        return None
    triangles = read_ground(order.grounds, order.depsgraph).triangles
    return (yield from call_in_thread(progress, height_grid, triangles, cell_for(triangles, _FINEST, _MOST_CELLS)))


_STEP, _ABOVE = 4.0, 0.08  # meters between points of roads on the ground, and how far they lie above it
_SINK = 0.3  # meters that a building reaches into the ground below its lowest corner
_BATCH = 200
#: Linear RGB and roughness of what has a surface.
_LOOKS = {
    WATER: ("Map water", (0.02, 0.035, 0.04), 0.08),
    BUILDING: ("Map building", (0.55, 0.5, 0.44), 0.8),
    "": ("Map road", (0.14, 0.13, 0.12), 0.9),
}
#: On objects that are imported buildings.
BUILDING_MARK = "tetflora_building"


@importing
def outline_steps(order: Import, kind: str = "") -> Steps:
    """Make curves of the outlines in a file; see `importing`.

    Parameters
    ----------
    kind : str
        What all are taken for; empty to tell them by their keys.
    """
    progress = Progress(0.0, f"Reading {order.path.name}")
    yield progress
    outlines, system, notes = yield from call_in_thread(progress, read_outlines, order.path, order.epsg, kind)
    points = np.concatenate([ring for outline in outlines for ring in outline.rings])
    box = order.box(points, system)
    if box is not None:
        number = len(outlines)
        outlines = [outline for outline in outlines if any(box.holds(ring).any() for ring in outline.rings)]
        if not outlines:
            raise order.nothing_left()
        points = np.concatenate([ring for outline in outlines for ring in outline.rings])
        notes.append(f"{number - len(outlines):,} beyond the Crop")
    sizes = [len(ring) for outline in outlines for ring in outline.rings]
    place = order.origin(points, system)
    flat = iter(np.split(order.local(place, points, system), np.cumsum(sizes)[:-1]))
    rings = [[next(flat) for _ in outline.rings] for outline in outlines]
    heights = yield from heights_steps(order, Progress(0.4, "Reading the ground"))
    top = bpy.data.collections.new(order.path.stem)
    collections = [bpy.data.collections.new(kind) for kind in KINDS]
    try:
        for number, (outline, local) in enumerate(zip(outlines, rings, strict=True)):
            if number % _BATCH == 0:
                yield Progress(0.5 + 0.5 * number / len(outlines), "Drawing outlines")
            collections[KINDS.index(outline.kind)].objects.link(_curve(outline, local, heights))
    except BaseException:  # an error, or Esc
        _remove([top, *collections])
        raise
    filled = {kind: collection for kind, collection in zip(KINDS, collections, strict=True) if collection.objects}
    for collection in filled.values():
        top.children.link(collection)
    bpy.data.batch_remove([collection for collection in collections if not collection.objects])
    order.scene.collection.children.link(top)
    order.remember(place)
    told = ", ".join(f"{kind} {len(collection.objects):,}" for kind, collection in filled.items())
    return Imported(None, [f"Outlines imported: {told}", *notes, f"coordinates: {system.name}"])


def building_areas(scene: Scene) -> list[Floats]:
    """Borders (k, 2) of the buildings that were imported into a scene, in world space."""
    buildings = [obj for obj in scene.objects if obj.type == 'CURVE' and obj.get(BUILDING_MARK)]
    walls = [(obj, members(spline.points, "co", 4)) for obj in buildings for spline in obj.data.splines[:1]]
    return [(corners.astype(np.float64) @ np.array(obj.matrix_world).T)[:, :2] for obj, corners in walls]


def _remove(collections: list[Collection]) -> None:
    """Take back what was drawn."""
    objects = [obj for collection in collections for obj in collection.objects]
    curves = [obj.data for obj in objects]
    materials = {material for curve in curves for material in curve.materials}
    bpy.data.batch_remove([*objects, *collections])
    bpy.data.batch_remove([*curves, *(material for material in materials if not material.users)])


def _curve(outline: MapFeature, rings: list[Floats], heights: HeightGrid | None) -> Object:
    """One outline as an object; its points count from its first one, so that far ones are exact."""
    data = bpy.data.curves.new(outline.name, 'CURVE')
    filled = outline.closed and outline.kind in (WATER, BUILDING)
    ribbon = not outline.closed and outline.width > 0.0
    if filled:
        data.dimensions, data.fill_mode = '2D', 'BOTH'
        data.extrude = outline.height / 2.0
    else:
        data.dimensions, data.twist_mode = '3D', 'Z_UP'
        rings = [one_ring(tuple(rings))] if outline.closed else [denser(rings[0], _STEP)] if ribbon else rings
        data.extrude = outline.width / 2.0
    ground = [
        np.zeros(len(ring)) if heights is None else np.nan_to_num(heights.at(heights.height, ring)) for ring in rings
    ]
    foot = np.array([*np.round(rings[0][0]), 0.0])
    if filled:
        sunk = _SINK if outline.height else 0.0
        foot[2] = min(float(z.min()) for z in ground) + outline.height / 2.0 - sunk
    for ring, z in zip(rings, ground, strict=True):
        local = np.column_stack([ring, z + _ABOVE * ribbon]) - foot
        if filled:
            local[:, 2] = 0.0
        spline = data.splines.new('POLY')
        spline.points.add(len(local) - 1)
        spline.points.foreach_set("co", np.column_stack([local, np.ones(len(local))]).astype(np.float32).ravel())
        spline.use_cyclic_u = outline.closed
        if ribbon:
            spline.points.foreach_set("tilt", np.full(len(local), pi / 2.0, np.float32))
    if filled or ribbon:
        data.materials.append(_look(outline.kind if outline.kind in (WATER, BUILDING) else ""))
    obj = bpy.data.objects.new(outline.name, data)
    obj.location = foot
    if ribbon:
        obj[HALF_WIDTH] = outline.width / 2.0
    if filled and outline.kind == BUILDING:
        obj[BUILDING_MARK] = True
    return obj


def _look(kind: str) -> Material:
    """The material of water, buildings or roads; that of an earlier import if there is one."""
    name, color, rough = _LOOKS[kind]

    def build(graph: Graph, material: Material) -> None:
        material.diffuse_color = (*color, 1.0)
        surface = graph.node("ShaderNodeBsdfPrincipled", {"Base Color": (*color, 1.0), "Roughness": rough})
        graph.node("ShaderNodeOutputMaterial", {"Surface": surface})

    return surface_material(name, 1, build)
