# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the screen says of TetFlora: ``python -m devtools.labels`` lists all labels, for documents that name them.

Names of properties, of what they can be, operators, panels and menus come from the classes that Blender has registered;
texts that panels draw themselves come from their code.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from typing import Any

from . import interface, session
from .house import ROOT


def _of(rna: Any) -> Iterator[str]:
    """Names of a group's or operator's properties, and of what these can be."""
    for prop in rna.properties:
        yield prop.name
        if prop.type == 'ENUM':
            yield from (item.name for item in prop.enum_items_static)


def _texts() -> Iterator[str]:
    """Texts in the code of panels; identifiers and names of icons begin otherwise, or are capitals alone."""
    for path in sorted((ROOT / "panels").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                text = node.value.removesuffix("...")
                if text[:1].isupper() and not (text.isupper() or "_" in text or text.endswith(".") or len(text) > 60):
                    yield text.strip()


def labels() -> set[str]:
    """All labels, with the extension registered in this process."""
    import bpy

    found = set(_texts())
    found.update(p.name for p in bpy.types.WindowManager.bl_rna.properties if p.identifier.startswith("tetflora"))
    for group in bpy.types.PropertyGroup.__subclasses__():
        if group.__name__.startswith("TetFlora") and getattr(group, "is_registered", False):
            found.update(_of(group.bl_rna))
    for group in interface.groups():
        found.update(_of(group.bl_rna))
    for rna in interface.operator_types().values():
        found.update((rna.name, *_of(rna)))
    for prefix in ("TETFLORA_PT_", "TETFLORA_MT_"):
        found.update(cls.bl_label for cls in interface.classes(prefix))
    return {label for label in found if label}


def main() -> int:
    """Print them."""
    session.start()
    print("\n".join(sorted(labels())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
