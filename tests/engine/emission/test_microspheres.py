# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Microspheres stand for facets: one each, in the same place, covering as much of the image, in the same colors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tests.engine.emission.test_emission import scene
from tetflora_addon.arrays import unit
from tetflora_addon.buffers import MeshBuffers, PointBuffers
from tetflora_addon.camera.camera import Camera
from tetflora_addon.emission.emitters import FacetForm, facet_blocks
from tetflora_addon.proxies.microsurfaces import Facets
from tetflora_addon.proxies.primitives import LEAST_COVER, SKYLIGHT, facing, joined, shape_buffers, spheres_of

EYE = np.array([2.0, -30.0, 4.0])


def squares(n: int = 20_000) -> Facets:
    """Facets turned at random, of several sizes and colors, in a box of two meters."""
    random = np.random.default_rng(3)
    across, along = np.linalg.qr(random.normal(size=(n, 3, 2)))[0].transpose(2, 0, 1)
    center, side = random.uniform(-1, 1, (n, 3)), random.uniform(0.01, 0.05, n)
    return Facets(center, across, along, side, random.random((n, 3)), random.random(n))


def camera(kind: str = "PERSP") -> Camera:
    frame = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return Camera(kind, EYE, frame, (-0.4, 0.4, -0.3, 0.3), 0.1, 100.0, 200, 150)


def discs(radius: np.ndarray) -> np.ndarray:
    return np.pi * radius.astype(np.float64) ** 2


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "PANO"])
def test_what_a_facet_covers_for_the_camera_its_sphere_covers(kind: str) -> None:
    """By the corners of the facets themselves, projected; but for those that are seen from their edge."""
    facets, view = squares(), camera(kind)
    made = shape_buffers(spheres_of(facets, view))
    vectors = support.face_vectors(support.facet_mesh(facets))
    sight = np.array([0.0, 1.0, 0.0]) if kind == "ORTHO" else unit(facets.center - EYE)
    shown = np.abs((vectors * sight).sum(axis=1))
    edge = facing(facets, view) < LEAST_COVER
    assert discs(made.radius)[~edge] == pytest.approx(shown[~edge], rel=1e-3, abs=1e-7)
    assert edge.mean() < 1.2 * LEAST_COVER
    assert discs(made.radius).sum() == pytest.approx(shown.sum(), rel=0.02)


def skylight(number: int = 4000) -> np.ndarray:
    """Directions from which an even sky lights level ground."""
    across, around = np.random.default_rng(5).random((2, number))
    low, turn = np.sqrt(across), 2.0 * np.pi * around
    return np.stack([low * np.cos(turn), low * np.sin(turn), np.sqrt(1.0 - across)], axis=1)


def test_what_nobody_sees_casts_the_same_shadow_on_average_over_light_from_the_sky() -> None:
    """Of an even one, as it falls on level ground. Leaves that lie level cast more than those that hang."""
    facets = squares(3000)
    vectors = support.face_vectors(support.facet_mesh(facets))
    for sun in (None, np.array([0.6, 0.0, -0.8])):  # below the horizon
        made = shape_buffers(spheres_of(facets, None, sun=sun))
        assert discs(made.radius) == pytest.approx(np.abs(vectors @ skylight().T).mean(axis=1), rel=0.03)


@pytest.mark.parametrize("height", [12.0, 60.0, 90.0])
def test_what_nobody_sees_casts_the_same_shadow_in_the_sun(height: float) -> None:
    """A canopy of level leaves as spheres lets as much of the sun through as its leaves; the sky's light is a share."""
    facets, up = squares(100), np.radians(height)
    facets = replace(
        facets, across=np.tile(np.eye(3)[0], (len(facets), 1)), along=np.tile(np.eye(3)[1], (len(facets), 1))
    )
    sun = np.array([np.cos(up), 0.0, np.sin(up)])
    covered = discs(shape_buffers(spheres_of(facets, None, sun=sun)).radius) / facets.side**2
    direct = sun[2] / (sun[2] + SKYLIGHT)
    assert covered == pytest.approx(direct * sun[2] + (1.0 - direct) * 2.0 / 3.0, rel=1e-5)
    assert height < 30.0 or covered == pytest.approx(sun[2], rel=0.06)


def test_places_and_looks_are_those_of_the_facets() -> None:
    some, others = squares(50), squares(30)
    made = shape_buffers(joined([spheres_of(some, camera()), spheres_of(others, None)]))
    assert made.polygons == 80
    for values, name in ((made.positions, "center"), *((v, k.removeprefix("tf_")) for k, v in made.attributes.items())):
        expected = np.concatenate([getattr(part, name) for part in (some, others)])
        assert (values == expected.astype(np.float32)).all()


def test_a_refinement_has_a_sphere_for_each_facet() -> None:
    """Where all are spheres as many as facets; where only hidden ones are, triangles where they are seen."""
    flora, _, view, result = scene()
    made = {}
    for name, form in (
        ("all", FacetForm(view, np.pi, None, (True, False))),
        ("hidden", FacetForm(view, np.pi, None, (False,))),
        ("none", FacetForm(view, np.pi, None, ())),
    ):
        refined = support.refined(flora, result, view, form=form)
        list(refined.mesh_blocks())
        made[name] = list(facet_blocks(refined))
    numbers = {name: sum(block.polygons for block in blocks) for name, blocks in made.items()}
    assert numbers["all"] == numbers["hidden"] == numbers["none"] > 1000
    kinds = {name: {type(block) for block in blocks} for name, blocks in made.items()}
    assert kinds == {"all": {PointBuffers}, "hidden": {PointBuffers, MeshBuffers}, "none": {MeshBuffers}}
    area = sum(support.face_areas(block).sum() for block in made["none"])
    cover = sum(discs(block.radius).sum() for block in made["all"])
    assert 0.2 * area < cover < 0.6 * area
