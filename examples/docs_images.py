# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the rendered images of the documentation anew: ``python -m examples.docs_images`` (``make docs-images``).

Pictures of the window come from `devtools.window_pictures`, which needs a full Blender.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

from devtools import session

from .paper.pictures import LARGEST, save_jpeg

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"


def store(source: Path, target: Path) -> None:
    """Store an image as a JPEG, without what Blender writes into it, such as the path of the file."""
    save_jpeg(Image.open(source).convert("RGB"), target)


def main() -> int:
    """Render all; exit code 1 if an image is larger than the repository wants."""
    session.start()
    import bpy

    from .ages import render_ages
    from .biomes import render_sheet as render_biomes
    from .close_ups import render_sheet as render_close_ups
    from .demo import run
    from .grown import render_grown
    from .landscape import render_landscape
    from .million import render_million
    from .scattered import main as render_scattered
    from .seasons import render_sheet as render_seasons
    from .species_sheet import render_opening, render_sheet
    from .wood import build as build_wood
    from .wood import render_dolly, render_interior

    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        run(out, 960)
        for name in ("cycles", "eevee", "top"):
            store(out / f"{name}.png", IMAGES / f"row80-{name}.jpg")
        render_landscape(out / "landscape.png")
        store(out / "landscape.png", IMAGES / "landscape.jpg")
        render_million(out / "million.png", memory=6.0)
        store(out / "million.png", IMAGES / "million.jpg")
    render_sheet(IMAGES / "species.jpg")
    render_close_ups(IMAGES / "close_ups.jpg")
    render_opening(IMAGES / "orders.jpg")
    session.clean_file()
    build_wood(bpy.context.scene)
    render_dolly(IMAGES / "dolly.jpg")
    render_interior(IMAGES / "interior.jpg")
    for render, name in ((render_seasons, "seasons"), (render_ages, "ages"), (render_grown, "grown")):
        session.clean_file()
        render(IMAGES / f"{name}.jpg")
    with tempfile.TemporaryDirectory() as folder:
        render_biomes(IMAGES / "biomes.jpg", Path(folder))
    session.clean_file()
    render_scattered([])
    session.stop()
    large = [p.name for p in IMAGES.iterdir() if p.stat().st_size > LARGEST]
    if large:
        print("larger than 500 kB:", ", ".join(large), file=sys.stderr)
    return 1 if large else 0


if __name__ == "__main__":
    sys.exit(main())
