# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which version of the layout of properties a file has. A later version adds steps from earlier ones here."""

import sys

import bpy

VERSION = 2


def migrate() -> None:
    """Stamp all plants, fields, occluders and scenes of the open file with the version of this layout.

    What a newer TetFlora saved is left alone and reported on stderr. Linked data belongs to another file.
    """
    owners = [o for o in bpy.data.objects if o.tetflora.is_plant or o.tetflora.is_field or o.tetflora.is_occluder]
    owners += [s for s in bpy.data.scenes if s.is_property_set("tetflora")]
    newer = 0
    for owner in owners:
        if owner.tetflora.version > VERSION:
            newer += 1
        elif owner.library is None and owner.tetflora.version < VERSION:
            owner.tetflora.version = VERSION
    if newer:
        print(
            f"TetFlora: a newer version saved {newer} of this file's objects and scenes; update the extension",
            file=sys.stderr,
        )
