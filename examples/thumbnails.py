# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of the catalog's species for menus: ``python -m examples.thumbnails [--seasons] [IDENTIFIER ...]``.

One plant of each species in daylight, rendered by Cycles in front of a light gray, 128 × 128 pixels, into
``tetflora_addon/catalog/thumbnails``. Images are stored with palettes, because all of them are in the extension. With
``--seasons``, those of the four seasons instead, of species that look different then.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

from devtools import session
from devtools.formats import set_format

FOLDER = session.ROOT / "tetflora_addon" / "catalog" / "thumbnails"
SIDE, SAMPLES, SEED = 128, 96, 11
COLORS = 96  # of a palette
LARGEST = 12_000  # bytes
#: Days of the seasons that have images of their own, and the least change of a plant's pixels, display values of 255.
DAYS = {"spring": 125.0, "summer": 196.0, "autumn": 293.0, "winter": 20.0}
CHANGED = 6.0
BACKDROP = (199, 209, 214)  # display values of 255; conifers would not be seen on the dark gray of menus


def render_thumbnail(identifier: str, path: Path, day: float | None = None) -> None:
    """Render one plant of a species, full-grown or on a day of the year, as a PNG with a transparent background."""
    import bpy
    import numpy as np

    from tetflora_addon.blender.job import plant_mesh
    from tetflora_addon.jobs import run_to_end

    from . import stage

    session.clean_file()
    scene = bpy.context.scene
    empty = stage.plant(scene, identifier, SEED, (0.0, 0.0, 0.0))
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    (plant,) = run_to_end(plant_mesh.make_plant_mesh_steps(scene, graph, [empty]))
    points = np.zeros((len(plant.data.vertices), 3), np.float32)
    plant.data.vertices.foreach_get("co", points.reshape(-1))
    # A few twigs that reach far out must not make the rest small.
    low, high = np.quantile(points, 0.002, axis=0), np.quantile(points, 0.998, axis=0)
    low[2] = min(low[2], 0.0)
    if day is not None:  # in the same frame
        bpy.data.objects.remove(plant)
        scene.tetflora.year.enabled, scene.tetflora.year.day = True, day
        run_to_end(plant_mesh.make_plant_mesh_steps(scene, graph, [empty]))
    middle, side = (low + high) / 2, max(float((high - low).max()), math.hypot(*(high - low)[:2])) * 1.06
    stage.camera(scene, middle + side * np.array([1.2, -2.4, 0.55]), middle, (SIDE, SIDE), far=10.0 * side, across=side)
    stage.daylight(scene, elevation=45.0, azimuth=215.0)
    scene.tetflora.refine_at_render = False
    scene.render.engine, scene.render.film_transparent = 'CYCLES', True
    scene.cycles.samples, scene.cycles.use_denoising = SAMPLES, False
    scene.view_settings.exposure = 1.1
    image = scene.render.image_settings
    set_format(image, 'PNG')
    image.color_mode, image.color_depth, image.compression = 'RGBA', '8', 100
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def _shrink(source: Path, target: Path) -> None:
    """Store an image in front of the backdrop, with a palette."""
    from PIL import Image

    rendered = Image.open(source).convert("RGBA")
    whole = Image.new("RGBA", rendered.size, BACKDROP)
    whole.alpha_composite(rendered)
    few = whole.convert("RGB").quantize(COLORS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few.save(target, "PNG", optimize=True)


def _change(first: Path, second: Path) -> float:
    """Mean difference of two images where a plant is in either, display values of 255."""
    import numpy as np
    from PIL import Image

    one, other = (np.asarray(Image.open(path).convert("RGB"), float) for path in (first, second))
    plant = (np.abs(one - BACKDROP).max(axis=2) > CHANGED) | (np.abs(other - BACKDROP).max(axis=2) > CHANGED)
    return float(np.abs(one - other)[plant].mean()) if plant.any() else 0.0


def main(arguments: list[str]) -> int:
    """Make the images that are asked for, or all; exit code 1 if one is too large."""
    session.start()
    from tetflora_addon.species import catalog

    known = catalog.list_species()
    wanted = [one for one in arguments if one != "--seasons"] or list(known)
    if "--seasons" in arguments:
        years = {one: year for one in wanted if (year := catalog.load_species(one).year) is not None}
        images = [
            (one, day, f"{one}.{season}.png")
            for one, year in years.items()
            for season, day in DAYS.items()
            if season != "summer" or year.blossom is not None  # otherwise it is as without seasons
        ]
    else:
        images = [(one, None, f"{one}.png") for one in wanted]
    FOLDER.mkdir(exist_ok=True)
    large = []
    with tempfile.TemporaryDirectory() as folder:
        for identifier, day, name in images:
            render_thumbnail(identifier, Path(folder) / "plant.png", day)
            target = FOLDER / name
            _shrink(Path(folder) / "plant.png", target)
            if day is not None and _change(target, FOLDER / f"{identifier}.png") < CHANGED:
                target.unlink()
                continue
            print(f"{target.stat().st_size:>8,} {target.relative_to(session.ROOT)}", flush=True)
            large += [name] if target.stat().st_size > LARGEST else []
    if large:
        print(f"larger than {LARGEST:,} bytes: {', '.join(large)}", file=sys.stderr)
    return 1 if large else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
