# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators have in common that mark the selected objects, and take the mark away when called again."""

from typing import Any

import bpy
from bpy.props import EnumProperty

from .base import Reporting, counted


def action_property(mark: str, unmark: str) -> Any:
    """The property that says what happens to the mark, from descriptions of both outcomes."""
    return EnumProperty(
        name="Action",
        description="How to change the mark",
        items=(
            ('TOGGLE', "Toggle", "Mark all, or unmark them if all are marked"),
            ('MARK', "Mark", mark),
            ('UNMARK', "Unmark", unmark),
        ),
        default='TOGGLE',
        options={'SKIP_SAVE'},
    )


class Marking(Reporting):
    """Mix-in for operators with an ``action``.

    Attributes
    ----------
    mark : str
        Property of objects, in ``tetflora``, that is the mark.
    nothing : str
        Why the operator cannot be used where nothing that fits is selected.
    marked : str
        Report, with ``{}`` for the number of objects.
    """

    mark: str
    nothing: str
    marked: str

    @staticmethod
    def fits(obj: bpy.types.Object) -> bool:
        """Whether an object may bear the mark."""
        raise NotImplementedError

    @classmethod
    def _chosen(cls, context: bpy.types.Context) -> list[bpy.types.Object]:
        # Something marked that has since become something else can still be unmarked.
        return [o for o in context.selected_objects if cls.fits(o) or getattr(o.tetflora, cls.mark)]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if cls._chosen(context):
            return True
        cls.poll_message_set(cls.nothing)
        return False

    def run(self, context: bpy.types.Context) -> set[str]:
        chosen = self._chosen(context)
        all_marked = all(getattr(o.tetflora, self.mark) for o in chosen)
        wanted = self.action == 'MARK' or (self.action == 'TOGGLE' and not all_marked)
        for obj in chosen:
            setattr(obj.tetflora, self.mark, wanted and self.fits(obj))
        number = counted(len(chosen), "object")
        self.report({'INFO'}, self.marked.format(number) if wanted else f"{number} unmarked")
        return {'FINISHED'}
