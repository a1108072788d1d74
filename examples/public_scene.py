# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The public test scene: four species at three distances, with a reference of all polygons and FLIP against it.

The scene is seeds: this script grows it. Folder ``examples/public`` holds the references, their masks and a README.

    python -m examples.public_scene build near scene.blend
    python -m examples.public_scene expand near scene.usdc
    python -m examples.public_scene render near FOLDER
    python -m examples.public_scene compare IMAGE REFERENCE MASK
"""

from __future__ import annotations

import argparse
import json
import sys
from math import atan, tan
from pathlib import Path
from tempfile import TemporaryDirectory

from devtools import session

session.start()

import bpy  # noqa: E402
import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from benchmarks import pictures as images  # noqa: E402
from devtools.formats import set_format  # noqa: E402
from examples import stands  # noqa: E402
from tetflora_addon.blender.job import refine  # noqa: E402

#: Height of plants in pixels, and plants of each species, by the name of the distance.
DISTANCES = {"near": (94, 1), "middle": (24, 2), "far": (12, 2)}
LIGHT = "side"
#: Of a plant's column, what the image shows more on the left and on the right: oaks are wider than their columns.
MARGIN = 0.35
SAMPLES = 512
#: Fraction of a pixel that plants cover where it counts.
LEAST_COVERAGE = 0.05
FOLDER = Path(__file__).parent / "public"


def build(distance: str) -> bpy.types.Scene:
    """Fill the empty scene with seeds, sun, sky, ground and camera, for Cycles."""
    session.clean_file()
    scene = bpy.context.scene
    pixels, each = DISTANCES[distance]
    stands.build(scene, pixels, LIGHT, each)
    _widen(scene, MARGIN / (each * len(stands.SPECIES)))
    scene.render.engine = 'CYCLES'
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    return scene


def _widen(scene: bpy.types.Scene, part: float) -> None:
    """Show a part of the width more on either side; nothing changes its size in the image, nor its height there."""
    before = scene.render.resolution_x
    scene.render.resolution_x += 2 * round(part * before)
    wider = scene.render.resolution_x / before
    camera = scene.camera.data
    camera.angle = 2.0 * atan(wider * tan(camera.angle / 2.0))
    camera.shift_y /= wider  # in widths of the image


def make(scene: bpy.types.Scene, expand: bool) -> None:
    """Give the scene its plants: all polygons, or what TetFlora refines them to."""
    scene.tetflora.expand_everything = expand
    refine.refine(scene, bpy.context.evaluated_depsgraph_get())


def export(distance: str, path: Path, expand: bool = True) -> None:
    """Write the scene as .blend, .obj or USD by the name's ending, with all polygons or as seeds (.blend)."""
    scene = build(distance)
    if expand:
        scene.tetflora.output.save_results = True
        make(scene, expand)
    else:
        scene.tetflora.refine_at_render = True
    if path.suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), copy=True)
    elif path.suffix == ".obj":
        bpy.ops.wm.obj_export(filepath=str(path), export_materials=False)
    else:
        bpy.ops.wm.usd_export(filepath=str(path))


def render(distance: str, folder: Path, samples: int = SAMPLES, seed: int = 0, expand: bool = True) -> None:
    """Render the image (half floats, linear) and, with all polygons, the mask: how much plants cover, 8 bits."""
    scene = build(distance)
    make(scene, expand)
    settings = scene.render.image_settings
    set_format(settings, 'OPEN_EXR')
    settings.color_mode, settings.color_depth, settings.exr_codec = 'RGB', '16', 'ZIP'
    images.render(scene, folder / f"{distance}.exr", samples, seed, form='OPEN_EXR')
    if expand:
        with TemporaryDirectory() as spare:
            cover = images.coverage(scene, Path(spare) / "cover.png", 256)
        images.save_picture(folder / f"{distance}-mask.png", cover)


def stored(path: Path) -> NDArray[np.float32]:
    """Image (height, width, 3) as an sRGB display stores it, 0 to 1; .exr and .hdr are linear, others sRGB already."""
    pixels = images.read_picture(path)[:, :, :3]
    return displayed(pixels) if path.suffix.lower() in {".exr", ".hdr"} else np.clip(pixels, 0.0, 1.0)


def displayed(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """Linear light, any shape, as an sRGB display stores it (IEC 61966-2-1), 0 to 1."""
    light = np.clip(light, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)


def compare(image: Path, reference: Path, mask: Path) -> dict[str, float]:
    """FLIP where plants are and of the whole image, and the difference of the mean color where plants are."""
    seen = images.read_picture(mask)[:, :, 0] > LEAST_COVERAGE
    a, b = stored(reference), stored(image)
    if a.shape != b.shape:
        raise SystemExit(f"{image} has {b.shape[1]} × {b.shape[0]} pixels, its reference {a.shape[1]} × {a.shape[0]}")
    error = images.flip_map(a, b)
    found = {"flip": error[seen].mean(), "flip_all": error.mean(), "color": images.color_error(a, b, seen)}
    return {key: round(float(value), 5) for key, value in found.items()}


def main() -> None:
    """Run a command of the command line."""
    parser = argparse.ArgumentParser(prog="python -m examples.public_scene", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("build", "expand"):
        command = commands.add_parser(name)
        command.add_argument("distance", choices=DISTANCES)
        command.add_argument("path", type=Path)
    command = commands.add_parser("render")
    command.add_argument("distance", choices=DISTANCES)
    command.add_argument("folder", type=Path)
    command.add_argument("--samples", type=int, default=SAMPLES)
    command.add_argument("--seed", type=int, default=0, help="of the renderer's noise")
    command.add_argument("--refined", action="store_true", help="what TetFlora refines the plants to")
    command = commands.add_parser("compare")
    for name in ("image", "reference", "mask"):
        command.add_argument(name, type=Path)
    given = parser.parse_args()
    if given.command == "compare":
        print(json.dumps(compare(given.image, given.reference, given.mask)))
    elif given.command == "render":
        given.folder.mkdir(parents=True, exist_ok=True)
        render(given.distance, given.folder, given.samples, given.seed, expand=not given.refined)
    else:
        export(given.distance, given.path, expand=given.command == "expand")


if __name__ == "__main__":
    sys.exit(main())
