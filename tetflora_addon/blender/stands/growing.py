# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grow a stand as a job, and make a field of its records: each point is a plant in one year (`scene.fields`)."""

import time
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.types import Object, PropertyGroup, Scene
from numpy.typing import NDArray

from ...arrays import Floats, quaternions
from ...compiled.recorded_sizes import Sizes, kinds_of_sizes, measure_of
from ...errors import SceneError, SpeciesError, TetFloraError
from ...jobs import Job, Progress, part_of
from ...planting.plane import Terrain, inside_any
from ...planting.site import lines_of_paths
from ...planting.wetness import HeightGrid, cell_for, height_grid, wet_ground
from ...species.species import Species
from ...stands.grow import Records, StandSettings, grow
from ...stands.site import StandSite, StandSpecies
from ..attributes import write
from ..placing.plant_objects import link_field
from ..placing.rules import digest, forms_of, zone_values, zoned
from ..placing.terrain import ground_form, read_ground
from ..runtime import JobData, is_there, job
from ..scene import fields
from ..settings import check_limits
from ..species.edits import catalog, species_for
from ..worker import call_in_thread, steps_in_thread

#: Finest cells of the ground, meters, and their most.
_FINEST, _MOST = 1.0, 500_000
_LEVEL = 0.4  # wetness of ground that is neither ridge nor valley


def _stand_site(
    ground: Terrain, climate: tuple[float, float], steepest: float, moisture: float, relief: float, fertility: float
) -> tuple[StandSite, Floats]:
    """The site of a stand, on which plants can be, and the place (2,) that its coordinates are counted from.

    By settings of `TetFloraStand`: degree days and coldest month; the largest slope, radians; and the soil.
    """
    grid, wetness = _grid(ground.triangles, relief)
    land = np.isfinite(grid.height)
    if not land.any():
        raise SceneError(
            f"The ground is too small for a stand: no square of {grid.cell:g} m of it is seen from above; use a larger "
            "mesh"
        )
    height = _whole(grid.height)
    sides = enumerate(height.shape)
    rise = [np.gradient(height, grid.cell, axis=a) if n > 1 else np.zeros_like(height) for a, n in sides]
    plantable = land & (np.hypot(*rise) <= np.tan(min(steepest, 1.57)))
    if not plantable.any():
        raise SceneError(
            f"All of the ground is steeper than Max Slope ({np.degrees(steepest):.0f}°); raise Max Slope or use "
            "another mesh"
        )
    plantable = plantable * _masks(ground, grid)
    if not plantable.any():
        raise SceneError("Vertex Group, Areas, Paths or the biome's limits leave no ground for the stand; change them")
    soil = np.full(height.shape, moisture) + relief * (wetness - _LEVEL), np.full(height.shape, fertility)
    return StandSite(0.0, 0.0, grid.cell, height, plantable, *soil, *climate), np.array([grid.west, grid.south])


def _grid(triangles: Floats, relief: float) -> tuple[HeightGrid, Floats]:
    """The ground as a grid, and how wet it is (h, w)."""
    if relief > 0.0:
        wet = wet_ground(triangles)
        return wet.grid, np.nan_to_num(wet.wetness, nan=_LEVEL)
    grid = height_grid(triangles, cell_for(triangles, _FINEST, _MOST))
    return grid, np.full(grid.height.shape, _LEVEL)


def _masks(ground: Terrain, grid: HeightGrid) -> Floats:
    """How suitable cells are (h, w), by what is drawn on the ground."""
    rows, columns = grid.height.shape
    x, y = (corner + grid.cell * (np.arange(n) + 0.5) for corner, n in ((grid.west, columns), (grid.south, rows)))
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    suitable = np.ones(len(middles))
    if ground.weight is not None:
        # Weights stand on the triangles as heights do.
        lifted = ground.triangles.copy()
        lifted[..., 2] = np.clip(ground.weight, 0.0, 1.0)
        suitable *= np.nan_to_num(height_grid(lifted, grid.cell).height).reshape(-1)
    if ground.areas:
        suitable *= inside_any(middles, ground.areas)
    paths = lines_of_paths(ground.paths)
    if paths is not None:
        suitable *= paths.nearness(middles) >= 1.0
    return suitable.reshape(rows, columns)


def _whole(height: Floats) -> Floats:
    """Heights (h, w) with what is missing beside the ground going on level."""
    out = height.copy()
    for _ in range(3):
        gaps = np.isnan(out)
        if not gaps.any():
            return out
        around = np.pad(out, 1, constant_values=np.nan)
        rows, columns = out.shape
        beside = np.stack(
            [around[1 + i : 1 + i + rows, 1 + j : 1 + j + columns] for i, j in ((0, 1), (0, -1), (1, 0), (-1, 0))]
        )
        known = ~np.isnan(beside)
        mean = np.where(known, beside, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        out = np.where(gaps & known.any(axis=0), mean, out)
    return np.where(np.isnan(out), np.nanmean(height), out)


NAME = "Stand"
#: A wood of central Europe, with shares of what is planted and of seeds.
MIXED_WOOD = {
    "beech": (3.0, 2.0), "oak": (3.0, 1.0), "birch": (3.0, 3.0), "ash": (1.0, 1.0), "hornbeam": (1.0, 1.0),
    "hazel": (0.5, 1.0),
}  # fmt: skip
#: State of a stand: what does not say how it grows, and what another does not get from it.
_STATE = {
    *("rna_type", "limits", "limits_shown", "name", "is_grown", "last_year", "plants", "grown_by", "stood_on"),
    "species_index",
}
_OWN = {*_STATE, "biome", "grounds", "species"}
_MASKS = ("vertex_group", "areas", "paths", "path_distance")
_PATIENCE = 5.0  # seconds for what the viewport will ask at once
_GROWING = (0.08, 0.85)  # fractions of the job: before, and while it grows


@dataclass(frozen=True)
class GrownStand:
    """What growing a stand made."""

    field: Object
    plants: int  # in the last year
    records: int
    years: int


def is_stand(obj: Object | None) -> bool:
    """Whether an object is a field that was grown as a stand."""
    return obj is not None and obj.tetflora.is_field and obj.tetflora.stand.is_grown


def stand_settings_now(scene: Scene, field: Object) -> str:
    """A short text that changes with the settings of a stand, for `TetFloraStand.grown_by`."""
    stand = field.tetflora.stand
    names = [p.identifier for p in stand.bl_rna.properties if p.type in {'INT', 'FLOAT', 'BOOLEAN', 'STRING'}]
    values = [getattr(stand, name) for name in names if name not in _STATE]
    values += [(entry.species, entry.planted, entry.incoming_seeds) for entry in stand.species]
    values += [one.name_full if one else "" for one in (stand.areas, stand.paths)]
    return digest(values + zone_values(scene, stand))


def copy_stand(source: PropertyGroup, target: PropertyGroup) -> None:
    """Give a stand the settings of another, and its species; a mixed forest where it has none."""
    for prop in source.bl_rna.properties:
        if prop.identifier not in _OWN:
            setattr(target, prop.identifier, getattr(source, prop.identifier))
    target.species.clear()
    known = catalog()
    rows = [(e.species, e.planted, e.incoming_seeds) for e in source.species if e.species]
    rows = rows or [(name, *shares) for name, shares in MIXED_WOOD.items() if name in known]
    for name, planted, rain in rows or [(name, 1.0, 1.0) for name in list(known)[:1]]:
        entry = target.species.add()
        entry.species, entry.planted, entry.incoming_seeds = name, planted, rain


@job("Growing the stand")
def new_stand_steps(
    data: JobData, grounds: Iterable[Object], name: str = NAME, fill: Callable[[PropertyGroup], None] | None = None
) -> Job[GrownStand]:
    """Grow a stand on meshes, by settings that a function fills in or by those of the scene for new ones.

    Closing the steps, or an error, leaves the scene as it was.

    Raises
    ------
    TetFloraError
        No ground, a species that the catalog does not have, or settings with which nothing grows.
    """
    scene, grounds = data.scene, list(grounds)
    data.add_objects(grounds)
    # The field comes first, with the settings that its plants will grow by: those of the scene may change meanwhile.
    nothing = np.zeros((0, 3)), np.zeros((0, 4)), *np.zeros((1, 0)), *np.zeros((2, 0), np.int32), ()
    field = fields.write_field(name, *nothing)
    mesh = field.data
    try:
        stand = field.tetflora.stand
        if fill is None:
            copy_stand(scene.tetflora.stand, stand)
        else:
            fill(stand)
        for obj in grounds:
            stand.grounds.add().object = obj
        grown = yield from _again_steps(data, field, grounds)
        stand = field.tetflora.stand
        stand.is_grown = True
        field.tetflora.stand_year = float(stand.years)
        field.display_type = 'BOUNDS'  # its points are plants of all years
        link_field(scene, field)
        return grown
    except BaseException:  # an error, or Esc
        if is_there(field):
            bpy.data.objects.remove(field)
        if is_there(mesh) and not mesh.users:
            bpy.data.meshes.remove(mesh)
        raise


@job("Growing the stand")
def again_steps(data: JobData, field: Object) -> Job[GrownStand]:
    """Grow a stand again by its own settings, in place of its plants; as `new_stand_steps`."""
    named = (entry.object for entry in field.tetflora.stand.grounds)
    grounds = [obj for obj in named if obj is not None and data.scene in obj.users_scene]
    data.add_objects([*grounds, field])
    return (yield from _again_steps(data, field, grounds))


def _again_steps(data: JobData, field: Object, grounds: list[Object]) -> Job[GrownStand]:
    scene, depsgraph, progress = data.scene, data.depsgraph, Progress(0.0, "Reading the ground")
    yield progress
    stand = field.tetflora.stand
    for group in (stand, *stand.species):
        check_limits(group, f'"{field.name}"')
    if not grounds:
        raise SceneError(f'"{field.name}" has no ground in this scene; select meshes and use Grow Stand')
    entries = [entry for entry in stand.species if entry.species]
    if not entries:
        raise SceneError(f'"{field.name}" has no species; add one to the list')
    members = [StandSpecies(species_for(scene, e.species), e.planted, e.incoming_seeds) for e in entries]
    names = [entry.species for entry in entries]
    climate, soil = (stand.degree_days, stand.coldest_month), (stand.moisture, stand.relief, stand.fertility)
    settings = StandSettings(**{name: getattr(stand, name) for name in StandSettings.__dataclass_fields__})
    ground = read_ground(grounds, depsgraph, **{name: getattr(stand, name) for name in _MASKS})
    ground = zoned(depsgraph, stand, grounds, ground)
    stood_on = forms_of(grounds, lambda obj: ground_form(obj, depsgraph))
    site, corner = yield from call_in_thread(progress, _stand_site, ground, climate, stand.slope_max, *soil)
    try:
        with closing(steps_in_thread(grow(site, members, settings), Progress(0.0, "Growing the stand"))) as steps:
            records = yield from part_of(steps, _GROWING[0], sum(_GROWING))
    except TetFloraError as error:
        raise SceneError(f'"{field.name}": {error}') from None
    if not len(records):
        if 0.0 < site.area * settings.density < 1e5:  # square meters by plants per hectare: fewer than ten
            raise SceneError(
                f"{site.area:.3g} m² of ground are too small for a stand of {settings.density:,.0f} plants per "
                "hectare; use a larger mesh, or raise Planted"
            )
        raise SceneError(
            "Nothing is left of the stand: no plant is 1 m tall; grow it longer, plant more, or change "
            "the species, Degree Days or Moisture"
        )
    progress = Progress(sum(_GROWING), "Measuring plants")
    columns = yield from call_in_thread(progress, _columns, records, site, corner)
    yield from steps_in_thread(_measuring([member.species for member in members], records), progress)
    data.check()
    _replace(field, names, *columns)
    last = int(records.year.max())
    group = field.tetflora
    group.stand.last_year = last
    group.stand_year = min(group.stand_year, last)
    group.stand.grown_by, group.stand.stood_on = stand_settings_now(scene, field), stood_on
    return GrownStand(field, len(records.at(last)), len(records), last)


def _measuring(species: list[Species], records: Records) -> Job[None]:
    """Compile species in the stages that the stand shows, last year first, as far as there is time."""
    end = time.monotonic() + _PATIENCE
    for shown in (records.at(records.year.max()), records):
        for number, one in enumerate(species):
            kin = shown.take(np.flatnonzero(shown.species == number))
            pair, kin = np.zeros((len(kin), 2)), (kin.height, kin.diameter, kin.crown_width, kin.crown_base, kin.dead)
            with suppress(SpeciesError):
                for kind in kinds_of_sizes(one, Sizes(*kin, pair, pair)):
                    yield Progress(sum(_GROWING), "Measuring plants")
                    if time.monotonic() > end:
                        return
                    _ = measure_of(kind).flora.samples


def _columns(records: Records, site: StandSite, corner: Floats) -> tuple[Floats, Floats, Records]:
    """Positions (n, 3) in the world and rotations (n, 4) of records."""
    position = records.position.astype(np.float64)
    lean, lying = records.lean.astype(np.float64), records.lying
    # What lies follows the ground.
    east, north = site.slope()
    cells = site.cells(position[:, 0], position[:, 1])
    length = np.maximum(np.hypot(*lean.T), 1e-9)
    rise = np.where(lying, (lean[:, 0] * east[cells] + lean[:, 1] * north[cells]) / length, 0.0)
    way = np.stack([lean[:, 0], lean[:, 1], np.where(lying, 1.0 + length * rise, 1.0)], axis=1)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    position[:, :2] += corner
    # The shortest turn from upright.
    turn = np.stack([1.0 + way[:, 2], -way[:, 1], way[:, 0], np.zeros(len(way))], axis=1)
    return position, turn / np.linalg.norm(turn, axis=1, keepdims=True), records


def _replace(field: Object, names: list[str], position: Floats, rotation: Floats, records: Records) -> None:
    """Give a field the records in place of its points."""
    other = fields.write_field(NAME, position, rotation, np.ones(len(records)), records.species, records.seed, names)
    numbers = records.height, records.diameter, records.crown_width, records.crown_base, records.dead
    columns = dict(zip(fields.NUMBERS, numbers, strict=True)) | {
        fields.OFFSET: np.pad(records.offset, ((0, 0), (0, 1)))
    }
    field.matrix_world = other.matrix_world.copy()
    _hand_over(other, field, {**columns, fields.YEAR: records.year, fields.PLANT: records.plant})
    group = field.tetflora
    forms = {entry.species: entry.skeleton for entry in group.field_species}
    group.field_species.clear()
    for name in names:
        entry = group.field_species.add()
        entry.species, entry.skeleton = name, forms.get(name)


def _hand_over(other: Object, field: Object, columns: dict[str, NDArray]) -> None:
    """Give a field the points of another, which goes, and columns of sizes."""
    for name, column in columns.items():
        write(other.data, name, column, data_type=fields.SIZE_ATTRIBUTES[name])
    old, field.data = field.data, other.data
    bpy.data.objects.remove(other)
    if not old.users:
        bpy.data.meshes.remove(old)
    field.update_tag()


def keep_year(field: Object) -> int:
    """Make a field of the plants of a history in its present year; how many there are.

    Raises
    ------
    SceneError
        It is no history, or cannot be read.
    """
    if not fields.has_history(field):
        raise SceneError(f'"{field.name}" has no years; select a stand that was grown')
    group, parts = field.tetflora, [field.data]
    points, sizes = fields.read_points(field, fields.field_kinds(field), parts), fields.read_sizes(field, parts)
    points, sizes = fields.in_year(points, sizes, fields.read_records(field, parts), group.stand_year, False)
    number = len(points.species)
    if not number:
        raise SceneError(f'"{field.name}" has no plants in this year; choose another')
    turn = quaternions(np.moveaxis(points.rotation, 2, 0))
    identity = points.species.astype(np.int32), points.seed.astype(np.int32)
    other = fields.write_field(field.data.name, points.position, turn, points.scale.mean(axis=0), *identity, ())
    # `write_field` counts from a corner near the points; here they stay in the field's own space.
    write(other.data, "position", points.position)
    _hand_over(other, field, _stored(sizes))
    field.display_type, group.seed = 'TEXTURED', 0
    fields.clear_years(field)
    return number


def _stored(sizes: Sizes | None) -> dict[str, NDArray]:
    """Attributes of sizes that say anything."""
    if sizes is None:
        return {}
    silent = fields.FIT if (sizes.fit == 1.0).all() else ""
    return {name: of for name, of in fields.size_columns(sizes).items() if of.any() and name != silent}


def animate(field: Object, first: int, last: int) -> tuple[float, float]:
    """Key the years of a history from a frame to another, evenly from 0 to the last one; returns both.

    Raises
    ------
    SceneError
        It is no history.
    """
    if not fields.has_history(field):
        raise SceneError(f'"{field.name}" has no years; select a stand that was grown')
    animation = field.animation_data
    if animation is not None and animation.action is not None and animation.action.library is not None:
        raise SceneError(f'The keys of "{field.name}" are linked from another file; make them local first')
    begin, end = 0.0, float(fields.read_records(field, [field.data]).year.max())
    group = field.tetflora
    group.stand_smooth = True
    fields.clear_years(field)
    for frame, year in ((first, begin), (last, end)):
        group.stand_year = year
        field.keyframe_insert(fields.YEAR_PATH, frame=frame)
    for curve in fields.year_curves(field):
        for point in curve.keyframe_points:
            point.interpolation = 'LINEAR'
    return begin, end
