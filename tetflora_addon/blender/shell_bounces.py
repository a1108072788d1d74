# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Transparent bounces of Cycles: a ray passes two faces of each shell, and what it cannot follow to its end is black.

Shells by baked light need as many as others do. EEVEE knows no bounces.
"""

from __future__ import annotations

import bpy

#: Bounces that shells get while TetFlora renders by itself, and those under which the artist is warned.
SHELL_BOUNCES, FEW_BOUNCES = 256, 128
#: Settings of Cycles: where rays end, and up to where none is given up at random. Below that number Cycles follows
#: rays through what is transparent to their ends; beyond it, light that has become weak goes on by chance, as noise.
_SETTINGS = ("transparent_max_bounces", "min_transparent_bounces")


def raise_bounces(scene: bpy.types.Scene) -> dict[str, int]:
    """Raise what is too low for a scene's shells.

    Returns
    -------
    dict of str to int
        Settings of ``scene.cycles`` that were changed, as they were.
    """
    cycles = getattr(scene, "cycles", None)
    if scene.tetflora.proxy_form != 'SHELLS' or scene.tetflora.expand_everything or cycles is None:
        return {}
    before = {name: getattr(cycles, name) for name in _SETTINGS if getattr(cycles, name, SHELL_BOUNCES) < SHELL_BOUNCES}
    for name in before:
        setattr(cycles, name, SHELL_BOUNCES)
    return before


def few_bounces(scene: bpy.types.Scene) -> str:
    """A warning if the scene's own bounces are too few for its shells, else an empty text."""
    cycles = getattr(scene, "cycles", None)
    if scene.tetflora.proxy_form != 'SHELLS' or scene.render.engine != 'CYCLES' or cycles is None:
        return ""
    if cycles.transparent_max_bounces >= FEW_BOUNCES:
        return ""
    return (
        f"Cycles renders shells black with {cycles.transparent_max_bounces} transparent bounces; raise Render > "
        f"Light Paths > Max Bounces > Transparent to {SHELL_BOUNCES}"
    )
