# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the rendered pictures of the documentation anew: ``python -m examples.docs_images`` (``make docs-images``).

Pictures of the window come from `devtools.window_pictures`, which needs a full Blender.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from devtools import session

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
LARGEST = 500_000


def as_jpeg(source: Path, target: Path, quality: int = 88) -> None:
    """Store a picture as a JPEG, without any colour management."""
    import bpy

    image = bpy.data.images.load(str(source))
    image.colorspace_settings.name = "Non-Color"
    image.update()  # read it now: what was only named has nothing to save
    image.file_format, image.filepath_raw = 'JPEG', str(target)
    image.save(quality=quality)
    bpy.data.images.remove(image)


def main() -> int:
    """Render all; exit code 1 if a picture is larger than the repository wants."""
    session.start()
    from .demo import run
    from .landscape import render_landscape
    from .million import render_million
    from .species_sheet import render_opening, render_sheet

    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        run(out, 960)
        for name in ("cycles", "eevee", "top"):
            as_jpeg(out / f"{name}.png", IMAGES / f"row80-{name}.jpg")
        render_landscape(out / "landscape.png")
        as_jpeg(out / "landscape.png", IMAGES / "landscape.jpg")
        render_million(out / "million.png", memory=6.0)
        as_jpeg(out / "million.png", IMAGES / "million.jpg")
    render_sheet(IMAGES / "species.jpg")
    render_opening(IMAGES / "orders.jpg")
    session.stop()
    large = [p.name for p in IMAGES.iterdir() if p.stat().st_size > LARGEST]
    if large:
        print("larger than 500 kB:", ", ".join(large), file=sys.stderr)
    return 1 if large else 0


if __name__ == "__main__":
    sys.exit(main())
