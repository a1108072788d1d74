# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An exported OBJ set as assimp reads it and mitsuba draws it, in a process without Blender, beside which it crashes.

    python -m benchmarks.mitsuba_views SET.obj POINTS.npy ALPHA.npy

Points (n, 3) are around all plants; alpha (views, h, w) has the top row first.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import Any

import assimp_py
import mitsuba
import numpy as np
from numpy.typing import NDArray

from .side_views import SIDE, VIEWS, eyes, frame_of

SAMPLES = 32


def main(path: Path, points: NDArray) -> NDArray:
    """Alpha of all views."""
    mitsuba.set_variant("scalar_rgb")
    scene: dict[str, Any] = {"type": "scene", "light": {"type": "constant"}}
    scene["integrator"] = {"type": "path", "max_depth": 64, "hide_emitters": True}  # of outlines, too
    models = {name: [_mesh(path, name, *mesh) for mesh in meshes] for name, meshes in finest(path).items()}
    with path.with_suffix(".csv").open(encoding="utf-8") as file:
        for number, row in enumerate(csv.DictReader(file)):
            for part, mesh in enumerate(models[row["variant"]]):  # its instances crash in 3.9.1
                scene[f"plant{number}_{part}"] = {**mesh, "to_world": _transform(row)}
    world, (middle, extent) = mitsuba.load_dict(scene, optimize=False), frame_of(points)
    made = []
    for eye in eyes(VIEWS):
        origin = (middle + 3.0 * extent * eye).tolist()
        look = mitsuba.ScalarTransform4f().look_at(origin=origin, target=middle.tolist(), up=[0, 0, 1])
        film = {"type": "hdrfilm", "width": SIDE, "height": SIDE, "pixel_format": "rgba", "rfilter": {"type": "box"}}
        sensor = {
            "type": "orthographic",
            "to_world": look.scale([extent / 2, extent / 2, 1.0]),
            "far_clip": 1e5,
            "film": film,
            "sampler": {"type": "independent", "sample_count": SAMPLES},
        }
        image = np.array(mitsuba.render(world, sensor=mitsuba.load_dict(sensor)))
        made.append(image[:, :, 3])
    return np.array(made)


def finest(path: Path) -> dict[str, list[tuple[str, Any]]]:
    """Materials and meshes of the finest level of each variant."""
    scene, name = assimp_py.import_file(str(path), assimp_py.Process_Triangulate), ""
    found: dict[str, list[tuple[str, Any]]] = {}
    for mesh in scene.meshes:  # of an object with two materials, the second mesh is named by its own
        name = mesh.name if "_LOD" in mesh.name else name
        if name.endswith("_LOD0"):
            material = scene.materials[mesh.material_index]["NAME"]
            found.setdefault(name.removesuffix("_LOD0"), []).append((material, mesh))
    return found


def _transform(row: dict[str, str]) -> Any:
    w, *axis = (float(row[key]) for key in ("qw", "qx", "qy", "qz"))
    made, long = mitsuba.ScalarTransform4f().translate([float(row[key]) for key in "xyz"]), float(np.linalg.norm(axis))
    if long:  # axes have to be of length 1
        made = made.rotate((np.array(axis) / long).tolist(), float(np.degrees(2.0 * np.arctan2(long, w))))
    return made.scale(float(row["scale"]))


def _mesh(path: Path, variant: str, material: str, mesh: Any) -> Any:
    """A mesh of mitsuba."""
    made = mitsuba.Mesh(material, mesh.num_vertices, mesh.num_faces)
    values = mitsuba.traverse(made)
    values["vertex_positions"] = np.array(mesh.vertices, np.float32).ravel()
    values["faces"] = np.array(mesh.indices, np.uint32).ravel()
    values.update()
    file = path.with_name(f"{variant}_{material}.ply")
    made.write_ply(str(file))
    return {"type": "ply", "filename": str(file), "bsdf": {"type": "twosided", "inner": {"type": "diffuse"}}}


if __name__ == "__main__":
    np.save(sys.argv[3], main(Path(sys.argv[1]), np.load(sys.argv[2])))
