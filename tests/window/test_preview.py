# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels and plants of preview_steps.py in the real window's viewport, judged by numbers and by pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

Pictures = dict[str, np.ndarray]
WIRES = ("wires_form", "wires_level", "wires_visibility", "wires_contribution")


#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "preview_steps", "preview", 300


@pytest.fixture(scope="module")
def views(seen: dict, pictures: Path) -> Pictures:
    """What the viewport showed (rows, columns, 3), 0 to 1, without sidebar, toolbar and the figures in its corner."""
    from PIL import Image

    x, y, width, height = seen["view"]
    out = {}
    for path in sorted((pictures / "preview").glob("*.png")):
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"), np.float32) / 255
        rows = slice(pixels.shape[0] - y - height + 120, pixels.shape[0] - y - 160)
        out[path.stem] = pixels[rows, x + 100 : x + width - 330]
    return out


def changed(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the pixels that differ visibly."""
    return float((np.abs(a - b).max(axis=2) > 0.05).mean())


def share(picture: np.ndarray, color: tuple[float, float, float]) -> float:
    """Share of the pixels that have the hue of a color and are as saturated."""
    wanted, got = np.array(color) - min(color), picture - picture.min(axis=2, keepdims=True)
    size = np.linalg.norm(got, axis=2) + 1e-6
    return float(((got @ wanted > 0.98 * size * np.linalg.norm(wanted)) & (size > 0.25)).mean())


GREEN, ORANGE, BLUE = (0.35, 0.85, 0.25), (1.0, 0.6, 0.1), (0.4, 0.6, 1.0)


def test_nothing_in_the_file_changes(seen: dict) -> None:
    before, after = seen["before"], seen["after"]
    assert set(before["objects"]) - set(after["objects"]) == {"plant 23"}  # which the script has deleted
    assert {k: v for k, v in after.items() if k != "objects"} == {k: v for k, v in before.items() if k != "objects"}
    assert not seen["broken"]


def test_plants_are_drawn_in_both_forms(seen: dict, views: Pictures) -> None:
    assert seen["plants"] == 24
    assert changed(views["bare"], views["light"]) > 0.1
    green = views["light"][..., 1] > 1.2 * views["light"][..., 2]
    assert green.mean() > 0.08
    assert 0.005 < changed(views["bare"], views["bounds"]) < changed(views["bare"], views["light"])
    assert seen["after_none"]


def test_levels_are_computed_as_a_job(seen: dict) -> None:
    assert seen["running"]
    assert len(seen["levels"]) > 4
    assert seen["last"] == seen["levels"][-1][0]
    sizes = [size for _, size in seen["levels"]]
    assert sizes[0] < 20 < sizes[-1]
    assert seen["running_before_esc"], "the job was over before Esc came"
    assert seen["kept"]


def test_each_level_looks_different(seen: dict, views: Pictures) -> None:
    first, middle, last = (views[name] for name in ("level_0", f"level_{seen['middle']}", "wires_form"))
    lines = [changed(views["bare"], view) for view in (first, middle, last)]
    assert 0.0 < lines[0] < lines[1]
    assert changed(middle, last) > 0.02
    # At the root all is to be divided or hidden, in the end nothing is.
    assert share(first, GREEN) == 0.0
    assert share(last, GREEN) > 0.005


@pytest.mark.parametrize("one", WIRES)
def test_each_coloring_tells_something_else(views: Pictures, one: str) -> None:
    for other in WIRES:
        if other != one:
            assert changed(views[one], views[other]) > 0.01, other
    # Colors change, places do not.
    places = [np.abs(views[name] - views["bare"]).max(axis=2) > 0.1 for name in (one, "wires_form")]
    assert (places[0] == places[1]).mean() > 0.9


def test_forms_are_told_apart_and_chosen(seen: dict, views: Pictures) -> None:
    _, proxies, hidden, explicit, _ = seen["forms"]
    assert min(proxies, hidden, explicit) > 0
    for color in (GREEN, ORANGE):
        assert share(views["wires_form"], color) > 0.003
        assert share(views["hidden"], color) < 1e-4
    assert share(views["hidden"], BLUE) > 0.002


def test_translucent_tetrahedra_have_the_plants_color(views: Pictures) -> None:
    cloud = np.abs(views["translucent"] - views["bare"]).max(axis=2) > 0.05
    assert cloud.mean() > 0.1
    red, green, blue = views["translucent"][cloud].mean(axis=0)
    assert green > 1.1 * red
    assert green > 1.1 * blue


def test_a_frozen_camera_is_seen_from_outside(seen: dict, views: Pictures) -> None:
    assert not seen["outdated_frozen"]
    assert seen["outdated"]
    assert seen["looks_from"] == pytest.approx([14.0, -34.0, 7.0], abs=0.01)
    assert seen["through"] == 'CAMERA'
    assert share(views["frozen"], (1.0, 0.75, 0.2)) > 0.0003  # its pyramid
    assert changed(views["frozen_view"], views["frozen"]) > 0.1


def test_forgotten_levels_are_not_drawn(seen: dict, views: Pictures) -> None:
    assert seen["forgotten"]
    saturation = views["forgotten"].max(axis=2) - views["forgotten"].min(axis=2)
    assert (saturation > 0.2).mean() < 0.01


def test_plants_follow_the_year(seen):
    enabled, day = seen["winter"]
    assert enabled
    assert day == pytest.approx(20.0)
