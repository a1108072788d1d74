# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A script: what the installed extension adds to Blender, and what it leaves behind when it is disabled.

    python probe.py OUT.json ZIP                  bpy wheel: installs the zip first
    blender -b -P probe.py -- OUT.json            full Blender: TetFlora is installed and enabled already

Writes ``{"installed", "enabled", "warnings", "added", "left", "commands", "kept"}``, the last only for a zip.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import bpy

import addon_utils  # isort: skip  (Blender's; there once bpy is)

PACKAGE = "bl_ext.user_default.tetflora"


def visible_state() -> set[str]:
    """Classes, properties, handlers, menu entries and import paths that this Blender knows now."""
    state = {f"class {name}" for name in dir(bpy.types)}
    types = [t for t in (getattr(bpy.types, name) for name in dir(bpy.types)) if isinstance(t, type)]
    for owner in [t for t in types if issubclass(t, (bpy.types.ID, bpy.types.Preferences, bpy.types.ViewLayer))]:
        state |= {f"property {owner.__name__}.{key}" for key in owner.bl_rna.properties.keys()}  # noqa: SIM118
    for name in dir(bpy.app.handlers):
        callbacks = getattr(bpy.app.handlers, name)
        if isinstance(callbacks, list):
            state |= {f"handler {name} {c.__module__}.{c.__qualname__}" for c in callbacks}
    for name in dir(bpy.types):
        draw = getattr(getattr(bpy.types, name), "draw", None)
        # Blender moves the menu's own draw function among them when the first is appended, and leaves it there.
        functions = [f for f in getattr(draw, "_draw_funcs", ()) if not f.__module__.startswith("bl_ui.")]
        state |= {f"entry {name} {f.__module__}.{f.__qualname__}" for f in functions}
    for keymap in (
        bpy.context.window_manager.keyconfigs.addon.keymaps if bpy.context.window_manager.keyconfigs.addon else ()
    ):
        # Of what opens a menu, the menu tells whose it is.
        state |= {
            f"key {keymap.name} {item.idname} {getattr(item.properties, 'name', '')}" for item in keymap.keymap_items
        }
    return state | {f"path {path}" for path in sys.path}


def watch_commands(balance: dict[str, int]) -> None:
    """Count registered commands of the command line, of which Blender gives no list."""
    register, unregister = bpy.utils.register_cli_command, bpy.utils.unregister_cli_command
    names = {}

    def counted_register(name, execute):
        handle = register(name, execute)
        names[id(handle)] = (name, handle)
        balance[name] = balance.get(name, 0) + 1
        return handle

    def counted_unregister(handle):
        balance[names[id(handle)][0]] -= 1
        return unregister(handle)

    bpy.utils.register_cli_command, bpy.utils.unregister_cli_command = counted_register, counted_unregister


def kept_when_removed(remove: Callable[[], int]) -> dict[str, bool]:
    """Whether a file of the user's own species, and one in the extension's folder, are there after it is removed."""
    own = sys.modules[f"{PACKAGE}.tetflora_addon.blender.preferences"].own_species_folder() / "mine.json"
    inside = Path(bpy.utils.extension_path_user(PACKAGE, path="species", create=True)) / "mine.json"
    for path in (own, inside):
        path.write_text("{}", encoding="utf-8")
    addon_utils.disable(PACKAGE, default_set=True)
    return {"removed": remove() == 0, "own": own.exists(), "inside": inside.exists()}


def main(out: str, archive: str | None = None) -> None:
    """Install if asked to, enable, disable, and write what was seen."""
    result: dict = {}
    if archive:
        from bl_pkg import bl_extension_cli

        install = ["install-file", "--repo", "user_default", archive]
        result["installed"] = bl_extension_cli.cli_extension_handler(install)
    else:
        result["installed"] = 0
        result["enabled_by_install"] = addon_utils.check(PACKAGE)[1]
        addon_utils.disable(PACKAGE)
    commands: dict[str, int] = {}
    watch_commands(commands)
    before = visible_state()
    result["enabled"] = addon_utils.enable(PACKAGE, default_set=True) is not None
    result["warnings"] = {name: list(texts) for name, texts in addon_utils._extensions_warnings_get().items()}
    result["added"] = sorted(visible_state() - before)
    result["commands"] = dict(commands)
    addon_utils.disable(PACKAGE, default_set=True)
    result["left"] = sorted(visible_state() - before) + [f"command {n}" for n, count in commands.items() if count]
    result["lost"] = sorted(before - visible_state())
    # A second life: what register() leaves in modules must not be in the way.
    result["enabled_again"] = addon_utils.enable(PACKAGE, default_set=True) is not None
    if archive:
        result["kept"] = kept_when_removed(lambda: bl_extension_cli.cli_extension_handler(["remove", "tetflora"]))
    else:
        addon_utils.disable(PACKAGE, default_set=True)
    Path(out).write_text(json.dumps(result, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main(*(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]))
