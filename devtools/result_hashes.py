# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts and hashes of everything that refinement makes, to show that a change of structure changes no result.

    python -m devtools.result_hashes write out/hashes.json      before the change
    python -m devtools.result_hashes compare out/hashes.json    after it; lists what differs

Scenes: the row of eighty, the landscape, and a small row in each proxy kind and lighting, in the layouts of both
engines. A hash covers all attributes of all meshes and point clouds, in no order. Hashes belong to one machine: numpy
may add up in another order on another one, so they are kept in ``out/`` and not under version control.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from . import session

FORMS = ('AUTOMATIC', 'MICROSURFACES', 'MICROSPHERES', 'SHELLS')
LIGHTINGS = ('OFF', 'PROXIES', 'ALL')
_SMALL_ROW = 12
_FIELDS = ("value", "vector", "color")


def datablock_hash(data: object) -> str:
    """Hash of all attributes of a mesh or point cloud: names, domains, types and values."""
    digest = hashlib.sha256()
    for layer in sorted(data.attributes, key=lambda layer: layer.name):
        digest.update(f"{layer.name} {layer.domain} {layer.data_type} {len(layer.data)}".encode())
        field = next((f for f in _FIELDS if len(layer.data) and hasattr(layer.data[0], f)), None)
        if field is not None:
            values = np.zeros(len(layer.data) * np.size(np.array(getattr(layer.data[0], field))))
            layer.data.foreach_get(field, values)
            digest.update(values.tobytes())
    return digest.hexdigest()


def scene_summary() -> dict[str, object]:
    """Counts of what refinement made in the open file, and one hash of it all.

    Returns
    -------
    dict
        ``statistics`` (counts, without seconds), ``objects``, ``hash``.
    """
    import bpy

    made = [o for o in bpy.data.objects if o.get("tetflora_kind") and o.data is not None]
    hashes = sorted(f"{o['tetflora_kind']} {datablock_hash(o.data)}" for o in made)
    statistics = json.loads(bpy.context.scene.tetflora.statistics)
    for timed in ("seconds", "steps"):
        statistics.pop(timed, None)
    return {
        "statistics": statistics,
        "objects": len(made),
        "hash": hashlib.sha256("\n".join(hashes).encode()).hexdigest(),
    }


def scenes() -> Iterator[tuple[str, dict[str, object]]]:
    """Name and summary of every scene, one after the other in an empty file."""
    import bpy

    from examples import landscape, row80

    def refined(**settings: object) -> dict[str, object]:
        for name, value in settings.items():
            setattr(bpy.context.scene.tetflora, name, value)
        bpy.ops.tetflora.refine()
        return scene_summary()

    session.clean_file()
    row80.build(bpy.context.scene)
    yield "row80", refined()
    session.clean_file()
    landscape.build(bpy.context.scene)
    yield "landscape", refined()
    session.clean_file()
    row80.build(bpy.context.scene, _SMALL_ROW)
    for form in FORMS:
        for lighting in LIGHTINGS:
            for engine in ('CYCLES', session.eevee()):
                bpy.context.scene.render.engine = engine
                yield f"{form} {lighting} {engine}", refined(proxy_kind=form, baked_light=lighting)
    yield "expanded", refined(expand_everything=True)


def main(arguments: list[str]) -> int:
    """Write or compare; 1 if anything differs."""
    action, path = arguments[0], Path(arguments[1])
    session.start()
    found = {}
    for name, summary in scenes():
        found[name] = summary
        print(name, summary["statistics"].get("polygons_meshed"), summary["hash"][:16], flush=True)
    if action == "write":
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(found, indent=1), encoding="utf-8")
        return 0
    before = json.loads(path.read_text(encoding="utf-8"))
    differing = [name for name in before if before[name] != json.loads(json.dumps(found.get(name)))]
    for name in differing:
        print(f"{name}: {before[name]}\n    now {found.get(name)}", file=sys.stderr)
    print(f"{len(before) - len(differing)} of {len(before)} scenes are the same")
    return bool(differing)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
