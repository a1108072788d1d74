# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of exported plants: colors in atlases, with veins and bark as nodes draw them.

Cycles bakes these on a square, in a scene of its own that is gone afterward.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ...arrays import Floats, Floats32
from ...buffers import MeshBuffers
from ...export import images
from ...export.forest import BakedSurface, Variant, identifiers, leaf_roughness
from ...export.levels import corner_triangles
from ...export.opaque import Sides, opaque, sides_of
from ...jobs import Job, Progress
from ...optics import GLOSS
from ..attributes import image_pixels, write
from ..materials.nodes import is_ours
from ..results.leaf_objects import materials_of
from ..species.edits import species_for

_BARK = 0.9  # roughness, where it has not been baked
_EVEN = 0.02  # what roughness varies by where it is a number, and the standard deviation of normals without a relief
_ABOVE = 4.0  # meters up a trunk where its bark is baked: beyond what is peculiar to its foot


@dataclass(frozen=True)
class _Look:
    """One kind of parts of a species."""

    name: str
    species: str
    part: str
    meshes: tuple[MeshBuffers, ...]
    palette: images.Palette

    @property
    def color(self) -> np.ndarray:
        """Mean color (3,) of the faces of the first mesh."""
        return self.meshes[0].attributes["tf_color"][1].mean(axis=0, dtype=np.float64)

    def mean(self, attribute: str) -> float:
        """Mean of an attribute of faces; 0 where there is none."""
        found = self.meshes[0].attributes.get(attribute)
        return 0.0 if found is None else float(found[1].mean(dtype=np.float64))


def with_surfaces(
    scene: bpy.types.Scene, variants: Sequence[Variant], folder: Path, textures: str, bake: bool
) -> Job[tuple[Variant, ...]]:
    """Variants with materials, and coordinates in their textures, which are written to a folder within another one.

    Parameters
    ----------
    folder : Path
        Of the file that will name the textures.
    textures : str
        Name of the folder in it for these.
    bake : bool
        Whether veins, bark and relief are baked; otherwise, textures have colors and outlines only.
    """
    variants = list(_opaque(variants))
    looks = _looks(variants)
    found: dict[tuple[str, str], BakedSurface] = {}
    for number, look in enumerate(looks):
        yield Progress(number / max(len(looks), 1), f"texture of {look.name}")
        found[look.species, look.part] = _surface(scene, look, folder, textures, bake)
    palettes = {(look.species, look.part): look.palette for look in looks}
    made = []
    for variant in variants:
        own = {part: palette for (species, part), palette in palettes.items() if species == variant.species}
        levels = tuple(images.in_atlas(level, own) for level in variant.levels)
        made.append(replace(variant, levels=levels, surfaces={part: found[variant.species, part] for part in own}))
    return tuple(made)


def _opaque(variants: Sequence[Variant]) -> Iterator[Variant]:
    """Variants in colors for materials that let no light through, as the first of their species shows its leaves."""
    sides: dict[str, Sides] = {}
    for variant in variants:
        if variant.species not in sides:
            sides[variant.species] = sides_of(variant.levels)
        yield replace(variant, levels=opaque(variant.levels, sides[variant.species]))


def _looks(variants: Sequence[Variant]) -> list[_Look]:
    parts: dict[tuple[str, str], list[MeshBuffers]] = {}
    for variant in variants:
        for level in variant.levels:
            for part, mesh in level.parts:
                parts.setdefault((variant.species, part), []).append(mesh)
    names = identifiers([f"{species}_{part}" for species, part in parts])
    return [
        _Look(
            name,
            species,
            part,
            tuple(meshes),
            images.palette_of(meshes, images.WOOD if part == "bark" else images.LEAVES),
        )
        for name, ((species, part), meshes) in zip(names, parts.items(), strict=True)
    ]


def _surface(scene: bpy.types.Scene, look: _Look, folder: Path, textures: str, bake: bool) -> BakedSurface:
    is_bark = look.part == "bark"
    gloss = 0.0 if is_bark else GLOSS * (1.0 - look.mean("tf_dull"))
    rough = _BARK if is_bark else leaf_roughness(gloss)
    maps: dict[str, Floats32] = {}
    if bake:
        species = species_for(scene, look.species)
        material = materials_of(scene, species, look.part, 0)[0]
        low = look.palette.low + np.array([0.0, _ABOVE * is_bark])
        given = (low, look.palette.size, 1.0 if is_bark else _meters(look.meshes[0]))
        maps = baked(material, look.color, look.mean("tf_transmission"), images.TEXELS, *given)
        maps = {name: images.tiled(own) if is_bark else images.within(own) for name, own in maps.items()}
        if is_bark or not is_ours(material):
            rough = float(maps["roughness"].mean())
        if np.ptp(maps["roughness"]) < _EVEN:  # as of TetFlora's own materials
            del maps["roughness"]
        if maps["normal"][..., :2].std() < _EVEN:
            del maps["normal"]
    detail = maps.get("color", np.ones((images.TEXELS, images.TEXELS, 3), np.float32))
    shown = None if is_bark else np.any([images.outline(look.palette, mesh) for mesh in look.meshes], axis=0)
    seen = detail.reshape(-1, 3) if shown is None else detail[shown]
    detail = detail / np.maximum(seen.mean(axis=0), 1e-6)
    # Not as alpha of colors, which EEVEE multiplies by it: outlines are for cards, and polygons need none.
    maps |= {} if shown is None else {"opacity": shown[..., None].astype(np.float32)}
    files = {key: np.tile(texels, (*look.palette.grid[::-1], 1)) for key, texels in maps.items()}
    files["color"] = images.atlas(look.palette, detail)
    names = {}
    for key, texels in files.items():
        names[key] = f"{textures}/{look.name}_{key}.png"
        (folder / textures).mkdir(exist_ok=True)
        (folder / names[key]).write_bytes(images.png(texels, linear=key != "color"))
        half = images.png(images.halved(texels), linear=key != "color")
        (folder / textures / f"{look.name}_{key}_half.png").write_bytes(half)
    names.pop("opacity", None)
    color = tuple(look.color.tolist())
    return BakedSurface(look.name, color, look.mean("tf_transmission"), rough, gloss, names)


def _meters(mesh: MeshBuffers) -> float:
    """Meters to a unit of texture coordinates: of its faces' edges, so that relief is as deep on them."""
    corner = corner_triangles(mesh)[1][:, :2]
    uv, place = mesh.attributes["UVMap"][1][corner], mesh.positions[mesh.corner_verts[corner]]
    flat, long = (np.linalg.norm(of[:, 1] - of[:, 0], axis=1).sum() for of in (uv, place))
    return float(long / max(flat, 1e-9))


#: What is baked of a material: Blender's name, and whether it is a color.
PASSES = {"color": ('DIFFUSE', True), "roughness": ('ROUGHNESS', False), "normal": ('NORMAL', False)}
_NAME = "TetFlora bake"


def baked(
    material: bpy.types.Material, color: Floats, through: float, size: int, low: Floats, extent: Floats, meters: float
) -> dict[str, Floats32]:
    """Texels (size, size, 3) of a material by the names of `PASSES`, row 0 lowest.

    Parameters
    ----------
    color : (3,) float
        Of the faces, linear RGB.
    through : float
        Their transmission.
    low, extent : (2,) float
        Texture coordinates that the square shows.
    meters : float
        To a unit of texture coordinates.
    """
    found: dict[str, Floats32] = {}
    with _square(material, color, through, low, extent, meters) as (scene, obj):
        for name, (kind, is_color) in PASSES.items():
            image = bpy.data.images.new(_NAME, size, size, float_buffer=True, is_data=not is_color)
            node = material.node_tree.nodes.new("ShaderNodeTexImage")
            before = material.node_tree.nodes.active
            try:
                node.image, material.node_tree.nodes.active = image, node
                given = {"scene": scene, "view_layer": scene.view_layers[0], "active_object": obj, "object": obj}
                with bpy.context.temp_override(**given, selected_objects=[obj], selected_editable_objects=[obj]):
                    bpy.ops.object.bake(type=kind, pass_filter={'COLOR'} if is_color else set(), margin=0)
                found[name] = image_pixels(image)[..., :3].copy()
            finally:
                material.node_tree.nodes.remove(node)
                material.node_tree.nodes.active = before
                bpy.data.images.remove(image)
    return found


@contextmanager
def _square(
    material: bpy.types.Material, color: Floats, through: float, low: Floats, extent: Floats, meters: float
) -> Iterator[tuple[bpy.types.Scene, bpy.types.Object]]:
    """A square of the material in a scene with Cycles at one sample."""
    scene, mesh = bpy.data.scenes.new(_NAME), bpy.data.meshes.new(_NAME)
    obj = bpy.data.objects.new(_NAME, mesh)
    try:
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
        mesh.from_pydata(np.pad(meters * extent * corners, ((0, 0), (0, 1))).tolist(), [], [(0, 1, 2, 3)])
        for name, uv in (("UVMap", low + corners * extent), ("bake", corners)):
            layer = mesh.uv_layers.new(name=name)
            layer.uv.foreach_set("vector", np.ascontiguousarray(uv, np.float32).reshape(-1))
        mesh.uv_layers.active = mesh.uv_layers["bake"]
        write(mesh, "tf_color", np.array([color], np.float32), 'FACE')
        write(mesh, "tf_transmission", np.array([through], np.float32), 'FACE')
        write(mesh, "tf_girth", np.array([meters], np.float32), 'FACE')
        mesh.materials.append(material)
        scene.collection.objects.link(obj)
        scene.render.engine = 'CYCLES'
        scene.cycles.samples, scene.cycles.use_denoising = 1, False
        scene.view_layers[0].update()
        yield scene, obj
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(mesh)
