# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m devtools.interface --json PATH`` counts what artists see, from the classes that Blender has registered.

Panels are drawn into a layout that records, in scenes with and without plants; a section that is closed counts as all
others. The largest number of controls that a panel has in any of these scenes is its own.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from . import session
from .layouts import Layout

#: What is asked for: figure, and its limit.
LIMITS = {
    "panels": 16,
    "sidebar_panels": 5,
    "sidebar_controls": 45,
    "operators": 50,
    "properties": 190,
    "longest_label": 24,
    "without_tooltip": 0,
    "slowest_draw_ms": 2.0,
}
OBJECTS = 100_000  # in the scene in which draws are timed
#: Calls of a layout that make something to click, type or choose.
_CONTROLS = {
    *("prop", "prop_search", "prop_menu_enum", "prop_enum", "prop_tabs_enum", "operator", "operator_menu_enum"),
    *("menu", "popover", "template_list", "template_ID", "template_icon_view", "template_curve_mapping"),
}


def classes(prefix: str) -> list[type]:
    """Registered classes of the extension whose names begin so."""
    import bpy

    return [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith(prefix)]


def groups() -> list[type]:
    """Registered groups of properties that artists see some of, and the preferences; lists that are hidden are none."""
    import bpy

    found = {cls for cls in bpy.types.PropertyGroup.__subclasses__() if cls.__name__.startswith("TetFlora")}
    uses = [p for cls in found for p in cls.bl_rna.properties if p.type in {'POINTER', 'COLLECTION'}]
    inner, shown = ({p.fixed_type.identifier for p in uses if p.is_hidden == hidden} for hidden in (True, False))
    # The editor draws the values of a page, which is stored elsewhere.
    found = {cls for cls in found if cls.__name__ in {"TetFloraSpeciesEditor", *shown} or cls.__name__ not in inner}
    found |= {cls for cls in bpy.types.AddonPreferences.__subclasses__() if cls.__name__.startswith("TetFlora")}
    return sorted((cls for cls in found if getattr(cls, "is_registered", False)), key=lambda cls: cls.__name__)


def settings(group: type) -> list[Any]:
    """Properties of a group that artists see; groups and lists within it have classes, and figures, of their own."""
    import bpy

    skipped = {"rna_type", "bl_idname"} | ({"name"} - set(group.__annotations__))
    # Blender lists a property twice that a group declares again, as that of all groups for a name.
    own = {p.identifier: p for p in group.bl_rna.properties if not p.is_hidden and p.identifier not in skipped}
    return [
        p
        for p in own.values()
        if getattr(getattr(p, "fixed_type", None), "base", None) != bpy.types.PropertyGroup.bl_rna
    ]


def operator_types() -> dict[str, Any]:
    """What Blender knows of each operator of the extension, by its name in Python."""
    import bpy

    return {name: getattr(bpy.ops.tetflora, name).get_rna_type() for name in dir(bpy.ops.tetflora)}


def _context(**others: Any) -> Any:
    """The context, with what only a window has."""
    import bpy

    space = SimpleNamespace(bl_rna=bpy.types.SpaceView3D.bl_rna, show_object_viewport_empty=True)
    given = {"region": SimpleNamespace(width=300), "space_data": space, **others}

    class _Context:
        def __getattr__(self, name: str) -> Any:
            return given[name] if name in given else getattr(bpy.context, name)

    return _Context()


def drawn(cls: type, context: Any, layout: Any) -> bool:
    """Draw a panel into a layout; whether its poll says that it is there."""
    poll = getattr(cls, "poll", None)
    if poll is not None and not poll(context):
        return False
    drawing = SimpleNamespace(layout=layout)
    for part in ("draw_header", "draw"):
        if hasattr(cls, part):
            getattr(cls, part)(drawing, context)
    return True


class _Nothing:
    """A layout that costs nothing: what is timed is the panel."""

    def __getattr__(self, name: str) -> Any:
        return (lambda *_, **__: (self, self)) if name == "panel" else (lambda *_, **__: self)


def controls(calls: list[tuple[str, tuple, dict]], closed: bool = True) -> int:
    """How many things to click a panel has, with or without those of sections that are closed at first."""
    number, skipped = 0, False
    for name, _, options in calls:
        if name == "panel":
            skipped = not closed and options.get("default_closed", False)
        number += name in _CONTROLS and not skipped
    return number


def _scenes() -> Iterator[str]:
    """An empty file, then plants and all that grows on a ground, each active in turn."""
    import bpy

    session.clean_file()
    yield "empty"
    bpy.ops.tetflora.first_forest()
    scene = bpy.context.scene
    bpy.context.window.scene = scene
    yield "forest"
    plant = next(obj for obj in scene.objects if obj.tetflora.is_plant)
    _only(plant)
    yield "plant"
    ground = next(obj for obj in scene.objects if obj.tetflora.is_occluder)
    _only(ground)
    bpy.ops.tetflora.populate(count=5, species="birch:1, spruce:1")
    yield "scatter"
    scene.tetflora.stand.years, scene.tetflora.stand.density = 2, 50.0
    _only(ground)
    bpy.ops.tetflora.grow_stand()
    yield "stand"
    scene.tetflora.layers.add().kind = 'BIOME'
    scene.tetflora.layers_index = len(scene.tetflora.layers) - 1
    yield "biome"


def _only(obj: Any) -> None:
    """Select one object."""
    import bpy

    for other in bpy.context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj


def _many() -> None:
    """A scene with very many objects, some of them plants, and a layer that grows on some thousand meshes."""
    import bpy

    collection, grounds = bpy.data.collections.new("many"), bpy.data.collections.new("grounds")
    mesh = bpy.data.meshes.new("ground")
    for number in range(2000):
        grounds.objects.link(bpy.data.objects.new(f"g{number}", mesh))
    bpy.context.scene.collection.children.link(grounds)
    layer = bpy.context.scene.tetflora.layers.add()
    layer.kind, layer.uid, layer.ground_collection = 'SCATTER', "grounds", grounds
    bpy.context.scene.tetflora.layers_index = len(bpy.context.scene.tetflora.layers) - 1
    for number in range(OBJECTS):
        obj = bpy.data.objects.new(f"o{number}", None)
        collection.objects.link(obj)
        if number % 100 == 0:
            obj.tetflora.is_plant, obj.tetflora.species = True, "bush"
    bpy.context.scene.collection.children.link(collection)
    bpy.context.view_layer.update()


def _as_in_a_window() -> None:
    """Look at folders, look for warnings and forecast as seldom as in a window: not in every draw."""
    import bpy

    from panels import refine
    from tetflora_addon.blender.biomes import library
    from tetflora_addon.blender.placing import rules
    from tetflora_addon.blender.results.collection import Results
    from tetflora_addon.blender.species import catalog, edits
    from tetflora_addon.blender.viewport import auto
    from tetflora_addon.jobs import run_to_end

    for module in (library, catalog, edits):
        module._TRUSTED = 60.0
    found = refine.warned(_context())
    refine.warned = lambda _context: found
    scene, layer = bpy.context.scene, bpy.context.view_layer
    text = refine.forecast_text(scene, layer)
    refine.forecast_text = lambda _scene, _layer: text
    results = Results(scene, 'VIEW')  # what is asked of them in each draw counts too
    results.open()
    results.finish()
    auto.note_results(scene, made_for := auto.results_made_for(scene))
    auto._outlook.of = lambda _scene, _layer: made_for
    seen = run_to_end(rules.ground_steps(scene, layer))
    rules.seen_grounds.of = lambda _scene, _layer: seen


def _milliseconds(draw: Callable[[], object]) -> float:
    """Median processor time of a draw, after a first one; other work of the machine does not count."""
    times = []
    for _ in range(10):
        begin = time.thread_time()
        draw()
        times.append(time.thread_time() - begin)
    return 1000.0 * statistics.median(times[1:])


def lists(context: Any) -> dict[str, Callable[[], int]]:
    """What draws all rows of each list that the scene has, by the list's class and name; it returns how many."""
    import bpy

    group = context.scene.tetflora
    stands = [layer.field.tetflora.stand for layer in group.layers if layer.field is not None]
    species = [*((layer, "mix") for layer in group.layers), *((one, "species") for one in (*stands, group.output))]
    owners = {"TETFLORA_UL_layers": [(group, "layers")], "TETFLORA_UL_species": species}

    def draw(cls: type, owner: Any, name: str) -> int:
        own = SimpleNamespace(bitflag_filter_item=1, beside=getattr(cls, "beside", None))
        if hasattr(cls, "filter_items"):
            cls.filter_items(own, context, owner, name)
        entries = getattr(owner, name)
        for number, item in enumerate(entries):
            cls.draw_item(own, context, _Nothing(), owner, item, 0, owner, f"{name}_index", number, 0)
        return len(entries)

    return {
        f"{kind}.{number}": partial(draw, getattr(bpy.types, kind), *one)
        for kind, some in owners.items()
        for number, one in enumerate(some)
    }


def sidebar(panels: list[type]) -> list[type]:
    """Those of some panels that are in the 3D view's sidebar."""
    return [cls for cls in panels if cls.bl_space_type == 'VIEW_3D' and cls.bl_region_type == 'UI']


def named(panels: list[type]) -> dict[str, Any]:
    """How many settings groups have, labels that are too long, and settings without a tooltip."""
    operators, shown = operator_types(), {cls.__name__: settings(cls) for cls in groups()}
    labels = {f"{name}.{p.identifier}": p.name for name, own in shown.items() for p in own}
    labels |= {f"tetflora.{name}": rna.name for name, rna in operators.items()}
    labels |= {cls.__name__: cls.bl_label for cls in panels}
    bare = [f"{name}.{p.identifier}" for name, own in shown.items() for p in own if not p.description]
    for name, rna in operators.items():
        own = (p for p in rna.properties if p.identifier != "rna_type" and not p.is_hidden)
        bare += [f"tetflora.{name}.{p.identifier}" for p in own if not (p.description or _is_blenders(p))]
    return {
        "properties_of": {name: len(own) for name, own in shown.items()},
        "longest_label": max(map(len, labels.values())),
        "long_labels": {key: label for key, label in labels.items() if len(label) > LIMITS["longest_label"]},
        "bare": bare,
    }


def figures() -> dict[str, Any]:
    """All figures; those of single panels and of what is too long or missing are details."""
    panels = classes("TETFLORA_PT_")
    every: dict[str, int] = {}
    opened: dict[str, int] = {}
    for _ in _scenes():
        for cls in sidebar(panels):
            layout = Layout()
            if drawn(cls, _context(), layout):
                name = cls.__name__
                every[name] = max(every.get(name, 0), controls(layout.drawn))
                opened[name] = max(opened.get(name, 0), controls(layout.drawn, closed=False))
    words = named(panels)
    _many()
    _as_in_a_window()
    context = _context()
    seen = {cls.__name__: partial(drawn, cls, context, _Nothing()) for cls in panels}
    times = {name: _milliseconds(draw) for name, draw in {**seen, **lists(context)}.items() if draw()}
    return {
        "panels": len(panels),
        "sidebar_panels": len(sidebar(panels)),
        "sidebar_controls": sum(every.values()),
        "sidebar_controls_open": sum(opened.values()),
        "operators": len(operator_types()),
        "properties": sum(words["properties_of"].values()),
        "longest_label": words["longest_label"],
        "without_tooltip": len(words["bare"]),
        "slowest_draw_ms": round(max(times.values(), default=0.0), 2),
        "details": {"controls_of": every, "open_controls_of": opened, **words, "draw_ms": times},
    }


def _is_blenders(prop: Any) -> bool:
    """Whether a property is one that Blender's own mix-ins for files bring."""
    return prop.identifier in {"filepath", "check_existing", "filter_glob", "files", "directory"}


def main(arguments: list[str] | None = None) -> int:
    """Print the figures beside their limits; 1 where one is exceeded."""
    parser = argparse.ArgumentParser(prog="devtools.interface", description="Count what artists see.")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write all figures to this file too")
    given = parser.parse_args(arguments)
    session.start()
    found = figures()
    if given.json is not None:
        given.json.write_text(json.dumps({**found, "limits": LIMITS}, indent=1) + "\n", encoding="utf-8")
    for name, limit in LIMITS.items():
        print(f"{name:24} {found[name]:>8} of {limit:>4}{'' if found[name] <= limit else '   <-- too many'}")
    return int(any(found[name] > limit for name, limit in LIMITS.items()))


if __name__ == "__main__":
    sys.exit(main())
