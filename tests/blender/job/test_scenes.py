# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes as artists have them, as a renderer sees them: stereo, regions, duplicates, catchers, mattes, light groups."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, tiny_render

SIZE = 32


@pytest.fixture
def scene(clean_file):
    scene = tiny_render(samples=4, size=SIZE)
    scene.render.film_transparent = True
    add_camera(location=(0.0, -13.0, 1.2))
    return scene


def rendered(scene, path):
    scene.render.filepath = str(path / "render.png")
    scene.render.image_settings.color_mode = 'RGBA'
    bpy.ops.render.render(write_still=True)


def alpha(path):
    image = bpy.data.images.load(str(path))
    width, height = image.size
    found = np.array(image.pixels).reshape(height, width, 4)[..., 3]
    bpy.data.images.remove(image)
    return found


def test_both_eyes_see_plants(scene, tmp_path):
    add_plant()
    scene.render.use_multiview = True
    scene.render.views_format = 'STEREO_3D'
    scene.render.image_settings.views_format = 'INDIVIDUAL'
    stereo = scene.camera.data.stereo
    stereo.interocular_distance, stereo.convergence_mode = 4.0, 'PARALLEL'
    rendered(scene, tmp_path)
    left, right = (alpha(tmp_path / f"render_{eye}.png") for eye in "LR")
    columns = np.arange(SIZE)
    middle = [float((eye.sum(axis=0) * columns).sum() / eye.sum()) for eye in (left, right)]
    assert left.sum() == pytest.approx(right.sum(), rel=0.15) and left.sum() > 10.0
    shift = 4.0 * SIZE / (2 * 13.0 * np.tan(scene.camera.data.angle / 2))
    assert middle[0] - middle[1] == pytest.approx(shift, rel=0.15)


def test_a_render_region_shows_what_the_whole_picture_shows_there(scene, tmp_path):
    add_plant()
    rendered(scene, tmp_path)
    whole = alpha(tmp_path / "render.png")
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.5, 1.0
    rendered(scene, tmp_path)
    part = alpha(tmp_path / "render.png")
    assert part[:, : SIZE // 2].sum() == 0.0
    assert part[:, SIZE // 2 :].sum() == pytest.approx(whole[:, SIZE // 2 :].sum(), rel=0.15)


@pytest.mark.parametrize("refined", [False, True])
def test_duplicates_stand_beside_their_originals(scene, tmp_path, refined):
    plant, rock = add_plant(location=(-3.0, 0.0, 0.0)), add_mesh("rock", size=0.5)
    rock.location, rock.rotation_euler.x = (-1.2, 0.0, 2.6), np.pi / 2
    rock.tetflora.is_explicit = True
    if refined:
        bpy.ops.tetflora.refine()
    for obj in (plant, rock):
        copy = obj.copy()
        scene.collection.objects.link(copy)
        copy.location.x += 4.5
    rendered(scene, tmp_path)
    seen = alpha(tmp_path / "render.png")
    step = round(4.5 * SIZE / (2 * 13.0 * np.tan(scene.camera.data.angle / 2)))
    assert seen[:, :16].sum() > 10.0
    assert seen[:, step : step + 16].sum() == pytest.approx(seen[:, :16].sum(), rel=0.2)
    if refined:
        bpy.ops.tetflora.clear()
    assert not any(o.hide_render for o in scene.objects if o.name.startswith("rock"))


def test_plants_shade_a_shadow_catcher(scene, tmp_path):
    ground = add_mesh("ground", size=6.0)
    ground.is_shadow_catcher = True
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", 'SUN'))
    sun.data.energy = 5.0
    scene.collection.objects.link(sun)
    scene.camera.location, scene.camera.rotation_euler = (0.0, 0.0, 20.0), (0.0, 0.0, 0.0)
    sun.rotation_euler = (0.0, np.radians(60.0), 0.0)
    add_plant().visible_camera = False
    rendered(scene, tmp_path)
    seen = alpha(tmp_path / "render.png")
    west, east = seen[:, : SIZE // 2].sum(), seen[:, SIZE // 2 :].sum()
    assert max(west, east) > 5.0 and max(west, east) > 3.0 * min(west, east)


def layers(scene, path):
    """Channels of a multilayer file by name, and its metadata."""
    import OpenImageIO

    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = 'MULTI_LAYER_IMAGE'
    scene.render.image_settings.file_format = 'OPEN_EXR_MULTILAYER'
    scene.render.filepath = str(path / "layers.exr")
    bpy.ops.render.render(write_still=True)
    file = OpenImageIO.ImageInput.open(str(path / "layers.exr"))
    channels, about, part = {}, {}, 0
    while file.seek_subimage(part, 0):  # a part for each pass
        spec = file.spec()
        pixels = file.read_image(part, 0, 0, spec.nchannels, "float")
        channels |= {name: pixels[..., n] for n, name in enumerate(spec.channelnames)}
        about |= {one.name: one.value for one in spec.extra_attribs}
        part += 1
    file.close()
    return channels, about


def test_cryptomatte_names_species_and_light_groups_hold_the_light_of_plants(scene, tmp_path):
    bpy.utils.expose_bundled_modules()
    add_plant(location=(-3.0, 0.0, 0.0))
    lit = add_plant(location=(3.0, 0.0, 0.0))
    lit.lightgroup = "right"
    layer = scene.view_layers[0]
    layer.use_pass_cryptomatte_object = layer.use_pass_cryptomatte_asset = True
    for name in ("left", "right"):
        layer.lightgroups.add(name=name)
    scene.tetflora.output.light_group, scene.tetflora.baked_light = "left", 'ALL'
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", 'SUN'))
    sun.data.energy, sun.rotation_euler.x = 5.0, 1.0
    scene.collection.objects.link(sun)
    channels, about = layers(scene, tmp_path)
    text = " ".join(value for value in about.values() if isinstance(value, str))
    assert "Bush (TetFlora)" in text
    matte = next(v for k, v in channels.items() if k.endswith("CryptoAsset00.g"))
    assert matte.max() > 0.5
    for name, own in (("left", slice(0, SIZE // 2)), ("right", slice(SIZE // 2, SIZE))):
        light = next(v for k, v in channels.items() if k.lower().endswith(f"combined_{name}.g"))
        assert light[:, own].sum() > 0.5 and light.sum() == pytest.approx(light[:, own].sum(), rel=0.05)
