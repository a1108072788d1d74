# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of the catalog (the paper's figure 4), and of one plant of which order after order is opened."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy
import numpy as np

from tetflora_addon.blender.job import contents, plant_mesh
from tetflora_addon.blender.materials import materials
from tetflora_addon.blender.results import leaf_objects, meshes
from tetflora_addon.growth import growth
from tetflora_addon.jobs import run_to_end
from tetflora_addon.proxies import microsurfaces
from tetflora_addon.proxies.primitives import shape_buffers, triangles_of
from tetflora_addon.species import catalog
from tetflora_addon.subplants import leaf_meshes, tubes

from . import stage
from .paper.pictures import save_sheet
from .studio import render_cells

COLUMNS, SIZE, OPENED_SIZE = 7, (236, 290), (380, 400)
SEED = 11
#: The plant that is opened, and how wide one facet of its deferred parts is, meters.
OPENED, FACET = "beech", 0.3


def _points(mesh: bpy.types.Mesh) -> np.ndarray:
    points = np.zeros(3 * len(mesh.vertices), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", points)
    return points.reshape(-1, 3)


def plant_cell(
    identifier: str, name: str, made: dict[str, tuple[int, float]], seed: int = SEED, age: float = 0.0
) -> Callable[[], tuple[np.ndarray, str]]:
    """Puts one plant of a species into the scene, as a mesh, and its polygons and height in meters into ``made``."""

    def build() -> tuple[np.ndarray, str]:
        scene = bpy.context.scene
        empty = stage.plant(scene, identifier, seed, (0.0, 0.0, 0.0), age=age)
        bpy.context.view_layer.update()
        steps = plant_mesh.make_plant_mesh_steps(scene, bpy.context.evaluated_depsgraph_get(), [empty])
        (plant,) = run_to_end(steps)
        points = _points(plant.data)
        high = float(points[:, 2].max())
        made[identifier] = len(plant.data.polygons), high
        return points, f"{name}, {high:.2g} m" if high >= 1.0 else f"{name}, {100.0 * high:.0f} cm"

    return build


def opened_cell(identifier: str, orders: int) -> Callable[[], tuple[np.ndarray, str]]:
    """Puts one plant of which some orders are opened into the scene: their wood as it is, the rest as microsurfaces."""

    def build() -> tuple[np.ndarray, str]:
        scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
        flora = contents.compile_for((identifier,), scene, depsgraph)
        single = plant_mesh.single_seed(identifier, SEED)
        closed = growth.trunks(flora.rows, single)
        parts = []
        for _ in range(orders):
            whole, _, closed, _ = growth.open_branches(flora.rows, closed)
            parts.append(("bark", 0, tubes.tube_buffers(flora, [whole])))
            parts += [("leaf", leaf.form, leaf.buffers) for leaf in leaf_meshes.leaf_meshes(flora, 0, [whole])]
        points = []
        if len(closed):
            facets = microsurfaces.subplant_facets(flora, closed, microsurfaces.FacetRules(np.full(len(closed), FACET)))
            parts.append(("proxy", 0, shape_buffers(triangles_of(facets))))
        for number, (kind, form, buffers) in enumerate(p for p in parts if p[2] is not None):
            proxy = materials.proxy_material
            own = [proxy()] if kind == "proxy" else leaf_objects.materials_of(scene, flora.species[0], kind, form)
            mesh = meshes.write_mesh(f"{kind} {number}", buffers, own)
            scene.collection.objects.link(bpy.data.objects.new(mesh.name, mesh))
            points.append(_points(mesh))
        count = sum(p[2].polygons for p in parts if p[2] is not None)
        title = "Closed" if orders == 0 else f"{orders} order{'s' * (orders > 1)} opened"
        return np.concatenate(points), f"{title}: {count:,} polygons"

    return build


def render_sheet(path: Path, samples: int = 32, identifiers: Sequence[str] | None = None) -> dict[str, int]:
    """Render one plant of each species of the catalog, or of some, as a JPEG, and return the polygons of each plant.

    They stand from the highest to the lowest.
    """
    known, made = catalog.list_species(), {}
    with tempfile.TemporaryDirectory() as folder:
        cells = [plant_cell(one, known[one].name, made) for one in identifiers or known]
        rendered = zip(made.items(), render_cells(cells, Path(folder), SIZE, samples), strict=True)
        ordered = sorted(rendered, key=lambda one: -one[0][1][1])
        save_sheet([cell for _, cell in ordered], COLUMNS, path)
    return {identifier: polygons for identifier, (polygons, _) in made.items()}


def render_opening(path: Path, samples: int = 32) -> None:
    """Render one plant with none of its orders opened, one, and so on to all, as a JPEG."""
    orders = len(catalog.load_species(OPENED).orders)
    cells = [opened_cell(OPENED, number) for number in range(orders + 1)]
    with tempfile.TemporaryDirectory() as folder:
        save_sheet(render_cells(cells, Path(folder), OPENED_SIZE, samples), len(cells), path)
