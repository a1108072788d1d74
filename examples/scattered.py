# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A wood that geometry nodes scatter from one model of 1.2 million triangles: plain above, refined below.

python -m examples.scattered            # docs/images/assets.jpg
python -m examples.scattered --instances 200 --width 320 --samples 8 --out out/assets.jpg

Both are of the same model at the same places; the second is refined although Cycles needs no help with one model.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
from PIL import Image

from devtools import session

from . import stage
from .paper.pictures import save_jpeg

SIZE, SAMPLES, INSTANCES = (800, 360), 20, 10_000
#: Rows of white between the two pictures.
_GAP = 6
#: Stops: the eye stands in the shade of the crowns.
_EXPOSURE = 1.0


def render_pair(path: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES, instances: int = INSTANCES) -> None:
    """Both pictures, one above the other, as a JPEG; in an empty scene."""
    from benchmarks import assets

    from .paper.scenes import refined, rendered

    scene = bpy.context.scene
    instancer = assets.build(scene, assets.Scatter("leaves", instances, "near", size=size))
    scene.view_settings.exposure = _EXPOSURE
    both = Image.new("RGB", (size[0], 2 * size[1] + _GAP), "white")
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "picture.png"
        rendered(scene, picture, samples)
        both.paste(Image.open(picture), (0, 0))
        instancer.tetflora.is_scatter = True
        scene.tetflora.asset_detail = 'REFINE'
        statistics = refined(scene)
        print(
            f"{statistics.polygons_full:,} polygons: {statistics.instances_whole} originals, "
            f"{statistics.instances_clusters} clusters, {statistics.polygons_proxy:,} facets"
        )
        rendered(scene, picture, samples)
        both.paste(Image.open(picture), (0, size[1] + _GAP))
    save_jpeg(both, path)


def main() -> None:
    """Command line."""
    parser = stage.words(__doc__, session.ROOT / "docs" / "images" / "assets.jpg", SIZE, SAMPLES)
    parser.add_argument("--instances", type=int, default=INSTANCES)
    given = parser.parse_args()
    session.start()
    session.clean_file()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    render_pair(given.out, stage.size_of(given, SIZE), given.samples, given.instances)


if __name__ == "__main__":
    main()
