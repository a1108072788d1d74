# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: explicit polygons and proxies together are the plants, each part in one form."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tests.engine.subplants.test_leaf_meshes import check_topology
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.emission import plants
from tetflora_addon.emission.plants import expanded_blocks, explicit_blocks
from tetflora_addon.emission.shells import proxy_shells
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement
from tetflora_addon.refinement.summaries import summarize
from tetflora_addon.tetrahedra.geometry import volume


@cache
def scene() -> tuple[Flora, Seeds, Camera, Refinement]:
    """Two species in depth, so that every decision occurs: near leaves, hidden ones, far ones."""
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    count = 36
    depth = np.repeat(np.arange(9) ** 2 * 3.0, 4)
    place = np.stack([np.tile([-3.0, -1.0, 1.0, 3.0], 9) * (1 + depth / 60), depth, 0 * depth], axis=1)
    seeds = support.plants(np.arange(count), np.arange(count) % 2, place)
    camera = support.camera((0, -6, 2), (0, 60, 1.0), pixels=160, view=1.0)
    _, result = run(flora, seeds, camera)
    return flora, seeds, camera, result


def with_decision(
    result: Refinement, decision: Decision | np.ndarray, visibility: float | np.ndarray | None = None
) -> Refinement:
    """Other decisions than those of the loop, one or an array (t,), and what comes through of each cell's light."""
    shape = result.decision.shape
    seen = result.transmittance if visibility is None else np.broadcast_to(visibility, shape).astype(float)
    return replace(result, decision=np.broadcast_to(decision, shape).astype(np.int8), transmittance=seen)


def test_the_scene_has_every_decision() -> None:
    *_, result = scene()
    assert {Decision.PROXY, Decision.HIDDEN, Decision.EXPLICIT} == set(result.decision.tolist())


def by_kind(blocks: list, kind: str, species: int) -> float:
    return sum(support.face_areas(b.buffers).sum() for b in blocks if (b.kind, b.species) == (kind, species))


def test_all_cells_explicit_are_the_plants_expanded(monkeypatch: pytest.MonkeyPatch) -> None:
    """By species and kind: leaves to the last one, bark's area; in blocks of any size."""
    flora, seeds, camera, result = scene()
    whole = list(expanded_blocks(flora, seeds))
    for size in (250_000, 9_000):
        monkeypatch.setattr(plants, "BLOCK_POLYGONS", size)
        parts = list(explicit_blocks(flora, with_decision(result, Decision.EXPLICIT), camera))
        for block in parts:
            check_topology(block.buffers)
        for species in (0, 1):
            leaves = [
                sum(b.buffers.polygons for b in blocks if (b.kind, b.species) == ("leaf", species))
                for blocks in (whole, parts)
            ]
            assert leaves[0] == leaves[1] > 0
            for kind, tolerance in (("leaf", 1e-6), ("bark", 1e-3)):
                expected = by_kind(whole, kind, species)
                assert by_kind(parts, kind, species) == pytest.approx(expected, rel=tolerance)
    assert max(b.number for b in parts) > 3


def test_blocks_come_in_order_and_end_at_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each (block, species, kind) once; fractions rise, to 1 where all is made, and tell what is done."""
    flora, seeds, camera, result = scene()
    monkeypatch.setattr(plants, "BLOCK_POLYGONS", 4_000)
    for blocks in (list(explicit_blocks(flora, result, camera)), list(expanded_blocks(flora, seeds))):
        names = [(b.number, b.species, b.kind) for b in blocks]
        assert len(set(names)) == len(names)
        assert [n for n, *_ in names] == sorted(n for n, *_ in names)
        fractions = [b.fraction for b in blocks]
        assert fractions == sorted(fractions)
        assert 0 < fractions[0] < fractions[-1] <= 1 + 1e-9
    assert fractions[-1] == pytest.approx(1)


def test_a_block_holds_about_as_many_polygons_as_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    flora, seeds, _, _ = scene()
    monkeypatch.setattr(plants, "BLOCK_POLYGONS", 20_000)
    sizes: dict[int, int] = {}
    for block in expanded_blocks(flora, seeds):
        sizes[block.number] = sizes.get(block.number, 0) + block.buffers.polygons
    assert max(sizes.values()) < 20_000 + 2 * flora.polygons.max()
    assert len(sizes) > 5


def test_explicit_polygons_are_about_as_many_as_expected() -> None:
    """A part at the border of what is explicit is made or not as a whole, by what most of it is."""
    flora, _, camera, result = scene()
    made = sum(b.buffers.polygons for b in explicit_blocks(flora, result, camera))
    expected = result.totals.polygons[result.decision == Decision.EXPLICIT].sum()
    assert made == pytest.approx(expected, rel=0.15)


def test_shells_hold_what_explicit_does_not() -> None:
    """Whatever is decided: polygons and shells together have the area of the plants."""
    flora, seeds, camera, result = scene()
    whole = sum(by_kind(list(expanded_blocks(flora, seeds)), "leaf", species) for species in (0, 1))
    for seed in range(4):
        rng = np.random.default_rng(seed)
        # Neighbors have one decision, as those of the loop do.
        near = result.tree.vertices(result.nodes)[:, :, 1].mean(axis=1) < rng.uniform(5, 60)
        one = with_decision(result, np.where(near, Decision.EXPLICIT, Decision.HIDDEN), rng.random(len(near)))
        real = sum(by_kind(list(explicit_blocks(flora, one, camera)), "leaf", species) for species in (0, 1))
        index = np.where(one.chosen(Decision.HIDDEN), 0, -1)
        held = one.totals.leaf_area[one.decision == Decision.HIDDEN].sum()
        shell = summarize(flora, one.contents, index, 1).optical_area[0]
        assert 0 < held <= shell
        assert 0.05 * whole < real < whole
        assert real + held == pytest.approx(whole, rel=0.05)


def test_shells_are_the_cells_of_proxies() -> None:
    flora, _, _, result = scene()
    mesh = proxy_shells(flora, result)
    cells = np.isin(result.decision, (Decision.PROXY, Decision.HIDDEN))
    assert mesh.polygons == 4 * cells.sum()
    check_topology(mesh)
    kappa = mesh.attributes["tf_kappa"][1].reshape(-1, 4)[:, 0]
    volumes = volume(result.tree.vertices(result.nodes[cells]))
    index = np.full(len(result.tree), -1)
    index[result.nodes[cells]] = np.arange(cells.sum())
    area = summarize(flora, result.contents, index, int(cells.sum())).effective_area(volumes)
    # Half of the area as the mean over all directions, whatever the orientation, within what the form of κ allows.
    np.testing.assert_allclose(kappa, (area / 2 / volumes)[np.argsort(-result.rank[cells])], rtol=0.08)
    assert mesh.attributes["tf_color"][1].min() >= 0
    assert mesh.attributes["tf_color"][1].max() <= 1


def test_all_proxies_leave_no_block_and_all_explicit_no_shell() -> None:
    flora, _, camera, result = scene()
    assert proxy_shells(flora, with_decision(result, Decision.EXPLICIT)) is None
    assert list(explicit_blocks(flora, with_decision(result, Decision.PROXY), camera)) == []


def test_copies_of_a_seed_are_all_made() -> None:
    """Empties copied in the scene keep their seed: each is drawn where it stands."""
    flora = support.small_flora()
    place = [(0, 0, 0), (4, 0, 0), (8, 0, 0)]
    blocks = list(expanded_blocks(flora, support.plants([5, 5, 5], position=place)))
    one = list(expanded_blocks(flora, support.plants([5])))
    assert sum(b.buffers.polygons for b in blocks) == 3 * sum(b.buffers.polygons for b in one)
    bark = next(b.buffers for b in blocks if b.kind == "bark")
    nearest = np.bincount(np.rint(bark.positions[:, 0] / 4).astype(int).clip(0, 2), minlength=3)
    assert nearest.min() > 0.9 * nearest.max()
