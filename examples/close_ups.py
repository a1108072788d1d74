# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Close-ups of species as an artist would frame them: leaf, twig, bark, foot, and crown.

    python -m examples.close_ups                          # docs/images/close_ups.jpg, eight species
    python -m examples.close_ups --out out/looks oak ash  # one picture for each view of these species

Every plant stands among others of its kind on covered ground, and every picture is refined for its own camera.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from math import tau
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session

from . import stage

if TYPE_CHECKING:
    from tetflora_addon.compiled.flora import Flora
    from tetflora_addon.refinement.loop import Statistics

ROOT = Path(__file__).resolve().parent.parent
SPECIES = ("oak", "scots_pine", "birch", "willow", "ash", "aspen", "beech", "spruce")
SIZE, SAMPLES = (400, 300), 24
#: Where the sun stands, degrees: above the horizon, and from north to the east; cameras look north.
ELEVATION, AZIMUTH = 42.0, 222.0
#: Other plants around the first one, and the side of the ground, meters.
_AROUND, _SIDE = 14, 50.0
#: Direction from leaves to the camera: from the south, where the sun is, and from above, as leaves face up.
_TOWARD = np.array([-0.25, -0.86, 0.44]) / np.linalg.norm([0.25, 0.86, 0.44])
#: Pixels to which shadows of hidden crowns are refined where trunks are seen.
_SHADOWS = 10.0
#: Mean of a picture that is well exposed, of its display values: of most, and of crowns before the sky.
_GRAY, _BRIGHT = 0.34, 0.5
#: Width of a picture on the sheet, pixels.
_CELL = 276
#: Strength of the sky: bright haze, which opens the shade under crowns.
_SKY = 0.9
#: Height of the breast, meters, where foresters measure girth.
_BREAST = 1.3
#: Species that stand among others, and how much so: the boughs of a spruce that stands free hide its foot.
_AMONG_OTHERS = {"spruce": 0.7}
#: Weight of how much a leaf faces the camera and the sky, in meters that it stands out.
_FACING = 1.2


class Subject:
    """One species, planted in an empty scene; each view moves the camera.

    Parameters
    ----------
    identifier : str
        Of the species.
    """

    def __init__(self, identifier: str) -> None:
        from tetflora_addon.blender.job.plant_mesh import single_seed
        from tetflora_addon.blender.species.edits import in_wood
        from tetflora_addon.compiled.flora import compile_species
        from tetflora_addon.compiled.sizes import crown_of
        from tetflora_addon.growth.axes import axes
        from tetflora_addon.growth.growth import WholeBranches, trunks
        from tetflora_addon.leaves.surfaces import Needles
        from tetflora_addon.species import catalog
        from tetflora_addon.species.ages import with_habit

        habit = _AMONG_OTHERS.get(identifier, 0.0)
        species = replace(catalog.load_species(identifier), habit=habit)
        self.planted = in_wood(bpy.context.scene, identifier, habit)
        self.identifier, self.crown = identifier, crown_of(with_habit(species, habit))
        flora = compile_species([species])
        stem = trunks(flora.rows, single_seed(identifier, 1))
        self.stem = WholeBranches(stem, axes(flora.rows, stem)), flora
        # Of a shoot full of needles, some of these are looked at.
        part = 0.5 if isinstance(flora.forms[0][0][0].shape, Needles) else 1.0
        self.size = part * max(o.leaf_size.mean for o in species.orders if o.leaves.mean > 0)
        self.leaf = face_on_leaf(flora, identifier, _TOWARD, highest=0.35)
        self._plant()

    def leaf_view(self) -> None:
        """A leaf that fills a third of the picture."""
        self._aim(self.leaf, self.leaf + _TOWARD * max(4.6 * self.size, 0.2), 55.0, blur=18.0)

    def twig_view(self) -> None:
        """A twig with its leaves."""
        away = float(np.clip(11.0 * self.size, 0.7, 1.6))
        self._aim(self.leaf - 0.1 * away * _TOWARD, self.leaf + _TOWARD * away, 50.0, blur=8.0)

    def bark_view(self) -> None:
        """The trunk at the height of the breast; its bark fills most of the picture."""
        middle, radius = self._trunk(_BREAST)
        away = np.array([-0.35, -0.94, 0.0])
        self._aim(middle, middle + away * (radius + max(3.6 * radius, 0.3)), 60.0)

    def foot_view(self) -> None:
        """Where the trunk enters the ground."""
        middle, radius = self._trunk(0.35)
        away = np.array([-0.6, -0.8, 0.0]) * max(9.0 * radius, 1.3)
        self._aim(middle, middle + away + [0.0, 0.0, 0.35 + 2.0 * radius], 45.0)

    def crown_view(self) -> None:
        """The crown in the light, from where one stands to look at it."""
        target = np.array([0.0, 0.0, 0.52 * self.crown.height])
        away = max(1.05 * self.crown.height, 2.6 * self.crown.radius)
        self._aim(target, np.array([-0.3 * away, -0.95 * away, 1.6]), 30.0)

    @property
    def views(self) -> dict[str, Callable[[], None]]:
        """The views by name."""
        return {name: getattr(self, f"{name}_view") for name in ("leaf", "twig", "bark", "foot", "crown")}

    def _trunk(self, height: float) -> tuple[NDArray[np.float64], float]:
        """Middle (3,) and radius of the trunk at a height, meters."""
        from tetflora_addon.growth.growth import radius_at

        whole, flora = self.stem
        # A twig may leave its place where a bush has no trunk so high.
        t = np.clip([height / whole.branches.length[0]], 0.0, 1.0)
        middle, _ = whole.lines.at(np.zeros(1, int), t)
        return middle[0], float(radius_at(flora.rows, whole.branches, t)[0])

    def _plant(self) -> None:
        from tetflora_addon.blender.placing import first_forest
        from tetflora_addon.blender.placing.cover import cover_steps
        from tetflora_addon.blender.worker import run_to_end

        scene = bpy.context.scene
        number = np.arange(_AROUND + 1)
        step = max(2.4 * self.crown.radius, 1.0)
        away, turn = step * np.sqrt(number), 2.399963 * number
        for i, (x, y) in enumerate(zip(away * np.cos(turn), away * np.sin(turn), strict=True)):
            if i and y < 0.0 and abs(x) < 1.2 * step:
                continue  # leaves room for the camera and the sun
            stage.plant(scene, self.planted, 1 + i, (x, y, 0.0), (turn[i] % tau) if i else 0.0)
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=60, y_subdivisions=60, size=_SIDE)
        ground = bpy.context.object
        stage.camera(scene, (0.0, -10.0, 1.6), (0.0, 0.0, 1.6), near=0.01, far=1000.0)
        stage.sun(scene, ELEVATION, AZIMUTH - 180.0)
        scene.world = first_forest.sky("Close-up sky")
        background = next(n for n in scene.world.node_tree.nodes if n.type == 'BACKGROUND')
        background.inputs["Strength"].default_value = _SKY
        bpy.context.view_layer.update()
        steps = cover_steps(scene, bpy.context.evaluated_depsgraph_get(), scene.tetflora.populate, grounds=[ground])
        run_to_end(steps)

    def _aim(
        self, target: NDArray[np.float64], eye: NDArray[np.float64], lens: float, blur: float | None = None
    ) -> None:
        """Look from one place to another; ``blur`` is the aperture of a lens that is focused on the target."""
        camera = bpy.context.scene.camera
        stage.look(bpy.context.scene, eye, target)
        camera.data.lens = lens
        camera.data.dof.use_dof = blur is not None
        camera.data.dof.focus_distance = float(np.linalg.norm(np.asarray(target) - eye))
        if blur is not None:
            camera.data.dof.aperture_fstop = blur
        bpy.context.view_layer.update()


def face_on_leaf(
    flora: Flora, identifier: str, toward: NDArray[np.float64], lowest: float = 0.0, highest: float = 0.4
) -> NDArray[np.float64]:
    """Middle (3,) of a leaf of the plant of seed 1 that stands out toward the camera and faces it and the sky.

    Parameters
    ----------
    flora : Flora
        Of that species alone.
    identifier : str
    toward : (3,) float64
        Direction from the leaf to the camera.
    lowest : float
        Meters above the ground at least.
    highest : float
        Fraction of all leaves among which it is, from below.
    """
    from tetflora_addon.blender.job.plant_mesh import single_seed
    from tetflora_addon.emission.plants import expanded_blocks

    middles, facings = [], []
    for block in expanded_blocks(flora, single_seed(identifier, 1)):
        if block.kind == "leaf":
            corners = len(flora.forms[0][0][block.form].positions)
            leaves = block.buffers.positions.astype(np.float64).reshape(-1, corners, 3)
            middle = leaves.mean(axis=1)
            # The blade is thinnest along its normal.
            off = leaves - middle[:, None]
            normal = np.linalg.eigh(np.einsum("nci,ncj->nij", off, off))[1][:, :, 0]
            normal *= np.sign(normal[:, 2:])
            middles.append(middle)
            facings.append(normal @ (toward + [0.0, 0.0, 0.35]))
    middle, facing = np.concatenate(middles), np.concatenate(facings)
    out = middle @ (toward * [1.0, 1.0, 0.0])
    low = (middle[:, 2] > lowest) & (middle[:, 2] < np.quantile(middle[:, 2], highest))
    return middle[np.where(low, out + _FACING * facing, -np.inf).argmax()]


def render(
    path: Path,
    size: tuple[int, int] = SIZE,
    samples: int = SAMPLES,
    gray: float = _GRAY,
    beyond: float = 0.0,
    exposure: float | None = None,
) -> Statistics:
    """Refine for the camera and render; ``gray`` is the mean that the exposure aims at, where none is given.

    What is beyond the border by a fraction of the picture is as fine as the rest, where plants stand close to the eye.
    """
    from .paper.scenes import refined, rendered

    scene = bpy.context.scene
    scene.tetflora.refine_at_render = False
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    lens = scene.camera.data.lens
    scene.camera.data.lens = lens / (1.0 + beyond)
    statistics = refined(scene)
    scene.camera.data.lens = lens
    stage.film(scene, 0.55 if exposure is None else exposure)
    rendered(scene, path, samples)
    if exposure is None:
        scene.view_settings.exposure += metered(path, gray)
        bpy.data.images["Render Result"].save_render(str(path), scene=scene)
    return statistics


def metered(path: Path, gray: float) -> float:
    """Stops by which a picture is too dark, as a camera meters: views in shade are longer exposed than in the sun."""
    from PIL import Image

    mean = np.asarray(Image.open(path).convert("L")).mean() / 255.0
    return float(np.clip(2.0 * np.log2(gray / max(mean, 1e-3)), -0.7, 2.0))


def render_views(
    identifier: str,
    folder: Path,
    size: tuple[int, int] = SIZE,
    samples: int = SAMPLES,
    only: tuple[str, ...] | None = None,
) -> list[Path]:
    """Render a species in all its views; the pictures."""
    session.clean_file()
    scene, made = bpy.context.scene, []
    for name, aim in Subject(identifier).views.items():
        if only is None or name in only:
            aim()
            # Trunks stand in the shade of crowns that the camera does not see.
            scene.tetflora.shadow_cutoff = _SHADOWS if name in ("bark", "foot") else 0.0
            made.append(folder / f"{identifier}-{name}.png")
            render(made[-1], size, samples, _BRIGHT if name == "crown" else _GRAY)
    return made


def render_sheet(path: Path) -> None:
    """The views of eight species, a row each, as one picture."""
    from tetflora_addon.species.catalog import load_species

    from .paper.pictures import save_sheet

    with tempfile.TemporaryDirectory() as folder:
        cells = []
        for identifier in SPECIES:
            name = load_species(identifier).name
            cells += [(one, f"{name}: {one.stem.split('-')[1]}") for one in render_views(identifier, Path(folder))]
        save_sheet(cells, len(cells) // len(SPECIES), path, _CELL)


def main() -> int:
    """Render the sheet of the documentation, or single pictures."""
    parser = stage.words(__doc__, ROOT / "out" / "looks", SIZE, SAMPLES)
    parser.add_argument("species", nargs="*")
    parser.add_argument("--views", nargs="+", help="only these")
    arguments = parser.parse_args()
    session.start()
    if not arguments.species:
        render_sheet(ROOT / "docs" / "images" / "close_ups.jpg")
        return 0
    arguments.out.mkdir(parents=True, exist_ok=True)
    size = stage.size_of(arguments, SIZE)
    only = tuple(arguments.views) if arguments.views else None
    for identifier in arguments.species:
        for path in render_views(identifier, arguments.out, size, arguments.samples, only):
            print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
