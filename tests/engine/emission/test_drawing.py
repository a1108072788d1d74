# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn: as fine as a pixel where it is seen, behind full pixels where it is not, the same in any order."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest

from tests.engine import support
from tests.engine.emission.test_emission import scene
from tests.engine.refinement.test_loop import run
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.camera.camera import Camera
from tetflora_addon.emission import drawing as subject
from tetflora_addon.emission.budget import fit_to_budget
from tetflora_addon.emission.coverage import MARGIN, Coverage, Shade
from tetflora_addon.emission.emitters import FacetForm, facet_blocks
from tetflora_addon.emission.frontier import Frontier, Waiting, corners_of_faces
from tetflora_addon.emission.plants import GrownPlants, Transition, expanded_blocks
from tetflora_addon.growth.growth import trunks
from tetflora_addon.proxies.facet_weights import facet_weights
from tetflora_addon.proxies.microsurfaces import CIRCUMRADIUS, STRETCH, Facets
from tetflora_addon.proxies.primitives import joined, triangle_corners
from tetflora_addon.refinement.contents import PlantParts, subplant_totals
from tetflora_addon.refinement.lights import Light
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.refinement.shared_parts import SharePoints

WIDTH = 64
#: Polygons of a birch at most.
BIRCH = 50_000.0


@cache
def wood() -> tuple:
    """Birches so close together that most of them are hidden, seen from beside and a little above."""
    flora, seeds = support.alone("birch", BIRCH), support.grove(100, 2.0)
    camera = support.camera((0, -36, 20), (0, 0, 6), pixels=WIDTH, view=0.7)
    return flora, seeds, camera, replace(run(flora, seeds, camera)[1], lights=(SUN,))


SUN = Light("SUN", np.zeros(3), np.array([0.6, 0.3, -0.74]), 0.01)


@cache
def drawn_wood() -> tuple:
    flora, _, camera, result = wood()
    return support.drawn(flora, result, camera, 1.2, 0.6)


def pixels_of(facets: Facets, camera: Camera) -> np.ndarray:
    return facets.side / camera.extent_around(facets.center)


def coverage_of(blocks: list, facets: Facets, seen: np.ndarray, camera: Camera) -> Coverage:
    """Of all that is seen, made anew."""
    made = Coverage(camera)
    made.draw(*made.of_corners(triangle_corners(facets)[seen])[1:])
    for mesh in (b.buffers for b in blocks):
        size, first = np.diff(mesh.face_offsets), mesh.face_offsets[:-1]
        for k in range(1, int(size.max()) - 1):
            some = np.flatnonzero(size > k + 1)
            corner = mesh.corner_verts[np.stack([first[some], first[some] + k, first[some] + k + 1], axis=1)]
            made.draw(*made.of_corners(mesh.positions[corner])[1:])
    return made


def test_facets_that_are_seen_are_as_large_as_asked_for() -> None:
    """Up to the leaf that each stands for, which is smaller here; and none is larger than asked for by a half."""
    camera = wood()[2]
    _, facets, seen = drawn_wood()
    pixels = pixels_of(facets, camera)[seen]
    assert np.median(pixels) == pytest.approx(1.2, rel=0.35)
    assert np.quantile(pixels, 0.99) < 1.8


def test_no_facet_of_wood_in_the_image_is_larger_than_a_pixel_and_a_half() -> None:
    camera = wood()[2]
    _, facets, seen = drawn_wood()
    wooden = seen & (facets.transmission == 0)
    assert wooden.any()
    assert pixels_of(facets, camera)[wooden].max() < 1.5
    # Long and thin, as branches are.
    corners = triangle_corners(facets)[wooden].astype(float)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    assert (longest > 2.5 * facets.side[wooden]).all()


def test_what_is_hidden_never_shows() -> None:
    """Each facet that the camera is not to see lies behind pixels that are full, or beside the image."""
    _, _, camera, _ = wood()
    blocks, facets, seen = drawn_wood()
    cover = coverage_of(blocks, facets, seen, camera)
    prints = cover.of_corners(triangle_corners(facets)[~seen])[0]
    small = pixels_of(facets, camera)[~seen] < 1.5
    assert (cover.hidden(prints) | small).mean() > 0.999
    assert (facets.side[~seen][~cover.hidden(prints)] ** 2).sum() < 0.02 * (facets.side[~seen] ** 2).sum()


@pytest.mark.parametrize("times", [1.0, 3.0])
def test_what_is_hidden_never_shows_as_a_sphere(times: float) -> None:
    """Spheres reach nearer to the eye than the facets for which they are drawn; coarse ones by more."""
    flora, _, camera, result = wood()
    blocks, facets, seen = support.drawn(flora, result, camera, 1.2 * times, 0.6 * times, hidden=times)
    cover, center = coverage_of(blocks, facets, seen, camera), facets.center[~seen].astype(float)
    side = facets.side[~seen]
    inside = camera.distance_to_view(center) <= 0.0
    shows = inside & ~cover.hidden(cover.of_spheres(center, side / np.sqrt(np.pi)))
    assert (side[shows] ** 2).sum() < 0.02 * (side[inside] ** 2).sum()


@pytest.mark.parametrize("lens", [0.0, 0.1, 0.4])
def test_no_facet_of_what_is_outside_is_in_the_image(lens: float) -> None:
    """A plant of which a little is in the corner of the image: what is large lies beyond it and its blur as a whole.

    Or behind full pixels.
    """
    flora = support.alone("birch", BIRCH)
    seeds = support.plants([3], position=[(11.2, 0, 0)])
    camera = support.camera((0, -30, 8), (0, 0, 8), pixels=WIDTH, view=0.7)
    camera = replace(camera, lens_radius=lens, focus=10.0)
    blocks, facets, seen = support.drawn(flora, run(flora, seeds, camera)[1], camera, 1.2, 0.6)
    cover = coverage_of(blocks, facets, seen, camera)
    prints = cover.of_corners(triangle_corners(facets))[0]
    inside = ~cover.outside(prints)
    assert inside.any() and (~seen).any()
    assert pixels_of(facets, camera)[inside & ~seen & ~cover.hidden(prints)].max(initial=0.0) < 1.5


@pytest.mark.parametrize(("most", "lost"), [(np.inf, 1e-6), (2e5, 0.15)])
def test_what_stands_far_behind_the_eye_is_no_larger_than_a_crown(most: float, lost: float) -> None:
    """No facet out of view is a roof over what is seen; all keep their area together, as far as there is room."""
    flora, behind = support.alone("birch", BIRCH), support.grove(185, 8.0)
    seeds = replace(behind, position=behind.position - np.array([0.0, 130.0, 0.0]))
    camera = support.camera((0, 0, 1.7), (0, 30, 1.7), pixels=WIDTH, view=0.7)
    result = replace(run(flora, seeds, camera)[1], lights=(SUN,))
    scene = support.refined(flora, result, camera, 1.2, 0.6, weighted=False, most=most)
    for _ in scene.mesh_blocks():
        pass
    facets = joined([some for parts in scene.facet_parts() for some, _ in parts])
    assert 0.0 < facets.side.max() < 4.0
    (kind,), (parts,) = scene.drawing.kinds, scene.drawing.parts
    area = float((kind.enough(parts) * kind.optical(parts)).sum())
    assert (facets.side**2).sum() == pytest.approx(area, rel=lost)


@pytest.mark.parametrize(("away", "hidden"), [(2.5, 1.0), (6.0, 16.0)])
def test_no_facet_near_the_eye_is_as_large_as_a_leaf(away: float, hidden: float) -> None:
    """Leaves that are many pixels wide are leaves; next to nothing shows of the facets for what is behind them."""
    flora, seeds = support.alone("birch", BIRCH), support.plants([3])
    high = 0.7 * support.trunks(flora.rows, seeds).length[0]
    camera = support.camera((0, -away, high), (0, 0, high), pixels=200, view=0.7)
    blocks, facets, seen = support.drawn(flora, run(flora, seeds, camera)[1], camera, 1.2, 0.6, hidden=hidden)
    cover = coverage_of(blocks, facets, seen, camera)
    assert np.isfinite(cover.depth).mean() > 0.1
    shown, pixels = showing(facets, cover), pixels_of(facets, camera)
    trunk = support.trunks(flora.rows, seeds)
    leaf = np.sqrt(flora.one_leaf_area(trunk)) / camera.extent_around(np.array([[0.0, 0.0, high]]))
    assert pixels[shown > 0.05].max(initial=0.0) < leaf[0]
    assert (shown * pixels**2).sum() < 1e-3 * camera.width * camera.height


def showing(facets: Facets, cover: Coverage) -> np.ndarray:
    """Fraction of each facet, by points on it, that is in the image and behind no pixel that is full."""
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], 48)
    points = np.einsum("kc,ncd->nkd", weights, triangle_corners(facets).astype(float))
    column, row, depth = (v.reshape(points.shape[:2]) for v in cover.project(points.reshape(-1, 3)))
    i, j = (np.floor(v).astype(int) for v in (row, column))
    inside = (np.clip(i, MARGIN, cover.height - 1 - MARGIN) == i) & (np.clip(j, MARGIN, cover.width - 1 - MARGIN) == j)
    full = cover.depth[np.clip(i, 0, cover.height - 1), np.clip(j, 0, cover.width - 1)]
    return (inside & (depth > cover.camera.near) & (depth < full * (1 - 1e-5) - 1e-4)).mean(axis=1)


def test_primitives_follow_the_image_however_deep_the_wood_is() -> None:
    """Three times as deep a wood has about as many: what lies behind full pixels costs next to nothing."""
    flora, _, camera, _ = wood()
    numbers = []
    for deep in (1, 3):
        seeds = support.grove(100, 2.0)
        place = np.concatenate([seeds.position + [0, 20.0 * k, 0] for k in range(deep)])
        every = support.plants(np.arange(len(place)), position=place)
        blocks, facets, _ = support.drawn(flora, run(flora, every, camera)[1], camera, 1.2, 0.6)
        numbers.append(sum(b.buffers.polygons for b in blocks) + len(facets))
    assert numbers[1] < 1.4 * numbers[0]
    assert numbers[0] < 9.0 * camera.width * camera.height


def test_few_facets_stand_for_what_nobody_sees() -> None:
    camera = wood()[2]
    _, facets, seen = drawn_wood()
    hidden = facets.take(np.flatnonzero(~seen))
    assert len(hidden) < 4.0 * camera.width * camera.height


def optical(blocks: list, facets: Facets) -> np.ndarray:
    """Area (2,) of leaves and of wood that can block light: closed tubes, of quads, show half of theirs."""
    leafy = facets.transmission > 0
    out = np.array([(facets.side[leafy] ** 2).sum(), (facets.side[~leafy] ** 2).sum()])
    for block in blocks:
        half = 0.5 if block.kind == "bark" else 1.0
        sizes = np.where(np.diff(block.buffers.face_offsets) == 3, 1.0, half)
        out[int(block.kind == "bark")] += (support.face_areas(block.buffers) * sizes).sum()
    return out


def optical_fractions(monkeypatch: pytest.MonkeyPatch, **options: float) -> np.ndarray:
    """Means (2,) over several draws of what is merged, of which single ones are off by some hundredths."""
    flora, seeds, camera, result = scene()
    monkeypatch.setenv("TETFLORA_THREADS", "1")  # other processes know nothing of the draws
    whole, found = optical(list(expanded_blocks(flora, seeds)), Facets.empty()), []
    for draw in range(4):
        monkeypatch.setattr(subject, "_MERGE", 300 + draw)
        blocks, facets, _ = support.drawn(flora, result, camera, 0.5, weighted=False, **options)
        found.append(optical(blocks, facets) / whole)
    return np.mean(found, axis=0)


def test_area_is_that_of_the_plants(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of leaves and of wood, whatever they are drawn as and merged into, where nothing is thinned out."""
    assert (np.abs(optical_fractions(monkeypatch, hidden=0.33) - 1.0) < [0.04, 0.065]).all()


def test_thinning_of_what_nobody_sees_loses_little(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of primitives that cannot be merged behind full pixels a part is left out where there are many."""
    found = optical_fractions(monkeypatch)
    assert (found > 0.85).all()
    assert (found < 1.06).all()


def digest(made: tuple) -> list:
    blocks, facets, seen = made
    meshes = [
        b"".join([b.buffers.positions.tobytes(), *(v.tobytes() for _, v in b.buffers.attributes.values())])
        for b in blocks
    ]
    return [*meshes, facets.center.tobytes(), facets.side.tobytes(), seen.tobytes()]


def test_the_order_of_plants_changes_nothing() -> None:
    """Real leaves, bark and facets are the same to the last bit, also of copies of one plant."""
    flora, seeds, camera, _ = scene()
    seeds = replace(seeds, seed=seeds.seed % 7)
    made = []
    for order in (np.arange(len(seeds)), np.random.default_rng(1).permutation(len(seeds))):
        result = run(flora, seeds.take(order), camera)[1]
        made.append(digest(support.drawn(flora, result, camera, 1.0, 0.6)))
    assert made[0] == made[1]


def test_equal_seeds_are_ordinary() -> None:
    """Plants that are copies of one have facets as large as plants that are all different."""
    flora, seeds, camera, _ = wood()
    means = []
    for kinds in (100, 1):
        result = run(flora, replace(seeds, seed=seeds.seed % kinds), camera)[1]
        _, facets, seen = support.drawn(flora, result, camera, 1.2, 0.6)
        means.append((len(facets), pixels_of(facets, camera)[seen].mean()))
    assert means[1][1] == pytest.approx(means[0][1], rel=0.05)
    assert means[1][0] == pytest.approx(means[0][0], rel=0.15)


def test_what_was_off_screen_comes_back_identical() -> None:
    """The camera turns away and back again: polygons and facets are the same to the last digit."""
    flora, seeds, camera, _ = scene()
    away = replace(camera, frame=camera.frame @ np.diag([-1.0, 1.0, -1.0]))
    made = [digest(support.drawn(flora, run(flora, seeds, view)[1], view, 1.0, 0.6)) for view in (camera, away, camera)]
    assert made[0] == made[2] != made[1]


def test_room_to_spare_changes_nothing() -> None:
    """To the last bit: no two moments have the same memory, and frames of a film are made in any order."""
    flora, _, camera, result = wood()
    made = [digest(support.drawn(flora, result, camera, 1.2, 0.6, most=most)) for most in (1e7, 16515929.727227628)]
    assert made[0] == made[1]


@pytest.mark.parametrize("most", [1e7, np.inf])
def test_a_tile_that_may_not_be_finer_is_drawn_once(monkeypatch: pytest.MonkeyPatch, most: float) -> None:
    """However much room there is to spare."""
    flora, _, camera, result = wood()
    drawn, usual = [], subject._Tile.draw
    monkeypatch.setattr("tetflora_addon.processes.pool.number", lambda *_: 0)  # other processes count by themselves
    monkeypatch.setattr(subject._Tile, "draw", lambda self, *given: drawn.append(1) or usual(self, *given))
    support.drawn(flora, result, camera, 1.2, 0.6, most=most)
    assert len(drawn) == subject.tiles_of(camera)


def test_some_megabytes_more_or_less_change_nothing() -> None:
    """Where memory is the limit: it is never the same for two frames; half of it is still much less."""
    _, _, camera, result = wood()
    details = [fit_to_budget(result, camera, RefinementSettings(max_memory=gb)) for gb in (0.02, 0.02003, 0.01)]
    assert details[0].coarser == details[1].coarser < details[2].coarser
    assert details[0].most == details[1].most > details[2].most


@cache
def drawn_with(most: int | None = None) -> tuple:
    """The wood with as many primitives as it has or as somebody allows."""
    flora, _, camera, result = wood()
    settings = RefinementSettings() if most is None else RefinementSettings(max_polygons=most)
    with patch("tetflora_addon.emission.budget.PLENTY", 600_000.0):  # for as few pixels
        detail = fit_to_budget(result, camera, settings)
    options = {"hidden": detail.coarser, "most": detail.most, "finest": detail.finest}
    return support.drawn(flora, result, detail.camera, detail.facet, detail.leaf_limit, **options)


def number_of(most: int | None = None) -> int:
    """Primitives of the wood."""
    return number_in(drawn_with(most))


def number_in(made: tuple) -> int:
    blocks, facets, _ = made
    return sum(block.buffers.polygons for block in blocks) + len(facets)


@pytest.mark.parametrize("share", [0.3, 0.1])
def test_a_budget_leaves_no_holes(share: float) -> None:
    """Less memory is coarser, and the sky never shows: as many pixels are covered as with plenty, or facets as set."""
    pictures = drawn_with(), drawn_wood(), drawn_with(int(share * number_of()))
    fine, coarse, limited = (np.isfinite(coverage_of(*picture, wood()[2]).depth).mean() for picture in pictures)
    assert 0.98 * fine < limited < 1.02 * coarse


@pytest.mark.parametrize("share", [0.3, 0.1, 0.02])
def test_a_budget_holds(share: float) -> None:
    """To the last primitive, however tight it is; and most of it is used."""
    most = int(share * number_of())
    assert 0.5 * most < number_of(most) <= most


def sides_of_faces(mesh: MeshBuffers, camera: Camera) -> np.ndarray:
    """Roots of the areas of all faces, in pixels."""
    corners, size = corners_of_faces(mesh)
    edges = np.diff(corners.astype(np.float64), axis=1)
    area = 0.5 * np.linalg.norm(np.cross(edges.cumsum(axis=1)[:, :-1], edges[:, 1:]).sum(axis=1), axis=1)
    middle = (corners.sum(axis=1) - (corners.shape[1] - size)[:, None] * corners[:, -1]) / size[:, None]
    return np.sqrt(area) / camera.extent_around(middle)


def test_what_nobody_sees_is_left_out_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as asked: facets that nobody sees, then the smallest faces, and facets that are seen at last."""
    leave_out, camera = subject._Tile._leave_out, wood()[2]
    kept = []

    def contents(tile: subject._Tile) -> tuple[np.ndarray, np.ndarray]:
        pixels = [np.zeros(0), *(sides_of_faces(mesh, camera) for meshes in tile.meshes.values() for mesh in meshes)]
        facets = {seen: sum(map(len, group)) for (_, seen), group in tile._facets.items()}
        sides = np.sort(np.concatenate(pixels))
        return np.array([facets.get(False, 0), len(sides), facets.get(True, 0)]), sides

    def leave_more_out(tile: subject._Tile, _: float) -> None:
        facets, meshes = dict(tile._facets), dict(tile.meshes)
        kept.append(contents(tile))
        for step, number in enumerate(kept[0][0]):
            tile._facets, tile.meshes = dict(facets), dict(meshes)
            leave_out(tile, kept[0][0][:step].sum() + 0.5 * number)
            kept.append(contents(tile))

    monkeypatch.setattr(subject._Tile, "_leave_out", leave_more_out)
    monkeypatch.setattr("tetflora_addon.processes.pool.number", lambda *_: 0)
    support.drawn(wood()[0], wood()[3], camera, 1.2, 0.6)
    before, sides = kept[0]
    assert min(before) > 100
    for step, (after, left) in enumerate(kept[1:4]):
        assert np.all(after[:step] == 0)
        assert after[step] == before[step] // 2
        assert np.all(after[step + 1 :] == before[step + 1 :])
        np.testing.assert_allclose(left, sides[len(sides) - len(left) :], rtol=1e-4)


def test_plants_before_a_ground_are_as_fine_as_before_the_sky() -> None:
    """Ground that fills the image at first is no layer of plants: a meadow had facets of 7 pixels, of 1.7 that fit."""
    flora, _, camera, result = wood()
    detail = fit_to_budget(result, camera, RefinementSettings(max_polygons=int(0.3 * number_of())))
    options = {"hidden": detail.coarser, "most": detail.most, "finest": detail.finest}
    far = np.array([[-900.0, 400, -900], [900, 400, -900], [900, 400, 900], [-900, 400, 900]])
    sides = []
    for ground in (None, far[[[0, 1, 2], [0, 2, 3]]]):
        found = support.drawn(
            flora, result, detail.camera, detail.facet, detail.leaf_limit, occluders=ground, **options
        )
        sides.append(np.quantile(pixels_of(found[1], camera)[found[2]], [0.5, 0.95]))
    np.testing.assert_allclose(sides[1], sides[0], rtol=0.1)


def test_within_pixels_of_small_images_nothing_hidden_shows() -> None:
    """A small image has facets finer than its pixels: what hides others is known as finely as they are."""
    blocks, facets, seen = drawn_with()
    finer = wood()[2].resized(6.0)
    shown, every = (coverage_of(blocks, facets, some, finer).depth for some in (seen, np.ones(len(facets), bool)))
    assert (every < shown)[np.isfinite(every)].mean() < 0.05


def test_a_tile_that_never_fits_is_drawn_as_far_as_it_does() -> None:
    """Rather a part of it than nothing."""
    flora, _, camera, result = wood()
    most = number_of() // 20
    blocks, facets, _ = support.drawn(flora, result, camera, 0.5, 0.25, most=most)
    assert 0.5 * most < sum(b.buffers.polygons for b in blocks) + len(facets) <= most


@pytest.mark.parametrize("times", [1.5, 3.0])
def test_a_tile_that_needs_more_than_it_has_is_evenly_coarser(times: float) -> None:
    """What is drawn last is seen through gaps of what is before, and no shard among fine leaves; there are no holes."""
    flora, _, camera, result = wood()
    blocks, facets, _ = drawn_wood()
    most = (sum(block.buffers.polygons for block in blocks) + len(facets)) / times
    pictures = drawn_wood(), support.drawn(flora, result, camera, 1.2, 0.6, most=most)
    whole, limited = (np.isfinite(coverage_of(*picture, camera).depth).mean() for picture in pictures)
    assert 0.99 * whole < limited < 1.02 * whole
    _, facets, seen = pictures[1]
    sides = pixels_of(facets, camera)[seen]
    assert sides.max() < 2.0 * np.median(sides)


def test_what_a_tile_may_have_is_used_where_less_is_needed_than_expected() -> None:
    """Pixels that are open tell it in time: a wood had 374,000 primitives of a million, with facets twice as large."""
    flora, _, camera, result = wood()
    blocks, facets, seen = support.drawn(flora, result, camera, 3.0, 1.5)
    most = 1.5 * (sum(block.buffers.polygons for block in blocks) + len(facets))
    blocks, finer, shown = support.drawn(flora, result, camera, 3.0, 1.5, most=most, finest=0.5)
    assert 0.8 * most < sum(block.buffers.polygons for block in blocks) + len(finer) <= most
    sides = [np.median(pixels_of(some, camera)[which]) for some, which in ((facets, seen), (finer, shown))]
    assert sides[1] < 0.85 * sides[0]


@pytest.mark.parametrize("times", [2.0, 5.0])
def test_what_may_be_much_finer_uses_its_room(times: float) -> None:
    """A tile that turned out too fine counted all behind it, in its own sides: 18,000 primitives of 142,000."""
    flora, _, camera, result = wood()
    most = times * number_in(drawn_wood())
    made = support.drawn(flora, result, camera, 1.2, 0.6, most=most, finest=0.3)
    assert 0.8 * most < number_in(made) <= most
    finer, usual = (np.median(pixels_of(facets, camera)[seen]) for _, facets, seen in (made, drawn_wood()))
    assert finer < 0.85 * usual


def test_sides_that_are_told_are_those_that_are_drawn() -> None:
    """Where more is needed than was expected, the report does not say what was asked for."""
    flora, _, camera, result = wood()
    told, drawn, most = [], [], np.inf
    for share in (0.9, 1.0):
        given = support.refined(flora, result, camera, 1.2, 0.6, most=most)
        polygons = sum(block.buffers.polygons for block in given.mesh_blocks())
        told.append(given.facet_pixels)
        facets = [made for parts in given.facet_parts() for made in parts]
        most = share * (polygons + sum(len(some) for some, _ in facets))
        seen = [pixels_of(some, camera) for some, is_seen in facets if is_seen]
        drawn.append(np.sqrt((np.concatenate(seen) ** 2).mean()))
    assert told[0] == pytest.approx(1.2)
    assert told[1] / told[0] == pytest.approx(drawn[1] / drawn[0], rel=0.15) and told[1] > 1.25


def test_less_memory_is_coarser_everywhere() -> None:
    """Error grows evenly: facets grow with the root of what is missing."""
    _, _, camera, result = wood()
    sides = [
        fit_to_budget(result, camera, RefinementSettings(max_polygons=most)).coarser
        for most in (100_000, 25_000, 6_000)
    ]
    assert sides == sorted(sides)
    assert sides[2] / sides[1] == pytest.approx(2.0, rel=0.5)


def test_qualities_are_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Final is finer than Preview, and that than Draft, by as much as they say, in small images as well."""
    from tetflora_addon.refinement.settings import QUALITIES

    _, _, camera, result = wood()
    monkeypatch.setattr("tetflora_addon.emission.budget.PLENTY", 60_000.0)  # for as few pixels
    sides = []
    for name in ("FINAL", "PREVIEW", "DRAFT"):
        quality = QUALITIES[name]
        settings = RefinementSettings(facet=quality["facet"], leaf_limit=quality["leaf_limit"])
        sides.append(fit_to_budget(result, camera, settings).coarser)
    # Drafts of small images would take as long as what is final if they were as fine.
    assert sides == pytest.approx([sides[0]] * 3, rel=0.2) and 0.4 < sides[0] < 0.9


def test_shade_is_the_depth_of_what_is_in_the_light() -> None:
    """Along the sun; half of the area of sheets, over that of the ground, lies before what is below all of them."""
    random = np.random.default_rng(1)
    place = random.uniform([-20, -20, 0], [20, 20, 10], (40_000, 3))
    area = np.full(len(place), 3.0 * 40 * 40 / len(place))
    shade = Shade(place, area, (Light("SUN", np.zeros(3), np.array([0.0, 0.0, -1.0])),))
    middle = random.uniform(-15, 15, (200, 2))
    for height, expected in ((-1.0, 1.5), (5.5, 0.675), (12.0, 0.0)):
        points = np.column_stack([middle, np.full(200, height)])
        assert shade.depth(points).mean() == pytest.approx(expected, abs=0.08)
    low = np.column_stack([middle, np.zeros(200)])
    assert shade.depth(low, 10.0).mean() < 0.2 < shade.depth(low).mean()


def test_quarters_are_the_facet_divided() -> None:
    """Their corners lie on it, and their areas add up."""
    _, facets, _ = drawn_wood()
    facets = facets.take(slice(0, 500))
    four = subject.quarters(facets)
    assert (four.side**2).sum() == pytest.approx((facets.side**2).sum())
    whole, parts = triangle_corners(facets).astype(float), triangle_corners(four).astype(float)
    middles = 0.5 * (whole + np.roll(whole, -1, axis=1))
    known = np.concatenate([whole, middles], axis=1)
    for k in range(4):
        own = parts[k * len(facets) : (k + 1) * len(facets)]
        away = np.linalg.norm(own[:, :, None] - known[:, None], axis=3).min(axis=2)
        assert (away < 1e-3 * facets.side[:, None] + 1e-5).all()


def test_facets_are_as_long_as_the_faces_in_whose_place_they_are() -> None:
    """Wood above all: their longest sides lie along those of the faces, up to what facets of wood are stretched."""
    buffers = next(b.buffers for b in expanded_blocks(*scene()[:2]) if b.kind == "bark")
    corners, size = corners_of_faces(buffers)
    facets = subject._facets_of_faces(corners, size, buffers, np.arange(buffers.polygons))
    edges = corners[:, [1, 2, 2]] - corners[:, [0, 0, 1]]
    length = np.linalg.norm(edges, axis=2)
    every = np.arange(len(length))
    longest = edges[every, length.argmax(axis=1)] / length.max(axis=1)[:, None]
    made = triangle_corners(facets).astype(np.float64)
    reach = np.ptp(np.einsum("nki,ni->nk", made, longest), axis=1)
    within = (length.max(axis=1) > 1.05 * 1.5 * CIRCUMRADIUS * facets.side) & (facets.stretch < 0.99 * STRETCH)
    assert within.sum() > 100
    np.testing.assert_allclose(reach[within], length.max(axis=1)[within], rtol=0.01)


def test_every_part_is_decided_once() -> None:
    """Drawn, hidden or outside: nothing twice, and nothing is lost, whatever it consists of."""
    flora, seeds, camera, result = wood()
    given = support.refined(flora, result, camera, 1.2, 0.6).drawing
    frontier = Frontier(given.kinds, Coverage(camera), given.facet)
    parts = given.kinds[0].opened(given.parts[0])[0]
    drawn = [slabs[0] for slabs in frontier.slabs([parts])]
    assert all(map(len, (drawn, frontier.hidden[0], frontier.outside[0])))
    every = PlantParts.concatenate([pool.parts for pool in (*drawn, *frontier.hidden[0], *frontier.outside[0])])
    assert len(np.unique(every.branches.key + every.branch_only.astype(np.uint64))) == len(every)
    assert set(every.branches.plant.tolist()) == set(range(len(seeds)))
    area, whole = every.totals.optical_area.sum(), subplant_totals(flora, trunks(flora.rows, seeds)).optical_area.sum()
    assert area == pytest.approx(whole, rel=0.05)  # plants differ in leaves


def test_where_nobody_looks_dense_shoots_keep_what_is_opaque_and_twigs_all() -> None:
    """Needles behind needles cast no shadow of their own; a part that cannot be opened stands for itself alone."""
    flora, camera = support.alone("spruce", BIRCH), wood()[2]
    result = replace(run(flora, support.grove(2, 8.0), camera)[1], lights=(SUN,))
    given = support.refined(flora, result, camera, 1.2, 0.6).drawing
    (kind,), (parts,), least, twigs = given.kinds, given.parts, 1.0, 0
    while len(parts):
        large, part = kind.can_open(parts), kind.enough(parts)
        assert np.all(part[~large] == 1.0)
        assert np.all((part > 0.0) & (part <= 1.0))
        least, twigs = min(least, part.min()), twigs + np.count_nonzero(~large & ~parts.branch_only)
        parts = kind.opened(parts.take(np.flatnonzero(large)[:200]))[0]
    assert least < 0.5
    assert twigs > 100


def test_each_part_is_decided_with_the_depth_of_its_own_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many slabs others have waited for."""
    flora, _, camera, result = wood()
    given = support.refined(flora, result, camera, 1.2, 0.6).drawing
    decided, slabs = Frontier._decided, []

    def checked(self: Frontier, number: int, slab: Waiting, depth: np.ndarray) -> tuple:
        slabs.append(len(slab))
        assert (slab.near <= depth).all()
        return decided(self, number, slab, depth)

    monkeypatch.setattr(Frontier, "_decided", checked)
    for _ in Frontier(given.kinds, Coverage(camera), given.facet).slabs(given.parts, 2_000.0):
        pass
    assert len(slabs) > 5


def test_nothing_to_draw() -> None:
    flora, _, camera, result = scene()
    plants = copy(result.plants)
    plants.hold(PlantParts.empty(), SharePoints.empty())
    blocks, facets, _ = support.drawn(flora, replace(result, plants=plants), camera)
    assert blocks == [] and len(facets) == 0


def test_triangles_are_the_facets() -> None:
    flora, _, camera, result = scene()
    facets = support.drawn(flora, result, camera)[1]
    scene_ = support.refined(flora, result, camera, form=FacetForm(camera, np.pi, None, ()))
    list(scene_.mesh_blocks())
    blocks = list(facet_blocks(scene_))
    assert sum(b.polygons for b in blocks) == len(facets)
    assert sum(support.face_areas(b).sum() for b in blocks) == pytest.approx((facets.side**2).sum(), rel=1e-4)


def test_margins_are_part_of_the_image() -> None:
    assert Coverage(wood()[2]).width == WIDTH + 2 * MARGIN


def test_wood_of_a_pixel_is_lit_from_all_sides() -> None:
    """A flat branch has one side for all of its length; faces around it point everywhere, so that areas cancel."""
    flora, seeds = support.alone("birch", BIRCH), support.plants([3])
    trunk = support.trunks(flora.rows, seeds)
    away = 2.0 * trunk.radius[0] / (0.75 * 0.7 / WIDTH)
    camera = support.camera((0, -away, 6), (0, 0, 6), pixels=WIDTH, view=0.7)
    wide = 2.0 * trunk.radius / camera.extent_around(trunk.position)
    assert 0.6 < wide[0] < 0.9
    plants = GrownPlants(flora, camera, Transition(flora, camera, 1e9), facet_weights(flora, [seeds.species[0]]), ())
    canvas = _Meshes()
    plants._draw_branches(canvas, trunk, 1.2 * camera.extent_around(trunk.position))
    vectors = np.concatenate([support.face_vectors(mesh) for mesh in canvas.meshes])
    assert np.linalg.norm(vectors.sum(axis=0)) < 0.2 * np.linalg.norm(vectors, axis=1).sum()


class _Meshes:
    """Keeps what is drawn as meshes."""

    def __init__(self) -> None:
        self.meshes: list = []

    def add_mesh(self, what: tuple, buffers: object, culled: bool = False) -> None:
        if what[0] == "bark" and buffers is not None:
            self.meshes.append(buffers)

    def add_facets(self, *_: object) -> None:
        """Leaves do not matter."""

    def thin(self, key: np.ndarray, *_: object) -> tuple[np.ndarray, np.ndarray]:
        return np.arange(len(key)), np.ones(len(key))


def test_shadows_from_just_beside_the_image_are_fine() -> None:
    """Trees out of view, of which many throw shadows that fall far: the nearest has what it needs."""
    flora = support.alone("birch", BIRCH)
    beside = [(-16.5, 0, 0), *((-20.0 - 2.0 * (k // 5), 6.0 * (k % 5 - 2), 0) for k in range(40))]
    seeds = support.plants(np.arange(1, 43), position=[(0, 0, 0), *beside])
    camera = support.camera((0, -30, 8), (0, 0, 8), pixels=WIDTH, view=0.7)
    lit = Light("SUN", np.zeros(3), np.array([0.8, 0.1, -0.6]), 0.01)
    _, facets, _ = support.drawn(flora, replace(run(flora, seeds, camera)[1], lights=(lit,)), camera, 1.2, 0.6)
    near = facets.take(np.flatnonzero(np.hypot(facets.center[:, 0] + 16.5, facets.center[:, 1]) < 1.5))
    assert np.average(near.side, weights=near.side**2) < 0.2


def test_what_throws_shadows_into_the_image_is_opened_and_nothing_is_there_twice() -> None:
    flora, seeds = (
        support.alone("birch", BIRCH),
        support.plants(np.arange(3), position=[(-16, 0, 0), (-19, 6, 0), (60, 0, 0)]),
    )
    camera = support.camera((0, -30, 8), (0, 0, 8), pixels=WIDTH, view=0.7)
    lit = Light("SUN", np.zeros(3), np.array([0.8, 0.1, -0.6]), 0.01)
    given = support.refined(flora, replace(run(flora, seeds, camera)[1], lights=(lit,)), camera, 1.2, 0.6).drawing
    tile, kind = subject._Tile(given, None, True), given.kinds[0]
    fine, left = tile._for_shadows(kind, tile.frontier.pool(kind, given.parts[0]))
    assert len(fine) > 100 and len(left)
    every = PlantParts.concatenate([fine.parts, left.parts])
    assert len(np.unique(every.branches.key + every.branch_only.astype(np.uint64))) == len(every)
    whole = subplant_totals(flora, trunks(flora.rows, seeds)).optical_area.sum()
    assert every.totals.optical_area.sum() == pytest.approx(whole, rel=0.05)  # plants differ in leaves
