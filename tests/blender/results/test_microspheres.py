# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Microspheres in the scene: made, counted, replaced and cleared like any other form, and shaded as spheres."""

from __future__ import annotations

import json

import bpy
import numpy as np
import pytest

from tests.blender.job.test_refine import _forest, _made, _refine
from tests.blender.renders import picture, small_scene
from tests.blender.scenes import datablocks, tiny_render
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.materials import materials
from tetflora_addon.blender.results import meshes

pytestmark = pytest.mark.usefixtures("clean_file")


def _proxies(scene):
    return [o for o in _made(scene) if o["tetflora_kind"] == "proxy"]


def _points(made):
    """Attributes of the points that are drawn."""
    evaluated = made.evaluated_get(bpy.context.evaluated_depsgraph_get())
    geometry = evaluated.evaluated_geometry()  # keeps the cloud alive
    cloud = geometry.pointcloud
    found = {}
    for name, size in (("position", 3), ("radius", 1), ("tf_color", 3), ("tf_transmission", 1)):
        values = np.zeros((len(cloud.points), size), np.float32)
        cloud.attributes[name].data.foreach_get("vector" if size == 3 else "value", values.reshape(-1))
        found[name] = values if size == 3 else values[:, 0]
    return found, [m.name for m in cloud.materials]


def test_spheres_take_the_places_of_facets_and_clear_removes_them():
    scene = _forest()
    scene.render.engine = 'CYCLES'
    before = datablocks()
    facets = _refine(scene, proxy_kind='MICROSURFACES')
    mesh = _proxies(scene)[0].data
    places = np.zeros((len(mesh.vertices), 3), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", places.reshape(-1))
    places = places.reshape(-1, 3, 3).mean(axis=1)
    spheres = _refine(scene, proxy_kind='MICROSPHERES')
    assert spheres.polygons_proxy == facets.polygons_proxy == len(places)
    assert spheres.facet_pixels == facets.facet_pixels
    assert spheres.memory_mb < facets.memory_mb
    (made,) = _proxies(scene)
    points, materials = _points(made)
    assert materials == ["TetFlora microsphere"]
    assert points["position"] == pytest.approx(places, abs=1e-4)
    assert points["radius"].min() > 0
    assert 0 <= points["tf_color"].min() <= points["tf_color"].max() <= 1
    assert len(np.unique(points["tf_transmission"])) == 2  # wood and leaves
    scene.render.engine = compat.eevee_engine()  # which draws less of a sphere
    _refine(scene)
    assert len(_proxies(scene)) == 1
    larger, _ = _points(_proxies(scene)[0])
    assert larger["radius"] == pytest.approx(points["radius"] * np.sqrt(np.pi / 2), rel=1e-4)
    assert refine.clear(scene) > 3
    assert datablocks() == before
    assert not bpy.data.pointclouds


def test_refine_at_render_takes_spheres_back():

    scene = _forest()
    tiny_render(size=160)
    scene.tetflora.proxy_kind, scene.tetflora.refine_at_render = 'MICROSPHERES', True
    before = datablocks()
    bpy.ops.render.render()
    assert json.loads(scene.tetflora.statistics)["polygons_proxy"] > 0
    assert datablocks() == before


def test_the_group_for_vertices_makes_the_same_points(monkeypatch):
    """What versions without `PointCloud.resize` use works on all."""
    random = np.random.default_rng(1)
    color, radius = random.random((5, 3), np.float32), random.random(5, np.float32)
    buffers = meshes.PointBuffers(
        random.random((5, 3), np.float32), radius, {"tf_color": color, "tf_transmission": radius / 2}
    )
    material = materials.sphere_material()
    for by_nodes in {True, not compat.can_resize_point_clouds()}:
        monkeypatch.setattr(meshes, "can_resize_point_clouds", lambda: not by_nodes)  # noqa: B023
        made = meshes.point_object("spheres", buffers, material)
        bpy.context.collection.objects.link(made)
        points, names = _points(made)
        assert names == [material.name]
        assert (points["position"] == buffers.positions).all()
        assert (points["radius"] == radius).all()
        assert (points["tf_color"] == color).all()
        assert (points["tf_transmission"] == radius / 2).all()


def test_what_was_written_wrongly_leaves_nothing_behind():
    materials.sphere_material()
    before = datablocks()
    wrong = meshes.PointBuffers(np.zeros((4, 3), np.float32), np.ones(3, np.float32))
    with pytest.raises(ValueError, match="radius"):
        meshes.point_object("spheres", wrong, materials.sphere_material())
    assert datablocks() == before


@pytest.mark.parametrize("transmission", [0.0, 0.5])
def test_white_spheres_vanish_before_a_white_sky(transmission):
    """What falls on a sphere comes back from it, through it or from its surface, and nothing else does."""

    small_scene(sky=1.0, samples=64)
    white = {"tf_color": np.ones((1, 3), np.float32), "tf_transmission": np.full(1, transmission, np.float32)}
    buffers = meshes.PointBuffers(np.zeros((1, 3), np.float32), np.full(1, 1.5, np.float32), white)
    made = meshes.point_object("sphere", buffers, materials.sphere_material())
    bpy.context.collection.objects.link(made)
    assert picture()[..., 0].mean() == pytest.approx(1.0, abs=0.01)
