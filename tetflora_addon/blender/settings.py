# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a scene that come from the engine: refinement with its qualities, animation, wind, the year.

Properties are generated from the engine's dataclasses, which hold their names, tooltips and ranges.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from datetime import date, timedelta
from math import degrees
from types import SimpleNamespace
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ..camera.view_cells import ViewCells
from ..errors import SceneError, quoted, readable
from ..growth.seasons import DAYS, Season
from ..growth.wind import Wind
from ..refinement.settings import QUALITIES, RefinementSettings
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
    """A property for each field of a dataclass that is declared with `setting.setting`.

    Parameters
    ----------
    settings : type
        The dataclass.
    **common
        Further options of all of them, as ``options`` and ``update``.

    Returns
    -------
    SimpleNamespace
        The properties by the fields' names, to be used as annotations of a property group.
    """
    made = SimpleNamespace()
    for f in fields(settings):
        if f.metadata:
            setattr(made, f.name, _MAKERS[type(f.default)](**{"default": f.default, **f.metadata, **common}))
    return made


def settings_in(settings: type, **common: Any) -> type:
    """A mix-in for property groups with all settings of a dataclass, as `properties_of`."""
    return type(settings.__name__, (), {"__annotations__": vars(properties_of(settings, **common))})


def with_identity(groups: Iterable[bpy.types.PropertyGroup], uid: str) -> bpy.types.PropertyGroup | None:
    """The population or biome of an identity; None where there is none."""
    return next((group for group in groups if group.uid == uid), None)


def active_in(owner: bpy.types.PropertyGroup, entries: str) -> bpy.types.PropertyGroup | None:
    """The active entry of a list of an owner; None without one."""
    found, index = getattr(owner, entries), getattr(owner, f"{entries}_index")
    return found[index] if 0 <= index < len(found) else None


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

    Scripts that write custom properties, and files of any origin, can store them past Blender's own checks, and Blender
    takes nan for any number.

    Parameters
    ----------
    owner : str
        Named in the message.

    Raises
    ------
    SceneError
        Names the setting, its value and the limits.
    """
    for prop in group.bl_rna.properties:
        if prop.type not in {'INT', 'FLOAT', 'ENUM'} or not group.is_property_set(prop.identifier):
            continue
        if prop.identifier in _OPEN:
            continue
        value = getattr(group, prop.identifier)
        if prop.type == 'ENUM':
            sound, limits = value != "", "one of the choices of its menu"
        else:
            numbers = value if getattr(prop, "is_array", False) else (value,)
            sound, limits = all(prop.hard_min <= n <= prop.hard_max for n in numbers), limits_of(prop)
        if not sound:
            raise SceneError(
                f"{readable(owner)}: {prop.name} is {quoted(value)}; it must be {limits}. Set it again in the TetFlora "
                "tab of the sidebar"
            )


_CELLS = properties_of(ViewCells)
_WIND = properties_of(Wind)
_SEASON = properties_of(Season)


def _factor(name: str, description: str, default: float) -> Any:
    """A property from 0 to 1."""
    return FloatProperty(name=name, description=description, default=default, min=0.0, max=1.0, subtype='FACTOR')


def quality_number(group: bpy.types.PropertyGroup) -> int:
    """Index of the quality whose values the settings have; the last one is that of others."""
    for number, values in enumerate(QUALITIES.values()):
        if all(abs(getattr(group, name) - value) < 1e-6 * max(value, 1) for name, value in values.items()):
            return number
    return len(QUALITIES)


def set_quality(group: bpy.types.PropertyGroup, number: int) -> None:
    """Give the settings the values of a quality; beyond the last one they stay as they are."""
    for name, value in list(QUALITIES.values())[number].items() if number < len(QUALITIES) else ():
        setattr(group, name, value)


class RefinementProperties(settings_in(RefinementSettings)):
    """Refinement settings of a scene: the engine's, quality, and the look of shells."""

    quality: EnumProperty(
        name="Quality",
        description="How fine the result is; sets Cutoff, Leaf Limit, Facet Size and Visibility Resolution",
        items=(*QUALITY_ITEMS, ('CUSTOM', "Custom", "Your own values")),
        get=quality_number,
        set=set_quality,
    )
    # The paper's shading of shells (section 7).
    shell_diffuse: _factor(
        "Diffuse (p)", "Fraction of light that shells scatter evenly (p in the paper). Smaller values are darker", 1.0
    )
    shell_gloss: _factor(
        "Gloss (s)", "Fraction of light that shells of coplanar leaves reflect as a highlight (s in the paper)", 0.04
    )
    shell_spear: FloatProperty(
        name="Sharpness (spear)",
        description="Exponent of the highlight (spear in the paper). Larger values make it smaller and brighter",
        default=7.5,
        min=0.0,
        soft_max=100.0,
        max=1000.0,
    )
    shell_roundness: _factor(
        "Roundness", "How round the contents of shells are shaded: 1 as spheres, 0 as flat discs facing the camera", 1.0
    )
    shell_variation: _factor("Variation", "Random variation of brightness between shells", 0.05)


class AnimationProperties:
    """Animation settings of a scene: what frames share, and the size of the frame cache."""

    share_frames: BoolProperty(
        name="Share Between Frames",
        description=(
            "Where the camera is animated, refine once for all frames with similar cameras, slightly finer and wider "
            "than a single one needs. A frame looks the same whichever frames are rendered before it"
        ),
        default=True,
    )
    cell_length: _CELLS.length
    cell_turn: _CELLS.turn
    kept_memory: FloatProperty(
        name="Frame Cache",
        description=(
            "Maximum size of the frame cache in gigabytes. A render keeps meshes for frames in which the camera "
            "returns; the least recently used go first. The current frame itself is not limited"
        ),
        default=1.0,
        min=0.0,
        soft_max=64.0,
        precision=1,
    )


class TetFloraWind(bpy.types.PropertyGroup):
    """Settings of the wind; all but the switch and the loop can be animated."""

    enabled: BoolProperty(
        name="Wind",
        description=(
            "Bend and sway plants, and flutter their leaves, as they are at the refined frame. Results of Refine do "
            "not move; with Refine at Render, each frame of an animation has its own"
        ),
        options=set(),
    )
    speed: _WIND.speed
    direction: _WIND.direction
    gusts: _WIND.gusts
    loop: IntProperty(
        name="Loop",
        description="Number of frames after which all movement repeats exactly; 0 for never",
        default=0,
        min=0,
        soft_max=1000,
        options=set(),
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


class TetFloraYear(bpy.types.PropertyGroup):
    """The day of the year, and the years that have passed; all but the switch can be animated."""

    enabled: BoolProperty(
        name="Seasons",
        description=(
            "Show plants as they are on a day of the year: leaves appear, grow, turn and fall. Off, it is summer. "
            "Results of Refine do not follow the day; with Refine at Render, each frame of an animation has its own"
        ),
        options=set(),
    )
    day: _SEASON.day
    latitude: _SEASON.latitude
    spread: _SEASON.spread
    snow: _SEASON.snow
    years: FloatProperty(
        name="Years",
        description=(
            "Years since planting, added to the age of every plant. Animate it to let plants grow. At 0, plants "
            "without an age of their own are full-grown"
        ),
        default=0.0,
        min=0.0,
        soft_max=200.0,
        max=10_000.0,
        step=100,
        precision=2,
    )


def season_of(scene: bpy.types.Scene) -> Season | None:
    """The season at the scene's frame, its day within one year; None without seasons."""
    group = scene.tetflora.year
    if not group.enabled:
        return None
    return Season(group.day % DAYS, group.latitude, group.spread, group.snow)


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


def begin(scene: bpy.types.Scene) -> None:
    """Give a scene that has no plants yet the quality and memory limit of the preferences, unless it has its own."""
    group, chosen = scene.tetflora, preferences()
    if chosen is None:
        return
    values = QUALITIES[chosen.new_quality]
    if not any(group.is_property_set(name) for name in values):
        set_quality(group, list(QUALITIES).index(chosen.new_quality))
    if chosen.new_memory > 0.0 and not group.is_property_set("max_memory"):
        group.max_memory = chosen.new_memory


CLASSES = (TetFloraWind, TetFloraYear)
