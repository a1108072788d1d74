# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Near leaves get the detail that the picture asks for: by size alone, as budgeted, and far ones stay as they were."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tests.engine.subplants.test_leaf_meshes import check_topology
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.emission.budget import fit_to_budget
from tetflora_addon.emission.plants import LeafDetail, Transition, expanded_blocks
from tetflora_addon.growth.growth import WholeBranches
from tetflora_addon.leaves.levels import coarse_error, leaf_levels
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.members import expected_polygons
from tetflora_addon.species.quality import with_quality
from tetflora_addon.subplants.leaf_meshes import leaf_meshes
from tetflora_addon.subplants.pieces import Pieces
from tetflora_addon.subplants.tubes import tube_faces


@cache
def tree(name: str) -> tuple[Flora, Pieces]:
    """A shipped tree, and its branches; of fewer and larger leaves than it is shipped with, where it has many."""
    species = load_species(name)
    flora = compile_species([with_quality(species, min(support.MOST_POLYGONS / expected_polygons(species), 1.0))])
    return flora, support.grown(flora, support.plants(3))[1]


def near(distance: float, name: str = "oak", pixels: int = 400) -> tuple:
    """A tree and a camera so far from its middle."""
    flora, pieces = tree(name)
    target = pieces.end[len(pieces) // 2]
    camera = support.camera(tuple(target + [0.0, -distance, 0.0]), tuple(target), pixels=pixels, view=0.6)
    return flora, camera, support.plants(3), pieces


def leaves(blocks) -> list[MeshBuffers]:
    return [block.buffers for block in blocks if block.kind != "bark"]


def polygons(meshes: list[MeshBuffers]) -> int:
    return sum(mesh.polygons for mesh in meshes)


def area(meshes: list[MeshBuffers]) -> float:
    return float(sum(support.face_areas(mesh).sum() for mesh in meshes))


def test_leaves_far_away_are_their_models() -> None:
    """To the bit, with and without a camera."""
    flora, _, seeds, _ = near(1.0)
    far = support.camera((0, -400, 5), (0, 0, 5), pixels=400)
    for one, other in zip(
        leaves(expanded_blocks(flora, seeds)), leaves(expanded_blocks(flora, seeds, far)), strict=True
    ):
        assert one.positions.tobytes() == other.positions.tobytes()
        assert one.corner_verts.tobytes() == other.corner_verts.tobytes()


@pytest.mark.parametrize("name", ["oak", "birch"])
def test_near_leaves_are_finer_and_keep_their_area(name: str) -> None:
    """Each leaf is there once: together they have the area of the models."""
    flora, camera, seeds, _ = near(2.5, name, 200)
    plain, fine = leaves(expanded_blocks(flora, seeds)), leaves(expanded_blocks(flora, seeds, camera))
    assert polygons(fine) > 1.3 * polygons(plain)
    assert area(fine) == pytest.approx(area(plain), rel=0.02)  # petioles have two sides
    assert any(mesh.smooth for mesh in fine)
    for mesh in fine:
        check_topology(mesh)


def test_the_nearer_the_finer_and_never_too_many() -> None:
    """Polygons follow the pixels of leaves, and are bounded by those of the finest level."""
    counts = []
    for distance in (30.0, 8.0, 2.0):
        flora, camera, seeds, _ = near(distance)
        counts.append(polygons(leaves(expanded_blocks(flora, seeds, camera))))
    assert counts == sorted(counts)
    assert counts[-1] < 0.1 * flora.leaf_count[0] * leaf_levels(flora.forms[0][0][0])[-1].model.polygons


def test_levels_do_not_depend_on_the_order() -> None:
    """Branches of a crown in any order, all or one by one, give the same leaves."""
    flora, camera, _, pieces = near(1.0)
    whole = support.whole_of(flora, pieces)
    detail = LeafDetail(flora, camera)
    whole = whole.take(np.flatnonzero(detail.lengths(whole) > 0)[:60])

    def places(some: list[WholeBranches]) -> np.ndarray:
        found = np.concatenate([mesh.buffers.positions for mesh in leaf_meshes(flora, 0, some, None, detail.lengths)])
        return found[np.lexsort(found.T)]

    every, turned = places([whole]), places([whole.take(np.arange(len(whole))[::-1])])
    assert len(every) > 1000
    assert every.tobytes() == turned.tobytes()
    assert every.tobytes() == places([whole.take(np.array([i])) for i in range(len(whole))]).tobytes()


def test_lengths_are_those_in_the_image() -> None:
    """Never shorter than where leaves are, not much longer where they are not near; 0 only where models suffice."""
    flora, camera, _, pieces = near(3.0)
    whole = support.whole_of(flora, pieces)
    lengths = LeafDetail(flora, camera).lengths(whole)
    size = flora.rows["leaf_size"][whole.branches.row].sum(axis=1) * whole.branches.scale
    knots = whole.lines.knots
    extent = camera.extent_around(knots.reshape(-1, 3)).reshape(len(whole), -1).min(axis=1)
    seen = size / extent / 0.5
    some = lengths > 0
    assert some.any()
    assert (lengths[some] >= seen[some]).all()
    assert (lengths[some] < 1.5 * seen[some]).mean() > 0.8
    error = max(coarse_error(model) for models in flora.forms[0] for model in models)
    assert (seen[~some] * error <= 1.0).all()


def test_what_is_out_of_view_is_coarse() -> None:
    """Of giants beside a small picture, millions of polygons were made: only shadows of what is beside it are seen."""
    flora, camera, _, pieces = near(25.0, pixels=6000)
    whole = support.whole_of(flora, pieces)
    aside = support.camera(camera.eye, camera.eye + [0.0, -1.0, 0.0], pixels=6000, view=0.6)
    here, there = (Transition(flora, of, 1.0).detail for of in (camera, aside))
    fine, coarse = here.lengths(whole), there.lengths(whole)
    some = fine > 0
    assert some.any()
    assert (coarse[some] < fine[some]).all()
    least = tube_faces(flora, whole)
    assert tube_faces(flora, whole, there.wood) - least < 0.2 * (tube_faces(flora, whole, here.wood) - least)


def test_what_comes_into_view_while_the_shutter_is_open_is_fine() -> None:
    """A camera that turns toward leaves sees them as one does that looked there all the time."""
    flora, camera, _, pieces = near(25.0, pixels=6000)
    whole = support.whole_of(flora, pieces)
    aside = support.camera(camera.eye, camera.eye + [0.0, -1.0, 0.0], pixels=6000, view=0.6)
    here, turns = (Transition(flora, of, 1.0).detail for of in (camera, replace(aside, shutter=(camera,))))
    assert turns.lengths(whole) == pytest.approx(here.lengths(whole))


def test_limits_hold_up_close() -> None:
    """However fine leaves could be, no more is made than somebody allows."""
    flora, camera, seeds, _ = near(1.0)
    result = run(flora, seeds, camera)[1]

    def number(settings: RefinementSettings) -> int:
        detail = fit_to_budget(result, camera, settings)
        given = support.refined(
            flora, result, detail.camera, detail.facet, detail.leaf_limit, weighted=False, most=detail.most
        )
        blocks = list(given.mesh_blocks())
        return sum(b.buffers.polygons for b in blocks) + sum(
            len(some) for part in given.facet_parts() for some, _ in part
        )

    free = number(RefinementSettings())
    for share in (0.4, 0.01):
        most = int(share * free)
        assert number(RefinementSettings(max_polygons=most)) <= most
