# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shorthand for node trees built by code, and the mark on datablocks that TetFlora made."""

from collections.abc import Callable, Iterator, Sequence
from functools import partialmethod
from graphlib import TopologicalSorter
from typing import Any, Self, TypeVar

import bpy

from ..compat import shader_tree

# Not plain "tetflora": on 4.5 a registered property group lives among the custom properties under its own name, so
# every empty with plant settings would look as if we had made it.
MADE = "tetflora_made"
VERSION = "tetflora_version"
#: Color of leaves where there is no other.
LEAF_GREEN = (0.1, 0.25, 0.05, 1.0)
#: Name of the group that `snow` makes.
SNOW = "TetFlora Snow"

Datablock = TypeVar("Datablock", bound=bpy.types.ID)


def tag(datablock: bpy.types.ID) -> None:
    """Mark a datablock as made by TetFlora, under the name that it has now; call it last, after naming."""
    datablock[MADE] = datablock.name


def untag(datablock: bpy.types.ID) -> None:
    """Hand a datablock over to the artist."""
    if MADE in datablock:
        del datablock[MADE]


def is_ours(datablock: bpy.types.ID) -> bool:
    """Whether TetFlora made a datablock and nobody took it over.

    A copy inherits custom properties but not the name, so copies and renamed datablocks count as the artist's.
    """
    return datablock.get(MADE) == datablock.name


def is_own(datablock: bpy.types.ID) -> bool:
    """Whether TetFlora may change or remove a datablock: it is ours, of this file, neither linked nor an override."""
    return is_ours(datablock) and datablock.library is None and datablock.override_library is None


def _get_or_create(
    collection: Any, name: str, version: int, new: Callable[[str], Datablock], build: Callable[[Datablock], None]
) -> Datablock:
    """The datablock of that name, built anew only if there is none or ours is of another version.

    What an artist edited or put there under this name comes back untouched. An outdated datablock of ours, which may be
    edited, gets another name and is the artist's; a linked one keeps its own.
    """
    existing = collection.get((name, None)) or collection.get(name)
    if existing is not None:
        if not is_ours(existing) or existing.get(VERSION) == version:
            return existing
        if existing.library is None:
            existing.name = f"{name} (version {existing.get(VERSION, 0)})"
    datablock = new(name)
    build(datablock)
    datablock[VERSION] = version
    tag(datablock)
    return datablock


class Term:
    """A number or a vector within a graph: arithmetic with others, with numbers and tuples adds nodes.

    A product of numbers waits for what is added to it: both together are one node.
    """

    def __init__(self, graph: "Graph", socket: bpy.types.NodeSocket | None, factors: tuple[Any, ...] = ()) -> None:
        self._graph, self._socket, self._factors = graph, socket, factors

    @property
    def socket(self) -> bpy.types.NodeSocket:
        """The output that gives it."""
        if self._socket is None:
            self._socket = self._graph.math('MULTIPLY', *self._factors).socket
        return self._socket

    @property
    def is_vector(self) -> bool:
        """Whether it is a vector or a color."""
        return self._socket is not None and self._socket.type != 'VALUE'

    def _with(self, operation: str, *others: Any, turned: bool = False) -> Self:
        values = (*others, self) if turned else (self, *others)
        vectors = any(isinstance(v, tuple) or (isinstance(v, Term) and v.is_vector) for v in values)
        return (self._graph.vector if vectors else self._graph.math)(operation, *values)

    def __add__(self, other: Any) -> Self:
        for product, rest in ((self, other), (other, self)):
            if isinstance(product, Term) and product._socket is None:
                return self._graph.math('MULTIPLY_ADD', *product._factors, rest)
        return self._with('ADD', other)

    def __mul__(self, other: Any) -> Self:
        vectors = [isinstance(v, tuple) or (isinstance(v, Term) and v.is_vector) for v in (self, other)]
        if not any(vectors):
            return Term(self._graph, None, (self, other))
        vector, factor = (self, other) if vectors[0] else (other, self)
        return self._graph.vector('MULTIPLY' if all(vectors) else 'SCALE', vector, factor)

    __radd__, __rmul__ = __add__, __mul__

    __sub__, __rsub__ = partialmethod(_with, 'SUBTRACT'), partialmethod(_with, 'SUBTRACT', turned=True)
    __truediv__, __rtruediv__ = partialmethod(_with, 'DIVIDE'), partialmethod(_with, 'DIVIDE', turned=True)
    __pow__, __abs__ = partialmethod(_with, 'POWER'), partialmethod(_with, 'ABSOLUTE')
    __lt__, __gt__ = partialmethod(_with, 'LESS_THAN'), partialmethod(_with, 'GREATER_THAN')

    def __neg__(self) -> Self:
        return self * -1.0


Terms = dict[str, Term]
#: Name and kind of each output of a group; what makes the group of its inputs, and returns what its outputs show.
Sockets = Sequence[tuple[str, str]]
Build = Callable[["Graph", Terms], dict[str, Any]]


class Graph:
    """A node tree under construction, which is emptied first if it is to be fresh.

    Sockets are found by identifier or, of groups, by name: identifiers stayed where 5.x renamed "Fac" to "Factor".
    """

    def __init__(self, tree: bpy.types.NodeTree, fresh: bool = True) -> None:
        self.tree = tree
        if fresh:
            tree.nodes.clear()

    def node(self, kind: str, inputs: dict[str, Any] | None = None, **settings: Any) -> bpy.types.Node:
        """Add a node, set its properties, and link or set its inputs: a value, a term, a socket, or a node's first."""
        node = self.tree.nodes.new(kind)
        for key, value in settings.items():
            if getattr(node, key) != value:  # Blender looks through the whole tree after each change
                setattr(node, key, value)
        for key, value in (inputs or {}).items():
            self.feed(find_socket(node.inputs, key), value)
        return node

    def outputs(self, kind: str, inputs: dict[str, Any] | None = None, **settings: Any) -> dict[str, Term]:
        """Outputs of a new node, by name and by identifier."""
        terms = [(socket, Term(self, socket)) for socket in self.node(kind, inputs, **settings).outputs]
        return {socket.name: term for socket, term in terms} | {socket.identifier: term for socket, term in terms}

    def feed(self, socket: bpy.types.NodeSocket, value: Any) -> None:
        """Link a socket to a term, to another socket or to a node's first output, or set its value."""
        if isinstance(value, bpy.types.Node):
            value = value.outputs[0]
        if isinstance(value, Term | bpy.types.NodeSocket):
            self.tree.links.new(value.socket if isinstance(value, Term) else value, socket)
        elif not (isinstance(value, float | int) and isinstance(socket.default_value, float)) or (
            socket.default_value != value  # as Blender stores it
        ):
            socket.default_value = value

    def part(self, name: str, version: int, given: Terms, outputs: Sockets, build: Build) -> Terms:
        """Outputs of a `node_group` fed with terms; Blender builds two trees of half the nodes in half the time."""
        inputs = [(key, 'Vector' if term.is_vector else 'Float') for key, term in given.items()]
        return self.outputs("ShaderNodeGroup", given, node_tree=node_group(name, version, inputs, outputs, build))

    def attribute(self, name: str, output: str) -> Term:
        """Output ``'Color'``, ``'Vector'`` or ``'Fac'`` of a mesh attribute."""
        return self.outputs("ShaderNodeAttribute", attribute_name=name)[output]

    def value(self, number: float) -> Term:
        """A number for an input that has to be linked."""
        socket = self.node("ShaderNodeValue").outputs[0]
        socket.default_value = number
        return Term(self, socket)

    def math(self, operation: str, *values: Any) -> Term:
        """Scalar operation on terms or numbers."""
        node = self.node("ShaderNodeMath", operation=operation)
        for socket, value in zip(node.inputs, values, strict=False):
            self.feed(socket, value)
        return Term(self, node.outputs[0])

    def vector(self, operation: str, *values: Any) -> Term:
        """Vector operation; ``'DOT_PRODUCT'``, ``'DISTANCE'``, ``'LENGTH'`` give a number, ``'SCALE'`` takes one."""
        node = self.node("ShaderNodeVectorMath", operation=operation)
        names = ("Vector", "Scale") if operation == 'SCALE' else ("Vector", "Vector_001")
        for key, value in zip(names, values, strict=False):
            self.feed(find_socket(node.inputs, key), value)
        number = operation in {'DOT_PRODUCT', 'DISTANCE', 'LENGTH'}
        return Term(self, find_socket(node.outputs, "Value" if number else "Vector"))

    def xyz(self, x: Any, y: Any, z: Any = 0.0) -> Term:
        """A vector of three numbers."""
        return Term(self, self.node("ShaderNodeCombineXYZ", {"X": x, "Y": y, "Z": z}).outputs[0])

    def parts(self, vector: Any) -> tuple[Term, Term, Term]:
        """Three numbers of a vector or a color."""
        outputs = self.outputs("ShaderNodeSeparateXYZ", {"Vector": vector})
        return outputs["X"], outputs["Y"], outputs["Z"]

    def mix(self, factor: Any, first: Any, second: Any) -> Term:
        """Mix two shaders; factor 0 gives the first."""
        node = self.node("ShaderNodeMixShader", {"Fac": factor, "Shader": first, "Shader_001": second})
        return Term(self, node.outputs[0])

    def mixed(self, factor: Any, a: Any, b: Any, **settings: Any) -> Term:
        """Colors mixed; those that are no terms are (r, g, b)."""
        inputs = {"Factor_Float": factor}
        for key, color in (("A_Color", a), ("B_Color", b)):
            inputs[key] = (*color[:3], 1.0) if isinstance(color, tuple) else color
        return self.outputs("ShaderNodeMix", inputs, data_type='RGBA', **settings)["Result_Color"]

    def tinted(self, color: Any, tint: Any) -> Term:
        """Product of two colors, at most 1 so that no surface returns more light than it gets."""
        return self.mixed(1.0, color, tint, blend_type='MULTIPLY', clamp_result=True)

    def scaled(self, color: Any, factor: Any) -> Term:
        """Color times a number, at most 1."""
        gray = self.node("ShaderNodeCombineColor", {"Red": factor, "Green": factor, "Blue": factor})
        return self.tinted(color, gray)

    def step(self, value: Any, low: Any, high: Any) -> Term:
        """0 under `low`, 1 over `high`, smooth between; falls where `low` is above `high`."""
        inputs = {"Value": value, "From Min": low, "From Max": high}
        return Term(self, self.node("ShaderNodeMapRange", inputs, interpolation_type='SMOOTHSTEP').outputs[0])

    def noise(
        self, place: Any, detail: float, roughness: float = 0.5, scale: float = 1.0, **settings: Any
    ) -> tuple[Term, Term]:
        """Fractal noise from 0 to 1, .5 on average: a number and three."""
        inputs = {"Vector": place, "Scale": scale, "Detail": detail, "Roughness": roughness}
        outputs = self.outputs("ShaderNodeTexNoise", inputs, **settings)
        return outputs["Fac"], outputs["Color"]

    def arrange(self) -> None:
        """Lay the nodes out in columns by their distance from the outputs, for whoever opens the editor."""
        nodes = list(self.tree.nodes)
        number = {node.as_pointer(): i for i, node in enumerate(nodes)}
        fed: dict[int, set[int]] = {here: set() for here in number.values()}
        for link in self.tree.links:
            fed[number[link.from_node.as_pointer()]].add(number[link.to_node.as_pointer()])
        column = [0] * len(nodes)
        for here in TopologicalSorter(fed).static_order():  # what it feeds comes first
            column[here] = max((column[target] + 1 for target in fed[here]), default=0)
        rows: dict[int, int] = {}
        places = []
        for place in column:
            places += (-220.0 * place, -200.0 * rows.get(place, 0))
            rows[place] = rows.get(place, 0) + 1
        self.tree.nodes.foreach_set("location", places)


def active_output(tree: bpy.types.NodeTree | None, kind: str) -> bpy.types.Node | None:
    """The output of a type, such as 'OUTPUT_MATERIAL', that counts in a tree, if there is one."""
    return next((n for n in tree.nodes if n.type == kind and n.is_active_output), None) if tree else None


def upstream(socket: bpy.types.NodeSocket) -> Iterator[bpy.types.Node]:
    """Nodes that feed a socket, nearest first, each once."""
    waiting, seen = [socket], set()
    while waiting:
        for link in waiting.pop(0).links:
            if link.from_node not in seen:
                seen.add(link.from_node)
                yield link.from_node
                waiting += list(link.from_node.inputs)


def find_socket(sockets: Any, key: str) -> bpy.types.NodeSocket:
    """Socket by identifier, else by name."""
    for attribute in ("identifier", "name"):
        for socket in sockets:
            if getattr(socket, attribute) == key:
                return socket
    raise KeyError(f"No socket {key} among {', '.join(socket.name for socket in sockets)}")


def node_group(
    name: str, version: int, inputs: Sequence[tuple], outputs: Sockets, build: Build, kind: str = "Shader"
) -> bpy.types.NodeTree:
    """A group of shader nodes, or of ``'Geometry'`` nodes, as `_get_or_create` finds or makes it.

    Parameters
    ----------
    inputs : sequence of tuple
        Name, kind (``'Float'``, ``'Color'``, ``'Vector'``, ...), default, and if needed a range and a description.
    outputs, build
        See `Sockets` and `Build`.
    """

    def fill(tree: bpy.types.NodeTree) -> None:
        for label, kind, *more in inputs:
            default, limits, description = (*more, *(None, None, "")[len(more) :])
            about = {"name": label, "description": description, "socket_type": f"NodeSocket{kind}"}
            socket = tree.interface.new_socket(in_out='INPUT', **about)
            if limits is not None:
                socket.min_value, socket.max_value = limits
            if default is not None:
                socket.default_value = default
        for output, kind in outputs:
            tree.interface.new_socket(name=output, in_out='OUTPUT', socket_type=f"NodeSocket{kind}")
        graph = Graph(tree)
        given = graph.outputs("NodeGroupInput") if inputs else {}
        graph.node("NodeGroupOutput", build(graph, given))
        graph.arrange()

    groups = bpy.data.node_groups
    return _get_or_create(groups, name, version, lambda name: groups.new(name, f"{kind}NodeTree"), fill)


def surface_material(name: str, version: int, build: Callable[[Graph, bpy.types.Material], None]) -> bpy.types.Material:
    """A material with nodes, as `_get_or_create` finds or makes it; `build` may change its viewport color."""

    def fill(material: bpy.types.Material) -> None:
        material.diffuse_color = LEAF_GREEN
        graph = Graph(shader_tree(material))
        build(graph, material)
        graph.arrange()

    return _get_or_create(bpy.data.materials, name, version, bpy.data.materials.new, fill)
