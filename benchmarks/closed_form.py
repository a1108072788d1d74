# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shells against closed formulas, in Cycles and EEVEE: transmittance, white furnace, baked light.

Images are of single rays through the centers of pixels, so that what differs from the formula is the shader's.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session
from devtools.formats import set_format
from tetflora_addon.blender import compat
from tetflora_addon.blender.materials import microsphere
from tetflora_addon.blender.results import meshes
from tetflora_addon.emission import shells

from .report import Targets

TARGETS: Targets = {"shell_rms": {"max": 0.005}, "shell_stack_rms": {"max": 0.005}, "furnace_error": {"max": 0.01}}
QUICK_TARGETS: Targets = TARGETS

SIZE, WIDTH = 32, 2.4
STACK = 64
#: Regular tetrahedron within a sphere of 1 m.
REGULAR = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
#: Plane, s, transmission of the furnaces.
MIXTURES = ((0.0, 0.04, 0.0), (0.0, 0.04, 0.5), (1.0, 0.04, 0.0), (1.0, 0.3, 0.5), (0.5, 0.3, 0.5))
KINDS = ("one", "stack")


def run(quick: bool) -> dict[str, float]:
    """RMS differences of images from the formulas, worst engine and by engine; ``furnace_error`` is of means."""
    engines = {"cycles": 'CYCLES', "eevee": compat.eevee_engine()}
    figures: dict[str, float] = {}
    for name, engine in engines.items():
        for kind, key in zip(KINDS, ("shell_rms", "shell_stack_rms"), strict=True):
            figures[f"{key}_{name}"] = _shell_error(engine, _cells(kind))
        figures[f"baked_rms_{name}"] = max(_baked_error(engine, _cells(kind)) for kind in KINDS)
    for key in ("shell_rms", "shell_stack_rms", "baked_rms"):
        figures[key] = max(figures[f"{key}_{name}"] for name in engines)
    errors = [_furnace_error('CYCLES', mixture, 256 if quick else 2048) for mixture in MIXTURES]
    figures["furnace_error"] = max(errors)
    figures["furnace_error_eevee"] = max(_furnace_error(engines["eevee"], mixture, 1) for mixture in MIXTURES)
    return figures


def _cells(kind: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cells (n, 4, 3) above one another, lowest first, and their extinctions (n,)."""
    rng = np.random.default_rng(4)
    count = STACK if kind == "stack" else 1
    turned = REGULAR @ np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    cells = turned * [1.0, 1.0, 0.2] + np.arange(count)[:, None, None] * [0.0, 0.0, 0.5]
    # A stack lets about as much through as one cell.
    return cells, rng.uniform(0.5, 2.0, count) * (1.0 if count == 1 else 0.15)


def _scene(engine: str, samples: int, sky: float = 1.0) -> None:
    session.clean_file()
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine, render.film_transparent = engine, False
    render.resolution_x = render.resolution_y = SIZE
    render.filter_size = cycles.filter_width = 0.01
    cycles.samples = scene.eevee.taa_render_samples = samples
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    # Rays end where they leave, not by chance; a furnace needs all that bounces, and highlights as they are.
    cycles.transparent_max_bounces = cycles.min_transparent_bounces = 1024
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 256
    cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    scene.world = bpy.data.worlds.new("sky")
    tree = compat.shader_tree(scene.world)
    tree.nodes["Background"].inputs["Color"].default_value = (sky, sky, sky, 1.0)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = 'ORTHO', WIDTH
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.camera.location = (0.0, 0.0, 60.0)
    scene.collection.objects.link(scene.camera)


def _place(cells: NDArray, kappa: NDArray, light: NDArray | None = None, **values: float) -> None:
    """Link the shells of cells, lowest first, white but for what `values` say of the material."""
    count = len(cells)
    axes = np.random.default_rng(9).normal(size=(count, 3))
    matrices = kappa[:, None] ** 2 * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    buffers = shells.shell_buffers(
        cells,
        np.full((count, 3), values.pop("color", 1.0)),
        np.full(count, values.pop("transmission", 0.0)),
        matrices,
        axes,
        np.full(count, values.pop("plane", 0.0)),
        rank=-cells[..., 2].mean(axis=1),
        light=light,
    )
    material = microsphere.shell_material() if light is None else microsphere.baked_shell_material()
    group = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")
    if light is None:
        group.inputs["Through Tint"].default_value = (1.0, 1.0, 1.0, 1.0)
        for name, value in {"Variation": 0.0, "Stochastic": 0.0, **values}.items():
            group.inputs[name].default_value = value
    mesh = meshes.write_mesh("shells", buffers, [material])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("shells", mesh))


def _picture() -> NDArray[np.float64]:
    """Render; the red channel (SIZE, SIZE) of linear radiance, bottom row first."""
    settings = bpy.context.scene.render
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "picture.exr")
        set_format(settings.image_settings, 'OPEN_EXR')
        settings.image_settings.color_depth = '32'
        settings.filepath = path
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(path)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.zeros(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    return pixels.reshape(SIZE, SIZE, 4)[..., 0].astype(np.float64)


def _rays() -> NDArray[np.float64]:
    """Points (SIZE, SIZE, 4) at z = 0 under the pixels' centers, homogeneous."""
    across = ((np.arange(SIZE) + 0.5) / SIZE - 0.5) * WIDTH
    x, y = np.meshgrid(across, across)
    return np.stack([x, y, np.zeros_like(x), np.ones_like(x)], axis=-1)


def _spans(cell: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Heights (SIZE, SIZE) where rays from above enter and leave a cell, and the matrix of its coordinates."""
    matrix = np.linalg.inv(np.vstack([cell.T, np.ones(4)]))
    at_zero, slope = _rays() @ matrix.T, matrix[:, 2]
    crossing = -at_zero / slope
    enter = np.where(slope < 0.0, crossing, np.inf).min(axis=-1)
    leave = np.where(slope > 0.0, crossing, -np.inf).max(axis=-1)
    return np.maximum(enter, leave), leave, matrix


def _shell_error(engine: str, stack: tuple[NDArray, NDArray]) -> float:
    """RMS of black cells before a white sky against e^{−Σκℓ}."""
    cells, kappa = stack
    _scene(engine, 1)
    _place(cells, kappa, color=0.0, s=0.0)
    depth = np.zeros((SIZE, SIZE))
    for cell, k in zip(cells, kappa, strict=True):
        enter, leave, _ = _spans(cell)
        depth += k * (enter - leave)
    return _rms(_picture() - np.exp(-depth))


def _baked_error(engine: str, stack: tuple[NDArray, NDArray]) -> float:
    """RMS of baked light against B = w₀ J₀ + w₁ J₁ over what is behind (paper, section 7)."""
    cells, kappa = stack
    light = np.random.default_rng(7).uniform(0.0, 2.0, (len(cells), 4))
    _scene(engine, 1)
    _place(cells, kappa, np.repeat(light[..., None], 3, axis=2))
    wanted, ground = np.ones((SIZE, SIZE)), _rays()
    for cell, k, corners in zip(cells, kappa, light, strict=True):
        enter, leave, matrix = _spans(cell)
        depth = k * (enter - leave)
        ends = [(ground + z[..., None] * [0.0, 0.0, 1.0, 0.0]) @ matrix.T @ corners for z in (enter, leave)]
        tau = np.maximum(depth, 1e-6)
        mean = -np.expm1(-tau) / tau
        first, last = 1.0 - mean, mean - np.exp(-tau)
        inside = depth > 0.0
        wanted = np.where(inside, wanted * np.exp(-depth) + first * ends[0] + last * ends[1], wanted)
    return _rms(_picture() - wanted)


def _furnace_error(engine: str, mixture: tuple[float, float, float], samples: int) -> float:
    """How far the mean of white cells under a white sky is from 1, where they are seen: dense, thin, stacked."""
    plane, s, transmission = mixture
    worst = 0.0
    for kind, density in (("one", 1e4), ("one", 1.0), ("stack", 2.0)):
        cells, kappa = _cells(kind)
        _scene(engine, samples)
        depth = sum(k * np.subtract(*_spans(cell)[:2]) for cell, k in zip(cells, kappa * density, strict=True))
        _place(cells, kappa * density, plane=plane, s=s, transmission=transmission, Stochastic=1.0)
        seen = depth > 1e-3
        worst = max(worst, abs(_picture()[seen].mean() - 1.0))
    return float(worst)


def _rms(difference: NDArray) -> float:
    return float(np.sqrt((difference**2).mean()))
