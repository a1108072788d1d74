# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each face of a mesh looks like from afar: colour, transmission and coverage, sampled from its materials.

A triangle is divided into smaller ones of equal size, as many as it covers texels (`look_points`). In the middle of
each, shaders and nodes are evaluated (`surface_shaders`, `node_values`), and images are means over a piece as large as
it (`image_pyramids`). Triangles with the same texture coordinates, as those of a leaf that was copied thousands of
times, are evaluated once.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..attributes import read, values_of
from ..compat import tree_in_use
from .colour_maths import luminance
from .look_points import Known, MeshLayers, Plan, find_out
from .means import GREY, Look
from .node_values import Notes
from .nodes import active_output, find_socket, upstream
from .surface_shaders import SurfaceShaders

#: Triangles that are worked on at once.
_TRIANGLES = 1 << 16
#: Points of all distinct triangles of these, about, and of a whole mesh if it has fewer.
_POINTS, _ALL_POINTS = 1 << 19, 1 << 22
_COLOURS = {'FLOAT_COLOR', 'BYTE_COLOR'}
_DOMAINS = {'POINT', 'CORNER', 'FACE'}
_TYPES = {'FLOAT', 'INT', 'INT8', 'BOOLEAN', 'FLOAT2', 'FLOAT_VECTOR', *_COLOURS}
_LEAST = 1e-4  # coverage below which a face has no colour of its own
_FAR = np.float32(1e6)  # texture coordinates and colours beyond it are no use
_ROUGH = 0.5  # of materials that do not say
_TINY = 1e-30  # added to areas, so that those of faces without any count alike


@dataclass(frozen=True)
class FaceLooks:
    """Looks of all faces of a mesh.

    Attributes
    ----------
    colour : (f, 3) float16
        Linear, the mean over what is not transparent.
    transmission : (f,) float16
        Fraction of scattered light that leaves on the other side; NaN where nobody knows.
    coverage : (f,) float16
        Fraction that is not transparent.
    roughness : (f,) float16
        Of the gloss of each face's material.
    """

    colour: NDArray[np.float16]
    transmission: NDArray[np.float16]
    coverage: NDArray[np.float16]
    roughness: NDArray[np.float16]


class FaceReader:
    """Reads looks of faces; images and means of materials are kept from one mesh to the next.

    Attributes
    ----------
    warnings : list of str
        What the artist should know, each once.
    """

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.known = Known()

    def prepare(self, mesh: bpy.types.Mesh, materials: list[bpy.types.Material | None]) -> MeshLooks:
        """Read all that the looks of a mesh follow from, so that it need not be there any more afterwards."""
        made = MeshLooks(mesh, materials, self.known)
        self.warn(problem for plan in made.plans for problem in plan.notes.problems)
        return made

    def warn(self, problems: Iterable[str]) -> None:
        """Add those warnings that are new."""
        for problem in problems:
            if problem not in self.warnings:
                self.warnings.append(problem)


class MeshLooks:
    """The looks of one mesh, evaluated piece by piece.

    Attributes
    ----------
    materials : list of bpy.types.Material or None
    plans : list of Plan
        One for each material.
    """

    def __init__(self, mesh: bpy.types.Mesh, materials: list[bpy.types.Material | None], known: Known) -> None:
        maps = mesh.uv_layers
        first = next((layer.name for layer in maps if layer.active_render), maps[0].name if len(maps) else "")
        types = {a.name: a.data_type for a in mesh.attributes if a.domain in _DOMAINS and a.data_type in _TYPES}
        self._known, self._layers = known, MeshLayers(first, types)
        self.materials = materials
        self.plans = [_plan_of(material, self._layers, known) for material in materials]
        self._values: dict[str, tuple[str, NDArray]] = {}
        for name in {name for plan in self.plans for name in plan.names}:
            attribute = mesh.attributes[name]
            values = values_of(attribute, "color" if attribute.data_type in _COLOURS else "")
            self._values[name] = attribute.domain, values.reshape(len(values), -1)
        # Without the attribute all faces are of the first slot.
        self._slot = read(mesh, "material_index") if "material_index" in types and len(materials) > 1 else None

    @property
    def first_map(self) -> str:
        """The UV map that renders first; '' if there is none."""
        return self._layers.first

    @property
    def needs_baking(self) -> list[int]:
        """Slots whose materials have nodes that only a renderer knows."""
        return [slot for slot, plan in enumerate(self.plans) if plan.notes.needs_baking]

    def slots(self, start: int, end: int) -> NDArray[np.int32]:
        """Slot of some faces."""
        if self._slot is None:
            return np.zeros(end - start, np.int32)
        return np.clip(self._slot[start:end], 0, len(self.plans) - 1)

    def steps(
        self,
        faces: int,
        positions: NDArray[np.float32],
        loops: NDArray[np.int32],
        corner_verts: NDArray[np.int32],
        face: NDArray[np.int32],
    ) -> Generator[float, None, FaceLooks]:
        """Evaluate all faces; yields the fraction that is done.

        Parameters
        ----------
        faces : int
        positions : (v, 3) float32
        loops : (t, 3) int32
            Corners of each triangle.
        corner_verts : (c,) int32
        face : (t,) int32
            Ascending.
        """
        made = FaceLooks(np.zeros((faces, 3), np.float16), *(np.ones(faces, np.float16) for _ in range(3)))
        if not any(plan.names for plan in self.plans):
            constant = np.array([plan.constant for plan in self.plans])
            for low in range(0, faces, _TRIANGLES):
                slot = self.slots(low, min(low + _TRIANGLES, faces))
                self._write(made, slice(low, low + len(slot)), constant[slot], slot)
            return made
        most = max(_POINTS, _ALL_POINTS // -(-len(face) // _TRIANGLES)) if len(face) else 0
        end = 0
        while end < len(face):
            start, end = end, min(end + _TRIANGLES, len(face))
            end = int(np.searchsorted(face, face[end - 1], side="right"))  # faces are not divided
            low, high = int(face[start]), int(face[end - 1]) + 1
            chosen = loops[start:end]
            verts = np.take(corner_verts, chosen)
            of_face = face[start:end] - low
            slot = self.slots(low, high)
            values = self._triangles(chosen, verts, face[start:end], slot[of_face], most)
            if high - low < end - start:
                values = _by_face(values, of_face, _areas(positions, verts), high - low)
            self._write(made, slice(low, high), values, slot)
            yield end / len(face)
        return made

    def _write(self, made: FaceLooks, faces: slice, values: NDArray[np.floating], slot: NDArray[np.int32]) -> None:
        """Means over what is not transparent, from those over whole faces (n, 5)."""
        plain = np.array([plan.constant[1:4] / max(plan.constant[0], _LEAST) for plan in self.plans], np.float32)
        known = np.array([plan.known for plan in self.plans])
        cover, colour, through = values[:, 0], values[:, 1:4], values[:, 4]
        light = luminance(colour.T)
        passed = np.divide(through, light, out=np.zeros_like(light), where=light > 1e-6)
        colour = np.where((cover > _LEAST)[:, None], colour / np.maximum(cover, _LEAST)[:, None], plain[slot])
        made.colour[faces] = np.clip(colour, 0, 1)
        made.coverage[faces] = np.clip(cover, 0, 1)
        made.roughness[faces] = np.array([roughness_of(material) for material in self.materials])[slot]
        made.transmission[faces] = np.where(known[slot], np.clip(passed, 0, 1), np.nan)

    def _triangles(
        self, loops: NDArray, verts: NDArray, face: NDArray[np.int32], slot: NDArray[np.int32], most: int
    ) -> NDArray[np.float32]:
        """Means (t, 5) over some triangles, see `Plan.constant`."""
        values = np.array([plan.constant for plan in self.plans])[slot]
        for number in np.unique(slot).tolist():
            plan = self.plans[number]
            rows = slice(None) if len(self.plans) == 1 else np.flatnonzero(slot == number)
            if plan.names:
                corners = {name: self._corners(name, loops[rows], verts[rows], face[rows]) for name in plan.names}
                values[rows] = plan.sampled(corners, self._layers, self._known, most)
        return values

    def _corners(self, name: str, loops: NDArray, verts: NDArray, face: NDArray) -> NDArray[np.float32]:
        """Values of an attribute at the corners of some triangles: (t, 3, width)."""
        domain, values = self._values[name]
        rows = {'FACE': np.broadcast_to(face[:, None], loops.shape), 'CORNER': loops}.get(domain, verts)
        found = np.nan_to_num(np.take(values, rows, axis=0).astype(np.float32, copy=False), posinf=0, neginf=0)
        return np.clip(found, -_FAR, _FAR, out=found)


def roughness_of(material: bpy.types.Material | None) -> float:
    """Roughness of a material's gloss, that of its first shader with one; half where nodes feed it."""
    output = None if material is None else active_output(tree_in_use(material), 'OUTPUT_MATERIAL')
    for node in () if output is None else upstream(find_socket(output.inputs, "Surface")):
        if node.type in {'BSDF_PRINCIPLED', 'EEVEE_SPECULAR', 'BSDF_GLOSSY'}:
            rough = find_socket(node.inputs, "Roughness")
            return _ROUGH if rough.is_linked else float(np.clip(rough.default_value, 0.0, 1.0))
    return _ROUGH


def _plan_of(material: bpy.types.Material | None, layers: MeshLayers, known: Known) -> Plan:
    """Find out how to evaluate a material."""
    notes = Notes()
    if material is None:
        return Plan("", notes, _constant(Look(GREY)))
    shaders = SurfaceShaders(material, known.looks, notes)
    plan = Plan(material.name, notes, _constant(shaders.plain), shaders.at)
    find_out(plan, layers, known)
    return plan


def _constant(look: Look) -> NDArray[np.float32]:
    return np.array([look.coverage, *np.multiply(look.colour, look.coverage), 0.0], np.float32)


def _areas(positions: NDArray[np.float32], verts: NDArray[np.int32]) -> NDArray[np.float64]:
    a, b, c = (np.take(positions, column, axis=0).astype(np.float64) for column in verts.T)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) + _TINY


def _by_face(
    values: NDArray[np.float32], face: NDArray[np.int32], areas: NDArray[np.float64], faces: int
) -> NDArray[np.float64]:
    """Means (n, 5) over faces of those over their triangles."""
    total = np.maximum(np.bincount(face, areas, faces), _TINY)
    return np.stack([np.bincount(face, column * areas, faces) for column in values.T], axis=1) / total[:, None]
