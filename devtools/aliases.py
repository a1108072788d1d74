# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain names for the modules of an extension that Blender has loaded under a name of its own.

    from devtools.aliases import INSTALLED, alias

    alias(INSTALLED)
    from tetflora_addon.blender.job import refine  # is bl_ext.user_default.tetflora.tetflora_addon.blender.job.refine

Scripts can then import the extension's modules by statements that editors and rename tools understand, and still get
the modules that Blender uses instead of second copies of them.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

# The name of the package where the zip was installed into Blender's own local repository.
INSTALLED = "bl_ext.user_default.tetflora"
PARTS = ("tetflora_addon", "operators", "panels")


class _Aliases(MetaPathFinder, Loader):
    """Finds the plain names in the extension's package."""

    def __init__(self, package: str) -> None:
        self.package = package

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name.partition(".")[0] not in PARTS:
            return None
        return ModuleSpec(name, self)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = importlib.import_module(f"{self.package}.{spec.name}")
        # Python now gives the module the alias's spec, with which its relative imports would fail.
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = module.__spec__.loader_state


def _imported() -> list[str]:
    return [name for name in sys.modules if name.partition(".")[0] in PARTS]


def alias(package: str) -> None:
    """Make ``tetflora_addon``, ``operators`` and ``panels`` names of the modules in a package that Blender has loaded.

    Parameters
    ----------
    package : str
        Full name of the extension's package, for instance `INSTALLED`.

    Raises
    ------
    RuntimeError
        Some of them were imported already, as other modules than Blender's.
    """
    if any(isinstance(finder, _Aliases) and finder.package == package for finder in sys.meta_path):
        return
    if found := _imported():
        raise RuntimeError(f"{found[0]} was imported before {package} was given its name; start Blender first")
    sys.meta_path.insert(0, _Aliases(package))


def forget() -> None:
    """Remove the names again."""
    sys.meta_path[:] = [finder for finder in sys.meta_path if not isinstance(finder, _Aliases)]
    for name in _imported():
        del sys.modules[name]
