# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The harness itself: Blender with TetFlora enabled from the source tree."""

from __future__ import annotations

import sys
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


def test_plain_names_are_blenders_own_modules(blender: ModuleType) -> None:
    from tetflora_addon import blender as bridge
    from tetflora_addon.blender.job import refine

    own = sys.modules[f"{session.PACKAGE}.tetflora_addon.blender.job.refine"]
    assert refine is own
    assert sys.modules["tetflora_addon.blender"] is bridge is blender.blender
    assert own.__spec__.name == own.__name__
