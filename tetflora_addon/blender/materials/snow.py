# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Snow by nodes: what faces the sky turns white, on anything that has a surface shader.

The group "TetFlora Snow" stands between a shader and the material output. How much snow there is is one number, which a
driver takes from the scene that is rendered, so that it follows the slider, and each frame has its own. Materials of
TetFlora have the group while a scene of the file has snow or may get some; others only where the artist adds it.

Facets are leaves with two sides and get the same group; clouds, which have no surface, a group that asks the normals of
their particles. Fresh snow reflects .85 to .9 of visible light or more, almost evenly (Warren, "Optical properties of
snow", Reviews of Geophysics 20, 1982).
"""

from collections.abc import Iterable
from typing import Any

import bpy

from . import microsphere
from .materials import ASSET_PROXY, ASSET_SPHERE, BAKED, PROXY, SPHERE
from .nodes import LEAF_GREEN, SNOW, Graph, Term, is_own, node_group
from .soil import is_soil

AMOUNT = "TetFlora Snow Amount"
CLOUD = "TetFlora Snow Cloud"
_VERSION = 1
#: On nodes that `fit` adds and takes away again; those that an artist adds have none.
_MARK = "tetflora_snow"
_NUMBER = "Snow of the Scene"
_PATHS = {"snow": "tetflora.year.snow", "on": "tetflora.year.enabled"}
#: Linear RGB, and how rough it is.
WHITE = (0.86, 0.875, 0.9, 1.0)
_ROUGH = 0.3
#: Snow that lies on level ground at amount 1, over what has to lie anywhere until half of the place is white, and over
#: how much of it white comes; how much noise adds or takes away, and how many patches there are to a meter.
_WHITE, _SOFT, _UNEVEN, _PATCHES = 0.25, 0.2, 0.9, 4.0
#: What of the snow stays on a twig, and how long the way around a branch is that has lost none, meters.
_TWIG, _STOUT = 0.6, 0.4
#: Of particles in clouds, which stand for leaves that shade each other's snow: measured as .83 to 1 for four species.
_CLUSTER = (*(0.92 * c for c in WHITE[:3]), 1.0)
#: Proxies of which what lets no light through stands for twigs.
_PROXIES = (PROXY, SPHERE, BAKED)
_OTHERS = (ASSET_PROXY, ASSET_SPHERE)  # stand for materials of the artist
_CLOUDS = (microsphere.SHELL_MATERIAL, microsphere.BAKED_SHELL_MATERIAL)


def has_snow(scene: bpy.types.Scene) -> bool:
    """Whether there is snow in a scene, or may be in one of its frames, by keys or a driver of its amount."""
    year, animation = scene.tetflora.year, scene.animation_data
    if not year.enabled or year.snow > 0.0 or animation is None:
        return year.enabled and year.snow > 0.0
    layers = animation.action.layers if animation.action is not None else ()
    bags = [bag for layer in layers for strip in layer.strips for bag in strip.channelbags]
    curves = [*animation.drivers, *(curve for bag in bags for curve in bag.fcurves)]
    return bool(animation.nla_tracks) or any(curve.data_path == _PATHS["snow"] for curve in curves)


def fit(materials: Iterable[bpy.types.Material | None]) -> None:
    """Put snow on TetFlora's own materials if a scene of the file has any, and take it from them otherwise."""
    snowy = any(has_snow(scene) for scene in bpy.data.scenes)
    for material in set(materials) - {None}:
        ours = is_own(material) or is_soil(material)
        if not ours or material.node_tree is None or material.name.startswith(_OTHERS):
            continue
        if material.name in _CLOUDS:
            _fit_cloud(snowy)
        elif snowy:
            add_snow(material, mark=True)
        else:
            _clear(material.node_tree)


def add_snow(material: bpy.types.Material, mark: bool = False) -> bool:
    """Put the group between a material's surface shaders and its outputs; False if it is there or there are none."""
    added, tree = False, material.node_tree
    for output in [node for node in tree.nodes if node.type == 'OUTPUT_MATERIAL']:
        surface = output.inputs["Surface"]
        if not surface.is_linked or _is_snow(surface.links[0].from_node):
            continue
        node = _group_node(tree, _snow_group(), output, mark)
        if material.name in _PROXIES:
            node.inputs["Twigs"].default_value = 1.0
        _put_between(tree, surface, node.inputs["Shader"], node.outputs["Shader"])
        added = True
    return added


def _snow_group() -> bpy.types.NodeTree:
    """The group "TetFlora Snow". The side of a sheet that faces up is white where its output Cover is 1.

    From below, a leaf that lets light through is darker by what the snow keeps from it. Leaves of a cluster shade each
    other's snow, as they do each other (`optics.recollision_albedo`).
    """
    inputs = (
        ("Shader", 'Shader'),
        ("Carry", 'Float', 1.0, microsphere.UNIT, "How much snow stays on it: less on thin things"),
        ("Snow Color", 'Color', WHITE),
        ("Twigs", 'Float', 0.0, microsphere.UNIT, "1: what lets no light through is thin, as in proxies"),
    )

    def build(graph: Graph, given: dict[str, Term]) -> dict[str, Any]:
        upward = graph.parts(graph.outputs("ShaderNodeNewGeometry")["Normal"])[2]
        through, girth = graph.attribute("tf_transmission", "Fac"), graph.attribute("tf_girth", "Fac")
        slight = (girth > 1e-6) * graph.step(girth, _STOUT, 0.0)
        unknown = (girth < 1e-6) * given["Twigs"]
        thin = graph.math('MAXIMUM', slight, unknown * (through < 1e-6))
        held = _held(graph, upward, given["Carry"] * (thin * (_TWIG - 1.0) + 1.0))
        above = upward > 0.0
        kept = held * graph.math('MAXIMUM', above, through)
        # What it scatters up meets undersides: half of what light meets next is white. A wood of spruces is 12 %
        # brighter than its truth so, and 18 % where all is.
        white, hidden = given["Snow Color"], graph.attribute("tf_dull", "Fac")
        white = white * (hidden * -1.0 + 1.0) / (white * (hidden * -0.5) + (1.0, 1.0, 1.0))
        snow = graph.node("ShaderNodeBsdfDiffuse", {"Color": white * above, "Roughness": _ROUGH})
        return {"Shader": graph.mix(kept, given["Shader"], snow), "Cover": held * above}

    return node_group(SNOW, _VERSION, inputs, (("Shader", 'Shader'), ("Cover", 'Float')), build)


def _cloud_group() -> bpy.types.NodeTree:
    """The group "TetFlora Snow Cloud": color and transmission of the particle that is hit in a cloud, under snow."""
    inputs = (("Color", 'Color', LEAF_GREEN), ("Transmission", 'Float', 0.0, microsphere.UNIT))
    outputs = (("Color", 'Color'), ("Transmission", 'Float'), ("Cover", 'Float'))

    def build(graph: Graph, given: dict[str, Term]) -> dict[str, Any]:
        geometry = graph.outputs("ShaderNodeNewGeometry")
        particle = microsphere.particle_normal(graph, {"Roundness": 1.0, "Facing": (0.0, 0.0, 0.0)}, geometry)
        axis = graph.attribute("tf_normal", "Vector")
        away = graph.vector('DOT_PRODUCT', axis, geometry["Incoming"]) < 0.0
        held, cover = [], []
        for normal in (particle, axis * (away * -2.0 + 1.0)):
            upward = graph.parts(normal)[2]
            held.append(_held(graph, upward, 1.0))
            cover.append(held[-1] * (upward > 0.0))
        share = graph.attribute("tf_plane", "Fac")
        kept, white = ((second - first) * share + first for first, second in (held, cover))
        color = graph.mixed(white, given["Color"], _CLUSTER)
        return {"Color": color, "Transmission": given["Transmission"] * (1.0 - kept), "Cover": white}

    return node_group(CLOUD, _VERSION, inputs, outputs, build)


def _held(graph: Graph, upward: Term, carry: Term | float) -> Term:
    """How white a place is on its side that faces up, 0 to 1, by the vertical component of its normal, of any sign."""
    amount = graph.outputs("ShaderNodeGroup", node_tree=_amount_group())["Snow"]
    noise = graph.noise(graph.outputs("ShaderNodeNewGeometry")["Position"] * _PATCHES, 2.0, 0.6)[0] - 0.5
    return graph.step(amount * carry * (noise * _UNEVEN + abs(upward)), _WHITE - _SOFT, _WHITE + _SOFT)


def _amount_group() -> bpy.types.NodeTree:
    """The group "TetFlora Snow Amount": the number of the scene that is rendered, by a driver that needs no script."""

    def build(graph: Graph, _given: Any) -> dict[str, Any]:
        number = graph.node("ShaderNodeValue")
        number.name = number.label = _NUMBER
        number.outputs[0].default_value = 0.0
        driver = graph.tree.driver_add(f'nodes["{_NUMBER}"].outputs[0].default_value').driver
        driver.type = 'SCRIPTED'
        for name, path in _PATHS.items():
            variable = driver.variables.new()
            variable.name, variable.type = name, 'CONTEXT_PROP'
            variable.targets[0].context_property, variable.targets[0].data_path = 'ACTIVE_SCENE', path
        driver.expression = " * ".join(_PATHS)
        return {"Snow": number}

    return node_group(AMOUNT, _VERSION, (), (("Snow", 'Float'),), build)


def _fit_cloud(snowy: bool) -> None:
    """Snow within the groups of shells, whose materials hold nothing else."""
    for name in (microsphere.SHELL, microsphere.BAKED_SHELL):
        tree = bpy.data.node_groups.get((name, None))
        if tree is None or not is_own(tree) or any(_MARK in node for node in tree.nodes) == snowy:
            continue
        if not snowy:
            _clear(tree)
        elif name == microsphere.SHELL:
            spheres = next(n for n in tree.nodes if n.type == 'GROUP' and n.node_tree.name == microsphere.MICROSPHERE)
            node = _group_node(tree, _cloud_group(), spheres, mark=True)
            for key in ("Color", "Transmission"):
                _put_between(tree, spheres.inputs[key], node.inputs[key], node.outputs[key])
        else:
            _cover_baked_shell(tree)


def _cover_baked_shell(tree: bpy.types.NodeTree) -> None:
    """White particles that the lights of the scene illuminate, where there is snow, in place of baked light."""
    end, before = next(node for node in tree.nodes if node.type == 'GROUP_OUTPUT'), set(tree.nodes)
    graph = Graph(tree, fresh=False)
    cover = graph.outputs("ShaderNodeGroup", node_tree=_cloud_group())["Cover"]
    for engine, _ in microsphere.ENGINES:
        added = end.inputs[engine].links[0].from_node
        baked, clear = (socket.links[0].from_socket for socket in added.inputs)
        through = Term(graph, clear.node.inputs["Color"].links[0].from_socket)
        looks = {"Color": _CLUSTER, "s": 0.0, "p": graph.math('SUBTRACT', 1.0, through)}
        looks |= {"Normal": graph.attribute("tf_normal", "Vector"), "Plane": graph.attribute("tf_plane", "Fac")}
        lit = graph.outputs("ShaderNodeGroup", looks, node_tree=microsphere.microsphere_group())
        graph.feed(added.inputs[0], graph.mix(cover, baked, lit[engine]))
    for node in set(tree.nodes) - before:
        node[_MARK] = True


def _group_node(tree: bpy.types.NodeTree, group: bpy.types.NodeTree, before: Any, mark: bool) -> bpy.types.Node:
    """A node with a group, left of another in the editor."""
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.location = before.location.x - 190.0, before.location.y + 160.0
    if mark:
        node[_MARK] = True
    return node


def _put_between(tree: bpy.types.NodeTree, end: Any, into: Any, out: Any) -> None:
    """Lead what feeds a socket through another node."""
    tree.links.new(end.links[0].from_socket, into)
    tree.links.new(out, end)


def _clear(tree: bpy.types.NodeTree) -> None:
    """Take away the nodes that `fit` has added; what went through one goes past it."""
    for node in [node for node in tree.nodes if _MARK in node]:
        for output in node.outputs:
            into = next((socket for socket in node.inputs if socket.name == output.name and socket.is_linked), None)
            for link in list(output.links) if into is not None else ():
                tree.links.new(into.links[0].from_socket, link.to_socket)
        tree.nodes.remove(node)


def _is_snow(node: bpy.types.Node) -> bool:
    return node.type == 'GROUP' and node.node_tree is not None and node.node_tree.name.startswith(SNOW)
