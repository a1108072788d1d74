# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves and blossoms that are the artist's mesh objects: their polygons and materials."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from itertools import pairwise

import bpy

from ...errors import SpeciesError
from ...leaves.models import LeafModel, leaf_model
from ...species.species import LEAF_KINDS, Species
from ..attributes import evaluated_mesh
from ..materials.materials import bark_material, bark_steps
from ..materials.nodes import is_ours
from ..scene.skeletons import form_of, read_skeleton, species_of
from ..species.edits import species_for
from .leaf_blades import species_leaf_material
from .meshes import UV_MAP, read_mesh_arrays
from .output import replaced_material

_INDEX = "material_index"
_COLOURED = "tetflora_coloured"  # on materials whose viewport colour is set; another is the artist's choice


def leaf_objects(scene: bpy.types.Scene) -> dict[str, bpy.types.Object]:
    """Mesh objects that replace the leaves of species, by the species' identifier."""
    return {entry.species: entry.leaf for entry in scene.tetflora.leaf_objects if entry.species and entry.leaf}


def resolved_species(scene: bpy.types.Scene, kind_of_plant: str, depsgraph: bpy.types.Depsgraph) -> Species:
    """A species with polygons and a skeleton in place of the names of objects.

    Parameters
    ----------
    kind_of_plant : str
        See `scene.skeletons.kind_of`.

    Raises
    ------
    SpeciesError
        Unknown or broken species, an object that is missing or not a mesh with faces, or a form without edges.
    """
    identifier, form = species_of(kind_of_plant), form_of(kind_of_plant)
    species = species_for(scene, identifier)
    if form is not None:
        species = replace(species, form=read_skeleton(form, depsgraph))
    chosen = leaf_objects(scene).get(identifier)
    if chosen is not None:
        species = replace(species, leaf=(_model_of(species, chosen, depsgraph, "leaf"),))
    for kind in LEAF_KINDS:
        forms = getattr(species, kind)
        if any(isinstance(form, str) for form in forms):
            models = (_named(species, f, depsgraph, kind) if isinstance(f, str) else f for f in forms)
            species = replace(species, **{kind: tuple(models)})
    return species


def _named(species: Species, form: str, depsgraph: bpy.types.Depsgraph, kind: str) -> LeafModel:
    found = bpy.data.objects.get(form)
    if found is None:
        raise SpeciesError(
            f'Species "{species.name}" uses the object "{form}" as its {kind}, but this file has no such object. '
            "Add a mesh object with this name, or choose one under Leaf Objects"
        )
    return _model_of(species, found, depsgraph, kind)


def _model_of(species: Species, source: bpy.types.Object, depsgraph: bpy.types.Depsgraph, kind: str) -> LeafModel:
    if source.type != 'MESH':
        raise SpeciesError(f'"{source.name}", the {kind} of "{species.name}", is not a mesh object; choose a mesh')
    with evaluated_mesh(source, depsgraph) as mesh:
        arrays = read_mesh_arrays(mesh)
    if arrays.polygons == 0:
        raise SpeciesError(
            f'"{source.name}", the {kind} of "{species.name}", has no faces; add faces or choose another mesh'
        )
    offsets, corners = arrays.face_offsets, arrays.corner_verts
    faces = [corners[a:b].tolist() for a, b in pairwise(offsets)]
    model = leaf_model(arrays.positions, faces)
    if UV_MAP in arrays.attributes:
        model = replace(model, uv=arrays.attributes[UV_MAP][1], textured=True)
    if len(source.material_slots) > 1 and _INDEX in arrays.attributes:
        model = replace(model, material_index=arrays.attributes[_INDEX][1])
    return model


def materials_of(scene: bpy.types.Scene, species: Species, kind: str, form: int) -> list[bpy.types.Material]:
    """Materials for polygons of a kind: the artist's for the species, else a leaf object's own, else TetFlora's.

    Parameters
    ----------
    scene : bpy.types.Scene
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
        return [_in_viewports(bark_material(species.name, species.bark), species, kind)]
    own = _brought(scene, species.identifier, kind, form)
    if any(own):
        return own
    return [_in_viewports(species_leaf_material(species, kind), species, kind)]


def material_steps(
    scene: bpy.types.Scene, species: Species, kind: str, form: int
) -> Generator[None, None, list[bpy.types.Material]]:
    """`materials_of` in steps."""
    if kind == "bark" and replaced_material(scene, species.identifier, kind) is None:
        yield from bark_steps(species.name, species.bark)
    return materials_of(scene, species, kind, form)


def brought_materials(scene: bpy.types.Scene, kind_of_plant: str) -> list[list[str]]:
    """Names of the materials of a species' leaf objects, form by form and slot by slot."""
    identifier = species_of(kind_of_plant)
    forms = [(k, n) for k in LEAF_KINDS for n in range(len(species_for(scene, identifier).forms(LEAF_KINDS.index(k))))]
    return [[getattr(m, "name_full", "") for m in _brought(scene, identifier, kind, form)] for kind, form in forms]


def _brought(scene: bpy.types.Scene, identifier: str, kind: str, form: int) -> list[bpy.types.Material | None]:
    """Materials of the leaf object of a form, slot by slot; empty without one."""
    source = leaf_objects(scene).get(identifier) if kind == "leaf" else None
    if source is None:
        named = species_for(scene, identifier).forms(LEAF_KINDS.index(kind))[form]
        source = bpy.data.objects.get(named) if isinstance(named, str) else None
    return [slot.material for slot in source.material_slots] if source is not None else []


def _in_viewports(material: bpy.types.Material, species: Species, kind: str) -> bpy.types.Material:
    """The material, with the mean colour of the species for solid viewports and exports without nodes."""
    if is_ours(material) and material.get(_COLOURED) is None:
        material[_COLOURED] = True
        every = [*species.orders, *([] if species.spur is None else [species.spur])]
        orders = [order for order in every if kind == "bark" or order.leaf_kind == kind]
        if orders and kind == "bark":
            material.diffuse_color = (*orders[0].branch_colour.mean, 1.0)
        elif orders:
            inside, outside = orders[-1].leaf_colour.mean, orders[-1].leaf_colour_tip
            material.diffuse_color = (*((a + b) / 2.0 for a, b in zip(inside, outside, strict=True)), 1.0)
    return material
