# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading a species file: every key with its type and allowed range, every mistake named.

`docs/species.md` is written from the fields of `Order` and of the leaves.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from .. import formats
from ..errors import SpeciesError, quoted
from ..files import beside, parse_json, read_whole
from ..leaves.schema import read_forms
from ..parameters import FileReader, Rgb, keys_of
from .members import expected_polygons
from .skeletons import MAX_ORDERS
from .species import DAYS, LEAF_KINDS, MAX_AUTUMN, Ages, Bud, Dead, Ecology, LeafYear, Order, Species, Year

MAX_FILE_BYTES = 4_000_000
MAX_POLYGONS = 20_000_000
LENGTH_HIGH = 20.0
"""Highest length of a branch after order 0, of its parent's length."""
ORDER_KEYS = keys_of(Order)
SPECIES_KEYS = (
    "format", "name", "description", "orders", "bark", "quality", "habit", "stand_leaves", "exact", "leaf",
    "leaf_transmission", "blossom", "blossom_transmission", "spur", "bud", "dead", "year", "age",
    "ecology",
)  # fmt: skip
_DEFAULTS = beside(__file__, "defaults.json")
#: The short shoot of a species that asks for some and describes none.
DEFAULT_SPUR: dict[str, Any] = _DEFAULTS["spur"]


def _read_order(reader: FileReader, data: Any, where: str, first: bool, last: bool) -> Order:
    order = reader.read(Order, data, where)
    if not first:
        reader.range(list(order.length), f"{where}.length", ORDER_KEYS["length"].low, LENGTH_HIGH)
    if last and order.branches.high > 0:
        raise reader.fail(
            f"{where}.branches", "must be [0, 0], because no order follows; add an order to describe these branches"
        )
    if order.leaf_envelope != "none" and order.forks.high > 0:
        raise reader.fail(f"{where}.leaf_envelope", 'must be "none", because the branch forks; or set forks to [0, 0]')
    return order


def _read_dead(reader: FileReader, data: Any, name: str) -> Dead:
    """The key ``dead`` of a species; one that only says how many has them broken off or bare, with bare twigs."""

    def read_orders(value: Any, name: str) -> tuple[Order, ...]:
        if not isinstance(value, list) or not 1 <= len(value) <= 2:
            raise reader.fail(name, "must be a list of 1 or 2 orders: dead branches, and twigs on them")
        last = len(value) - 1
        return tuple(_read_order(reader, one, f"{name}[{i}]", False, i == last) for i, one in enumerate(value))

    whole = {"orders": _DEFAULTS["dead"], **data} if isinstance(data, dict) else data
    dead = reader.read(Dead, whole, name, {"orders": read_orders})
    for i, order in enumerate(dead.orders):
        for key in ("leaves", "spurs", "forks", "flare", "pipe"):
            value = getattr(order, key)
            if (value if isinstance(value, float) else value.high) > 0:
                raise reader.fail(f"{name}.orders[{i}].{key}", "must be 0: dead branches are bare and do not grow")
    return dead


def _read_leaf_year(reader: FileReader, data: Any, name: str) -> LeafYear:
    def colors(value: Any, name: str) -> tuple[Rgb, ...]:
        if not isinstance(value, list) or len(value) > MAX_AUTUMN:
            raise reader.fail(name, f"must be a list of up to {MAX_AUTUMN} colors [r, g, b]")
        return tuple(reader.rgb(one, f"{name}[{i}]") for i, one in enumerate(value))

    year = reader.read(LeafYear, data, name, {"autumn": colors})
    reader.number(year.turn, f"{name}.turn", year.appear, year.appear + DAYS)
    reader.number(year.fall, f"{name}.fall", year.turn, year.appear + DAYS)
    return year


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
        raise reader.fail("species", f"must be an object {{…}}, not {quoted(data)}")
    if "format" in data:
        try:
            data = formats.newest("species", data, data["format"])
        except ValueError as error:
            raise reader.fail("format", str(error)) from None
    reader.keys(data, "", SPECIES_KEYS)
    for key in ("format", "name", "orders", "leaf"):
        if key not in data:
            raise reader.fail(key, "missing; add this key")
    orders = data["orders"]
    if not isinstance(orders, list) or not 1 <= len(orders) <= MAX_ORDERS:
        found = len(orders) if isinstance(orders, list) else quoted(orders)
        raise reader.fail("orders", f"must be a list of 1 to {MAX_ORDERS} orders, has {found}")
    read = tuple(_read_order(reader, o, f"orders[{i}]", i == 0, i == len(orders) - 1) for i, o in enumerate(orders))
    spur = None
    if "spur" in data or any(order.spurs.high > 0 for order in read):
        spur = _read_order(reader, data.get("spur", DEFAULT_SPUR), "spur", True, True)
        for key in ("spurs", "forks"):
            if getattr(spur, key).high > 0:
                raise reader.fail(f"spur.{key}", "must be [0, 0], because a short shoot has only leaves")
    parts: dict[str, Callable[[Any, str], Any]] = {
        "bud": partial(reader.read, Bud),
        "dead": partial(_read_dead, reader),
        "year": partial(reader.read, Year, readers=dict.fromkeys(LEAF_KINDS, partial(_read_leaf_year, reader))),
        "age": partial(reader.read, Ages),
        "ecology": partial(reader.read, Ecology),
    }
    others = {name: part(data[name], name) for name, part in parts.items() if data.get(name) is not None}
    values = reader.values(Species, data, "")
    others |= {name: read_forms(reader, data[name], name) for name in LEAF_KINDS if name in data}
    species = Species(identifier=identifier, orders=read, spur=spur, ages=others.pop("age", None), **values, **others)
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
        data = parse_json(content)
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
