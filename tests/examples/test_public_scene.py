# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The public test scene builds from seeds, and its references are theirs."""

from __future__ import annotations

import re

import numpy as np
import pytest

from benchmarks import pictures as images
from examples import public_scene


@pytest.mark.parametrize("distance", public_scene.DISTANCES)
def test_the_scene_is_seeds_of_four_species_for_an_image_of_the_size_of_its_reference(distance, clean_file):
    scene = public_scene.build(distance)
    plants = [o for o in scene.objects if o.tetflora.is_plant]
    assert len(plants) == 4 * public_scene.DISTANCES[distance][1]
    assert len({o.tetflora.species for o in plants}) == 4
    assert not any(o.type == 'MESH' and o.name != "Ground" for o in scene.objects)
    reference = images.read_picture(public_scene.FOLDER / f"{distance}.exr")
    assert reference.shape[:2] == (scene.render.resolution_y, scene.render.resolution_x)


@pytest.mark.parametrize("distance", public_scene.DISTANCES)
def test_a_reference_is_no_different_from_itself_and_plants_are_where_its_mask_says(distance, clean_file):
    reference, mask = (public_scene.FOLDER / f"{distance}{end}" for end in (".exr", "-mask.png"))
    assert public_scene.compare(reference, reference, mask) == {"flip": 0.0, "flip_all": 0.0, "color": 0.0}
    light, seen = images.read_picture(reference)[:, :, :3].mean(axis=2), images.read_picture(mask)[:, :, 0]
    # Foliage is darker than the sky that it is seen before, and than the ground.
    assert light[seen > 0.9].mean() < 0.6 * light[seen == 0.0].mean()


def test_the_image_shows_all_plants_in_full(clean_file):
    mask = images.read_picture(public_scene.FOLDER / "near-mask.png")[:, :, 0]
    assert not mask[:, [0, -1]].any()
    assert not mask[[0, -1]].any()


def test_the_readme_tells_the_noise_of_another_seed(clean_file, tmp_path):
    readme = (public_scene.FOLDER / "README.md").read_text(encoding="utf-8")
    found = re.search(r"far: all polygons, another seed \| (\S+) \| (\S+) \| (\S+) ", readme)
    scene = public_scene.build("far")
    public_scene.make(scene, expand=True)
    path = tmp_path / "far.exr"
    images.render(scene, path, public_scene.SAMPLES, seed=1, form='OPEN_EXR')
    noise = public_scene.compare(path, public_scene.FOLDER / "far.exr", public_scene.FOLDER / "far-mask.png")
    np.testing.assert_allclose(list(noise.values()), [float(value) for value in found.groups()], atol=0.002)


def test_linear_light_counts_as_a_display_stores_it(clean_file):
    light = np.linspace(0.0, 1.0, 1001, dtype=np.float32)
    np.testing.assert_allclose(images.linear_light(public_scene.displayed(light)), light, atol=1e-6)
    np.testing.assert_allclose(public_scene.displayed(np.float32([-1.0, 7.0])), [0.0, 1.0], atol=1e-6)
    far = public_scene.FOLDER / "far.exr"
    linear = images.read_picture(far)[:, :, :3]
    np.testing.assert_array_equal(public_scene.stored(far), public_scene.displayed(linear))


def test_an_image_of_another_size_is_refused(clean_file):
    near, far = (public_scene.FOLDER / f"{name}.exr" for name in ("near", "far"))
    with pytest.raises(SystemExit, match="pixels"):
        public_scene.compare(near, far, public_scene.FOLDER / "far-mask.png")
