# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Crowns for panels are found in the background; a species without one gets a guess and is not asked for again."""

from __future__ import annotations

import time
from dataclasses import replace

import bpy
import pytest

from tetflora_addon.blender.scene import crowns
from tetflora_addon.blender.species.edits import species_for
from tetflora_addon.compiled.sizes import crown_of, known_crown
from tetflora_addon.errors import SpeciesError


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> list:
    """As in a window; timers are called by the test."""
    called = []
    monkeypatch.setattr(crowns, "_in_background", lambda: False)
    monkeypatch.setattr(crowns, "call_soon", lambda function, seconds: called.append(function))
    return called


def look(called: list) -> None:
    """Call what was to be called soon until it needs no more."""
    end = time.monotonic() + 20.0
    while called[-1]() is not None:
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_panel_does_not_wait(window: list, monkeypatch: pytest.MonkeyPatch) -> None:
    species = replace(species_for(None, "rowan"), name="Never compiled before")
    monkeypatch.setattr(crowns, "species_for", lambda *_: species)
    scene = bpy.context.scene
    assert crowns.crown_to_draw(scene, "rowan") is None and known_crown(species) is None
    assert crowns.crown_to_draw(scene, "rowan") is None
    look(window)
    assert crowns.crown_to_draw(scene, "rowan") == crowns.crown_for(scene, "rowan") == crown_of(species)


def test_an_estimate_gets_crowns_whose_leaves_are_prepared(window: list, monkeypatch: pytest.MonkeyPatch) -> None:
    """How finely leaves may be drawn takes longer than the crown; a window stood still for it."""
    species = replace(species_for(None, "rowan"), name="Compiled, but not prepared")
    monkeypatch.setattr(crowns, "species_for", lambda *_: species)
    crown_of(species)
    scene = bpy.context.scene
    assert crowns.crown_to_draw(scene, "rowan") is not None
    assert crowns.crown_to_draw(scene, "rowan", prepared=True) is None
    look(window)
    assert crowns.crown_to_draw(scene, "rowan", prepared=True) == crown_of(species)


def test_what_cannot_be_compiled_is_guessed(window: list, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_: object) -> None:
        raise SpeciesError("an object for a leaf")

    species = replace(species_for(None, "rowan"), name="With an object for a leaf")
    monkeypatch.setattr(crowns, "species_for", lambda *_: species)
    monkeypatch.setattr(crowns, "prepare", fails)
    assert crowns.crown_to_draw(bpy.context.scene, "rowan") is None
    look(window)
    asked = len(window)
    guess = crowns.crown_to_draw(bpy.context.scene, "rowan")
    assert guess.height > guess.radius > 0.0 and len(window) == asked


def test_nobody_waits_without_a_window() -> None:
    scene = bpy.context.scene
    assert crowns.crown_to_draw(scene, "birch") == crowns.crown_for(scene, "birch")
