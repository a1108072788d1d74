# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights as they are read for their shadows."""

from __future__ import annotations

from math import radians

import bpy
import numpy as np
import pytest

from tests.blender.scenes import depsgraph
from tetflora_addon.blender.scene.lights import read_lights

pytestmark = pytest.mark.usefixtures("clean_file")


def _add(name, kind, **properties):
    obj = bpy.data.objects.new(name, bpy.data.lights.new(name, kind))
    for key, value in properties.items():
        setattr(obj.data, key, value)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _read():
    return read_lights(depsgraph())


def test_every_kind_of_light_is_read_by_name():
    _add("a", 'SUN', angle=0.02).rotation_euler = (radians(90), 0.0, 0.0)
    _add("b", 'SPOT', spot_size=1.0, shadow_soft_size=0.1).location = (1.0, 2.0, 3.0)
    _add("c", 'AREA', shape='RECTANGLE', size=0.5, size_y=2.0)
    _add("d", 'POINT', shadow_soft_size=0.25)
    lights = _read()
    assert [light.kind for light in lights] == ['SUN', 'SPOT', 'AREA', 'POINT']
    assert [light.width for light in lights] == pytest.approx([0.02, 0.2, 2.0, 0.5])
    assert lights[0].direction == pytest.approx((0.0, 1.0, 0.0), abs=1e-6)
    assert lights[1].position == pytest.approx((1.0, 2.0, 3.0))
    assert lights[1].angle == pytest.approx(0.5)
    assert all(np.linalg.norm(light.direction) == pytest.approx(1.0) for light in lights)


def test_dark_and_lost_lights_are_left_out():
    _add("dark", 'SUN', energy=0.0)
    _add("black", 'SUN', color=(0.0, 0.0, 0.0))
    _add("hidden", 'POINT').hide_render = True
    _add("nowhere", 'POINT').scale = (0.0, 0.0, 0.0)
    assert _read() == ()


def test_lights_without_shadows_say_so():
    _add("a", 'POINT', use_shadow=False)
    _add("b", 'POINT')
    assert [light.shadow for light in _read()] == [False, True]
