# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 5: the row of eighty and the partition of space from above, the viewer at the left."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from ..top_view import render_top_view
from .pictures import save_jpeg
from .scenes import refined, row


def make(out: Path, images: Path, small: bool) -> dict[str, float]:
    """Make ``row80-top.jpg``; there is nothing to measure."""
    scene = row(small)
    refined(scene)
    picture = out / "figure5.png"
    render_top_view(scene, picture, *((100, 1) if small else (1600, 16)))
    save_jpeg(Image.open(picture).convert("RGB"), images / "row80-top.jpg")
    return {}
