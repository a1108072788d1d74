# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each face of a mesh looks like from afar: color, transmission and coverage, sampled from its materials.

A triangle is divided into smaller ones of equal size, as many as it covers texels. In the middle of each, shaders and
nodes are evaluated (`node_values`), and images are means over a piece as large as it (`Pyramid`). Triangles with the
same texture coordinates, as those of a leaf that was copied thousands of times, are evaluated once.
"""

from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from functools import cache

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Floats16, Floats32, Integers, Integers32
from ...growth.hashing import mix
from ..attributes import image_pixels, linear_rgb, read, values_of
from ..compat import tree_in_use
from .node_values import ImageMissing, NodeValues, Scattered, Values, luminance, source_of
from .nodes import active_output, find_socket, upstream

#: Columns or rows of the finest copy that is kept; finer ones say nothing about whole faces of a plant.
MOST_TEXELS = 2048
#: Pixels that are worked on at once, so that they stay in the processor's cache.
_PIXELS = 1 << 16
#: Bytes of pyramids that are kept for the next material.
_MOST_BYTES = 512 << 20


@dataclass(frozen=True)
class Pyramid:
    """Copies of an image, each half as wide as the one before."""

    texels: NDArray[np.uint64]  # (n,): of all copies; each is four float16: linear RGB times alpha, and alpha
    #: start, columns, rows: (l,): First texel, and size, of each copy
    start: Integers32
    columns: Integers32
    rows: Integers32
    #: width, height: (l,): Texels that the whole image would be wide and high in each copy; of sizes that are no power
    #: of two, the last texels stick out
    width: Floats32
    height: Floats32

    def look(self, u: Floats32, v: Floats32, size: Floats32, extension: str) -> tuple[Floats32, Floats32]:
        """Mean colors (3, p, k) and alpha (p, k) around some points.

        Parameters
        ----------
        u, v : (p, k) or (1, 1) float32
        size : (1, k) float32
            Side of the square that counts, in units of the image.
        extension : {'REPEAT', 'EXTEND', 'CLIP', 'MIRROR'}
        """
        with np.errstate(divide="ignore"):
            # Of long images the short side counts: more noise, but nothing from beside the square.
            level = np.floor(np.log2(size * min(self.width[0], self.height[0])))
        level = np.clip(np.nan_to_num(level), 0, len(self.start) - 1).astype(np.int32)
        x, x0, x1 = _columns(u, self.width[level], self.columns[level], extension)
        y, y0, y1 = _columns(v, self.height[level], self.rows[level], extension)
        first, stride = self.start[level], self.columns[level]
        low, high = first + y0 * stride, first + y1 * stride
        texels = self._texels(low + x0) * ((1 - x) * (1 - y))[..., None]
        texels += self._texels(low + x1) * (x * (1 - y))[..., None]
        texels += self._texels(high + x0) * ((1 - x) * y)[..., None]
        texels += self._texels(high + x1) * (x * y)[..., None]
        if extension == 'CLIP':
            texels[(u < 0) | (u > 1) | (v < 0) | (v > 1)] = 0
        color, alpha = np.ascontiguousarray(np.moveaxis(texels[..., :3], -1, 0)), texels[..., 3].copy()
        return color / np.maximum(alpha, 1e-6), alpha

    def _texels(self, index: Integers32) -> Floats32:
        return np.take(self.texels, index).view(np.float16).reshape(*index.shape, 4).astype(np.float32)


def _columns(
    u: Floats32, width: Floats32, columns: Integers32, extension: str
) -> tuple[Floats32, Integers32, Integers32]:
    """Of one axis: where between two texels, and both of these."""
    if extension == 'REPEAT':
        u = u - np.floor(u)
    elif extension == 'MIRROR':
        u = 1 - np.abs(1 - (u - 2 * np.floor(u * np.float32(0.5))))
    else:
        u = np.clip(u, 0, 1)
    x = u * width - np.float32(0.5)
    whole = np.floor(x)
    x -= whole
    first = whole.astype(np.int32)
    second = first + 1
    if extension == 'REPEAT':
        first = np.where(first < 0, columns - 1, np.minimum(first, columns - 1))
        return x, first, np.where(second >= columns, 0, second)
    return x, np.clip(first, 0, columns - 1), np.clip(second, 0, columns - 1)


def _pyramid_of(image: bpy.types.Image, weighted: bool, most: int) -> Pyramid | None:
    """The pyramid of an image, weighted by alpha or not, of some columns or rows at most; None if it has no pixels."""
    if not (all(image.size) and image.channels):
        return None
    pixels = image_pixels(image)
    if most < MOST_TEXELS:
        # An odd step, so that a power of two of columns does not make a few of them stand for all.
        step = max(1, max(image.size) // most) | 1
        pixels = pixels[::step, ::step]
    height, width = pixels.shape[:2]
    halvings = max(0, int(np.ceil(np.log2(max(width, height) / MOST_TEXELS))))
    levels = [_finest(image, pixels, weighted, halvings)]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halved(levels[-1]))
    rows, columns = np.array([level.shape[:2] for level in levels], np.int32).T.copy()
    start = np.cumsum(rows * columns, dtype=np.int32) - rows * columns
    parts = np.float32(0.5) ** np.arange(halvings, halvings + len(levels), dtype=np.float32)
    texels = np.concatenate([level.astype(np.float16).reshape(-1, 4) for level in levels]).view(np.uint64).reshape(-1)
    return Pyramid(texels, start, columns, rows, width * parts, height * parts)


def _finest(image: bpy.types.Image, pixels: Floats32, weighted: bool, halvings: int) -> Floats16:
    """The finest copy that is kept (h, w, 4): linear RGB times alpha, and alpha."""
    height, width, channels = pixels.shape
    # Eight bits have 256 values: a table is ten times as fast as a power.
    table = None if image.is_float else linear_rgb(image, np.linspace(0, 1, 256, dtype=np.float32)[:, None])[:, 0]
    table = None if table is None else table.astype(np.float32)
    has_alpha = channels == 4 and image.alpha_mode != 'NONE'
    # Pixels of floating point images are multiplied by their alpha already.
    associated = image.is_float and image.alpha_mode != 'CHANNEL_PACKED'
    step = max(1 << halvings, _PIXELS // width >> halvings << halvings)
    finest = np.zeros((-(-height // (1 << halvings)), -(-width // (1 << halvings)), 4), np.float16)
    for row in range(0, height, step):
        block = pixels[row : row + step]
        alpha = np.clip(block[..., 3:], 0, 1) if has_alpha else None
        if table is None:
            out = np.ones((*block.shape[:2], 4), np.float32)
            out[..., :3] = np.clip(linear_rgb(image, block), 0, 60_000)
        else:
            block = np.broadcast_to(block[..., :1], (*block.shape[:2], 4)) if channels < 3 else block
            out = np.take(table, (block * np.float32(255) + np.float32(0.5)).astype(np.uint8))
            out = np.concatenate([out, np.ones_like(out[..., :1])], axis=2) if channels == 3 else out
        if has_alpha and associated:
            out /= np.maximum(alpha, 1e-6)
        if has_alpha and weighted:
            out *= alpha
            out[..., 3:] = alpha
        else:
            out[..., 3] = 1
        for _ in range(halvings):
            out = _halved(out)
        start = row >> halvings
        finest[start : start + len(out)] = np.minimum(out, np.float32(60_000))
    return finest


def _halved(level: NDArray[np.floating]) -> Floats32:
    """Half as many columns and rows; the last ones count twice where their number is odd."""
    height, width = level.shape[:2]
    level = np.pad(level, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge") if height % 2 or width % 2 else level
    halves = level[0::2].astype(np.float32) + level[1::2]
    return (halves[:, 0::2] + halves[:, 1::2]) * np.float32(0.25)


#: What Blender shows where there is no material.
GRAY = (0.8, 0.8, 0.8)

#: Parts along an edge, at most; texels of the finest image along an edge of a part, about. Where steps, or several
#: images, make the mean of what nodes get something else than the mean of what comes out, single texels are looked at.
_MOST_PARTS, _MOST_PARTS_UNEVEN = 32, 64
_TEXELS, _TEXELS_UNEVEN = 8.0, 3.0
#: Texture coordinates and colors that differ by less are the same.
_SAME = 1.0 / (1 << 14)


@dataclass(frozen=True)
class MeshLayers:
    """Attributes of a mesh: the UV map that renders first, '' if there is none; types, and means if known, by name."""

    first: str
    types: dict[str, str]
    means: dict[str, NDArray] = field(default_factory=dict)

    def map_named(self, name: str) -> str:
        """The UV map that a name stands for: the first one if there is no such map."""
        return name if self.types.get(name) == 'FLOAT2' else self.first


@dataclass
class Plan:
    """How a material is evaluated on a mesh; a point where everything has its mean, which notes what is asked for."""

    name: str  # of the material, for messages
    layers: MeshLayers
    reader: "FaceReader"
    viewport: Floats32  # (3,): the material's color in viewports, for images that are missing
    #: (5,): Cover, color times cover, and the lightness of what goes through; of where all has its mean, if it varies
    constant: Floats32
    problems: list[str] = field(default_factory=list)  # for the artist
    surface: bpy.types.NodeSocket | None = None  # what its shaders lead to; None if it has none
    is_known: bool = False  # whether its transmission is
    #: maps, colors: UV maps and other attributes that it depends on
    maps: list[str] = field(default_factory=list)
    colors: list[str] = field(default_factory=list)
    images: set[bpy.types.Image] = field(default_factory=set)
    texels: float = 1.0  # of the finest image, along a unit of texture coordinates
    uneven: bool = False  # whether it is not the mean that comes out for the mean

    def tell(self, problem: str) -> None:
        """Add a problem; those that are told already are left out."""
        if problem not in self.problems:
            self.problems.append(problem)

    def uv(self, name: str) -> tuple[Values, Values, Values]:
        """Texture coordinates u and v, and the side (1, k) of what each place stands for; '' is the first map."""
        name = self.layers.map_named(name)
        if name and name not in self.maps:
            self.maps.append(name)
        return _ANYWHERE

    def attribute(self, name: str) -> Values:
        """A color attribute (4, p, k)."""
        exists = name in self.layers.types
        if exists and name not in self.colors:
            self.colors.append(name)
        mean = np.full(4, 0.5 if exists else 0.0, np.float32)
        if (known := self.layers.means.get(name)) is not None:
            mean[: len(known)] = known if len(known) > 1 else known[0]
        return mean.reshape(4, 1, 1)

    def pyramid(self, node: bpy.types.Node, scale: float) -> Pyramid:
        """The image of a node, whose coordinates are stretched by a factor."""
        image = node.image
        if image is None:
            raise ImageMissing(
                f'An image of material "{self.name}" is missing; its viewport color stands for it. Choose an image in '
                f'the node "{node.label or node.name}"'
            )
        pyramid = self.reader.pyramid(image, node.outputs["Alpha"].is_linked)
        if pyramid is None:
            raise ImageMissing(
                f'The image "{image.name}" of material "{self.name}" cannot be read; the viewport color stands for it. '
                "Find it with File > External Data > Find Missing Files"
            )
        if image.source == 'TILED':
            self.tell(f'The image "{image.name}" of material "{self.name}" has several tiles; the first stands for all')
        self.images.add(image)
        self.texels = max(self.texels, float(np.sqrt(pyramid.width[0] * pyramid.height[0])) * scale)
        return pyramid

    def unknown(self) -> None:
        """Note that only a renderer knows what comes out of a node."""
        self.tell(
            f'Some nodes of material "{self.name}" are only known to a renderer; their middle value stands for them. '
            "Bake them to an image to see their pattern from afar"
        )

    @property
    def names(self) -> list[str]:
        """Attributes that it depends on; none where it is the same everywhere."""
        return [*self.maps, *(name for name in self.colors if name not in self.maps)]

    def sampled(self, corners: dict[str, NDArray], most: int) -> NDArray:
        """Means over some triangles (t, 5) float32, as `constant`.

        Parameters
        ----------
        corners : mapping of str to (t, 3, width) float32
            Of each attribute in `names`, at the corners of the triangles.
        most : int
            Points of all distinct triangles, about.
        """
        one, which = _distinct([corners[name] for name in self.names])
        corners = {name: values[one] for name, values in corners.items()}
        extents = {name: _extents(corners[name]) for name in self.maps}
        parts = self._parts([length for length, _ in extents.values()], len(one), most)
        means = np.zeros((len(one), 5), np.float32)
        for n in np.unique(parts).tolist():
            rows = np.flatnonzero(parts == n)
            step = max(1, _BATCH // (n * n))
            for start in range(0, len(rows), step):
                batch = rows[start : start + step]
                part = np.float32(0 if self.uneven else 1 / n)
                sizes = {name: height[None, batch] * part for name, (_, height) in extents.items()}
                points = _Sampled(self, {name: corners[name][batch] for name in self.names}, sizes, n)
                means[batch] = _means_of(NodeValues(points, self.reader.curves).shader(self.surface))
        return means[which]

    def _parts(self, lengths: list[Floats32], count: int, most: int) -> Integers32:
        """Parts along an edge of each triangle: a power of two that follows its texels, and fewer if they are many."""
        texels = np.max(lengths, axis=0) * self.texels if lengths else np.zeros(count, np.float32)
        limit, each = (_MOST_PARTS_UNEVEN, _TEXELS_UNEVEN) if self.uneven else (_MOST_PARTS, _TEXELS)
        wanted = np.clip(texels / each, 1 if self.maps else 2, limit)
        parts = (1 << np.ceil(np.log2(wanted)).astype(np.int32)).astype(np.int32)
        while limit > 2 and (parts.astype(np.int64) ** 2).sum() > most:
            limit //= 2
            parts = np.minimum(parts, limit)
        return parts


_HALF = np.full((1, 1), 0.5, np.float32)
_ANYWHERE = _HALF, _HALF, np.full((1, 1), np.inf, np.float32)  # a point that stands for the whole image
_BATCH = 1 << 15  # points that are evaluated at once, so that they stay in the processor's cache


class _Sampled(Plan):
    """Points (p, k) of k triangles: the middles of n × n parts of each."""

    def __init__(self, plan: Plan, corners: dict[str, Floats32], sizes: dict[str, Floats32], n: int) -> None:
        vars(self).update(vars(plan))
        self._corners, self._sizes, self._weights = corners, sizes, _middles(n)

    def uv(self, name: str) -> tuple[Values, Values, Values]:
        name = self.layers.map_named(name)
        if not name:
            return _ANYWHERE
        u, v = (self._weights @ self._corners[name][:, :, i].T for i in range(2))
        return u, v, self._sizes[name]

    def attribute(self, name: str) -> Values:
        if name not in self._corners:
            return np.zeros((4, 1, 1), np.float32)
        corners = self._corners[name]
        parts = [self._weights @ corners[:, :, i].T for i in range(corners.shape[2])]
        if len(parts) == 1:
            parts *= 3
        while len(parts) < 3:
            parts.append(np.zeros_like(parts[0]))
        return np.stack([*parts[:3], parts[3] if len(parts) > 3 else np.ones_like(parts[0])])


def _means_of(shade: Scattered) -> Floats32:
    """Means over the points of each triangle (k, 5); (1, 5) where all are the same."""
    parts = [part.mean(axis=0) for part in (shade[0], *shade[1], shade[2])]
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def _distinct(corners: list[Floats32]) -> tuple[Integers, Integers]:
    """One of each kind of triangle, by the values (t, 3, width) at its corners; and the kind of each."""
    count = len(corners[0])
    key = np.zeros(count, np.uint64)
    with np.errstate(over="ignore", invalid="ignore"):
        for values in corners:
            whole = np.rint(np.clip(values.reshape(count, -1), -1e12, 1e12) * np.float32(1 / _SAME)).astype(np.int64)
            for column in whole.view(np.uint64).T:
                key = mix(key ^ column)
    order = np.argsort(key)
    key = key[order]
    new = np.ones(count, bool)
    new[1:] = key[1:] != key[:-1]
    which = np.zeros(count, np.int64)
    which[order] = np.cumsum(new) - 1
    return order[new], which


def _extents(uv: Floats32) -> tuple[Floats32, Floats32]:
    """Longest edge of triangles (t, 3, 2), and the height above it."""
    edges = np.roll(uv, -1, axis=1) - uv
    longest = np.sqrt((edges**2).sum(axis=2).max(axis=1))
    area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    return longest, np.divide(area, longest, out=np.zeros_like(area), where=longest > 0)


@cache
def _middles(n: int) -> Floats32:
    """Barycentric coordinates (n², 3) of the middles of equal parts of a triangle, n along each edge."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    up, down = i + j < n, i + j < n - 1
    a = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / n
    b = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / n
    return np.stack([1 - a - b, a, b], axis=1).astype(np.float32)


#: Triangles that are worked on at once.
_TRIANGLES = 1 << 16
#: Points of all distinct triangles of these, about, and of a whole mesh if it has fewer.
_POINTS, _ALL_POINTS = 1 << 19, 1 << 22
_COLORS = {'FLOAT_COLOR', 'BYTE_COLOR'}
_DOMAINS = {'POINT', 'CORNER', 'FACE'}
_TYPES = {'FLOAT', 'INT', 'INT8', 'BOOLEAN', 'FLOAT2', 'FLOAT_VECTOR', *_COLORS}
_LEAST = 1e-4  # coverage below which a face has no color of its own
_FAR = np.float32(1e6)  # texture coordinates and colors beyond it are no use
_ROUGH = 0.5  # of materials that do not say
_FEW_TEXELS = 512  # columns or rows of images of which only the mean counts
_TINY = 1e-30  # added to areas, so that those of faces without any count alike


#: Of all faces (f,) of a mesh: linear ``color`` (f, 3), the mean over what is not transparent; ``transmission``, the
#: fraction of scattered light that leaves on the other side, NaN where nobody knows; ``coverage``, the fraction that is
#: not transparent; and ``roughness`` of the gloss.
FaceLooks = dict[str, NDArray[np.float16]]


class FaceReader:
    """Reads looks of faces; keeps means, and images of ``most`` columns or rows (`_pyramid_of`) as memory allows."""

    def __init__(self, most: int = MOST_TEXELS) -> None:
        self.warnings: list[str] = []  # what the artist should know, each once
        self.curves: dict[str, Floats32] = {}  # tables of ramps, see `NodeValues`
        self._most = most
        self._pyramids: dict[tuple[bpy.types.Image, bool], Pyramid | None] = {}

    def pyramid(self, image: bpy.types.Image, weighted: bool) -> Pyramid | None:
        """The pyramid of an image, see `_pyramid_of`."""
        key = image, weighted
        if key not in self._pyramids:
            if sum(p.texels.nbytes for p in self._pyramids.values() if p is not None) > _MOST_BYTES:
                self._pyramids.clear()
            self._pyramids[key] = _pyramid_of(image, weighted, self._most)
        return self._pyramids[key]

    def prepare(self, mesh: bpy.types.Mesh, materials: list[bpy.types.Material | None]) -> "MeshLooks":
        """Read all that the looks of a mesh follow from, so that it need not be there any more afterward."""
        looks = MeshLooks(mesh, materials, self)
        self.warn(problem for plan in looks.plans for problem in plan.problems)
        return looks

    def warn(self, problems: Iterable[str]) -> None:
        """Add those warnings that are new."""
        self.warnings += [problem for problem in dict.fromkeys(problems) if problem not in self.warnings]


class MeshLooks:
    """The looks of one mesh, evaluated piece by piece."""

    def __init__(self, mesh: bpy.types.Mesh, materials: list[bpy.types.Material | None], reader: FaceReader) -> None:
        maps = mesh.uv_layers
        first = next((layer.name for layer in maps if layer.active_render), maps[0].name if len(maps) else "")
        types = {a.name: a.data_type for a in mesh.attributes if a.domain in _DOMAINS and a.data_type in _TYPES}
        self.materials = materials
        layers = MeshLayers(first, types)
        self.plans = [plan_of(material, layers, reader) for material in materials]  # one for each material
        self._values: dict[str, tuple[str, NDArray]] = {}
        for name in {name for plan in self.plans for name in plan.names}:
            attribute = mesh.attributes[name]
            values = values_of(attribute, "color" if attribute.data_type in _COLORS else "")
            self._values[name] = attribute.domain, values.reshape(len(values), -1)
        self._slot = np.zeros(len(mesh.polygons), np.int32)  # without the attribute all faces are of the first one
        if "material_index" in types:
            self._slot = np.clip(read(mesh, "material_index"), 0, len(materials) - 1)

    def steps(
        self, faces: int, positions: Floats32, loops: Integers32, corner_verts: Integers32, face: Integers32
    ) -> Generator[float, None, FaceLooks]:
        """Evaluate all faces; yields the fraction that is done.

        Parameters
        ----------
        positions : (v, 3) float32
        loops : (t, 3) int32
            Corners of each triangle.
        corner_verts : (c,) int32
        face : (t,) int32
            Ascending.
        """
        looks = {name: np.ones(faces, np.float16) for name in ("transmission", "coverage", "roughness")}
        looks["color"] = np.zeros((faces, 3), np.float16)
        if not any(plan.names for plan in self.plans):
            constant = np.array([plan.constant for plan in self.plans])
            for low in range(0, faces, _TRIANGLES):
                slot = self._slot[low : low + _TRIANGLES]
                self._write(looks, slice(low, low + len(slot)), constant[slot], slot)
            return looks
        most = max(_POINTS, _ALL_POINTS // -(-len(face) // _TRIANGLES)) if len(face) else 0
        end = 0
        while end < len(face):
            start, end = end, min(end + _TRIANGLES, len(face))
            end = int(np.searchsorted(face, face[end - 1], side="right"))  # faces are not divided
            low, high = int(face[start]), int(face[end - 1]) + 1
            chosen = loops[start:end]
            verts = np.take(corner_verts, chosen)
            of_face = face[start:end] - low
            slot = self._slot[low:high]
            values = self._triangles(chosen, verts, face[start:end], slot[of_face], most)
            if high - low < end - start:
                # Means over faces of those over their triangles.
                areas, number = _areas(positions, verts), high - low
                total = np.maximum(np.bincount(of_face, areas, number), _TINY)
                values = np.stack([np.bincount(of_face, column * areas, number) for column in values.T], axis=1)
                values = values / total[:, None]
            self._write(looks, slice(low, high), values, slot)
            yield end / len(face)
        return looks

    def _write(self, looks: FaceLooks, faces: slice, values: NDArray[np.floating], slot: Integers32) -> None:
        """Means over what is not transparent, from those over whole faces (n, 5)."""
        plain = np.array([plan.constant[1:4] / max(plan.constant[0], _LEAST) for plan in self.plans], np.float32)
        known = np.array([plan.is_known for plan in self.plans])
        cover, color, through = values[:, 0], values[:, 1:4], values[:, 4]
        light = luminance(color.T)
        passed = np.divide(through, light, out=np.zeros_like(light), where=light > 1e-6)
        color = np.where((cover > _LEAST)[:, None], color / np.maximum(cover, _LEAST)[:, None], plain[slot])
        looks["color"][faces] = np.clip(color, 0, 1)
        looks["coverage"][faces] = np.clip(cover, 0, 1)
        looks["roughness"][faces] = np.array([roughness_of(material) for material in self.materials])[slot]
        looks["transmission"][faces] = np.where(known[slot], np.clip(passed, 0, 1), np.nan)

    def _triangles(self, loops: NDArray, verts: NDArray, face: Integers32, slot: Integers32, most: int) -> Floats32:
        """Means (t, 5) over some triangles, see `Plan.constant`."""
        values = np.array([plan.constant for plan in self.plans])[slot]
        for number in np.unique(slot).tolist():
            plan = self.plans[number]
            rows = slice(None) if len(self.plans) == 1 else np.flatnonzero(slot == number)
            if plan.names:
                corners = {name: self._corners(name, loops[rows], verts[rows], face[rows]) for name in plan.names}
                values[rows] = plan.sampled(corners, most)
        return values

    def _corners(self, name: str, loops: NDArray, verts: NDArray, face: NDArray) -> Floats32:
        """Values of an attribute at the corners of some triangles: (t, 3, width)."""
        domain, values = self._values[name]
        rows = {'FACE': np.broadcast_to(face[:, None], loops.shape), 'CORNER': loops}.get(domain, verts)
        corners = np.nan_to_num(np.take(values, rows, axis=0).astype(np.float32, copy=False), posinf=0, neginf=0)
        return np.clip(corners, -_FAR, _FAR, out=corners)


def roughness_of(material: bpy.types.Material | None) -> float:
    """Roughness of a material's gloss, that of its first shader with one; half where nodes feed it."""
    output = None if material is None else active_output(tree_in_use(material), 'OUTPUT_MATERIAL')
    for node in () if output is None else upstream(find_socket(output.inputs, "Surface")):
        if node.type in {'BSDF_PRINCIPLED', 'EEVEE_SPECULAR', 'BSDF_GLOSSY'}:
            rough = find_socket(node.inputs, "Roughness")
            return _ROUGH if rough.is_linked else float(np.clip(rough.default_value, 0.0, 1.0))
    return _ROUGH


@dataclass(frozen=True)
class Look:
    """Means over a material: linear RGB, transmission (NaN if unknown), fraction that is not transparent."""

    color: tuple[float, float, float] = GRAY
    transmission: float = 0.0
    coverage: float = 1.0


class Looks:
    """Reads means of whole materials; each image is read once, and only some of its pixels."""

    def __init__(self) -> None:
        self._reader = FaceReader(_FEW_TEXELS)

    def of(self, material: bpy.types.Material | None, attributes: dict[str, NDArray]) -> Look:
        """Look of a material.

        Parameters
        ----------
        attributes : mapping of str to (n, k) float32
            Of the mesh that wears it, for those that take their color from one.
        """
        if material is None:
            return Look()
        types = {name: 'FLOAT2' if values.shape[1] == 2 else 'FLOAT_VECTOR' for name, values in attributes.items()}
        means = {name: values.mean(axis=0, dtype=np.float64) for name, values in attributes.items()}
        plan = plan_of(material, MeshLayers("", types, means), self._reader)
        cover, *color, through = plan.constant.astype(np.float64).tolist()
        color = np.clip(np.array(color) / max(cover, _LEAST), 0, 1)
        passed = np.clip(through / max(float(luminance(color * cover)), 1e-6), 0, 1)
        return Look(tuple(color.tolist()), float(passed) if plan.is_known else np.nan, cover)


def plan_of(material: bpy.types.Material | None, layers: MeshLayers, reader: FaceReader) -> Plan:
    """Evaluate a material once where everything has its mean, and note what that takes."""
    seen = np.array(GRAY if material is None else np.clip(material.diffuse_color[:3], 0, 1), np.float32)
    name = "" if material is None else material.name
    plan = Plan(name, layers, reader, seen, np.array([1.0, *seen, 0.0], np.float32), is_known=material is None)
    output = None if material is None else active_output(tree_in_use(material), 'OUTPUT_MATERIAL')
    surface = None if output is None else find_socket(output.inputs, "Surface")
    if surface is not None and source_of(surface, ())[0] is None:
        plan.tell(
            f'Material "{name}" has no surface shader; its viewport color stands for it. Link a shader to the Surface '
            "of its Material Output"
        )
    elif surface is not None:
        plan.surface, plan.is_known = surface, True
        plan.constant = _means_of(NodeValues(plan, reader.curves).shader(surface))[0]
        plan.uneven |= len(plan.images) > 1
    return plan


def _areas(positions: Floats32, verts: Integers32) -> Floats:
    a, b, c = (np.take(positions, column, axis=0).astype(np.float64) for column in verts.T)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) + _TINY
