# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees of the benchmark `assets` as Blender objects, as other tools write them.

``leaves``: a mesh of 1.2 million triangles, bark and closed leaves. ``cards``: bark and 6,000 quads with a painted
texture of leaves and holes. ``nodes``: a skeleton on which geometry nodes instance leaf objects. All are about 12 m
high. `different` makes as many trees of the first kind as one likes, each with shapes of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from tetflora_addon.blender import compat

from .asset_shapes import (
    Order,
    Stalks,
    Surface,
    branches,
    cards,
    closed_leaves,
    joined,
    open_leaf,
    sprigs,
    stalks,
    tubes,
)
from .forest_instances import placing_nodes

KINDS = ("leaves", "cards", "nodes")
TRIANGLES, QUICK_TRIANGLES = 1_200_000, 300_000
CARDS, LEAVES = 6_000, 20_000
#: Trunk, boughs, branches, twigs.
ORDERS = (
    Order(1, 11.0, 0.0, (0, 0), 0.3, 14, 12),
    Order(42, 0.4, 0.2, (48, 78), 0.5, 9, 7, 0.42),
    Order(13, 0.4, 0.2, (35, 65), 0.25, 6, 5, 0.5),
    Order(9, 0.42, 0.12, (30, 62), 0.1, 4, 3, 0.5),
)
#: Length of leaves of each kind and width relative to it, meters.
_LEAF, _NODE_LEAF, _CARD = (0.095, 0.62), 0.13, (0.42, 0.8)
_BARK, _GREEN = (0.17, 0.12, 0.08), (0.10, 0.24, 0.05)
#: Fraction of light that goes through leaves that are one sheet.
_THROUGH = 0.35


def make(kind: str, quick: bool = False, seed: int = 7) -> bpy.types.Object:
    """A tree of a kind, of no scene yet; quick: a quarter of the triangles of ``leaves``."""
    if kind == "leaves":
        return leafy(f"Tree {seed}", QUICK_TRIANGLES if quick else TRIANGLES, seed)
    return {"cards": carded, "nodes": noded}[kind](f"Tree of {kind}", seed)


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


def noded(name: str, seed: int = 7, number: int = LEAVES, realized: bool = False) -> bpy.types.Object:
    """Kind ``nodes``: a mesh of bark with loose points, on which nodes instance three leaf objects.

    realized: what nodes give is one mesh of all leaves.
    """
    rng = np.random.default_rng(seed)
    made = branches(ORDERS, rng)
    bark = tubes(made, ORDERS)
    places = stalks(made[-1], number, rng)
    material = image_material("Node leaf", leaf_image(), 0.5, _THROUGH)
    leaves = bpy.data.collections.new(f"{name}: leaves")
    shape = open_leaf()
    for i in range(3):
        bent = shape.positions * [1.0, 1.0 - 0.15 * i, 1.0 + 0.5 * i]
        mesh = mesh_of(f"{name}: leaf {i}", Surface(bent, shape.triangles, shape.uv, shape.material), [material])
        leaves.objects.link(bpy.data.objects.new(mesh.name, mesh))
    mesh = mesh_of(name, bark, [image_material("Node bark", bark_image(), 0.9)], places.base)
    size = _sizes(places, rng, _NODE_LEAF, 1.0)[:, 0]
    _place_attributes(mesh, len(bark.positions), places, size, rng)
    tree = bpy.data.objects.new(name, mesh)
    tree.modifiers.new("Leaves", 'NODES').node_group = _leaf_nodes(leaves, realized)
    return tree


def different(number: int, triangles: int, first: int = 100) -> Iterator[bpy.types.Object]:
    """Trees of kind ``leaves``, one after another, all with shapes and colors of their own."""
    for seed in range(first, first + number):
        tree = leafy(f"Tree {seed}", triangles, seed)
        materials = tree.data.materials
        materials[1] = image_material(f"Leaf {seed}", leaf_image(f"Leaf {seed}", seed), 0.5)
        yield tree


def grown(number: int, triangles: int, first: int = 100) -> Iterator[bpy.types.Object]:
    """Different trees as well, whose nodes make so many triangles of what takes a tenth of the memory in a file."""
    for seed in range(first, first + number):
        tree = noded(f"Tree {seed}", seed, 1, True)
        bark = len(tree.data.polygons)
        mesh = tree.data
        bpy.data.objects.remove(tree)
        bpy.data.meshes.remove(mesh)
        yield noded(f"Tree {seed}", seed, max((triangles - bark) // 40, 1), True)


def store_libraries(folder: Path, number: int, triangles: int) -> list[Path]:
    """Save different trees each in a file of its own, as a collection of the file's name; files that exist are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"tree{seed}.blend" for seed in range(100, 100 + number)]
    for seed, path in enumerate(paths, 100):
        if path.exists():
            continue
        (tree,) = different(1, triangles, seed)
        held = bpy.data.collections.new(path.stem)
        held.objects.link(tree)
        bpy.data.libraries.write(str(path), {held}, compress=False)
        mesh = tree.data
        bpy.data.collections.remove(held)
        bpy.data.objects.remove(tree)
        bpy.data.meshes.remove(mesh)
    return paths


def mesh_of(
    name: str,
    surface: Surface,
    materials: list[bpy.types.Material],
    loose: NDArray[np.float64] | None = None,
    quads: int = 0,
) -> bpy.types.Mesh:
    """A mesh of triangles with a UV map.

    loose: (n, 3) vertices after those of the surface; quads: so many pairs of its last triangles are one face each.
    """
    positions = surface.positions if loose is None else np.concatenate([surface.positions, loose])
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


def leaf_image(name: str = "Leaf", seed: int = 1, size: int = 256) -> bpy.types.Image:
    """A leaf's two sides: veins, blotches, lighter toward its tip."""
    rng = np.random.default_rng(seed)
    v, u = np.meshgrid(np.linspace(0, 1, size), np.linspace(-0.5, 0.5, size), indexing="ij")
    blotches = np.kron(rng.normal(0.0, 0.12, (16, 16)), np.ones((size // 16, size // 16)))
    veins = 0.5 * np.exp(-((u / 0.015) ** 2)) + 0.2 * np.exp(-((((v - 0.7 * np.abs(u)) % 0.1) / 0.012) ** 2))
    shade = (0.8 + 0.35 * v + blotches + veins)[..., None]
    tint = np.array(_GREEN) * (1.0 if seed == 1 else rng.uniform([0.7, 0.75, 0.6], [2.0, 1.25, 1.4]))
    return image_of(name, _stored(shade * tint))


def bark_image(size: int = 256) -> bpy.types.Image:
    """Furrows along the stem."""
    rng = np.random.default_rng(2)
    furrows = np.repeat(rng.uniform(0.5, 1.3, size)[None], size, axis=0) + rng.normal(0.0, 0.12, (size, size))
    return image_of("Bark", _stored(furrows[..., None] * np.array(_BARK)))


def image_material(
    name: str, image: bpy.types.Image, roughness: float, through: float = 0.0, alpha: bool = False
) -> bpy.types.Material:
    """Principled with an image, with Translucent, cut out by the image; the same one when asked again."""
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    material = bpy.data.materials.new(name)
    tree = compat.shader_tree(material)
    new, link = tree.nodes.new, tree.links.new
    texture = new("ShaderNodeTexImage")
    texture.image = image
    principled = next(node for node in tree.nodes if node.type == 'BSDF_PRINCIPLED')
    output = next(node for node in tree.nodes if node.type == 'OUTPUT_MATERIAL')
    principled.inputs["Roughness"].default_value = roughness
    link(texture.outputs["Color"], principled.inputs["Base Color"])
    surface = principled.outputs[0]
    if through:
        sheet, mix = new("ShaderNodeBsdfTranslucent"), new("ShaderNodeMixShader")
        link(texture.outputs["Color"], sheet.inputs["Color"])
        mix.inputs[0].default_value = through
        link(surface, mix.inputs[1])
        link(sheet.outputs[0], mix.inputs[2])
        surface = mix.outputs[0]
    if alpha:
        link(texture.outputs["Alpha"], principled.inputs["Alpha"])
    link(surface, output.inputs["Surface"])
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


def _place_attributes(
    mesh: bpy.types.Mesh, first: int, places: Stalks, size: NDArray[np.float64], rng: np.random.Generator
) -> None:
    """What the nodes of leaves read: which vertices are places, their turns, sizes and leaves."""
    n = len(mesh.vertices)
    frame = places.frames
    turn = np.zeros((n, 3))
    turn[first:, 0] = np.arctan2(frame[:, 2, 1], frame[:, 2, 2])
    turn[first:, 1] = -np.arcsin(np.clip(frame[:, 2, 0], -1.0, 1.0))
    turn[first:, 2] = np.arctan2(frame[:, 1, 0], frame[:, 0, 0])
    sizes, variant, is_leaf = np.zeros(n), np.zeros(n), np.zeros(n)
    sizes[first:], variant[first:], is_leaf[first:] = size, rng.integers(0, 3, len(size)), 1
    for name, kind, key, values in (
        ("turned", 'FLOAT_VECTOR', "vector", turn.astype(np.float32)),
        ("size", 'FLOAT', "value", sizes.astype(np.float32)),
        ("variant", 'INT', "value", variant.astype(np.int32)),
        ("is_leaf", 'BOOLEAN', "value", is_leaf.astype(bool)),
    ):
        mesh.attributes.new(name, kind, 'POINT').data.foreach_set(key, values.ravel())


def _leaf_nodes(leaves: bpy.types.Collection, realized: bool) -> bpy.types.GeometryNodeTree:
    """The mesh in, the mesh and instances of leaves out."""
    named = (("turned", 'FLOAT_VECTOR', "Rotation"), ("size", 'FLOAT', "Scale"), ("variant", 'INT', "Instance Index"))
    tree, members, placed = placing_nodes("GeometryNodeCollectionInfo", (*named, ("is_leaf", 'BOOLEAN', "Selection")))
    members.inputs["Collection"].default_value = leaves
    members.inputs["Separate Children"].default_value = True
    members.inputs["Reset Children"].default_value = True
    placed.inputs["Pick Instance"].default_value = True
    given = next(node for node in tree.nodes if node.type == 'GROUP_INPUT')
    made = next(node for node in tree.nodes if node.type == 'GROUP_OUTPUT')
    both = tree.nodes.new("GeometryNodeJoinGeometry")
    tree.links.new(given.outputs[0], both.inputs[0])
    tree.links.new(placed.outputs[0], both.inputs[0])
    last = both.outputs[0]
    if realized:
        whole = tree.nodes.new("GeometryNodeRealizeInstances")
        tree.links.new(last, whole.inputs[0])
        last = whole.outputs[0]
    tree.links.new(last, made.inputs[0])
    return tree
