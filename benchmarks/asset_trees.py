# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees of the benchmark `assets`, as other tools make them: branches, tubes, leaves, cards. None is a plant of ours.

``leaves``: a mesh of 1.2 million triangles, bark and closed leaves. ``cards``: bark and 6,000 quads with a painted
texture of leaves and holes. Both are about 12 m high.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from tetflora_addon.blender import compat

Array = NDArray[np.float64]

#: Closed leaf of 16 triangles: a rim of six points, two above and two below the midrib. Along, across, up, for a length
#: of 1; the width comes in when it is placed.
_RIM = ((0.0, 0.0), (0.28, 0.42), (0.64, 0.4), (1.0, 0.0), (0.64, -0.4), (0.28, -0.42))
_RIBS = (0.3, 0.66)
_THICK = 0.012
#: Half of one side: rim 0 to 3, and the two points of the midrib as 6 and 7.
_HALF = ((0, 1, 6), (6, 1, 2), (6, 2, 7), (7, 2, 3))
KINDS = ("leaves", "cards")
TRIANGLES, QUICK_TRIANGLES, CARDS = 1_200_000, 300_000, 6_000


@dataclass(frozen=True)
class Order:
    """Branches of one order.

    Attributes
    ----------
    number : int
        Of each branch of the order before.
    length : float
        Relative to the parent's; of the trunk meters.
    first : float
        Where along the parent they begin, 0 to 1.
    lean : tuple of float
        Least and greatest angle to the parent, degrees.
    rise : float
        How much each segment turns up; negative hangs.
    segments, sides : int
        Of tubes.
    thick : float
        Radius relative to the parent's where it begins.
    """

    number: int
    length: float
    first: float
    lean: tuple[float, float]
    rise: float
    segments: int
    sides: int
    thick: float = 0.5


@dataclass(frozen=True)
class Branches:
    """Polylines of one order.

    Attributes
    ----------
    points : (n, s + 1, 3) float64
        Meters.
    radius : (n, s + 1) float64
        Meters.
    """

    points: Array
    radius: Array


@dataclass(frozen=True)
class Surface:
    """Triangles with what a mesh needs.

    Attributes
    ----------
    positions : (v, 3) float64
    triangles : (t, 3) int64
    uv : (t, 3, 2) float64
        Of each corner.
    material : (t,) int64
    """

    positions: Array
    triangles: NDArray[np.int64]
    uv: Array
    material: NDArray[np.int64]


def joined(surfaces: list[Surface]) -> Surface:
    """All of some surfaces in one."""
    first = np.cumsum([0] + [len(s.positions) for s in surfaces[:-1]])
    return Surface(
        np.concatenate([s.positions for s in surfaces]),
        np.concatenate([s.triangles + f for s, f in zip(surfaces, first, strict=True)]),
        np.concatenate([s.uv for s in surfaces]),
        np.concatenate([s.material for s in surfaces]),
    )


def branches(orders: tuple[Order, ...], rng: np.random.Generator, radius: float = 0.2) -> list[Branches]:
    """A tree of so many orders; the first is the trunk, from the origin upward."""
    base, heading = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    length, thick = np.array([orders[0].length]), np.array([radius])
    made: list[Branches] = []
    for number, order in enumerate(orders):
        if number:
            parent = made[-1]
            base, heading, length, thick = _children(parent, order, rng, crown=number == 1)
        points = [base]
        for _ in range(order.segments):
            heading = _unit(heading + rng.normal(0.0, 0.11, heading.shape) + [0.0, 0.0, order.rise / order.segments])
            points.append(points[-1] + heading * (length / order.segments)[:, None])
        taper = 1.0 - 0.85 * np.linspace(0.0, 1.0, order.segments + 1) ** 0.9
        made.append(Branches(np.stack(points, axis=1), np.maximum(thick[:, None] * taper, 0.0012)))
    return made


def _children(parent: Branches, order: Order, rng: np.random.Generator, crown: bool) -> tuple[Array, ...]:
    """Where branches begin, where to, their lengths and radii; those of a crown are longest in its lower middle."""
    number = len(parent.points)
    of = np.repeat(np.arange(number), order.number)
    rank = np.tile((np.arange(order.number) + 0.5) / order.number, number)
    t = np.clip(order.first + (1.0 - order.first) * (rank + rng.uniform(-0.5, 0.5, len(of)) / order.number), 0.0, 0.999)
    points, along = on(parent, of, t)
    turn = 2.399963 * np.arange(len(of)) + rng.uniform(-0.5, 0.5, len(of))
    side, up = _across(along)
    out = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up
    lean = np.radians(rng.uniform(*order.lean, len(of)) * (1.0 - 0.35 * t if crown else 1.0))[:, None]
    whole = np.linalg.norm(np.diff(parent.points, axis=1), axis=2).sum(axis=1)[of]
    shape = np.sqrt(np.clip(1.0 - ((rank - 0.3) / 0.72) ** 2, 0.06, 1.0)) if crown else 1.0 - 0.55 * t
    length = order.length * whole * shape * rng.uniform(0.8, 1.15, len(of))
    cell = np.minimum((t * (parent.radius.shape[1] - 1)).astype(int), parent.radius.shape[1] - 2)
    return points, np.cos(lean) * along + np.sin(lean) * out, length, order.thick * parent.radius[of, cell]


def on(parent: Branches, of: NDArray[np.int64], t: Array) -> tuple[Array, Array]:
    """Points at fractions of the lengths of branches, and the unit vectors along there."""
    cells = parent.points.shape[1] - 1
    cell = np.minimum((t * cells).astype(int), cells - 1)
    a, b = parent.points[of, cell], parent.points[of, cell + 1]
    return a + (b - a) * (t * cells - cell)[:, None], _unit(b - a)


def tubes(made: list[Branches], orders: tuple[Order, ...], material: int = 0) -> Surface:
    """Bark around branches, open at both ends."""
    return joined([_tubes(some, order.sides, material) for some, order in zip(made, orders, strict=True)])


def _tubes(some: Branches, sides: int, material: int) -> Surface:
    number, rings = some.radius.shape
    heading = _unit(some.points[:, -1] - some.points[:, 0])
    a, b = _across(heading)
    turn = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = np.cos(turn)[:, None] * a[:, None] + np.sin(turn)[:, None] * b[:, None]
    positions = some.points[:, :, None] + some.radius[:, :, None, None] * ring[:, None]
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    cell = np.stack([i, i, i + 1, i, i + 1, i + 1], axis=-1).reshape(-1, 3)
    beside = np.stack([j, j + 1, j + 1, j, j + 1, j], axis=-1).reshape(-1, 3)
    one = cell * sides + beside % sides
    triangles = (one + (np.arange(number) * rings * sides)[:, None, None]).reshape(-1, 3)
    uv = np.broadcast_to(np.stack([beside / sides, cell / (rings - 1)], axis=-1), (number, len(one), 3, 2))
    return Surface(positions.reshape(-1, 3), triangles, uv.reshape(-1, 3, 2), np.full(len(triangles), material))


@dataclass(frozen=True)
class Stalks:
    """Where leaves or cards are.

    Attributes
    ----------
    base : (n, 3) float64
        Meters.
    along, across, up : (n, 3) float64
        Unit vectors of each: where its tip is, its width, what it turns to the sky.
    """

    base: Array
    along: Array
    across: Array
    up: Array

    @property
    def frames(self) -> Array:
        """(n, 3, 3), the axes as columns."""
        return np.stack([self.along, self.across, self.up], axis=2)


def stalks(twigs: Branches, number: int, rng: np.random.Generator, first: float = 0.15, droop: float = 0.25) -> Stalks:
    """So many on twigs, alternating along each, most of them level and somewhat hanging."""
    each = -(-number // len(twigs.points))
    of = np.repeat(np.arange(len(twigs.points)), each)
    rank = np.tile(np.arange(each), len(twigs.points))
    t = first + (1.0 - first) * (rank + rng.uniform(0.1, 0.9, len(of))) / each
    base, heading = on(twigs, of, np.minimum(t, 0.999))
    keep = np.sort(rng.permutation(len(of))[:number])
    of, rank, base, heading = of[keep], rank[keep], base[keep], heading[keep]
    side = _unit(np.cross(heading, [0.0, 0.0, 1.0]) + rng.normal(0.0, 0.15, heading.shape))
    along = _unit(0.6 * heading + np.where(rank % 2, 1.0, -1.0)[:, None] * side + [0.0, 0.0, -droop])
    along = _unit(along + rng.normal(0.0, 0.22, along.shape))
    across = _unit(np.cross([0.0, 0.0, 1.0] + rng.normal(0.0, 0.45, along.shape), along))
    return Stalks(base, along, across, np.cross(along, across))


def closed_leaves(places: Stalks, size: Array, material: int = 1) -> Surface:
    """Thin closed bodies of 16 triangles; size (n, 2): length and width, meters."""
    rim = np.array([(x, y, 0.05 * abs(y) - 0.1 * x * x) for x, y in _RIM])
    ribs = np.array([(x, 0.0, 0.02 + sign * _THICK - 0.1 * x * x) for sign in (1.0, -1.0) for x in _RIBS])
    half = np.array(_HALF)
    mirrored = np.array([0, 5, 4, 3, 0, 0, 6, 7])[half][:, ::-1]
    above = np.concatenate([half, mirrored])[:, ::-1]
    below = np.where(above >= 6, above + 2, above)[:, ::-1]
    return _placed(np.concatenate([rim, ribs]), np.concatenate([above, below]), places, size, material)


def cards(places: Stalks, size: Array, tile: NDArray[np.int64], tiles: int = 2, material: int = 1) -> Surface:
    """Quads that show a tile of a square texture of ``tiles²`` each; size (n, 2): length and width, meters."""
    corners = np.array([(0.0, -0.5, 0.0), (1.0, -0.5, 0.0), (1.0, 0.5, 0.0), (0.0, 0.5, 0.0)])
    made = _placed(corners, np.array([(0, 1, 2), (0, 2, 3)]), places, size, material)
    own = np.array([(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)])[[[0, 1, 2], [0, 2, 3]]]
    origin = np.stack([tile % tiles, tile // tiles], axis=1)
    uv = (own[None] + origin[:, None, None, :]) / tiles
    return Surface(made.positions, made.triangles, uv.reshape(-1, 3, 2), made.material)


def _placed(points: Array, triangles: NDArray, places: Stalks, size: Array, material: int) -> Surface:
    """Copies of a leaf; its first coordinate is along, the second across, and both are its UV."""
    number = len(size)
    scale = np.stack([size[:, 0], size[:, 1], size[:, 0]], axis=1)
    frames = places.frames * scale[:, None, :]
    positions = np.einsum("nij,kj->nki", frames, points) + places.base[:, None]
    whole = (triangles[None] + (np.arange(number) * len(points))[:, None, None]).reshape(-1, 3)
    one = np.stack([0.5 + points[:, 1], points[:, 0]], axis=1)[triangles]
    uv = np.broadcast_to(one, (number, *one.shape)).reshape(-1, 3, 2)
    return Surface(positions.reshape(-1, 3), whole, uv, np.full(len(whole), material))


def sprigs(pixels: int = 1024, leaves: int = 13) -> NDArray[np.float32]:
    """A painted texture (pixels, pixels, 4), linear and alpha: four sprigs, from old and dark to young and light.

    Each is a stem with pairs of leaves, transparent between them; in each, leaves grow lighter toward the tip.
    """
    half = pixels // 2
    tints = (((0.10, 0.16, 0.05), (0.20, 0.27, 0.08)), ((0.12, 0.22, 0.06), (0.28, 0.38, 0.10)))
    tints += (((0.17, 0.30, 0.07), (0.42, 0.52, 0.15)), ((0.30, 0.33, 0.10), (0.62, 0.58, 0.22)))
    painted = [_sprig(half, leaves, np.random.default_rng(n), *tint) for n, tint in enumerate(tints)]
    return np.concatenate([np.concatenate(painted[:2], axis=1), np.concatenate(painted[2:], axis=1)]).astype(np.float32)


def _sprig(size: int, leaves: int, rng: np.random.Generator, dark: tuple, light: tuple) -> Array:
    """A tile (size, size, 4); row 0 is where the stem begins, v grows along it."""
    v, u = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size - 0.5, indexing="ij")
    dark, light = np.array(dark), np.array(light)
    color = np.broadcast_to(0.6 * dark + [0.12, 0.06, 0.02], (size, size, 3)).copy()
    edge = 1.5 / size
    alpha = np.clip((0.006 - np.abs(u - 0.03 * np.sin(5 * v))) / edge, 0, 1) * (v < 0.9)
    for n in range(leaves):
        t, side = 0.05 + 0.82 * n / (leaves - 1), 1 if n % 2 else -1
        angle = np.radians(0.0 if n == leaves - 1 else rng.uniform(42, 68)) * side
        long = (0.16 if n == leaves - 1 else rng.uniform(0.28, 0.36)) * (1.0 - 0.3 * t)
        # Only near it: no leaf is wider than a third of its length.
        stem = 0.03 * np.sin(5 * t)
        rows, columns = (np.rint((np.array([-1.1, 1.1]) * long + at) * size).astype(int) for at in (t, stem + 0.5))
        near = np.s_[slice(*rows.clip(0, size)), slice(*columns.clip(0, size))]
        x, y = u[near] - stem, v[near] - t
        along, across = np.sin(angle) * x + np.cos(angle) * y, np.cos(angle) * x - np.sin(angle) * y
        s = along / long
        width = 0.27 * long * np.sin(np.pi * np.clip(s, 0, 1) ** 0.85)
        inside = np.clip((width - np.abs(across)) / edge, 0, 1) * ((s > 0) & (s < 1))
        vein = 1.0 + 0.35 * np.exp(-((across / (0.01 * 1.5)) ** 2)) + 0.12 * np.cos(60 * s + 220 * np.abs(across))
        mix = np.clip(t + 0.2 * rng.uniform(-1, 1) + 0.25 * (s - 0.5), 0, 1)[..., None]
        leaf = (dark + (light - dark) * mix) * vein[..., None] * rng.uniform(0.85, 1.1)
        color[near] = np.where(inside[..., None] > 0, leaf, color[near])
        alpha[near] = np.maximum(alpha[near], inside)
    return np.concatenate([np.clip(color, 0, 1), alpha[..., None]], axis=2)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _across(heading: Array) -> tuple[Array, Array]:
    """Two unit vectors that are square to each of some."""
    other = np.where(np.abs(heading[:, :1]) < 0.8, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    side = _unit(np.cross(heading, other))
    return side, np.cross(heading, side)


#: Trunk, boughs, branches, twigs.
ORDERS = (
    Order(1, 11.0, 0.0, (0, 0), 0.3, 14, 12),
    Order(42, 0.4, 0.2, (48, 78), 0.5, 9, 7, 0.42),
    Order(13, 0.4, 0.2, (35, 65), 0.25, 6, 5, 0.5),
    Order(9, 0.42, 0.12, (30, 62), 0.1, 4, 3, 0.5),
)
#: Length of leaves of each kind and width relative to it, meters.
_LEAF, _CARD = (0.095, 0.62), (0.42, 0.8)
_BARK, _GREEN = (0.17, 0.12, 0.08), (0.10, 0.24, 0.05)


def make(kind: str, quick: bool = False, seed: int = 7) -> bpy.types.Object:
    """A tree of a kind, of no scene yet; quick: a quarter of the triangles of ``leaves``."""
    if kind == "leaves":
        return leafy(f"Tree {seed}", QUICK_TRIANGLES if quick else TRIANGLES, seed)
    return carded(f"Tree of {kind}", seed)


def leafy(name: str, triangles: int, seed: int = 7) -> bpy.types.Object:
    """Kind ``leaves``: bark, and as many closed leaves as make so many triangles, one mesh."""
    rng = np.random.default_rng(seed)
    made = branches(ORDERS, rng)
    bark = tubes(made, ORDERS)
    wanted = (triangles - len(bark.triangles)) // 16
    places = stalks(made[-1], max(wanted, 16), rng)
    size = _sizes(places, rng, *_LEAF) * np.clip(np.sqrt(68_000 / len(places.base)), 1.0, 2.5)
    surface = joined([bark, closed_leaves(places, size)])
    materials = [image_material("Scanned bark", bark_image(), 0.9), image_material("Scanned leaf", leaf_image(), 0.5)]
    return bpy.data.objects.new(name, mesh_of(name, surface, materials))


def carded(name: str, seed: int = 7) -> bpy.types.Object:
    """Kind ``cards``: bark of boughs, and cards on their branches; each quarter of the texture has its height."""
    rng = np.random.default_rng(seed)
    made = branches(ORDERS[:3], rng)
    places = stalks(made[-1], CARDS, rng, 0.1, 0.1)
    size = _sizes(places, rng, *_CARD)
    # Young and light above and outside, old and dark below and inside, as painters of assets do.
    height = places.base[:, 2] / places.base[:, 2].max()
    tile = np.clip((4.0 * (1.25 * height - 0.25) + rng.normal(0.0, 0.5, len(height))).astype(int), 0, 3)
    surface = joined([tubes(made, ORDERS[:3]), cards(places, size, tile)])
    atlas = image_of("Sprigs", _stored(sprigs()))
    materials = [image_material("Card bark", bark_image(), 0.9)]
    materials.append(image_material("Card sprigs", atlas, 0.6, alpha=True))
    return bpy.data.objects.new(name, mesh_of(name, surface, materials, quads=CARDS))


def mesh_of(name: str, surface: Surface, materials: list[bpy.types.Material], quads: int = 0) -> bpy.types.Mesh:
    """A mesh of triangles with a UV map; so many pairs of the last ones are one face each."""
    positions = surface.positions
    alone = len(surface.triangles) - 2 * quads
    # Triangles 0 1 2 and 0 2 3 of a quad.
    kept = np.concatenate([np.arange(3 * alone), (3 * alone + 6 * np.arange(quads)[:, None] + [0, 1, 2, 5]).ravel()])
    sides = np.repeat([3, 4], [alone, quads])
    first = np.concatenate([np.arange(alone), alone + 2 * np.arange(quads)])
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(positions))
    mesh.loops.add(len(kept))
    mesh.polygons.add(len(sides))
    mesh.attributes["position"].data.foreach_set("vector", positions.astype(np.float32).ravel())
    mesh.attributes[".corner_vert"].data.foreach_set("value", surface.triangles.ravel()[kept].astype(np.int32))
    mesh.polygons.foreach_set("loop_start", (np.cumsum(sides) - sides).astype(np.int32))
    mesh.polygons.foreach_set("material_index", surface.material[first].astype(np.int32))
    uv = surface.uv.reshape(-1, 2)[kept].astype(np.float32)
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uv.ravel())
    for material in materials:
        mesh.materials.append(material)
    mesh.update(calc_edges=True)
    return mesh


def image_of(name: str, pixels: NDArray[np.float32]) -> bpy.types.Image:
    """A packed image (height, width, 4) as it is stored, sRGB; the same one when asked again."""
    if name in bpy.data.images:
        return bpy.data.images[name]
    image = bpy.data.images.new(name, pixels.shape[1], pixels.shape[0], alpha=True)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    image.update()
    image.pack()
    return image


def leaf_image(size: int = 256) -> bpy.types.Image:
    """A leaf's two sides: veins, blotches, lighter toward its tip."""
    rng = np.random.default_rng(1)
    v, u = np.meshgrid(np.linspace(0, 1, size), np.linspace(-0.5, 0.5, size), indexing="ij")
    blotches = np.kron(rng.normal(0.0, 0.12, (16, 16)), np.ones((size // 16, size // 16)))
    veins = 0.5 * np.exp(-((u / 0.015) ** 2)) + 0.2 * np.exp(-((((v - 0.7 * np.abs(u)) % 0.1) / 0.012) ** 2))
    shade = (0.8 + 0.35 * v + blotches + veins)[..., None]
    return image_of("Leaf", _stored(shade * np.array(_GREEN)))


def bark_image(size: int = 256) -> bpy.types.Image:
    """Furrows along the stem."""
    rng = np.random.default_rng(2)
    furrows = np.repeat(rng.uniform(0.5, 1.3, size)[None], size, axis=0) + rng.normal(0.0, 0.12, (size, size))
    return image_of("Bark", _stored(furrows[..., None] * np.array(_BARK)))


def image_material(name: str, image: bpy.types.Image, roughness: float, alpha: bool = False) -> bpy.types.Material:
    """Principled with an image, cut out by the image; the same one when asked again."""
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    material = bpy.data.materials.new(name)
    tree = compat.shader_tree(material)
    new, link = tree.nodes.new, tree.links.new
    texture = new("ShaderNodeTexImage")
    texture.image = image
    principled = next(node for node in tree.nodes if node.type == 'BSDF_PRINCIPLED')
    principled.inputs["Roughness"].default_value = roughness
    link(texture.outputs["Color"], principled.inputs["Base Color"])
    if alpha:
        link(texture.outputs["Alpha"], principled.inputs["Alpha"])
    return material


def _sizes(places: Stalks, rng: np.random.Generator, length: float, width: float) -> NDArray[np.float64]:
    """Lengths and widths, (n, 2)."""
    long = length * rng.uniform(0.72, 1.2, len(places.base))
    return np.stack([long, width * long * rng.uniform(0.9, 1.1, len(long))], axis=1)


def _stored(linear: NDArray[np.float64]) -> NDArray[np.float32]:
    """Pixels (height, width, 3 or 4) as sRGB stores them, with alpha."""
    light = np.clip(linear[..., :3], 0.0, 1.0)
    stored = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    alpha = linear[..., 3:] if linear.shape[2] == 4 else np.ones((*stored.shape[:2], 1))
    return np.concatenate([stored, alpha], axis=2).astype(np.float32)
