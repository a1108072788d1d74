# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the benchmark `assets`: refined woods and crowns beside the renderer's own instances of the same trees.

What is compared is where trees cover more than a twentieth of a pixel of the plain picture. Woods are refined with
everything that the extension does to assets (`REFINE`), even where plain instances would be cheaper.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools.formats import set_format
from tetflora_addon.blender.job import refine

from . import asset_scenes
from .asset_cases import mark
from .asset_scenes import DISTANCES, LIGHTS, PICTURE, Scatter
from .compare import difference, read_picture, render
from .row80 import timed_refine

INSTANCES = 16
#: By distance: what is far is small and cheap, and has many trees in a pixel.
SAMPLES, QUICK_DIVISOR = {"near": 64, "middle": 256, "far": 256}, 8
COVERAGE_SAMPLES = 64
LEAST_COVERAGE = 0.05
#: Meters of the pixels that crowns are refined for, and of those of the pictures that are compared, with samples.
#: Cards of .4 m are real in smaller ones.
COARSE, FINE, CROWN_SAMPLES = (0.8, 1.0, 1.2), 0.1, 256
TENTHS = 10
#: Of the renderer's passes, those that sum up to the color of a surface.
_PASSES = "diffuse", "glossy", "transmission"
#: Least of a crown's row that is covered where its color counts.
_LEAST_ROW = 0.02


def woods(kind: str, folder: Path, quick: bool, warped: bool = False) -> dict[str, float]:
    """FLIP of a refined wood in each light and from each distance, and of two plain pictures in the first light."""
    scene = bpy.context.scene
    asset_scenes.build(scene, Scatter(kind, INSTANCES, size=PICTURE, warped=warped, quick=quick))
    found: dict[str, float] = {}
    masks: dict[str, NDArray[np.bool_]] = {}
    for distance, light in _views(scene):
        name, samples = f"{kind}-{distance}-{light}", _samples(distance, quick)
        render(scene, folder / f"{name}-plain.png", samples)
        if light == next(iter(LIGHTS)):
            masks[distance] = coverage(scene, folder / "coverage.png") > LEAST_COVERAGE
            render(scene, folder / f"{name}-again.png", samples, seed=1)
            pair = folder / f"{name}-plain.png", folder / f"{name}-again.png"
            found[f"noise_{kind}_{distance}"] = difference(*pair, masks[distance]).flip
    mark("REFINE")
    for distance, light in _views(scene):
        name, samples = f"{kind}-{distance}-{light}", _samples(distance, quick)
        statistics, _ = timed_refine(scene)
        render(scene, folder / f"{name}-refined.png", samples)
        pair = folder / f"{name}-plain.png", folder / f"{name}-refined.png"
        made = difference(*pair, masks[distance])
        key = f"{kind}_{distance}_{light}"
        found |= {f"flip_{key}": made.flip, f"color_{key}": made.color}
        found[f"polygons_{kind}_{distance}"] = statistics.polygons_meshed + statistics.polygons_proxy
    return found


def plain_woods(kind: str, folder: Path, quick: bool) -> dict[str, float]:
    """Only the plain half of `woods`."""
    scene = bpy.context.scene
    asset_scenes.build(scene, Scatter(kind, INSTANCES, size=PICTURE, quick=quick))
    found = {}
    for distance, light in _views(scene):
        name, samples = f"{kind}-{distance}-{light}", _samples(distance, quick)
        render(scene, folder / f"{name}-plain.png", samples)
        render(scene, folder / f"{name}-again.png", samples, seed=1)
        mask = coverage(scene, folder / "coverage.png") > LEAST_COVERAGE
        pair = folder / f"{name}-plain.png", folder / f"{name}-again.png"
        found[f"noise_{kind}_{distance}_{light}"] = difference(*pair, mask).flip
    return found


def _samples(distance: str, quick: bool) -> int:
    return SAMPLES[distance] // (QUICK_DIVISOR if quick else 1)


def _views(scene: bpy.types.Scene) -> Iterator[tuple[str, str]]:
    """Names of distances and lights, which the scene has while each lasts."""
    for distance, meters in DISTANCES.items():
        asset_scenes.aim(scene, meters)
        for light in LIGHTS:
            asset_scenes.set_sun(scene, light)
            bpy.context.view_layer.update()
            yield distance, light


def crown(kind: str, folder: Path, quick: bool) -> dict[str, float]:
    """How much light a crown lets through, and the color of its tenths from below to above, refined and plain."""
    scene = bpy.context.scene
    asset_scenes.alone(scene, kind, quick)
    samples = CROWN_SAMPLES // (QUICK_DIVISOR if quick else 1)
    asset_scenes.frame(scene, FINE)
    plain = silhouette(scene, folder / f"crown-{kind}-plain.exr", samples), albedo(scene, folder / "albedo.exr")
    again = silhouette(scene, folder / f"crown-{kind}-again.exr", samples, 1), albedo(scene, folder / "albedo.exr", 1)
    found = {f"noise_{key}": value for key, value in _compared(plain, again).items()}
    mark("REFINE")
    for pixel in COARSE:
        asset_scenes.frame(scene, pixel)
        statistics, _ = timed_refine(scene)
        asset_scenes.frame(scene, FINE)
        test = silhouette(scene, folder / f"crown-{kind}-{pixel}.exr", samples), albedo(scene, folder / "albedo.exr")
        found |= {f"{key}_{pixel}": value for key, value in _compared(plain, test).items()}
        found[f"crown_polygons_{pixel}"] = statistics.polygons_meshed + statistics.polygons_proxy
    refine.clear(scene)
    return found


def _compared(plain: tuple[NDArray, NDArray], test: tuple[NDArray, NDArray]) -> dict[str, float]:
    """How much less of the image a crown covers than a plain one, and how far the colors of its tenths are from its.

    Both are given as what `silhouette` and `albedo` return. ``tenth`` is of the albedo, ``lit`` under the sky, where
    the crown shades itself.
    """
    light, own = plain[0], plain[1]
    # Of all of the image: facets are larger than what they stand for, and reach beyond its outline.
    found = {"dT": float((light[..., 3] - test[0][..., 3]).sum() / (light[..., 3] > LEAST_COVERAGE).sum())}
    rows = crown_rows(light)
    for name, a, b in (("tenth", own, test[1]), ("lit", light, test[0])):
        theirs, ours = tenths(a, rows), tenths(b, rows)
        found[name] = float((np.abs(ours - theirs).mean(axis=1) / theirs.mean(axis=1)).max())
    return found


def crown_rows(silhouette: NDArray[np.float32]) -> tuple[int, int]:
    """First row of a crown from below, and the one after its last; the lowest fifth of a tree is trunk."""
    covered = np.flatnonzero((silhouette[::-1, :, 3] > LEAST_COVERAGE).mean(axis=1) > _LEAST_ROW)
    end = int(covered[-1]) + 1
    return int(covered[0]) + (end - int(covered[0])) // 5, end


def tenths(silhouette: NDArray[np.float32], rows: tuple[int, int]) -> NDArray[np.float64]:
    """Mean color (10, 3) of what is covered in each tenth of a crown's rows, from below to above."""
    bands = np.array_split(silhouette[::-1].astype(np.float64)[slice(*rows)], TENTHS)
    return np.array([band[..., :3].sum(axis=(0, 1)) / band[..., 3].sum() for band in bands])


def silhouette(scene: bpy.types.Scene, path: Path, samples: int, seed: int = 0) -> NDArray[np.float32]:
    """Light and alpha (height, width, 4), linear and premultiplied, of what is not ground or sky."""
    with ground_as_holes():
        before = scene.render.film_transparent
        scene.render.film_transparent = True
        try:
            render(scene, path, samples, seed, form='OPEN_EXR')
        finally:
            scene.render.film_transparent = before
    return read_picture(path)


def albedo(scene: bpy.types.Scene, path: Path, seed: int = 0) -> NDArray[np.float32]:
    """Color of surfaces, all that they do with light, and alpha (height, width, 4), premultiplied, without ground."""
    bpy.utils.expose_bundled_modules()
    import OpenImageIO  # Blender's own, which it shows only now

    layer, render_settings, bounces = bpy.context.view_layer, scene.render, scene.cycles.max_bounces
    scene.cycles.max_bounces = 0
    for kind in _PASSES:
        setattr(layer, f"use_pass_{kind}_color", True)
    try:
        with ground_as_holes():
            render_settings.engine, scene.cycles.samples, scene.cycles.seed = 'CYCLES', COVERAGE_SAMPLES, seed
            scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
            render_settings.film_transparent, render_settings.filepath = True, str(path)
            if hasattr(render_settings.image_settings, "media_type"):
                render_settings.image_settings.media_type = 'MULTI_LAYER_IMAGE'
            render_settings.image_settings.file_format = 'OPEN_EXR_MULTILAYER'
            bpy.ops.render.render(write_still=True)
    finally:
        set_format(render_settings.image_settings, 'PNG')
        render_settings.film_transparent, scene.cycles.max_bounces = False, bounces
        for kind in _PASSES:
            setattr(layer, f"use_pass_{kind}_color", False)
    parts = [OpenImageIO.ImageBuf(str(path), i, 0) for i in range(OpenImageIO.ImageBuf(str(path)).nsubimages)]
    named = {}
    for part in parts:
        pixels = part.get_pixels(OpenImageIO.FLOAT)
        named |= {name.split(".", 1)[1]: pixels[..., i] for i, name in enumerate(part.spec().channelnames)}
    colors = [sum(named[f"{kind.title()} Color.{c}"] for kind in _PASSES) for c in "RGB"]
    return np.stack([*colors, named["Combined.A"]], axis=2)


def coverage(scene: bpy.types.Scene, path: Path) -> NDArray[np.float32]:
    """How much of each pixel (height, width) is not ground or sky, 0 to 1."""
    bounces = scene.cycles.max_bounces
    scene.cycles.max_bounces = 0
    try:
        return silhouette(scene, path.with_suffix(".exr"), COVERAGE_SAMPLES)[..., 3]
    finally:
        scene.cycles.max_bounces = bounces


@contextmanager
def ground_as_holes() -> Iterator[None]:
    """Make holes in the image of all ground; instances come out of ground, so it is its material that does it."""
    trees = [bpy.data.materials[name].node_tree for name in ("Meadow", "Forest floor")]
    changed = []
    for tree in trees:
        output = next(node for node in tree.nodes if node.type == 'OUTPUT_MATERIAL')
        hole = tree.nodes.new("ShaderNodeHoldout")
        changed.append((tree, output, hole, output.inputs["Surface"].links[0].from_socket))
        tree.links.new(hole.outputs[0], output.inputs["Surface"])
    color_mode = bpy.context.scene.render.image_settings.color_mode
    bpy.context.scene.render.image_settings.color_mode = 'RGBA'
    try:
        yield
    finally:
        bpy.context.scene.render.image_settings.color_mode = color_mode
        for tree, output, hole, before in changed:
            tree.links.new(before, output.inputs["Surface"])
            tree.nodes.remove(hole)
