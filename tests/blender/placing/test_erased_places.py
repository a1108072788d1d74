# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the brush takes from a population stays away when it is placed anew, and nothing else does."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, select

pytestmark = pytest.mark.usefixtures("clean_file")

MIDDLE, RADIUS = (3.0, -2.0, 0.0), 4.0


def _scene():
    return bpy.context.scene


def _population():
    return _scene().tetflora.layers[0]


def _places():
    """Places of the population's plants on the map, empties or field, in an order of their own."""
    found = []
    for obj in _scene().objects:
        if obj.tetflora.is_plant:
            found.append(obj.location[:2])
        elif obj.tetflora.is_field:
            found += [(obj.matrix_world @ v.co)[:2] for v in obj.data.vertices]
    found = np.array(found).reshape(-1, 2)
    return found[np.lexsort(found.T)]


def _populate(as_field='EMPTIES'):
    select(add_mesh("ground", size=15.0))
    bpy.ops.tetflora.populate(count=150, species="bush", min_distance=0.5, as_field=as_field)
    bpy.context.view_layer.update()
    return _places()


def _stroke(mode='ERASE', **changes):
    for name, value in {"radius": RADIUS, "strength": 1.0, **changes}.items():
        setattr(_scene().tetflora.brush, name, value)
    bpy.context.view_layer.update()
    bpy.ops.tetflora.paint_plants(mode=mode, stroke=" ".join(map(str, MIDDLE)))
    bpy.context.view_layer.update()
    return _places()


def _update(**options):
    bpy.ops.tetflora.update_layers(which='ACTIVE', **options)
    bpy.context.view_layer.update()
    return _places()


def _inside(places):
    return np.linalg.norm(places - MIDDLE[:2], axis=1) <= RADIUS


@pytest.mark.parametrize("as_field", ['EMPTIES', 'FIELD'])
def test_an_update_brings_nothing_back_and_changes_nothing_else(as_field, capfd):
    before = _populate(as_field)
    gone = int(_inside(before).sum())
    assert gone > 3
    left = _stroke()
    assert np.allclose(left, before[~_inside(before)])
    assert _population().made == len(left)
    assert np.allclose(_update(), left, atol=1e-5)
    assert _population().made == len(left)
    reported = capfd.readouterr().out
    assert f"{gone} omitted where you erased" in reported
    assert "restored" not in reported


def test_the_ground_stays_bare_in_other_arrangements_too():
    _populate()
    _stroke()
    _population().count = 600
    assert not _inside(_update()).any()
    assert not _inside(_update(reroll=True)).any()
    assert len(_places()) > 300


@pytest.mark.parametrize("how", [{"mode": 'THIN', "density": 2.0}, {"mode": 'ERASE', "strength": 0.4}])
def test_what_is_thinned_stays_away_one_by_one(how):
    before = _populate()
    left = _stroke(**how)
    assert 0 < _inside(left).sum() < _inside(before).sum()
    assert np.allclose(_update(), left)


def test_plants_by_hand_and_other_populations_are_not_asked():
    _populate()
    erased = _population().erased
    _scene().tetflora.layers.add().uid = "another"
    _stroke()
    assert not erased
    assert _population().erased
    assert not _scene().tetflora.layers[1].erased
    _stroke('PAINT', density=20.0)
    painted = _inside(_places()).sum()
    assert painted > 3
    assert _inside(_update()).sum() == painted
    assert bpy.ops.tetflora.update_layers(which='ACTIVE', forget_erased=True) == {'FINISHED'}


def test_places_can_be_forgotten():
    before = _populate()
    _stroke()
    assert np.allclose(_update(forget_erased=True), before)
    assert not _population().erased
