# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A layout that records what is drawn where Blender has no window, and refuses what Blender's own would refuse."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy

_FUNCTIONS = bpy.types.UILayout.bl_rna.functions
_SETTINGS = {p.identifier for p in bpy.types.UILayout.bl_rna.properties}
_ICONS = set(_FUNCTIONS["label"].parameters["icon"].enum_items.keys())


class Layout:
    """Stands for `bpy.types.UILayout`; its parts share one record.

    Attributes
    ----------
    drawn : list of (str, tuple, dict)
        Function, and its arguments, in the order of the calls.
    beside : list of str
        Labels of settings that stand to the left of their values, where they have less room than elsewhere.
    """

    use_property_split = False

    def __init__(self, above: Layout | None = None) -> None:
        self.drawn = [] if above is None else above.drawn
        self.beside = [] if above is None else above.beside
        if above is not None:
            self.use_property_split = above.use_property_split

    def __setattr__(self, name: str, value: Any) -> None:
        assert name in {"drawn", "beside"} or name in _SETTINGS, f"UILayout has no setting {name}"
        super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        assert name in _FUNCTIONS, f"UILayout has no function {name}"
        parameters = _FUNCTIONS[name].parameters

        def call(*arguments: Any, **options: Any) -> Any:
            assert set(options) <= set(parameters.keys()), f"{name} does not take {set(options)}"
            assert options.get("icon", 'NONE') in _ICONS, options["icon"]
            if name in {"prop", "prop_search"}:
                owner, prop = arguments[:2]
                assert prop in owner.bl_rna.properties, f"{owner} has no property {prop}"
            self.drawn.append((name, arguments, options))
            if name in {"prop", "prop_search"} and self.use_property_split:
                shown = owner.bl_rna.properties[prop]
                if shown.type != 'BOOLEAN':  # its label is to the right
                    self.beside.append(options.get("text", shown.name))
            return self._result(name, arguments)

        return call

    def _result(self, name: str, arguments: tuple) -> Any:
        if name == "panel":
            return Layout(self), Layout(self)
        if name != "operator":
            return Layout(self)
        group, operator = arguments[0].split(".")
        known = getattr(getattr(bpy.ops, group), operator).get_rna_type().properties.keys()
        return _Operator(frozenset(known))

    def names(self, function: str, place: int = 0) -> list[str]:
        """An argument of all calls of a function."""
        return [arguments[place] for name, arguments, _ in self.drawn if name == function]


class _Operator(SimpleNamespace):
    """Properties of an operator's button."""

    def __init__(self, known: frozenset[str]) -> None:
        self.__dict__["known"] = known

    def __setattr__(self, name: str, value: Any) -> None:
        assert name in self.known, f"the operator has no property {name}"
        super().__setattr__(name, value)
