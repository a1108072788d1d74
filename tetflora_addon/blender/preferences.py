# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: where the user's own species are, what new scenes begin with, and the keys."""

from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ..errors import SpeciesError
from . import keymaps

# Blender files preferences under the name of the extension's root package, two levels above this one. Only the name
# is needed; nothing in tetflora_addon imports what lies above it.
ROOT_PACKAGE = __package__.rsplit(".", 2)[0]


class TetFloraPreferences(bpy.types.AddonPreferences):
    """What belongs to the user and not to a scene."""

    bl_idname = ROOT_PACKAGE

    species_folder: StringProperty(
        name="Species Folder",
        description=(
            "Folder of your own species files (*.json); without one, a folder beside your Blender settings. "
            "A file there replaces a shipped species of the same file name. "
            "Scenes store only the name of a species: whoever renders a scene needs the same files"
        ),
        subtype='DIR_PATH',
        default="",
    )
    new_quality: EnumProperty(
        name="Quality of New Scenes",
        description="Quality of refinement that a scene gets with its first plant; the Refinement panel changes it",
        items=(
            ('DRAFT', "Draft", "Seconds, for placing plants; some 30 times fewer polygons than Final"),
            ('PREVIEW', "Preview", "For judging light and colours"),
            ('FINAL', "Final", "For the picture: what is left out cannot be seen"),
        ),
        default='FINAL',
    )
    new_memory: FloatProperty(
        name="Memory of New Scenes",
        description=(
            "Gigabytes that refined plants may take in a scene that is new, in Blender and the renderer together: its "
            "Most Memory. 0 for no limit; with one, plants become coarser where they would not fit"
        ),
        default=0.0,
        min=0.0,
        soft_max=64.0,
        precision=1,
    )

    def draw(self, context: bpy.types.Context) -> None:
        """The page in Preferences > Add-ons."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "species_folder")
        if self.species_folder and not species_folders():
            layout.label(text="This folder does not exist", icon='ERROR')
        layout.prop(self, "new_quality")
        layout.prop(self, "new_memory")
        _draw_keys(layout, context)


def _draw_keys(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Our keys as in Preferences > Keymap, to be changed here."""
    import rna_keymap_ui  # Blender's own; only there while its interface is

    column = layout.column()
    column.label(text=f"Keys in {keymaps.KEYMAP}")
    config = context.window_manager.keyconfigs.user
    for keymap, item in keymaps.items():
        column.context_pointer_set("keymap", keymap)
        rna_keymap_ui.draw_kmi([], config, keymap, item, column, 0)


def preferences() -> TetFloraPreferences | None:
    """The user's preferences; None outside of an extension."""
    addon = bpy.context.preferences.addons.get(ROOT_PACKAGE)
    return None if addon is None else addon.preferences


def species_folders() -> tuple[Path, ...]:
    """Folders of the user's own species that exist, for the catalogue's functions; empty outside of an extension."""
    folder = _species_folder(create=False)
    return (folder,) if folder is not None and folder.is_dir() else ()


def own_species_folder() -> Path:
    """The folder that the user's own species are saved in, made if there is none.

    Raises
    ------
    SpeciesError
        It cannot be made, or this is no installed extension.
    """
    try:
        folder = _species_folder(create=True)
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SpeciesError(f"The species folder cannot be made: {error}; name another in the preferences") from None
    if folder is None:
        raise SpeciesError("There is no folder for your own species; name one in TetFlora's preferences")
    return folder


def _species_folder(create: bool) -> Path | None:
    addon = bpy.context.preferences.addons.get(ROOT_PACKAGE)
    if addon is None or addon.preferences is None:
        return None
    if addon.preferences.species_folder:
        return Path(bpy.path.abspath(addon.preferences.species_folder))
    try:
        return Path(bpy.utils.extension_path_user(ROOT_PACKAGE, path="species", create=create))
    except ValueError:  # an add-on of the old kind has no such folder
        return None


def register() -> None:
    """Register the preferences."""
    bpy.utils.register_class(TetFloraPreferences)


def unregister() -> None:
    """Unregister the preferences."""
    bpy.utils.unregister_class(TetFloraPreferences)
