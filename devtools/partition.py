# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tetrahedra of a scene as refinement divides it, for images and tests of the partition; nothing is made of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import bpy

    from tetflora_addon.camera.camera import Camera
    from tetflora_addon.refinement.loop import Refinement


def partition(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[Camera, Refinement]:
    """Camera and tetrahedra after refinement; both count from the camera's `origin`. Errors are those of Refine."""
    from tetflora_addon.blender.job import contents, refine
    from tetflora_addon.blender.scene.camera import read_camera
    from tetflora_addon.jobs import run_to_end

    camera = read_camera(scene, depsgraph).local()
    given = contents.read_scene(scene, depsgraph).counted_from(camera.origin)
    flora = contents.in_wind(scene, contents.compile_for(given.species, scene, depsgraph), camera)
    left = contents.memory_left(scene, camera)
    bound = run_to_end(contents.bind_steps(scene, given.places, depsgraph, camera, left))
    settings = contents.refinement_settings(scene)
    run = refine._Run(depsgraph, camera, given, flora=flora, bound=bound, settings=settings)
    return camera, run_to_end(refine._run_loop(run))
