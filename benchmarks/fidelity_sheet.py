# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact sheet of the fidelity bench: plants fully expanded beside each form of proxies, by height, light and engine.

``python -m benchmarks.fidelity --sheet`` makes it from the images that the last run left.
"""

from __future__ import annotations

import json
from pathlib import Path

#: Width of an image on the sheet, pixels; small images are enlarged by a whole number without smoothing.
WIDTH = 340
#: Which rows there are, of those that were rendered: height, light and engine.
ROWS = (
    (12, "side", "cycles"),
    (12, "side", "eevee"),
    (50, "side", "cycles"),
    (50, "side", "eevee"),
    (50, "back", "cycles"),
    (50, "overcast", "cycles"),
    (50, "overcast", "eevee"),
    (200, "front", "cycles"),
    (200, "side", "cycles"),
    (200, "side", "eevee"),
)
LARGEST = 500_000
_LABEL, _TEXT, _PAPER = 18, (30, 30, 30), (245, 245, 245)


def make(folder: Path, target: Path) -> None:
    """Write the sheet as a JPEG of at most half a megabyte.

    Parameters
    ----------
    folder : Path
        Of ``frames.json`` and the images that it names.
    target : Path

    Raises
    ------
    FileNotFoundError
        Nothing was rendered yet.
    """
    from PIL import Image, ImageDraw, ImageFont

    from .fidelity_frames import EXPANDED, picture_path

    record = folder / "frames.json"
    if not record.exists():
        raise FileNotFoundError(f"{record} is missing: run python -m benchmarks.fidelity first")
    frames = json.loads(record.read_text())
    columns = [EXPANDED, *dict.fromkeys(f["form"] for f in frames)]
    font = ImageFont.load_default(13)
    rows = []
    for pixels, light, engine in ROWS:
        here = [f for f in frames if (f["pixels"], f["light"], f["engine"]) == (pixels, light, engine)]
        if not here:
            continue
        each = min(f["each"] for f in here)  # one plant of each species where that was rendered
        here = [f for f in here if f["each"] == each]
        paths = [picture_path(folder, pixels, each, light, engine, form) for form in columns]
        cells = [_scaled(Image.open(path).convert("RGB")) if path.exists() else None for path in paths]
        name = {"cycles": "Cycles", "eevee": "EEVEE"}[engine]
        labels = [f"{name}, {pixels} pixels high, {light}: expanded"]
        for form in columns[1:]:
            flips = [f["flip"] for f in here if f["form"] == form]
            mean = f": FLIP {sum(flips) / len(flips):.3f}" if flips else ""
            labels.append(form.replace("_", " ").capitalize() + mean)
        rows.append((labels, cells))
    heights = [_LABEL + max(c.height for c in cells if c is not None) + 4 for _, cells in rows]
    sheet = Image.new("RGB", (len(columns) * (WIDTH + 4), sum(heights)), _PAPER)
    draw = ImageDraw.Draw(sheet)
    top = 0
    for (labels, cells), height in zip(rows, heights, strict=True):
        for column, (label, cell) in enumerate(zip(labels, cells, strict=True)):
            draw.text((column * (WIDTH + 4) + 2, top + 1), label, fill=_TEXT, font=font)
            if cell is not None:
                sheet.paste(cell, (column * (WIDTH + 4), top + _LABEL))
        top += height
    target.parent.mkdir(parents=True, exist_ok=True)
    for quality in (92, 88, 82, 75, 65):
        sheet.save(target, quality=quality, subsampling=0)
        if target.stat().st_size <= LARGEST:
            break
    print(f"{target}: {sheet.width} by {sheet.height}, {target.stat().st_size / 1e3:.0f} kB")


def _scaled(picture: object) -> object:
    """An image of about `WIDTH`: every pixel as a square where it is enlarged, means where it is made smaller."""
    from PIL import Image

    factor = WIDTH // picture.width
    if factor >= 1:
        return picture.resize((picture.width * factor, picture.height * factor), Image.Resampling.NEAREST)
    return picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)), Image.Resampling.BOX)
