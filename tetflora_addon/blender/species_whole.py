# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of the species editor beside the keys of an order: name, leaves, bark, which order is shown."""

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..plants.leaf_models import LEAF_MODELS
from ..plants.schema import QUALITY_LIMITS
from ..plants.skeletons import MAX_ORDERS
from ..plants.species import BARKS
from .species_choice import SpeciesChoice
from .species_edits import tell_listeners
from .species_values import (
    number_in,
    order_label,
    orders_of,
    parts_of,
    present_order,
    rounded,
    set_species_value,
    species_value,
)

#: Items of ``leaf_form`` and ``blossom_form`` that are no built-in model.
OBJECT_LEAF, OWN_LEAF, NO_LEAF = "OBJECT", "OWN", "NONE"

# Blender keeps no copy of the strings of dynamic items, so somebody has to.
_kept: dict[tuple[str, ...], list[tuple[str, str, str, int]]] = {}


def _order_items(editor: bpy.types.PropertyGroup, _context: Any) -> list[tuple[str, str, str, int]]:
    orders = len(orders_of(editor))
    labels = tuple(order_label(i, part, i >= orders) for i, part in enumerate(parts_of(editor)[: MAX_ORDERS + 1]))
    if labels not in _kept:
        if len(_kept) > 256:  # every number on the way of a slider is another text
            _kept.clear()
        _kept[labels] = [(str(i), text, "Edit the branches of this order", i) for i, text in enumerate(labels)] or [
            ("0", "No orders", "This species cannot be read", 0)
        ]
    return _kept[labels]


_LEAF_ITEMS = [
    *((name, name.capitalize(), f"{m.polygons} faces", i) for i, (name, m) in enumerate(LEAF_MODELS.items())),
    (OBJECT_LEAF, "Mesh Object", "Mesh object of this file, one unit long along +Y", len(LEAF_MODELS)),
    (OWN_LEAF, "From Species File", "Polygons from the species file, or several forms", len(LEAF_MODELS) + 1),
]  # fmt: skip
_BLOSSOM_ITEMS = [*_LEAF_ITEMS, (NO_LEAF, "None", "The species has no blossoms or fruit", len(_LEAF_ITEMS))]


def _forms(editor: bpy.types.PropertyGroup, kind: str) -> dict[str, Any]:
    """The only form of a kind of leaf as JSON; empty where there are several, or none."""
    forms = species_value(editor, kind, {})
    return forms if isinstance(forms, dict) else {}


def _form(editor: bpy.types.PropertyGroup, kind: str) -> str:
    form = _forms(editor, kind)
    if "object" in form:
        return OBJECT_LEAF
    if kind == "blossom" and species_value(editor, kind, None) is None:
        return NO_LEAF
    return model if (model := form.get("model")) in LEAF_MODELS else OWN_LEAF


def _set_form(editor: bpy.types.PropertyGroup, kind: str, identifier: str) -> None:
    if identifier == OBJECT_LEAF:
        set_species_value(editor, kind, {"object": str(_forms(editor, kind).get("object") or kind.capitalize())})
    elif identifier == NO_LEAF:
        set_species_value(editor, kind, None)
    elif identifier != OWN_LEAF:  # polygons cannot be invented here
        set_species_value(editor, kind, {"model": identifier})


def _form_property(kind: str, items: list[tuple[str, str, str, int]], name: str, description: str) -> Any:
    return EnumProperty(
        name=name,
        description=description,
        items=items,
        get=lambda self: next(i for key, _, _, i in items if key == _form(self, kind)),
        set=lambda self, number: _set_form(self, kind, items[number][0]),
        options={'SKIP_SAVE'},
    )


def _object_property(kind: str) -> Any:
    return StringProperty(
        name=f"{kind.capitalize()} Object",
        description=f"Mesh object used as the {kind}: stalk at the origin, pointing along +Y, upper side facing +Z",
        get=lambda self: str(_forms(self, kind).get("object", "")),
        set=lambda self, value: set_species_value(self, kind, {"object": value}),
        options={'SKIP_SAVE'},
    )


def _transmission_property(kind: str) -> Any:
    key = f"{kind}_transmission"
    return FloatProperty(
        name=f"{kind.capitalize()} Translucency",
        description=f"Fraction of the light scattered by a {kind} that passes through it",
        subtype='FACTOR',
        min=0.0,
        max=1.0,
        get=lambda self: number_in(species_value(self, key, 0.4)),
        set=lambda self, value: set_species_value(self, key, rounded(value)),
        options={'SKIP_SAVE'},
    )


class WholeSpecies(SpeciesChoice):
    """Properties of the editor that do not come from the keys of an order."""

    order_index: IntProperty(name="Active Order", min=0, options={'HIDDEN'})
    order: EnumProperty(
        name="Order",
        description="Generation of branches to edit: 0 is the trunk, 1 grows on the trunk",
        items=_order_items,
        get=present_order,
        set=lambda self, number: setattr(self, "order_index", number),
        options={'SKIP_SAVE'},
    )
    preview_seed: IntProperty(
        name="Seed",
        description="Individual of the species to show in the preview",
        default=1,
        min=0,
        update=lambda _self, _context: tell_listeners(),
        options=set(),
    )
    species_name: StringProperty(
        name="Name",
        description="Name shown in menus; the identifier that plants refer to does not change",
        get=lambda self: str(species_value(self, "name", "")),
        set=lambda self, value: set_species_value(self, "name", value),
        options={'SKIP_SAVE'},
    )
    species_description: StringProperty(
        name="Description",
        description="Tooltip of the species in menus, in one sentence",
        get=lambda self: str(species_value(self, "description", "")),
        set=lambda self, value: set_species_value(self, "description", value),
        options={'SKIP_SAVE'},
    )
    leaf_form: _form_property("leaf", _LEAF_ITEMS, "Leaf Model", "Shape of each leaf")
    leaf_object: _object_property("leaf")
    leaf_transmission: _transmission_property("leaf")
    blossom_form: _form_property(
        "blossom", _BLOSSOM_ITEMS, "Blossom Model", "Shape of blossoms or fruit, used by orders of this Leaf Kind"
    )
    blossom_object: _object_property("blossom")
    blossom_transmission: _transmission_property("blossom")
    exact: BoolProperty(
        name="Exact Plant",
        description="Make all plants of the species identical: ignore variation and seeds",
        get=lambda self: species_value(self, "exact", False) is True,
        set=lambda self, value: set_species_value(self, "exact", value),
        options={'SKIP_SAVE'},
    )
    bark: EnumProperty(
        name="Bark",
        description="Pattern of the bark",
        items=[(name, name.capitalize(), "", number) for number, name in enumerate(BARKS)],
        get=lambda self: BARKS.index(value) if (value := species_value(self, "bark", BARKS[0])) in BARKS else 0,
        set=lambda self, number: set_species_value(self, "bark", BARKS[number]),
        options={'SKIP_SAVE'},
    )
    quality: FloatProperty(
        name="Quality",
        description="Polygon multiplier for this species: below 1 fewer, larger leaves; above 1 more, finer ones",
        min=QUALITY_LIMITS[0],
        max=QUALITY_LIMITS[1],
        soft_min=0.02,
        soft_max=10.0,
        default=1.0,
        precision=3,
        get=lambda self: number_in(species_value(self, "quality", 1.0)),
        set=lambda self, value: set_species_value(self, "quality", rounded(value)),
        options={'SKIP_SAVE'},
    )
