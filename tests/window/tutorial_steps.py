# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's tutorials, step by step in the window, as devtools/tutorials.py starts them.

Buttons and settings of TetFlora are clicked and typed into; without the mouse (TETFLORA_NO_MOUSE), for pictures, their
operators are called and properties set instead, which takes a tenth of the time. What is Blender's own (adding a mesh,
modeling, choosing a file) is done by its operators. Files of a real place lie in the folder ``place`` beside this
script's pictures.
"""

import json
import os
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Quaternion, Vector

sys.path.append(str(Path(__file__).resolve().parent))

from click_steps import Hand

WIDTH, SAMPLES = 160, 4


def steps(ui):
    """See devtools/window_driver.py."""
    wanted = os.environ.get("TETFLORA_TUTORIALS", "").split(",")
    for name, tutorial in TUTORIALS.items():
        if wanted != [""] and name not in wanted:
            continue
        bpy.ops.wm.read_homefile(use_empty=False)
        yield 1.0
        bpy.context.scene.tetflora.preview.plants = 'NONE'  # a window without a graphics card is slow
        yield from ui.show_sidebar("TetFlora")
        writer = (Caller if os.environ.get("TETFLORA_NO_MOUSE") else Writer)(ui, name)
        ui.values[name] = {}
        yield from tutorial(writer, ui.values[name])
        (ui.out_dir / "values.json").write_text(json.dumps(ui.values))


class Writer(Hand):
    """Also types into fields, adds keyframes, turns the view, and renders."""

    def __init__(self, ui, name):
        super().__init__(ui)
        self.name = name

    def delete_all(self):
        """A and X: the startup file's cube, light and camera."""
        with self.ui.override():
            bpy.ops.object.select_all(action='SELECT')
            bpy.ops.object.delete()
        yield 0.5

    def grid(self, size, height=0.0):
        """Add > Mesh > Grid of some meters, and a sculptor's hills."""
        with self.ui.override():
            bpy.ops.mesh.primitive_grid_add(x_subdivisions=60, y_subdivisions=60, size=size)
        mesh = bpy.context.active_object.data
        place = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", place)
        x, y, _ = place.reshape(-1, 3).T
        place[2::3] = height * (np.cos(x / 17.0 + 0.6) * np.cos(y / 23.0) + 0.2 * np.cos(x / 6.0 - y / 8.0))
        mesh.vertices.foreach_set("co", place)
        mesh.shade_smooth()
        mesh.update()
        yield 1.0

    def enter(self, path, value):
        """Copy a number and paste it while the mouse is over the field of a setting."""
        yield from self.ui.find(path, shift=True)
        bpy.context.window_manager.clipboard = str(value)
        self.clicks += 1
        self.ui.press('V', ctrl=True)
        yield 0.5

    def keyframe(self, path, frame, value):
        """Go to a frame, enter a value, and press I over the field."""
        bpy.context.scene.frame_set(frame)
        yield 0.5
        yield from self.enter(path, value)
        yield from self.key('I')

    def view(self, middle, azimuth, tilt, distance):
        """Turn the view: degrees from the south and above the horizon."""
        region = self.ui.area().spaces.active.region_3d
        turn = Quaternion((0.0, 0.0, 1.0), np.radians(azimuth)) @ Quaternion((1.0, 0.0, 0.0), np.radians(90.0 - tilt))
        region.view_perspective = 'PERSP'
        region.view_rotation, region.view_location, region.view_distance = turn, Vector(middle), distance
        yield 1.0

    def select(self, *objects):
        """Click objects, the last one with the most weight."""
        for obj in bpy.context.selected_objects:
            obj.select_set(False)
        for obj in objects:
            obj.select_set(True)
        bpy.context.view_layer.objects.active = objects[-1]
        yield 0.5

    def across(self, *pixels):
        """Places from top to bottom, by pixels from the right edge of the sidebar."""
        return self.ui.places(across=pixels)

    def scroll(self, steps):
        """Turn the wheel over the sidebar."""
        self.ui.move(*self.ui.center('UI'))
        yield 0.3
        for _ in range(steps):
            self.ui.press('WHEELDOWNMOUSE')
            yield 0.1
        yield 0.5

    def season(self, letter):
        """The menu of seasons, below the layers, and an item by the letter that is underlined."""
        yield from self.scroll(10)
        yield from self.click("tetflora.year.season", shift=True)
        yield from self.key(letter)

    def choose_own(self):
        """The menu of the species in the list, and the model in it."""
        x, y = yield from self.click("layers[0].mix[0].species_choice", shift=True)
        yield 1.0
        yield from self.ui.picture("own_trees_menu")
        self.ui.move(x - 203, y - 283)
        yield 0.3
        self.ui.press('LEFTMOUSE')
        yield 0.5

    def look_by_daylight(self, where=""):
        """The two buttons below Refine, and a choice in Adjust Last Operation."""
        yield from self.click("ops.tetflora.daylight(")
        yield 1.0
        if where:
            with self.ui.override():
                bpy.ops.tetflora.look(where=where)
        else:
            yield from self.click("ops.tetflora.look(")
        yield 1.0

    def picture(self, name=None, exposure=0.0):
        """F12, as a draft that is soon done, and a copy of the file; how much of the picture is green."""
        scene, name = bpy.context.scene, name or self.name
        scene.view_settings.exposure = exposure
        scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = 'CYCLES', SAMPLES, False
        scene.render.resolution_x, scene.render.resolution_y = WIDTH, WIDTH * 9 // 16
        scene.render.resolution_percentage = 100
        scene.tetflora.quality = 'DRAFT'  # an artist would wait
        green = yield from self.shoot(f"{name}_render", 1200)
        bpy.ops.wm.save_as_mainfile(filepath=str(self.ui.out_dir / f"{name}.blend"), copy=True, compress=True)
        return green

    def window(self):
        """A picture of the window, with plants as shapes."""
        bpy.context.scene.tetflora.preview.plants = 'LIGHT'
        yield 1.0
        yield from self.ui.picture(f"{self.name}_window")
        bpy.context.scene.tetflora.preview.plants = 'NONE'


class Caller(Writer):
    """Calls what buttons call, and sets what fields show, without looking for them."""

    def click(self, said, *_place, **_keys):
        """Call an operator as its button does, or choose a row, or turn a switch."""
        name, _, values = said.partition("(")
        scene = bpy.context.scene
        if name.startswith("ops.tetflora."):
            self._call(name.rpartition(".")[2], values)
        elif said.startswith("layers[") or "." in said:
            owner, _, last = said.rpartition(".")
            owner = scene.path_resolve(owner if owner.startswith("tetflora") else f"tetflora.{owner}")
            setattr(owner, last, not getattr(owner, last))
        else:
            layers = scene.tetflora.layers
            scene.tetflora.layers_index = next(n for n, layer in enumerate(layers) if layer.name == said)
        yield 0.5

    def add_layer(self, button):
        """What a button of the list of layers calls."""
        name, _, values = button.partition("(")
        self._call(name, values or ("by_density=True" if name == "populate" else ""))
        yield from self.done()

    def add_species(self, up):
        """A species of the gallery, by the place of its picture."""
        layer = bpy.context.scene.tetflora.layers[bpy.context.scene.tetflora.layers_index]
        layer.mix.add().species = {215: "scots_pine", 342: "oak"}[up]
        yield 0.2

    def choose_own(self):
        """The model in place of the beech."""
        scene = bpy.context.scene
        mix = scene.tetflora.layers[0].mix
        mix.clear()
        mix.add().species = scene.tetflora.asset_species[0].identifier
        yield 0.2

    def enter(self, path, value):
        """Set a number."""
        owner, _, last = path.rpartition(".")
        if last == "stand_year":
            bpy.context.scene.tetflora.layers[0].field.tetflora.stand_year = value
        else:
            owner = owner if owner.startswith("tetflora") else f"tetflora.{owner}"
            setattr(bpy.context.scene.path_resolve(owner), last, int(value) if last == "day" else value)
        yield 0.2

    def keyframe(self, path, frame, value):
        """Set a number and its keyframe."""
        bpy.context.scene.frame_set(frame)
        yield from self.enter(path, value)
        bpy.context.scene.keyframe_insert(path, frame=frame)

    def across(self, *_pixels):
        """No places are looked at."""

    def season(self, letter):
        """Choose a season."""
        bpy.context.scene.tetflora.year.season = {'A': 'AUTUMN'}[letter]
        yield 0.2

    def _call(self, name, values):
        given = eval(f"dict({values.rstrip(')')})")
        with self.ui.override():
            getattr(bpy.ops.tetflora, name)('INVOKE_DEFAULT', **given)


def own_ground(writer, found):
    """A mixed wood on ground of one's own."""
    yield from writer.delete_all()
    yield from writer.grid(100.0, 3.0)
    yield from writer.add_layer("populate(")
    for up in (215, 342):
        yield from writer.add_species(up)
    yield from writer.click("ops.tetflora.update_layers(")
    yield from writer.done()
    yield from writer.add_layer("ground_cover(")
    yield from writer.view((0.0, -10.0, 2.0), 25.0, 25.0, 60.0)
    yield from writer.look_by_daylight()
    yield from writer.window()
    layers = bpy.context.scene.tetflora.layers
    found["species"] = sorted(entry.species for entry in layers[0].mix)
    found["plants"] = [layer.made for layer in layers]
    found["green"] = yield from writer.picture(exposure=2.5)  # it is dark in a wood


def biome(writer, found):
    """A biome with more junipers and without ground cover, in summer and in autumn."""
    yield from writer.delete_all()
    with writer.ui.override():
        bpy.ops.tetflora.add_biome('INVOKE_DEFAULT', biome="birch_pine")  # the entry of the Add menu
    yield from writer.done()
    layers = bpy.context.scene.tetflora.layers
    before = {layer.name: layer.made for layer in layers}
    yield from writer.click("Junipers")
    index = next(n for n, layer in enumerate(layers) if layer.name == "Junipers")
    found["active"] = layers[bpy.context.scene.tetflora.layers_index].name
    yield from writer.enter(f"layers[{index}].density", 2.0 * layers[index].density)
    yield from writer.click("ops.tetflora.update_layers(")
    yield from writer.done()
    layers = bpy.context.scene.tetflora.layers
    found["junipers"] = [before["Junipers"], layers[index].made]
    index = next(n for n, layer in enumerate(layers) if layer.name == "Ground cover")
    yield from writer.click(f"layers[{index}].shown", writer.across(-90, -94), shift=True)
    found["shown"] = layers[index].shown
    yield from writer.view((0.0, -20.0, 2.0), 20.0, 20.0, 60.0)
    yield from writer.look_by_daylight()
    yield from writer.window()
    found["green"] = [(yield from writer.picture())]
    yield from writer.season('A')
    found["season"] = bpy.context.scene.tetflora.year.season
    found["green"].append((yield from writer.picture("biome_autumn")))


def grown_forest(writer, found):
    """A stand, its years, and two of them."""
    yield from writer.delete_all()
    yield from writer.grid(60.0, 1.5)
    yield from writer.add_layer("grow_stand(")
    yield from writer.view((0.0, -10.0, 1.0), 15.0, 20.0, 50.0)
    yield from writer.look_by_daylight()
    field = bpy.context.scene.tetflora.layers[0].field
    found["last"] = field.tetflora.stand.last_year
    found["green"] = []
    for year in (20, 100):
        yield from writer.enter("tetflora.stand_year", year)
        found["year"] = field.tetflora.stand_year
        yield from writer.window()
        found["green"].append((yield from writer.picture(f"grown_forest_{year}")))
    yield from writer.click("ops.tetflora.animate_growth(")
    found["animated"] = field.animation_data is not None and field.animation_data.action is not None


def real_place(writer, found):
    """Terrain, map, inventory and canopy height of a valley."""
    yield from writer.delete_all()
    place = writer.ui.out_dir / "place"
    for operator, file in (
        ("import_terrain", "elevation.asc"),
        ("import_outlines", "map.geojson"),
        ("import_inventory", "trees.csv"),
        ("import_canopy", "canopy.tif"),
    ):
        system = {} if file.endswith(("json", "tif")) else {"epsg": 25832}  # the other files name theirs
        with writer.ui.override():
            getattr(bpy.ops.tetflora, operator)('EXEC_DEFAULT', filepath=str(place / file), **system)
        yield from writer.done()
    yield from writer.view((10.0, -80.0, 440.0), 10.0, 25.0, 90.0)
    yield from writer.click("ops.tetflora.daylight(")
    with writer.ui.override():
        bpy.ops.tetflora.look(where='ABOVE')
    yield 1.0
    yield from writer.window()
    found["collections"] = sorted(c.name for c in bpy.context.scene.collection.children_recursive)
    found["fields"] = sorted(obj.name for obj in bpy.context.scene.objects if obj.tetflora.is_field)
    found["green"] = yield from writer.picture()


def own_trees(writer, found):
    """A model of one's own as a species, and a tree along a drawn trunk."""
    yield from writer.delete_all()
    tree = model()
    yield from writer.select(tree)
    yield from writer.click("ops.tetflora.use_as_species(", writer.properties())
    tree.hide_render = True
    tree.hide_set(True)
    yield from writer.grid(60.0, 1.0)
    yield from writer.add_layer("populate(")
    yield from writer.choose_own()
    yield from writer.enter("layers[0].density", 60.0)
    yield from writer.click("ops.tetflora.update_layers(")
    yield from writer.done()
    layer = bpy.context.scene.tetflora.layers[0]
    found["mix"] = [one.species for one in layer.mix]
    found["plants"] = layer.made
    with writer.ui.override():
        bpy.ops.curve.primitive_bezier_curve_add()
    curve = bpy.context.active_object
    points = curve.data.splines[0].bezier_points
    for point, place in zip(points, ((0.0, 0.0, 0.0), (1.5, 0.5, 8.0)), strict=True):
        point.co = place
        point.handle_left = (place[0] - 1.0, place[1], place[2] - 2.5)
        point.handle_right = (place[0] + 1.0, place[1], place[2] + 2.5)
    curve.location = (0.0, -14.0, 0.0)
    yield 1.0
    yield from writer.click("ops.tetflora.use_as_skeleton(", writer.properties())
    found["drawn"] = sum(obj.tetflora.skeleton is not None for obj in bpy.context.scene.objects)
    yield from writer.view((0.0, -12.0, 4.0), 10.0, 8.0, 26.0)
    yield from writer.look_by_daylight('VIEW')
    yield from writer.window()
    found["green"] = yield from writer.picture()


def film(writer, found):
    """First Forest through a year."""
    yield from writer.click("ops.tetflora.first_forest(")
    yield 2.0
    scene = bpy.context.scene
    yield from writer.click("tetflora.year.enabled", shift=True)
    yield from writer.keyframe("tetflora.year.day", 1, 1)
    yield from writer.keyframe("tetflora.year.day", 73, 361)
    found["enabled"] = scene.tetflora.year.enabled
    area = next(a for a in writer.ui.window.screen.areas if a.type == 'DOPESHEET_EDITOR')
    writer.ui.move(area.x + area.width // 2, area.y + area.height // 3)
    yield 0.3
    yield from writer.key('A')
    yield from writer.key('T')
    yield from writer.ui.picture("film_interpolation")
    yield from writer.key('L')
    action = scene.animation_data.action
    curves = [curve for bag in bags(action) for curve in bag.fcurves]
    found["keys"] = [[(k.co.x, k.co.y, k.interpolation) for k in curve.keyframe_points] for curve in curves]
    yield from writer.window()
    found["green"] = []
    for frame in (4, 25, 40, 60):
        scene.frame_set(frame)
        found["green"].append((yield from writer.picture(f"film_{frame}")))


def bags(action):
    """Where an action of Blender 5 keeps its curves."""
    return [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]


def model():
    """A tree as a modeler makes one: a trunk of eight sides and three cones of needles, with two materials."""
    scene = bpy.context.scene
    parts = []
    for radius, tall, foot, color in (
        (0.25, 3.0, 0.0, (0.12, 0.07, 0.04)),
        (2.4, 4.0, 1.6, (0.03, 0.11, 0.05)),
        (1.9, 3.6, 4.0, (0.04, 0.13, 0.05)),
        (1.3, 3.2, 6.4, (0.05, 0.15, 0.06)),
    ):
        top = 0.15 if foot == 0.0 else 0.0
        bpy.ops.mesh.primitive_cone_add(
            vertices=12, radius1=radius, radius2=top, depth=tall, location=(0, 0, foot + tall / 2)
        )
        obj = bpy.context.active_object
        material = bpy.data.materials.new("Own bark" if foot == 0.0 else "Own needles")
        shader = next(n for n in material.node_tree.nodes if n.type == 'BSDF_PRINCIPLED')
        shader.inputs["Base Color"].default_value = (*color, 1.0)
        obj.data.materials.append(material)
        parts.append(obj)
    for part in parts:
        part.select_set(True)
    bpy.context.view_layer.objects.active = parts[0]
    bpy.ops.object.transform_apply(location=True)
    bpy.ops.object.join()
    tree = bpy.context.active_object
    tree.name = "My Tree"
    scene.cursor.location = (0.0, 0.0, 0.0)
    bpy.ops.object.origin_set(type='ORIGIN_CURSOR')
    return tree


TUTORIALS = {
    "own_ground": own_ground,
    "biome": biome,
    "grown_forest": grown_forest,
    "real_place": real_place,
    "own_trees": own_trees,
    "film": film,
}
