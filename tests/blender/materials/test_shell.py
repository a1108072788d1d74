# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The shell's opacity is 1 − e^{−κℓ} of the true thickness, in the mean over samples and through stacks of cells.

Black cells before a white sky: what is seen is their transmittance.
"""

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.renders import picture, small_scene
from tetflora_addon.blender import compat
from tetflora_addon.blender.materials import microsphere
from tetflora_addon.blender.results import meshes
from tetflora_addon.emission import shells
from tetflora_addon.light.receivers import MediumCells
from tetflora_addon.tetrahedra.geometry import signed_volume

pytestmark = pytest.mark.usefixtures("clean_file")

SIZE, WIDTH = 24, 2.4
# A regular tetrahedron of edge 1.63 m, all of it in view.
REGULAR = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
ISOTROPIC = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


def upright(vertices):
    """Cells (n, 4, 3) in positive orientation."""
    vertices = np.asarray(vertices, np.float64)
    return np.where(signed_volume(vertices)[:, None, None] < 0.0, vertices[:, [0, 2, 1, 3]], vertices)


def place(
    vertices, extinction, color=0.0, transmission=0.0, normal=(0.0, 0.0, 1.0), plane=0.0, stochastic=1.0, **sockets
):
    """Link shells of the cells (n, 4, 3) with S (n, 6) to the scene."""
    count = len(vertices)
    cells = MediumCells(
        upright(vertices),
        np.broadcast_to(extinction, (count, 6)),
        np.full((count, 3), color),
        np.full(count, transmission),
        np.tile(normal, (count, 1)),
        np.full(count, plane),
    )
    buffers = shells._shell_buffers(cells)
    material = microsphere.shell_material()
    group = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")
    for name, value in {"Stochastic": stochastic, "s": 0.0, "Variation": 0.0, "Roundness": 0.0, **sockets}.items():
        group.inputs[name].default_value = value
    mesh = meshes.write_mesh("shells", buffers, [material])
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
    """Five kilometers away positions are rounded to half a millimeter, thickness is not."""
    away = np.array([4000.0, 3000.0, 0.0])
    prepare(64)
    bpy.context.scene.camera.location.x += away[0]
    bpy.context.scene.camera.location.y += away[1]
    place(REGULAR[None] + away, ISOTROPIC, stochastic=0.0)
    difference = picture()[..., 0] - transmittance(REGULAR[None], 1.0)
    assert np.sqrt((difference**2).mean()) < 0.01


def test_light_from_the_viewer_gives_the_color():
    """Particles and planes that face both light and viewer: p cos φ = p cos α = p at φ = α = 0."""
    for plane in (0.0, 1.0):
        session.clean_file()
        small_scene(sky=0.0, samples=16, sun=0.0, size=SIZE, width=0.2)
        place(REGULAR[None], ISOTROPIC * 1e8, color=0.3, plane=plane)
        # Besides the sun's light only what scatters inside the cell and comes out at its rim.
        np.testing.assert_allclose(picture(), 0.3, rtol=0.03)
        np.testing.assert_allclose(picture().mean(), 0.3, rtol=1e-3)


def test_one_output_for_each_engine():
    material = microsphere.shell_material()
    targets = sorted(n.target for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    assert targets == ['CYCLES', 'EEVEE']
    assert material.cycles.use_bump_map_correction is False
    assert all(link.is_valid for link in material.node_tree.links)


def at_centers(samples=1, **changes):
    """Pixels that look through their centers only, as exact as the renderer's arithmetic."""
    prepare(samples, **changes)
    scene = bpy.context.scene
    scene.cycles.pixel_filter_type = 'BLACKMAN_HARRIS'
    scene.cycles.filter_width = scene.render.filter_size = 0.01
    # Cycles otherwise ends rays by chance when little of them is left.
    scene.cycles.transparent_max_bounces = scene.cycles.min_transparent_bounces = 256


def engine(name):
    return compat.eevee_engine() if name == "EEVEE" else name


@pytest.mark.parametrize("name", ["CYCLES", "EEVEE"])
def test_stacks_are_exact_at_the_centers_of_pixels(name):
    cells = stack(24) * [1.0, 1.0, 0.2]
    kappa = np.random.default_rng(6).uniform(0.1, 2.0, len(cells))
    at_centers(engine=engine(name))
    place(cells, ISOTROPIC * kappa[:, None] ** 2, stochastic=0.0)
    wanted = np.exp(-np.einsum("nyxs,n->yx", thickness(cells, 1), kappa))
    assert np.sqrt(((picture()[..., 0] - wanted) ** 2).mean()) < 0.005


@pytest.mark.parametrize("name", ["CYCLES", "EEVEE"])
@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_camera_inside_sees_what_is_left_of_the_way(name, kind):
    """From the middle of a cell, whose entry face is behind the camera, what counts is the way to the wall."""
    at_centers(engine=engine(name))
    camera = bpy.context.scene.camera
    camera.location = (0.02, -0.03, 0.05)
    camera.data.type, camera.data.ortho_scale, camera.data.angle = kind, 0.3, 1.0
    camera.data.clip_start = 1e-3
    place(REGULAR[None], ISOTROPIC * 4.0, stochastic=0.0)
    center = (np.arange(SIZE) + 0.5) / SIZE - 0.5
    x, y = np.meshgrid(center, center)
    flat = np.stack([x, y, np.zeros_like(x)], axis=-1)
    if kind == 'ORTHO':
        start, direction = np.array(camera.location) + 0.3 * flat, np.zeros_like(flat) - [0.0, 0.0, 1.0]
    else:
        start = np.broadcast_to(camera.location, flat.shape)
        direction = 2.0 * np.tan(0.5) * flat - [0.0, 0.0, 1.0]
        direction /= np.linalg.norm(direction, axis=-1)[..., None]
    # The face opposite corner c has the outward normal −c and lies 1/3 from the middle.
    outward = -REGULAR
    with np.errstate(divide="ignore"):
        distance = (1.0 / 3.0 - start @ outward.T) / (direction @ outward.T)
    wanted = np.exp(-2.0 * np.where(distance > 0.0, distance, np.inf).min(axis=-1))
    assert np.sqrt(((picture()[..., 0] - wanted) ** 2).mean()) < 0.005


def baked(path, light, extinction):
    """Baked picture of cells (n, 4, 3), far to near, whose radiance at the corners is `light` (n, 4)."""
    count = len(path)
    cells = MediumCells(
        path,
        ISOTROPIC * extinction[:, None] ** 2,
        np.zeros((count, 3)),
        np.zeros(count),
        np.zeros((count, 3)),
        np.zeros(count),
    )
    buffers = shells._shell_buffers(cells, np.arange(count)[::-1], np.repeat(light[..., None], 3, axis=2))
    material = microsphere.baked_shell_material()
    mesh = meshes.write_mesh("shells", buffers, [material])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("shells", mesh))


@pytest.mark.parametrize("name", ["CYCLES", "EEVEE"])
@pytest.mark.parametrize("count", [1, 12])
def test_baked_light_follows_the_integral(name, count):
    """∫ J e^{−κt} κ dt by many steps, cell by cell, J linear between the corners."""
    rng = np.random.default_rng(8)
    turns = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    turns *= np.linalg.det(turns)[:, None, None]  # no mirror images
    cells = REGULAR @ turns + np.arange(count)[:, None, None] * [0, 0, 3.0]
    light, kappa = rng.uniform(0.0, 2.0, (count, 4)), rng.uniform(0.02, 1.5, count)
    at_centers(engine=engine(name))
    baked(cells, light, kappa)
    steps = 400
    wanted = np.ones((SIZE, SIZE))
    center = ((np.arange(SIZE) + 0.5) / SIZE - 0.5) * WIDTH
    x, y = np.meshgrid(center, center)
    for cell, corners, k, length in zip(cells, light, kappa, thickness(cells, 1)[..., 0], strict=True):
        # Barycentric coordinates are linear: those of any point by one matrix.
        system = np.linalg.inv(np.vstack([cell.T, np.ones(4)]))
        top = _top(cell, x, y)
        for i in range(steps - 1, -1, -1):
            z = top - (i + 0.5) / steps * length
            point = np.stack([x, y, z, np.ones_like(x)])
            radiance = np.einsum("j,jk,kyx->yx", corners, system, point)
            clear = np.exp(-k * length / steps)
            wanted = np.where(length > 0.0, wanted * clear + radiance * (1.0 - clear), wanted)
    assert np.sqrt(((picture()[..., 0] - wanted) ** 2).mean()) < 0.005


def _top(cell, x, y):
    """Height where vertical rays from above enter a cell."""
    lowest = np.full(x.shape, np.inf)
    for corner in range(4):
        a, b, c = np.delete(cell, corner, axis=0)
        normal = np.cross(b - a, c - a)
        normal *= -np.sign(normal @ (cell[corner] - a))
        if normal[2] > 0.0:
            lowest = np.minimum(lowest, a[2] - ((x - a[0]) * normal[0] + (y - a[1]) * normal[1]) / normal[2])
    return lowest


def test_cycles_casts_the_shadow_of_the_cloud():
    """On white ground under a sun, seen from below the cells, what is left of the light is e^{−κℓ}."""
    cells, kappa = stack(6), np.linspace(0.2, 1.0, 6)
    prepare(256, sun=0.0)
    scene = bpy.context.scene
    compat.shader_tree(scene.world).nodes["Background"].inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    scene.camera.location.z = -20.0
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 0.0, -30.0))
    place(cells, ISOTROPIC * kappa[:, None] ** 2, stochastic=0.0)
    bare = 0.8  # of the new material's diffuse color
    material = bpy.data.materials.new("ground")
    tree = compat.shader_tree(material)
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (bare, bare, bare, 1.0)
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    bpy.data.objects["Plane"].data.materials.append(material)
    difference = picture()[..., 0] / bare - transmittance(cells, kappa)
    assert abs(difference.mean()) < 0.003
    assert np.sqrt((difference**2).mean()) < 0.02
