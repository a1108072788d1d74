# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The architecture as properties: who may import whom, and the house rules."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from devtools import house

ROOT = house.ROOT
ADDON = ROOT / "tetflora_addon"
BLENDER_MODULES = {"bpy", "bmesh", "mathutils", "gpu", "gpu_extras", "bpy_extras", "bl_ui", "addon_utils"}

# The table of docs/architecture.md: what each room of the engine may import besides numpy and itself.
ROOMS = {
    "plants": set(),
    "tetrahedra": set(),
    "refinement": {"plants", "tetrahedra"},
    "shading": {"plants", "tetrahedra", "refinement"},
    "planting": {"plants"},
    "preview": {"plants", "tetrahedra", "refinement"},
}
SHARED = {"arrays", "buffers", "errors", "cache_folder", "kept_arrays", "setting", "whole_files"}
# Files beside the rooms that put decisions into buffers may use each other.
BESIDE = {"baked_emission", "budget", "facet_emission", "shell_emission"}

ENGINE = sorted(p for p in ADDON.rglob("*.py") if p.relative_to(ADDON).parts[0] != "blender")
EXTENSION = sorted(p for folder in (ADDON, ROOT / "operators", ROOT / "panels") for p in folder.rglob("*.py"))


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _imports(path: Path) -> Iterator[tuple[int, str]]:
    """Level (0: absolute) and dotted name of everything that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.module is None:
                yield from ((node.level, alias.name) for alias in node.names)
            else:
                yield node.level, node.module


def test_engine_runs_where_there_is_no_blender() -> None:
    modules = [_name(p).removesuffix(".py").replace("/", ".").removesuffix(".__init__") for p in ENGINE]
    code = (
        f"import sys, importlib\nblender = {sorted(BLENDER_MODULES)!r}\n"
        "for name in blender: sys.modules[name] = None  # importing it now fails\n"
        f"for name in {modules!r}: importlib.import_module(name)\n"
        "assert not [name for name in blender if sys.modules[name]]\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("path", ENGINE, ids=_name)
def test_engine_file(path: Path) -> None:
    """Numpy and the standard library only, neighbours as the architecture allows, and a docstring."""
    inside = path.relative_to(ADDON).parts
    room = inside[0] if len(inside) > 1 else None
    allowed = SHARED | ({room} | ROOMS[room] if room else set(ROOMS) | BESIDE)
    for level, module in _imports(path):
        first = module.split(".")[0]
        if level == 0:
            assert first == "numpy" or first in sys.stdlib_module_names, f"imports {module}"
        elif level == len(inside):
            assert first in allowed, f"{room} imports {module}"
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), "says nothing of what it is for"


@pytest.mark.parametrize("path", EXTENSION, ids=_name)
def test_extension_file(path: Path) -> None:
    """Relative imports only, and none from tetflora_addon to above itself."""
    parts = path.relative_to(ROOT).parts
    # How many dots lead to the topmost package that the file may name.
    highest = len(parts) - 1 if parts[0] == ADDON.name else len(parts)
    for level, module in _imports(path):
        assert level <= highest, f"{'.' * level}{module} reaches above {parts[0]}"
        if level == 0:
            assert module.split(".")[0] not in {ADDON.name, "operators", "panels", "devtools", "tests"}, module


@pytest.mark.parametrize("path", EXTENSION, ids=_name)
def test_versions_are_compared_in_one_place(path: Path) -> None:
    if path.name == "compat.py":
        return
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and node.attr in {"version", "version_string", "version_file"}:
            owner = node.value
            assert not (isinstance(owner, ast.Attribute) and owner.attr == "app"), f"line {node.lineno}"


def test_house_rules() -> None:
    assert house.problems() == []


@pytest.mark.parametrize(
    "text",
    ["see /w" + "ork/main", "from .." + "/shared/data", "https://p" + "ypi.org/simple", "/h" + "ome/ada/x"],
)
def test_house_rules_can_fail(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bad = tmp_path / "bad.py"
    bad.write_text(text + "\n" * house.LONGEST + "x = 1\n", encoding="utf-8")
    monkeypatch.setattr(house, "ROOT", tmp_path)
    monkeypatch.setattr(house, "files", lambda: [bad])
    assert len(house.problems()) == 3  # header, length, name


def test_no_example_of_a_property_is_timed() -> None:
    assert settings.default.deadline is None
