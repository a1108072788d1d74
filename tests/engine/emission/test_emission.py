# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: explicit polygons and proxies together are the plants, each part in one form."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tests.engine.subplants.test_leaf_meshes import check_topology
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.emission import facets, plants
from tetflora_addon.emission.budget import afford
from tetflora_addon.emission.forms import Refined, facet_blocks
from tetflora_addon.emission.plants import Transition, expanded_blocks, explicit_blocks
from tetflora_addon.emission.portions import Sight
from tetflora_addon.emission.shells import proxy_shells
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.proxies.facet_sizes import FacetPixels
from tetflora_addon.proxies.facet_weights import COUNTS, FacetWeights
from tetflora_addon.proxies.summaries import summarise
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement
from tetflora_addon.refinement.settings import RefinementSettings
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


def all_real(flora: Flora, camera: Camera) -> Transition:
    """Nothing is too small to be drawn as it is."""
    return Transition(flora, camera, 1e-9)


def unweighted(monkeypatch: pytest.MonkeyPatch, flora: Flora) -> None:
    """Facets have all of the area that they stand for, not what leaves of a cluster show of it."""
    ones = np.ones((len(flora.rows), len(COUNTS)))
    monkeypatch.setattr(facets, "facet_weights", lambda *_: FacetWeights(ones[None], ones[None]))


def positions(blocks: list) -> list[bytes]:
    """All places and attributes of meshes, bit by bit."""
    return [b"".join([m.positions.tobytes(), *(v.tobytes() for _, v in m.attributes.values())]) for m in blocks]


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


def test_facets_have_the_area_of_what_is_not_explicit(monkeypatch: pytest.MonkeyPatch) -> None:
    """But for what leaves of a cluster hide of each other; without a transition they stand for all plants."""
    flora, _, camera, result = scene()
    mesh = support.facet_buffers(flora, result, camera)
    check_topology(mesh)
    whole = result.totals.optical_area.sum()
    assert 0.4 * whole < support.face_areas(mesh).sum() < 1.05 * whole
    unweighted(monkeypatch, flora)
    assert support.face_areas(support.facet_buffers(flora, result, camera)).sum() == pytest.approx(whole, rel=0.05)
    real = all_real(flora, camera)
    rest = support.facet_buffers(flora, result, camera, transition=real)
    leaves = support.face_areas(rest)[rest.attributes["tf_transmission"][1] > 0].sum()
    proxies = np.isin(result.decision, (Decision.PROXY, Decision.HIDDEN))
    # A part that reaches into an explicit tetrahedron may be real as a whole.
    assert leaves == pytest.approx(result.totals.leaf_area[proxies].sum(), rel=0.15)


def test_facets_are_as_large_as_asked_for_and_larger_where_hidden() -> None:
    """In pixels at their own distance, for wood; hidden wood of few faces gets larger facets still."""
    flora, _, camera, result = scene()
    numbers = {}
    for decision in (Decision.PROXY, Decision.HIDDEN):
        mesh = support.facet_buffers(flora, with_decision(result, decision, 1.0), camera, 0.5)
        numbers[decision] = mesh.polygons
        wood = mesh.attributes["tf_transmission"][1] == 0
        centre = support.face_centres(mesh)[wood]
        pixels = np.sqrt(support.face_areas(mesh)[wood])
        pixels /= np.linalg.norm(centre - camera.position, axis=1) * camera.pixel_size
        if decision == Decision.PROXY:
            assert np.median(pixels) == pytest.approx(0.5, rel=0.25)
        else:
            assert np.quantile(pixels, 0.01) > 1.0 * 0.75
    assert numbers[Decision.HIDDEN] < numbers[Decision.PROXY]


def test_facets_are_about_as_many_as_expected() -> None:
    """Of whatever is decided, seen however well, at any size: the budget rests on it."""
    flora, _, camera, result = scene()
    for decision, visibility in ((Decision.PROXY, 1.0), (Decision.PROXY, 0.2), (Decision.HIDDEN, 1e-3)):
        one = with_decision(result, decision, visibility)
        for pixels in (FacetPixels(0.3), FacetPixels(1.0, 2.0)):
            sight = Sight(flora, one, camera)
            expected = facets.sizes_of(flora, sight.portions(), sight.shadows).counts(pixels).sum()
            made = support.facet_buffers(flora, one, camera, pixels).polygons
            assert made == pytest.approx(expected, rel=0.15), (decision, visibility, pixels)


def test_chunks_of_facets_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    flora, _, camera, result = scene()
    once = support.facet_buffers(flora, result, camera)
    monkeypatch.setattr(facets, "FACETS_AT_ONCE", 500)
    chunked = support.facet_buffers(flora, result, camera)
    assert chunked.polygons == once.polygons
    quads = [np.unique(m.positions.reshape(-1, 9), axis=0) for m in (once, chunked)]
    assert (quads[0] == quads[1]).all()


def test_facets_are_made_in_chunks_that_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """By facets, not by branches: thick wood close to the eye is cut into very many."""
    flora, _, camera, result = scene()
    made: dict[str, list[int]] = {"piece_facets": [], "subplant_facets": []}
    for name, numbers in made.items():
        inner = getattr(facets, name)

        def counted(*args: object, inner: object = inner, numbers: list[int] = numbers) -> object:
            out = inner(*args)
            numbers.append(len(out))
            return out

        monkeypatch.setattr(facets, name, counted)
    monkeypatch.setattr(facets, "FACETS_AT_ONCE", 2_000)
    total = support.facet_buffers(flora, with_decision(result, Decision.PROXY), camera, 0.15)
    assert sum(map(sum, made.values())) == total.polygons
    for numbers in made.values():
        assert sum(numbers) > 8_000
        # One thing alone may exceed the limit, but then it has a chunk of its own.
        assert len(numbers) > sum(numbers) / max(2_000, max(numbers)) / 2
        assert np.median(numbers) < 2 * 2_000


def test_facets_come_in_blocks_of_bounded_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Together they are all facets; each is of one species, of which only the last block is small."""
    flora, _, camera, result = scene()
    once = support.facet_buffers(flora, result, camera, 1.0)
    monkeypatch.setattr(facets, "FACETS_AT_ONCE", 300)
    monkeypatch.setattr(facets, "BLOCK_POLYGONS", 700)
    made = Refined(flora, result, camera, FacetPixels(1.0))
    largest = max(len(some) for parts in made.facet_parts() for some, _ in parts)
    blocks = list(facet_blocks(made))
    sizes = [b.polygons for b in blocks]
    assert sum(sizes) == once.polygons
    assert len(blocks) > 3
    assert min(a.polygons for a, b in pairwise(blocks) if a.species == b.species) >= 700
    # What one part of a plant has at most comes on top.
    assert max(sizes) < 700 + largest
    assert largest < 3_000
    assert sorted({b.species for b in blocks}) == list(range(len(flora.species)))
    assert [b.species for b in blocks] == sorted(b.species for b in blocks)


def test_the_order_of_plants_changes_nothing() -> None:
    """Real leaves, bark and facets are the same to the last bit, also of copies of one plant, with any budget."""
    flora, seeds, camera, _ = scene()
    seeds = replace(seeds, seed=seeds.seed % 7)
    made = []
    for order in (np.arange(len(seeds)), np.arange(len(seeds))[::-1], np.random.default_rng(1).permutation(len(seeds))):
        _, result = run(flora, seeds.take(order), camera)
        detail = afford(flora, result, camera, RefinementSettings(max_polygons=20_000))
        transition = Transition(flora, camera, detail.leaf_limit / 2)
        blocks = [b.buffers for t in (None, transition) for b in explicit_blocks(flora, result, camera, t)]
        proxies = facet_blocks(Refined(flora, result, camera, detail.pixels, transition))
        made.append((detail.pixels, positions([*blocks, *proxies])))
    assert made[0] == made[1] == made[2]
    assert len(made[0][1]) > 6


def test_shells_hold_what_explicit_does_not() -> None:
    """Whatever is decided: polygons and shells together have the area of the plants."""
    flora, seeds, camera, result = scene()
    whole = sum(by_kind(list(expanded_blocks(flora, seeds)), "leaf", species) for species in (0, 1))
    for seed in range(4):
        rng = np.random.default_rng(seed)
        # Neighbours have one decision, as those of the loop do.
        near = result.tree.vertices(result.nodes)[:, :, 1].mean(axis=1) < rng.uniform(5, 60)
        one = with_decision(result, np.where(near, Decision.EXPLICIT, Decision.HIDDEN), rng.random(len(near)))
        real = sum(by_kind(list(explicit_blocks(flora, one, camera)), "leaf", species) for species in (0, 1))
        index = np.where(one.chosen(Decision.HIDDEN), 0, -1)
        held = one.totals.leaf_area[one.decision == Decision.HIDDEN].sum()
        shell = summarise(flora, one.contents, index, 1).optical_area[0]
        assert 0 < held <= shell
        assert 0.05 * whole < real < whole
        assert real + held == pytest.approx(whole, rel=0.05)


def test_what_was_off_screen_comes_back_identical() -> None:
    """The camera turns away and back again: polygons and facets are the same to the last digit."""
    flora, seeds, camera, _ = scene()
    away = replace(camera, frame=camera.frame @ np.diag([-1.0, 1.0, -1.0]))
    made = []
    for view in (camera, away, camera):
        _, result = run(flora, seeds, view)
        blocks = [b.buffers for b in explicit_blocks(flora, result, camera)]
        made.append([m.positions for m in (*blocks, support.facet_buffers(flora, result, view))])
    assert all(np.array_equal(a, b) for a, b in zip(made[0], made[2], strict=True))
    assert sum(map(len, made[1])) < sum(map(len, made[0])) / 2


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
    area = summarise(flora, result.contents, index, int(cells.sum())).effective_area(volumes)
    # Half of the area as the mean over all directions, whatever the orientation, within what the form of κ allows.
    np.testing.assert_allclose(kappa, (area / 2 / volumes)[np.argsort(-result.rank[cells])], rtol=0.08)
    assert mesh.attributes["tf_colour"][1].min() >= 0
    assert mesh.attributes["tf_colour"][1].max() <= 1


def test_nothing_to_draw() -> None:
    """All explicit leaves no proxy, all proxies leave no block."""
    flora, _, camera, result = scene()
    explicit = with_decision(result, Decision.EXPLICIT)
    assert proxy_shells(flora, explicit) is None
    assert support.facet_buffers(flora, explicit, camera, transition=all_real(flora, camera)) is None
    assert list(explicit_blocks(flora, with_decision(result, Decision.PROXY), camera)) == []
    # Facets so large that none of what there is makes one.
    proxies = with_decision(result, Decision.PROXY)
    assert list(facet_blocks(Refined(flora, proxies, camera, FacetPixels(1e9)))) == []


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
