# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rasters from files, and ground from those of elevations: a smooth mesh with UV and soil.

The engine reads all but pixels of PNG. Those are Blender's, which divides whole numbers by the largest of their type,
as long as the image's color space is Non-Color.
"""

import struct
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Integers
from ...errors import SceneError
from ...files import read_whole
from ...geodata.geotiff import place_of_image, use_zstandard
from ...geodata.grids import ENDINGS, mosaic, read_grid
from ...geodata.projection import System, between, chosen_system
from ...geodata.rasters import MAX_CELLS, Raster, checked_size, in_degrees
from ...jobs import Job, Progress
from ...planting.wetness import HeightGrid, cell_for, height_grid
from ..attributes import image_pixels, write
from ..compat import shader_tree
from ..materials.nodes import Graph
from ..materials.soil import soil_material
from ..placing.terrain import read_ground
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
    """Read the raster of an import, its tiles as one; yields progress. ``path``: another file, whole, in its place.

    Raises `OSError`: one cannot be read. Raises `SceneError`: one is broken, or lacks a place.
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
            raise SceneError(
                f"{what}with the {len(tiles) - 1:,} before it, more than {MAX_CELLS:,} cells; import fewer"
            )
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
    at, name = 8, b""
    while name != b"IEND":  # Blender would make flat ground of what is damaged
        size, name = struct.unpack(">I4s", content[at : at + 8].ljust(8, b"\0"))
        end = at + 12 + size
        if end > len(content) or zlib.crc32(content[at + 4 : end - 4]) != int.from_bytes(content[end - 4 : end]):
            raise SceneError(f"{path.name}: byte {at:,}: it is damaged or was not copied whole")
        at = end
    image = _loaded(path, "Blender cannot read its pixels; it is damaged")
    try:
        image.colorspace_settings.name = "Non-Color"
        if tuple(image.size) != (width, height) or not image.channels:
            raise SceneError(f"{path.name}: Blender cannot read its pixels; it is damaged")
        values = np.rint(image_pixels(image)[::-1, :, 0] * np.float32(2**bits - 1))
    finally:
        bpy.data.images.remove(image)
    return replace(place_of_image(path), values=values)


def _loaded(path: Path, unreadable: str) -> bpy.types.Image:
    """An image of a file."""
    try:
        return bpy.data.images.load(str(path), check_existing=False)
    except RuntimeError:
        raise SceneError(f"{path.name}: {unreadable}") from None


@importing
def terrain_steps(order: Import, most: int, image: Path | None = None) -> Steps:
    """Make ground of at most so many faces; yields progress. Closing the steps leaves all as it was.

    ``image`` is an orthophoto, which becomes its color. A file that is broken, or cannot lie in this scene, is a
    `SceneError`.
    """
    raster = yield from read_raster(order)
    photo = None if image is None else _photo_place(image, raster.system)
    place = order.origin(raster.outline, raster.system)
    coarse = yield from call_in_thread(Progress(0.7, "Making the ground"), raster.coarser, most)
    h, w = coarse.values.shape
    column, row = np.tile(np.arange(w), h), np.repeat(np.arange(h), w)
    flat = order.local(place, coarse.places(column, row), coarse.system)
    points = np.column_stack([flat, coarse.values.ravel()])
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
    made = _mesh(order.path.stem, points[used], number[faces], uv, material)
    order.scene.collection.objects.link(made)
    order.remember(place)
    step = float(np.linalg.norm(points[faces[:, 0], :2] - points[faces[:, 1], :2], axis=1).mean())
    finer = "; the file is finer, see Max Faces" * (coarse is not raster)
    ground = f'Ground "{made.name}" of {len(faces):,} faces, one every {step:.2f} m{finer}'
    return Imported(made, [ground, *notes])


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


def _photo_material(path: Path, cells: Floats) -> tuple[bpy.types.Material, Floats, int]:
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


def _mesh(
    name: str, points: NDArray, faces: NDArray, uv: NDArray, material: bpy.types.Material | None
) -> bpy.types.Object:
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
    layer = mesh.uv_layers.new(name="UVMap")
    write(mesh, layer.name, uv[faces.ravel()])
    if material is None:
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        shape = (2, 2)
        colors, green = np.broadcast_to(_SOIL, (*shape, 3)), np.full(shape, _COVERED)
        material = soil_material(f"{name} soil", colors, green, np.array(_GREEN), low, high - low)
    mesh.materials.append(material)
    made = bpy.data.objects.new(name, mesh)
    made.location = middle
    made[TERRAIN] = True
    made.tetflora.is_occluder = True
    return made


def heights_steps(order: Import, progress: Progress) -> Job[HeightGrid | None]:
    """Heights of the ground that an import lies on; None where there is none."""
    if not order.grounds:
        return None
    triangles = read_ground(order.grounds, order.depsgraph).triangles
    cell = cell_for(triangles, _FINEST, _MOST_CELLS)
    return (yield from call_in_thread(progress, height_grid, triangles, cell))
