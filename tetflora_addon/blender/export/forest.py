# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Export Forest as a job: the plants of a scene to a file of another program, whole or not at all."""

from dataclasses import dataclass
from pathlib import Path

from ...errors import TetFloraError
from ...export.forest import Forest, identifiers, written_whole
from ...export.gltf import write_gltf
from ...export.obj import write_obj
from ...jobs import Job, Progress, part_of
from ..runtime import JobData, job
from ..worker import steps_in_thread
from .gather import forest_parts, kinds_of, read_plants, variants_of
from .surfaces import with_surfaces
from .usd import ENDINGS, write_usd

#: Most variants of a species, and levels of detail of one.
MOST_VARIANTS, LEVELS = 1000, 6
#: What writes a file, by its ending; the first of each format is its own.
WRITERS = {**dict.fromkeys(ENDINGS, write_usd), ".glb": write_gltf, ".obj": write_obj}
#: Formats as choices: ending, name, and what they are for.
FORMATS = (
    (".usdc", "USD", "Houdini, Omniverse, Unreal, and back to Blender"),
    (".glb", "glTF", "Godot, Unity and the web"),
    (".obj", "OBJ", "Single plants for any program, and a table of their places"),
)


@dataclass(frozen=True)
class ExportOrder:
    """What is exported, and how."""

    path: Path
    variants: int = 8  # of each species
    levels: int = 0  # of detail, with the full plant; 0 for as many as suit each species
    polygons: int = 0  # that a level has at most; finer ones are left out. 0 for no limit
    bake: bool = True  # veins, bark and relief; otherwise textures have colors and outlines only


@dataclass(frozen=True)
class Exported:
    """What was written."""

    path: Path
    plants: int
    variants: int
    levels: tuple[dict, ...]  # figures of each level of each variant
    megabytes: float


@job("Export Forest")
def export_steps(data: JobData, order: ExportOrder) -> Job[Exported]:
    """Write all plants of the scene that render; yields progress. Closing the steps early leaves no file.

    Raises
    ------
    TetFloraError
        There are no plants, or something cannot be read or written.
    """
    writer = WRITERS.get(order.path.suffix.lower())
    if writer is None:
        raise TetFloraError(f'"{order.path.name}": choose a name that ends in {", ".join(WRITERS)}')
    with written_whole(order.path) as folder:
        yield Progress(0.0, "reading plants")
        sources, seeds = read_plants(data)
        kinds = yield from part_of(kinds_of(data, seeds, order.variants), 0.05, 0.15)
        shown = yield from part_of(variants_of(seeds, kinds, order.levels, order.polygons), 0.15, 0.65)
        textures = f"{identifiers([order.path.stem])[0]}_textures"
        given = data.scene, shown.variants, folder, textures, order.bake
        variants = yield from part_of(with_surfaces(*given), 0.65, 0.75)
        data.check()
        parts = yield from part_of(forest_parts(data, sources, seeds, shown), 0.75, 0.8)
        forest = Forest(variants, parts)
        progress = Progress(0.8, f"writing {order.path.name}")
        steps = (Progress(0.8 + 0.2 * part, progress.message) for part in writer(folder / order.path.name, forest))
        yield from steps_in_thread(steps, progress)
        size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    return Exported(order.path, len(forest), len(forest.variants), _levels(forest), size / 1e6)


def _levels(forest: Forest) -> tuple[dict, ...]:
    return tuple(
        {
            "variant": variant.name,
            "level": number,
            "polygons": level.polygons,
            "distance": round(level.distance, 2),
            "screen_size": round(level.screen_size(variant.height), 4),
            "cover_error": abs(level.cover),
            "color_error": level.color,
            "outline_px": level.outline,
        }
        for variant in forest.variants
        for number, level in enumerate(variant.levels)
    )
