# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a scene that come from the engine: refinement with its qualities, animation, wind, the year.

Properties are generated from the engine's dataclasses, which hold their names, tooltips and ranges.
"""

from collections.abc import Iterable
from dataclasses import fields
from datetime import date, timedelta
from math import degrees
from types import SimpleNamespace
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty

from ..camera.view_cells import ViewCells
from ..errors import SceneError, quoted, readable
from ..growth.seasons import DAYS, Season
from ..growth.wind import Wind
from ..parameters import within
from ..refinement.settings import QUALITIES, RefinementSettings
from .declare import FIXED, boolean, choice, integer, once, real
from .preferences import QUALITY_ITEMS, preferences

_MAKERS = {bool: BoolProperty, int: IntProperty, float: FloatProperty}
#: From the frame to the middle of the exposure, in times that the shutter is open, by position of the shutter.
_MIDDLE = {'START': 0.5, 'CENTER': 0.0, 'END': -0.5}

#: Seasons in the order of their months in the north, December first.
SEASONS = ("winter", "spring", "summer", "autumn")
#: For dates in panels.
MONTHS = (
    *("January", "February", "March", "April", "May", "June"),
    *("July", "August", "September", "October", "November", "December"),
)


def properties_of(settings: type, **common: Any) -> SimpleNamespace:
    """Annotations of a property group, by name, for fields that `parameters.setting` declares, with common options."""
    properties = SimpleNamespace()
    for f in fields(settings):
        if f.metadata:
            given = {"name": f.name.replace("_", " ").title(), "default": f.default, **f.metadata, **common}
            given["options"] = f.metadata.get("options", given.get("options", {'ANIMATABLE'}))
            setattr(properties, f.name, _MAKERS[type(f.default)](**given))
    return properties


def settings_in(*settings: type, only: Iterable[str] = (), **common: Any) -> type:
    """A mix-in for property groups with settings of dataclasses, those of later ones first, as `properties_of`.

    What belongs together is one setting for artists: the least and the most of something with how soft both are, and a
    direction with its spread. Each number keeps its own name for files and scripts.
    """
    properties = {name: value for one in settings for name, value in vars(properties_of(one, **common)).items()}
    properties = {name: properties[name] for name in only or properties}
    ends = {name.removesuffix("_min"): (name, f"{name[:-3]}max") for name in properties if name.endswith("_min")}
    ends |= {name.removesuffix("_spread"): (name[:-7], name) for name in properties if name.endswith("_spread")}
    for stem, names in ends.items():
        soft = tuple(name for name in (f"{stem}_falloff", f"{stem}_softness") if name in properties)
        properties[f"{stem}_range"] = _range(names, soft, {name: properties[name].keywords for name in (*names, *soft)})
    return type(settings[0].__name__, (), {"__annotations__": properties})


#: Of several numbers, by those of one: Blender knows no others for them.
SUBTYPES = {'ANGLE': 'EULER', 'DISTANCE': 'XYZ_LENGTH'}


def _range(ends: tuple[str, str], soft: tuple[str, ...], given: dict[str, dict[str, Any]]) -> Any:
    """One setting of several numbers, which are hidden; biomes blend, so their edges are soft in another way."""

    def names_for(group: bpy.types.PropertyGroup) -> tuple[str, ...]:
        return (*ends, *(soft[-1:] if getattr(group, "kind", "") == BIOME else soft[:1]))

    def store(group: bpy.types.PropertyGroup, values: Any) -> None:
        for name, value in zip(names_for(group), values, strict=True):
            if getattr(group, name) != value:
                setattr(group, name, value)

    options: dict[str, Any] = {"subtype": SUBTYPES.get(given[ends[0]].get("subtype"), 'NONE')}
    for name, outermost in (("min", min), ("max", max), ("soft_min", min), ("soft_max", max)):
        values = [one[name] for one in given.values() if name in one]
        if len(values) == len(given):
            options[name] = outermost(values)
    text = ". ".join(f"{one['name']}: {one['description']}" for one in given.values())
    for one in given.values():
        one["options"] = {'HIDDEN'}
    return FloatVectorProperty(
        name="Path" if ends[1] == "path_max" else given[ends[1]]["name"].removeprefix("Max ").removesuffix(" Spread"),
        description=text,
        size=2 + bool(soft),
        get=lambda self: tuple(getattr(self, name) for name in names_for(self)),
        set=store,
        options={'SKIP_SAVE'},
        **options,
    )


#: What a layer is: plants placed by rules, which are a cover where it says what it covers; a group of layers from a
#: file; an object whose points are plants that were grown, painted or imported.
SCATTER, BIOME, FIELD = 'SCATTER', 'BIOME', 'FIELD'


def with_identity(groups: Iterable[bpy.types.PropertyGroup], uid: str) -> bpy.types.PropertyGroup | None:
    """The population or biome of an identity; None where there is none."""
    return next((group for group in groups if group.uid == uid), None)


def rules_of(layer: bpy.types.PropertyGroup) -> bpy.types.PropertyGroup:
    """Where the settings of what grows in a layer are: in itself, or in the stand that it shows."""
    return layer if named(layer) is layer else layer.field.tetflora.stand


def named(layer: bpy.types.PropertyGroup) -> bpy.types.PropertyGroup | bpy.types.Object:
    """What has the name by which artists know a layer: itself, or the field that it shows."""
    return layer.field if layer.kind == FIELD and layer.field is not None else layer


def active_in(owner: bpy.types.PropertyGroup, entries: str) -> bpy.types.PropertyGroup | None:
    """The active entry of a list of an owner; None without one."""
    groups, index = getattr(owner, entries), getattr(owner, f"{entries}_index")
    return groups[index] if 0 <= index < len(groups) else None


def switches(name: str, description: str, properties: dict[str, Any]) -> type:
    """A mix-in with hidden Boolean properties, and one, labeled by its name, in which artists see them side by side."""
    said = [one.keywords for one in properties.values()]

    def store(group: bpy.types.PropertyGroup, bits: int) -> None:
        for number, one in enumerate(properties):
            if getattr(group, one) != bool(bits >> number & 1):
                setattr(group, one, bool(bits >> number & 1))

    for one in said:
        one["options"] = {'HIDDEN'}
    together = EnumProperty(
        name=name.replace("_", " ").title(),
        description=description,
        items=[
            (key.upper(), one["name"], one["description"], 1 << n)
            for n, (key, one) in enumerate(zip(properties, said, strict=True))
        ],
        get=lambda self: sum(getattr(self, one) << number for number, one in enumerate(properties)),
        set=store,
        options={'ENUM_FLAG', 'SKIP_SAVE'},
    )
    return type(name, (), {"__annotations__": {**properties, name: together}})


_ENDLESS = 1e30  # what Blender has for no bound is larger


def limits_of(prop: bpy.types.Property) -> str:
    """What a number has to be, for messages; angles in degrees."""
    low, high = prop.hard_min, prop.hard_max
    if prop.type == 'FLOAT' and prop.subtype == 'ANGLE':
        low, high = degrees(low), degrees(high)
    if low < -_ENDLESS:
        return "a finite number"
    return f"from {low:.6g} to {high:.6g}" if high < _ENDLESS else f"{low:.6g} or greater"


#: Choices that other extensions add; while those are absent, the default takes their place.
_OPEN = {"proxy_kind"}


def check_limits(group: bpy.types.PropertyGroup, owner: str) -> None:
    """Refuse numbers and choices that no slider and no menu gives.

    Scripts that write custom properties, and files, can store them past Blender's checks, and Blender accepts nan.

    Raises
    ------
    SceneError
        Names the owner, the setting, its value and the limits.
    """
    for prop in group.bl_rna.properties:
        if prop.type not in {'INT', 'FLOAT', 'ENUM'} or not group.is_property_set(prop.identifier):
            continue
        if prop.identifier in _OPEN or prop.is_skip_save:  # or shows others
            continue
        value = getattr(group, prop.identifier)
        if prop.type == 'ENUM':
            sound, limits = value != "", "one of the choices of its menu"
        else:
            numbers = value if getattr(prop, "is_array", False) else (value,)
            sound, limits = all(prop.hard_min <= n <= prop.hard_max for n in numbers), limits_of(prop)
        if not sound:
            told = f"{readable(owner)}: {prop.name} is {quoted(value)}"
            raise SceneError(f"{told}; it must be {limits}. Set it again in its TetFlora panel")


_CELLS = properties_of(ViewCells)
_WIND = properties_of(Wind)
_SEASON = properties_of(Season)


#: What *Expand Everything* does.
EVERYTHING = (
    "Create every polygon of every plant, for comparison. Eighty trees have about 4 million polygons; a forest does "
    "not fit into memory"
)
_SHELL = {"min": 0.0, "max": 1.0, "options": {'HIDDEN', 'ANIMATABLE'}}


def quality_number(group: bpy.types.PropertyGroup) -> int:
    """Index of the quality whose values the settings have; then that of others, and that of every polygon."""
    if group.expand_everything:
        return len(QUALITIES) + 1
    for number, values in enumerate(QUALITIES.values()):
        if all(abs(getattr(group, name) - value) < 1e-6 * max(value, 1) for name, value in values.items()):
            return number
    return len(QUALITIES)


def set_quality(group: bpy.types.PropertyGroup, number: int) -> None:
    """Give the settings the values of a quality; beyond the last one they stay as they are."""
    group.expand_everything = number > len(QUALITIES)
    for name, value in list(QUALITIES.values())[number].items() if number < len(QUALITIES) else ():
        setattr(group, name, value)


class RefinementProperties(settings_in(RefinementSettings)):
    """Refinement settings of a scene: the engine's, quality, the look of shells, and what frames share."""

    quality: choice(
        "Quality",
        "How fine the result is: Cutoff, and the sizes of leaves and facets that go with it",
        (*QUALITY_ITEMS, ('CUSTOM', "Custom", "Your own values"), ('EVERYTHING', "Every Polygon", EVERYTHING)),
        get=quality_number,
        set=set_quality,
    )
    # The paper's shading of shells (section 7), for scripts: the fraction of light scattered evenly (p), that of
    # highlights of coplanar leaves (s), their exponent (spear), how round contents look, and random variation.
    shell_diffuse: real("Shell Diffuse", "", 1.0, **_SHELL)
    shell_gloss: real("Shell Gloss", "", 0.04, **_SHELL)
    shell_spear: real("Shell Spear", "", 7.5, **{**_SHELL, "max": 1000.0})
    shell_roundness: real("Shell Roundness", "", 1.0, **_SHELL)
    shell_variation: real("Shell Variation", "", 0.05, **_SHELL)

    share_frames: boolean(
        "Share Between Frames",
        "Where the camera is animated, refine once for all frames with similar cameras, slightly finer and wider "
        "than a single one needs. A frame looks the same whichever frames are rendered before it",
        True,
    )
    cell_length: _CELLS.length
    cell_turn: _CELLS.turn


class TetFloraWind(bpy.types.PropertyGroup):
    """Settings of the wind; all but the switch and the loop can be animated."""

    enabled: boolean(
        "Wind",
        "Bend and sway plants, and flutter their leaves, as they are at the refined frame. Results of Refine do "
        "not move; with Refine at Render, each frame of an animation has its own",
        **FIXED,
    )
    speed: _WIND.speed
    direction: _WIND.direction
    gusts: _WIND.gusts
    loop: integer(
        "Loop", "Number of frames after which all movement repeats exactly; 0 for never", **within(0, 1000), **FIXED
    )


def wind_of(scene: bpy.types.Scene) -> Wind | None:
    """The wind at the scene's frame, subframe included; None without wind.

    With motion blur it is that of the middle of the exposure, from which Cycles goes back and forth by velocities. It
    does not depend on the scene's range of frames, which workers of a farm set to the frames that they render.
    """
    group = scene.tetflora.wind
    if not group.enabled or group.speed == 0.0:
        return None
    rate = scene.render.fps / scene.render.fps_base
    frame = scene.frame_current_final
    if group.loop:
        frame %= group.loop  # here, where frames are whole numbers, it is exact
    blurred = scene.render.use_motion_blur
    if blurred:
        frame += _MIDDLE[scene.render.motion_blur_position] * scene.render.motion_blur_shutter
    return Wind(group.speed, group.direction, group.gusts, frame / rate, group.loop / rate, blurred)


#: Days in the middle of the seasons of a temperate wood, in the north, as `SEASONS`; and half a year.
_MIDDLES, _HALF = (20.0, 125.0, 196.0, 293.0), 182.0


def _go_to_season(year: bpy.types.PropertyGroup, number: int) -> None:
    day = _MIDDLES[number] + (0.0 if year.latitude >= 0.0 else _HALF)
    year.enabled, year.day = True, (day - 1.0) % 365.0 + 1.0
    year.id_data.update_tag()  # as a slider does: previews and Refine Automatically listen


class TetFloraYear(bpy.types.PropertyGroup):
    """The day of the year, and the years that have passed; all but the switch can be animated."""

    enabled: boolean(
        "Seasons",
        "Show plants as they are on a day of the year: leaves appear, grow, turn and fall. Off, it is summer. "
        "Results of Refine do not follow the day; with Refine at Render, each frame of an animation has its own",
        **FIXED,
    )
    season: once.choice(
        "Season",
        "Go to the middle of a season at the latitude of the scene, and turn on Seasons",
        (
            ('WINTER', "Winter", "Bare branches of January"),
            ('SPRING', "Spring", "Fresh leaves of early May, some still growing"),
            ('SUMMER', "Summer", "Full leaves of July"),
            ('AUTUMN', "Autumn", "Leaves of late October, most of them turned"),
        ),
        get=lambda year: SEASONS.index(season_name(Season(year.day % DAYS, year.latitude))),
        set=_go_to_season,
    )
    day: _SEASON.day
    latitude: _SEASON.latitude
    spread: _SEASON.spread
    snow: _SEASON.snow
    years: real(
        "Years",
        "Years since planting, added to the age of every plant. Animate it to let plants grow. At 0, plants "
        "without an age of their own are full-grown",
        **within(0.0, 200.0, 10_000.0),
        step=100,
        precision=2,
    )


def season_of(scene: bpy.types.Scene) -> Season | None:
    """The season at the scene's frame, its day within one year; None without seasons."""
    group = scene.tetflora.year
    return Season(group.day % DAYS, group.latitude, group.spread, group.snow) if group.enabled else None


def years_of(scene: bpy.types.Scene) -> float:
    """Years that are added to the age of all plants of a scene at its frame."""
    return scene.tetflora.year.years


def date_text(day: float) -> str:
    """A day of the year as ``14 October``; days of other years are those of one year."""
    quoted = date(2001, 1, 1) + timedelta(days=int((day - 1.0) % DAYS))  # no leap year
    return f"{quoted.day} {iface(MONTHS[quoted.month - 1])}"


def season_name(season: Season) -> str:
    """``spring``, ``summer``, ``autumn`` or ``winter``: quarters of the year as meteorologists cut it."""
    north = season.latitude >= 0.0
    month = (date(2001, 1, 1) + timedelta(days=int((season.day - 1.0) % DAYS))).month
    return SEASONS[(month + (0 if north else 6)) % 12 // 3]


def most_memory(scene: bpy.types.Scene) -> float:
    """Gigabytes that Blender may take: what a script set for a scene, else the preferences' limit; 0 is automatic."""
    prefs = preferences()
    return scene.tetflora.max_memory or (prefs.max_memory if prefs is not None else 0.0)


def begin(scene: bpy.types.Scene) -> None:
    """Give a scene that has no plants yet the quality of the preferences, unless it has its own."""
    group, chosen = scene.tetflora, preferences()
    if chosen is None:
        return
    if not any(group.is_property_set(name) for name in QUALITIES[chosen.new_quality]):
        set_quality(group, list(QUALITIES).index(chosen.new_quality))
