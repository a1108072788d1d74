# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Installs TetFlora on a worker of a farm; `bundle` copies this file into each job, beside the extension's zip.

    BLENDER_USER_RESOURCES=/new/folder blender --background --python-exit-code 1 --python install_tetflora.py

It imports nothing of the extension, which is not installed yet. The folder in the variable belongs to the job, so that
the worker's own add-ons and preferences are neither used nor changed.
"""

import os
import shutil
import sys
from pathlib import Path

import bpy

REPOSITORY = "user_default"
PACKAGE = f"bl_ext.{REPOSITORY}.tetflora"
#: Devices of Cycles, the fastest first.
GRAPHICS = ('OPTIX', 'CUDA', 'HIP', 'ONEAPI', 'METAL')


def install(folder: Path) -> None:
    """Install the zip of a folder, and the species beside it, or exit with a message."""
    home = os.environ.get("BLENDER_USER_RESOURCES")
    if not home:
        sys.exit("tetflora: error: BLENDER_USER_RESOURCES is not set; set it to a folder of this job and run again")
    zips = sorted(folder.glob("tetflora-*.zip"))
    if len(zips) != 1:
        sys.exit(f"tetflora: error: {folder} must contain one tetflora-*.zip, found {len(zips)}; write the job again")
    # Without the folder Blender falls back to the user's own.
    for name in ("config", "extensions", "scripts", "datafiles"):
        Path(home, name).mkdir(parents=True, exist_ok=True)
    bpy.ops.extensions.package_install_files(filepath=str(zips[0]), repo=REPOSITORY, enable_on_install=True)
    if PACKAGE not in bpy.context.preferences.addons:
        sys.exit(f"tetflora: error: cannot install {zips[0].name}; see Blender's message above")
    _choose_graphics_cards()
    bpy.ops.wm.save_userpref()
    species = Path(bpy.utils.user_resource('DATAFILES', path="tetflora", create=True))
    for path in sorted(folder.glob("species/*.json")):
        shutil.copyfile(path, species / path.name)
    print(f"tetflora: {zips[0].name} installed in {home}", flush=True)


def _choose_graphics_cards() -> None:
    """Enable graphics cards in new preferences, so that Cycles uses them in scenes set to GPU Compute."""
    cycles = bpy.context.preferences.addons.get("cycles")
    if cycles is None:
        return
    for kind in GRAPHICS:
        try:
            cycles.preferences.compute_device_type = kind
        except TypeError:  # not in this build of Blender
            continue
        cycles.preferences.refresh_devices()
        found = [device for device in cycles.preferences.devices if device.type == kind]
        if found:
            for device in found:
                device.use = True
            print(f"tetflora: {kind}: {', '.join(device.name for device in found)}", flush=True)
            return
    cycles.preferences.compute_device_type = 'NONE'


if __name__ == "__main__":
    install(Path(__file__).resolve().parent)
