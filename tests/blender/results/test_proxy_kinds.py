# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of proxy kinds: a row added from outside is a form like any other, and every row keeps the rules."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_plant, datablocks, depsgraph
from tetflora_addon.blender import properties
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.materials import materials
from tetflora_addon.blender.results import proxy_kinds
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.emission.emitters import ProxyEmitter
from tetflora_addon.light.illumination import baked_attributes
from tetflora_addon.refinement.decisions import Decision

TOY, NUMBER = 'TRIANGLES', 1700


@pytest.fixture
def scene(clean_file):
    """A bush that the leaf limit makes proxies, for the most part."""
    add_camera(location=(0.0, -50.0, 1.3))
    add_plant("bush", "bush")
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.tetflora.leaf_limit = 2.5
    return scene


def triangles(refined, light=None, _first_sheet=0):
    """One face of each proxy tetrahedron, with the mean light of its contents."""
    result = refined.refinement
    proxies = np.isin(result.decision, (Decision.PROXY, Decision.HIDDEN))
    corners = result.tree.vertices(result.nodes[proxies])[:, :3].reshape(-1, 3).astype(np.float32)
    index = np.arange(len(corners), dtype=np.int32)
    attributes = {"tf_transmission": ('FACE', np.zeros(len(corners) // 3, np.float32))}
    if light is not None:
        mean = light.illumination.cell_sources(light.camera)[proxies].mean(axis=1)
        attributes |= baked_attributes('FACE', mean)
    following = np.where(index % 3 == 2, index - 2, index + 1).astype(np.int32)
    yield MeshBuffers(
        positions=corners,
        edge_verts=np.stack([index, following], axis=1),
        corner_verts=index,
        corner_edges=index,
        face_offsets=np.arange(0, len(index) + 1, 3, dtype=np.int32),
        attributes=attributes,
    )


def material():
    return bpy.data.materials.get("toy") or bpy.data.materials.new("toy")


def row(baked: bool = True, **changed):
    """The one row that a new form takes."""
    emission = ProxyEmitter(blocks=triangles, baked_blocks=triangles if baked else None, faces=1.0, proxy_block=4.0)
    about = {
        "identifier": TOY,
        "number": NUMBER,
        "label": "Triangles",
        "description": "One triangle for each tetrahedron",
        "icon": 'MESH_CONE',
        "emission": emission,
        "material": material,
    }
    return proxy_kinds.ProxyKind(**about | changed)


@pytest.fixture
def toy(request):
    """The form is there; the parameter tells whether it has baked light."""
    form = row(getattr(request, "param", True))
    proxy_kinds.register_proxy_kind(form)
    yield form
    proxy_kinds.unregister_proxy_kind(TOY)


def items(scene) -> dict[str, int]:
    return {item.identifier: item.value for item in scene.tetflora.bl_rna.properties["proxy_kind"].enum_items}


def refined(scene, **settings):
    for name, value in settings.items():
        setattr(scene.tetflora, name, value)
    return refine.refine(scene, depsgraph())


def proxies(scene):
    return [obj for obj in scene.objects if obj.get("tetflora_kind") == "proxy"]


@pytest.mark.parametrize("lighting", ['OFF', 'PROXIES', 'ALL'])
@pytest.mark.parametrize("toy", [True, False], indirect=True, ids=["baked", "never baked"])
def test_a_row_from_outside_is_a_form_like_any_other(scene, toy, lighting):
    assert items(scene)[TOY] == NUMBER
    material()  # which is the test's own, so that Clear leaves it
    before = datablocks()
    statistics = refined(scene, proxy_kind=TOY, baked_light=lighting)
    (made,) = proxies(scene)
    assert len(made.data.polygons) == statistics.tetrahedra_proxy == statistics.polygons_proxy > 10
    assert {len(face.vertices) for face in made.data.polygons} == {3}
    assert statistics.facet_pixels == 0.0
    baked = lighting != 'OFF' and toy.emission.baked_blocks is not None
    assert made.data.materials[0].name == (materials.BAKED if baked else "toy")
    assert ("tf_light_front" in made.data.attributes) == baked
    refine.clear(scene)
    assert datablocks() == before


def test_its_faces_count_in_the_budget(scene, toy):
    free = refined(scene, proxy_kind=TOY, leaf_limit=0.1)
    whole = free.polygons_meshed + free.polygons_proxy
    assert free.polygons_meshed > 100
    fitted = refined(scene, max_polygons=whole // 2)
    assert 0 < fitted.polygons_meshed + fitted.polygons_proxy <= whole // 2


def test_values_that_files_hold_stay_while_forms_come_and_go(scene, tmp_path):
    numbers = {'MICROSURFACES': 0, 'SHELLS': 1, 'MICROSPHERES': 2, 'AUTOMATIC': 3}
    assert items(scene) == numbers
    assert scene.tetflora.proxy_kind == proxy_kinds.proxy_kind_of(scene).identifier == 'AUTOMATIC'
    scene.tetflora.proxy_kind = 'SHELLS'
    proxy_kinds.register_proxy_kind(row())
    assert (scene.tetflora.proxy_kind, items(scene)) == ('SHELLS', {**numbers, TOY: NUMBER})
    scene.tetflora.proxy_kind = TOY
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "toy.blend"))
    proxy_kinds.unregister_proxy_kind(TOY)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "toy.blend"))
    scene = bpy.context.scene
    assert items(scene) == numbers
    assert proxy_kinds.proxy_kind_of(scene).identifier == 'AUTOMATIC'  # of an add-on that is not there
    assert refined(scene).polygons_proxy > 0
    proxy_kinds.register_proxy_kind(row())
    assert scene.tetflora.proxy_kind == proxy_kinds.proxy_kind_of(scene).identifier == TOY
    proxy_kinds.unregister_proxy_kind(TOY)


def test_forms_stay_while_the_extension_is_disabled(scene, toy):
    properties.unregister()
    properties.register()
    assert items(scene)[TOY] == NUMBER
    scene.tetflora.proxy_kind = TOY
    assert proxy_kinds.proxy_kind_of(scene).identifier == TOY


@pytest.mark.parametrize("changed", [{"identifier": 'SHELLS'}, {"number": 2}])
def test_what_is_taken_is_refused(scene, changed):
    before = items(scene)
    with pytest.raises(ValueError, match=r"Triangles: the proxy kind (Shells|Microspheres) has the same"):
        proxy_kinds.register_proxy_kind(row(**changed))
    assert items(scene) == before


def points_of(obj):
    """Points of a cloud, which are vertices of a mesh where Python cannot resize clouds; none of other meshes."""
    if obj.type == 'POINTCLOUD':
        return obj.data.points
    return () if len(obj.data.polygons) else obj.data.vertices


@pytest.mark.parametrize("lighting", ['OFF', 'PROXIES'])
def test_each_form_refines_and_clear_removes_it(scene, toy, lighting):
    material()
    before = datablocks()
    for form in proxy_kinds.forms():
        statistics = refined(scene, proxy_kind=form.identifier, baked_light=lighting)
        made = proxies(scene)
        assert made, form
        faces = sum(len(points_of(o) or o.data.polygons) for o in made)
        assert faces == statistics.polygons_proxy > 0, form
        assert (statistics.facet_pixels > 0) == form.emission.facets, form
        if not form.emission.facets:
            assert faces == form.emission.faces * statistics.tetrahedra_proxy, form
        for obj in made:
            lit = form.point_material if points_of(obj) else form.material
            make = form.baked_material if lighting == 'PROXIES' else lit
            assert obj.data.materials[:] == [make()], form
        for name, setting in form.sockets.items():
            assert setting in scene.tetflora.bl_rna.properties, name
        scene.cycles.transparent_max_bounces, scene.render.engine = 8, 'CYCLES'
        assert bool(proxy_kinds.few_bounces(scene)) == (form.bounces > 16), form
        refine.clear(scene)
        assert datablocks() == before, form
