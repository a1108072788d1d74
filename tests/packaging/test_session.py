# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The harness itself: Blender with TetFlora enabled from the source tree."""

from __future__ import annotations

from types import ModuleType

from devtools import session


def test_starts_once(blender: ModuleType) -> None:
    assert session.start() is blender
    assert blender.__name__ == session.PACKAGE


def test_clean_file_is_empty_and_keeps_the_extension(clean_file: ModuleType) -> None:
    import addon_utils
    import bpy

    bpy.data.objects.new("left over", None)
    bpy.data.meshes.new("left over").use_fake_user = True
    session.clean_file()
    assert len(bpy.data.objects) == len(bpy.data.meshes) == len(bpy.data.collections) == 0
    assert len(bpy.data.scenes) == 1
    assert addon_utils.check(session.PACKAGE) == (True, True)
    assert bpy.context.scene.tetflora is not None


def test_parts_are_blenders_own(blender: ModuleType) -> None:
    assert session.part("tetflora_addon.errors").__name__ == f"{session.PACKAGE}.tetflora_addon.errors"
