# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The shipped biomes, each on a hectare of its own land: at eye height and from above, in summer and in winter.

    python -m examples.biomes                        # docs/images/biomes*.jpg, from pictures that are in out/biomes
    python -m examples.biomes beech_fern meadow      # renders these into out/biomes first
    python -m examples.biomes --all --pictures       # all of them, and their small pictures for menus

Around the hectare there is more of the same land, with the trees of the biome and without what covers the ground.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Vector
from PIL import Image

from devtools import session

from . import stage
from .close_ups import render
from .haze import add_haze
from .paper.pictures import save_jpeg, save_sheet
from .seasons import LOOKS, Rgb, sky
from .wood import grid

if TYPE_CHECKING:
    from tetflora_addon.blender.biomes.adding import BiomeResult
    from tetflora_addon.blender.biomes.files import Biome

ROOT = Path(__file__).resolve().parent.parent
SHIPPED = ROOT / "tetflora_addon" / "biomes"
SIZE, SAMPLES = (480, 300), 48
#: Of the sheets: pixels of a picture, pictures in a row, and files by season.
CELL, COLUMNS, SHEETS = 330, 4, {"summer": "biomes.jpg", "winter": "biomes_winter.jpg"}
#: Pictures for menus: pixels, and bytes at most.
SMALL, LARGEST = (320, 200), 20_000
#: Side of all land, meters.
_LAND = 460.0
#: Fraction below which space counts as hidden: through grass one sees far.
_HIDDEN = 0.004
#: How much of soil is hidden where it is green, as its material has it.
_GREEN = 0.85
#: Height from which on what covers the ground is in a camera's way, meters.
_KNEE = 0.75
#: Sine of the height of the sun that lights land far away, about the middle of the views.
_SUN = 0.67


@dataclass(frozen=True)
class View:
    """From where a biome is seen, and in which light.

    Attributes
    ----------
    eye, ahead : tuple of float
        x, y and height over the ground, of the camera and of what is in the middle of the picture; meters.
    sun : tuple of float
        Height over the horizon and azimuth where the light comes from, from north to the east; degrees.
    gray : float
        Mean that the exposure aims at.
    haze : tuple
        As of `seasons.Look`.
    light : float
        Of the sun and the sky over that of open land: woods are longer exposed.
    free : float
        Meters in front of the camera without trees and shrubs; 0 for a camera that stands where it is told.
    beside : str
        A biome whose low plants cover the ground that this one leaves.
    water : float
        Of a brook in the valley, meters over its bed; 0 for none.
    snow : bool
        Whether winter brings it.
    """

    eye: tuple[float, float, float] = (0.0, -42.0, 1.65)
    ahead: tuple[float, float, float] = (0.0, 0.0, 3.0)
    lens: float = 28.0
    sun: tuple[float, float] = (48.0, 236.0)
    tint: Rgb = (1.0, 0.94, 0.84)
    gray: float = 0.34
    haze: tuple[float, Rgb] = (0.0004, (0.5, 0.62, 0.8))
    clouds: float = 0.5
    light: float = 1.0
    free: float = 6.0
    beside: str = ""
    water: float = 0.0
    snow: bool = True


_COOL, _GOLD = (1.0, 0.95, 0.88), (1.0, 0.86, 0.66)
_CLEAR = (0.0002, (0.4, 0.5, 0.5))
VIEWS = {
    "alpine_treeline": View((-34.0, -26.0, 1.8), (18.0, 2.0, 3.0), 24.0, (38.0, 215.0), gray=0.42, clouds=0.6),
    "beech_fern": View(
        (-7.0, 1.5, 1.6), (10.0, 35.0, 2.6), 26.0, (56.0, 215.0), gray=0.46, haze=_CLEAR, light=2.2, free=0.0
    ),
    "birch_pine": View((0.0, -42.0, 1.6), (4.0, 0.0, 4.6), 26.0, (36.0, 240.0), _GOLD, gray=0.38),
    "dead_forest": View((12.5, 29.5, 1.6), (2.6, -14.4, 4.5), 26.0, (32.0, 245.0), gray=0.44, clouds=0.8, free=0.0),
    "hedgerow": View((-45.0, -12.0, 1.75), (0.0, 1.0, 2.4), 28.0, (34.0, 200.0), _COOL, gray=0.42, beside="meadow"),
    "meadow": View((0.0, -44.0, 1.5), (4.0, 0.0, 1.7), 34.0, (42.0, 245.0), gray=0.44),
    "mediterranean_scrub": View(
        (0.0, -44.0, 1.7), (2.0, 0.0, 2.2), 28.0, (46.0, 240.0), _COOL, gray=0.44, clouds=0.3, snow=False
    ),
    "oak_savanna": View((0.0, -46.0, 1.9), (2.0, 0.0, 3.0), 34.0, (24.0, 245.0), _GOLD, gray=0.42),
    "park": View((0.0, -46.0, 1.65), (0.0, 0.0, 4.0), 28.0, (40.0, 240.0), gray=0.42),
    "riparian_willow": View(
        (44.0, -12.0, 2.2),
        (8.0, 4.0, 3.2),
        24.0,
        (44.0, 200.0),
        gray=0.42,
        free=7.0,
        beside="meadow",
        water=0.3,
    ),
    "spruce_forest": View(
        (-25.0, -17.0, 1.6), (5.0, 10.0, 3.0), 26.0, (54.0, 215.0), gray=0.44, haze=_CLEAR, light=2.2, free=0.0
    ),
    "tropical_understory": View(
        (0.0, -38.0, 1.6),
        (0.0, 0.0, 4.2),
        24.0,
        (62.0, 220.0),
        gray=0.42,
        haze=_CLEAR,
        light=2.0,
        snow=False,
    ),
}
#: Names of the two cameras, and the height of winter's sun at most, degrees.
EYE, FROM_ABOVE = CAMERAS = "Eye", "From Above"
WINTER_SUN = 16.0
#: From where most of the hectare is seen from above, without its border, as `View.eye` and `View.ahead`, the lens and
#: the exposure's mean.
ABOVE, BELOW, ABOVE_LENS, ABOVE_GRAY = (0.0, -95.0, 105.0), (0.0, 0.0, 0.0), 64.0, 0.37


#: The picture of the README: the wood of birches and pines against a low sun.
INTERIOR = replace(
    VIEWS["birch_pine"],
    eye=(-9.5, -45.5, 1.6),
    lens=30.0,
    sun=(20.0, 24.0),
    gray=0.43,
    haze=(0.0009, (0.75, 0.68, 0.5)),
    free=0.0,
)
INTERIOR_SIZE, INTERIOR_SAMPLES = (1600, 900), 48


def build(identifier: str, view: View) -> None:
    """Fill an empty scene with a biome, its land, sun and sky."""
    from tetflora_addon.blender.biomes import adding
    from tetflora_addon.blender.placing.rules import biomes_in
    from tetflora_addon.blender.worker import run_to_end

    scene = bpy.context.scene
    biome = read(identifier)
    land = adding.make_land(scene, biome.ground)
    if view.beside:
        other = read(view.beside)
        add(scene, replace(other, layers=[o for o in other.layers if o["kind"] == "cover"]), land)
    added = add(scene, biome, land)
    around = _around(biome)
    scene.collection.objects.link(around)
    tall = [layer for layer in biome.layers if layer["kind"] != "cover"]
    if tall:
        seen = {"earth": _from_afar(scene, land), "turf_share": 0.0}
        far = replace(biome, layers=tall, ground={**biome.ground, **seen}, species=biome.species)
        add(scene, far, around)
    else:
        around.data.materials.append(land.data.materials[0])
    if view.beside:
        run_to_end(adding.plant_biome_steps(scene, bpy.context.evaluated_depsgraph_get(), biomes_in(scene)[0]))
    if view.water:
        _brook(scene, biome, view)
    print(identifier, ", ".join(f"{name} {number:,}" for name, number in added.layers), *added.bare, flush=True)
    around.name, scene.tetflora.hidden = "Ground", _HIDDEN

    def on_land(place: tuple[float, float, float]) -> Vector:
        return Vector((*place[:2], place[2] + float(adding.heights(*np.array(place[:2]), biome.ground))))

    stage.camera(scene, on_land(_clear(scene, view)), on_land(view.ahead), lens=view.lens, near=0.05).name = EYE
    above = on_land((*BELOW[:2], ABOVE[2])) + Vector((*ABOVE[:2], 0.0))
    stage.camera(scene, above, on_land(BELOW), lens=ABOVE_LENS).name = FROM_ABOVE


def _covers(scene: bpy.types.Scene) -> Iterator[tuple[Any, list[Any]]]:
    """Plants of covers as `Seeds`, and the `Crown` of each of their species."""
    from tetflora_addon.blender.attributes import world_matrix
    from tetflora_addon.blender.placing.canopy import is_cover
    from tetflora_addon.blender.scene.crowns import crown_for
    from tetflora_addon.blender.scene.fields import fields_of, read_field

    depsgraph = bpy.context.evaluated_depsgraph_get()
    covers = {population.uid for population in scene.tetflora.layers if is_cover(population)}
    for field in fields_of([obj for obj in scene.objects if obj.tetflora.population in covers]):
        read = read_field(field, depsgraph, world_matrix(field, depsgraph)[None])
        yield read, [crown_for(scene, kind) for kind in read.identifiers]


def _from_afar(scene: bpy.types.Scene, land: bpy.types.Object) -> list[float]:
    """Mean color of the land with what covers it, linear RGB: as land of which nobody sees the blades.

    A deep layer of leaves shades itself: what it returns follows from the albedo of one leaf by the two-stream
    approximation (J. A. Coakley and P. Chylek, Journal of the Atmospheric Sciences 32, 1975).
    """
    hidden, color = 0.0, np.zeros(3)
    for read, crowns in _covers(scene):
        seen = np.array([crown.seen for crown in crowns])[read.species] * read.scale**2
        hidden += seen.sum()
        color += seen @ np.array([crown.color for crown in crowns])[read.species]
    absorbed = np.sqrt(1.0 - color / max(hidden, 1e-9))
    layer = (1.0 - absorbed) / (1.0 + 2.0 * _SUN * absorbed)
    bare = np.exp(-hidden / (land.dimensions.x * land.dimensions.y))
    return (bare * np.array(_mean(land)) + (1.0 - bare) * layer).tolist()


def _clear(scene: bpy.types.Scene, view: View) -> tuple[float, float, float]:
    """The place nearest to that of a view from which no plant stands close in the picture."""
    if not view.free:
        return view.eye
    from tetflora_addon.blender.placing.canopy import canopy_of

    canopy, _ = canopy_of(scene, bpy.context.evaluated_depsgraph_get())
    plants, reach = [canopy.position[:, :2]], [view.free + 0.3 * canopy.radius]
    for read, crowns in _covers(scene):
        high = np.array([crown.height for crown in crowns])[read.species] * read.scale
        plants.append(read.position[high > _KNEE, :2])
        reach.append(2.2 * high[high > _KNEE])
    plants, reach = np.concatenate(plants), np.concatenate(reach)
    near = np.hypot(*(plants - view.eye[:2]).T) < 30.0
    plants, reach = plants[near], reach[near]
    along = np.array(view.ahead[:2]) - view.eye[:2]
    along /= np.linalg.norm(along)
    side = np.arange(-10.0, 10.1, 0.5)
    places = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    places = places[np.argsort(np.hypot(*places.T), kind="stable")] + view.eye[:2]
    best = {}
    for place in places:
        away = plants - place
        ahead, beside = away @ along, np.abs(away @ [-along[1], along[0]])
        seen = (ahead > -0.4) & (beside < 0.75 * np.maximum(ahead, 0.0) + 0.6)
        best[tuple(place)] = (np.hypot(*away[seen].T) / reach[seen]).min(initial=9.0)
        if best[tuple(place)] >= 1.0:
            break
    x, y = max(best, key=best.__getitem__)
    return float(x), float(y), view.eye[2]


def read(identifier: str) -> Biome:
    """A shipped biome."""
    from tetflora_addon.blender.biomes import files

    return files.read_biome(SHIPPED / f"{identifier}.json")


def add(scene: bpy.types.Scene, biome: Biome, land: bpy.types.Object) -> BiomeResult:
    """Plant a biome on land."""
    from tetflora_addon.blender.biomes import adding
    from tetflora_addon.blender.worker import run_to_end

    bpy.context.view_layer.update()
    return run_to_end(adding.add_biome_steps(scene, bpy.context.evaluated_depsgraph_get(), biome, [land]))


def _around(biome: Biome) -> bpy.types.Object:
    """The same land around the hectare, with the same corners along its border: nothing shows between the two."""
    from tetflora_addon.blender.biomes import adding

    mesh, _, _ = grid("Ground", _LAND, adding.STEP, adding.SIDE, lambda x, y: adding.heights(x, y, biome.ground))
    around = bpy.data.objects.new("Ground", mesh)
    around.tetflora.is_occluder = True
    return around


def _brook(scene: bpy.types.Scene, biome: Biome, view: View) -> None:
    """Water in the bed of a valley, which falls as the bed does."""
    from tetflora_addon.blender.biomes import adding
    from tetflora_addon.blender.compat import shader_tree

    along = np.linspace(-0.5 * _LAND, 0.5 * _LAND, 300)
    middle = adding.brook(along)
    bed = adding.heights(along, middle, biome.ground) + view.water
    points = np.concatenate([np.stack([along, middle + side, bed], axis=1) for side in (-4.0, 4.0)])
    first = np.arange(len(along) - 1)
    faces = np.stack([first, first + 1, first + len(along) + 1, first + len(along)], axis=1)
    mesh = bpy.data.meshes.new("Brook")
    mesh.from_pydata(points.tolist(), [], faces.tolist(), shade_flat=False)
    water = bpy.data.materials.new("Water")
    surface = next(n for n in shader_tree(water).nodes if n.type == 'BSDF_PRINCIPLED')
    surface.inputs["Base Color"].default_value = (0.012, 0.02, 0.016, 1.0)
    surface.inputs["Roughness"].default_value = 0.06
    mesh.materials.append(water)
    scene.collection.objects.link(bpy.data.objects.new("Brook", mesh))


def _mean(land: bpy.types.Object) -> list[float]:
    """Mean color of a land's soil with the green on it, linear RGB."""
    nodes = land.data.materials[0].node_tree.nodes
    image, tint = nodes["Soil Map"].image, np.array(nodes["Soil Green"].outputs[0].default_value[:3])
    pixels = np.zeros(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    shown, green = np.split(pixels.reshape(-1, 4).astype(np.float64), [3], axis=1)
    soil = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    return (soil + _GREEN * green * (tint - soil)).mean(axis=0).tolist()


def dress(scene: bpy.types.Scene, view: View, camera: str, season: str) -> float:
    """Look through a camera in a season, whose light it gets; the mean that the exposure aims at."""
    look, year, eye = LOOKS[season], scene.tetflora.year, camera == EYE
    scene.camera = scene.objects[camera]
    for old in [o for o in scene.objects if o.type == 'LIGHT' or o.name.startswith("Haze")]:
        bpy.data.objects.remove(old)
    year.enabled, year.day, year.snow = season != "summer", look.day, look.snow * view.snow
    light, snowy = view.light if eye else 1.0, year.enabled and view.snow
    high, tint = (min(view.sun[0], WINTER_SUN), look.tint) if snowy else (view.sun[0], view.tint)
    stage.sun(scene, high, view.sun[1] - 180.0, 5.0 * light, tint, 0.8)
    scene.world = sky(replace(look, clouds=view.clouds, strength=look.strength * light))
    if eye:  # from above, what air adds over 140 m would veil the dark crowns
        add_haze(scene, *view.haze)
    return look.gray if snowy else view.gray if eye else ABOVE_GRAY


def render_views(identifier: str, folder: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES) -> list[Path]:
    """Those of the pictures of one biome that a folder has not; at eye height and from above, in both seasons."""
    cases = {(season, camera): _picture(folder, identifier, season, camera) for season in SHEETS for camera in CAMERAS}
    missing = {case: path for case, path in cases.items() if not path.exists()}
    if missing:
        session.clean_file()
        view = VIEWS.get(identifier, View())
        build(identifier, view)
        for (season, camera), path in missing.items():
            gray = dress(bpy.context.scene, view, camera, season)
            render(path, size, samples, gray=gray, beyond=0.1 if camera == EYE else 0.0)
    return list(cases.values())


def _picture(folder: Path, identifier: str, season: str, camera: str) -> Path:
    return folder / f"{identifier}-{season}-{camera.lower().replace(' ', '-')}.png"


def render_interior(path: Path) -> None:
    """Inside a wood that grew, at eye height in summer, for the README; in an empty scene."""
    build("birch_pine", INTERIOR)
    gray = dress(bpy.context.scene, INTERIOR, EYE, "summer")
    render(path, INTERIOR_SIZE, INTERIOR_SAMPLES, gray=gray, beyond=0.1)


def save_small(source: Path, identifier: str) -> Path:
    """Store a biome's picture for menus, as well as its bytes allow."""
    target = SHIPPED / f"{identifier}.jpg"
    save_jpeg(Image.open(source).convert("RGB").resize(SMALL, Image.Resampling.LANCZOS), target, LARGEST)
    return target


def render_sheets(folder: Path, pictures: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES) -> None:
    """All biomes in both seasons, a file each in a folder, from pictures; those that are missing are rendered."""
    cells = {season: [] for season in SHEETS}
    for file in sorted(SHIPPED.glob("*.json")):
        render_views(file.stem, pictures, size, samples)
        name = json.loads(file.read_text(encoding="utf-8"))["name"]
        for season in SHEETS:
            texts = zip(CAMERAS, (name, "from above"), strict=True)
            cells[season] += [(_picture(pictures, file.stem, season, camera), text) for camera, text in texts]
    for season, target in SHEETS.items():
        save_sheet(cells[season], COLUMNS, folder / target, CELL)


def main() -> int:
    """Render the sheet of the documentation, or some pictures."""
    parser = stage.words(__doc__, ROOT / "out" / "biomes", SIZE, SAMPLES)
    parser.add_argument("biomes", nargs="*", help="render these")
    parser.add_argument("--all", action="store_true", help="render all")
    parser.add_argument("--pictures", action="store_true", help="store pictures for menus beside the biomes")
    parser.add_argument("--no-sheet", action="store_true")
    arguments = parser.parse_args()
    session.start()
    arguments.out.mkdir(parents=True, exist_ok=True)
    size = stage.size_of(arguments, SIZE)
    wanted = [file.stem for file in sorted(SHIPPED.glob("*.json"))] if arguments.all else arguments.biomes
    for identifier in wanted:
        for old in arguments.out.glob(f"{identifier}-*.png"):
            old.unlink()
        picture, *_ = render_views(identifier, arguments.out, size, arguments.samples)
        if arguments.pictures:
            print(save_small(picture, identifier))
    if not arguments.no_sheet:
        render_sheets(ROOT / "docs" / "images", arguments.out, size, arguments.samples)
    return 0


if __name__ == "__main__":
    sys.exit(main())
