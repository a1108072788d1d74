# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The only place that knows which Blender this is; every branch asks for a feature, none for a version number."""

from importlib import import_module
from math import pi
from types import SimpleNamespace
from typing import Any

import bpy
import gpu

#: For people to read: nothing depends on it.
VERSION_TEXT = bpy.app.version_string
EEVEE_ENGINES = ("BLENDER_EEVEE", "BLENDER_EEVEE_NEXT")


def eevee_engine() -> str:
    """Identifier of EEVEE for ``scene.render.engine``; 4.x called its rewrite "next"."""
    known = {item.identifier for item in bpy.types.RenderSettings.bl_rna.properties["engine"].enum_items}
    for identifier in EEVEE_ENGINES:
        if identifier in known:
            return identifier
    raise LookupError(f"This Blender has none of the engines {', '.join(EEVEE_ENGINES)} and is not supported")


def handlers(name: str) -> list:
    """Functions that Blender calls; of ``exit_pre``, which 4.5 lacks, a list that nobody reads."""
    return getattr(bpy.app.handlers, name, []) if name == "exit_pre" else getattr(bpy.app.handlers, name)


def stored_properties(owner: bpy.types.ID) -> Any | None:
    """Custom properties in which Blender keeps a datablock's groups, whatever add-ons declare now; None without any."""
    return owner.bl_system_properties_get() if hasattr(owner, "bl_system_properties_get") else owner


def shader_tree(owner: bpy.types.Material | bpy.types.World | bpy.types.Light) -> bpy.types.NodeTree:
    """Node tree of a material, world or light, made if there is none.

    From 5.0 on new datablocks have one, and touching ``use_nodes`` warns of its removal; 4.5 makes it when that is set.
    """
    if owner.node_tree is None:
        owner.use_nodes = True
    return owner.node_tree


def tree_in_use(owner: bpy.types.Material | bpy.types.World | bpy.types.Light) -> bpy.types.NodeTree | None:
    """Node tree of a material, world or light; None where its nodes are switched off, which only 4.5 can."""
    return owner.node_tree if getattr(owner, "use_nodes", True) else None


def sky_model(node: bpy.types.ShaderNodeTexSky) -> str:
    """Type of a sky by its current name; 4.5 calls nearly the same Nishita."""
    return 'SINGLE_SCATTERING' if node.sky_type == 'NISHITA' else node.sky_type


def disable_bump_correction(material: bpy.types.Material) -> None:
    """Keep Cycles, where its add-on is on, from darkening a material's custom normals as if they were bump maps."""
    cycles = getattr(material, "cycles", None)
    if cycles is not None and hasattr(cycles, "use_bump_map_correction"):
        cycles.use_bump_map_correction = False


def loses_summed_lobes() -> bool:
    """Whether Cycles loses light where lobes around several normals are added.

    It counts those cut off at the horizon, but not their light (Blender's issue 139870); mended in 5.0, with this node.
    """
    return not hasattr(bpy.types, "ShaderNodeRadialTiling")


def can_resize_point_clouds() -> bool:
    """Whether Python can fill point clouds; otherwise only geometry nodes make points."""
    return "resize" in bpy.types.PointCloud.bl_rna.functions


def blend_in_mesh_order(material: bpy.types.Material) -> None:
    """Let EEVEE blend a material's faces in their order in the mesh, with exact opacity.

    Dithering, the other way, needs hundreds of samples for a few cells in depth. Cycles has no such setting.
    """
    material.surface_render_method = 'BLENDED'
    material.use_transparency_overlap = True
    material.use_transparent_shadow = True


def drawn_disc(engine: str) -> float:
    """Area drawn for a point of radius 1 of a point cloud: EEVEE draws a square in the circle that Cycles draws."""
    return 2.0 if engine in EEVEE_ENGINES else pi


def dot_shader() -> str:
    """Built-in shader for colored points; before 5.0 the one for all flat colors draws them."""
    try:
        gpu.shader.from_builtin('POINT_FLAT_COLOR')
    except ValueError:
        return 'FLAT_COLOR'
    return 'POINT_FLAT_COLOR'


def set_node_input(modifier: bpy.types.NodesModifier, identifier: str, value: object) -> None:
    """Set an input of a modifier's geometry nodes; before 5.2 it is a custom property of the modifier."""
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, identifier).value = value
    else:
        modifier[identifier] = value


def stored_inputs(modifier: bpy.types.Modifier) -> list[tuple[str, object]]:
    """Inputs of a modifier's geometry nodes where they are custom properties, before 5.2; later they are settings."""
    return [] if modifier.type != 'NODES' or hasattr(modifier, "properties") else list(modifier.items())


def node_inputs(modifier: bpy.types.Modifier) -> list[bpy.types.ID]:
    """Datablocks that inputs of a modifier's geometry nodes name; none of other modifiers."""
    inputs = modifier.properties.inputs if hasattr(modifier, "properties") else None
    names = [prop.identifier for prop in inputs.bl_rna.properties] if inputs else []
    given = [getattr(getattr(inputs, name), "value", None) for name in names]
    return [one for one in (*given, *dict(stored_inputs(modifier)).values()) if isinstance(one, bpy.types.ID)]


def usd() -> SimpleNamespace | None:
    """The modules of USD that Blender brings, by name; None where it was built without them."""
    bpy.utils.expose_bundled_modules()
    try:
        names = ("Gf", "Kind", "Sdf", "Usd", "UsdGeom", "UsdShade", "UsdUtils", "Vt")
        return SimpleNamespace(**{name: import_module(f"pxr.{name}") for name in names})
    except ImportError:
        return None
