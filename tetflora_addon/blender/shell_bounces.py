# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Transparent bounces of Cycles: a ray passes two faces of each shell, and is black where it runs out of bounces.

Shells with baked light need as many. EEVEE has no bounces.
"""

from __future__ import annotations

import bpy

from .proxy_forms import form_of

#: Fraction of a form's bounces below which the artist is warned.
FEW = 0.5
#: Settings of Cycles: where rays end, and up to where none is given up at random. Below that number Cycles follows
#: rays through what is transparent to their ends; beyond it, light that has become weak goes on by chance, as noise.
_SETTINGS = ("transparent_max_bounces", "min_transparent_bounces")


def raise_bounces(scene: bpy.types.Scene) -> dict[str, int]:
    """Raise what is too low for a scene's proxies.

    Returns
    -------
    dict of str to int
        Settings of ``scene.cycles`` that were changed, as they were.
    """
    cycles, bounces = getattr(scene, "cycles", None), form_of(scene).bounces
    if scene.tetflora.expand_everything or cycles is None:
        return {}
    before = {name: getattr(cycles, name) for name in _SETTINGS if getattr(cycles, name, bounces) < bounces}
    for name in before:
        setattr(cycles, name, bounces)
    return before


def few_bounces(scene: bpy.types.Scene) -> str:
    """A warning if the scene's own bounces are too few for its proxies, else an empty text."""
    cycles, form = getattr(scene, "cycles", None), form_of(scene)
    if scene.render.engine != 'CYCLES' or cycles is None or cycles.transparent_max_bounces >= FEW * form.bounces:
        return ""
    return (
        f"Cycles renders {form.label.lower()} black with {cycles.transparent_max_bounces} transparent bounces; "
        f"raise Render > Light Paths > Max Bounces > Transparent to {form.bounces}"
    )
