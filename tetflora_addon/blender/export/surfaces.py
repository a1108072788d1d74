# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of exported plants: colors in atlases, with veins and bark as nodes draw them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ...arrays import Floats32
from ...buffers import MeshBuffers
from ...export.forest import BakedSurface, Variant, identifiers
from ...export.images import (
    LEAVES,
    TEXELS,
    WOOD,
    Palette,
    atlas,
    halved,
    in_atlas,
    outline,
    palette_of,
    png,
    tiled,
    within,
)
from ...jobs import Job, Progress
from ...optics import GLOSS
from ..results.leaf_objects import materials_of
from ..species.edits import species_for
from .bake import baked

#: Roughness of what has not been baked.
_ROUGH = {"bark": 0.9}
_LEAF = 0.1  # meters to a leaf, for the depth of what is baked
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
    looks = _looks(variants)
    found: dict[tuple[str, str], BakedSurface] = {}
    for number, look in enumerate(looks):
        yield Progress(number / max(len(looks), 1), f"texture of {look.name}")
        found[look.species, look.part] = _surface(scene, look, folder, textures, bake)
    palettes = {(look.species, look.part): look.palette for look in looks}
    made = []
    for variant in variants:
        own = {part: palette for (species, part), palette in palettes.items() if species == variant.species}
        levels = tuple(in_atlas(level, own) for level in variant.levels)
        made.append(replace(variant, levels=levels, surfaces={part: found[variant.species, part] for part in own}))
    return tuple(made)


def _looks(variants: Sequence[Variant]) -> list[_Look]:
    parts: dict[tuple[str, str], list[MeshBuffers]] = {}
    for variant in variants:
        for level in variant.levels:
            for part, mesh in level.parts:
                parts.setdefault((variant.species, part), []).append(mesh)
    names = identifiers([f"{species}_{part}" for species, part in parts])
    return [
        _Look(name, species, part, tuple(meshes), palette_of(meshes, WOOD if part == "bark" else LEAVES))
        for name, ((species, part), meshes) in zip(names, parts.items(), strict=True)
    ]


def _surface(scene: bpy.types.Scene, look: _Look, folder: Path, textures: str, bake: bool) -> BakedSurface:
    is_bark = look.part == "bark"
    images: dict[str, Floats32] = {}
    if bake:
        species = species_for(scene, look.species)
        material = materials_of(scene, species, look.part, 0)[0]
        low = look.palette.low + np.array([0.0, _ABOVE * is_bark])
        given = (low, look.palette.size, 1.0 if is_bark else _LEAF)
        images = baked(material, look.color, look.mean("tf_transmission"), TEXELS, *given)
        images = {name: tiled(own) if is_bark else within(own) for name, own in images.items()}
    rough = float(images.pop("roughness", np.full(1, _ROUGH.get(look.part, 0.5))).mean())
    detail = images.get("color", np.ones((TEXELS, TEXELS, 3), np.float32))
    shown = None if is_bark else outline(look.palette, look.meshes[0])
    seen = detail.reshape(-1, 3) if shown is None else detail[shown]
    detail = detail / np.maximum(seen.mean(axis=0), 1e-6)
    files = {"color": atlas(look.palette, detail, shown)}
    if "normal" in images:
        files["normal"] = np.tile(images["normal"], (*look.palette.grid[::-1], 1))
    names = {}
    for key, texels in files.items():
        names[key] = f"{textures}/{look.name}_{key}.png"
        (folder / textures).mkdir(exist_ok=True)
        (folder / names[key]).write_bytes(png(texels, linear=key == "normal"))
        half = png(halved(texels), linear=key == "normal")
        (folder / textures / f"{look.name}_{key}_half.png").write_bytes(half)
    color = tuple(look.color.tolist())
    gloss = 0.0 if is_bark else GLOSS * (1.0 - look.mean("tf_dull"))
    return BakedSurface(look.name, color, look.mean("tf_transmission"), rough, gloss, not is_bark, names)
