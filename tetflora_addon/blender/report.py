# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report of a fault needs to say of the machine, the settings and the last error; nothing of the scene.

No name of an object, file, folder or user is in it: texts in quotes and paths are left out.
"""

import os
import platform
import re
import sys
from collections.abc import Iterator

import addon_utils
import bpy
import numpy as np

from .. import memory, parallel
from ..processes import pool
from .compat import VERSION_TEXT
from .preferences import CACHE_VARIABLE, ROOT_PACKAGE, preferences
from .runtime import last_error

#: Kinds of properties that hold neither names nor paths.
_PLAIN = {'BOOLEAN', 'INT', 'FLOAT', 'ENUM'}
#: Enums whose choices are somebody's own files or objects.
_OWN = re.compile("species|biome|object|file|folder|path", re.IGNORECASE)
#: Texts in quotes, and paths as Unix and Windows have them.
_PRIVATE = re.compile(
    r"""["“].*?["”]|'.*?'|(?<![\w.])(?:[A-Za-z]:[\\/]|\\\\|/)[^:;,]*?(?=: |[;,]|\. [A-Z]|$)""", re.DOTALL
)
_LEFT_OUT = "(left out)"


def report_text(scene: bpy.types.Scene) -> str:
    """The report, as lines of ``name: value`` under headings."""
    parts = {
        "Versions": _versions(),
        "Machine": _machine(),
        "Settings that are not the defaults": _changed(scene),
        "Last error": _error(),
    }
    lines = ["TetFlora report. It holds nothing of your scene; look through it before you send it."]
    for heading, entries in parts.items():
        lines += ["", f"## {heading}", *entries]
    return "\n".join(lines) + "\n"


def public(text: str) -> str:
    """A text without what may name somebody's things."""
    return _PRIVATE.sub(_LEFT_OUT, text)


def _versions() -> Iterator[str]:
    version = addon_utils.module_bl_info(sys.modules[ROOT_PACKAGE]).get("version", ())
    yield f"TetFlora: {'.'.join(map(str, version)) or 'unknown'}"
    built = bpy.app.build_hash.decode(errors="replace")
    yield f"Blender: {VERSION_TEXT} ({built}){', in background' if bpy.app.background else ''}"
    yield f"Python: {platform.python_version()}, numpy: {np.__version__}"
    yield f"System: {platform.platform()}, {platform.machine()}"
    yield f"Encodings: {sys.getfilesystemencoding()}, language: {bpy.app.translations.locale or 'en_US'}"


def _machine() -> Iterator[str]:
    total, resident = memory.total(), memory.resident()
    yield f"Cores: {parallel.cores()}, threads: {parallel.threads()}"
    yield f"Memory: {_giga(total)}, of Blender now: {_giga(resident)}"
    yield f"Other processes: {pool.state()}, {_giga(pool.peak())} at most"


def _giga(number: int | None) -> str:
    return "unknown" if number is None else f"{number / memory.GIGABYTE:.1f} GB"


def _changed(scene: bpy.types.Scene) -> Iterator[str]:
    groups: dict[str, bpy.types.bpy_struct | None] = {"preferences": preferences(), "scene": scene.tetflora}
    groups |= {name: getattr(scene.tetflora, name) for name in ("wind", "year", "output")}
    for owner, group in groups.items():
        for prop in () if group is None else group.bl_rna.properties:
            name = prop.identifier
            if prop.type not in _PLAIN or prop.is_readonly or _OWN.search(name) or not group.is_property_set(name):
                continue
            value = getattr(group, name)
            yield f"{owner}.{name}: {tuple(value) if getattr(prop, 'is_array', False) else value}"
    yield f"render engine: {scene.render.engine}, Lock Interface: {scene.render.use_lock_interface}"
    for name in (parallel.VARIABLE, CACHE_VARIABLE):
        yield f"{name}: {'set' if name in os.environ else 'not set'}"


def _error() -> Iterator[str]:
    text, places = last_error()
    yield public(text) or "none in this session"
    yield from places
