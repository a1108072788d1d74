# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The shell's opacity is 1 − e^{−κℓ} of the true thickness, in the mean over samples and through stacks of cells.

Black cells before a white sky: what is seen is their transmittance.
"""

import numpy as np
import pytest

from devtools import session
from tests.blender.renders import compat, picture, small_scene

pytestmark = pytest.mark.usefixtures("clean_file")

SIZE, WIDTH = 24, 2.4
# A regular tetrahedron of edge 1.63 m, all of it in view.
REGULAR = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
ISOTROPIC = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


def place(vertices, extinction, colour=0.0, transmission=0.0, normal=(0.0, 0.0, 1.0), plane=0.0, stochastic=1.0):
    """Link shells of the cells (n, 4, 3) with S (n, 6) to the scene."""
    import bpy

    count = len(vertices)
    buffers = session.part("tetflora_addon.shading.shells").shell_buffers(
        vertices,
        np.full((count, 3), colour),
        np.full(count, transmission),
        np.broadcast_to(extinction, (count, 6)),
        np.tile(normal, (count, 1)),
        np.full(count, plane),
    )
    material = session.part("tetflora_addon.blender.shell_material").shell_material()
    group = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")
    group.inputs["Stochastic"].default_value = stochastic
    group.inputs["s"].default_value = 0.0
    mesh = session.part("tetflora_addon.blender.meshes").write_mesh("shells", buffers, [material])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("shells", mesh))


def thickness(vertices, fine=4):
    """Length (n, pixel rows, columns, fine²) of vertical rays inside each convex cell, from its planes."""
    step = WIDTH / (SIZE * fine)
    across = (np.arange(SIZE * fine) + 0.5) * step - WIDTH / 2.0
    x, y = np.meshgrid(across, across)
    origin = np.stack([x, y, np.zeros_like(x)], axis=-1)
    lengths = []
    for cell in vertices:
        enter, leave = np.full(x.shape, -np.inf), np.full(x.shape, np.inf)
        for corner in range(4):
            a, b, c = np.delete(cell, corner, axis=0)
            normal = np.cross(b - a, c - a)
            normal *= np.sign(normal @ (cell[corner] - a))
            inside, slope = (origin - a) @ normal, normal[2]
            with np.errstate(divide="ignore"):
                hit = -inside / slope
            if slope > 0:
                enter = np.maximum(enter, hit)
            else:
                leave = np.minimum(leave, hit)
        lengths.append(np.maximum(leave - enter, 0.0))
    blocks = np.array(lengths).reshape(len(vertices), SIZE, fine, SIZE, fine)
    return blocks.transpose(0, 1, 3, 2, 4).reshape(len(vertices), SIZE, SIZE, fine * fine)


def transmittance(vertices, kappa):
    """Mean of e^{−Σκℓ} over each pixel."""
    return np.exp(-np.einsum("n...,n->...", thickness(vertices), np.broadcast_to(kappa, len(vertices)))).mean(axis=-1)


def prepare(samples, **changes):
    small_scene(sky=1.0, samples=samples, size=SIZE, width=WIDTH, **changes)
    import bpy

    # A box of one pixel, as the reference has.
    bpy.context.scene.cycles.pixel_filter_type = 'BOX'


def stack(count=4):
    """Cells of random shape above one another."""
    rng = np.random.default_rng(5)
    cells = rng.normal(size=(count, 4, 3)) * 0.6
    return cells + np.arange(count)[:, None, None] * [0.0, 0.0, 5.0]


@pytest.mark.parametrize("kappa", [0.3, 2.0])
def test_smooth_opacity_of_one_cell(kappa):
    cells = REGULAR[None] @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    prepare(64)
    place(cells, ISOTROPIC * kappa**2, stochastic=0.0)
    difference = picture()[..., 0] - transmittance(cells, kappa)
    assert np.sqrt((difference**2).mean()) < 0.005
    assert abs(difference.mean()) < 0.001


def test_stochastic_opacity_has_the_same_mean():
    """Samples are 0 or 1: with n of them a pixel's standard deviation is √(T(1−T)/n), and nothing else remains."""
    samples, kappa = 256, 1.0
    prepare(samples)
    place(REGULAR[None], ISOTROPIC * kappa**2)
    wanted = transmittance(REGULAR[None], kappa)
    difference = picture()[..., 0] - wanted
    inside = wanted < 0.999
    expected = np.sqrt((wanted * (1.0 - wanted))[inside].mean() / samples)
    assert np.sqrt((difference[inside] ** 2).mean()) < 1.3 * expected
    assert abs(difference[inside].mean()) < 4.0 * expected / np.sqrt(inside.sum())


def test_a_stack_multiplies():
    cells, kappa = stack(), np.array([0.4, 1.5, 0.8, 0.2])
    prepare(256)
    place(cells, ISOTROPIC * kappa[:, None] ** 2)
    difference = picture()[..., 0] - transmittance(cells, kappa)
    assert np.sqrt((difference**2).mean()) < 0.03
    assert abs(difference.mean()) < 0.003


def test_cells_that_share_a_face_leave_no_seam():
    """A cell cut in two along the view looks as the whole: entry and exit faces coincide and count once."""
    a, b, c, d = REGULAR
    middle = (a + d) / 2.0
    prepare(64)
    place(np.array([[a, b, c, middle], [middle, b, c, d]]), ISOTROPIC, stochastic=0.0)
    difference = picture()[..., 0] - transmittance(REGULAR[None], 1.0)
    assert np.abs(difference).max() < 0.02


def test_extinction_depends_on_direction():
    """κ(ω) = √(ωᵀSω): seen along z a cell of flat flakes counts √Szz, off-diagonal parts included by turning it."""
    flat = np.diag([0.04, 0.25, 2.25])
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turned = turn @ flat @ turn.T
    matrix = turned[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    prepare(64)
    place(REGULAR[None], matrix, stochastic=0.0)
    difference = picture()[..., 0] - transmittance(REGULAR[None], np.sqrt(turned[2, 2]))
    assert np.sqrt((difference**2).mean()) < 0.005


def test_far_from_the_origin():
    """Five kilometres away positions are rounded to half a millimetre, thickness is not."""
    import bpy

    away = np.array([4000.0, 3000.0, 0.0])
    prepare(64)
    bpy.context.scene.camera.location.x += away[0]
    bpy.context.scene.camera.location.y += away[1]
    place(REGULAR[None] + away, ISOTROPIC, stochastic=0.0)
    difference = picture()[..., 0] - transmittance(REGULAR[None], 1.0)
    assert np.sqrt((difference**2).mean()) < 0.01


def test_light_from_the_viewer_gives_the_colour():
    """Particles and planes that face both light and viewer: p cos φ = p cos α = p at φ = α = 0."""
    for plane in (0.0, 1.0):
        session.clean_file()
        small_scene(sky=0.0, samples=16, sun=0.0, size=SIZE, width=0.2)
        place(REGULAR[None], ISOTROPIC * 1e8, colour=0.3, plane=plane)
        np.testing.assert_allclose(picture(), 0.3, rtol=1e-3)


def test_no_more_light_than_comes_in():
    for plane, transmission in ((0.0, 0.0), (0.0, 0.5), (1.0, 0.5)):
        session.clean_file()
        prepare(64)
        place(REGULAR[None], ISOTROPIC * 1e8, colour=1.0, plane=plane, transmission=transmission)
        assert picture().max() < 1.05


def test_one_output_for_each_engine():
    material = session.part("tetflora_addon.blender.shell_material").shell_material()
    targets = sorted(n.target for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    assert targets == ['CYCLES', 'EEVEE']
    assert material.cycles.use_bump_map_correction is False
    assert all(link.is_valid for link in material.node_tree.links)


def test_eevee_shows_the_same_cloud():
    kappa = 1.5
    prepare(64, engine=compat().eevee_engine())
    place(REGULAR[None], ISOTROPIC * kappa**2)
    difference = picture()[..., 0] - transmittance(REGULAR[None], kappa)
    assert np.sqrt((difference**2).mean()) < 0.1
    assert abs(difference.mean()) < 0.02
