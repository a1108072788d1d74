# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of species files and of settings: declared once, as fields of dataclasses with what they mean.

Species files are read and documented by them: the annotation of a field says how its value is written, see `KINDS`; its
default is used where the file has none. Settings carry what an interface needs: a label, a tooltip, limits, a unit.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from difflib import get_close_matches
from functools import cache
from typing import Any, NamedTuple, Self, TypeVar

from .errors import NAME, SpeciesError, quoted, readable

#: Options of lengths in meters, and of what is from 0 to 1.
LENGTH = {"subtype": 'DISTANCE', "unit": 'LENGTH'}
FACTOR = {"subtype": 'FACTOR', "min": 0.0, "max": 1.0}


def setting(default: bool | int | float, label: str, description: str, /, **options: Any) -> Any:
    """A field of a dataclass of settings; the property of the scene is made from it.

    Parameters
    ----------
    default : bool, int or float
        The field's default; its type is the property's.
    label, description : str
        Name in panels, and tooltip.
    **options
        What else Blender's properties take: ``min``, ``max``, ``soft_min``, ``soft_max``, ``step``, ``precision``,
        ``subtype``, ``unit``; and ``default``, where an artist starts with another value than the engine.
    """
    return field(default=default, metadata={"name": label, "description": description, **options})


def script_setting(default: bool | int | float, /, **options: Any) -> Any:
    """The same for what only scripts set, as its value follows from others: panels do not show it."""
    return field(default=default, metadata={"options": {'HIDDEN', 'ANIMATABLE'}, **options})


def within(low: float, soft: float | None = None, high: float | None = None) -> dict[str, Any]:
    """Options of what has a lowest value, and maybe one that dragging does not exceed, and a highest."""
    return {"min": low} | ({} if soft is None else {"soft_max": soft}) | ({} if high is None else {"max": high})


def meters(low: float, soft: float, high: float | None = None) -> dict[str, Any]:
    """The same of lengths."""
    return within(low, soft, high) | LENGTH


Rgb = tuple[float, float, float]
Declared = TypeVar("Declared")


class Range(NamedTuple):
    """A value that differs from branch to branch: uniform in mean ± variation."""

    mean: float
    variation: float = 0.0

    @property
    def low(self) -> float:
        """Smallest possible value."""
        return self.mean - self.variation

    @property
    def high(self) -> float:
        """Largest possible value."""
        return self.mean + self.variation

    def scaled(self, factor: float) -> Self:
        """The same times a factor."""
        return Range(factor * self.mean, factor * self.variation)

    def allowed(self, factor: float, key: "Key") -> float:
        """The factor, or the nearest to it that keeps a range with a mean above 0 within the limits of a key."""
        if self.high > 0:
            factor = min(factor, key.high / self.high)
        if self.low < 0:
            factor = min(factor, key.low / self.low)
        elif self.low > 0:
            factor = max(factor, key.low / self.low)
        return factor


def altered(record: Declared, **changes: Any) -> Declared:
    """`dataclasses.replace` for one whose fields are all there is to it: half of the time of an age went into that."""
    out = object.__new__(type(record))
    vars(out).update(vars(record), **changes)
    return out


class Color(NamedTuple):
    """A linear color that differs from leaf to leaf: mean ± variation, all channels together."""

    mean: Rgb
    variation: Rgb


#: How fields are written, by their annotations.
KINDS = {
    Range: "range", float: "number", int: "integer", str: "text", bool: "truth", Color: "color",
    Rgb: "rgb", Rgb | None: "rgb", tuple[float, float]: "pair",
}  # fmt: skip


@dataclass(frozen=True)
class Key:
    """What files may have for a field, and what it means."""

    #: low and high: limits, inclusive; of a pair they may be two as well, of a text they count characters. A range is
    #: written ``[mean, variation]``, or as a number where it has no variation; mean − variation and mean + variation
    #: both have to lie in the limits.
    low: Any
    high: Any
    #: meaning and unit: for the documentation and for tooltips.
    meaning: str
    unit: str = ""
    choices: tuple[str, ...] = ()  # names of which it is one
    follows: str = ""  # key of the same object whose mean is the default
    written: str = ""  # the key in files where it is not the field's name
    #: kind, default, field and needed: from the field: one of `KINDS` or ``choice``, what stands for a key that is left
    #: out, the field's name, and whether the key must be there.
    kind: str = ""
    default: Any = None
    field: str = ""
    needed: bool = False

    def of(self, one: Field) -> Self:
        """The same with what the field itself says."""
        needed = one.default is MISSING and not self.follows
        default = None if one.default is MISSING else one.default
        kind = "choice" if self.choices else KINDS.get(one.type) or one.type.__name__
        return replace(self, kind=kind, default=default, field=one.name, needed=needed)


def limited(default: Any, low: float, high: float, meaning: str, unit: str = "", **options: str) -> Any:
    """A field with its limits and meaning; ``...`` for no default. Options are those of `Key`."""
    key = Key(low, high, meaning, unit, **options)
    return field(metadata={"key": key}, **({} if default is ... else {"default": default}))


def named(default: str, names: Iterable[str], meaning: str) -> Any:
    """A field that is one of some names."""
    return field(default=default, metadata={"key": Key(0, 0, meaning, choices=tuple(names))})


def described(default: Any, meaning: str, unit: str = "", **options: str) -> Any:
    """A field without limits of its own: a text, true or false, or a color."""
    return limited(default, 0, 1, meaning, unit, **options)


@cache
def keys_of(kind: type) -> dict[str, Key]:
    """Keys of a dataclass as they are written in files."""
    keys = (one.metadata["key"].of(one) for one in fields(kind) if "key" in one.metadata)
    return {key.written or key.field: key for key in keys}


class FileReader:
    """Reads values of one file; every complaint, a `SpeciesError`, names it and the key."""

    def __init__(self, source: str) -> None:
        self.source = source

    def fail(self, key: str, problem: str) -> SpeciesError:
        """The error for a problem with a key."""
        return SpeciesError(f"{self.source}: {key}: {problem}")

    def number(self, value: Any, key: str, low: float, high: float) -> float:
        """A number within limits."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(key, f"must be a number from {low:g} to {high:g}, not {quoted(value)}")
        if not low <= value <= high:  # false for NaN as well
            raise self.fail(key, f"must be from {low:g} to {high:g}, not {quoted(value)}")
        return float(value)

    def range(self, value: Any, key: str, low: float, high: float) -> Range:
        """A range: a mean alone, or with a variation."""
        if isinstance(value, int | float) and not isinstance(value, bool):
            return Range(self.number(value, key, low, high))
        if not isinstance(value, list | Range) or len(value) != 2:
            raise self.fail(key, f"must be [mean, variation] within {low:g} to {high:g}, not {quoted(value)}")
        mean = self.number(value[0], f"{key}[0] (mean)", low, high)
        variation = self.number(value[1], f"{key}[1] (variation)", 0, high - low)
        if mean - variation < low - 1e-12 or mean + variation > high + 1e-12:
            raise self.fail(
                key,
                f"mean ± variation is {mean - variation:g} to {mean + variation:g}, must be from {low:g} to {high:g}",
            )
        return Range(mean, variation)

    def color(self, value: Any, key: str) -> Color:
        """A color with the variation of each channel."""
        form = "[[r, g, b], [variation of each]]"
        if not (
            isinstance(value, list | Color)
            and len(value) == 2
            and all(isinstance(v, list | tuple) and len(v) == 3 for v in value)
        ):
            raise self.fail(key, f"must be {form} with numbers from 0 to 1, not {quoted(value)}")
        channels = [self.range([m, v], f"{key}.{c}", 0, 1) for m, v, c in zip(*value, "rgb", strict=True)]
        return Color(tuple(c.mean for c in channels), tuple(c.variation for c in channels))

    def rgb(self, value: Any, key: str) -> tuple[float, float, float]:
        """A color."""
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise self.fail(key, f"must be [r, g, b] with numbers from 0 to 1, not {quoted(value)}")
        return tuple(self.number(v, f"{key}.{c}", 0, 1) for v, c in zip(value, "rgb", strict=True))

    def truth(self, value: Any, key: str) -> bool:
        """True or false."""
        if not isinstance(value, bool):
            raise self.fail(key, f"must be true or false, not {quoted(value)}")
        return value

    def choice(self, value: Any, key: str, choices: tuple[str, ...]) -> str:
        """One of a few names."""
        if value not in choices:
            raise self.fail(key, f"must be one of {', '.join(choices)}, not {quoted(value)}")
        return value

    def keys(self, value: Any, key: str, allowed: Mapping[str, Any] | tuple[str, ...]) -> None:
        """Refuse what is no object, and keys that are not allowed."""
        if not isinstance(value, dict):
            raise self.fail(key, f"must be an object {{…}}, not {quoted(value)}")
        for name in value:
            if name not in allowed:
                name = readable(name, NAME)
                near = get_close_matches(name.lower(), allowed, 1)
                meant = f'did you mean "{near[0]}"? Allowed' if near else "allowed"
                raise self.fail(f"{key}.{name}" if key else name, f"unknown key; {meant} keys: {', '.join(allowed)}")

    def text(self, value: Any, key: str, least: int = 1) -> str:
        """A text that people read."""
        text = readable(value) if isinstance(value, str) else ""
        if not isinstance(value, str) or len(text.strip()) < least or len(value) > 1000:
            raise self.fail(key, f"must be a string of {least} to 1000 characters, not {quoted(value)}")
        return text

    def pair(self, value: Any, key: str, low: Any, high: Any) -> tuple[float, float]:
        """Two numbers; limits are for both, or two as well."""
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise self.fail(key, f"must be a pair of numbers, [first, second], not {quoted(value)}")
        lows, highs = (limit if isinstance(limit, tuple) else (limit, limit) for limit in (low, high))
        first, second = (self.number(value[i], f"{key}[{i}]", lows[i], highs[i]) for i in (0, 1))
        return first, second

    def integer(self, value: Any, key: str, low: float, high: float) -> int:
        """A whole number within limits."""
        number = self.number(value, key, low, high)
        if number != int(number):
            raise self.fail(key, f"must be a whole number, not {quoted(value)}")
        return int(number)

    def value(self, key: Key, value: Any, where: str) -> Any:
        """What a key may have; as it is where it is none of the `KINDS`."""
        if key.kind in ("range", "number", "integer", "pair"):
            return getattr(self, key.kind)(value, where, key.low, key.high)
        if key.kind == "choice":
            return self.choice(value, where, key.choices)
        if key.kind == "text":
            return self.text(value, where, int(key.low))
        return getattr(self, key.kind)(value, where) if key.kind in KINDS.values() else value

    def values(self, kind: type, data: Mapping[str, Any], where: str) -> dict[str, Any]:
        """Values of the fields of a dataclass that have keys; of those that the file leaves out, the defaults."""
        values: dict[str, Any] = {}
        for name, key in keys_of(kind).items():
            path = f"{where}.{name}" if where else name
            if key.needed and data.get(name) is None:
                limits = f"within {key.low:g} to {key.high:g}"
                form = f"[mean, variation] {limits}" if key.kind == "range" else f"a number {limits}"
                raise self.fail(path, f"missing; must be {form}")
            if name not in data and key.follows:
                values[key.field] = values[key.follows].mean
            elif name in data or key.default is not None:
                values[key.field] = self.value(key, data.get(name, key.default), path)
        return values

    def read(
        self, kind: type[Declared], data: Any, where: str, readers: Mapping[str, Callable[..., Any]] | None = None
    ) -> Declared:
        """An object of a dataclass: fields that have keys, and those that have a reader of their own.

        Parameters
        ----------
        data : object
            What `json.load` gave.
        where : str
            Named in errors.
        readers : mapping, optional
            For each other key, what makes the value of the field of this name from the data and the key's whole name.
        """
        readers = readers or {}
        self.keys(data, where, (*keys_of(kind), *readers))
        others = {name: read(data[name], f"{where}.{name}") for name, read in readers.items() if name in data}
        rest = {name: value for name, value in data.items() if name not in readers}
        return kind(**{**self.values(kind, rest, where), **others})
