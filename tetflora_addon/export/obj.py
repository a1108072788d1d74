# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Variants as Wavefront OBJ, an object for each level, with their materials; and a table of all places beside it.

For programs without instances in files, and pictures of single plants. Sizes at which levels take over are comments.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import numpy as np

from ..buffers import MeshBuffers
from .forest import Forest


def write_obj(path: Path, forest: Forest) -> Iterator[float]:
    """Write a file, its materials (``.mtl``) and a table of plants (``.csv``); yields how much of it is done.

    Raises
    ------
    OSError
        One of them cannot be written.
    """
    lines = []
    for surface in forest.surfaces:
        color = " ".join(f"{x:.4f}" for x in surface.color)
        lines += [f"newmtl {surface.name}", f"Kd {color}", "Ks 0 0 0", f"Pr {surface.roughness:.3f}"]
        named = (("map_Kd", "color"), ("norm", "normal"), ("map_Pr", "roughness"), ("map_d", "card"))
        lines += [f"{key} {surface.textures[name]}" for key, name in named if name in surface.textures]
    path.with_suffix(".mtl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    vertices = corners = 0
    with path.open("w", encoding="utf-8") as file:
        file.write(f"mtllib {path.with_suffix('.mtl').name}\n")
        for number, variant in enumerate(forest.variants):
            yield number / len(forest.variants)
            for count, level in enumerate(variant.levels):
                size = level.screen_size(variant.height)
                file.write(f"# from {level.distance:.2f} m on, at {size:.4f} of the screen's height\n")
                file.write(f"o {variant.name}_LOD{count}\n")
                for kind, mesh in level.parts:
                    file.write(f"usemtl {variant.surfaces[kind].name}\n")
                    _write_mesh(file, mesh, vertices + 1, corners + 1)
                    vertices, corners = vertices + len(mesh.positions), corners + len(mesh.corner_verts)
    with path.with_suffix(".csv").open("w", encoding="utf-8") as file:
        file.write("variant,x,y,z,qw,qx,qy,qz,scale,species,seed,age,height\n")
        names = np.array([variant.name for variant in forest.variants])
        for part in forest.parts:
            place, turn = (part.origin + part.position).T, part.rotation.T
            kinds = np.array([species for species, _ in part.kinds])[part.species]
            numbers = part.seed, part.age, part.height
            rows = np.rec.fromarrays([names[part.variant], *place, *turn, part.scale, kinds, *numbers])
            np.savetxt(file, rows, ",".join(["%s", *["%.9g"] * 8, "%s", "%d", "%.9g", "%.6g"]))


def _write_mesh(file: TextIO, mesh: MeshBuffers, vertex: int, corner: int) -> None:
    """Vertices, texture coordinates and faces, which count from 1 through the file."""
    np.savetxt(file, mesh.positions, "v %.6g %.6g %.6g")
    np.savetxt(file, mesh.attributes["UVMap"][1], "vt %.6g %.6g")
    size = np.diff(mesh.face_offsets)
    for number in np.unique(size).tolist():
        index = mesh.face_offsets[:-1][size == number][:, None] + np.arange(number)
        both = np.stack([mesh.corner_verts[index] + vertex, index + corner], axis=2).reshape(len(index), -1)
        np.savetxt(file, both, "f" + " %d/%d" * number)
