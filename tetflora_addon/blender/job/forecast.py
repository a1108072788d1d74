# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What refining a scene will take, as a line for panels; and the limit of memory in words.

Plants are counted, some of them looked at, and figures computed a moment after something has changed, and not more
often than a few hundredths of the time allow; never while a panel is drawn.
"""

from collections.abc import Generator
from contextlib import suppress
from dataclasses import replace

import numpy as np
from bpy.types import Mesh, Object, PointCloud, Scene, ViewLayer
from numpy.typing import NDArray

from ... import memory
from ...arrays import Floats, Integers
from ...compiled.recorded_sizes import CROWDED, ages_of_heights, crowds
from ...emission.budget import Estimate, Stand, estimate
from ...errors import SpeciesError, TetFloraError
from ...growth.seasons import PRESENT, expected_of
from ...jobs import run_to_end
from ...processes import pool
from ...species.kinds import Kind, species_of
from ..attributes import read, values_of
from ..runtime import Outlook, handlers, in_order
from ..scene.ages import crown_kinds
from ..scene.camera import read_camera
from ..scene.crowns import crown_to_draw
from ..scene.fields import AGE, HEIGHT, PREFIX, field_kinds, sound_ages, stored_now
from ..scene.objects import objects_within, renderable_in_parts
from ..settings import most_memory, season_of
from ..species.edits import display_height, species_for
from .contents import check_settings, memory_left, picture_bytes, settings_from

_LOOKED_AT = 2_000  # plants of each kind of storage that stand for all
_GIGA, _MEGA = memory.GIGABYTE, 1e6


_layer: tuple[int, str] | None = None  # whose stand was counted; of none where that has changed
_stand: Stand | None = None
_learned = 1.0  # what refining took here last over what was expected


def forecast(scene: Scene, view_layer: ViewLayer) -> Estimate | None:
    """What refining takes by the present settings; None without plants or usable camera, and until crowns are known."""
    return run_to_end(forecast_steps(scene, view_layer))


def forecast_steps(scene: Scene, view_layer: ViewLayer) -> Generator[None, None, Estimate | None]:
    """The same in small steps, during which nothing may change."""
    global _layer, _stand
    depsgraph, layer = view_layer.depsgraph, (scene.session_uid, view_layer.name)
    if depsgraph is None or scene.camera is None:
        return None
    if _stand is None or _layer != layer:
        _stand, _layer = (yield from _count(scene, view_layer)), layer
    if _stand is None or not len(_stand.number):
        return None
    try:
        check_settings(scene)
        camera = read_camera(scene, depsgraph, blurred=False)
    except TetFloraError:
        return None
    used = (memory.resident() or 0) + picture_bytes(scene, camera)
    processes = pool.number(memory.limit(most_memory(scene)))
    allowed = memory_left(scene, camera)
    return estimate(_stand, camera, settings_from(scene), used, allowed, scene.tetflora.expand_everything, processes)


def learn(expected: Estimate | None, seconds: float) -> None:
    """Refining took so long: this machine, its window, and the scene as it is now take as long the next time."""
    global _learned
    if expected is not None and seconds > 1.0:  # of less, half is chance
        _learned = float(np.clip(seconds / max(expected.seconds, 0.1), 0.1, 100.0))


def seconds_here(expected: Estimate) -> float:
    """Seconds that what is expected takes on this machine, as it took last."""
    return expected.seconds * _learned


def forecast_text(scene: Scene, view_layer: ViewLayer) -> str:
    """``About 12 s, 4.1 M polygons, 2.5 GB``, as found last, and in a second line what limits it; empty if unknown."""
    return _outlook.of(scene, view_layer) or ""


def _text_for(scene: Scene, view_layer: ViewLayer) -> Generator[None, None, str]:
    cost = yield from forecast_steps(scene, view_layer)
    if cost is None:
        # Plants are there, and their crowns are being looked for.
        return "" if _stand is not None or scene.camera is None else "Estimating…"
    size = cost.memory / _GIGA
    taken = seconds_text(seconds_here(cost)), polygons_text(cost.primitives), f"{size:.{int(size < 10.0)}f} GB"
    text = f"About {', '.join(taken)}"
    return f"{text}\nLimited by {cost.limit}" if cost.limit else text


def memory_text(scene: Scene) -> str:
    """``Automatic: 11.7 GB`` where the artist sets no limit of memory, else that limit."""
    if (limit := most_memory(scene)) > 0.0:
        return f"{limit:.1f} GB by the preferences"
    most = memory.limit(0.0)
    return f"Automatic: {most / _GIGA:.1f} GB" if np.isfinite(most) else "Automatic: no limit"


def seconds_text(seconds: float) -> str:
    """A time as long as one would say it: ``12 s``, ``35 s``, ``4 min``."""
    if seconds < 90.0:
        return f"{max(round(seconds), 1) if seconds < 20.0 else 5 * round(seconds / 5.0)} s"
    return f"{round(seconds / 60.0)} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def polygons_text(number: float) -> str:
    """A number of polygons in two digits, and few letters: a sidebar has room for no more."""
    number = float(f"{number:.2g}")
    size, unit = (1.0, "") if number < 1e4 else (1e3, " k") if number < _MEGA else (_MEGA, " M")
    return f"{number / size:{'g' if number < 10.0 * size else ',.0f'}}{unit} polygons"


def _count(scene: Scene, view_layer: ViewLayer) -> Generator[None, None, Stand | None]:
    single: list[Object] = []
    parts: list[tuple[int, Floats, Floats, list[str]]] = []
    for obj in renderable_in_parts(view_layer):
        yield
        group = obj.tetflora
        if group.is_plant:
            if group.enabled:
                single.append(obj)
        elif group.is_field:
            if group.enabled and len(points := stored_now(obj)):
                parts.append(_field(scene, obj, points))
        elif obj.instance_type == 'COLLECTION' and obj.instance_collection is not None:
            within = [o for o in objects_within(obj.instance_collection) if o.tetflora.is_plant]
            if within:
                parts.append(_plants(scene, within, np.array(obj.matrix_world)))
    if single:
        parts.append(_plants(scene, single, np.eye(4)))
    kinds = dict.fromkeys(kind for *_, species in parts for kind in species)
    crowns = {kind: crown_to_draw(scene, kind, prepared=True) for kind in kinds}
    if None in crowns.values():
        return None
    index = {kind: i for i, kind in enumerate(crowns)}
    rows = [(*sizes, np.array([index[kind] for kind in species], dtype=np.int64)) for *sizes, species in parts]
    left = [replace(c, parts=c.parts.with_leaves(_in_leaf(scene, identifier))) for identifier, c in crowns.items()]
    # Samples of all parts as one, of each by the root of its number: a few trees show more than much grass.
    samples: list[tuple] = [(np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64))]
    whole = sum(np.sqrt(number) for number, *_ in rows)
    for number, *values in rows:
        chosen = _even_sample(len(values[0]), max(round(_LOOKED_AT * np.sqrt(number) / whole), 1))
        samples.append((np.full(len(chosen), number / len(chosen)), *(one[chosen] for one in values)))
    return Stand(*map(np.concatenate, zip(*samples, strict=True)), tuple(left))


def _in_leaf(scene: Scene, kind: str) -> float:
    """Fraction of the leaves of a kind of plant that there are on the scene's day."""
    season = season_of(scene)
    try:
        year = None if season is None else species_for(scene, species_of(kind)).year
    except SpeciesError:
        return 1.0
    if year is None or year.leaf is None:
        return 1.0
    return float(expected_of(year.at_latitude(abs(season.latitude)).leaf, np.array([season.northern_day]), PRESENT)[0])


def _even_sample(number: int, most: int = _LOOKED_AT) -> Integers:
    return np.linspace(0, number - 1, min(number, most)).round().astype(np.int64)


def _plants(scene: Scene, plants: list[Object], carried: Floats) -> tuple[int, Floats, Floats, list[str]]:
    """How many single plants there are; feet, scales and kinds of some."""
    chosen = [plants[i] for i in _even_sample(len(plants)).tolist()]
    matrices = carried @ np.array([o.matrix_world for o in chosen], dtype=np.float64)
    scale = np.cbrt(np.abs(np.linalg.det(matrices[:, :3, :3])))
    kinds = list(dict.fromkeys(o.tetflora.species for o in chosen))
    which = np.array([kinds.index(o.tetflora.species) for o in chosen])
    ages = np.array([o.tetflora.age for o in chosen])
    return len(plants), matrices[:, :3, 3], *_aged(scene, scale, kinds, which, ages)


def _aged(scene: Scene, scale: Floats, kinds: list[str], which: Integers, ages: Floats) -> tuple[Floats, list[str]]:
    """Scales of plants and their kinds, by their ages."""
    sound = np.where(sound_ages(ages), ages, 0.0).astype(np.float64)
    named, which, taller = crown_kinds(scene, kinds, which, sound if sound.any() else None)
    return scale * taller, [named[i] for i in which.tolist()]


def _field(scene: Scene, obj: Object, points: Integers) -> tuple[int, Floats, Floats, list[str]]:
    """The same of those points (n,) of a field that are plants now, as stored: nodes are not evaluated yet."""
    kinds = [species_of(kind) for kind in field_kinds(obj)]
    number = len(points)
    chosen = points[_even_sample(number)]
    matrix = np.array(obj.matrix_world, dtype=np.float64)
    foot = read(obj.data, "position")[chosen].astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    scale, species, tall = (stored(obj.data, name, chosen) for name in ("scale", "species", HEIGHT))
    factor = np.cbrt(abs(np.linalg.det(matrix[:3, :3])))
    scale = factor * (np.ones(len(chosen)) if scale is None else scale)
    which = np.zeros(len(chosen), np.int64) if species is None else np.clip(species, 0, len(kinds) - 1).astype(np.int64)
    ages = next((a for n in (PREFIX + AGE, AGE) if (a := stored(obj.data, n, chosen)) is not None), None)
    ages = np.full(len(chosen), obj.tetflora.age) if ages is None else ages
    if tall is not None:
        known = np.isfinite(tall) & (tall > 0.0)
        ages = np.where(known, _ages_of(scene, kinds, which, tall), ages)
        scale = np.where(known, factor, scale)
    scale, species = _aged(scene, scale, kinds, which, ages)
    wide = stored(obj.data, "tf_crown_width", chosen)
    if tall is not None and wide is not None:
        species = [_beside_others(scene, *one) for one in zip(species, tall.tolist(), wide.tolist(), strict=True)]
    return number, foot, scale, species


def _beside_others(scene: Scene, kind: str, tall: float, wide: float) -> str:
    """The kind of a plant with a recorded height and width: with few leaves if its crown is as narrow as in a stand."""
    one = Kind.read(kind)
    crown = crown_to_draw(scene, one.species) if one.age and not one.dead else None
    narrow = crown is not None and 0.0 < wide * crown.height < CROWDED * tall * 2.0 * crown.radius
    return str(replace(one, crowded=True)) if narrow and crowds(species_for(scene, one.species)) else kind


def _ages_of(scene: Scene, kinds: list[str], which: Integers, tall: NDArray[np.floating]) -> Floats:
    """Ages (n,) at which plants of some kinds are so tall, about."""
    out = np.zeros(len(tall))
    for number, kind in enumerate(kinds):
        of_kind = which == number
        with suppress(SpeciesError):
            crown = crown_to_draw(scene, kind)
            full = display_height(kind) if crown is None else crown.height
            out[of_kind] = ages_of_heights(species_for(scene, kind), tall[of_kind] / full)
    return out


def stored(points: Mesh | PointCloud, name: str, chosen: Integers) -> NDArray | None:
    """An attribute of some points that is a number each; None where there is none."""
    attribute = points.attributes.get(name)
    if attribute is None or attribute.domain != 'POINT' or attribute.data_type not in {'FLOAT', 'INT'}:
        return None
    values = values_of(attribute)
    return values[chosen] if len(values) > chosen[-1] else None


def _on_change(*_: object) -> None:
    global _layer
    _layer = None


def _on_load(*_: object) -> None:
    global _stand, _learned
    _stand, _learned = None, 1.0


_HANDLERS = handlers(depsgraph_update_post=_on_change, undo_post=_on_change, redo_post=_on_change, load_post=_on_load)
#: By now crowns may be known, or memory short.
_outlook = Outlook(_text_for, old=2.0)


register, unregister = in_order(_HANDLERS, _outlook)
