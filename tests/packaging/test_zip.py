# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip holds what users need and nothing else, and Blender accepts it."""

from __future__ import annotations

import ast
import tomllib
import zipfile
from pathlib import Path, PurePosixPath

import pytest

from devtools import build, rooms

AT_THE_ROOT = {"__init__.py", "blender_manifest.toml", "LICENSE"}
FOLDERS = {"tetflora_addon", "operators", "panels"}
# The manual, which the buttons for help open.
HELP = {"docs/manual.md", *(f"docs/manual/{path.name}" for path in (build.ROOT / "docs" / "manual").glob("*.md"))}
KINDS = {".py", ".json", ".svg", ".png", ".jpg", ".dat", ".vert", ".frag"}
LARGEST = 2_200_000  # species have pictures of four seasons, biomes one each


@pytest.fixture(scope="module")
def names(extension_zip: Path) -> list[PurePosixPath]:
    with zipfile.ZipFile(extension_zip) as archive:
        assert archive.testzip() is None
        return [PurePosixPath(n) for n in archive.namelist() if not n.endswith("/")]


def test_only_what_is_meant(names: list[PurePosixPath]) -> None:
    strangers = [
        str(name)
        for name in names
        if not (str(name) in AT_THE_ROOT or str(name) in HELP or (name.parts[0] in FOLDERS and name.suffix in KINDS))
        or any(part.startswith(".") or part == "__pycache__" for part in name.parts)
    ]
    assert strangers == []


def test_nothing_is_missing(names: list[PurePosixPath]) -> None:
    expected = {PurePosixPath(name) for name in AT_THE_ROOT | HELP}
    for folder in FOLDERS:
        for path in (build.ROOT / folder).rglob("*"):
            if path.is_file() and path.suffix in KINDS and "__pycache__" not in path.parts:
                expected.add(PurePosixPath(path.relative_to(build.ROOT).as_posix()))
    assert expected - set(names) == set()


def test_every_package_can_be_imported(names: list[PurePosixPath]) -> None:
    """Python would take a folder without __init__.py for a namespace, and Blender's relative imports then surprise."""
    folders = {name.parent for name in names if name.suffix == ".py"}
    assert {folder for folder in folders if folder / "__init__.py" not in names} == set()


def test_size(extension_zip: Path) -> None:
    assert 10_000 < extension_zip.stat().st_size < LARGEST


def test_valid_for_blender(extension_zip: Path) -> None:
    build.validate(extension_zip)


def test_an_invalid_manifest_is_refused(tmp_path: Path) -> None:
    text = (build.ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    (tmp_path / "__init__.py").touch()
    (tmp_path / "blender_manifest.toml").write_text(text.replace('"Render"', '"Botany"'), encoding="utf-8")
    with pytest.raises(RuntimeError, match="Botany"):
        build.validate(tmp_path)


def test_manifest_says_what_the_project_promises(extension_zip: Path) -> None:
    with zipfile.ZipFile(extension_zip) as archive:
        about = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert about["id"] == "tetflora"
    assert about["license"] == ["SPDX:GPL-3.0-or-later"]
    assert about["blender_version_min"] == "4.5.0"
    assert set(about["permissions"]) == {"files"}
    assert all(
        word in about["permissions"]["files"] for word in ("Read", "write", "delete", "species", "caches", "jobs")
    )
    assert len(about["permissions"]["files"]) <= 64  # as Blender's platform demands
    assert extension_zip.name == f"tetflora-{about['version']}.zip"


def test_nothing_needs_a_permission_that_the_manifest_lacks() -> None:
    """No network, camera, microphone or clipboard; and no other programs, which could do anything.

    Only `processes.pool` starts any: the Python that runs it, with the engine's own code.
    """
    own = rooms.ROOT / "tetflora_addon" / "processes" / "pool.py"
    banned = {"socket", "ssl", "http", "urllib", "ftplib", "smtplib", "asyncio", "requests", "subprocess", "aud"}
    words = {"clipboard", "popen", "online_access", "url_open", "path_open"}
    for path in rooms.sources().values():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found = {alias.name.split(".")[0] for alias in node.names} & banned
                assert found <= ({"subprocess"} if path == own else set()), path
            elif isinstance(node, ast.ImportFrom) and not node.level:
                assert (node.module or "").split(".")[0] not in banned, path
            elif isinstance(node, ast.Attribute):
                assert node.attr.lower() not in words or path == own, path


def test_the_version_has_its_section_in_the_changelog() -> None:
    assert f"\n## {build.manifest()['version']}" in (build.ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
