# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of a scene as one list: what each is, how many plants it has, whether it is due, its place among the others.

A biome is followed by the layers that it is made of, which know its identity. Layers of fields point at their object.
"""

from collections.abc import Sequence

import bpy

from ...jobs import run_to_end
from ..compat import stored_properties
from ..placing import rules
from ..placing.plant_objects import PAINTED_MARK, note_field, plant_collection
from ..placing.populations import add_population
from ..placing.rules import BIOME_ONLY, awaits_update, copy_settings, free_seed, grounds_of, set_grounds
from ..runtime import handlers
from ..scene.fields import has_history, stored_size
from ..settings import BIOME, FIELD, SCATTER, active_in, rules_of
from ..stands.growing import stand_settings_now

#: What layers are, by their icons.
SCATTERED, COVERING, GROUP = 'OUTLINER_OB_POINTCLOUD', 'OUTLINER_OB_CURVES', 'WORLD'
STAND, PAINTED, IMPORTED = 'TIME', 'BRUSH_DATA', 'IMPORT'
Layer = bpy.types.PropertyGroup


def kind_of(layer: Layer) -> str:
    """What a layer is, as artists see it: its icon."""
    if layer.kind == SCATTER:
        return COVERING if layer.covers else SCATTERED
    if layer.kind == BIOME:
        return GROUP
    if layer.field is not None and layer.field.tetflora.stand.is_grown:
        return STAND
    return PAINTED if layer.field is not None and PAINTED_MARK in layer.field else IMPORTED


def active_layer(scene: bpy.types.Scene) -> Layer | None:
    """The layer that buttons act on; None where there is none."""
    return active_in(scene.tetflora, "layers")


def index_of(scene: bpy.types.Scene, uid: str) -> int:
    """Place of a layer in the list; -1 where there is none of this identity."""
    return next((number for number, layer in enumerate(scene.tetflora.layers) if layer.uid == uid), -1)


def children_of(layer: Layer) -> list[Layer]:
    """The layers of a biome; none of others."""
    if layer.kind != BIOME or not layer.uid:
        return []
    return [one for one in layer.id_data.tetflora.layers if one.biome == layer.uid and one.kind != BIOME]


def plants_in(layer: Layer) -> int:
    """How many plants a layer has; reads no geometry but that of fields."""
    if layer.kind == FIELD:
        if layer.field is None:
            return 0
        return layer.field.tetflora.stand.plants if has_history(layer.field) else stored_size(layer.field)
    return layer.made + sum(map(plants_in, children_of(layer)))


def is_due(layer: Layer) -> bool:
    """Whether an update would change a layer's plants; cheap."""
    if layer.frozen:
        return False
    if layer.kind == BIOME:
        return any(map(is_due, children_of(layer)))
    if layer.kind == FIELD:
        field = layer.field
        if field is None or not field.tetflora.stand.grown_by or not has_history(field):
            return False
        changed = field.tetflora.stand.grown_by != stand_settings_now(layer.id_data, field)
        return changed or rules.on_changed_ground(layer)
    return awaits_update(layer)


def due_layers(scene: bpy.types.Scene) -> list[str]:
    """Identities of all layers that an update would change, but biomes, whose layers are among them; reads grounds."""
    layers, seen = scene.tetflora.layers, run_to_end(rules.ground_steps(scene, bpy.context.view_layer))
    return [one.uid for one in layers if one.kind != BIOME and (is_due(one) or (seen[one.uid][-1] and not one.frozen))]


def is_gone(layer: Layer) -> bool:
    """Whether the object of a layer was deleted: then nothing but the layer uses it; cheap."""
    return layer.kind == FIELD and (layer.field is None or layer.field.users < 2)


def forget_gone(scene: bpy.types.Scene) -> None:
    """Take layers out of the list whose object was deleted."""
    layers = scene.tetflora.layers
    for index in range(len(layers) - 1, -1, -1):
        field = layers[index].field
        if layers[index].kind == FIELD and (field is None or scene not in field.users_scene):
            layers.remove(index)
    scene.tetflora.layers_index = min(scene.tetflora.layers_index, len(layers) - 1)


def copy_layer(scene: bpy.types.Scene, source: Layer, grounds: Sequence[bpy.types.Object] | None = None) -> Layer:
    """Add a copy of a layer without plants, a biome with its layers, on the same or other grounds; it becomes active.

    Fields are copied with their plants; on other grounds, stands are due.
    """
    old, copies = source.uid, {}
    for uid in [old, *(one.uid for one in children_of(source))]:
        copies[uid] = _copy_one(scene, uid, grounds, copies.get(old, ""))
    _tidy(scene, copies[old])
    return scene.tetflora.layers[index_of(scene, copies[old])]


def _copy_one(scene: bpy.types.Scene, uid: str, grounds: Sequence[bpy.types.Object] | None, biome: str) -> str:
    """Identity of a copy of a layer of an identity, which belongs to a biome or to none."""
    layers = scene.tetflora.layers
    kind, field, name = (getattr(layers[index_of(scene, uid)], key) for key in ("kind", "field", "name"))
    if kind == FIELD:
        copy = field.copy()
        copy.data = field.data.copy()
        copy.tetflora.stand.biome = biome
        if grounds is not None:
            set_grounds(copy.tetflora.stand, grounds)
            copy.tetflora.stand.grown_by = "elsewhere"
        plant_collection(scene).objects.link(copy)
        note_field(scene, copy)
        return layers[-1].uid
    new = add_population(scene, name=name)
    source = layers[index_of(scene, uid)]  # fetched again: adding to a list moves what is in it
    copy_settings(source, new)
    for key in ("kind", "source", "data", *BIOME_ONLY):
        setattr(new, key, getattr(source, key))
    set_grounds(new, [e.object for e in source.grounds] if grounds is None else grounds)
    if grounds is None:
        new.seed = free_seed(scene, new.seed)
    # A cover lies under the copy of what it lay under, or under that itself.
    new.covers = biome if source.covers == source.biome else source.covers
    new.biome = biome or (source.biome if grounds is None else "")
    return new.uid


def _blocks(layers: Sequence[Layer]) -> list[list[str]]:
    """Identities of the layers that move together: a biome with its own, all others alone."""
    biomes = {layer.uid for layer in layers if layer.kind == BIOME}
    blocks: dict[str, list[str]] = {}
    for layer in layers:
        blocks.setdefault(layer.biome if layer.biome in biomes else layer.uid, []).append(layer.uid)
    return [sorted(block, key=lambda uid: uid not in biomes) for block in blocks.values()]


def move_layer(scene: bpy.types.Scene, step: int) -> bool:
    """Move the active layer past its neighbor, a biome with all of its layers; whether there was one.

    Layers of a biome stay within it.
    """
    group, layer = scene.tetflora, active_layer(scene)
    blocks = _blocks(group.layers)
    within = next((block for block in blocks if layer.uid in block[1:]), None)
    rows: list = blocks if within is None else within
    index = next(n for n, row in enumerate(rows) if layer.uid == row or (within is None and layer.uid in row))
    first = 0 if within is None else 1  # a biome stays above its layers
    if not first <= index + step < len(rows):
        return False
    rows.insert(index + step, rows.pop(index))
    sort_layers(scene, [uid for block in blocks for uid in block], layer.uid)
    return True


def group_layer(scene: bpy.types.Scene) -> bool:
    """Put the active layer into the group above or, without one, into a new group with the layer above it.

    False for groups, and for what is in one.
    """
    layers, layer = scene.tetflora.layers, active_layer(scene)
    blocks, uid = _blocks(layers), layer.uid
    index = next((n for n, block in enumerate(blocks) if block == [uid]), -1)
    if index < 0 or layer.kind == BIOME:
        return False
    above = blocks[index - 1] if index else []
    if above and layers[index_of(scene, above[0])].kind == BIOME:
        _put_into(layer, above[0])
    else:
        zone = add_population(scene, grounds_of(scene, rules_of(layer)), name="Group")
        zone.kind, zone.limits, zone.gives_way, group = BIOME, set(), False, zone.uid
        for one in (*above, uid):
            _put_into(layers[index_of(scene, one)], group)
    _tidy(scene, uid)
    return True


def ungroup_layer(scene: bpy.types.Scene) -> bool:
    """Take the active layer out of its group, to below it; False where it is in none."""
    layer = active_layer(scene)
    if not layer.biome or layer.kind == BIOME:
        return False
    _put_into(layer, "")
    _tidy(scene, layer.uid)
    return True


def _put_into(layer: Layer, group: str) -> None:
    layer.biome = group
    if layer.kind == FIELD and layer.field is not None:
        layer.field.tetflora.stand.biome = group


def _tidy(scene: bpy.types.Scene, active: str) -> None:
    """Let layers follow their biomes and groups."""
    sort_layers(scene, [uid for block in _blocks(scene.tetflora.layers) for uid in block], active)


def sort_layers(scene: bpy.types.Scene, order: Sequence[str], active: str) -> None:
    """Bring the list into an order of identities."""
    for place, uid in enumerate(order if list(order) != [one.uid for one in scene.tetflora.layers] else ()):
        scene.tetflora.layers.move(index_of(scene, uid), place)
    scene.tetflora.layers_index = index_of(scene, active)


def bring_together(scene: bpy.types.Scene) -> None:
    """Let layers of biomes follow these, and fields without a layer have one, as in files of any origin."""
    forget_gone(scene)
    layers, active = scene.tetflora.layers, active_layer(scene)
    shown = active.uid if active is not None else ""
    known = {layer.field for layer in layers if layer.field is not None}
    uids = {layer.uid for layer in layers}
    for obj in scene.objects:
        if obj.tetflora.is_field and obj.tetflora.population not in uids and obj not in known and obj.library is None:
            note_field(scene, obj)
    _tidy(scene, shown)
    scene.tetflora.layers_index = max(index_of(scene, shown), min(len(layers) - 1, 0))


def _read_older(scene: bpy.types.Scene) -> None:
    """Take over what a file from before there were layers keeps: populations, and biomes in a list of their own."""
    stored = (stored_properties(scene) or {}).get("tetflora")
    if stored is None or "populations" not in stored:
        return
    kinds = scene.tetflora.bl_rna.properties["layers"].fixed_type.properties["kind"].enum_items
    biomes = [{**one.to_dict(), "kind": kinds[BIOME].value} for one in stored.get("biomes", ())]
    stored["layers"] = biomes + [one.to_dict() for one in (*stored.get("layers", ()), *stored["populations"])]
    scene.tetflora.layers_index = len(biomes) + stored.get("populations_index", 0)
    for name in ("populations", "populations_index", "biomes", "biomes_index"):
        stored.pop(name, None)


def _on_load(*_: object) -> None:
    for scene in bpy.data.scenes:
        if scene.library is None:
            _read_older(scene)
            bring_together(scene)


register, unregister = handlers(load_post=_on_load)
