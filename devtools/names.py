# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m devtools.names`` writes docs/reference/names.md: all names that files, scripts and artists' nodes hold.

They stay. A test compares the page with what Blender has registered, with what materials are built of and with what
readers of files accept: a name that is missing breaks somebody's file.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable

from . import interface, session
from .house import ROOT

PAGE = ROOT / "docs" / "reference" / "names.md"
_HEAD = """<!-- SPDX-FileCopyrightText: 2026 TetFlora Authors -->
<!-- SPDX-License-Identifier: GPL-3.0-or-later -->

# Names

Files and scripts use these identifiers, so they do not change. `python -m devtools.names` writes this page, and a test
compares it with the code. A name that must change needs a step in `tetflora_addon/formats.py`.
"""
#: Where scripts find groups of properties.
_PLACES = {"TetFloraObject": "`Object.tetflora`", "TetFloraScene": "`Scene.tetflora`"}


def operators() -> dict[str, list[str]]:
    """Identifiers of operators, and of their properties without those of Blender's own file dialogs."""
    import bpy

    files = {p.identifier for p in bpy.ops.wm.open_mainfile.get_rna_type().properties}
    return {
        f"tetflora.{name}": [p.identifier for p in rna.properties if p.identifier not in files]
        for name, rna in interface.operator_types().items()
    }


def properties() -> dict[str, list[str]]:
    """Identifiers of properties, hidden ones too, by the class of their group."""
    import bpy

    kinds = (*bpy.types.PropertyGroup.__subclasses__(), *bpy.types.AddonPreferences.__subclasses__())
    found = {cls for cls in kinds if cls.__name__.startswith("TetFlora") and getattr(cls, "is_registered", False)}
    own = {cls.__name__: dict.fromkeys(p.identifier for p in cls.bl_rna.properties) for cls in found}
    return {name: [n for n in given if n not in {"rna_type", "bl_idname"}] for name, given in sorted(own.items())}


def attributes() -> list[str]:
    """Names of attributes of meshes, points and objects that TetFlora reads or writes."""
    from tetflora_addon.blender.scene.fields import FIELD_ATTRIBUTES

    sources = (path.read_text(encoding="utf-8") for path in (ROOT / "tetflora_addon").rglob("*.py"))
    found = {name for source in sources for name in re.findall(r'"(tf_[a-z0-9_]+|tetflora_[a-z_]+)"', source)}
    return sorted(found | set(FIELD_ATTRIBUTES) | {"age"})


def sockets() -> dict[str, list[str]]:
    """Inputs and outputs of the groups in materials, by the groups' names; all barks have the same, and all blades."""
    import bpy

    from tetflora_addon.blender.materials import materials, microsphere, snow
    from tetflora_addon.blender.materials.blade import BLADES, blade_group
    from tetflora_addon.species.species import BARKS

    session.clean_file()
    blade_group(next(iter(BLADES)))
    materials.bark_material("any", BARKS[0])
    snow.add_snow(materials.proxy_material())
    for build in (materials.sphere_material, materials.baked_material, microsphere.shell_material):
        build()
    microsphere.baked_shell_material()
    return {
        group.name: [item.name for item in group.interface.items_tree]
        for group in sorted(bpy.data.node_groups, key=lambda group: group.name)
    }


def file_keys() -> dict[str, list[str]]:
    """Keys of files that artists exchange."""
    from tetflora_addon.blender.biomes import files
    from tetflora_addon.blender.biomes.library import GROUND
    from tetflora_addon.blender.placing.population_data import simple_settings
    from tetflora_addon.blender.placing.properties import TetFloraLayer
    from tetflora_addon.blender.placing.rules import ENTRY
    from tetflora_addon.parameters import keys_of
    from tetflora_addon.species import catalog, species

    parts = (species.Bud, species.Dead, species.Year, species.LeafYear, species.Ages, species.Ecology)
    return {
        "species": list(catalog.SPECIES_KEYS),
        "species: orders, spur": list(catalog.ORDER_KEYS),
        **{f"species: {kind.__name__}": list(keys_of(kind)) for kind in parts},
        "biome": sorted(files._KEYS | files._MORE),
        "biome: ground": list(GROUND),
        "biome: season": list(files.SEASON),
        "biome: layer": [p.identifier for p in simple_settings(TetFloraLayer)],
        "biome: species of a layer": list(ENTRY),
        "biome: stand": files.stand_settings(),
        "biome: species of a stand": list(files.STAND_ENTRY),
    }


def _table(title: str, rows: dict[str, Iterable[str]]) -> str:
    lines = [f"| {name} | {', '.join(f'`{one}`' for one in sorted(set(given)))} |" for name, given in rows.items()]
    return "\n".join((f"\n## {title}\n", "| of | names |", "|---|---|", *lines, ""))


def page() -> str:
    """The page as it is today."""
    groups = {_PLACES.get(name, f"`{name}`"): given for name, given in properties().items()}
    return _HEAD + "".join(
        (
            _table("Operators", {f"`{name}`": given for name, given in operators().items()}),
            _table("Properties", groups),
            _table("Attributes and Custom Properties", {"all": attributes()}),
            _table("Sockets of Groups in Materials", sockets()),
            _table("Keys of Files", file_keys()),
        )
    )


def main() -> int:
    """Write the page."""
    session.start()
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
