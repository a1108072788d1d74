# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A wood that geometry nodes scatter from one model of 1.2 million triangles: plain above, refined below.

python -m examples.scattered            # docs/images/assets.jpg
python -m examples.scattered --instances 200 --width 320 --samples 8 --out out/assets.jpg

Both are of the same model at the same places; the second is refined although Cycles needs no help with one model.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import bpy
from PIL import Image

from devtools import session

ROOT = Path(__file__).resolve().parent.parent
#: Rows of white between the two pictures.
_GAP = 6


def render(scene: bpy.types.Scene, path: Path) -> Image.Image:
    """One picture of the scene as it is."""
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return Image.open(path).convert("RGB")


def pair(instances: int, width: int, samples: int) -> Image.Image:
    """Both pictures, one above the other."""
    from benchmarks import assets
    from tetflora_addon.blender.job.refine import refine

    scene, size = bpy.context.scene, (width, width * 9 // 20)
    instancer = assets.build(scene, assets.Scatter("leaves", instances, "near", size=size))
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = samples, True
    with tempfile.TemporaryDirectory() as folder:
        plain = render(scene, Path(folder) / "plain.png")
        instancer.tetflora.is_scatter = True
        scene.tetflora.asset_detail = 'REFINE'
        statistics = refine(scene, bpy.context.evaluated_depsgraph_get())
        print(
            f"{statistics.polygons_full:,} polygons: {statistics.instances_whole} originals, "
            f"{statistics.instances_clusters} clusters, {statistics.polygons_proxy:,} facets"
        )
        refined = render(scene, Path(folder) / "refined.png")
    both = Image.new("RGB", (size[0], 2 * size[1] + _GAP), "white")
    both.paste(plain, (0, 0))
    both.paste(refined, (0, size[1] + _GAP))
    return both


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--instances", type=int, default=10_000)
    parser.add_argument("--width", type=int, default=800)
    parser.add_argument("--samples", type=int, default=20)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images" / "assets.jpg")
    given = parser.parse_args(arguments)
    session.start()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    pair(given.instances, given.width, given.samples).save(given.out, quality=88)


if __name__ == "__main__":
    main(sys.argv[1:])
