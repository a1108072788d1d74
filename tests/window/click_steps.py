# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does first, by clicks that are counted; tests/window/test_clicks.py judges them."""

import bpy

STEP = 8  # pixels between two looks for a button


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

    def click(self, said, kind='UI', **keys):
        """Find a button by what Blender copies of it, and click it."""
        manager = bpy.context.window_manager
        for x, y in self._places(kind):
            manager.clipboard = ""
            self.ui.move(x, y)
            yield 0.03
            self.ui.press('C', ctrl=True, **keys)
            yield 0.03
            if said in manager.clipboard:
                break
        else:
            raise LookupError(f"there is no button for {said}")
        self.clicks += 1
        self.ui.press('LEFTMOUSE')
        yield 0.5

    def _places(self, kind):
        area = next(a for a in self.ui.window.screen.areas if a.type == ('VIEW_3D' if kind == 'UI' else kind))
        region = next(r for r in area.regions if r.type == ('UI' if kind == 'UI' else 'WINDOW'))
        across = (region.width // 3, region.width * 2 // 3)
        down = range(region.y + region.height - STEP, region.y, -STEP)
        return [(region.x + x, y) for x in across for y in down]


def autumn(hand, _scene, found):
    """The season's menu, and its item by the letter that is underlined."""
    yield from hand.click("tetflora.year.season", shift=True)
    yield from hand.key('A')
    year = bpy.context.scene.tetflora.year
    found["season"] = [year.season, year.enabled]


def own_tree(hand, _scene, found):
    """The startup's cube as a species, by a button of the Object tab."""
    yield from hand.click("ops.tetflora.use_as_species(", 'PROPERTIES')
    found["species"] = len(bpy.context.scene.tetflora.asset_species)


TASKS = {
    "autumn": autumn,
    "own_tree": own_tree,
}
