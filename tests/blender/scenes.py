# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes for tests of the artist's side."""

from __future__ import annotations

import bpy
import numpy as np

from devtools.formats import set_format

SPECIES = "bush"


def add_camera(location=(0.0, -20.0, 2.0), rotation=(np.pi / 2, 0.0, 0.0)):
    """The scene's active camera; looks along +Y by default. Its image is small where a test has not said its size."""
    scene = bpy.context.scene
    if scene.render.resolution_x == 1920:
        scene.render.resolution_x, scene.render.resolution_y = 240, 135
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = location, rotation
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def add_plant(name="plant", species=SPECIES, seed=1, location=(0.0, 0.0, 0.0), collection=None, **properties):
    """One plant, made without the operators."""
    plant = bpy.data.objects.new(name, None)
    (collection or bpy.context.scene.collection).objects.link(plant)
    plant.location = location
    plant.tetflora.is_plant, plant.tetflora.species, plant.tetflora.seed = True, species, seed
    for key, value in properties.items():
        setattr(plant, key, value)
    return plant


def add_mesh(name="mesh", faces=((0, 1, 2, 3),), size=1.0, z=0.0):
    """A square of side 2 × size at a height."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-size, -size, z), (size, -size, z), (size, size, z), (-size, size, z)], [], list(faces))
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def select(*objects):
    """Select these and nothing else; the first becomes active."""
    bpy.context.view_layer.update()  # what was made a moment ago cannot be selected before
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[0] if objects else None


def depsgraph():
    """What the scene evaluates to now."""
    bpy.context.view_layer.update()
    return bpy.context.evaluated_depsgraph_get()


def tiny_render(samples=1, size=16):
    """Cycles as fast as it gets."""
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.cycles.samples = samples
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    set_format(scene.render.image_settings, "PNG")
    return scene


def datablocks():
    """Names of everything in the file, by type; to tell whether something was left behind."""
    found = {}
    kinds = (
        "objects",
        "meshes",
        "pointclouds",
        "collections",
        "materials",
        "node_groups",
        "cameras",
        "curves",
        "images",
    )
    for kind in (*kinds, "images"):
        found[kind] = sorted(d.name for d in getattr(bpy.data, kind) if d.name != "Render Result")
    return found
