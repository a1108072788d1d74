# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The architecture as properties: who may import whom, and that the rules which ``make lint`` asserts can fail."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from devtools import house, rooms, words

ROOT = house.ROOT
ADDON = ROOT / "tetflora_addon"
BLENDER_MODULES = {"bpy", "bmesh", "mathutils", "gpu", "gpu_extras", "bpy_extras", "bl_ui", "addon_utils"}

ENGINE = sorted(p for p in ADDON.rglob("*.py") if p.relative_to(ADDON).parts[0] != "blender")
EXTENSION = sorted(p for folder in (ADDON, ROOT / "operators", ROOT / "panels") for p in folder.rglob("*.py"))


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _imports(path: Path) -> Iterator[tuple[int, str]]:
    """Level (0: absolute) and dotted name of everything that a file imports, anywhere in it."""
    for node in ast.walk(rooms.tree(path)):
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


def test_engine_imports_numpy_and_the_standard_library_only() -> None:
    allowed = {"numpy", *sys.stdlib_module_names}
    found = [(_name(path), name) for path in ENGINE for level, name in _imports(path) if not level]
    assert len(ENGINE) > 100 and len(found) > 100
    assert [(path, name) for path, name in found if name.split(".")[0] not in allowed] == []


def test_every_file_says_what_it_is_for() -> None:
    assert [_name(path) for path in EXTENSION if not ast.get_docstring(rooms.tree(path))] == []


def test_no_arrow_is_allowed_without_need() -> None:
    assert rooms.unused() == []


def test_arrows_between_rooms_point_downward() -> None:
    heights = rooms.heights()  # ends only where there is no circle
    assert all(heights[other] < heights[room] for room, others in rooms.ARROWS.items() for other in others)


def test_tests_mirror_the_rooms() -> None:
    folders = {
        folder.relative_to(ROOT / "tests").as_posix()
        for kind in ("engine", "blender")
        for folder in (ROOT / "tests" / kind).rglob("*")
        if folder.is_dir() and folder.name != "__pycache__"
    }
    expected = {name if name.startswith("blender/") else f"engine/{name}" for name in rooms.ARROWS if name != "."}
    assert folders <= expected | {"blender/operators", "blender/panels"}
    assert {f"engine/{room}" for room in rooms.ENGINE if room != "."} <= folders


@pytest.fixture
def toy_house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty product in a folder of its own, which the rules of the rooms are applied to."""
    for folder in ("tetflora_addon/species", "tetflora_addon/growth", "tetflora_addon/blender", "operators"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "__init__.py").touch()
    for name in ("__init__.py", "tetflora_addon/__init__.py"):
        (tmp_path / name).touch()
    monkeypatch.setattr(rooms, "ROOT", tmp_path)
    for cached in (rooms.sources, rooms.imports):
        cached.cache_clear()
    yield tmp_path / "tetflora_addon"
    for cached in (rooms.sources, rooms.imports):
        cached.cache_clear()


def test_toy_house_is_in_order(toy_house: Path) -> None:
    (toy_house / "growth" / "roots.py").write_text("from ..species import leaves")
    (toy_house / "species" / "leaves.py").write_text("class Leaf: pass")
    (toy_house / "blender" / "props.py").touch()
    assert rooms.problems() == []


@pytest.mark.parametrize(
    ("files", "problem"),
    [
        ({"species/a.py": "from ..growth import b", "growth/b.py": ""}, "species may not import growth"),
        ({"species/a.py": "def f():\n    from .b import x", "species/b.py": "from . import a"}, "in a circle"),
        ({"species/a.py": "class Leaf: pass", "growth/b.py": "class Leaf: pass"}, "class Leaf is defined in"),
        ({"species/a.py": "x = 1\n" * (rooms.MAX_ROOM_LINES + 1)}, f"room species: {rooms.MAX_ROOM_LINES + 1} lines"),
        ({f"growth/a{i}.py": "" for i in range(rooms.MAX_FILES)}, f"files; {rooms.MAX_FILES} is the limit"),
        (
            {f"blender/a{i}.py": f"from . import a{i + 1}" for i in range(rooms.MAX_LEVELS + 1)},
            f"{rooms.MAX_LEVELS + 1} levels",
        ),
        ({"attic/a.py": ""}, "room attic is not in devtools/rooms.py"),
    ],
)
def test_rules_of_the_rooms_can_fail(toy_house: Path, files: dict[str, str], problem: str) -> None:
    for name, text in {"blender/props.py": "", **files}.items():
        (toy_house / name).parent.mkdir(exist_ok=True)
        (toy_house / name).write_text(text)
    (found,) = rooms.problems()
    assert problem in found


def test_files_of_the_extension_import_each_other_by_dots() -> None:
    """And none of tetflora_addon what is above it."""
    found = []
    for path in EXTENSION:
        parts = path.relative_to(ROOT).parts
        # How many dots lead to the topmost package that the file may name.
        highest = len(parts) - 1 if parts[0] == ADDON.name else len(parts)
        own = {ADDON.name, "operators", "panels", "devtools", "tests"}
        for level, name in _imports(path):
            if level > highest or (not level and name.split(".")[0] in own):
                found.append(f"{_name(path)} imports {'.' * level}{name}")
    assert found == []


def test_versions_are_compared_in_one_place() -> None:
    found = [
        f"{_name(path)}:{node.lineno}"
        for path in EXTENSION
        for node in ast.walk(rooms.tree(path))
        if isinstance(node, ast.Attribute)
        and node.attr in {"version", "version_string", "version_file"}
        and isinstance(node.value, ast.Attribute)
        and node.value.attr == "app"
    ]
    assert {place.split(":")[0] for place in found} <= {"tetflora_addon/blender/compat.py"}


@pytest.mark.parametrize(
    "text", ["see /w" + "ork/main", "from .." + "/shared/data", "https://p" + "ypi.org/simple", "/h" + "ome/ada/x"]
)
def test_house_rules_can_fail(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bad = tmp_path / "bad.py"
    bad.write_text(text + "\n" * house.LONGEST + "x = 1\n", encoding="utf-8")
    monkeypatch.setattr(house, "ROOT", tmp_path)
    monkeypatch.setattr(house, "files", lambda: [bad])
    monkeypatch.setattr(rooms, "problems", list)
    assert len(house.problems()) == 3  # header, length, name


def test_no_example_of_a_property_is_timed() -> None:
    assert settings.default.deadline is None


def test_words_that_gave_way_are_found_and_those_of_others_are_not() -> None:
    gone = ["col" + "our", "Met" + "res", "Proxy" + "Form", "PAIRS_AT" + "_ONCE", "thrown" + " shadow", "guil" + "ds"]
    for word in gone:
        assert words.problems("a.py", ["", f"x = {word}  # and"])[0].startswith(f'a.py:2: "{word[:3]}'), word
    kept = [
        'LENGTHUNIT["met' + 're", 1.0]',
        "diametre_houppier",
        "https://x.org/col" + "our",
        "at once",
        "color",
        "misguided",
    ]
    assert words.problems("a.py", kept) == []
    assert words.problems("tests/data/a.csv", gone) == []


def _fillers(code: str, name: str = "a.py") -> list[str]:
    return [text.split(": ")[0] + text.split('"')[1] for text in words.fillers(name, ast.parse(code))]


def test_variables_of_the_product_are_named_by_what_they_hold() -> None:
    code = """
def plants_of(at, *, scale=1.0):
    (own, light), rest = at
    return [some.size for some in rest if (found := lambda made: made)(some.own) and self.there]
"""
    assert _fillers(code) == ["a.py:2at", "a.py:3own", "a.py:4found", "a.py:4made", "a.py:4some"]


def test_fields_and_functions_of_the_product_are_named_by_what_they_hold_and_do() -> None:
    code = """
_found: dict[str, int] = {}

class Layer:
    made: int
    at = 0.0

    def __init__(self, layer):
        self._there, layer.made = True, 3

    def _own(self):
        def some():
            return self.found(made=layer.made)

    @property
    def found(self):
        return self._there
"""
    told = ["a.py:2_found", "a.py:5made", "a.py:6at", "a.py:9_there", "a.py:11_own", "a.py:12some", "a.py:16found"]
    assert _fillers(code) == told


def test_what_evaluates_at_places_and_what_is_saved_keep_their_names() -> None:
    assert _fillers("class Raster:\n    def at(self, places):\n        return places") == []
    layer = "class TetFloraLayer:\n    made: integer()\n    found: integer()"
    saved = "tetflora_addon/blender/placing/properties.py"
    assert _fillers(layer, saved) == [f"{saved}:3found"]
    assert _fillers(layer) == ["a.py:2made", "a.py:3found"]
    source = rooms.tree(ROOT / saved)
    assert any(isinstance(one, ast.ClassDef) and one.name == "TetFloraLayer" for one in source.body)
    assert words.fillers("elsewhere.py", source) != [] == words.fillers(saved, source)
