# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does first, by clicks that are counted; tests/window/test_clicks.py judges them."""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).resolve().parent))

from forest_steps import build_ground

STEP = 17  # pixels between two looks for a button, which is 20 high


def steps(ui):
    """See devtools/window_driver.py."""
    for name, task in TASKS.items():
        bpy.ops.wm.read_homefile(use_empty=False)
        yield 1.0
        yield from ui.show_sidebar("TetFlora")
        hand = Hand(ui)
        ui.values[name] = {}
        yield from task(hand, bpy.context.scene, ui.values[name])
        ui.values[name]["clicks"] = hand.clicks
        yield from ui.picture(name)


class Hand:
    """Presses buttons and keys, and counts them; looking for a button counts for nothing."""

    def __init__(self, ui):
        self.ui, self.clicks = ui, 0

    def key(self, key):
        """Press a key where the mouse is."""
        self.clicks += 1
        self.ui.press(key)
        yield 0.5

    def click(self, said, place=None, above=0, popup=False, **keys):
        """Find a button by what Blender copies of it and click it, or what is some pixels above it."""
        x, y = yield from self.ui.find(said, place, popup, **keys)
        self.ui.move(x, y + above)
        yield 0.1
        self.clicks += 1
        self.ui.press('LEFTMOUSE')
        yield 0.5
        return x, y + above

    def add_layer(self, button):
        """The + beside the list of layers, and a button of what it opens around the mouse."""
        x, y = yield from self.click("TETFLORA_PT_add_layer", self.beside_lists())
        yield 1.5  # pictures are loaded
        yield from self.ui.picture("add_layer")
        inside = [(x - 60 - a, b) for a in (0, 120, 240, 360) for b in (*range(y - 20, 0, -STEP), *range(y, 990, STEP))]
        yield from self.click(f"ops.tetflora.{button}", inside, popup=True)
        yield from self.done()

    def add_species(self, up):
        """The + beside the list of species, above the minus, and a picture of the gallery that it opens."""
        x, y = yield from self.click("ops.tetflora.edit_list(", self.beside_lists(), above=20)
        yield 1.5
        yield from self.ui.picture("add_species")
        self.ui.move(x - 571, y + up)
        yield 0.3
        self.clicks += 1
        self.ui.press('LEFTMOUSE')
        yield 0.5

    def beside_lists(self):
        """Where buttons beside lists are."""
        return self.ui.places(across=(-36, -46))

    def properties(self):
        """Where buttons of the Properties editor are."""
        return self.ui.places('WINDOW', 'PROPERTIES')

    def done(self):
        """Wait until no job runs."""
        yield 0.5
        yield from self.ui.until(lambda: not self.ui.window.modal_operators, 900, "end of the job")
        yield 0.5

    def render(self, found):
        """F12; how much of the picture is green."""
        found["green"] = yield from self.shoot(f"render_{len(self.ui.values)}", 600)

    def shoot(self, name, seconds):
        """F12 and Esc; a picture of that name, and how much of it is green."""
        done = []
        bpy.app.handlers.render_complete.append(end := lambda *_: done.append(True))
        self.ui.move(*self.ui.center())
        yield from self.key('F12')
        yield from self.ui.until(lambda: done, seconds, "render")
        yield 1.0
        bpy.app.handlers.render_complete.remove(end)
        path = str(self.ui.out_dir / f"{name}.png")
        bpy.data.images["Render Result"].save_render(path)
        image = bpy.data.images.load(path)
        pixels = np.zeros(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
        self.ui.press('ESC')
        yield 1.0
        red, green, blue, _ = pixels.reshape(-1, 4).T
        return float(((green > 1.05 * red) & (green > 1.05 * blue)).mean())


def soon_done():
    """A small picture and few polygons: the machine of the test is slow, an artist would wait."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = 'CYCLES', 1, False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 160, 90, 100
    scene.tetflora.quality = 'DRAFT'


def shapes_of(scene):
    """Plants as they are shown before they are refined."""
    state = next(
        module for name, module in sys.modules.items() if name.endswith("tetflora_addon.blender.viewport.state")
    )
    preview = state.find(scene)
    return preview.shapes if preview else None


def first_forest(hand, _scene, found):
    """First Forest, Refine, F12."""
    yield from hand.click("ops.tetflora.first_forest(")
    yield from hand.done()
    found["plants"] = sum(obj.tetflora.is_plant for obj in bpy.context.scene.objects)
    found["startup"] = sorted(set(bpy.context.scene.objects.keys()) & {"Cube", "Camera", "Light"})
    yield from hand.ui.until(lambda: shapes_of(bpy.context.scene), 60, "shapes")
    found["shown"] = shapes_of(bpy.context.scene).of
    found["through_camera"] = hand.ui.area().spaces.active.region_3d.view_perspective == 'CAMERA'
    soon_done()
    yield from hand.click("ops.tetflora.refine(")
    yield from hand.done()
    found["refined"] = bpy.context.scene.tetflora.statistics != ""
    # The Outliner takes its time for these, and must not be drawn while the render's thread changes what it lists.
    for number in range(4000):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Other {number}", None))
    yield from hand.render(found)


def biome(hand, scene, found):
    """A biome on a hill."""
    build_ground(scene)
    yield from hand.add_layer("add_biome(biome='alpine_treeline'")
    found["layers"] = len(bpy.context.scene.tetflora.layers)
    found["grounds"] = [entry.object.name for entry in bpy.context.scene.tetflora.layers[0].grounds]


def autumn(hand, _scene, found):
    """The season's menu, and its item by the letter that is underlined."""
    yield from hand.click("tetflora.year.season", shift=True)
    year = bpy.context.scene.tetflora.year
    for _ in range(9):  # on a machine that is busy, menus that are just opening let keys pass
        if not year.enabled:
            hand.ui.press('A')
            yield 0.5
    hand.clicks += 1
    found["season"] = [year.season, year.enabled]


def own_tree(hand, _scene, found):
    """The startup's cube as a species, by a button of the Object tab, then a plant of it in the Add menu's place."""
    yield from hand.click("ops.tetflora.use_as_species(", hand.properties())
    found["species"] = len(bpy.context.scene.tetflora.asset_species)


def own_ground(hand, _scene, found):
    """A mixed wood with cover on a ground of one's own, by daylight, and F12."""
    build_ground(bpy.context.scene)
    bpy.context.scene.tetflora.populate.mix.clear()
    soon_done()
    yield from hand.add_layer("populate(")
    for up in (215, 342):  # pixels, within two rows of pictures
        yield from hand.add_species(up)
    yield from hand.click("ops.tetflora.update_layers(")
    yield from hand.done()
    yield from hand.add_layer("ground_cover(")
    yield from hand.click("ops.tetflora.daylight(")
    yield 1.0
    layers = bpy.context.scene.tetflora.layers
    found["species"] = sorted(entry.species for entry in layers[0].mix)
    found["plants"] = [layer.made for layer in layers]
    yield from hand.render(found)


TASKS = {"own_ground": own_ground, "biome": biome, "autumn": autumn, "own_tree": own_tree, "first_forest": first_forest}
