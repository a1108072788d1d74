# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender with TetFlora enabled straight from this source tree, for tests, benchmarks and examples.

    from devtools import session

    tetflora = session.start()   # imports bpy in a home of its own, enables the extension, returns its package
    session.clean_file()         # an empty file
    session.stop()               # disables it; also runs by itself at exit

The modules that Blender uses are ``bl_ext.tetflora_dev.tetflora.*``. From `start` to `stop`, ``tetflora_addon``,
``operators`` and ``panels`` are other names of the same modules, so ``from tetflora_addon.blender.job import refine``
imports what Blender runs. Without a session these names mean the files at the root of the repository; a process uses
either.
"""

from __future__ import annotations

import atexit
import io
import os
import shutil
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path
from types import ModuleType

from .aliases import alias, forget

ROOT = Path(__file__).resolve().parent.parent
REPOSITORY = "tetflora_dev"
PACKAGE = f"bl_ext.{REPOSITORY}.tetflora"

_home: Path | None = None


def start() -> ModuleType:
    """Start Blender if this process has none yet, and enable TetFlora from the source tree.

    Works with the bpy wheel and inside a full Blender; preferences of the user are neither read (wheel) nor saved.

    Returns
    -------
    module
        The extension's root package, ``bl_ext.tetflora_dev.tetflora``. The same one when called again.

    Raises
    ------
    RuntimeError
        The extension could not be enabled; Blender has printed the reason. Or its modules were imported without it.
    """
    global _home
    if _home is not None:
        return sys.modules[PACKAGE]
    alias(PACKAGE)
    home = Path(tempfile.mkdtemp(prefix="tetflora-"))
    atexit.register(shutil.rmtree, home, ignore_errors=True)
    if "bpy" not in sys.modules:
        # Read once, when bpy is imported: the user's own preferences must not decide what a test sees.
        os.environ["BLENDER_USER_RESOURCES"] = str(home)
    import bpy

    import addon_utils  # isort: skip  (only there once bpy is)

    repository = home / "repository"
    repository.mkdir()
    (repository / "tetflora").symlink_to(ROOT, target_is_directory=True)
    bpy.context.preferences.extensions.repos.new(name=REPOSITORY, module=REPOSITORY, custom_directory=str(repository))
    failures: list[BaseException] = []
    if addon_utils.enable(PACKAGE, default_set=True, handle_error=failures.append) is None:
        forget()
        raise RuntimeError(f"Blender could not enable {PACKAGE} from {ROOT}") from next(iter(failures), None)
    _home = home
    from tetflora_addon import storage

    # Inside a full Blender it would be the user's own.
    storage.set_folder(home / "cache")
    # Blender 4.5's wheel hangs at exit while a callback of an add-on is registered.
    atexit.register(stop)
    return sys.modules[PACKAGE]


def clean_file() -> None:
    """Replace what is open by an empty file: one scene, no objects; enabled add-ons stay enabled."""
    import bpy

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


def stop() -> None:
    """Disable the extension and forget its repository; does nothing when it is not enabled."""
    global _home
    if _home is None:
        return
    home, _home = _home, None
    forget()
    import addon_utils
    import bpy

    addon_utils.disable(PACKAGE, default_set=True)
    repositories = bpy.context.preferences.extensions.repos
    # Blender disables what is in the repository once more, and says that it is not enabled.
    with redirect_stdout(io.StringIO()):
        for repository in [r for r in repositories if r.module == REPOSITORY]:
            repositories.remove(repository)
    shutil.rmtree(home, ignore_errors=True)
    for name in [n for n in sys.modules if n == PACKAGE or n.startswith(PACKAGE + ".")]:
        del sys.modules[name]


def eevee() -> str:
    """Identifier of EEVEE in this version of Blender."""
    import bpy

    return 'BLENDER_EEVEE_NEXT' if bpy.app.version < (5, 0) else 'BLENDER_EEVEE'
