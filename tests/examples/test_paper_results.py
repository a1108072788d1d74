# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's figures and tables: each is made, tiny, and shows and counts what it must."""

from __future__ import annotations

import importlib
import json
import re
from pathlib import Path

import bpy
import numpy as np
import pytest
from PIL import Image as image  # noqa: N813 (a module)

from devtools import session
from examples import stage
from examples.haze import add_haze
from examples.paper import figure8, figure9, tables
from examples.paper.__main__ import IMAGES, PAGE
from tests.blender import renders
from tetflora_addon.blender import compat
from tetflora_addon.emission import budget


@pytest.fixture
def make(clean_file, tmp_path, monkeypatch):
    """Makes a figure, tiny; gives what it measured."""
    (tmp_path / "images").mkdir()
    whole = stage.daylight

    def daylight(scene, **angles):
        whole(scene, **angles)
        renders.few_directions(scene.world)

    monkeypatch.setattr(stage, "daylight", daylight)
    monkeypatch.setattr(budget, "FINEST", 1.0)  # small images have finer facets by themselves

    def make_figure(name: str) -> dict[str, float]:
        return importlib.import_module(f"examples.paper.{name}").make(tmp_path, tmp_path / "images", small=True)

    return make_figure


def _picture(path) -> np.ndarray:
    """Display values (height, width, 3), 0 to 1."""
    return np.asarray(image.open(path).convert("RGB"), np.float64) / 255


def _shows_something(path) -> bool:
    return bool(_picture(path).std() > 0.02)


def test_figure4_counts_polygons_of_each_species(make, tmp_path):
    figures = make("figure4")
    assert figures["species"] == 2
    assert 100 < figures["polygons_min"] < figures["polygons_max"]
    assert _shows_something(tmp_path / "images" / "species.jpg")


def test_figure5_has_a_top_view(make, tmp_path):
    make("figure5")
    assert _shows_something(tmp_path / "images" / "row80-top.jpg")


def test_figures_6_and_7_stored_and_deferred_are_all(make, tmp_path):
    figures = make("figure6")
    assert figures["drawn_real"] == figures["polygons_meshed"] > 0
    assert figures["drawn_proxy"] == figures["polygons_proxy"] > 0
    assert figures["seeds_file_mb"] < figures["stored_file_mb"], "deferred polygons are no part of the file"
    assert _shows_something(tmp_path / "images" / "paper-figures6-7.jpg")
    both, real = (_picture(tmp_path / f"{name}.png") for name in ("kinds", "real"))

    def orange(picture):
        return (picture[:, :, 0] - picture[:, :, 2] > 0.15).sum()

    assert orange(both) > orange(real), "approximations are orange, and gone where polygons are alone"
    stored, deferred = (_picture(tmp_path / f"figure{n}.png") for n in (6, 7))
    assert np.abs(stored.mean(axis=(0, 1)) - deferred.mean(axis=(0, 1))).max() < 0.03, "both are the same scene"


def test_figure8_refines_from_picture_to_picture(make, tmp_path):
    figures = make("figure8")
    early, last = figure8.SMALL_PASSES[0], figures["passes"]
    assert figures[f"tetrahedra_{early}"] < figures[f"tetrahedra_{last}"]
    assert figures[f"waiting_{early}"] > 0
    assert figures[f"waiting_{last}"] == 0
    first, final = (_picture(tmp_path / f"figure8-{n:02d}.png") for n in (early, last))
    assert np.abs(first - final).mean() > 0.005, "coarse volumes look coarse"
    assert _shows_something(tmp_path / "images" / "paper-figure8.jpg")


def test_figure9_is_hazy_as_koschmieder_says(make, tmp_path):

    figures = make("figure9")
    assert figures["plants"] == figure9.SMALL_PLANTS
    assert _shows_something(tmp_path / "images" / "paper-figure9.jpg")

    session.clean_file()
    renders.small_scene(sky=0.0, samples=4)
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [], [(0, 1, 2, 3)])
    glow = bpy.data.materials.new("glow")
    tree = compat.shader_tree(glow)
    tree.nodes.clear()
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(emission.outputs[0], output.inputs[0])
    mesh.materials.append(glow)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Ground", mesh))
    add_haze(bpy.context.scene, figure9.EXTINCTION, figure9.AIRLIGHT)
    passed = np.exp(-figure9.EXTINCTION * 50.0)  # the camera is 50 m above the ground, which is as bright as 1
    expected = passed + (1 - passed) * np.array(figure9.AIRLIGHT)
    assert np.allclose(renders.picture().mean(axis=(0, 1)), expected, rtol=0.01)


def test_animation_makes_a_film(make, tmp_path):
    figures = make("animation")
    assert figures["frames"] == 2
    assert figures["refined"] == 1, "two frames of a walk share their plants"
    assert figures["later_refine_s"] > 0.0
    assert 0 <= figures["divided_anew_min"] <= figures["divided_anew_mean"] <= figures["divided_anew_max"]
    assert figures["divided_anew_max"] < figures["divided"]
    film = (tmp_path / "images" / "paper-film.mp4").read_bytes()
    assert film[4:8] == b"ftyp"
    assert _shows_something(tmp_path / "images" / "paper-film.jpg")


def _records(folder, figures: dict[str, dict[str, float]]) -> None:
    for name, values in figures.items():
        record = {"figures": {"seconds": 60.0, **values}, "machine": "a machine", "blender": "9.9", "commit": "abc"}
        (folder / f"{name}.json").write_text(json.dumps(record))


def test_tables_hold_what_was_measured_and_nothing_else_changes(tmp_path):
    page = tmp_path / "page.md"
    places = [f"<!-- measured: {name} -->\n\n<!-- end -->" for name in (*tables.TABLES, "machine")]
    page.write_text("Before.\n\n" + "\n\nBetween.\n\n".join(places) + "\n\nafter\n")
    keys = set(re.findall(r'_(?:count|seconds|megabytes)\("(\w+)"', Path(tables.__file__).read_text()))
    figures = dict.fromkeys(keys, 1234.0) | {
        "polygons_meshed": 250.0,
        "polygons_full": 1000.0,
        "refine_s": 3.0,
        "render_s": 4.0,
        "polygons_mb": 210.0,
        "tetrahedra_mb": 10.0,
        "flip": 0.05,
        "first_refine_s": 1.0,
        "first_render_s": 1.0,
        "later_refine_s": 1.5,
        "later_render_s": 2.25,
        "divided_anew_min": 3.0,
        "divided_anew_max": 9.0,
        "divided_anew_mean": 6.0,
        "divided": 1234.0,
        "refined": 2.0,
        "frames": 48.0,
        "polygons_proxy": 99.0,
    }
    _records(tmp_path, {name: figures for names, _ in tables.TABLES.values() for name in names})
    tables.write_tables(tmp_path, page)
    once = page.read_text()
    assert "| polygons in the image | 784,049 (20.7 %) | 250 (25.0 %) |" in once
    assert "| later frames, mean, total | 6.64 min | 3.8 s |" in once
    assert "| 3 to 9, mean 6, of 1,234 |" in once
    assert "| all | 2 of 48 |" in once
    assert "10 MB (1/21)" in once
    assert once.count("Between.") == len(places) - 1
    assert once.startswith("Before.\n")
    assert once.endswith("after\n")
    tables.write_tables(tmp_path, page)
    assert page.read_text() == once, "writing twice changes nothing"


def test_page_without_a_place_for_a_table_is_refused(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("nothing\n")
    _records(tmp_path, {"figure4": {}})
    with pytest.raises(ValueError, match="measured: machine"):
        tables.write_tables(tmp_path, page)
    assert page.read_text() == "nothing\n"


def test_the_documentation_has_a_place_for_each_table_and_all_pictures():
    page = PAGE.read_text(encoding="utf-8")
    for name in (*tables.TABLES, "machine"):
        assert tables.put(page, name, "here") != page
    for picture in re.findall(r"\(images/([\w.-]+)\)", page):
        assert (IMAGES / picture).stat().st_size <= (2e6 if picture.endswith(".mp4") else 5e5), picture


def test_only_what_this_commit_has_not_made_is_made(tmp_path, monkeypatch):
    command = importlib.import_module("examples.paper.__main__")
    monkeypatch.setattr(command, "RECORDS", tmp_path)
    monkeypatch.setattr(command, "head", lambda: "abc")
    assert not command.is_made("figure8")
    _records(tmp_path, {"figure8": {}})
    assert command.is_made("figure8")
    monkeypatch.setattr(command, "head", lambda: "def")
    assert not command.is_made("figure8")
