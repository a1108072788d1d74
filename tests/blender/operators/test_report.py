# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A report of a fault says what matters and nothing of the scene; what is wrong is told in the panel."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

from devtools.layouts import Layout
from operators import base
from panels import preferences, refine
from tests.blender.scenes import add_camera, add_plant
from tetflora_addon.blender import report, runtime
from tetflora_addon.processes import pool

pytestmark = pytest.mark.usefixtures("clean_file")


def written(path: Path) -> str:
    assert bpy.ops.tetflora.write_report(filepath=str(path)) == {'FINISHED'}
    return path.read_text(encoding="utf-8")


def test_it_says_what_a_reader_needs_and_nothing_of_the_scene(tmp_path: Path) -> None:
    scene = bpy.context.scene
    add_camera().name = "Secret Camera"
    add_plant("Secret Oak")
    scene.name = "Secret Film"
    scene.tetflora.max_memory, scene.tetflora.quality = 3.5, 'DRAFT'
    try:
        {}["Secret Oak"]
    except KeyError as error:
        runtime.remember(f'{error} of "Secret Film" in /srv/ann/My Secret/oak.json: not there', error)
    text = written(tmp_path / "Bericht für Ann.txt")
    for part in (bpy.app.version_string, "numpy", "Cores: ", "GB", "scene.max_memory: 3.5", "quality: DRAFT"):
        assert part in text
    assert "not there" in text and "test_report.py" in text and "in test_it_says_what" in text
    assert "Secret" not in text and "/srv" not in text


@pytest.mark.parametrize(
    "text",
    [
        r"Cannot write D:\Films\Ann B\oak.json: no space",
        r"Cannot write \\server\Ann\oak.json: no space",
        "Cannot write //Ann/oak.json: no space",
        '"Ann" has no leaves; /srv/Ann/a b.json, too: no space',
        "KeyError('Ann') in “Ann”: no space",
    ],
)
def test_names_and_paths_are_left_out(text: str) -> None:
    assert "Ann" not in report.public(text) and "no space" in report.public(text)
    assert report.public("3/4 of 12 m is left. Raise Max Memory") == "3/4 of 12 m is left. Raise Max Memory"


def test_the_last_error_is_that_of_an_operator_or_a_render(tmp_path: Path) -> None:
    class Fails(base.Reporting):
        def report(self, *_: object) -> None: ...

        def run(self, _context: object) -> set[str]:
            return {}["missing"]

    with pytest.raises(KeyError):
        Fails().execute(bpy.context)
    text, places = runtime.last_error()
    assert "KeyError" in text and places[-1].endswith("in run")
    assert base.Reporting.failed(Fails(), "no plants") == {'CANCELLED'}
    assert runtime.last_error() == ("no plants", [])
    runtime.complain("frame 3 has none")
    assert runtime.last_error() == ("frame 3 has none", [])
    assert "frame 3 has none" in written(tmp_path / "a.txt")


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Choose another folder"):
        bpy.ops.tetflora.write_report(filepath=str(tmp_path / "missing" / "a.txt"))


def test_processes_that_were_given_up_are_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool._pool, "broken", True)
    assert "Other processes: given up" in report.report_text(bpy.context.scene)


def test_its_button_is_in_the_preferences(monkeypatch: pytest.MonkeyPatch) -> None:
    layout, own = Layout(), preferences.TetFloraPreferences
    monkeypatch.setattr(preferences, "_draw_keys", lambda *_: None)
    names = ("species_folder", "threads", "new_quality", "max_memory", "kept_memory", "use_cache", "cache_folder")
    known = {"layout": layout, "bl_rna": own.bl_rna, **dict.fromkeys(names, "")}
    preferences._draw(SimpleNamespace(**known), bpy.context)
    assert "tetflora.write_report" in layout.names("operator")


@pytest.mark.parametrize(("locked", "refines", "warns"), [(True, True, 0), (False, True, 1), (False, False, 0)])
def test_the_panel_warns_where_the_window_is_not_locked(locked: bool, refines: bool, warns: int) -> None:
    scene, layout = bpy.context.scene, Layout()
    add_camera()
    add_plant()
    scene.render.use_lock_interface, scene.tetflora.refine_at_render = locked, refines
    names = ("scene", "view_layer", "preferences", "active_object", "mode")
    known = {name: getattr(bpy.context, name) for name in names}
    context = SimpleNamespace(region=SimpleNamespace(width=300), **known)
    refine.TETFLORA_PT_warnings.draw(SimpleNamespace(layout=layout), context)
    said = [options.get("text", "") for *_, options in layout.drawn]
    assert sum("Lock Interface is off" in text for text in said) == warns
    if warns:
        bpy.ops.tetflora.mend(what="lock")
        assert scene.render.use_lock_interface
