# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture of the benchmark `exact`, made and measured in the process that this is called in.

``truth``: a few expanded plants of each species as instances, at the places of all plants with the same seeds.
``refined``: what Refine makes of the same plants, measured against the truth that an earlier process has left.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session
from devtools.formats import set_format
from tetflora_addon.blender.biomes import adding, files, ground, library
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.job.contents import read_scene
from tetflora_addon.blender.materials import snow
from tetflora_addon.blender.results.output import KIND, result_collections
from tetflora_addon.blender.scene.fields import fields_of
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.growth.hashing import child_key, key_of_seed

from . import forest_instances, forest_scene
from .compare import color_error, coverage, flip_map, read_picture, render
from .exact import KINDS, blobs, luma, polygon_areas, sums_of_sides
from .report import cpu_s, forget_peak, peak_mb

#: Pixels that plants cover by less are not compared.
COVERED, COVERAGE_SAMPLES = 0.05, 8
#: Attributes of faces: the root of the area in meters, and which of `KINDS`.
_SIDE, _KIND = "exact_side", "exact_kind"
_DAY = 20.0
#: Exposure inside the wood, stops.
_INSIDE = 3.0
#: Height of the eye in biomes, meters.
_EYE = 1.7
#: Ground of a few plants, meters.
_PATCH = 8.0
_LOW_SUN = np.radians(12.0)


def build(scene: bpy.types.Scene, spec: dict) -> int:
    """The wood of a case, its camera and light, on its day; how many plants there are."""
    kind, species = spec["case"], tuple(spec["species"])
    case = forest_scene.Case(species, **({"side": _PATCH, "asked": spec["few"]} if spec["few"] else {}))
    if kind == "ridge":
        case = replace(case, away=600.0, eye=60.0)
    elif kind == "eye":
        case = replace(case, eye=1.7, inside=True, distance=spec["distance"])
    planted = forest_scene.build(scene, case, tuple(spec["size"]))
    if kind == "ridge":
        scene.camera.data.lens = 110.0
        scene.camera.data.clip_end = 5000.0
    if kind == "eye":
        scene.camera.location[:2] = _clearing(scene)
        scene.view_settings.exposure = _INSIDE
    if kind == "low":
        sun = next(o for o in scene.objects if o.type == 'LIGHT')
        sun.rotation_euler = _LOW_SUN - np.pi / 2.0, 0.0, 0.0
    year = scene.tetflora.year
    year.enabled = spec["season"] != "summer"
    if year.enabled:
        year.day, year.snow = _DAY, 1.0 if spec["season"] == "snow" else 0.0
    if spec["window"]:
        _crop(scene.render, spec["window"], spec["size"])
    if spec["seeds"]:
        few_seeds(scene, spec["seeds"])
    for name, value in spec["set"]:
        _set(scene.tetflora, name, value)
    bpy.context.view_layer.update()
    return planted


def _clearing(scene: bpy.types.Scene) -> NDArray[np.float64]:
    """The place (2,) near the middle of a wood that is farthest from all plants."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    plants = read_scene(scene, depsgraph, depsgraph.view_layer).seeds.position[:, :2]
    along = np.arange(-20.0, 20.0, 0.5)
    places = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    near = plants[(np.abs(plants) < 40.0).all(axis=1)]
    away = np.linalg.norm(places[:, None] - near, axis=2).min(axis=1)
    return places[np.argmax(away)]


def _set(group: Any, name: str, value: str) -> None:
    kind = type(getattr(group, name))
    setattr(group, name, value == "True" if kind is bool else kind(value))


def _crop(render: bpy.types.RenderSettings, window: list[int], size: list[int]) -> None:
    """Only a window in the middle of the image is rendered, pixels."""
    render.use_border = render.use_crop_to_border = True
    low, high = ([0.5 + side * w / s / 2.0 for w, s in zip(window, size, strict=True)] for side in (-1.0, 1.0))
    render.border_min_x, render.border_min_y = low
    render.border_max_x, render.border_max_y = high


def few_seeds(scene: bpy.types.Scene, number: int) -> None:
    """Give all plants of a scene one of so many seeds, by a hash of their places."""
    for obj in scene.objects:
        if obj.tetflora.is_plant:
            obj.tetflora.seed = int(_few(np.array([obj.location]), number)[0])
    for obj in fields_of(scene.objects):
        mesh = obj.data
        place = np.zeros((len(mesh.vertices), 3), np.float32)
        mesh.attributes["position"].data.foreach_get("vector", place.ravel())
        place += np.array(obj.matrix_world.translation, np.float32)
        mesh.attributes["seed"].data.foreach_set("value", _few(place, number))
        mesh.update()


def _few(place: NDArray, number: int) -> NDArray[np.int32]:
    """One of so many seeds (n,) for each place (n, 3), meters; the same in fields and empties."""
    east, north = np.round(place[:, :2].astype(np.float64) * 1e3).astype(np.int64).T
    return (child_key(key_of_seed(east), north) % np.uint64(number)).astype(np.int32)


def truth(scene: bpy.types.Scene, spec: dict, folder: Path) -> dict[str, float]:
    """Instances in place of all plants, rendered with two seeds of noise; seconds and memory."""
    figures: dict[str, float] = {"planted": build(scene, spec)}
    forget_peak()
    figures |= {f"instances_{k}": v for k, v in forest_instances.build(scene, spec["seeds"], own=True).items()}
    wood = scene.objects["Wood"]
    wood[KIND] = "truth"  # not one of those that are holes where plants are not
    snow.fit(bpy.data.materials)
    figures["instances_render_s"] = _rendered(scene, folder / "truth.png", spec["samples"], 0)
    figures["instances_peak_mb"] = peak_mb()
    _rendered(scene, folder / "again.png", spec["samples"], 1)
    _save_mask(folder / "covered.npy", coverage(scene, folder / "coverage.png", COVERAGE_SAMPLES))
    return figures


def refined(scene: bpy.types.Scene, spec: dict, folder: Path, kept: Path) -> dict[str, float]:
    """What Refine makes, rendered, and how far it is from the truth in a folder."""
    figures: dict[str, Any] = {"planted": build(scene, spec)} | _refined(scene, spec)
    if spec["render"]:
        figures["render_s"] = _rendered(scene, folder / "refined.png", spec["samples"], 2)
        figures["peak_render_mb"] = max(peak_mb(), figures["peak_mb"])
        if spec["compare"]:
            figures |= compared(folder, kept, coverage(scene, folder / "coverage.png", COVERAGE_SAMPLES))
    return figures | _sides(scene, folder)


def _refined(scene: bpy.types.Scene, spec: dict) -> dict[str, Any]:
    """Refine as renders do; seconds, memory of all processes, and what was made."""
    forget_peak()
    begun, processor = time.perf_counter(), cpu_s()
    statistics = refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    return {
        "refine_emit_s": time.perf_counter() - begun,
        "refine_emit_cpu_s": cpu_s() - processor,
        "peak_mb": peak_mb(),
        "stages": {name: round(value, 2) for name, value in statistics.seconds.items()},
        "facet_pixels_said": statistics.facet_pixels,
        **counted(_made(scene), spec["size"]),
    }


def _made(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [o for c in result_collections(scene) for o in c.all_objects if o.data is not None]


def biome(scene: bpy.types.Scene, spec: dict, folder: Path) -> dict[str, Any]:
    """A shipped biome on a hectare, seen at the height of the eye from the edge, in one of the qualities."""
    chosen = files.read_biome(library.builtin_folder() / f"{spec['case']}.json")
    land = ground.make_land(scene, chosen.ground)
    bpy.context.view_layer.update()
    run_to_end(adding.add_biome_steps(scene, bpy.context.evaluated_depsgraph_get(), chosen, [land]))
    forest_scene.add_light(scene)
    side = land.dimensions.y
    forest_scene.add_camera(scene, forest_scene.Case((), eye=_EYE, side=side))
    hit, place, *_ = land.ray_cast((0.0, -0.49 * side, 1e3), (0.0, 0.0, -1.0))
    scene.camera.location = 0.0, -0.49 * side, _EYE + (place.z if hit else 0.0)
    scene.camera.rotation_euler = np.pi / 2.0, 0.0, 0.0
    scene.render.resolution_x, scene.render.resolution_y = spec["size"]
    scene.render.resolution_percentage = 100
    scene.tetflora.refine_at_render, scene.tetflora.quality = False, spec["quality"]
    bpy.context.view_layer.update()
    return {"facet_set": scene.tetflora.facet} | _refined(scene, spec) | _sides(scene, folder)


def checked(scene: bpy.types.Scene, spec: dict, folder: Path) -> dict[str, float]:
    """Whether instances are the plants: a few of them as instances, beside the same expanded one by one."""
    figures: dict[str, float] = {"planted": build(scene, spec)}
    scene.tetflora.expand_everything = True
    refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    for name, seed in (("truth", 0), ("again", 1)):
        _rendered(scene, folder / f"{name}.png", spec["samples"], seed)
    _save_mask(folder / "covered.npy", covered := coverage(scene, folder / "coverage.png", COVERAGE_SAMPLES))
    refine.clear(scene)
    forest_instances.build(scene, spec["seeds"], own=True)
    snow.fit(bpy.data.materials)
    _rendered(scene, folder / "refined.png", spec["samples"], 2)
    return figures | compared(folder, folder, covered)


def _rendered(scene: bpy.types.Scene, path: Path, samples: int, seed: int) -> float:
    """Render; seconds."""
    begun = time.perf_counter()
    render(scene, path, samples, seed)
    return time.perf_counter() - begun


def _save_mask(path: Path, covered: NDArray[np.float32]) -> None:
    np.save(path, covered.astype(np.float16))


def counted(made: list[bpy.types.Object], size: list[int]) -> dict[str, float]:
    """Polygons and points of results, by kind and together."""
    found: dict[str, int] = {}
    for obj in made:
        data = obj.data
        number = len(data.points) if obj.type == 'POINTCLOUD' else len(getattr(data, "polygons", ()))
        kind = f"primitives_{obj.get(KIND, 'other')}"
        found[kind] = found.get(kind, 0) + (number or len(getattr(data, "vertices", ())))
    whole = sum(found.values())
    return {"primitives": whole, "primitives_a_pixel": whole / (size[0] * size[1]), **found}


def compared(folder: Path, kept: Path, covered: NDArray[np.float32]) -> dict[str, float]:
    """How far the refined picture is from the truth; a sheet of truth, refined and FLIP, and one of blobs."""
    exact, again, found = (
        read_picture(path)[:, :, :3] for path in (kept / "truth.png", kept / "again.png", folder / "refined.png")
    )
    mask = (np.load(kept / "covered.npy") > COVERED) | (covered > COVERED)
    error, noise = flip_map(exact, found), flip_map(exact, again)
    bright, dark = blobs(luma(exact), luma(found), mask)
    noisy = blobs(luma(exact), luma(again), mask)
    megapixels = mask.sum() / 1e6
    shown = np.repeat(np.minimum(error, 1.0)[:, :, None], 3, axis=2)
    marks = 0.35 * np.repeat(luma(exact)[:, :, None], 3, axis=2)
    marks[bright], marks[dark] = (1.0, 0.3, 0.1), (0.1, 0.4, 1.0)
    _save(folder / "sheet.png", np.concatenate([exact, found, shown], axis=1))
    _save(folder / "blobs.png", np.concatenate([found, marks], axis=1))
    flip, flip_noise = float(error[mask].mean()), float(noise[mask].mean())
    return {
        "flip": flip,
        "noise": flip_noise,
        "flip_over_noise": flip - flip_noise,
        "color": color_error(exact, found, mask),
        "color_noise": color_error(exact, again, mask),
        "blobs": float((bright.sum() + dark.sum()) / megapixels),
        "blobs_bright": float(bright.sum() / megapixels),
        "blobs_dark": float(dark.sum() / megapixels),
        "blobs_noise": float(sum(one.sum() for one in noisy) / megapixels),
        "covered": float(mask.mean()),
    }


def _save(path: Path, picture: NDArray[np.floating]) -> None:
    """Write an image (height, width, 3) as it is stored, top row first."""
    height, width = picture.shape[:2]
    image = bpy.data.images.new("sheet", width, height)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[:, :, :3] = picture[::-1]
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(path), 'PNG'
    image.save()
    bpy.data.images.remove(image)


def _sides(scene: bpy.types.Scene, folder: Path) -> dict[str, float]:
    """Sides in pixels of the faces of results that the centers of pixels see; `exact.sums_of_sides`.

    Cycles draws each face in its own root of area, with one ray through the middle of each pixel. Independent of the
    engine: nothing but the meshes counts.
    """
    for obj in _made(scene):
        if obj.type == 'MESH' and len(obj.data.polygons):
            _mark(obj.data, str(obj.get(KIND, "")))
    seen = _seen(scene, folder / "sides.exr", _side_material())
    side, kind, depth = seen[:, :, 0], np.round(seen[:, :, 1]).astype(int), np.maximum(seen[:, :, 2], 1e-6)
    corners = np.array(scene.camera.data.view_frame(scene=scene))
    across = np.ptp(corners[:, 0] / -corners[:, 2]) / scene.render.resolution_x
    return sums_of_sides(side / (depth * across), kind)


def _mark(mesh: bpy.types.Mesh, kind: str) -> None:
    """Write the roots of the areas of a mesh's faces and their kinds as its attributes."""
    position = np.zeros((len(mesh.vertices), 3), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", position.ravel())
    corners, starts, totals = (np.zeros(n, np.int32) for n in (len(mesh.loops), len(mesh.polygons), len(mesh.polygons)))
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("loop_total", totals)
    kinds = np.full(len(totals), KINDS.index(kind) if kind in KINDS else 0, np.float32)
    if kind == "bark":
        kinds[totals == 3] = KINDS.index("triangle")
    for name, values in ((_SIDE, np.sqrt(polygon_areas(position, corners, starts, totals))), (_KIND, kinds)):
        mesh.attributes.new(name, 'FLOAT', 'FACE').data.foreach_set("value", values.astype(np.float32))
    mesh.update()


def _side_material() -> bpy.types.Material:
    """Emits side, kind and depth, meters."""
    material = bpy.data.materials.new("Sides")
    if not material.node_tree:  # before Blender 5.0 new materials have no nodes
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    new, link = tree.nodes.new, tree.links.new
    packed, emitted, out = new("ShaderNodeCombineXYZ"), new("ShaderNodeEmission"), new("ShaderNodeOutputMaterial")
    for name, socket in ((_SIDE, "X"), (_KIND, "Y")):
        link(_attribute(tree, name), packed.inputs[socket])
    link(new("ShaderNodeCameraData").outputs["View Z Depth"], packed.inputs["Z"])
    link(packed.outputs[0], emitted.inputs["Color"])
    link(emitted.outputs[0], out.inputs["Surface"])
    return material


def _attribute(tree: bpy.types.NodeTree, name: str) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = name
    return node.outputs["Fac"]


def _seen(scene: bpy.types.Scene, path: Path, material: bpy.types.Material) -> NDArray[np.float32]:
    """What is emitted to the center of each pixel (height, width, 3), if everything were of a material."""
    layer, settings = bpy.context.view_layer, scene.render
    with _changed(
        (layer, "material_override", material),
        (settings, "film_transparent", True),
        (scene.cycles, "pixel_filter_type", 'BOX'),
        (scene.cycles, "filter_width", 0.01),
        (scene.cycles, "max_bounces", 0),
    ):
        set_format(settings.image_settings, 'OPEN_EXR')
        settings.image_settings.color_depth = '32'
        render(scene, path, 1, form='OPEN_EXR')
    return read_picture(path)[:, :, :3]


@contextmanager
def _changed(*changes: tuple[Any, str, Any]) -> Iterator[None]:
    before = [(owner, name, getattr(owner, name)) for owner, name, _ in changes]
    for owner, name, value in changes:
        setattr(owner, name, value)
    try:
        yield
    finally:
        for owner, name, value in before:
            setattr(owner, name, value)


def measure(spec: dict) -> dict[str, Any]:
    """Make the picture that is asked for (`exact.Spec.asked`) in an empty file; its figures."""
    session.clean_file()
    folder, kept = Path(spec["folder"]), Path(spec["kept"])
    folder.mkdir(parents=True, exist_ok=True)
    scene = bpy.context.scene
    if spec["what"] == "truth":
        return truth(scene, spec, kept)
    if spec["what"] == "refined":
        return refined(scene, spec, folder, kept)
    return (biome if spec["what"] == "biome" else checked)(scene, spec, folder)
