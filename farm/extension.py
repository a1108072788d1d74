# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tool uses of TetFlora: of the extension that is enabled, or of the source tree that it lies in."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

import bpy


def _part(name: str) -> ModuleType:
    enabled = (addon.module for addon in bpy.context.preferences.addons)
    root = next((f"{module}." for module in enabled if module.rpartition(".")[2] == "tetflora"), "")
    try:
        return importlib.import_module(f"{root}tetflora_addon.{name}")
    except ModuleNotFoundError:
        sys.exit("tetflora: error: TetFlora is not enabled; enable it under Edit > Preferences > Add-ons")


_errors = _part("errors")
SceneError, readable = _errors.SceneError, _errors.readable
command = _part("blender.cli.command")
Run, frame_numbers = command.Run, command.frame_numbers
estimate = _part("blender.job.contents").estimate
species_folders = _part("blender.preferences").species_folders
read_camera = _part("blender.scene.camera").read_camera
NoPlantsError = _part("blender.scene.plants").NoPlantsError
#: Root of the extension as it is installed, or of the source tree.
EXTENSION = Path(str(_errors.__file__)).resolve().parents[1]
