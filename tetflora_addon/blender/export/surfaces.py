# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of exported plants: colors in atlases, with veins and bark as nodes draw them.

Cycles bakes these on a square, in a scene of its own that is gone afterward.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ...arrays import Floats, Floats32
from ...buffers import MeshBuffers
from ...export.forest import BakedSurface, Variant, identifiers, leaf_roughness
from ...export.images import TEXELS, Palette, atlas, halved, in_atlas, outline, palette_of, png, tiled, within
from ...export.levels import PlantLevel, corner_triangles, with_area
from ...export.opaque import Sides, opaque, sides_of
from ...jobs import Job, Progress
from ...optics import GLOSS
from ..attributes import image_pixels, write
from ..compat import tree_in_use
from ..materials.face_looks import FaceReader, MeshLayers, plan_of
from ..materials.node_values import luminance
from ..materials.nodes import is_ours
from ..results.leaf_objects import materials_of
from ..results.meshes import UV_MAP
from ..results.output import remove_unused
from ..species.edits import species_for

_BARK = 0.9  # roughness, where it has not been baked
_EVEN = 0.02  # what roughness varies by where it is a number, and the standard deviation of normals without a relief
_WHOLE, _THIN = 0.99, 0.05  # cover from which on there is no alpha, and below which there is no color
_MOST_THROUGH = 0.95  # transmission of materials whose colors can be told from what they reflect
_POINTS = 1 << 19  # at which alpha is looked at
_FAR = "_far"  # of kinds of parts in coarse levels, where alpha would make leaves vanish
_ABOVE = 4.0  # meters up a trunk where its bark is baked: beyond what is peculiar to its foot


@dataclass(frozen=True)
class _Look:
    """One kind of parts of a species."""

    name: str
    species: str
    part: str
    meshes: tuple[MeshBuffers, ...]
    palette: Palette

    @property
    def color(self) -> np.ndarray:
        """Mean color (3,) of the faces of the first mesh."""
        return self.meshes[0].attributes["tf_color"][1].mean(axis=0, dtype=np.float64)

    def mean(self, attribute: str) -> float:
        """Mean of an attribute of faces; 0 where there is none."""
        stored = self.meshes[0].attributes.get(attribute)
        return 0.0 if stored is None else float(stored[1].mean(dtype=np.float64))


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
    with _forgotten():
        variants = list(_even(_on_trunks(scene, variants) if bake else variants))
    looks = _looks(variants)
    by_part: dict[tuple[str, str], BakedSurface] = {}
    for number, look in enumerate(looks):
        yield Progress(number / max(len(looks), 1), f"texture of {look.name}")
        by_part[look.species, look.part] = _surface(scene, look, folder, textures, bake)
    palettes = {(look.species, look.part): look.palette for look in looks}
    textured = []
    for variant in variants:
        atlases = {part: palette for (species, part), palette in palettes.items() if species == variant.species}
        levels = tuple(in_atlas(level, atlases) for level in variant.levels)
        surfaces = {part: by_part[variant.species, part] for part in atlases}
        for part, surface in list(surfaces.items()):
            if surface.cut:
                levels = tuple(_uncut(level, part, surface.kept) for level in levels)
                opaque = {name: file for name, file in surface.textures.items() if name not in ("opacity", "card")}
                far = replace(surface, name=surface.name + _FAR, cut=0.0, problems=(), textures=opaque)
                surfaces[part + _FAR] = far
        textured.append(replace(variant, levels=levels, surfaces=surfaces))
    return tuple(textured)


def _uncut(level: PlantLevel, part: str, kept: float) -> PlantLevel:
    """A coarse level with leaves that are not cut: smaller, as textures show the mean of a leaf where it is shown."""
    if level.pixel == 0.0:
        return level
    parts = ((kind + _FAR, with_area(mesh, kept)) if kind == part else (kind, mesh) for kind, mesh in level.parts)
    return replace(level, parts=tuple(parts))


def _even(variants: Sequence[Variant]) -> Iterator[Variant]:
    """Variants in colors for materials that let no light through, as the first of their species shows its leaves."""
    sides: dict[str, Sides] = {}
    for variant in variants:
        if variant.species not in sides:
            sides[variant.species] = sides_of(variant.levels)
        yield replace(variant, levels=opaque(variant.levels, sides[variant.species]))


def _on_trunks(scene: bpy.types.Scene, variants: Sequence[Variant]) -> Iterator[Variant]:
    """Variants whose trunks have the mean colors of their bark by height: textures have one mean for all wood."""
    colors: dict[str, Floats] = {}
    for variant in variants:
        girth = max((m.attributes["tf_girth"][1].max() for k, m in variant.levels[0].parts if k == "bark"), default=0.0)
        material = materials_of(scene, species_for(scene, variant.species), "bark", 0)[0]
        if variant.species not in colors and girth and is_ours(material):
            tone, ends = np.full(3, 0.2), (np.zeros(2), np.array([1.0, _ABOVE + 1.0]))
            texels = _baked(material, tone, 0.0, TEXELS, *ends, float(girth), {"color": PASSES["color"]})["color"]
            colors[variant.species] = texels.mean(axis=(1, 2), dtype=np.float64) / tone[0]
        if variant.species in colors:
            rows, levels = colors[variant.species], []
            for level in variant.levels:
                parts = ((k, _by_height(m, rows, girth) if k == "bark" else m) for k, m in level.parts)
                levels.append(replace(level, parts=tuple(parts)))
            variant = replace(variant, levels=tuple(levels))
        yield variant


def _by_height(bark: MeshBuffers, rows: Floats, girth: float) -> MeshBuffers:
    """Bark with factors on the colors of its trunk: means over heights (t,), of which the last fifth goes on."""
    top = len(rows) * 4 // 5
    sums = np.concatenate([[0.0], np.cumsum(rows[:top]) / top * _ABOVE])
    on = float(rows[top:].mean())
    first, v = bark.face_offsets[:-1], bark.attributes["UVMap"][1][:, 1]
    low, high = ends = np.stack([each.reduceat(v, first) for each in (np.minimum, np.maximum)]).astype(np.float64)
    beyond = np.maximum(ends - _ABOVE, 0.0) + np.minimum(ends, 0.0)
    below, whole = np.interp(ends, np.linspace(0.0, _ABOVE, top + 1), sums) + on * beyond
    factor = (whole - below) / np.maximum(high - low, 1e-9)
    factor = np.where((bark.attributes["tf_girth"][1] > girth / 2.0) & (high > low), factor, 1.0)[:, None]
    color = np.clip(bark.attributes["tf_color"][1] * factor, 0.0, 1.0).astype(np.float32)
    return replace(bark, attributes={**bark.attributes, "tf_color": ("FACE", color)})


def _looks(variants: Sequence[Variant]) -> list[_Look]:
    parts: dict[tuple[str, str], list[MeshBuffers]] = {}
    for variant in variants:
        for level in variant.levels:
            for part, mesh in level.parts:
                parts.setdefault((variant.species, part), []).append(mesh)
    names = identifiers([f"{species}_{part}" for species, part in parts])
    return [
        _Look(name, species, part, tuple(meshes), palette_of(meshes, part == "bark"))
        for name, ((species, part), meshes) in zip(names, parts.items(), strict=True)
    ]


@contextmanager
def _forgotten() -> Iterator[None]:
    """Where materials of TetFlora's are made that nothing else uses, they are gone afterward."""
    before = {*bpy.data.materials, *bpy.data.node_groups}
    try:
        yield
    finally:
        remove_unused({*bpy.data.materials, *bpy.data.node_groups} - before)


@_forgotten()
def _surface(scene: bpy.types.Scene, look: _Look, folder: Path, textures: str, bake: bool) -> BakedSurface:
    is_bark = look.part == "bark"
    gloss = 0.0 if is_bark else GLOSS * (1.0 - look.mean("tf_dull"))
    rough = _BARK if is_bark else leaf_roughness(gloss)
    material, problems = _material_of(scene, look)
    images = _details(material, look) if bake and tree_in_use(material) is not None else {}
    shown = np.ones((TEXELS, TEXELS), bool)
    if not is_bark:
        shown = np.any([outline(look.palette, mesh) for mesh in look.meshes], axis=0)
    read = None if is_ours(material) else _own_of(material, look)
    cut, kept = 0.0, 1.0 if read is None or is_bark else float(read.cover[shown].mean())
    if kept < _WHOLE:
        solid = shown & (read.cover >= 0.5)
        if solid.any():
            # Textures from afar have its mean, of which nothing must vanish.
            cut, shown, problems, images = min(0.5, kept / 2.0), solid, problems + read.problems, _filled(images, read)
        else:
            problems.append(f'Material "{material.name}" is transparent everywhere; its leaves are opaque in the file')
    if images:
        if is_bark or read is not None:
            rough = float(images["roughness"][shown].mean())
        gloss = gloss if read is None else 1.0  # at most, by an index of 1.5, as Blender's own materials
        if np.ptp(images["roughness"]) < _EVEN:  # as of TetFlora's own materials
            del images["roughness"]
        if images["normal"][..., :2].std() < _EVEN:
            del images["normal"]
    if not is_bark:
        # Not as alpha of colors, which EEVEE multiplies by it: outlines are for cards, and polygons need none.
        images["opacity"] = (read.cover if cut else shown)[..., None].astype(np.float32)
    palette, color = look.palette, look.color
    detail = images.get("color", np.ones((TEXELS, TEXELS, 3), np.float32))
    if read is not None and read.color is not None:
        detail = detail / (1.0 - read.through) if "color" in images else detail * read.color
        palette, color = replace(palette, colors=np.ones_like(palette.colors)), detail[shown].mean(axis=0)
    else:
        detail = detail / np.maximum(detail[shown].mean(axis=0), 1e-6)
    files = {key: np.tile(texels, (*palette.grid[::-1], 1)) for key, texels in images.items()}
    files["color"] = atlas(palette, detail)
    if cut:
        files["card"] = np.concatenate([files["color"], files["opacity"]], axis=2)
    names = _written(files, look.name, folder, textures)
    if not cut:
        names.pop("opacity", None)
    through, color = look.mean("tf_transmission"), tuple(color.tolist())
    return BakedSurface(look.name, color, through, rough, gloss, names, cut, kept, tuple(problems))


def _material_of(scene: bpy.types.Scene, look: _Look) -> tuple[bpy.types.Material, list[str]]:
    """The material that stands for all of a kind of parts, and what is not as the artist has it."""
    species = species_for(scene, look.species)
    forms = 1 if look.part == "bark" else len(species.forms(look.part))
    every = [m for form in range(forms) for m in materials_of(scene, species, look.part, form) if m is not None]
    material = every[0]
    problems = []
    if any(other != material for other in every):
        problems.append(f'{look.name} has several materials; "{material.name}" stands for all')
    if tree_in_use(material) is None:
        problems.append(f'Material "{material.name}" has no nodes, and its viewport color stands in; turn on Use Nodes')
    return material, problems


def _details(material: bpy.types.Material, look: _Look) -> dict[str, Floats32]:
    """What is baked of a material, as cells have it."""
    is_bark = look.part == "bark"
    low, meters = look.palette.low + np.array([0.0, _ABOVE * is_bark]), 1.0
    if not is_bark:  # of its faces' edges, so that relief is as deep on them
        corner, mesh = corner_triangles(look.meshes[0])[1][:, :2], look.meshes[0]
        uv, place = mesh.attributes["UVMap"][1][corner], mesh.positions[mesh.corner_verts[corner]]
        flat, long = (np.linalg.norm(of[:, 1] - of[:, 0], axis=1).sum() for of in (uv, place))
        meters = float(long / max(flat, 1e-9))
    images = _baked(material, look.color, look.mean("tf_transmission"), TEXELS, low, look.palette.size, meters)
    return {name: tiled(texels) if is_bark else within(texels) for name, texels in images.items()}


@dataclass(frozen=True)
class _Own:
    """What is known of a material of the artist's."""

    cover: Floats32  # (t, t): part of each texel of a cell that is not transparent
    color: Floats32 | None  # (3,): mean, linear RGB; None if it follows that of the species
    through: float  # part of the scattered light that leaves on the other side, which is not baked
    problems: list[str]


def _filled(images: dict[str, Floats32], read: _Own) -> dict[str, Floats32]:
    """The same without what is baked of transparent texels: black, and colors times the part that is not."""
    solid, filled = read.cover >= 0.5, {}
    for name, texels in images.items():
        texels = texels / np.maximum(read.cover, 0.5)[..., None] if PASSES[name][1] else texels
        filled[name] = np.where(solid[..., None], texels, texels[solid].mean(axis=0))
    return filled


def _own_of(material: bpy.types.Material, look: _Look) -> _Own:
    """Read a material from its nodes, as those of assets are."""
    types = {UV_MAP: 'FLOAT2', "tf_color": 'FLOAT_COLOR'}
    plan = plan_of(material, MeshLayers(UV_MAP, types, {"tf_color": look.color[None]}), FaceReader())
    whole, *color, through = plan.constant
    cover = np.full((TEXELS, TEXELS), whole)
    if plan.names:
        row, column = np.divmod(np.arange(TEXELS**2), TEXELS)
        ends = np.stack([column, row], axis=1)[:, None] + np.array([(0, 0), (1, 0), (0, 1)])
        uv = (look.palette.low + look.palette.size * ends / TEXELS).astype(np.float32)
        corners = {UV_MAP: uv, "tf_color": np.broadcast_to(look.color.astype(np.float32), (*uv.shape[:2], 3))}
        cover = within(plan.sampled(corners, _POINTS)[:, 0].reshape(TEXELS, TEXELS))
    light = float(luminance(np.array(color)))
    passed = min(float(through) / light, _MOST_THROUGH) if light > 0.0 else 0.0
    of_species = "tf_color" in plan.names
    return _Own(cover, None if of_species else np.array(color) / max(whole, _THIN), passed, plan.problems)


def _written(files: dict[str, Floats32], name: str, folder: Path, textures: str) -> dict[str, str]:
    """Write images and halves of them; their names."""
    names = {key: f"{textures}/{name}_{key}.png" for key in files}
    (folder / textures).mkdir(exist_ok=True)
    for key, texels in files.items():
        linear = key not in ("color", "card")
        (folder / names[key]).write_bytes(png(texels, linear))
        (folder / textures / f"{name}_{key}_half.png").write_bytes(png(halved(texels), linear))
    return names


#: What is baked of a material: Blender's name, and whether it is a color.
PASSES = {"color": ('DIFFUSE', True), "roughness": ('ROUGHNESS', False), "normal": ('NORMAL', False)}
_NAME = "TetFlora bake"


def _baked(
    material: bpy.types.Material,
    color: Floats,
    through: float,
    size: int,
    low: Floats,
    extent: Floats,
    meters: float,
    passes: Mapping[str, tuple[str, bool]] = PASSES,
) -> dict[str, Floats32]:
    """Texels (size, size, 3) of a material by the names of `PASSES`, row 0 lowest.

    They are those of faces of a linear color (3,) and a transmission, over a square of texture coordinates from ``low``
    on (2,), with so many meters to a unit of these.
    """
    images: dict[str, Floats32] = {}
    copy = material.copy()  # those of other files cannot be changed
    try:
        node = copy.node_tree.nodes.active = copy.node_tree.nodes.new("ShaderNodeTexImage")
        with _square(copy, color, through, low, extent, meters) as (scene, obj):
            given = {"scene": scene, "view_layer": scene.view_layers[0], "active_object": obj, "object": obj}
            for name, (kind, is_color) in passes.items():
                node.image = bpy.data.images.new(_NAME, size, size, float_buffer=True, is_data=not is_color)
                try:
                    with bpy.context.temp_override(**given, selected_objects=[obj], selected_editable_objects=[obj]):
                        bpy.ops.object.bake(type=kind, pass_filter={'COLOR'} if is_color else set(), margin=0)
                    images[name] = image_pixels(node.image)[..., :3].copy()
                finally:
                    bpy.data.images.remove(node.image)
    finally:
        bpy.data.materials.remove(copy)
    return images


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
            mesh.uv_layers.new(name=name).uv.foreach_set("vector", np.ascontiguousarray(uv, np.float32).reshape(-1))
        mesh.uv_layers.active = mesh.uv_layers["bake"]
        for name, value in (("tf_color", color), ("tf_transmission", through), ("tf_girth", meters)):
            write(mesh, name, np.array([value], np.float32), 'FACE')
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
