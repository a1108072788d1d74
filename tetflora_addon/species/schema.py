# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading a species file: every key with its type and allowed range, every mistake named.

The tables below are the reference of the file format; `docs/species.md` is written from them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import SpeciesError, shown
from ..files import json_of, read_whole
from ..leaves.schema import read_forms
from .ecology import read_ecology
from .extras import read_ages, read_bud, read_dead
from .members import expected_polygons
from .reader import FileReader
from .skeletons import MAX_ORDERS
from .species import BARKS, CROWN_SHAPES, LEAF_ENVELOPES, LEAF_INCLINATIONS, LEAF_KINDS, Order, Species
from .year import read_year

FORMAT = 1
MAX_FILE_BYTES = 4_000_000
MAX_POLYGONS = 20_000_000
LENGTH_HIGH = 20.0
"""Highest length of a branch after order 0, of its parent's length."""


@dataclass(frozen=True)
class Key:
    """One key of an order: what it holds, within which range, and what it means.

    Attributes
    ----------
    kind : {'range', 'number', 'integer', 'shape', 'kind', 'envelope', 'inclination', 'colour', 'rgb'}
        A range is written ``[mean, variation]``, or as a number where it has no variation; mean − variation and mean +
        variation both have to lie in the limits.
    low, high : float
        Limits, inclusive.
    default : object
        Used where the key is absent; None means that the key must be there.
    unit, meaning : str
        For the documentation and for tooltips.
    """

    kind: str
    low: float
    high: float
    default: Any
    unit: str
    meaning: str


ORDER_KEYS: dict[str, Key] = {
    "length": Key(
        "range", 0.001, 200, None, "m for the trunk, otherwise fraction of the parent's length", "length of a branch"
    ),
    "thickness": Key(
        "range", 0.001, 1, None, "fraction of the trunk's length, or of the parent's radius", "radius at the base"
    ),
    "taper": Key("range", 0, 1, [0.3, 0], "fraction of the base radius", "radius at the tip"),
    "flare": Key("number", 0, 4, 0.0, "fraction of the radius", "extra thickness at the very base"),
    "pipe": Key(
        "number",
        0,
        4,
        0.0,
        "",
        "exponent of the pipe model, which divides the radius of a branch among its children (2 is Leonardo's rule; "
        "values below 1 count as 1); 0 makes the thickness of a child a fraction of the parent's radius there",
    ),
    "segments": Key("integer", 1, 32, 1, "", "straight segments along a branch"),
    "sides": Key("integer", 3, 64, 4, "", "faces around a branch"),
    "curvature": Key("range", -360, 360, [0, 0], "degrees", "bend along the length; positive bends towards the parent"),
    "curvature_tip": Key(
        "number", -360, 360, math.nan, "degrees", "bend of the outer half of the branch (default: same as curvature)"
    ),
    "attraction": Key(
        "range", -360, 360, [0, 0], "degrees", "turn of a level branch towards the sky; negative turns down"
    ),
    "angle": Key("range", 0, 180, [0, 0], "degrees", "angle between branch and parent, at the parent's base"),
    "angle_tip": Key("number", 0, 180, math.nan, "degrees", "the same at the parent's tip (default: same as angle)"),
    "azimuth": Key("range", -360, 360, [137.5, 10], "degrees", "rotation around the parent between branches"),
    "spray": Key("number", 0, 1, 0.0, "", "how strongly branches spread horizontally to both sides of their parent"),
    "whorl": Key("integer", 1, 12, 1, "", "branches at each node: 1 alternate, 2 opposite, 3 or more a whorl"),
    "branches": Key("range", 0, 10_000, [0, 0], "", "number of branches of the next order on each branch"),
    "branch_start": Key("range", 0, 0.99, [0.1, 0], "fraction of the length", "part at the base without branches"),
    "crown": Key("shape", 0, 0, "cylindrical", "", "how the length of child branches varies along the branch"),
    "count_by_length": Key(
        "number",
        0,
        1,
        0.0,
        "",
        "how much the number of branches and leaves decreases on shorter branches: 0 not at all, 1 in proportion",
    ),
    "forks": Key("range", 0, 8, [0, 0], "", "number of stems that the branch forks into; 0 disables forking"),
    "fork_at": Key("number", 0.05, 0.95, 0.5, "fraction of the length", "position of the first fork"),
    "fork_angle": Key("range", 0, 120, [25, 8], "degrees", "angle by which each stem turns away"),
    "fork_levels": Key("integer", 1, 4, 1, "", "number of successive forks, evenly spaced up to the tip"),
    "spurs": Key("range", 0, 10_000, [0, 0], "", "number of short shoots on each branch, as defined by spur"),
    "spur_start": Key("range", 0, 0.99, [0.1, 0], "fraction of the length", "part at the base without short shoots"),
    "leaf_kind": Key("kind", 0, 0, "leaf", "", "what grows on the branch: the leaf or the blossom of the species"),
    "leaves": Key("range", 0, 100_000, [0, 0], "", "number of leaves directly on each branch of this order"),
    "leaf_envelope": Key(
        "envelope", 0, 0, "none", "", "solid around the branch that leaves fill evenly, instead of sitting on its axis"
    ),
    "leaf_envelope_radius": Key(
        "number", 0.001, 20, 0.5, "fraction of the length", "radius of the solid; of a box half of its side"
    ),
    "leaf_inclination": Key(
        "inclination", 0, 0, "branch", "", "distribution of the angle between leaf normals and the axis of the branch"
    ),
    "leaf_whorl": Key("integer", 1, 64, 1, "", "leaves at each node: 1 alternate, 2 opposite, 3 or more a whorl"),
    "leaf_start": Key("range", 0, 0.99, [0.1, 0], "fraction of the length", "part at the base without leaves"),
    "leaf_size": Key("range", 0.0005, 20, [0.08, 0.02], "m", "length of a leaf"),
    "leaf_size_tip": Key("number", 0.05, 5, 1.0, "fraction of leaf_size", "size of leaves at the outside of the crown"),
    "leaf_size_young": Key(
        "number", 0.05, 5, 1.0, "fraction of the size", "size of young leaves, those at the ends of the branches"
    ),
    "leaf_angle": Key("range", 0, 180, [50, 15], "degrees", "angle between branch and leaf"),
    "leaf_azimuth": Key("range", -360, 360, [137.5, 20], "degrees", "rotation around the branch between leaves"),
    "leaf_light": Key("range", 0, 1, [0.5, 0], "", "how strongly leaves turn towards the sky"),
    "leaf_light_tip": Key(
        "number",
        0,
        1,
        math.nan,
        "",
        "how strongly leaves turn towards the sky at the outside of the crown (default: same as leaf_light)",
    ),
    "leaf_spray": Key("number", 0, 1, 0.0, "", "how strongly leaves spread horizontally to both sides of their branch"),
    "leaf_droop": Key("number", 0, 1, 0.0, "", "how strongly leaves hang down"),
    "branch_colour": Key("colour", 0, 1, [[0.16, 0.11, 0.07], [0.04, 0.03, 0.02]], "linear RGB", "color of the bark"),
    "leaf_colour": Key("colour", 0, 1, [[0.08, 0.19, 0.03], [0.03, 0.06, 0.01]], "linear RGB", "color of the leaves"),
    "leaf_colour_tip": Key(
        "rgb",
        0,
        1,
        None,
        "linear RGB",
        "color of leaves at the outside of the crown (default: same as leaf_colour)",
    ),
    "leaf_colour_young": Key(
        "rgb",
        0,
        1,
        None,
        "linear RGB",
        "color of young leaves, at the ends of the branches, inside the crown; those outside differ from it as other "
        "leaves do (default: same as leaf_colour)",
    ),
}

SPECIES_KEYS = (
    "format", "name", "description", "orders", "bark", "quality", "habit", "stand_leaves", "exact", "leaf",
    "leaf_transmission", "blossom", "blossom_transmission", "spur", "bud", "dead", "year", "age",
    "ecology",
)  # fmt: skip
QUALITY_LIMITS = (0.001, 1000.0)
#: The short shoot of a species that asks for some and describes none.
DEFAULT_SPUR = {"length": [0.05, 0.02], "thickness": [0.03, 0.005], "angle": [50, 15], "leaves": [4, 1]}
#: Defaults that another key of the same order gives.
FOLLOWS = {
    "curvature_tip": "curvature",
    "angle_tip": "angle",
    "leaf_light_tip": "leaf_light",
    "leaf_colour_tip": "leaf_colour",
    "leaf_colour_young": "leaf_colour",
}
#: What a key of a kind may be, where that is one of a few names.
CHOICES = {
    "shape": CROWN_SHAPES,
    "kind": LEAF_KINDS,
    "envelope": LEAF_ENVELOPES,
    "inclination": LEAF_INCLINATIONS,
}


def _read_order(reader: FileReader, data: Any, where: str, first: bool, last: bool) -> Order:
    reader.keys(data, where, ORDER_KEYS)
    values: dict[str, Any] = {}
    for name, key in ORDER_KEYS.items():
        path = f"{where}.{name}"
        if name not in data and name in FOLLOWS:
            values[name] = values[FOLLOWS[name]].mean
            continue
        value = data.get(name, key.default)
        if value is None:
            raise reader.fail(path, f"missing; must be {_expected(key)}")
        high = LENGTH_HIGH if name == "length" and not first else key.high
        readers: dict[str, Callable[[], Any]] = {
            "range": lambda value=value, path=path, key=key, high=high: reader.range(value, path, key.low, high),
            "number": lambda value=value, path=path, key=key: reader.number(value, path, key.low, key.high),
            "colour": lambda value=value, path=path: reader.colour(value, path),
            "rgb": lambda value=value, path=path: reader.rgb(value, path),
        }
        if key.kind in readers:
            values[name] = readers[key.kind]()
        elif key.kind == "integer":
            number = reader.number(value, path, key.low, key.high)
            if number != int(number):
                raise reader.fail(path, f"must be a whole number, not {shown(value)}")
            values[name] = int(number)
        else:
            values[name] = reader.choice(value, path, CHOICES[key.kind])
    if last and values["branches"].high > 0:
        raise reader.fail(
            f"{where}.branches", "must be [0, 0], because no order follows; add an order to describe these branches"
        )
    if values["leaf_envelope"] != "none" and values["forks"].high > 0:
        raise reader.fail(f"{where}.leaf_envelope", 'must be "none", because the branch forks; or set forks to [0, 0]')
    return Order(**values)


def _expected(key: Key) -> str:
    if key.kind == "range":
        return f"[mean, variation] within {key.low:g} to {key.high:g}"
    return f"a number from {key.low:g} to {key.high:g}"


def species_from_dict(data: Any, identifier: str, source: str) -> Species:
    """Check a decoded species file and turn it into a `Species`.

    Parameters
    ----------
    data : object
        What `json.load` gave.
    identifier : str
        Name by which plants refer to the species.
    source : str
        Named in errors, usually the file's path.

    Raises
    ------
    SpeciesError
        Names the source, the key and what is allowed.
    """
    reader = FileReader(source)
    if not isinstance(data, dict):
        raise reader.fail("species", f"must be an object {{…}}, not {shown(data)}")
    reader.keys(data, "", SPECIES_KEYS)
    for key in ("format", "name", "orders", "leaf"):
        if key not in data:
            raise reader.fail(key, "missing; add this key")
    if data["format"] != FORMAT or isinstance(data["format"], bool):
        raise reader.fail("format", f"must be {FORMAT} for this version of TetFlora, not {shown(data['format'])}")
    orders = data["orders"]
    if not isinstance(orders, list) or not 1 <= len(orders) <= MAX_ORDERS:
        found = len(orders) if isinstance(orders, list) else shown(orders)
        raise reader.fail("orders", f"must be a list of 1 to {MAX_ORDERS} orders, has {found}")
    read = tuple(_read_order(reader, o, f"orders[{i}]", i == 0, i == len(orders) - 1) for i, o in enumerate(orders))
    spur = None
    if "spur" in data or any(order.spurs.high > 0 for order in read):
        spur = _read_order(reader, data.get("spur", DEFAULT_SPUR), "spur", True, True)
        for key in ("spurs", "forks"):
            if getattr(spur, key).high > 0:
                raise reader.fail(f"spur.{key}", "must be [0, 0], because a short shoot has only leaves")
    species = Species(
        identifier=identifier,
        name=reader.text(data["name"], "name"),
        description=reader.text(data.get("description", ""), "description", least=0),
        orders=read,
        leaf=read_forms(reader, data["leaf"], "leaf"),
        leaf_transmission=reader.number(data.get("leaf_transmission", 0.4), "leaf_transmission", 0, 1),
        blossom=read_forms(reader, data["blossom"], "blossom") if "blossom" in data else (),
        blossom_transmission=reader.number(data.get("blossom_transmission", 0.4), "blossom_transmission", 0, 1),
        spur=spur,
        bud=read_bud(reader, data.get("bud")),
        dead=read_dead(reader, data.get("dead"), lambda order, at, last: _read_order(reader, order, at, False, last)),
        bark=reader.choice(data.get("bark", BARKS[0]), "bark", BARKS),
        quality=reader.number(data.get("quality", 1.0), "quality", *QUALITY_LIMITS),
        habit=reader.number(data.get("habit", 0.0), "habit", 0, 1),
        stand_leaves=reader.number(data.get("stand_leaves", 1.0), "stand_leaves", 0.05, 1),
        exact=reader.truth(data.get("exact", False), "exact"),
        year=read_year(reader, data.get("year")),
        ages=read_ages(reader, data.get("age")),
        ecology=read_ecology(reader, data.get("ecology")),
    )
    polygons = expected_polygons(species) * species.quality
    if polygons > MAX_POLYGONS:
        raise reader.fail(
            "orders" if species.quality <= 1 else "quality",
            f"one plant would have {polygons:.3g} polygons, the limit is {MAX_POLYGONS:.0g}; use fewer branches",
        )
    return species


def species_from_json(content: bytes | str, identifier: str, source: str) -> Species:
    """Check the text of a species file, as `species_from_dict` checks what it decodes to.

    Raises
    ------
    SpeciesError
        It is not JSON, or breaks a rule of the format.
    """
    try:
        data = json_of(content)
    except ValueError as error:
        raise SpeciesError(f"{source}: {error}") from None
    return species_from_dict(data, identifier, source)


def read_species(path: Path) -> Species:
    """Read and check one species file.

    Raises
    ------
    SpeciesError
        The file cannot be read, is not JSON, or breaks a rule of the format.
    """
    return species_from_json(species_file(path), path.stem, path.name)


def species_file(path: Path) -> bytes:
    """The content of a species file.

    Raises
    ------
    SpeciesError
        It cannot be read.
    """
    try:
        return read_whole(path, MAX_FILE_BYTES)
    except OSError as error:
        raise SpeciesError(f"{path.name}: cannot be read: {error.strerror}") from None
