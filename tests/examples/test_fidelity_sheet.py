# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact sheet of the benchmark `fidelity`."""

from __future__ import annotations

import json

import numpy as np
from PIL import Image

from benchmarks import fidelity


def test_an_image_that_was_not_rendered_has_no_heading(tmp_path):
    forms = ("MICROSURFACES", "MICROSPHERES")
    shown = [(light, form) for light in ("side", "back") for form in forms if (light, form) != ("back", forms[1])]
    frames = [
        {"pixels": 50, "light": light, "engine": "cycles", "each": 1, "form": form, "flip": 0.04}
        for light, form in shown
    ]
    (tmp_path / "frames.json").write_text(json.dumps(frames))
    for light, form in [*shown, ("side", fidelity.EXPANDED), ("back", fidelity.EXPANDED)]:
        Image.new("RGB", (340, 100)).save(fidelity.picture_path(tmp_path, 50, 1, light, "cycles", form))
    fidelity.make_sheet(tmp_path, tmp_path / "sheet.jpg")
    sheet = np.asarray(Image.open(tmp_path / "sheet.jpg").convert("L"))
    upper, lower = np.array_split(sheet[:, 690:1020], 2)
    assert upper.min() < 100
    assert lower.min() > 220
