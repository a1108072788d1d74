# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender and the extension are there before the tests are collected, so they import both at the top of the file."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from devtools import session

session.start()


@pytest.fixture(autouse=True)
def quickly_refined(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Small images get facets no finer than asked for, and bark and leaves no pattern: both are most of a refinement.
    Of assets one cluster is looked at from one side, to see how much of its facets lies behind others.

    Not where a test or its file is marked ``fine``: there results are what artists get.
    """
    if request.node.get_closest_marker("fine"):
        return
    from tetflora_addon.assets import compiled
    from tetflora_addon.blender.materials import blade, materials
    from tetflora_addon.emission import budget

    monkeypatch.setattr(budget, "FINEST", 1.0)
    monkeypatch.setattr(compiled, "CLUSTERS", 1)
    monkeypatch.setattr(compiled, "DIRECTIONS", compiled.DIRECTIONS[:1])
    monkeypatch.setattr(materials, "bark_group", _plain_bark)
    monkeypatch.setattr(blade, "_built", _plain_blade)


@pytest.fixture(autouse=True)
def thumbnails_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in the window, where it is a second: else each menu of species that is read takes 5 ms, a button up to 20."""
    from tetflora_addon.blender.species import catalog

    monkeypatch.setattr(catalog, "_TRUSTED", float("inf"))


@pytest.fixture
def thumbnails_looked_for(thumbnails_looked_for_once: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Anew each time, for tests of them."""
    from tetflora_addon.blender.species import catalog

    monkeypatch.setattr(catalog, "_TRUSTED", 0.0)


def _plain_bark(character: str) -> Any:
    """The group of a bark, of its color all over."""
    from tetflora_addon.blender.materials import bark, nodes

    def build(graph: Any, given: dict[str, Any]) -> dict[str, Any]:
        normal = graph.outputs("ShaderNodeNewGeometry")["Normal"]
        return {"Color": given["Color"], "Normal": normal, "Gain": 1.0, "Shown": 0.0}

    outputs = (("Color", 'Color'), ("Normal", 'Vector'), ("Gain", 'Float'), ("Shown", 'Float'))
    name, color = f"TetFlora {character.capitalize()} Bark", (("Color", 'Color'),)
    return nodes.node_group(name, bark._VERSION, color, outputs, build)


def _plain_blade(graph: Any, given: dict[str, Any], _name: str, _blade: object) -> dict[str, Any]:
    """What the outputs of a leaf blade's group are linked to, without veins."""
    normal = graph.outputs("ShaderNodeNewGeometry")["Normal"]
    return {"Reflected": given["Color"], "Through": given["Color"], "Normal": normal} | {
        name: given[name] for name in ("Gloss", "Roughness")
    }


@pytest.fixture
def coarsely_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Levels of exported plants follow from views of few cells, for tests of files: their colors are none of it.

    Textures are a quarter as wide.
    """
    from tetflora_addon.blender.export import surfaces
    from tetflora_addon.export import images, levels, opaque

    for module in (images, surfaces):
        monkeypatch.setattr(module, "TEXELS", 64)
    monkeypatch.setattr(images, "MARGIN", 2)
    monkeypatch.setattr(opaque, "_CELLS", 48)
    monkeypatch.setattr(levels, "_FEWEST_CELLS", 40)
    monkeypatch.setattr(levels, "_MOST_CELLS", 80)


@pytest.fixture
def keep_memory() -> Iterator[Callable[[float], None]]:
    """Sets the size of the frame cache in the preferences, in gigabytes, for one test."""
    from tetflora_addon.blender import preferences

    own = preferences.preferences()
    before = own.kept_memory
    yield lambda gigabytes: setattr(own, "kept_memory", gigabytes)
    own.kept_memory = before
