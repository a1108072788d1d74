# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves and blossoms that are the artist's mesh objects: their polygons and materials."""

from dataclasses import replace
from itertools import pairwise
from math import tau

import bpy
import numpy as np

from ...arrays import connected
from ...errors import SpeciesError
from ...leaves.models import LeafModel, leaf_model
from ...leaves.outlines import Blade
from ...leaves.surfaces import Compound, Needles
from ...species.kinds import species_of
from ...species.species import LEAF_KINDS, Species
from ..attributes import mesh_of
from ..materials.materials import bark_material, leaf_material
from ..materials.nodes import is_ours
from ..scene.ages import drawn_species
from ..species.edits import species_for
from .meshes import read_mesh
from .output import replaced_material

#: Transmission under which leaves are needles, scales or succulent.
_THICK = 0.2
#: Width over length: under the first, veins are parallel; under the second, leaves are narrow; over the third, palmate.
_PARALLEL, _NARROW, _PALMATE = 0.15, 0.3, 0.95
#: Area over that of the convex hull, under which a leaf is lobed.
_LOBED = 0.86
#: Parallel veins across a blade.
_ACROSS = 11.0
#: Most teeth of one side in which veins end; width over the distance of others, as of birches; relief of their blades.
_FEW, _APART, _FLAT = 10, 5.4, 0.012
_DIRECTIONS = tau * np.arange(48) / 48


def _species_leaf_material(species: Species, kind: str) -> bpy.types.Material:
    """TetFlora's own material for the leaves or blossoms of a species, resolved or not."""
    forms = species.forms(kind)
    model = forms[0] if isinstance(forms[0], LeafModel) else None
    through = species.leaf_transmission if kind == "leaf" else species.blossom_transmission
    leaflet = model.shape.length if model is not None and isinstance(model.shape, Compound) else 1.0
    looks = {"leaf_length": leaflet * _length(species, kind)}
    blade = "pinnate" if model is None else _blade_kind(model, through, kind)
    if model is not None:
        looks |= _venation(model, blade)
    return leaf_material(species.name if kind == "leaf" else f"{species.name} {kind}", blade, **looks)


def _blade_kind(model: LeafModel, transmission: float, kind: str = "leaf") -> str:
    """One of `blade.BLADES` for a leaf model, by its outline, else by its UV map: the pattern lies in that."""
    if transmission < _THICK or isinstance(model.shape, Needles):
        return "needle" if kind == "leaf" else "plain"
    if kind != "leaf":
        return "petal"
    outline = _outline(model)
    if outline is not None:
        return "palmate" if outline.palmate else _simple(outline.width, outline.lobes > 0)
    width, length = np.ptp(model.uv, axis=0)
    if _leaflets(model, length):
        return "plain"
    ratio = width / max(length, 1e-6)
    return "palmate" if ratio > _PALMATE else _simple(ratio, _filled(model) < _LOBED)


def _simple(ratio: float, lobed: bool) -> str:
    """Blade of a leaf with one midrib, by width over length."""
    if ratio < _NARROW:
        return "parallel" if ratio < _PARALLEL else "narrow"
    return "lobed" if lobed else "pinnate"


def _outline(model: LeafModel) -> Blade | None:
    """Outline of the leaf or of its leaflets, each of which has the whole UV map."""
    shape = model.shape.leaflet if isinstance(model.shape, Compound) else model.shape
    return shape if isinstance(shape, Blade) else None


def _venation(model: LeafModel, blade: str) -> dict[str, float]:
    """Veins to a leaf's length: they end in lobes or few teeth, and the blade swells between them; others are flat."""
    outline = _outline(model)
    if blade == "parallel":
        return {"veins": _ACROSS / max(np.ptp(model.uv[:, 0]) if outline is None else outline.width, 1e-3)}
    if outline is None or blade not in ("lobed", "pinnate"):
        return {}
    ends = outline.lobes if blade == "lobed" else outline.teeth
    if 3 <= ends <= _FEW:
        return {"veins": 1.15 * (ends + 0.5)}
    return {"veins": 1.15 * (min(_APART / outline.width, _FEW) + 0.5), "relief": _FLAT}


def _leaflets(model: LeafModel, length: float) -> bool:
    """Whether most faces are much shorter than the leaf and there are many, as of compound leaves and fronds."""
    along = model.uv[:, 1]
    starts = model.face_offsets[:-1]
    spans = np.maximum.reduceat(along, starts) - np.minimum.reduceat(along, starts)
    if len(spans) < 8 or np.median(spans) >= 0.4 * length:
        return False
    return len(np.unique(connected(len(model.positions), *model.edges[0].T))) >= 4  # parts that share no vertex


def _filled(model: LeafModel) -> float:
    """Area in the UV map over that of its convex hull."""
    u, v = model.uv.T.astype(np.float64)
    area = abs(np.add.reduceat(u * v[model.next_corner] - v * u[model.next_corner], model.face_offsets[:-1])).sum() / 2
    ends = (model.uv @ np.stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])).argmax(axis=0)
    x, y = u[ends], v[ends]
    hull = abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2
    return float(area / max(hull, 1e-12))


def _length(species: Species, kind: str) -> float:
    """Mean length of leaves of a kind, meters."""
    every = [*species.orders, *([] if species.spur is None else [species.spur])]
    bearing = [order for order in every if order.leaf_kind == kind and order.leaves.mean > 0]
    sizes = [order.leaf_size.mean * (1.0 + order.leaf_size_tip) / 2.0 for order in bearing]
    return float(np.mean(sizes)) if sizes else 0.1


_COLORED = "tetflora_colored"  # on materials whose viewport color is set; another is the artist's choice


def leaf_objects(scene: bpy.types.Scene) -> dict[str, bpy.types.Object]:
    """Mesh objects that replace the leaves of species, by the species' identifier."""
    return {entry.species: entry.leaf for entry in scene.tetflora.leaf_objects if entry.species and entry.leaf}


def resolved_species(scene: bpy.types.Scene, kind_of_plant: str, depsgraph: bpy.types.Depsgraph) -> Species:
    """A species with polygons and a skeleton in place of the names of objects.

    Raises
    ------
    SpeciesError
        Unknown or broken species, an object that is missing or not a mesh with faces, or a form without edges.
    """
    species = drawn_species(scene, kind_of_plant, depsgraph)
    if (chosen := leaf_objects(scene).get(species_of(kind_of_plant))) is not None:
        species = replace(species, leaf=(_model_of(species, chosen, depsgraph, "leaf"),))
    for kind in LEAF_KINDS:
        forms = getattr(species, kind)
        if any(isinstance(form, str) for form in forms):
            models = (_named(species, f, depsgraph, kind) if isinstance(f, str) else f for f in forms)
            species = replace(species, **{kind: tuple(models)})
    return species


def _named(species: Species, form: str, depsgraph: bpy.types.Depsgraph, kind: str) -> LeafModel:
    obj = bpy.data.objects.get(form)
    if obj is None:
        raise SpeciesError(
            f'Species "{species.name}" uses the object "{form}" as its {kind}, but this file has no such object. '
            "Add a mesh object with this name, or choose one under Leaf Objects"
        )
    return _model_of(species, obj, depsgraph, kind)


def _model_of(species: Species, source: bpy.types.Object, depsgraph: bpy.types.Depsgraph, kind: str) -> LeafModel:
    if source.type != 'MESH':
        raise SpeciesError(f'"{source.name}", the {kind} of "{species.name}", is not a mesh object; choose a mesh')
    with mesh_of(source.evaluated_get(depsgraph)) as mesh:
        arrays = read_mesh(mesh, [slot.material for slot in source.material_slots] or [None])
    if len(arrays.slots) == 0:
        raise SpeciesError(f'"{source.name}", the {kind} of "{species.name}", has no faces; choose a mesh with faces')
    offsets, corners = arrays.face_offsets, arrays.corner_verts
    model = leaf_model(arrays.positions, [corners[a:b].tolist() for a, b in pairwise(offsets)])
    if uv_map := arrays.rendered[0]:
        model = replace(model, uv=arrays.layers[uv_map].values, textured=True)
    return replace(model, material_index=arrays.slots) if arrays.slots.any() else model


def materials_of(scene: bpy.types.Scene, species: Species, kind: str, form: int) -> list[bpy.types.Material]:
    """Materials for polygons of a kind: the artist's for the species, else a leaf object's own, else TetFlora's.

    Parameters
    ----------
    species : Species
        Resolved or not; its identifier determines where its leaves come from.
    kind : str
        ``'bark'`` or one of `LEAF_KINDS`.
    form : int
        Which form of leaf.
    """
    replaced = replaced_material(scene, species.identifier, kind)
    if replaced is not None:
        return [replaced]
    if kind == "bark":
        dead = species.aged is not None and species.bark != species.aged[0].bark
        return [_in_viewports(bark_material(species.name + " dead" * dead, species.bark), species, kind)]
    materials = _brought(scene, species.identifier, kind, form)
    return materials if any(materials) else [_in_viewports(_species_leaf_material(species, kind), species, kind)]


def brought_materials(scene: bpy.types.Scene, kind_of_plant: str) -> list[list[str]]:
    """Names of the materials of a species' leaf objects, form by form and slot by slot."""
    identifier = species_of(kind_of_plant)
    forms = [(k, n) for k in LEAF_KINDS for n in range(len(species_for(scene, identifier).forms(k)))]
    return [[getattr(m, "name_full", "") for m in _brought(scene, identifier, kind, form)] for kind, form in forms]


def _brought(scene: bpy.types.Scene, identifier: str, kind: str, form: int) -> list[bpy.types.Material | None]:
    """Materials of the leaf object of a form, slot by slot; empty without one."""
    source = leaf_objects(scene).get(identifier) if kind == "leaf" else None
    if source is None:
        named = species_for(scene, identifier).forms(kind)[form]
        source = bpy.data.objects.get(named) if isinstance(named, str) else None
    return [slot.material for slot in source.material_slots] if source is not None else []


def _in_viewports(material: bpy.types.Material, species: Species, kind: str) -> bpy.types.Material:
    """The material, with the mean color of the species for solid viewports and exports without nodes."""
    if is_ours(material) and material.get(_COLORED) is None:
        material[_COLORED] = True
        every = [*species.orders, *([] if species.spur is None else [species.spur])]
        orders = [order for order in every if kind == "bark" or order.leaf_kind == kind]
        if orders and kind == "bark":
            material.diffuse_color = (*orders[0].branch_color.mean, 1.0)
        elif orders:
            inside, outside = orders[-1].leaf_color.mean, orders[-1].leaf_color_tip
            material.diffuse_color = (*((a + b) / 2.0 for a, b in zip(inside, outside, strict=True)), 1.0)
    return material
