# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Views of viewports as cameras: matrices that draw alike give the camera that Blender's own one is read as."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.blender.scenes import add_camera
from tetflora_addon.blender.scene.camera import _camera_of, is_rendered, read_camera, view_camera, viewport_of

pytestmark = pytest.mark.usefixtures("clean_file")


@given(
    angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    place=st.tuples(*[st.floats(-100.0, 100.0)] * 3),
    lens=st.floats(10.0, 200.0),
    shift=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    kind=st.sampled_from(["PERSP", "ORTHO"]),
)
def test_the_matrices_of_a_camera_give_that_camera(angles, place, lens, shift, kind):
    camera = add_camera(location=place, rotation=angles)
    data, scene = camera.data, bpy.context.scene
    data.type, data.lens, data.ortho_scale = kind, lens, lens
    data.shift_x, data.shift_y = shift
    bpy.context.view_layer.update()
    graph, size = bpy.context.evaluated_depsgraph_get(), (scene.render.resolution_x, scene.render.resolution_y)
    projection = np.array(camera.calc_matrix_camera(graph, x=size[0], y=size[1]), np.float64)
    view = np.array(camera.matrix_world.inverted(), np.float64)
    made = _camera_of(view, projection, (data.clip_start, data.clip_end), size)
    expected = read_camera(scene, graph)
    assert made.kind == expected.kind
    assert (made.width, made.height) == (expected.width, expected.height)
    np.testing.assert_allclose(made.window, expected.window, atol=2e-4 * max(1.0, *np.abs(expected.window)))
    np.testing.assert_allclose(made.frame, expected.frame, atol=1e-5)
    behind = made.position - expected.position
    away = data.clip_end * expected.frame[:, 2] if kind == "ORTHO" else np.zeros(3)
    np.testing.assert_allclose(behind, away, atol=1e-3)
    assert 0.0 < made.near < made.far
    bpy.data.objects.remove(camera)


@pytest.fixture
def region_3d():
    """Of the only viewport; as it was afterward."""
    space, _ = viewport_of(bpy.context.scene)
    own = space.region_3d
    before = own.view_perspective
    yield own
    own.view_perspective = before


def test_the_default_viewport_is_seen_along_its_axis(region_3d):
    camera = view_camera(bpy.context.scene)
    across, up, back = (np.array(region_3d.view_location) - camera.position) @ camera.frame
    assert camera.kind == "PERSP"
    assert max(abs(across), abs(up)) < 1e-3
    assert camera.near < -back < camera.far
    assert camera.pixel_size > 0.0


def test_a_viewport_that_looks_through_the_camera_has_no_view_of_its_own(region_3d):
    region_3d.view_perspective = 'CAMERA'
    assert view_camera(bpy.context.scene) is None


def test_a_viewport_in_rendered_shading_is_the_one_even_if_it_looks_through_the_camera():
    """Beside one in another shading, where the artist works."""
    areas = bpy.context.window_manager.windows[0].screen.areas
    space, _ = viewport_of(bpy.context.scene)
    other = next(area for area in areas if area.type == 'OUTLINER')
    other.type = 'VIEW_3D'
    second = other.spaces.active
    try:
        assert not is_rendered(bpy.context.scene)
        second.region_3d.view_perspective, second.shading.type = 'CAMERA', 'RENDERED'
        assert is_rendered(bpy.context.scene) and view_camera(bpy.context.scene) is None
        second.region_3d.view_perspective = 'PERSP'
        assert viewport_of(bpy.context.scene)[0] == second
        second.shading.type = 'SOLID'
        assert viewport_of(bpy.context.scene)[0] == space
    finally:
        second.region_3d.view_perspective, second.shading.type = 'PERSP', 'SOLID'
        other.type = 'OUTLINER'
