# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arithmetic with terms of a graph adds the nodes that it says."""

import bpy
import pytest

from tetflora_addon.blender.materials.nodes import Graph, Term


@pytest.fixture
def graph():
    return Graph(bpy.data.node_groups.new("terms", "ShaderNodeTree"))


def made(graph):
    return sorted(node.operation for node in graph.tree.nodes if hasattr(node, "operation"))


def test_a_product_and_what_is_added_are_one_node(graph):
    x, y = graph.value(2.0), graph.value(3.0)
    assert isinstance((y + x * 0.5).socket, bpy.types.NodeSocket)
    assert made(graph) == ['MULTIPLY_ADD']


def test_a_product_that_is_asked_for_twice_is_one_node(graph):
    product = graph.value(2.0) * 3.0
    graph.math('SINE', product)
    graph.math('COSINE', product)
    assert made(graph) == ['COSINE', 'MULTIPLY', 'SINE']


def test_numbers_before_a_term_keep_their_place(graph):
    x = graph.value(2.0)
    for term, operation in ((1.0 - x, 'SUBTRACT'), (1.0 / x, 'DIVIDE')):
        node = term.socket.node
        assert node.operation == operation
        assert node.inputs[0].default_value == 1.0
        assert node.inputs[1].is_linked


def test_vectors_scale_by_numbers_and_multiply_by_vectors(graph):
    vector = graph.xyz(1.0, 2.0, 3.0)
    assert [(vector * other).socket.node.operation for other in (0.5, graph.value(2.0), (1.0, 2.0, 3.0), vector)] == [
        'SCALE',
        'SCALE',
        'MULTIPLY',
        'MULTIPLY',
    ]
    assert isinstance((1.0, 0.0, 0.0) + vector, Term)
    assert ((1.0, 0.0, 0.0) * graph.value(2.0)).socket.node.operation == 'SCALE'
